#pragma once
// The fastest of springs, dampers and modes of a vehicle at one state: what an explicit method must follow, whether it moves or not.
#include <memory>
#include <string>
#include <utility>

#include "core/model/model.hpp"

namespace cardan {

struct FastestMotion {
  double rate = 0.0;  // [1/s] of decay, or angular frequency [rad/s]; 0: nothing is elastic or damped
  bool decays = false;
  std::string what;  // "the damper of boom.angle"
};

struct FastestMotions {
  FastestMotion swings, decays;
  const FastestMotion& faster() const { return decays.rate > swings.rate ? decays : swings; }
};

/// Of M v' = -K q - C v, M at q, prescribed components held: the root of the largest eigenvalue of M^-1 K, and that of M^-1 C, by some
/// forty products, each O(N); of closed loops in their motions alone, by ClosedSystem. A few per cent low where many are as fast.
FastestMotions fastest_motions(std::shared_ptr<const Model> model, const double* q);
/// The faster one.
inline FastestMotion fastest_motion(std::shared_ptr<const Model> model, const double* q) {
  return fastest_motions(std::move(model), q).faster();
}

}  // namespace cardan
