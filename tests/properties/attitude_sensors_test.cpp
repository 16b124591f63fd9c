// What sensors of attitude read, against closed forms: the sense of rotations, what blinds them, the statistics of their noise.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "core/sim/simulation.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/support/scratch.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

using std::numbers::pi;
Matrix3d about(const Vector3d& axis, double angle) { return Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix(); }
Matrix3d by(const Vector3d& e) { return e.norm() > 0.0 ? about(e, e.norm()) : Matrix3d::Identity(); }

/// A ball of inertia that turns at a constant rate w (its own axes) from the attitude R0, with a node that is turned by R_BN.
struct Turning {
  Matrix3d R0 = about({1, 2, 3}, 0.8), R_BN = about({-2, 1, 1}, 1.1);
  Vector3d w{0.3, -0.5, 0.7}, position{7e6, 0, 0};
  Matrix3d R_WN(double t) const { return R0 * by(t * w) * R_BN; }
  SystemSpec with(DeviceSpec sensor, double rate, std::vector<FieldSpec> fields = {}) const {
    BodySpec bus = on(rigid("bus", 10.0, {0, 0, 0}, diagonal({2, 2, 2})), "", "free");
    const Eigen::Quaterniond q(R0);
    bus.hinge.q = {q.w(), q.x(), q.y(), q.z(), position[0], position[1], position[2]}, bus.hinge.v = {w[0], w[1], w[2], 0, 0, 0};
    NodeSpec head;
    head.name = "head", head.position = {0.3, 0.2, -0.1}, head.R_BN = R_BN;
    bus.nodes = {head};
    SystemSpec spec = system({bus});
    sensor.rate = rate;
    spec.devices = {std::move(sensor)}, spec.fields = std::move(fields);
    return spec;
  }
};
DeviceSpec at_head(const std::string& type, const std::vector<std::pair<std::string, double>>& numbers = {}) {
  return device("sensor", type, numbers, {{"at", "bus.head"}});
}
FieldSpec sunlight(const Vector3d& direction, double irradiance = 1361.0, double radius = 0.0) {
  FieldSpec sun;
  sun.name = "sun", sun.type = "sunlight", sun.params = {{"irradiance", number(irradiance)}, {"radius", number(radius)}};
  sun.params["direction"].value = std::vector<double>(direction.data(), direction.data() + 3);
  return sun;
}

VectorXd outputs(Simulation& sim) {
  VectorXd out(sim.model().devices.n_out);
  for (int i = 0; i < sim.model().devices.n_out; ++i) out[i] = sim.device_output(i);
  return out;
}
/// At so many ticks of the rate: what it then holds, and the time of the tick.
template <class See>
void sampled(const SystemSpec& spec, double rate, int samples, const See& see) {
  Simulation sim(compiled(spec), accurate());
  for (int k = 0; k < samples; ++k) {
    sim.run((k + 0.125) / rate);
    see(outputs(sim), k / rate);
  }
}
/// The same with all samples of the outputs as columns.
MatrixXd samples_of(const SystemSpec& spec, double rate, int n) {
  MatrixXd all(compiled(spec)->devices.n_out, n);
  int k = 0;
  sampled(spec, rate, n, [&](const VectorXd& out, double) { all.col(k++) = out; });
  return all;
}

Eigen::Quaterniond attitude(const VectorXd& out) { return {out[0], out[1], out[2], out[3]}; }
Vector3d rotation_vector(const Eigen::Quaterniond& q) {
  const Eigen::AngleAxisd a(q.w() < 0.0 ? Eigen::Quaterniond(-q.coeffs()) : q);
  return a.angle() * a.axis();
}

/// n columns of samples have the mean 0 and this covariance, within five of their standard errors; each is independent of the one before.
void expect_normal(const MatrixXd& x, const MatrixXd& covariance) {
  const double n = static_cast<double>(x.cols());
  const MatrixXd found = x * x.transpose() / n, lagged = x.rightCols(x.cols() - 1) * x.leftCols(x.cols() - 1).transpose() / (n - 1.0);
  const VectorXd mean = x.rowwise().mean();
  for (Eigen::Index i = 0; i < x.rows(); ++i) {
    EXPECT_LT(std::abs(mean[i]), 5.0 * std::sqrt(covariance(i, i) / n)) << i;
    for (Eigen::Index j = 0; j < x.rows(); ++j) {
      const double spread = covariance(i, i) * covariance(j, j);
      EXPECT_NEAR(found(i, j), covariance(i, j), 5.0 * std::sqrt((spread + covariance(i, j) * covariance(i, j)) / n)) << i << ", " << j;
      EXPECT_LT(std::abs(lagged(i, j)), 5.0 * std::sqrt(spread / n)) << i << ", " << j;
    }
  }
}

TEST(StarTracker, TellsTheRotationFromItsNodeToTheWorld) {
  const Turning motion;
  sampled(motion.with(at_head("star_tracker"), 4.0), 4.0, 60, [&](const VectorXd& out, double t) {
    EXPECT_LT((attitude(out).toRotationMatrix() - motion.R_WN(t)).norm(), 1e-9) << t;  // fifteen seconds at 1e-11 a step
    EXPECT_NEAR(attitude(out).norm(), 1.0, 1e-15);
    EXPECT_EQ(out[4], 1.0);
  });
}

/// It begins with w >= 0 and goes on without jumps: after a turn of 360 deg the quaternion is the opposite one.
TEST(StarTracker, GoesOnWithTheSignThatItHad) {
  Turning motion;
  motion.w = {0.0, 0.0, 2.0 * pi / 10.0};
  Eigen::Quaterniond first, before;
  sampled(motion.with(at_head("star_tracker"), 1.0), 1.0, 21, [&](const VectorXd& out, double t) {
    const Eigen::Quaterniond q = attitude(out);
    if (t == 0.0) {
      first = before = q;
      EXPECT_GE(q.w(), 0.0);
    }
    EXPECT_GT(q.dot(before), 0.9) << t;
    if (t == 10.0) {
      EXPECT_NEAR(q.dot(first), -1.0, 1e-9);
    }
    if (t == 20.0) {
      EXPECT_NEAR(q.dot(first), 1.0, 1e-9);
    }
    before = q;
  });
}

/// What it takes for node axes are those turned by the misalignment.
TEST(StarTracker, IsMisalignedInItsOwnAxes) {
  const Turning motion;
  const Vector3d e(0.02, -0.03, 0.05);
  sampled(motion.with(with_vector(at_head("star_tracker"), "misalignment", e), 4.0), 4.0, 5, [&](const VectorXd& out, double t) {
    EXPECT_LT((attitude(out).toRotationMatrix() - motion.R_WN(t) * by(e)).norm(), 1e-10) << t;
  });
}

/// The rotation from truth to reading, in its axes: one standard deviation across the boresight, another about it.
TEST(StarTracker, ScattersAcrossItsBoresightAndAboutIt) {
  Turning still;
  still.w.setZero();
  const Vector3d u = Vector3d(2, -1, 2) / 3.0;
  const double across = 3e-5, roll = 4e-4;
  for (const Vector3d& misaligned : {Vector3d(0, 0, 0), Vector3d(0.4, -0.2, 0.7)}) {
    DeviceSpec d = with_vector(at_head("star_tracker", {{"cross_noise", across}, {"roll_noise", roll}}), "boresight", u);
    d = with_vector(d, "misalignment", misaligned);
    const MatrixXd out = samples_of(still.with(d, 10.0), 10.0, 20'000);
    MatrixXd e(3, out.cols());
    const Eigen::Quaterniond truth(still.R_WN(0.0) * by(misaligned));
    for (Eigen::Index k = 0; k < out.cols(); ++k) e.col(k) = rotation_vector(truth.conjugate() * attitude(out.col(k)));
    expect_normal(e, across * across * (Matrix3d::Identity() - u * u.transpose()) + roll * roll * u * u.transpose());
  }
}

/// Blinded where the Sun is nearer to the boresight than `exclusion`: then the last good attitude stays. In shadow nothing blinds.
TEST(StarTracker, IsBlindedByTheSunButNotInShadow) {
  const Turning motion;
  const Vector3d u(0.6, 0.0, 0.8), sun = Vector3d(1, 4, 2).normalized(), e(0.4, -0.2, 0.7);
  const double half = 50.0 * pi / 180.0;
  for (const bool shaded : {false, true}) {
    Turning there = motion;
    if (shaded) there.position = -7e6 * sun;
    DeviceSpec d = with_vector(at_head("star_tracker", {{"exclusion", half}}), "boresight", u);
    const SystemSpec spec = there.with(with_vector(d, "misalignment", e), 4.0, {sunlight(sun, 1361.0, 6.4e6)});
    double good = 0.0;
    int blinded = 0, seen = 0;
    sampled(spec, 4.0, 80, [&](const VectorXd& out, double t) {
      const bool blind = !shaded && std::acos((motion.R_WN(t) * by(e) * u).dot(sun)) < half;
      (blind ? blinded : seen) += 1;
      if (!blind) good = t;
      EXPECT_EQ(out[4], blind ? 0.0 : 1.0) << t;
      if (seen > 0) {
        EXPECT_LT((attitude(out).toRotationMatrix() - motion.R_WN(good) * by(e)).norm(), 1e-9) << t;
      }
    });
    EXPECT_GT(seen, 10);
    EXPECT_EQ(blinded > 10, !shaded);
  }
}

TEST(StarTracker, FindsNoStarsBeyondItsRate) {
  for (const double limit : {0.9, 0.92}) {  // |w| = 0.9110 rad/s
    const MatrixXd out = samples_of(Turning{}.with(at_head("star_tracker", {{"rate_limit", limit}}), 4.0), 4.0, 3);
    EXPECT_EQ(out(4, 2), limit < std::sqrt(0.83) ? 0.0 : 1.0);
    if (limit < std::sqrt(0.83)) {
      EXPECT_EQ(out.col(2).head(4), Eigen::Vector4d(1, 0, 0, 0));
    }  // it has had none
  }
}

TEST(SunSensor, PointsToTheSunInItsAxes) {
  const Turning motion;
  const Vector3d u(0.6, 0.0, 0.8), sun = Vector3d(1, 4, 2).normalized(), e(0.02, -0.03, 0.05);
  const double half = 70.0 * pi / 180.0;
  for (const bool misaligned : {false, true}) {
    DeviceSpec sensor = with_vector(at_head("sun_sensor", {{"half_angle", half}}), "boresight", u);
    if (misaligned) sensor = with_vector(sensor, "misalignment", e);
    Vector3d held = Vector3d::Zero();
    int seen = 0, lost = 0;
    sampled(motion.with(sensor, 4.0, {sunlight(sun, 300.0)}), 4.0, 80, [&](const VectorXd& out, double t) {
      Vector3d s = motion.R_WN(t).transpose() * sun;
      if (misaligned) s = by(e).transpose() * s;
      const bool in_view = std::acos(s.dot(u)) < half;
      (in_view ? seen : lost) += 1;
      EXPECT_EQ(out[3], in_view ? 1.0 : 0.0) << t;
      if (in_view) held = s;
      EXPECT_LT((out.head<3>() - held).norm(), 1e-9) << t;
    });
    EXPECT_GT(seen, 10);
    EXPECT_GT(lost, 10);
  }
}

/// In shadow, and up to its threshold, there is no Sun.
TEST(SunSensor, SeesNothingInShadow) {
  Turning still;
  still.w.setZero();
  const Vector3d sun = Vector3d(1, 4, 2).normalized();
  const DeviceSpec any = at_head("sun_sensor", {{"half_angle", pi}}),
                   blunt = at_head("sun_sensor", {{"half_angle", pi}, {"threshold", 300.0}});
  const auto valid = [&](const DeviceSpec& d, const FieldSpec& light) { return samples_of(still.with(d, 1.0, {light}), 1.0, 1)(3, 0); };
  EXPECT_EQ(valid(any, sunlight(sun, 299.0)), 1.0);
  EXPECT_EQ(valid(blunt, sunlight(sun, 299.0)), 0.0);
  EXPECT_EQ(valid(blunt, sunlight(sun, 301.0)), 1.0);
  still.position = -7e6 * sun;
  EXPECT_EQ(valid(any, sunlight(sun, 1361.0, 6.4e6)), 0.0);
}

/// Across the direction in both axes alike, along it not at all.
TEST(SunSensor, ScattersAcrossTheDirection) {
  Turning still;
  still.w.setZero();
  const Vector3d sun = Vector3d(1, 4, 2).normalized(), s = still.R_WN(0.0).transpose() * sun;
  const double noise = 2e-3;
  const MatrixXd out =
      samples_of(still.with(at_head("sun_sensor", {{"half_angle", pi}, {"noise", noise}}), 10.0, {sunlight(sun)}), 10.0, 20'000);
  const Vector3d a = s.unitOrthogonal(), b = s.cross(a);
  MatrixXd e(2, out.cols());
  for (Eigen::Index k = 0; k < out.cols(); ++k) {
    e.col(k) << a.dot(out.col(k).head<3>()), b.dot(out.col(k).head<3>());
    ASSERT_NEAR(out.col(k).head<3>().norm(), 1.0, 1e-15);
  }
  expect_normal(e, noise * noise * MatrixXd::Identity(2, 2));
}

/// scale E / 1361 cos, 0 beyond the half-angle and on the other side.
TEST(CoarseSunSensor, FollowsTheCosine) {
  const Turning motion;
  const Vector3d n(0.6, 0.0, 0.8), sun = Vector3d(1, 4, 2).normalized();
  for (const double half : {0.5 * pi, 60.0 * pi / 180.0}) {
    const DeviceSpec cell = with_vector(at_head("coarse_sun_sensor", {{"half_angle", half}, {"scale", 1.2}}), "normal", n);
    int dark = 0, bright = 0;
    sampled(motion.with(cell, 4.0, {sunlight(sun, 500.0)}), 4.0, 80, [&](const VectorXd& out, double t) {
      const double cosine = (motion.R_WN(t) * n).dot(sun);
      const bool seen = std::acos(cosine) < half;
      (seen ? bright : dark) += 1;
      EXPECT_NEAR(out[0], seen ? 1.2 * 500.0 / 1361.0 * cosine : 0.0, 1e-9) << t;
    });
    EXPECT_GT(dark, 10);
    EXPECT_GT(bright, 10);
  }
}

/// Cut at 0: in the dark half of its noise is left, of mean sigma / sqrt(2 pi) and mean square sigma^2 / 2.
TEST(CoarseSunSensor, IsNeverBelowZero) {
  Turning still;
  still.w.setZero();
  const double sigma = 0.03, n = 20'000.0, mean = sigma / std::sqrt(2.0 * pi), square = 0.5 * sigma * sigma;
  const Vector3d sun = Vector3d(1, 4, 2).normalized(), down = -(still.R_WN(0.0).transpose() * sun);
  const SystemSpec spec = still.with(with_vector(at_head("coarse_sun_sensor", {{"noise", sigma}}), "normal", down), 10.0, {sunlight(sun)});
  const MatrixXd out = samples_of(spec, 10.0, 20'000);
  EXPECT_TRUE((out.array() >= 0.0).all());
  EXPECT_NEAR(out.mean(), mean, 5.0 * std::sqrt((square - mean * mean) / n));
  EXPECT_NEAR(out.squaredNorm() / n, square, 5.0 * std::sqrt((1.5 - 0.25) * std::pow(sigma, 4) / n));  // E x^4 = 3 sigma^4 / 2
}

/// At the equator of a dipole D the field is -D / r^3 along its axis.
TEST(Magnetometer, ReadsTheFieldInItsAxes) {
  Turning motion;
  const double D = -7.77e15;
  motion.position = {6.9e6, 0, 0};
  const Vector3d scale(1.01, 0.98, 1.03), bias(2e-7, -3e-7, 5e-7);
  DeviceSpec sensor = with_vector(with_vector(at_head("magnetometer"), "scale", scale), "bias", bias);
  const SystemSpec spec = motion.with(sensor, 4.0, {{"earth", "dipole", {}, false, {}}});
  sampled(spec, 4.0, 20, [&](const VectorXd& out, double t) {
    const Vector3d r = motion.position + motion.R0 * by(t * motion.w) * Vector3d(0.3, 0.2, -0.1);  // as far as it is in the plane
    const Vector3d B = motion.R_WN(t).transpose() * (D / std::pow(r.norm(), 3) * (3.0 * r.z() / r.squaredNorm() * r - Vector3d::UnitZ()));
    EXPECT_LT((out.head<3>() - scale.cwiseProduct(B) - bias).norm(), 1e-9 * B.norm()) << t;
    EXPECT_EQ(out[3], 1.0);
  });
}

/// Steps of its converter; an axis beyond the range reads its end, and then nothing holds.
TEST(Magnetometer, HasStepsAndARange) {
  Turning still;
  still.w.setZero();
  still.position = {6.9e6, 0, 0};
  const auto read = [&](const std::vector<std::pair<std::string, double>>& numbers) {
    return VectorXd(samples_of(still.with(at_head("magnetometer", numbers), 1.0, {{"earth", "dipole", {}, false, {}}}), 1.0, 1).col(0));
  };
  const VectorXd truth = read({}), steps = read({{"step", 1e-6}});
  const double most = largest(truth.head<3>());
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(steps[i], 1e-6 * std::round(truth[i] / 1e-6), 1e-18) << i;
    EXPECT_NE(steps[i], truth[i]);
  }
  EXPECT_EQ(steps[3], 1.0);
  const VectorXd cut = read({{"range", 0.9 * most}}), whole = read({{"range", 1.1 * most}});
  EXPECT_EQ(cut[3], 0.0);
  EXPECT_EQ(largest(cut.head<3>()), 0.9 * most);
  for (int i = 0; i < 3; ++i) {  // any axis is enough
    const DeviceSpec d = with_vector(at_head("magnetometer", {{"range", 2.0 * most}}), "bias", 4.0 * most * Vector3d::Unit(i));
    EXPECT_EQ(samples_of(still.with(d, 1.0, {{"earth", "dipole", {}, false, {}}}), 1.0, 1)(3, 0), 0.0) << i;
  }
  EXPECT_EQ(whole, truth);
}

TEST(Magnetometer, ScattersAlikeInItsAxes) {
  Turning still;
  still.w.setZero();
  const double noise = 1e-7;
  const Vector3d scale(2.0, 0.5, 1.5), bias(1e-5, -2e-5, 3e-5);  // of what is measured; its own noise stays as it is
  const auto sensor = [&](double deviation) {
    return with_vector(with_vector(at_head("magnetometer", {{"noise", deviation}}), "scale", scale), "bias", bias);
  };
  const SystemSpec spec = still.with(sensor(noise), 10.0, {{"earth", "dipole", {}, false, {}}});
  const VectorXd truth = samples_of(still.with(sensor(0.0), 10.0, spec.fields), 10.0, 1).col(0);
  const MatrixXd out = samples_of(spec, 10.0, 20'000);
  expect_normal(out.topRows(3).colwise() - truth.head<3>(), noise * noise * MatrixXd::Identity(3, 3));
}

SystemSpec with_encoder(const std::string& hinge, double rate, const std::vector<std::pair<std::string, double>>& numbers,
                        const std::string& at = "arm") {
  const bool ball = hinge == "ball";
  BodySpec arm =
      on(rigid("arm", 3.0, {0, 0, 0}, diagonal({1, 1, 1})), "", hinge, ball ? std::vector<Vector3d>{} : std::vector<Vector3d>{{0, 0, 1}});
  if (!ball) arm.hinge.q = {0.2}, arm.hinge.v = {1.7};
  SystemSpec spec = system({arm});
  spec.devices = {device("encoder", "encoder", numbers, {{"at", at}})};
  spec.devices[0].rate = rate;
  return spec;
}

/// It counts on beyond a turn, to the nearest step; the rate is that of two readings, and not there at the first.
TEST(Encoder, CountsAndTakesDifferences) {
  const double step = 2.0 * pi / 4096.0, bias = 0.01, rate = 50.0;
  for (const std::string hinge : {"revolute", "prismatic"}) {
    double before = 0.0, square = 0.0;
    const int n = 2000;
    sampled(with_encoder(hinge, rate, {{"step", step}, {"bias", bias}}), rate, n, [&](const VectorXd& out, double t) {
      const double truth = 0.2 + 1.7 * t + bias, error = out[0] - truth;
      EXPECT_LE(std::abs(error), 0.5 * step + 1e-10) << t;
      EXPECT_NEAR(out[0] / step, std::round(out[0] / step), 1e-9);
      EXPECT_EQ(out[2], t > 0.0 ? 1.0 : 0.0);
      EXPECT_NEAR(out[1], t > 0.0 ? (out[0] - before) * rate : 0.0, 1e-12);
      if (t > 0.0) {
        EXPECT_NEAR(out[1], 1.7, step * rate);
      }
      before = out[0], square += error * error;
    });
    // Errors of rounding are spread evenly over a step: their square is step^2 / 12, with the standard error step^2 / (6 sqrt(5 n)).
    EXPECT_NEAR(square / n, step * step / 12.0, 5.0 * step * step / (6.0 * std::sqrt(5.0 * n)));
  }
}

/// One that reads with another bias from an instant on has no reading before it that its rate could be taken from.
TEST(Encoder, TakesNoDifferenceAcrossAChangeOfItself) {
  Simulation sim(compiled(with_encoder("revolute", 10.0, {})), accurate());
  sim.every({1000, 1}, [&] { sim.adopt(compiled(with_encoder("revolute", 10.0, {{"bias", 0.5}}))); }, {1, 20});
  sim.run(0.07);
  EXPECT_NEAR(sim.device_output(0), 0.2, 1e-15);  // held
  EXPECT_EQ(sim.device_output(2), 0.0);
  sim.run(0.12);
  EXPECT_NEAR(sim.device_output(0), 0.2 + 1.7 * 0.1 + 0.5, 1e-10);
  EXPECT_EQ(sim.device_output(1), 0.0);
  EXPECT_EQ(sim.device_output(2), 0.0);
  sim.run(0.22);
  EXPECT_NEAR(sim.device_output(1), 1.7, 1e-9);
  EXPECT_EQ(sim.device_output(2), 1.0);
}

TEST(Encoder, ScattersBeforeItRounds) {
  const double noise = 1e-3;
  const MatrixXd out = samples_of(with_encoder("revolute", 10.0, {{"noise", noise}}), 10.0, 10'000);
  MatrixXd e = out.topRows(1);
  for (Eigen::Index k = 0; k < e.cols(); ++k) e(0, k) -= 0.2 + 0.17 * static_cast<double>(k);
  expect_normal(e, MatrixXd::Constant(1, 1, noise * noise));
}

TEST(Encoder, WantsACoordinate) {
  EXPECT_NE(refusal(with_encoder("ball", 10.0, {}, "arm.wx")).find("coordinate"), std::string::npos)
      << refusal(with_encoder("ball", 10.0, {}, "arm.wx"));
}

/// The direction from a node that turns to the centre of a planet, which is elsewhere; seen within its half-angle alone.
TEST(HorizonSensor, ReadsTheDirectionToTheCentreInNodeAxes) {
  const Turning bus;
  const Vector3d centre(1e6, -2e6, 5e5), arm(0.3, 0.2, -0.1), misaligned(0.3, -0.2, 0.25);
  for (const double half_angle : {0.8, pi}) {
    DeviceSpec d = with_vector(at_head("horizon_sensor", {{"half_angle", half_angle}}), "centre", centre);
    d = with_vector(with_vector(d, "misalignment", misaligned), "boresight", {0, 1, 0});
    int seen = 0, unseen = 0;
    sampled(bus.with(d, 2.0), 2.0, 40, [&](const VectorXd& out, double t) {
      const Vector3d place = bus.position + bus.R0 * by(t * bus.w) * arm;
      const Vector3d read = by(misaligned).transpose() * bus.R_WN(t).transpose() * (centre - place).normalized();
      const bool within = std::acos(read[1]) <= half_angle;
      EXPECT_EQ(out[3], within ? 1.0 : 0.0) << t;
      if (within) {
        EXPECT_LT((out.head<3>() - read).norm(), 1e-10);  // what 10 s of turning leave at 1e-12
      }
      (within ? seen : unseen) += 1;
    });
    EXPECT_GT(seen, 5);
    EXPECT_EQ(unseen > 5, half_angle < pi);
  }
}

TEST(HorizonSensor, IsBlindedByTheSunAndByDistance) {
  const Turning bus;
  const Vector3d misaligned(0.4, -0.2, 0.7);
  const auto valid = [&](const Vector3d& sun, double farthest) {
    DeviceSpec d = at_head("horizon_sensor", {{"half_angle", pi}, {"exclusion", 0.3}, {"max_distance", farthest}});
    return samples_of(bus.with(with_vector(d, "misalignment", misaligned), 1.0, {sunlight(sun)}), 1.0, 1)(3, 0);
  };
  const Vector3d boresight = (bus.R_WN(0.0) * by(misaligned)).col(2);
  EXPECT_EQ(valid(by(0.29 * boresight.cross(Vector3d::UnitX()).normalized()) * boresight, 0.0), 0.0);
  EXPECT_EQ(valid(by(0.31 * boresight.cross(Vector3d::UnitX()).normalized()) * boresight, 0.0), 1.0);
  EXPECT_EQ(valid(-boresight, 6.9e6), 0.0);
  EXPECT_EQ(valid(-boresight, 7.1e6), 1.0);
  // In shadow no light comes, from nowhere.
  for (const double side : {1.0, -1.0}) {
    DeviceSpec d = at_head("horizon_sensor", {{"half_angle", pi}, {"exclusion", 0.3}});
    const FieldSpec shaded = sunlight(-bus.position.normalized(), 1361.0, 6.4e6);
    EXPECT_EQ(samples_of(bus.with(with_vector(d, "boresight", {0, 0, side}), 1.0, {shaded}), 1.0, 1)(3, 0), 1.0) << side;
  }
}

TEST(HorizonSensor, HasNoiseAcrossTheDirection) {
  const double sigma = 1e-3;
  const int n = 2000;
  Turning bus;
  bus.w.setZero();
  const MatrixXd all = samples_of(bus.with(at_head("horizon_sensor", {{"half_angle", pi}, {"noise", sigma}}), 10.0), 10.0, n);
  const Vector3d truth = bus.R_WN(0.0).transpose() * -(bus.position + bus.R0 * Vector3d(0.3, 0.2, -0.1)).normalized();
  double sum = 0.0;
  for (int k = 0; k < n; ++k) sum += (all.col(k).head<3>() - truth).squaredNorm();
  EXPECT_NEAR(sum / n, 2 * sigma * sigma, 5 * 2 * sigma * sigma / std::sqrt(n));  // chi-square of two: five standard deviations
}

/// In world axes what the node does, its arm and its turning too; in axes of a planet that turns, less its rotation.
TEST(Gnss, TellsPositionAndVelocityInTheAxesAskedFor) {
  Turning bus;
  const Vector3d arm(0.3, 0.2, -0.1), axis = Vector3d(1, 2, 2) / 3.0, meridian = Vector3d(2, 1, -2) / 3.0, centre(1e6, 2e6, -3e6);
  const double rate = 1e-2;
  for (const bool planet : {false, true}) {
    DeviceSpec d = at_head("gnss", {{"planet_rate", rate}});
    d.params["axes"].value = std::string(planet ? "planet" : "world");
    d = with_vector(with_vector(with_vector(d, "axis", axis), "meridian", meridian), "centre", centre);
    sampled(bus.with(d, 2.0), 2.0, 20, [&](const VectorXd& out, double t) {
      const Matrix3d R = bus.R0 * by(t * bus.w);
      Vector3d r = bus.position + R * arm, v = R * bus.w.cross(arm);
      if (planet) {
        Matrix3d axes;  // columns
        axes << meridian, axis.cross(meridian), axis;
        axes = (about(axis, rate * t) * axes).eval();
        v = axes.transpose() * (v - rate * axis.cross(r - centre)), r = axes.transpose() * (r - centre);
      }
      EXPECT_LT((out.head<3>() - r).norm(), 1e-8) << t;  // 7e6 m to 1e-15
      EXPECT_LT((out.segment<3>(3) - v).norm(), 1e-8) << t;
      EXPECT_EQ(out[6], 1.0);
    });
  }
}

/// White noise and an error that wanders, stationary from the start: variances add, and neighbours are correlated by exp(-T / tau).
TEST(Gnss, HasNoiseAndAnErrorThatWanders) {
  const double white = 2.0, wander = 3.0, tau = 5.0, rate = 1.0, slow = 0.02;
  const int n = 4000;
  Turning bus;
  bus.w.setZero();
  const DeviceSpec d =
      at_head("gnss", {{"position_noise", white}, {"position_wander", wander}, {"wander_time", tau}, {"velocity_noise", slow}});
  const MatrixXd all = samples_of(bus.with(d, rate), rate, n);
  const Vector3d truth = bus.position + bus.R0 * Vector3d(0.3, 0.2, -0.1);
  double variance = 0.0, next = 0.0, speed = 0.0, both = 0.0;
  for (int k = 0; k + 1 < n; ++k) {
    const Vector3d a = all.col(k).head<3>() - truth, b = all.col(k + 1).head<3>() - truth;
    variance += a.squaredNorm() / (3 * n), next += a.dot(b) / (3 * n), speed += all.col(k).segment<3>(3).squaredNorm() / (3 * n);
    both += a.dot(all.col(k).segment<3>(3)) / (3 * n);
  }
  // 3 n / (1 + 2 tau) independent samples or so: four standard deviations of the variance are a tenth.
  EXPECT_NEAR(variance, white * white + wander * wander, 0.12 * (white * white + wander * wander));
  EXPECT_NEAR(next, wander * wander * std::exp(-1.0 / tau), 0.15 * wander * wander);
  EXPECT_NEAR(speed, slow * slow, 0.06 * slow * slow);
  EXPECT_LT(std::abs(both), 5.0 * std::hypot(white, wander) * slow / std::sqrt(3.0 * n)) << "noises of their own";
}

/// The example of the IAU's SOFA tools for Earth attitude, with the polar motion, UT1 and offsets of the pole of its bulletin (as of
/// Bulletin.TellsHowTheEarthStands). Beyond the days of the bulletin it says so.
TEST(Gnss, HasTheAxesOfTheEarthByABulletin) {
  const std::string file = test::scratch("gnss_days.csv");
  std::ofstream csv(file);
  csv << "mjd,x [mas],y [mas],ut1_utc [s],dX [mas],dY [mas]\n";
  for (int mjd = 54193; mjd < 54199; ++mjd) csv << mjd << ",34.9282,483.3163,-0.072073685,0.1750,-0.2259\n";
  csv.close();
  Matrix3d wanted;  // from celestial to terrestrial axes
  wanted << +0.973104317697535, +0.230363826239128, -0.000703163482198, -0.230363800456037, +0.973104570632801, +0.000118545366625,
      +0.000711560162668, +0.000046626403995, +0.999999745754024;
  DeviceSpec d = at_head("gnss");
  d.params["axes"].value = std::string("planet"), d.params["orientation"].value = std::string("iau2006");
  d.params["epoch"].value = std::string("2007-04-05T12:00:00 UTC"), d.params["bulletin"].value = file;
  Turning bus;
  bus.w.setZero();
  Simulation sim(compiled(bus.with(d, 1e-3)), accurate());
  sim.run(1.0);
  const Vector3d r = bus.position + bus.R0 * Vector3d(0.3, 0.2, -0.1);
  EXPECT_LT((outputs(sim).head<3>() - wanted * r).norm(), 1e-3);  // 7e6 m to the digits printed and 3e-11; polar motion alone is 16 m
  try {
    sim.run(3 * 86400.0);
    FAIL() << "beyond the days of the bulletin";
  } catch (const NumericsError& e) {
    EXPECT_NE(std::string(e.what()).find("outside of the days of `bulletin`"), std::string::npos) << e.what();
  }
}

TEST(Gnss, KeepsItsLastFixWithoutASignal) {
  Turning bus;
  SystemSpec spec = bus.with(at_head("gnss", {{"max_distance", 8e6}}), 1.0);
  Simulation sim(compiled(spec), accurate());
  sim.run(0.5);
  const double x = sim.device_output(0);
  EXPECT_EQ(sim.device_output(6), 1.0);
  sim.set_device_input(0, 0.0);
  sim.run(1.5);
  EXPECT_EQ(sim.device_output(6), 0.0);
  EXPECT_EQ(sim.device_output(0), x);
  sim.set_device_input(0, 1.0);
  sim.run(2.5);
  EXPECT_EQ(sim.device_output(6), 1.0);
  EXPECT_NE(sim.device_output(0), x);
  bus.position = {0, 8.1e6, 0};
  const DeviceSpec near = at_head("gnss", {{"max_distance", 8e6}});
  EXPECT_EQ(samples_of(bus.with(near, 1.0), 1.0, 1)(6, 0), 0.0);
  EXPECT_EQ(samples_of(bus.with(with_vector(near, "centre", {0, 1e6, 0}), 1.0), 1.0, 1)(6, 0), 1.0) << "counted from the centre";
}

}  // namespace
}  // namespace cardan::test
