// Indices that there are not, states of another vehicle, times that are none: an InputError with its code. They wrote over the heap, read
// beside it, or ran for ever.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <span>
#include <string>
#include <string_view>

#include "core/base/diagnostic.hpp"
#include "core/sim/outputs.hpp"
#include "core/sim/simulation.hpp"
#include "tests/support/builders.hpp"

namespace cardan::test {
namespace {

template <class Call>
std::string code_of(const Call& call) {
  try {
    call();
  } catch (const InputError& e) {
    return std::string(number_of(e.diagnostics().front().code));
  }
  return "none";
}

TEST(Commands, OfIndicesThatThereAreNotAreRefused) {
  Simulation sim(compiled(system(base_with_sprung_arm())), {});
  const int nq = sim.model().nq, nv = sim.model().nv;
  for (const int i : {-1, nv}) {
    EXPECT_EQ(code_of([&] { sim.set_force(i, 1.0); }), "C0301");
    EXPECT_EQ(code_of([&] { sim.force(i); }), "C0301");
    EXPECT_EQ(code_of([&] { sim.v(i) = 1.0; }), "C0301");
  }
  for (const int i : {-1, nq}) EXPECT_EQ(code_of([&] { sim.q(i) = 1.0; }), "C0301");
  for (const int slot : {-1, 0}) EXPECT_EQ(code_of([&] { sim.set_wrench(slot, {}); }), "C0301");
  const int unknown = sim.model().find_node("nowhere");
  EXPECT_EQ(code_of([&] { standard_outputs(sim, {.reactions = {}, .nodes = {unknown}}); }), "C0202");
  EXPECT_EQ(code_of([&] { standard_outputs(sim, {.reactions = {99}, .nodes = {}}); }), "C0201");
}

// They were missed, ran eleven times at once, or made the run read beside what it keeps of events.
TEST(Commands, TasksAndEventsAreThereBeforeTheRun) {
  Simulation sim(compiled(system(base_with_sprung_arm())), {});
  const auto adds = [&sim](std::vector<std::string>& codes) {
    codes.push_back(code_of([&] { sim.every({1, 10}, [] {}); }));
    codes.push_back(code_of([&] { sim.watch({1, 10}, [] {}); }));
    struct : Recorder {
      void begin(const RunHeader&, const std::vector<Channel>&) override {}
      void row(double, std::span<const double>) override {}
      void attach(const std::string&, const std::string&) override {}
      void restart_state(double, std::span<const double>) override {}
      void flush() override {}
      void close(std::string_view) override {}
    } late;  // which ends before the run does
    codes.push_back(code_of([&] { sim.record(late, {}, {1, 10}); }));
    codes.push_back(code_of([&] { sim.add_event({"late", [](double t, const double*, const double*) { return t - 0.7; }, 0, {}}); }));
  };
  std::vector<std::string> inside, after;
  sim.every({1, 1}, [&] { adds(inside); });
  sim.run(0.5);
  adds(after);
  EXPECT_EQ(inside, std::vector<std::string>(4, "C0401"));
  EXPECT_EQ(after, inside);
  sim.run(1.0);
  EXPECT_EQ(sim.time(), 1.0);
}

// The force on a coordinate whose coefficient is one.
TEST(Outputs, AMultiplierOfACouplingHasTheUnitThatItsRowGives) {
  const BodySpec wheel = rigid("", 1.0, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity());
  SystemSpec spec;
  for (const auto& [name, type] : {std::pair{"motor", "revolute"}, {"drum", "revolute"}, {"rack", "prismatic"}, {"slide", "prismatic"}}) {
    spec.bodies.push_back(on(wheel, "", type, {{0, 0, 1}}));
    spec.bodies.back().name = name;
  }
  const auto couple = [&](const char* name, std::vector<LoopSpec::Term> terms) {
    LoopSpec& l = spec.loops.emplace_back();
    l.name = name, l.type = "coupling", l.terms = std::move(terms), l.open = name[0] == 'o';
  };
  couple("gear", {{"motor", 1.0, {}}, {"drum", -50.0, {}}});
  couple("open_ratio", {{"motor", 17.0, {}}, {"drum", -50.0, {}}});
  couple("pinion", {{"motor", 0.02, {}}, {"rack", -1.0, {}}});
  couple("open_screw", {{"rack", 3000.0, {}}, {"motor", 1.0, {}}});
  couple("open_slides", {{"rack", 2.0, {}}, {"slide", 1.0, {}}});
  couple("open_both", {{"rack", 1.0, {}}, {"motor", 1.0, {}}});
  couple("open_none", {{"rack", 2.0, {}}, {"motor", 3.0, {}}});
  Simulation sim(compiled(spec), {});
  std::map<std::string, std::string> units;
  for (const Output& o : standard_outputs(sim))
    if (o.channel.path.ends_with("/multiplier")) units[o.channel.path] = o.channel.unit;
  EXPECT_EQ(units, (std::map<std::string, std::string>{{"loops/gear/multiplier", "N m"},
                                                       {"loops/open_ratio/multiplier", "N m"},
                                                       {"loops/pinion/multiplier", "N"},
                                                       {"loops/open_screw/multiplier", "N m"},
                                                       {"loops/open_slides/multiplier", "N"},
                                                       {"loops/open_both/multiplier", "1"},
                                                       {"loops/open_none/multiplier", "1"}}));
}

TEST(Commands, WrenchesAreOnNodesThatThereAre) {
  Simulation sim(compiled(system(base_with_sprung_arm()), {.node_wrenches = true, .world_wrenches = true}), {});
  EXPECT_EQ(code_of([&] { sim.add_wrench(-1, true); }), "C0202");
  EXPECT_EQ(code_of([&] { sim.add_wrench(static_cast<int>(sim.model().nodes.size()), false); }), "C0202");
  const int slot = sim.add_wrench(0, true);
  EXPECT_EQ(code_of([&] { sim.set_wrench(slot, {}); }), "none");
  EXPECT_EQ(code_of([&] { sim.set_wrench(slot + 1, {}); }), "C0301");
}

TEST(Commands, StatesTimesAndEventsThatAreNone) {
  EXPECT_EQ(code_of([] { Simulation none(nullptr, {}); }), "C0209");
  Simulation sim(compiled(system(base_with_sprung_arm())), {});
  State other = sim.state();
  other.q.conservativeResize(1);
  EXPECT_EQ(code_of([&] { sim.set_state(other); }), "C0402");
  EXPECT_EQ(code_of([&] { sim.run(std::nan("")); }), "C0301");
  EXPECT_EQ(code_of([&] { sim.add_event({"empty", {}, 0, {}}); }), "C0105");
  sim.add_event({"without an action", [](double t, const double*, const double*) { return t - 0.05; }, 0, {}});
  EXPECT_EQ(code_of([&] { sim.run(0.1); }), "none");
  EXPECT_EQ(sim.time(), 0.1);
}

}  // namespace
}  // namespace cardan::test
