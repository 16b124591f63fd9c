#pragma once
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace cardan {

struct ImportOptions {
  enum class Base { automatic, free, fixed } base = Base::automatic;  // of the root link of a URDF
  std::vector<std::string> leave_out;                                 // what cannot be honoured, by name
  std::vector<std::pair<std::string, std::string>> initial;           // joint, coordinate at the start: "30 deg"; SI without a unit
  std::optional<double> stop_stiffness;                               // [N m/rad or N/m] limits become stops
  std::optional<double> friction_width;                               // [rad/s or m/s] dry friction is honoured, smoothed over so much
};

}  // namespace cardan
