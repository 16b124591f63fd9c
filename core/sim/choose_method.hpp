#pragma once
// The method of integration for `method = "auto"`, from what the vehicle has that is fast and how often a run is interrupted.
// docs/mathematics/integration.md, "Which method".
#include <memory>
#include <string>

#include "core/model/model.hpp"
#include "core/sim/dynamics.hpp"
#include "core/time/integrator.hpp"

namespace cardan {

struct MethodChoice {
  IntegratorOptions options;  // those that were asked for, with a method and what it needs
  std::string why;            // a sentence without its full stop
};

/// interval: [s] the shortest between two instants at which commands may change, infinite where there are none; instants at which devices
/// end steps by themselves are counted beside them. The model is looked at in its initial state: the choice is that of any resumed run too.
MethodChoice choose_method(const std::shared_ptr<const Model>& model, double interval, const IntegratorOptions& asked,
                           Dynamics dynamics = Dynamics::standard);

}  // namespace cardan
