// universal (Cardan joint): two successive rotations, R = exp(u1~ q1) exp(u2~ q2).
#include "core/abi/family.hpp"
#include "hinges/axes.hpp"
#include "hinges/slopes.hpp"

namespace cardan {
namespace {

struct Universal {
  static constexpr const char* type = "universal";
  static constexpr const char* summary = "two successive rotations about axes[0] (fixed in O) and axes[1] (fixed in P)";
  static constexpr int nq = 2, nv = 2;
  static constexpr auto shape = CARDAN_SHAPE_DENSE;
  struct Packed {
    double u[6];
  };
  static constexpr cardan_param_desc schema[] = {
      param::required("axes", CARDAN_UNIT_VECTORS, "1", "the two axes, in the axes of the hinge nodes at q = 0", 2)};
  static constexpr const char* q_names[] = {"angle_1", "angle_2"};
  static constexpr const char* q_units[] = {"rad", "rad"};
  static constexpr const char* v_names[] = {"rate_1", "rate_2"};
  static constexpr const char* v_units[] = {"rad/s", "rad/s"};

  static bool pack(const Params& params, Packed& p) {
    for (int i = 0; i < 2; ++i) Eigen::Map<Eigen::Vector3d>(p.u + 3 * i) = params.vector("axes", i);
    if (nearly_parallel(axis(p, 0), axis(p, 1)))
      return params.fail("axes", "two axes that are not parallel (the sine of their angle > 1e-5)");
    return true;
  }
  static Eigen::Map<const Eigen::Vector3d> axis(const Packed& p, int i) { return Eigen::Map<const Eigen::Vector3d>(p.u + 3 * i); }
  static void kinematics(const Packed& p, const double* q, const double* v, HingeOut<2>& out) noexcept {
    const Eigen::Vector3d u1 = axis(p, 0), u2 = axis(p, 1);
    const Eigen::Matrix3d R2 = rotation_about_axis(u2, q[1]);
    const Eigen::Vector3d h1 = R2.transpose() * u1;
    out.R_OP = rotation_about_axis(u1, q[0]) * R2;
    out.Ht.col(0).head<3>() = h1;
    out.Ht.col(1).head<3>() = u2;
    out.Hdot_v.head<3>() = -v[1] * v[0] * u2.cross(h1);
  }
  static void slopes(const Packed& p, const double* q, const double* v, SlopesOut<2, 2>& out) noexcept {
    const Eigen::Vector3d u1 = axis(p, 0), u2 = axis(p, 1);
    const Eigen::Matrix3d R2 = rotation_about_axis(u2, q[1]), R = rotation_about_axis(u1, q[0]) * R2;
    const Eigen::Vector3d h1 = R2.transpose() * u1, dh1 = -u2.cross(h1);  // dh1/dq2
    out.in_q[0].R_OP = tilde(u1) * R;
    out.in_q[1].R_OP = R * tilde(u2);
    out.in_q[1].Ht.col(0).head<3>() = dh1;
    out.in_q[1].Hdot_v.head<3>() = -v[1] * v[0] * u2.cross(dh1);
    out.in_v.col(0).head<3>() = v[1] * dh1;
    out.in_v.col(1).head<3>() = v[0] * dh1;
  }
};

}  // namespace
const cardan_hinge_family& universal_family() { return hinge_table<Universal>(); }
HingeSlopes universal_slopes() { return slopes_of<Universal>(); }
}  // namespace cardan
