#pragma once
// Between the sweep types and Eigen, for everything outside of the inner loop.
#include <Eigen/Core>

#include "core/spatial/inertia.hpp"

namespace cardan {

inline Vec3<double> from_eigen(const Eigen::Vector3d& a) { return {a.x(), a.y(), a.z()}; }
inline Mat3<double> from_eigen(const Eigen::Matrix3d& m) {
  return {m(0, 0), m(0, 1), m(0, 2), m(1, 0), m(1, 1), m(1, 2), m(2, 0), m(2, 1), m(2, 2)};
}
inline Sym3<double> symmetric(const Eigen::Matrix3d& m) {
  return {m(0, 0), m(1, 1), m(2, 2), 0.5 * (m(0, 1) + m(1, 0)), 0.5 * (m(0, 2) + m(2, 0)), 0.5 * (m(1, 2) + m(2, 1))};
}
inline Eigen::Vector3d to_eigen(const Vec3<double>& a) { return {a.x, a.y, a.z}; }
inline Eigen::Matrix3d to_eigen(const Mat3<double>& m) {
  return (Eigen::Matrix3d() << m.xx, m.xy, m.xz, m.yx, m.yy, m.yz, m.zx, m.zy, m.zz).finished();
}
inline Eigen::Matrix3d to_eigen(const Sym3<double>& m) {
  return (Eigen::Matrix3d() << m.xx, m.xy, m.xz, m.xy, m.yy, m.yz, m.xz, m.yz, m.zz).finished();
}
inline Eigen::Matrix<double, 6, 1> to_eigen(const Motion<double>& a) {
  return (Eigen::Matrix<double, 6, 1>() << a.w.x, a.w.y, a.w.z, a.v.x, a.v.y, a.v.z).finished();
}
inline Eigen::Matrix<double, 6, 1> to_eigen(const Force<double>& a) {
  return (Eigen::Matrix<double, 6, 1>() << a.n.x, a.n.y, a.n.z, a.f.x, a.f.y, a.f.z).finished();
}
inline Motion<double> motion(const double* a) { return {{a[0], a[1], a[2]}, {a[3], a[4], a[5]}}; }
inline Force<double> force(const double* a) { return {{a[0], a[1], a[2]}, {a[3], a[4], a[5]}}; }
/// 6 x 6 matrix of an articulated inertia.
inline Eigen::Matrix<double, 6, 6> to_eigen(const ArticulatedInertia<double>& P) {
  Eigen::Matrix<double, 6, 6> m;
  m.topLeftCorner<3, 3>() = to_eigen(P.J);
  m.topRightCorner<3, 3>() = to_eigen(P.B);
  m.bottomLeftCorner<3, 3>() = to_eigen(P.B).transpose();
  m.bottomRightCorner<3, 3>() = to_eigen(P.M);
  return m;
}

}  // namespace cardan
