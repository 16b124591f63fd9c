#pragma once
// The sweeps over the whole tree as a table of functions, one table per scalar and instruction set (kernels.hpp picks). Each is
// a loop over runs of bodies with one kernel. Formulas: kernels_*.hpp.
#include "core/soa/kernels_acceleration.hpp"
#include "core/soa/kernels_axis.hpp"
#include "core/soa/kernels_kinematics.hpp"

namespace cardan::soa {

template <class T>
struct Sweeps {
  using Bodies = const SweepModel&;
  using Work = Workspace<T>&;
  using In = const Inputs<T>&;
  /// Sets the ground: gamma(0) = [0; -g] for uniform gravity; clears what the inward sweeps gather there.
  void (*ground)(Bodies, Work, In) = nullptr;
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
  /// tau = H phi f with f in z (inverse dynamics).
  void (*gather)(Bodies, Work, In, const Run&, T* tau) = nullptr;
};

/// Pose of B in A, and columns of H* at B, of any body: for what is not in the inner loop.
template <class T>
static Pose<T> pose_in_inboard(const SweepModel& model, const Workspace<T>& ws, int k) {
  const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
  if (!is_axis(b.kind)) return ws.X(k);
  const AxisRecord<T>& r = ws.axis(k);
  return {cast<T>(b.O.R) * rotation_about(cast<T>(b.axis), r.s, r.c), cast<T>(b.O.p)};
}
template <class T>
static Motion<T> hinge_column(const SweepModel& model, const Workspace<T>& ws, int k, int j) {
  const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
  return is_axis(b.kind) ? Motion<T>{cast<T>(b.axis), {T(0), T(0), T(0)}} : ws.H(k)[j];
}

}  // namespace cardan::soa
