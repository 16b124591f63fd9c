// particle: a rigid body whose mass is all at its mass centre.
#include "core/abi/cardan_abi.h"

namespace cardan {

const cardan_body_family& particle_family() {
  static constexpr cardan_body_family family{
      sizeof(cardan_body_family), "particle", "point mass", 0, nullptr, nullptr, nullptr, nullptr, nullptr};
  return family;
}

}  // namespace cardan
