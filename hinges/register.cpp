#include "hinges/register.hpp"

namespace cardan {

const cardan_hinge_family& locked_family();
const cardan_hinge_family& revolute_family();
const cardan_hinge_family& prismatic_family();
const cardan_hinge_family& helical_family();
const cardan_hinge_family& cylindrical_family();
const cardan_hinge_family& universal_family();
const cardan_hinge_family& gimbal_family();
const cardan_hinge_family& ball_family();
const cardan_hinge_family& planar_family();
const cardan_hinge_family& translational_family();
const cardan_hinge_family& free_family();
const cardan_hinge_family& free_body_family();

void register_hinges(Registry& registry) {
  for (const auto family : {locked_family, revolute_family, prismatic_family, helical_family, cylindrical_family, universal_family,
                            gimbal_family, ball_family, planar_family, translational_family, free_family, free_body_family})
    registry.hinges.add(family());
}

}  // namespace cardan
