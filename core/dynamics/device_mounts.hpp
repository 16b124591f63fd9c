#pragma once
// How the mounts of devices move, as numbers and as rates along a direction.
#include <vector>

#include "core/dynamics/node_motion.hpp"

namespace cardan {

/// Where the numbers of mounts come from or go to, so that a step asks nothing of the model.
struct Mounts {
  struct OnHinge {
    int mount, q, v;  // q < 0: it has no coordinate of its own
  };
  struct OnNode {
    int mount, node, load;     // load: index of its wrench
    const DeviceMount* where;  // in the model
  };
  std::vector<OnHinge> hinges;
  std::vector<OnNode> nodes;
};

namespace device_mounts {

inline constexpr int kMotion = sizeof(cardan_mount_motion) / sizeof(double), kLoad = sizeof(cardan_mount_load) / sizeof(double);
inline double* numbers(cardan_mount_motion& m) { return reinterpret_cast<double*>(&m); }
inline const double* numbers(const cardan_mount_motion& m) { return reinterpret_cast<const double*>(&m); }
inline double* numbers(cardan_mount_load& l) { return reinterpret_cast<double*>(&l); }

/// put(mount, number of cardan_mount_motion, value): as these mounts move.
template <class T, class Put>
void hinge_motion_of(const soa::Inputs<T>& in, const Mounts& mounts, const Put& put) {
  for (const auto& m : mounts.hinges) put(m.mount, 18, m.q >= 0 ? in.q[m.q] : T(0.0)), put(m.mount, 19, in.v[m.v]);
}
template <class T, class Put>
void put_pose_and_velocity(const NodeMotion<T>& n, int mount, const Put& put) {
  const Mat3<T>& R = n.R_WN;
  const T all[18] = {R.xx,           R.xy,           R.xz,           R.yx,           R.yy,           R.yz,
                     R.zx,           R.zy,           R.zz,           n.position.x,   n.position.y,   n.position.z,
                     n.velocity.w.x, n.velocity.w.y, n.velocity.w.z, n.velocity.v.x, n.velocity.v.y, n.velocity.v.z};
  for (int i = 0; i < 18; ++i) put(mount, i, all[i]);
}
/// `here`, in the world, with its place and velocity counted from the home of the mount, whose origin moves on evenly.
template <class T>
void count_from_home(const Model& model, const soa::Workspace<T>& ws, const soa::Inputs<T>& in, const DeviceMount& mount,
                     const soa::DeformedNode<T>& at, NodeMotion<T>& here) {
  Pose<T> X;
  Motion<T> V{ws.V(mount.home).w, {}};
  for (const int k : mount.way) {
    const Pose<T> step = soa::pose_in_inboard(model, ws, k, in.q);
    V = soa::velocity_of(model, ws, in, k, step, V);
    X = X * step;
  }
  here.position = ws.pose_W(mount.home).R * (X.p + X.R * at.rho);
  here.velocity.v = transpose_times(at.R, velocity_at(V, at).v);
}
template <class T, class Put>
void motion_of(const Model& model, const soa::Workspace<T>& ws, const soa::Inputs<T>& in, const Mounts& mounts, const Put& put) {
  hinge_motion_of(in, mounts, put);
  for (const auto& m : mounts.nodes) {
    const UserNode& node = model.nodes[m.node];
    const soa::DeformedNode<T> at = deformed(model, ws, node, in);
    NodeMotion<T> n = pose_and_velocity(ws, model.user[node.body].sweep, at);
    if (m.where->home > 0) count_from_home(model, ws, in, *m.where, at, n);
    put_pose_and_velocity(n, m.mount, put);
  }
}
/// With accelerations.
template <class T, class Put>
void accelerated_motion_of(const Model& model, const soa::Workspace<T>& ws, const soa::Inputs<T>& in, const Mounts& mounts, const T* vdot,
                           After after, const Put& put) {
  hinge_motion_of(in, mounts, put);
  for (const auto& m : mounts.hinges) put(m.mount, 26, vdot[m.v]);
  for (const auto& m : mounts.nodes) {
    const NodeMotion<T> n = node_motion<T>(model, ws, in, m.node, vdot, after);
    put_pose_and_velocity(n, m.mount, put);
    const Vec3<T>&alpha = n.acceleration.w, &f = n.specific_force;
    const T more[6] = {alpha.x, alpha.y, alpha.z, f.x, f.y, f.z};
    for (int i = 0; i < 6; ++i) put(m.mount, 20 + i, more[i]);
  }
}

}  // namespace device_mounts
}  // namespace cardan
