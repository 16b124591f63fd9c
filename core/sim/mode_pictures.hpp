#pragma once
// Pictures of the modes of a vehicle, for the results of a run.
#include <vector>

#include "core/io/recorder.hpp"
#include "core/model/spec.hpp"

namespace cardan {

/// One for all bodies that share their modes, in the order of the bodies. Where the mesh is not known (lumped masses, a modal file of
/// another program) the points are mass nodes and named nodes, with no lines between them.
std::vector<ModePicture> mode_pictures(const SystemSpec& spec);

}  // namespace cardan
