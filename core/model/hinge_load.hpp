#pragma once
// Forces on one velocity component of a hinge as laws of its coordinate and its velocity. The formulas stand in
// core/dynamics/hinge_laws.hpp.
#include <array>
#include <cstdint>
#include <limits>

namespace cardan {

enum class HingeLaw : std::uint8_t { spring, stop, friction };

/// What comes to a limit of a stop faster than `speed` [rad/s, m/s] leaves it at once with `restitution` times its rate.
struct Bounce {
  double restitution = 0.0, speed = std::numeric_limits<double>::infinity();
};

/// A law with its parameters, SI. A component that turns has its torques in N m and angles in rad, one that slides N and m.
struct HingeLoad {
  /// spring: stiffness, rest, damping. stop: lower, upper, stiffness, exponent, dissipation. friction: coulomb, breakaway, stribeck_rate,
  /// viscous, width.
  using Parameters = std::array<double, 5>;
  HingeLaw law = HingeLaw::spring;
  int q = 0, v = 0;  // of the coordinate and of the velocity, in the user's order
  Parameters p{};
  Bounce bounce{};  // of a stop
};

}  // namespace cardan
