#pragma once
// Warnings as the commands write them: what is the same of several bodies, pieces of a boom or wings that are alike, once.
#include <span>
#include <string>
#include <vector>

#include "core/base/warnings.hpp"

namespace cardan {

/// One for what differs by the name in its key path alone, with which its text may begin; the hint names the others.
std::vector<Warning> gathered(std::span<const Warning>);
/// render() of all, gathered; the last line counts each.
std::string told(const Warnings&);

}  // namespace cardan
