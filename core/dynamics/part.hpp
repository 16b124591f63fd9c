#pragma once
// Some of the bodies of a model as a system of their own, without a model of their own: the sweeps over these bodies alone.
//
// Whoever's inboard body does not take part hangs on ground, where the inboard body is now, standing still. The others are not there:
// no mass, no force. An inward sweep adds to inboard bodies only, so over the runs of those that take part it is right as it is; an
// outward sweep needs the pose and the gravity of what they hang on, at rest.
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "core/soa/sweeps.hpp"
#include "core/soa/tangent.hpp"

namespace cardan {

struct Part {
  std::vector<std::uint8_t> takes_part;  // by sweep index
  std::vector<Run> runs;                 // those that take part, base to tip
  std::vector<Run> still;            // what they hang on and all inboard of it, base to tip (of bodies in between also such that take part)
  std::vector<int> rotors_left_out;  // rotors whose carrier takes part and they do not: M_sweep of the carrier has their inertia
};
/// The stretches of the runs whose bodies are marked, by sweep index.
std::vector<Run> stretches(const std::vector<Run>& runs, const std::vector<std::uint8_t>& marked);
Part part_of(const SweepModel& model, std::span<const int> sweep_bodies);

/// Parts are of one state, and of its derivative along a direction: of lanes there are none.
template <class T>
inline constexpr bool kHasParts = std::is_same_v<T, double> || std::is_same_v<T, soa::Tangent>;

template <class T>
void outward_of_part(const SweepModel& model, const soa::Sweeps<T>& S, soa::Workspace<T>& ws, const soa::Inputs<T>& in,
                     soa::OutwardFor what, const Part& part);
template <class T>
void world_of_part(const SweepModel& model, const soa::Sweeps<T>& S, soa::Workspace<T>& ws, const soa::Inputs<T>& in, const Part& part);
/// Loads on nodes of the part, then tip to base: tau of inverse dynamics.
template <class T>
void gather_of_part(const SweepModel& model, const soa::Sweeps<T>& S, soa::Workspace<T>& ws, const soa::Inputs<T>& in, T* tau,
                    const Part& part);

/// Ground, hinge records and, base to tip, all bodies, or those of a part (then in.v and in.vdot are zero for the others).
template <class T>
void outward(const SweepModel& model, const soa::Sweeps<T>& S, soa::Workspace<T>& ws, const soa::Inputs<T>& in, soa::OutwardFor what,
             const Part* part = nullptr) {
  S.ground(model, ws, in);
  S.hinge_records(model, ws, in);
  if constexpr (kHasParts<T>)
    if (part) return outward_of_part(model, S, ws, in, what, *part);
  for (const Run& run : model.runs) S.outward(model, ws, in, run, what);
}

/// Poses and velocities in the world. Needs outward; Workspace::require_world() before.
template <class T>
void world(const SweepModel& model, const soa::Sweeps<T>& S, soa::Workspace<T>& ws, const soa::Inputs<T>& in, const Part* part) {
  S.world(model, ws, in);
  if constexpr (kHasParts<T>)
    if (part) world_of_part(model, S, ws, in, *part);
}

}  // namespace cardan
