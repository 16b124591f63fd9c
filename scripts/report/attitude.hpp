#pragma once
// An attitude as angles that can be read: how far it is from where it began, or ought to be, and 3-2-1 angles that do not jump.
#include <cstddef>
#include <span>
#include <vector>

namespace cardan {

struct AttitudeAngles {
  /// Rows x 4 [deg]: turn, yaw, pitch, roll. NaN where the quaternion is none, and in the row behind each jump.
  std::vector<double> rows;
  /// Rows that are more than 90 deg from the row before in some angle: between them nobody knows which way it went.
  std::size_t jumps = 0;
};

/// Of `rows` quaternions w, x, y, z (body into world, of any length) from as many others, or from the first of them: q_0* q. turn is the
/// angle of that rotation, 0 to 180 deg. yaw, pitch, roll are its 3-2-1 (Tait-Bryan) angles, R = R_z(yaw) R_y(pitch) R_x(roll): about z,
/// then the new y, then the new x. Of the two triples for a rotation, and of their turns by 360 deg, each row takes what is nearest to the
/// row before, so that pitch goes on beyond 90 deg and yaw and roll beyond 180 deg; where pitch is +-90 deg, yaw stays.
AttitudeAngles attitude_angles(std::span<const double> quaternions, std::size_t rows, std::span<const double> from = {});

}  // namespace cardan
