#include "core/io/compare_runs.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cmath>
#include <csignal>
#include <limits>
#include <random>

#include "core/base/child_process.hpp"
#include "core/base/diagnostic.hpp"
#include "core/io/hdf5_file.hpp"
#include "tests/support/scratch.hpp"
#include "tests/support/worse.hpp"

namespace cardan {
namespace {

using test::kNaN;
using Numbers = std::vector<double>;

Difference worst(const Numbers& is, const Numbers& reference, Tolerance tolerance, Agreement agreement = Agreement::integration) {
  Numbers times;
  for (std::size_t i = 0; i < is.size(); ++i) times.push_back(static_cast<double>(i));
  return worst_difference(times, is, reference, 2.0, tolerance, agreement);
}

TEST(WorstDifference, IsFoundWithItsTimeAndItsLimit) {
  const Difference d = worst({1.0, 2.5, 3.0}, {1.0, 2.0, 2.75}, {0.1, 0.05});
  EXPECT_EQ(d.difference, 0.5);
  EXPECT_EQ(d.t, 1.0);
  EXPECT_DOUBLE_EQ(d.limit, 0.2);  // 0.1 + 0.05 * 2
  EXPECT_FALSE(d.pass);
  EXPECT_TRUE(worst({1.0, 2.5, 3.0}, {1.0, 2.0, 2.75}, {0.5, 0.0}).pass) << "a difference as large as the limit";
}

TEST(WorstDifference, NaNEqualsNoNumber) {
  for (const Agreement a : {Agreement::same_bits, Agreement::round_off, Agreement::integration}) {
    const Difference d = worst({1.0, kNaN, 9.0}, {1.0, 1.0, 1.0}, {1e9, 1.0}, a);
    EXPECT_FALSE(d.pass);
    EXPECT_TRUE(std::isnan(d.difference)) << "nothing is worse";
    EXPECT_EQ(d.t, 1.0);
    for (const double x : {HUGE_VAL, -HUGE_VAL, kNaN})
      for (const double y : {HUGE_VAL, -HUGE_VAL, kNaN, 1.0}) {
        const bool same = x == y || (std::isnan(x) && std::isnan(y));
        EXPECT_EQ(worst({x}, {y}, {HUGE_VAL, 1.0}, a).pass, same) << x << " and " << y;
        EXPECT_EQ(worst({x}, {y}, {}, a).difference == 0.0, same) << x << " and " << y;
      }
    EXPECT_TRUE(worst({1.0, kNaN}, {1.0, -kNaN}, {}, a).pass) << "all NaN are alike";
    EXPECT_FALSE(std::signbit(worst({-kNaN}, {1.0}, {}, a).is)) << "and are told without a sign";
  }
}

TEST(WorstDifference, OfTheSameBitsTellsZeroFromMinusZero) {
  EXPECT_FALSE(worst({-0.0}, {0.0}, {}, Agreement::same_bits).pass);
  EXPECT_TRUE(worst({-0.0}, {0.0}, {}, Agreement::round_off).pass);
  EXPECT_FALSE(worst({std::nextafter(1.0, 2.0)}, {1.0}, {1.0, 1.0}, Agreement::same_bits).pass);
}

TEST(WorstDifference, OfNothingIsNoAgreement) {
  for (const Agreement a : {Agreement::same_bits, Agreement::truth}) {
    const Difference d = worst({}, {}, {1.0, 1.0}, a);
    EXPECT_FALSE(d.pass);
    EXPECT_EQ(d.share(), HUGE_VAL);
  }
}

TEST(CommonRows, AreThoseOfTheSameInstant) {
  const CommonRows rows = common_rows(Numbers{0.0, 0.1, 0.2, 0.3}, Numbers{0.1 + 1e-12, 0.25, 0.3, 0.4});
  EXPECT_EQ(rows.first, (std::vector<std::size_t>{1, 3}));
  EXPECT_EQ(rows.second, (std::vector<std::size_t>{0, 2}));
}

// Of 2000 right samples about 2000 (1 - confidence) = 20 fail: by more than 45 with a probability below 1e-6 (Poisson). A mean that is off
// by 10 and a deviation by 7 of their own standard errors fail nearly always.
TEST(Statistics, FailARightProgramAsOftenAsStated) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal(0.3, 2.0);
  int right = 0, other_mean = 0, other_deviation = 0;
  const auto fails = [](const Numbers& x, double mean, double deviation) {
    const Statistics s = compare_statistics(x, mean, deviation, static_cast<double>(x.size()), 0.99);
    return !s.mean.pass || !s.deviation->pass;
  };
  for (int i = 0; i < 2000; ++i) {
    Numbers x(400);
    for (double& one : x) one = normal(random);
    right += fails(x, 0.3, 2.0);
    other_mean += fails(x, 1.3, 2.0);
    other_deviation += fails(x, 0.3, 2.5);
  }
  EXPECT_GT(right, 4);
  EXPECT_LT(right, 45);
  EXPECT_GT(other_mean, 1990);
  EXPECT_GT(other_deviation, 1990);
}

// The normal distribution leaves 0.25 % above 2.807 and 0.5 % above 2.576: both tests of a sample share 1 %, the mean alone has it.
TEST(Statistics, BothTestsShareWhatMayFail) {
  const Numbers x = {-1.0, 1.0, -1.0, 1.0};
  EXPECT_NEAR(compare_statistics(x, 0.0, 3.0, 25.0, 0.99).mean.limit, 2.807033768343811 * 3.0 / 5.0, 1e-9);
  EXPECT_NEAR(compare_statistics(x, 0.0, {}, 25.0, 0.99).mean.limit, 2.575829303548901 * std::sqrt(4.0 / 3.0) / 5.0, 1e-9);
}

RunColumns run_of(const Numbers& times, const Numbers& values) {
  return {"", times, {{"a/b", {"x"}, {"m"}, values}}, "", "passed", "", ""};
}

TEST(Runs, AreComparedAtTheTimesThatBothHave) {
  const RunDifference d = compare_runs(run_of({0, 1, 2}, {5, 6, 7}), run_of({0, 2, 4}, {5, 8, 9}), {0.5, 0.0}, Agreement::integration);
  EXPECT_EQ(d.rows, 2u);
  EXPECT_FALSE(d.same_times());
  ASSERT_EQ(d.components.size(), 1u);
  EXPECT_EQ(d.components[0].worst.difference, 1.0);
  EXPECT_EQ(d.components[0].worst.t, 2.0);
}

// Within tolerances an instant is the same where the conversion of a decimal time leaves it; bits of times are numbers like all others.
TEST(Runs, WhoseTimesHaveOtherBitsAreNotTheSameBits) {
  const double t = std::nextafter(1.0, 2.0);
  const RunDifference d = compare_runs(run_of({0, 1, 2}, {5, 6, 7}), run_of({0, t, 2}, {5, 6, 7}), {}, Agreement::same_bits);
  EXPECT_EQ(d.rows, 2u);
  EXPECT_FALSE(d.pass(false));
  EXPECT_TRUE(compare_runs(run_of({0, 1}, {5, 6}), run_of({0, t}, {5, 6}), {}, Agreement::integration).pass(false));
}

// Residuals are noise, and have the size of what is in balance: two runs that agree to 1e-11 agree in them too.
TEST(Runs, ResidualsAreRelativeNumbersAsTheyAre) {
  for (const char* path : {"ledger/energy", "loops/residual", "a/b"}) {
    RunColumns first = run_of({0, 1}, {1e-12, 1e-13}), second = run_of({0, 1}, {3e-13, 2e-12});
    first.columns[0].path = second.columns[0].path = path;
    first.columns[0].units = second.columns[0].units = {"1"};
    EXPECT_EQ(compare_runs(first, second, {0.0, 1e-11}, Agreement::integration).pass(false), std::string_view(path) != "a/b");
    EXPECT_FALSE(compare_runs(first, second, {0.0, 1e-12}, Agreement::integration).pass(false));
    EXPECT_FALSE(compare_runs(first, second, {}, Agreement::same_bits).pass(false));
  }
}

TEST(Runs, WithoutATimeInCommonNeverPass) {
  EXPECT_FALSE(compare_runs(run_of({0, 1}, {5, 6}), run_of({0.5, 1.5}, {5, 6}), {1.0, 1.0}, Agreement::integration).pass(true));
}

TEST(Runs, WithoutAnythingToCompareNeverPass) {
  RunColumns none = run_of({0, 1}, {5, 6}), empty = none;
  none.columns.clear();
  empty.columns.push_back({"a/c", {}, {}, {}});
  EXPECT_FALSE(compare_runs(none, none, {}, Agreement::same_bits).pass(true));
  const RunDifference d = compare_runs(empty, empty, {}, Agreement::same_bits);
  EXPECT_EQ(d.misfits, std::vector<std::string>{"a/c: no components"});
  EXPECT_FALSE(d.pass(true));
}

TEST(Runs, OfOtherChannelsComponentsOrUnitsDiffer) {
  const RunColumns a = run_of({0, 1}, {5, 6});
  RunColumns other_name = a, other_unit = a;
  other_name.columns[0].path = "a/c";
  other_unit.columns[0].units = {"km"};
  const RunDifference names = compare_runs(a, other_name, {}, Agreement::same_bits);
  EXPECT_EQ(names.only_in_first, std::vector<std::string>{"a/b"});
  EXPECT_EQ(names.only_in_second, std::vector<std::string>{"a/c"});
  EXPECT_FALSE(names.pass(true));
  const RunDifference units = compare_runs(a, other_unit, {}, Agreement::same_bits);
  EXPECT_EQ(units.misfits, std::vector<std::string>{"a/b: unit m against km"});
  EXPECT_FALSE(units.pass(true));
  EXPECT_TRUE(compare_runs(a, a, {}, Agreement::same_bits).pass(false));
}

TEST(UnitOfAChannel, ComesBackForEachComponent) {
  using Units = std::vector<std::string>;
  for (const auto& [units, text] :
       {std::pair{Units{"m"}, "m"}, std::pair{Units{"N m"}, "N m"}, std::pair{Units{"m", "m", "m"}, "m"},
        std::pair{Units{"N m", "N m", "N m"}, "N m"}, std::pair{Units{"N m", "N m"}, "N*m N*m"},
        std::pair{Units{"N m s", "N m s", "N m s"}, "N*m*s N*m*s N*m*s"}, std::pair{Units{"kg m^2/s", "kg m^2/s"}, "kg*m^2/s kg*m^2/s"},
        std::pair{Units{"N m", "N", "N"}, "N*m N N"}}) {
    EXPECT_EQ(unit_of_channel(units), text);
    EXPECT_EQ(units_of_components(text, units.size()), units);
  }
  EXPECT_EQ(units_of_components("Nm Nm N", 3), (Units{"N m", "N m", "N"})) << "of results of before";
  EXPECT_EQ(units_of_components("N m", 2), (Units{"N m", "N m"})) << "and of these";
}

TEST(PackedColumns, ComeBackBitByBitInFewerBytes) {
  Numbers times(2000), values(6000);
  for (std::size_t i = 0; i < times.size(); ++i)
    times[i] = 0.1 * static_cast<double>(i), values[3 * i] = std::sin(times[i]), values[3 * i + 1] = -0.0;
  const RunColumns run{"", times, {{"bodies/bus/x", {"x", "y", "q"}, {"m", "m", "1"}, values}}, "", "", "", ""};
  const std::string path = test::scratch("packed.h5");
  write_packed_columns(path, run, {{"sweeps", "v3"}});
  const RunColumns back = read_run_columns(path);
  EXPECT_EQ(back.times, times);
  EXPECT_EQ(back.sweeps, "v3");
  ASSERT_EQ(back.columns.size(), 1u);
  EXPECT_EQ(back.columns[0].units, run.columns[0].units);
  EXPECT_TRUE(compare_runs(back, run, {}, Agreement::same_bits).pass(false));
  EXPECT_LT(std::filesystem::file_size(path), 64'000 * 3 / 4u);
}

// A limit on the size of files stands for the full disk. Wherever in the file it strikes, what was there is there still.
TEST(PackedColumns, ThatADiskDoesNotTakeLeaveWhatWasThere) {
  const std::filesystem::path folder = test::scratch("full"), path = folder / "reference.h5";
  std::filesystem::create_directory(folder);
  Numbers times(500), values(500);
  for (std::size_t i = 0; i < times.size(); ++i) times[i] = static_cast<double>(i), values[i] = std::sin(times[i]);
  write_packed_columns(path, run_of(times, values), {});
  const auto size = std::filesystem::file_size(path);
  write_packed_columns(path, run_of({0, 1}, {5, 6}), {});
  for (rlim_t limit = 0; limit < size; limit += 97) {
    const ChildEnd end = run_in_child(
        [&](const Say& say) {
          std::signal(SIGXFSZ, SIG_IGN);
          const rlimit bytes{limit, limit};
          setrlimit(RLIMIT_FSIZE, &bytes);
          try {
            write_packed_columns(path, run_of(times, values), {});
          } catch (const InputError& e) {
            say(number_of(e.diagnostics()[0].code));
          }
        },
        {});
    EXPECT_EQ(end.said, "C0701") << limit << " of " << size;
    EXPECT_EQ(read_run_columns(path).times, (Numbers{0, 1})) << limit;
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 1) << "nothing is left beside it";
  }
}

TEST(PackedColumns, AreNotPutInPlaceOfAFolder) {
  const std::filesystem::path folder = test::scratch("taken"), path = folder / "reference.h5";
  std::filesystem::create_directories(path / "kept");
  EXPECT_THROW(write_packed_columns(path, run_of({0, 1}, {5, 6}), {}), InputError);
  EXPECT_TRUE(std::filesystem::exists(path / "kept"));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 1);
}

TEST(Columns, OfAFileThatIsCutShortAreRefused) {
  const std::string path = test::scratch("cut.h5");
  write_packed_columns(path, run_of({0, 1, 2}, {5, 6, 7}), {});
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
  EXPECT_THROW(read_run_columns(path), InputError);
}

TEST(Columns, OfAnotherLengthThanTheTimesAreRefused) {
  const std::string path = test::scratch("length.h5");
  write_packed_columns(path, run_of({0, 1, 2}, {5, 6, 7}), {});
  {
    Hdf5File file = Hdf5File::update(path);
    file.write("/time", Numbers{0, 1});
    file.close();
  }
  try {
    read_run_columns(path);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics()[0].at.key_path, "/channels/a/b");
    EXPECT_EQ(e.diagnostics()[0].got, "3");
  }
}

}  // namespace
}  // namespace cardan
