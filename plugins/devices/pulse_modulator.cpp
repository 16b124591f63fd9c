// pulse_modulator: a valve is open or closed. At each of its ticks it opens for the part of the period that is commanded, at least for the
// shortest pulse; what is shorter is left out, made longer, or kept until enough has come together.
#include <algorithm>

#include "core/abi/device_family.hpp"

namespace cardan {
namespace {

enum Short { kSkip, kRaise, kCarry };
constexpr const char* kShorts[] = {"skip", "raise", "carry"};

struct PulseModulator {
  static constexpr const char* type = "pulse_modulator";
  static constexpr const char* summary = "opens a valve for a part of each period, at least for a shortest pulse";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_CONTROLLER;
  struct Packed {
    double minimum;
    int when_short;
  };
  static constexpr cardan_param_desc schema[] = {
      param::not_negative(param::optional("minimum", CARDAN_NUMBER, "s", "shortest pulse")),
      param::named(param::optional("short", CARDAN_CHOICE, "1",
                                   "a pulse below it. skip: none; raise: the shortest; carry: its time is added to the next ones"),
                   kShorts)};
  static constexpr cardan_port_desc ports[] = {{"command", CARDAN_PORT_IN, "1", 0.0, 0, "part of the period; cut to 0 to 1"},
                                               {"open", CARDAN_PORT_OUT, "1", 0.0, 0, "1 while it is, else 0"}};
  static constexpr cardan_state_desc marks[] = {{"open", "1", 0.0, 0.0, "1 while it is"},
                                                {"until", "s", 0.0, 0.0, "when the pulse ends"},
                                                {"earliest", "s", 0.0, 0.0, "when the pulse may end"},
                                                {"owed", "s", 0.0, 0.0, "carried to the next pulses"}};
  static constexpr std::uint32_t n_roots = 1;

  static bool pack(const Params& params, Packed& p) {
    p = {params.number("minimum"), params.choice("short")};
    return true;
  }

  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.out[0] = T(in.d[0]);
  }
  static void roots(const Packed&, const DeviceIn<double>& in, double* g) noexcept { g[0] = in.d[0] != 0.0 ? in.d[1] - in.t : 1.0; }
  static void event(const Packed&, const DeviceIn<double>&, std::uint32_t root, int, double*, double* d) noexcept {
    if (root < n_roots) d[0] = 0.0;
  }

  static void tick(const Packed& p, const DeviceIn<double>& in, double period, const double*, double*, double* d) noexcept {
    double &open = d[0], &until = d[1], &earliest = d[2], &owed = d[3];
    const double wanted = std::clamp(in.in[0], 0.0, 1.0) * period + owed;
    const double least = open != 0.0 ? std::max(0.0, earliest - in.t) : p.minimum;
    double given = wanted;  // what is commanded for all of the period goes on, and is not short
    if (wanted < std::min(least, period)) given = open != 0.0 || (p.when_short == kRaise && wanted > 0.0) ? least : 0.0;
    owed = p.when_short == kCarry ? wanted - std::min(given, period) : 0.0;
    if (open == 0.0) earliest = in.t + p.minimum;
    open = given > 0.0 ? 1.0 : 0.0;
    // A pulse to the very end goes on until the next tick says otherwise: no gap of a rounding.
    until = in.t + (given < period * (1.0 - 1e-9) ? given : 2.0 * period);
  }
};

}  // namespace
const cardan_device_family& pulse_modulator_family() { return device_table<PulseModulator>(); }
}  // namespace cardan
