#include "core/dynamics/node_motion.hpp"

#include "core/soa/gravity_field.hpp"

namespace cardan {

Force<double> wrench_at_B(const Model& model, const Workspace& ws, const NodeWrench& load) {
  const UserNode& node = model.nodes[load.node];
  const Pose<double>& N = node.shapes.pose;
  const Mat3<double> R = load.world_axes ? transpose(ws.pose_W(node.sweep).R) : N.R;
  const Force<double> f{R * load.f.n, R * load.f.f};
  return {f.n + cross(N.p, f.f), f.f};
}

Force<double> bias_of_rotor(const Model& model, const Workspace& ws, const Inputs& in, int k, const Vec3<double>& w,
                            const Motion<double>& gamma) {
  const RigidInertia<double>& M = model.bodies[k].M;
  Force<double> z = M * gamma + gyroscopic(M, w);
  if (in.gravity && model.field.pulls() && M.m > 0.0) {
    Vec3<double> c, r;
    z -= soa::attraction(model.field, M, ws.pose_W(k), c, r, in.moment);
  }
  for (const NodeWrench& load : in.wrenches)
    if (model.nodes[load.node].sweep == k) z -= wrench_at_B(model, ws, load);
  return z;
}

}  // namespace cardan
