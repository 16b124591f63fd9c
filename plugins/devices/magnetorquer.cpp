// magnetorquer: three coils at a node in the field of a dipole at the origin of the world: moment m x B,
// B = D / r^3 (3 (a . r) r - a), r the unit vector to the node, D > 0 where B points along -a above the equator.
#include <cmath>

#include "core/abi/device_family.hpp"

namespace cardan {
namespace {

struct Magnetorquer {
  static constexpr const char* type = "magnetorquer";
  static constexpr const char* summary = "three coils at a node, in the field of a dipole at the origin of the world";
  static constexpr unsigned facts = 0;
  struct Packed {
    double dipole, axis[3], largest;
  };
  static constexpr cardan_param_desc schema[] = {
      param::optional("field_dipole", CARDAN_NUMBER, "T m^3", "mu_0 / (4 pi) times its moment; the default is that of Earth", -7.77e15),
      param::along(param::optional("field_axis", CARDAN_UNIT_VECTOR, "1", "of the dipole, world axes"), 0, 0, 1),
      param::positive(param::required("max_moment", CARDAN_NUMBER, "A m^2", "of each coil; commands beyond are cut"))};
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_POSE | CARDAN_USE_VELOCITY | CARDAN_USE_LOAD,
                                                  "the node that carries the coils, along its axes"}};
  static constexpr cardan_port_desc ports[] = {{"moment_x", CARDAN_PORT_IN, "A m^2", 0.0, 0, "of the coil along x"},
                                               {"moment_y", CARDAN_PORT_IN, "A m^2", 0.0, 0, "of the coil along y"},
                                               {"moment_z", CARDAN_PORT_IN, "A m^2", 0.0, 0, "of the coil along z"},
                                               {"field_x", CARDAN_PORT_OUT, "T", 0.0, 0, "at the node, node axes"},
                                               {"field_y", CARDAN_PORT_OUT, "T", 0.0, 0, "at the node, node axes"},
                                               {"field_z", CARDAN_PORT_OUT, "T", 0.0, 0, "at the node, node axes"}};

  static bool pack(const Params& params, Packed& p) {
    const Eigen::Vector3d a = params.vector("field_axis");
    p = {params.number("field_dipole"), {a[0], a[1], a[2]}, params.number("max_moment")};
    return true;
  }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    using std::sqrt;
    const MountMotion<T>& at = in.at[0];
    const T distance = sqrt(dot(at.position, at.position));
    const Vec3<T> r = (T(1.0) / distance) * at.position, a{T(p.axis[0]), T(p.axis[1]), T(p.axis[2])};
    const Vec3<T> B = transpose_times(at.R_WN, (T(p.dipole) / (distance * distance * distance)) * (T(3.0) * dot(a, r) * r - a));
    const auto cut = [&](const T& x) { return x > T(p.largest) ? T(p.largest) : x < T(-p.largest) ? T(-p.largest) : x; };
    out.load[0].moment = cross(Vec3<T>{cut(in.in[0]), cut(in.in[1]), cut(in.in[2])}, B);
    out.out[0] = B.x, out.out[1] = B.y, out.out[2] = B.z;
  }
};

}  // namespace
const cardan_device_family& magnetorquer_family() { return device_table<Magnetorquer>(); }
}  // namespace cardan
