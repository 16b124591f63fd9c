// Where devices take energy and never give it: by themselves, as functions of what they read.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/properties/random_devices.hpp"

namespace cardan::test {
namespace {

using Eigen::Vector3d;

/// One device of a vehicle with a hub "bus" on a hinge "bus.angle", to be asked at any numbers.
class Asked {
 public:
  explicit Asked(DeviceSpec spec) {
    SystemSpec all = system({on(rigid("bus", 10.0, {0, 0, 0}, diagonal({1, 2, 3})), "", "revolute", {{0, 0, 1}})});
    all.fields = {{"air", "exponential_atmosphere", {{"density", number(1e-3)}}, true, {}}};
    all.devices = {std::move(spec)};
    model_ = compiled(all);
  }
  /// What it reads but for its parameters, and what it gave; zero at first.
  cardan_mount_motion mount[3] = {};
  double in[4] = {}, z[4] = {}, d[4] = {};
  cardan_mount_load load[3] = {};
  double zdot[4] = {}, out[8] = {}, lost = 0.0;

  void ask() {
    const Device& device = model_->devices.all[0];
    cardan_device_args a{};
    a.struct_size = sizeof a, a.packed = device.packed.data();
    a.in = in, a.mount = mount, a.z = z, a.d = d;
    std::ranges::fill(load, cardan_mount_load{}), std::ranges::fill(zdot, 0.0), std::ranges::fill(out, 0.0);
    cardan_device_out o{};
    o.zdot = zdot, o.out = out, o.load = load;
    ASSERT_EQ(device.family->evaluate(&a, &o), 0);
    lost = o.lost;
  }

 private:
  std::shared_ptr<const Model> model_;
};

struct Lugre {
  double coulomb, breakaway, stribeck, stiffness, damping, viscous, fading;
  double limit(double v) const { return coulomb + (breakaway - coulomb) * std::exp(-std::pow(v / stribeck, 2)); }  // g
  double bending(double v) const { return damping * (fading > 0.0 ? std::exp(-std::pow(v / fading, 2)) : 1.0); }   // s_1(v)
  Asked device() const {
    return Asked(test::device("friction", "lugre_friction",
                              {{"coulomb", coulomb},
                               {"breakaway", breakaway},
                               {"stribeck_rate", stribeck},
                               {"stiffness", stiffness},
                               {"damping", damping},
                               {"viscous", viscous},
                               {"fading_rate", fading}},
                              {{"at", "bus"}}));
  }
};

class Random {
 public:
  explicit Random(unsigned seed) : bits_(seed) {}
  double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(bits_); }
  double of_any_size(double low, double high) { return std::exp(between(std::log(low), std::log(high))); }
  bool one_of(unsigned n) { return bits_() % n == 0; }
  Lugre friction() {
    const double coulomb = of_any_size(0.1, 10);
    return {coulomb,
            coulomb * between(1, 2),
            of_any_size(1e-3, 1),
            of_any_size(1, 1e4),
            of_any_size(0.1, 100),
            one_of(3) ? 0.0 : of_any_size(1e-3, 1),
            one_of(2) ? 0.0 : of_any_size(1e-2, 1)};
  }

 private:
  std::mt19937 bits_;
};

/// Where s_1^2 |v| <= 4 (s_1 + s_2) g it loses whatever the bristles are bent by; where not, there is a bending at which it gives.
TEST(LugreFriction, LosesAtEveryEvaluationWhereItsParametersSaySo) {
  Random random(5);
  int kept = 0, broken = 0;
  for (int k = 0; k < 2000; ++k) {
    const Lugre p = random.friction();
    Asked friction = p.device();
    for (int i = 0; i < 20; ++i) {
      const double v = (random.one_of(2) ? -1 : 1) * random.of_any_size(1e-5, 10), g = p.limit(v), s_1 = p.bending(v);
      if (s_1 < 1e-3) continue;  // it fades: nothing is left to give
      const double a = p.stiffness * std::abs(v) / g, over = s_1 * s_1 * std::abs(v) / (4.0 * (s_1 + p.viscous) * g);
      // lost = (s_0 a + s_2 a^2) z^2 + (s_1 + 2 s_2) a z z' + (s_1 + s_2) z'^2 is least at this z' of z
      const double ratio = -0.5 * (s_1 + 2.0 * p.viscous) * a / (s_1 + p.viscous);
      const double worst = v / (a + ratio), any = random.between(-1.2, 1.2) * p.breakaway / p.stiffness;
      for (const double z : {worst, any}) {
        friction.mount[0].v = v, friction.z[0] = z;
        friction.ask();
        const double size = p.stiffness * a * z * z + (s_1 + p.viscous) * v * v;
        if (over <= 1.0) {
          EXPECT_GE(friction.lost, -1e-14 * size) << "v " << v << ", z " << z;
          ++kept;
        } else if (over > 1.001 && z == worst) {
          EXPECT_LT(friction.lost, 0.0) << "v " << v << ", " << over << " times beyond";
          ++broken;
        }
      }
    }
  }
  EXPECT_GT(kept, 10'000);
  EXPECT_GT(broken, 1'000);
}

/// Beyond it, what it gives in places it has taken before: a hinge that is moved to and fro works on it in each period.
TEST(LugreFriction, TakesWorkInEveryClosedCycle) {
  Random random(9);
  for (int k = 0; k < 200; ++k) {
    Lugre p = random.friction();
    const double amplitude = random.of_any_size(0.1, 30) * p.breakaway / p.stiffness, rate = random.of_any_size(0.1, 30);
    const double fastest = amplitude * rate, g = p.limit(fastest);
    p.fading = 0.0;
    p.damping = random.of_any_size(1.2, 20) * 2.0 * g / fastest * (1.0 + std::sqrt(1.0 + p.viscous * fastest / g));  // times the limit
    Asked friction = p.device();
    // Equal steps of the angle of the sinusoid, of which the bristles take no more than a fifth of their relaxation.
    const int n = std::max(2000, static_cast<int>(5.0 * 2.0 * std::numbers::pi * p.stiffness * amplitude / p.coulomb));
    const double h = 2.0 * std::numbers::pi / rate / n;
    double z = 0.0, work = 0.0, size = 0.0;
    for (int i = 0; i < 3 * n; ++i) {
      if (i == n) work = size = 0.0;  // after the first period
      double slopes[4], powers[4];
      for (int stage = 0; stage < 4; ++stage) {
        const double c = stage == 0 ? 0.0 : stage == 3 ? 1.0 : 0.5;
        friction.mount[0].v = fastest * std::cos(rate * h * (i + c));
        friction.z[0] = z + (stage == 0 ? 0.0 : c * h * slopes[stage - 1]);
        friction.ask();
        slopes[stage] = friction.zdot[0], powers[stage] = -friction.load[0].tau * friction.mount[0].v;
      }
      z += h / 6.0 * (slopes[0] + 2.0 * slopes[1] + 2.0 * slopes[2] + slopes[3]);
      const double here = h / 6.0 * (powers[0] + 2.0 * powers[1] + 2.0 * powers[2] + powers[3]);
      work += here, size += std::abs(here);
    }
    EXPECT_GT(work, 1e-6 * size) << "set no. " << k << ", amplitude " << amplitude << ", rate " << rate;
  }
}

TEST(DcMotor, HeatsItsWindingAlone) {
  Random random(3);
  for (int k = 0; k < 200; ++k) {
    const double R = random.of_any_size(1e-3, 100);
    Asked motor(
        device("motor", "dc_motor",
               {{"constant", random.of_any_size(1e-3, 1)}, {"resistance", R}, {"inductance", 1e-3}, {"gear", random.between(1, 100)}},
               {{"at", "bus"}}));
    motor.mount[0].v = random.between(-10, 10), motor.z[0] = random.between(-5, 5), motor.in[0] = random.between(-30, 30);
    motor.ask();
    EXPECT_GE(motor.lost, 0.0);
    EXPECT_NEAR(motor.lost, R * motor.z[0] * motor.z[0], 1e-14 * motor.lost);
  }
}

TEST(MomentumWheel, HeatsItsBearingsAlone) {
  Random random(4);
  for (int k = 0; k < 200; ++k) {
    const double J = random.of_any_size(1e-3, 1), b = random.one_of(3) ? 0.0 : random.of_any_size(1e-5, 0.1);
    Asked wheel(device("wheel", "momentum_wheel", {{"inertia", J}, {"viscous", b}, {"max_torque", 0.2}}, {{"at", "bus"}}));
    for (double& w : wheel.mount[0].omega) w = random.between(-10, 10);
    wheel.z[0] = random.between(-5, 5), wheel.in[0] = random.between(-1, 1);
    wheel.ask();
    const double rate = wheel.z[0] / J - wheel.mount[0].omega[2];
    EXPECT_GE(wheel.lost, 0.0);
    EXPECT_NEAR(wheel.lost, b * rate * rate, 1e-12 * wheel.lost);
  }
}

/// Air at rest takes power from what moves in it, whatever its attitude and direction; none from what stands still.
TEST(Drag, OfStillAirTakesPower) {
  Random random(6);
  Asked drag(device("drag", "drag", {{"area", 3.0}}, {{"at", "bus"}}));
  for (int k = 0; k < 200; ++k) {
    double power = 0.0, speed = 0.0;
    for (double& v : drag.mount[0].velocity) v = random.between(-100, 100), speed += v * v;
    drag.mount[1].field[0] = random.of_any_size(1e-12, 1);
    drag.ask();
    for (int i = 0; i < 3; ++i) power += drag.load[0].force[i] * drag.mount[0].velocity[i];
    EXPECT_NEAR(power, -0.5 * drag.mount[1].field[0] * 2.2 * 3.0 * std::pow(speed, 1.5), -1e-13 * power);
    EXPECT_LT(power, 0.0);
  }
  for (double& v : drag.mount[0].velocity) v = 0.0;
  drag.ask();
  for (const double f : drag.load[0].force) EXPECT_EQ(f, 0.0);
}

/// Of what moves through a wind it is that of what moves by so much less in still air.
TEST(Drag, IsOfTheAirThatGoesBy) {
  Random random(7);
  Asked drag(device("drag", "drag", {{"area", 3.0}, {"coefficient", 1.7}}, {{"at", "bus"}}));
  DeviceSpec sail = device("plate", "plate_drag", {{"area", 3.0}, {"temperature", 900.0}}, {{"at", "bus"}});
  Asked plate(with_vector(sail, "normal", {0.36, 0.48, 0.8})), still(with_vector(sail, "normal", {0.36, 0.48, 0.8}));
  for (int k = 0; k < 50; ++k) {
    Vector3d u;
    for (int i = 0; i < 3; ++i) {
      const double v = random.between(-500, 500), w = random.between(-500, 500);
      u[i] = v - w;
      drag.mount[0].velocity[i] = plate.mount[0].velocity[i] = v, drag.mount[2].field[i] = plate.mount[2].field[i] = w;
      still.mount[0].velocity[i] = v - w;
    }
    const double rho = random.of_any_size(1e-12, 1);
    for (Asked* of : {&drag, &plate, &still}) {
      of->mount[1].field[0] = rho;
      of->ask();
      EXPECT_EQ(of->out[0], rho);
    }
    const Vector3d force = -0.5 * rho * 1.7 * 3.0 * u.norm() * u;
    EXPECT_LE((Vector3d::Map(drag.load[0].force) - force).norm(), 1e-14 * force.norm());
    const Vector3d on_plate = Vector3d::Map(still.load[0].force);
    EXPECT_LE((Vector3d::Map(plate.load[0].force) - on_plate).norm(), 1e-14 * on_plate.norm());
  }
}

}  // namespace
}  // namespace cardan::test
