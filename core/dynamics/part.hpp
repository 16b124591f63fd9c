#pragma once
// Some of the bodies of a model as a system of their own, without a model of their own: the sweeps over these bodies alone.
//
// Whoever's inboard body does not take part hangs on ground, where the inboard body is now, standing still. The others are not there:
// no mass, no force. An inward sweep adds to inboard bodies only, so over the runs of those that take part it is right as it is; an
// outward sweep needs the pose and the gravity of what they hang on, at rest.
#include <cstdint>
#include <span>
#include <vector>

#include "core/soa/sweeps.hpp"
#include "core/soa/tangent.hpp"

namespace cardan {

struct Part {
  std::vector<std::uint8_t> takes_part;  // by sweep index
  std::vector<Run> runs;                 // those that take part, base to tip
  std::vector<Run> still;            // what they hang on and all inboard of it, base to tip (of bodies in between also such that take part)
  std::vector<int> rotors_left_out;  // rotors whose carrier takes part and they do not: M_sweep of the carrier has their inertia
};
/// The stretches of the runs whose bodies are marked, by sweep index.
std::vector<Run> stretches(const std::vector<Run>& runs, const std::vector<std::uint8_t>& marked);
Part part_of(const SweepModel& model, std::span<const int> sweep_bodies);

/// What stands still has no derivative, also where q moves what it hangs on.
template <class T>
T held(const T& x) {
  return x;
}
template <class D>
TangentOf<D> held(const TangentOf<D>& x) {
  return x.x;
}
template <class T>
Vec3<T> held(const Vec3<T>& a) {
  return {held(a.x), held(a.y), held(a.z)};
}
template <class T>
Pose<T> held(const Pose<T>& X) {
  const Mat3<T>& R = X.R;
  return {{held(R.xx), held(R.xy), held(R.xz), held(R.yx), held(R.yy), held(R.yz), held(R.zx), held(R.zy), held(R.zz)}, held(X.p)};
}

/// Ground, hinge records and, base to tip, all bodies, or those of a part (then in.v and in.vdot are zero for the others).
template <class T>
CARDAN_INLINE void outward(const SweepModel& model, const soa::Sweeps<T>& S, soa::Workspace<T>& ws, const soa::Inputs<T>& in,
                           soa::OutwardFor what, const Part* part = nullptr) {
  S.ground(model, ws, in);
  S.hinge_records(model, ws, in);
  if (!part) {
    for (const Run& run : model.runs) S.outward(model, ws, in, run, what);
    return;
  }
  for (const Run& run : part->still) S.outward(model, ws, in, run, {.velocity = false});
  for (const Run& run : part->still)
    for (int k = run.begin; k < run.end; ++k) ws.core(k).gamma.v = held(ws.core(k).gamma.v);
  for (const Run& run : part->runs) S.outward(model, ws, in, run, what);
  for (const int k : part->rotors_left_out) {
    const SweepBody& rotor = model.bodies[k];
    const soa::Core<T>& carrier = ws.core(rotor.parent);
    const RigidInertia<T> M = cast<T>(rotor.M_sweep);
    ws.z(rotor.parent) -= M * carrier.gamma + gyroscopic(M, carrier.w);
  }
}

/// Poses and velocities in the world. Needs outward; Workspace::require_world() before.
template <class T>
void world(const SweepModel& model, const soa::Sweeps<T>& S, soa::Workspace<T>& ws, const soa::Inputs<T>& in, const Part* part) {
  S.world(model, ws, in);
  for (int k = 1; part && k < static_cast<int>(model.bodies.size()); ++k) {
    const int inboard = model.bodies[k].parent;
    if (part->takes_part[k]) {
      const Pose<T> X = soa::pose_in_inboard(model, ws, k, in.q);
      ws.pose_W(k) = ws.pose_W(inboard) * X;
      ws.V(k) = soa::velocity_of(model, ws, in, k, X, ws.V(inboard));
    } else {
      ws.pose_W(k) = held(ws.pose_W(k));
      ws.V(k) = Motion<T>{{T(0), T(0), T(0)}, {T(0), T(0), T(0)}};
    }
  }
}

}  // namespace cardan
