// Mechanisms in absolute coordinates carried through time by IDA, against the forms that know no differential-algebraic system: the closer
// the smaller the tolerance.
#include <gtest/gtest.h>

#include <numbers>

#include "core/dynamics/loops.hpp"
#include "core/sim/simulation.hpp"
#include "tests/cases/andrews.hpp"
#include "tests/support/four_bar.hpp"
#include "tests/support/modal_samples.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::VectorXd;

struct DaeScene {
  SystemSpec spec;
  double span;
  std::function<void(Simulation&)> set_up = [](Simulation&) {};
};

std::unique_ptr<Simulation> run_by(const DaeScene& scene, LoopForm form, const std::string& method, double tolerance) {
  SystemSpec spec = scene.spec;
  spec.loop_form = form;
  SimulationOptions options;
  options.integrator.method = method, options.integrator.relative_tolerance = tolerance;
  auto sim = std::make_unique<Simulation>(compiled(spec), options);
  scene.set_up(*sim);
  sim->run(scene.span);
  return sim;
}

VectorXd state_of(const Simulation& sim) {
  VectorXd x(sim.state().q.size() + sim.state().v.size());
  x << sim.state().q, sim.state().v;
  return x;
}
VectorXd multipliers_of(Simulation& sim) {
  const LoopForces f = sim.loop_forces();
  return VectorXd::Map(f.multipliers.data(), static_cast<Eigen::Index>(f.multipliers.size()));
}

/// Errors of states and of multipliers at the end, relative to their largest, at 1e-5 and 1e-9; rows closed, energy as its tolerance has
/// it.
void expect_the_same_motion(const DaeScene& scene, double coarse, double fine) {
  const auto wanted = run_by(scene, LoopForm::automatic, "dop853", 1e-12);
  const VectorXd x = state_of(*wanted), lambda = multipliers_of(*wanted);
  double before = 0.0;
  for (const auto& [tolerance, allowed] : {std::pair(1e-5, coarse), std::pair(1e-9, fine)}) {
    const auto sim = run_by(scene, LoopForm::dae, "ida", tolerance);
    EXPECT_EQ(sim->integrator_name(), "ida");
    const double error = (state_of(*sim) - x).lpNorm<Eigen::Infinity>() / x.lpNorm<Eigen::Infinity>();
    EXPECT_LE(error, allowed) << tolerance;
    EXPECT_LE((multipliers_of(*sim) - lambda).lpNorm<Eigen::Infinity>(), 1e3 * allowed * lambda.lpNorm<Eigen::Infinity>()) << tolerance;
    if (tolerance == 1e-9) {
      EXPECT_LT(error, 0.03 * before);
    }
    before = error;
    for (const double c : sim->loop_forces().residual) EXPECT_LE(std::abs(c), 1e-13);
    for (const double rate : sim->loop_forces().rate) EXPECT_LE(std::abs(rate), 1e-12 * x.lpNorm<Eigen::Infinity>());
    EXPECT_TRUE(sim->ledger().pass) << sim->ledger().energy_relative << " of " << sim->ledger().energy_limit;
  }
}

SystemSpec bench_spec(const std::string& name) {
  return bench_loops::read(CARDAN_SOURCE_DIR "/tests/reference/bench_loops/" + name + ".json").spec;
}

TEST(DaeInTime, AFourBarMovesAsTheOtherFormsHaveIt) { expect_the_same_motion({four_bar(), 1.0}, 1e-3, 1e-6); }

// Two rows of the second are implied by the others.
TEST(DaeInTime, AFourBarOfHingesLeavesRedundantRowsOut) { expect_the_same_motion({four_bar("revolute"), 1.0}, 1e-3, 1e-6); }

TEST(DaeInTime, AndrewsSqueezerMovesAsTheOtherFormsHaveIt) {
  expect_the_same_motion({andrews_squeezer(), 0.01, [](Simulation& sim) { sim.set_force(0, kAndrewsTorque); }}, 1e-2, 1e-5);
}

// Mobility where counting gives none, whatever the posture.
TEST(DaeInTime, BricardsMechanismNeedsNoRegularisation) { expect_the_same_motion({bench_spec("bricard"), 0.5}, 1e-3, 1e-6); }

/// Of another size the same, with the same angles: lengths, weight and inertia as they follow.
SystemSpec slider_crank(double size = 1.0) {
  const auto J = [&](double x, double y, double z) { return diagonal({size * size * x, size * size * y, size * size * z}); };
  BodySpec crank = on(rigid("crank", 1.0, {0.1 * size, 0, 0}, J(0.002, 0.01, 0.01)), "", "revolute", {{0, 0, 1}});
  crank.hinge.q = {0.7}, crank.hinge.v = {6.0};
  BodySpec rod = on(rigid("rod", 0.8, {0.25 * size, 0, 0}, J(0.001, 0.02, 0.02)), "crank", "revolute", {{0, 0, 1}}, {0.2 * size, 0, 0});
  BodySpec slider = on(rigid("slider", 1.5, Eigen::Vector3d::Zero(), J(0.01, 0.01, 0.01)), "", "prismatic", {{1, 0, 0}});
  slider.hinge.q = {0.6 * size};
  SpringDamper spring;
  spring.stiffness = 200.0, spring.rest = 0.5 * size, spring.damping = 2.0;
  slider.hinge.springs = {spring};
  SystemSpec spec = system({crank, rod, slider}, uniform_gravity({0, -9.81 * size, 0}));
  LoopSpec pin;
  pin.name = "pin", pin.type = "point", pin.from.body = "slider", pin.to.body = "rod", pin.to.position = {0.5 * size, 0, 0};
  spec.loops = {pin};
  spec.assembly.hold = std::vector<std::string>{"crank"};
  return spec;
}
TEST(DaeInTime, ASliderCrankMovesAsTheOtherFormsHaveIt) { expect_the_same_motion({slider_crank(), 1.0}, 1e-3, 1e-6); }

// What multipliers are asked for, and how places are drawn together, follows from the inertia of what they move: a crank of a millimetre
// takes the steps of one of a metre, and turns as it does, as far as 1e-8 m tell: 5e-5 rad of the smallest.
TEST(DaeInTime, AMechanismOfAnySizeTakesTheSameSteps) {
  const auto of = [](double size) { return run_by({slider_crank(size), 0.5}, LoopForm::dae, "ida", 1e-8); };
  const auto metre = of(1.0);
  for (const double size : {0.1, 0.01, 1e-3}) {
    const auto sim = of(size);
    EXPECT_LE(std::abs(sim->state().q[0] - metre->state().q[0]), 1e-3) << size;
    EXPECT_LE(sim->statistics().steps, 2 * metre->statistics().steps) << size;
  }
}

// Nor does it matter much how fast it turns: multipliers are asked for as finely as the velocities, whose tolerances grow with them. With
// absolute ones alone a given crank of 1500 rad/s took twelve times the steps of one of 15 rad/s for the same turns.
TEST(DaeInTime, AMechanismOfAnySpeedTakesStepsOfTheSameAngle) {
  const auto of = [](double speed) {
    SystemSpec spec = slider_crank();
    spec.gravity = {};
    spec.bodies[0].hinge.v = {speed}, spec.bodies[0].hinge.prescribed = {0};
    spec.bodies[2].hinge.springs.clear();
    return run_by({spec, 15.0 / speed}, LoopForm::dae, "ida", 1e-9)->statistics().steps;
  };
  EXPECT_LE(of(1500.0), 3 * of(15.0));
}

// A given crank, a gear and a length that changes with time: rows of each kind. The bob is free.
TEST(DaeInTime, GivenMotionsAndCouplingsAreRows) {
  DaeScene scene{slider_crank(), 1.0};
  scene.spec.bodies[0].hinge.prescribed = {0};
  BodySpec wheel = on(rigid("wheel", 0.4, {0, 0.02, 0}, diagonal({0.003, 0.003, 0.005})), "", "revolute", {{0, 0, 1}}, {0, 0, 0.2});
  BodySpec idle = on(rigid("idle", 0.4, {0.1, 0.02, 0}, diagonal({0.003, 0.003, 0.005})), "", "revolute", {{0, 0, 1}}, {1.0, 0, 0});
  BodySpec bob = on(rigid("bob", 0.3, {0, -0.2, 0}, diagonal({0.002, 0.001, 0.002})), "rod", "revolute", {{0, 0, 1}}, {0.25, 0, 0});
  scene.spec.bodies.insert(scene.spec.bodies.end(), {wheel, idle, bob});
  LoopSpec gear;
  gear.name = "gear", gear.type = "coupling", gear.terms = {{"wheel", 3.0, {}}, {"slider", 40.0, {}}}, gear.offset = 40.0 * 0.6;
  LoopSpec jack;
  jack.name = "jack", jack.type = "distance", jack.from.position = {1.0, 1.0, 0}, jack.to.body = "idle", jack.to.position = {0.4, 0, 0};
  jack.length = 1.0, jack.prescribed = true;
  scene.spec.loops.push_back(gear), scene.spec.loops.push_back(jack);
  scene.set_up = [](Simulation& sim) {
    sim.prescribe(0, MotionProfile::rate_table({{0.0, 6.0}, {0.4, 2.0}, {2.0, 2.0}}));
    sim.prescribe_loop("jack", MotionProfile::rate_table({{0.0, 0.0}, {0.5, 0.3}, {2.0, 0.3}}));
  };
  expect_the_same_motion(scene, 1e-3, 1e-6);
}

// A governor turns, and its arms fly out against gravity.
SystemSpec governor() {
  BodySpec shaft = on(rigid("shaft", 2.0, {0, 0, 0.3}, diagonal({0.05, 0.05, 0.02})), "", "revolute", {{0, 0, 1}});
  shaft.hinge.v = {9.0};
  BodySpec slider = on(rigid("slider", 0.5, Eigen::Vector3d::Zero(), diagonal({0.002, 0.002, 0.003})), "shaft", "prismatic", {{0, 0, 1}});
  slider.hinge.q = {0.2};
  std::vector<BodySpec> bodies{shaft, slider};
  SystemSpec spec = system({}, uniform_gravity({0, 0, -9.81}));
  for (const double side : {1.0, -1.0}) {
    const std::string of = side > 0 ? "right" : "left";
    BodySpec arm = on(rigid(of + "_arm", 1.0, {side * 0.3, 0, 0}, diagonal({0.002, 0.02, 0.02})), "shaft", "revolute", {{0, 1, 0}},
                      {side * 0.05, 0, 0.6});
    arm.hinge.q = {side * 0.9};
    BodySpec link = on(rigid(of + "_link", 0.2, {side * 0.1, 0, 0}, diagonal({0.0002, 0.002, 0.002})), of + "_arm", "revolute", {{0, 1, 0}},
                       {side * 0.2, 0, 0});
    LoopSpec pin;
    pin.name = of, pin.type = "point", pin.from.body = "slider", pin.from.position = {side * 0.05, 0, 0};
    pin.to.body = of + "_link", pin.to.position = {side * 0.3, 0, 0};
    bodies.push_back(arm), bodies.push_back(link);
    spec.loops.push_back(pin);
  }
  spec.bodies = bodies;
  spec.assembly.hold = std::vector<std::string>{"shaft", "right_arm", "left_arm"};
  return spec;
}
TEST(DaeInTime, AGovernorMovesAsTheOtherFormsHaveIt) { expect_the_same_motion({governor(), 0.5}, 1e-3, 1e-6); }

// A coupler that bends, on a crank of two of its modes.
TEST(DaeInTime, LinksThatBendMoveAsTheOtherFormsHaveThem) {
  SystemSpec spec = four_bar();
  BodySpec boom = on(BodySpec(), "coupler", "revolute", {{0, 0, 1}}, {0.3, 0.05, 0});
  boom.name = "boom", boom.type = "modal_flexible", boom.level = 1;
  boom.modal = std::make_shared<const ModalData>(lumped());
  spec.bodies.push_back(boom);
  expect_the_same_motion({spec, 0.3}, 1e-2, 1e-5);
}

// Errors of fast modes are asked for by the square of their frequency, more finely than the places of a loop that holds one are known:
// the first steps became too small.
TEST(DaeInTime, AStiffLinkInALoopMovesAsTheOtherFormsHaveIt) {
  BodySpec boom = on(BodySpec(), "", "revolute", {{0, 0, 1}});
  boom.name = "boom", boom.type = "modal_flexible", boom.level = 1;
  BodySpec crank = on(rigid("crank", 1.0, {0.1, 0, 0}, diagonal({0.002, 0.01, 0.01})), "", "revolute", {{0, 0, 1}}, {1.0, 0, 0});
  LoopSpec rod;
  rod.name = "rod", rod.type = "distance", rod.from.body = "crank", rod.from.position = {0.3, 0, 0};
  rod.to.body = "boom", rod.to.node = "tip", rod.length = 1.3;
  for (const auto& [stiffer, tolerance] : {std::pair(1e6, 1e-9), std::pair(1e3, 1e-11)}) {
    ModalData stiff = lumped();
    stiff.K *= stiffer, stiff.C *= std::sqrt(stiffer);
    boom.modal = std::make_shared<const ModalData>(stiff);
    SystemSpec spec = system({boom, crank}, uniform_gravity({0.5, -9.81, 0}));
    spec.loops = {rod};
    DaeScene scene{spec, 0.02};
    const VectorXd wanted = state_of(*run_by(scene, LoopForm::automatic, "dop853", 1e-12));
    const auto sim = run_by(scene, LoopForm::dae, "ida", tolerance);
    EXPECT_LE(sim->statistics().steps, 2000) << tolerance;
    EXPECT_LE((state_of(*sim) - wanted).lpNorm<Eigen::Infinity>(), 1e3 * tolerance * wanted.lpNorm<Eigen::Infinity>()) << tolerance;
  }
}

// A slide that weighs next to nothing bears the weight of all: its own inertia says nothing of how finely these multipliers are known, nor
// of how places are drawn together.
TEST(DaeInTime, ALightSlideBearsHeavyLinks) {
  SystemSpec spec = slider_crank();
  BodySpec slide = on(rigid("slide", 1e-9, Eigen::Vector3d::Zero(), diagonal({1e-9, 1e-9, 1e-9})), "", "prismatic", {{0, 1, 0}});
  spec.bodies[0].hinge.inboard_body = "slide";
  spec.bodies.insert(spec.bodies.begin(), slide);
  expect_the_same_motion({spec, 0.5}, 1e-2, 1e-5);
}

// Places that a distance holds may be off by their own tolerance, not by that of velocities as so many metres: 2 km apart, or far from the
// origin, these are finer than places are known (order 1, 382,584 steps).
TEST(DaeInTime, ALongDistanceTakesTheStepsOfItsMotion) {
  for (const double place : {0.0, 7e6}) {
    BodySpec one = on(rigid("one", 50.0, Eigen::Vector3d::Zero(), diagonal({10, 10, 10})), "", "free");
    one.hinge.q = {1, 0, 0, 0, place, 0, 0}, one.hinge.v = {0, 0, 0, 0, 1, 0};
    BodySpec other = on(rigid("other", 5.0, Eigen::Vector3d::Zero(), diagonal({1, 1, 1})), "", "free");
    other.hinge.q = {1, 0, 0, 0, place + 2000.0, 0, 0}, other.hinge.v = {0, 0, 0, 0, 3, 0};
    LoopSpec line;
    line.name = "line", line.type = "distance", line.from.body = "one", line.to.body = "other", line.length = 2000.0;
    SystemSpec spec = system({one, other});
    spec.loops = {line}, spec.loop_form = LoopForm::dae;
    SimulationOptions options;
    options.integrator.method = "ida", options.integrator.relative_tolerance = 1e-9, options.absolute_tolerance = 1e-8;
    Simulation sim(compiled(spec), options);
    sim.run(600.0);
    EXPECT_LE(sim.statistics().steps, 1000) << place;
  }
}

// Without loops there are the rows of hinges; a body that flies has none. Quaternions keep their norm.
TEST(DaeInTime, AnOpenTreeMovesAsTheSweepsHaveIt) {
  BodySpec bus = on(rigid("bus", 4.0, {0.1, 0, 0.05}, diagonal({0.4, 0.7, 0.9})), "", "free");
  bus.hinge.v = {0.5, 2.0, 0.3, 0.1, 0.2, -0.1};
  BodySpec arm = on(rigid("arm", 1.0, {0.3, 0, 0}, diagonal({0.01, 0.05, 0.05})), "bus", "universal", {{0, 0, 1}, {0, 1, 0}}, {0.5, 0, 0});
  arm.hinge.v = {1.0, -0.5};
  BodySpec ball = on(rigid("ball", 0.5, {0, 0.2, 0}, diagonal({0.01, 0.02, 0.02})), "arm", "ball", {}, {0.6, 0, 0});
  ball.hinge.v = {0.4, -2.0, 1.0};
  expect_the_same_motion({system({bus, arm, ball}), 1.0}, 1e-3, 1e-6);
}

// A particle has no inertia about itself: rows alone hold its turn. Two on strings, a double pendulum in space.
TEST(DaeInTime, ParticlesMoveAsTheOtherFormsHaveThem) {
  SystemSpec spec = system({}, uniform_gravity({0, 0, -9.81}));
  const auto hang = [&](const std::string& name, double mass, const std::string& on_what, double length) {
    BodySpec body = on(particle(name, mass, Eigen::Vector3d::Zero()), "", "translational");
    body.hinge.q = {spec.bodies.empty() ? length : spec.bodies.back().hinge.q[0] + length, 0.0, 0.0};
    body.hinge.v = {0.0, 0.8, 0.0};
    spec.bodies.push_back(body);
    LoopSpec string;
    string.name = name + "_string", string.type = "distance", string.length = length;
    string.from.body = on_what, string.to.body = name;
    spec.loops.push_back(string);
  };
  hang("upper", 2.0, "", 0.7);
  hang("lower", 0.3, "upper", 0.4);
  expect_the_same_motion({spec, 0.6}, 1e-3, 1e-6);
}

// The moment across the axes of a universal hinge turns with the first; its row is the one that it was, whichever coordinate direction is
// the nearest (at 1e-3 rad from zero another came first: Newton's method found no way across).
TEST(DaeInTime, RowsThatTurnStayWhatTheyWere) {
  Eigen::Matrix3d J = Eigen::Vector3d(0.4, 0.5, 0.6).asDiagonal();
  J(0, 1) = J(1, 0) = 0.05;
  const BodySpec bob = on(rigid("bob", 2.0, {0.1, 0.2, -0.3}, J), "", "universal", {{1, 0, 0}, {0, 1, 0}});
  DaeScene scene{system({bob}, uniform_gravity({0.5, 0.3, -9.81})), 3.0};
  expect_the_same_motion(scene, 1e-3, 1e-6);
  scene.spec.bodies[0].hinge.v = {9.0, 2.0};  // over the top
  expect_the_same_motion(scene, 1e-2, 1e-5);
}

// The energy of a closed mechanism on which nothing acts drifts as the tolerance says.
TEST(DaeInTime, EnergyDriftsWithTheTolerance) {
  DaeScene scene{four_bar(), 3.0};
  scene.spec.gravity = {};
  double before = 0.0;
  for (const double tolerance : {1e-6, 1e-9}) {
    const auto sim = run_by(scene, LoopForm::dae, "ida", tolerance);
    const double at_start = compiled(scene.spec) ? Simulation(compiled(scene.spec), {}).energy().total() : 0.0;
    const double drift = std::abs(sim->energy().total() - at_start) / at_start;
    EXPECT_LE(drift, 1e5 * tolerance);
    if (tolerance == 1e-9) {
      EXPECT_LT(drift, 0.1 * before);
    }
    before = drift;
  }
}

// Any method advances (q, v) by the accelerations of this form.
TEST(DaeInTime, OtherMethodsTakeItsAccelerations) {
  const DaeScene scene{four_bar(), 0.5};
  const VectorXd a = state_of(*run_by(scene, LoopForm::dae, "dop853", 1e-11)),
                 b = state_of(*run_by(scene, LoopForm::automatic, "dop853", 1e-11));
  EXPECT_LE((a - b).lpNorm<Eigen::Infinity>(), 1e-10 * b.lpNorm<Eigen::Infinity>());
}

// A crank that is released by an event goes on as if it had been so from there; what was before is history of the integrator, which starts
// anew, also at a checkpoint: with the same bits.
TEST(DaeInTime, GoesOnFromACheckpointWithTheSameBits) {
  const auto begin = [] {
    SystemSpec spec = slider_crank();
    spec.loop_form = LoopForm::dae;
    SimulationOptions options;
    options.integrator.method = "ida", options.integrator.relative_tolerance = 1e-7;
    auto sim = std::make_unique<Simulation>(compiled(spec), options);
    Simulation& s = *sim;
    sim->add_event({"far", [](double, const double* q, const double*) { return q[2] - 0.55; }, 0,
                    [&s] { s.set_force(0, s.force(0) == 0.0 ? -0.4 : 0.0); }});
    return sim;
  };
  const auto whole = begin();
  Checkpoint made;
  whole->every({1, 4},
               [&] {
                 if (whole->time() == 0.5)
                   made = whole->checkpoint();
                 else
                   whole->checkpoint();
               },
               {1, 4});
  whole->run(1.0);
  const auto rest = begin();
  rest->every({1, 4}, [&] { rest->checkpoint(); }, {1, 4});
  rest->resume(made);
  rest->run(1.0);
  EXPECT_EQ(state_of(*rest), state_of(*whole));
  EXPECT_EQ(rest->statistics().steps, whole->statistics().steps);
  EXPECT_EQ(rest->ledger().energy, whole->ledger().energy);
}

}  // namespace
}  // namespace cardan::test
