// Inverse kinematics: what can be reached is reached to round-off, what cannot is said with the nearest posture.
#include "core/operators/inverse_kinematics.hpp"

#include <Eigen/Geometry>
#include <numbers>

#include "tests/properties/trees.hpp"

namespace cardan::test {
namespace {

using operators::IkLimit;
using operators::IkOptions;
using operators::IkResult;
using operators::IkTarget;
using operators::inverse_kinematics;

/// Pose of a node at q, by the observer.
NodeState node_at(const Model& m, const VectorXd& q, const std::string& name) {
  Workspace ws(m);
  Observer observer(m, ws);
  const VectorXd zero = VectorXd::Zero(m.nv);
  VectorXd vdot(m.nv);
  const Inputs in{.q = q.data(), .v = zero.data(), .tau = zero.data(), .vdot = zero.data()};
  forward_dynamics(m, ws, in, vdot.data());
  observer.update(in, nullptr);
  return observer.node(m.find_node(name));
}
double off(const Model& m, const VectorXd& q, const std::string& node, const IkTarget& t) {
  const NodeState n = node_at(m, q, node);
  return worse((n.position - t.position).norm(), (n.R_WN - t.R_WN).norm());
}

/// Planar arm along x, links of length 1, hinges about z; its tip is node "tip".
std::shared_ptr<const Model> arm(int links) {
  std::vector<BodySpec> bodies;
  for (int i = 0; i < links; ++i)
    bodies.push_back(on(rigid("link" + std::to_string(i), 1.0, {0.5, 0, 0}, diagonal({0.1, 0.1, 0.1})),
                        i == 0 ? "" : "link" + std::to_string(i - 1), "revolute", {Vector3d::UnitZ()}, Vector3d(i == 0 ? 0.0 : 1.0, 0, 0)));
  NodeSpec tip;
  tip.name = "tip", tip.position = Vector3d::UnitX();
  bodies.back().nodes.push_back(tip);
  return compiled(system(bodies));
}
int tip_of(const Model& m) { return m.find_node(m.user.back().name + ".tip"); }

TEST(InverseKinematics, TwoPosesOnABranchedTree) {
  const auto body = [](const std::string& name) { return rigid(name, 1.0, {0.2, 0.1, 0.0}, diagonal({0.1, 0.2, 0.2})); };
  const Vector3d up{0.1, 0.3, 0.8};
  std::vector<BodySpec> bodies{on(body("root"), "", "ball")};
  for (const std::string side : {"l", "r"}) {
    const double y = side == "l" ? 0.5 : -0.5;
    bodies.push_back(on(body(side + "1"), "root", "ball", {}, {0.0, y, 0.2}));
    bodies.push_back(on(body(side + "2"), side + "1", "universal", {Vector3d::UnitX(), Vector3d::UnitY()}, up));
    bodies.push_back(on(body(side + "3"), side + "2", "revolute", {Vector3d(1, 2, 2).normalized()}, up));
  }
  const auto model = compiled(system(bodies));
  const VectorXd q0 = model->initial_state().q;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    VectorXd d(model->nv), q(model->nq);
    for (int i = 0; i < model->nv; ++i) d[i] = 1.2 * std::sin(7.0 * seed + 3.0 * i);
    model->retract(q0.data(), d.data(), q.data());
    const NodeState l = node_at(*model, q, "l3"), r = node_at(*model, q, "r3");
    const std::vector<IkTarget> targets{IkTarget::at_pose(model->find_node("l3"), l.position, l.R_WN),
                                        IkTarget::at_pose(model->find_node("r3"), r.position, r.R_WN)};
    const IkResult found = inverse_kinematics(model, q0.data(), targets);
    EXPECT_TRUE(found.reached) << found.message;
    EXPECT_LT(found.residual, 1e-12);
    EXPECT_LT(off(*model, found.q, "l3", targets[0]), 1e-11);
    EXPECT_LT(off(*model, found.q, "r3", targets[1]), 1e-11);
    const IkResult weighted = inverse_kinematics(model, q0.data(), targets, {.dynamic = true});
    EXPECT_TRUE(weighted.reached) << weighted.message;
    const IkResult again = inverse_kinematics(model, q0.data(), targets);
    EXPECT_EQ(again.q, found.q);
    EXPECT_EQ(again.message, found.message);
  }
}

TEST(InverseKinematics, RandomTreesReachWhatTheyStoodIn) {  // any hinge, flexible bodies with their modes held
  for (const double flexible : {0.0, 0.5})
    for_all_trees(
        {.bodies = 5, .flexible = flexible, .level = 1}, 1e-11,
        [](const RandomTree& tree) {
          const auto model = compiled(tree.spec);
          const State s = model->initial_state();
          std::vector<IkTarget> targets;
          for (const std::string& name : {model->user.back().name, model->user.front().name}) {
            if (model->nodes[static_cast<std::size_t>(model->find_node(name))].sweep == 0) continue;
            const NodeState n = node_at(*model, s.q, name);
            targets.push_back(IkTarget::at_pose(model->find_node(name), n.position, n.R_WN));
          }
          VectorXd d = VectorXd::Zero(model->nv), q(model->nq);
          for (const UserBody& u : model->user)
            for (int j = 0; j < u.nv; ++j) d[u.v + j] = 0.15 * ((3 * (u.v + j)) % 5 - 2);
          model->retract(s.q.data(), d.data(), q.data());
          const IkResult found = inverse_kinematics(model, q.data(), targets, {.tolerance = 3e-13});
          if (!found.reached) return HUGE_VAL;
          for (const UserBody& u : model->user)
            if (u.n_modes > 0 && (found.q - q).segment(u.eta, u.n_modes).norm() != 0.0) return HUGE_VAL;
          double worst = 0.0;
          for (const IkTarget& t : targets)
            worst =
                worse(worst, off(*model, found.q, model->nodes[static_cast<std::size_t>(t.node)].name, t) / worse(1.0, t.position.norm()));
          return worst;
        },
        40);
}

TEST(InverseKinematics, WhatIsOutOfReachIsSaid) {
  const auto model = arm(2);
  const IkTarget far = IkTarget::at_position(tip_of(*model), {0.0, 3.0, 0.0});
  VectorXd q(2);
  q << 0.3, 0.4;
  const IkResult found = inverse_kinematics(model, q.data(), {&far, 1});
  EXPECT_FALSE(found.reached);
  EXPECT_TRUE(found.stationary);
  EXPECT_NEAR(found.residual, 1.0, 1e-9);  // stretched towards it
  EXPECT_LT((node_at(*model, found.q, "link1.tip").position - Vector3d(0, 2, 0)).norm(), 1e-6);
  EXPECT_EQ(found.starts, 8);
  EXPECT_NE(found.message.find("cannot be reached"), std::string::npos) << found.message;
  EXPECT_NE(found.message.find("link1.tip off by 0 rad, 1 m"), std::string::npos) << found.message;
}

TEST(InverseKinematics, SingularPostures) {
  const auto model = arm(2);
  VectorXd q = VectorXd::Zero(2);
  const IkTarget inside = IkTarget::at_position(tip_of(*model), {1.0, 0.0, 0.0});  // along the straight arm: no first-order motion helps
  const IkResult stuck = inverse_kinematics(model, q.data(), {&inside, 1}, {.starts = 1});
  EXPECT_FALSE(stuck.reached);
  EXPECT_NEAR(stuck.residual, 1.0, 1e-12);
  const IkResult found = inverse_kinematics(model, q.data(), {&inside, 1});
  EXPECT_TRUE(found.reached) << found.message;
  EXPECT_GT(found.starts, 1);
  EXPECT_NEAR(std::cos(found.q[1]), -0.5, 1e-12);  // law of cosines: the elbow at 120 degrees
  q << 0.4, 0.9;
  const IkTarget edge = IkTarget::at_position(tip_of(*model), {2.0, 0.0, 0.0});  // at full stretch the Jacobian has rank 1
  EXPECT_LT(inverse_kinematics(model, q.data(), {&edge, 1}).residual, 1e-9);
}

TEST(InverseKinematics, Limits) {
  const auto model = arm(2);
  VectorXd q(2);
  q << 0.0, 0.5;
  const IkTarget target = IkTarget::at_position(tip_of(*model), {1.0, 1.0, 0.0});  // elbow +-90 degrees
  IkOptions options;
  options.limits = {{1, -2.0, -0.1}};
  const IkResult found = inverse_kinematics(model, q.data(), {&target, 1}, options);
  EXPECT_TRUE(found.reached) << found.message;
  EXPECT_NEAR(found.q[1], -0.5 * std::numbers::pi, 1e-11);
  EXPECT_TRUE(found.at_limit.empty());
  options.limits = {{1, -1.0, 1.0}};  // now too stiff: the tip stays at least |1 + e^i| = 2 cos(1/2) away from the shoulder
  const IkResult short_of = inverse_kinematics(model, q.data(), {&target, 1}, options);
  EXPECT_FALSE(short_of.reached);
  EXPECT_NEAR(short_of.residual, 2.0 * std::cos(0.5) - std::sqrt(2.0), 1e-9);
  EXPECT_EQ(short_of.at_limit, std::vector<int>{1});
  EXPECT_NEAR(std::abs(short_of.q[1]), 1.0, 0.0);
  EXPECT_NE(short_of.message.find("at limits: link1.rate"), std::string::npos) << short_of.message;
  options.limits = {{1, 1.0, -1.0}};
  EXPECT_THROW(inverse_kinematics(model, q.data(), {&target, 1}, options), InputError);
}

TEST(InverseKinematics, RowsChooseWhatCounts) {  // a node on a ball hinge that shall point its z along the target's: any turn about it
  const auto model = compiled(system({on(rigid("dish", 1.0, {0, 0, 0.1}, diagonal({1, 1, 1})), "", "ball")}));
  const VectorXd q = model->initial_state().q;
  IkTarget t =
      IkTarget::at_attitude(model->find_node("dish"), Eigen::AngleAxisd(2.0, Vector3d(0.3, 1.0, -0.4).normalized()).toRotationMatrix());
  t.rows[2] = false;
  const IkResult found = inverse_kinematics(model, q.data(), {&t, 1});
  EXPECT_TRUE(found.reached) << found.message;
  const Eigen::Matrix3d R = node_at(*model, found.q, "dish").R_WN;
  EXPECT_LT((R.col(2) - t.R_WN.col(2)).norm(), 1e-11);
  EXPECT_GT((R.col(0) - t.R_WN.col(0)).norm(), 1e-2);  // it did not do more than it was asked
  EXPECT_NEAR(found.q.norm(), 1.0, 1e-14);
}

TEST(InverseKinematics, PrefersThePostureNearAnother) {
  const auto model = arm(3);
  const IkTarget target = IkTarget::at_position(tip_of(*model), {1.2, 0.9, 0.0});
  VectorXd q(3);
  q << 1.0, -0.5, -0.8;
  IkOptions options;
  options.prefer = (VectorXd(3) << 0.2, 0.4, 0.1).finished();
  const IkResult found = inverse_kinematics(model, q.data(), {&target, 1}, options);
  EXPECT_TRUE(found.reached) << found.message;
  EXPECT_LT(found.residual, 2e-12);
  // Lagrange: the way to the preferred posture has no part in the null space of J
  const double a = found.q[0], b = a + found.q[1], c = b + found.q[2];
  const Vector3d jx{-std::sin(a) - std::sin(b) - std::sin(c), -std::sin(b) - std::sin(c), -std::sin(c)},
      jy{std::cos(a) + std::cos(b) + std::cos(c), std::cos(b) + std::cos(c), std::cos(c)};
  const Vector3d null = jx.cross(jy).normalized();
  EXPECT_NEAR(null.dot(options.prefer - found.q), 0.0, 2e-7);
  EXPECT_LT(found.null_space_step, 2e-7);
  const IkResult plain = inverse_kinematics(model, q.data(), {&target, 1});
  EXPECT_LT((found.q - options.prefer).norm(), (plain.q - options.prefer).norm());
}

TEST(InverseKinematics, HeldAndFreedComponents) {
  const auto model = arm(3);
  const IkTarget target = IkTarget::at_position(tip_of(*model), {1.2, 0.9, 0.0});
  VectorXd q(3);
  q << 1.0, -0.5, -0.8;
  const IkResult found = inverse_kinematics(model, q.data(), {&target, 1}, {.free = {0, 2}});
  EXPECT_TRUE(found.reached) << found.message;
  EXPECT_EQ(found.q[1], -0.5);
}

}  // namespace
}  // namespace cardan::test
