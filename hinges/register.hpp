#pragma once
#include "core/abi/registry.hpp"

namespace cardan {
/// The built-in hinges, in the order of the documentation.
void register_hinges(Registry& registry);
}  // namespace cardan
