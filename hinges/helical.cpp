// helical: screw: rotation about an axis with an advance of pitch metres per radian
#include "core/abi/family.hpp"

namespace cardan {
namespace {

struct Helical {
  static constexpr const char* type = "helical";
  static constexpr const char* summary = "screw: rotation about an axis with an advance of pitch metres per radian";
  static constexpr int nq = 1, nv = 1;
  static constexpr auto shape = CARDAN_SHAPE_SCREW;
  using Packed = AxisParams;
  static constexpr cardan_param_desc schema[] = {
      param::required("axis", CARDAN_UNIT_VECTOR, "1", "hinge axis, in the axes of the hinge nodes"),
      param::required("pitch", CARDAN_NUMBER, "m/rad", "advance along the axis per radian")};
  static constexpr const char* q_names[] = {"angle"};
  static constexpr const char* q_units[] = {"rad"};
  static constexpr const char* v_names[] = {"rate"};
  static constexpr const char* v_units[] = {"rad/s"};

  static bool pack(const Params& params, Packed& p) { return pack_axis(params, p, true); }
};

}  // namespace
const cardan_hinge_family& helical_family() { return hinge_table<Helical>(); }
}  // namespace cardan
