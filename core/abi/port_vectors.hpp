#pragma once
// Ports that belong together: NAME_x, NAME_y, NAME_z, or NAME_1 to NAME_n. Side by side, of one kind, unit and frame, they are the vector
// NAME: connected, commanded and read as one.
#include <string>
#include <string_view>
#include <vector>

#include "core/abi/cardan_device.h"

namespace cardan {

struct PortVector {
  std::string name;
  int first = 0;                      // its place among the inputs or outputs of its device
  std::vector<std::string> suffixes;  // "_x", "_y", "_z"; two at least
};

/// Of the inputs (CARDAN_PORT_IN) or outputs of a family, in their order. A vector whose name is that of a port is none.
std::vector<PortVector> port_vectors(const cardan_device_family& family, std::uint32_t kind);

/// A port by its place among the inputs or outputs.
const cardan_port_desc& port_at(const cardan_device_family& family, std::uint32_t kind, int place);
/// Its place by its name; -1: there is none.
int place_of_port(const cardan_device_family& family, std::uint32_t kind, std::string_view name);

}  // namespace cardan
