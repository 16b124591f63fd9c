#pragma once
// What a description may say but hardly means: the warnings that need no simulation.
#include "core/model/spec.hpp"

namespace cardan {

/// About hinges, springs and where they attach, once the modal data are there.
Warnings doubts(const SystemSpec& spec);

/// True if nothing holds the frame of these modes to a point of the body: mean axes, sum m phi = 0 and sum m r x phi = 0 (I3 = I4 =
/// 0). A hinge on such a frame moves no mode and is moved by none.
bool has_mean_axes(const ModalData& modal);

}  // namespace cardan
