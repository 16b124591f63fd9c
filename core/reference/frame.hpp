#pragma once
// A frame of the twin in world axes, with its motion.
#include "core/reference/leaves.hpp"

namespace cardan::reference {

template <class T>
struct Frame {
  Mat3<T> R = Mat3<T>::Identity();                          // its axes to world axes
  Vec3<T> x = Vec3<T>::Zero();                              // [m]
  Vec3<T> w = Vec3<T>::Zero(), xdot = Vec3<T>::Zero();      // angular velocity, velocity
  Mat3X<T> Jw, Jx;                                          // w = Jw v, xdot = Jx v
  Vec3<T> wdot = Vec3<T>::Zero(), xddot = Vec3<T>::Zero();  // angular and classical acceleration at v' = 0
};

}  // namespace cardan::reference
