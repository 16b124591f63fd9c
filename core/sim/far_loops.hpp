#pragma once
// Loops whose ends are known to less than they need be.
#include "core/base/warnings.hpp"

namespace cardan {

class Simulation;

/// W0302: loops between bodies that have nothing but the world inboard of both, far from its origin for the size of the loop. Places of
/// their ends are counted from there, and rounding of these is what holds them.
Warnings loops_far_from_home(Simulation& sim);

}  // namespace cardan
