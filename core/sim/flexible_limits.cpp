#include "core/sim/flexible_limits.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/linalg/dense.hpp"
#include "core/model/validate.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {
namespace {

constexpr double kStiffness = 0.01;  // (Omega / omega_1)^2: half a percent of the frequency
constexpr double kCarried = 0.05;    // of the stiffness: a beam in eight pieces under half of what it buckles under has less in each
constexpr double kDeflection = 0.1;  // of the size: foreshortening, about 0.6 d^2 / L of a cantilever, is then 0.6 % of it
constexpr double kNews = 1.05;       // a rate seen is told again where it exceeds the expected one by more
// Of a clamped rod of the mass m and the length L, bent as by its first mode, w = 1 at its end: the integral of w'^2 is 1.16 / L and the
// modal mass m / 4, so that a tension F along it is 4.65 F / (m L omega_1^2) of its stiffness. What is spread along it counts less: a rod
// buckles under 7.84 E I / L^2 of own weight, and under 2.47 at its end.
constexpr double kAlong = 4.65, kSpread = 0.315;

bool moves(const ModalNode& node) { return (node.Phi.size() > 0 && !node.Phi.isZero(0.0)); }

}  // namespace

double first_frequency(const ModalData& modal) {
  if (modal.n_modes == 0) return std::numeric_limits<double>::infinity();
  const std::optional<Eigen::VectorXd> squares = generalised_eigenvalues(modal.K, modal.integrals.I6);
  return squares ? std::sqrt(std::max(0.0, (*squares)(0))) : 0.0;
}

bool has_stiffening(const BodySpec& body) {
  return body.level == 2 && !body.modal->mass_nodes.empty() &&
         std::ranges::all_of(body.modal->mass_nodes, [](const MassNode& n) { return !n.Q.empty(); });
}

double size_of(const ModalData& modal) {
  return modal.integrals.I1 > 0.0 ? std::sqrt(1.5 * std::max(0.0, modal.integrals.I7.trace()) / modal.integrals.I1) : 0.0;
}

FlexibleLimits::FlexibleLimits(const Simulation& sim) : spec_(sim.model().spec) {
  const Model& m = sim.model();
  for (std::size_t i = 0; i < m.user.size(); ++i) {
    const BodySpec& spec = spec_->bodies[i];
    if (m.user[i].n_modes == 0 || !spec.modal || has_stiffening(spec)) continue;
    if (m.flexible[static_cast<std::size_t>(m.bodies[static_cast<std::size_t>(m.user[i].sweep)].flexible)].curved)
      continue;  // exact at any size
    Body b;
    b.user = static_cast<int>(i), b.node = m.find_node(spec.name);
    b.omega = first_frequency(*spec.modal), b.size = size_of(*spec.modal);
    for (std::size_t k = 0; k < spec.modal->nodes.size(); ++k)
      if (moves(spec.modal->nodes[k])) b.points.push_back(static_cast<int>(k));
    bodies_.push_back(std::move(b));
  }
}

Diagnostic FlexibleLimits::rate_warning(const Body& b, double rate, bool before) const {
  const BodySpec& body = spec_->bodies[static_cast<std::size_t>(b.user)];
  const double ratio = rate / b.omega;
  return {
      Code::beyond_the_model,
      spec_->locate(body_path(body) + (before ? ".level" : "")),
      {},
      {},
      "rates below a tenth of the first frequency leave less than 1 % of the stiffness out; stiffening is in level 2 of lumped masses with "
      "second-order shapes Q alone; a shaft that turns about its own length has none, and all else of that order is in level 2",
      {},
      fmt::format("{} {} {:.3g} rad/s{}, {:.2g} times its first frequency of {:.4g} Hz ({:.3g} rad/s): level {} has no centrifugal "
                  "stiffening, of the order of (Omega/omega_1)^2 = {:.2g} times the stiffness of that mode",
                  body.name, before ? "may turn with up to" : "turns with", rate, before ? " by its initial rates and profiles" : "", ratio,
                  b.omega / (2 * std::numbers::pi), b.omega, body.level, ratio * ratio),
      0};
}

/// [N] Tension along the body, from its hinge to its mass centre, by what its hinge transmits. Of what its own mass takes to be carried
/// along the part that counts, of what that takes as the body turns nothing: its rate tells.
double FlexibleLimits::carried_by(const Body& b, Simulation& sim) const {
  const ModalIntegrals& of = spec_->bodies[static_cast<std::size_t>(b.user)].modal->integrals;
  const UserBody& u = sim.user(b.user);
  const auto vector = [](const Vec3<double>& a) { return Eigen::Vector3d(a.x, a.y, a.z); };
  const Eigen::Vector3d com = of.I2 / of.I1, arm = com - vector(u.pnode.p);
  if (!(of.I1 > 0.0) || arm.norm() < 0.1 * b.size) return 0.0;
  const Observer& observer = sim.observe();
  const NodeState frame = observer.node(sim.now().node[static_cast<std::size_t>(b.node)]);
  const Eigen::Vector3d w = frame.velocity.head<3>(), along = arm.normalized();
  const Force<double> force = observer.hinge_wrench(sim.now().body[static_cast<std::size_t>(b.user)]);
  const Eigen::Vector3d turning = of.I1 * (frame.acceleration.head<3>().cross(com) + w.cross(w.cross(com)));
  const double tension = along.dot(turning - vector(u.pnode.R * force.f)), own = -of.I1 * along.dot(frame.specific_force);
  return tension - (1.0 - kSpread) * (tension > 0.0 ? std::clamp(own, 0.0, tension) : std::clamp(own, tension, 0.0));
}

double FlexibleLimits::share_of_stiffness(const Body& b) const {
  const double mass = spec_->bodies[static_cast<std::size_t>(b.user)].modal->integrals.I1;
  return kAlong * b.carried / (mass * b.size * b.omega * b.omega);
}

Warnings FlexibleLimits::expected(Simulation& sim, double t_end) {
  Warnings found;
  const Model& m = sim.model();
  try {
    for (Body& b : bodies_) {
      b.expected = sim.observe().node(b.node).velocity.head<3>().norm();
      for (int i = b.user; i >= 0; i = m.user[static_cast<std::size_t>(i)].parent) {
        const UserBody& u = m.user[static_cast<std::size_t>(i)];
        for (int j = 0; j < u.nv; ++j)
          if (const MotionProfile* profile = sim.profile(u.v + j); profile && u.v_units[static_cast<std::size_t>(j)] == "rad/s")
            b.expected += std::max(0.0, profile->largest_rate(sim.time(), t_end) - std::abs(sim.state().v[u.v + j]));
      }
      if (b.expected * b.expected > kStiffness * b.omega * b.omega) found.add(rate_warning(b, b.expected, true));
    }
  } catch (const NumericsError&) {  // a singular start: the run will tell
    return {};
  }
  return found;
}

void FlexibleLimits::see(Simulation& sim) {
  for (Body& b : bodies_) {
    const double rate = sim.observe().node(sim.now().node[static_cast<std::size_t>(b.node)]).velocity.head<3>().norm();
    if (rate > b.rate) b.rate = rate, b.t_rate = sim.time();
    // What swings faster than it bends stiffens nothing.
    const double share = b.t_carries < 0.0 ? 1.0 : -std::expm1(-b.omega * (sim.time() - b.t_carries) / (2.0 * std::numbers::pi));
    b.carries += share * (carried_by(b, sim) - b.carries), b.t_carries = sim.time();
    if (std::abs(b.carries) > std::abs(b.carried)) b.carried = b.carries, b.t_carried = sim.time();
    const UserBody& u = sim.user(b.user);
    const ModalData& modal = *spec_->bodies[static_cast<std::size_t>(b.user)].modal;
    for (const int k : b.points) {
      const double d = (modal.nodes[static_cast<std::size_t>(k)].Phi * sim.state().q.segment(u.eta, u.n_modes)).norm();
      if (d > b.deflection) b.deflection = d, b.t_deflection = sim.time(), b.point = k;
    }
  }
}

Warnings FlexibleLimits::seen() const {
  Warnings found;
  for (const Body& b : bodies_) {
    const BodySpec& body = spec_->bodies[static_cast<std::size_t>(b.user)];
    if (b.rate * b.rate > kStiffness * b.omega * b.omega && b.rate > kNews * b.expected)
      found.add(rate_warning(b, b.rate, false), b.t_rate);
    if (const double share = share_of_stiffness(b); std::abs(share) > kCarried)
      found.add(
          Code::beyond_the_model, spec_->locate(body_path(body)),
          fmt::format("{} carries {:.3g} N along itself, a {}: level {} is not {} by that, of the order of {:.2g} times the stiffness of "
                      "its first mode",
                      body.name, std::abs(b.carried), share > 0.0 ? "tension" : "compression", body.level,
                      share > 0.0 ? "stiffened" : "softened", std::abs(share)),
          "in pieces, `boundary: craig_bampton` each with the next one locked to its interface, it is: the error falls with the square of "
          "their length",
          b.t_carried);
    if (b.deflection > kDeflection * b.size) {
      const ModalNode& node = body.modal->nodes[static_cast<std::size_t>(b.point)];
      found.add(Code::beyond_the_model, spec_->locate(fmt::format("{}.modal.nodes.{}", body_path(body), node.name)),
                fmt::format(
                    "{}.{} is {:.3g} m away from its place in the undeformed body, {:.2g} % of its size of {:.3g} m: modes are linear, and "
                    "foreshortening, of second order, is left out",
                    body.name, node.name, b.deflection, 100.0 * b.deflection / b.size, b.size),
                "results are good to about the square of that share", b.t_deflection);
    }
  }
  return found;
}

}  // namespace cardan
