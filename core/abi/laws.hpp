#pragma once
// The executable laws of the hinge concept: table in, list of violations out. They run in the contract tests over every
// registered family, and once for each family of a plugin when it is loaded.
#include <cstdint>
#include <string>
#include <vector>

#include "core/abi/cardan_abi.h"
#include "core/abi/law_record.hpp"
#include "core/abi/trial.hpp"

namespace cardan {

/// What is wrong with the table as such, before any of its functions is called: null pointers, absurd counts, names and
/// units that cannot be shown, a shape that does not go with nq and nv. Each is told as "member: what".
std::vector<std::string> hinge_table_faults(const cardan_hinge_family& family);

/// The faults of the table; if there are none, the laws at `samples` random parameters, coordinates (to 30 rad or m
/// either side of zero, and `zero` itself) and rates (0.1 to 10): R is a rotation; Ht v is the velocity of (R, l) along
/// qdot; Hdot_v is (d/dt Ht) v; retract and difference are inverse and consistent with qdot; qdot is
/// linear in v, and v itself where nq = nv; the functions are pure, in any
/// thread, and write what they are handed; the declared shape is what the sweeps compute by their own formulas; nothing is
/// NaN. A hinge may have a domain: where its record is not finite beyond 1 rad or m nothing is asked. Each entry names
/// the law, the error and the sample. `before` is told of each call, `record` gets what was tried.
std::vector<std::string> hinge_law_violations(
    const cardan_hinge_family& family, int samples = 40, std::uint64_t seed = 1, const TellPhase& before = [](std::string_view) {},
    LawRecord* record = nullptr);

}  // namespace cardan
