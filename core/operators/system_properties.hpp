#pragma once
// What a workbench tells of a system, or of any subgraph of it, at one q: where it is, its mass properties, its momentum, and what is
// felt at a hinge. Deformed bodies count as they stand. World axes unless told otherwise. All O(N); all components of v, free or not.
#include "core/operators/tree_operators.hpp"

namespace cardan::operators {

/// A frame: axes to those of another, origin in it [m].
struct Placement {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
};
/// The body frames (user's, B) of the bodies that take part. Kept from the body frame of the first root, so that far from
/// the world's origin what is between bodies keeps its digits.
struct Placements {
  explicit Placements(const TreeOperators& tree);  // needs Position
  Placement reference;                             // the first root's frame in the world
  std::vector<Placement> bodies;                   // per tree.bodies(), in the reference
};

struct MassProperties {
  double mass = 0.0;                                  // [kg]
  Eigen::Vector3d com = Eigen::Vector3d::Zero();      // [m] from the world's origin
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  // [kg m^2] about the mass centre, the tensor (products with their sign)
  /// As seen from a frame in the world: com from its origin, all in its axes.
  MassProperties seen_from(const Placement& frame) const;
};
/// Of all bodies that take part; zero mass: com at the world's origin.
MassProperties mass_properties(const TreeOperators& tree);
/// The frame of a node in the world.
Placement place_of_node(const TreeOperators& tree, int node);

/// Where momentum is taken about.
enum class About : std::uint8_t { world_origin, mass_centre };
/// 6 x nv: [angular; linear] momentum of the bodies that take part per v, world axes (mathematics 5.4: columns of R H* carried to the
/// ground). About the mass centre: the centroidal momentum matrix; its angular part does not depend on how the whole is carried along.
Eigen::Matrix<double, 6, Eigen::Dynamic> momentum_matrix(const TreeOperators& tree, About about);
/// The same times v, and its adjoint times a unit twist [angular; linear] w: without the matrix.
Eigen::Matrix<double, 6, 1> momentum(const TreeOperators& tree, About about, const Eigen::VectorXd& v);
Eigen::VectorXd momentum_adjoint(const TreeOperators& tree, About about, const Eigen::Matrix<double, 6, 1>& w);

/// How a motion's momentum is spread over the bodies, per tree.bodies().
struct MomentumSharing {
  Eigen::Matrix<double, 6, Eigen::Dynamic> bodies;  // [angular about the mass centre of all; linear] per body, world axes
  Eigen::Matrix<double, 6, 1> total;
  // Part of the total along its own direction: sum 1, any signs. Empty where the total is round-off against its parts.
  Eigen::VectorXd angular, linear;
};
MomentumSharing momentum_sharing(const TreeOperators& tree, const Eigen::VectorXd& v);

/// The inertia felt at each velocity component, kg m^2, kg, or 1 (modes, by their scale).
struct ReflectedInertia {
  Eigen::VectorXd others_locked;  // M_kk = (H R H*)_kk: composite
  Eigen::VectorXd outboard_free;  // 1 / (D^-1)_kk: what is inboard held, all else of the body and outboard free
  Eigen::VectorXd others_free;    // 1 / (M^-1)_kk, M^-1 = D^-1 + G* Y+ G on the diagonal
};
/// Needs OperationalSpace. Of components that are not free the last two are infinite.
ReflectedInertia reflected_inertia(const TreeOperators& tree);

}  // namespace cardan::operators
