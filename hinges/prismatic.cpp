// prismatic: translation along one axis
#include "core/abi/family.hpp"

namespace cardan {
namespace {

struct Prismatic {
  static constexpr const char* type = "prismatic";
  static constexpr const char* summary = "translation along one axis";
  static constexpr int nq = 1, nv = 1;
  static constexpr auto shape = CARDAN_SHAPE_SLIDE;
  using Packed = AxisParams;
  static constexpr cardan_param_desc schema[] = {
      param::required("axis", CARDAN_UNIT_VECTOR, "1", "hinge axis, in the axes of the hinge nodes")};
  static constexpr const char* q_names[] = {"displacement"};
  static constexpr const char* q_units[] = {"m"};
  static constexpr const char* v_names[] = {"rate"};
  static constexpr const char* v_units[] = {"m/s"};

  static bool pack(const Params& params, Packed& p) { return pack_axis(params, p, false); }
};

}  // namespace
const cardan_hinge_family& prismatic_family() { return hinge_table<Prismatic>(); }
}  // namespace cardan
