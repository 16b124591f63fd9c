#pragma once
// Initial coordinates and velocities of a hinge by name: one grammar for vehicles, missions and `cardan types`.
#include <cstddef>
#include <string>
#include <vector>

#include "core/abi/cardan_abi.h"
#include "core/model/schema.hpp"

namespace cardan {

/// Components that may be given as one list, under any of these names.
struct ComponentGroup {
  std::vector<std::string> names;
  std::string unit;
  std::size_t first, size;  // among the coordinates, or the velocities
};
/// The quaternion of a family whose shape has one, and what is a vector: x, y, z in m.
std::vector<ComponentGroup> coordinate_groups(const cardan_hinge_family& family);
/// Vectors: wx, wy, wz in rad/s and vx, vy, vz in m/s.
std::vector<ComponentGroup> velocity_groups(const cardan_hinge_family& family);

/// Whether a map gives any of them.
struct InitialGiven {
  bool coordinates = false, velocities = false;
};
/// Sets what the map gives, by the names of components or of groups; an attitude also as `orientation` (read_orientation). All other
/// values of q (nq) and v (nv) stay. Faults: C0106 where a value is given twice, C0304 for a quaternion that is not of unit length.
InitialGiven read_initial(MapReader& map, const cardan_hinge_family& family, double* q, double* v);

/// q (nq) made what `normalise` of the family leaves as it is. C0402 where that is another place: further than 1e-6 of the largest
/// coordinate, or nowhere. Quaternions stay: their length is looked at where they are read.
void settle_coordinates(const cardan_hinge_family& family, const double* packed, double* q, const Located& at, DiagnosticSink& sink);

/// Where a hinge begins: at `zero` of its family, or at the coordinates that are given; settled.
std::vector<double> initial_coordinates(const cardan_hinge_family& family, const double* packed, const std::vector<double>& given);

}  // namespace cardan
