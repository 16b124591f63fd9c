// A plugin with a hinge that turns about z and whose coordinates are not its velocity: the cosine and sine of its angle. It begins at
// `start`.
#include <cmath>
#include <string_view>

#include "core/abi/family.hpp"

namespace {

using namespace cardan;

struct Turn {
  static constexpr const char* type = "told/turn";
  static constexpr const char* summary = "a rotation about z, by cosine and sine of its angle";
  static constexpr int nq = 2, nv = 1;
  static constexpr auto shape = CARDAN_SHAPE_DENSE;
  static constexpr const char *q_names[] = {"cos", "sin"}, *q_units[] = {"1", "1"}, *v_names[] = {"rate"}, *v_units[] = {"rad/s"};
  static constexpr cardan_param_desc schema[] = {param::optional("start", CARDAN_NUMBER, "rad", "the angle that it has at first")};
  struct Packed {
    double start;
  };

  static bool pack(const Params& params, Packed& p) {
    p = {params.number("start")};
    return true;
  }
  static void kinematics(const Packed&, const double* q, const double*, HingeOut<1>& out) noexcept {
    out.R_OP << q[0], -q[1], 0, q[1], q[0], 0, 0, 0, 1;
    out.Ht(2) = 1;
  }
  static void qdot(const Packed&, const double* q, const double* v, double* rate) noexcept {
    rate[0] = -q[1] * v[0], rate[1] = q[0] * v[0];
  }
  static void zero(const Packed& p, double* q) noexcept { q[0] = std::cos(p.start), q[1] = std::sin(p.start); }
  static void normalise(const Packed&, double* q) noexcept {
    const double length = std::hypot(q[0], q[1]);
    if (std::abs(length - 1) > 4e-16) q[0] /= length, q[1] /= length;
  }
  static void retract(const Packed&, const double* q, const double* d, double* out) noexcept {
    const double c = std::cos(d[0]), s = std::sin(d[0]), q0 = q[0], q1 = q[1];
    out[0] = c * q0 - s * q1, out[1] = s * q0 + c * q1;
  }
  static void difference(const Packed&, const double* a, const double* b, double* d) noexcept {
    d[0] = std::atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]);
  }
};

const void* family(const char* kind, std::uint32_t index) {
  return std::string_view(kind) == CARDAN_KIND_HINGE && index == 0 ? &hinge_table<Turn>() : nullptr;
}
const cardan_plugin plugin{sizeof plugin, CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "told", "1", "Apache-2.0", family};

}  // namespace

extern "C" CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host*) { return &plugin; }
