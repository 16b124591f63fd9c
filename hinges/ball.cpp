// ball: free rotation, attitude as a quaternion (w, x, y, z), P axes to O axes; rates are omega of P in O, P axes.
#include "core/abi/family.hpp"
#include "hinges/axes.hpp"

namespace cardan {
namespace {

struct Ball : QuaternionKinematics {
  static constexpr const char* type = "ball";
  static constexpr const char* summary = "free rotation (quaternion; rates = angular velocity in the axes of the body node)";
  static constexpr int nq = 4, nv = 3;
  static constexpr auto shape = CARDAN_SHAPE_BALL;
  struct Packed {};
  static constexpr const char* q_names[] = {"qw", "qx", "qy", "qz"};
  static constexpr const char* q_units[] = {"1", "1", "1", "1"};
  static constexpr const char* v_names[] = {"wx", "wy", "wz"};
  static constexpr const char* v_units[] = {"rad/s", "rad/s", "rad/s"};

  static bool pack(const Params&, Packed&) { return true; }
  static void zero(const Packed&, double* q) noexcept { q[0] = 1, q[1] = q[2] = q[3] = 0; }
  static void kinematics(const Packed&, const double* q, const double*, HingeOut<3>& out) noexcept {
    out.R_OP = rotation(q);
    out.Ht.topRows<3>().setIdentity();
  }
  static void qdot(const Packed&, const double* q, const double* v, double* qd) noexcept { QuaternionKinematics::qdot(q, v, qd); }
  static void normalise(const Packed&, double* q) noexcept { QuaternionKinematics::normalise(q); }
  static void retract(const Packed&, const double* q, const double* d, double* out) noexcept { QuaternionKinematics::retract(q, d, out); }
  static void difference(const Packed&, const double* a, const double* b, double* d) noexcept { QuaternionKinematics::difference(a, b, d); }
};

}  // namespace
const cardan_hinge_family& ball_family() { return hinge_table<Ball>(); }
}  // namespace cardan
