// Components that devices hold (dry friction at rest) in a run: where they break away, and that what is held stands still. What holds them
// is found in holding.hpp.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/dynamics/hinge_laws.hpp"
#include "core/sim/alike.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {

namespace {

constexpr double kStillMoves = 1e-10;  // of the largest rate [rad/s, m/s], at least of 1: what is left where rest is located, at most
constexpr double kAtRest = 1e-12;      // likewise: what is less after a jump is its rounding

/// What holds gives way at a root that lies a little beyond the most that settle_holds() leaves alone: on which side of it a state begins
/// is never a matter of rounding.
constexpr double kLoose = 1.0 + 1e-12, kRoot = 1.0 + 1e-10;

constexpr double kAlike = 1e-9;  // relative: what is loaded alike gives way together, and what is pushed along alike is held again together

constexpr std::size_t kRounds = 12;  // looks at each, at most: where some hold or slide against each other they are tried in turn

/// Of loads that grow together from nothing what has the largest part of its most gives way first.
double overload(const Holding::Force& f) {
  return f.leaves != 0 ? std::numeric_limits<double>::infinity() : f.force == 0.0 ? 0.0 : std::abs(f.force) / f.most;
}
/// Whether one of these comes before the other is a matter of rounding. Dead centres are left one by one: others may stand there because of
/// the first.
bool is_loaded_alike(const Holding::Force& a, const Holding::Force& b) {
  return a.leaves == 0 && b.held && std::abs(overload(a) - overload(b)) <= kAlike * overload(a);
}
bool is_pushed_alike(const Holding::Force& a, const Holding::Force& b) {
  const double by = std::abs(a.acceleration);
  return std::abs(by - std::abs(b.acceleration)) <= kAlike * by;
}

/// It begins to move against what was found to hold it.
int way_of(const Holding::Force& f) { return f.leaves != 0 ? f.leaves : f.force > 0.0 ? -1 : 1; }

}  // namespace

Inputs Simulation::hold_inputs(double t, const double* x) {
  const double *q = x, *v = q + model_->nq;
  holds_.tau = tau_;
  hinge_laws::add_forces(*model_, q, v, holds_.tau.data());
  holds_.vdot = vdot_given_;
  for (const Prescribed& p : prescribed_) holds_.vdot[static_cast<std::size_t>(p.index)] = p.profile.acceleration(t, std::min(t, stretch_));
  drive_loops(t, std::min(t, stretch_), holds_.drives);
  return {.q = q, .v = v, .tau = holds_.tau.data(), .vdot = holds_.vdot.data(), .wrenches = wrenches_, .drives = holds_.drives.data()};
}

bool Simulation::look_at_holds(double t, const double* x) {
  return holding_->look(*devices_, hold_inputs(t, x), t, x + model_->nq + model_->nv, state_.marks.data());
}

bool Simulation::is_held(const DeviceHold& h) const { return model_->prescribed[static_cast<std::size_t>(h.v)] != 0; }

/// Whether it holds, of a device that may.
double& Simulation::mark_of(const DeviceHold& h) { return state_.marks[model_->devices.all[static_cast<std::size_t>(h.device)].mark]; }

/// [rad/s, m/s] What comes to rest has no more left where that is located, or where it comes alike with others.
double Simulation::hardly_moves() const { return std::max(kStillMoves, apart(options_.integrator)) * scale_of_rates(); }

bool Simulation::anything_is_held() const {
  return std::ranges::any_of(model_->devices.holds, [this](const DeviceHold& h) { return is_held(h); });
}

/// At a trial state: what is left until each held component breaks away; 1 of others, and where v' cannot be evaluated.
void Simulation::hold_roots(double t, const double* x, double* g) {
  const auto& holds = model_->devices.holds;
  std::fill_n(g, holds.size(), 1.0);
  if (!anything_is_held()) return;
  const bool good = look_at_holds(t, with_given_motion(t, x));
  weigh();  // devices_ may not have been told yet what has just broken away
  for (std::size_t i = 0; good && i < holds.size(); ++i)
    if (const Holding::Force& f = holding_->forces()[i]; f.held) g[i] = f.leaves != 0 ? -1.0 : kRoot * f.most - std::abs(f.force);
}

void Simulation::break_away(std::size_t hold, int direction) {
  const int device = model_->devices.holds[hold].device;
  const std::uint32_t n = model_->devices.all[static_cast<std::size_t>(device)].family->n_roots;
  device_event(device, n + 1, direction);
  changed();
}

/// Where it came to rest is known to the rounding of the instant, and so far it moves there still: no error of the steps.
void Simulation::stop_what_is_held() {
  const auto moves = [this](const DeviceHold& h) { return is_held(h) && state_.v[h.v] != 0.0; };
  const auto& holds = model_->devices.holds;
  if (std::ranges::none_of(holds, moves)) return;
  const double still = hardly_moves();
  const bool rounding = std::ranges::none_of(holds, [&](const DeviceHold& h) { return moves(h) && std::abs(state_.v[h.v]) > still; });
  const Sums before = sums();
  for (const DeviceHold& h : holds)
    if (moves(h)) state_.v[h.v] = 0.0;
  changed();
  if (!rounding) return;
  balances_.jump(Balances::Integrals::Zero(), gained(before, sums()).cwiseAbs());
}

void Simulation::hold_again(const DeviceHold& h) {
  state_.v[h.v] = 0.0;
  changed();
  observe();
  start_device(h.device);
  changed();
}

/// What slows down alike beside what has just begun to hold, and has hardly a rate left, holds with it: which of them comes to rest first
/// is not known, and the first one held would throw the others back. Accelerations are those of before.
void Simulation::hold_what_rests_beside(std::span<const int> crossed) {
  const double still = hardly_moves();
  const auto has_crossed = [&](const DeviceHold& h) {
    const Device& device = model_->devices.all[static_cast<std::size_t>(h.device)];
    return std::ranges::any_of(crossed.subspan(static_cast<std::size_t>(device.root), device.family->n_roots),
                               [](int side) { return side != 0; });
  };
  const auto& holds = model_->devices.holds;
  for (const DeviceHold& h : holds) {
    const auto stops_alike = [&](const DeviceHold& other) {
      return has_crossed(other) && mark_of(other) != 0.0 && is_alike(vdot_[other.v], vdot_[h.v]);
    };
    if (mark_of(h) == 0.0 && !has_crossed(h) && std::abs(state_.v[h.v]) <= still && state_.v[h.v] * vdot_[h.v] < 0.0 &&
        std::ranges::any_of(holds, stops_alike))
      mark_of(h) = 1.0, changed();
  }
}

/// What closed loops do not let move because something else is held stands still, and holds as well.
bool Simulation::hold_what_is_blocked(const std::vector<int>& let_go) {
  bool any = false;
  for (std::size_t i = 0; i < let_go.size(); ++i) {
    const DeviceHold& h = model_->devices.holds[i];
    if (let_go[i] != 0 || is_held(h) || !holding_->is_blocked_by_others(i, state_.q.data(), holds_.drives.data())) continue;
    hold_again(h);
    any = any || is_held(h);
  }
  return any;
}

/// What was to stop where its root was passed got a rate in the same instant: it slides on with that.
bool Simulation::is_thrown_on(const DeviceHold& h) const {
  return (jumped_ || holds_.begin_anew) && std::abs(state_.v[h.v]) > kStillMoves * scale_of_rates();
}

/// A rate that a jump has left of nothing is none.
void Simulation::stop_rounding() {
  const double still = kAtRest * scale_of_rates();
  for (const DeviceHold& h : model_->devices.holds)
    if (std::abs(state_.v[h.v]) <= still) state_.v[h.v] = 0.0;
}

/// Where rates were set from outside, devices that hold begin with them as at the start. What has got a rate is not held while that is
/// looked at: of closed loops that are held in more places than they need be nothing could be evaluated.
void Simulation::start_holds() {
  const auto& holds = model_->devices.holds;
  if (!std::exchange(holds_.begin_anew, false) || !begun_ || holds.empty()) return;
  stop_rounding();
  for (const DeviceHold& h : holds)
    if (state_.v[h.v] != 0.0) mark_of(h) = 0.0;
  changed();
  observe();
  for (const DeviceHold& h : holds) start_device(h.device);
  changed();
}

/// What is held stands still; what more would be needed for than can be breaks away, one after the other, what is loaded most first, alike
/// ones together: what still holds may need less then. What would then begin to move against the way that it was let go, and be pushed
/// along by its friction, is held again.
void Simulation::settle_holds() {
  start_holds();
  std::vector<int> let_go = std::move(holds_.let_go);  // its room is kept; what a device does as it breaks away may come here again
  let_go.assign(model_->devices.holds.size(), 0);
  settle_holds(let_go);
  holds_.let_go = std::move(let_go);
}
void Simulation::settle_holds(std::vector<int>& let_go) {
  const auto& holds = model_->devices.holds;
  for (std::size_t pass = 0; holding_ && pass <= kRounds * holds.size(); ++pass) {
    if (!anything_is_held() && std::ranges::all_of(let_go, [](int way) { return way == 0; })) return;
    if (!loops_) stop_what_is_held();                // with loops once it is known to hold: others may move on
    if (!look_at_holds(state_.t, packed())) return;  // told where the dynamics come upon it
    const auto& forces = holding_->forces();
    const auto is_loose = [&](std::size_t i) { return overload(forces[i]) > kLoose; };
    const auto is_pushed_along = [&](std::size_t i) { return let_go[i] * forces[i].acceleration < 0.0; };
    auto i = static_cast<std::size_t>(std::ranges::max_element(forces, {}, overload) - forces.begin());
    const bool in_order = pass > 2 * holds.size();  // one by one it comes to an end [Murty 1974]
    if (in_order || !is_loose(i))
      for (i = 0; i < holds.size() && !is_loose(i) && !is_pushed_along(i);) ++i;
    if (i == holds.size()) {
      stop_what_is_held();
      if (!loops_ || !hold_what_is_blocked(let_go)) return;
    } else if (is_loose(i)) {
      for (std::size_t j = 0; j < holds.size(); ++j) {
        if (j != i && (in_order || !is_loaded_alike(forces[i], forces[j]))) continue;
        let_go[j] = way_of(forces[j]);
        break_away(j, let_go[j]);
      }
    } else {
      for (std::size_t j = 0; j < holds.size(); ++j) {
        if (j != i && (in_order || !is_pushed_along(j) || !is_pushed_alike(forces[i], forces[j]))) continue;
        hold_again(holds[j]);
        let_go[j] = 0;
      }
    }
  }
}

/// Where what holds gives way, and with it what is loaded alike; true if any did.
bool Simulation::hold_events(std::span<const int> crossed) {
  bool any = false;
  for (std::size_t i = 0; holding_ && i < model_->devices.holds.size(); ++i) {
    if (crossed[static_cast<std::size_t>(model_->devices.n_roots) + i] >= 0) continue;
    any = true;
    if (!look_at_holds(state_.t, packed())) continue;
    const auto& forces = holding_->forces();
    for (std::size_t j = 0; forces[i].held && j < forces.size(); ++j)
      if (j == i || is_loaded_alike(forces[i], forces[j])) break_away(j, way_of(forces[j]));
  }
  return any;
}

}  // namespace cardan
