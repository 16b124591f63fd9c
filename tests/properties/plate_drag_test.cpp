// Rarefied air on plates: against integrals over the velocities of its molecules, and closed forms of bodies made of plates.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/linalg/dense.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/random_devices.hpp"

namespace cardan::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using std::numbers::pi;

/// Air at rest in the world, of this density at its origin, and less by exp(-1e-6) in a metre.
struct RarefiedAir {
  double rho = 3e-9, R = 500.0, T = 900.0, wall = 350.0;
  double c() const { return std::sqrt(2.0 * R * T); }

  SystemSpec around(BodySpec body, std::vector<DeviceSpec> plates) const {
    SystemSpec spec = system({std::move(body)});
    FieldSpec air;
    air.name = "air", air.type = "exponential_atmosphere";
    for (const auto& [key, x] : {std::pair("density", rho), std::pair("radius", 1e6), std::pair("height", -1e6),
                                 std::pair("scale_height", 1e6), std::pair("lowest", -1e7)})
      air.params[key] = number(x);
    spec.fields = {air}, spec.devices = std::move(plates);
    return spec;
  }
  DeviceSpec plate(const std::string& name, const std::string& at, double area, const Vector3d& normal, double accommodation = 1.0,
                   bool both = false) const {
    DeviceSpec d = with_vector(
        device(name, "plate_drag",
               {{"area", area}, {"temperature", T}, {"gas_constant", R}, {"wall_temperature", wall}, {"accommodation", accommodation}},
               {{"at", at}}),
        "normal", normal);
    d.params["both_sides"].value = both;
    return d;
  }
  /// On all plates of a body of 1 kg that has this velocity and attitude: the force, world axes.
  Vector3d force(const std::vector<DeviceSpec>& plates, const Vector3d& velocity, const Matrix3d& attitude = Matrix3d::Identity()) const {
    BodySpec body = on(rigid("body", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "free");
    const Eigen::Quaterniond q(attitude);
    body.hinge.q = {q.w(), q.x(), q.y(), q.z(), 0, 0, 0}, body.hinge.v = {0, 0, 0, velocity[0], velocity[1], velocity[2]};
    Simulation sim(compiled(around(body, plates)), {});
    return sim.vdot().segment<3>(3);
  }
};

/// Simpson's rule over velocities from 0 to `most`.
template <class F>
double integral(double most, const F& f) {
  const int n = 4000;
  double sum = 0.0;
  for (int i = 0; i <= n; ++i) sum += (i == 0 || i == n ? 1.0 : i % 2 == 1 ? 4.0 : 2.0) * f(most * i / n);
  return sum * most / n / 3.0;
}

/// What molecules bring that fall on a side with the normal n, and what they take along when they leave in all directions.
Vector3d by_molecules(const RarefiedAir& air, const Vector3d& stream, const Vector3d& n, double accommodation) {
  const double c = air.c(), towards = -stream.dot(n), RT = air.R * air.T;
  const Vector3d along = stream + towards * n;
  const auto part = [&](double x) { return std::exp(-std::pow((x - towards) / c, 2)) / (std::sqrt(pi) * c); };  // of a speed x towards it
  const double most = std::max(0.0, towards) + 9.0 * c;
  const double flux = air.rho * integral(most, [&](double x) { return x * part(x); });
  const double pressure = air.rho * integral(most, [&](double x) { return x * x * part(x); });
  const double energy = air.rho * integral(most, [&](double x) { return x * part(x) * (0.5 * x * x + 0.5 * along.squaredNorm() + RT); });
  const double R_leaving = (1.0 - accommodation) * energy / flux / 2.0 + accommodation * air.R * air.wall;  // 2 k T each
  return flux * along - (pressure + flux * std::sqrt(pi * R_leaving / 2.0)) * n;
}

TEST(PlateDrag, IsThatOfItsMolecules) {
  const RarefiedAir air;
  const Vector3d n = Vector3d(2, -1, 2) / 3.0;
  const Matrix3d attitude = Eigen::AngleAxisd(0.9, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  for (const double ratio : {0.0, 0.4, 2.0, 9.0})
    for (const Vector3d& direction : {Vector3d(1, 0, 0), Vector3d(-1, 2, 1), Vector3d(0.3, -1, 0.2)})
      for (const double accommodation : {1.0, 0.6, 0.0}) {
        const Vector3d v = ratio * air.c() * direction.normalized(), normal = attitude * n;
        if (ratio > 5.0 && v.dot(normal) < 0.0) continue;  // next to nothing
        const Vector3d truth = 0.7 * by_molecules(air, -v, normal, accommodation);
        const Vector3d got = air.force({air.plate("plate", "body", 0.7, n, accommodation)}, v, attitude);
        EXPECT_LT((got - truth).norm() / truth.norm(), 1e-10) << ratio << ", " << direction.transpose() << ", " << accommodation;
        const Vector3d both = truth + 0.7 * by_molecules(air, -v, -normal, accommodation);
        if (ratio == 0.4) {
          EXPECT_LT((air.force({air.plate("plate", "body", 0.7, n, accommodation, true)}, v, attitude) - both).norm() / both.norm(), 1e-9);
        }
      }
}

/// Air at rest, as warm as the wall, presses with rho R T; and on both sides alike.
TEST(PlateDrag, FeelsThePressureOfAirAtRest) {
  RarefiedAir air;
  air.wall = air.T;
  for (const double accommodation : {1.0, 0.3}) {
    const Vector3d one = air.force({air.plate("plate", "body", 2.0, {0, 1, 0}, accommodation)}, {0, 0, 0});
    EXPECT_NEAR(one.y() / (-2.0 * air.rho * air.R * air.T), 1.0, 1e-14);
    EXPECT_EQ(air.force({air.plate("plate", "body", 2.0, {0, 1, 0}, accommodation, true)}, {0, 0, 0}).norm(), 0.0);
  }
}

/// A sphere of plates, at the places of Gauss along its axis and three around it, has the drag of a sphere [Schaaf, Chambre 1961]:
/// C_D = (2 s^2 + 1) exp(-s^2) / (sqrt(pi) s^3) + (4 s^4 + 4 s^2 - 1) erf(s) / (2 s^4) + 2 sqrt(pi) / (3 s) sqrt(T_wall / T).
TEST(PlateDrag, OfASphereOfPlatesIsThatOfASphere) {
  const RarefiedAir air;
  const int n = 32, around = 3;
  Eigen::MatrixXd jacobi = Eigen::MatrixXd::Zero(n, n);  // of Legendre's polynomials [Golub, Welsch 1969]
  for (int k = 1; k < n; ++k) jacobi(k, k - 1) = jacobi(k - 1, k) = k / std::sqrt(4.0 * k * k - 1.0);
  const DensePairs places = symmetric_pairs(jacobi);
  std::vector<DeviceSpec> plates;
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < around; ++k) {
      const double x = places.values[i], weight = 2.0 * std::pow(places.vectors(0, i), 2), y = std::sqrt(1.0 - x * x);
      const double turn = 2.0 * pi * k / around;
      plates.push_back(air.plate("plate_" + std::to_string(plates.size()), "body", weight * 2.0 * pi / around,
                                 {x, y * std::cos(turn), y * std::sin(turn)}));
    }
  for (const double s : {0.3, 1.0, 3.0}) {
    const double U = s * air.c();
    const double drag = (2 * s * s + 1) * std::exp(-s * s) / (std::sqrt(pi) * s * s * s) +
                        (4 * std::pow(s, 4) + 4 * s * s - 1) * std::erf(s) / (2 * std::pow(s, 4)) +
                        2.0 * std::sqrt(pi) / (3.0 * s) * std::sqrt(air.wall / air.T);
    const Vector3d force = air.force(plates, {U, 0, 0});
    EXPECT_NEAR(-force.x() / (0.5 * air.rho * U * U * pi), drag, 1e-9 * drag) << s;
    EXPECT_LT(force.tail<2>().norm(), 1e-12 * std::abs(force.x()));
  }
}

/// What flies with the wind feels air at rest.
TEST(PlateDrag, IsThatOfTheVelocityInTheWind) {
  const RarefiedAir air;
  const double r = 1000.0, rate = 0.5;
  const auto force = [&](double speed, bool wind) {
    BodySpec body = on(rigid("body", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "free");
    body.hinge.q = {1, 0, 0, 0, r, 0, 0}, body.hinge.v = {0, 0, 0, 0, speed, 0};
    SystemSpec spec = air.around(body, {air.plate("plate", "body", 1.0, {0, 1, 0})});
    FieldSpec turning;
    turning.name = "wind", turning.type = "co_rotating_wind", turning.params["rate"] = number(rate);
    if (wind) spec.fields.push_back(turning), spec.devices[0].mounts["wind"] = {"wind", {}};
    Simulation sim(compiled(spec), {});
    return Vector3d(sim.vdot().segment<3>(3));
  };
  const Vector3d still = force(0.0, false), blown = force(0.0, true);
  EXPECT_LT((force(rate * r, true) - still).norm(), 1e-14 * still.norm());
  EXPECT_LT((blown - force(-rate * r, false)).norm(), 1e-14 * still.norm());
  EXPECT_GT((blown - still).norm(), 0.1 * still.norm());
}

/// Two paddles at r of a wheel that turns slowly in air at rest: the moment is that of the first order,
/// -2 r 2 A rho c (1 / sqrt(pi) + sqrt(pi T_wall / T) / 4) r w, and the rate falls as an exponential.
TEST(PlateDrag, BrakesWhatTumbles) {
  const RarefiedAir air{1e-3, 500.0, 900.0, 350.0};
  const double r = 1.5, A = 0.2, J = 2.0, w = 1e-3;
  BodySpec wheel = on(rigid("wheel", 4.0, {0, 0, 0}, diagonal({J, J, J})), "", "revolute", {{0, 0, 1}});
  wheel.hinge.v = {w};
  for (const double side : {1.0, -1.0}) {
    NodeSpec paddle;
    paddle.name = side > 0.0 ? "left" : "right", paddle.position = {side * r, 0, 0};
    wheel.nodes.push_back(paddle);
  }
  const std::vector<DeviceSpec> paddles = {air.plate("one", "wheel.left", A, {0, 1, 0}, 1.0, true),
                                           air.plate("two", "wheel.right", A, {0, 1, 0}, 1.0, true)};
  const double rho = air.rho * std::exp(-1e-6 * r);
  const double k = 2.0 * r * r * 2.0 * A * rho * air.c() * (1.0 / std::sqrt(pi) + std::sqrt(pi * air.wall / air.T) / 4.0) / J;
  Simulation sim(compiled(air.around(wheel, paddles)), accurate("dop853", 1e-14));
  sim.run(2.0);
  EXPECT_GT(k, 0.3);
  EXPECT_NEAR(sim.state().v[0] / w, std::exp(-2.0 * k), 1e-9);
}

}  // namespace
}  // namespace cardan::test
