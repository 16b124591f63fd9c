// What devices push with all at once, against closed forms, the mass matrix and the balances.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/abi/device_family.hpp"
#include "core/dynamics/loops.hpp"
#include "core/model/loops.hpp"
#include "core/sim/simulation.hpp"
#include "tests/operators/compare.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/support/four_bar.hpp"

namespace cardan::test {
namespace {

/// Strikes once at `when`: a node with [moment; force] in its axes, and a hinge component.
struct Hammer {
  static constexpr const char *type = "hammer", *summary = "strikes a node and a hinge once";
  static constexpr unsigned facts = 0;
  struct Packed {
    double when, moment[3], force[3], tau;
  };
  static constexpr cardan_param_desc schema[] = {
      param::required("when", CARDAN_NUMBER, "s", "time"), param::optional("moment", CARDAN_VECTOR, "1", "on the node [N m s]"),
      param::optional("force", CARDAN_VECTOR, "N s", "on the node"), param::optional("tau", CARDAN_NUMBER, "1", "on the hinge")};
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_IMPULSE, "a node"},
                                                 {"hinge", CARDAN_MOUNT_HINGE, CARDAN_USE_LOAD, "a component"}};
  static constexpr cardan_state_desc marks[] = {{"struck", "1", 0.0, 1.0, "how often"}};
  static constexpr std::uint32_t n_roots = 1;
  static bool pack(const Params& in, Packed& p) {
    p.when = in.number("when"), p.tau = in.number("tau");
    std::copy_n(in.vector("moment").data(), 3, p.moment), std::copy_n(in.vector("force").data(), 3, p.force);
    return true;
  }
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>&, DeviceOut<T>&) noexcept {}
  static void roots(const Packed& p, const DeviceIn<double>& in, double* g) noexcept { g[0] = in.t - p.when; }
  static void impulse(const Packed& p, const DeviceIn<double>&, std::uint32_t cause, int, MountLoad<double>* load) noexcept {
    if (cause != 0) return;
    load[0].moment = {p.moment[0], p.moment[1], p.moment[2]}, load[0].force = {p.force[0], p.force[1], p.force[2]};
    load[1].tau = p.tau;
  }
  static void event(const Packed&, const DeviceIn<double>&, std::uint32_t root, int, double*, double* d) noexcept { d[0] += root == 0; }
};

std::shared_ptr<const Model> struck(const SystemSpec& spec) {
  static const Registry types = [] {
    Registry all = registry();
    all.devices.add(device_table<Hammer>());
    return all;
  }();
  return compile(spec, types);
}
DeviceSpec hammer(const std::string& node, const std::string& hinge, const Vector3d& moment, const Vector3d& force, double tau = 0.0) {
  DeviceSpec d = device("hammer", "hammer", {{"when", 0.3}, {"tau", tau}}, {{"at", node}, {"hinge", hinge}});
  return with_vector(with_vector(d, "moment", moment), "force", force);
}
/// Just before and just after the blow at 0.3 s.
struct Jump {
  VectorXd q, v_before, v_after;
};
/// Between them 2e-9 s pass.
Jump jump(const SystemSpec& spec) {
  const auto model = struck(spec);
  Simulation before(model, accurate("dop853", 1e-13)), after(model, accurate("dop853", 1e-13));
  before.run(0.3 - 1e-9), after.run(0.3 + 1e-9);
  const Devices& devices = after.model().devices;
  const int mark = devices.all[static_cast<std::size_t>(devices.find("hammer"))].mark;
  EXPECT_EQ(before.state().marks[mark], 0.0);
  EXPECT_EQ(after.state().marks[mark], 1.0);
  EXPECT_TRUE(after.ledger().pass);
  return {after.state().q, before.state().v, after.state().v};
}

/// The last body whose hinge moves.
const UserBody& last_that_moves(const Model& m) {
  return *std::find_if(m.user.rbegin(), m.user.rend(), [](const UserBody& u) { return u.nv > 0; });
}

TEST(Impulses, OnAFreeBodyOutOfItsCentre) {
  const Vector3d com(0.1, -0.2, 0.3), J(2, 3, 4), n(0.3, 0.1, -0.2), f(1.0, -2.0, 0.5);
  NodeSpec corner;
  corner.name = "corner", corner.position = {0.5, 0.4, -0.3};
  corner.R_BN = Eigen::AngleAxisd(0.7, Vector3d(2, -1, 2) / 3.0).toRotationMatrix();
  BodySpec b = on(rigid("b", 7.0, com, diagonal({2, 3, 4})), "", "free");
  b.nodes = {corner};
  SystemSpec spec = system({b, on(rigid("c", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {{0, 0, 1}})});
  spec.devices = {hammer("b.corner", "c", n, f)};
  const Jump j = jump(spec);
  const Vector3d F = corner.R_BN * f, N = corner.R_BN * n;  // at rest before: axes of the body are those of the world
  const Vector3d w = (N + (corner.position - com).cross(F)).cwiseQuotient(J), v = F / 7.0 - w.cross(com);
  EXPECT_LT((j.v_after.head<3>() - w).norm(), 1e-9);  // 1e-9 s later, and the body turns
  EXPECT_LT((j.v_after.segment<3>(3) - v).norm(), 1e-9);
  EXPECT_EQ(j.v_after[6], 0.0);
}

TEST(Impulses, OnAHingeAndItsReaction) {
  BodySpec hub = on(rigid("hub", 5.0, {0, 0, 0}, diagonal({1, 1, 2})), "", "free");
  BodySpec disc = on(rigid("disc", 3.0, {0, 0, 0}, diagonal({1, 1, 0.5})), "hub", "revolute", {{0, 0, 1}});
  SystemSpec spec = system({hub, disc});
  spec.devices = {hammer("hub", "disc", {0, 0, 0}, {0, 0, 0}, 0.6)};
  const Jump j = jump(spec);
  EXPECT_NEAR(j.v_after[6], 0.6 * (1 / 0.5 + 1 / 2.0), 1e-14);
  EXPECT_NEAR(j.v_after[2], -0.6 / 2.0, 1e-14);
}

/// M (v+ - v-) = J* p on any tree in motion, and the sums of momentum and work are those of the impulse.
TEST(Impulses, JumpByTheInverseOfTheMassMatrix) {
  for (const double flexible : {0.0, 0.5})
    for_all_trees(
        {.bodies = 5, .roots = 1, .flexible = flexible, .floating = true, .springs = true}, 1e-6,
        [](const RandomTree& tree) {
          SystemSpec spec = tree.spec;
          const auto bare = compiled(spec);
          const std::string node = bare->nodes.back().name;
          const UserBody& moves = last_that_moves(*bare);
          const std::string hinge = moves.name + "." + moves.v_names[0];
          const Vector3d n(0.4, -0.3, 0.2), f(-1.0, 2.0, 0.7);
          const double tau = 0.9;
          spec.devices = {hammer(node, hinge, n, f, tau)};
          const Jump j = jump(spec);
          const auto model = struck(spec);
          Workspace ws(*model);
          const NodeWrench w{model->find_node(node), false, {from_eigen(n), from_eigen(f)}};
          VectorXd force = external_force(*model, ws, j.q.data(), {&w, 1});
          force[moves.v] += tau;
          const MatrixXd M = mass_matrix(*model, ws, j.q.data());
          const VectorXd given = M * (j.v_after - j.v_before);
          return distance(given, force) / (1.0 + largest(force)) / std::max(1.0, largest(j.v_after));  // 2e-9 s apart
        },
        30);
}

TEST(Impulses, AreInTheLedgerOfMomentumAndWork) {
  for_all_trees(
      {.bodies = 5, .roots = 1, .flexible = 0.4, .floating = true, .springs = true, .gravity = GravitySpec::Kind::uniform}, 1e-9,
      [](const RandomTree& tree) {
        SystemSpec spec = tree.spec;
        const auto bare = compiled(spec);
        spec.devices = {hammer(bare->nodes.back().name, last_that_moves(*bare).name + "." + last_that_moves(*bare).v_names[0],
                               {0.4, -0.3, 0.2}, {-1.0, 2.0, 0.7}, 0.9)};
        Simulation sim(struck(spec), accurate("dop853", 1e-12));
        sim.run(0.5);
        const LedgerState l = sim.ledger();
        return sim.state().marks[0] == 1.0 ? worse({l.linear_relative, l.angular_relative, l.energy_relative}) : HUGE_VAL;
      },
      30);
}

/// Friction has a limit and an impulse has none: what sticks jumps as if nothing held it, and is braked from there on.
TEST(Impulses, LoosenWhatFrictionHolds) {
  BodySpec mass = on(particle("mass", 2.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}});
  SystemSpec spec = system({mass});
  spec.devices = {device("brake", "dry_friction", {{"coulomb", 8.0}, {"breakaway", 10.0}}, {{"at", "mass"}}),
                  hammer("mass", "mass", {0, 0, 0}, {3.0, 0, 0}, 1.0)};
  Simulation sim(struck(spec), accurate());
  const int held = sim.model().devices.all[static_cast<std::size_t>(sim.model().devices.find("brake"))].mark;
  sim.run(0.3 - 1e-6);
  EXPECT_EQ(sim.state().marks[held], 1.0);
  sim.run(0.35);
  EXPECT_NEAR(sim.state().v[0], 4.0 / 2.0 - 8.0 / 2.0 * 0.05, 1e-11);
  sim.run(1.0);  // it stops after 0.5 s and 0.5 m
  EXPECT_EQ(sim.state().v[0], 0.0);
  EXPECT_NEAR(sim.state().q[0], 0.5, 1e-10);
  EXPECT_TRUE(sim.ledger().pass);
}

/// Held hinges of a vehicle that floats: the jump is that of the same vehicle without brakes, all of it.
TEST(Impulses, LoosenWhatIsHeldAllOverAVehicle) {
  SystemSpec spec = system(base_with_sprung_arm());
  BodySpec hand = on(rigid("hand", 1.0, {0.2, 0.1, 0}, diagonal({0.02, 0.03, 0.04})), "arm", "revolute", {{0, 1, 0}}, {1, 0, 0});
  spec.bodies.push_back(hand);
  SystemSpec loose = spec;
  loose.devices = {hammer("hand", "arm", {0.1, 0.2, -0.3}, {1.0, -2.0, 0.5}, 0.4)};
  spec.devices = loose.devices;
  for (const char* at : {"arm", "hand"})
    spec.devices.push_back(device(std::string("brake_") + at, "dry_friction", {{"coulomb", 30.0}}, {{"at", at}}));
  const Jump held = jump(spec);
  const auto model = struck(loose);
  Workspace ws(*model);
  const NodeWrench w{model->find_node("hand"), false, {{0.1, 0.2, -0.3}, {1.0, -2.0, 0.5}}};
  VectorXd f = external_force(*model, ws, held.q.data(), {&w, 1});
  f[model->user[1].v] += 0.4;
  const VectorXd given = mass_matrix(*model, ws, held.q.data()) * (held.v_after - held.v_before);
  EXPECT_GT(std::abs(held.v_after[6]), 0.1);
  EXPECT_LT(distance(given, f) / largest(f), 1e-6);  // 2e-9 s apart
}

/// A vehicle that floats on a loop to the ground: what the ground gives back comes from outside too.
TEST(Impulses, OnAVehicleThatALoopHoldsToTheGround) {
  BodySpec body = on(rigid("body", 2.0, {0.1, 0, 0}, diagonal({0.1, 0.2, 0.3})), "", "free");
  SystemSpec spec = system({body, on(rigid("far", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "body", "revolute", {{0, 0, 1}})});
  LoopSpec pin;
  pin.name = "pin", pin.type = "point", pin.from.position = {0, 0, 0}, pin.to.body = "body";
  spec.loops = {pin};
  spec.devices = {hammer("body", "far", {0, 0, 0.3}, {0, 1.0, 0})};
  const Jump j = jump(spec);                                  // the ledger passes
  EXPECT_NEAR(j.v_after[2], 0.3 / (0.3 + 2.0 * 0.01), 1e-9);  // about the pin
  EXPECT_LT(j.v_after.segment<3>(3).norm(), 1e-9);
}

/// What a given motion moves keeps it.
TEST(Impulses, LeaveGivenMotionsAsTheyAre) {
  BodySpec cart = on(particle("cart", 2.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}});
  BodySpec load = on(particle("load", 3.0, {0, 0, 0}), "cart", "prismatic", {{1, 0, 0}});
  cart.hinge.v = {0.7}, cart.hinge.prescribed = {0};
  SystemSpec spec = system({cart, load});
  spec.devices = {hammer("load", "load", {0, 0, 0}, {6.0, 0, 0})};
  const Jump j = jump(spec);
  EXPECT_EQ(j.v_after[0], 0.7);
  EXPECT_NEAR(j.v_after[1], 2.0, 1e-14);
}

/// On closed loops v+ - v- = X (X* M X)^-1 X* J* p, X the one motion that the linkage has.
TEST(Impulses, ActAlongWhatClosedLoopsLeaveFree) {
  for (const char* closing : {"point", "revolute"}) {
    SystemSpec spec = four_bar(closing);
    spec.devices = {hammer("coupler", "crank", {0.1, 0.2, 0.3}, {0.5, -0.4, 0.2}, 0.6)};
    const Jump j = jump(spec);
    const auto closed = struck(spec), model = open_tree(closed);
    Workspace ws(*model);
    const NodeWrench w{model->find_node("coupler"), false, {{0.1, 0.2, 0.3}, {0.5, -0.4, 0.2}}};
    VectorXd f = external_force(*model, ws, j.q.data(), {&w, 1});
    f[0] += 0.6;
    const MatrixXd X = loop_freedom(*closed, ws, j.q.data()).X;
    ASSERT_EQ(X.cols(), 1);
    const VectorXd x = X.col(0), expected = x * (x.dot(f) / x.dot(mass_matrix(*model, ws, j.q.data()) * x));
    EXPECT_LT((j.v_after - j.v_before - expected).norm() / expected.norm(), 1e-6) << closing;  // 2e-9 s apart
  }
}

/// A pulse at each tick: n bits of it, in its direction, and no more when it is told to stop.
TEST(PulsedThruster, GivesOneBitATick) {
  BodySpec mass = on(particle("mass", 4.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}});
  SystemSpec spec = system({mass});
  DeviceSpec thruster = device("jet", "pulsed_thruster", {{"bit", 0.2}}, {{"at", "mass"}});
  thruster.rate = 10.0, thruster.inputs["fire"] = {1.0, {}};
  spec.devices = {thruster};
  const auto model = compiled(spec, {.node_wrenches = false});  // as a mission does that puts no load on a node
  EXPECT_FALSE(model->devices.all[0].acts);                     // nothing of it is computed in a step
  Simulation sim(model, accurate());
  sim.run(0.95);  // at 0, 0.1, ... 0.9 s
  EXPECT_NEAR(sim.state().v[0], 10 * 0.2 / 4.0, 1e-14);
  EXPECT_NEAR(sim.device_output(1), 2.0, 1e-14);
  sim.set_device_input(0, 0.25), sim.run(1.05);
  EXPECT_NEAR(sim.state().v[0], 10.25 * 0.2 / 4.0, 1e-14);
  sim.set_device_input(0, 0.0), sim.run(2.0);
  EXPECT_EQ(sim.device_output(0), 11.0);
  double x = 0.0;  // v = 0.05 (k + 1) after the k-th
  for (int k = 0; k < 10; ++k) x += 0.05 * (k + 1) * 0.1;
  x += 0.05 * 10.25 * 1.0;
  EXPECT_NEAR(sim.state().q[0], x, 1e-12);
  EXPECT_TRUE(sim.ledger().pass);
}

/// Of 2000 pulses mean and deviation, each from its number in the run alone.
TEST(PulsedThruster, ScattersAsItSays) {
  BodySpec mass = on(particle("mass", 4.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}});
  SystemSpec spec = system({mass});
  DeviceSpec thruster = device("jet", "pulsed_thruster", {{"bit", 0.2}, {"scatter", 0.05}}, {{"at", "mass"}});
  thruster.rate = 100.0, thruster.inputs["fire"] = {1.0, {}};
  spec.devices = {thruster};
  Simulation sim(compiled(spec), accurate());
  double sum = 0.0, squares = 0.0, before = 0.0;
  const int n = 2000;
  for (int k = 0; k < n; ++k) {
    sim.run(0.01 * k + 0.005);
    const double bit = (sim.state().v[0] - before) * 4.0 / 0.2 - 1.0;
    before = sim.state().v[0];
    sum += bit, squares += bit * bit;
  }
  EXPECT_NEAR(sum / n, 0.0, 4 * 0.05 / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(squares / n), 0.05, 4 * 0.05 / std::sqrt(2.0 * n));
}

/// However widely its bits scatter, none draws.
TEST(PulsedThruster, NeverPulls) {
  SystemSpec spec = system({on(particle("mass", 4.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}})});
  DeviceSpec thruster = device("jet", "pulsed_thruster", {{"bit", 0.2}, {"scatter", 2.0}}, {{"at", "mass"}});
  thruster.rate = 100.0, thruster.inputs["fire"] = {1.0, {}};
  spec.devices = {thruster};
  Simulation sim(compiled(spec), accurate());
  int none = 0;
  for (int k = 0; k < 100; ++k) {
    const double before = sim.state().v[0];
    sim.run(0.01 * k + 0.005);
    EXPECT_GE(sim.state().v[0], before);
    none += sim.state().v[0] == before;
  }
  EXPECT_GT(none, 10);  // of a normal number below -1/2, three of ten
  EXPECT_NEAR(sim.device_output(1), 4.0 * sim.state().v[0], 1e-12);
}

TEST(PulsedThruster, PushesAlongItsDirection) {
  const Vector3d u(0.36, -0.48, 0.8);
  SystemSpec spec = system({on(rigid("bus", 4.0, {0, 0, 0}, diagonal({1, 2, 3})), "", "free")});
  DeviceSpec thruster = with_vector(device("jet", "pulsed_thruster", {{"bit", 0.2}}, {{"at", "bus"}}), "direction", u);
  thruster.rate = 10.0, thruster.inputs["fire"] = {1.0, {}};
  spec.devices = {thruster};
  Simulation sim(compiled(spec), accurate());
  sim.run(0.05);
  EXPECT_LT((sim.state().v.segment<3>(3) - 0.05 * u).norm(), 1e-16);
}

}  // namespace
}  // namespace cardan::test
