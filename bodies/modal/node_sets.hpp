#pragma once
// Sets of nodes: what the body frame holds, what moves a named node, what carries a mass (docs/mathematics/modes.md, section 1).
#include <string>
#include <vector>

#include "bodies/modal/fe_model.hpp"
#include "bodies/modal/modal_source.hpp"

namespace cardan {

/// The nodes of a set; of none given, the one that is nearest.
std::vector<int> nodes_of(const FeModel&, const NodeSet&, const Eigen::Vector3d& position, const std::string& field, const Located& at);

/// What moves a named node at `position`. A node with rotations does it alone.
FeModel::Grip grip_of(const FeModel&, const NodeSet&, const Eigen::Vector3d& position, const std::string& field, const Located& at);

/// What moves the node `root` at the origin, where nodes have no rotations: nothing, where the root is held.
FeModel::Grip root_grip(const FeModel&, const NodeSet&, bool free, const std::string& field, const Located& at);

/// Makes the nodes the mass points, between which M has the masses FeModel::between (n x n), and adds to both M and the points what the
/// nodes carry.
void add_masses(FeModel&, const std::vector<PointMass>&, const Located& at);

}  // namespace cardan
