#pragma once
// The devices that come with Cardan, and the fields that they read.
#include "core/abi/registry.hpp"

namespace cardan {
void register_devices(Registry& registry);
}  // namespace cardan
