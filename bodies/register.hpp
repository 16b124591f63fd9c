#pragma once
#include "core/abi/registry.hpp"

namespace cardan {
/// The built-in bodies: rigid, particle, modal_flexible.
void register_bodies(Registry& registry);
}  // namespace cardan
