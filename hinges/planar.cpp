// planar: two translations in the plane of e1, e2 and a rotation about its normal n = e1 x e2.
#include "core/abi/family.hpp"
#include "hinges/axes.hpp"
#include "hinges/slopes.hpp"

namespace cardan {
namespace {

struct Planar {
  static constexpr const char* type = "planar";
  static constexpr const char* summary = "two translations in a plane (axes of O) and a rotation about its normal";
  static constexpr int nq = 3, nv = 3;
  static constexpr auto shape = CARDAN_SHAPE_DENSE;
  struct Packed {
    double e[6];
  };
  static constexpr cardan_param_desc schema[] = {
      param::required("axes", CARDAN_UNIT_VECTORS, "1", "two orthogonal axes that span the plane, in O", 2)};
  static constexpr const char* q_names[] = {"x", "y", "angle"};
  static constexpr const char* q_units[] = {"m", "m", "rad"};
  static constexpr const char* v_names[] = {"vx", "vy", "rate"};
  static constexpr const char* v_units[] = {"m/s", "m/s", "rad/s"};

  static bool pack(const Params& params, Packed& p) {
    Eigen::Vector3d e1, e2;
    if (!orthogonal_axes(params, e1, e2)) return false;
    Eigen::Map<Eigen::Vector3d>(p.e) = e1;
    Eigen::Map<Eigen::Vector3d>(p.e + 3) = e2;
    return true;
  }
  static void kinematics(const Packed& p, const double* q, const double* v, HingeOut<3>& out) noexcept {
    const Eigen::Map<const Eigen::Vector3d> e1(p.e), e2(p.e + 3);
    const Eigen::Vector3d n = e1.cross(e2);
    out.R_OP = rotation_about_axis(n, q[2]);
    out.p_OP = e1 * q[0] + e2 * q[1];
    out.Ht.col(0).tail<3>() = out.R_OP.transpose() * e1;
    out.Ht.col(1).tail<3>() = out.R_OP.transpose() * e2;
    out.Ht.col(2).head<3>() = n;
    out.Hdot_v.tail<3>() = -(n * v[2]).cross(out.Ht.col(0).tail<3>() * v[0] + out.Ht.col(1).tail<3>() * v[1]);
  }
  static void slopes(const Packed& p, const double* q, const double* v, SlopesOut<3, 3>& out) noexcept {
    const Eigen::Map<const Eigen::Vector3d> e1(p.e), e2(p.e + 3);
    const Eigen::Vector3d n = e1.cross(e2);
    const Eigen::Matrix3d R = rotation_about_axis(n, q[2]);
    const Eigen::Vector3d d1 = -n.cross(R.transpose() * e1), d2 = -n.cross(R.transpose() * e2);  // of both columns in the angle
    out.in_q[0].p_OP = e1;
    out.in_q[1].p_OP = e2;
    out.in_q[2].R_OP = tilde(n) * R;
    out.in_q[2].Ht.col(0).tail<3>() = d1;
    out.in_q[2].Ht.col(1).tail<3>() = d2;
    out.in_q[2].Hdot_v.tail<3>() = -(n * v[2]).cross(d1 * v[0] + d2 * v[1]);
    out.in_v.col(0).tail<3>() = v[2] * d1;
    out.in_v.col(1).tail<3>() = v[2] * d2;
    out.in_v.col(2).tail<3>() = v[0] * d1 + v[1] * d2;
  }
};

}  // namespace
const cardan_hinge_family& planar_family() { return hinge_table<Planar>(); }
HingeSlopes planar_slopes() { return slopes_of<Planar>(); }
}  // namespace cardan
