#include "hinges/register.hpp"

namespace cardan {

const cardan_hinge_family& locked_family();
const cardan_hinge_family& revolute_family();
const cardan_hinge_family& prismatic_family();
const cardan_hinge_family& helical_family();
const cardan_hinge_family& cylindrical_family();
const cardan_hinge_family& universal_family();
const cardan_hinge_family& constant_velocity_family();
const cardan_hinge_family& gimbal_family();
const cardan_hinge_family& ball_family();
const cardan_hinge_family& planar_family();
const cardan_hinge_family& translational_family();
const cardan_hinge_family& free_family();
const cardan_hinge_family& free_body_family();

HingeSlopes cylindrical_slopes();
HingeSlopes universal_slopes();
HingeSlopes gimbal_slopes();
HingeSlopes planar_slopes();
HingeSlopes translational_slopes();

void register_hinges(Registry& registry) {
  for (const auto family :
       {locked_family, revolute_family, prismatic_family, helical_family, cylindrical_family, universal_family, constant_velocity_family,
        gimbal_family, ball_family, planar_family, translational_family, free_family, free_body_family})
    registry.hinges.add(family());
  registry.add_slopes(cylindrical_family(), cylindrical_slopes());
  registry.add_slopes(universal_family(), universal_slopes());
  registry.add_slopes(gimbal_family(), gimbal_slopes());
  registry.add_slopes(planar_family(), planar_slopes());
  registry.add_slopes(translational_family(), translational_slopes());
}

}  // namespace cardan
