// gimbal: three successive rotations about any axes, R = exp(u1~ q1) exp(u2~ q2) exp(u3~ q3). The map loses rank where
// the three axes become coplanar; a ball hinge has no such place.
#include <cctype>

#include "core/abi/family.hpp"
#include "hinges/axes.hpp"
#include "hinges/slopes.hpp"

namespace cardan {
namespace {

struct Gimbal {
  static constexpr const char* type = "gimbal";
  static constexpr const char* summary = "three successive rotations about any axes (singular where they are coplanar)";
  static constexpr int nq = 3, nv = 3;
  static constexpr auto shape = CARDAN_SHAPE_DENSE;
  struct Packed {
    double u[9];
  };
  static constexpr cardan_param_desc schema[] = {
      param::optional("axes", CARDAN_UNIT_VECTORS, "1", "the three axes, in the axes of the hinge nodes at q = 0", 0.0, 3),
      param::optional("sequence", CARDAN_TEXT, "1", "instead of axes: three letters or digits, \"zyx\" or \"313\"")};
  static constexpr const char* q_names[] = {"angle_1", "angle_2", "angle_3"};
  static constexpr const char* q_units[] = {"rad", "rad", "rad"};
  static constexpr const char* v_names[] = {"rate_1", "rate_2", "rate_3"};
  static constexpr const char* v_units[] = {"rad/s", "rad/s", "rad/s"};

  static bool pack(const Params& params, Packed& p) {
    const bool by_axes = params.count("axes") == 3;
    const char* sequence = params.text("sequence");
    if (by_axes == (sequence != nullptr)) return params.fail("axes", "either axes (three vectors) or sequence");
    if (by_axes) {
      for (int i = 0; i < 3; ++i) Eigen::Map<Eigen::Vector3d>(p.u + 3 * i) = params.vector("axes", i);
      const Eigen::Map<const Eigen::Vector3d> u1(p.u), u2(p.u + 3), u3(p.u + 6);
      if (nearly_parallel(u1, u2) || nearly_parallel(u2, u3))
        return params.fail("axes", "three axes, no neighbours parallel (the sine of their angle > 1e-5)");
      return true;
    }
    const char* expected = "three of x, y, z (or 1, 2, 3), neighbours different";
    if (std::strlen(sequence) != 3) return params.fail("sequence", expected);
    int previous = -1;
    for (int i = 0; i < 3; ++i) {
      const char c = static_cast<char>(std::tolower(sequence[i]));
      const int k = c >= 'x' && c <= 'z' ? c - 'x' : c >= '1' && c <= '3' ? c - '1' : -1;
      if (k < 0 || k == previous) return params.fail("sequence", expected);
      p.u[3 * i + k] = 1.0;
      previous = k;
    }
    return true;
  }
  struct Columns {
    Eigen::Vector3d h1, h2, u3;
    Eigen::Matrix3d R23, R3;
  };
  static Columns columns(const Packed& p, const double* q) {
    const Eigen::Map<const Eigen::Vector3d> u1(p.u), u2(p.u + 3), u3(p.u + 6);
    Columns c;
    c.R3 = rotation_about_axis(u3, q[2]);
    c.R23 = rotation_about_axis(u2, q[1]) * c.R3;
    c.h1 = c.R23.transpose() * u1;
    c.h2 = c.R3.transpose() * u2;
    c.u3 = u3;
    return c;
  }
  static void kinematics(const Packed& p, const double* q, const double* v, HingeOut<3>& out) noexcept {
    const Columns c = columns(p, q);
    out.R_OP = rotation_about_axis(Eigen::Map<const Eigen::Vector3d>(p.u), q[0]) * c.R23;
    out.Ht.col(0).head<3>() = c.h1;
    out.Ht.col(1).head<3>() = c.h2;
    out.Ht.col(2).head<3>() = c.u3;
    out.Hdot_v.head<3>() = -(c.h2 * v[1] + c.u3 * v[2]).cross(c.h1 * v[0]) - (c.u3 * v[2]).cross(c.h2 * v[1]);
  }
  static void slopes(const Packed& p, const double* q, const double* v, SlopesOut<3, 3>& out) noexcept {
    const Columns c = columns(p, q);
    const Eigen::Map<const Eigen::Vector3d> u1(p.u);
    const Eigen::Matrix3d R = rotation_about_axis(u1, q[0]) * c.R23;
    out.in_q[0].R_OP = tilde(u1) * R;
    out.in_q[1].R_OP = R * tilde(c.h2);
    out.in_q[2].R_OP = R * tilde(c.u3);
    const Eigen::Vector3d turn = c.h2 * v[1] + c.u3 * v[2], last = c.u3 * v[2];
    for (int i = 1; i < 3; ++i) {
      HingeOut<3>& slope = out.in_q[i];
      const Eigen::Vector3d dh1 = -(i == 1 ? c.h2 : c.u3).cross(c.h1);
      const Eigen::Vector3d dh2 = i == 1 ? Eigen::Vector3d::Zero() : Eigen::Vector3d(-c.u3.cross(c.h2));
      slope.Ht.col(0).head<3>() = dh1;
      slope.Ht.col(1).head<3>() = dh2;
      slope.Hdot_v.head<3>() = -(dh2 * v[1]).cross(c.h1 * v[0]) - turn.cross(dh1 * v[0]) - last.cross(dh2 * v[1]);
    }
    out.in_v.col(0).head<3>() = -turn.cross(c.h1);
    out.in_v.col(1).head<3>() = -c.h2.cross(c.h1 * v[0]) - last.cross(c.h2);
    out.in_v.col(2).head<3>() = -c.u3.cross(c.h1 * v[0] + c.h2 * v[1]);
  }
};

}  // namespace
const cardan_hinge_family& gimbal_family() { return hinge_table<Gimbal>(); }
HingeSlopes gimbal_slopes() { return slopes_of<Gimbal>(); }
}  // namespace cardan
