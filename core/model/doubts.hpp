#pragma once
// What a description may say but hardly means: the warnings that need no simulation.
#include "core/model/spec.hpp"

namespace cardan {

/// About hinges, springs and where they attach, once the modal data are there.
Warnings doubts(const SystemSpec& spec);

}  // namespace cardan
