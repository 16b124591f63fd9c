// What joins two nodes: the bushing, in all six directions, and the cable, which pulls only.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/base/diagnostic.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/random_devices.hpp"

namespace cardan::test {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using std::numbers::pi;

BodySpec flying(const std::string& name, double mass, const Eigen::Vector3d& inertia) {
  return on(rigid(name, mass, {0, 0, 0}, diagonal(inertia)), "", "free");
}
DeviceSpec with_matrix(DeviceSpec d, const std::string& key, const Matrix6d& A) {
  d.params[key].value = std::vector<double>(A.data(), A.data() + 36);
  return d;
}
DeviceSpec bushing(const std::string& from = "a", const std::string& to = "b") {
  const DeviceSpec d = device("mount", "bushing", {}, {{"from", from}, {"to", to}});
  return with_vector(with_vector(d, "stiffness", Vector3d::Zero()), "turn_stiffness", Vector3d::Zero());
}

/// Shifted along each axis and turned about it, two free bodies swing at sqrt(k / mu), mu = m M / (m + M), and sqrt(k (1 / I + 1 / J)),
/// about the third axis by 2 rad too: a rotation vector about a fixed axis is its angle.
TEST(Bushing, SwingsAtTheFrequenciesOfTwoFreeBodies) {
  const double m = 2.0, M = 5.0, t = 1.3;
  const Vector3d I(0.1, 0.2, 0.25), J(0.3, 0.4, 0.5), k(30, 50, 80), kt(2, 3, 4), rest(1.2, -0.4, 0.3);
  for (int axis = 0; axis < 6; ++axis) {
    const bool turns = axis > 2;
    const int i = axis % 3;
    const double begin = turns ? 2.0 : 0.3;
    BodySpec a = flying("a", m, I), b = flying("b", M, J);
    const Eigen::Quaterniond q(AngleAxisd(turns ? begin : 0.0, Vector3d::Unit(i)));
    b.hinge.q = {q.w(), q.x(), q.y(), q.z(), rest[0], rest[1], rest[2]};
    if (turns)
      a.hinge.q = {1, 0, 0, 0, rest[0], rest[1], rest[2]};  // at one place: the springs of the shift are at rest
    else
      b.hinge.q[static_cast<std::size_t>(4 + i)] += begin;
    SystemSpec spec = system({a, b});
    DeviceSpec d =
        with_vector(with_vector(bushing(), "stiffness", turns ? Vector3d::Zero() : k), "turn_stiffness", turns ? kt : Vector3d::Zero());
    spec.devices = {turns ? d : with_vector(d, "rest", rest)};
    if (!turns) {  // of point masses, nearly: a force across the line turns them
      for (BodySpec& body : spec.bodies) body.inertia_com = diagonal({1e9, 1e9, 1e9});
    }
    Simulation sim(compiled(spec), accurate());
    sim.run(t);
    const double omega = turns ? std::sqrt(kt[i] * (1 / I[i] + 1 / J[i])) : std::sqrt(k[i] * (m + M) / (m * M));
    EXPECT_NEAR(sim.device_output(turns ? 3 + i : i), begin * std::cos(omega * t), turns ? 1e-9 : 2e-8) << axis;  // 1e-9: what turns
    EXPECT_TRUE(sim.ledger().pass) << axis;
  }
}

/// A pose and a motion of all kinds, and a matrix that joins all directions.
struct Twisted {
  Vector3d place{0.4, -0.7, 0.5}, axis = Vector3d(2, -1, 2) / 3.0, wa{0.3, -0.4, 0.2}, wb{-0.5, 0.6, 0.8}, va{1, 2, -0.5},
                                  vb{-0.3, 0.4, 0.7};
  double angle = 1.9;
  Matrix3d Ra = AngleAxisd(0.8, Vector3d(1, 2, 2) / 3.0).toRotationMatrix(), R = AngleAxisd(angle, axis).toRotationMatrix();
  static Matrix6d matrix(double seed) {
    Matrix6d L;
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 6; ++j) L(i, j) = std::sin(seed + 1.7 * i + 2.9 * j);
    const Matrix6d A = L * L.transpose();
    return 0.5 * (A + A.transpose());
  }
  SystemSpec spec() const {
    BodySpec a = flying("a", 1.0, {1, 1, 1}), b = flying("b", 1.0, {1, 1, 1});
    a.hinge.type = b.hinge.type = "free_body";  // velocities in its own axes
    const Eigen::Quaterniond qa(Ra), qb(Matrix3d(Ra * R));
    const Vector3d p = Vector3d(3, 1, -2) + Ra * place;
    a.hinge.q = {qa.w(), qa.x(), qa.y(), qa.z(), 3, 1, -2}, b.hinge.q = {qb.w(), qb.x(), qb.y(), qb.z(), p[0], p[1], p[2]};
    a.hinge.v = {wa[0], wa[1], wa[2], va[0], va[1], va[2]}, b.hinge.v = {wb[0], wb[1], wb[2], vb[0], vb[1], vb[2]};
    return system({a, b});
  }
};

/// Against K x + C x' by differences of the pose along the motion, and moments by the inverse of the map from the rates of a rotation
/// vector to the angular velocity: w = turn' + (1 - cos) / a^2 turn x turn' + (a - sin) / a^3 turn x (turn x turn').
TEST(Bushing, DrawsBackByItsMatricesInTheAxesOfTheFirst) {
  const Twisted at;
  const Matrix6d K = Twisted::matrix(0.3), C = Twisted::matrix(1.1);
  const Vector3d rest(0.1, 0.2, -0.1);
  const Vector6d preload = (Vector6d() << 0.3, -0.6, 0.2, 0.5, 0.1, -0.4).finished();
  SystemSpec spec = at.spec();
  DeviceSpec d = with_matrix(with_matrix(bushing(), "stiffness_matrix", K), "damping_matrix", C);
  d = with_vector(with_vector(with_vector(d, "rest", rest), "preload", preload.head<3>()), "preload_moment", preload.tail<3>());
  spec.devices = {d};
  Simulation sim(compiled(spec), {});
  const VectorXd vdot = sim.vdot();

  const auto x_at = [&](double h) {
    const auto moved = [&](const Matrix3d& R0, const Vector3d& w) { return Matrix3d(R0 * AngleAxisd(h * w.norm(), w.normalized())); };
    const Matrix3d Ra = moved(at.Ra, at.wa), Rb = moved(at.Ra * at.R, at.wb);
    const Vector3d pa = h * (at.Ra * at.va), pb = at.Ra * at.place + h * (at.Ra * at.R * at.vb);
    const AngleAxisd turn(Matrix3d(Ra.transpose() * Rb));
    Vector6d x;
    x << Ra.transpose() * (pb - pa) - rest, turn.angle() * turn.axis();
    return x;
  };
  const double h = 1e-3;
  const Vector6d rate = (45.0 * (x_at(h) - x_at(-h)) - 9.0 * (x_at(2 * h) - x_at(-2 * h)) + (x_at(3 * h) - x_at(-3 * h))) / (60.0 * h);
  const Vector6d g = K * x_at(0.0) + C * rate - preload;
  const Vector3d turn = at.angle * at.axis;
  const Matrix3d t = (Matrix3d() << 0, -turn[2], turn[1], turn[2], 0, -turn[0], -turn[1], turn[0], 0).finished();
  const double a = at.angle;
  const Matrix3d to_rate = Matrix3d::Identity() + (1 - std::cos(a)) / (a * a) * t + (a - std::sin(a)) / (a * a * a) * t * t;
  const Vector3d f = g.head<3>(), m = to_rate.transpose().inverse() * g.tail<3>();
  // Unit inertias.
  EXPECT_LT((vdot.segment<3>(0) - (m + at.place.cross(f))).norm(), 1e-10);  // differences of sixth order: 1e-12 of rates near 1
  EXPECT_LT((vdot.segment<3>(3) + at.wa.cross(at.va) - f).norm(), 1e-10);
  EXPECT_LT((vdot.segment<3>(6) + at.R.transpose() * m).norm(), 1e-10);
  EXPECT_LT((vdot.segment<3>(9) + at.wb.cross(at.vb) + at.R.transpose() * f).norm(), 1e-10);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(sim.device_output(i), at.place[i] - rest[i], 1e-14);
    EXPECT_NEAR(sim.device_output(3 + i), turn[i], 1e-14);
    EXPECT_NEAR(sim.device_output(6 + i), -f[i], 1e-10);
    EXPECT_NEAR(sim.device_output(9 + i), -m[i], 1e-10);
  }
}

/// A massless cantilever as a matrix of stiffness: bent by F L^3 / (3 E I) and F L^2 / (2 E I) it takes the force F at its end and no
/// moment.
TEST(Bushing, MayBeABeam) {
  const double L = 2.0, EI = 50.0, F = 0.3, w = F * L * L * L / (3 * EI), slope = F * L * L / (2 * EI);
  Matrix6d K = Matrix6d::Identity();
  K(1, 1) = 12 * EI / (L * L * L), K(5, 5) = 4 * EI / L, K(1, 5) = K(5, 1) = -6 * EI / (L * L);
  BodySpec b = flying("b", 1.0, {1, 1, 1});
  const Eigen::Quaterniond q(AngleAxisd(slope, Vector3d::UnitZ()));
  b.hinge.q = {q.w(), q.x(), q.y(), q.z(), L, w, 0};
  SystemSpec spec = system({b});
  spec.devices = {with_vector(with_matrix(bushing("world", "b"), "stiffness_matrix", K), "rest", {L, 0, 0})};
  Simulation sim(compiled(spec), {});
  EXPECT_NEAR(sim.device_output(7), -F, 1e-13);
  EXPECT_NEAR(sim.device_output(11), 0.0, 1e-13);
}

/// Turned at rest it is without stress, and what it then does is the same in turned axes.
TEST(Bushing, MayBeTurnedAtRest) {
  const Vector3d turn(0.5, -1.1, 0.7);
  const Matrix3d R0 = AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  const auto moment = [&](const Matrix3d& R, const Vector3d& rest) {
    BodySpec b = flying("b", 1.0, {1, 1, 1});
    const Eigen::Quaterniond q(R);
    b.hinge.q = {q.w(), q.x(), q.y(), q.z(), 0, 0, 0};
    SystemSpec spec = system({b});
    spec.devices = {with_vector(with_vector(bushing("world", "b"), "turn_stiffness", {2, 3, 4}), "rest_turn", rest)};
    return Vector3d(R * Simulation(compiled(spec), {}).vdot().head<3>());
  };
  EXPECT_LT(moment(R0, turn).norm(), 1e-14);
  const Matrix3d further = AngleAxisd(0.4, Vector3d(2, 1, -2) / 3.0).toRotationMatrix();
  EXPECT_LT((moment(further * R0, turn) - moment(further, Vector3d::Zero())).norm(), 1e-14);
  EXPECT_GT(moment(further, Vector3d::Zero()).norm(), 1.0);
}

/// At the ends of the series for small turns its moment has no step.
TEST(Bushing, IsSmoothInTheTurn) {
  for (const double s2 : {1e-3 - 1e-12, 1e-3 + 1e-12}) {
    const double angle = std::asin(std::sqrt(s2));
    const Vector3d turn = angle * Vector3d(2, 1, -2) / 3.0;
    BodySpec b = flying("b", 1.0, {1, 1, 1});
    const Eigen::Quaterniond q(AngleAxisd(angle, turn.normalized()));
    b.hinge.q = {q.w(), q.x(), q.y(), q.z(), 0, 0, 0};
    SystemSpec spec = system({b});
    spec.devices = {with_vector(bushing("world", "b"), "turn_stiffness", {2, 3, 4})};
    Simulation sim(compiled(spec), {});
    const Vector3d n = Vector3d(2, 3, 4).cwiseProduct(turn);
    const double cot = 0.5 * angle / std::tan(0.5 * angle), b2 = (1 - cot) / (angle * angle);
    const Vector3d m = n + 0.5 * turn.cross(n) + b2 * turn.cross(turn.cross(n));
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(sim.device_output(9 + i), -m[i], 1e-15);
  }
}

/// What a preload gives is taken from its energy: bodies at rest that it drives apart and turns keep their sum.
TEST(Bushing, KeepsTheEnergyOfItsPreload) {
  SystemSpec spec = system({flying("a", 2.0, {0.1, 0.2, 0.25}), flying("b", 5.0, {0.3, 0.4, 0.5})});
  DeviceSpec d = with_vector(with_vector(bushing(), "stiffness", {30, 50, 80}), "turn_stiffness", {2, 3, 4});
  spec.devices = {with_vector(with_vector(d, "preload", {3.0, -1.0, 2.0}), "preload_moment", {0.2, 0.5, -0.4})};
  Simulation sim(compiled(spec), accurate());
  const double before = sim.energy().total();
  sim.run(0.7);
  EXPECT_GT(sim.energy().kinetic, 0.01);
  EXPECT_NEAR(sim.energy().total(), before, 1e-10);
  EXPECT_TRUE(sim.ledger().pass);
}

TEST(Bushing, RefusesWhatIsNoMount) {
  const auto said = [](const DeviceSpec& d) {
    SystemSpec spec = system({flying("a", 1, {1, 1, 1}), flying("b", 1, {1, 1, 1})});
    spec.devices = {d};
    return refusal(spec);
  };
  const auto has = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
  Matrix6d A = Twisted::matrix(0.3);
  EXPECT_EQ(said(with_matrix(bushing(), "damping_matrix", A)), "it compiled");
  EXPECT_TRUE(has(said(with_vector(with_matrix(bushing(), "damping_matrix", A), "damping", {1, 1, 1})), "not both"));
  // Turned by a program it is symmetric but for rounding.
  Matrix6d Q = Matrix6d::Zero();
  Q.topLeftCorner<3, 3>() = Q.bottomRightCorner<3, 3>() = Twisted().R;
  const Matrix6d turned = Q * A * Q.transpose();
  ASSERT_NE(turned, turned.transpose());
  EXPECT_EQ(said(with_matrix(bushing(), "damping_matrix", turned)), "it compiled");
  A(1, 4) += 1e-9;
  EXPECT_TRUE(has(said(with_matrix(bushing(), "damping_matrix", A)), "symmetric"));
  // Of rank 1 it may be, in newtons beside micrometres; a thousandth less on the diagonal gives energy.
  const Vector6d u = (Vector6d() << 1e3, 0, -2e3, 1e-3, 2e-3, 0).finished();
  Matrix6d B = u * u.transpose();
  B = (0.5 * (B + B.transpose())).eval();
  EXPECT_EQ(said(with_matrix(bushing(), "damping_matrix", B)), "it compiled");
  B(4, 4) *= 0.999;
  EXPECT_TRUE(has(said(with_matrix(bushing(), "damping_matrix", B)), "negative eigenvalues"));
  EXPECT_TRUE(has(said(with_matrix(bushing(), "stiffness_matrix", B)), "negative eigenvalues"));
}

/// Turned beyond 3 rad it ends the run and says why.
TEST(Bushing, EndsTheRunWhereARotationVectorMeasuresNothing) {
  BodySpec b = flying("b", 1.0, {1, 1, 1});
  b.hinge.v = {1, 0, 0, 0, 0, 0};
  SystemSpec spec = system({b});
  spec.devices = {with_vector(bushing("world", "b"), "stiffness", {1, 1, 1})};
  Simulation sim(compiled(spec), accurate());
  sim.run(2.9);
  try {
    sim.run(3.1);
    FAIL() << "it went on";
  } catch (const std::exception& e) {
    EXPECT_NE(std::string(e.what()).find("3 rad"), std::string::npos) << e.what();
  }
}

/// A bead on a line at a cable from the ground, flung out at v: free up to its length, taut until nothing pulls any more, free again. With
/// s'' + 2 a s' + w^2 s = 0 it is let go where s'' = 0, tan(b t) = 2 a b / (a^2 - b^2), b^2 = w^2 - a^2, at the rate v exp(-a t) (cos b t -
/// a / b sin b t).
TEST(Cable, CatchesAndLetsGo) {
  const double m = 2.0, k = 50.0, length = 1.0, v = 0.8;
  for (const double c : {0.0, 3.0})
    for (const char* method : {"dopri5", "dop853", "cvode_adams"}) {
      BodySpec bead = on(particle("bead", m, {0, 0, 0}), "", "prismatic", {{0.6, 0, 0.8}});
      bead.hinge.q = {0.2}, bead.hinge.v = {v};
      SystemSpec spec = system({bead});
      spec.devices = {device("line", "cable", {{"stiffness", k}, {"length", length}, {"damping", c}}, {{"from", "world"}, {"to", "bead"}})};
      Simulation sim(compiled(spec), accurate(method, 1e-11));
      const double a = c / (2 * m), b = std::sqrt(k / m - a * a), caught = (length - 0.2) / v;
      double t = std::atan2(2 * a * b, a * a - b * b) / b;
      if (c == 0.0) t = pi / b;
      const double back = v * std::exp(-a * t) * (std::cos(b * t) - a / b * std::sin(b * t));
      const double out = v / b * std::exp(-a * t) * std::sin(b * t), rest = 0.3;
      std::vector<double> taut, at = {0.5 * caught, caught + 0.4 * t, caught + t + rest};
      for (const double time : at) {
        sim.run(time);
        taut.push_back(sim.device_output(2));
      }
      EXPECT_EQ(taut, (std::vector<double>{0, 1, 0})) << c;
      EXPECT_LT(back, 0.0);
      EXPECT_NEAR(sim.state().v[0], back, 1e-9) << c << ", " << method;
      EXPECT_NEAR(sim.state().q[0], length + out + back * rest, 1e-9) << c << ", " << method;
      EXPECT_NEAR(sim.device_output(0), sim.state().q[0], 1e-15);
      EXPECT_EQ(sim.device_output(1), 0.0);
      EXPECT_TRUE(sim.ledger().pass) << c << ", " << method;
      EXPECT_LT(sim.ledger().energy_relative, 1e-9) << c << ", " << method;
    }
}

SystemSpec bead_on_a_line(double place, double rate, const std::vector<std::pair<std::string, double>>& numbers) {
  BodySpec bead = on(particle("bead", 2.0, {0, 0, 0}), "", "prismatic", {{0.6, 0, 0.8}});
  bead.hinge.q = {place}, bead.hinge.v = {rate};
  SystemSpec spec = system({bead});
  spec.devices = {device("line", "cable", numbers, {{"from", "world"}, {"to", "bead"}})};
  return spec;
}

/// What begins at its length, at a rate or pushed from rest, is a spring from there on: v / w sin(w t), and g / w^2 (1 - cos(w t)).
TEST(Cable, PullsFromItsLengthOn) {
  const double k = 50.0, length = 1.0, v = 0.8, g = 0.7, t = 0.4, w = std::sqrt(k / 2.0);
  for (const char* method : {"dopri5", "dop853", "cvode_adams"}) {
    const SystemSpec at_rate = bead_on_a_line(length, v, {{"stiffness", k}, {"length", length}});
    SystemSpec pushed = bead_on_a_line(length, 0.0, {{"stiffness", k}, {"length", length}});
    pushed.gravity = uniform_gravity({0.6 * g, 0, 0.8 * g});
    Simulation a(compiled(at_rate), accurate(method, 1e-11)), b(compiled(pushed), accurate(method, 1e-11));
    a.run(t), b.run(t);
    EXPECT_NEAR(a.state().q[0], length + v / w * std::sin(w * t), 1e-9) << method;
    EXPECT_NEAR(b.state().q[0], length + g / (w * w) * (1.0 - std::cos(w * t)), 1e-9) << method;
    EXPECT_EQ(a.device_output(2), 1.0);
    EXPECT_TRUE(a.ledger().pass && b.ledger().pass) << method;
  }
}

/// Two satellites on a cable that are 7000 km from the origin of the world: their distance is known to a nanometre, within which it is seen
/// to pass its length several times. Each time that they have come to its end it holds them.
TEST(Cable, HoldsFarFromHome) {
  const double far = 7e6, length = 10.0;
  BodySpec a = flying("a", 400.0, {50, 60, 70}), b = flying("b", 100.0, {5, 6, 7});
  a.hinge.q = {1, 0, 0, 0, far, 0, 0}, a.hinge.v = {0, 0, 0, 0, 7500, 0};
  NodeSpec hook;
  hook.name = "hook", hook.position = {0.2, 0.3, 0};
  b.nodes = {hook};
  for (const double more : {0.0, 0.01, 0.02, 0.03, 0.04}) {
    b.hinge.q = {1, 0, 0, 0, far + 9.9 + more, 0.1, 0}, b.hinge.v = {0, 0, 0, 0.1, 7500, 0};
    SystemSpec spec = system({a, b}, central_gravity(3.986004418e14, false));
    spec.devices = {device("line", "cable", {{"stiffness", 1e6}, {"length", length}}, {{"from", "a"}, {"to", "b.hook"}})};
    SimulationOptions options;
    options.integrator.method = "dop853";
    Simulation sim(compiled(spec), options);
    for (double t = 0.1; t < 20.0; t += 0.1) {
      sim.run(t);
      ASSERT_LT(sim.device_output(0), 1.05 * length) << more << " at " << t;
    }
  }
}

/// A blow that sends its ends towards each other faster than its spring draws leaves nothing that pulls, and one that sends them apart
/// again makes it pull at once.
TEST(Cable, FollowsBlows) {
  const double k = 5.0, c = 3.0, length = 1.0;
  SystemSpec spec = bead_on_a_line(1.5, 0.1, {{"stiffness", k}, {"length", length}, {"damping", c}});
  for (const double side : {-1.0, 1.0}) {
    DeviceSpec jet = with_vector(device(side < 0.0 ? "back" : "forth", "pulsed_thruster", {{"bit", 6.0}}, {{"at", "bead"}}), "direction",
                                 {0.6 * side, 0, 0.8 * side});
    jet.rate = 10.0;
    spec.devices.push_back(jet);
  }
  Simulation sim(compiled(spec), accurate());
  const Devices& devices = sim.model().devices;
  const int taut = devices.all[static_cast<std::size_t>(devices.find("line"))].out + 2;
  sim.run(0.15);
  EXPECT_EQ(sim.device_output(taut), 1.0);
  sim.set_device_input(0, 1.0), sim.run(0.2), sim.set_device_input(0, 0.0);
  const double s = sim.state().q[0], v = sim.state().v[0];
  ASSERT_LT(k * (s - length) + c * v, 0.0);
  sim.run(0.25);
  EXPECT_NEAR(sim.state().q[0], s + v * 0.05, 1e-12);
  EXPECT_EQ(sim.state().v[0], v);
  EXPECT_EQ(sim.device_output(taut), 0.0);
  sim.set_device_input(1, 1.0), sim.run(0.3), sim.set_device_input(1, 0.0);
  const double pull = k * (sim.state().q[0] - length) + c * sim.state().v[0];
  ASSERT_GT(sim.state().q[0], length);
  ASSERT_GT(pull, 0.0);
  EXPECT_NEAR(sim.vdot()[0], -pull / 2.0, 1e-12);
  sim.run(0.5);
  EXPECT_TRUE(sim.ledger().pass);
}

/// Made shorter in the midst of a run than its ends are apart it is a spring from there on.
TEST(Cable, IsTautAtOnceWhereItIsMadeShorter) {
  const double k = 50.0, t = 0.2, w = std::sqrt(k / 2.0);
  Simulation sim(compiled(bead_on_a_line(1.0, 0.0, {{"stiffness", k}, {"length", 2.0}})), accurate());
  sim.every({1000, 1}, [&] { sim.adopt(compiled(bead_on_a_line(1.0, 0.0, {{"stiffness", k}, {"length", 0.9}}))); }, {1, 2});
  sim.run(0.5 + t);
  EXPECT_NEAR(sim.state().q[0], 0.9 + 0.1 * std::cos(w * t), 1e-9);
  EXPECT_TRUE(sim.ledger().pass);
}

/// Taut all the time it is a spring_damper, to the last bit of what it pulls with.
TEST(Cable, IsASpringWhileItIsTaut) {
  const Twisted at;
  SystemSpec one = at.spec(), other = one;
  const std::vector<std::pair<std::string, std::string>> mounts = {{"from", "a"}, {"to", "b"}};
  one.devices = {device("line", "cable", {{"stiffness", 20}, {"length", 0.1}, {"damping", 0.3}}, mounts)};
  other.devices = {device("line", "spring_damper", {{"stiffness", 20}, {"rest", 0.1}, {"damping", 0.3}}, mounts)};
  Simulation a(compiled(one), {}), b(compiled(other), {});
  a.run(0.0), b.run(0.0);
  EXPECT_EQ(a.vdot(), b.vdot());
}

}  // namespace
}  // namespace cardan::test
