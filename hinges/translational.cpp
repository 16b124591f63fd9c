// translational: three translations in the axes of O, no rotation.
#include "core/abi/family.hpp"
#include "hinges/slopes.hpp"

namespace cardan {
namespace {

struct Translational {
  static constexpr const char* type = "translational";
  static constexpr const char* summary = "three translations in the axes of the inboard node, no rotation";
  static constexpr int nq = 3, nv = 3;
  static constexpr auto shape = CARDAN_SHAPE_DENSE;
  struct Packed {};
  static constexpr const char* q_names[] = {"x", "y", "z"};
  static constexpr const char* q_units[] = {"m", "m", "m"};
  static constexpr const char* v_names[] = {"vx", "vy", "vz"};
  static constexpr const char* v_units[] = {"m/s", "m/s", "m/s"};

  static bool pack(const Params&, Packed&) { return true; }
  static void kinematics(const Packed&, const double* q, const double*, HingeOut<3>& out) noexcept {
    out.p_OP = Eigen::Map<const Eigen::Vector3d>(q);
    out.Ht.bottomRows<3>().setIdentity();
  }
  static void slopes(const Packed&, const double*, const double*, SlopesOut<3, 3>& out) noexcept {
    for (int i = 0; i < 3; ++i) out.in_q[i].p_OP[i] = 1.0;
  }
};

}  // namespace
const cardan_hinge_family& translational_family() { return hinge_table<Translational>(); }
HingeSlopes translational_slopes() { return slopes_of<Translational>(); }
}  // namespace cardan
