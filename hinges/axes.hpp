#pragma once
// Small rotations shared by the hinges.
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "core/abi/family.hpp"

namespace cardan {

/// Two successive rotations about such axes (unit vectors) are one: the hinge's inertia would lose ten digits.
inline bool nearly_parallel(const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return a.cross(b).norm() < 1e-5; }

/// `axes` of a hinge type that takes two orthogonal ones; false: told.
inline bool orthogonal_axes(const Params& params, Eigen::Vector3d& e1, Eigen::Vector3d& e2) {
  e1 = params.vector("axes", 0), e2 = params.vector("axes", 1);
  return std::abs(e1.dot(e2)) <= 1e-6 || params.fail("axes", "two orthogonal vectors");
}

/// exp(u~ q), u of unit length (Rodrigues).
inline Eigen::Matrix3d rotation_about_axis(const Eigen::Vector3d& u, double q) {
  const double s = std::sin(q), h = std::sin(0.5 * q), k = 2.0 * h * h;  // k = 1 - cos q without cancellation
  Eigen::Matrix3d t;
  t << 0, -u.z(), u.y(), u.z(), 0, -u.x(), -u.y(), u.x(), 0;
  return Eigen::Matrix3d::Identity() + s * t + k * (u * u.transpose() - Eigen::Matrix3d::Identity());
}

/// Unit quaternions q = (w, x, y, z), P axes to O axes; v = omega of P in O, P axes.
struct QuaternionKinematics {
  /// R(q / |q|).
  static Eigen::Matrix3d rotation(const double* q) {
    const double w = q[0], x = q[1], y = q[2], z = q[3], s = 2.0 / (w * w + x * x + y * y + z * z);
    Eigen::Matrix3d R;
    R << 1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y), s * (x * y + w * z), 1 - s * (x * x + z * z),
        s * (y * z - w * x), s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y);
    return R;
  }
  /// q' = N(q) omega = 1/2 q o (0, omega).
  static void qdot(const double* q, const double* o, double* qd) {
    qd[0] = 0.5 * (-q[1] * o[0] - q[2] * o[1] - q[3] * o[2]);
    qd[1] = 0.5 * (q[0] * o[0] + q[2] * o[2] - q[3] * o[1]);
    qd[2] = 0.5 * (q[0] * o[1] + q[3] * o[0] - q[1] * o[2]);
    qd[3] = 0.5 * (q[0] * o[2] + q[1] * o[1] - q[2] * o[0]);
  }
  static void normalise(double* q) {
    const double s = 1.0 / std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; ++i) q[i] *= s;
  }
  /// q o exp(d / 2).
  static void retract(const double* q, const double* d, double* out) {
    const double t = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), c = std::cos(0.5 * t);
    const double s = t < 1e-4 ? 0.5 - t * t / 48.0 : std::sin(0.5 * t) / t;
    const double x = s * d[0], y = s * d[1], z = s * d[2];
    const double r[4] = {q[0] * c - q[1] * x - q[2] * y - q[3] * z, q[0] * x + q[1] * c + q[2] * z - q[3] * y,
                         q[0] * y + q[2] * c + q[3] * x - q[1] * z, q[0] * z + q[3] * c + q[1] * y - q[2] * x};
    for (int i = 0; i < 4; ++i) out[i] = r[i];
    normalise(out);
  }
  /// d with retract(a, d) = b, |d| <= pi: 2 log(a^-1 o b).
  static void difference(const double* a, const double* b, double* d) {
    double w = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    double x = a[0] * b[1] - a[1] * b[0] - a[2] * b[3] + a[3] * b[2];
    double y = a[0] * b[2] - a[2] * b[0] - a[3] * b[1] + a[1] * b[3];
    double z = a[0] * b[3] - a[3] * b[0] - a[1] * b[2] + a[2] * b[1];
    if (w < 0) w = -w, x = -x, y = -y, z = -z;
    const double n = std::sqrt(x * x + y * y + z * z);
    const double s = n < 1e-8 ? 2.0 / w : 2.0 * std::atan2(n, w) / n;
    d[0] = s * x;
    d[1] = s * y;
    d[2] = s * z;
  }
};

}  // namespace cardan
