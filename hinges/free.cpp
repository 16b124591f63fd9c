// free: six degrees of freedom; v = [omega in P axes; rate of the position in O axes], so that an orbit stays smooth.
#include "hinges/six_dof.hpp"

namespace cardan {
namespace {

struct Free : SixDof {
  static constexpr const char* type = "free";
  static constexpr const char* summary = "six degrees of freedom; linear velocity in the axes of the inboard node (use this one in orbit)";
  static constexpr auto shape = CARDAN_SHAPE_FREE;

  static void kinematics(const Packed&, const double* q, const double* v, HingeOut<6>& out) noexcept {
    out.R_OP = rotation(q);
    out.p_OP = Eigen::Map<const Eigen::Vector3d>(q + 4);
    out.Ht.topLeftCorner<3, 3>().setIdentity();
    out.Ht.bottomRightCorner<3, 3>() = out.R_OP.transpose();
    const Eigen::Map<const Eigen::Vector3d> omega(v), rate(v + 3);
    out.Hdot_v.tail<3>() = -omega.cross(out.R_OP.transpose() * rate);
  }
  static void qdot(const Packed&, const double* q, const double* v, double* qd) noexcept {
    QuaternionKinematics::qdot(q, v, qd);
    for (int i = 0; i < 3; ++i) qd[4 + i] = v[3 + i];
  }
  static void retract(const Packed&, const double* q, const double* d, double* out) noexcept {
    for (int i = 0; i < 3; ++i) out[4 + i] = q[4 + i] + d[3 + i];
    QuaternionKinematics::retract(q, d, out);
  }
  static void difference(const Packed&, const double* a, const double* b, double* d) noexcept {
    QuaternionKinematics::difference(a, b, d);
    for (int i = 0; i < 3; ++i) d[3 + i] = b[4 + i] - a[4 + i];
  }
};

}  // namespace
const cardan_hinge_family& free_family() { return hinge_table<Free>(); }
}  // namespace cardan
