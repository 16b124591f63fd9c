// Mechanisms with closed loops in closed form or by equations of their own, each a vehicle as an engineer writes it, in the file of its
// case.
#include <cmath>
#include <numbers>

#include "bodies/vehicle/load_vehicle.hpp"
#include "core/model/components.hpp"
#include "core/sim/rejoin.hpp"
#include "tests/cases/published.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

SystemSpec vehicle_of(const Published& ref, LoopForm form = LoopForm::automatic) {
  SystemSpec spec = vehicle_from_text(ref.model()["vehicle"].as<std::string>(), case_at_hand(), registry());
  make_modes(spec);
  spec.loop_form = form;
  return spec;
}

/// Runs `then` by the two forms that sweep, each with the words that its rows begin with.
template <class F>
void by_both_forms(const Published& ref, const F& then) {
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers})
    then(vehicle_of(ref, form), std::string(form == LoopForm::embedding ? "embedded: " : "multipliers: "));
}

int component(const Simulation& sim, const std::string& name) { return components_of(sim.model(), name).at(0); }
double rate_of(const Simulation& sim, const std::string& name) { return sim.state().v[component(sim, name)]; }
/// Of a hinge without quaternion, in a vehicle where none stands before it.
double place_of(const Simulation& sim, const std::string& name) {
  const UserBody& u = sim.model().user[static_cast<std::size_t>(sim.model().find_body(name.substr(0, name.find('.'))))];
  return sim.state().q[u.q + component(sim, name) - u.v];
}
Vector3d node(Simulation& sim, const std::string& name) { return sim.observe().node(sim.model().find_node(name)).position; }
/// Moment and force of the only loop on its end `to`, axes of `from`.
Eigen::Matrix<double, 6, 1> push_of(Simulation& sim, int loop = 0) {
  const LoopForces f = sim.loop_forces();
  const Loop& l = sim.model().loops.all[static_cast<std::size_t>(loop)];
  Force<double> sum{};
  for (int i = l.first; i < l.first + l.rows; ++i) sum += f.multipliers[static_cast<std::size_t>(i)] * f.unit[static_cast<std::size_t>(i)];
  Eigen::Matrix<double, 6, 1> out;
  out << to_eigen(sum.n), to_eigen(sum.f);
  return out;
}

/// When the input of a mechanism of one degree of freedom comes to its last place, and its rate then; `there` looks at the rest.
void expect_passage(const Published& ref, const std::function<void(Simulation&, const std::string&)>& there) {
  const auto input = ref.model()["input"].as<std::string>();
  const double end = ref.model()["input_at_the_end"].as<double>(), tolerance = ref.tolerance("rel");
  by_both_forms(ref, [&](const SystemSpec& spec, const std::string& by) {
    const auto sim = run_of(spec, "dop853", 1e-12);
    const UserBody& u = sim->model().user[static_cast<std::size_t>(sim->model().find_body(input))];
    double rate = 0.0;
    const auto times = crossings(
        *sim, 0, [end, q = u.q](const double* x, const double*) { return x[q] - end; },
        [&] { rate = sim->state().v[u.v], there(*sim, by); });
    sim->run(1.001 * ref.number("time"));
    ASSERT_EQ(times->size(), 1u) << by;
    expect_relative(by + "time", times->front(), ref.number("time"), tolerance);
    expect_relative(by + "rate", rate, ref.number("rate"), tolerance);
  });
}

TEST(DoubleCardan, TurnsItsSecondShaftAsTheFirst) {
  const Published ref("loop-double-cardan");
  expect_passage(ref, [&](Simulation& sim, const std::string& by) {
    const double apart = std::abs(place_of(sim, "out") - place_of(sim, "inp"));
    expect_within(by + "shafts apart", worse(apart, std::abs(rate_of(sim, "out") - rate_of(sim, "inp"))), ref.tolerance("apart_rad"));
  });
}

// Nothing accelerates at the start: what rows that are left out lack is rounding of centripetal accelerations alone.
TEST(DoubleCardan, TurnsInAbsoluteCoordinates) {
  const Published ref("loop-double-cardan");
  const auto embedded = run_of(vehicle_of(ref, LoopForm::embedding)), absolute = run_of(vehicle_of(ref, LoopForm::dae), "ida", 1e-7);
  embedded->run(0.1), absolute->run(0.1);
  expect_within("by ida: rates apart", (absolute->state().v - embedded->state().v).lpNorm<Eigen::Infinity>(), 1e-3);
}

TEST(ScotchYoke, TurnsBackWhereItsRowHoldsNothing) {
  const Published ref("loop-scotch-yoke");
  expect_passage(ref, [&](Simulation& sim, const std::string& by) {
    expect_relative(by + "place of the yoke", place_of(sim, "yoke"), ref.number("place of the yoke"), ref.tolerance("rel"));
  });
}

TEST(Sarrus, FallsAlongAStraightLine) {
  const Published ref("loop-sarrus");
  expect_passage(ref, [&](Simulation& sim, const std::string& by) {
    const Vector3d top = node(sim, "top");
    expect_relative(by + "height of the platform", top.z(), ref.number("height of the platform"), ref.tolerance("rel"));
    expect_within(by + "off the line", top.head<2>().norm(), ref.tolerance("line_m"));
  });
}

TEST(SphericalFourBar, TurnsAboutAxesThroughOnePoint) {
  const Published ref("loop-spherical-four-bar");
  expect_passage(ref, [&](Simulation& sim, const std::string& by) {
    expect_relative(by + "angle of the output", place_of(sim, "out"), ref.number("angle of the output"), ref.tolerance("rel"));
  });
}

TEST(Roberval, DoesNotCareWhereItsWeightsLie) {
  expect_passage(Published("loop-roberval"), [](Simulation&, const std::string&) {});
}

TEST(ScissorsMast, FoldsUnderItsWeight) {
  const Published ref("loop-scissors-mast");
  expect_passage(ref, [&](Simulation& sim, const std::string& by) {
    expect_relative(by + "height", node(sim, "p2.top").y(), ref.number("height"), ref.tolerance("rel"));
  });
}

TEST(Oldham, TurnsItsSecondShaftAsTheFirst) {
  const Published ref("loop-oldham");
  by_both_forms(ref, [&](const SystemSpec& spec, const std::string& by) {
    const auto sim = run_of(spec, "dop853", 1e-12);
    sim->set_force(component(*sim, "a"), ref.model()["torque_Nm"].as<double>());
    sim->run(ref.model()["end_s"].as<double>());
    const double abs = ref.tolerance("abs");
    expect_absolute(by + "angle of the second", place_of(*sim, "b"), ref.number("angle of the second"), abs);
    expect_absolute(by + "rate of the second", rate_of(*sim, "b"), ref.number("rate of the second"), abs);
    expect_absolute(by + "place of the disc", place_of(*sim, "disc"), ref.number("place of the disc"), abs);
    expect_absolute(by + "torque on the second", push_of(*sim)[2], ref.number("torque on the second"), abs);
  });
}

TEST(PlanetaryGears, AccelerateWithTheRatiosOfWillis) {
  const Published ref("loop-planetary-gears");
  by_both_forms(ref, [&](const SystemSpec& spec, const std::string& by) {
    const auto sim = run_of(spec, "dop853", 1e-12);
    sim->set_force(component(*sim, "sun"), ref.model()["torque_on_the_sun_Nm"].as<double>());
    sim->set_force(component(*sim, "car"), ref.model()["torque_on_the_carrier_Nm"].as<double>());
    sim->run(ref.model()["end_s"].as<double>());
    for (const auto& [name, what] : {std::pair("sun", "rate of the sun"),
                                     {"car", "rate of the carrier"},
                                     {"ring", "rate of the ring"},
                                     {"p1", "rate of a planet on the carrier"}})
      expect_relative(by + what, rate_of(*sim, name), ref.number(what), ref.tolerance("rel"));
    const int ring = sim->model().loops.find("r1");
    const double force =
        sim->loop_forces().multipliers[static_cast<std::size_t>(sim->model().loops.all[static_cast<std::size_t>(ring)].first)];
    expect_relative(by + "force at the ring", force, ref.number("force at the ring"), ref.tolerance("rel"));
  });
}

TEST(HexapodLegs, CarryTheirPlatformAsItRises) {
  const Published ref("loop-hexapod-legs");
  by_both_forms(ref, [&](SystemSpec spec, const std::string& by) {
    const double amplitude = ref.model()["amplitude_m"].as<double>(), frequency = ref.model()["frequency_Hz"].as<double>();
    const double speed = 2.0 * std::numbers::pi * frequency * amplitude * spec.loops[0].length / spec.bodies[0].hinge.q.back();
    spec.bodies[0].hinge.v = {0, 0, 0, 0, 0, speed};
    const auto sim = run_of(spec, "dop853", 1e-12);
    for (int leg = 0; leg < 6; ++leg) sim->prescribe_loop(fmt::format("leg{}", leg), MotionProfile::sine(amplitude, frequency, 0.0));
    sim->run(ref.model()["end_s"].as<double>());
    expect_absolute(by + "height", node(*sim, "top").z(), ref.number("height"), ref.tolerance("abs"));
    for (int leg = 0; leg < 6; ++leg)
      expect_absolute(fmt::format("{}force of strut {}", by, leg), sim->loop_forces().multipliers[static_cast<std::size_t>(leg)],
                      ref.number("force of a strut"), 100.0 * ref.tolerance("abs"));
  });
}

TEST(BifilarPendulum, TurnsAndRises) {
  const Published ref("loop-bifilar");
  by_both_forms(ref, [&](const SystemSpec& spec, const std::string& by) {
    const auto sim = run_of(spec, "dop853", 1e-12);
    sim->run(ref.number("quarter of the period"));
    expect_absolute(by + "angle at the quarter", 2.0 * std::atan2(sim->state().q[3], sim->state().q[0]), 0.0, ref.tolerance("abs"));
    expect_absolute(by + "rate", sim->state().v[2], ref.number("rate"), ref.tolerance("abs"));
    expect_absolute(by + "force of a string", sim->loop_forces().multipliers[0], ref.number("force of a string"), ref.tolerance("abs"));
  });
}

TEST(FlexibleSliderCrank, BendsAsItsPointsDo) {
  const Published ref("loop-flexible-slider-crank");
  by_both_forms(ref, [&](const SystemSpec& spec, const std::string& by) {
    const auto sim = run_of(spec, "dop853", 1e-12);
    sim->run(ref.model()["end_s"].as<double>());
    const UserBody& rod = sim->model().user[static_cast<std::size_t>(sim->model().find_body("rod"))];
    VectorXd ours(6), theirs(6);
    ours << place_of(*sim, "crank"), rate_of(*sim, "crank"), place_of(*sim, "piston"), sim->state().q[rod.eta], sim->state().q[rod.eta + 1],
        std::abs(push_of(*sim)[4]);
    const char* const names[] = {"angle of the crank", "rate of the crank", "place of the piston",
                                 "first mode",         "second mode",       "force across"};
    for (int i = 0; i < 6; ++i) expect_absolute(by + names[i], ours[i], ref.number(names[i]), ref.tolerance("rel"));
  });
}

TEST(Ladder, LeavesTheWallWhereItPushesNoMore) {
  const Published ref("event-ladder");
  by_both_forms(ref, [&](const SystemSpec& spec, const std::string& by) {
    const auto sim = run_of(spec, "dop853", 1e-12);
    SystemSpec off = spec;
    off.loops[0].open = true;
    double rate = 0.0, push = 0.0, flat_rate = 0.0, speed = 0.0;
    const double leaves = ref.number("angle where it leaves");
    const auto left = crossings(
        *sim, 1, [=](const double* q, const double*) { return q[2] - leaves; },
        [&] {
          if (rate != 0.0) return;
          rate = sim->state().v[2], push = push_of(*sim).norm();
          sim->adopt([&] { return rejoin(*sim, off, registry(), {}); }, "off the wall");
        });
    const auto flat = crossings(
        *sim, 1, [](const double* q, const double*) { return q[2] - 0.5 * std::numbers::pi; },
        [&] { flat_rate = sim->state().v[2], speed = sim->state().v[0]; });
    sim->run(1.001 * ref.number("time when flat"));
    ASSERT_FALSE(left->empty() || flat->empty());
    const double rel = ref.tolerance("rel");
    expect_relative(by + "time where it leaves", left->front(), ref.number("time there"), rel);
    expect_relative(by + "rate there", rate, ref.number("rate there"), rel);
    expect_within(by + "push there", push, ref.tolerance("push_N"));
    expect_relative(by + "time when flat", flat->front(), ref.number("time when flat"), rel);
    expect_relative(by + "rate when flat", flat_rate, ref.number("rate when flat"), rel);
    expect_relative(by + "speed of the middle along the floor", speed, ref.number("speed of the middle"), rel);
  });
}

TEST(GenevaDrive, LeadsItsWheelForAQuarterTurn) {
  const Published ref("event-geneva");
  by_both_forms(ref, [&](const SystemSpec& spec, const std::string& by) {
    const auto sim = run_of(spec, "dop853", 1e-12);
    SystemSpec led = spec;
    led.loops[0].open = false, led.bodies[1].hinge.locked = false;
    const double enters = ref.number("angle where the pin enters");
    const auto driver = [](double at) { return [at](const double* q, const double*) { return q[0] - at; }; };
    double in_the_middle = 0.0, wheel = 0.0, left = 0.0;
    crossings(*sim, 1, driver(enters), [&] { sim->adopt([&] { return rejoin(*sim, led, registry(), {}); }, "led"); });
    crossings(*sim, 1, driver(0.0), [&] { in_the_middle = sim->state().v[0], wheel = sim->state().v[1]; });
    crossings(*sim, 1, driver(-enters), [&] {
      left = sim->time();
      expect_absolute(by + "angle of the wheel after it", sim->state().q[1], ref.number("angle of the wheel after it"),
                      ref.tolerance("rel"));
      sim->adopt([&] { return rejoin(*sim, spec, registry(), {}); }, "locked");
    });
    sim->run(1.1 * ref.number("time when it leaves"));
    const double rel = ref.tolerance("rel");
    expect_relative(by + "time when the pin leaves", left, ref.number("time when it leaves"), rel);
    expect_relative(by + "rate of the driver in the middle", in_the_middle, ref.number("rate of the driver in the middle"), rel);
    expect_relative(by + "rate of the wheel in the middle", wheel, ref.number("rate of the wheel in the middle"), rel);
    expect_relative(by + "rate of the driver after it", sim->state().v[0], ref.number("rate of the driver after it"), rel);
  });
}

}  // namespace
}  // namespace cardan::test
