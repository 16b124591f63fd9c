#pragma once
// The devices that come with Cardan.
#include "core/abi/registry.hpp"

namespace cardan {
void register_devices(Registry& registry);
}  // namespace cardan
