#include "core/operators/linear_column.hpp"

#include "core/base/diagnostic.hpp"
#include "core/dynamics/hinge_laws.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/dynamics/node_motion.hpp"
#include "core/operators/apply.hpp"
#include "core/soa/kernels_tangent.hpp"

namespace cardan::operators::linear {

using Eigen::VectorXd;

namespace {

/// Momentum about the world's origin, world axes, with what devices store. `ws` has been through pose and world of this q, v.
Force<Tangent> momentum(const Scope& scope, soa::Workspace<Tangent>& ws, const soa::Inputs<Tangent>& in, DeviceTangents* devices) {
  const Model& m = scope.m;
  Force<Tangent> sum{{0, 0, 0}, {0, 0, 0}};
  if (devices) sum.n += devices->stored_momentum();
  for (int k = 1; k < static_cast<int>(m.bodies.size()); ++k) {
    if (!scope.has(k)) continue;
    const SweepBody& b = m.bodies[k];
    Force<Tangent> h;
    if (const soa::Modal<Tangent>* modal = ws.modal_of(k); modal && b.n_modes > 0) {
      h = modal->M_rr * ws.V(k);
      const FlexibleBody& f = m.flexible[b.flexible];
      for (int j = 0; j < b.n_modes; ++j) {
        Tangent column[6];
        for (int i = 0; i < 6; ++i) column[i] = modal->P_re ? modal->P_re[6 * j + i] : Tangent(f.M_re[6 * j + i]);
        h += in.v[b.etadot + j] * soa::force_column(column, 0);
      }
    } else {
      h = cast<Tangent>(b.M) * ws.V(k);
      if (devices && !m.varies.empty() && m.varies[static_cast<std::size_t>(k)]) {
        const Motion<Tangent>& V = ws.V(k);
        const Force<double> dh = devices->inertia_rate(k) * Motion<double>{{V.w.x.x, V.w.y.x, V.w.z.x}, {V.v.x.x, V.v.y.x, V.v.z.x}};
        h += Force<Tangent>{{{0.0, dh.n.x}, {0.0, dh.n.y}, {0.0, dh.n.z}}, {{0.0, dh.f.x}, {0.0, dh.f.y}, {0.0, dh.f.z}}};
      }
    }
    sum += to_inboard(ws.pose_W(k), h);
  }
  return sum;
}

}  // namespace

Column::Column(const Scope& scope, const OperatingPoint& at, const PortList& inputs, const PortList& outputs)
    : q(scope.m.nq),
      v(scope.m.nv, 0.0),
      vdot(scope.m.nv, 0.0),
      u(inputs.ports.size()),
      scope_(scope),
      m_(scope.m),
      at_(at),
      inputs_(inputs),
      outputs_(outputs),
      tau_(m_.nv),
      given_(m_.nv),
      back_(m_.nv, 0.0),
      residual_(scope.nv()),
      solved_(scope.nv()) {
  for (int i = 0; i < m_.nq; ++i) q[i] = at.q[i];
  for (const int i : scope.components) v[i] = at.v[i];
  for (const NodeWrench& w : at.wrenches) wrenches_.push_back({w.node, w.world_axes, {cast<Tangent>(w.f.n), cast<Tangent>(w.f.f)}});
  for (std::size_t i = 0; i < u.size(); ++i) {
    u[i] = 0.0;
    if (inputs.ports[i].kind == Port::force || inputs.ports[i].kind == Port::torque)
      wrenches_.push_back({inputs.ports[i].index, false, {{0, 0, 0}, {0, 0, 0}}});
  }
  if (!scope.blocks && !wrenches_.empty() && !m_.has(OpCode::node_wrenches))
    refuse(Code::unsupported, {"inputs of the linear model"}, "a model compiled with loads on nodes", "one without",
           "CompileOptions::node_wrenches");
  if (at.devices) {
    devices_.emplace(m_, *at.devices);
    z.assign(m_.devices.n_z, 0.0);
  }
  looks_ = outputs.has({Port::position, Port::velocity, Port::acceleration, Port::attitude, Port::rate, Port::specific_force});
  if (outputs.has({Port::linear_momentum, Port::angular_momentum})) moving_.emplace(m_), moving_->require_world();
}

/// Made when it is asked for: where all outputs are states and v' is known, nobody does.
soa::Workspace<Tangent>& Column::ws() {
  if (!sweeping_) {
    sweeping_.emplace(m_);
    if (looks_ || devices_) sweeping_->require_world();
  }
  return *sweeping_;
}

StateLoads<Tangent>* Column::with_devices() {
  if (!devices_) return nullptr;
  devices_->set({at_.t, z.data(), nullptr, tau_.data(), wrenches_.data()});
  return &*devices_;
}

void Column::keep_loops_closed() {
  for (Tangent& x : v) x.d = 0.0;
  place_loops({.q = q.data(), .v = v.data()});
  const VectorXd follow = scope_.loops->rates();
  for (int i = 0; i < m_.nv; ++i) v[i].d = follow[i];
}

void Column::run(Tangent* y) {
  if (vdot0_)
    for (int i = 0; i < m_.nv; ++i) vdot[i] = {(*vdot0_)[i], dvdot_ ? dvdot_[i] : 0.0};
  if (vdot0_ && !looks_ && !moving_) return;
  for (int i = 0; i < m_.nv; ++i) {
    tau_[i] = at_.tau && !scope_.given[i] ? at_.tau[i] : 0.0;
    given_[i] = at_.vdot && scope_.given[i] ? at_.vdot[i] : 0.0;
  }
  std::size_t load = at_.wrenches.size();
  for (std::size_t i = 0; i < u.size(); ++i) {
    const Port& p = inputs_.ports[i];
    if (p.kind == Port::device_input) {
      if (devices_) devices_->commands[p.index] = u[i].d;
      continue;
    }
    if (p.kind == Port::hinge) {
      Tangent& x = (scope_.given[p.index] ? given_ : tau_)[p.index];
      x = x + u[i];
      continue;
    }
    Force<Tangent>& f = wrenches_[load++].f;
    Vec3<Tangent>& part = p.kind == Port::force ? f.f : f.n;
    (p.axis == 0 ? part.x : p.axis == 1 ? part.y : part.z) = u[i];
  }
  if (!vdot0_) hinge_laws::add_forces(m_, q.data(), v.data(), tau_.data());
  soa::Inputs<Tangent> in{
      .q = q.data(), .v = v.data(), .tau = tau_.data(), .vdot = given_.data(), .wrenches = wrenches_, .moment = at_.moment};
  if (vdot0_)
    follow(in);
  else if (scope_.blocks)
    solve(in);
  else if (scope_.loops)
    close(in);
  else
    move(in);
  if (devices_) {
    world(m_, soa::sweeps<Tangent>(), ws(), in, scope_.part());
    if (!devices_->complete(ws(), in)) throw devices_->fault();
  }
  look(in, y);
}

/// What devices push with, which no acceleration changes. Of bodies that take no part poses are those of now.
void Column::push(const soa::Inputs<Tangent>& in) {
  outward(m_, soa::sweeps<Tangent>(), ws(), in, {.velocity = false});
  world(m_, soa::sweeps<Tangent>(), ws(), in, scope_.part());
  if (!with_devices()->act(ws(), in)) throw devices_->fault();
}

/// What outputs see of a known v'.
void Column::follow(soa::Inputs<Tangent>& in) {
  in.vdot = vdot.data();
  if (looks_) inverse_dynamics(m_, ws(), in, back_.data());
}

void Column::move(const soa::Inputs<Tangent>& in) {
  if (forward_dynamics(m_, ws(), in, vdot.data(), with_devices())) return;
  if (devices_ && devices_->failed()) throw devices_->fault();
  throw NumericsError(describe_breakdown(m_, ws().breakdown, at_.t));
}

void Column::place_loops(const soa::Inputs<Tangent>& in) {
  outward(m_, soa::sweeps<Tangent>(), ws(), in, {});
  scope_.loops->place(ws(), in);
}
/// With the multipliers as they are at the point; then with the change that keeps c'' = 0.
void Column::close(soa::Inputs<Tangent>& in) {
  place_loops(in);
  const std::size_t loads = wrenches_.size();
  const std::vector<Tangent> tau = tau_;
  scope_.loops->forget();
  for (const bool known : {false, true}) {
    wrenches_.resize(loads), tau_ = tau;
    scope_.loops->push(wrenches_, tau_.data());
    in.wrenches = wrenches_;
    move(in);
    if (!known) scope_.loops->solve(ws(), in, vdot.data());
  }
  wrenches_.resize(loads);
}

/// v' = M^-1 (tau - ID) of the free components, first its value, then d v' = M^-1 (d tau - d ID) at that v'.
void Column::solve(soa::Inputs<Tangent>& in) {
  if (devices_) push(in);
  in.vdot = vdot.data();
  for (const int i : scope_.components) vdot[i] = {scope_.given[i] || !solved_once_ ? given_[i].x : vdot[i].x, given_[i].d};
  const auto respond = [&](double Tangent::*part) {
    inverse_dynamics(m_, ws(), in, back_.data(), {}, scope_.part());
    for (int i = 0; i < scope_.nv(); ++i) {
      const std::size_t at = (scope_.components[i]);
      residual_[i] = tau_[at].*part - back_[at].*part;
    }
    apply(letters::mass_inverse, *scope_.blocks, residual_.data(), solved_.data());
    for (int i = 0; i < scope_.nv(); ++i) vdot[scope_.components[i]].*part += solved_[i];
  };
  if (!solved_once_) respond(&Tangent::x);
  solved_once_ = true;
  respond(&Tangent::d);
  if (looks_ || devices_) inverse_dynamics(m_, ws(), in, back_.data(), {}, scope_.part());
  if (devices_ && !devices_->follow(ws(), in, vdot.data(), After::inverse)) throw devices_->fault();
}

void Column::look(const soa::Inputs<Tangent>& in, Tangent* y) {
  const soa::Sweeps<Tangent>& S = soa::sweeps<Tangent>();
  const Part* part = scope_.part();
  Force<Tangent> h{{0, 0, 0}, {0, 0, 0}};
  if (looks_) world(m_, S, ws(), in, part);
  if (moving_) {
    outward(m_, S, *moving_, in, {.velocity = false});
    world(m_, S, *moving_, in, part);
    h = momentum(scope_, *moving_, in, devices_ ? &*devices_ : nullptr);
  }
  const auto component = [](const Vec3<Tangent>& a, int i) { return i == 0 ? a.x : i == 1 ? a.y : a.z; };
  int seen = -1;
  NodeMotion<Tangent> node;
  for (std::size_t i = 0; i < outputs_.ports.size(); ++i) {
    const Port& p = outputs_.ports[i];
    if (p.kind == Port::state) continue;  // rows of the unit matrix
    if (p.kind == Port::device_output) {
      if (devices_) y[i] = {at_.devices->output(p.index), devices_->output(p.index)};
      continue;
    }
    if (p.kind == Port::linear_momentum || p.kind == Port::angular_momentum) {
      y[i] = component(p.kind == Port::linear_momentum ? h.f : h.n, p.axis);
      continue;
    }
    if (p.index != seen)
      node = node_motion(m_, ws(), in, seen = p.index, vdot.data(), scope_.blocks || vdot0_ ? After::inverse : After::forward);
    switch (p.kind) {
      case Port::position:
        y[i] = component(node.position, p.axis);
        break;
      case Port::velocity:
        y[i] = component(node.R_WN * node.velocity.v, p.axis);
        break;
      case Port::acceleration:
        y[i] = component(node.R_WN * node.acceleration.v, p.axis);
        break;
      case Port::rate:
        y[i] = component(node.velocity.w, p.axis);
        break;
      case Port::specific_force:
        y[i] = component(node.specific_force, p.axis);
        break;
      case Port::attitude: {  // dR = R dphi~
        const Mat3<Tangent>& R = node.R_WN;
        const Vec3<double> cx{R.xx.x, R.yx.x, R.zx.x}, cy{R.xy.x, R.yy.x, R.zy.x}, cz{R.xz.x, R.yz.x, R.zz.x};
        const Vec3<double> dx{R.xx.d, R.yx.d, R.zx.d}, dy{R.xy.d, R.yy.d, R.zy.d}, dz{R.xz.d, R.yz.d, R.zz.d};
        y[i] = {0.0, p.axis == 0   ? 0.5 * (dot(cz, dy) - dot(cy, dz))
                     : p.axis == 1 ? 0.5 * (dot(cx, dz) - dot(cz, dx))
                                   : 0.5 * (dot(cy, dx) - dot(cx, dy))};
        break;
      }
      default:
        break;
    }
  }
}

}  // namespace cardan::operators::linear
