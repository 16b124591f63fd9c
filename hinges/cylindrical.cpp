// cylindrical: rotation about and translation along one axis.
#include "core/abi/family.hpp"
#include "hinges/axes.hpp"
#include "hinges/slopes.hpp"

namespace cardan {
namespace {

struct Cylindrical {
  static constexpr const char* type = "cylindrical";
  static constexpr const char* summary = "rotation about and translation along one axis";
  static constexpr int nq = 2, nv = 2;
  static constexpr auto shape = CARDAN_SHAPE_DENSE;
  using Packed = AxisParams;
  static constexpr cardan_param_desc schema[] = {
      param::required("axis", CARDAN_UNIT_VECTOR, "1", "hinge axis, in the axes of the hinge nodes")};
  static constexpr const char* q_names[] = {"angle", "displacement"};
  static constexpr const char* q_units[] = {"rad", "m"};
  static constexpr const char* v_names[] = {"rate", "speed"};
  static constexpr const char* v_units[] = {"rad/s", "m/s"};

  static bool pack(const Params& params, Packed& p) { return pack_axis(params, p, false); }

  static void kinematics(const Packed& p, const double* q, const double*, HingeOut<2>& out) noexcept {
    const Eigen::Vector3d u(p.u[0], p.u[1], p.u[2]);
    out.R_OP = rotation_about_axis(u, q[0]);
    out.p_OP = q[1] * u;
    out.Ht.col(0).head<3>() = u;
    out.Ht.col(1).tail<3>() = u;
  }
  static void slopes(const Packed& p, const double* q, const double*, SlopesOut<2, 2>& out) noexcept {
    const Eigen::Vector3d u(p.u[0], p.u[1], p.u[2]);
    out.in_q[0].R_OP = tilde(u) * rotation_about_axis(u, q[0]);
    out.in_q[1].p_OP = u;
  }
};

}  // namespace
const cardan_hinge_family& cylindrical_family() { return hinge_table<Cylindrical>(); }
HingeSlopes cylindrical_slopes() { return slopes_of<Cylindrical>(); }
}  // namespace cardan
