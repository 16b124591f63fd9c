// cable: a spring and a damper along the line between two nodes that pull and never push: f = max(0, k (l - l_0) + c l') where l > l_0,
// else it is slack. Both instants are located.
#include <limits>

#include "plugins/devices/line.hpp"

namespace cardan {
namespace {

struct Cable {
  static constexpr const char* type = "cable";
  static constexpr const char* summary = "pulls two nodes towards each other where it is taut, and is slack where they are nearer";
  static constexpr unsigned facts = CARDAN_FACT_INTERNAL | CARDAN_FACT_ENERGY | CARDAN_FACT_PASSIVE;
  static constexpr unsigned role = CARDAN_ROLE_FORCE;
  struct Packed {
    double stiffness, length, damping;
  };
  static constexpr cardan_param_desc schema[] = {
      param::positive(param::required("stiffness", CARDAN_NUMBER, "N/m", "force over stretch: E A / l")),
      param::not_negative(param::required("length", CARDAN_NUMBER, "m", "up to which it is slack")),
      param::not_negative(param::optional("damping", CARDAN_NUMBER, "N s/m", "force over rate while it is taut; it never pushes"))};
  static constexpr const auto& mounts = kLineMounts;
  static constexpr cardan_port_desc ports[] = {{"length", CARDAN_PORT_OUT, "m", 0.0, 0, "between the nodes"},
                                               {"tension", CARDAN_PORT_OUT, "N", 0.0, 0, "that pulls them towards each other"},
                                               {"taut", CARDAN_PORT_OUT, "1", 0.0, 0, "1: it pulls; 0: it is slack"}};
  enum Regime { kUntold, kTaut, kGivingWay, kSlack };  // giving way: nothing pulls, its damper takes what its spring still has
  static constexpr cardan_state_desc marks[] = {
      {"regime", "1", 0.0, 1.0, "1: taut; 2: slack with a stretch that its damper takes; 3: slack; 0: what its length tells"}};
  static constexpr std::uint32_t n_roots = 2;
  static constexpr double kHeld = 1e-12;  // of the length: by which it goes on in a regime, beyond rounding where it just comes to the next

  static bool pack(const Params& params, Packed& p) {
    p = {params.number("stiffness"), params.number("length"), params.number("damping")};
    return true;
  }

  template <class T>
  struct Pull {
    NodeLine<T> line;
    T elastic, sum;  // of the spring; with the damper
  };
  template <class T>
  static Pull<T> pull(const Packed& p, const DeviceIn<T>& in) noexcept {
    const NodeLine<T> l = line_between(in);
    const T elastic = T(p.stiffness) * (l.length - T(p.length));
    return {l, elastic, elastic + T(p.damping) * l.rate};
  }
  /// Between two events its law is smooth, beyond the instant of the next one too.
  template <class T>
  static Regime regime(const double* d, const Pull<T>& at) noexcept {
    if (const auto told = static_cast<Regime>(d[0]); told != kUntold) return told;
    return !(at.elastic > T(0.0)) ? kSlack : at.sum > T(0.0) ? kTaut : kGivingWay;
  }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    const Pull<T> at = pull(p, in);
    const Regime is = regime(in.d, at);
    const T spring = is == kSlack ? T(0.0) : at.elastic, tension = is == kTaut ? at.sum : T(0.0);
    pull_along(at.line, tension, in, out);
    out.out[0] = at.line.length, out.out[1] = tension, out.out[2] = T(is == kTaut ? 1.0 : 0.0);
    out.lost = (tension - spring) * at.line.rate;
  }
  static double energy(const Packed& p, const DeviceIn<double>& in) noexcept {
    const Pull<double> at = pull(p, in);
    return regime(in.d, at) == kSlack ? 0.0 : 0.5 * at.elastic * at.elastic / p.stiffness;
  }
  /// Above zero where it is taut: both the stretch and the force are then. And where a stretch that was left is gone. What is not taut at
  /// zero is below it, so that a cable that begins at its length crosses it.
  static void roots(const Packed& p, const DeviceIn<double>& in, double* g) noexcept {
    const Pull<double> at = pull(p, in);
    g[0] = std::fmin(at.elastic, at.sum), g[1] = at.elastic;
    const auto told = static_cast<Regime>(in.d[0]);
    const auto far = [&](int end) { return std::sqrt(dot(in.at[end].position, in.at[end].position)); };
    const double held = p.stiffness * (kHeld * p.length + kOnePoint * (far(0) + far(1)));
    if (told != kUntold) g[0] += told == kTaut ? held : -held;
    if (g[0] == 0.0 && regime(in.d, at) != kTaut) g[0] = -std::numeric_limits<double>::min();
  }
  static void event(const Packed& p, const DeviceIn<double>& in, std::uint32_t root, int direction, double*, double* d) noexcept {
    constexpr double untold = kUntold;
    const Pull<double> at = pull(p, in);
    if (root == n_roots) d[0] = regime(&untold, at);  // the start
    if (root == 0) d[0] = direction > 0 ? kTaut : at.elastic > 0.0 ? kGivingWay : kSlack;
    if (root == 1 && direction < 0) d[0] = kSlack;
  }
};

}  // namespace
const cardan_device_family& cable_family() { return device_table<Cable>(); }
}  // namespace cardan
