// The hinge of shafts that turn alike: in trees and as a closure beside the dense twin, and what it is there for.
#include <cmath>
#include <numbers>

#include "core/sim/simulation.hpp"
#include "tests/properties/closed_mechanisms.hpp"
#include "tests/properties/forms_of_loops.hpp"

namespace cardan::test {
namespace {

TEST(ConstantVelocity, TreesAndClosuresAreThoseOfTheTwin) {
  int closed = 0;
  for_all_trees({.bodies = 5, .flexible = 0.3, .prescribed = 0.0, .hinges = {"constant_velocity", "constant_velocity", "ball", "revolute"}},
                1e-11, [&](const RandomTree& tree) {
                  Cut mechanism = cut(tree);
                  for (const LoopSpec& loop : mechanism.closed.spec.loops) closed += loop.type == "constant_velocity";
                  return forms_apart(mechanism.closed.spec, {}, {LoopForm::multipliers});
                });
  EXPECT_GT(closed, 30);
}

/// A shaft on the ground, and one whose bearing is askew by `tilt` and that the joint drives; the second one closes the loop.
SystemSpec shafts(double tilt, LoopForm form) {
  BodySpec first = on(rigid("first", 1.0, {0, 0, 0}, diagonal({0.02, 0.03, 0.01})), "", "revolute", {{0, 0, 1}});
  const Vector3d askew(0, -std::sin(tilt), std::cos(tilt));  // z turned about x
  BodySpec second = on(rigid("second", 2.0, {0, 0, 0}, diagonal({0.05, 0.02, 0.04})), "", "revolute", {askew});
  first.hinge.v = {1.5}, second.hinge.v = {1.5};
  SystemSpec spec = system({first, second});
  LoopSpec joint;
  joint.name = "joint", joint.type = "constant_velocity", joint.params = along({{1, 0, 0}, {0, 1, 0}});
  joint.from.body = "first", joint.to.body = "second";
  joint.to.R << 1, 0, 0, 0, std::cos(tilt), -std::sin(tilt), 0, std::sin(tilt), std::cos(tilt);  // its z: the axis of the second shaft
  spec.loops = {joint};
  spec.loop_form = form;
  return spec;
}

TEST(ConstantVelocity, ShaftsTurnAlikeAtAnyTilt) {
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers})
    for (const double tilt : {0.02, 0.7, 1.4}) {
      SimulationOptions options;
      options.integrator.method = "dop853", options.integrator.relative_tolerance = 1e-12;
      Simulation sim(compiled(shafts(tilt, form)), options);
      const double energy = sim.energy().total();
      sim.set_force(0, 0.1);
      sim.run(4.0);  // more than a turn
      EXPECT_GT(sim.state().q[0], 2.0 * std::numbers::pi);
      EXPECT_NEAR(sim.state().q[1], sim.state().q[0], 1e-11) << tilt;
      EXPECT_NEAR(sim.state().v[1], sim.state().v[0], 1e-11) << tilt;
      const double second = 0.02 * std::pow(std::sin(tilt), 2) + 0.04 * std::pow(std::cos(tilt), 2);
      EXPECT_NEAR(sim.vdot()[0], 0.1 / (0.01 + second), 1e-10) << tilt;
      EXPECT_NEAR(sim.energy().total() - energy, 0.1 * sim.state().q[0], 1e-11);
    }
}

/// Axes of a file are orthogonal to as many digits as it has; what turns by them is turned, not strained.
TEST(ConstantVelocity, AxesThatAreAlmostOrthogonalTurnByARotation) {
  BodySpec tilted =
      on(rigid("tilted", 1.0, {0.1, 0.2, 0.3}, diagonal({0.02, 0.03, 0.04})), "", "constant_velocity", {{1, 0, 0}, {9e-7, 1, 0}});
  tilted.hinge.q = {0.7, -0.9};
  const auto model = compiled(system({tilted}));
  Workspace ws(*model);
  const State at = model->initial_state();
  VectorXd vdot(model->nv);
  const Inputs in{.q = at.q.data(), .v = at.v.data()};
  ASSERT_TRUE(forward_dynamics(*model, ws, in, vdot.data()));
  Observer seen(*model, ws);
  seen.update(in, vdot.data());
  const Eigen::Matrix3d R = seen.node(model->find_node("tilted")).R_WN;
  EXPECT_LT((R.transpose() * R - Eigen::Matrix3d::Identity()).norm(), 1e-15);
  SystemSpec joined = shafts(0.7, LoopForm::multipliers);
  joined.loops[0].params = along({{1, 0, 0}, {9e-7, 1, 0}});
  EXPECT_LT(forms_apart(joined, {}, {LoopForm::multipliers}), 1e-12);
}

}  // namespace
}  // namespace cardan::test
