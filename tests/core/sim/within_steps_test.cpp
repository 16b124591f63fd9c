// Rows of outputs and readings of sensors inside of steps (SimulationOptions::between_steps): what they show is the motion, nothing of it
// depends on them, and what acts still ends steps.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/base/diagnostic.hpp"
#include "core/io/recorder.hpp"
#include "core/sim/outputs.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/support/builders.hpp"
#include "tests/support/four_bar.hpp"
#include "tests/support/modal_samples.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace within_steps {
namespace {

/// Keeps rows, and what happened among them: "t event text".
class Kept final : public Recorder {
 public:
  std::vector<double> times;
  std::vector<std::vector<double>> rows;
  std::vector<std::pair<double, std::string>> events;
  std::vector<std::vector<double>> intervals;

  void begin(const RunHeader&, const std::vector<Channel>&) override {}
  void row(double t, std::span<const double> values) override {
    times.push_back(t), rows.emplace_back(values.begin(), values.end());
    order.push_back(t);
  }
  void note(Note what, double t, const std::vector<std::string>& texts) override {
    if (what != Note::event) return;
    events.emplace_back(t, texts.front());
    order.push_back(t);
  }
  void steps(std::span<const double> numbers, const std::string&) override { intervals.emplace_back(numbers.begin(), numbers.end()); }
  void attach(const std::string&, const std::string&) override {}
  void restart_state(double, std::span<const double>) override {}
  void flush() override {}
  void close(std::string_view) override {}

  std::vector<double> order;  // times of rows and events, as they came
};

SimulationOptions options_of(const std::string& method, double relative, bool between_steps) {
  SimulationOptions o;
  o.integrator.method = method.substr(0, method.find(' '));
  if (method.ends_with("krylov")) o.integrator.linear_solver = "krylov";
  if (method.ends_with(" diagonalised")) o.dynamics = Dynamics::diagonalised;
  o.integrator.relative_tolerance = relative;
  if (method == "rk4" || method.starts_with("variational")) o.integrator.fixed_step = 0.02;
  o.between_steps = between_steps;
  return o;
}

/// A free base with a sprung arm and a flexible boom.
SystemSpec spacecraft() {
  BodySpec boom = on(BodySpec(), "base", "revolute", {{0, 1, 0}}, {0, 0.4, 0});
  boom.name = "boom", boom.type = "modal_flexible", boom.level = 0;
  boom.modal = std::make_shared<const ModalData>(lumped());
  std::vector<BodySpec> bodies = base_with_sprung_arm();
  bodies[0].hinge.v[3] = 0.05;
  bodies.push_back(boom);
  return system(std::move(bodies));
}

const std::vector<std::string> kMethods = {
    "rk4",          "dopri5",      "dop853",           "exponential",         "multirate",
    "cvode_adams",  "cvode_bdf",   "cvode_bdf krylov", "ark_explicit",        "ark_imex",
    "ark_implicit", "variational", "variational4",     "dopri5 diagonalised", "cvode_bdf diagonalised"};

/// All channels there are, 100 rows a second.
struct Recorded {
  Recorded(const SystemSpec& spec, const SimulationOptions& options, Rational period = {1, 100}) : sim(compiled(spec), options) {
    OutputOptions all;
    for (std::size_t i = 0; i < sim.model().user.size(); ++i) all.reactions.push_back(static_cast<int>(i));
    for (std::size_t i = 0; i < sim.model().nodes.size(); ++i) all.nodes.push_back(static_cast<int>(i));
    std::vector<Output> outputs = standard_outputs(sim, all);
    std::erase_if(outputs, [](const Output& o) { return o.channel.path.starts_with("ledger/"); });
    for (const Output& o : outputs)
      for (std::size_t i = 0; i < o.channel.components.size(); ++i) names.push_back(o.channel.path);
    outputs.push_back({{"energy balance", {"x"}, "1", "", ""}, [this](double* x) { *x = sim.ledger().energy_relative; }});
    names.emplace_back("energy balance");
    sim.record(kept, std::move(outputs), period);
  }
  Simulation sim;
  Kept kept;
  std::vector<std::string> names;
};

/// The largest difference of rows at the same times, over 1 and the largest number of the column.
double apart(const Recorded& a, const Recorded& b) {
  EXPECT_EQ(a.kept.times, b.kept.times);
  double most = 0.0;
  for (std::size_t c = 0; c < a.names.size() && a.kept.times == b.kept.times; ++c) {
    double size = 1.0;
    for (const auto& row : b.kept.rows) size = std::max(size, std::abs(row[c]));
    for (std::size_t i = 0; i < a.kept.rows.size(); ++i) most = worse(most, std::abs(a.kept.rows[i][c] - b.kept.rows[i][c]) / size);
  }
  return most;
}

/// What rows may be off by: each step by its tolerance in the root mean square, that of the row by eight times as much (docs/mathematics/
/// integration.md, "Rows inside of steps"). Equal steps, cut in halves where they end at rows: by as much as the order makes of that.
double allowed(const Recorded& run, const std::string& method, double tolerance, double off_in_halves) {
  const std::map<std::string, int> order = {{"rk4", 4}, {"variational", 2}, {"variational4", 4}};
  if (const auto equal = order.find(method); equal != order.end()) return 2.0 * std::exp2(equal->second) * off_in_halves;
  const double states = run.sim.model().nq + run.sim.model().nv;
  return (static_cast<double>(run.sim.statistics().steps) + 8.0) * tolerance * std::sqrt(states);
}

TEST(BetweenSteps, RowsOfEachMethodLieOnTheMotion) {
  Recorded reference(spacecraft(), options_of("dop853", 1e-13, false));
  reference.sim.run(2.0);
  for (const std::string& method : kMethods) {
    const double tolerance = 1e-8;
    Recorded inside(spacecraft(), options_of(method, tolerance, true)), ends(spacecraft(), options_of(method, tolerance, false));
    inside.sim.run(2.0), ends.sim.run(2.0);
    ASSERT_EQ(inside.kept.times.size(), 201u) << method;
    EXPECT_LT(apart(inside, reference), allowed(inside, method, tolerance, apart(ends, reference))) << method;
    if (method != "exponential" && method != "multirate") {  // they follow the modes
      EXPECT_LT(inside.sim.statistics().steps, ends.sim.statistics().steps) << method;
    }
  }
}

/// Steps of h each: no polynomial loses what its method has. (Of ark_implicit Newton's iteration leaves a share of the tolerance.)
TEST(BetweenSteps, RowsAreOfTheOrderOfTheMethod) {
  Recorded reference(system(base_with_sprung_arm()), options_of("dop853", 1e-13, false), {1, 50});
  reference.sim.run(4.0);
  const auto off = [&](const std::string& method, double h) {
    SimulationOptions o = options_of(method, 0.5, true);
    if (o.integrator.fixed_step > 0.0)
      o.integrator.fixed_step = h;
    else
      o.integrator.initial_step = o.integrator.max_step = h;
    Recorded run(system(base_with_sprung_arm()), o, {1, 50});
    run.sim.run(4.0);
    EXPECT_LT(run.sim.statistics().steps, 150) << method;
    return apart(run, reference);
  };
  for (const auto& [method, order, h] : {std::tuple{"rk4", 4, 0.1},
                                         {"dopri5", 5, 0.2},
                                         {"dop853", 8, 0.2},
                                         {"ark_explicit", 6, 0.2},
                                         {"ark_imex", 5, 0.2},
                                         {"exponential", 3, 0.1},
                                         {"multirate", 4, 0.2},
                                         {"variational", 2, 0.1},
                                         {"variational4", 4, 0.2}}) {
    const double whole = off(method, h), half = off(method, 0.5 * h), found = std::log2(whole / half);
    EXPECT_GT(found, order - 0.5) << method << ": " << whole << ", " << half;
  }
}

/// The end has the same bits however often somebody looked on the way.
TEST(BetweenSteps, NothingOfTheMotionHangsOnWhoLooks) {
  for (const std::string& method : kMethods) {
    Recorded looked(spacecraft(), options_of(method, 1e-7, true), {1, 130});
    Simulation alone(compiled(spacecraft()), options_of(method, 1e-7, true));
    alone.watch({2, 1}, [] {});
    looked.sim.run(2.0), alone.run(2.0);
    EXPECT_EQ(looked.sim.state().q, alone.state().q) << method;
    EXPECT_EQ(looked.sim.state().v, alone.state().v) << method;
    EXPECT_EQ(looked.sim.statistics().steps, alone.statistics().steps) << method;
  }
}

/// Commands at 4 Hz and an event that turns a force over end steps; the rows around them are those of steps that end at rows.
struct Busy : Recorded {
  Busy(const std::string& method, bool between_steps) : Recorded(vehicle(), options_of(method, 1e-8, between_steps)) {
    const Model& m = sim.model();
    sim.prescribe(m.user[2].v, MotionProfile::rate_table({{0.13, 0.0}, {0.57, 1.1}, {1.01, -0.4}}));
    const int arm = m.user[1].v, q = m.user[1].q, base = m.user[0].v;
    sim.every({1, 4}, [this, arm] { sim.set_force(arm, 0.5 * std::cos(3.0 * sim.time())); });
    sim.add_event({"arm passes", [q](double, const double* x, const double*) { return x[q] - 0.2; }, 0,
                   [this, base] { sim.set_force(base, sim.force(base) > 0.0 ? -0.2 : 0.2); }});
    sim.record_steps({1, 2});
    sim.every({3, 5}, [this] { made.push_back(sim.checkpoint()); }, {3, 5});
  }
  static SystemSpec vehicle() {
    BodySpec wheel = on(rigid("wheel", 1.5, {0, 0.1, 0}, diagonal({0.2, 0.1, 0.2})), "base", "revolute", {{1, 0, 0}}, {-0.5, 0, 0});
    wheel.hinge.prescribed = {0};
    std::vector<BodySpec> bodies = base_with_sprung_arm();
    bodies.push_back(wheel);
    return system(std::move(bodies));
  }
  std::vector<Checkpoint> made;
};

TEST(BetweenSteps, CommandsEventsAndCornersEndStepsAndRowsAreAmongThem) {
  for (const std::string method :
       {"rk4", "dopri5", "dop853", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_implicit", "ark_imex", "exponential", "multirate"}) {
    Busy inside(method, true), ends("dop853", false);
    inside.sim.run(2.0), ends.sim.run(2.0);
    ASSERT_GT(inside.kept.events.size(), 0u);
    ASSERT_EQ(inside.kept.events.size(), ends.kept.events.size()) << method;
    EXPECT_TRUE(std::ranges::is_sorted(inside.kept.order)) << method;
    Busy same(method, false);
    same.sim.run(2.0);
    EXPECT_LT(apart(inside, ends), allowed(inside, method, 1e-8, apart(same, ends))) << method;
    ASSERT_EQ(inside.kept.intervals.size(), 4u) << method;
    const auto column = [&](std::size_t row, const char* name) {
      const auto columns = StepInterval().columns();
      return inside.kept
          .intervals[row][static_cast<std::size_t>(std::ranges::find(columns, name, &StepInterval::Column::name) - columns.begin())];
    };
    double steps = 0.0;
    for (std::size_t i = 0; i < 4; ++i) {
      steps += column(i, "steps");
      if (i > 0) {
        EXPECT_EQ(column(i, "begin"), column(i - 1, "end")) << method;
      }
    }
    EXPECT_EQ(steps, inside.sim.statistics().steps) << method;
  }
}

TEST(BetweenSteps, ARunThatGoesOnFromACheckpointHasTheSameRows) {
  for (const std::string method :
       {"rk4", "dopri5", "dop853", "exponential", "multirate", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit"}) {
    Busy whole(method, true), rest(method, true);
    whole.sim.run(2.0);
    rest.sim.resume(whole.made.at(1));  // at 1.2 s
    rest.sim.run(2.0);
    ASSERT_EQ(rest.kept.rows.size(), 80u) << method;
    EXPECT_TRUE(std::equal(rest.kept.rows.begin(), rest.kept.rows.end(), whole.kept.rows.end() - 80)) << method;
    EXPECT_TRUE(std::equal(rest.kept.times.begin(), rest.kept.times.end(), whole.kept.times.end() - 80)) << method;
  }
}

/// The function of an event is no number from 1.005 s on, in a step that began long before: the rows of the steps that were made are there.
TEST(BetweenSteps, RowsBeforeAFailureAreThereAndNoneAfterIt) {
  SimulationOptions options = options_of("dopri5", 1e-6, true);
  options.integrator.max_step = 0.25;
  Recorded run(system(base_with_sprung_arm()), options);
  run.sim.add_event({"broken", [](double t, const double*, const double*) { return t > 1.005 ? std::nan("") : 1.0; }, 0, {}});
  EXPECT_THROW(run.sim.run(2.0), NumericsError);
  const double reached = run.sim.time();
  EXPECT_GT(reached, 0.75);
  EXPECT_LE(reached, 1.005);
  ASSERT_FALSE(run.kept.times.empty());
  EXPECT_LE(run.kept.times.back(), reached);
  EXPECT_GT(run.kept.times.back(), reached - 0.01 - 1e-9);
  EXPECT_EQ(static_cast<double>(run.kept.times.size()), std::floor(run.kept.times.back() * 100.0 + 0.5) + 1.0);
}

/// An event that stops the run: the rows before it, that at its instant, and none after it.
TEST(BetweenSteps, RowsEndWithAStop) {
  Recorded run(system(base_with_sprung_arm()), options_of("dop853", 1e-9, true));
  run.sim.add_event({"time", [](double t, const double*, const double*) { return t - 1.2345; }, 0, [&] { run.sim.stop(); }});
  run.sim.run(2.0);
  ASSERT_EQ(run.kept.times.size(), 125u);
  EXPECT_EQ(run.kept.times[123], 1.23);
  EXPECT_NEAR(run.kept.times[124], 1.2345, 1e-12);
}

/// An angle that grows by 0.7 rad/s, read at 8 Hz from 1/32 s on: rows hold the last reading, and a controller at 1 Hz has that of its
/// instant.
TEST(BetweenSteps, SensorsThatOnlyReadAreSampledInsideOfSteps) {
  SystemSpec spec = system({on(rigid("wheel", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {{0, 0, 1}})});
  spec.bodies[0].hinge.v = {0.7};
  spec.devices = {device("encoder", "encoder", {}, {{"at", "wheel"}})};
  spec.devices[0].rate = 8.0, spec.devices[0].offset = 1.0 / 32.0;
  for (const bool controlled : {false, true}) {
    Simulation sim(compiled(spec), options_of("dopri5", 1e-9, true));
    EXPECT_EQ(sim.shortest_period(), std::numeric_limits<double>::infinity());
    Kept kept;
    std::vector<double> seen;
    if (controlled) sim.every({1, 1}, [&] { seen.push_back(sim.device_output(0)); }, {1, 32});
    sim.record(kept, {{{"reading", {"x"}, "rad", "", ""}, [&](double* x) { *x = sim.device_output(0); }}}, {1, 64});
    sim.run(4.0);
    ASSERT_EQ(kept.rows.size(), 257u);
    for (std::size_t i = 2; i < kept.rows.size(); ++i) {
      const double t = static_cast<double>(i) / 64.0, read = 1.0 / 32.0 + std::floor((t - 1.0 / 32.0) * 8.0) / 8.0;
      EXPECT_NEAR(kept.rows[i][0], 0.7 * read, 1e-12) << t;
    }
    for (std::size_t i = 0; i < seen.size(); ++i) EXPECT_NEAR(seen[i], 0.7 * (1.0 / 32.0 + static_cast<double>(i)), 1e-12);
    EXPECT_EQ(seen.size(), controlled ? 4u : 0u);
    EXPECT_LT(sim.statistics().steps, 25);
  }
}

/// The same noise, tick by tick, as where each tick ends a step.
TEST(BetweenSteps, ReadingsAreThoseOfTicksThatEndSteps) {
  SystemSpec spec = system(base_with_sprung_arm());
  spec.bodies[0].nodes.push_back({});
  spec.bodies[0].nodes.back().name = "head", spec.bodies[0].nodes.back().position = {0.3, 0.2, -0.1};
  spec.devices = {device("imu", "imu", {{"angle_random_walk", 1e-3}, {"velocity_random_walk", 1e-3}}, {{"at", "base.head"}})};
  spec.devices[0].rate = 40.0;
  Recorded inside(spec, options_of("dopri5", 1e-9, true), {1, 100}), ends(spec, options_of("dop853", 1e-12, false), {1, 100});
  inside.sim.run(2.0), ends.sim.run(2.0);
  EXPECT_LT(apart(inside, ends), allowed(inside, "dopri5", 1e-9, 0.0));
  EXPECT_LT(inside.sim.statistics().steps, 60);
}

/// Ticks of what pushes, or has a state, end steps; those of what reads alone do not.
TEST(BetweenSteps, DevicesThatActEndSteps) {
  const auto shortest = [](const DeviceSpec& d) {
    SystemSpec spec = system(base_with_sprung_arm());
    spec.devices = {d};
    spec.devices[0].rate = 8.0;
    Simulation sim(compiled(spec), options_of("dopri5", 1e-8, true));
    sim.run(0.0);
    return sim.shortest_period();
  };
  EXPECT_EQ(shortest(device("gyro", "imu", {}, {{"at", "base"}})), std::numeric_limits<double>::infinity());
  EXPECT_EQ(shortest(device("encoder", "encoder", {}, {{"at", "arm"}})), std::numeric_limits<double>::infinity());
  EXPECT_EQ(shortest(device("gyro", "integrating_imu", {}, {{"at", "base"}})), 0.125);
  EXPECT_EQ(shortest(device("jet", "pulsed_thruster", {{"bit", 0.2}}, {{"at", "base"}})), 0.125);
}

/// The arm weighs another amount from 1.65 s on, in the middle between two rows: rows go on in time, and are those of steps that they end.
TEST(BetweenSteps, RowsGoOnWithAnotherVehicle) {
  const auto run = [](const std::string& method, double tolerance, bool between_steps) {
    auto r = std::make_unique<Recorded>(system(base_with_sprung_arm()), options_of(method, tolerance, between_steps), Rational{1, 20});
    Simulation& sim = r->sim;
    sim.every({33, 20},
              [&sim] {
                std::vector<BodySpec> heavier = base_with_sprung_arm();
                heavier[1].mass = 2.5;
                sim.adopt(compiled(system(heavier)));
              },
              {67, 40});
    sim.run(3.0);
    return r;
  };
  const auto ends = run("dop853", 1e-12, false);
  for (const std::string method : {"dopri5", "dop853", "cvode_adams", "ark_explicit"}) {
    const auto inside = run(method, 1e-8, true);
    EXPECT_EQ(inside->kept.times.size(), 61u) << method;
    EXPECT_TRUE(std::ranges::is_sorted(inside->kept.order)) << method;
    double off = 0.0;
    for (std::size_t i = 0; i < inside->kept.rows.size(); ++i)
      for (std::size_t c = 0; c + 1 < inside->names.size(); ++c)  // the ledger knows of two vehicles
        off = worse(off, std::abs(inside->kept.rows[i][c] - ends->kept.rows[i][c]));
    EXPECT_LT(off, allowed(*inside, method, 1e-8, 0.0)) << method;
  }
}

TEST(BetweenSteps, LoopsAreClosedInside) {
  for (const std::string method : {"dopri5", "dop853", "cvode_bdf", "ark_explicit", "rk4", "ida"}) {
    SystemSpec spec = four_bar();
    if (method == "ida") spec.loop_form = LoopForm::dae;
    Recorded inside(spec, options_of(method, 1e-8, true)), ends(four_bar(), options_of("dop853", 1e-12, false));
    inside.sim.run(1.0), ends.sim.run(1.0);
    if (method != "rk4") {  // equal steps this long are off by their h^4
      EXPECT_LT(apart(inside, ends), allowed(inside, method, 1e-8, 0.0)) << method;
    }
    const auto column = static_cast<std::size_t>(std::ranges::find(inside.names, "loops/residual") - inside.names.begin());
    double residual = 0.0;
    for (const auto& row : inside.kept.rows) residual = worse(residual, row[column]);
    EXPECT_LT(residual, 1e-14) << method;
  }
}

/// A mass falls on a hard stop and goes up again with half its speed: in each row the parabola before or after, and -g.
TEST(BetweenSteps, RowsBesideAHardStopAreThoseOfTheirSide) {
  const double g = 9.81, h = 1.0, e = 0.5, fall = std::sqrt(2.0 * h / g), up = e * g * fall;
  BodySpec mass = on(rigid("mass", 2.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "prismatic", {{0, 0, 1}});
  mass.hinge.q = {h};
  mass.hinge.loads = {{0, HingeLaw::stop, {0.0, std::numeric_limits<double>::infinity(), 1e6, 1.0, 1.0}, {}, {e, 1.0}}};
  for (const std::string method : {"dopri5", "dop853", "cvode_adams", "ark_explicit"}) {
    Simulation sim(compiled(system({mass}, uniform_gravity({0, 0, -g}))), options_of(method, 1e-9, true));
    Kept kept;
    sim.record(kept,
               {{{"q, v, v'", {"q", "v", "a"}, "1", "", ""},
                 [&](double* x) { x[0] = sim.state().q[0], x[1] = sim.state().v[0], x[2] = sim.vdot()[0]; }}},
               {1, 100});
    sim.run(0.8);
    ASSERT_EQ(kept.rows.size(), 81u) << method;
    EXPECT_LT(sim.statistics().steps, 60) << method;
    for (std::size_t i = 0; i < kept.rows.size(); ++i) {
      const double t = kept.times[i], after = t - fall;
      EXPECT_NEAR(kept.rows[i][0], after < 0.0 ? h - 0.5 * g * t * t : up * after - 0.5 * g * after * after, 1e-7) << method << t;
      EXPECT_NEAR(kept.rows[i][1], after < 0.0 ? -g * t : up - g * after, 1e-7) << method << t;
      EXPECT_NEAR(kept.rows[i][2], -g, 1e-12) << method << t;
    }
  }
}

/// A corner one unit in the last place behind a row.
TEST(BetweenSteps, ARowNextToACornerIsWritten) {
  for (const std::string method : {"dopri5", "cvode_adams", "ark_explicit", "ark_implicit"}) {
    Recorded run(Busy::vehicle(), options_of(method, 1e-8, true), {1, 10});
    run.sim.prescribe(
        run.sim.model().user[2].v,
        MotionProfile::rate_table({{0.1, 0.0}, {std::nextafter(0.3, 0.0), 0.2}, {std::nextafter(0.3, 1.0), 0.2}, {1.0, 0.1}}));
    run.sim.run(1.0);
    EXPECT_EQ(run.kept.times.size(), 11u) << method;
  }
}

TEST(BetweenSteps, WhatChangesSomethingInsideIsRefused) {
  Simulation sim(compiled(system(base_with_sprung_arm())), options_of("dopri5", 1e-8, true));
  sim.watch({1, 50}, [&] { sim.set_force(6, sim.time()); });
  try {
    sim.run(1.0);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics().front().code, Code::unsupported);
  }
}

/// A wave that is below zero for 8 ms between two crests, inside of one step: neither its slopes at the ends nor the looks inside tell of
/// it, and a row does. Where rows end steps it happens.
TEST(BetweenSteps, AnEventThatIsMissedIsTold) {
  for (const bool between_steps : {true, false}) {
    Recorded run(system(base_with_sprung_arm()), options_of("dop853", 1e-5, between_steps), {1, 20});
    run.sim.add_event({"dip",
                       [](double t, const double*, const double*) {
                         return 1.0 + 0.5 * std::exp(-std::abs(t - 1.7)) - 2.0 * std::exp(-2e4 * (t - 1.7) * (t - 1.7));
                       },
                       0,
                       {}});
    run.sim.run(4.0);
    EXPECT_EQ(run.kept.events.size(), between_steps ? 0u : 2u);
    ASSERT_EQ(run.sim.warnings().all().size(), between_steps ? 1u : 0u);
    if (!between_steps) continue;
    EXPECT_EQ(run.sim.warnings().all()[0].what.code, Code::mission_doubt);
    EXPECT_EQ(run.sim.warnings().all()[0].what.at.key_path, "event \"dip\"");
  }
  Busy none("dopri5", true);
  none.sim.run(2.0);
  for (const Warning& w : none.sim.warnings().all()) EXPECT_EQ(w.what.at.key_path.find("event"), std::string::npos);
}

/// Of which each row inside of a step would be a step of its own.
TEST(BetweenSteps, RowsOfExtendedRunsEndSteps) {
  Recorded inside(system(base_with_sprung_arm()), options_of("extended", 1e-18, true), {1, 10});
  Recorded ends(system(base_with_sprung_arm()), options_of("extended", 1e-18, false), {1, 10});
  inside.sim.run(1.0), ends.sim.run(1.0);
  EXPECT_EQ(inside.kept.rows, ends.kept.rows);
  EXPECT_EQ(inside.sim.statistics().steps, ends.sim.statistics().steps);
}

/// Steps that outputs alone end are counted, so that somebody is told.
TEST(BetweenSteps, StepsThatRowsEndAreCounted) {
  Recorded ends(system(base_with_sprung_arm()), options_of("dop853", 1e-6, false)),
      inside(system(base_with_sprung_arm()), options_of("dop853", 1e-6, true));
  ends.sim.every({1, 10}, [&] { ends.sim.set_force(6, 0.1 * std::cos(ends.sim.time())); });
  ends.sim.run(2.0), inside.sim.run(2.0);
  EXPECT_EQ(ends.sim.ended_by_looking(), 180) << "of 200 those at which no command came";
  EXPECT_EQ(inside.sim.ended_by_looking(), 0);
  EXPECT_LT(inside.sim.statistics().steps, 20);
}

}  // namespace
}  // namespace within_steps
}  // namespace cardan::test
