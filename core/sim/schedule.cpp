#include "core/sim/schedule.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

namespace cardan {
namespace {

__extension__ using Wide = __int128;  // products of two 64-bit numbers

Rational period(double value, bool is_hertz, const Located& at) {
  const auto refuse = [&](std::string expected, std::string hint) {
    cardan::refuse(Code::out_of_range, at, std::move(expected), fmt::format("{} {}", value, is_hertz ? "Hz" : "s"), std::move(hint));
  };
  if (!(value > 0.0) || !std::isfinite(value)) refuse(is_hertz ? "a rate > 0 Hz" : "a period > 0 s", {});
  const std::optional<Rational> ratio = to_rational(value);
  if (!ratio) {
    const std::string rounded = fmt::format("{:.3g}", value), inverse = fmt::format("{:.3g}", 1.0 / value);
    const auto taken = [](const std::string& text) {
      double x = std::numeric_limits<double>::quiet_NaN();
      std::from_chars(text.data(), text.data() + text.size(), x);
      return to_rational(x).has_value();
    };
    const char* other = is_hertz ? "period" : "rate";
    std::string hint = "ticks are from 1 ns to 1e9 s apart";  // a number that is suggested must be one that is taken
    if (taken(rounded))
      hint = fmt::format("give the {} instead (1/60 Hz is a period of 60 s), or round it: {} {}", other, rounded, is_hertz ? "Hz" : "s");
    else if (taken(inverse))
      hint = fmt::format("give the {} instead: {} {}", other, inverse, is_hertz ? "s" : "Hz");
    refuse(fmt::format("a {} that is a ratio of whole numbers up to 1e9 over up to 1e6", is_hertz ? "rate" : "period"), std::move(hint));
  }
  return is_hertz ? Rational{ratio->denominator, ratio->numerator} : *ratio;
}

constexpr std::int64_t kFinestUnit = std::int64_t{1} << 53;  // parts of a second are exact as doubles: what coincides has the same time

/// n / unit seconds.
Instant instant_of(Wide n, std::int64_t unit) {
  Wide whole = n / unit, part = n % unit;
  if (part < 0) --whole, part += unit;
  return {static_cast<std::int64_t>(whole), static_cast<std::int64_t>(part), unit};
}

}  // namespace

/// Continued fraction of |value|: its convergents are the best approximations for their size.
std::optional<Rational> to_rational(double value) {
  constexpr double largest_denominator = 1e6;
  const double size = std::abs(value);
  if (!(size <= static_cast<double>(Rational::kLargest))) return std::nullopt;
  double p = 1.0, q = 0.0, p_before = 0.0, q_before = 1.0, rest = size;
  for (;;) {
    const double term = std::floor(rest);
    p_before = std::exchange(p, term * p + p_before);
    q_before = std::exchange(q, term * q + q_before);
    if (q > largest_denominator || p > static_cast<double>(Rational::kLargest)) return std::nullopt;
    if (std::abs(p / q - size) <= 4.0 * std::numeric_limits<double>::epsilon() * size) break;
    rest = 1.0 / (rest - term);
  }
  return Rational{static_cast<std::int64_t>(std::copysign(p, value)), static_cast<std::int64_t>(q)};
}

std::optional<Instant> to_instant(double t) {
  const std::optional<Rational> ratio = to_rational(t);
  if (!ratio) return std::nullopt;
  const Instant instant = instant_of(ratio->numerator, ratio->denominator);
  return instant.seconds() == t ? std::optional(instant) : std::nullopt;
}

double on_ticks(double t) {
  const std::optional<Rational> ratio = to_rational(t);
  return ratio ? instant_of(ratio->numerator, ratio->denominator).seconds() : t;
}

std::optional<Instant> later(const Instant& i, double duration) {
  const std::optional<Rational> more = to_rational(duration);
  if (!more) return std::nullopt;
  const Wide unit = static_cast<Wide>(i.unit) / std::gcd(i.unit, more->denominator) * more->denominator;
  if (unit > kFinestUnit) return std::nullopt;
  const Wide n = static_cast<Wide>(i.whole) * unit + unit / i.unit * i.part + unit / more->denominator * more->numerator;
  return instant_of(n, static_cast<std::int64_t>(unit));
}

Instant next_tick(const Rational& period, double t) {
  const auto tick = [&period](std::int64_t k) { return instant_of(static_cast<Wide>(k) * period.numerator, period.denominator); };
  const double k = std::floor(t * static_cast<double>(period.denominator) / static_cast<double>(period.numerator)) - 2.0;
  auto next = static_cast<std::int64_t>(std::max(k, 0.0));
  while (tick(next).seconds() <= t) ++next;
  return tick(next);
}

Rational period_from_hertz(double hertz, const Located& at) { return period(hertz, true, at); }
Rational period_from_seconds(double seconds, const Located& at) { return period(seconds, false, at); }

int Schedule::add(Rational period, Rational offset) {
  const auto fits = [](Rational r) {
    return std::abs(r.numerator) <= Rational::kLargest && r.denominator > 0 && r.denominator <= Rational::kLargest;
  };
  if (!fits(period) || !fits(offset) || period.numerator <= 0)
    throw std::logic_error("Schedule::add: period and offset must be fractions of numbers up to 1e9, the period positive");
  const std::int64_t unit = std::lcm(period.denominator, offset.denominator);
  if (unit > kFinestUnit) throw std::logic_error("Schedule::add: period and offset have no common unit of time");
  entries_.push_back({offset.numerator * (unit / offset.denominator), period.numerator * (unit / period.denominator), unit, 0});
  look_ahead();
  return static_cast<int>(entries_.size()) - 1;
}

void Schedule::start(double t) {
  for (Entry& e : entries_) {
    const double unit = static_cast<double>(e.unit);
    const double k = std::floor((t * unit - static_cast<double>(e.first)) / static_cast<double>(e.step)) - 2.0;
    e.k = static_cast<std::int64_t>(std::max(k, 0.0));
    while (e.instant().seconds() < t) ++e.k;
  }
  look_ahead();
}

void Schedule::remember(Archive& archive) {
  std::size_t n = entries_.size();
  archive(n);
  if (n != entries_.size()) archive.wrong("another number of clocked tasks");
  for (Entry& e : entries_) {
    archive(e.k);
    if (e.k < 0) archive.wrong("a tick before the first");
  }
  look_ahead();
}

void Schedule::let_inside(int entry, bool inside) {
  entries_[static_cast<std::size_t>(entry)].inside = inside;
  look_ahead();
}

bool Schedule::any_inside() const {
  /// Whether b ticks wherever a does, all in units of one over the product of theirs.
  const auto follows = [](const Entry& a, const Entry& b) {
    const Wide step = static_cast<Wide>(b.step) * a.unit, after = static_cast<Wide>(a.first) * b.unit - static_cast<Wide>(b.first) * a.unit;
    return after >= 0 && after % step == 0 && static_cast<Wide>(a.step) * b.unit % step == 0;
  };
  return std::ranges::any_of(entries_, [&](const Entry& a) {
    return a.inside && std::ranges::none_of(entries_, [&](const Entry& b) { return !b.inside && follows(a, b); });
  });
}

/// Times of instants that come one after the other are too, equal ones are equal.
void Schedule::look_ahead() {
  time_ = stop_ = std::numeric_limits<double>::infinity();
  for (const Entry& e : entries_) {
    const double t = e.instant().seconds();
    time_ = std::min(time_, t);
    if (!e.inside) stop_ = std::min(stop_, t);
  }
}

double Schedule::shortest_period() const {
  double shortest = std::numeric_limits<double>::infinity();
  for (const Entry& e : entries_)
    if (!e.inside) shortest = std::min(shortest, static_cast<double>(e.step) / static_cast<double>(e.unit));
  return shortest;
}

Schedule::Tick Schedule::next() {
  const std::size_t i = earliest();
  const Tick tick{static_cast<int>(i), entries_[i].k++};
  look_ahead();
  return tick;
}

bool Schedule::stands_at(double t) const {
  return std::all_of(entries_.begin(), entries_.end(),
                     [t](const Entry& e) { return e.instant().seconds() >= t && (e.k == 0 || e.instant(e.k - 1).seconds() <= t); });
}

Instant Schedule::Entry::instant(std::int64_t tick) const {
  return instant_of(static_cast<Wide>(first) + static_cast<Wide>(tick) * step, unit);
}

bool Schedule::before(const Instant& a, const Instant& b) {
  if (a.whole != b.whole) return a.whole < b.whole;
  return static_cast<Wide>(a.part) * b.unit < static_cast<Wide>(b.part) * a.unit;
}

/// Of several at one instant the first.
std::size_t Schedule::earliest() const {
  const auto found =
      std::min_element(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) { return before(a.instant(), b.instant()); });
  return static_cast<std::size_t>(found - entries_.begin());
}

}  // namespace cardan
