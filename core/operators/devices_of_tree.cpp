#include "core/operators/devices_of_tree.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/diagnostic.hpp"
#include "core/dynamics/device_tangents.hpp"
#include "core/dynamics/inverse.hpp"

namespace cardan::operators {

using Eigen::MatrixXd, Eigen::VectorXd;
using soa::Tangent;

namespace {

/// Poses and velocities of all bodies, those that take no part at rest.
template <class T>
void move(const TreeOperators& tree, soa::Workspace<T>& ws, const soa::Inputs<T>& in) {
  ws.require_world();
  outward(tree.model(), soa::sweeps<T>(), ws, in, {.velocity = false});
  world(tree.model(), soa::sweeps<T>(), ws, in, tree.part());
}

/// The loads of all devices, zero.
template <class T>
std::vector<soa::NodeWrench<T>> loads_of(const Devices& devices) {
  std::vector<soa::NodeWrench<T>> out(static_cast<std::size_t>(devices.n_loads));
  for (const Device& d : devices.all)
    for (const DeviceMount& m : d.mounts)
      if (m.load >= 0) out[static_cast<std::size_t>(m.load)] = {m.node, false, {{T(0.0), T(0.0), T(0.0)}, {T(0.0), T(0.0), T(0.0)}}};
  return out;
}

}  // namespace

std::vector<std::uint8_t> devices_that_take_part(const TreeOperators& tree) {
  const Model& m = tree.model();
  const std::vector<Device>& all = m.devices.all;
  std::vector<std::uint8_t> out(all.size());
  std::vector<int> giver(static_cast<std::size_t>(m.devices.n_out));
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (const DeviceMount& mount : all[i].mounts)
      if ((mount.node >= 0 && tree.index_of(m.user[m.nodes[mount.node].body].sweep) >= 0) ||
          (mount.v >= 0 && tree.place_of_velocity(mount.v) >= 0))
        out[i] = 1;
    std::fill_n(giver.begin() + all[i].out, all[i].n_out, static_cast<int>(i));
  }
  for (bool more = true; more;) {
    more = false;
    for (std::size_t i = 0; i < all.size(); ++i)
      for (int in = all[i].in; in < all[i].in + all[i].n_in; ++in)
        m.devices.each_source(in, [&](int output) {
          std::uint8_t& other = out[static_cast<std::size_t>(giver[static_cast<std::size_t>(output)])];
          if (other == out[i]) return;
          other = out[i] = 1;
          more = true;
        });
  }
  return out;
}

void evaluate_in(const TreeOperators& tree, DeviceForces& devices, const double* v, double* tau, std::span<NodeWrench> wrenches) {
  const Model& m = tree.model();
  soa::Workspace<double> ws(m);
  const Inputs in{.q = tree.q().data(), .v = v};
  move(tree, ws, in);
  devices.put_into(tau, wrenches.data());
  if (devices.act(ws, in) && devices.complete(ws, in)) return;
  const DeviceFault& fault = devices.fault();
  throw NumericsError({.code = Code::device_failed,
                       .t = devices.time(),
                       .what = fmt::format("device {}: {}", m.devices.all[static_cast<std::size_t>(fault.device)].name, fault.what)});
}

bool may_be_stiff(const Device& d) {
  return d.family->n_states == 0 && (d.family->facts & CARDAN_FACT_ENERGY) != 0 && std::ranges::all_of(d.mounts, [](const DeviceMount& m) {
           return m.node < 0 || (m.use & CARDAN_USE_LOAD) == 0 || (m.use & CARDAN_USE_POSE) != 0;
         });
}

std::vector<DeviceStiffness> stiffness_of_devices(const TreeOperators& tree, const DeviceForces& given) {
  const Model& m = tree.model();
  const std::vector<Device>& all = m.devices.all;
  const std::vector<std::uint8_t> takes_part = devices_that_take_part(tree);
  const int n = tree.size(Space::hinge);
  std::vector<DeviceStiffness> out;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (takes_part[i] && may_be_stiff(all[i]))
      out.push_back({static_cast<int>(i), MatrixXd::Zero(n, n), MatrixXd::Zero(n, n), VectorXd::Zero(n), MatrixXd::Zero(n, n)});
  if (out.empty()) return out;

  DeviceForces at_rest(given);
  std::vector<double> none(static_cast<std::size_t>(m.nv)), unit(none), rate(static_cast<std::size_t>(m.nq));
  std::vector<double> pushed(none);
  std::vector<NodeWrench> held = loads_of<double>(m.devices);
  evaluate_in(tree, at_rest, none.data(), pushed.data(), held);

  soa::Workspace<Tangent> moving(m), gathering(m);
  DeviceTangents devices(m, at_rest);
  std::vector<Tangent> q(tree.q().begin(), tree.q().end()), v(static_cast<std::size_t>(m.nv), 0.0),
      z(static_cast<std::size_t>(m.devices.n_z), 0.0), tau(v), needed(v);
  const std::vector<Tangent> at_rest_v(v);
  std::vector<soa::NodeWrench<Tangent>> loads = loads_of<Tangent>(m.devices);
  const auto look_along = [&] {  // the direction that q and v have
    const soa::Inputs<Tangent> in{.q = q.data(), .v = v.data()};
    move(tree, moving, in);
    devices.set({given.time(), z.data(), nullptr, tau.data(), loads.data()});
    if (!devices.act(moving, in)) throw devices.fault();
  };
  /// take(component, of - J* f, with its derivative) for each load of a device.
  const auto resist = [&](const DeviceStiffness& of, const auto& take) {
    const Device& d = all[static_cast<std::size_t>(of.device)];
    for (std::size_t k = 0; k < d.mounts.size(); ++k) {
      const DeviceMount& mount = d.mounts[k];
      if (const int i = mount.v >= 0 ? tree.place_of_velocity(mount.v) : -1; i >= 0)
        take(i, -devices.load(d.mount + static_cast<int>(k)).tau);
      if (mount.load < 0) continue;
      const soa::Inputs<Tangent> in{.q = q.data(), .v = at_rest_v.data(), .wrenches = {&loads[static_cast<std::size_t>(mount.load)], 1}};
      std::ranges::fill(needed, Tangent(0.0));
      inverse_dynamics(m, gathering, in, needed.data(), {.velocity = false, .gravity = false, .elastic = false}, tree.part());
      for (int w = 0; w < m.nv; ++w)
        if (const int i = tree.place_of_velocity(w); i >= 0) take(i, needed[static_cast<std::size_t>(w)]);
    }
  };
  look_along();
  for (DeviceStiffness& s : out) resist(s, [&](int i, const Tangent& x) { s.push[i] -= x.x; });
  for (int w = 0; w < m.nv; ++w) {
    const int j = tree.place_of_velocity(w);
    if (j < 0) continue;
    unit[static_cast<std::size_t>(w)] = 1.0;
    m.qdot(tree.q().data(), unit.data(), rate.data());
    unit[static_cast<std::size_t>(w)] = 0.0;
    for (std::size_t i = 0; i < q.size(); ++i) q[i].d = rate[i];
    look_along();
    for (DeviceStiffness& s : out) resist(s, [&](int i, const Tangent& x) { s.K(i, j) += x.d; });
    for (DeviceStiffness& s : out) {
      const Device& d = all[static_cast<std::size_t>(s.device)];
      for (std::size_t k = 0; k < d.mounts.size() && !s.K.col(j).isZero(0.0); ++k) {
        devices.move_only(d.mount + static_cast<int>(k));
        look_along();
        resist(s, [&](int i, const Tangent& x) { s.size(i, j) += std::abs(x.d); });
      }
    }
    devices.move_only(-1);
    for (Tangent& x : q) x.d = 0.0;
    v[static_cast<std::size_t>(w)].d = 1.0;
    look_along();
    for (DeviceStiffness& s : out) resist(s, [&](int i, const Tangent& x) { s.C(i, j) += x.d; });
    v[static_cast<std::size_t>(w)].d = 0.0;
  }
  for (DeviceStiffness& s : out)
    for (MatrixXd* part : {&s.K, &s.C, &s.size}) *part = (0.5 * (*part + part->transpose())).eval();
  return out;
}

}  // namespace cardan::operators
