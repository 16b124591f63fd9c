#pragma once
// Definitions of sweeps.hpp; included only by the files that instantiate a scalar.
#include "core/soa/gravity_field.hpp"
#include "core/soa/sincos.hpp"
#include "core/soa/sweeps.hpp"

namespace cardan::soa {

/// Number of hinge velocities a kernel is compiled for.
static constexpr int size_of(KernelKind k) {
  if (is_general(k)) return static_cast<int>(k) - static_cast<int>(KernelKind::general0);
  if (k == KernelKind::fixed) return 0;
  if (is_axis(k)) return 1;
  if (k <= KernelKind::screw) return 1;
  return static_cast<int>(k) - static_cast<int>(KernelKind::dense1) + 1;
}

template <class T, class Rigid, class General>
static void for_kernel(KernelKind kind, const Rigid& rigid, const General& general) {
  with_hinge_size<T>(size_of(kind), [&]<int NV>() {
    if (is_general(kind))
      general.template operator()<NV>();
    else
      rigid.template operator()<NV>();
  });
}

/// Fills the records of one family, in double.
static inline void family_records(const SweepModel&, Workspace<double>& ws, const Inputs<double>& in, const DenseBatch& batch) {
  const auto n = static_cast<std::uint32_t>(batch.iq.size());
  batch.family->kinematics(batch.packed.data(), n, batch.iq.data(), batch.iv.data(), in.q, in.v, ws.hinge_records(0) + batch.first);
}
/// Any other scalar: lane by lane through double.
template <class T>
static void family_records(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, const DenseBatch& batch) {
  const auto n = static_cast<std::uint32_t>(batch.iq.size());
  double *q = ws.family.data(), *v = q + model.nq;
  for (int l = 0; l < kWidth<T>; ++l) {
    for (int i = 0; i < model.nq; ++i) q[i] = lane(in.q[i], l);
    for (int i = 0; i < model.nv; ++i) v[i] = lane(in.v[i], l);
    batch.family->kinematics(batch.packed.data(), n, batch.iq.data(), batch.iv.data(), q, v, ws.hinge_records(l) + batch.first);
  }
}

template <class T>
static void hinge_records(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in) {
  ws.articulated = false;
  if (!model.angles.empty()) {
    T* angle = ws.angles.data();
    for (const AxisAngle& a : model.angles) *angle++ = in.q[a.q] + T(a.q0);
    sine_cosine(ws.angles.data(), ws.sines.data(), ws.cosines.data(), ws.angles.size());
  }
  for (const DenseBatch& batch : model.batches) family_records(model, ws, in, batch);
}

template <class T>
static void ground(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in) {
  Core<T>& ground = ws.core(0);  // w, gamma_w, delta, E of the ground are zero and stay so; its P is read by nobody
  ground.z = Force<T>();
  ground.gamma.v = in.gravity && model.field.uniform ? -cast<T>(model.field.g) : Vec3<T>{T(0), T(0), T(0)};
  for (const int k : model.rotors) ws.axis(k).load = T(0);
  ws.breakdown = {};
}

template <class T>
static void at_rest(const SweepModel& model, Workspace<T>& ws) {
  for (int k = 0; k < static_cast<int>(model.bodies.size()); ++k) {
    ws.core(k).z = Force<T>();
    ws.core(k).gamma = Motion<T>();
    if (Modal<T>* modal = ws.modal_of(k))
      for (int j = 0; j < model.bodies[static_cast<std::size_t>(k)].n_modes; ++j) modal->z[j] = T(0);
  }
}

template <class T>
static void outward(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, const Run& run, OutwardFor what) {
  const auto pass = [&]<OutwardFor For>() {
    if (is_axis(run.kind))
      return outward_axes<T, For>(model, ws, in, run.begin, run.end);
    if (run.kind == KernelKind::free) return outward_free<T, For>(model, ws, in, run.begin, run.end);
    for_kernel<T>(
        run.kind, [&]<int NV>() { outward_rigid<T, NV, For>(model, ws, in, run.begin, run.end); },
        [&]<int NV>() { outward_general<T, NV, For>(model, ws, in, run.begin, run.end); });
  };
  if (!what.inertia && what.vdot)  // inverse dynamics
    what.velocity ? pass.template operator()<OutwardFor{true, true, false}>() : pass.template operator()<OutwardFor{true, false, false}>();
  else if (!what.inertia)  // forward dynamics once more at the same q
    pass.template operator()<OutwardFor{false, true, false}>();
  else if (what.velocity)
    what.vdot ? pass.template operator()<OutwardFor{true, true, true}>() : pass.template operator()<OutwardFor{false, true, true}>();
  else
    pass.template operator()<OutwardFor{false, false, true}>();
}

template <class T>
static void world(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in) {
  ws.pose_W(0) = Pose<T>();
  ws.V(0) = Motion<T>();
  for (int k = 1; k < static_cast<int>(model.bodies.size()); ++k) {
    const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
    const Pose<T> X = pose_in_inboard(model, ws, k, in.q);
    ws.pose_W(k) = ws.pose_W(b.parent) * X;
    ws.V(k) = velocity_of(model, ws, in, k, X, ws.V(b.parent));
  }
}

// The force on mode k is -dU/d eta_k of the same potential: with F the force at the mass centre, Grad = mu/r^3 (3 rhat rhat* - 1)
// and S = (tr J/2) 1 - J the second moments, f_k = I3_k . F/m + 1/2 Grad : dS_k - c . Grad I3_k.
template <class T>
static void central_gravity(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in) {
  using std::sqrt;
  if (!in.gravity) return;
  const GravityField& g = model.field;
  for (int k = 1; k < static_cast<int>(model.bodies.size()); ++k) {
    const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
    const int carrier = b.kind == KernelKind::rotor ? b.parent : k;  // the pull on a rotor has no moment about its axis
    Core<T>& body = ws.core(carrier);
    Modal<T>* modal = b.n_modes > 0 ? ws.modal_of(k) : nullptr;
    const RigidInertia<T> inertia =
        modal ? gravity_inertia(model.flexible[static_cast<std::size_t>(b.flexible)], b.n_modes, modal->M_rr, in.q + b.eta) : cast<T>(carrier == k ? b.M : b.M_sweep);
    if (!(inertia.m > T(0))) continue;
    Vec3<T> c, r;
    const Force<T> pull = attraction(g, inertia, ws.pose_W(carrier), c, r);
    body.z -= pull;
    if (!modal) continue;
    const Vec3<T> field = (T(1) / inertia.m) * pull.f;
    const T r2 = dot(r, r), k3 = T(g.mu) / (r2 * sqrt(r2));
    const FlexibleBody& flexible = model.flexible[static_cast<std::size_t>(b.flexible)];
    const T* eta = in.q + b.eta;
    for (int j = 0; j < b.n_modes; ++j) {
      const double* constant = flexible.M_re.data() + 6 * j;
      const T* M_e = modal->P_re ? modal->P_re + 6 * j : nullptr;
      const Vec3<T> I3 = M_e ? Vec3<T>{M_e[3], M_e[4], M_e[5]} : Vec3<T>{T(constant[3]), T(constant[4]), T(constant[5])};
      T f = dot(I3, field);
      if (g.gradient) {
        f = f - k3 * (T(3) * dot(c, r) * dot(r, I3) / r2 - dot(c, I3));
        // 1/2 Grad : dS = k3/2 (tr dJ - 3 rhat* dJ rhat)
        Sym3<T> dJ = inertia_derivative<T>(flexible.dJ.data() + 6 * j);
        for (int l = 0; l < b.n_modes && !flexible.d2J.empty(); ++l) dJ += scaled(eta[l], inertia_derivative<T>(flexible.d2J.data() + 6 * (j * b.n_modes + l)));
        f = f + T(0.5) * k3 * (dJ.xx + dJ.yy + dJ.zz - T(3) * dot(r, dJ * r) / r2);
      }
      modal->z[j] = modal->z[j] - f;
    }
  }
}

template <class T>
static void node_wrenches(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in) {
  for (const NodeWrench<T>& load : in.wrenches) {
    const UserNode& node = model.nodes[static_cast<std::size_t>(load.node)];
    const int k = node.sweep;
    if (k == 0) continue;
    const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
    Core<T>& body = ws.core(k);
    DeformedNode<T> at;
    at.R = cast<T>(node.shapes.pose.R);
    at.rho = cast<T>(node.shapes.pose.p);
    if (node.shapes.deforms()) deform<T>(node.shapes, in.q + b.eta, nullptr, at);
    Force<T> f;  // body axes, at the node
    if (load.world_axes) {
      const Mat3<T>& R = ws.pose_W(k).R;
      f = {transpose_times(R, load.f.n), transpose_times(R, load.f.f)};
    } else {
      f = {at.R * load.f.n, at.R * load.f.f};
    }
    const Force<T> at_B{f.n + cross(at.rho, f.f), f.f};
    if (b.kind == KernelKind::rotor) {
      ws.axis(k).load = ws.axis(k).load + dot(cast<T>(b.axis), at_B.n);
      ws.core(b.parent).z -= to_inboard(pose_in_inboard(model, ws, k, in.q), at_B);
      continue;
    }
    body.z -= at_B;
    if (!node.shapes.deforms()) continue;
    Modal<T>& modal = *ws.modal_of(k);
    for (int j = 0; j < b.n_modes; ++j) modal.z[j] = modal.z[j] - dot(node_column(node.shapes, at, j), f);
  }
}

template <class T>
static void inward(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, const Run& run, InwardFor what) {
  const auto pass = [&]<InwardFor For>() {
    if (is_axis(run.kind))
      return inward_axes<T, For>(model, ws, in, run.begin, run.end);
    if (run.kind == KernelKind::free) return inward_free<T, For>(model, ws, in, run.begin, run.end);
    for_kernel<T>(
        run.kind, [&]<int NV>() { inward_rigid<T, NV, For>(model, ws, in, run.begin, run.end); },
        [&]<int NV>() { inward_general<T, NV, For>(model, ws, in, run.begin, run.end); });
  };
  if (what.inertia && what.bias)
    pass.template operator()<InwardFor{true, true}>();
  else if (what.inertia)
    pass.template operator()<InwardFor{true, false}>();
  else
    pass.template operator()<InwardFor{false, true}>();
}

template <class T>
static void acceleration(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, const Run& run, T* vdot) {
  if (is_axis(run.kind))
    return acceleration_axes<T>(model, ws, vdot, run.begin, run.end);
  if (run.kind == KernelKind::free) return acceleration_free<T>(model, ws, in, vdot, run.begin, run.end);
  for_kernel<T>(
      run.kind, [&]<int NV>() { acceleration_rigid<T, NV>(model, ws, in, vdot, run.begin, run.end); },
      [&]<int NV>() { acceleration_general<T, NV>(model, ws, in, vdot, run.begin, run.end); });
}

template <class T>
static void gather(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, const Run& run, T* tau) {
  if (is_axis(run.kind))
    return gather_axes<T>(model, ws, in, tau, run.begin, run.end);
  if (run.kind == KernelKind::free) return gather_free<T>(model, ws, in, tau, run.begin, run.end);
  for_kernel<T>(
      run.kind, [&]<int NV>() { gather_rigid<T, NV>(model, ws, tau, run.begin, run.end); },
      [&]<int NV>() { gather_general<T, NV>(model, ws, tau, run.begin, run.end); });
}

/// M^-1 = (I - H psi K)* D^-1 (I - H psi K), nv x nv, column-major: column j is the acceleration that a unit force on hinge
/// velocity j gives to a system at rest. Tip to base the force meets only the bodies between its own and the ground; base to tip
/// the accelerations are needed only of the bodies up to its own, the rest follows by symmetry.
template <class T>
static void mass_matrix_inverse(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, T* inverse) {
  const int n = static_cast<int>(model.bodies.size()), nv = model.nv;
  for (int k = 1; k < n; ++k)
    if (is_axis(model.bodies[static_cast<std::size_t>(k)].kind)) {
      const AxisBody& a = model.axis_bodies[static_cast<std::size_t>(k)];
      if (!a.leaf && a.kind != KernelKind::rotor) start(a, ws.core(k).P);
      ws.axis(k).nu = T(0);
    }
  for (auto run = model.runs.rbegin(); run != model.runs.rend(); ++run) {
    inward(model, ws, in, *run, {.inertia = true, .bias = !is_axis(run->kind)});  // nu = 0 where the path does not pass
    if (ws.breakdown.body != 0) return;
  }
  T* unit = ws.rest.data();  // the force
  Inputs<T> use = in;
  use.tau = unit;
  for (int k = 1; k < n; ++k) {
    const SweepBody& own = model.bodies[static_cast<std::size_t>(k)];
    for (int v = own.v; v < own.v + own.nv; ++v) {
      T* column = inverse + static_cast<std::ptrdiff_t>(nv) * v;
      unit[v] = T(1);
      for (int p = k; p > 0; p = model.bodies[static_cast<std::size_t>(p)].parent) {
        const SweepBody& b = model.bodies[static_cast<std::size_t>(p)];
        if (b.kind == KernelKind::free && p != k) break;  // six free components without force let nothing through
        if (is_axis(b.kind))
          inward_axes<T, InwardFor{false, true}>(model, ws, use, p, p + 1);
        else
          inward(model, ws, use, {p, p + 1, b.kind}, {.inertia = false});
      }
      unit[v] = T(0);
      for (const Run& run : model.runs) {
        if (run.begin > k) break;
        acceleration(model, ws, in, {run.begin, run.end < k + 1 ? run.end : k + 1, run.kind}, column);
      }
      for (int i = 1; i <= k; ++i) {
        const SweepBody& b = model.bodies[static_cast<std::size_t>(i)];
        for (int l = b.v; l < b.v + b.nv; ++l) inverse[static_cast<std::ptrdiff_t>(nv) * l + v] = column[l];
      }
      for (int p = k; p > 0; p = model.bodies[static_cast<std::size_t>(p)].parent) {  // z = 0, nu = 0 again
        const SweepBody& b = model.bodies[static_cast<std::size_t>(p)];
        ws.core(p).z = Force<T>();
        if (is_axis(b.kind))
          ws.axis(p).nu = T(0);
        else if (b.kind == KernelKind::free)
          for (T& x : ws.free(p).tau) x = T(0);
        else
          inward(model, ws, use, {p, p + 1, b.kind}, {.inertia = false});
      }
    }
  }
}

/// The table of one scalar, for the instruction set that the including file is compiled for.
template <class T>
static constexpr Sweeps<T> make_sweeps() {
  return {ground<T>, at_rest<T>, hinge_records<T>, outward<T>, elastic<T>, world<T>, central_gravity<T>, node_wrenches<T>, inward<T>, acceleration<T>, gather<T>, mass_matrix<T>, mass_matrix_inverse<T>};
}

}  // namespace cardan::soa
