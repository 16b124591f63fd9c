// drag: of the air on a body, at its centre of pressure: force -1/2 rho C_d A |u| u, u the velocity of the node in the air, whatever its
// attitude. The air is at rest in the world where there is no field of wind.
#include <cmath>

#include "core/abi/cardan_field.h"
#include "core/abi/device_family.hpp"

namespace cardan {
namespace {

struct Drag {
  static constexpr const char* type = "drag";
  static constexpr const char* summary = "drag of the air at a node, the same from all sides";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_FORCE;
  struct Packed {
    double half;  // [m^2]
  };
  static constexpr cardan_param_desc schema[] = {param::positive(param::required("area", CARDAN_NUMBER, "m^2", "across the stream")),
                                                 param::not_negative(param::optional("coefficient", CARDAN_NUMBER, "1", "of drag", 2.2))};
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_NODE, CARDAN_USE_POSE | CARDAN_USE_VELOCITY | CARDAN_USE_LOAD, "the centre of pressure"},
      {"air", CARDAN_MOUNT_FIELD, CARDAN_DENSITY, "a field of the density of the air"},
      {"wind", CARDAN_MOUNT_FIELD, std::uint32_t{CARDAN_WIND} | std::uint32_t{CARDAN_USE_OPTIONAL},
       "a field of the velocity of the air; without, it is at rest"}};
  static constexpr cardan_port_desc ports[] = {{"density", CARDAN_PORT_OUT, "kg/m^3", 0.0, 0, "of the air at the node"}};

  static bool pack(const Params& params, Packed& p) {
    p = {0.5 * params.number("coefficient") * params.number("area")};
    return true;
  }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    using std::sqrt;
    const T *rho = in.at[1].field, *w = in.at[2].field;
    const Vec3<T> u = in.at[0].velocity - Vec3<T>{w[0], w[1], w[2]};
    out.load[0].force = (-(T(p.half) * rho[0] * sqrt(dot(u, u)))) * u;
    out.out[0] = rho[0];
  }
};

}  // namespace
const cardan_device_family& drag_family() { return device_table<Drag>(); }
}  // namespace cardan
