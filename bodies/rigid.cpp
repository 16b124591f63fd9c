// rigid: constant mass, mass centre and inertia. The sweeps hold these ten numbers; no function is called in a step.
#include "core/abi/cardan_abi.h"

namespace cardan {

const cardan_body_family& rigid_family() {
  static constexpr cardan_body_family family{
      sizeof(cardan_body_family), "rigid", "rigid body: mass, mass centre, inertia", 0, nullptr, nullptr, nullptr, nullptr, nullptr};
  return family;
}

}  // namespace cardan
