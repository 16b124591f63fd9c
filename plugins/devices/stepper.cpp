// stepper: a motor whose field turns in steps, on a hinge component: torque -T_h sin(p (q - q_f)) - T_d sin(4 p q), p = pi / (2 step), with
// q_f the angle of the field: a whole number of microsteps, the one nearest to what the commanded rate has added up to.
#include <cmath>
#include <numbers>

#include "core/abi/device_family.hpp"

namespace cardan {
namespace {

struct Stepper {
  static constexpr const char* type = "stepper";
  static constexpr const char* summary = "a stepper motor on a component of a hinge that turns: array and antenna drives";
  static constexpr unsigned facts = CARDAN_FACT_INTERNAL | CARDAN_FACT_ENERGY;
  static constexpr unsigned role = CARDAN_ROLE_ACTUATOR;
  struct Packed {
    double step, holding, detent, p, microsteps, damping, rate_limit;
  };
  static constexpr cardan_param_desc schema[] = {
      param::positive(param::required("step", CARDAN_NUMBER, "rad", "a full step, of the hinge")),
      param::positive(param::required("holding_torque", CARDAN_NUMBER, "N m", "the most that its field holds, at the hinge")),
      param::not_negative(
          param::optional("detent_torque", CARDAN_NUMBER, "N m", "the most that holds it without a field; at rest at full steps")),
      param::in_range(param::optional("microsteps", CARDAN_INTEGER, "1", "places of the field in a full step; 0: it turns evenly", 1.0),
                      0.0, 65536.0),
      param::not_negative(param::optional("damping", CARDAN_NUMBER, "N m s/rad", "of the hinge")),
      param::not_negative(
          param::optional("rate_limit", CARDAN_NUMBER, "1/s", "full steps in a second, beyond which a command is that; 0: none"))};
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_HINGE, CARDAN_USE_LOAD | CARDAN_USE_TURN | CARDAN_USE_COORDINATE, "a component of a hinge that turns"}};
  static constexpr cardan_port_desc ports[] = {{"rate", CARDAN_PORT_IN, "1/s", 0.0, 0, "full steps in a second"},
                                               {"torque", CARDAN_PORT_OUT, "N m", 0.0, 0, "on the hinge"},
                                               {"field", CARDAN_PORT_OUT, "rad", 0.0, 0, "angle that the field holds the hinge at"},
                                               {"work", CARDAN_PORT_OUT, "J", 0.0, 0, "that the steps of the field have brought in"}};
  static constexpr cardan_state_desc states[] = {{"steps", "1", 0.0, 1.0, "full steps commanded so far"}};
  static constexpr cardan_state_desc marks[] = {{"field", "1", 0.0, 1.0, "full steps that the field stands at"},
                                                {"work", "J", 0.0, 1.0, "that its steps have brought in"}};
  static constexpr std::uint32_t n_roots = 2;

  static bool pack(const Params& params, Packed& p) {
    const double step = params.number("step");
    p = {step,
         params.number("holding_torque"),
         params.number("detent_torque"),
         0.5 * std::numbers::pi / step,
         params.number("microsteps"),
         params.number("damping"),
         params.number("rate_limit")};
    return true;
  }

  template <class T>
  static T rate_of(const Packed& p, const T& command) noexcept {
    if (!(p.rate_limit > 0.0)) return command;
    return command > T(p.rate_limit) ? T(p.rate_limit) : command < T(-p.rate_limit) ? T(-p.rate_limit) : command;
  }
  template <class T>
  static T field_of(const Packed& p, const DeviceIn<T>& in) noexcept {
    return p.microsteps > 0.0 ? T(in.d[0]) : in.z[0];
  }
  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    using std::sin;
    const T field = T(p.step) * field_of(p, in), q = in.at[0].q, v = in.at[0].v;
    const T held = T(-p.holding) * sin(T(p.p) * (q - field)), torque = held - T(p.detent) * sin(T(4.0 * p.p) * q) - T(p.damping) * v;
    const T rate = rate_of(p, in.in[0]);
    out.zdot[0] = rate;
    out.load[0].tau = torque;
    out.out[0] = torque, out.out[1] = field, out.out[2] = T(in.d[1]);
    if (!(p.microsteps > 0.0)) out.delivered = held * T(p.step) * rate;
    out.lost = T(p.damping) * v * v;
  }
  /// 1 - cos x without the difference.
  static double versine(double x) noexcept {
    const double s = std::sin(0.5 * x);
    return 2.0 * s * s;
  }
  static double held_energy(const Packed& p, double q, double field) noexcept {
    return p.holding / p.p * versine(p.p * (q - p.step * field));
  }
  /// Less what its steps have brought in at once: so it is continuous, and what came from the supply is in the ledger.
  static double energy(const Packed& p, const DeviceIn<double>& in) noexcept {
    const double q = in.at[0].q;
    return held_energy(p, q, field_of(p, in)) + 0.25 * p.detent / p.p * versine(4.0 * p.p * q) - in.d[1];
  }

  /// Half a microstep ahead of the field and behind it, and by more than rounding: a field that has just stepped is on this side of the
  /// place where it steps back.
  static void roots(const Packed& p, const DeviceIn<double>& in, double* g) noexcept {
    const double ahead = p.microsteps * (in.z[0] - in.d[0]), half = 0.5 + 1e-14 * (1.0 + std::abs(p.microsteps * in.z[0]));
    g[0] = ahead - half, g[1] = ahead + half;
  }
  static void event(const Packed& p, const DeviceIn<double>& in, std::uint32_t root, int direction, double*, double* d) noexcept {
    if (!(p.microsteps > 0.0)) return;
    if (root == n_roots) {  // the start
      d[0] = std::floor(p.microsteps * in.z[0] + 0.5) / p.microsteps;
      return;
    }
    const int by = root == 0 && direction > 0 ? 1 : root == 1 && direction < 0 ? -1 : 0;
    if (by == 0) return;
    const double q = in.at[0].q, before = held_energy(p, q, d[0]);
    d[0] = (std::floor(p.microsteps * d[0] + 0.5) + by) / p.microsteps;
    d[1] += held_energy(p, q, d[0]) - before;
  }
};

}  // namespace
const cardan_device_family& stepper_family() { return device_table<Stepper>(); }
}  // namespace cardan
