// What devices push with all at once, and hard stops: velocities jump by M^-1 J* p, with p the impulses at nodes and hinges; poses stay
// (docs/mathematics/devices.md, "Impulses").
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/dynamics/forward.hpp"
#include "core/linalg/complementarity.hpp"
#include "core/sim/alike.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {
namespace {

constexpr double kAsFast = 1.0 - 1e-9;  // of the fastest: it is a matter of rounding which of them comes first
constexpr double kAlmost = 1e-11;       // of a place, at least of 1 [rad, m]: so near to its limit it comes there with what is struck
constexpr int kBounces = 1000;          // in one instant; what then still moves into a stop presses into it

Eigen::Vector3d moment_of(const NodeWrench& w) { return to_eigen(w.f.n); }
Eigen::Vector3d force_of(const NodeWrench& w) { return to_eigen(w.f.f); }

}  // namespace

void Simulation::ask_for_impulse(int device, std::uint32_t cause, int direction) {
  bool good = false;
  if (!unless_thrown([&] { good = devices_->impulse(device, cause, direction, impulse_.loads); }) || !good) fail(explain({}));
  impulse_.by = device;
}

void Simulation::strike() {
  if (impulse_.by < 0) return;
  const Model& m = *model_;
  const Device& d = m.devices.all[static_cast<std::size_t>(std::exchange(impulse_.by, -1))];
  Eigen::VectorXd& hinges = impulse_.hinges;
  impulse_.wrenches.clear();
  hinges.setZero(m.nv);
  for (std::size_t i = 0; i < d.mounts.size(); ++i) {
    const cardan_mount_load& l = impulse_.loads[i];
    if ((d.mounts[i].use & (CARDAN_USE_LOAD | CARDAN_USE_IMPULSE)) == 0) continue;
    if (d.mounts[i].v >= 0) hinges[d.mounts[i].v] += l.tau;
    const NodeWrench w{d.mounts[i].node, false, {{l.moment[0], l.moment[1], l.moment[2]}, {l.force[0], l.force[1], l.force[2]}}};
    if (w.node >= 0 && !(moment_of(w).isZero(0.0) && force_of(w).isZero(0.0))) impulse_.wrenches.push_back(w);
  }
  if (!impulse_.wrenches.empty() || !hinges.isZero(0.0)) jump(d.name);
}

void Simulation::find_jump() {
  const Model& m = *model_;
  // Forward dynamics at rest, without gravity and what bends the modes: v' is then what one unit of time of these loads gives. The unit is
  // so short, a power of two, that the loads are far above the forces of the modes: their rounding would else be in the jump.
  Eigen::VectorXd& f = impulse_.force;
  f.setZero(m.nv);
  for (const UserBody& u : m.user)
    if (u.n_modes > 0)
      if (const ModalData& modes = *m.flexible[static_cast<std::size_t>(m.bodies[static_cast<std::size_t>(u.sweep)].flexible)].data;
          modes.K.size() > 0)
        f.segment(u.etadot, u.n_modes).noalias() = modes.K * state_.q.segment(u.eta, u.n_modes);
  double loads = impulse_.hinges.lpNorm<Eigen::Infinity>();
  for (const NodeWrench& w : impulse_.wrenches)
    loads = std::max({loads, moment_of(w).lpNorm<Eigen::Infinity>(), force_of(w).lpNorm<Eigen::Infinity>()});
  const double bends = f.lpNorm<Eigen::Infinity>();
  const double per_unit = bends > 0.0 && loads > 0.0 ? std::exp2(std::clamp(20 + std::ilogb(bends) - std::ilogb(loads), -900, 900)) : 1.0;
  const auto scale_wrenches = [&](double by) {
    for (NodeWrench& w : impulse_.wrenches) w.f = by * w.f;
  };
  f += per_unit * impulse_.hinges;
  scale_wrenches(per_unit);
  // What a device holds gives way: its force has a limit, and an impulse has none.
  for (const DeviceHold& h : m.devices.holds) own_->prescribed[static_cast<std::size_t>(h.v)] = 0;
  impulse_.rest.setZero(m.nv), impulse_.jump.resize(m.nv);
  const Inputs in{.q = state_.q.data(),
                  .v = impulse_.rest.data(),
                  .tau = f.data(),
                  .vdot = impulse_.rest.data(),
                  .wrenches = impulse_.wrenches,
                  .gravity = false};
  const bool good = forward_dynamics(m, workspace_, in, impulse_.jump.data());
  scale_wrenches(1.0 / per_unit);
  impulse_.jump /= per_unit;
  if (good) return;
  RunFailure failure = describe_breakdown(m, workspace_.breakdown, state_.t);
  tell_singular_posture(m, workspace_.breakdown, state_.t, state_.q.data(), drives_.data(), failure);
  fail(std::move(failure));
}

void Simulation::jump(const std::string& by) {
  const Model& m = *model_;
  const std::vector<NodeWrench>& blows = impulse_.wrenches;
  const Eigen::VectorXd& hinges = impulse_.hinges;
  ledger();  // up to here
  const Sums before = sums();
  Jump jump(*this);
  Balances::Integrals given = Balances::Integrals::Zero();
  const auto add_half_of_work = [&](const Observer& o) {
    for (const NodeWrench& w : blows) {
      const NodeState n = o.node(w.node);
      given[6] += 0.5 * (moment_of(w).dot(n.velocity.head<3>()) + force_of(w).dot(n.velocity.tail<3>()));
    }
    given[6] += 0.5 * hinges.dot(state_.v);
  };
  const Observer& o = observe();
  for (const NodeWrench& w : blows) {
    const NodeState n = o.node(w.node);
    const Eigen::Vector3d in_world = n.R_WN * force_of(w);
    given.head<3>() += in_world, given.segment<3>(3) += n.R_WN * moment_of(w) + n.position.cross(in_world);
  }
  add_half_of_work(o);

  find_jump();
  state_.v += impulse_.jump;
  holds_.begin_anew = jumped_ = true;
  changed();
  if (!m.devices.holds.empty()) settle_holds();

  add_half_of_work(observe());
  const Balances::Integrals changed_by = gained(before, sums());
  // Where something else holds the vehicle, the ground or a given motion, what that gives comes from outside too.
  const auto floats = [&](int root) { return m.user[static_cast<std::size_t>(root)].nv == 6; };
  const auto on_ground = [](const Loop& l) { return l.closing != Closing::coupling && (l.from.node < 0 || l.to.node < 0); };
  const bool free =
      prescribed_.empty() && drives_.empty() && std::ranges::all_of(roots_, floats) && std::ranges::none_of(m.loops.all, on_ground);
  balances_.jump(free ? given : changed_by);
  if (recorder_)
    recorder_->note(Note::event, state_.t,
                    {by, fmt::format("impulse: momentum {:.6g} N s, angular momentum {:.6g} N m s, energy {:+.6g} J",
                                     changed_by.head<3>().norm(), changed_by.segment<3>(3).norm(), changed_by[6])});
  jump.end();
}

bool Simulation::is_at(const Limit& limit) const {
  constexpr double kRounding = 1e-12;  // of the place, at least of 1 [rad, m]: what an event's action moves away is not there
  const double missing = limit.side * (limit.value - state_.q[limit.q]);
  return missing <= 0.0 || (limit.passed == state_.t && missing <= kRounding * std::max(1.0, std::abs(limit.value)));
}

/// [rad/s, m/s] Towards it and beyond.
double Simulation::inwards(const Limit& limit) const { return limit.side * state_.v[limit.v]; }

std::string Simulation::told(const Limit& limit) const {
  return fmt::format("{} limit of {}", limit.side > 0 ? "upper" : "lower", name_of(limit.v));
}

/// All at once: each gets an impulse p >= 0 so that it leaves with its restitution times the rate that it came with, or without one faster
/// where others throw it [Pfeiffer, Glocker 1996]. False: their motions are given.
bool Simulation::turn_over(std::span<Limit* const> together) {
  const auto n = std::ssize(together);
  Eigen::MatrixXd W(n, n);  // what one unit of each impulse takes off the rates inwards
  Eigen::VectorXd leave(n);
  observe();
  impulse_.wrenches.clear();
  for (Eigen::Index j = 0; const Limit* limit : together) {
    impulse_.hinges.setZero(model_->nv);
    impulse_.hinges[limit->v] = limit->side;
    find_jump();
    for (Eigen::Index i = 0; const Limit* other : together) W(i++, j) = other->side * impulse_.jump[other->v];
    leave[j++] = (1.0 + limit->bounce.restitution) * inwards(*limit);
  }
  changed();  // what was seen is that of rest
  const Eigen::VectorXd p = complementarity(W, leave);
  if (p.isZero(0.0)) return false;
  impulse_.hinges.setZero(model_->nv);
  std::string by;
  for (Eigen::Index i = 0; const Limit* limit : together) {
    impulse_.hinges[limit->v] -= limit->side * p[i++];
    by += (by.empty() ? "" : ", ") + told(*limit);
  }
  jump(by);
  return true;
}

/// What comes to a limit in this instant, or rests there and is struck by that, which bounces as well, the fastest first.
void Simulation::bounce(std::span<const int> crossed) {
  const auto rate_before = [&](const Limit& limit) -> double& { return x_[static_cast<std::size_t>(model_->nq + limit.v)]; };
  std::vector<Limit*> together;
  const auto blow = [&] {
    const bool turned = turn_over(together);
    for (const Limit* limit : together) rate_before(*limit) = turned && inwards(*limit) > 0.0 ? 0.0 : state_.v[limit->v];
  };
  // It is beyond by what its crossing is resolved to, and would be pushed at from there on its way back.
  const auto come_back = [&](const Limit& limit) {
    ledger();  // up to here
    const Sums before = sums();
    state_.q[limit.q] = limit.value;
    changed();
    balances_.jump(gained(before, sums()));
  };
  for (std::size_t i = 0; i < crossed.size(); ++i) {
    Limit& limit = limits_[i];
    if (crossed[i] != limit.side || !(inwards(limit) > limit.bounce.speed)) continue;
    come_back(limit);
    together.push_back(&limit);
  }
  const auto almost_there = [&](const Limit& limit) {
    const double missing = limit.side * (limit.value - state_.q[limit.q]), place = std::max(1.0, std::abs(limit.value)),
                 rate = inwards(limit);
    if (!(missing > 0.0 && rate > limit.bounce.speed)) return false;
    const auto comes_alike = [&](const Limit* other) { return is_alike(inwards(*other), rate); };
    return missing <= kAlmost * place || (missing <= apart(options_.integrator) * place && std::ranges::any_of(together, comes_alike));
  };
  if (!together.empty()) {
    for (Limit& limit : limits_)
      if (almost_there(limit) && !model_->has_given_motion(limit.v)) together.push_back(&limit);
    blow();
  }
  const auto struck = [&](const Limit& limit) {
    return is_at(limit) && inwards(limit) > limit.bounce.speed && !(limit.side * rate_before(limit) > limit.bounce.speed) &&
           !model_->has_given_motion(limit.v);
  };
  for (int blows = 0;; ++blows) {
    double fastest = 0.0;
    for (const Limit& limit : limits_)
      if (struck(limit)) fastest = std::max(fastest, inwards(limit));
    together.clear();
    for (Limit& limit : limits_)
      if (struck(limit) && inwards(limit) >= kAsFast * fastest) together.push_back(&limit);
    if (together.empty()) return;
    if (blows == kBounces)
      return warn(Code::beyond_the_model, {told(*together[0]), {}},
                  fmt::format("{} blows in one instant are no end of them: it is pressed in", blows),
                  "a restitution below 1, or room between the stops");
    blow();
  }
}

}  // namespace cardan
