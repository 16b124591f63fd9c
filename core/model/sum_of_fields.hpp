#pragma once
// Gravity of several fields: a field that is their sum.
#include <vector>

#include "core/model/model.hpp"

namespace cardan {

/// Of fields of the quantity gravity: "earth + moon". It has a potential, is steady and has gradients if all of them are and have; limits
/// are those of all, "moon: altitude", at most 31 in all.
Field sum_of_fields(const std::vector<Field>& parts);

}  // namespace cardan
