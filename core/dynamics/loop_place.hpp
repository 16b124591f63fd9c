#pragma once
// The ends of a closed loop as its rows see them (docs/mathematics/loops.md, 1), in any scalar: seen from home at rest, from each other,
// and their accelerations.
#include <utility>

#include "core/dynamics/node_motion.hpp"
#include "core/model/model.hpp"

namespace cardan {

/// One end of a loop.
template <class T>
struct LoopEndMotion {
  soa::DeformedNode<T> at;  // in its body
  Mat3<T> R_HN;             // node axes to axes of home
  Vec3<T> x;                // [m] from home
  Vec3<T> w, v;             // relative to home, node axes
};

/// `to` seen from `from`, its axes.
template <class T>
struct LoopPlace {
  Mat3<T> R;
  Vec3<T> d, w, u;  // [m], [rad/s], [m/s]
};

inline const NodeShapes& shapes_of(const Model& model, const LoopEnd& end) {
  static const NodeShapes rigid;
  return end.node >= 0 ? model.nodes[static_cast<std::size_t>(end.node)].shapes : rigid;
}

/// Needs outward. `path`: bodies from the one outboard of home to that of the end.
template <class T>
LoopEndMotion<T> seen_from_home(const Model& model, const soa::Workspace<T>& ws, const soa::Inputs<T>& in, const LoopEnd& end,
                                const std::vector<int>& path) {
  LoopEndMotion<T> out{};
  if (end.node >= 0) {
    out.at = deformed(model, ws, model.nodes[static_cast<std::size_t>(end.node)], in);
  } else {
    out.at.R = cast<T>(end.pose.R), out.at.rho = cast<T>(end.pose.p);
    out.at.rate = out.at.bias = Motion<T>{};
    out.at.S = nullptr;
  }
  Pose<T> X;
  Motion<T> V{};
  for (const int k : path) {
    const Pose<T> step = soa::pose_in_inboard(model, ws, k, in.q);
    V = soa::velocity_of(model, ws, in, k, step, V);
    X = X * step;
  }
  const Motion<T> here = velocity_at(V, out.at);
  out.R_HN = X.R * out.at.R;
  out.x = X.p + X.R * out.at.rho;
  out.w = transpose_times(out.at.R, here.w), out.v = transpose_times(out.at.R, here.v);
  return out;
}

template <class T>
LoopPlace<T> seen_from(const LoopEndMotion<T>& a, const LoopEndMotion<T>& b) {
  LoopPlace<T> r;
  r.R = transpose(a.R_HN) * b.R_HN;
  r.d = transpose_times(a.R_HN, b.x - a.x);
  r.w = r.R * b.w - a.w;
  r.u = r.R * b.v - a.v - cross(a.w, r.d);
  return r;
}

/// w', u' of a loop as the workspace and vdot have it, after forward dynamics.
template <class T>
std::pair<Vec3<T>, Vec3<T>> relative_acceleration(const Model& model, const soa::Workspace<T>& ws, const soa::Inputs<T>& in,
                                                  const Loop& loop, const LoopEndMotion<T>& from, const LoopEndMotion<T>& to,
                                                  const LoopPlace<T>& r, const T* vdot) {
  const auto of = [&](const LoopEnd& end, const LoopEndMotion<T>& e, Vec3<T>& w) -> Motion<T> {  // node axes; w: of the node
    const BodyMotion<T> body = motion_of_body(model, ws, in, end.sweep, vdot, After::forward);
    const Motion<T> a = acceleration_at(model.bodies[static_cast<std::size_t>(end.sweep)], shapes_of(model, end), e.at, body.w,
                                        body.gamma + body.delta, vdot);
    w = transpose_times(e.at.R, body.w + e.at.rate.w);
    return {transpose_times(e.at.R, a.w), transpose_times(e.at.R, a.v)};
  };
  Vec3<T> w_a, w_b;
  const Motion<T> A = of(loop.from, from, w_a), B = of(loop.to, to, w_b);
  return {r.R * B.w - A.w - cross(w_a, r.w), r.R * B.v - A.v - cross(A.w, r.d) - T(2) * cross(w_a, r.u) - cross(w_a, cross(w_a, r.d))};
}

}  // namespace cardan
