// revolute: rotation about one axis
#include "core/abi/family.hpp"

namespace cardan {
namespace {

struct Revolute {
  static constexpr const char* type = "revolute";
  static constexpr const char* summary = "rotation about one axis";
  static constexpr int nq = 1, nv = 1;
  static constexpr auto shape = CARDAN_SHAPE_ROTATION;
  using Packed = AxisParams;
  static constexpr cardan_param_desc schema[] = {
      param::required("axis", CARDAN_UNIT_VECTOR, "1", "hinge axis, in the axes of the hinge nodes")};
  static constexpr const char* q_names[] = {"angle"};
  static constexpr const char* q_units[] = {"rad"};
  static constexpr const char* v_names[] = {"rate"};
  static constexpr const char* v_units[] = {"rad/s"};

  static bool pack(const Params& params, Packed& p) { return pack_axis(params, p, false); }
};

}  // namespace
const cardan_hinge_family& revolute_family() { return hinge_table<Revolute>(); }
}  // namespace cardan
