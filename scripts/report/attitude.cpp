#include "scripts/report/attitude.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

namespace cardan {
namespace {

using Angles = std::array<double, 3>;      // yaw, pitch, roll [rad]
using Quaternion = std::array<double, 4>;  // w, x, y, z
constexpr double kPi = std::numbers::pi;
constexpr double kLocked = 1e-9;  // cosine of the pitch below which yaw and roll are about one axis

Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

/// Of length 1; nothing where it has no direction.
std::optional<Quaternion> unit(std::span<const double> x) {
  Quaternion q{x[0], x[1], x[2], x[3]};
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(length > 0.0 && length <= std::numeric_limits<double>::max())) return std::nullopt;
  for (double& c : q) c /= length;
  return q;
}

/// The angle nearest to `before` that differs from x by whole turns.
double nearest(double x, double before) { return x + 2 * kPi * std::round((before - x) / (2 * kPi)); }

double distance(const Angles& a, const Angles& b) {
  return std::max({std::abs(a[0] - b[0]), std::abs(a[1] - b[1]), std::abs(a[2] - b[2])});
}

Angles angles_321(const Quaternion& q, const Angles& before) {
  const auto [w, x, y, z] = q;
  const double R00 = w * w + x * x - y * y - z * z, R10 = 2 * (x * y + w * z), R20 = 2 * (x * z - w * y), R21 = 2 * (y * z + w * x),
               R22 = w * w - x * x - y * y + z * z, R01 = 2 * (x * y - w * z), R11 = w * w - x * x + y * y - z * z;
  const double cosine = std::hypot(R00, R10), pitch = std::atan2(-R20, cosine);
  const auto near = [&](Angles a) {
    for (std::size_t k = 0; k < 3; ++k) a[k] = nearest(a[k], before[k]);
    return a;
  };
  if (cosine < kLocked) {  // R holds roll - yaw alone, or roll + yaw
    const double yaw = before[0];
    return near({yaw, pitch, pitch > 0 ? yaw + std::atan2(R01, R11) : std::atan2(-R01, R11) - yaw});
  }
  const double yaw = std::atan2(R10, R00), roll = std::atan2(R21, R22);
  const Angles one = near({yaw, pitch, roll}), other = near({yaw + kPi, kPi - pitch, roll + kPi});
  return distance(one, before) <= distance(other, before) ? one : other;
}

}  // namespace

AttitudeAngles attitude_angles(std::span<const double> quaternions, std::size_t rows, std::span<const double> from) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN(), kDegrees = 180 / kPi;
  AttitudeAngles out;
  out.rows.assign(4 * rows, kNone);
  std::optional<Quaternion> first;
  Angles before{};
  for (std::size_t i = 0; i < rows; ++i) {
    const std::optional<Quaternion> q = unit(quaternions.subspan(4 * i, 4));
    if (!from.empty()) first = unit(from.subspan(4 * i, 4));
    if (from.empty() && !first) first = q;
    if (!q || !first) continue;
    const Quaternion p = product({(*first)[0], -(*first)[1], -(*first)[2], -(*first)[3]}, *q);
    const Angles a = angles_321(p, before);
    const bool jumps = distance(a, before) > kPi / 2;
    before = a;
    if (jumps) {
      ++out.jumps;
      continue;
    }
    out.rows[4 * i] = 2 * kDegrees * std::atan2(std::sqrt(p[1] * p[1] + p[2] * p[2] + p[3] * p[3]), std::abs(p[0]));
    for (std::size_t k = 0; k < 3; ++k) out.rows[4 * i + 1 + k] = kDegrees * a[k];
  }
  return out;
}

}  // namespace cardan
