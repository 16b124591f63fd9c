// Indices that there are not, states of another vehicle, times that are none: an InputError with its code. They wrote over the heap, read
// beside it, or ran for ever.
#include <gtest/gtest.h>

#include <cmath>

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
