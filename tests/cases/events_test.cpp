// Published cases of blows and of friction that changes its sign.
#include <cmath>
#include <limits>
#include <numbers>

#include "tests/cases/published.hpp"

namespace cardan::test {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

TEST(StackedBalls, ThrowTheSmallestHighest) {
  const Published ref("event-stacked-balls");
  const VectorXd masses = Published::as_vector(ref.model()["masses_kg"]);
  const double g = ref.model()["gravity_ms2"].as<double>(), h = ref.model()["height_m"].as<double>(), fall = std::sqrt(2.0 * h / g);
  for (const double e : ref.model()["restitution"].as<std::vector<double>>()) {
    std::vector<BodySpec> balls;
    for (int i = 0; i < 3; ++i) {
      balls.push_back(
          on(particle(fmt::format("ball_{}", i), masses[i], Vector3d::Zero()), i == 0 ? "" : balls.back().name, "prismatic", {Z}));
      balls.back().hinge.q = {i == 0 ? h : 0.0};
      const double never = std::numeric_limits<double>::infinity();
      balls.back().hinge.loads = {{0, HingeLaw::stop, {0.0, never, 1e6, 1.0, 0.0}, {}, {e, 1e-3}}};
    }
    const auto sim = run_of(system(balls, uniform_gravity(-g * Z)), "dop853");
    const double later = 1e-3;
    sim->run(fall + later);
    const VectorXd want = ref.vector(fmt::format("e={}", e));
    double v = g * later;
    for (int i = 0; i < 3; ++i) {
      v += sim->state().v[i];
      expect_relative(fmt::format("e = {}: rate of ball {} over sqrt(2 g h)", e, i + 1), v / (g * fall), want[i], ref.tolerance("rel"));
    }
  }
}

TEST(DenHartog, VibratesWithTheAmplitudeOfDryFriction) {
  const Published ref("event-den-hartog");
  const double m = ref.model()["mass_kg"].as<double>(), forcing = ref.model()["forcing_rads"].as<double>();
  BodySpec base = on(rigid("base", 1.0, Vector3d::Zero(), diagonal({1, 1, 1})), "", "prismatic", {X});
  base.hinge.prescribed = {0};
  BodySpec mass = on(particle("mass", m, Vector3d::Zero()), "base", "prismatic", {X});
  SpringDamper spring;
  spring.stiffness = ref.model()["spring_Nm"].as<double>();
  mass.hinge.springs = {spring};
  SystemSpec spec = system({base, mass});
  DeviceSpec friction;
  friction.name = "friction", friction.type = "dry_friction";
  friction.params["coulomb"].value = ref.model()["friction_N"].as<double>();
  friction.mounts["at"] = {"mass", {}};
  spec.devices = {friction};
  const auto sim = run_of(spec, "dop853", 1e-12);
  sim->prescribe(0, MotionProfile::sine(ref.model()["force_N"].as<double>() / (m * forcing * forcing), forcing / (2.0 * std::numbers::pi),
                                        0.5 * std::numbers::pi));
  std::vector<double> turns;
  crossings(
      *sim, 0, [](const double*, const double* v) { return v[1]; }, [&] { turns.push_back(sim->state().q[1]); });
  sim->run(100.0);
  ASSERT_GT(turns.size(), 150u);
  for (std::size_t i = turns.size() - 4; i < turns.size(); ++i)
    expect_relative("amplitude", std::abs(turns[i]), ref.number("amplitude"), ref.tolerance("rel"));
}

TEST(NewmarksBlock, IsLeftBehindAndRestsAgain) {
  const Published ref("event-newmark-block");
  const auto given = [&](const char* name) { return ref.model()[name].as<double>(); };
  const double m = given("mass_kg"), a = given("base_acceleration_ms2"), duration = given("for_s");
  BodySpec base = on(rigid("base", 10.0, Vector3d::Zero(), diagonal({1, 1, 1})), "", "prismatic", {X});
  base.hinge.prescribed = {0};
  SystemSpec spec = system({base, on(particle("block", m, Vector3d::Zero()), "base", "prismatic", {X})});
  DeviceSpec friction;
  friction.name = "friction", friction.type = "dry_friction";
  friction.params["coulomb"].value = given("friction") * m * given("gravity_ms2");
  friction.mounts["at"] = {"block", {}};
  spec.devices = {friction};
  const auto sim = run_of(spec);
  sim->prescribe(0, MotionProfile::rate_table({{0.0, 0.0}, {duration, a * duration}, {10.0, a * duration}}));
  const double rests = ref.number("at rest again");
  sim->run(0.999 * rests);
  EXPECT_LT(sim->state().v[1], 0.0);
  sim->run(1.5 * rests);
  EXPECT_EQ(sim->state().v[1], 0.0);
  expect_absolute("slip", -sim->state().q[1], ref.number("slip"), ref.tolerance("slip_abs"));
}

// Torque against the side on which angle + lead rate has left the dead band, until it is back within the narrower one.
TEST(RelayWithADeadBand, CyclesAsInThePhasePlane) {
  const Published ref("rigid-relay-limit-cycle");
  const auto given = [&](const char* name) { return ref.model()[name].as<double>(); };
  const double J = given("inertia_kgm2"), torque = given("torque_Nm"), lead = given("lead_s");
  BodySpec body = on(rigid("body", 100.0, Vector3d::Zero(), diagonal({100, 110, J})), "", "revolute", {Z});
  body.hinge.q = {ref.initial()["angle_rad"].as<double>()}, body.hinge.v = {ref.initial()["rate_rads"].as<double>()};
  const auto sim = run_of(system({body}), "dop853", 1e-12);
  sim->set_force(0, -torque);
  std::vector<double> on_times, rates;
  for (const double side : {-1.0, 1.0}) {
    const auto beyond = [=](double level) { return [=](const double* q, const double* v) { return side * (q[0] + lead * v[0]) - level; }; };
    crossings(*sim, +1, beyond(given("on_rad")), [&, side] {
      sim->set_force(0, -side * torque);
      if (side > 0.0) on_times.push_back(sim->time()), rates.push_back(sim->state().v[0]);
    });
    crossings(*sim, -1, beyond(given("off_rad")), [&] { sim->set_force(0, 0.0); });
  }
  double largest = 0.0;
  crossings(
      *sim, -1, [](const double*, const double* v) { return v[0]; }, [&] { largest = sim->state().q[0]; });
  sim->run(2500.0);
  ASSERT_GT(on_times.size(), 10u);
  expect_absolute("period", on_times.back() - on_times[on_times.size() - 2], ref.number("period"), ref.tolerance("period_abs"));
  expect_absolute("rate while it drifts", rates.back(), ref.number("rate while it drifts"), ref.tolerance("amplitude_abs"));
  expect_absolute("amplitude", largest, ref.number("amplitude"), ref.tolerance("amplitude_abs"));
}

}  // namespace
}  // namespace cardan::test
