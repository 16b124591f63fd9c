// Rotations, poses, spatial vectors and inertias by identities that hold for any numbers, and by Eigen's dense matrices of the
// same: each would fail on a wrong sign, a transposed rotation or a factor.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "core/spatial/eigen_bridge.hpp"
#include "core/spatial/inertia.hpp"
#include "core/spatial/rotation.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d, Eigen::MatrixXd, Eigen::Vector3d;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

constexpr double kRoundOff = 4e-15;  // a few hundred operations on numbers of order one

struct Random {
  std::mt19937_64 rng{7};
  double number() { return -1.0 + 2.0 * static_cast<double>(rng() >> 11) * 0x1.0p-53; }
  Vec3<double> vec3() { return {number(), number(), number()}; }
  Motion<double> motion() { return {vec3(), vec3()}; }
  Force<double> force() { return {vec3(), vec3()}; }
  Mat3<double> rotation() { return rotation_of_quaternion(number(), number(), number(), number()); }
  Pose<double> pose() { return {rotation(), vec3()}; }
  Sym3<double> sym3() { return {number(), number(), number(), number(), number(), number()}; }
  RigidInertia<double> inertia() {
    return about_origin(1.5 + number(), vec3(), Sym3<double>{2 + 0.3 * number(), 2.2, 1.9, 0.2 * number(), 0.1 * number(), 0.3 * number()});
  }
  ArticulatedInertia<double> articulated() {
    return {sym3(), {number(), number(), number(), number(), number(), number(), number(), number(), number()}, sym3()};
  }
};

Matrix3d tilde_of(const Vector3d& a) {
  Matrix3d t;
  t << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return t;
}
/// Phi*(A, B): velocities from A to B.
Matrix6 to_B(const Pose<double>& AB) {
  const Matrix3d R = to_eigen(AB.R).transpose();
  Matrix6 X;
  X << R, Matrix3d::Zero(), -R * tilde_of(to_eigen(AB.p)), R;
  return X;
}
Matrix6 dense(const RigidInertia<double>& M) {
  const Matrix3d h = tilde_of(to_eigen(M.h));
  Matrix6 out;
  out << to_eigen(M.J), h, -h, M.m * Matrix3d::Identity();
  return out;
}
Matrix6 dense(const ArticulatedInertia<double>& P) {
  Matrix6 out;
  out << to_eigen(P.J), to_eigen(P.B), to_eigen(P.B).transpose(), to_eigen(P.M);
  return out;
}
Vector6 dense(const Motion<double>& V) { return to_eigen(V); }
Vector6 dense(const Force<double>& f) { return to_eigen(f); }

double apart(const MatrixXd& a, const MatrixXd& b) { return (a - b).cwiseAbs().maxCoeff<Eigen::PropagateNaN>(); }
#define EXPECT_SAME(a, b) EXPECT_LE(apart(a, b), kRoundOff)

TEST(Vectors, CrossIsTheTildeMatrixAndRightHanded) {
  Random r;
  const Vec3<double> a = r.vec3(), b = r.vec3();
  EXPECT_SAME(to_eigen(cross(a, b)), to_eigen(a).cross(to_eigen(b)));
  EXPECT_SAME(to_eigen(tilde(a)), tilde_of(to_eigen(a)));
  EXPECT_SAME(to_eigen(tilde(a) * b), to_eigen(cross(a, b)));
  const Vec3<double> z = cross(Vec3<double>{1, 0, 0}, Vec3<double>{0, 1, 0});
  EXPECT_EQ(z.z, 1.0);
}

TEST(Vectors, EntriesByIndexAreThoseOfTheMatrix) {
  Mat3<double> m{1, 2, 3, 4, 5, 6, 7, 8, 9};
  Sym3<double> s{1, 5, 9, 2, 3, 6};
  EXPECT_EQ((entry<0, 2>(m)), 3.0);
  EXPECT_EQ((entry<2, 0>(m)), 7.0);
  EXPECT_EQ((entry<1, 2>(s)), 6.0);
  EXPECT_EQ((entry<2, 1>(s)), 6.0);
  const Matrix3d full = (Matrix3d() << 1, 2, 3, 2, 5, 6, 3, 6, 9).finished();
  EXPECT_SAME(to_eigen(s), full);
}

TEST(Vectors, ProductsOfMatricesAreThoseOfEigen) {
  Random r;
  const Mat3<double> a = r.rotation(), b = r.articulated().B;
  const Sym3<double> s = r.sym3();
  const Vec3<double> x = r.vec3();
  EXPECT_SAME(to_eigen(a * b), to_eigen(a) * to_eigen(b));
  EXPECT_SAME(to_eigen(b * x), to_eigen(b) * to_eigen(x));
  EXPECT_SAME(to_eigen(transpose_times(b, x)), to_eigen(b).transpose() * to_eigen(x));
  EXPECT_SAME(to_eigen(s * x), to_eigen(s) * to_eigen(x));
  EXPECT_SAME(to_eigen(rotate(a, s)), to_eigen(a) * to_eigen(s) * to_eigen(a).transpose());
}

TEST(Rotations, OfAxisQuaternionAndVectorAgreeWithEigen) {
  Random r;
  for (const double angle : {0.0, 1e-9, 0.3, 0.999, 1.0, 1.001, 2.5, -3.1, 6.0}) {
    const Vector3d axis = to_eigen(r.vec3()).normalized();
    const Matrix3d R = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    EXPECT_SAME(to_eigen(rotation_about(from_eigen(axis), std::sin(angle), std::cos(angle))), R);
    const Vec3<double> t = from_eigen(Vector3d(angle * axis));
    EXPECT_SAME(to_eigen(rotation_of_vector(rotation_coefficients(dot(t, t)), t)), R)
        << "series and closed form, on either side of |t| = 1";
    const double c = std::cos(angle / 2), s = std::sin(angle / 2);
    EXPECT_SAME(to_eigen(rotation_of_quaternion(c, s * axis.x(), s * axis.y(), s * axis.z())), R) << "(w, x, y, z)";
    EXPECT_SAME(to_eigen(rotation_of_quaternion(-3 * c, -3 * s * axis.x(), -3 * s * axis.y(), -3 * s * axis.z())), R)
        << "of any length and sign";
  }
}

TEST(Rotations, LeftJacobianIsTheAngularVelocityInBaseAxes) {
  Random r;
  for (const double size : {1e-3, 0.5, 0.99, 1.01, 2.5}) {
    const Vector3d t = size * to_eigen(r.vec3()).normalized(), d = to_eigen(r.vec3()), g = to_eigen(r.vec3());
    const auto R = [](const Vector3d& x) {
      const Vec3<double> v = from_eigen(x);
      return to_eigen(rotation_of_vector(rotation_coefficients(dot(v, v)), v));
    };
    const auto Jl = [](const Vector3d& x, const Vector3d& y) {
      const Vec3<double> v = from_eigen(x);
      return to_eigen(left_jacobian(rotation_coefficients(dot(v, v)), v, from_eigen(y)));
    };
    constexpr double h = 1e-3;  // differences of fourth order: h^4 = 1e-12, eps / h = 2e-13
    const Matrix3d dR = (8 * (R(t + h * d) - R(t - h * d)) - (R(t + 2 * h * d) - R(t - 2 * h * d))) / (12 * h);
    EXPECT_LE(apart(dR * R(t).transpose(), tilde_of(Jl(t, d))), 1e-11);
    const Vector3d dJ = (8 * (Jl(t + h * d, g) - Jl(t - h * d, g)) - (Jl(t + 2 * h * d, g) - Jl(t - 2 * h * d, g))) / (12 * h);
    const Vec3<double> v = from_eigen(t);
    EXPECT_LE(apart(dJ, to_eigen(left_jacobian_dot(rotation_coefficients(dot(v, v)), v, from_eigen(d), from_eigen(g)))), 1e-11);
  }
}

TEST(Poses, ComposeAndInvertAsMovesOfPoints) {
  Random r;
  const Pose<double> AB = r.pose(), BC = r.pose(), AC = AB * BC;
  const Vector3d x = to_eigen(r.vec3());
  const auto moved = [](const Pose<double>& X, const Vector3d& p) -> Vector3d { return to_eigen(X.R) * p + to_eigen(X.p); };
  EXPECT_SAME(moved(AC, x), moved(AB, moved(BC, x)));
  EXPECT_SAME(moved(inverse(AB), moved(AB, x)), x);
}

TEST(Poses, MoveVelocitiesAndForcesByDualMaps) {
  Random r;
  const Pose<double> AB = r.pose(), BC = r.pose();
  const Motion<double> V = r.motion();
  const Force<double> f = r.force();
  EXPECT_SAME(dense(to_outboard(AB, V)), to_B(AB) * dense(V));
  EXPECT_SAME(dense(to_inboard(AB, f)), to_B(AB).transpose() * dense(f));
  EXPECT_SAME(dense(to_inboard(AB, to_outboard(AB, V))), dense(V));
  EXPECT_SAME(dense(to_outboard(AB, to_inboard(AB, f))), dense(f));
  EXPECT_SAME(dense(to_outboard(AB * BC, V)), dense(to_outboard(BC, to_outboard(AB, V))));
  EXPECT_NEAR(dot(to_outboard(AB, V), f), dot(V, to_inboard(AB, f)), kRoundOff) << "power is the same on both sides";
}

TEST(Inertias, OfARigidBodyIsTheSumOverItsMasses) {
  Random r;
  // four particles; their inertia about the mass centre taken to the origin is the sum of each about the origin
  double m = 0.0;
  Vector3d c = Vector3d::Zero();
  std::vector<std::pair<double, Vector3d>> points;
  for (int i = 0; i < 4; ++i) {
    points.emplace_back(1.1 + r.number(), to_eigen(r.vec3()));
    m += points.back().first;
    c += points.back().first * points.back().second;
  }
  c /= m;
  Matrix3d about_c = Matrix3d::Zero();
  RigidInertia<double> sum;
  for (const auto& [mass, p] : points) {
    about_c -= mass * tilde_of(p - c) * tilde_of(p - c);
    sum = sum + about_origin(mass, from_eigen(p), Sym3<double>{});
  }
  EXPECT_SAME(dense(about_origin(m, from_eigen(c), symmetric(about_c))), dense(sum));
  const Motion<double> V = r.motion();
  Vector6 momentum = Vector6::Zero();
  for (const auto& [mass, p] : points) {
    const Vector3d linear = mass * (to_eigen(V.v) + to_eigen(V.w).cross(p));
    momentum.head<3>() += p.cross(linear);
    momentum.tail<3>() += linear;
  }
  EXPECT_SAME(dense(sum * V), momentum);
  Vector6 gyroscopic_force = Vector6::Zero();  // centripetal forces of the particles at constant w
  for (const auto& [mass, p] : points) {
    const Vector3d w = to_eigen(V.w), force = mass * w.cross(w.cross(p));
    gyroscopic_force.head<3>() += p.cross(force);
    gyroscopic_force.tail<3>() += force;
  }
  EXPECT_SAME(dense(gyroscopic(sum, V.w)), gyroscopic_force);
}

TEST(Inertias, RotateAndShiftAsPhiMPhiStar) {
  Random r;
  const Pose<double> AB = r.pose();
  const RigidInertia<double> M = r.inertia();
  EXPECT_SAME(dense(to_inboard(AB, M)), to_B(AB).transpose() * dense(M) * to_B(AB));
  EXPECT_SAME(dense(articulated(M)), dense(M));
  const ArticulatedInertia<double> P = r.articulated();
  EXPECT_SAME(dense(to_inboard(AB, P)), to_B(AB).transpose() * dense(P) * to_B(AB));
  EXPECT_SAME(dense(shift(AB.p, P)), dense(to_inboard(Pose<double>{Mat3<double>::identity(), AB.p}, P)));
  const Motion<double> V = r.motion();
  EXPECT_SAME(dense(P * V), dense(P) * dense(V));
  EXPECT_SAME(dense(M * V), dense(M) * dense(V));
}

TEST(Inertias, AddAndLoseColumnsBlockByBlock) {
  Random r;
  const ArticulatedInertia<double> P = r.articulated(), Q = r.articulated();
  EXPECT_SAME(dense(P + Q), dense(P) + dense(Q));
  ArticulatedInertia<double> x = P;
  x += Q;
  x -= P;
  EXPECT_SAME(dense(x), dense(Q));
  const Force<double> a = r.force(), b = 0.7 * a;
  x = P;
  subtract_outer(x, a, b);
  EXPECT_SAME(dense(x), dense(P) - dense(a) * dense(b).transpose());
}

}  // namespace
}  // namespace cardan
