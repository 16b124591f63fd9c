// plate_drag: of rarefied air on a plate, in free molecular flow. Molecules come with the velocity of the stream and the spread of their
// temperature, and leave in all directions, as warm as their accommodation to the wall makes them [Schaaf, Chambre 1961; Sentman 1961]. At
// rest the air still presses on a side.
#include <cmath>
#include <numbers>

#include "core/abi/cardan_field.h"
#include "core/abi/device_family.hpp"

namespace cardan {
namespace {

struct PlateDrag {
  static constexpr const char* type = "plate_drag";
  static constexpr const char* summary = "drag and lift of rarefied air on a plate at a node, in free molecular flow";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_FORCE;
  struct Packed {
    double area, normal[3];
    double speed;                // c = sqrt(2 R T), the most probable of the molecules [m/s]
    double accommodation, wall;  // R T of the wall [m^2/s^2]
    std::int64_t both_sides;
  };
  static constexpr cardan_param_desc schema[] = {
      param::positive(param::required("area", CARDAN_NUMBER, "m^2", "of one side")),
      param::along(param::optional("normal", CARDAN_UNIT_VECTOR, "1", "of the side that the air meets, node axes"), 0.0, 0.0, 1.0),
      param::optional("both_sides", CARDAN_TRUTH, "1", "the air is on the other side of the plate too"),
      param::positive(param::required("temperature", CARDAN_NUMBER, "K", "of the air")),
      param::positive(param::optional("gas_constant", CARDAN_NUMBER, "J/(kg K)", "of the air; the default is atomic oxygen", 519.67)),
      param::in_range(param::optional("accommodation", CARDAN_NUMBER, "1", "of the energy of molecules to that of the wall", 1.0), 0.0,
                      1.0),
      param::positive(param::optional("wall_temperature", CARDAN_NUMBER, "K", "of the plate", 300.0))};
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_NODE, CARDAN_USE_POSE | CARDAN_USE_VELOCITY | CARDAN_USE_LOAD, "the middle of the plate"},
      {"air", CARDAN_MOUNT_FIELD, CARDAN_DENSITY, "a field of the density of the air"},
      {"wind", CARDAN_MOUNT_FIELD, std::uint32_t{CARDAN_WIND} | std::uint32_t{CARDAN_USE_OPTIONAL},
       "a field of the velocity of the air; without, it is at rest"}};
  static constexpr cardan_port_desc ports[] = {{"density", CARDAN_PORT_OUT, "kg/m^3", 0.0, 0, "of the air at the node"}};

  static bool pack(const Params& params, Packed& p) {
    const auto n = [&](const char* name) { return params.number(name); };
    const Eigen::Vector3d normal = params.vector("normal");
    p = {n("area"),          {normal[0], normal[1], normal[2]},         std::sqrt(2.0 * n("gas_constant") * n("temperature")),
         n("accommodation"), n("gas_constant") * n("wall_temperature"), params.truth("both_sides")};
    return true;
  }

  static double erfc_of(double x) noexcept { return std::erfc(x); }
  static Tangent erfc_of(const Tangent& a) noexcept {
    return {std::erfc(a.x), -2.0 * std::numbers::inv_sqrtpi * std::exp(-a.x * a.x) * a.d};
  }

  /// Force over density and area on the side with the normal n, in a stream u.
  template <class T>
  static Vec3<T> on_side(const Packed& p, const Vec3<T>& u, const Vec3<T>& n) noexcept {
    using std::exp, std::sqrt;
    const double c = p.speed, root_pi = 1.0 / std::numbers::inv_sqrtpi;
    const T s = -dot(u, n) / T(c);  // speed ratio towards the side
    if (s < T(-10.0)) return {};    // molecules that catch up with it: exp(-100) of all
    const T bell = exp(-s * s), tail = erfc_of(-s), arrive = bell + T(root_pi) * s * tail;
    const T flux = T(0.5 * c / root_pi) * arrive;                                                        // mass that arrives [m/s]
    const T falls = T(0.5 * c * c) * (s * bell / T(root_pi) + (T(0.5) + s * s) * tail);                  // pressure of what arrives
    const T brought = dot(u, u) / T(2.0) + T(0.25 * c * c) * (T(4.0) + T(root_pi) * s * tail / arrive);  // its energy
    const T leaves = T(0.5 * (1.0 - p.accommodation)) * brought + T(p.accommodation * p.wall);           // R T of what leaves
    const T pressure = falls + flux * sqrt(T(0.5 * std::numbers::pi) * leaves);
    return flux * (u + (s * T(c)) * n) - pressure * n;
  }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    const T *rho = in.at[1].field, *w = in.at[2].field;
    const Vec3<T> u = Vec3<T>{w[0], w[1], w[2]} - in.at[0].velocity, n{T(p.normal[0]), T(p.normal[1]), T(p.normal[2])};
    Vec3<T> force = on_side(p, u, n);
    if (p.both_sides != 0) force += on_side(p, u, -n);
    out.load[0].force = (T(p.area) * rho[0]) * force;
    out.out[0] = rho[0];
  }
};

}  // namespace
const cardan_device_family& plate_drag_family() { return device_table<PlateDrag>(); }
}  // namespace cardan
