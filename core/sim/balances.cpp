#include "core/sim/balances.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace cardan {
namespace {

constexpr double kSafety = 10.0;  // of a limit: estimates of errors are estimates, and a norm of many states hides one
constexpr double kJudges = 0.1;   // a limit above judges nothing: what is lost altogether is a residual of one
constexpr double kLargest = std::numeric_limits<double>::max();

struct Row {
  const char* name;
  double LedgerState::*over;
  double LedgerState::*limit;
};
constexpr Row kRows[] = {{"linear momentum", &LedgerState::linear_relative, &LedgerState::linear_limit},
                         {"angular momentum", &LedgerState::angular_relative, &LedgerState::angular_limit},
                         {"energy", &LedgerState::energy_relative, &LedgerState::energy_limit}};

std::array<double, 3> magnitudes(const Momentum& p, const Energy& e) { return {p.linear_magnitude, p.angular_magnitude, e.magnitude}; }

}  // namespace

void LedgerState::remember(Archive& a) {
  a(std::span(linear.data(), 3), std::span(angular.data(), 3), energy, pass);
  for (const Row& row : kRows) a(this->*row.over, this->*row.limit);
}

std::vector<std::string> LedgerState::undecided() const {
  std::vector<std::string> out;
  for (const Row& row : kRows)
    if (!(this->*row.limit <= kJudges)) out.emplace_back(row.name);
  return out;
}

void Balances::begin(const Momentum& p, const Energy& e) {
  start_ << p.linear, p.angular, e.total();
  scale_ = magnitudes(p, e);
}

void Balances::go_on(const Momentum& p, const Energy& e) {
  start_ << p.linear - now_.linear, p.angular - now_.angular, e.total() - now_.energy;
  off_ += last_off_;
  last_off_.setZero();
}

const LedgerState& Balances::look(const Momentum& p, const Energy& e, const Integrals& y, const Integrals& off,
                                  const IntegratorStatistics& counts, double relative, bool inside) {
  LedgerState& s = now_ = {};
  steps_ = counts.steps;
  last_off_ = off;
  s.linear = p.linear - start_.head<3>() - y.head<3>();
  s.angular = p.angular - start_.segment<3>(3) - y.segment<3>(3);
  s.energy = e.total() - start_[6] - y[6];
  const std::array<double, 3> now = magnitudes(p, e), residual = {s.linear.norm(), s.angular.norm(), std::abs(s.energy)};
  for (std::size_t i = 0; i < 3; ++i) scale_[i] = std::max(scale_[i], now[i]);
  const double round_off = 4.0 * std::numeric_limits<double>::epsilon() * (100.0 + static_cast<double>(counts.steps));
  const std::array<double, 3> allowed = {relative * scale_[0] + least_[0], relative * scale_[1] + least_[1],
                                         2.0 * relative * scale_[2] + 2.0 * std::sqrt(scale_[2] * least_[2]) + least_[2]};  // of a square
  const std::array<double, 3> integrals = {(off + off_).head<3>().norm(), (off + off_).segment<3>(3).norm(), off[6] + off_[6]};
  // Of what flies away from the world's origin place and velocity are nearly parallel, and their product is small beside its rounding.
  const std::array<double, 3> rounded = {scale_[0], std::max(scale_[1], p.angular_parts), scale_[2]};
  for (std::size_t i = 0; i < 3; ++i) {
    const Row& row = kRows[i];
    const bool moves = !(scale_[i] <= least_[i]);
    double& over = s.*row.over = moves || !std::isfinite(residual[i]) ? residual[i] / scale_[i] : 0.0;
    if (!std::isfinite(over)) over = kLargest;  // the largest of all: summaries hold numbers
    const double explained = kSafety * (counts.error_sum * allowed[i] + integrals[i]) + round_off * rounded[i];
    const double limit = s.*row.limit = moves ? explained / scale_[i] : 0.0;
    s.pass = s.pass && (over <= limit || (limit > kJudges && over < kLargest));
    if (inside) continue;
    worst_.*row.over = std::max(worst_.*row.over, over);
    worst_.*row.limit = std::max(limit, worst_.*row.limit);
  }
  worst_.pass = worst_.pass && (inside || s.pass);
  return s;
}

std::vector<std::pair<std::string, std::string>> Balances::beyond(const std::string& method) const {
  std::vector<std::pair<std::string, std::string>> all;
  for (const Row& row : kRows) {
    const double over = now_.*row.over, limit = now_.*row.limit;
    if (over <= limit || (limit > kJudges && over < kLargest)) continue;
    all.emplace_back(row.name,
                     over < kLargest
                         ? fmt::format("a residual of {:.1e} of the largest sum of magnitudes; the errors of {} steps of {} explain {:.1e}",
                                       over, steps_, method, limit)
                         : std::string("the residual is not a finite number"));
  }
  return all;
}

void Balances::remember(Archive& a) {
  a(std::span(start_.data(), kIntegrals), std::span(off_.data(), kIntegrals), std::span(scale_), std::span(least_), worst_);
}

}  // namespace cardan
