#pragma once
// The executable laws of a body: table in, list of violations out.
#include <cstdint>
#include <string>
#include <vector>

#include "core/abi/cardan_body.h"
#include "core/abi/law_record.hpp"
#include "core/abi/trial.hpp"

namespace cardan {

/// What is wrong with the table as such, as "member: what".
std::vector<std::string> body_table_faults(const cardan_body_family& family);

/// The faults of the table; if there are none, the laws at `samples` random parameters. Of a body with modes: random sets of up to five
/// modes over lumped masses, without and with rotary inertia and second-order displacements, at levels 0, 1 and 2; a set that pack
/// refuses is left out, but one in twelve must pass. There, at amplitudes of 0.01, 0.1 and 1:
/// mass and bias are finite, pure in any thread and wherever the packed parameters stand, and write what they are handed; the mass is
/// that of the modal data; M_ee is symmetric and the whole mass matrix positive definite (at 0.01, where deformations are small); M_ve is
/// the derivative of m c along eta; b is what the kinetic energy 1/2 V* M V gives by Lagrange's equations; each declared fact is true; many
/// states at once are each what they are alone, bit for bit. Of
/// two nodes, where the family tells how they move: x, S and a are finite, pure as mass and bias are, the same part by part; x = 0 at eta =
/// 0; S is the derivative of x along eta, and a that of S eta' along eta'.
/// Of a body whose mass is computed: an inertia that a body can have.
std::vector<std::string> body_law_violations(
    const cardan_body_family& family, int samples = 40, std::uint64_t seed = 1, const TellPhase& before = [](std::string_view) {},
    LawRecord* record = nullptr);

}  // namespace cardan
