#pragma once
// The fields that come with Cardan.
#include "core/abi/registry.hpp"

namespace cardan {
void register_fields(Registry& registry);
}  // namespace cardan
