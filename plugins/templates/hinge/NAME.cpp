// @TYPE@: P runs along an ellipse in the x-y plane of O and turns with it about z. q = angle [rad].
//   R = exp(z~ q), p = (a cos q, b sin q, 0); velocity of P per unit of v, in P axes: angular z, linear R* dp/dq.
#include <cmath>
#include <limits>

#include "core/abi/family.hpp"

namespace {

using namespace cardan;

struct Ellipse {
  static constexpr const char* type = "@TYPE@";
  static constexpr const char* summary = "motion along an ellipse, turning with it";
  static constexpr int nq = 1, nv = 1;
  static constexpr auto shape = CARDAN_SHAPE_DENSE;
  static constexpr const char *q_names[] = {"angle"}, *q_units[] = {"rad"}, *v_names[] = {"rate"}, *v_units[] = {"rad/s"};

  // The host converts units, checks ranges, and shows all of this by `cardan types`.
  static constexpr double kOpen = std::numeric_limits<double>::infinity();
  static constexpr cardan_param_desc schema[] = {
      param::in_range(param::required("semi_x", CARDAN_NUMBER, "m", "semi-axis along x"), 0.0, kOpen, CARDAN_ABOVE),
      param::in_range(param::required("semi_y", CARDAN_NUMBER, "m", "semi-axis along y"), 0.0, kOpen, CARDAN_ABOVE)};
  struct Packed {
    double a, b;
  };
  static bool pack(const Params& params, Packed& p) {
    p = {params.number("semi_x"), params.number("semi_y")};
    return true;
  }

  // Runs inside a right-hand side, from any thread: no allocation, no state, no exception. What is not written is 0, R_OP is 1.
  static void kinematics(const Packed& p, const double* q, const double* v, HingeOut<1>& out) noexcept {
    const double c = std::cos(q[0]), s = std::sin(q[0]), d = p.b - p.a;
    out.R_OP << c, -s, 0, s, c, 0, 0, 0, 1;
    out.p_OP << p.a * c, p.b * s, 0;
    out.Ht << 0, 0, 1, d * s * c, p.a * s * s + p.b * c * c, 0;
    out.Hdot_v << 0, 0, 0, d * (c * c - s * s) * v[0] * v[0], -2 * d * s * c * v[0] * v[0], 0;  // (d/dt Ht) v
  }
};

const void* family(const char* kind, std::uint32_t index) {
  return std::string_view(kind) == CARDAN_KIND_HINGE && index == 0 ? &hinge_table<Ellipse>() : nullptr;
}
const cardan_plugin kPlugin{sizeof(cardan_plugin), CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "@NAME@", "0.1", "", family};

}  // namespace

extern "C" CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host* host) {
  return host->abi_major == CARDAN_ABI_MAJOR ? &kPlugin : nullptr;
}
