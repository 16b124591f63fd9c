#include "core/sim/choose_method.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/sim/device_corners.hpp"
#include "core/sim/fastest_motion.hpp"
#include "core/sim/vehicle_implicit_form.hpp"
#include "core/sim/vehicle_linear_part.hpp"
#include "core/time/methods.hpp"

namespace cardan {
namespace {

// Between two ticks an explicit method takes a step or two for what is slow: an angle of the fastest swing beyond this makes them more.
constexpr double kAngle = 5.0;         // [rad]
constexpr double kTwoSteps = 0.3;      // [rad] by which it takes two steps of order 5 at fine tolerances
constexpr double kWithoutTicks = 1.0;  // [s] that slow motion takes at least for such an angle, where nothing interrupts
constexpr double kStiff = 1e3;         // decays of that rate [1/s] hold an explicit method to thousands of steps in a second
constexpr double kFine = 1e-11;        // relative: below, an order of three is too low
constexpr double kHighOrder = 1e-7;    // relative: below, order 8 needs half the evaluations of order 5
constexpr double kBeside = 0.2;  // of the fastest swing: what is not linear and faster holds exponential, of order three, to as many steps
constexpr double kDense = 50.0;  // states up to which a dense Jacobian is faster

}  // namespace

MethodChoice choose_method(const std::shared_ptr<const Model>& model, double interval, const IntegratorOptions& asked, Dynamics dynamics) {
  MethodChoice out{asked, {}};
  std::string& method = out.options.method;
  if (asked.fixed_step > 0.0) {
    method = "rk4";
    out.why = fmt::format("a step of {:g} s is given", asked.fixed_step);
    return out;
  }
  if (model->loops.absolute && VehicleImplicitForm::refusal(*model).empty()) {
    method = "ida";
    out.why = "loop_form: dae";
    return out;
  }
  const State start = model->initial_state();
  const FastestMotion fastest = fastest_motion(model, start.q.data());
  const auto [corners, as_commanded] = device_corners(*model, kWithoutTicks);
  const double ticks = interval;
  interval = std::min(ticks, corners);
  const double span = std::min(interval, kWithoutTicks), angle = fastest.rate * span;
  const std::string told = fastest.decays ? fmt::format("{} decays at {:.3g} 1/s", fastest.what, fastest.rate)
                                          : fmt::format("{} swings at {:.3g} Hz", fastest.what, fastest.rate / (2.0 * std::numbers::pi));
  const std::string often =
      interval >= kWithoutTicks
          ? ""
          : fmt::format(" and {} each {:.3g} s", corners < ticks ? "devices end steps" : "commands may change", interval);
  const bool standard = dynamics == Dynamics::standard;
  const bool may_close = model->loops.empty() && !model->spec->loops.empty();  // open at the start, closed by the mission
  const std::string not_linear = !standard   ? name_of(dynamics) + " dynamics"
                                 : may_close ? "loops that a mission may close"
                                             : VehicleLinearPart::refusal(*model);
  const bool closed_form = angle > kAngle && not_linear.empty() && asked.relative_tolerance >= kFine;
  const FastestMotion beside = closed_form ? swing_of_devices(*model, 0.0, start) : FastestMotion{};
  if (closed_form && beside.rate <= kBeside * fastest.rate) {
    method = "exponential";
    out.options.rivals = {asked.relative_tolerance < kHighOrder ? "dop853" : "dopri5", "multirate"};
    out.options.fastest = fastest.rate;
    out.why = told + often + ": it is advanced in closed form" +
              fmt::format("; where the error sets its steps, {} and multirate are tried beside it, and what costs least goes on",
                          out.options.rivals.front()) +
              (as_commanded ? "; where a mission commands a device that ends steps (a stepper without `rate_limit`) often, dopri5 is faster"
                            : "");
  } else if (fastest.decays && fastest.rate > kStiff && model->spec->loops.empty()) {
    method = "cvode_bdf";
    if (model->nq + model->nv > kDense && asked.linear_solver.empty() && standard) out.options.linear_solver = "krylov";
    out.why = told + ": stiff" + (not_linear.empty() ? std::string() : fmt::format(", and exponential does not take {}", not_linear));
  } else {
    // Order 8 pays where a step of its own fits between two ticks, or the fastest motion makes it several.
    const bool long_enough = angle > kTwoSteps || 2.0 * std::numbers::pi * interval > kAngle;
    method = asked.relative_tolerance < kHighOrder && long_enough ? "dop853" : "dopri5";
    const std::string why_high = fmt::format("a tolerance of {:g}{}", asked.relative_tolerance, often.empty() ? " on long stretches" : "");
    const std::string why_low = often.empty() ? fmt::format("a tolerance of {:g}", asked.relative_tolerance) : often.substr(5);
    out.why = (method == "dop853" ? why_high : why_low) +
              (fastest.rate <= 0.0   ? ", nothing is elastic or damped"
               : angle <= kAngle     ? ", " + told + ": slow beside that"
               : !not_linear.empty() ? fmt::format(", {}, but exponential does not take {}", told, not_linear)
               : closed_form         ? fmt::format(", {}, and {} swings at {:.3g} Hz, which exponential does not take in closed form", told,
                                                   beside.what, beside.rate / (2.0 * std::numbers::pi))
                                     : ", " + told + ", finer than exponential is made for");
  }
  return out;
}

}  // namespace cardan
