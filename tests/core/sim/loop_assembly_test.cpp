// The assembler: starts that leave loops open, of mechanisms with one and with several ways to close them.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "core/dynamics/inverse.hpp"
#include "core/dynamics/loops.hpp"
#include "core/model/loops.hpp"
#include "core/sim/simulation.hpp"
#include "tests/support/bench_loops.hpp"
#include "tests/support/four_bar.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd start_of(const SystemSpec& spec) { return compiled(spec)->initial_state().q; }

/// Largest residual of the start, relative to the size of its loop.
double open(const Model& model) {
  LoopProjection projection(model);
  State s = model.initial_state();
  projection.close(s.q.data(), s.v.data());
  return worse(projection.distance(), projection.rate());
}

TEST(Assembler, KeepsBothBranchesOfAFourBar) {
  for (const double branch : {1.0, -1.0}) {
    SystemSpec spec = four_bar("point", 2.0, branch);
    const VectorXd closed = start_of(spec);
    // From here to the other branch the coupler turns by 1.9 rad or more; half of it is where neither is.
    for (const double by : {-0.6, -0.2, 0.1, 0.4, 0.6}) {
      spec.bodies[1].hinge.q = {closed[1] + by}, spec.bodies[2].hinge.q = {closed[2] - 0.8 * by};
      spec.assembly.hold = {"crank"};
      const auto model = compiled(spec);
      const VectorXd q = model->initial_state().q;
      EXPECT_EQ(q[0], closed[0]);
      EXPECT_LE(distance(q, closed), 1e-12) << branch << " " << by;
      EXPECT_LE(distance(model->initial_state().v, compiled(four_bar("point", 2.0, branch))->initial_state().v), 1e-12);
    }
  }
}

TEST(Assembler, FindsWhatIsNotGiven) {
  SystemSpec spec = four_bar();
  const State closed = compiled(spec)->initial_state();
  for (BodySpec& b : spec.bodies)
    if (b.name != "crank") b.hinge.v.clear();
  EXPECT_LE(distance(compiled(spec)->initial_state().v, closed.v), 1e-13);  // rates alone
  spec.bodies[2].hinge.q.clear();
  spec.bodies[1].hinge.q.clear();
  spec.bodies[0].hinge.q = {0.4 * std::numbers::pi};
  const auto model = compiled(spec);
  EXPECT_EQ(model->initial_state().q[0], 0.4 * std::numbers::pi);
  EXPECT_EQ(model->initial_state().v[0], 2.0);
  EXPECT_LE(open(*model), 1e-13);
  EXPECT_EQ(model->loops.moved.size(), 4u);  // coordinate and rate of two hinges
  Simulation(model, {}).run(0.1);
}

TEST(Assembler, LeavesAGoodStartAlone) {
  SystemSpec spec = four_bar();
  for (BodySpec& b : spec.bodies) b.hinge.q[0] += b.name == "crank" ? 1e-8 : 0.0;  // open within the tolerance
  const State given = [&] {
    SystemSpec tree = spec;
    tree.loops.clear();
    return compiled(tree)->initial_state();
  }();
  spec.assembly.hold.emplace();
  const auto model = compiled(spec);
  EXPECT_TRUE(model->initial_state().q == given.q && model->initial_state().v == given.v);
  EXPECT_TRUE(model->loops.moved.empty());
}

// Where it ends, the way back has no momentum along what the loops leave free: N* W M W (q_0 - q) = 0.
TEST(Assembler, EndsAtTheNearestInTheMetricOfTheMassMatrix) {
  for (const double weight : {1.0, 30.0}) {
    SystemSpec spec = four_bar();
    const double by[] = {0.3, -0.2, 0.25};
    for (std::size_t i = 0; i < 3; ++i) spec.bodies[i].hinge.q[0] += by[i];
    spec.assembly.hold.emplace();
    spec.assembly.weights["crank"] = weight;
    const auto model = compiled(spec);
    SystemSpec tree = spec;
    tree.loops.clear();
    const auto open_tree = compiled(tree);
    Workspace ws(*open_tree), of_loops(*model);
    const VectorXd q0 = open_tree->initial_state().q, q = model->initial_state().q;
    EXPECT_LE(open(*model), 1e-12);
    MatrixXd M = mass_matrix(*open_tree, ws, q0.data());
    const VectorXd W = Eigen::Vector3d(std::sqrt(weight), 1, 1);
    M = (W.asDiagonal() * M * W.asDiagonal()).eval();
    const MatrixXd G = loop_matrix(*model, of_loops, q.data()).topRows(2);  // x, y of the pin; z does not move
    const VectorXd free = Eigen::Vector3d(G.row(0)).cross(Eigen::Vector3d(G.row(1))).normalized();
    const VectorXd way = q0 - q;
    EXPECT_LE(std::abs(free.dot(M * way)), 5e-5 * std::sqrt(free.dot(M * free) * way.dot(M * way))) << weight;  // a gain of 1e-9 is none
    EXPECT_GT(way.norm(), 0.1);
  }
}

// Perturbed by up to `by`, published mechanisms come back: where what is held leaves them no freedom, to where they were.
TEST(Assembler, ClosesPublishedMechanismsFromPerturbedStarts) {
  struct Case {
    const char *name, *held;
    double by;
  };
  for (const Case& c :
       {Case{"andrews", "K1", 0.02}, Case{"andrews", "", 0.02}, Case{"hexapod_free", "", 0.02}, Case{"six_bar", "", 0.05},
        Case{"four_bar_revolute", "", 0.2}, Case{"n_fourbar_40", "", 0.02}, Case{"bricard", "", 0.02}, Case{"bricard", "", 0.1}}) {
    bench_loops::Model bench = bench_loops::read(fmt::format("{}/tests/reference/bench_loops/{}.json", CARDAN_SOURCE_DIR, c.name));
    const auto published = compiled(bench.spec);
    const VectorXd q = published->initial_state().q;
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> uniform(-c.by, c.by);
    VectorXd d = VectorXd::Zero(published->nv), start(published->nq);
    for (const Loop& loop : published->loops.all)
      for (const int v : loop.rates) d[v] = uniform(random);
    for (const UserBody& u : published->user)
      if (u.name == c.held) d.segment(u.v, u.nv).setZero();
    published->retract(q.data(), d.data(), start.data());
    for (const UserBody& u : published->user) {
      HingeSpec& hinge = bench.spec.bodies[static_cast<std::size_t>(&u - published->user.data())].hinge;
      if (u.nq > 0) hinge.q.assign(start.data() + u.q, start.data() + u.q + u.nq);
    }
    bench.spec.assembly.hold.emplace();
    if (*c.held) bench.spec.assembly.hold->push_back(c.held);
    const auto model = compiled(bench.spec);
    EXPECT_LE(open(*model), 1e-8) << c.name;
    VectorXd back(model->nv);
    published->difference(q.data(), model->initial_state().q.data(), back.data());
    EXPECT_LE(back.norm(), *c.held ? 1e-9 : 3.0 * d.norm()) << c.name;
    EXPECT_FALSE(model->loops.moved.empty());
    EXPECT_EQ(model->loops.rank, published->loops.rank) << c.name;
  }
}

// Crank, rod and slider: from a slider on the wrong side the rod is turned the short way, never through the dead centre.
TEST(Assembler, OfASliderCrankEndsWhereItIsInClosedForm) {
  BodySpec crank = on(rigid("crank", 1.0, {0.1, 0, 0}, diagonal({0.002, 0.01, 0.01})), "", "revolute", {{0, 0, 1}});
  BodySpec rod = on(rigid("rod", 1.5, {0.3, 0, 0}, diagonal({0.002, 0.05, 0.05})), "crank", "revolute", {{0, 0, 1}}, {0.2, 0, 0});
  BodySpec slider = on(rigid("slider", 0.7, {0, 0, 0}, diagonal({0.01, 0.01, 0.01})), "", "prismatic", {{1, 0, 0}});
  const double angle = 1.1, rate = 3.0;
  crank.hinge.q = {angle}, crank.hinge.v = {rate};
  SystemSpec spec = system({crank, rod, slider});
  LoopSpec pin;
  pin.name = "pin", pin.type = "point";
  pin.from.body = "slider", pin.to.body = "rod", pin.to.position = {0.6, 0, 0};
  spec.loops = {pin};
  const double b = -std::asin(0.2 * std::sin(angle) / 0.6), x = 0.2 * std::cos(angle) + 0.6 * std::cos(b);
  const double bdot = -0.2 * std::cos(angle) * rate / (0.6 * std::cos(b)), xdot = -0.2 * std::sin(angle) * rate - 0.6 * std::sin(b) * bdot;
  for (const double begin : {0.0, 0.3, -0.9}) {
    if (begin != 0.0) spec.bodies[1].hinge.q = {begin}, spec.assembly.hold = {"crank"};
    const State s = compiled(spec)->initial_state();
    EXPECT_LE(distance(s.q, Eigen::Vector3d(angle, b - angle, x)), 1e-12) << begin;
    EXPECT_LE(distance(s.v, Eigen::Vector3d(rate, bdot - rate, xdot)), 1e-12) << begin;
  }
}

// A body that slides along all axes and turns about y is brought home by each hinge, whose axis turns by 0.9 rad on the way: its rows go
// on as they were, whichever coordinate directions they are the nearest to. At home there is no lever, but what is left of the way.
TEST(Assembler, BringsABodyHomeByEachHinge) {
  using Axes = std::vector<Eigen::Vector3d>;
  const Eigen::Vector3d X(1, 0, 0), Y(0, 1, 0), Z(0, 0, 1), begin(0.1, 0.2, 0.3);
  struct Case {
    const char* type;
    Axes axes;
    Eigen::Vector3d stays;  // 1: along this axis it slides where it is
    double angle;           // where it ends
  };
  for (const auto& [type, axes, stays, angle] :
       {Case{"revolute", {Z}, {0, 0, 0}, 0.0}, Case{"prismatic", {Z}, Z, 0.0}, Case{"cylindrical", {Z}, Z, 0.0},
        Case{"universal", {X, Z}, {0, 0, 0}, 0.0}, Case{"constant_velocity", {X, Z}, {0, 0, 0}, 0.0}, Case{"planar", {X, Y}, X + Y, 0.0},
        Case{"ball", {}, {0, 0, 0}, 0.9}, Case{"point", {}, {0, 0, 0}, 0.9}, Case{"weld", {}, {0, 0, 0}, 0.0}}) {
    SystemSpec spec = system({on(rigid("a", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "translational"),
                              on(rigid("b", 1.0, {0, 0, 0}, diagonal({1e-3, 1e-3, 1e-3})), "a", "revolute", {Y})});
    spec.bodies[0].hinge.q = {begin.x(), begin.y(), begin.z()}, spec.bodies[1].hinge.q = {0.9};
    LoopSpec& home = spec.loops.emplace_back();
    home.name = "home", home.type = type, home.to.body = "b";
    if (!axes.empty()) home.params = along(axes);
    spec.assembly.hold.emplace();
    const VectorXd q = compiled(spec)->initial_state().q;
    EXPECT_LE(distance(q.head(3), stays.cwiseProduct(begin)), 1e-12) << type;
    EXPECT_LE(std::abs(q[3] - angle), 1e-12) << type;
  }
}

std::string told(const SystemSpec& spec) {
  try {
    compiled(spec);
  } catch (const InputError& e) {
    return e.what();
  }
  return "nothing";
}

TEST(Assembler, TellsTheNearestWhereLinksAreTooShort) {
  SystemSpec spec = four_bar();
  spec.loops[0].from.position = {1.5, 0, 0};  // links reach 1.2
  spec.assembly.hold.emplace();
  const std::string text = told(spec);
  EXPECT_NE(text.find("error[C1103]: a loop is not closed at the start\n  at: loops.pivot\n"
                      "  expected: a place of crank.angle, coupler.angle, rocker.angle that closes it\n"
                      "  got:      pivot: row 1, along x -0.3 m"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("begin elsewhere, or hold less"), std::string::npos) << text;
}

// A closure that stands on the hinges of its way, but for the last digit: no distance there is a measure of what is open.
TEST(Assembler, TakesALoopWithoutLeversAsClosed) {
  BodySpec a = on(rigid("a", 3.0, {0.3, 0.1, 0.05}, diagonal({1, 2, 2.5})), "", "ball", {}, {0.3, 0.2, 0.1});
  a.hinge.q = {std::cos(0.4), 0, std::sin(0.4), 0};
  BodySpec b = on(rigid("b", 2.0, {0.3, 0.1, 0.05}, diagonal({1, 2, 2.5})), "a", "universal", {{1, 2, 3}, {2, 0, 1}}, {0.3, 0.2, 0.1});
  b.hinge.pnode_position = {0.3, -0.1, 0.3};
  b.hinge.q = {0.3, -0.7};
  SystemSpec spec = system({a, b}, uniform_gravity({0.3, -0.4, -9.81}));
  Simulation tree(compiled(spec), {});
  LoopSpec again;
  again.name = "again", again.type = "ball";
  again.from.body = "a", again.from.position = {0.3, 0.2, 0.1};
  again.to.body = "b", again.to.position = {0.1 + 0.2, -0.1, 0.3};
  spec.loops = {again};
  for (const LoopForm form : {LoopForm::multipliers, LoopForm::embedding, LoopForm::dae}) {
    spec.loop_form = form;
    Simulation closed(compiled(spec), {});
    EXPECT_LE(distance(closed.vdot(), tree.vdot()), 1e-12);
  }
}

// What loops hold still has no accelerations by which rows that others imply could be measured, in absolute coordinates either.
TEST(Assembler, WhatLoopsHoldStillStandsInEachForm) {
  BodySpec a = on(rigid("a", 3.0, {0.3, 0.1, 0.05}, diagonal({1, 2, 2.5})), "", "ball", {}, {0.3, 0.2, 0.1});
  const BodySpec b = on(rigid("b", 2.0, {0.3, 0.1, 0.05}, diagonal({1, 2, 2.5})), "a", "revolute", {{1, 2, 3}}, {0.3, 0.2, 0.1});
  SystemSpec spec = system({a, b}, uniform_gravity({0.3, -0.4, -9.81}));
  LoopSpec to_world, to_a;
  to_world.name = "to_world", to_world.type = "weld";
  to_world.from.position = {0.3, 0.2, 0.1}, to_world.to.body = "a";
  to_a.name = "to_a", to_a.type = "weld";
  to_a.from.body = "a", to_a.to.body = "b", to_a.to.position = {-0.3, -0.2, -0.1};
  spec.loops = {to_world, to_a};
  for (const LoopForm form : {LoopForm::multipliers, LoopForm::embedding, LoopForm::dae}) {
    spec.loop_form = form;
    Simulation still(compiled(spec), {});
    EXPECT_LE(largest(still.vdot()), 1e-12);
  }
}

TEST(Assembler, RefusesNamesAndWeightsThatThereAreNot) {
  SystemSpec spec = four_bar();
  spec.assembly.hold = {"crnk"};
  spec.assembly.weights["rocker"] = -1.0;
  EXPECT_EQ(told(spec),
            "error[C0208]: unknown name\n"
            "  at: assembly.hold[0]\n"
            "  expected: a hinge that moves, or a component of one\n"
            "  got:      \"crnk\"\n"
            "  hint:     did you mean \"crank\"?\n\n"
            "error[C0301]: value out of range\n"
            "  at: assembly.weights.rocker\n"
            "  expected: a finite number > 0\n"
            "  got:      -1\n\n2 errors. Nothing was run.\n");
}

/// Two free flyers that a loop joins: in orbit its ends are known to the rounding of their places, and the run says so; on one tree, or
/// near the origin, it does not.
TEST(LoopsOfFreeFlyers, FarFromTheOriginAreToldOf) {
  const auto told = [](double away, const char* inboard) {
    SystemSpec spec = system({on(rigid("chaser", 20.0, {0, 0, 0}, diagonal({2, 3, 4})), "", "free"),
                              on(rigid("target", 50.0, {0, 0, 0}, diagonal({5, 6, 7})), inboard, "free")});
    spec.bodies[0].hinge.q = {1, 0, 0, 0, away, 0, 0};
    spec.bodies[1].hinge.q = {1, 0, 0, 0, (*inboard ? 0.0 : away) + 2.0, 0, 0};
    LoopSpec& grip = spec.loops.emplace_back();
    grip.name = "grip", grip.type = "ball", grip.from.body = "chaser", grip.to.body = "target";
    grip.from.position = {1, 0, 0}, grip.to.position = {-1, 0, 0};
    Simulation sim(compiled(spec), {});
    sim.run(0.01);
    return std::ranges::count_if(sim.warnings().all(), [](const Warning& w) {
      return w.what.code == Code::unusual_value && w.what.at.key_path == "loops.grip" && w.what.hint.starts_with("chaser and target");
    });
  };
  EXPECT_EQ(told(6.9e6, ""), 1);
  EXPECT_EQ(told(1000.0, ""), 0);
  EXPECT_EQ(told(6.9e6, "chaser"), 0);
}

}  // namespace
}  // namespace cardan::test
