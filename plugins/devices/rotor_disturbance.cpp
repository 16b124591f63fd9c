// rotor_disturbance, wheel_disturbance: what a rotor that is out of balance and its bearings push their seat with, as tables of reaction
// wheels have it: harmonics of the angle whose amplitudes grow with the square of the rate W. With psi = h angle + phase:
// radial W^2 C (cos psi e_1 + sin psi e_2), force and moment, and axial W^2 C cos psi u. The rotor is a body on a hinge, or a wheel that
// tells its rate.
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "plugins/devices/rows.hpp"

namespace cardan {
namespace {

struct Harmonics {
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_FORCE;
  static constexpr int row_size = 5;
  struct Packed {
    PackedRows rows;
    double u[3], e1[3], e2[3];
  };
  static constexpr const char* columns[] = {"order", "radial_force", "radial_moment", "axial_force", "phase"};
  static constexpr const char* units[] = {"1", "N s^2", "N m s^2", "N s^2", "rad"};
  static constexpr cardan_param_desc schema[] = {
      [] {
        cardan_param_desc table = param::named(
            param::required("harmonics", CARDAN_TABLE, "1", "orders h, amplitudes over the square of the rate, phases at the angle 0"),
            columns);
        table.units = units;
        return table;
      }(),
      param::along(param::optional("axis", CARDAN_UNIT_VECTOR, "1", "about which it turns, node axes"), 0.0, 0.0, 1.0)};

  static std::uint64_t rows(const Params& params) { return static_cast<std::uint64_t>(params.table("harmonics", row_size).cols()); }
  static bool pack(const Params& params, Packed& p, double* row) {
    const auto table = params.table("harmonics", row_size);
    if (table.cols() == 0) return params.fail("harmonics", "at least one row");
    for (Eigen::Index k = 0; k < table.cols(); ++k)
      if (!(table(0, k) > 0.0)) return params.fail("harmonics", "orders above 0");
    std::copy_n(table.data(), table.size(), row);
    const Eigen::Vector3d u = params.vector("axis");
    const Eigen::Vector3d near = std::abs(u.x()) < 0.8 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
    const Eigen::Vector3d e1 = (near - near.dot(u) * u).normalized(), e2 = u.cross(e1);
    for (int i = 0; i < 3; ++i) p.u[i] = u[i], p.e1[i] = e1[i], p.e2[i] = e2[i];
    return true;
  }

  template <class F, class T>
  static void push(const Packed& p, const T& angle, const T& rate, DeviceOut<T>& out) noexcept {
    using std::cos, std::sin;
    T radial[2] = {}, moment[2] = {}, axial{};
    const double* row = rows_of<F>(p);
    for (std::int64_t k = 0; k < p.rows.n; ++k, row += row_size) {
      const T psi = T(row[0]) * angle + T(row[4]), c = cos(psi), s = sin(psi);
      radial[0] = radial[0] + T(row[1]) * c, radial[1] = radial[1] + T(row[1]) * s;
      moment[0] = moment[0] + T(row[2]) * c, moment[1] = moment[1] + T(row[2]) * s;
      axial = axial + T(row[3]) * c;
    }
    const auto along = [&](const double(&e)[3], const T& x) { return Vec3<T>{T(e[0]) * x, T(e[1]) * x, T(e[2]) * x}; };
    const T square = rate * rate;
    give_wrench(square * (along(p.e1, radial[0]) + along(p.e2, radial[1]) + along(p.u, axial)),
                square * (along(p.e1, moment[0]) + along(p.e2, moment[1])), out);
  }
};

struct RotorDisturbance : Harmonics {
  static constexpr const char* type = "rotor_disturbance";
  static constexpr const char* summary = "harmonics of a rotor on a hinge, at the node that it is carried at";
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_NODE, CARDAN_USE_LOAD, "the node that they push"},
      {"rotor", CARDAN_MOUNT_HINGE, CARDAN_USE_TURN | CARDAN_USE_COORDINATE, "the component of the hinge that it turns by"}};
  static constexpr const auto& ports = kWrenchPorts<0>;

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    push<RotorDisturbance>(p, in.at[1].q, in.at[1].v, out);
  }
};

struct WheelDisturbance : Harmonics {
  static constexpr const char* type = "wheel_disturbance";
  static constexpr const char* summary = "harmonics of a wheel that tells its rate, at the node that it is carried at";
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_LOAD, "the node that they push"}};
  static constexpr cardan_port_desc ports[] = {
      {"rate", CARDAN_PORT_IN, "rad/s", 0.0, 0, "of the wheel, relative to the node", nullptr, CARDAN_PORT_REQUIRED},
      kWrenchPorts<1>[0],
      kWrenchPorts<1>[1],
      kWrenchPorts<1>[2],
      kWrenchPorts<1>[3],
      kWrenchPorts<1>[4],
      kWrenchPorts<1>[5]};
  static constexpr cardan_state_desc states[] = {{"angle", "rad", 0.0, 1.0, "of the wheel"}};

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.zdot[0] = in.in[0];
    push<WheelDisturbance>(p, in.z[0], in.in[0], out);
  }
};

}  // namespace
const cardan_device_family& rotor_disturbance_family() { return device_table_with_rows<RotorDisturbance>(); }
const cardan_device_family& wheel_disturbance_family() { return device_table_with_rows<WheelDisturbance>(); }
}  // namespace cardan
