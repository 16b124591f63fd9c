#pragma once
// Pose, velocity and acceleration of nodes from a workspace, in any scalar: on Tangent with their derivative.
#include "core/model/model.hpp"
#include "core/soa/sweeps.hpp"

namespace cardan::soa {

template <class T>
struct NodeMotion {
  Mat3<T> R_WN;            // node axes to world axes
  Vec3<T> position;        // [m] world axes
  Motion<T> velocity;      // [angular; linear] node axes
  Motion<T> acceleration;  // true acceleration of the point, [angular; classical linear], node axes; only if asked for
};

/// What the workspace has been through: forward dynamics leaves gamma_b and delta, a pass outward with v' gamma as a whole.
enum class After : std::uint8_t { forward, inverse };

/// w and gamma of a sweep body, its axes; of a rotor, which is folded into its carrier, by hand.
template <class T>
void motion_of_body(const Model& model, const Workspace<T>& ws, const Inputs<T>& in, int k, const T* vdot, After after, Vec3<T>& w,
                    Motion<T>& gamma) {
  const SweepBody& b = model.bodies[k];
  if (b.kind != BodyKernel::rotor) {
    w = ws.core(k).w, gamma = ws.core(k).gamma;
    if (after == After::forward) gamma += ws.core(k).delta;
    return;
  }
  const Core<T>& carrier = ws.core(b.parent);
  const Pose<T> X = pose_in_inboard(model, ws, k, in.q);
  const Vec3<T> w1 = transpose_times(X.R, carrier.w), axis = cast<T>(b.axis), rate = in.v[b.v] * axis;
  w = w1 + rate;
  gamma = Motion<T>{transpose_times(X.R, carrier.gamma.w) + cross(w1, rate), transpose_times(X.R, carrier.gamma.v + carrier.E * X.p)};
  if (after == After::forward) gamma += to_outboard(X, carrier.delta);
  gamma.w += vdot[b.v] * axis;
}

/// Reads a workspace after S.world(), and for the acceleration after dynamics with `in` and v' (else null).
template <class T>
NodeMotion<T> node_motion(const Model& model, const Workspace<T>& ws, const Inputs<T>& in, int node_index, const T* vdot,
                          After after = After::forward) {
  const UserNode& node = model.nodes[node_index];
  const int k = model.user[node.body].sweep;
  const SweepBody& b = model.bodies[k];
  DeformedNode<T> at{};
  at.R = cast<T>(node.shapes.pose.R), at.rho = cast<T>(node.shapes.pose.p);
  at.rate = at.bias = Motion<T>{{T(0), T(0), T(0)}, {T(0), T(0), T(0)}};
  if (node.shapes.deforms()) deform<T>(node.shapes, in.q + b.eta, in.v ? in.v + b.etadot : nullptr, at);
  const Pose<T>& W = ws.pose_W(k);
  const Motion<T>& V = ws.V(k);
  NodeMotion<T> out;
  out.R_WN = W.R * at.R;
  out.position = W.p + W.R * at.rho;
  const Motion<T> velocity{V.w + at.rate.w, V.v + cross(V.w, at.rho) + at.rate.v};
  out.velocity = {transpose_times(at.R, velocity.w), transpose_times(at.R, velocity.v)};
  out.acceleration = Motion<T>{{T(0), T(0), T(0)}, {T(0), T(0), T(0)}};
  if (!vdot || k == 0) return out;
  Vec3<T> w;
  Motion<T> gamma;
  motion_of_body(model, ws, in, k, vdot, after, w, gamma);
  Motion<T> a{gamma.w, gamma.v + cross(gamma.w, at.rho)};
  if (node.shapes.deforms())
    for (int j = 0; j < b.n_modes; ++j) a += vdot[b.etadot + j] * node_column(node.shapes, at, j);
  a.w += cross(V.w, at.rate.w) + at.bias.w;
  a.v += cross(V.w, cross(V.w, at.rho)) + T(2) * cross(V.w, at.rate.v);
  out.acceleration = {transpose_times(at.R, a.w), transpose_times(at.R, a.v)};
  if (in.gravity && model.field.uniform) out.acceleration.v += transpose_times(out.R_WN, cast<T>(model.field.g));
  return out;
}

}  // namespace cardan::soa
