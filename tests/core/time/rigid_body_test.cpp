// Quaternion kinematics under each method: q' = q o (0, w)/2 + k (1 - |q|^2) q, scalar first, w in body axes.
#include <Eigen/Geometry>
#include <numbers>

#include "tests/core/time/problems.hpp"

namespace cardan::test {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

OdeProblem torque_free_body(const Vector3d& inertia) {
  OdeProblem p = problem(7, [inertia](double, const double* x, double* xdot) {
    const Quaterniond q(x[0], x[1], x[2], x[3]);
    const Vector3d w(x[4], x[5], x[6]);
    const Quaterniond rate = q * Quaterniond(0.0, w[0], w[1], w[2]);
    const double pull = 1.0 - q.squaredNorm();
    xdot[0] = 0.5 * rate.w() + pull * q.w();
    for (int i = 0; i < 3; ++i) xdot[1 + i] = 0.5 * rate.vec()[i] + pull * q.vec()[i];
    const Vector3d h = inertia.cwiseProduct(w);
    const Vector3d acceleration = h.cross(w).cwiseQuotient(inertia);
    for (int i = 0; i < 3; ++i) xdot[4 + i] = acceleration[i];
    return true;
  });
  p.project = [](double, double* x) {
    Eigen::Map<Eigen::Vector4d> q(x);
    q.normalize();
  };
  return p;
}

Vector3d spin(const Values& x) { return {x[4], x[5], x[6]}; }
Quaterniond attitude(const Values& x) { return {x[0], x[1], x[2], x[3]}; }

/// Angle between two attitudes [rad], also for small ones.
double angle(const Quaterniond& a, const Quaterniond& b) { return 2.0 * (a.conjugate() * b).vec().norm(); }

/// sn, cn, dn by descending Landen steps (Abramowitz, Stegun 16.4).
Vector3d jacobi(double u, double m) {
  double a[12], c[12], b = std::sqrt(1.0 - m);
  a[0] = 1.0;
  c[0] = std::sqrt(m);
  int n = 0;
  for (; std::abs(c[n]) > 1e-16 && n < 11; ++n) {
    a[n + 1] = 0.5 * (a[n] + b);
    c[n + 1] = 0.5 * (a[n] - b);
    b = std::sqrt(a[n] * b);
  }
  double phi = std::ldexp(a[n] * u, n);
  for (; n > 0; --n) phi = 0.5 * (phi + std::asin(c[n] / a[n] * std::sin(phi)));
  return {std::sin(phi), std::cos(phi), std::sqrt(1.0 - m * std::sin(phi) * std::sin(phi))};
}

class EveryMethodRigidBody : public EveryMethod {};

/// A symmetric body: it turns about its axis while the axis turns about the momentum (Euler 1758).
TEST_P(EveryMethodRigidBody, SymmetricBodyKeepsItsClosedForm) {
  const Vector3d inertia(3.0, 3.0, 2.0), w0(0.4, 0.0, 1.0);
  const double t = 20.0;
  auto integrator = make(torque_free_body(inertia));
  const Values x = integrate(*integrator, 0.0, {1, 0, 0, 0, w0[0], w0[1], w0[2]}, t);
  const Vector3d h = inertia.cwiseProduct(w0);
  const double relative_spin = (1.0 - inertia[2] / inertia[0]) * w0[2];
  const Quaterniond exact = Quaterniond(Eigen::AngleAxisd(h.norm() / inertia[0] * t, h.normalized())) *
                            Quaterniond(Eigen::AngleAxisd(relative_spin * t, Vector3d::UnitZ()));
  EXPECT_LT(angle(attitude(x), exact), 1e-7);
  EXPECT_NEAR(attitude(x).norm(), 1.0, 4e-16);
}

/// Three different moments: w in Jacobi's elliptic functions (Landau, Lifshitz, Mechanics, section 37), here for
/// h^2 > 2 T I2 and a start at w2 = 0; the attitude through the momentum, which stands still in space.
TEST_P(EveryMethodRigidBody, AsymmetricBodyFollowsEllipticFunctions) {
  const Vector3d inertia(1.0, 2.0, 3.0), w0(0.5, 0.0, 1.0);
  const double t = 20.0;
  auto integrator = make(torque_free_body(inertia));
  const Values x = integrate(*integrator, 0.0, {1, 0, 0, 0, w0[0], w0[1], w0[2]}, t);

  const Vector3d h = inertia.cwiseProduct(w0);
  const double hh = h.squaredNorm(), tt = h.dot(w0);
  const double i1 = inertia[0], i2 = inertia[1], i3 = inertia[2];
  ASSERT_GT(hh, tt * i2);
  const double rate = std::sqrt((i3 - i2) * (hh - tt * i1) / (i1 * i2 * i3));
  const double m = (i2 - i1) * (tt * i3 - hh) / ((i3 - i2) * (hh - tt * i1));
  const Vector3d f = jacobi(rate * t, m);
  const Vector3d exact(std::sqrt((tt * i3 - hh) / (i1 * (i3 - i1))) * f[1], std::sqrt((tt * i3 - hh) / (i2 * (i3 - i2))) * f[0],
                       std::sqrt((hh - tt * i1) / (i3 * (i3 - i1))) * f[2]);
  EXPECT_LT((spin(x) - exact).norm(), 1e-7);
  const Vector3d momentum = attitude(x) * inertia.cwiseProduct(spin(x));
  EXPECT_LT((momentum - h).norm(), 1e-7);
}

INSTANTIATE_TEST_SUITE_P(, EveryMethodRigidBody,
                         testing::Values("ark_explicit", "ark_imex", "ark_implicit", "cvode_adams", "cvode_bdf", "dop853", "dopri5",
                                         "multirate", "rk4"),
                         parameter_name);

}  // namespace
}  // namespace cardan::test
