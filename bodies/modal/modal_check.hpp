#pragma once
// What modal data must obey, wherever they come from: lumped masses of a vehicle file, or a modal file.
#include "core/base/diagnostic.hpp"
#include "core/spatial/modal_data.hpp"

namespace cardan {

/// K and C are m x m, m >= 1, finite, symmetric, K positive definite and C positive semidefinite. Throws InputError C0321,
/// and C0322 where K has a zero eigenvalue (a rigid-body mode duplicates the floating frame).
void check_stiffness(const Eigen::MatrixXd& K, const Eigen::MatrixXd& C, const Located& at);

/// Mass node j: a positive mass, a moment of inertia that some body can have, shapes and Q of the right size (3 x m; none or three m x m),
/// all finite. Throws InputError C0321.
void check_mass_node(const MassNode& node, Eigen::Index m, std::size_t j, const Located& at);

/// Each node has a name of its own that can be written in `to: body.node`, shapes of 3 x m, and axes that are a rotation.
/// Throws InputError C0210, C0207, C0321, C0303.
void check_nodes(const std::vector<ModalNode>& nodes, Eigen::Index m, const Located& at);

/// The integrals fit to each other as those of some distribution of mass do: I1 > 0, the mass matrix at eta = 0 positive
/// semidefinite, I5 antisymmetric and I9 symmetric in their two modes, I8 - I8* = -I4~ where no rotary inertia is part of I4.
/// With mass nodes: they are the sums over these. Throws InputError C0321. Sizes must have been checked.
void check_integrals(const ModalData& data, const Located& at);

}  // namespace cardan
