#pragma once
// The executable laws of a field: table in, list of violations out.
#include <cstdint>
#include <string>
#include <vector>

#include "core/abi/cardan_field.h"
#include "core/abi/law_record.hpp"
#include "core/abi/trial.hpp"

namespace cardan {

/// What is wrong with the table as such, as "member: what".
std::vector<std::string> field_table_faults(const cardan_field_family& family);

/// The faults of the table; if there are none, the laws at `samples` sets of random parameters, each with points at random times and places
/// at about the distance that the table tells: values and gradients are finite, pure in any thread, the same point by point as all at once,
/// and within their arrays; gradients are the derivatives of values; of gravity with a potential a = -grad U and curl a = 0; a magnetic
/// field has no divergence; a density is not negative, an attitude a unit quaternion, and each declared fact is true.
std::vector<std::string> field_law_violations(
    const cardan_field_family& family, int samples = 40, std::uint64_t seed = 1, const TellPhase& before = [](std::string_view) {},
    LawRecord* record = nullptr);

}  // namespace cardan
