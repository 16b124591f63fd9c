#include "core/sim/schedule.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace cardan {
namespace {

const Located kHere{"controllers.attitude.rate", {}};

Rational hertz(double f) { return period_from_hertz(f, kHere); }

/// Passes an instant: who ticks there.
std::vector<int> instant(Schedule& s) {
  std::vector<int> out;
  for (const double t = s.time(); s.time() == t;) out.push_back(s.next().entry);
  return out;
}

TEST(Rationals, AreFoundWhereTheyAreMeant) {
  const auto is = [](double value, std::int64_t p, std::int64_t q) {
    const auto r = to_rational(value);
    return r && r->numerator == p && r->denominator == q;
  };
  EXPECT_TRUE(is(10.0, 10, 1));
  EXPECT_TRUE(is(0.1, 1, 10));
  EXPECT_TRUE(is(1.0 / 60.0, 1, 60));
  EXPECT_TRUE(is(1.0 / 7.0, 1, 7));
  EXPECT_TRUE(is(-2.5, -5, 2));
  EXPECT_TRUE(is(0.0, 0, 1));
  EXPECT_TRUE(is(35 * 0.001, 7, 200));  // a unit conversion leaves round-off
  EXPECT_TRUE(is(29.97, 2997, 100));
  EXPECT_TRUE(is(30000.0 / 1001.0, 30000, 1001));
  EXPECT_FALSE(to_rational(3.14159265358979));
  EXPECT_FALSE(to_rational(0.0166667));
  EXPECT_FALSE(to_rational(1e-9));
  EXPECT_FALSE(to_rational(1e10));
  EXPECT_FALSE(to_rational(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_FALSE(to_rational(std::numeric_limits<double>::infinity()));
}

TEST(Rationals, RefusedRatesSayWhatToDo) {
  const auto refusal = [](double f) {
    try {
      hertz(f);
    } catch (const InputError& e) {
      const Diagnostic& d = e.diagnostics().front();
      return std::string(number_of(d.code)) + " | " + d.at.key_path + " | " + d.expected + " | " + d.got + " | " + d.hint;
    }
    return std::string("accepted");
  };
  EXPECT_EQ(refusal(0.0166667),
            "C0301 | controllers.attitude.rate | a rate that is a ratio of whole numbers up to 1e9 over up to 1e6 | "
            "0.0166667 Hz | give the period instead (1/60 Hz is a period of 60 s), or round it: 0.0167 Hz");
  // What is suggested is taken: rounding 1e10 Hz changes nothing.
  const auto hint = [](double x, bool is_hertz) {
    try {
      is_hertz ? period_from_hertz(x, kHere) : period_from_seconds(x, kHere);
    } catch (const InputError& e) {
      return e.diagnostics().front().hint;
    }
    return std::string("accepted");
  };
  EXPECT_EQ(hint(1e-9, false), "give the rate instead: 1e+09 Hz");
  EXPECT_EQ(hint(1.23456e-5, false), "give the rate instead: 8.1e+04 Hz");
  EXPECT_EQ(hint(0.0001234567, false), "give the rate instead (1/60 Hz is a period of 60 s), or round it: 0.000123 s");
  EXPECT_EQ(hint(2e-7, true), "give the period instead: 5e+06 s");
  for (const double x : {1e-10, 1e10, 1e300, 1e-320})
    for (const bool is_hertz : {false, true}) EXPECT_EQ(hint(x, is_hertz), "ticks are from 1 ns to 1e9 s apart") << x;
  EXPECT_EQ(refusal(-1.0), "C0301 | controllers.attitude.rate | a rate > 0 Hz | -1 Hz | ");
  EXPECT_EQ(refusal(std::numeric_limits<double>::infinity()).substr(0, 5), "C0301");
  EXPECT_THROW(period_from_seconds(0.0, kHere), InputError);
}

/// A year of 10 Hz has 315 360 000 ticks; adding 0.1 s as often is 4e-2 s off.
TEST(Schedule, TenHertzStaysTenHertzAfterAYear) {
  for (const double begin : {31536000.0, 31536000.0 * 100.0}) {
    Schedule s;
    s.add(hertz(10.0));
    s.start(begin);
    for (int i = 0; i < 1000; ++i) {
      const std::int64_t k = static_cast<std::int64_t>(begin) * 10 + i;
      const double t = s.time();
      EXPECT_NEAR(t, begin + i / 10.0, begin * 1.2e-16);  // the nearest double
      if (i % 10 == 0) {
        EXPECT_EQ(t, begin + i / 10);
      }
      EXPECT_EQ(s.next().k, k);
    }
  }
}

/// 3 Hz and 30 Hz meet at every third of a second, 1/60 Hz joins each minute, 1/7 s at whole seconds.
TEST(Schedule, DifferentRatesMeetExactlyAlsoAfterAYear) {
  for (const double begin : {0.0, 31536000.0, 31536000.0 * 30.0}) {
    Schedule s;
    const int three = s.add(hertz(3.0)), thirty = s.add(hertz(30.0));
    const int minute = s.add(hertz(1.0 / 60.0)), seventh = s.add(period_from_seconds(1.0 / 7.0, kHere));
    s.start(begin);
    long count[4] = {}, instants = 0;
    double before = -1.0;
    for (; s.time() < begin + 120.0; ++instants) {
      const double t = s.time();
      ASSERT_GT(t, before);
      before = t;
      const auto now = instant(s);
      const auto in = [&](int e) { return std::find(now.begin(), now.end(), e) != now.end(); };
      EXPECT_TRUE(!in(three) || in(thirty)) << t;
      EXPECT_TRUE(!in(minute) || (in(three) && in(seventh))) << t;
      EXPECT_TRUE(!in(seventh) || in(thirty) == (t == std::floor(t))) << t;
      EXPECT_TRUE(std::is_sorted(now.begin(), now.end()));
      for (int e : now) ++count[e];
    }
    EXPECT_EQ(count[three], 360);
    EXPECT_EQ(count[thirty], 3600);
    EXPECT_EQ(count[minute], 2);
    EXPECT_EQ(count[seventh], 840);
    EXPECT_EQ(instants, 3600 + 840 - 120);
  }
}

/// The same instant, reached by different fractions, is the same double: no step of one unit in the last place between.
TEST(Schedule, EqualInstantsHaveEqualTimes) {
  Schedule a, b;
  a.add(hertz(3.0));
  b.add(hertz(48.0), Rational{-5, 3});
  a.start(31536000.25);
  b.start(31536000.25);
  for (int i = 0; i < 300; ++i) {
    while (b.time() < a.time()) instant(b);
    EXPECT_EQ(b.time(), a.time());
    instant(a);
  }
}

TEST(Schedule, OffsetsShiftAnEntry) {
  Schedule s;
  s.add(hertz(10.0), Rational{1, 40});
  s.add(hertz(10.0));
  EXPECT_EQ(s.time(), 0.0);
  EXPECT_EQ(instant(s), std::vector<int>{1});
  EXPECT_EQ(s.time(), 0.025);
  EXPECT_EQ(instant(s), std::vector<int>{0});
  EXPECT_EQ(s.time(), 0.1);
  EXPECT_EQ(s.next().k, 1);
  EXPECT_THROW(s.add(Rational{1, 999'999'937}, Rational{1, 999'999'929}), std::logic_error) << "no double tells parts of their unit";
}

/// Entries that may lie inside of steps: time() is that of all, stop() and the shortest period those of the others.
TEST(Schedule, TellsWhereStepsEnd) {
  Schedule s;
  const int rows = s.add(hertz(10.0)), control = s.add(hertz(2.0), Rational{1, 4});
  EXPECT_FALSE(s.any_inside());
  s.let_inside(rows, true);
  EXPECT_TRUE(s.any_inside());
  EXPECT_EQ(s.time(), 0.0);
  EXPECT_EQ(s.stop(), 0.25);
  EXPECT_EQ(s.shortest_period(), 0.5);
  for (int i = 0; i < 3; ++i) s.next();
  EXPECT_EQ(s.time(), 0.25);
  EXPECT_EQ(s.next().entry, control);
  EXPECT_EQ(s.stop(), 0.75);
  s.let_inside(control, true);
  EXPECT_EQ(s.stop(), std::numeric_limits<double>::infinity());
}

TEST(Schedule, TellsWhetherAnyTickComesBetweenStops) {
  const auto between = [](Rational period, Rational offset) {
    Schedule s;
    s.add({1, 20}, {3, 40});
    s.let_inside(s.add(period, offset), true);
    return s.any_inside();
  };
  EXPECT_FALSE(between({1, 20}, {3, 40}));
  EXPECT_FALSE(between({1, 10}, {7, 40}));
  EXPECT_TRUE(between({1, 10}, {1, 10})) << "another offset";
  EXPECT_TRUE(between({1, 10}, {1, 40})) << "before the first stop";
  EXPECT_TRUE(between({3, 40}, {3, 40})) << "no whole number of periods";
}

TEST(Schedule, TicksOfOneInstantComeInTheOrderOfRegistration) {
  Schedule s;
  s.add(hertz(1.0));
  s.add(hertz(10.0));
  s.add(hertz(5.0));
  EXPECT_EQ(instant(s), (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(instant(s), (std::vector<int>{1}));
  EXPECT_EQ(instant(s), (std::vector<int>{1, 2}));
}

TEST(Schedule, StartsAtTheFirstTickNotBefore) {
  Schedule s;
  s.add(hertz(10.0));
  s.start(0.3);  // the double next to 3/10 is that tick
  EXPECT_EQ(s.time(), 0.3);
  EXPECT_EQ(s.next().k, 3);
  s.start(0.30000001);
  EXPECT_EQ(s.time(), 0.4);
  s.start(-5.0);
  EXPECT_EQ(s.time(), 0.0);
}

TEST(Schedule, WithoutEntriesNothingEverHappens) {
  Schedule s;
  EXPECT_EQ(s.time(), std::numeric_limits<double>::infinity());
}

/// Sums of durations are those of whole numbers: a million thirds and sevenths, where doubles are off by 1e-5 of a step.
TEST(Instants, AddUpWithoutRounding) {
  Instant sum = *to_instant(0.1);
  for (int k = 0; k < 1'000'000; ++k) sum = *later(sum, k % 2 == 0 ? 1.0 / 3.0 : 1.0 / 7.0);
  EXPECT_EQ(sum.whole, 238095);  // 0.1 + 500000 (1/3 + 1/7) = 238095 + 71/210
  EXPECT_EQ(sum.part * 210, sum.unit * 71);
  EXPECT_EQ(later(*to_instant(1.2), 0.1)->seconds(), 1.3);
  EXPECT_EQ(later(*to_instant(-0.25), 0.5)->seconds(), 0.25);
  const Instant before = *to_instant(-0.25);
  EXPECT_EQ(before.whole, -1);
  EXPECT_EQ(before.part * 4, before.unit * 3);
  EXPECT_FALSE(to_instant(3.14159265358979));
  EXPECT_FALSE(to_instant(0.1 + 0.2)) << "0.3 is another double";
  EXPECT_FALSE(later(*to_instant(1.0), 3.14159265358979));
  EXPECT_FALSE(later({0, 1, (std::int64_t{1} << 53) - 111}, 1e-6)) << "no double tells such parts of a second";
}

TEST(Instants, OfTheNextTickAreThoseOfTheSchedule) {
  for (const double rate : {10.0, 3.0, 29.97, 1.0 / 60.0}) {
    Schedule s;
    s.add(hertz(rate));
    double t = -1.0;
    for (int k = 0; k < 1000; ++k) {
      EXPECT_EQ(next_tick(hertz(rate), t).seconds(), s.time());
      t = s.time();
      s.next();
    }
    EXPECT_EQ(next_tick(hertz(rate), std::nextafter(t, 0.0)).seconds(), t);
  }
}

}  // namespace
}  // namespace cardan
