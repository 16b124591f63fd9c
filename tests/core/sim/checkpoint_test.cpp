// A run goes on from a checkpoint with the same bits as if it had never stopped.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include "core/io/checkpoint_text.hpp"
#include "core/io/recorder.hpp"
#include "core/sim/outputs.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/equipped_vehicle.hpp"
#include "tests/support/builders.hpp"
#include "tests/support/mass_on_a_string.hpp"
#include "tests/support/modal_samples.hpp"
#include "tests/support/scratch.hpp"

namespace cardan::test {
namespace {

using Eigen::VectorXd;

const std::vector<std::string> kResumedMethods = {"rk4",
                                                  "dopri5",
                                                  "dop853",
                                                  "exponential",
                                                  "multirate",
                                                  "cvode_adams",
                                                  "cvode_bdf",
                                                  "cvode_bdf krylov",
                                                  "ark_explicit",
                                                  "ark_imex",
                                                  "ark_implicit",
                                                  "ark_implicit krylov",
                                                  "rk4 diagonalised",
                                                  "dopri5 diagonalised",
                                                  "dop853 diagonalised_rates",
                                                  "cvode_bdf diagonalised"};

/// On the base beside the sprung arm a flexible boom and a wheel on a profile with corners, a wrench on the arm; commands at 8 Hz; an event
/// that turns the wrench over.
SystemSpec spacecraft() {
  BodySpec wheel = on(rigid("wheel", 1.5, {0, 0.1, 0}, diagonal({0.2, 0.1, 0.2})), "base", "revolute", {{1, 0, 0}}, {-0.5, 0, 0});
  wheel.hinge.prescribed = {0};
  BodySpec boom = on(BodySpec(), "base", "revolute", {{0, 1, 0}}, {0, 0.4, 0});
  boom.name = "boom", boom.type = "modal_flexible", boom.level = 0;
  boom.modal = std::make_shared<const ModalData>(lumped());
  std::vector<BodySpec> bodies = base_with_sprung_arm();
  bodies[0].hinge.v[3] = 0.05;
  bodies.insert(bodies.end(), {wheel, boom});
  return system(std::move(bodies));
}

struct ResumedScene {
  explicit ResumedScene(const std::string& method)
      : sim(compiled(spacecraft(), {.node_wrenches = true, .world_wrenches = true}), options(method)) {
    const Model& m = sim.model();
    sim.prescribe(m.user[2].v, MotionProfile::rate_table({{0.13, 0.0}, {0.57, 1.1}, {1.01, -0.4}}));
    slot = sim.add_wrench(m.find_node("arm"), true);
    const int arm = m.user[1].v, q = m.user[1].q;
    sim.every({1, 8}, [this, arm] { sim.set_force(arm, 0.5 * std::cos(3.0 * sim.time())); });
    sim.add_event({"arm passes", [q](double, const double* x, const double*) { return x[q] - 0.3; }, 0,
                   [this] {
                     Force<double> f = sim.wrenches()[static_cast<std::size_t>(slot)].f;
                     f.f.x = f.f.x > 0.0 ? -0.2 : 0.2;
                     sim.set_wrench(slot, f);
                   }});
    sim.every({1, 10}, [this] { made.emplace_back(sim.time(), sim.checkpoint()); }, {1, 10});
  }
  static SimulationOptions options(const std::string& method) {
    SimulationOptions o;
    o.integrator.method = method.substr(0, method.find(' '));
    if (method.ends_with("krylov")) o.integrator.linear_solver = "krylov";
    if (method.ends_with(" diagonalised")) o.dynamics = Dynamics::diagonalised;
    if (method.ends_with(" diagonalised_rates")) o.dynamics = Dynamics::diagonalised_rates;
    o.integrator.relative_tolerance = 1e-7;
    if (method.starts_with("rk4")) o.integrator.fixed_step = 0.007;
    return o;
  }
  Simulation sim;
  int slot = 0;
  std::vector<std::pair<double, Checkpoint>> made;
};

void expect_same(Simulation& a, Simulation& b, const std::string& what) {
  EXPECT_TRUE(a.state().q == b.state().q && a.state().v == b.state().v) << what;
  EXPECT_EQ(a.time(), b.time()) << what;
  const IntegratorStatistics x = a.statistics(), y = b.statistics();
  EXPECT_EQ(x.steps, y.steps) << what;
  EXPECT_EQ(x.rhs_calls, y.rhs_calls) << what;
  EXPECT_EQ(x.restarts, y.restarts) << what;
  EXPECT_EQ(x.root_evaluations, y.root_evaluations) << what;
  EXPECT_EQ(x.rejected, y.rejected) << what;
  EXPECT_EQ(x.error_sum, y.error_sum) << what;
  EXPECT_EQ(a.ledger().energy, b.ledger().energy) << what;
  EXPECT_TRUE(a.ledger().angular == b.ledger().angular) << what;
  EXPECT_EQ(a.worst_ledger().energy_limit, b.worst_ledger().energy_limit) << what;
  EXPECT_EQ(checkpoint_text(a.checkpoint()), checkpoint_text(b.checkpoint())) << what;
}

TEST(Checkpoint, IsWhereARunGoesOnBitForBit) {
  for (const std::string& method : kResumedMethods) {
    ResumedScene whole(method);
    whole.sim.run(2.0);
    ASSERT_EQ(whole.made.size(), 20u) << method;
    EXPECT_TRUE(whole.sim.ledger().pass) << method;
    for (const std::size_t at : {0u, 4u, 9u, 18u}) {
      const auto& [t, checkpoint] = whole.made[at];
      ResumedScene rest(method);
      rest.sim.resume(checkpoint_of(checkpoint_text(checkpoint)));
      EXPECT_EQ(rest.sim.time(), t) << method;
      rest.sim.run(2.0);
      ASSERT_EQ(rest.made.size(), whole.made.size() - at - 1) << method;
      for (std::size_t i = 0; i < rest.made.size(); ++i)
        EXPECT_EQ(rest.made[i].second, whole.made[at + 1 + i].second) << method << " from " << t << " s at " << rest.made[i].first << " s";
      ResumedScene again(method);
      again.sim.resume(checkpoint);
      again.sim.run(2.0);
      expect_same(rest.sim, again.sim, method);
    }
  }
}

/// Resumed at 100 ticks drawn at random, one after the other, each from the checkpoint of the run before: the end is the same.
TEST(Checkpoint, SurvivesAHundredInterruptions) {
  std::mt19937 random(7);
  ResumedScene whole("dopri5");
  whole.sim.run(12.0);
  auto part = std::make_unique<ResumedScene>("dopri5");
  part->sim.run(0.1);
  Checkpoint last = part->made.back().second;
  int tick = 1, interruptions = 0;
  while (tick < 120) {
    part = std::make_unique<ResumedScene>("dopri5");
    part->sim.resume(last);
    const int next = std::min(120, tick + 1 + static_cast<int>(random() % 2 == 0 && 120 - tick > 100 - interruptions));
    part->sim.run(0.1 * next);
    last = part->made.back().second;
    tick = next, ++interruptions;
  }
  EXPECT_GE(interruptions, 100);
  EXPECT_EQ(last, whole.made.back().second);
  EXPECT_TRUE(part->sim.state().q == whole.sim.state().q && part->sim.state().v == whole.sim.state().v);
}

/// The first number of the first block in which two of them differ.
std::string difference(const Checkpoint& a, const Checkpoint& b) {
  for (const auto& [name, block] : a) {
    const auto other = b.find(name);
    if (other == b.end() || block.numbers.size() != other->second.numbers.size()) return name + " of another size";
    for (std::size_t i = 0; i < block.numbers.size(); ++i)
      if (!(block.numbers[i] == other->second.numbers[i]))
        return fmt::format("{} no. {}: {} and {}", name, i, block.numbers[i], other->second.numbers[i]);
    if (!(block == other->second)) return name;
  }
  return a == b ? "" : "more blocks";
}

/// The same of a vehicle with devices: noise, what is under way in delays, pulses, a tank, a latch, a command that grows silent.
TEST(Checkpoint, OfDevicesSurvivesAHundredInterruptions) {
  constexpr int kTicks = 160;
  const auto model = equipped();
  const int jolt = model->devices.all[static_cast<std::size_t>(model->devices.find("motor"))].in;
  const int moment = model->devices.all[static_cast<std::size_t>(model->devices.find("rods"))].in + 1;
  for (const std::string method :
       {"dopri5", "dop853", "exponential", "multirate", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit"}) {
    std::vector<Checkpoint> made;
    const auto begin = [&] {
      SimulationOptions options = ResumedScene::options(method);
      options.seed = 11;
      auto sim = std::make_unique<Simulation>(model, options);
      Simulation& s = *sim;
      s.every({1, 4}, [&s, jolt, moment] {
        s.set_device_input(jolt, 2.0 * std::cos(3.0 * s.time()));
        if (std::fmod(s.time(), 2.0) < 1.0) s.set_device_input(moment, 5.0 + s.time());  // then it is silent for a second
      });
      s.every({1, 20}, [&made, &s] { made.push_back(s.checkpoint()); }, {1, 20});
      return sim;
    };
    const auto run = begin();
    run->run(0.05 * kTicks);
    const std::vector<Checkpoint> whole = made;
    ASSERT_EQ(whole.size(), static_cast<std::size_t>(kTicks)) << method;
    EXPECT_TRUE(run->ledger().pass) << method << ": " << run->ledger().energy_relative << " of " << run->ledger().energy_limit;
    std::vector<int> ticks(kTicks - 1);
    std::iota(ticks.begin(), ticks.end(), 1);
    std::ranges::shuffle(ticks, std::mt19937(7));
    ticks.resize(100);
    std::ranges::sort(ticks);
    ticks.push_back(kTicks);
    Checkpoint last;
    for (const int tick : ticks) {
      const auto part = begin();
      made.clear();
      if (!last.empty()) part->resume(checkpoint_of(checkpoint_text(last)));
      part->run(0.05 * tick);
      last = made.back();
      ASSERT_EQ(difference(last, whole[static_cast<std::size_t>(tick - 1)]), "") << method << " at " << part->time() << " s";
      if (tick == kTicks) expect_same(*part, *run, method);
    }
  }
}

/// Keeps nothing, or what it is given.
class Dropped final : public Recorder {
  void begin(const RunHeader&, const std::vector<Channel>&) override {}
  void row(double, std::span<const double>) override {}
  void attach(const std::string&, const std::string&) override {}
  void restart_state(double, std::span<const double>) override {}
  void flush() override {}
  void close(std::string_view) override {}
};

/// Whether rows and checkpoints are kept, in which form, how often they reach the disk, and whether anybody looks between: the same bits.
TEST(Checkpoint, IsTheSameWhateverIsRecorded) {
  const auto model = equipped();
  const auto last_of = [&](std::unique_ptr<Recorder> recorder, bool kept, bool looks) {
    SimulationOptions options = ResumedScene::options("dopri5");
    options.seed = 11;
    Simulation sim(model, options);
    Checkpoint last;
    sim.every({1, 5},
              [&] {
                last = sim.checkpoint();
                if (kept) recorder->checkpoint(sim.time(), checkpoint_text(last));
              },
              {1, 5});
    std::vector<Output> outputs = standard_outputs(sim);
    std::vector<Channel> channels;
    for (const Output& o : outputs) channels.push_back(o.channel);
    recorder->begin({}, channels);
    sim.record(*recorder, std::move(outputs), {1, 20});
    sim.run(2.0, [&](double) {
      if (looks) sim.observe(), recorder->flush();
    });
    recorder->close("passed");
    return last;
  };
  const Checkpoint expected = last_of(std::make_unique<Dropped>(), false, false);
  ASSERT_FALSE(expected.empty());
  EXPECT_EQ(last_of(std::make_unique<Dropped>(), false, true), expected) << "looked at after each step";
  EXPECT_EQ(last_of(make_hdf5_recorder(scratch("always.h5"), 0.0), true, false), expected) << "flushed at each row";
  EXPECT_EQ(last_of(make_hdf5_recorder(scratch("never.h5"), 1e9), true, false), expected) << "flushed at the end";
  EXPECT_EQ(last_of(make_text_recorder(scratch("rows.csv")), true, true), expected) << "as text";
}

TEST(Checkpoint, OfAnotherModelIsRefused) {
  ResumedScene scene("dopri5");
  scene.sim.run(0.2);
  Checkpoint made = scene.made.back().second;
  Simulation other(compiled(system({on(rigid("a", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "free")})), {});
  EXPECT_THROW(other.resume(made), CheckpointFault);
  made["state"].numbers.pop_back();
  EXPECT_THROW(ResumedScene("dopri5").sim.resume(made), CheckpointFault);
  made = scene.made.back().second;
  made.erase("ledger");
  EXPECT_THROW(ResumedScene("dopri5").sim.resume(made), CheckpointFault);
  made = scene.made.back().second;
  made["schedule"].numbers[1] = -1.0;
  EXPECT_THROW(ResumedScene("dopri5").sim.resume(made), CheckpointFault);
  made["schedule"].numbers[1] = 0.5;
  EXPECT_THROW(ResumedScene("dopri5").sim.resume(made), CheckpointFault);
}

/// What a changed number of a checkpoint is answered with.
TEST(Checkpoint, OfImpossibleNumbersIsRefused) {
  ResumedScene scene("dopri5");
  scene.sim.run(0.2);
  const Checkpoint good = scene.made.back().second;
  const auto refused = [&](const std::string& block, std::size_t i, double value) {
    Checkpoint damaged = good;
    damaged.at(block).numbers.at(i) = value;
    try {
      ResumedScene("dopri5").sim.resume(damaged);
    } catch (const CheckpointFault& fault) {
      return std::string(fault.what());
    }
    return std::string("taken");
  };
  EXPECT_EQ(good.at("given motion").numbers.at(0), 3.0);  // points of the profile: 0.13 s, 0; 0.57 s, 1.1; 1.01 s, -0.4; then 3 travels
  const std::string times = "block given motion: a profile whose times do not increase";
  EXPECT_EQ(refused("given motion", 3, 0.13), times);
  EXPECT_EQ(refused("given motion", 3, std::nan("")), "block given motion: a number is not finite");
  EXPECT_EQ(refused("state", 0, HUGE_VAL), "block state: a number is not finite");
  EXPECT_EQ(refused("state", 5, -std::nan("")), "block state: a number is not finite");
  const std::string ticks = "block schedule: ticks of another time than that of the state";
  EXPECT_EQ(refused("state", 0, 0.7), ticks);
  EXPECT_EQ(refused("state", 0, -0.1), ticks);
  EXPECT_EQ(refused("schedule", 1, 0.0), ticks);
  EXPECT_EQ(refused("schedule", 1, 0x1p53), ticks);
  const std::string whole = "block schedule: a whole number is not one, or too large";
  EXPECT_EQ(refused("schedule", 1, 0x1p54), whole);
  EXPECT_EQ(refused("schedule", 0, -1.0), whole);
  EXPECT_EQ(refused("run", 1, 2.0), "block run: a whole number is not one, or too large");  // of a truth
  Checkpoint damaged = good;
  std::vector<double>& motion = damaged.at("given motion").numbers;
  motion[7] = 1.0, motion.erase(motion.begin() + 8, motion.begin() + 10);  // one travel for three points
  EXPECT_THROW(ResumedScene("dopri5").sim.resume(damaged), CheckpointFault);
}

TEST(Checkpoint, BeforeTheFirstStepIsTheBeginningOfTheRun) {
  for (const double t : {0.0, 3.35}) {
    const auto at = [t](ResumedScene& scene) {
      State state = scene.sim.state();
      state.t = t;
      scene.sim.set_state(state);
    };
    ResumedScene whole("dopri5"), rest("dopri5");
    at(whole), at(rest);
    const Checkpoint first = whole.sim.checkpoint();
    whole.sim.run(t + 1.0);
    EXPECT_TRUE(whole.sim.ledger().pass);
    EXPECT_EQ(whole.made.size(), 10u) << "no tick of the time before the run";
    rest.sim.resume(first);
    rest.sim.run(t + 1.0);
    expect_same(whole.sim, rest.sim, "from the beginning");
  }
}

// Its string is as long as it is, and what moves along it has no profile to follow.
TEST(Checkpoint, BeginsARunAsRunDoesAndWhatThatRefusesIsRefusedAgain) {
  Simulation sim(compiled(mass_on_a_string({0.3, 1.5, 0.0})), {});
  for (int again = 0; again < 2; ++again) {
    EXPECT_THROW(sim.checkpoint(), InputError);
    EXPECT_THROW(sim.run(1.0), InputError);
  }
  EXPECT_EQ(sim.time(), 0.0);
}

/// What else happens at that instant would be lost to the run that is resumed.
TEST(Checkpoint, IsRefusedInTheMidstOfEvents) {
  Simulation sim(compiled(spacecraft()), {});
  const auto half = [](double t, const double*, const double*) { return t - 0.5; };
  sim.add_event({"keeps", half, 0, [&sim] { sim.checkpoint(); }});
  sim.add_event({"comes after", half, 0, {}});
  EXPECT_THROW(sim.run(1.0), InputError);
  EXPECT_NO_THROW(sim.checkpoint());
  sim.run(1.0);
  EXPECT_EQ(sim.time(), 1.0);
}

TEST(CheckpointText, KeepsEveryBit) {
  constexpr double inf = std::numeric_limits<double>::infinity();
  Checkpoint all;
  all["a"].numbers = {0.0, -0.0, 0.1, -1e308, 5e-324, inf, -inf, 0x1.fffffffffffffp+52};
  all["b"].texts = {"", "a \"text\"\n", "\xc3\xa4"};
  const Checkpoint back = checkpoint_of(checkpoint_text(all));
  EXPECT_EQ(back, all);
  EXPECT_TRUE(std::signbit(back.at("a").numbers[1]));
  all["a"].numbers = {std::nan("")};
  EXPECT_TRUE(std::isnan(checkpoint_of(checkpoint_text(all)).at("a").numbers.at(0)));
}

TEST(CheckpointText, OfAnotherKindIsRefused) {
  for (const char* text :
       {"", "{}", R"({"format": 1e300, "blocks": {}})", R"({"format": 1.5, "blocks": {}})", "[1, 2]", R"({"format": 2, "blocks": {}})",
        R"({"format": 1, "blocks": {"a": {"numbers": ["x"], "texts": []}}})", R"({"format": 1, "blocks": {"a": {"numbers": [1]}}})",
        R"({"format": 1, "blocks": {"a": {"numbers": [1], "texts": [1]}}})"})
    EXPECT_THROW(checkpoint_of(text), CheckpointFault) << text;
}

}  // namespace
}  // namespace cardan::test
