// What `--check-against-reference` tells of a run: the difference of v' from that of the dense twin.
#include "core/sim/reference_check.hpp"

#include <gtest/gtest.h>

#include "core/sim/simulation.hpp"
#include "tests/support/builders.hpp"

namespace cardan::test {
namespace {

/// A light link between heavy bodies in orbit, which the twin in double may not be asked about: rounding is told as what it is, and nothing
/// is taken for something that hangs at rest.
TEST(ReferenceCheck, TellsDifferencesInOrbit) {
  BodySpec bus = on(rigid("bus", 6e4, {0.3, 0.05, -0.2}, diagonal({9e5, 6e5, 1.1e6})), "", "free");
  BodySpec link =
      on(rigid("link", 1e-4, {0.01, 0.002, 0.0}, diagonal({1e-8, 2e-8, 2e-8})), "bus", "revolute", {{0, 1, 0}}, {4.0, 0.0, -2.0});
  BodySpec load = on(rigid("load", 1e4, {1.0, 0.1, 0.0}, diagonal({8e3, 1.6e4, 1.7e4})), "link", "revolute", {{0, 1, 0}}, {0.0, 0.0, 0.0});
  BodySpec needle =
      on(rigid("needle", 1e-6, {0.01, 0.0, 0.0}, diagonal({1e-12, 1e-10, 1e-10})), "load", "revolute", {{0, 0, 1}}, {1.0, 0.0, 0.5});
  SystemSpec spec = system({bus, link, load, needle});
  spec.gravity = central_gravity(3.986004418e14, true);
  const auto model = compiled(spec);
  Simulation sim(model, SimulationOptions());
  State s = model->initial_state();
  s.q.segment(4, 3) << 6.1e6, 2.8e6, 1.1e6;
  s.v << 1e-3, -2e-3, 5e-4, -2800.0, 4000.0, 5900.0, 0.02, -0.03, 0.01;
  sim.set_state(s);
  const double apart = difference_from_twin(sim);
  EXPECT_GT(apart, 0.0);
  EXPECT_LT(apart, kReferenceLimit);
}

}  // namespace
}  // namespace cardan::test
