// particle: a rigid body whose mass is all at its mass centre.
#include "core/abi/cardan_body.h"

namespace cardan {

const cardan_body_family& particle_family() {
  static const cardan_body_family family = [] {
    cardan_body_family f{};
    f.struct_size = sizeof(cardan_body_family);
    f.type = "particle";
    f.summary = "point mass";
    f.mass_source = CARDAN_MASS_POINT;
    return f;
  }();
  return family;
}

}  // namespace cardan
