#pragma once
// Before a run: what springs, dampers and modes ask of an explicit method. docs/mathematics/integration.md, "Stiffness".
#include <memory>

#include "core/base/warnings.hpp"
#include "core/model/model.hpp"
#include "core/time/integrator.hpp"

namespace cardan {

/// What to do about a stiff scene, and where what is fast swings.
extern const char *const kStiffHint, *const kSwingHint;

/// W0401 where steps of equal length, cut at what comes every `interval` [s], are beyond the stability of the method, or one that chooses
/// its steps must take very many in `span` [s]; with the spring, damper or mode that causes it at the coordinates q, and the step that
/// works. Empty for methods that stiffness does not hold.
Warnings expected_stiffness(const std::shared_ptr<const Model>& model, const double* q, const IntegratorOptions& options, double interval,
                            double span);

}  // namespace cardan
