#include "core/sim/expected_stiffness.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/sim/fastest_motion.hpp"

namespace cardan {

const char* const kStiffHint =
    "integrator.method = \"cvode_bdf\", above some fifty states with linear_solver = \"krylov\"; or a softer law, or a locked hinge";
const char* const kSwingHint =
    "integrator.method = \"cvode_bdf\" where it is damped out; where it swings on that follows it as well: a softer law, fewer modes, or a "
    "locked hinge, if it does not matter";

namespace {

constexpr double kManyDecaying = 1e6, kManySwinging = 1e7;  // steps

/// h times the rate that an explicit method stands: on the real axis, on the imaginary one (there as far as the error test lets it).
struct Stability {
  double decay, swing;
};
Stability stability_of(const std::string& method) {
  if (method == "rk4") return {2.785, 2.828};
  if (method == "variational") return {1.5, 1.5};  // its iteration, which is given 60 attempts; it converges, ever more slowly, up to 2
  if (method == "variational4") return {2.2, 2.2};
  if (method == "dopri5") return {3.3, 1.6};
  if (method == "dop853") return {6.1, 5.4};
  if (method == "ark_explicit") return {4.0, 1.5};
  return {1.0, 1.0};  // the fixed-point iteration of Adams, about
}

/// h with two digits, and no larger.
double rounded_down(double h) {
  const double unit = std::pow(10.0, std::floor(std::log10(h)) - 1.0);
  return std::floor(h / unit) * unit;
}

}  // namespace

Warnings expected_stiffness(const std::shared_ptr<const Model>& model, const double* q, const IntegratorOptions& options, double interval,
                            double span) {
  Warnings out;
  if (is_implicit(options.method) || advances_linear_part(options.method)) return out;
  const FastestMotions both = fastest_motions(model, q);
  const Stability stable = stability_of(options.method);
  const auto longest_step = [&](const FastestMotion& of) { return (of.decays ? stable.decay : stable.swing) / of.rate; };
  const auto many = [](const FastestMotion& of) { return of.decays ? kManyDecaying : kManySwinging; };
  const bool equal_steps = options.fixed_step > 0.0;
  // The one that asks for more than the other: the slower one may.
  const double share = equal_steps ? 1.0 : many(both.decays) / many(both.swings);
  const FastestMotion& fastest = longest_step(both.decays) * share < longest_step(both.swings) ? both.decays : both.swings;
  if (fastest.rate <= 0.0) return out;
  const double h = longest_step(fastest), steps = span / h;
  const std::string cause = fastest.decays ? fmt::format("{} decays at {:.3g} 1/s", fastest.what, fastest.rate)
                                           : fmt::format("{} swings at {:.3g} Hz", fastest.what, fastest.rate / (2.0 * std::numbers::pi));
  if (equal_steps && std::min(options.fixed_step, interval) > h)
    out.add(Code::stiff_scene, {"integrator.step", {}},
            fmt::format("{}: {} {} with steps above {:.3g} s", cause, options.method,
                        options.method.starts_with("variational") ? "does not solve its equations" : "is unstable", h),
            fmt::format("a step of {:.2g} s at most, or {}", rounded_down(h), kStiffHint));
  else if (!equal_steps && steps > many(fastest))
    out.add(Code::stiff_scene, {"integrator.method", {}},
            fmt::format("{}: {} must take steps of {:.2g} s, {:.1e} of them in {:g} s", cause, options.method, h, steps, span),
            fastest.decays ? kStiffHint : kSwingHint);
  return out;
}

}  // namespace cardan
