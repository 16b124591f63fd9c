#include "core/operators/linear_model.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <optional>

#include "core/base/diagnostic.hpp"
#include "core/base/poll.hpp"
#include "core/base/units.hpp"
#include "core/dynamics/hinge_laws.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/dynamics/loop_tangent.hpp"
#include "core/dynamics/node_motion.hpp"
#include "core/model/components.hpp"
#include "core/model/loops.hpp"
#include "core/operators/apply.hpp"
#include "core/operators/closed_system.hpp"
#include "core/operators/devices_of_tree.hpp"
#include "core/operators/sensitivity.hpp"
#include "core/soa/field_at.hpp"
#include "core/soa/kernels_tangent.hpp"

namespace cardan::operators {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using soa::Tangent;

constexpr const char* kXyz[] = {"x", "y", "z"};

bool is_curved(const UserBody& u) { return u.nq > 0 && u.hinge->retract; }

/// What the model is of: all bodies, or those of a tree.
struct Scope {
  const Model& m;
  const TreeOperators* blocks = nullptr;         // articulated, by which v' is found; null: all bodies, by the sweeps of forward dynamics
  std::vector<int> components = {}, place = {};  // of the hinge space: velocity component of the model; and back, -1 for others
  std::vector<std::uint8_t> given = {};          // per velocity component of the model
  std::vector<std::uint8_t> devices = {};        // per device: it is in the model; empty: none is
  std::vector<int> z = {};                       // of the states of the model that are states of devices: which of those of all devices
  void take(std::vector<std::uint8_t> taken) {
    devices = std::move(taken);
    for (std::size_t i = 0; i < devices.size(); ++i)
      for (std::uint32_t j = 0; devices[i] && j < m.devices.all[i].family->n_states; ++j)
        z.push_back(m.devices.all[i].z + static_cast<int>(j));
  }
  int n_z() const { return static_cast<int>(z.size()); }
  LoopTangents* loops = nullptr;  // of a vehicle with closed loops; m is its open tree
  std::vector<int> states = {};   // of all 2 nv + n_z: those of the linear model; with loops the independent ones
  int nv() const { return static_cast<int>(components.size()); }
  const Part* part() const { return blocks ? blocks->part() : nullptr; }
  bool has(int sweep) const { return !part() || part()->takes_part[sweep] != 0; }
  /// Of those that are asked for by name.
  std::string expected(std::string what) const { return part() ? what + ", of the bodies that take part" : what; }
};
Scope scope_of(const Model& m, const TreeOperators* blocks) {
  Scope out{m, blocks};
  out.place.resize(m.nv), out.given.resize(m.nv);
  out.components.resize(blocks ? blocks->size(Space::hinge) : m.nv);
  for (int v = 0; v < m.nv; ++v) {
    const int i = out.place[v] = blocks ? blocks->place_of_velocity(v) : v;
    if (i >= 0) out.components[i] = v;
    out.given[v] = i >= 0 && ((m.has_prescribed() && m.prescribed[v]) || (blocks && !blocks->is_free(i)));
  }
  return out;
}

void keep_all_states(Scope& scope) {
  for (int i = 0; i < 2 * scope.nv() + scope.n_z(); ++i) scope.states.push_back(i);
}

// ---- names ----

/// "rad/s" -> "rad".
std::string without_second(const std::string& unit) { return unit.ends_with("/s") ? unit.substr(0, unit.size() - 2) : unit + " s"; }

SpaceLabels state_labels(const Scope& scope) {
  SpaceLabels out;
  const int nv = scope.nv();
  out.names.resize(2 * nv), out.units.resize(2 * nv);
  for (std::size_t k = 0; k < scope.devices.size(); ++k)
    for (std::uint32_t i = 0; scope.devices[k] && i < scope.m.devices.all[k].family->n_states; ++i) {
      const Device& d = scope.m.devices.all[k];
      out.names.push_back(d.name + "." + d.family->states[i].name);
      out.units.emplace_back(d.family->states[i].unit);
    }
  const auto put = [&](int i, std::string name, std::string unit) { out.names[i] = std::move(name), out.units[i] = std::move(unit); };
  for (const UserBody& u : scope.m.user) {
    if (!scope.has(u.sweep)) continue;
    for (int j = 0; j < u.nv; ++j) {
      const int i = scope.place[u.v + j];
      put(i, u.name + "." + deviation_name(u, j), is_curved(u) ? without_second(u.v_units[j]) : u.q_units[j]);
      put(nv + i, u.name + "." + u.v_names[j], u.v_units[j]);
    }
    for (int j = 0; j < u.n_modes; ++j) {
      const int i = scope.place[u.etadot + j];
      put(i, fmt::format("{}.eta_{}", u.name, j + 1), "1");
      put(nv + i, fmt::format("{}.etadot_{}", u.name, j + 1), "1/s");
    }
  }
  return out;
}

// ---- ports ----

/// One number that goes in or comes out.
struct Port {
  enum Kind {
    hinge,
    force,
    torque,
    state,
    position,
    velocity,
    acceleration,
    attitude,
    rate,
    specific_force,
    linear_momentum,
    angular_momentum,
    device_input,
    device_output
  } kind;
  int index;  // velocity component of the model, node, state, or port of devices
  int axis;   // of three
};
struct PortList {
  std::vector<Port> ports;
  SpaceLabels labels;
  bool has(std::initializer_list<Port::Kind> kinds) const {
    return std::any_of(ports.begin(), ports.end(),
                       [&](const Port& p) { return std::find(kinds.begin(), kinds.end(), p.kind) != kinds.end(); });
  }
};

struct Quantity {
  const char* name;
  Port::Kind kind;
  const char* unit;
};
constexpr Quantity kLoads[] = {{"force", Port::force, "N"}, {"torque", Port::torque, "N m"}};
constexpr Quantity kSeen[] = {
    {"position", Port::position, "m"},   {"velocity", Port::velocity, "m/s"}, {"acceleration", Port::acceleration, "m/s^2"},
    {"attitude", Port::attitude, "rad"}, {"rate", Port::rate, "rad/s"},       {"specific_force", Port::specific_force, "m/s^2"}};
constexpr Quantity kMomentum[] = {{"linear", Port::linear_momentum, "N s"}, {"angular", Port::angular_momentum, "N m s"}};

[[noreturn]] void unknown(const char* side, const std::string& text, std::string expected, const std::vector<std::string>& legal) {
  refuse(Code::unknown_name, {fmt::format("{} of the linear model", side)}, std::move(expected), "\"" + text + "\"",
         did_you_mean(text, legal));
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

int node_of(const Scope& scope, const char* side, const std::string& text, std::size_t colon) {
  const std::string name = text.substr(0, colon);
  const int node = scope.m.find_node(name);
  if (node >= 0 && scope.has(scope.m.nodes[node].sweep)) return node;
  std::vector<std::string> legal;
  for (const UserNode& n : scope.m.nodes)
    if (scope.has(n.sweep)) legal.push_back(n.name);
  unknown(side, name, scope.expected("the name of a node, or of a body for its origin"), legal);
}

/// "wheel:torque"; false: there is no such device, or it takes no part.
bool add_device_port(PortList& out, const Scope& scope, const char* side, const std::string& text, std::size_t colon, std::uint32_t kind) {
  const Model& m = scope.m;
  const int device = m.devices.find(text.substr(0, colon));
  if (device < 0 || (!scope.devices.empty() && !scope.devices[device])) return false;
  const Device& d = m.devices.all[device];
  std::vector<std::string> legal;
  int index = kind == CARDAN_PORT_IN ? d.in : d.out;
  for (std::uint32_t i = 0; i < d.family->n_ports; ++i) {
    const cardan_port_desc& port = d.family->ports[i];
    if (port.kind != kind) continue;
    const int at = index++;
    if (kind == CARDAN_PORT_IN && m.devices.from[at] >= 0) continue;  // another device gives it
    legal.emplace_back(port.name);
    if (text.substr(colon + 1) != port.name) continue;
    out.ports.push_back({kind == CARDAN_PORT_IN ? Port::device_input : Port::device_output, at, 0});
    out.labels.names.push_back(text), out.labels.units.emplace_back(port.unit);
    return true;
  }
  unknown(side, text,
          legal.empty() ? fmt::format("another device: {} has none", d.name)
                        : fmt::format("one of {} behind the colon", fmt::join(legal, ", ")),
          legal);
}

PortList inputs_of(const Scope& scope, const SpaceLabels& states, const std::vector<std::string>& wanted) {
  const Model& m = scope.m;
  PortList out;
  const auto add = [&](int i) {  // component of the hinge space
    const std::string &name = states.names[i], &rate = states.units[scope.nv() + i];
    const int v = scope.components[i];
    out.ports.push_back({Port::hinge, v, 0});
    out.labels.names.push_back(name);
    out.labels.units.push_back(!scope.given[v] ? force_unit(rate) : rate == "1/s" ? "1/s^2" : rate + "^2");
  };
  const auto add_hinge = [&](const UserBody& u) {
    for (int j = 0; j < u.nv; ++j) add(scope.place[u.v + j]);
  };
  if (wanted.empty())
    for (const UserBody& u : m.user)
      if (scope.has(u.sweep)) add_hinge(u);
  for (const std::string& text : wanted) {
    if (const std::size_t colon = text.rfind(':'); colon != std::string::npos) {
      if (!add_device_port(out, scope, "inputs", text, colon, CARDAN_PORT_IN))
        add_quantity(out, "inputs", text, colon, node_of(scope, "inputs", text, colon), kLoads);
      continue;
    }
    std::vector<int> found = components_of(m, text);
    std::erase_if(found, [&](int v) { return scope.place[v] < 0; });
    if (found.empty())
      unknown("inputs", text, scope.expected("a component of a hinge, a hinge, a mode, or NODE:force, NODE:torque"), states.names);
    for (const int v : found) add(scope.place[v]);
  }
  return out;
}

PortList outputs_of(const Scope& scope, const SpaceLabels& states, const std::vector<std::string>& wanted) {
  const Model& m = scope.m;
  PortList out;
  const auto add = [&](int i) {
    out.ports.push_back({Port::state, i, 0});
    out.labels.names.push_back(states.names[i]), out.labels.units.push_back(states.units[i]);
  };
  if (wanted.empty())
    for (const int i : scope.states) add(i);
  for (const std::string& text : wanted) {
    if (const std::size_t colon = text.rfind(':'); colon != std::string::npos) {
      if (text.starts_with("momentum:") && m.find_node("momentum") < 0)
        add_quantity(out, "outputs", text, colon, -1, kMomentum);
      else if (!add_device_port(out, scope, "outputs", text, colon, CARDAN_PORT_OUT))
        add_quantity(out, "outputs", text, colon, node_of(scope, "outputs", text, colon), kSeen);
      continue;
    }
    if (const int i = m.find_body(text); i >= 0 && m.user[i].nv + m.user[i].n_modes > 0 && scope.has(m.user[i].sweep)) {
      const UserBody& u = m.user[i];
      for (const int side : {0, scope.nv()}) {
        for (int j = 0; j < u.nv; ++j) add(side + scope.place[u.v + j]);
        for (int j = 0; j < u.n_modes; ++j) add(side + scope.place[u.etadot + j]);
      }
      continue;
    }
    const auto found = std::find(states.names.begin(), states.names.end(), text);
    if (found == states.names.end())
      unknown("outputs", text, scope.expected("a state, a hinge, NODE:position ... or momentum:linear, momentum:angular"), states.names);
    add(static_cast<int>(found - states.names.begin()));
  }
  return out;
}

// ---- the derivatives ----

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

/// v' and outputs on Tangent numbers; the direction is set in q, v and the inputs, then run() gives the column.
class Column {
 public:
  Column(const Scope& scope, const OperatingPoint& at, const PortList& inputs, const PortList& outputs)
      : scope_(scope),
        m_(scope.m),
        at_(at),
        inputs_(inputs),
        outputs_(outputs),
        q(m_.nq),
        v(m_.nv, 0.0),
        vdot(m_.nv, 0.0),
        u(inputs.ports.size()),
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

  /// The v' of the point, and its derivative along the direction that is set, as they are known; null: run() finds both.
  void take(const VectorXd* vdot0, const double* dvdot) { vdot0_ = vdot0, dvdot_ = dvdot; }
  /// vdot and y, values and derivatives.
  void run(Tangent* y) {
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

 private:
  const Scope& scope_;
  const Model& m_;
  const OperatingPoint& at_;
  const PortList &inputs_, &outputs_;
  std::optional<soa::Workspace<Tangent>> sweeping_;
  /// Made when it is asked for: where all outputs are states and v' is known, nobody does.
  soa::Workspace<Tangent>& ws() {
    if (!sweeping_) {
      sweeping_.emplace(m_);
      if (looks_ || devices_) sweeping_->require_world();
    }
    return *sweeping_;
  }

 public:
  std::vector<Tangent> q, v, vdot, u, z;
  /// v moves so that loops stay closed where q moves along its direction and the independent rates stand.
  void keep_loops_closed() {
    for (Tangent& x : v) x.d = 0.0;
    place_loops({.q = q.data(), .v = v.data()});
    const VectorXd follow = scope_.loops->rates();
    for (int i = 0; i < m_.nv; ++i) v[i].d = follow[i];
  }
  /// [dz'] of devices.
  const double* zdot() const { return devices_->zdot(); }

 private:
  StateLoads<Tangent>* with_devices() {
    if (!devices_) return nullptr;
    devices_->set({at_.t, z.data(), nullptr, tau_.data(), wrenches_.data()});
    return &*devices_;
  }
  std::vector<Tangent> tau_, given_, back_;
  VectorXd residual_, solved_;
  std::vector<soa::NodeWrench<Tangent>> wrenches_;
  std::optional<DeviceTangents> devices_;
  std::optional<soa::Workspace<Tangent>> moving_;  // poses and inertias as they are before the inward sweep
  bool looks_ = false, solved_once_ = false;
  const VectorXd* vdot0_ = nullptr;
  const double* dvdot_ = nullptr;

  /// What devices push with, which no acceleration changes. Of bodies that take no part poses are those of now.
  void push(const soa::Inputs<Tangent>& in) {
    outward(m_, soa::sweeps<Tangent>(), ws(), in, {.velocity = false});
    world(m_, soa::sweeps<Tangent>(), ws(), in, scope_.part());
    if (!with_devices()->act(ws(), in)) throw devices_->fault();
  }

  /// What outputs see of a known v'.
  void follow(soa::Inputs<Tangent>& in) {
    in.vdot = vdot.data();
    if (looks_) inverse_dynamics(m_, ws(), in, back_.data());
  }

  void move(const soa::Inputs<Tangent>& in) {
    if (forward_dynamics(m_, ws(), in, vdot.data(), with_devices())) return;
    if (devices_ && devices_->failed()) throw devices_->fault();
    throw NumericsError(describe_breakdown(m_, ws().breakdown, at_.t));
  }

  void place_loops(const soa::Inputs<Tangent>& in) {
    outward(m_, soa::sweeps<Tangent>(), ws(), in, {});
    scope_.loops->place(ws(), in);
  }
  /// With the multipliers as they are at the point; then with the change that keeps c'' = 0.
  void close(soa::Inputs<Tangent>& in) {
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
  void solve(soa::Inputs<Tangent>& in) {
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

  void look(const soa::Inputs<Tangent>& in, Tangent* y) {
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
};

/// v' and its derivatives along all columns of a linear model, many at once (Sensitivities).
struct KnownAccelerations {
  VectorXd vdot;
  MatrixXd along;  // nv x (2 nv + inputs), in the order of the columns of [A B]
};
/// Of whole open trees without devices, whose v' needs no refinement and no hinge of square-root form: M^-1 of changes of inverse dynamics
/// has the square of the condition that these avoid.
bool can_be_known(const Model& m, const OperatingPoint& at) {
  return m.loops.empty() && !at.devices && !m.has(OpCode::refine) && std::ranges::none_of(m.bodies, &SweepBody::square_root);
}

KnownAccelerations known_accelerations(Sensitivities& about, const Scope& scope, const OperatingPoint& at, const PortList& inputs) {
  const Model& m = scope.m;
  const VectorXd still = VectorXd::Zero(m.nv);
  about.solve(
      {.q = at.q, .v = at.v, .tau = at.tau, .vdot = at.vdot ? at.vdot : still.data(), .wrenches = at.wrenches, .moment = at.moment});
  const auto nu = static_cast<Eigen::Index>(inputs.ports.size());
  const MatrixXd unit = MatrixXd::Identity(m.nv, m.nv);
  MatrixXd forces = MatrixXd::Zero(m.nv, nu);
  std::vector<Direction> all(static_cast<std::size_t>(2 * m.nv + nu));
  for (int j = 0; j < m.nv; ++j) all[j].q = all[m.nv + j].v = unit.col(j).data();
  std::optional<Workspace> ws;
  for (Eigen::Index j = 0; j < nu; ++j) {
    const Port& p = inputs.ports[j];
    Direction& direction = all[2 * m.nv + j];
    if (p.kind == Port::hinge) {
      (scope.given[p.index] ? direction.vdot : direction.tau) = unit.col(p.index).data();
      continue;
    }
    NodeWrench load{p.index, false, {{0, 0, 0}, {0, 0, 0}}};
    Vec3<double>& part = p.kind == Port::force ? load.f.f : load.f.n;
    (p.axis == 0 ? part.x : p.axis == 1 ? part.y : part.z) = 1.0;
    if (!ws) ws.emplace(m);
    forces.col(j) = external_force(m, *ws, at.q, {&load, 1});
    direction.tau = forces.col(j).data();
  }
  KnownAccelerations out{about.vdot(), MatrixXd(m.nv, 2 * m.nv + nu)};
  about.forward(all, out.along.data());
  return out;
}

/// `about`: of the model, where v' can be known; else null.
LinearModel linearize(const Scope& scope, const OperatingPoint& at, const LinearPorts& wanted, Sensitivities* about = nullptr) {
  const Model& m = scope.m;
  const int nv = scope.nv(), n_z = scope.n_z(), n = static_cast<int>(scope.states.size()), half = (n - n_z) / 2;
  const SpaceLabels labels = state_labels(scope);
  const PortList inputs = inputs_of(scope, labels, wanted.inputs), outputs = outputs_of(scope, labels, wanted.outputs);
  const int nu = static_cast<int>(inputs.ports.size()), ny = static_cast<int>(outputs.ports.size());
  LinearModel out;
  out.system = m.name;
  out.t = at.t;
  out.inputs = inputs.labels, out.outputs = outputs.labels;
  for (const int i : scope.states) out.states.names.push_back(labels.names[i]), out.states.units.push_back(labels.units[i]);
  out.A.setZero(n, n), out.B.setZero(n, nu), out.C.setZero(ny, n), out.D.setZero(ny, nu);
  out.drift.setZero(n), out.u0.setZero(nu), out.y0.setZero(ny);

  Column column(scope, at, inputs, outputs);
  std::optional<KnownAccelerations> known;
  if (about) known = known_accelerations(*about, scope, at, inputs);
  std::vector<Tangent> y(ny, Tangent(0.0));
  const auto component = [&](int i) { return scope.components[scope.states[i]]; };  // of the velocity space, i < half
  const auto run = [&](MatrixXd& top, MatrixXd& bottom, int j) {
    Poll::now();
    if (known) column.take(&known->vdot, known->along.col(&top == &out.A ? j : 2 * half + j).data());
    column.run(y.data());
    for (int i = 0; i < half; ++i) top(half + i, j) = column.vdot[component(i)].d;
    for (int i = 0; i < n_z; ++i) top(2 * half + i, j) = column.zdot()[scope.z[i]];
    for (int i = 0; i < ny; ++i)
      if (outputs.ports[i].kind != Port::state) bottom(i, j) = y[i].d;
  };
  for (int i = 0; i < ny && !scope.loops; ++i)  // states that are outputs
    if (const Port& p = outputs.ports[i]; p.kind == Port::state && p.index < 2 * nv) out.C(i, p.index) = 1.0;
  const auto seen = [&](int first, const auto& of, int j) {  // with loops, those of the configuration or of v
    for (int i = 0; i < ny && scope.loops; ++i)
      if (const Port& p = outputs.ports[i]; p.kind == Port::state && p.index >= first && p.index < first + nv)
        out.C(i, j) = of(scope.components[p.index - first]);
  };
  const Eigen::SparseMatrix<double> kinematics = kinematic_rates(m, at.q, at.v);
  std::vector<double> rate(m.nq);
  const auto direction = [&](int j) {  // of the velocity space
    return scope.loops ? VectorXd(scope.loops->freedom().X.col(j)) : VectorXd(VectorXd::Unit(m.nv, component(j)));
  };
  for (int j = 0; j < half; ++j) {
    const VectorXd along = direction(j);
    m.qdot(at.q, along.data(), rate.data());
    for (int i = 0; i < m.nq; ++i) column.q[i].d = rate[i];
    seen(
        0, [&](int v) { return along[v]; }, j);
    if (scope.loops) {
      column.keep_loops_closed();
      seen(
          nv, [&](int v) { return column.v[v].d; }, j);
    }
    run(out.A, out.C, j);
    const VectorXd turned = kinematics * along;
    for (int i = 0; i < half; ++i) out.A(i, j) = turned[component(i)];
  }
  for (Tangent& x : column.q) x.d = 0.0;
  for (Tangent& x : column.v) x.d = 0.0;
  for (int j = 0; j < half; ++j) {
    const VectorXd along = direction(j);
    for (int v = 0; v < m.nv; ++v) column.v[v].d = along[v];
    seen(
        nv, [&](int v) { return along[v]; }, half + j);
    run(out.A, out.C, half + j);
  }
  for (Tangent& x : column.v) x.d = 0.0;
  for (int j = 0; j < n_z; ++j) {
    column.z[scope.z[j]].d = 1.0;
    run(out.A, out.C, 2 * half + j);
    column.z[scope.z[j]].d = 0.0;
  }
  for (int j = 0; j < nu; ++j) {
    column.u[j].d = 1.0;
    run(out.B, out.D, j);
    column.u[j].d = 0.0;
  }
  if (known) column.take(&known->vdot, nullptr);
  column.run(y.data());

  out.A.block(0, half, half, half).setIdentity();
  for (int i = 0; i < half; ++i) out.drift[i] = at.v[component(i)], out.drift[half + i] = column.vdot[component(i)].x;
  for (int i = 0; i < n_z; ++i) out.drift[2 * half + i] = at.devices->zdot()[scope.z[i]];
  for (int j = 0; j < nu; ++j) {
    const Port& p = inputs.ports[j];
    if (p.kind == Port::device_input && at.devices) out.u0[j] = at.devices->input(p.index);
    if (p.kind != Port::hinge) continue;
    const double* from = scope.given[p.index] ? at.vdot : at.tau;
    out.u0[j] = from ? from[p.index] : 0.0;
  }
  VectorXd theta = VectorXd::Zero(m.nv);  // the coordinates where dtheta is theirs
  for (const PlainRates& r : m.plain_rates)
    for (int i = 0; i < r.n; ++i) theta[r.v + i] = at.q[r.q + i];
  for (int i = 0; i < ny; ++i) {
    const Port& p = outputs.ports[i];
    if (p.kind == Port::state) {
      if (p.index >= 2 * nv) {
        out.C(i, 2 * half + p.index - 2 * nv) = 1.0;
        out.y0[i] = at.devices->state(scope.z[p.index - 2 * nv]);
        continue;
      }
      const int v = scope.components[p.index % nv];
      out.y0[i] = p.index < nv ? theta[v] : at.v[v];
    } else {
      out.y0[i] = y[i].x;
    }
  }
  return out;
}

[[noreturn]] void refuse_part(const std::string& why) {
  refuse(Code::unsupported, {"linearize"}, "the whole vehicle, nothing masked, where there is such a device", why);
}

/// z' of devices that hang on the accelerations of a part.
void follow(const Scope& scope, const OperatingPoint& at, DeviceForces& devices) {
  const Model& m = scope.m;
  Workspace ws(m);
  ws.require_world();
  std::vector<double> tau(at.tau, at.tau + m.nv), vdot(m.nv, 0.0), needed(m.nv);
  hinge_laws::add_forces(m, at.q, at.v, tau.data());
  for (const int i : scope.components)
    if (scope.given[i] && at.vdot) vdot[i] = at.vdot[i];
  const Inputs in{.q = at.q, .v = at.v, .vdot = vdot.data(), .wrenches = at.wrenches, .moment = at.moment};
  inverse_dynamics(m, ws, in, needed.data(), {}, scope.part());
  VectorXd left(scope.nv()), solved(scope.nv());
  for (int i = 0; i < scope.nv(); ++i) left[i] = tau[scope.components[i]] - needed[scope.components[i]];
  apply(letters::mass_inverse, *scope.blocks, left.data(), solved.data());
  for (int i = 0; i < scope.nv(); ++i) vdot[scope.components[i]] += solved[i];
  inverse_dynamics(m, ws, in, needed.data(), {}, scope.part());
  world(m, soa::sweeps<double>(), ws, in, scope.part());
  if (!devices.follow(ws, in, vdot.data(), After::inverse))
    throw NumericsError({.code = Code::device_failed, .t = at.t, .what = devices.fault().what});
}

void take_devices(Scope& scope, const OperatingPoint& at) {
  if (at.devices) scope.take(std::vector<std::uint8_t>(scope.m.devices.all.size(), 1));
}

/// A vehicle with closed loops: its open tree, and what its loops do.
struct ClosedPoint {
  ClosedPoint(const Model& m, const OperatingPoint& at)
      : tree(open_tree(std::shared_ptr<const Model>(std::shared_ptr<void>(), &m))),
        loops(loops_at(m, at)),
        scope(scope_of(*tree, nullptr)) {
    scope.loops = &loops;
    take_devices(scope, at);
  }
  ClosedPoint(const ClosedPoint&) = delete;

  std::shared_ptr<const Model> tree;
  LoopTangents loops;
  Scope scope;

 private:
  static LoopTangents loops_at(const Model& m, const OperatingPoint& at) {
    VectorXd tau = VectorXd::Zero(m.nv), given = VectorXd::Zero(m.nv);
    for (int v = 0; v < m.nv; ++v)
      if (const double* from = m.has_given_motion(v) ? at.vdot : at.tau) (m.has_given_motion(v) ? given : tau)[v] = from[v];
    hinge_laws::add_forces(m, at.q, at.v, tau.data());
    return {
        m,
        {.q = at.q, .v = at.v, .tau = tau.data(), .vdot = given.data(), .wrenches = at.wrenches, .moment = at.moment, .drives = at.drives},
        at.t};
  }
};

}  // namespace

LinearModel linearize(Sensitivities& about, const OperatingPoint& at, const LinearPorts& ports) {
  const Model& m = *about.model();
  if (!about.of_all() || !can_be_known(m, at)) return linearize(m, at, ports);
  Scope scope = scope_of(m, nullptr);
  keep_all_states(scope);
  return linearize(scope, at, ports, &about);
}

LinearModel linearize(const Model& m, const OperatingPoint& at, const LinearPorts& ports) {
  if (!at.q || !at.v) refuse(Code::operator_shape, {"point of the linear model"}, "q and v", "a null pointer");
  if (can_be_known(m, at)) {
    Sensitivities about(std::shared_ptr<const Model>(std::shared_ptr<void>(), &m));
    return linearize(about, at, ports);
  }
  if (m.loops.empty()) {
    Scope scope = scope_of(m, nullptr);
    take_devices(scope, at);
    keep_all_states(scope);
    return linearize(scope, at, ports);
  }
  ClosedPoint closed(m, at);
  for (const int first : {0, m.nv})
    for (const int v : closed.loops.freedom().independent) closed.scope.states.push_back(first + v);
  for (int i = 0; i < closed.scope.n_z(); ++i) closed.scope.states.push_back(2 * m.nv + i);
  return linearize(closed.scope, at, ports);
}

ClosedDerivatives closed_derivatives(const Model& m, const OperatingPoint& at) {
  ClosedPoint closed(m, at);
  const LoopFreedom& freedom = closed.loops.freedom();
  const Eigen::Index n = freedom.X.cols();
  const PortList none;
  Column column(closed.scope, at, none, none);
  ClosedDerivatives out{freedom.independent, VectorXd(m.nv), MatrixXd(m.nv, n), MatrixXd(m.nv, n), MatrixXd::Zero(m.nv, m.nv)};
  const auto run = [&](auto&& take) {
    Poll::now();
    column.run(nullptr);
    for (int i = 0; i < m.nv; ++i) take(i, column.vdot[i]);
  };
  std::vector<double> rate(m.nq);
  for (Eigen::Index j = 0; j < n; ++j) {
    m.qdot(at.q, freedom.X.col(j).data(), rate.data());
    for (int i = 0; i < m.nq; ++i) column.q[i].d = rate[i];
    column.keep_loops_closed();
    run([&](int i, const Tangent& x) { out.q(i, j) = x.d; });
  }
  for (Tangent& x : column.q) x.d = 0.0;
  for (Eigen::Index j = 0; j < n; ++j) {
    for (int i = 0; i < m.nv; ++i) column.v[i].d = freedom.X(i, j);
    run([&](int i, const Tangent& x) { out.v(i, j) = x.d; });
  }
  for (Tangent& x : column.v) x.d = 0.0;
  run([&](int i, const Tangent& x) { out.vdot[i] = x.x; });
  TreeOperators tree(closed.tree);
  tree.at(at.q);
  const MatrixXd Y = free_motions(tree, freedom.X);
  for (Eigen::Index j = 0; j < Y.cols(); ++j) {
    const VectorXd y = tree.to_model(Y.col(j));
    out.tau += y * y.transpose();
  }
  return out;
}

LinearModel linearize(const TreeOperators& tree, const OperatingPoint& at, const LinearPorts& ports) {
  tree.require(Kind::H);
  const Model& m = tree.model();
  OperatingPoint use = at;
  use.q = tree.q().data();
  const bool loads = !at.wrenches.empty() ||
                     std::ranges::any_of(ports.inputs, [](const std::string& name) { return name.find(':') != std::string::npos; });
  if (tree.whole() && !tree.is_masked() && (!loads || m.has(OpCode::node_wrenches))) return linearize(m, use, ports);
  TreeOperators blocks = tree.subgraph(tree.sweep_bodies());
  const Scope marks = scope_of(m, &tree);
  std::vector<std::uint8_t> free;
  for (const int v : marks.components) free.push_back(!marks.given[v]);
  blocks.articulate({.free = free});
  Scope scope = scope_of(m, &blocks);
  if (!at.devices) {
    keep_all_states(scope);
    return linearize(scope, use, ports);
  }
  scope.take(devices_that_take_part(blocks));
  for (const DeviceMass& mass : m.devices.masses)
    if (scope.devices[mass.device]) refuse_part(m.devices.all[mass.device].name + " carries mass of " + m.user[mass.user].name);
  bool follows = false;
  for (std::size_t i = 0; i < scope.devices.size(); ++i) {
    const Device& d = m.devices.all[i];
    if (!scope.devices[i] || !d.family->follow) continue;
    follows = true;
    for (const DeviceMount& mount : d.mounts)
      if (mount.node >= 0 && !scope.has(m.user[m.nodes[mount.node].body].sweep)) refuse_part(d.name + " follows a body that takes no part");
  }
  DeviceForces devices(*at.devices);
  std::vector<double> v(m.nv, 0.0), tau(m.nv, 0.0), pushed(m.nv, 0.0);
  devices.add_hinge_forces(pushed.data());
  for (const int i : scope.components) v[i] = at.v[i], tau[i] = at.tau ? at.tau[i] - pushed[i] : 0.0;
  std::vector<NodeWrench> wrenches(at.wrenches.begin(), at.wrenches.end());
  evaluate_in(blocks, devices, v.data(), tau.data(), wrenches);
  use.v = v.data(), use.tau = tau.data(), use.wrenches = wrenches, use.devices = &devices;
  if (follows) follow(scope, use, devices);
  keep_all_states(scope);
  return linearize(scope, use, ports);
}

}  // namespace cardan::operators
