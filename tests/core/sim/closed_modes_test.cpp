// Modes of vehicles with closed loops.
#include <Eigen/Dense>
#include <numbers>

#include "core/dynamics/loops.hpp"
#include "core/model/loops.hpp"
#include "core/operators/system_modes.hpp"
#include "tests/support/builders.hpp"

namespace cardan::test {
namespace {

/// Two cranks on the ground, and what joins their tips, which stays level.
SystemSpec parallelogram(double stiffness) {
  const auto crank = [&](const char* name, double x) {
    BodySpec b = on(rigid(name, 1.3, {0.25, 0, 0}, diagonal({0.001, 0.03, 0.03})), "", "revolute", {{0, 0, 1}}, {x, 0, 0});
    b.hinge.q = {-0.5 * std::numbers::pi};
    return b;
  };
  BodySpec coupler = on(rigid("coupler", 2.1, {0.4, 0, 0}, diagonal({0.01, 0.2, 0.2})), "left", "revolute", {{0, 0, 1}}, {0.5, 0, 0});
  coupler.hinge.q = {0.5 * std::numbers::pi};
  SystemSpec spec = system({crank("left", 0.0), crank("right", 0.8), coupler}, uniform_gravity({0, -9.81, 0}));
  if (stiffness > 0.0) {
    SpringDamper spring;
    spring.stiffness = stiffness, spring.rest = -0.5 * std::numbers::pi;
    spec.bodies[0].hinge.springs = {spring};
  }
  LoopSpec pin;
  pin.name = "pin", pin.type = "point";
  pin.from.body = "right", pin.from.position = {0.5, 0, 0}, pin.to.body = "coupler", pin.to.position = {0.8, 0, 0};
  spec.loops = {pin};
  return spec;
}
constexpr double kInertia = 2.1 * 0.25 + 2 * (0.03 + 1.3 * 0.0625);

TEST(ClosedSystemModes, OfAParallelogramOnASpring) {
  SystemSpec spec = parallelogram(35.0);
  spec.gravity = {};
  const auto model = compiled(spec);
  const State s = model->initial_state();
  Workspace ws(*model);
  operators::TreeOperators tree(open_tree(model));
  tree.at(s.q.data());
  const auto modes = operators::closed_system_modes(tree, loop_freedom(*model, ws, s.q.data()).X);
  ASSERT_EQ(modes.n_rigid, 0);
  ASSERT_EQ(modes.frequency.size(), 1);
  EXPECT_NEAR(modes.frequency[0], std::sqrt(35.0 / kInertia) / (2 * std::numbers::pi), 1e-13);
  EXPECT_NEAR(modes.kinetic.sum(), 1.0, 1e-13);
  EXPECT_NEAR(modes.strain.sum(), 1.0, 1e-13);
}

}  // namespace
}  // namespace cardan::test
