#pragma once
// Faults of ports: whoever reads a port gets another number than the one that is there, from one instant to another.
// docs/mathematics/devices.md, "Faults of ports".
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/checkpoint.hpp"
#include "core/dynamics/devices.hpp"

namespace cardan {

/// From `from` until `until` whoever reads the port gets scale x + bias + drift (t - from) + noise in place of x, or what it is stuck at.
struct PortFault {
  int device = -1;                                         // id: index into Devices::all of the first model of the simulation
  bool input = false;                                      // else an output
  int place = 0;                                           // among its inputs or outputs
  double scale = 1.0, bias = 0.0, drift = 0.0;             // [-], [unit of the port], [unit of the port / s]
  bool stuck = false;                                      // at `value`, none of the others then;
  std::optional<double> value{};                           // none: at what it is when the fault begins
  double noise = 0.0;                                      // standard deviation of what is added, drawn at each tick of the device
  double drop = 0.0;                                       // probability that a tick is lost: the number before it stays
  double delay = 0.0;                                      // [s] x is what it was so long ago: whole ticks of the device, up to kMostTicks
  int swap = -1;                                           // the place of another one, which exchanges its value with this; -1: none
  double from = -std::numeric_limits<double>::infinity();  // [s]; by default when it is told
  double until = std::numeric_limits<double>::infinity();  // [s]

  /// C0301 for a number that is not one or out of its range.
  void expect_good(const Located& at) const;
  /// Something is wrong.
  bool any() const {
    return stuck || scale != 1.0 || bias != 0.0 || drift != 0.0 || noise != 0.0 || drop != 0.0 || delay != 0.0 || swap >= 0;
  }
};

/// A fault in a run.
struct RunningFault : PortFault {
  bool begun = false;
  bool lost = false;           // the last tick was
  double drawn = 0.0;          // of the noise, at the last tick
  double kept = 0.0;           // what it is stuck at; what was there before a tick that is lost
  double late = 0.0;           // of a delay: the value that is read now, ...
  std::vector<double> line{};  // ... and those on their way, tick by tick, ...
  int oldest = 0;              // ... with the first of them
  /// A tick: x goes in.
  void pass(double x) {
    late = std::exchange(line[static_cast<std::size_t>(oldest)], x);
    oldest = (oldest + 1) % static_cast<int>(line.size());
  }
  std::array<std::uint32_t, 2> key{};  // of what is drawn, by the names of device and port: from the beginning on
  AlteredPort altered(int index) const;
  void remember(Archive& archive);
};

}  // namespace cardan
