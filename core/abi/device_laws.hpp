#pragma once
// The executable laws of devices: table in, list of violations out. They run in the contract tests over every registered device, and
// once for each of a plugin when it is loaded.
#include <cstdint>
#include <string>
#include <vector>

#include "core/abi/cardan_device.h"
#include "core/abi/law_record.hpp"
#include "core/abi/trial.hpp"

namespace cardan {

/// What is wrong with the table as such, before any of its functions is called: null pointers, absurd counts, names that cannot be shown,
/// facts that do not go together.
std::vector<std::string> device_table_faults(const cardan_device_family& family);

/// It pushes its nodes against each other (CARDAN_FACT_INTERNAL) and reads no other node and no field: what it does follows from where they
/// are and how they move as seen from each other, a law. Then the host may count their places and velocities from any point that moves
/// evenly, and far from the origin of the world no digits are lost.
bool reads_between_nodes(const cardan_device_family& family);

/// The faults of the table; if there are none, the laws at `samples` random parameters, motions of the mounts, inputs and states (of their
/// nominal size): the functions are pure, on another thread too, and write nothing but what is theirs; nothing is read that the mounts do
/// not declare, nothing pushes where they do not; outputs depend on the inputs that they say; loads of an internal device sum to zero,
/// and follow from what lies between its nodes; energy' = delivered - lost - power of the loads; a passive one loses; `tangent` is the
/// derivative; what is given is finite. Each entry names the law, the error and the sample. `before` is told of each call, `record` gets
/// what was tried.
std::vector<std::string> device_law_violations(
    const cardan_device_family& family, int samples = 40, std::uint64_t seed = 1, const TellPhase& before = [](std::string_view) {},
    LawRecord* record = nullptr);

}  // namespace cardan
