#pragma once
// What sampled sensors have in common: readings that are held, steps of a converter, a range, axes that are turned a little.
#include <Eigen/Geometry>
#include <cmath>

#include "core/abi/device_family.hpp"

namespace cardan {

/// The first n outputs are the first n marks, held since the last sample.
template <int n, class T>
void give_held(const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
  for (int i = 0; i < n; ++i) out.out[i] = T(in.d[i]);
}

/// To the nearest multiple of a step; 0: as it is.
inline double to_steps(double x, double step) noexcept { return step > 0.0 ? step * std::floor(x / step + 0.5) : x; }
/// Within `most` of 0; 0: any.
inline double to_range(double x, double most) noexcept { return most > 0.0 ? std::fmin(std::fmax(x, -most), most) : x; }

inline Eigen::Vector3d as_vector(const double* x) noexcept { return {x[0], x[1], x[2]}; }
/// Axes that are turned by a rotation vector [rad], in those that they are turned from.
inline Eigen::Quaterniond turned(const Eigen::Vector3d& e) noexcept {
  const double angle = e.norm(), sine = angle > 0.0 ? std::sin(0.5 * angle) / angle : 0.5;
  return {std::cos(0.5 * angle), sine * e.x(), sine * e.y(), sine * e.z()};
}
/// A small rotation of normal numbers: each component across the unit vector u has the standard deviation `across`, that about it `about`.
inline Eigen::Vector3d scatter(const double* normal, const Eigen::Vector3d& u, double across, double about) noexcept {
  const Eigen::Vector3d n = as_vector(normal);
  return across * n + (about - across) * n.dot(u) * u;
}
/// Precise for small angles too.
inline double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) noexcept { return std::atan2(a.cross(b).norm(), a.dot(b)); }

}  // namespace cardan
