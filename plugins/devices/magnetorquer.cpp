// magnetorquer: three coils at a node in a magnetic field: moment m x B.
#include <cmath>

#include "core/abi/cardan_field.h"
#include "core/abi/device_family.hpp"

namespace cardan {
namespace {

struct Magnetorquer {
  static constexpr const char* type = "magnetorquer";
  static constexpr const char* summary = "three coils at a node, in a magnetic field";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_ACTUATOR;
  struct Packed {
    double largest;
  };
  static constexpr cardan_param_desc schema[] = {
      param::positive(param::required("max_moment", CARDAN_NUMBER, "A m^2", "of each coil; commands beyond are cut"))};
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_NODE, CARDAN_USE_LOAD, "the node that carries the coils, along its axes"},
      {"field", CARDAN_MOUNT_FIELD, CARDAN_MAGNETIC, "a magnetic field"}};
  static constexpr cardan_port_desc ports[] = {{"moment_x", CARDAN_PORT_IN, "A m^2", 0.0, 0, "of the coil along x", "at"},
                                               {"moment_y", CARDAN_PORT_IN, "A m^2", 0.0, 0, "of the coil along y", "at"},
                                               {"moment_z", CARDAN_PORT_IN, "A m^2", 0.0, 0, "of the coil along z", "at"},
                                               {"field_x", CARDAN_PORT_OUT, "T", 0.0, 0, "at the node, node axes", "at"},
                                               {"field_y", CARDAN_PORT_OUT, "T", 0.0, 0, "at the node, node axes", "at"},
                                               {"field_z", CARDAN_PORT_OUT, "T", 0.0, 0, "at the node, node axes", "at"}};

  static bool pack(const Params& params, Packed& p) {
    p = {params.number("max_moment")};
    return true;
  }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    const Vec3<T> B{in.at[1].field[0], in.at[1].field[1], in.at[1].field[2]};
    const auto cut = [&](const T& x) { return x > T(p.largest) ? T(p.largest) : x < T(-p.largest) ? T(-p.largest) : x; };
    out.load[0].moment = cross(Vec3<T>{cut(in.in[0]), cut(in.in[1]), cut(in.in[2])}, B);
    out.out[0] = B.x, out.out[1] = B.y, out.out[2] = B.z;
  }
};

}  // namespace
const cardan_device_family& magnetorquer_family() { return device_table<Magnetorquer>(); }
}  // namespace cardan
