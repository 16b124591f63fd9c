#pragma once
// A finite-element model in body axes: what every generator builds and every solution reads.
#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bodies/modal/modal_integrals.hpp"
#include "core/linalg/sparse_factor.hpp"

namespace cardan {

using RigidShapes = Eigen::Matrix<double, Eigen::Dynamic, 6>;
/// I2 = sum m r [kg m] of the mass matrix of a rigid body about the origin, angular first.
Eigen::Vector3d first_moment(const Eigen::Matrix<double, 6, 6>& rigid);

/// Each node has six dofs: 6 node + 0..2 its displacement [m], + 3..5 its rotation [rad], body axes. Those of solid elements have no
/// rotation, and three: `per_node` tells. Below n is the number of nodes and 6 n that of dofs, for both.
/// The mass matrix is the sum over mass points (the integration points of the elements, and lumped masses)
///   M = sum_p m_p N_p* N_p + Q_p* J_p Q_p,     N_p, Q_p: displacement and rotation of point p per nodal dof,
/// so that modal_integrals() of the points' shapes belongs to exactly this M. Of solids the points are the nodes, and masses between them
/// (MassField::between) take the place of m_p; of matrices with rotations three more for each node (masses_between in matrices.cpp).
struct FeModel {
  std::vector<Eigen::Vector3d> nodes;          // [m]
  int per_node = 6;                            // dofs of a node: 6, or 3, displacements alone
  int component_modes = 0;                     // dofs behind those of the nodes: coordinates of modes of what lies between them
  SparseMatrix K, M;                           // 6 n x 6 n, free of constraints
  Eigen::VectorXd point_mass;                  // p [kg]
  Eigen::Matrix3Xd point_position;             // 3 x p [m]
  std::vector<Eigen::Matrix3d> point_inertia;  // p [kg m^2] about the point
  SparseMatrix N[3], Q[3];                     // p x 6 n each: x, y, z
  SparseMatrix between;                        // p x p [kg] masses between the points; empty: each has its own
  bool exact_points = true;                    // false: of I1 ... I4 and I7 the points know less than M
  SparseMatrix C;                              // 6 n x 6 n; empty: damping ratios
  double element_size = 0.0;                   // [m] diagonal of the largest element; of a named point, the largest distance from a node
  std::vector<int> root_nodes;                 // what Boundary::cantilever holds
  std::vector<std::vector<int>> lines;         // for pictures: rows of nodes, a few hundred nodes in all however fine the mesh
  std::string description;                     // "beam 10 m, 40 elements"
  std::map<int, int> numbers;                  // of a mesh that was read: the node with a number of the file
  std::map<std::string, int> names;            // of a table that was read: the node with a name
  std::map<std::string, std::vector<int>> groups;  // likewise: nodes by the name of their group

  int n_dofs() const { return per_node * static_cast<int>(nodes.size()) + component_modes; }
  /// The nearest node, or -1 when it is farther away than one element.
  int find_node(const Eigen::Vector3d& position) const;
  /// How the motion of some nodes is that of one rigid frame: of a node with rotations its own; of nodes without, the rigid motion that is
  /// nearest to theirs in the sum of squares. Nothing where these lie on one line.
  struct Grip {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    std::vector<int> nodes;
    Eigen::MatrixXd B;                                                  // 6 x dofs of the nodes: displacement, then rotation of the frame
    Eigen::MatrixXd of(const Eigen::MatrixXd& shapes, int dofs) const;  // 6 x m; dofs: of a node
  };
  std::optional<Grip> grip(const Eigen::Vector3d& position, const std::vector<int>& nodes) const;
  /// The nodes that share an element with this one, and it: those that K couples with it.
  std::vector<int> around(int node) const;
  /// Dofs of the nodes when their frame moves by each unit displacement, then rotation: n x 6, zero elsewhere.
  Eigen::MatrixXd rigid_motion(const Grip&) const;
  /// 6 n x 6: nodal values of the unit rigid motions, rotation about the origin and translation (angular first).
  RigidShapes rigid_shapes() const;
  /// The nodes on `lines` with the shapes of the first modes there (at most kMostPictured).
  ModalDrawing drawing(const Eigen::MatrixXd& shapes) const;
  static constexpr Eigen::Index kMostPictured = 30;
  /// The points with the interpolated shapes of nodal vectors (6 n x m).
  MassField mass_field(const Eigen::MatrixXd& shapes) const;
};

/// Collects nodes and elements.
class FeBuilder {
 public:
  /// A mass point of an element with k nodes: shapes 3 x 6 k over the element's dofs, body axes.
  struct Point {
    double mass = 0.0;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
    Eigen::MatrixXd N, Q;
  };
  int add_node(const Eigen::Vector3d& position);
  const Eigen::Vector3d& node(int i) const { return model_.nodes[i]; }
  const FeModel& mesh() const { return model_; }  ///< nodes and element size so far; the matrices come with finish()
  /// K: 6 k x 6 k in body axes [N/m, N, N m].
  void add_element(const std::vector<int>& nodes, const Eigen::MatrixXd& K, const std::vector<Point>& points);
  void add_line(std::vector<int> nodes) { model_.lines.push_back(std::move(nodes)); }
  void add_mass(int node, double mass, const Eigen::Matrix3d& inertia);
  FeModel finish(std::vector<int> root_nodes, std::string description);

 private:
  using Triplets = std::vector<Eigen::Triplet<double>>;
  FeModel model_;
  std::vector<double> masses_;
  std::vector<Eigen::Vector3d> positions_;
  Triplets K_, M_, N_[3], Q_[3];
};

}  // namespace cardan
