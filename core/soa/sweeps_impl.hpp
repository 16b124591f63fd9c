#pragma once
// Definitions of sweeps.hpp; included only by the files that instantiate a scalar.
#include "core/soa/gravity_field.hpp"
#include "core/soa/sincos.hpp"
#include "core/soa/sweeps.hpp"
#include "core/soa/workspace_layout.hpp"

namespace cardan::soa {

/// Number of hinge velocities a kernel is compiled for.
constexpr int size_of(KernelKind k) {
  if (is_general(k)) return static_cast<int>(k) - static_cast<int>(KernelKind::general0);
  if (k == KernelKind::fixed) return 0;
  if (is_axis(k)) return 1;
  if (k <= KernelKind::screw) return 1;
  return static_cast<int>(k) - static_cast<int>(KernelKind::dense1) + 1;
}

template <class T, class Rigid, class General>
void for_kernel(KernelKind kind, const Rigid& rigid, const General& general) {
  with_hinge_size<T>(size_of(kind), [&]<int NV>() {
    if (is_general(kind))
      general.template operator()<NV>();
    else
      rigid.template operator()<NV>();
  });
}

/// Calls visit<I, TILT>() of an axis kernel.
template <class Visit>
void for_axis(KernelKind kind, const Visit& visit) {
  switch (kind) {
    case KernelKind::axis_x: return visit.template operator()<0, Tilt::none>();
    case KernelKind::axis_y: return visit.template operator()<1, Tilt::none>();
    case KernelKind::axis_z: return visit.template operator()<2, Tilt::none>();
    case KernelKind::tilt: return visit.template operator()<2, Tilt::beta>();
    default: return visit.template operator()<2, Tilt::alpha_beta>();
  }
}

template <class T>
void Sweeps<T>::hinge_records(const Model& model, Workspace<T>& ws, const Inputs<T>& in) {
  if (model.n_axis > 0) {
    std::size_t i = 0;
    for (const Run& run : model.runs)
      for (int k = run.begin; is_axis(run.kind) && k < run.end; ++k) {
        const AxisBody& b = model.axis_bodies[static_cast<std::size_t>(k)];
        ws.angles[i++] = in.q[b.q] + T(b.q0);
      }
    sine_cosine(ws.angles.data(), ws.sines.data(), ws.cosines.data(), i);
    i = 0;
    for (const Run& run : model.runs)
      for (int k = run.begin; is_axis(run.kind) && k < run.end; ++k, ++i) {
        AxisRecord<T>& r = ws.axis(k);
        r.c = ws.cosines[i];
        r.s = ws.sines[i];
      }
  }
  for (const DenseBatch& batch : model.batches) {
    const auto n = static_cast<std::uint32_t>(batch.iq.size());
    if constexpr (std::is_same_v<T, double>) {
      batch.family->kinematics(batch.packed.data(), n, batch.iq.data(), batch.iv.data(), in.q, in.v, ws.hinge_records() + batch.first);
    } else {
      std::vector<double> q(static_cast<std::size_t>(model.nq)), v(static_cast<std::size_t>(model.nv));
      for (int i = 0; i < model.nq; ++i) q[static_cast<std::size_t>(i)] = static_cast<double>(in.q[i]);
      for (int i = 0; i < model.nv; ++i) v[static_cast<std::size_t>(i)] = static_cast<double>(in.v[i]);
      batch.family->kinematics(batch.packed.data(), n, batch.iq.data(), batch.iv.data(), q.data(), v.data(), ws.hinge_records() + batch.first);
    }
  }
}

template <class T>
void Sweeps<T>::ground(const Model& model, Workspace<T>& ws, const Inputs<T>& in) {
  Core<T>& ground = ws.core(0);
  ground = Core<T>();
  if (in.gravity && model.gravity.kind == GravitySpec::Kind::uniform) {
    const auto& g = model.gravity.g;
    ground.gamma.v = {T(-g.x()), T(-g.y()), T(-g.z())};
  }
  ws.breakdown = {};
}

template <class T>
void Sweeps<T>::outward(const Model& model, Workspace<T>& ws, const Inputs<T>& in, const Run& run, bool vdot, bool velocity) {
  const auto pass = [&]<OutwardFor For>() {
    if (is_axis(run.kind))
      return for_axis(run.kind, [&]<int I, Tilt TILT>() { outward_axis<T, I, TILT, For>(model, ws, in, run.begin, run.end); });
    for_kernel<T>(
        run.kind, [&]<int NV>() { outward_rigid<T, NV, For>(model, ws, in, run.begin, run.end); },
        [&]<int NV>() { outward_general<T, NV, For>(model, ws, in, run.begin, run.end); });
  };
  if (velocity)
    vdot ? pass.template operator()<OutwardFor{true, true}>() : pass.template operator()<OutwardFor{false, true}>();
  else
    vdot ? pass.template operator()<OutwardFor{true, false}>() : pass.template operator()<OutwardFor{false, false}>();
}

template <class T>
void Sweeps<T>::elastic(const Model& model, Workspace<T>& ws, const Inputs<T>& in) {
  elastic_forces(model, ws, in);
}

template <class T>
void Sweeps<T>::world(const Model& model, Workspace<T>& ws, const Inputs<T>& in) {
  ws.pose_W(0) = Pose<T>();
  ws.V(0) = Motion<T>();
  for (int k = 1; k < static_cast<int>(model.bodies.size()); ++k) {
    const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
    const Pose<T> X = pose_in_inboard(model, ws, k);
    ws.pose_W(k) = ws.pose_W(b.parent) * X;
    const Modal<T>* modal = ws.modal_of(k);
    Motion<T> at_inboard = ws.V(b.parent);
    if (modal && modal->node) {
      T s[6];
      sum_columns(model.shapes[static_cast<std::size_t>(b.onode)].columns.data(), in.v + model.bodies[static_cast<std::size_t>(b.parent)].etadot,
                  b.n_parent_modes, s);
      at_inboard += motion_of_node(*modal->node, s);
    }
    Motion<T> V = to_outboard(X, at_inboard);
    for (int j = 0; j < b.nv; ++j) V += in.v[b.v + j] * hinge_column(model, ws, k, j);
    if (modal && modal->C)
      for (int j = 0; j < b.n_modes; ++j) V -= in.v[b.etadot + j] * motion_column(modal->C, j);
    ws.V(k) = V;
  }
}

// The force on mode k is -dU/d eta_k of the same potential: with F the force at the mass centre, Grad = mu/r^3 (3 rhat rhat* - 1)
// and S = (tr J/2) 1 - J the second moments, f_k = I3_k . F/m + 1/2 Grad : dS_k - c . Grad I3_k.
template <class T>
void Sweeps<T>::central_gravity(const Model& model, Workspace<T>& ws, const Inputs<T>& in) {
  using std::sqrt;
  if (!in.gravity) return;
  const GravitySpec& g = model.gravity;
  for (int k = 1; k < static_cast<int>(model.bodies.size()); ++k) {
    const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
    Core<T>& body = ws.core(k);
    Modal<T>* modal = b.n_modes > 0 ? ws.modal_of(k) : nullptr;
    const RigidInertia<T> inertia =
        modal ? gravity_inertia(model.flexible[static_cast<std::size_t>(b.flexible)], b.n_modes, modal->M_rr, in.q + b.eta) : cast<T>(b.M);
    if (!(inertia.m > T(0))) continue;
    Vec3<T> c, r;
    const Force<T> pull = attraction(g, inertia, ws.pose_W(k), c, r);
    body.z -= pull;
    if (!modal) continue;
    const Vec3<T> field = (T(1) / inertia.m) * pull.f;
    const T r2 = dot(r, r), k3 = T(g.mu) / (r2 * sqrt(r2));
    const FlexibleBody& flexible = model.flexible[static_cast<std::size_t>(b.flexible)];
    const ModalIntegrals& I = flexible.data->integrals;
    const T* eta = in.q + b.eta;
    for (int j = 0; j < b.n_modes; ++j) {
      const double* constant = flexible.M_re.data() + 6 * j;
      const T* M_e = modal->P_re + 6 * j;
      const Vec3<T> I3 = modal->P_re ? Vec3<T>{M_e[3], M_e[4], M_e[5]} : Vec3<T>{T(constant[3]), T(constant[4]), T(constant[5])};
      T f = dot(I3, field);
      if (g.gradient) {
        f = f - k3 * (T(3) * dot(c, r) * dot(r, I3) / r2 - dot(c, I3));
        const Eigen::Matrix3d fixed = first_order_inertia(I, j);  // 1/2 Grad : dS = k3/2 (tr dJ - 3 rhat* dJ rhat)
        T dJ[3][3];
        for (int p = 0; p < 3; ++p)
          for (int q = 0; q < 3; ++q) dJ[p][q] = T(fixed(p, q));
        if (flexible.level == 2 && !I.I9.empty())
          for (int l = 0; l < b.n_modes; ++l) {
            const auto& I9 = I.I9[static_cast<std::size_t>(j * b.n_modes + l)];
            for (int p = 0; p < 3; ++p)
              for (int q = 0; q < 3; ++q) dJ[p][q] = dJ[p][q] + eta[l] * T(I9(p, q) + I9(q, p));
          }
        const T rr[3] = {r.x, r.y, r.z};
        T rJr(0);
        for (int p = 0; p < 3; ++p)
          for (int q = 0; q < 3; ++q) rJr = rJr + rr[p] * dJ[p][q] * rr[q];
        f = f + T(0.5) * k3 * (dJ[0][0] + dJ[1][1] + dJ[2][2] - T(3) * rJr / r2);
      }
      modal->z[j] = modal->z[j] - f;
    }
  }
}

template <class T>
void Sweeps<T>::node_wrenches(const Model& model, Workspace<T>& ws, const Inputs<T>& in) {
  for (const NodeWrench<T>& load : in.wrenches) {
    const UserNode& node = model.nodes[static_cast<std::size_t>(load.node)];
    const int k = model.user[static_cast<std::size_t>(node.body)].sweep;
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
    body.z -= Force<T>{f.n + cross(at.rho, f.f), f.f};
    if (!node.shapes.deforms()) continue;
    Modal<T>& modal = *ws.modal_of(k);
    for (int j = 0; j < b.n_modes; ++j) modal.z[j] = modal.z[j] - dot(node_column(node.shapes, at, j), f);
  }
}

template <class T>
void Sweeps<T>::inward(const Model& model, Workspace<T>& ws, const Inputs<T>& in, const Run& run, InwardFor what) {
  const auto pass = [&]<InwardFor For>() {
    if (is_axis(run.kind))
      return for_axis(run.kind, [&]<int I, Tilt TILT>() { inward_axis<T, I, TILT, For>(model, ws, in, run.begin, run.end); });
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
void Sweeps<T>::acceleration(const Model& model, Workspace<T>& ws, const Inputs<T>& in, const Run& run, T* vdot) {
  if (is_axis(run.kind))
    return for_axis(run.kind, [&]<int I, Tilt TILT>() { acceleration_axis<T, I, TILT>(model, ws, vdot, run.begin, run.end); });
  for_kernel<T>(
      run.kind, [&]<int NV>() { acceleration_rigid<T, NV>(model, ws, in, vdot, run.begin, run.end); },
      [&]<int NV>() { acceleration_general<T, NV>(model, ws, in, vdot, run.begin, run.end); });
}

template <class T>
void Sweeps<T>::gather(const Model& model, Workspace<T>& ws, const Run& run, T* tau) {
  if (is_axis(run.kind))
    return for_axis(run.kind, [&]<int I, Tilt TILT>() { gather_axis<T, I, TILT>(model, ws, tau, run.begin, run.end); });
  for_kernel<T>(
      run.kind, [&]<int NV>() { gather_rigid<T, NV>(model, ws, tau, run.begin, run.end); },
      [&]<int NV>() { gather_general<T, NV>(model, ws, tau, run.begin, run.end); });
}

}  // namespace cardan::soa
