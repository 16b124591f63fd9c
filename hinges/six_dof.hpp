#pragma once
// What free and free_body share: coordinates [quaternion (w, x, y, z); position in O axes], six velocities.
#include <cstring>

#include "core/abi/family.hpp"
#include "hinges/axes.hpp"

namespace cardan {

struct SixDof : QuaternionKinematics {
  static constexpr int nq = 7, nv = 6;
  struct Packed {};
  static constexpr const char* q_names[] = {"qw", "qx", "qy", "qz", "x", "y", "z"};
  static constexpr const char* q_units[] = {"1", "1", "1", "1", "m", "m", "m"};
  static constexpr const char* v_names[] = {"wx", "wy", "wz", "vx", "vy", "vz"};
  static constexpr const char* v_units[] = {"rad/s", "rad/s", "rad/s", "m/s", "m/s", "m/s"};

  static bool pack(const Params&, Packed&) { return true; }
  static void zero(const Packed&, double* q) noexcept {
    std::memset(q, 0, nq * sizeof(double));
    q[0] = 1;
  }
  static void normalise(const Packed&, double* q) noexcept { QuaternionKinematics::normalise(q); }
};

}  // namespace cardan
