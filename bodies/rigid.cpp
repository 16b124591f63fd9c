// rigid: constant mass, mass centre and inertia. The sweeps hold these ten numbers; no function is called in a step.
#include "core/abi/cardan_body.h"

namespace cardan {

const cardan_body_family& rigid_family() {
  static const cardan_body_family family = [] {
    cardan_body_family f{};
    f.struct_size = sizeof(cardan_body_family);
    f.type = "rigid";
    f.summary = "rigid body: mass, mass centre, inertia";
    f.mass_source = CARDAN_MASS_RIGID;
    return f;
  }();
  return family;
}

}  // namespace cardan
