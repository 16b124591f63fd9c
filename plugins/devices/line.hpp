#pragma once
// The line between two nodes, of what pulls along it.
#include <cmath>

#include "core/abi/device_family.hpp"

namespace cardan {

/// Of the way to a node, some roundings: a nearer one is where it is, as far as 53 bits tell, and a line between them has any direction.
inline constexpr double kOnePoint = 2e-15;

template <class T>
struct NodeLine {
  Vec3<T> u;  // unit vector from the first to the second, world axes; 0 where the nodes are at one point but for rounding
  T length, rate;
};
template <class T>
NodeLine<T> line_between(const DeviceIn<T>& in) noexcept {
  using std::sqrt;
  const Vec3<T> d = in.at[1].position - in.at[0].position;
  const T square = dot(d, d);
  if (square < T(kOnePoint * kOnePoint) * dot(in.at[0].position, in.at[0].position) + T(1e-300)) return {{}, T(0.0), T(0.0)};
  const T length = sqrt(square);
  const Vec3<T> u = (T(1.0) / length) * d;
  return {u, length, dot(u, in.at[1].R_WN * in.at[1].velocity - in.at[0].R_WN * in.at[0].velocity)};
}
/// Towards each other with this tension.
template <class T>
void pull_along(const NodeLine<T>& line, const T& tension, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
  const Vec3<T> pull = tension * line.u;
  out.load[0].force = transpose_times(in.at[0].R_WN, pull);
  out.load[1].force = transpose_times(in.at[1].R_WN, -pull);
}

inline constexpr auto kLineUse = CARDAN_USE_POSE | CARDAN_USE_VELOCITY | CARDAN_USE_LOAD;
inline constexpr cardan_mount_desc kLineMounts[] = {{"from", CARDAN_MOUNT_NODE, kLineUse, "a node: one end"},
                                                    {"to", CARDAN_MOUNT_NODE, kLineUse, "a node: the other end"}};

}  // namespace cardan
