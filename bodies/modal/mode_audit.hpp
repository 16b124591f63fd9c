#pragma once
// Which modes are kept, and why.
#include <Eigen/Core>
#include <vector>

#include "bodies/modal/eigen_modes.hpp"
#include "bodies/modal/modal_source.hpp"

namespace cardan {

/// 6 x m: resultants R* M x of each mode over the six rigid motions (angular about the origin first). The squares are
/// the effective masses of mass-normalised modes [kg m^2 | kg]; over all modes they add up to the rigid mass that is
/// not held.
Eigen::MatrixXd participation(const FeModel&, const FeModes&);

/// One record per mode with frequency, effective masses and the verdict of `choice`.
std::vector<ModeRecord> audit_modes(const FeModel&, const FeModes&, const ModeChoice& choice);

}  // namespace cardan
