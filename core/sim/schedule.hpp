#pragma once
// When periodic things happen (controllers, sensors, outputs), on an integer time base: tick k of "10 Hz" is k/10 s,
// computed from k each time, so that nothing drifts and different rates meet exactly where they should. A step of the integrator ends where
// one ticks, but for those that may lie inside of steps.
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/base/checkpoint.hpp"
#include "core/base/diagnostic.hpp"

namespace cardan {

/// numerator/denominator in lowest terms, denominator > 0; seconds or hertz, as the name of the variable says.
struct Rational {
  std::int64_t numerator = 0, denominator = 1;
  double value() const { return static_cast<double>(numerator) / static_cast<double>(denominator); }
  static constexpr std::int64_t kLargest = 1'000'000'000;  // of both, in a Schedule
};

/// The fraction with a denominator of at most 1e6 that `value` stands for (to 4 units in the last place): 0.1 -> 1/10,
/// 0.016666666666666666 -> 1/60. Empty if there is none: 0.0166667, 3.14159265.
std::optional<Rational> to_rational(double value);

/// Period [s] of a rate given in hertz, or of a period given in seconds. InputError C0301 if it is not positive or is
/// no ratio of whole numbers.
Rational period_from_hertz(double hertz, const Located& at);
Rational period_from_seconds(double seconds, const Located& at);

/// whole + part/unit [s], 0 <= part < unit <= 2^53: exact, and the same numbers reduce to the same double.
struct Instant {
  std::int64_t whole = 0, part = 0, unit = 1;
  double seconds() const { return static_cast<double>(whole) + static_cast<double>(part) / static_cast<double>(unit); }
};
/// The instant whose double is t [s], where that is a ratio as to_rational() finds it; empty: t is somewhere between.
std::optional<Instant> to_instant(double t);
/// t [s] as the ticks there have it: of 0.1 * 3, a rounding beyond the tick at 0.3 s, that one. As it is where it is no ratio.
double on_ticks(double t);
/// `duration` [s] after it; empty where that is no ratio, or the sum has too fine a unit.
std::optional<Instant> later(const Instant& instant, double duration);
/// The first k * period after t [s], k = 0, 1, ...
Instant next_tick(const Rational& period, double t);

class Schedule {
 public:
  struct Tick {
    int entry;       // as returned by add()
    std::int64_t k;  // its how-manieth tick, from 0
  };

  /// An entry that ticks at offset + k * period, k = 0, 1, ... Returns its number: 0, 1, ... in the order of the calls.
  int add(Rational period, Rational offset = {});
  /// Whether the ticks of an entry may lie inside of steps; at first they do not.
  void let_inside(int entry, bool inside);
  /// The next tick of each entry becomes its first at or after t [s] (the start of a run that does not begin at zero).
  void start(double t);
  /// Which tick of each entry is the next.
  void remember(Archive& archive);
  /// Whether the next tick of each entry is its first at t [s] or its first later than t.
  bool stands_at(double t) const;
  /// Time of the next instant [s]; infinity if there are no entries.
  double time() const { return time_; }
  /// The same of those at which steps end.
  double stop() const { return stop_; }
  /// The shortest period of the entries at which steps end [s]; infinity if there are none.
  double shortest_period() const;
  /// Whether any tick comes between these.
  bool any_inside() const;
  /// Passes one tick there: those of one instant come in the order of add(). There must be an entry.
  Tick next();

 private:
  struct Entry {
    std::int64_t first, step, unit;  // tick k at (first + k * step) / unit seconds
    std::int64_t k;
    bool inside = false;  // of steps
    Instant instant() const { return instant(k); }
    Instant instant(std::int64_t tick) const;
  };
  static bool before(const Instant& a, const Instant& b);
  std::size_t earliest() const;
  void look_ahead();

  std::vector<Entry> entries_;
  double time_ = std::numeric_limits<double>::infinity(), stop_ = time_;
};

}  // namespace cardan
