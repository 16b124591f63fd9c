// free_body: six degrees of freedom; v = [omega; linear velocity], both in P axes: quasi-velocities.
#include "hinges/six_dof.hpp"

namespace cardan {
namespace {

struct FreeBody : SixDof {
  static constexpr const char* type = "free_body";
  static constexpr const char* summary = "six degrees of freedom; both velocities in the axes of the body node";
  static constexpr auto shape = CARDAN_SHAPE_FREE_BODY;

  static void kinematics(const Packed&, const double* q, const double*, HingeOut<6>& out) noexcept {
    out.R_OP = rotation(q);
    out.p_OP = Eigen::Map<const Eigen::Vector3d>(q + 4);
    out.Ht.setIdentity();
  }
  static void qdot(const Packed&, const double* q, const double* v, double* qd) noexcept {
    QuaternionKinematics::qdot(q, v, qd);
    Eigen::Map<Eigen::Vector3d>(qd + 4) = rotation(q) * Eigen::Map<const Eigen::Vector3d>(v + 3);
  }
  static void retract(const Packed&, const double* q, const double* d, double* out) noexcept {
    const Eigen::Vector3d step = rotation(q) * Eigen::Map<const Eigen::Vector3d>(d + 3);
    for (int i = 0; i < 3; ++i) out[4 + i] = q[4 + i] + step[i];
    QuaternionKinematics::retract(q, d, out);
  }
  static void difference(const Packed&, const double* a, const double* b, double* d) noexcept {
    QuaternionKinematics::difference(a, b, d);
    Eigen::Map<Eigen::Vector3d>(d + 3) =
        rotation(a).transpose() * (Eigen::Map<const Eigen::Vector3d>(b + 4) - Eigen::Map<const Eigen::Vector3d>(a + 4));
  }
};

}  // namespace
const cardan_hinge_family& free_body_family() { return hinge_table<FreeBody>(); }
}  // namespace cardan
