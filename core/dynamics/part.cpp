#include "core/dynamics/part.hpp"

#include "core/soa/gravity_field.hpp"

namespace cardan {

std::vector<Run> stretches(const std::vector<Run>& runs, const std::vector<std::uint8_t>& marked) {
  std::vector<Run> out;
  for (const Run& run : runs)
    for (int k = run.begin; k < run.end; ++k) {
      if (!marked[k]) continue;
      if (k > run.begin && marked[k - 1])
        ++out.back().end;
      else
        out.push_back({k, k + 1, run.kind, run.prescribed, run.square_root});
    }
  return out;
}

Part part_of(const SweepModel& model, std::span<const int> sweep_bodies) {
  Part out;
  out.takes_part.assign(model.bodies.size(), 0);
  for (const int k : sweep_bodies) out.takes_part[k] = 1;
  std::vector<std::uint8_t> still(model.bodies.size(), 0);
  for (const int k : sweep_bodies)
    if (const int inboard = model.bodies[k].parent; !out.takes_part[inboard])
      for (int p = inboard; p > 0 && !still[p]; p = model.bodies[p].parent) still[p] = 1;
  out.runs = stretches(model.runs, out.takes_part);
  out.still = stretches(model.runs, still);
  for (const int k : model.rotors)
    if (!out.takes_part[k] && out.takes_part[model.bodies[k].parent]) out.rotors_left_out.push_back(k);
  return out;
}

namespace {

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

}  // namespace

template <class T>
void outward_of_part(const SweepModel& model, const soa::Sweeps<T>& S, soa::Workspace<T>& ws, const soa::Inputs<T>& in,
                     soa::OutwardFor what, const Part& part) {
  for (const Run& run : part.still) S.outward(model, ws, in, run, {.velocity = false});
  for (const Run& run : part.still)
    for (int k = run.begin; k < run.end; ++k) ws.core(k).gamma.v = held(ws.core(k).gamma.v);
  for (const Run& run : part.runs) S.outward(model, ws, in, run, what);
  for (const int k : part.rotors_left_out) {
    const SweepBody& rotor = model.bodies[k];
    const soa::Core<T>& carrier = ws.core(rotor.parent);
    const RigidInertia<T> M = cast<T>(rotor.M_sweep);
    ws.z(rotor.parent) -= M * carrier.gamma + gyroscopic(M, carrier.w);
  }
}
template <class T>
void world_of_part(const SweepModel& model, const soa::Sweeps<T>&, soa::Workspace<T>& ws, const soa::Inputs<T>& in, const Part& part) {
  for (int k = 1; k < static_cast<int>(model.bodies.size()); ++k) {
    const int inboard = model.bodies[k].parent;
    if (part.takes_part[k]) {
      const Pose<T> X = soa::pose_in_inboard(model, ws, k, in.q);
      ws.pose_W(k) = ws.pose_W(inboard) * X;
      ws.V(k) = soa::velocity_of(model, ws, in, k, X, ws.V(inboard));
    } else {
      ws.pose_W(k) = held(ws.pose_W(k));
      ws.V(k) = Motion<T>{{T(0), T(0), T(0)}, {T(0), T(0), T(0)}};
    }
  }
}

template <class T>
void gather_of_part(const SweepModel& model, const soa::Sweeps<T>& S, soa::Workspace<T>& ws, const soa::Inputs<T>& in, T* tau,
                    const Part& part) {
  const bool central = in.gravity && model.field.pulls();
  for (const int k : part.rotors_left_out)
    if (const SweepBody& rotor = model.bodies[k]; central && rotor.M.m > 0.0) {
      Vec3<T> c, r;
      ws.z(rotor.parent) += soa::attraction(model.field, cast<T>(rotor.M_sweep), ws.pose_W(rotor.parent), c, r, in.moment);
    }
  soa::Inputs<T> use = in;
  for (const soa::NodeWrench<T>& w : in.wrenches) {
    if (!part.takes_part[model.nodes[w.node].sweep]) continue;
    use.wrenches = {&w, 1};
    S.node_wrenches(model, ws, use);
  }
  for (auto run = part.runs.rbegin(); run != part.runs.rend(); ++run) S.gather(model, ws, use, *run, tau);
}

#define CARDAN_PARTS(T)                                                                                                               \
  template void outward_of_part(const SweepModel&, const soa::Sweeps<T>&, soa::Workspace<T>&, const soa::Inputs<T>&, soa::OutwardFor, \
                                const Part&);                                                                                         \
  template void world_of_part(const SweepModel&, const soa::Sweeps<T>&, soa::Workspace<T>&, const soa::Inputs<T>&, const Part&);      \
  template void gather_of_part(const SweepModel&, const soa::Sweeps<T>&, soa::Workspace<T>&, const soa::Inputs<T>&, T*, const Part&)
CARDAN_PARTS(double);
CARDAN_PARTS(soa::Tangent);
#undef CARDAN_PARTS

}  // namespace cardan
