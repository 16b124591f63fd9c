// Motion that is not free: components and lengths of loops that are functions of time, and loops that stay closed.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/sim/loop_doubts.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {

namespace {

// Of closed loops, relative to their size:
constexpr double kDrift = 10.0;      // relative tolerances that the history of an integrator may be off before it starts anew
constexpr double kGivenOpen = 1e-6;  // what a state that was given may be open by: typed numbers have a finite number of digits
constexpr double kGivenDrift = 1e3;  // ... or so many relative tolerances
constexpr double kGivenMoves = 1e3;  // how much more than that its coordinates may move [rad, m; of large ones relatively]

/// Rates [rad/s, m/s] that differ by more than the rounding of what computed them: in the ninth digit of `size`, slow ones by 1e-12.
bool apart(double a, double b, double size) { return std::abs(a - b) > 1e-9 * std::max(size, 1e-3); }

/// Where one profile follows another.
bool jumps(double before, double rate, const MotionProfile& was, const MotionProfile& is) {
  constexpr double kEver = std::numeric_limits<double>::infinity();
  return apart(rate, before, std::max(was.largest_rate(-kEver, kEver), is.largest_rate(-kEver, kEver)));
}

const char* unit_of(const Loop& loop) { return loop.closing == Closing::distance ? " m/s" : " 1/s"; }

}  // namespace

void Simulation::prescribe(int v_index, MotionProfile profile) {
  const auto p = std::ranges::find(prescribed_, v_index, &Prescribed::index);
  if (p == prescribed_.end())
    refuse(Code::bad_initial_state, {"profile of " + name_of(v_index)}, "a component that is prescribed", "one that is free to move",
           "say so in the vehicle: hinge.prescribed");
  double& v = state_.v[v_index];
  if (const double rate = profile.rate(state_.t); begun_ && !jumps(v, rate, p->profile, profile)) v = rate;
  p->profile = std::move(profile);
  p->given = true;
  if (begun_) {
    // What a rate that jumps brings in is known, and told of: it is no error of the steps.
    const bool jumped = p->profile.rate(state_.t) != v;
    if (jumped) ledger();  // up to here
    const Sums before = jumped ? sums() : Sums{};
    Jump jump(*this);
    start_given_motion();
    changed();
    if (jumped) {
      balances_.jump(gained(before, sums()));
      struck_by_loops_ = true;  // others follow
    }
    jump.end();
  }
  changed();
}

const MotionProfile* Simulation::profile(int v_index) const {
  const auto p = std::ranges::find(prescribed_, v_index, &Prescribed::index);
  return p == prescribed_.end() || !p->given ? nullptr : &p->profile;
}

/// Rates are those of the profiles from now on, coordinates go on from where they are.
void Simulation::start_given_motion() {
  for (PrescribedLoop& p : prescribed_loops_) p.more_0 = p.more(state_.t), p.t_0 = state_.t;
  for (Prescribed& p : prescribed_) {
    double& v = state_.v[p.index];
    if (!p.given && p.profile.rate(state_.t) != v) p.profile = MotionProfile::hold(v);
    const double rate = p.profile.rate(state_.t), before = v;
    if (apart(rate, before, std::max(std::abs(rate), std::abs(before))) && (begun_ || before != 0.0))
      warn(Code::mission_doubt, {"profile of " + name_of(p.index), {}},
           fmt::format("the rate is {:.6g} and the profile's {:.6g}: it jumps, and what that does to other bodies is left out", before,
                       rate),
           "let the profile begin with the rate that is there, and change it over a time");
    v = rate;
    p.t_0 = state_.t;
    if (p.coordinate >= 0) p.q_0 = state_.q[p.coordinate];
  }
}

void Simulation::give_motion(double t, double* q, double* v) const {
  for (const Prescribed& p : prescribed_) {
    v[p.index] = p.profile.rate(t);
    if (p.coordinate >= 0) q[p.coordinate] = p.q_0 + p.profile.travel(p.t_0, t);
  }
}

/// x as the physics sees it: prescribed components are functions of time and not what was integrated of them.
const double* Simulation::with_given_motion(double t, const double* x) {
  if (prescribed_.empty()) return x;
  std::copy_n(x, x_given_.size(), x_given_.begin());
  give_motion(t, x_given_.data(), x_given_.data() + model_->nq);
  return x_given_.data();
}

void Simulation::prescribe_loop(std::string_view loop, MotionProfile profile) {
  const auto p = std::ranges::find(prescribed_loops_, loop, &PrescribedLoop::name);
  if (p == prescribed_loops_.end())
    refuse(Code::bad_initial_state, {fmt::format("profile of {}", loop)}, "a loop that is prescribed, and closed", "one that is not",
           "say so in the vehicle: loops.<name>.prescribed");
  p->more_0 = p->more(state_.t), p->t_0 = state_.t;
  const double before = p->profile.rate(state_.t), rate = profile.rate(state_.t);
  if (begun_ && jumps(before, rate, p->profile, profile)) {
    struck_by_loops_ = true;
    warn(Code::mission_doubt, {fmt::format("profile of {}", loop), {}},
         fmt::format("the rate is {:.6g} and the profile's {:.6g}: it jumps, and the vehicle takes it as a blow", before, rate),
         "let the profile begin with the rate that is there, and change it over a time");
  }
  p->profile = std::move(profile);
  p->given = true;
  changed();
}

const MotionProfile* Simulation::loop_profile(std::string_view loop) const {
  const auto p = std::ranges::find(prescribed_loops_, loop, &PrescribedLoop::name);
  return p == prescribed_loops_.end() || !p->given ? nullptr : &p->profile;
}

/// `since`: as in MotionProfile::acceleration().
void Simulation::drive_loops(double t, double since, std::vector<LoopDrive>& drives) const {
  drives.resize(prescribed_loops_.size());
  for (std::size_t i = 0; i < drives.size(); ++i) {
    const PrescribedLoop& p = prescribed_loops_[i];
    drives[i] = {p.more(t), p.profile.rate(t), p.profile.acceleration(t, since)};
  }
}

// Of loops whose length or offset is given: initial rates that move it are those of its profile.
void Simulation::expect_profiles() {
  if (std::ranges::all_of(prescribed_loops_, &PrescribedLoop::given)) return;
  start_lengths();
}

std::vector<std::pair<const Loop*, double>> Simulation::loops_that_begin_otherwise() {
  std::vector<std::pair<const Loop*, double>> out;
  if (!loops_ || (prescribed_.empty() && drives_.empty())) return out;
  const Eigen::VectorXd rates = loop_matrix(*model_, workspace_, state_.q.data(), drives_.data()) * state_.v;
  observed_ = ledger_known_ = false;
  const double limit = kGivenOpen * scale_of_rates();
  for (const Loop& loop : model_->loops.all)
    for (int i = loop.first; i < loop.first + loop.rows; ++i) {
      const double wanted = loop.drive < 0 ? 0.0 : prescribed_loops_[static_cast<std::size_t>(loop.drive)].profile.rate(state_.t);
      if (!(std::abs(rates[i]) > limit && std::abs(rates[i] - wanted) > limit)) continue;
      out.emplace_back(&loop, rates[i]);
      break;
    }
  return out;
}

void Simulation::start_lengths() {
  const auto otherwise = loops_that_begin_otherwise();
  for (const auto& [begun, rate] : otherwise) {
    const Loop& loop = *begun;
    if (loop.drive < 0) continue;
    const PrescribedLoop& p = prescribed_loops_[static_cast<std::size_t>(loop.drive)];
    const double wanted = p.profile.rate(state_.t);
    const auto unit = [&](double x) { return fmt::format("{:.6g}{}", x, unit_of(loop)); };
    if (!p.given)
      refuse(Code::open_start, model_->spec->locate("loops." + loop.name),
             "a profile that begins with its rate, or initial rates that leave it as it is", unit(rate),
             fmt::format("in the mission: sat:loop(\"{}\"):profile{{...}}", loop.name));
    warn(Code::mission_doubt, {fmt::format("profile of {}", loop.name), {}},
         fmt::format("the rate is {} and the profile's {}: the vehicle begins with that of the profile", unit(rate), unit(wanted)),
         "give `initial` of the hinges rates that go with it, or none");
  }
  if (!begun_ || (drives_.empty() && otherwise.empty())) return;
  // From rest: what the loops do not tell of the rates follows from masses, by an impulse along the given lengths.
  const LoopRank rank = loop_rank(*model_, workspace_, state_.q.data(), drives_.data());
  const Eigen::VectorXd rates = loop_matrix(*model_, workspace_, state_.q.data(), drives_.data()) * state_.v;
  observed_ = ledger_known_ = false;
  if (model_->nv - static_cast<int>(prescribed_.size()) <= rank.rank) return;
  for (const Prescribed& p : prescribed_) {
    const double rate = state_.v[p.index];  // that of its profile
    if (rate != 0.0 && std::ranges::any_of(otherwise, [&](const auto& loop) { return std::ranges::count(loop.first->rates, p.index) > 0; }))
      warn(Code::mission_doubt, {fmt::format("profile of {} at the start", name_of(p.index)), {}},
           fmt::format(
               "it begins with {:.6g}, and other hinges of a loop do not begin with rates that go with that: the vehicle takes it as "
               "a blow",
               rate),
           "let the profile begin at rest, and change its rate over a time, or give `initial` of the hinges rates that go with it");
  }
  const double limit = kGivenOpen * scale_of_rates();
  for (const Loop& loop : model_->loops.all) {
    if (loop.drive < 0) continue;
    const double wanted = prescribed_loops_[static_cast<std::size_t>(loop.drive)].profile.rate(state_.t);
    if (std::abs(rates[loop.first]) > limit || std::abs(wanted) <= limit) continue;
    warn(Code::mission_doubt, {fmt::format("profile of {} at the start", loop.name), {}},
         fmt::format("the rate is 0{0} and the profile's {1:.6g}{0}: it jumps, and the vehicle takes it as a blow", unit_of(loop), wanted),
         "let the profile begin at rest, and change its rate over a time, or give `initial` of the hinges rates that go with it");
  }
}

// Onto closed loops. false: they cannot be closed from there.
bool Simulation::close_loops(double t, double* q, double* v) {
  bool closed = false;
  drive_loops(t, std::min(t, stretch_), drives_);
  unless_thrown([&] { closed = loops_->close(q, v, drives_.data()); });
  if (!closed) obstacle_.breakdown = loops_->breakdown(), keep_broken(t, q);
  if (closed && loops_->pivot() < nearest_.pivot) nearest_ = {loops_->pivot(), t};
  if (closed && loops_->pivot() < kNearSingular)
    tell_near_singular(fmt::format("has a scaled pivot of {:.2g}, below {:g}", loops_->pivot(), kNearSingular));
  if (closed && (loops_->left_open() > 0.0 || model_->loops.left_open) && !std::exchange(told_left_open_, true)) tell_left_open(q, v);
  drifted_ = drifted_ || loops_->drift() > kDrift * options_.integrator.relative_tolerance;
  return closed;
}

// Of a loop that the start was not told of.
void Simulation::tell_left_open(const double* q, const double* v) {
  const Warnings found = open_rows_of_loops(*model_, Eigen::Map<const Eigen::VectorXd>(q, model_->nq),
                                            Eigen::Map<const Eigen::VectorXd>(v, model_->nv), drives_.data());
  for (const Warning& w : found.all())
    if (std::ranges::none_of(warnings_.all(), [&](const Warning& told) {
          return told.what.code == w.what.code && told.what.at.key_path == w.what.at.key_path;
        }))
      warn(w.what.code, w.what.at, w.what.about, w.what.hint);
}

// Once for each loop.
void Simulation::tell_near_singular(const std::string& what) {
  const int row = loops_->weakest();
  const Loop& loop = *std::ranges::find_if(model_->loops.all, [row](const Loop& l) { return row < l.first + l.rows; });
  Located at = model_->spec->locate("loops." + loop.name);
  for (const Warning& w : warnings_.all())
    if (w.what.code == Code::near_singular && w.what.at.key_path == at.key_path) return;
  warn(
      Code::near_singular, std::move(at), fmt::format("row {} of the loop {}", row - loop.first + 1, what),
      headway_.steps() == 0
          ? "if other rows should imply it, more digits of places and axes: it holds what is meant to move; if not, loops that begin there "
            "may go on in another branch: see docs/errors.md"
          : "multipliers grow as the inverse of its pivot, and loops that begin there may go on in another branch: see docs/errors.md");
}

// A state that was given is closed but for rounding and typing.
void Simulation::start_closed() {
  if (!loops_) return;
  obstacle_.forget();
  const double scale = scale_of_rates();
  const bool struck = std::exchange(struck_by_loops_, false);
  Sums before;
  std::optional<Jump> jump;
  if (struck) ledger(), before = sums(), jump.emplace(*this);
  Eigen::Map<Eigen::VectorXd> as_given(x_.data(), model_->nq);  // packed anew after this
  as_given = state_.q;
  if (!close_loops(state_.t, state_.q.data(), state_.v.data())) fail(explain({}));
  // Rows that contradict each other by what was typed hold almost nothing beside each other: what closes them is far away.
  const double moved = ((state_.q - as_given).array().abs() / as_given.array().abs().max(1.0)).maxCoeff();
  const double far = kGivenMoves * std::max(loops_->distance(), kGivenOpen);
  if (headway_.steps() == 0 && !(moved <= far)) {
    obstacle_.breakdown = {.body = 1, .value = loops_->distance(), .limit = loops_->distance() * far / moved, .row = loops_->worst()};
    state_.q = as_given;
    keep_broken(state_.t, state_.q.data());
    fail(explain({}));
  }
  const double typed = model_->loops.left_open ? kTyped : kGivenOpen;
  const double limit = std::max(typed, kGivenDrift * options_.integrator.relative_tolerance);
  const double open = prescribed_.empty() && drives_.empty() ? std::max(loops_->distance(), loops_->rate() / scale) : loops_->distance();
  if (!(open <= limit)) {
    obstacle_.breakdown = {.body = 1, .value = open, .limit = limit, .row = loops_->worst()};
    keep_broken(state_.t, state_.q.data());
    fail(explain({}));
  }
  drifted_ = false;
  if (!struck) return;
  observed_ = ledger_known_ = false;
  balances_.jump(gained(before, sums()));
  jump->end();
}

double Simulation::next_corner() const {
  double t = std::min(ages_.next(model_->devices), next_fault());
  for (const auto& p : prescribed_) t = std::min(t, p.profile.next_corner(state_.t));
  for (const auto& p : prescribed_loops_) t = std::min(t, p.profile.next_corner(state_.t));
  return t;
}

}  // namespace cardan
