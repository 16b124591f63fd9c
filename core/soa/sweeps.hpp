#pragma once
// The sweeps as functions over the whole tree, for any scalar that is instantiated (double: kernels.cpp; a counting scalar:
// cost.cpp). Each is a loop over runs of bodies with one kernel. Formulas: kernels_*.hpp.
#include "core/soa/kernels_acceleration.hpp"
#include "core/soa/kernels_kinematics.hpp"
#include "core/soa/kernels_axis.hpp"

namespace cardan::soa {

template <class T>
struct Sweeps {
  /// What depends on the hinge coordinates alone: sines and cosines of the axis hinges in one go, and the records of the
  /// dense shapes, one call per family.
  static void hinge_records(const Model&, Workspace<T>&, const Inputs<T>&);
  /// Sets the ground: gamma(0) = [0; -g] for uniform gravity; clears what the inward sweeps gather there.
  static void ground(const Model&, Workspace<T>&, const Inputs<T>&);
  /// Pose, hinge map, w, gamma_b and z, base to tip, over one run.
  static void outward(const Model&, Workspace<T>&, const Inputs<T>&, const Run&, bool vdot, bool velocity);
  static void elastic(const Model&, Workspace<T>&, const Inputs<T>&);
  /// Poses and spatial velocities in the world. Needs outward; Workspace::require_world() before.
  static void world(const Model&, Workspace<T>&, const Inputs<T>&);
  static void central_gravity(const Model&, Workspace<T>&, const Inputs<T>&);
  static void node_wrenches(const Model&, Workspace<T>&, const Inputs<T>&);
  /// P, D, G and z, eps, nu, tip to base. Sets Workspace::breakdown and stops where D is singular.
  static void inward(const Model&, Workspace<T>&, const Inputs<T>&, const Run&, InwardFor what);
  static void acceleration(const Model&, Workspace<T>&, const Inputs<T>&, const Run&, T* vdot);
  static void gather(const Model&, Workspace<T>&, const Run&, T* tau);
};

/// Pose of B in A, and columns of H* at B, of any body: for what is not in the inner loop.
template <class T>
Pose<T> pose_in_inboard(const Model& model, const Workspace<T>& ws, int k) {
  const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
  if (!is_axis(b.kind)) return ws.X(k);
  const AxisRecord<T>& r = ws.axis(k);
  return {cast<T>(b.O.R) * rotation_about(cast<T>(b.axis), r.s, r.c), cast<T>(b.O.p)};
}
/// R_AB r + m p_AB: the first moment r of the mass m about B, in the axes of A and about its origin.
template <class T>
Vec3<T> moment_in_inboard(const Model& model, const Workspace<T>& ws, int k, const Vec3<T>& r, const T& m) {
  const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
  if (!is_axis(b.kind)) return ws.X(k).R * r + m * ws.X(k).p;
  const AxisRecord<T>& turn = ws.axis(k);
  const Vec3<T> u = cast<T>(b.axis);
  return cast<T>(b.O.R) * (turn.c * r + turn.s * cross(u, r) + ((T(1) - turn.c) * dot(u, r)) * u) + m * cast<T>(b.O.p);
}
template <class T>
Motion<T> hinge_column(const Model& model, const Workspace<T>& ws, int k, int j) {
  const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
  return is_axis(b.kind) ? Motion<T>{cast<T>(b.axis), {T(0), T(0), T(0)}} : ws.H(k)[j];
}

}  // namespace cardan::soa
