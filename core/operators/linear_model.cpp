#include "core/operators/linear_model.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <optional>

#include "core/base/diagnostic.hpp"
#include "core/operators/node_motion.hpp"
#include "core/operators/sensitivity.hpp"
#include "core/soa/kernels_tangent.hpp"

namespace cardan::soa {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr const char* kXyz[] = {"x", "y", "z"};

std::size_t idx(int i) { return static_cast<std::size_t>(i); }

bool is_curved(const UserBody& u) { return u.nq > 0 && u.hinge->retract; }
bool has_quaternion(const UserBody& u) {
  return u.hinge->shape == CARDAN_SHAPE_BALL || u.hinge->shape == CARDAN_SHAPE_FREE || u.hinge->shape == CARDAN_SHAPE_FREE_BODY;
}
bool is_given(const Model& m, int v) { return m.has_prescribed() && m.prescribed[idx(v)] != 0; }

// ---- names ----

/// The name of dtheta_j of a hinge: its coordinate where it has one of its own.
std::string deviation_name(const UserBody& u, int j) {
  if (!is_curved(u)) return u.q_names[idx(j)];
  if (has_quaternion(u)) return j < 3 ? fmt::format("turn_{}", kXyz[j]) : fmt::format("shift_{}", kXyz[j - 3]);
  return "d_" + u.v_names[idx(j)];
}
/// "rad/s" -> "rad".
std::string without_second(const std::string& unit) { return unit.ends_with("/s") ? unit.substr(0, unit.size() - 2) : unit + " s"; }
/// Dual to a velocity: W per unit of it.
std::string force_unit(const std::string& rate) { return rate == "rad/s" ? "N m" : rate == "m/s" ? "N" : rate == "1/s" ? "J" : "W/(" + rate + ")"; }

SpaceLabels state_labels(const Model& m) {
  SpaceLabels out;
  out.names.resize(idx(2 * m.nv)), out.units.resize(idx(2 * m.nv));
  const auto put = [&](int i, std::string name, std::string unit) { out.names[idx(i)] = std::move(name), out.units[idx(i)] = std::move(unit); };
  for (const UserBody& u : m.user) {
    for (int j = 0; j < u.nv; ++j) {
      put(u.v + j, u.name + "." + deviation_name(u, j), is_curved(u) ? without_second(u.v_units[idx(j)]) : u.q_units[idx(j)]);
      put(m.nv + u.v + j, u.name + "." + u.v_names[idx(j)], u.v_units[idx(j)]);
    }
    for (int j = 0; j < u.n_modes; ++j) {
      put(u.etadot + j, fmt::format("{}.eta_{}", u.name, j + 1), "1");
      put(m.nv + u.etadot + j, fmt::format("{}.etadot_{}", u.name, j + 1), "1/s");
    }
  }
  return out;
}

// ---- ports ----

/// One number that goes in or comes out.
struct Port {
  enum Kind { hinge, force, torque, state, position, velocity, acceleration, attitude, rate, specific_force, linear_momentum, angular_momentum } kind;
  int index;  // velocity component, node, or state
  int axis;   // of three
};
struct PortList {
  std::vector<Port> ports;
  SpaceLabels labels;
  bool has(std::initializer_list<Port::Kind> kinds) const {
    return std::any_of(ports.begin(), ports.end(), [&](const Port& p) { return std::find(kinds.begin(), kinds.end(), p.kind) != kinds.end(); });
  }
};

struct Quantity {
  const char* name;
  Port::Kind kind;
  const char* unit;
};
constexpr Quantity kLoads[] = {{"force", Port::force, "N"}, {"torque", Port::torque, "N m"}};
constexpr Quantity kSeen[] = {{"position", Port::position, "m"},   {"velocity", Port::velocity, "m/s"}, {"acceleration", Port::acceleration, "m/s^2"},
                              {"attitude", Port::attitude, "rad"}, {"rate", Port::rate, "rad/s"},       {"specific_force", Port::specific_force, "m/s^2"}};
constexpr Quantity kMomentum[] = {{"linear", Port::linear_momentum, "N s"}, {"angular", Port::angular_momentum, "N m s"}};

[[noreturn]] void unknown(const char* side, const std::string& text, std::string expected, const std::vector<std::string>& legal) {
  throw InputError(Diagnostic{Code::unknown_name, {fmt::format("{} of the linear model", side), {}}, std::move(expected), "\"" + text + "\"",
                              did_you_mean(text, legal), {}, {}, 0});
}

/// "tip:force.x" behind the colon: one or three of a list of quantities.
void add_quantity(PortList& out, const char* side, const std::string& text, std::size_t colon, int node, std::span<const Quantity> list) {
  std::string what = text.substr(colon + 1);
  int axis = -1;
  if (what.size() > 2 && what[what.size() - 2] == '.')
    for (int i = 0; i < 3; ++i)
      if (what.back() == *kXyz[i]) axis = i;
  if (axis >= 0) what.resize(what.size() - 2);
  std::vector<std::string> legal;
  for (const Quantity& q : list) {
    legal.emplace_back(q.name);
    if (what != q.name) continue;
    for (int i = 0; i < 3; ++i) {
      if (axis >= 0 && axis != i) continue;
      out.ports.push_back({q.kind, node, i});
      out.labels.names.push_back(fmt::format("{}:{}.{}", text.substr(0, colon), q.name, kXyz[i]));
      out.labels.units.emplace_back(q.unit);
    }
    return;
  }
  unknown(side, text, fmt::format("one of {} behind the colon, all three or .x, .y, .z", fmt::join(legal, ", ")), legal);
}

int node_of(const Model& m, const char* side, const std::string& text, std::size_t colon) {
  const std::string name = text.substr(0, colon);
  const int node = m.find_node(name);
  if (node >= 0) return node;
  std::vector<std::string> legal;
  for (const UserNode& n : m.nodes) legal.push_back(n.name);
  unknown(side, name, "the name of a node, or of a body for its origin", legal);
}

PortList inputs_of(const Model& m, const std::vector<std::string>& wanted) {
  const SpaceLabels states = state_labels(m);
  PortList out;
  const auto add = [&](int v) {
    const std::string &name = states.names[idx(v)], &rate = states.units[idx(m.nv + v)];
    out.ports.push_back({Port::hinge, v, 0});
    out.labels.names.push_back(name);
    out.labels.units.push_back(!is_given(m, v) ? force_unit(rate) : rate == "1/s" ? "1/s^2" : rate + "^2");
  };
  const auto add_hinge = [&](const UserBody& u) {
    for (int j = 0; j < u.nv; ++j) add(u.v + j);
  };
  if (wanted.empty())
    for (const UserBody& u : m.user) add_hinge(u);
  for (const std::string& text : wanted) {
    if (const std::size_t colon = text.rfind(':'); colon != std::string::npos) {
      add_quantity(out, "inputs", text, colon, node_of(m, "inputs", text, colon), kLoads);
      continue;
    }
    if (const int u = m.find_body(text); u >= 0 && m.user[idx(u)].nv > 0) {
      add_hinge(m.user[idx(u)]);
      continue;
    }
    const auto found = std::find(states.names.begin(), states.names.end(), text);
    if (found == states.names.end()) unknown("inputs", text, "a component of a hinge, a hinge, a mode, or NODE:force, NODE:torque", states.names);
    add(static_cast<int>(found - states.names.begin()) % m.nv);
  }
  return out;
}

PortList outputs_of(const Model& m, const std::vector<std::string>& wanted) {
  const SpaceLabels states = state_labels(m);
  PortList out;
  const auto add = [&](int i) {
    out.ports.push_back({Port::state, i, 0});
    out.labels.names.push_back(states.names[idx(i)]), out.labels.units.push_back(states.units[idx(i)]);
  };
  for (int i = 0; wanted.empty() && i < 2 * m.nv; ++i) add(i);
  for (const std::string& text : wanted) {
    if (const std::size_t colon = text.rfind(':'); colon != std::string::npos) {
      if (text.starts_with("momentum:") && m.find_node("momentum") < 0)
        add_quantity(out, "outputs", text, colon, -1, kMomentum);
      else
        add_quantity(out, "outputs", text, colon, node_of(m, "outputs", text, colon), kSeen);
      continue;
    }
    if (const int i = m.find_body(text); i >= 0 && m.user[idx(i)].nv + m.user[idx(i)].n_modes > 0) {
      const UserBody& u = m.user[idx(i)];
      for (const int side : {0, m.nv}) {
        for (int j = 0; j < u.nv; ++j) add(side + u.v + j);
        for (int j = 0; j < u.n_modes; ++j) add(side + u.etadot + j);
      }
      continue;
    }
    const auto found = std::find(states.names.begin(), states.names.end(), text);
    if (found == states.names.end()) unknown("outputs", text, "a state, a hinge, NODE:position ... or momentum:linear, momentum:angular", states.names);
    add(static_cast<int>(found - states.names.begin()));
  }
  return out;
}

// ---- the derivatives ----

/// Momentum of the system about the world's origin, world axes. `ws` has been through pose and world of this q, v.
Force<Tangent> momentum(const Model& m, Workspace<Tangent>& ws, const Inputs<Tangent>& in) {
  Force<Tangent> sum{{0, 0, 0}, {0, 0, 0}};
  for (int k = 1; k < static_cast<int>(m.bodies.size()); ++k) {
    const SweepBody& b = m.bodies[idx(k)];
    Force<Tangent> h;
    if (const Modal<Tangent>* modal = ws.modal_of(k); modal && b.n_modes > 0) {
      h = modal->M_rr * ws.V(k);
      const FlexibleBody& f = m.flexible[idx(b.flexible)];
      for (int j = 0; j < b.n_modes; ++j) {
        Tangent column[6];
        for (int i = 0; i < 6; ++i) column[i] = modal->P_re ? modal->P_re[6 * j + i] : Tangent(f.M_re[idx(6 * j + i)]);
        h += in.v[b.etadot + j] * force_column(column, 0);
      }
    } else {
      h = cast<Tangent>(b.M) * ws.V(k);
    }
    sum += to_inboard(ws.pose_W(k), h);
  }
  return sum;
}

/// Forward dynamics and outputs on Tangent numbers; the direction is set in q, v and the inputs, then run() gives the column.
class Column {
 public:
  Column(const Model& m, const OperatingPoint& at, const PortList& inputs, const PortList& outputs)
      : m_(m), at_(at), inputs_(inputs), outputs_(outputs), ws_(m), q(idx(m.nq)), v(idx(m.nv)), vdot(idx(m.nv)), u(inputs.ports.size()),
        tau_(idx(m.nv)), given_(idx(m.nv)) {
    for (int i = 0; i < m.nq; ++i) q[idx(i)] = at.q[i];
    for (int i = 0; i < m.nv; ++i) v[idx(i)] = at.v[i];
    for (const NodeWrench<double>& w : at.wrenches)
      wrenches_.push_back({w.node, w.world_axes, {cast<Tangent>(w.f.n), cast<Tangent>(w.f.f)}});
    for (std::size_t i = 0; i < u.size(); ++i) {
      u[i] = 0.0;
      if (inputs.ports[i].kind != Port::hinge) wrenches_.push_back({inputs.ports[i].index, false, {{0, 0, 0}, {0, 0, 0}}});
    }
    if (!wrenches_.empty() && !m.has(Kernel::node_wrenches))
      throw InputError(Diagnostic{Code::unsupported, {"inputs of the linear model", {}}, "a model compiled with loads on nodes", "one without",
                                  "CompileOptions::node_wrenches", {}, {}, 0});
    looks_ = outputs.has({Port::position, Port::velocity, Port::acceleration, Port::attitude, Port::rate, Port::specific_force});
    if (looks_) ws_.require_world();
    if (outputs.has({Port::linear_momentum, Port::angular_momentum})) moving_.emplace(m), moving_->require_world();
  }

  /// vdot and y, values and derivatives.
  void run(Tangent* y) {
    for (int i = 0; i < m_.nv; ++i) {
      tau_[idx(i)] = at_.tau && !is_given(m_, i) ? at_.tau[i] : 0.0;
      given_[idx(i)] = at_.vdot && is_given(m_, i) ? at_.vdot[i] : 0.0;
    }
    std::size_t load = at_.wrenches.size();
    for (std::size_t i = 0; i < u.size(); ++i) {
      const Port& p = inputs_.ports[i];
      if (p.kind == Port::hinge) {
        Tangent& x = (is_given(m_, p.index) ? given_ : tau_)[idx(p.index)];
        x = x + u[i];
        continue;
      }
      Force<Tangent>& f = wrenches_[load++].f;
      Vec3<Tangent>& part = p.kind == Port::force ? f.f : f.n;
      (p.axis == 0 ? part.x : p.axis == 1 ? part.y : part.z) = u[i];
    }
    for (const Spring& s : m_.springs)
      tau_[idx(s.v)] = tau_[idx(s.v)] - (Tangent(s.stiffness) * (q[idx(s.q)] - Tangent(s.rest)) + Tangent(s.damping) * v[idx(s.v)]);
    const Inputs<Tangent> in{.q = q.data(), .v = v.data(), .tau = tau_.data(), .vdot = given_.data(), .wrenches = wrenches_};
    if (!forward_dynamics(m_, ws_, in, vdot.data())) throw NumericsError(describe_breakdown(m_, ws_.breakdown, at_.t));
    look(in, y);
  }

 private:
  const Model& m_;
  const OperatingPoint& at_;
  const PortList &inputs_, &outputs_;
  Workspace<Tangent> ws_;

 public:
  std::vector<Tangent> q, v, vdot, u;

 private:
  std::vector<Tangent> tau_, given_;
  std::vector<NodeWrench<Tangent>> wrenches_;
  std::optional<Workspace<Tangent>> moving_;  // poses and inertias as they are before the inward sweep
  bool looks_ = false;

  void look(const Inputs<Tangent>& in, Tangent* y) {
    const Sweeps<Tangent>& S = sweeps<Tangent>();
    Force<Tangent> h{{0, 0, 0}, {0, 0, 0}};
    if (looks_) S.world(m_, ws_, in);
    if (moving_) {
      S.ground(m_, *moving_, in);
      S.hinge_records(m_, *moving_, in);
      for (const Run& run : m_.runs) S.outward(m_, *moving_, in, run, {.velocity = false});
      S.world(m_, *moving_, in);
      h = momentum(m_, *moving_, in);
    }
    const auto component = [](const Vec3<Tangent>& a, int i) { return i == 0 ? a.x : i == 1 ? a.y : a.z; };
    int seen = -1;
    NodeMotion<Tangent> node;
    for (std::size_t i = 0; i < outputs_.ports.size(); ++i) {
      const Port& p = outputs_.ports[i];
      if (p.kind == Port::state) continue;  // rows of the unit matrix
      if (p.kind == Port::linear_momentum || p.kind == Port::angular_momentum) {
        y[i] = component(p.kind == Port::linear_momentum ? h.f : h.n, p.axis);
        continue;
      }
      if (p.index != seen) node = node_motion(m_, ws_, in, seen = p.index, vdot.data());
      switch (p.kind) {
        case Port::position: y[i] = component(node.position, p.axis); break;
        case Port::velocity: y[i] = component(node.R_WN * node.velocity.v, p.axis); break;
        case Port::acceleration: y[i] = component(node.R_WN * node.acceleration.v, p.axis); break;
        case Port::rate: y[i] = component(node.velocity.w, p.axis); break;
        case Port::specific_force: {
          Vec3<Tangent> a = node.acceleration.v;
          if (m_.field.uniform) a -= transpose_times(node.R_WN, cast<Tangent>(m_.field.g));
          y[i] = component(a, p.axis);
          break;
        }
        case Port::attitude: {  // dR = R dphi~
          const Mat3<Tangent>& R = node.R_WN;
          const Vec3<double> cx{R.xx.x, R.yx.x, R.zx.x}, cy{R.xy.x, R.yy.x, R.zy.x}, cz{R.xz.x, R.yz.x, R.zz.x};
          const Vec3<double> dx{R.xx.d, R.yx.d, R.zx.d}, dy{R.xy.d, R.yy.d, R.zy.d}, dz{R.xz.d, R.yz.d, R.zz.d};
          y[i] = {0.0, p.axis == 0 ? 0.5 * (dot(cz, dy) - dot(cy, dz)) : p.axis == 1 ? 0.5 * (dot(cx, dz) - dot(cz, dx)) : 0.5 * (dot(cy, dx) - dot(cx, dy))};
          break;
        }
        default: break;
      }
    }
  }
};

}  // namespace

LinearModel linearize(const Model& m, const OperatingPoint& at, const LinearPorts& wanted) {
  const int nv = m.nv, n = 2 * nv;
  const PortList inputs = inputs_of(m, wanted.inputs), outputs = outputs_of(m, wanted.outputs);
  const int nu = static_cast<int>(inputs.ports.size()), ny = static_cast<int>(outputs.ports.size());
  LinearModel out;
  out.system = m.name;
  out.t = at.t;
  out.states = state_labels(m), out.inputs = inputs.labels, out.outputs = outputs.labels;
  out.A.setZero(n, n), out.B.setZero(n, nu), out.C.setZero(ny, n), out.D.setZero(ny, nu);
  out.drift.setZero(n), out.u0.setZero(nu), out.y0.setZero(ny);

  Column column(m, at, inputs, outputs);
  std::vector<Tangent> y(idx(ny), Tangent(0.0));
  const auto run = [&](MatrixXd& top, MatrixXd& bottom, int j) {
    column.run(y.data());
    for (int i = 0; i < nv; ++i) top(nv + i, j) = column.vdot[idx(i)].d;
    for (int i = 0; i < ny; ++i)
      if (outputs.ports[idx(i)].kind != Port::state) bottom(i, j) = y[idx(i)].d;
  };
  std::vector<double> unit(idx(nv), 0.0), rate(idx(m.nq));
  for (int j = 0; j < nv; ++j) {
    unit[idx(j)] = 1.0;
    m.qdot(at.q, unit.data(), rate.data());
    unit[idx(j)] = 0.0;
    for (int i = 0; i < m.nq; ++i) column.q[idx(i)].d = rate[idx(i)];
    run(out.A, out.C, j);
  }
  for (Tangent& x : column.q) x.d = 0.0;
  for (int j = 0; j < nv; ++j) {
    column.v[idx(j)].d = 1.0;
    run(out.A, out.C, nv + j);
    column.v[idx(j)].d = 0.0;
  }
  for (int j = 0; j < nu; ++j) {
    column.u[idx(j)].d = 1.0;
    run(out.B, out.D, j);
    column.u[idx(j)].d = 0.0;
  }
  column.run(y.data());

  out.A.topLeftCorner(nv, nv) = kinematic_rates(m, at.q, at.v);
  out.A.topRightCorner(nv, nv).setIdentity();
  for (int i = 0; i < nv; ++i) out.drift[i] = at.v[i], out.drift[nv + i] = column.vdot[idx(i)].x;
  for (int j = 0; j < nu; ++j) {
    const Port& p = inputs.ports[idx(j)];
    if (p.kind != Port::hinge) continue;
    const double* from = is_given(m, p.index) ? at.vdot : at.tau;
    out.u0[j] = from ? from[p.index] : 0.0;
  }
  VectorXd theta = VectorXd::Zero(nv);  // the coordinates where dtheta is theirs
  for (const PlainRates& r : m.plain_rates)
    for (int i = 0; i < r.n; ++i) theta[r.v + i] = at.q[r.q + i];
  for (int i = 0; i < ny; ++i) {
    const Port& p = outputs.ports[idx(i)];
    if (p.kind == Port::state) {
      out.C(i, p.index) = 1.0;
      out.y0[i] = p.index < nv ? theta[p.index] : at.v[p.index - nv];
    } else {
      out.y0[i] = y[idx(i)].x;
    }
  }
  return out;
}

}  // namespace cardan::soa
