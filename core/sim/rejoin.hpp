#pragma once
// A vehicle whose hinges and closures become others while it moves: bodies part, dock, are latched (docs/mathematics/topology.md).
#include <vector>

#include "core/model/model_map.hpp"

namespace cardan {

class Simulation;

/// Hinges or closures are others, or held otherwise: states are not carried over coordinate by coordinate.
bool joined_otherwise(const SystemSpec& before, const SystemSpec& after);

/// `spec`: the bodies of `from`, on hinges and in loops of which some are others. Every body stays where it is; coordinates of hinges that
/// are others follow from that, also of such as are `locked`: they hold the pose they find. Velocities: of those that hinges and loops
/// allow the nearest to what the bodies do now, in the metric of the mass matrix: what an impulse without duration inside of the hinges
/// leaves. Linear and angular momentum are kept; a body that is only let go keeps its velocity. Initial values of the description are
/// replaced. InputError C0404 where a hinge cannot take the pose that its ends have, C1103 where a loop is not closed; and what compile()
/// refuses.
Rejoined rejoin(Simulation& from, SystemSpec spec, const Registry& registry, const CompileOptions& options);

/// The coordinates of hinges and modes that a description has as initial values, one after the other; and the way back. A description that
/// rejoin() has filled in is told by its text and these.
std::vector<double> initial_places(const SystemSpec& spec);
/// false: they are not of this description.
bool put_initial_places(SystemSpec& spec, const std::vector<double>& places);

}  // namespace cardan
