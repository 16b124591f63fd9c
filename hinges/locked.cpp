// locked: P is fixed in O. Any other hinge becomes one with `locked: true`.
#include "core/abi/family.hpp"

namespace cardan {
namespace {

struct Locked {
  static constexpr const char* type = "locked";
  static constexpr const char* summary = "no motion: the body is fixed to the inboard node";
  static constexpr int nq = 0, nv = 0;
  static constexpr auto shape = CARDAN_SHAPE_FIXED;
  struct Packed {};

  static bool pack(const Params&, Packed&) { return true; }
  static void kinematics(const Packed&, const double*, const double*, HingeOut<0>&) noexcept {}
};

}  // namespace
const cardan_hinge_family& locked_family() { return hinge_table<Locked>(); }
}  // namespace cardan
