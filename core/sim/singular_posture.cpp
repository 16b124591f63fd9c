// Past a posture in which a row of closed loops holds nothing (docs/mathematics/loops.md, 7: singular postures).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/sim/near_singular.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {
namespace {

constexpr double kNear = 1e-2;   // a scaled pivot from which on it is looked at ...
constexpr double kLeast = 1e-4;  // ... and beyond which the motion goes on at least
constexpr int kTries = 6;

/// Weights of values at the times s, in which the polynomial through them has the integral from 0 to 1: Gauss' rule of four points.
std::vector<double> weights(const std::vector<double>& s) {
  constexpr std::array<double, 4> at = {0.06943184420297371, 0.33000947820757187, 0.66999052179242813, 0.93056815579702629},
                                  of = {0.17392742256872693, 0.32607257743127307, 0.32607257743127307, 0.17392742256872693};
  std::vector<double> all(s.size(), 0.0);
  for (std::size_t j = 0; j < s.size(); ++j)
    for (std::size_t g = 0; g < at.size(); ++g) {
      double base = of[g];
      for (std::size_t i = 0; i < s.size(); ++i)
        if (i != j) base *= (at[g] - s[i]) / (s[j] - s[i]);
      all[j] += base;
    }
  return all;
}

}  // namespace

// Steps may be much shorter than the way that is left, and more of them say no more: the newest state alone may be near the one before it.
void Simulation::Trail::add(double t, double pivot, const std::vector<double>& x) {
  if (n > 0 && pivot >= all[0].pivot) n = 0;
  const bool instead = n > 1 && all[1].pivot < 1.3 * all[0].pivot;
  if (!instead) std::rotate(all.begin(), all.end() - 1, all.end()), n = std::min(n + 1, static_cast<int>(all.size()));
  all[0].t = t, all[0].pivot = pivot, all[0].x = x;
}

// The motion itself is smooth there, but rounding of the loops is an error over the pivot's square in the direction of motion: the error
// test would make the steps ever smaller, down to where rounding alone parts the branches from each other. So the integrator is not asked:
// to as far on the other side x' is a polynomial through its last states and the one there, all of them away from the posture.
void Simulation::pass_singular_posture(double t_stop) {
  if (trail_.n < 3 || !(trail_.all[0].pivot < kNear)) return;
  const double t = state_.t, pivot = trail_.all[0].pivot, falls = (trail_.all[1].pivot - pivot) / (t - trail_.all[1].t);
  if (!(falls > 0.0) || !(t < t_stop)) return;
  const double there = pivot / falls, h = std::min(there + std::max(pivot, kLeast) / falls, t_stop - t);
  if (!(h > 1.5 * there) || t + h == t) return;
  const double t_after = h == t_stop - t ? t_stop : t + h;

  const auto n = static_cast<Eigen::Index>(x_.size()), n_all = n + (options_.ledger ? Balances::kIntegrals : 0);
  const Eigen::ArrayXd x0 = Eigen::Map<const Eigen::ArrayXd>(x_.data(), n);
  const std::vector<double> absolute = absolute_tolerances();
  const auto slope = [&](double at, const double* x, auto f) {
    f.setZero();
    return rhs(at, x, f.data()) && (n_all == n || unless_thrown([&] { integrands(at, x, f.data() + n); })) && f.allFinite();
  };
  std::vector<double> s{1.0};  // times, in h from t: there, and where it was, newest first
  for (int i = 0; i < trail_.n; ++i) s.push_back((trail_.all[static_cast<std::size_t>(i)].t - t) / h);
  Eigen::ArrayXXd f(n_all, trail_.n + 1);
  /// What the polynomial through the values at s[from], ..., s[to - 1] gains in h.
  const auto gain = [&](std::size_t from, std::size_t to) -> Eigen::ArrayXd {
    const std::vector<double> w = weights({s.begin() + static_cast<std::ptrdiff_t>(from), s.begin() + static_cast<std::ptrdiff_t>(to)});
    Eigen::ArrayXd all = Eigen::ArrayXd::Zero(n_all);
    for (std::size_t j = from; j < to; ++j) all += h * w[j - from] * f.col(static_cast<Eigen::Index>(j));
    return all;
  };
  Eigen::ArrayXd x1, gained, unsure;
  const auto apart = [&](const Eigen::ArrayXd& a, const Eigen::ArrayXd& b) {
    const Eigen::ArrayXd allowed = Eigen::Map<const Eigen::ArrayXd>(absolute.data(), n) +
                                   options_.integrator.relative_tolerance * x0.abs() +
                                   rounded_direction(pivot) * (x0.abs() + gained.head(n).abs());
    return ((a - b).head(n).abs() / allowed).maxCoeff();
  };
  const auto reach = [&](const Eigen::ArrayXd& by) {  // an error across the loops ends here
    x1 = x0 + by.head(n);
    project(t_after, x1.data());
    return x1.allFinite() && loops_->pivot() > 0.5 * pivot;
  };
  const auto find = [&] {
    for (int i = 0; i < trail_.n; ++i)
      if (const auto& r = trail_.all[static_cast<std::size_t>(i)]; !slope(r.t, r.x.data(), f.col(i + 1))) return false;
    gained = gain(1, s.size());
    for (int tries = 0; tries < kTries; ++tries) {
      if (!reach(gained) || !slope(t_after, x1.data(), f.col(0))) return false;
      const Eigen::ArrayXd now = gain(0, s.size());
      const double change = apart(now, gained);
      gained = now;
      if (change > 0.1) continue;
      const Eigen::ArrayXd less = gain(0, s.size() - 1);
      if (!reach(less)) return false;
      const Eigen::ArrayXd by_one_less = x1;
      unsure = (gained - less).abs();
      return reach(gained) && apart(x1, by_one_less) <= 1.0;
    }
    return false;
  };
  const auto sides = [&](double at, const double* x) {
    std::vector<double> g(static_cast<std::size_t>(n_roots()));
    if (!g.empty()) roots(at, x, g.data());
    return g;
  };

  const bool drifted = drifted_;
  stretch_ = t;
  bool passed = find();
  if (passed) {  // what happens on the way is for the integrator to find
    const std::vector<double> g0 = sides(t, x_.data()), g1 = sides(t_after, x1.data());
    passed = std::ranges::equal(g0, g1, [](double a, double b) { return a * b > 0.0 || (a == 0.0 && b == 0.0); });
  }
  stretch_ = std::numeric_limits<double>::infinity();
  drifted_ = drifted;
  if (!passed) return;

  tell_near_singular(
      fmt::format("passes a posture in which it holds nothing (scaled pivot {:.2g} before, {:.2g} after)", pivot, loops_->pivot()));
  std::copy_n(x1.data(), n, x_.begin());
  state_.t = t_after;
  unpack(x_.data());
  observed_ = ledger_known_ = false;
  if (options_.ledger)
    balances_.jump(gained.tail<Balances::kIntegrals>().matrix(),
                   unsure.tail<Balances::kIntegrals>().matrix() +
                       off_near_singular(pivot, options_.integrator.relative_tolerance, momentum(), energy()));
  trail_.n = 0;
  start_anew_for(RestartCause::loops);
  restart();  // whose integrals end where it is
}

}  // namespace cardan
