#pragma once
// The sweeps over the whole tree as a table of functions, one table per scalar and instruction set (kernels.hpp picks). Each is
// a loop over runs of bodies with one kernel. Formulas: kernels_*.hpp.
#include "core/soa/kernels_acceleration.hpp"
#include "core/soa/kernels_composite.hpp"
#include "core/soa/kernels_kinematics.hpp"

namespace cardan::soa {

struct NodeColumns;

template <class T>
struct Sweeps {
  using Bodies = const SweepModel&;
  using Work = Workspace<T>&;
  using In = const Inputs<T>&;
  /// Sets the ground: gamma(0) = [0; -g] for uniform gravity; clears what the inward sweeps gather there.
  void (*ground)(Bodies, Work, In) = nullptr;
  /// z = 0 and gamma_b = 0 everywhere: a system at rest without loads, to which hinge forces are then applied.
  void (*at_rest)(Bodies, Work) = nullptr;
  /// What depends on the hinge coordinates alone: sines and cosines of the axis hinges in one go, and the records of the
  /// dense shapes, one call per family.
  void (*hinge_records)(Bodies, Work, In) = nullptr;
  /// Pose, hinge map, w, gamma_b and z, base to tip, over one run.
  void (*outward)(Bodies, Work, In, const Run&, OutwardFor) = nullptr;
  void (*elastic)(Bodies, Work, In) = nullptr;
  /// Poses and spatial velocities in the world. Needs outward; Workspace::require_world() before.
  void (*world)(Bodies, Work, In) = nullptr;
  void (*central_gravity)(Bodies, Work, In) = nullptr;
  void (*node_wrenches)(Bodies, Work, In) = nullptr;
  /// P, D, G and z, eps, nu, tip to base. Sets Workspace::breakdown and stops where D is singular.
  void (*inward)(Bodies, Work, In, const Run&, InwardFor) = nullptr;
  void (*acceleration)(Bodies, Work, In, const Run&, T* vdot) = nullptr;
  /// Takes v' of the whole program as a first guess and adds what is missing. Models with SweepModel::graded only.
  void (*refine)(Bodies, Work, In, T* vdot) = nullptr;
  /// tau = H phi f with f in z (inverse dynamics).
  void (*gather)(Bodies, Work, In, const Run&, T* tau) = nullptr;
  /// Rigid trees, one state: M, nv x nv. Needs hinge_records and outward; Workspace::composite with one entry per body.
  void (*mass_matrix)(Bodies, Work, In, T* M) = nullptr;
  /// Rigid trees, one state: M^-1, nv x nv. Needs hinge_records, outward of all but axis bodies.
  void (*mass_matrix_inverse)(Bodies, Work, In, T* inverse) = nullptr;
  /// The same of nodes, double alone: their compliance (kernels_compliance.hpp). Nothing where a direction has no inertia.
  void (*node_compliance)(Bodies, Work, In, NodeColumns&) = nullptr;
};

/// Pose of B in A of any body: for what is not in the inner loop. A rotor has no angle of its own in
/// the sweeps, hence q.
template <class T>
static Pose<T> pose_in_inboard(const SweepModel& model, const Workspace<T>& ws, int k, const T* q) {
  using std::cos, std::sin;
  const SweepBody& b = model.bodies[k];
  if (!is_axis(b.kind)) return ws.X(k);
  const AxisBody& a = model.axis_bodies[k];
  const T angle = q[b.q] + T(a.q0);
  const bool rotor = b.kind == BodyKernel::rotor;
  const T s = rotor ? T(sin(angle)) : ws.sines[a.angle], c = rotor ? T(cos(angle)) : ws.cosines[a.angle];
  return {cast<T>(b.O.R) * rotation_about(cast<T>(b.axis), s, c), cast<T>(b.O.p)};
}
/// Spatial velocity of B, B axes, where the inboard body has V_inboard (its axes). X: pose of B in A. Needs outward.
template <class T>
static Motion<T> velocity_of(const SweepModel& model, const Workspace<T>& ws, const Inputs<T>& in, int k, const Pose<T>& X,
                             const Motion<T>& V_inboard) {
  const SweepBody& b = model.bodies[k];
  Motion<T> V_A = V_inboard;
  const Modal<T>* modal = ws.modal_of(k);
  if (modal && modal->node) {
    T s[6];
    with_columns(model.shapes[b.onode], *modal->node,
                 [&](const auto* S) { sum_columns(S, in.v + model.bodies[b.parent].etadot, b.n_parent_modes, s); });
    V_A += motion_of_node(*modal->node, s);
  }
  Motion<T> V = to_outboard(X, V_A);
  for (int j = 0; j < b.nv; ++j) V += in.v[b.v + j] * hinge_column(model, ws, k, j);
  if (modal && modal->C)
    for (int j = 0; j < b.n_modes; ++j) V -= in.v[b.etadot + j] * motion_column(modal->C, j);
  return V;
}
}  // namespace cardan::soa
