// Built-in families under other names, compiled from the same sources into a plugin.
#include <cstdint>
#include <cstring>

#include "core/abi/cardan_abi.h"
#include "core/abi/cardan_body.h"
#include "core/abi/cardan_device.h"
#include "core/abi/cardan_field.h"

namespace cardan {
const cardan_hinge_family& universal_family();
const cardan_hinge_family& revolute_family();
const cardan_hinge_family& ball_family();
const cardan_body_family& modal_flexible_family();
const cardan_device_family& spring_damper_family();
const cardan_device_family& lugre_friction_family();
const cardan_device_family& momentum_wheel_family();
const cardan_field_family& dipole_family();
const cardan_field_family& point_mass_family();
}  // namespace cardan

namespace {

template <class Table>
Table named(Table table, const char* type) {
  table.type = type;
  return table;
}

const void* family(const char* kind, std::uint32_t i) {
  static const cardan_hinge_family hinges[] = {named(cardan::universal_family(), "twin/universal"),
                                               named(cardan::revolute_family(), "twin/revolute"),
                                               named(cardan::ball_family(), "twin/ball")};
  static const cardan_body_family body = named(cardan::modal_flexible_family(), "twin/modal_flexible");
  static const cardan_device_family devices[] = {named(cardan::spring_damper_family(), "twin/spring_damper"),
                                                 named(cardan::lugre_friction_family(), "twin/lugre_friction"),
                                                 named(cardan::momentum_wheel_family(), "twin/momentum_wheel")};
  static const cardan_field_family fields[] = {named(cardan::dipole_family(), "twin/dipole"),
                                               named(cardan::point_mass_family(), "twin/point_mass")};
  if (std::strcmp(kind, CARDAN_KIND_FIELD) == 0) return i < 2 ? &fields[i] : nullptr;
  if (std::strcmp(kind, CARDAN_KIND_DEVICE) == 0) return i < 3 ? &devices[i] : nullptr;
  if (std::strcmp(kind, CARDAN_KIND_HINGE) == 0) return i < 3 ? &hinges[i] : nullptr;
  return std::strcmp(kind, CARDAN_KIND_BODY) == 0 && i == 0 ? &body : nullptr;
}
const cardan_plugin kPlugin{sizeof(cardan_plugin), CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "twins", "1", "Apache-2.0", family};

}  // namespace

extern "C" CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host*) { return &kPlugin; }
