#pragma once
// One way to name a component of motion, wherever a list of them is asked for: what moves, what carries no actuator, what is
// limited, where a force acts, along what is differentiated.
//
//   "arm.rate", "arm.angle"     a velocity component, or the coordinate whose rate it is: both name it
//   "bus.turn_x", "bus.shift_x" of a hinge with a quaternion: the rotation, the displacement that go with wx, vx
//   "arm.eta_2", "arm.etadot_2" a mode
//   "arm"                       all components of the hinge
//   "arm.eta"                   all modes of the body
#include <string>
#include <string_view>
#include <vector>

#include "core/model/model.hpp"

namespace cardan {

/// Indices into v, ascending; none if nothing has this name, or if it has no component.
std::vector<int> components_of(const Model& model, std::string_view name);
/// What components_of knows, for hints.
std::vector<std::string> component_names(const Model& model);

/// "arm.angle", "bus.turn_x", "wing.eta_2": a name by which components_of() knows velocity component v alone.
std::string component_name(const Model& model, int v);

/// The deviation that belongs to velocity component j of a hinge: its coordinate where it has one of its own, else "turn_x",
/// "shift_x", "d_<velocity>".
std::string deviation_name(const UserBody& u, int j);

}  // namespace cardan
