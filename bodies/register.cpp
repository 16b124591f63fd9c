#include "bodies/register.hpp"

namespace cardan {

const cardan_body_family& rigid_family();
const cardan_body_family& particle_family();
const cardan_body_family& modal_flexible_family();

void register_bodies(Registry& registry) {
  for (const auto family : {rigid_family, particle_family, modal_flexible_family}) registry.bodies.add(family());
}

}  // namespace cardan
