// Inverse kinematics: what can be reached is reached to round-off, what cannot is said with the nearest posture.
#include "core/operators/inverse_kinematics.hpp"

#include <Eigen/Geometry>
#include <numbers>

#include "core/dynamics/loops.hpp"
#include "tests/properties/trees.hpp"
#include "tests/support/bench_loops.hpp"
#include "tests/support/four_bar.hpp"

namespace cardan::test {
namespace {

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

TEST(InverseKinematics, WhatIsNotANumberIsRefused) {  // it ended the program
  const auto model = arm(2);
  VectorXd q(2);
  q << 0.0, 0.5;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [&](const VectorXd& start, const IkTarget& target, const IkOptions& options = {}) {
    try {
      inverse_kinematics(model, start.data(), {&target, 1}, options);
    } catch (const InputError& e) {
      return e.diagnostics().front().code == Code::out_of_range;
    }
    return false;
  };
  const IkTarget good = IkTarget::at_position(tip_of(*model), {1.0, 1.0, 0.0});
  for (const double bad : {nan, HUGE_VAL}) EXPECT_TRUE(refused(q, IkTarget::at_position(tip_of(*model), {1.0, bad, 0.0})));
  for (const double bad : {nan, -1.0, HUGE_VAL}) {
    IkTarget weighted = good;
    weighted.position_weight = bad;
    EXPECT_TRUE(refused(q, weighted)) << bad;
  }
  EXPECT_TRUE(refused(VectorXd::Constant(2, nan), good));
  IkOptions options;
  options.prefer = VectorXd::Constant(2, nan);
  EXPECT_TRUE(refused(q, good, options));
  options.prefer.resize(0), options.weight = Eigen::Vector2d(1.0, nan);
  EXPECT_TRUE(refused(q, good, options));
  const IkTarget far = IkTarget::at_position(tip_of(*model), {1e300, 0.0, 0.0});  // the square of its residual overflows
  const IkResult found = inverse_kinematics(model, q.data(), {&far, 1});
  EXPECT_FALSE(found.reached);
  EXPECT_EQ(found.q.size(), 2) << "the nearest posture that was found";
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

// ---- closed loops ----

double open_by(const Model& m, const VectorXd& q, const LoopDrive* drives = nullptr) {
  Workspace ws(m);
  return loop_rows(m, ws, q.data(), drives).c.cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
}
/// q moved by d and closed again.
VectorXd beside(const Model& m, const VectorXd& q, const VectorXd& d) {
  VectorXd out(m.nq), v = VectorXd::Zero(m.nv);
  m.retract(q.data(), d.data(), out.data());
  EXPECT_TRUE(LoopProjection(m).close(out.data(), v.data()));
  return out;
}
SystemSpec four_bar_with_nodes(const std::string& closing, double branch) {
  SystemSpec spec = four_bar(closing, 2.0, branch);
  NodeSpec middle;
  middle.name = "middle", middle.position = {0.3, 0.1, 0};
  spec.bodies[1].nodes.push_back(middle);
  return spec;
}

/// One angle tells all of a four-bar: the coupler finds it, in the assembly that it stands in, with as many rows as there are.
TEST(ClosedInverseKinematics, FindsTheCrankOfAFourBar) {
  for (const char* closing : {"point", "revolute"})
    for (const double branch : {1.0, -1.0})
      for (const double turn : {0.3, -0.6, 1.1}) {
        const auto model = compiled(four_bar_with_nodes(closing, branch));
        const VectorXd q0 = model->initial_state().q;
        VectorXd truth = q0;
        for (int i = 0; i < 20; ++i) truth = beside(*model, truth, (VectorXd(3) << turn / 20.0, 0, 0).finished());
        const NodeState there = node_at(*model, truth, "coupler.middle");
        const IkTarget target = IkTarget::at_position(model->find_node("coupler.middle"), there.position);
        const IkResult found = inverse_kinematics(model, q0.data(), {&target, 1});
        EXPECT_TRUE(found.reached) << closing << branch << turn << ": " << found.message;
        EXPECT_EQ(found.starts, 1);
        EXPECT_LE(distance(found.q, truth), 1e-10);
        EXPECT_LE(open_by(*model, found.q), 1e-14);
        EXPECT_TRUE(inverse_kinematics(model, q0.data(), {&target, 1}, {.dynamic = true}).reached);
      }
}

/// Rows that the others imply but for the last digits that an axis was typed with have singular values of so much: they hold nothing, or
/// the crank would not move. Closed at the start; far from it they stay open by as much.
TEST(ClosedInverseKinematics, RowsThatOthersImplyButForDigitsHoldNothing) {
  for (const auto& [tilt, turn] :
       {std::pair(0.0, 1e-3), {0.0, 0.2}, {3e-10, 1e-3}, {1e-9, 1e-3}, {1e-8, 1e-4}, {1e-8, 0.2}, {1e-7, 0.2}, {1e-6, 0.2}}) {
    SystemSpec spec = four_bar_with_nodes("revolute", 1.0);
    HingeSpec& rocker = spec.bodies[2].hinge;  // the same posture at an angle of zero
    rocker.onode_R = Eigen::AngleAxisd(rocker.q[0], Eigen::Vector3d::UnitZ()).toRotationMatrix(), rocker.q = {0.0};
    rocker.params = along({{tilt, 0, 1}});
    const auto model = compiled(spec);
    const VectorXd q0 = model->initial_state().q;
    const VectorXd truth = beside(*model, q0, (VectorXd(3) << turn, 0, 0).finished());
    const NodeState there = node_at(*model, truth, "coupler.middle");
    const IkTarget target = IkTarget::at_position(model->find_node("coupler.middle"), there.position);
    const IkResult found = inverse_kinematics(model, q0.data(), {&target, 1}, {.tolerance = 1e-13});
    EXPECT_TRUE(found.reached) << tilt << ": " << found.message;
    EXPECT_LE(distance(found.q, truth), 1e-11 + 10.0 * tilt * turn) << tilt << ": a tolerance over the 0.2 m of the crank, and open rows";
  }
}

/// Places that a mechanism was moved to.
TEST(ClosedInverseKinematics, MechanismsReachWhereTheyWere) {
  for (const char* name :
       {"hexapod_free", "mini_cheetah", "andrews", "rocker_bogie", "six_bar", "solar_array_8", "planar_leg_linkage", "tello"}) {
    const auto model = compiled(bench_loops::read(fmt::format("{}/tests/reference/bench_loops/{}.json", CARDAN_SOURCE_DIR, name)).spec);
    const VectorXd q0 = model->initial_state().q;
    Workspace ws(*model);
    const MatrixXd X = loop_freedom(*model, ws, q0.data()).X;
    for (int seed = 1; seed <= 3; ++seed) {
      VectorXd d = VectorXd::Zero(model->nv);
      for (Eigen::Index j = 0; j < X.cols(); ++j) d += 0.2 * std::sin(7.0 * seed + 3.0 * static_cast<double>(j)) * X.col(j);
      d *= std::min(1.0, 0.4 / largest(d));
      const VectorXd truth = beside(*model, q0, d);
      std::vector<IkTarget> targets;
      for (const UserBody& u : model->user) {
        const NodeState n = node_at(*model, truth, u.name);
        targets.push_back(IkTarget::at_pose(model->find_node(u.name), n.position, n.R_WN));
      }
      const IkResult found = inverse_kinematics(model, q0.data(), targets, {.tolerance = 1e-11});
      EXPECT_TRUE(found.reached) << name << ": " << found.message;
      EXPECT_LE(open_by(*model, found.q), 1e-13) << name;
    }
  }
}

TEST(ClosedInverseKinematics, OutOfReachAndAtLimits) {
  const auto model = compiled(four_bar_with_nodes("point", 1.0));
  const VectorXd q0 = model->initial_state().q;
  const int middle = model->find_node("coupler.middle");
  const IkTarget far = IkTarget::at_position(middle, {0.35, 1.0, 0.0});
  // All that it can do, angle by angle.
  double nearest = 1e9, within = 1e9;
  VectorXd q = q0;
  for (const int way : {1, -1}) {
    q = q0;
    for (int i = 0; i < 3000; ++i) {
      q = beside(*model, q, (VectorXd(3) << way * 1e-3, 0, 0).finished());
      const double off = (node_at(*model, q, "coupler.middle").position - far.position).norm();
      nearest = std::min(nearest, off);
      if (std::abs(q[0] - q0[0]) <= 0.02) within = std::min(within, off);
    }
  }
  const IkResult found = inverse_kinematics(model, q0.data(), {&far, 1});
  EXPECT_FALSE(found.reached);
  EXPECT_TRUE(found.stationary);
  EXPECT_NEAR(found.residual, nearest, 1e-6);
  EXPECT_LE(open_by(*model, found.q), 1e-14);
  IkOptions held;
  held.limits = {{0, q0[0] - 0.02, q0[0] + 0.02}};
  const IkResult at_limit = inverse_kinematics(model, q0.data(), {&far, 1}, held);
  EXPECT_FALSE(at_limit.reached);
  EXPECT_GT(within, nearest + 2e-4);
  EXPECT_NEAR(at_limit.residual, within, 1e-4 * within);  // a step of the scan
  EXPECT_EQ(at_limit.at_limit, std::vector<int>{0});
  EXPECT_NEAR(std::abs(at_limit.q[0] - q0[0]), 0.02, 1e-15);
  EXPECT_LE(open_by(*model, at_limit.q), 1e-14);
}

TEST(ClosedInverseKinematics, AnOpenStartIsClosedOrRefused) {
  const auto model = compiled(four_bar_with_nodes("point", 1.0));
  VectorXd q = model->initial_state().q;
  const NodeState there = node_at(*model, q, "coupler.middle");
  const IkTarget target = IkTarget::at_position(model->find_node("coupler.middle"), there.position);
  q[0] += 0.2, q[1] += 0.1;
  EXPECT_GT(open_by(*model, q), 1e-2);
  const IkResult found = inverse_kinematics(model, q.data(), {&target, 1});
  EXPECT_TRUE(found.reached) << found.message;
  EXPECT_LE(open_by(*model, found.q), 1e-14);
  try {
    inverse_kinematics(model, q.data(), {&target, 1}, {.free = {0}});
    FAIL() << "one crank cannot close a loop";
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("C1103"), std::string::npos) << e.what();
  }
}

/// A strut of given length in place of the pivot: two ways to move, and the posture near another among them.
TEST(ClosedInverseKinematics, LengthsOfTheInstantAndAPreferredPosture) {
  SystemSpec spec = four_bar_with_nodes("distance", 1.0);
  spec.loops[0].length = 0.2, spec.loops[0].from.position = {0.5, -0.2, 0}, spec.loops[0].prescribed = true;
  for (BodySpec& b : spec.bodies) b.hinge.v = {0.0};
  const auto model = compiled(spec);
  const VectorXd q0 = model->initial_state().q;
  const LoopDrive longer{0.05, 0.0, 0.0};
  IkTarget target = IkTarget::at_position(model->find_node("coupler.middle"), {0.0, 0.33, 0.0});
  target.rows = {false, false, false, false, true, false};  // its height
  IkOptions options;
  options.drives = &longer, options.prefer = q0 + Eigen::Vector3d(0.1, 0.05, -0.1);
  const IkResult found = inverse_kinematics(model, q0.data(), {&target, 1}, options);
  EXPECT_TRUE(found.reached) << found.message;
  EXPECT_LE(open_by(*model, found.q, &longer), 1e-14);
  const NodeState tip = node_at(*model, found.q, "rocker");
  const Vector3d end = tip.position + tip.R_WN * Vector3d(0.4, 0, 0);
  EXPECT_NEAR((end - Vector3d(0.5, -0.2, 0)).norm(), 0.25, 1e-14);
  EXPECT_NEAR(node_at(*model, found.q, "coupler.middle").position.y(), 0.33, 1e-12);
  // Nothing of the way to the preferred posture is left along what loop and target allow: one direction of three.
  Workspace ws(*model);
  const VectorXd g = loop_rows(*model, ws, found.q.data(), &longer).G.row(0);
  const double a = found.q[0], b = a + found.q[1];
  const Vector3d height{0.2 * std::cos(a) + 0.3 * std::cos(b) - 0.1 * std::sin(b), 0.3 * std::cos(b) - 0.1 * std::sin(b), 0.0};
  const Vector3d free = Vector3d(g).cross(height).normalized();
  EXPECT_NEAR(free.dot(options.prefer - found.q), 0.0, 1e-6);
}

}  // namespace
}  // namespace cardan::test
