#pragma once
// Derivatives of inverse and forward dynamics in q, v, v', tau and in body parameters (mathematics/sensitivities.md), each along a
// direction in O(N): the sweeps of inverse dynamics on numbers that carry a derivative (soa/tangent.hpp), and
// d v' = M^-1 (d tau - d ID) by the articulated sweeps. "Along q" means along a tangent vector u: q moves by N(q) u.
#include <Eigen/SparseCore>
#include <memory>
#include <optional>
#include <span>

#include "core/dynamics/device_tangents.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/operators/tree_operators.hpp"
#include "core/soa/tangent.hpp"

namespace cardan::operators {

/// What changes, numbers of the hinge space (nv in the order of v for a whole tree); null: does not change.
struct Direction {
  const double* q = nullptr;  // tangent vector u
  const double* v = nullptr;
  const double* vdot = nullptr;  // of inverse dynamics; of forward dynamics the prescribed components alone are read
  const double* tau = nullptr;   // of forward dynamics
};

/// Hinge space squared (nv x nv) each: column i is the derivative along component i.
struct InverseDerivatives {
  Eigen::MatrixXd q, v;  // dtau/dq, dtau/dv; dtau/dv' is the mass matrix
};
struct ForwardDerivatives {
  Eigen::MatrixXd q, v, tau;  // dv'/dq, dv'/dv, dv'/dtau = M^-1. Rows of prescribed components are zero
};

/// At one point (q, v, v', wrenches), set by at() or solve(). Gravity of every kind, elastic forces and wrenches on nodes take part: those
/// given in node axes turn with the node, those in world axes do not. Hinge springs and dampers too, unless left out:
/// tau is what is left for actuators.
///
/// Of a subgraph: bodies that take no part stay where they are, without mass and force; all vectors and matrices are of its hinge space,
/// only Inputs are the model's, of which those of its bodies are read (and all of q).
class Sensitivities {
 public:
  enum class Springs : bool { left_out, included };
  explicit Sensitivities(std::shared_ptr<const Model> model, Springs springs = Springs::included);
  /// Of the bodies that take part in `tree`. Prescribed are the components that the model gives and those that are not free in the tree
  /// (a diagonal W of it plays no part). The tree is not needed afterwards.
  explicit Sensitivities(const TreeOperators& tree, Springs springs = Springs::included);

  const std::shared_ptr<const Model>& model() const { return model_; }
  /// All bodies and components of the model, springs too.
  bool of_all() const { return !part_ && springs_; }

  /// The point with v' = in.vdot (null = 0). `devices`: evaluated there, in.wrenches with theirs first, as Simulation::wrenches() has them;
  /// what they push with then changes with q and v, their states and commands held, and tau is what is left beside them. Null: their loads
  /// are held, as they are where only a part of the bodies, or of the components, takes part. They must outlive this point.
  void at(const Inputs& in, const DeviceForces* devices = nullptr);
  /// The point with v' from in.tau, of actuators and devices, by forward dynamics. NumericsError where a free direction has no inertia.
  void solve(const Inputs& in, const DeviceForces* devices = nullptr);
  // All that follows is about the point: without one it is InputError C0901.
  const Eigen::VectorXd& tau() const { return tau_; }  ///< of inverse dynamics at the point
  const Eigen::VectorXd& vdot() const { return vdot_; }

  // Along n directions, O(N) each, a column of the result for each (hinge space x n): of whole trees without devices eight at once, by
  // sweeps on numbers with eight derivatives.
  void inverse(std::span<const Direction> along, double* dtau);
  void forward(std::span<const Direction> along, double* dvdot);
  // Along one direction, O(N)
  void inverse(const Direction& along, double* dtau);
  void forward(const Direction& along, double* dvdot);
  /// (dM along u) w: one pass with v = 0 and v' = w.
  void mass(const double* u, const double* w, double* dM_w);
  /// M^-1 f, zero at prescribed components.
  void mass_inverse(const double* f, double* out);

  // Whole matrices: 2 nv passes, O(N nv)
  InverseDerivatives inverse();
  ForwardDerivatives forward();

  // In the parameters of a body (index into Model::user) at fixed q, v and v' (inverse) or tau (forward). tau is linear in them but
  // for the pull of a centre, and body b moves the tau between it and the ground only: O(depth) per parameter.
  /// A rigid body's inertia, seen in its own frame: columns m, h = m c (3), J (xx yy zz xy xz yz) about its origin; nv x 10. Bodies
  /// that are merged with others, and rotors, have theirs. InputError for a flexible body, and for one that takes no part.
  Eigen::MatrixXd inverse_in_inertia(int body);
  Eigen::MatrixXd forward_in_inertia(int body);
  /// Along one change of that inertia.
  void inverse_in_inertia(int body, const RigidInertia<double>& change, double* dtau);
  /// Modal stiffness of a flexible body with m modes. Diagonal: nv x m. Full: nv x m (m + 1) / 2, lower triangle by rows; K_ij and K_ji
  /// move together.
  enum class Stiffness : bool { diagonal, full };
  Eigen::MatrixXd inverse_in_stiffness(int body, Stiffness which = Stiffness::diagonal) const;
  Eigen::MatrixXd forward_in_stiffness(int body, Stiffness which = Stiffness::diagonal);

 private:
  Sensitivities(std::shared_ptr<const Model> model, const TreeOperators* tree, Springs springs);
  void evaluate();
  soa::Workspace<soa::Tangent>& tangent();
  Workspace& inertia();
  void articulate();
  const TreeOperators& tree();
  const UserBody& user(int body) const;
  Eigen::MatrixXd minus_inverse_of(Eigen::MatrixXd dtau);
  int size() const { return static_cast<int>(component_.size()); }
  const double* on_model(const Eigen::VectorXd& x, Eigen::VectorXd& all) const;
  void require_point() const;
  void set_rate(const double* u);
  void let_devices_act(double* dtau);
  bool side_by_side() const { return !part_ && !devices_; }
  void inverse_side_by_side(std::span<const Direction> along, double* dtau);
  void mass_inverse(int n, const double* f, double* out);

  std::shared_ptr<const Model> model_;
  bool springs_, gravity_ = true, articulated_ = false, posed_ = false, has_point_ = false;
  std::shared_ptr<const Part> part_;    // null: all bodies
  std::vector<int> bodies_;             // sweep indices, of the part; M^-1 is then by its blocks, of all bodies by sweeps
  std::vector<int> component_, place_;  // of the hinge space: velocity component of the model; and back, -1 for others
  std::vector<std::uint8_t> given_;     // per component
  Eigen::VectorXd q_, v_, vdot_, tau_, rate_, masked_, work_;  // but for q and its rate of the hinge space
  Eigen::VectorXd v_all_, vdot_all_, tau_all_, zeros_;         // nv numbers, zero for who takes no part
  std::vector<NodeWrench> wrenches_;
  std::shared_ptr<const FieldMoment> moment_;  // of gravity that is a field, as it was when at() was called
  std::vector<soa::NodeWrench<soa::Tangent>> wrenches_t_;
  std::vector<soa::Tangent> q_t_, v_t_, vdot_t_, tau_t_;
  Workspace ws_;                                         // of inverse dynamics at the point
  std::optional<Workspace> inertia_;                     // P, D, G there
  std::optional<soa::Workspace<soa::Tangent>> tangent_;  // as what is below, made when it is asked for
  std::optional<DeviceTangents> devices_;
  std::vector<soa::Tangent> z_t_, device_tau_;
  struct SideBySide;
  SideBySide& beside();
  std::unique_ptr<SideBySide, void (*)(SideBySide*)> side_{nullptr, nullptr};
  std::optional<TreeOperators> tree_;
  std::optional<TreeOperators> sub_;  // of bodies_, at q
};

/// C_kin of the linearised kinematics, nv x nv, block-diagonal: with q + dq = retract(q, theta),
///   d/dt theta = dv + C_kin theta.
/// 0 where q' = v; ball -omega~; free diag(-omega~, 0); free_body [-omega~ 0; -v~ -omega~]; other hinges by differences of
/// eighth order of their retract and difference.
Eigen::SparseMatrix<double> kinematic_rates(const Model& model, const double* q, const double* v);

}  // namespace cardan::operators
