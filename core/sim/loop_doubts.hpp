#pragma once
// Loops that numbers hold less well than they need be: W0302.
#include "core/base/warnings.hpp"
#include "core/dynamics/workspace.hpp"

namespace cardan {

class Simulation;

/// Loops between bodies that have nothing but the world inboard of both, far from its origin for the size of the loop. Places of their ends
/// are counted from there, and rounding of these is what holds them.
Warnings loops_far_from_home(Simulation& sim);

/// Rows that others imply and that are open by what numbers were typed with: nothing can close them.
Warnings open_rows_of_loops(const Model& model, const Eigen::VectorXd& q, const Eigen::VectorXd& v, const LoopDrive* drives);

}  // namespace cardan
