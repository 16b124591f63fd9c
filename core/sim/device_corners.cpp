#include "core/sim/device_corners.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/base/diagnostic.hpp"
#include "core/dynamics/devices.hpp"
#include "core/dynamics/fields.hpp"
#include "core/dynamics/forward.hpp"

namespace cardan {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr int kEnough = 100;     // corners to tell how often they come
constexpr double kAhead = 1e-6;  // of the span: over which roots are differenced
constexpr double kLarge = 1e6;   // a command of which a device that has a limit takes no more

std::string name_of_velocity(const Model& model, int v) {
  for (const UserBody& u : model.user)
    if (v >= u.v && v < u.v + static_cast<int>(u.v_names.size())) return u.name + "." + u.v_names[static_cast<std::size_t>(v - u.v)];
  return "modes";
}

/// `large`: what devices with roots are commanded; 0: what the vehicle file says.
double interval_with(const Model& model, double span, double large) {
  DeviceForces devices(model);
  for (const Device& d : model.devices.all)
    for (int in = d.in; large > 0.0 && d.family->n_roots > 0 && in < d.in + d.n_in; ++in)
      if (model.devices.is_commanded(in)) devices.commands[static_cast<std::size_t>(in)] = large;
  State s = model.initial_state();
  std::vector<double> g(static_cast<std::size_t>(model.devices.n_roots)), ahead(g.size());
  double t = 0.0, first = 0.0;
  int corners = 0;
  /// Roots at t + h, with the rates of the states at t.
  const auto roots_after = [&](double h, std::vector<double>& out) {
    const Eigen::VectorXd z = s.z + h * Eigen::VectorXd::Map(devices.zdot(), s.z.size());
    devices.set({t + h, z.data(), s.marks.data(), nullptr, nullptr});
    devices.roots(out.data());
  };
  const auto happen = [&](int device, std::uint32_t root, int direction) {
    devices.set({t, s.z.data(), s.marks.data(), nullptr, nullptr});
    devices.event(device, root, direction, s.z.data(), s.marks.data());
  };
  try {
    devices.set({t, s.z.data(), s.marks.data(), nullptr, nullptr});
    Workspace ws(model);
    ws.require_world();
    const Eigen::VectorXd still = Eigen::VectorXd::Zero(model.nv);  // what is prescribed, or held by a device, has an acceleration
    devices.look_at(devices, model.devices.reads_nodes ? &ws : nullptr, {.q = s.q.data(), .v = s.v.data(), .vdot = still.data()});
    for (std::size_t i = 0; i < model.devices.all.size(); ++i) happen(static_cast<int>(i), model.devices.all[i].family->n_roots, 0);
    while (corners < kEnough) {
      devices.set({t, s.z.data(), s.marks.data(), nullptr, nullptr});
      if (!devices.evaluate()) break;
      roots_after(0.0, g), roots_after(kAhead * span, ahead);
      double next = kNever;
      int device = 0, direction = 0;
      std::uint32_t root = 0;
      for (std::size_t i = 0; i < model.devices.all.size(); ++i) {
        const Device& d = model.devices.all[i];
        for (std::uint32_t r = 0; r < d.family->n_roots; ++r) {
          const auto at = static_cast<std::size_t>(d.root) + r;
          const double rate = (ahead[at] - g[at]) / (kAhead * span), wait = -g[at] / rate;
          // What has just crossed is zero but for rounding.
          if (wait > 1e-9 * span && wait < next) next = wait, device = static_cast<int>(i), root = r, direction = rate > 0.0 ? 1 : -1;
        }
      }
      if (!(t + next <= span)) break;
      s.z += next * Eigen::VectorXd::Map(devices.zdot(), s.z.size());
      t += next;
      if (corners++ == 0) first = t;
      happen(device, root, direction);
    }
  } catch (const std::exception&) {  // a plugin, or a field that knows nothing there: the run says so
  }
  return corners < 2 ? kNever : corners < kEnough ? span / corners : (t - first) / (corners - 1);
}

}  // namespace

FastestMotion swing_of_devices(const Model& model, double t, const State& s) {
  constexpr int kIterations = 20;
  constexpr double kStep = 1e-6;  // [rad, m] a stepper's field turns over some 1e-4 rad
  FastestMotion found;
  if (model.devices.all.empty() || !model.loops.empty()) return found;
  Eigen::VectorXd x(model.nv), y(model.nv), with(model.nv), without(model.nv), q(model.nq), moved(model.nv), before(model.nv);
  const Eigen::VectorXd still = Eigen::VectorXd::Zero(model.nv);
  try {
    Eigen::VectorXd tau(model.nv);
    std::vector<NodeWrench> wrenches(static_cast<std::size_t>(model.devices.n_loads));
    for (const Device& d : model.devices.all)
      for (const DeviceMount& m : d.mounts)
        if (m.node >= 0 && (m.use & CARDAN_USE_LOAD) != 0) wrenches[static_cast<std::size_t>(m.load)].node = m.node;
    DeviceForces devices(model);
    devices.set({t, s.z.data(), s.marks.data(), tau.data(), wrenches.data()});
    Workspace ws(model);
    FieldMoments moments(model);
    const int gravity = field_of_gravity(model);
    const FieldMoment* moment = gravity < 0 ? nullptr : &moments.at(gravity, t);
    /// v' by devices alone, where q is moved by h x.
    const auto pushed = [&](double h) -> const Eigen::VectorXd& {
      moved = h * x;
      model.retract(s.q.data(), moved.data(), q.data());
      tau.setZero();
      const Inputs alone{.q = q.data(), .v = s.v.data(), .vdot = still.data(), .moment = moment};
      const Inputs in{.q = q.data(), .v = s.v.data(), .tau = tau.data(), .vdot = still.data(), .wrenches = wrenches, .moment = moment};
      const bool known = forward_dynamics(model, ws, alone, without.data()) && forward_dynamics(model, ws, in, with.data(), &devices);
      return known ? with -= without : with.setZero();
    };
    for (int i = 0; i < model.nv; ++i) x[i] = 1.0 + 0.1 * std::sin(3.7 * i);
    x.normalize();
    for (int k = 0; k < kIterations; ++k) {
      y = pushed(kStep), before = tau;
      y = (pushed(-kStep) - y) / (2.0 * kStep);
      const double value = y.norm();
      if (!(value > 0.0) || !std::isfinite(value)) return {};
      Eigen::Index most = 0;
      const bool at_hinge = x.cwiseProduct(tau - before).maxCoeff(&most) > 0.0;
      found = {std::sqrt(value), false,
               at_hinge ? "what devices push with at " + name_of_velocity(model, static_cast<int>(most)) : "what devices push with"};
      x = y / value;
    }
  } catch (const std::exception&) {  // a plugin, or a field that knows nothing there: the run says so
  }
  return found;
}

DeviceCorners device_corners(const Model& model, double span) {
  if (model.devices.n_roots == 0) return {kNever, false};
  const double as_given = interval_with(model, span, 0.0), at_most = interval_with(model, span, kLarge);
  if (at_most < 0.5 * interval_with(model, span, 0.1 * kLarge)) return {as_given, true};
  return {std::min(as_given, at_most), false};
}

}  // namespace cardan
