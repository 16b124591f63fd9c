#pragma once
// Definitions of sweeps.hpp; included only by the files that instantiate a scalar.
#include <algorithm>

#include "core/soa/gravity_field.hpp"
#include "core/soa/kernels_columns.hpp"
#include "core/soa/kernels_compliance.hpp"
#include "core/soa/kernels_refine.hpp"
#include "core/soa/kernels_square_root.hpp"
#include "core/soa/sincos.hpp"
#include "core/soa/sweeps.hpp"

namespace cardan::soa {

/// Number of hinge velocities a kernel is compiled for.
static constexpr int size_of(BodyKernel k) {
  if (is_general(k)) return static_cast<int>(k) - static_cast<int>(BodyKernel::general0);
  if (k == BodyKernel::fixed) return 0;
  if (is_axis(k)) return 1;
  if (k <= BodyKernel::screw) return 1;
  return static_cast<int>(k) - static_cast<int>(BodyKernel::dense1) + 1;
}

template <class T, class Rigid, class General>
static void for_kernel(BodyKernel kind, const Rigid& rigid, const General& general) {
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

/// A record of frame P becomes that of frame S: R_OS = R_OP R_PS, columns of H* and Hdot* v in S axes.
template <class T>
static void turn_record(const SweepModel& model, Workspace<T>& ws, const TurnedRecord& t) {
  const SweepBody& b = model.bodies[t.body];
  const auto number = [&](int at) { return ws.hinge_number(b.dense, at); };
  const auto set = [&](int at, const Vec3<T>& a) {
    ws.set_hinge_number(b.dense, at, a.x), ws.set_hinge_number(b.dense, at + 1, a.y), ws.set_hinge_number(b.dense, at + 2, a.z);
  };
  const Mat3<T> turned =
      Mat3<T>{number(0), number(1), number(2), number(3), number(4), number(5), number(6), number(7), number(8)} * cast<T>(t.R_PS);
  set(0, {turned.xx, turned.xy, turned.xz}), set(3, {turned.yx, turned.yy, turned.yz}), set(6, {turned.zx, turned.zy, turned.zz});
  const auto turn = [&](int at) { set(at, transpose_times(cast<T>(t.R_PS), Vec3<T>{number(at), number(at + 1), number(at + 2)})); };
  for (int i = 0; i < 2 * b.nv; ++i) turn(12 + 3 * i);
  turn(48), turn(51);
}

template <class T>
static void hinge_records(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in) {
  ws.articulated = false;
  constexpr std::size_t kBlock = 64;
  T angles[kBlock];
  for (std::size_t first = 0; first < model.angles.size(); first += kBlock) {
    const std::size_t count = std::min(kBlock, model.angles.size() - first), filled = (count + 7) / 8 * 8;
    for (std::size_t i = 0; i < count; ++i) angles[i] = in.q[model.angles[first + i].q] + T(model.angles[first + i].q0);
    for (std::size_t i = count; i < filled; ++i) angles[i] = T(0);
    sine_cosine(angles, ws.sines.data() + first, ws.cosines.data() + first, filled);
  }
  for (const DenseBatch& batch : model.batches) family_records(model, ws, in, batch);
  for (const TurnedRecord& t : model.graded.turned) turn_record(model, ws, t);
}

template <class T>
static void ground(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in) {
  ws.z(0) = Force<T>();  // w, gamma_w, delta, E of the ground are zero and stay so; its P is read by nobody
  ws.core(0).gamma.v = in.gravity && model.field.uniform ? -cast<T>(model.field.g) : Vec3<T>{T(0), T(0), T(0)};
  for (const int k : model.rotors) ws.axis(k).load = T(0);
  for (Force<T>& load : ws.loads) load = Force<T>();
  ws.breakdown = {};
}

template <class T>
static void at_rest(const SweepModel& model, Workspace<T>& ws) {
  for (int k = 0; k < static_cast<int>(model.bodies.size()); ++k) {
    ws.z(k) = Force<T>();
    ws.core(k).gamma = Motion<T>();
    if (Modal<T>* modal = ws.modal_of(k))
      for (int j = 0; j < model.bodies[k].n_modes; ++j) modal->z[j] = T(0);
  }
}

/// What a table of sweeps is asked for; every pass more is as long a template as the others.
enum class Wanted {
  all,
  program,  // as run_op() calls it where q is new, and not otherwise
  inverse   // inverse dynamics with v and v' of the whole tree
};
template <class T, Wanted W = Wanted::all>
static void outward(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, const Run& run, OutwardFor what) {
  const auto pass = [&]<OutwardFor For>() {
    if (is_axis(run.kind)) return outward_axes<T, For>(model, ws, in, run.begin, run.end);
    if (run.kind == BodyKernel::free) return outward_free<T, For>(model, ws, in, run.begin, run.end);
    for_kernel<T>(
        run.kind, [&]<int NV>() { outward_rigid<T, NV, For>(model, ws, in, run.begin, run.end); },
        [&]<int NV>() { outward_general<T, NV, For.velocity>(model, ws, in, For.vdot, run.begin, run.end); });
  };
  if constexpr (W == Wanted::inverse)
    pass.template operator()<OutwardFor{true, true, false}>();
  else if constexpr (W == Wanted::program)
    what.vdot ? pass.template operator()<OutwardFor{true, true, true}>() : pass.template operator()<OutwardFor{false, true, true}>();
  else if (!what.inertia && what.vdot)  // inverse dynamics
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
    const SweepBody& b = model.bodies[k];
    const Pose<T> X = pose_in_inboard(model, ws, k, in.q);
    ws.pose_W(k) = ws.pose_W(b.parent) * X;
    ws.V(k) = velocity_of(model, ws, in, k, X, ws.V(b.parent));
  }
}

/// z of body k less a load on it [moment about its mass centre c; force], which is kept for the refinement.
template <class T>
static void add_load(Workspace<T>& ws, int k, const Force<T>& load, const Vec3<T>& c) {
  ws.loads[k] += load;
  ws.z(k) -= Force<T>{load.n + cross(c, load.f), load.f};
}

// Of a field of a family: body by body, with a, da/dr and U at the mass centre (docs/mathematics/gravity.md 5).
template <class T>
static void gravity_of_source(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in) {
  const GravityField& g = model.field;
  for (int k = 1; k < static_cast<int>(model.bodies.size()); ++k) {
    const SweepBody& b = model.bodies[k];
    const int carrier = b.kind == BodyKernel::rotor ? b.parent : k;
    Modal<T>* modal = b.n_modes > 0 ? ws.modal_of(k) : nullptr;
    if (!model.graded.own.empty()) {
      const CentralInertia &own = model.graded.own[k], &swept = model.graded.swept[carrier];
      if (!(own.m > 0.0)) continue;
      const T trace(own.S.xx + own.S.yy + own.S.zz);
      const Sym3<T> J{trace - T(own.S.xx), trace - T(own.S.yy), trace - T(own.S.zz), -T(own.S.xy), -T(own.S.xz), -T(own.S.yz)};
      const FieldPull<T> pull = field_pull(g, in.moment, T(own.m), cast<T>(own.c), J, ws.pose_W(carrier));
      add_load(ws, carrier, {pull.torque + cross(cast<T>(own.c - swept.c), pull.force), pull.force}, cast<T>(swept.c));
      continue;
    }
    const RigidInertia<T> inertia =
        modal ? gravity_inertia(model.flexible[b.flexible], b.n_modes, modal->M_rr, in.q + b.eta) : cast<T>(carrier == k ? b.M : b.M_sweep);
    if (!(inertia.m > T(0))) continue;
    const FieldPull<T> pull = pull_of_source(g, in.moment, inertia, ws.pose_W(carrier));
    const Vec3<T> c = (T(1) / inertia.m) * inertia.h;
    ws.z(carrier) -= Force<T>{pull.torque + cross(c, pull.force), pull.force};
    if (modal)
      add_pull_on_modes(model.flexible[b.flexible], *modal, b.n_modes, in.q + b.eta,
                        pull_on_modes<T>((T(1) / inertia.m) * pull.force, c, pull.gradient), T(-1), modal->z);
  }
}

// The force on mode k is -dU/d eta_k of the same potential: with F the force at the mass centre, G = mu/r^3 (3 rhat rhat* - 1)
// and S = (tr J/2) 1 - J the second moments, f_k = I3_k . F/m + 1/2 G : dS_k - c . G I3_k.
template <class T>
static void central_gravity(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in) {
  using std::sqrt;
  if (!in.gravity) return;
  const GravityField& g = model.field;
  if (g.source) return gravity_of_source(model, ws, in);
  for (int k = 1; k < static_cast<int>(model.bodies.size()); ++k) {
    const SweepBody& b = model.bodies[k];
    const int carrier = b.kind == BodyKernel::rotor ? b.parent : k;  // the pull on a rotor has no moment about its axis
    Modal<T>* modal = b.n_modes > 0 ? ws.modal_of(k) : nullptr;
    const RigidInertia<T> inertia =
        modal ? gravity_inertia(model.flexible[b.flexible], b.n_modes, modal->M_rr, in.q + b.eta) : cast<T>(carrier == k ? b.M : b.M_sweep);
    if (!(inertia.m > T(0))) continue;
    if (!model.graded.own.empty()) {  // the same about mass centres
      const CentralInertia &own = model.graded.own[k], &swept = model.graded.swept[carrier];
      const T trace(own.S.xx + own.S.yy + own.S.zz);
      const Sym3<T> J{trace - T(own.S.xx), trace - T(own.S.yy), trace - T(own.S.zz), -T(own.S.xy), -T(own.S.xz), -T(own.S.yz)};
      const Pose<T>& W = ws.pose_W(carrier);
      const Force<T> pull = attraction(g, T(own.m), J, transpose_times(W.R, W.p - cast<T>(g.centre)) + cast<T>(own.c));
      add_load(ws, carrier, {pull.n + cross(cast<T>(own.c - swept.c), pull.f), pull.f}, cast<T>(swept.c));
      continue;
    }
    Vec3<T> c, r;
    const Force<T> pull = attraction(g, inertia, ws.pose_W(carrier), c, r, nullptr);
    ws.z(carrier) -= pull;
    if (!modal) continue;
    Mat3<T> G{};
    if (g.gradient) {
      const T r2 = dot(r, r), k3 = T(g.mu) / (r2 * sqrt(r2)), k5 = T(3) * k3 / r2;
      G = {k5 * r.x * r.x - k3, k5 * r.x * r.y, k5 * r.x * r.z, k5 * r.x * r.y,     k5 * r.y * r.y - k3,
           k5 * r.y * r.z,      k5 * r.x * r.z, k5 * r.y * r.z, k5 * r.z * r.z - k3};
    }
    add_pull_on_modes(model.flexible[b.flexible], *modal, b.n_modes, in.q + b.eta, pull_on_modes<T>((T(1) / inertia.m) * pull.f, c, G),
                      T(-1), modal->z);
  }
}

/// A load on a node of body k seen from it, the node turned by R_BN at rho: body axes, moments about the node and about B.
template <class T>
struct LoadOnBody {
  Force<T> at_node, at_B;
};
template <class T>
CARDAN_INLINE LoadOnBody<T> seen_from_body(const Workspace<T>& ws, int k, const NodeWrench<T>& load, const Mat3<T>& R_BN,
                                           const Vec3<T>& rho) {
  const Mat3<T>* R_WB = load.world_axes ? &ws.pose_W(k).R : nullptr;
  const Force<T> f =
      R_WB ? Force<T>{transpose_times(*R_WB, load.f.n), transpose_times(*R_WB, load.f.f)} : Force<T>{R_BN * load.f.n, R_BN * load.f.f};
  return {f, {f.n + cross(rho, f.f), f.f}};
}
template <class T>
[[gnu::noinline]] static void load_deforming_node(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in,
                                                  const NodeWrench<T>& load) {
  const UserNode& node = model.nodes[load.node];
  const int k = node.sweep;
  DeformedNode<T> at;
  deform<T>(model, ws, k, node.shapes, in.q, nullptr, at);
  const LoadOnBody<T> f = seen_from_body(ws, k, load, at.R, at.rho);
  ws.z(k) -= f.at_B;
  Modal<T>& modal = *ws.modal_of(k);
  for (int j = 0; j < model.bodies[k].n_modes; ++j) modal.z[j] = modal.z[j] - dot(node_column(node.shapes, at, j), f.at_node);
}
template <class T>
static void node_wrenches(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in) {
  const bool graded = !ws.loads.empty();  // of rigid trees
  for (const NodeWrench<T>& load : in.wrenches) {
    const UserNode& node = model.nodes[load.node];
    const int k = node.sweep;
    if (k == 0) continue;
    if (node.shapes.deforms()) {
      load_deforming_node(model, ws, in, load);
      continue;
    }
    const SweepBody& b = model.bodies[k];
    const LoadOnBody<T> f = seen_from_body(ws, k, load, cast<T>(node.shapes.pose.R), cast<T>(node.shapes.pose.p));
    if (b.kind == BodyKernel::rotor) {
      ws.axis(k).load = ws.axis(k).load + dot(cast<T>(b.axis), f.at_B.n);
      const Force<T> at_A = to_inboard(pose_in_inboard(model, ws, k, in.q), f.at_B);
      if (graded) {
        const Vec3<T> c = cast<T>(model.graded.swept[b.parent].c);
        add_load(ws, b.parent, {at_A.n - cross(c, at_A.f), at_A.f}, c);
      } else {
        ws.z(b.parent) -= at_A;
      }
    } else if (graded) {
      const Force<T>& at_N = f.at_node;
      add_load(ws, k, {at_N.n + cross(cast<T>(model.graded.arm[load.node]), at_N.f), at_N.f}, cast<T>(model.graded.swept[k].c));
    } else {
      ws.z(k) -= f.at_B;
    }
  }
}

template <class T>
static void inward(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, const Run& run, InwardFor what) {
  const auto pass = [&]<InwardFor For>() {
    if (is_axis(run.kind)) return inward_axes<T, For>(model, ws, in, run.begin, run.end);
    if (run.kind == BodyKernel::free) return inward_free<T, For>(model, ws, in, run.begin, run.end);
    for_kernel<T>(
        run.kind, [&]<int NV>() { inward_rigid<T, NV, For>(model, ws, in, run.begin, run.end); },
        [&]<int NV>() {
          if constexpr (NV > 1)
            if (run.square_root) return inward_square_root<T, NV>(model, ws, in, For, run.begin, run.end);
          inward_general<T, NV>(model, ws, in, For, run.begin, run.end);
        });
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
  if (is_axis(run.kind)) return acceleration_axes<T>(model, ws, vdot, run.begin, run.end);
  if (run.kind == BodyKernel::free) return acceleration_free<T>(model, ws, in, vdot, run.begin, run.end);
  for_kernel<T>(
      run.kind, [&]<int NV>() { acceleration_rigid<T, NV>(model, ws, in, vdot, run.begin, run.end); },
      [&]<int NV>() {
        if constexpr (NV > 1)
          if (run.square_root) return acceleration_square_root<T, NV>(model, ws, in, vdot, run.begin, run.end);
        acceleration_general<T, NV>(model, ws, in, vdot, run.begin, run.end);
      });
}

// With every pass the error of v' falls by a factor of the size of the relative error of the sweeps, which is what the first pass
// finds. Each lane by itself, so that its bits do not depend on the others: a lane that has enough, or that a pass does not bring
// nearer, keeps its v'.
template <class T>
static void refine(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, T* vdot) {
  const auto nv = static_cast<std::size_t>(model.nv);
  T* d = ws.correction.data();
  T size(1e-300), rate(0), more(1);
  for (std::size_t i = 0; i < nv; ++i) size = larger(magnitude(vdot[i]), size);
  T before = size;
  for (int pass = 1; pass <= kPasses; ++pass) {
    rebase(model, ws);
    ws.z(0) = Force<T>();
    for (auto run = model.runs.rbegin(); run != model.runs.rend(); ++run) inward(model, ws, in, *run, {.inertia = false});
    for (const Run& run : model.runs) acceleration(model, ws, in, run, d);
    for (const int k : model.rotors) {  // all of v', not the rest
      const auto i = static_cast<std::size_t>(model.bodies[k].v);
      d[i] = d[i] - vdot[i];
    }
    for (std::size_t i = 0; i < model.prescribed.size(); ++i)
      if (model.prescribed[i]) d[i] = T(0);
    T now(0);
    for (std::size_t i = 0; i < nv; ++i) now = larger(magnitude(d[i]), now);
    more = more * above(before, now);
    for (std::size_t i = 0; i < nv; ++i) vdot[i] = vdot[i] + more * d[i];
    if (pass == 1) rate = T(kRate) * now / size;
    more = more * above(rate * now / size, T(kRefined));
    before = now;
    if (T(0.5) > more) return;
  }
}

template <class T>
static void gather(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, const Run& run, T* tau) {
  if (is_axis(run.kind)) return gather_axes<T>(model, ws, in, tau, run.begin, run.end);
  if (run.kind == BodyKernel::free) return gather_free<T>(model, ws, in, tau, run.begin, run.end);
  for_kernel<T>(
      run.kind, [&]<int NV>() { gather_rigid<T, NV>(model, ws, tau, run.begin, run.end); },
      [&]<int NV>() { gather_general<T, NV>(model, ws, tau, run.begin, run.end); });
}

/// P, D and G of all bodies of a rigid tree. False where a direction has no inertia.
template <class T>
static bool articulate(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in) {
  for (std::size_t k = 1; k < model.bodies.size(); ++k)
    if (is_axis(model.bodies[k].kind)) {
      const AxisBody& a = model.axis_bodies[k];
      if (!a.leaf && a.kind != BodyKernel::rotor) start(a, ws.core(static_cast<int>(k)).P);
    }
  for (auto run = model.runs.rbegin(); run != model.runs.rend(); ++run) {
    inward(model, ws, in, *run, {.bias = false});
    if (ws.breakdown.body != 0) return false;
  }
  return true;
}

template <class T>
static void mass_matrix_inverse(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, T* inverse) {
  if (articulate(model, ws, in)) inverse_by_columns(model, ws, inverse);
}

template <class T>
static void node_compliance(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, NodeColumns& work) {
  if (articulate(model, ws, in)) compliance_of_nodes(model, ws, in, work);
}

/// Those of inverse dynamics alone.
template <class T>
static constexpr Sweeps<T> make_inverse_sweeps() {
  return {.ground = ground<T>,
          .hinge_records = hinge_records<T>,
          .outward = outward<T, Wanted::inverse>,
          .elastic = elastic<T>,
          .world = world<T>,
          .central_gravity = central_gravity<T>,
          .node_wrenches = node_wrenches<T>,
          .gather = gather<T>};
}

/// The table of one scalar, for the instruction set that the including file is compiled for.
template <class T, Wanted W = Wanted::all>
static constexpr Sweeps<T> make_sweeps() {
  Sweeps<T> all{.ground = ground<T>,
                .at_rest = at_rest<T>,
                .hinge_records = hinge_records<T>,
                .outward = outward<T, W>,
                .elastic = elastic<T>,
                .world = world<T>,
                .central_gravity = central_gravity<T>,
                .node_wrenches = node_wrenches<T>,
                .inward = inward<T>,
                .acceleration = acceleration<T>,
                .refine = refine<T>};
  if constexpr (W == Wanted::all) all.gather = gather<T>;
  if constexpr (W == Wanted::all && kWidth<T> == 1) all.mass_matrix = mass_matrix<T>, all.mass_matrix_inverse = mass_matrix_inverse<T>;
  if constexpr (W == Wanted::all && std::is_same_v<T, double>) all.node_compliance = node_compliance<T>;
  return all;
}

}  // namespace cardan::soa
