// Numbers of channels as they are recorded, in the axes that their frames name, against statics and a steady turn.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/sim/outputs.hpp"
#include "core/sim/simulation.hpp"
#include "tests/support/builders.hpp"
#include "tests/support/four_bar.hpp"
#include "tests/support/modal_samples.hpp"

namespace cardan::test {
namespace {

using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;

Eigen::Matrix3d about(const Vector3d& axis, double angle) { return Eigen::AngleAxisd(angle, axis).toRotationMatrix(); }

/// What is recorded at the present state below this path.
Eigen::VectorXd recorded(Simulation& sim, const std::string& path, const OutputOptions& wanted = {}) {
  for (const Output& o : standard_outputs(sim, wanted)) {
    if (o.channel.path != path) continue;
    Eigen::VectorXd x = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(o.channel.components.size()));
    sim.observe();
    o.fill(x.data());
    return x;
  }
  ADD_FAILURE() << "no channel " << path;
  return {};
}

/// An arm that turns about the vertical at a given rate: its hinge gives it m w^2 c towards the axis and holds its weight. Its pnode is
/// turned against the body.
TEST(Outputs, ReactionsAreInAxesOfThePnodeAndAccelerationsInThoseOfTheWorld) {
  const double m = 3.0, L = 0.7, w = 1.3, g = 9.81, t = 0.4;
  BodySpec arm = on(rigid("arm", m, {L, 0, 0}, diagonal({0.1, 0.2, 0.2})), "", "revolute", {{0, 0, 1}});
  arm.hinge.pnode_R = about({0, 0, 1}, 0.6), arm.hinge.prescribed = {0}, arm.hinge.v = {w};
  NodeSpec tip;
  tip.name = "tip", tip.position = {2 * L, 0, 0};
  arm.nodes = {tip};
  Simulation sim(compiled(system({arm}, uniform_gravity({0, 0, -g}))), {});
  sim.run(t);
  const OutputOptions wanted{.reactions = {0}, .nodes = {sim.model().find_node("arm.tip")}};
  const Vector3d c = arm.hinge.pnode_R.transpose() * Vector3d(L, 0, 0), weight(0, 0, m * g);
  Vector6d reaction;
  reaction << c.cross(weight), -m * w * w * c + weight;
  EXPECT_LT((recorded(sim, "reactions/arm", wanted) - reaction).norm(), 1e-11 * m * g);
  const Vector3d place = about({0, 0, 1}, w * t) * arm.hinge.pnode_R.transpose() * tip.position;
  EXPECT_LT((recorded(sim, "nodes/arm.tip/position", wanted) - place).norm(), 1e-11);
  EXPECT_LT((recorded(sim, "nodes/arm.tip/velocity", wanted) - w * Vector3d(0, 0, 1).cross(place)).norm(), 1e-11);
  EXPECT_LT((recorded(sim, "nodes/arm.tip/acceleration", wanted) + w * w * place).norm(), 1e-11);
}

TEST(Outputs, CountModesFromOne) {
  const ModalData data = lumped();
  std::vector<std::string> wanted;
  for (int j = 1; j <= data.K.rows(); ++j) wanted.push_back(std::to_string(j));
  BodySpec boom = on(BodySpec(), "", "revolute", {{0, 1, 0}});
  boom.name = "boom", boom.type = "modal_flexible", boom.level = 0, boom.modal = std::make_shared<const ModalData>(data);
  Simulation sim(compiled(system({boom})), {});
  for (const std::string path : {"modes/boom/eta", "modes/boom/etadot"}) {
    const std::vector<Output> all = standard_outputs(sim);
    const auto found = std::ranges::find(all, path, [](const Output& o) { return o.channel.path; });
    ASSERT_NE(found, all.end()) << path;
    EXPECT_EQ(found->channel.components, wanted) << path;
  }
}

/// A body that a weld alone holds against its weight, at a place beside its mass centre.
TEST(Outputs, ReactionsOfLoopsAreInAxesOfFrom) {
  const double m = 4.0, g = 9.81;
  const BodySpec block = on(rigid("block", m, {0, 0, 0}, diagonal({1, 2, 2.5})), "", "free");
  SystemSpec spec = system({block}, uniform_gravity({0, 0, -g}));
  LoopSpec& weld = spec.loops.emplace_back();
  weld.name = "weld", weld.type = "weld", weld.to.body = "block", weld.to.position = weld.from.position = {0.5, 0.3, -0.2};
  weld.to.R = weld.from.R = about(Vector3d(0.6, 0, 0.8), 0.9);
  Simulation sim(compiled(spec), {});
  sim.run(0.1);
  const Vector3d weight(0, 0, m * g);
  Vector6d reaction;
  reaction << weld.from.R.transpose() * (-weld.to.position).cross(weight), weld.from.R.transpose() * weight;
  EXPECT_LT((recorded(sim, "loops/weld/reaction") - reaction).norm(), 1e-10 * m * g);
}

/// One that is eight times as large is as open where its crank is off by the same angle.
TEST(Outputs, ResidualsOfLoopsAreOverTheirSize) {
  const auto residual = [](double size) {
    SystemSpec spec = four_bar();
    for (BodySpec& body : spec.bodies) body.com *= size, body.hinge.onode_position *= size;
    spec.loops[0].from.position *= size, spec.loops[0].to.position *= size;
    Simulation sim(compiled(spec), {});
    sim.q(0) += 1e-7;
    return recorded(sim, "loops/residual")[0];
  };
  EXPECT_GT(residual(1.0), 1e-8);
  EXPECT_NEAR(residual(8.0), residual(1.0), 1e-7 * residual(1.0));
}

TEST(Outputs, AHingeThatIsLockedTellsWhereItIsHeld) {
  BodySpec arm = on(rigid("arm", 1.0, {1, 0, 0}, diagonal({1, 1, 1})), "", "cylindrical", {{0, 0, 1}});
  arm.hinge.q = {0.3, -0.2}, arm.hinge.locked = true;
  Simulation sim(compiled(system({arm})), {});
  EXPECT_EQ(recorded(sim, "hinges/arm/angle")[0], 0.3);
  EXPECT_EQ(recorded(sim, "hinges/arm/displacement")[0], -0.2);
  EXPECT_EQ(recorded(sim, "hinges/arm/speed")[0], 0.0);
  EXPECT_EQ(recorded(sim, "hinges/arm/force"), Eigen::Vector2d(0, 0));
}

/// Along the axis it is driven, against its weight; about it commanded.
TEST(Outputs, ForcesAreThoseOfTheDriveAndThoseThatAreCommanded) {
  const double m = 2.0, g = 9.81;
  BodySpec arm = on(rigid("arm", m, {0, 0, 0}, diagonal({1, 1, 1})), "", "cylindrical", {{0, 0, 1}});
  arm.hinge.prescribed = {1};
  SpringDamper spring;
  spring.component = 1, spring.stiffness = 50.0, spring.rest = 0.1;
  arm.hinge.springs = {spring};
  Simulation sim(compiled(system({arm}, uniform_gravity({0, 0, -g}))), {});
  sim.set_force(0, 2.5);
  const Eigen::VectorXd force = recorded(sim, "hinges/arm/force");
  EXPECT_EQ(force[0], 2.5);
  EXPECT_NEAR(force[1], m * g - 50.0 * 0.1, 1e-12);  // beside its spring
}

TEST(Outputs, ForcesOfADriveAreThoseOfItsOwnHinge) {
  const double g = 9.81;
  BodySpec first = on(rigid("first", 2.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "cylindrical", {{0, 0, 1}}), second = first;
  second.name = "second", second.mass = 5.0;
  first.hinge.prescribed = second.hinge.prescribed = {1};
  Simulation sim(compiled(system({first, second}, uniform_gravity({0, 0, -g}))), {});
  EXPECT_NEAR(recorded(sim, "hinges/first/force")[1], 2.0 * g, 1e-12);
  EXPECT_NEAR(recorded(sim, "hinges/second/force")[1], 5.0 * g, 1e-12);
}

/// A body in any attitude: its rate in its own axes, its velocity in those of the world. As it turns its quaternion goes on through w < 0.
TEST(Outputs, RatesAreInAxesOfTheBodyAndAttitudesDoNotJump) {
  const Vector3d w(0.3, -0.5, 0.7), v(1, 2, -3);
  BodySpec bus = on(rigid("bus", 2.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "free");
  const Eigen::Quaterniond q(about(Vector3d(1, 2, 2) / 3.0, 1.1));
  bus.hinge.q = {q.w(), q.x(), q.y(), q.z(), 4, 5, 6}, bus.hinge.v = {w[0], w[1], w[2], v[0], v[1], v[2]};
  Simulation sim(compiled(system({bus})), {});
  EXPECT_LT((recorded(sim, "bodies/bus/rate") - w).norm(), 1e-15);
  EXPECT_LT((recorded(sim, "bodies/bus/velocity") - v).norm(), 1e-15);
  EXPECT_LT((recorded(sim, "bodies/bus/position") - Vector3d(4, 5, 6)).norm(), 1e-15);
  const std::vector<Output> all = standard_outputs(sim, {});
  const auto attitude = std::ranges::find(all, "bodies/bus/attitude", [](const Output& o) { return o.channel.path; });
  ASSERT_NE(attitude, all.end());
  Eigen::Vector4d x = Eigen::Vector4d::Zero(), before;
  double least = 1.0;
  for (int k = 0; k < 80; ++k) {  // a turn takes 6.9 s
    before = x;
    sim.run(0.1 * k), sim.observe();
    attitude->fill(x.data());
    EXPECT_LT(
        (Eigen::Quaterniond(x[0], x[1], x[2], x[3]).toRotationMatrix() - q.toRotationMatrix() * about(w.normalized(), 0.1 * k * w.norm()))
            .norm(),
        1e-5);
    EXPECT_TRUE(k == 0 || x.dot(before) > 0.99) << k;
    least = std::min(least, x[0]);
  }
  EXPECT_LT(least, -0.8);
}

}  // namespace
}  // namespace cardan::test
