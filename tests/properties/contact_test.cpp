// Contact between simple shapes: closed forms, shapes against points of their surfaces, and what every contact obeys.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <random>

#include "core/abi/device_laws.hpp"
#include "core/linalg/dense.hpp"
#include "core/operators/system_modes.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/random_devices.hpp"

namespace cardan::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;

/// TouchingShape and numbers of one side.
struct TouchingShape {
  std::string kind;
  std::map<std::string, double> numbers;
  std::map<std::string, std::vector<double>> vectors;
};
const TouchingShape kBall{"sphere", {{"radius", 0.2}}, {}},
    kPads{"pads", {{"radius", 0.05}}, {{"points", {0.3, 0, 0, -0.2, 0.3, 0, -0.2, -0.3, 0.1}}}},
    kRod{"capsule", {{"radius", 0.1}, {"length", 0.7}}, {{"axis", {0.6, 0, 0.8}}}},
    kRing{"ring", {{"radius", 0.4}, {"tube", 0.06}}, {{"axis", {0, 0.6, 0.8}}}}, kBox{"box", {}, {{"size", {0.4, 0.6, 0.8}}}},
    kPlane{"plane", {}, {{"axis", {0.48, 0.6, 0.64}}}},
    kCone{"cone", {{"radius", 0.5}, {"end_radius", 0.2}, {"length", 0.6}}, {{"axis", {0, 0.8, 0.6}}}},
    kWheel{"wheel", {{"radius", 0.4}, {"tube", 0.06}}, {{"axis", {0, 0.6, 0.8}}}}, kEllipsoid{"ellipsoid", {}, {{"size", {0.8, 0.5, 0.3}}}};

void put_shape(DeviceSpec& d, const std::string& side, const TouchingShape& shape) {
  d.params[side + "_shape"].value = shape.kind;
  for (const auto& [key, x] : shape.numbers) d.params[side + "_" + key] = number(x);
  for (const auto& [key, x] : shape.vectors) d.params[side + "_" + key].value = x;
}
DeviceSpec contact(const std::string& from, const TouchingShape& a, const std::string& to, const TouchingShape& b,
                   const std::vector<std::pair<std::string, double>>& law) {
  DeviceSpec d = device("contact", "contact", law, {{"from", from}, {"to", to}});
  put_shape(d, "from", a), put_shape(d, "to", b);
  return d;
}
TouchingShape sphere(double radius) { return {"sphere", {{"radius", radius}}, {}}; }
TouchingShape plane(const std::vector<double>& outwards) { return {"plane", {}, {{"axis", outwards}}}; }

BodySpec ball(const std::string& name, double mass, double radius, const std::vector<double>& at, const std::vector<double>& v) {
  const double J = 0.4 * mass * radius * radius;
  BodySpec b = on(rigid(name, mass, {0, 0, 0}, diagonal({J, J, J})), "", "free");
  b.hinge.q = {1, 0, 0, 0, at[0], at[1], at[2]};
  b.hinge.v = v;
  return b;
}

/// The sides of a contact at any motion.
class AskedContact {
 public:
  AskedContact(const TouchingShape& a, const TouchingShape& b, const std::vector<std::pair<std::string, double>>& law) {
    SystemSpec all = system({ball("a", 1, 1, {0, 0, 0}, {}), ball("b", 1, 1, {9, 0, 0}, {})});
    all.devices = {contact("a", a, "b", b, law)};
    model_ = compiled(all);
  }
  cardan_mount_motion mount[2] = {};
  cardan_mount_load load[2] = {};
  double out[4] = {}, lost = 0.0;
  int code = 0;
  void place(int i, const Quaterniond& R, const Vector3d& p) {
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(mount[i].R_WN) = R.toRotationMatrix();
    Vector3d::Map(mount[i].position) = p;
  }
  void move(int i, const Vector3d& omega, const Vector3d& velocity) {
    Vector3d::Map(mount[i].omega) = omega, Vector3d::Map(mount[i].velocity) = velocity;
  }
  AskedContact& ask() {
    const Device& d = model_->devices.all[0];
    cardan_device_args a{};
    a.struct_size = sizeof a, a.packed = d.packed.data(), a.mount = mount;
    std::fill_n(load, 2, cardan_mount_load{}), std::fill_n(out, 4, 0.0);
    cardan_device_out o{};
    o.out = out, o.load = load;
    code = d.family->evaluate(&a, &o);
    lost = o.lost;
    return *this;
  }
  Vector3d force(int i) const { return Vector3d::Map(load[i].force); }
  Vector3d moment(int i) const { return Vector3d::Map(load[i].moment); }

 private:
  std::shared_ptr<const Model> model_;
};

struct RandomMotion {
  std::mt19937 bits;
  double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(bits); }
  Vector3d vector(double size) { return {between(-size, size), between(-size, size), between(-size, size)}; }
  Quaterniond attitude() {
    std::normal_distribution<double> n;
    return Quaterniond(n(bits), n(bits), n(bits), n(bits)).normalized();
  }
};

/// Pairs that can touch; balls on the first feel the second.
const std::vector<std::pair<TouchingShape, TouchingShape>> kPairs = {
    {kBall, kBall}, {kBall, kRod}, {kBall, kRing},  {kBall, kBox},  {kBall, kPlane}, {kBall, kCone},   {kPads, kBall},      {kPads, kRod},
    {kPads, kRing}, {kPads, kBox}, {kPads, kPlane}, {kPads, kCone}, {kRod, kRod},    {kRod, kPlane},   {kRod, kCone},       {kRing, kRod},
    {kRing, kRing}, {kRing, kBox}, {kRing, kPlane}, {kRing, kCone}, {kBox, kPlane},  {kWheel, kPlane}, {kEllipsoid, kPlane}};
const std::vector<std::pair<std::string, double>> kLaw = {{"stiffness", 3.0}, {"exponent", 1.5}, {"restitution", 0.6},
                                                          {"speed", 0.4},     {"friction", 0.7}, {"width", 0.05}};

/// Many more random shapes than a contract test takes.
TEST(Contact, ObeysTheLawsOfDevices) {
  for (const std::string& v : device_law_violations(*registry().device("contact"), 2000, 3)) ADD_FAILURE() << v;
}

/// What a point of the surface, a body's axis or middle, is away from it, by many points of it.
double distance_by_points(const TouchingShape& s, const Vector3d& x) {
  const auto of = [&](const char* key) { return s.numbers.contains(key) ? s.numbers.at(key) : 0.0; };
  const Vector3d u = s.vectors.contains("axis") ? Vector3d(Vector3d::Map(s.vectors.at("axis").data())) : Vector3d::UnitZ();
  const Vector3d e = u.unitOrthogonal(), f = u.cross(e);
  if (s.kind == "plane") return x.dot(u);
  if (s.kind == "sphere") return x.norm() - of("radius");
  double least = HUGE_VAL;
  constexpr int n = 700;
  for (int i = 0; i <= n; ++i) {
    const double part = static_cast<double>(i) / n, angle = 2.0 * std::numbers::pi * part;
    const Vector3d out = std::cos(angle) * e + std::sin(angle) * f;
    if (s.kind == "capsule") least = std::min(least, (x - part * of("length") * u).norm() - of("radius"));
    if (s.kind == "ring") least = std::min(least, (x - of("radius") * out).norm() - of("tube"));
    if (s.kind == "cone")
      for (int k = 0; k <= 200; ++k) {
        const double way = k / 200.0, r = of("radius") + way * (of("end_radius") - of("radius"));
        least = std::min(least, (x - r * out - way * of("length") * u).norm());
      }
    if (s.kind == "box")
      for (int k = 0; k <= 200; ++k)
        for (int axis = 0; axis < 3; ++axis)
          for (const double side : {-0.5, 0.5}) {
            const double* size = s.vectors.at("size").data();
            Vector3d on;
            on[axis] = side * size[axis];
            on[(axis + 1) % 3] = (part - 0.5) * size[(axis + 1) % 3], on[(axis + 2) % 3] = (k / 200.0 - 0.5) * size[(axis + 2) % 3];
            least = std::min(least, (x - on).norm());
          }
  }
  return least;
}

/// The gap of a sphere to each shape, by points of it 3 mm apart: off by their distance squared over that of the middle, 1e-4 m.
TEST(Contact, ShapesAreWhereTheirPointsAre) {
  RandomMotion random{std::mt19937(4)};
  for (const TouchingShape& shape : {kBall, kRod, kRing, kBox, kPlane, kCone}) {
    AskedContact asked(kBall, shape, kLaw);
    for (int k = 0; k < 12;) {
      const Vector3d x = random.vector(0.9), p = random.vector(2.0);
      const Quaterniond R = random.attitude();
      asked.place(0, random.attitude(), p + R * x), asked.place(1, R, p);
      if (asked.ask().code != 0) continue;  // too deep
      if (shape.kind == "box" && (x.cwiseAbs().array() < Vector3d(0.2, 0.3, 0.4).array()).all()) continue;
      ++k;
      EXPECT_NEAR(asked.out[0], distance_by_points(shape, x) - 0.2, 1e-4) << shape.kind;
    }
  }
}

/// Two capsules by all pairs of points of their lines.
TEST(Contact, CapsulesAreAsFarApartAsTheirLines) {
  RandomMotion random{std::mt19937(6)};
  AskedContact asked(kRod, kRod, kLaw);
  for (int k = 0; k < 40; ++k) {
    Vector3d at[2], line[2];
    for (int i = 0; i < 2; ++i) {
      const Quaterniond R = random.attitude();
      at[i] = random.vector(0.6), line[i] = R * Vector3d(0.6, 0, 0.8) * 0.7;
      asked.place(i, R, at[i]);
    }
    double least = HUGE_VAL;
    for (int i = 0; i <= 400; ++i)
      for (int j = 0; j <= 400; ++j) least = std::min(least, (at[0] + i / 400.0 * line[0] - at[1] - j / 400.0 * line[1]).norm());
    asked.ask();
    EXPECT_NEAR(asked.out[0], least - 0.2, least < 0.02 ? 2e-3 : 1e-4);
  }
}

/// Forces are equal and opposite about any point; no force comes before they touch and none pulls; the same in another frame; and the same
/// where the sides are named the other way round.
TEST(Contact, IsTheSameFromBothSidesAndInEveryFrame) {
  RandomMotion random{std::mt19937(5)};
  for (const auto& [a, b] : kPairs) {
    AskedContact asked(a, b, kLaw), turned(a, b, kLaw), exchanged(b, a, kLaw);
    int touched = 0;
    for (int k = 0; k < 4000 && touched < 30; ++k) {
      const Vector3d p[2] = {random.vector(0.7), random.vector(0.7)}, shift = random.vector(3.0);
      const Quaterniond R[2] = {random.attitude(), random.attitude()}, turn = random.attitude();
      for (int i = 0; i < 2; ++i) {
        const Vector3d w = random.vector(1), v = random.vector(1);
        asked.place(i, R[i], p[i]), turned.place(i, turn * R[i], shift + turn * p[i]), exchanged.place(1 - i, R[i], p[i]);
        asked.move(i, w, v), turned.move(i, w, v), exchanged.move(1 - i, w, v);
      }
      asked.ask();
      const double force = asked.out[1];
      EXPECT_EQ(asked.out[3], asked.out[0] < 0.0 ? 1.0 : 0.0);
      if (asked.out[0] >= 0.0) {
        EXPECT_EQ(asked.force(0), Vector3d::Zero().eval());
        continue;
      }
      if (asked.code != 0 || force < 1e-3) continue;
      ++touched;
      turned.ask(), exchanged.ask();
      const double size = force + asked.out[2], limit = 1e-12 * size * 4.0;  // round-off of numbers around 4 m
      EXPECT_GE(asked.lost, 0.0);
      for (int i = 0; i < 2; ++i) {
        EXPECT_LT((turned.force(i) - asked.force(i)).norm() + (turned.moment(i) - asked.moment(i)).norm(), limit) << a.kind << b.kind;
        EXPECT_LT((exchanged.force(1 - i) - asked.force(i)).norm() + (exchanged.moment(1 - i) - asked.moment(i)).norm(), limit)
            << a.kind << b.kind;
      }
      const Vector3d f[2] = {R[0] * asked.force(0), R[1] * asked.force(1)};
      EXPECT_LT((f[0] + f[1]).norm(), 1e-14 * size);
      EXPECT_LT((R[0] * asked.moment(0) + p[0].cross(f[0]) + R[1] * asked.moment(1) + p[1].cross(f[1])).norm(), 1e-14 * size);
    }
    EXPECT_GE(touched, 20) << a.kind << " on " << b.kind;
  }
}

/// Without friction, at rest, the force is the derivative of the energy: k d^n, n and k in units that are told.
TEST(Contact, PushesAsItsParametersSay) {
  const double r = 0.2, depth = 0.03;
  const std::vector<std::pair<std::vector<std::pair<std::string, double>>, double>> cases = {
      {{{"stiffness", 50.0}, {"exponent", 1.0}}, 50.0 * depth},
      {{{"stiffness", 50.0}}, 50.0 * std::pow(depth, 1.5)},
      {{{"stiffness", 50.0}, {"exponent", 2.0}, {"at_depth", 0.01}}, 50.0 * depth * (depth / 0.01)}};
  for (const auto& [law, force] : cases) {
    AskedContact asked(sphere(r), plane({0, 0, 2}), law);
    asked.place(0, Quaterniond::Identity(), {4, 5, r - depth}), asked.place(1, Quaterniond::Identity(), {0, 0, 0});
    asked.ask();
    EXPECT_NEAR(asked.force(0).z(), force, 1e-14 * force);
    EXPECT_NEAR(asked.out[0], -depth, 1e-15);
  }
}

/// A sphere that spins against a smaller one: friction acts in the middle of what overlaps, half of the depth below each surface.
TEST(Contact, RubsInTheMiddleOfWhatOverlaps) {
  const double depth = 0.02, lever[2] = {0.2 - 0.5 * depth, 0.1 - 0.5 * depth};
  AskedContact asked(sphere(0.2), sphere(0.1), {{"stiffness", 50.0}, {"exponent", 1.0}, {"friction", 0.3}});
  asked.place(0, Quaterniond::Identity(), {0, 0, 0}), asked.place(1, Quaterniond::Identity(), {0.3 - depth, 0, 0});
  asked.move(0, {0, 0, 10}, {0, 0, 0});
  asked.ask();
  const double rub = 0.3 * 50.0 * depth;
  EXPECT_LT((asked.force(0) - Vector3d(-50.0 * depth, -rub, 0)).norm(), 1e-14);
  for (const int i : {0, 1}) EXPECT_LT((asked.moment(i) - Vector3d(0, 0, -rub * lever[i])).norm(), 1e-14);
  EXPECT_NEAR(asked.lost, rub * 10.0 * lever[0], 1e-13);
}

/// A sphere leaves a plane of the ground at e times the speed of `speed`, and at another one as a (v_i + v_o) = ln((1 + a v_i) / (1 - a
/// v_o)) says [Hunt & Crossley 1975], whatever the stiffness and the exponent.
TEST(Contact, BouncesWithItsRestitution) {
  for (const double e : {0.2, 0.7, 1.0})
    for (const double n : {1.0, 1.5, 2.2})
      for (const double v : {0.3, 0.06}) {
        SystemSpec spec = system({ball("ball", 2.0, 0.1, {0.02, 0, 0.11}, {0, 0, 0, 0, 0, -v})});
        spec.devices = {contact("ball", sphere(0.1), "world", plane({0, 0, 1}),
                                {{"stiffness", 4e4}, {"exponent", n}, {"at_depth", 1e-3}, {"restitution", e}, {"speed", 0.3}})};
        Simulation sim(compiled(spec), accurate());
        sim.run(0.6);
        const double after = sim.state().v[5];
        // x = a v_i at the speed that e is told of, 1 - e x = (1 + x) exp(-x (1 + e)), by iteration from where it converges.
        double x = 1.0 / e;
        for (int i = 0; i < 2000; ++i) x = (1.0 - (1.0 + x) * std::exp(-x * (1.0 + e))) / e;
        const double a = e < 1.0 ? x / 0.3 : 0.0;
        if (v == 0.3 || e == 1.0) {
          EXPECT_NEAR(after, e * v, 1e-9) << e << ", " << n;
        } else {
          EXPECT_NEAR(a * (v + after), std::log((1.0 + a * v) / (1.0 - a * after)), 1e-8) << e << ", " << n;
          EXPECT_GT(after, e * v);  // slower bodies lose less
        }
        EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
      }
}

/// Half a period of a spring, pi sqrt(m / k); by Hertz 2 sqrt(pi) Gamma(2/5) / (5 Gamma(9/10)) times the deepest over the speed, and that
/// is (5 m v^2 / (4 K))^(2/5) [Timoshenko & Goodier, Theory of Elasticity, 143: 2.9432]. Begin and end are where the gap is zero.
TEST(Contact, LastsAsLongAsItsLawSays) {
  const double m = 2.0, v = 0.3, k = 4e4, r = 0.1;
  for (const bool hertz : {false, true}) {
    SystemSpec spec = system({ball("ball", m, r, {0.4 + r + 0.003, 0, 0}, {0, 0, 0, -v, 0, 0})});
    BodySpec wall = on(rigid("wall", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "locked");
    wall.nodes = {{"face", {0.4, 0, 0}, Eigen::AngleAxisd(0.5 * std::numbers::pi, Vector3d::UnitY()).toRotationMatrix(), {}}};
    spec.bodies.push_back(wall);
    spec.devices = {contact("wall.face", plane({0, 0, 1}), "ball", sphere(r), {{"stiffness", k}, {"exponent", hertz ? 1.5 : 1.0}})};
    Simulation sim(compiled(spec), accurate());
    std::vector<double> times;
    double deepest = 0.0;
    sim.add_event(
        {"touch", [r](double, const double* q, const double*) { return q[4] - 0.4 - r; }, 0, [&] { times.push_back(sim.time()); }});
    sim.add_event({"turn", [](double, const double*, const double* u) { return u[3]; }, 0, [&] { deepest = 0.4 + r - sim.state().q[4]; }});
    sim.run(0.2);
    ASSERT_EQ(times.size(), 2u);
    const double depth = hertz ? std::pow(1.25 * m * v * v / k, 0.4) : v * std::sqrt(m / k);
    const double lasts = hertz ? 0.4 * std::sqrt(std::numbers::pi) * std::tgamma(0.4) / std::tgamma(0.9) * 2.0 * depth / v
                               : std::numbers::pi * std::sqrt(m / k);
    EXPECT_NEAR(times[0], 0.01, 1e-12);
    EXPECT_NEAR(deepest, depth, 1e-11);
    EXPECT_NEAR(times[1] - times[0], lasts, 1e-9 * lasts + 1e-11);
    EXPECT_NEAR(sim.state().v[3], v, 1e-10);
  }
}

/// Two spheres meet off their line of centres, without friction: along it they part as e says, across nothing happens. With friction they
/// spin; momentum is kept all the same, and the ledger closes.
TEST(Contact, KeepsMomentumOfTwoThatMeet) {
  const double r = 0.1, e = 0.5, u = 0.4;
  for (const double mu : {0.0, 0.4}) {
    BodySpec a = ball("a", 1.0, r, {0, 0, 0}, {0.3, 0, 0.2, u, 0, 0}), b = ball("b", 3.0, r, {0.3, 0.1, 0}, {0, -0.1, 0, 0, 0, 0});
    SystemSpec spec = system({a, b});
    const double sine = 0.1 / (2.0 * r), cosine = std::sqrt(1.0 - sine * sine), closing = u * cosine;
    spec.devices = {
        contact("a", sphere(r), "b", sphere(r), {{"stiffness", 1e10}, {"restitution", e}, {"speed", closing}, {"friction", mu}})};
    Simulation sim(compiled(spec), accurate());
    const Momentum before = sim.momentum();
    const double energy = sim.energy().total();
    sim.run(0.6);
    const Momentum after = sim.momentum();
    EXPECT_LT((after.linear - before.linear).norm(), 1e-13 * before.linear_magnitude);
    EXPECT_LT((after.angular - before.angular).norm(), 1e-13 * before.angular_magnitude);
    EXPECT_LT(sim.energy().total(), energy);
    EXPECT_TRUE(sim.ledger().pass);
    if (mu > 0.0) {
      EXPECT_GT(std::abs(sim.state().v[8] + 0.0) + std::abs(sim.state().v[2] - 0.2), 1e-3);
      continue;
    }
    const Vector3d n(cosine, sine, 0), va = Vector3d::Map(&sim.state().v[3]), vb = Vector3d::Map(&sim.state().v[9]);
    EXPECT_NEAR((vb - va).dot(n), e * closing, 2e-4);  // the line turns a little while they touch
    EXPECT_NEAR(sim.state().v[2], 0.2, 1e-12);
  }
}

/// Two equal balls that meet exchange their velocities, wherever in a long step of free flight they do so: of some stages of a step
/// (the first ones of dop853 behind its beginning, those of its dense output) neither its end nor its error has anything.
TEST(Contact, IsMetInTheMiddleOfALongStep) {
  const double r = 0.05;
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> gap(0.05, 0.4), speed(0.5, 2.5), log_k(4.5, 6.0);
  for (const std::string method : {"dop853", "dopri5"}) {
    int passed = 0;
    for (int i = 0; i < 100; ++i) {
      const double d = gap(rng), u = speed(rng);
      SystemSpec spec =
          system({ball("a", 1.0, r, {0, 0, 0}, {0, 0, 0, u, 0, 0}), ball("b", 1.0, r, {2 * r + d, 0, 0}, {0, 0, 0, 0, 0, 0})});
      spec.devices = {contact("a", sphere(r), "b", sphere(r), {{"stiffness", std::pow(10.0, log_k(rng))}})};
      Simulation sim(compiled(spec), accurate(method, 1e-9));
      sim.run(2.0);
      passed += std::abs(sim.state().v[9] - u) > 1e-4 * u ? 1 : 0;
    }
    EXPECT_EQ(passed, 0) << method;
  }
}

/// Pads on a plane that rub at the height of the mass centre, in the middle of what overlaps: mu g from first to last, without a moment.
TEST(Contact, SlidesToRestUnderFriction) {
  const double m = 3.0, g = 9.81, mu = 0.25, k = 1e5, v = 0.8, depth = std::pow(m * g / 3.0 / k, 1.0 / 1.5);
  BodySpec block = on(rigid("block", m, {0, 0, 0.5 * depth}, diagonal({0.1, 0.2, 0.2})), "", "free");
  block.hinge.q = {1, 0, 0, 0, 0, 0, -depth};
  block.hinge.v = {0, 0, 0, v * 0.6, v * 0.8, 0};
  SystemSpec spec = system({block}, uniform_gravity({0, 0, -g}));
  const TouchingShape pads{"pads", {{"radius", 0.0}}, {{"points", {0.2, 0, 0, -0.1, 0.2, 0, -0.1, -0.2, 0}}}};
  spec.devices = {contact("block", pads, "world", plane({0, 0, 1}), {{"stiffness", k}, {"friction", mu}, {"width", 1e-3}})};
  Simulation sim(compiled(spec), accurate());
  const double t = 0.2;
  sim.run(t);
  EXPECT_NEAR(sim.state().v[3], 0.6 * (v - mu * g * t), 1e-9);
  EXPECT_NEAR(sim.state().v[4], 0.8 * (v - mu * g * t), 1e-9);
  EXPECT_NEAR(sim.state().q[4], 0.6 * (v * t - 0.5 * mu * g * t * t), 1e-9);
  sim.run(0.5);
  EXPECT_LT(sim.state().v.norm(), 1e-9);  // what is left creeps to rest as exp(-mu g t / width)
  EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
}

/// A sphere that slides begins to roll, at 5/7 of its speed: exactly v / (1 + J / (m l^2)), the friction acting l = r - depth / 2 below the
/// middle, where half of what overlaps is above and half below.
TEST(Contact, RollsAtFiveSevenths) {
  const double m = 2.0, r = 0.15, g = 9.81, k = 1e7, v = 1.4, depth = std::pow(m * g / k, 1.0 / 1.5), l = r - 0.5 * depth;
  SystemSpec spec = system({ball("ball", m, r, {0, 0, r - depth}, {0, 0, 0, v, 0, 0})}, uniform_gravity({0, 0, -g}));
  spec.devices = {contact("ball", sphere(r), "world", plane({0, 0, 1}), {{"stiffness", k}, {"friction", 0.3}, {"width", 1e-3}})};
  Simulation sim(compiled(spec), accurate("dopri5", 1e-11));
  sim.run(0.3);
  const double rolling = v / (1.0 + 0.4 * r * r / (l * l));
  EXPECT_NEAR(sim.state().v[3], rolling, 1e-9);
  EXPECT_NEAR(sim.state().v[1], rolling / l, 1e-8);
  EXPECT_NEAR(sim.state().v[3], v * 5.0 / 7.0, 2.0 / 7.0 * v * 1.1 * depth / r);
}

/// A box is as far from a plane as its middle less the sum of its half edges, each by the cosine of its angle to the normal.
TEST(Contact, BoxesTouchWithTheirLowestCorner) {
  const Vector3d half = 0.5 * Vector3d::Map(kBox.vectors.at("size").data()), n = Vector3d::Map(kPlane.vectors.at("axis").data());
  RandomMotion random{std::mt19937(21)};
  AskedContact asked(kBox, kPlane, {{"stiffness", 1.0}});
  for (int k = 0; k < 50; ++k) {
    const Quaterniond R = random.attitude(), of_plane = random.attitude();
    const Vector3d p = random.vector(1.0), on = random.vector(1.0), up = of_plane * n;
    asked.place(0, R, p), asked.place(1, of_plane, on);
    EXPECT_NEAR(asked.ask().out[0], up.dot(p - on) - half.dot((R.conjugate() * up).cwiseAbs()), 1e-15 * 8.0);
  }
}

/// A wheel is as far from a plane as the nearest point of its rim, wherever it has turned to: by points of the rim 4 mm apart, 5e-6 m.
TEST(Contact, WheelsTouchWhereTheirRimIsLowest) {
  RandomMotion random{std::mt19937(5)};
  AskedContact asked(kWheel, kPlane, kLaw);
  const Vector3d n(0.48, 0.6, 0.64), axis(0, 0.6, 0.8), e = axis.unitOrthogonal(), f = axis.cross(e);
  for (int k = 0; k < 12; ++k) {
    const Vector3d p = random.vector(2.0);
    const Quaterniond R = random.attitude(), turned = random.attitude();
    asked.place(0, R, p), asked.place(1, turned, Vector3d(0.3, 0.2, 0.1));
    double least = HUGE_VAL;
    for (int i = 0; i < 700; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / 700;
      const Vector3d rim = p + R * (0.4 * (std::cos(angle) * e + std::sin(angle) * f));
      least = std::min(least, (turned * n).dot(rim - Vector3d(0.3, 0.2, 0.1)) - 0.06);
    }
    EXPECT_NEAR(asked.ask().out[0], least, 5e-6);
  }
}

/// A disc that leans by a rolls in a circle: its place of contact goes round a radius R at W, W^2 = 4 g tan a / (6 R - 5 r sin a) [O'Reilly
/// 1996], from dL/dt = W x L. It sinks by 3e-7 m, and what holds it in creeps at 0.2 of `width`, 2e-5 m in all.
TEST(Contact, WheelsRollInCircles) {
  const double m = 2.0, r = 0.5, R = 2.0, a = 0.4, g = 9.81, k = 1e8, inertia = m * r * r / 4.0, sink = m * g / k;
  const double W = std::sqrt(4.0 * g * std::tan(a) / (6.0 * R - 5.0 * r * std::sin(a))), rho = R - r * std::sin(a), spin = -W * R / r;
  BodySpec disc = on(rigid("disc", m, {0, 0, 0}, diagonal({2.0 * inertia, inertia, inertia})), "", "free");
  disc.hinge.q = {std::cos(0.5 * a), 0, -std::sin(0.5 * a), 0, rho, 0, r * std::cos(a) - sink};  // its axis x points out and up by a
  disc.hinge.v = {spin + W * std::sin(a), 0, W * std::cos(a), 0, W * rho, 0};
  SystemSpec spec = system({disc}, uniform_gravity({0, 0, -g}));
  spec.devices = {contact("disc", {"wheel", {{"radius", r}}, {{"axis", {1, 0, 0}}}}, "world", plane({0, 0, 1}),
                          {{"stiffness", k}, {"exponent", 1.0}, {"friction", 0.9}, {"width", 1e-4}})};
  Simulation sim(compiled(spec), accurate("dopri5", 1e-9));
  const double t = 1.0;
  sim.run(t);
  const Vector3d at = Vector3d::Map(sim.state().q.data() + 4);
  EXPECT_LT((at - Vector3d(rho * std::cos(W * t), rho * std::sin(W * t), r * std::cos(a))).norm(), 1e-4);
  const Quaterniond q(sim.state().q[0], sim.state().q[1], sim.state().q[2], sim.state().q[3]);
  const Vector3d axis(std::cos(a) * std::cos(W * t), std::cos(a) * std::sin(W * t), std::sin(a));
  EXPECT_LT((q * Vector3d::UnitX() - axis).norm(), 1e-4);
  EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
}

/// An ellipsoid is as far from a plane as the nearest point of its surface: by points of it, 1e-3 rad apart at most, 1e-6 m.
TEST(Contact, EllipsoidsTouchWhereTheyAreLowest) {
  RandomMotion random{std::mt19937(7)};
  AskedContact asked(kEllipsoid, kPlane, kLaw);
  const Vector3d n(0.48, 0.6, 0.64), place(0.3, 0.2, 0.1);
  for (int k = 0; k < 6; ++k) {
    const Vector3d p = random.vector(2.0);
    const Quaterniond R = random.attitude(), turned = random.attitude();
    asked.place(0, R, p), asked.place(1, turned, place);
    const Vector3d down = -(R.conjugate() * (turned * n));
    double least = 0.0;
    for (int i = 0; i <= 1600; ++i)
      for (int j = 0; j < 3200; ++j) {
        const double polar = std::numbers::pi * i / 1600, angle = 2.0 * std::numbers::pi * j / 3200;
        least = std::max(least, down.dot(Vector3d(0.4 * std::sin(polar) * std::cos(angle), 0.25 * std::sin(polar) * std::sin(angle),
                                                  0.15 * std::cos(polar))));
      }
    EXPECT_NEAR(asked.ask().out[0], (turned * n).dot(p - place) - least, 1e-6);
  }
}

/// A rattleback: an ellipsoid that rolls on a plane, its mass centre below its middle, its axes of inertia turned from those of its
/// surface.
struct Rattleback {
  double m = 1.0, g = 9.81, size[3] = {0.4, 0.06, 0.04}, low = 0.01;  // half axes 20, 3, 2 cm [as of Kane & Levinson 1982]
  double A = 2e-4, B = 1.6e-3, C = 1.7e-3, E = 2e-5;                  // tensor: xx, yy, zz, xy
  double k = 1e8, width = 1e-6;

  static Quaterniond attitude(const Simulation& sim) {
    const auto& q = sim.state().q;
    return {q[0], q[1], q[2], q[3]};
  }

  double height() const { return 0.5 * size[2] - low; }
  Simulation at(const Eigen::Vector2d& tilt, const Vector3d& w, const SimulationOptions& method) const {
    Matrix3d inertia = diagonal({A, B, C});
    inertia(0, 1) = inertia(1, 0) = E;
    BodySpec stone = on(rigid("stone", m, {0, 0, 0}, inertia), "", "free");
    stone.nodes = {{"middle", {0, 0, low}, Matrix3d::Identity(), {}}};
    const Vector3d from = Vector3d(tilt.x(), tilt.y(), 1.0).normalized();
    const Quaterniond q = Quaterniond(1.0 + from.z(), from.y(), -from.x(), 0.0).normalized();  // turns `from` to z
    const Vector3d up = q.conjugate() * Vector3d::UnitZ(), half = 0.5 * Vector3d::Map(size);
    const Vector3d scaled = half.cwiseProduct(up), contact_point = Vector3d(0, 0, low) - half.cwiseProduct(scaled) / scaled.norm();
    const double sink = m * g / k;
    const Vector3d v = q * contact_point.cross(w);  // it rolls
    const double z = -up.dot(contact_point) - sink;
    stone.hinge.q = {q.w(), q.x(), q.y(), q.z(), 0, 0, z};
    stone.hinge.v = {w.x(), w.y(), w.z(), v.x(), v.y(), v.z()};
    SystemSpec spec = system({stone}, uniform_gravity({0, 0, -g}));
    spec.devices = {contact("stone.middle", {"ellipsoid", {}, {{"size", {size[0], size[1], size[2]}}}}, "world", plane({0, 0, 1}),
                            {{"stiffness", k}, {"exponent", 1.0}, {"friction", 0.9}, {"width", width}})};
    return Simulation(compiled(spec), method);
  }
  /// S of x' = S x for the components x, y of the upward direction and of the angular velocity, in the body, about a spin n: rolling
  /// without sliding, L' + w x L = r x m (a + g u) about the place of contact, r' by the radii of curvature there [Bondi 1986].
  Eigen::MatrixXd linear(double n) const {
    const double h = height(), Rx = size[0] * size[0] / (2.0 * size[2]), Ry = size[1] * size[1] / (2.0 * size[2]);
    Eigen::MatrixXd left = Eigen::MatrixXd::Identity(4, 4), right(4, 4);
    left.bottomRightCorner<2, 2>() << A + m * h * h, E, E, B + m * h * h;
    right.row(0) << 0, n, 0, -1;  // alpha' = beta n - q
    right.row(1) << -n, 0, 1, 0;  // beta' = p - alpha n
    // v = (h q - n Ry beta, n Rx alpha - h p),  a = (v_x' - n v_y, v_y' + n v_x)
    right.row(2) << 0, -m * g * (Ry - h) - m * h * n * n * Ry, E * n, -(C - B) * n + m * h * h * n;
    right.row(2) += m * h * n * Rx * right.row(0);
    right.row(3) << m * g * (Rx - h) + m * h * n * n * Rx, 0, -(A - C) * n - m * h * h * n, -E * n;
    right.row(3) += m * h * n * Ry * right.row(1);
    return lu_solve(left, right).x;
  }
};
/// About rest and about spins either way, one of which makes it rock more and more, the other less: tilts of 1e-4 rad, which move the place
/// of contact by 1e-3 of the half axis and more. It sinks by 1e-5 of the height of its mass centre. Either shifts the phase, 54 rad, by
/// some 1e-4.
TEST(Contact, RattlebacksRockAsLinearTheorySays) {
  const Rattleback stone;
  const double t = 0.5;
  const Eigen::Vector4d x0(0.6e-4, 0.8e-4, 2e-4, -1e-4);
  for (const double n : {0.0, 4.0, -4.0}) {
    Simulation sim = stone.at(x0.head<2>(), {x0[2], x0[3], n}, accurate("cvode_bdf", 1e-10));
    sim.run(t);
    const Eigen::MatrixXd S = stone.linear(n);
    Eigen::VectorXd expected = x0;  // exp(S t) x0 by its series, over steps in which S t is small
    const int steps = 100;
    for (int k = 0; k < steps; ++k)
      for (auto [term, i] = std::pair(expected, 1); i < 20; ++i) expected += term = S * term * (t / steps / i);
    const Vector3d up = Rattleback::attitude(sim).conjugate() * Vector3d::UnitZ();
    const Eigen::Vector4d size(1.0, 1.0, 0.01, 0.01);  // rates are a hundred times the tilt
    const Eigen::Vector4d got(up.x(), up.y(), sim.state().v[0], sim.state().v[1]);
    EXPECT_LT((got - expected).cwiseProduct(size).norm(), 1e-3 * expected.cwiseProduct(size).norm()) << n;
  }
}

/// Started the wrong way it rocks, stops and turns back; the right way it goes on: what rocks it then grows to a hundredth of its energy.
/// No energy comes from anywhere.
TEST(Contact, RattlebacksTurnBackOneWay) {
  const Rattleback stone{.k = 1e6, .width = 1e-4};
  for (const double n : {4.0, -4.0}) {
    Simulation sim = stone.at({0.01, 0.01}, {0, 0, n}, accurate("cvode_bdf", 1e-7));
    double energy = sim.energy().total(), least = 1.0;
    for (int i = 1; i <= 40; ++i) {
      sim.run(0.1 * i);
      const double now = sim.energy().total();
      EXPECT_LT(now, energy + 1e-6 * energy);
      energy = now, least = std::min(least, sim.state().v[2] / n);
    }
    if (n > 0.0)
      EXPECT_LT(sim.state().v[2], -0.3);  // by -0.6 to -2.8: after 2 s how fast hangs on the last digits
    else
      EXPECT_GT(least, 0.95);
    EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
  }
}

/// The tip of a probe in the narrow end of a drogue touches it all around: no force across, and along the axis both sides of the wall.
TEST(Contact, SeatsATipInAConeOnItsAxis) {
  const TouchingShape drogue{"cone", {{"radius", 0.5}, {"end_radius", 0.1}, {"length", 0.4}}, {}};  // half angle 45 degrees
  const double r = 0.2, k = 800.0, z = 0.25;  // the wall is (0.5 - z) / sqrt(2) off the axis there
  AskedContact asked(sphere(r), drogue, {{"stiffness", k}, {"exponent", 1.0}});
  asked.place(0, Quaterniond::Identity(), {0, 0, z}), asked.place(1, Quaterniond::Identity(), {0, 0, 0});
  asked.ask();
  const double depth = r - (0.5 - z) / std::sqrt(2.0);
  EXPECT_NEAR(asked.out[0], -depth, 1e-15);
  EXPECT_NEAR(asked.force(0).z(), -2.0 * k * depth / std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(asked.force(0).head<2>().norm(), 0.0, 1e-12);
  for (const double off : {1e-3, -1e-3}) {  // pushed back to the axis
    asked.place(0, Quaterniond::Identity(), {off, 0, z});
    EXPECT_NEAR(asked.ask().force(0).x(), -k * off, 1e-10);
  }
}

/// Two rings face to face: the stiffness is that of all of the circle, however many balls feel it, and a tilt is put right.
TEST(Contact, RingsShareTheirStiffness) {
  for (const double n : {8.0, 12.0, 16.0}) {
    const TouchingShape ring{"ring", {{"radius", 0.5}, {"tube", 0.02}, {"samples", n}}, {}};
    AskedContact asked(ring, ring, {{"stiffness", 1e4}, {"exponent", 1.0}});
    asked.place(0, Quaterniond::Identity(), {0, 0, 0.039}), asked.place(1, Quaterniond::Identity(), {0, 0, 0});
    EXPECT_NEAR(asked.ask().force(0).z(), 1e4 * 0.001, 1e-9);
    const double tilt = 1e-4;  // of a ring of springs k each: moment k R^2 / 2 times the tilt, here about the y axis
    asked.place(0, Quaterniond(Eigen::AngleAxisd(tilt, Vector3d::UnitY())), {0, 0, 0.039});
    EXPECT_NEAR(asked.ask().moment(0).y(), -0.5 * 1e4 * 0.25 * tilt, 2e-4);
  }
}

/// On random floating trees, bodies that meet: energy never grows, momentum is kept, the same with the sides exchanged.
TEST(Contact, NeverGivesEnergyOnRandomTrees) {
  TreeOptions options = kAny;
  options.bodies = 4, options.roots = 2, options.floating = true, options.gravity = GravitySpec::Kind::none, options.wheels = 0.0;
  int touched = 0;
  for (unsigned n = 0; n < 12 || (n < 100 && touched <= 10); ++n) {
    const unsigned seed = first_seed() + n;
    RandomTree tree = random_tree(seed, options);
    std::vector<std::string> roots;
    for (BodySpec& b : tree.spec.bodies)
      if (b.hinge.inboard_body.empty()) roots.push_back(b.name), b.hinge.onode_R.setIdentity();  // coordinates along the axes of the world
    if (roots.size() < 2) continue;
    SystemSpec spec = tree.spec;
    spec.devices = {contact(roots[0], sphere(0.6), roots[1], seed % 2 ? kBox : kRing,
                            {{"stiffness", 300.0}, {"restitution", 0.5}, {"speed", 1.0}, {"friction", 0.3}, {"width", 0.05}})};
    std::shared_ptr<const Model> model = compiled(spec);
    Simulation sim(model, accurate("dopri5", 1e-9));
    // towards each other: the second root comes along the line between both
    const UserBody& b = model->user[idx(model->find_body(roots[1]))];
    State state = sim.state();
    const auto place = [&](const std::string& body) { return sim.observe().node(model->find_node(body)).position; };
    const Vector3d from = place(roots[0]), between = place(roots[1]) - from, line = between.normalized();
    Vector3d::Map(&state.q[b.q + 4]) += 1.5 * line - between;
    state.v *= 0.1;
    Vector3d::Map(&state.v[b.v + 3]) = -0.8 * line;
    sim.set_state(state);
    const Momentum before = sim.momentum();
    double energy = sim.energy().total();
    const double size = sim.energy().magnitude;
    for (int k = 1; k <= 40; ++k) {
      sim.run(0.05 * k);
      touched += sim.device_output(3) != 0.0;
      const double now = sim.energy().total();
      EXPECT_LE(now, energy + 1e-8 * size) << seed << " at " << sim.time();
      energy = now;
    }
    const Momentum after = sim.momentum();
    EXPECT_LT((after.linear - before.linear).norm(), 1e-8 * before.linear_magnitude) << seed;  // that of the steps
    EXPECT_LT((after.angular - before.angular).norm(), 1e-8 * before.angular_magnitude) << seed;
    EXPECT_TRUE(sim.ledger().pass) << seed;
  }
  EXPECT_GT(touched, 10);
}

/// A ball that rests on the ground swings about there with the stiffness of the law: modes of the system have it, whatever else reads
/// nodes.
TEST(Contact, IsInTheModesOfTheSystem) {
  const double m = 2.0, k = 3e4, g = 9.81;
  BodySpec b = on(particle("ball", m, {0, 0, 0}), "", "prismatic", {{0, 0, 1}});
  b.hinge.q = {0.1 - m * g / k};
  SystemSpec spec = system({b}, uniform_gravity({0, 0, -g}));
  spec.bodies.push_back(on(particle("other", 1.0, {0, 0, 0}), "", "translational"));
  spec.devices = {contact("ball", sphere(0.1), "world", plane({0, 0, 1}), {{"stiffness", k}, {"exponent", 1.0}}),
                  device("sensor", "imu", {}, {{"at", "other"}})};
  spec.devices[1].rate = 10.0;
  Simulation sim(compiled(spec), accurate());
  sim.observe();
  operators::TreeOperators tree(sim.shared_model());
  tree.at(sim.state().q.data());
  const auto modes = operators::system_modes(tree, {1, 0, sim.devices()});
  ASSERT_EQ(modes.frequency.size(), 1);
  EXPECT_NEAR(modes.frequency[0], std::sqrt(k / m) / (2.0 * std::numbers::pi), 1e-9);
}

TEST(Contact, RefusesWhatCannotBe) {
  const auto said = [](const TouchingShape& a, const TouchingShape& b, const std::vector<std::pair<std::string, double>>& law) {
    SystemSpec spec = system({ball("a", 1, 1, {0, 0, 0}, {}), ball("b", 1, 1, {9, 0, 0}, {})});
    spec.devices = {contact("a", a, "b", b, law)};
    return refusal(spec);
  };
  const std::vector<std::pair<std::string, double>> law = {{"stiffness", 1.0}};
  for (const auto& [a, b] : {std::pair(kPlane, kPlane), {kBox, kBox}, {kBox, kCone}, {kCone, kCone}, {kRod, kBox}, {kPads, kPads}})
    EXPECT_NE(said(a, b, law).find("what can touch a " + a.kind), std::string::npos) << said(a, b, law);
  EXPECT_NE(said(sphere(0.0), kBall, law).find("a radius > 0 of a sphere"), std::string::npos);
  EXPECT_NE(said({"pads", {{"radius", 0.0}}, {{"points", {0, 0, 0}}}}, kCone, law).find("a radius > 0 of what touches a cone"),
            std::string::npos);
  EXPECT_NE(said(kCone, {"pads", {{"radius", 0.0}}, {{"points", {0, 0, 0}}}}, law).find("a radius > 0 of what touches a cone"),
            std::string::npos);
  EXPECT_NE(said({"pads", {{"radius", 0.1}}, {}}, kBox, law).find("1 to 16 points"), std::string::npos);
  EXPECT_NE(said(kBall, kBall, {{"stiffness", 1.0}, {"restitution", 0.5}}).find("the speed > 0"), std::string::npos);
  EXPECT_NE(said(kBall, kBall, {{"stiffness", 0.0}}).find("a number > 0"), std::string::npos);
  EXPECT_NE(said(kBall, kBall, {{"stiffness", 1.0}, {"friction", -0.1}}).find("a number >= 0"), std::string::npos);
  EXPECT_NE(said({"cone", {{"length", 1.0}}, {}}, kBall, law).find("a radius > 0 at one end of a cone"), std::string::npos);
  EXPECT_EQ(said({"cone", {{"radius", 0.5}, {"length", 1.0}}, {}}, kBall, law), "it compiled");  // it has a tip
}

/// Shapes that overlap beyond what they may are told at the start, by name.
TEST(Contact, TellsThatShapesOverlap) {
  SystemSpec spec = system({ball("a", 1, 0.1, {0, 0, 0}, {}), ball("b", 1, 0.1, {0.15, 0, 0}, {})});
  spec.devices = {contact("a", sphere(0.1), "b", sphere(0.1), {{"stiffness", 1.0}, {"max_depth", 0.02}})};
  Simulation sim(compiled(spec), accurate());
  try {
    sim.run(0.1);
    ADD_FAILURE() << "it ran";
  } catch (const NumericsError& e) {
    EXPECT_NE(std::string(e.what()).find("contact (contact): evaluate: the shapes are deeper in each other"), std::string::npos)
        << e.what();
  }
  spec.devices[0].params["max_depth"] = number(0.06);
  Simulation whole(compiled(spec), accurate());
  whole.run(0.1);
  EXPECT_GT(whole.device_output(1), 0.0);
  // A ball whose middle is in a box is deeper than the shapes tell, whatever `max_depth` is.
  AskedContact inside(kBall, kBox, {{"stiffness", 1.0}, {"max_depth", 10.0}});
  inside.place(0, Quaterniond::Identity(), {0.1, 0, 0}), inside.place(1, Quaterniond::Identity(), {0, 0, 0});
  EXPECT_EQ(inside.ask().code, 1);
  AskedContact other(kBox, kBall, {{"stiffness", 1.0}, {"max_depth", 10.0}});
  other.place(0, Quaterniond::Identity(), {0, 0, 0}), other.place(1, Quaterniond::Identity(), {0.1, 0, 0});
  EXPECT_EQ(other.ask().code, 1);
}

/// A shape all of which is behind a plane was put there by mistake, unless it is said to sink so far. A point tells nothing.
TEST(Contact, TellsThatAShapeIsBehindAPlane) {
  const Vector3d n(0.48, 0.6, 0.64);
  const TouchingShape point{"pads", {{"radius", 0.0}}, {{"points", {0, 0, 0}}}};
  for (const TouchingShape& a : {kBall, kPads, kRod, kRing, kBox, kWheel, kEllipsoid, point})
    for (const bool given : {false, true}) {
      std::vector<std::pair<std::string, double>> law = {{"stiffness", 1.0}};
      if (given) law.emplace_back("max_depth", 5.0);
      AskedContact all(a, kPlane, law);
      all.place(1, Quaterniond::Identity(), {0, 0, 0});
      for (const double depth : {0.1, 3.0}) {
        all.place(0, Quaterniond::Identity(), -depth * n);
        EXPECT_EQ(all.ask().code, depth == 3.0 && !given && a.numbers != point.numbers ? 1 : 0) << a.kind << " " << depth << " " << given;
      }
    }
  AskedContact round(kBall, kPlane, {{"stiffness", 1.0}});
  round.place(1, Quaterniond::Identity(), {0, 0, 0});
  for (const double depth : {0.399, 0.401}) {
    round.place(0, Quaterniond::Identity(), (0.2 - depth) * n);
    EXPECT_EQ(round.ask().code, depth > 0.4 ? 1 : 0) << depth;
  }
}

/// What slides as it comes nearer is held along the surface by the speed along it, and by what presses then.
TEST(Contact, RubsAlongTheSurfaceAlone) {
  const double k = 50.0, r = 0.2, depth = 0.01, mu = 0.4, width = 0.3, e = 0.5, meets = 2.0, closing = 0.7;
  const Vector3d along(0.6, -0.2, 0);
  AskedContact slides(kBall, plane({0, 0, 1}),
                      {{"stiffness", k}, {"exponent", 1.0}, {"friction", mu}, {"width", width}, {"restitution", e}, {"speed", meets}});
  slides.place(0, Quaterniond::Identity(), {0, 0, r - depth}), slides.place(1, Quaterniond::Identity(), {0, 0, 0});
  slides.move(0, {0, 0, 0}, along - closing * Vector3d::UnitZ());
  slides.ask();
  const double presses = slides.out[1], rubs = mu * presses * std::tanh(along.norm() / width);
  EXPECT_GT(presses, 1.1 * k * depth);  // as it comes nearer
  EXPECT_LT((slides.force(0) - Vector3d(0, 0, presses) + rubs * along.normalized()).norm(), 1e-15);
  EXPECT_NEAR(slides.out[2], rubs, 1e-15);
  EXPECT_NEAR(slides.lost, (presses - k * depth) * closing + rubs * along.norm(), 1e-15);
}

/// mu N / width is what resists the slowest sliding.
TEST(Contact, ResistsTheSlowestSlidingInProportion) {
  for (const double speed : {1e-15, 1e-13, 1e-11, 1e-9}) {  // 1e-9 of the width is where its formula changes
    AskedContact slides(kBall, plane({0, 0, 1}), {{"stiffness", 100.0}, {"exponent", 1.0}, {"friction", 0.5}, {"width", 1e-3}});
    slides.place(0, Quaterniond::Identity(), {0, 0, 0.15}), slides.place(1, Quaterniond::Identity(), {0, 0, 0});
    slides.move(0, {0, 0, 0}, {speed, 0, 0});
    EXPECT_NEAR(slides.ask().out[2] / speed, 0.5 * 5.0 / 1e-3, 1e-8);
  }
}

}  // namespace
}  // namespace cardan::test
