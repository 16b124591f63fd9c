#pragma once
// Frames of rigid bodies on one rotation, re-chosen for the axis kernels (core/soa/kernels_axis.hpp), and rotors. Steps of assemble().
#include "core/model/central_inertias.hpp"

namespace cardan {

/// The axis becomes a coordinate axis of the body, and the constant rotation between O and the inboard body vanishes or is one or two
/// rotations in a plane. A slide has the axes of its inboard body, but where `central` is kept. `central`: turned along; empty where they
/// are not kept.
void choose_frames(Model& model, std::vector<Central>& central);

/// Axisymmetric leaves on one rotation, on a rigid body: their inertia seen from that body is constant, so it becomes part of it. Then
/// what the axis kernels read of each body.
void fold_rotors(Model& model);

}  // namespace cardan
