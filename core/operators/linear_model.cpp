#include "core/operators/linear_model.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <optional>

#include "core/base/diagnostic.hpp"
#include "core/base/poll.hpp"
#include "core/dynamics/hinge_laws.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/model/loops.hpp"
#include "core/operators/apply.hpp"
#include "core/operators/closed_system.hpp"
#include "core/operators/devices_of_tree.hpp"
#include "core/operators/linear_column.hpp"
#include "core/operators/sensitivity.hpp"

namespace cardan::operators {
namespace {

using namespace linear;
using Eigen::MatrixXd;
using Eigen::VectorXd;

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
  if ((!at.q && m.nq > 0) || (!at.v && m.nv > 0)) refuse(Code::operator_shape, {"point of the linear model"}, "q and v", "a null pointer");
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
