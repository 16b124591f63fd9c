// radiation_pressure: of light on a node: of a sphere A C_R / c along the light; of a plate, in the part of the light that falls on it,
// what it throws back like a mirror, into all directions, and what it takes up [Montenbruck, Gill 2000, 3.4].
#include <cmath>

#include "core/abi/cardan_field.h"
#include "core/abi/device_family.hpp"

namespace cardan {
namespace {

struct RadiationPressure {
  static constexpr const char* type = "radiation_pressure";
  static constexpr const char* summary = "pressure of light at a node, on a sphere or a plate";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_FORCE;
  static constexpr double kLight = 299792458.0;  // [m/s]
  enum Shape { sphere, plate };
  struct Packed {
    double over_c;  // area / c [m s]
    double coefficient, specular, diffuse, normal[3];
    std::int64_t shape, both_sides;
  };
  static constexpr const char* shapes[] = {"sphere", "plate"};
  static constexpr cardan_param_desc schema[] = {
      param::positive(param::required("area", CARDAN_NUMBER, "m^2", "across the light, of a plate its own")),
      param::named(param::optional("shape", CARDAN_CHOICE, "1", "a sphere, alike from all sides, or a plate"), shapes),
      param::in_range(param::optional("coefficient", CARDAN_NUMBER, "1", "of a sphere: 1 black, 2 at most", 1.3), 0.0, 2.0),
      param::in_range(param::optional("specular", CARDAN_NUMBER, "1", "part that a plate throws back like a mirror"), 0.0, 1.0),
      param::in_range(param::optional("diffuse", CARDAN_NUMBER, "1", "part that it throws back into all directions"), 0.0, 1.0),
      {"normal",
       CARDAN_UNIT_VECTOR,
       0u,
       "1",
       "of the side of a plate that the light falls on, node axes",
       {0.0, 0.0, 1.0},
       0.0,
       0.0,
       0,
       nullptr,
       nullptr},
      param::optional("both_sides", CARDAN_TRUTH, "1", "the other side of the plate is alike")};
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_NODE, CARDAN_USE_POSE | CARDAN_USE_LOAD, "where the pressure acts, the middle of the plate"},
      {"light", CARDAN_MOUNT_FIELD, CARDAN_LIGHT, "a field of light"}};
  static constexpr cardan_port_desc ports[] = {{"irradiance", CARDAN_PORT_OUT, "W/m^2", 0.0, 0, "of the light at the node"}};

  static bool pack(const Params& params, Packed& p) {
    const auto n = [&](const char* name) { return params.number(name); };
    const Eigen::Vector3d normal = params.vector("normal");
    p = {n("area") / kLight, 0.0, 0.0, 0.0, {normal[0], normal[1], normal[2]}, params.choice("shape"), 0};
    if (p.shape == sphere) {
      p.coefficient = n("coefficient");
      return true;
    }
    p.specular = n("specular"), p.diffuse = n("diffuse"), p.both_sides = params.truth("both_sides");
    return p.specular + p.diffuse <= 1.0 || params.fail("diffuse", "at most 1 with `specular`");
  }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    using std::sqrt;
    const T* field = in.at[1].field;
    const Vec3<T> light{field[0], field[1], field[2]}, n{T(p.normal[0]), T(p.normal[1]), T(p.normal[2])};
    const T irradiance = sqrt(dot(light, light));
    out.out[0] = irradiance;
    if (p.shape == sphere) {
      out.load[0].force = T(p.over_c * p.coefficient) * light;
      return;
    }
    const T towards = -dot(light, n);  // irradiance times the cosine of the angle to the normal
    if (!(irradiance > T(0.0)) || (towards < T(0.0) && p.both_sides == 0)) return;
    const T falls = towards < T(0.0) ? -towards : towards, cosine = falls / irradiance;
    const T back = T(2.0) * (T(p.specular) * cosine + T(p.diffuse / 3.0)) * falls;
    out.load[0].force = T(p.over_c) * (T(1.0 - p.specular) * cosine * light - (towards < T(0.0) ? -back : back) * n);
  }
};

}  // namespace
const cardan_device_family& radiation_pressure_family() { return device_table<RadiationPressure>(); }
}  // namespace cardan
