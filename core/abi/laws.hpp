#pragma once
// The executable laws of the hinge concept: table in, list of violations out. They run in the contract tests over every
// registered family, and once for each family of a plugin when it is loaded.
#include <cstdint>
#include <string>
#include <vector>

#include "core/abi/cardan_abi.h"

namespace cardan {

/// Checks, at `samples` random parameters, coordinates and rates: R is a rotation; Ht v is the velocity of (R, l) along
/// qdot; Hdot_v and map_dot are derivatives of Ht; retract and difference are inverse and consistent with qdot; qdot is
/// linear in v; the declared shape is true; nothing is NaN. Each entry names the law, the error and the sample.
std::vector<std::string> hinge_law_violations(const cardan_hinge_family& family, int samples = 8,
                                              std::uint64_t seed = 1);

/// Random legal parameters of a family, packed; empty if the schema cannot be satisfied at random.
std::vector<double> random_packed(const cardan_hinge_family& family, std::uint64_t seed);

}  // namespace cardan
