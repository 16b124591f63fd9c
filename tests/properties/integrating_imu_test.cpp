// Devices whose states follow the motion: what an integrating IMU counts, against closed forms and on any tree.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "core/abi/device_family.hpp"
#include "core/base/noise.hpp"
#include "tests/operators/compare.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {
namespace {

using Six = std::array<double, 6>;

DeviceSpec counter(const std::string& node, double rate, const std::vector<std::pair<std::string, double>>& numbers = {}) {
  DeviceSpec d = device("counter", "integrating_imu", numbers, {{"at", node}});
  d.rate = rate;
  return d;
}

Six given(Simulation& sim) {
  Six out{};
  for (int i = 0; i < 6; ++i) out[static_cast<std::size_t>(i)] = sim.device_output(i);
  return out;
}

NodeSpec node_at(const std::string& name, const Eigen::Vector3d& r) {
  NodeSpec n;
  n.name = name, n.position = r;
  return n;
}

/// Free symmetric body of inertia (J, J, J3): w = (w_t cos lt, w_t sin lt, w_3), l = (J3 - J) / J w_3 [Euler 1765]. At the arm r the
/// accelerometers read w' x r + w x (w x r). Integrals of both from 0 to T.
struct Wobble {
  double J = 20.0, J3 = 33.0, w_t = 0.7, w_3 = 1.9;
  Eigen::Vector3d r{0.4, -0.3, 0.2};
  double l() const { return (J3 - J) / J * w_3; }
  Six integral(double T) const {
    const double p = l(), s = std::sin(p * T), c = 1.0 - std::cos(p * T), s2 = std::sin(2 * p * T), c2 = 1.0 - std::cos(2 * p * T);
    const Eigen::Vector3d dw(w_t * (std::cos(p * T) - 1.0), w_t * s, 0.0);  // integral of w'
    // Integrals of w w^T; w . w is constant.
    Eigen::Matrix3d ww;
    ww(0, 0) = w_t * w_t * (T / 2 + s2 / (4 * p)), ww(1, 1) = w_t * w_t * (T / 2 - s2 / (4 * p)), ww(2, 2) = w_3 * w_3 * T;
    ww(0, 1) = ww(1, 0) = w_t * w_t * c2 / (4 * p);
    ww(0, 2) = ww(2, 0) = w_t * w_3 * s / p, ww(1, 2) = ww(2, 1) = w_t * w_3 * c / p;
    const Eigen::Vector3d v = dw.cross(r) + ww * r - (w_t * w_t + w_3 * w_3) * T * r;
    return {w_t * s / p, w_t * c / p, w_3 * T, v[0], v[1], v[2]};
  }
};

SystemSpec wobbling(const Wobble& truth) {
  BodySpec bus = on(rigid("bus", 100.0, {0, 0, 0}, diagonal({truth.J, truth.J, truth.J3})), "", "free");
  bus.hinge.v = {truth.w_t, 0.0, truth.w_3, 0.3, 0.1, -0.2};
  bus.nodes = {node_at("imu", truth.r)};
  return system({bus});
}

TEST(IntegratingImu, AddsUpWhatAFreeBodyDoes) {
  const Wobble truth;
  for (const char* method : {"dopri5", "dop853", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit", "rk4"}) {
    SystemSpec spec = wobbling(truth);
    spec.devices = {counter("bus.imu", 4.0)};
    SimulationOptions options = accurate(method, 1e-11);
    if (options.integrator.method == "rk4") options.integrator.fixed_step = 1e-3;
    Simulation sim(compiled(spec), options);
    for (int k = 1; k <= 8; ++k) {
      sim.run(0.25 * k + 0.125);
      const Six now = truth.integral(0.25 * k), before = truth.integral(0.25 * (k - 1)), got = given(sim);
      for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(got[i], now[i] - before[i], 2e-9) << method << ", " << i << " at " << k;
    }
    if (options.integrator.method == "dopri5") {
      EXPECT_EQ(sim.statistics().restarts, 1);  // its samples change no motion
    }
  }
}

/// On a bench it holds gravity up; turned by a hinge it feels what a carousel does.
TEST(IntegratingImu, FeelsTheGroundAndTheCarousel) {
  const double g = 9.8, w = 2.0, r = 0.5, T = 0.1;
  BodySpec table = on(rigid("table", 3.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {Eigen::Vector3d(0, 0, 1)});
  table.hinge.v = {w};
  table.nodes = {node_at("rim", {r, 0, 0})};
  SystemSpec spec = system({table}, uniform_gravity({0, 0, -g}));
  spec.devices = {counter("table.rim", 1.0 / T)};
  Simulation sim(compiled(spec), accurate());
  sim.run(1.05);
  const Six truth{0, 0, w * T, -w * w * r * T, 0, g * T}, got = given(sim);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(got[i], truth[i], 1e-11) << i;
}

/// z' is the rate and the specific force of its node, on bodies that deform too.
TEST(IntegratingImu, FollowsItsNodeOnAnyTree) {
  for_all_trees(kAny, 1e-14, [](const RandomTree& tree) {
    Simulation sim(compiled(with_followers(tree.spec, tree.seed)), {});
    const Device& d = sim.model().devices.all[static_cast<std::size_t>(sim.model().devices.find("counter"))];
    const VectorXd z = VectorXd::Map(sim.devices()->zdot() + d.z, 6);
    const NodeState n = sim.observe().node(d.mounts[0].node);
    VectorXd truth(6);
    truth << n.velocity.head<3>(), n.specific_force;
    return apart(z, truth);
  });
}

TEST(IntegratingImu, TakesPartInTheJacobian) {
  for_all_trees(kAny, 1e-8, [](const RandomTree& tree) { return jacobian_error(with_followers(tree.spec, tree.seed)); });
}

TEST(IntegratingImu, WithoutATangentIsDifferentiated) {
  static const Registry other = [] {
    static cardan_device_family bare = *registry().device("integrating_imu");
    bare.follow_tangent = nullptr, bare.type = "bare_imu";
    Registry r = registry();
    r.devices.add(bare);
    return r;
  }();
  const auto product = [](const SystemSpec& spec) {
    Simulation sim(compile(spec, other), krylov());
    const OdeProblem ode = sim.ode();
    VectorXd x(ode.n), d(ode.n), out(ode.n);
    x << sim.state().q, sim.state().v, sim.state().z;
    for (int i = 0; i < ode.n; ++i) d[i] = 1e-3 * std::sin(2.7 * i + 0.3);
    EXPECT_TRUE(ode.jacobian_times(0.0, x.data(), d.data(), out.data()));
    return out;
  };
  for_all_trees(kAny, 1e-8, [&](const RandomTree& tree) {
    SystemSpec spec = with_followers(tree.spec, tree.seed);
    const VectorXd exact = product(spec);
    spec.devices.back().type = "bare_imu";
    return apart(product(spec), exact);
  });
}

/// The same bits as with a unit that only samples, in equal steps.
TEST(IntegratingImu, ChangesNoMotion) {
  const Wobble truth;
  SystemSpec spec = wobbling(truth);
  SimulationOptions options = accurate("rk4");
  options.integrator.fixed_step = 0.01;
  spec.devices = {counter("bus.imu", 10.0)};
  spec.devices[0].type = "imu";
  Simulation without(compiled(spec), options);
  spec.devices = {counter("bus.imu", 10.0, {{"angle_random_walk", 1e-3}})};
  Simulation with(compiled(spec), options);
  without.run(2.0), with.run(2.0);
  EXPECT_EQ(with.state().v, without.state().v);
  EXPECT_EQ(with.state().q, without.state().q);
}

/// One unit by itself, its integrals given: what it counts.
struct Alone {
  explicit Alone(const std::vector<std::pair<std::string, double>>& numbers,
                 const std::vector<std::pair<std::string, std::vector<double>>>& vectors = {}) {
    SystemSpec spec = system({on(rigid("bus", 100.0, {0, 0, 0}, diagonal({20, 20, 30})), "", "locked")});
    spec.devices = {counter("bus", 10.0, numbers)};
    for (const auto& [key, x] : vectors) spec.devices[0].params[key].value = x;
    model = compiled(spec);
    marks = model->devices.marks0;
  }
  Six tick(double period, const Six& integral, int k) {
    const cardan_device_family& imu = *registry().device("integrating_imu");
    std::vector<double> noise(imu.n_noise), z(6);
    normal_noise(noise_key(3, "counter"), static_cast<std::uint64_t>(k), imu.n_noise, noise.data());
    const cardan_mount_motion still{};
    const cardan_device_args at{sizeof at, 0.0, model->devices.all[0].packed.data(), nullptr, &still, integral.data(), marks.data()};
    EXPECT_EQ(imu.tick(&at, period, noise.data(), z.data(), marks.data()), 0);
    Six out{};
    std::copy_n(marks.begin(), 6, out.begin());
    return out;
  }
  std::shared_ptr<const Model> model;
  std::vector<double> marks;
};

/// An angle random walk of N: the sum of its increments over t scatters by N sqrt(t), whatever the rate.
TEST(IntegratingImu, WalksAtRandomAsItsDensitySays) {
  const double N = 2e-3;
  for (const double rate : {10.0, 200.0}) {
    Alone unit({{"angle_random_walk", N}});
    const int seconds = 2000;
    double square = 0.0, sum = 0.0;
    unit.tick(1.0 / rate, {}, 0);
    for (int k = 1; k <= seconds * static_cast<int>(rate); ++k) {
      sum += unit.tick(1.0 / rate, {}, k)[0];
      if (k % static_cast<int>(rate) == 0) square += sum * sum, sum = 0.0;
    }
    EXPECT_NEAR(std::sqrt(square / seconds), N, 5.0 * N / std::sqrt(2.0 * seconds)) << rate;
  }
}

/// Counts lose nothing: what is less than one is kept for the next. A bias adds up; beyond the range it counts no faster.
TEST(IntegratingImu, CountsWithoutLoss) {
  const double step = 1e-3, bias = 2e-3, T = 0.05;
  Alone unit({{"gyro_step", step}, {"gyro_bias", bias}, {"accelerometer_range", 0.5}});
  double angle = 0.0, velocity = 0.0;
  unit.tick(T, {}, 0);
  for (int k = 1; k <= 400; ++k) {
    const double t = T * k, true_angle = 0.3 * std::sin(t);
    const Six out = unit.tick(T, {true_angle, 0, 0, 2.0 * t, 0, 0}, k);
    angle += out[0], velocity += out[3];
    EXPECT_NEAR(out[0] / step, std::round(out[0] / step), 1e-9);
    EXPECT_LE(std::abs(angle - true_angle - bias * t), 0.5 * step + 1e-12) << k;
    EXPECT_NEAR(velocity, 0.5 * t, 1e-12) << "2 m/s^2, of which it knows 0.5";
  }
}

/// An axis counts what it sees of the integrals of the others.
TEST(IntegratingImu, CountsWhatItsAxesSee) {
  Alone unit({}, {{"gyro_scale", {0.1, 0.0, 0.0}},
                  {"accelerometer_misalignment", {0.0, 0.0, 0.5 * std::numbers::pi}},
                  {"gyro_nonorthogonality", {0.02, 0.0, 0.0}},
                  {"gyro_bias", {0.0, 0.0, 0.5}}});
  const double T = 0.2;
  unit.tick(T, {}, 0);
  const Six out = unit.tick(T, {1, 2, 3, 4, 5, 6}, 1), wanted = {1.1, 2.03, 3.02 + 0.5 * T, 5, -4, 6};
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(out[i], wanted[i], 1e-14) << i;
}

// ---- devices of this test ----

struct NoParameters {};

/// z' = alpha_x, until that is beyond 1.
struct Shy {
  static constexpr const char *type = "shy", *summary = "z' = alpha_x";
  static constexpr unsigned facts = 0;
  using Packed = NoParameters;
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_ACCELERATION, "a node"}};
  static constexpr cardan_state_desc states[] = {{"turned", "rad/s", 0.0, 1.0, "integral of alpha"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>&, DeviceOut<T>&) noexcept {}
  template <class T>
  static void follow(const Packed&, const DeviceIn<T>& in, T* zdot) noexcept {
    using std::sqrt;
    zdot[0] = in.at[0].alpha.x + T(0.0) * sqrt(T(1.0) - in.at[0].alpha.x);
  }
};

/// z' = v' of a hinge.
struct Tachometer {
  static constexpr const char *type = "tachometer", *summary = "z' = v'";
  static constexpr unsigned facts = 0;
  using Packed = NoParameters;
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_HINGE, CARDAN_USE_ACCELERATION, "a component"}};
  static constexpr cardan_state_desc states[] = {{"rate", "rad/s|m/s", 0.0, 1.0, "integral of v'"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>&, DeviceOut<T>&) noexcept {}
  template <class T>
  static void follow(const Packed&, const DeviceIn<T>& in, T* zdot) noexcept {
    zdot[0] = in.at[0].vdot;
  }
};

/// z' = q v' of a hinge.
struct Leverage {
  static constexpr const char *type = "leverage", *summary = "z' = q v'";
  static constexpr unsigned facts = 0;
  using Packed = NoParameters;
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_HINGE, CARDAN_USE_COORDINATE | CARDAN_USE_ACCELERATION, "a component"}};
  static constexpr cardan_state_desc states[] = {{"sum", "1", 0.0, 1.0, "integral of q v'"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>&, DeviceOut<T>&) noexcept {}
  template <class T>
  static void follow(const Packed&, const DeviceIn<T>& in, T* zdot) noexcept {
    zdot[0] = in.at[0].q * in.at[0].vdot;
  }
};

/// Pushes with what it is commanded, without looking.
struct Blower {
  static constexpr const char *type = "blower", *summary = "a force";
  static constexpr unsigned facts = 0;
  using Packed = NoParameters;
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_LOAD, "a node"}};
  static constexpr cardan_port_desc ports[] = {{"force", CARDAN_PORT_IN, "N", 0.0, 0, "along x"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.load[0].force.x = in.in[0];
  }
};

/// v' that overflows is told of v', not of who follows it.
TEST(Following, IsNotBlamedForWhatItFollows) {
  static const Registry own = [] {
    Registry r = registry();
    r.devices.add(device_table<Blower>());
    return r;
  }();
  SystemSpec spec = system({on(rigid("bus", 1e-10, {0, 0, 0}, diagonal({1e-12, 1e-12, 1e-12})), "", "free")});
  spec.devices = {counter("bus", 10.0), device("blower", "blower", {}, {{"at", "bus"}})};
  Simulation sim(compile(spec, own), accurate());
  sim.set_device_input(0, 1e300);
  try {
    sim.run(1.0);
    FAIL() << "it ran";
  } catch (const NumericsError& e) {
    EXPECT_EQ(std::string(e.what()).find("counter"), std::string::npos) << e.what();
  }
}

/// The rate of a slide that is pulled at and bounces: what has been added up of v' is what it has changed by.
TEST(Following, AHingeFeelsItsBounces) {
  static const Registry own = [] {
    Registry r = registry();
    r.devices.add(device_table<Tachometer>());
    return r;
  }();
  BodySpec slider = on(particle("slider", 2.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}});
  slider.hinge.v = {0.3};
  slider.hinge.loads = {{0, HingeLaw::stop, {-1.0, 0.1, 1e5, 1.0, 0.1}, {}, {0.6, 0.01}}};
  SystemSpec spec = system({slider});
  spec.devices = {device("on_it", "tachometer", {}, {{"at", "slider"}})};
  Simulation sim(compile(spec, own), accurate());
  sim.set_force(0, 0.4);
  sim.run(1.0);
  ASSERT_LT(sim.state().q[0], 0.1);
  EXPECT_LT(sim.state().v[0], 0.0) << "it has come back";
  EXPECT_NEAR(sim.state().z[0], sim.state().v[0] - 0.3, 1e-13);
}

/// A slide that is pulled at with a constant force bounces once: it is struck where it is, 0.1 m from home.
TEST(Following, AHingeIsStruckWhereItIs) {
  static const Registry own = [] {
    Registry r = registry();
    r.devices.add(device_table<Leverage>());
    return r;
  }();
  const double at = 0.1, back = 0.6, a = 0.2, v = 0.3;
  BodySpec slider = on(particle("slider", 2.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}});
  slider.hinge.v = {v};
  slider.hinge.loads = {{0, HingeLaw::stop, {-1.0, at, 1e5, 1.0, 0.1}, {}, {back, 0.01}}};
  SystemSpec spec = system({slider});
  spec.devices = {device("on_it", "leverage", {}, {{"at", "slider"}})};
  Simulation sim(compile(spec, own), accurate());
  sim.set_force(0, 2.0 * a);
  sim.run(1.0);
  const double t = (std::sqrt(v * v + 2.0 * a * at) - v) / a, struck = v + a * t, s = 1.0 - t;
  const auto sum = [a](double q, double rate, double time) {  // of a q from there on
    return a * time * (q + time * (rate / 2.0 + a * time / 6.0));
  };
  EXPECT_NEAR(sim.state().z[0], sum(0.0, v, t) - at * (1.0 + back) * struck + sum(at, -back * struck, s), 1e-12);
}

TEST(Following, WithoutAUsableRateIsNamed) {
  static const Registry own = [] {
    Registry r = registry();
    r.devices.add(device_table<Shy>(), "a plugin");
    return r;
  }();
  SystemSpec spec = system({on(rigid("bus", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "free")});
  spec.devices = {counter("bus", 10.0), device("one", "shy", {}, {{"at", "bus"}})};
  Simulation sim(compile(spec, own), accurate());
  sim.set_force(0, 0.5);
  sim.run(2.0);
  EXPECT_NEAR(sim.state().z[sim.model().devices.all[1].z], 1.0, 1e-12);
  sim.set_force(0, 2.0);
  try {
    sim.run(3.0);
    FAIL() << "it ran";
  } catch (const NumericsError& e) {
    EXPECT_NE(std::string(e.what()).find("device one (shy, a plugin): follow: rate of turned"), std::string::npos) << e.what();
  }
}

}  // namespace
}  // namespace cardan::test
