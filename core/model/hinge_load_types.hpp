#pragma once
// What `hinge.loads` takes: the reader of vehicles and `cardan types` go by this table.
#include <array>
#include <limits>

#include "core/model/hinge_load.hpp"

namespace cardan {

struct HingeLoadParameter {
  const char* name;
  const char *turns, *slides;  // the unit where the component turns, and where it slides
  double fallback;             // NaN: required; infinite: no such limit
  const char* times;           // null; else the default is `fallback` times this one
  const char* meaning;
  /// Null; else the unit is that of the table where this parameter is 1, and otherwise has no name: the number is in SI.
  const char* unit_where_one = nullptr;
};

struct HingeLoadType {
  const char* name;
  HingeLaw law;
  const char* summary;
  std::array<HingeLoadParameter, std::tuple_size_v<HingeLoad::Parameters>> parameters;  // in their order
  /// A stop of lower, upper, stiffness, restitution, speed: its exponent is 1, its dissipation follows from the last two.
  bool bounces = false;
};

inline constexpr double kRequired = std::numeric_limits<double>::quiet_NaN(), kNoLimit = std::numeric_limits<double>::infinity();

inline constexpr std::array<HingeLoadType, 3> kHingeLoadTypes = {
    {{"stop",
      HingeLaw::stop,
      "pushes back beyond its limits: stiffness depth^exponent (1 + dissipation rate), never pulls",
      {{{"lower", "rad", "m", -kNoLimit, nullptr, "least coordinate without contact; this or `upper`, or both"},
        {"upper", "rad", "m", kNoLimit, nullptr, "largest coordinate without contact"},
        {"stiffness", "N m/rad", "N/m", kRequired, nullptr, "with another exponent than 1 a plain number in SI", "exponent"},
        {"exponent", "1", "1", 1.5, nullptr, "from 1 to 10; 1.5 is a sphere on a plane (Hertz), 1 a spring: backlash"},
        {"dissipation", "s/rad", "s/m", 0.0, nullptr, "how much of the motion it takes away"}}}},
     {"hard_stop",
      HingeLaw::stop,
      "what comes faster than `speed` bounces back at once; slower it is a stop of exponent 1 with the same losses",
      {{{"lower", "rad", "m", -kNoLimit, nullptr, "least coordinate; this or `upper`, or both"},
        {"upper", "rad", "m", kNoLimit, nullptr, "largest coordinate"},
        {"stiffness", "N m/rad", "N/m", kRequired, nullptr, "of what rests against it or comes slowly"},
        {"restitution", "1", "1", kRequired, nullptr, "rate after over rate before, 0 to 1; of what comes slowly at least 0.05"},
        {"speed", "rad/s", "m/s", kRequired, nullptr, "above it an impact takes no time"}}},
      true},
     {"friction",
      HingeLaw::friction,
      "against the rate, smoothed about zero over `width`: what is held creeps below it",
      {{{"coulomb", "N m", "N", kRequired, nullptr, "while it moves"},
        {"breakaway", "N m", "N", 1.0, "coulomb", "at its largest, just as it begins to move"},
        {"stribeck_rate", "rad/s", "m/s", 10.0, "width", "over which it falls from `breakaway` to `coulomb`"},
        {"viscous", "N m s/rad", "N s/m", 0.0, nullptr, "part in proportion to the rate"},
        {"width", "rad/s", "m/s", kRequired, nullptr, "below it the friction grows in proportion to the rate; a small one is stiff"}}}}}};

}  // namespace cardan
