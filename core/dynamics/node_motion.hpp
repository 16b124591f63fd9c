#pragma once
// Pose, velocity and acceleration of bodies and nodes, read from a workspace, in any scalar: on Tangent with their derivative.
#include "core/dynamics/workspace.hpp"
#include "core/soa/field_at.hpp"
#include "core/soa/sweeps.hpp"

namespace cardan {

/// What the workspace has been through: forward dynamics leaves gamma_b and delta, a pass outward with v' gamma as a whole.
enum class After : std::uint8_t { forward, inverse };

/// Of a sweep body, its axes. gamma + delta is its acceleration in gamma form (docs/one_step.md).
template <class T>
struct BodyMotion {
  Vec3<T> w;               // [rad/s]
  Motion<T> gamma, delta;  // without and due to v'; after a pass outward all of it is gamma
};

/// Also of a rotor, which the sweeps fold into its carrier. Without `vdot` the rotor's own acceleration is left out.
template <class T>
BodyMotion<T> motion_of_body(const Model& model, const soa::Workspace<T>& ws, const soa::Inputs<T>& in, int k, const T* vdot, After after) {
  const SweepBody& b = model.bodies[k];
  const bool rotor = b.kind == BodyKernel::rotor;
  const soa::Core<T>& core = ws.core(rotor ? b.parent : k);
  const Motion<T> delta = after == After::forward ? core.delta : Motion<T>{};
  if (!rotor) return {core.w, core.gamma, delta};
  const Pose<T> X = soa::pose_in_inboard(model, ws, k, in.q);
  const Vec3<T> w1 = transpose_times(X.R, core.w), axis = cast<T>(b.axis), rate = in.v[b.v] * axis;
  BodyMotion<T> out{w1 + rate,
                    {transpose_times(X.R, core.gamma.w) + cross(w1, rate), transpose_times(X.R, core.gamma.v + core.E * X.p)},
                    to_outboard(X, delta)};
  if (vdot) out.delta.w += vdot[b.v] * axis;
  return out;
}

/// A wrench on a node of a body that does not deform there, referred to B, its axes. Reads poses in the world.
Force<double> wrench_at_B(const Model& model, const Workspace& ws, const NodeWrench& load);
/// z of a rotor that moves with w and gamma: M gamma + gyroscopic terms, less gravity and loads, at B, its axes.
Force<double> bias_of_rotor(const Model& model, const Workspace& ws, const Inputs& in, int k, const Vec3<double>& w,
                            const Motion<double>& gamma);

/// A node in its body.
template <class T>
soa::DeformedNode<T> deformed(const Model& model, const soa::Workspace<T>& ws, const UserNode& node, const soa::Inputs<T>& in) {
  soa::DeformedNode<T> at{};
  at.R = cast<T>(node.shapes.pose.R), at.rho = cast<T>(node.shapes.pose.p);
  at.rate = at.bias = Motion<T>{};
  at.S = nullptr;
  if (node.shapes.deforms()) soa::deform<T>(model, ws, model.user[node.body].sweep, node.shapes, in.q, in.v, at);
  return at;
}
/// [angular; linear] velocity of a node, body axes; V: that of its body.
template <class T>
Motion<T> velocity_at(const Motion<T>& V, const soa::DeformedNode<T>& at) {
  return {V.w + at.rate.w, V.v + cross(V.w, at.rho) + at.rate.v};
}

/// [angular; linear] acceleration of a node in gamma form, body axes: the true one of the point, less the pull of uniform gravity. w and
/// gamma: those of its body; `vdot`: of its modes; null: without.
template <class T>
Motion<T> acceleration_at(const SweepBody& b, const NodeShapes& shapes, const soa::DeformedNode<T>& at, const Vec3<T>& w,
                          const Motion<T>& gamma, const T* vdot) {
  Motion<T> a{gamma.w, gamma.v + cross(gamma.w, at.rho)};
  if (vdot && shapes.deforms())
    for (int j = 0; j < b.n_modes; ++j) a += vdot[b.etadot + j] * soa::node_column(shapes, at, j);
  a.w += cross(w, at.rate.w) + at.bias.w;
  a.v += cross(w, cross(w, at.rho)) + T(2) * cross(w, at.rate.v);
  if (at.S) a.v += at.bias.v;
  return a;
}

/// A node in the world.
template <class T>
struct NodeMotion {
  Mat3<T> R_WN;            // node axes to world axes
  Vec3<T> position;        // [m] world axes
  Motion<T> velocity;      // [angular; linear] node axes
  Motion<T> acceleration;  // true acceleration of the point, [angular; classical linear], node axes; only if asked for
  Vec3<T> specific_force;  // [m/s^2] what an ideal accelerometer at the node reads, node axes; as acceleration
};

/// Without acceleration: of a node of sweep body k, deformed. Reads a workspace after S.world().
template <class T>
NodeMotion<T> pose_and_velocity(const soa::Workspace<T>& ws, int k, const soa::DeformedNode<T>& at) {
  const Pose<T>& W = ws.pose_W(k);
  const Motion<T> velocity = velocity_at(ws.V(k), at);
  NodeMotion<T> out{};
  out.R_WN = W.R * at.R;
  out.position = W.p + W.R * at.rho;
  out.velocity = {transpose_times(at.R, velocity.w), transpose_times(at.R, velocity.v)};
  return out;
}

/// Reads a workspace after S.world(), and for the acceleration after dynamics with `in` and v' (else null).
template <class T>
NodeMotion<T> node_motion(const Model& model, const soa::Workspace<T>& ws, const soa::Inputs<T>& in, int node_index, const T* vdot,
                          After after = After::forward) {
  const UserNode& node = model.nodes[node_index];
  const int k = model.user[node.body].sweep;
  const SweepBody& b = model.bodies[k];
  const soa::DeformedNode<T> at = deformed(model, ws, node, in);
  NodeMotion<T> out = pose_and_velocity(ws, k, at);
  if (!vdot) return out;
  const Motion<T>& V = ws.V(k);
  const BodyMotion<T> body = motion_of_body(model, ws, in, k, vdot, after);
  const Motion<T> gamma = body.gamma + body.delta;
  const Motion<T> a = acceleration_at(b, node.shapes, at, V.w, gamma, vdot);
  out.acceleration = {transpose_times(at.R, a.w), transpose_times(at.R, a.v)};
  out.specific_force = out.acceleration.v;
  if (!in.gravity) return out;
  const Vec3<T> field = transpose_times(out.R_WN, soa::field_at(model.field, out.position, in.moment));
  if (model.field.uniform) out.acceleration.v += field;  // gamma is seen from what falls; of the ground it is 0
  if (model.field.pulls()) out.specific_force -= field;
  return out;
}

}  // namespace cardan
