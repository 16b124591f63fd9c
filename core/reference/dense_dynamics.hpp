#pragma once
// The dense twin: the same dynamics as the sweeps by another way. Every frame is carried in world axes from the world
// outward by the elementary kinematics of relative motion (position, columns of its Jacobian, classical acceleration at
// v' = 0); the equations of motion are Kane's projection of the momentum balance of every mass (Kane & Levinson 1985).
// Cubic in the number of velocities and meant as truth: it shares no formula with the sweeps, the hinge families or the
// body families. Instantiated for double and for Quad (quad.hpp).
//
//   M v' + bias = tau + gravity_force + elastic_force + hinge_force + external_force
//
// State: q body by body in the order of the spec [hinge q; eta], v likewise [hinge v; eta']; a hinge with `locked:
// true` has no entries. Wrenches, velocities and accelerations of nodes: [angular; linear] in node axes, at the node;
// accelerations are those of the point in inertial space, gravity not included.
// A flexible body at level 2 with mass nodes is the exact sum over its nodes, second-order displacements included; at
// the other levels, or with integrals alone, it is its truncated mass matrix (modal_inertia.hpp). There, as the
// textbook form has it, velocity terms contain omega x v: at orbital speed in double some digits go, use Quad.
#include "core/reference/dense_model.hpp"
#include "core/reference/modal_inertia.hpp"

namespace cardan::reference {

template <class T>
struct NodeMotion {
  Vec3<T> x;                            // [m] world axes
  Mat3<T> R;                            // node axes to world axes
  VecX<T> velocity, acceleration_bias;  // 6
  MatX<T> J;                            // 6 x nv
  VecX<T> acceleration(const VecX<T>& vdot) const { return J * vdot + acceleration_bias; }
};

/// Wrench [moment; force] on a node, node axes.
template <class T>
struct NodeWrench {
  std::string body, node;
  VecX<T> wrench;
};
template <class T>
using NodeWrenches = std::vector<NodeWrench<T>>;

template <class T>
struct HybridResult {
  VecX<T> vdot, tau;  // tau: as given where free, what the motion needs where prescribed
};

/// Everything at one (q, v).
template <class T>
class DenseState {
 public:
  MatX<T> M;                                                                 // nv x nv
  VecX<T> bias, gravity_force, elastic_force, hinge_force, qdot;             // elastic: modes; hinge: springs and dampers
  T total_mass{0}, kinetic_energy{0}, gravity_energy{0}, elastic_energy{0};  // elastic: modes and hinge springs
  T pull_squared{0};                                                         // [N^2/kg] of gravity, over the mass, sum over bodies
  Vec3<T> com, linear_momentum, angular_momentum;                            // world axes, about the world's origin
  std::vector<Frame<T>> bodies;                                              // frame B of each

  NodeMotion<T> node(std::string_view body, std::string_view node) const;
  VecX<T> external_force(const NodeWrenches<T>&) const;
  /// The rows of each loop.
  std::vector<LoopRows<T>> loops() const;
  /// v' for tau with the multipliers of the loops, those of all loops one after the other.
  ClosedMotion<T> closed(const VecX<T>& tau, const NodeWrenches<T>& = {}) const;
  /// v' for tau, of the closed system; throws NumericsError N0101 when M is not positive definite.
  VecX<T> forward(const VecX<T>& tau, const NodeWrenches<T>& = {}) const;
  /// tau for v'; of the open tree.
  VecX<T> inverse(const VecX<T>& vdot, const NodeWrenches<T>& = {}) const;
  /// v'_i as given where prescribed[i], free elsewhere. What holds a motion in a closed loop comes out of `tau` and multipliers together.
  HybridResult<T> hybrid(const VecX<T>& tau, const std::vector<bool>& prescribed, const VecX<T>& vdot_prescribed,
                         const NodeWrenches<T>& = {}) const;
  /// Per body the total wrench [moment; force] that its inboard hinge transmits to it at P, in P axes. `lambda`: of closed().
  std::vector<VecX<T>> hinge_wrenches(const VecX<T>& vdot, const NodeWrenches<T>& = {}, const VecX<T>& lambda = {}) const;

 private:
  template <class>
  friend class DenseTwin;

  /// Resultants [moment about the origin of B; force] of one body in world axes: inertia W v' + bias, gravity.
  struct Resultants {
    MatX<T> W;
    VecX<T> bias, gravity;
  };
  explicit DenseState(std::shared_ptr<const DenseModel<T>> model) : model_(std::move(model)) {}
  void add(const std::vector<int>& in, const MatX<T>& mass, const VecX<T>& bias_of_body, const VecX<T>& gravity_of_body);
  int index(std::string_view body) const;
  Frame<T> node_frame(int body, std::string_view node) const;
  std::pair<MatX<T>, VecX<T>> constraints() const;  // G and gamma of all loops
  Frame<T> end_frame(int body, const ModalPoint<T>& at) const;
  VecX<T> applied(const NodeWrenches<T>&) const;  // every known force but tau, minus bias

  std::shared_ptr<const DenseModel<T>> model_;
  VecX<T> q_, v_;
  Mat3X<T> drives_;
  std::vector<Frame<T>> pnodes_;
  std::vector<Resultants> resultants_;
};

template <class T>
class DenseTwin {
 public:
  explicit DenseTwin(const SystemSpec& spec, const ForeignHinges& foreign = {}) : DenseTwin(dense_model<T>(spec, foreign)) {}
  explicit DenseTwin(DenseModel<T> model);
  int nq() const { return model_->nq; }
  int nv() const { return model_->nv; }
  /// `drives`: of each prescribed loop in its order by how much it is more, its rate and acceleration; none: at rest as described.
  DenseState<T> at(const VecX<T>& q, const VecX<T>& v, const Mat3X<T>& drives = {}) const;

 private:
  void set_kinematics(DenseState<T>&) const;
  void add_nodal_body(DenseState<T>&, int body) const;
  Vec3<T> common_centre(const DenseState<T>&, const std::vector<int>& bodies) const;
  void add_modal_body(DenseState<T>&, int body) const;
  void add_hinge_and_modal_forces(DenseState<T>&, int body) const;

  std::shared_ptr<const DenseModel<T>> model_;           // shared with its states
  std::vector<std::optional<ModalInertia<T>>> inertia_;  // of the bodies that are not summed over their nodes
};

}  // namespace cardan::reference
