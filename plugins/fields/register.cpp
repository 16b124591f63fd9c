#include "plugins/fields/register.hpp"

namespace cardan {

const cardan_field_family& dipole_family();
const cardan_field_family& polyhedron_family();
const cardan_field_family& point_mass_family();
const cardan_field_family& zonal_harmonics_family();
const cardan_field_family& spherical_harmonics_family();
const cardan_field_family& magnetic_harmonics_family();
const cardan_field_family& exponential_atmosphere_family();
const cardan_field_family& standard_atmosphere_family();
const cardan_field_family& tabulated_atmosphere_family();
const cardan_field_family& harris_priester_family();
const cardan_field_family& nrlmsise00_family();
const cardan_field_family& co_rotating_wind_family();
const cardan_field_family& sunlight_family();
const cardan_field_family& third_body_family();
const cardan_field_family& celestial_body_family();
const cardan_field_family& planet_attitude_family();

void register_fields(Registry& registry) {
  for (const auto family :
       {point_mass_family, zonal_harmonics_family, spherical_harmonics_family, polyhedron_family, dipole_family, magnetic_harmonics_family,
        exponential_atmosphere_family, standard_atmosphere_family, tabulated_atmosphere_family, harris_priester_family, nrlmsise00_family,
        co_rotating_wind_family, sunlight_family, third_body_family, celestial_body_family, planet_attitude_family})
    registry.fields.add(family());
}

}  // namespace cardan
