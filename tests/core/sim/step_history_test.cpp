// What is told of the steps of a run: their number, why they were as long as they were, what was rejected, why the method started anew.
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "core/base/diagnostic.hpp"
#include "core/io/recorder.hpp"
#include "core/sim/simulation.hpp"
#include "tests/support/builders.hpp"

namespace cardan::test {
namespace {

/// Keeps the history of steps.
class KeptSteps final : public Recorder {
 public:
  std::vector<std::pair<std::vector<double>, std::string>> intervals;
  double sum(const std::string& column) const {
    double all = 0.0;
    for (const auto& [numbers, worst] : intervals) all += numbers.at(index(column));
    return all;
  }
  double number(std::size_t row, const std::string& column) const { return intervals.at(row).first.at(index(column)); }

  void begin(const RunHeader&, const std::vector<Channel>&) override {}
  void row(double, std::span<const double>) override {}
  void steps(std::span<const double> numbers, const std::string& worst) override {
    intervals.emplace_back(std::vector<double>(numbers.begin(), numbers.end()), worst);
  }
  void attach(const std::string&, const std::string&) override {}
  void restart_state(double, std::span<const double>) override {}
  void flush() override {}
  void close(std::string_view) override {}

 private:
  static std::size_t index(const std::string& name) {
    const auto columns = StepInterval().columns();
    return static_cast<std::size_t>(std::ranges::find(columns, name, &StepInterval::Column::name) - columns.begin());
  }
};

SimulationOptions of_method(const std::string& method, double relative = 1e-8) {
  SimulationOptions o;
  o.integrator.method = method;
  o.integrator.relative_tolerance = relative;
  if (method == "rk4") o.integrator.fixed_step = 0.01;
  return o;
}

/// A free base with a sprung arm and a wheel on a profile with three corners; commands at 4 Hz, checkpoints each 0.6 s, an event at each
/// passage of the arm that changes a command too, another vehicle at 1.65 s.
struct BusyScene {
  explicit BusyScene(const std::string& method) : sim(compiled(vehicle(2.0)), of_method(method)) {
    const Model& m = sim.model();
    sim.prescribe(m.user[2].v, MotionProfile::rate_table({{0.13, 0.0}, {0.57, 1.1}, {1.01, -0.4}}));
    const int arm = m.user[1].v, q = m.user[1].q, base = m.user[0].v;
    sim.every({1, 4}, [this, arm] { sim.set_force(arm, 0.5 * std::cos(3.0 * sim.time())); });
    sim.add_event({"arm passes", [q](double, const double* x, const double*) { return x[q] - 0.2; }, 0,
                   [this, base] {
                     ++events;
                     sim.set_force(base, sim.force(base) > 0.0 ? -0.2 : 0.2);
                   }});
    sim.every({33, 20}, [this] { sim.adopt(compiled(vehicle(2.5))); }, {33, 20});
    sim.record(kept, {}, {1, 10});
    sim.record_steps({1, 2});
    sim.every({3, 5}, [this] { made.push_back(sim.checkpoint()); }, {3, 5});
  }
  static SystemSpec vehicle(double mass) {
    BodySpec wheel = on(rigid("wheel", 1.5, {0, 0.1, 0}, diagonal({0.2, 0.1, 0.2})), "base", "revolute", {{1, 0, 0}}, {-0.5, 0, 0});
    wheel.hinge.prescribed = {0};
    std::vector<BodySpec> bodies = base_with_sprung_arm();
    bodies[1].mass = mass;
    bodies.push_back(wheel);
    return system(std::move(bodies));
  }
  Simulation sim;
  KeptSteps kept;
  int events = 0;
  std::vector<Checkpoint> made;
};

TEST(StepHistory, TellsWhyAMethodStartedAnew) {
  for (const std::string method : {"rk4", "dopri5", "dop853", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit"}) {
    BusyScene scene(method);
    scene.sim.run(2.0);
    ASSERT_GT(scene.events, 0);
    EXPECT_EQ(scene.kept.sum("restarts_start"), 1) << method;
    EXPECT_EQ(scene.kept.sum("restarts_tick"), 7) << method << ": at 0 s it is the start, at 2 s none follows";
    EXPECT_EQ(scene.kept.sum("restarts_event"), scene.events) << method;
    EXPECT_EQ(scene.kept.sum("restarts_corner"), 3) << method;
    EXPECT_EQ(scene.kept.sum("restarts_loops"), 0) << method;
    EXPECT_EQ(scene.kept.sum("restarts_checkpoint"), 3) << method;
    EXPECT_EQ(scene.kept.sum("restarts_vehicle"), 1) << method;
    const StepInterval& whole = scene.sim.step_history().whole();
    EXPECT_EQ(std::accumulate(whole.restarts.begin(), whole.restarts.end(), 0L), scene.sim.statistics().restarts) << method;
  }
}

/// Intervals follow each other without gap, and their sums are what the method counts itself.
TEST(StepHistory, SumsUpToTheWholeRun) {
  for (const std::string method : {"rk4", "dopri5", "cvode_adams", "ark_explicit"}) {
    BusyScene scene(method);
    scene.sim.run(2.0);
    const IntegratorStatistics all = scene.sim.statistics();
    const KeptSteps& kept = scene.kept;
    ASSERT_EQ(kept.intervals.size(), 5u) << "0.5, 1.0, 1.5, the other vehicle at 1.65, 2.0 s";
    EXPECT_EQ(kept.number(0, "begin"), 0.0);
    EXPECT_EQ(kept.number(4, "end"), 2.0);
    for (std::size_t i = 1; i < kept.intervals.size(); ++i) EXPECT_EQ(kept.number(i, "begin"), kept.number(i - 1, "end"));
    EXPECT_EQ(kept.sum("steps"), all.steps) << method;
    EXPECT_EQ(kept.sum("evaluations"), all.rhs_calls) << method;
    EXPECT_EQ(kept.sum("rejected_mechanical") + kept.sum("rejected_modal") + kept.sum("rejected_devices") +
                  kept.sum("rejected_not_evaluated") + kept.sum("rejected_not_converged"),
              all.rejected.all())
        << method;
    const StepInterval& whole = scene.sim.step_history().whole();
    EXPECT_EQ(whole.steps, all.steps);
    EXPECT_EQ(whole.by_error, kept.sum("by_error"));
    long named = 0;
    for (const auto& [name, n] : scene.sim.step_history().worst()) named += n;
    EXPECT_EQ(named, whole.by_error) << method;
    if (method != "rk4") continue;
    EXPECT_EQ(kept.sum("by_error"), 0);
    EXPECT_LE(whole.longest, 0.01 * (1 + 1e-12));
    EXPECT_NEAR(kept.number(0, "order"), 4.0, 0.0);
  }
}

TEST(StepHistory, GoesOnAfterACheckpoint) {
  for (const std::string method : {"rk4", "dopri5", "exponential", "multirate", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit"}) {
    BusyScene whole(method), rest(method);
    whole.sim.run(2.0);
    rest.sim.resume(whole.made.at(0));  // at 0.6 s, in the second interval
    rest.sim.run(2.0);
    ASSERT_EQ(rest.kept.intervals.size() + 1, whole.kept.intervals.size()) << method;
    for (std::size_t i = 0; i < rest.kept.intervals.size(); ++i)
      EXPECT_EQ(rest.kept.intervals[i], whole.kept.intervals[i + 1]) << method << ", interval " << i;
    EXPECT_EQ(rest.sim.step_history().worst(), whole.sim.step_history().worst()) << method;
  }
}

/// Two pendulums that know nothing of each other, one thirty times as fast.
SystemSpec slow_and_fast(double first, double second) {
  std::vector<BodySpec> bodies;
  for (const auto& [name, rate] : {std::pair{"first", first}, {"second", second}}) {
    BodySpec b = on(rigid(name, 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {{0, 0, 1}});
    SpringDamper spring;
    spring.stiffness = rate * rate;
    b.hinge.springs = {spring};
    b.hinge.q = {0.3};
    bodies.push_back(b);
  }
  return system(std::move(bodies));
}

TEST(StepHistory, NamesTheComponentWhoseErrorSetsTheSteps) {
  for (const std::string method : {"dopri5", "dop853", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit"})
    for (const bool swapped : {false, true}) {
      Simulation sim(compiled(swapped ? slow_and_fast(30.0, 1.0) : slow_and_fast(1.0, 30.0)), of_method(method));
      KeptSteps kept;
      sim.record(kept, {}, {5, 1});
      sim.record_steps({5, 1});
      sim.run(5.0);
      ASSERT_EQ(kept.intervals.size(), 1u);
      EXPECT_TRUE(kept.intervals[0].second.starts_with(swapped ? "first." : "second.")) << method << ": " << kept.intervals[0].second;
      const auto worst = sim.step_history().worst();
      ASSERT_FALSE(worst.empty()) << method;
      EXPECT_TRUE(worst[0].first.starts_with(swapped ? "first." : "second.")) << method << ": " << worst[0].first;
      long of_fast = 0;
      for (const auto& [name, n] : worst) of_fast += name.starts_with(swapped ? "first." : "second.") ? n : 0;
      EXPECT_GT(of_fast, 9 * sim.step_history().whole().by_error / 10) << method;
    }
}

TEST(StepHistory, TellsStepsThatWereCutOrGiven) {
  SimulationOptions options = of_method("dopri5");
  Simulation ticked(compiled(slow_and_fast(1e-3, 1e-3)), options);
  ticked.every({1, 10}, [] {});
  ticked.run(10.0);
  const StepInterval& cut = ticked.step_history().whole();
  EXPECT_GT(cut.by_stop, 99);
  EXPECT_LE(cut.longest, 0.1 * (1 + 1e-12));
  options.integrator.max_step = 0.01;
  Simulation held(compiled(slow_and_fast(1e-3, 1e-3)), options);
  held.run(10.0);
  const StepInterval& given = held.step_history().whole();
  EXPECT_GT(given.steps - given.by_stop - given.by_error, 9 * given.steps / 10);
}

/// One of two bodies falls into the attractor: no tolerance can be kept, and it is the one that is named.
TEST(StepHistory, AnErrorThatCannotBeMetNamesItsComponent) {
  for (const std::string method : {"dopri5", "dop853", "cvode_adams", "ark_explicit"})
    for (const std::string falls : {"left", "right"}) {
      std::vector<BodySpec> bodies;
      for (const std::string name : {"left", "right"}) {
        BodySpec b = on(particle(name, 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}}, {0, name == falls ? 0.0 : 1e6, 0});
        b.hinge.q = {1.0};
        bodies.push_back(b);
      }
      Simulation sim(compiled(system(std::move(bodies), central_gravity(1.0, false))), of_method(method));
      KeptSteps kept;
      sim.record(kept, {}, {1, 1});
      try {
        sim.run(10.0);
        FAIL() << method;
      } catch (const NumericsError& e) {
        EXPECT_EQ(e.failure().code, Code::step_too_small) << method << ": " << e.what();
        EXPECT_EQ(e.failure().body, falls) << method << ": " << e.what();
        EXPECT_NE(e.failure().what.find("most of it that of "), std::string::npos) << e.what();
      }
      ASSERT_FALSE(kept.intervals.empty());
      EXPECT_GT(kept.sum("rejected_mechanical"), 0) << method;
      EXPECT_EQ(kept.intervals.back().second.substr(0, falls.size() + 1), falls + ".") << method;
    }
}

}  // namespace
}  // namespace cardan::test
