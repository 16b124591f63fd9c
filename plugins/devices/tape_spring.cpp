// tape_spring: the moment of a curved blade over the angle q it is folded by: stiff and strong while straight, up to a peak, then it snaps
// and keeps a small moment [shape after Seffen & Pellegrino 1999, Proc. Royal Society A 455; smooth]:
//   M = -(M_s tanh(q / w) + (M_p - M_s tanh(q_p / w)) (q / q_p) exp((1 - (q / q_p)^2) / 2)) - c q'.
#include <cmath>

#include "core/abi/device_family.hpp"

namespace cardan {
namespace {

struct TapeSpring {
  static constexpr const char* type = "tape_spring";
  static constexpr const char* summary = "a curved blade across a hinge: it snaps straight and stays";
  static constexpr unsigned facts = CARDAN_FACT_INTERNAL | CARDAN_FACT_ENERGY | CARDAN_FACT_PASSIVE | CARDAN_FACT_ROUGH;
  static constexpr unsigned role = CARDAN_ROLE_FORCE;
  struct Packed {
    double peak, peak_angle, steady, width, damping, rest;
  };
  static constexpr cardan_param_desc schema[] = {
      param::positive(param::required("peak_moment", CARDAN_NUMBER, "N m", "at peak_angle; the largest is a little beyond")),
      param::positive(param::required("peak_angle", CARDAN_NUMBER, "rad", "about where it snaps")),
      param::positive(param::required("steady_moment", CARDAN_NUMBER, "N m", "of the folded blade")),
      param::not_negative(param::optional("damping", CARDAN_NUMBER, "N m s/rad", "of its motion")),
      param::optional("rest", CARDAN_NUMBER, "rad", "the angle at which it is straight")};
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_HINGE, CARDAN_USE_LOAD | CARDAN_USE_TURN | CARDAN_USE_COORDINATE,
                                                  "a component of a hinge that turns, with a coordinate"}};
  static constexpr cardan_port_desc ports[] = {{"moment", CARDAN_PORT_OUT, "N m", 0.0, 0, "on the hinge"}};

  static bool pack(const Params& params, Packed& p) {
    p.peak_angle = params.number("peak_angle"), p.steady = params.number("steady_moment"), p.damping = params.number("damping");
    p.width = p.peak_angle, p.rest = params.number("rest");
    p.peak = params.number("peak_moment") - p.steady * std::tanh(1.0);
    return p.peak > 0.0 || params.fail("peak_moment", "more than the steady moment");
  }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    using std::exp, std::tanh;
    const T s = (in.at[0].q - T(p.rest)) / T(p.peak_angle), v = in.at[0].v;
    const T moment = -(T(p.steady) * tanh(s) + T(p.peak) * s * exp(T(0.5) * (T(1.0) - s * s))) - T(p.damping) * v;
    out.load[0].tau = moment;
    out.out[0] = moment;
    out.lost = T(p.damping) * v * v;
  }
  static double energy(const Packed& p, const DeviceIn<double>& in) noexcept {
    const double s = (in.at[0].q - p.rest) / p.peak_angle, a = std::abs(s);
    const double log_cosh = a + std::log1p(std::exp(-2.0 * a)) - std::log(2.0);
    return p.peak_angle * (p.steady * log_cosh + p.peak * std::exp(0.5) * -std::expm1(-0.5 * s * s));
  }
};

}  // namespace
const cardan_device_family& tape_spring_family() { return device_table<TapeSpring>(); }
}  // namespace cardan
