#include "core/sim/headway.hpp"

#include <fmt/format.h>

#include <cmath>
#include <span>

namespace cardan {

std::optional<RunFailure> Headway::stalls(double t, double t_end) {
  constexpr long kLook = 200'000;
  if (steps_ - looked_at_ < kLook) return {};
  const double advanced = t - t_looked_at_, left = t_end - t;
  begin(t);
  if (!std::isfinite(left) || left <= 1e7 * advanced) return {};
  return RunFailure{Code::step_too_small,
                    t,
                    "",
                    "",
                    fmt::format("time does not advance: the last {} steps went {:.2g} s further, {:.3g} s are left", kLook, advanced, left),
                    "rates or a stiffness beyond all measure, or a max_step or step that is far too small",
                    ""};
}

std::optional<RunFailure> Headway::storms(double t, double t_end, const std::string& event) {
  double& earliest = events_[events_seen_ % kEvents];
  const double span = t - earliest;
  if (events_seen_ >= kEvents && span <= 1e-7 * (t_end - t))
    return RunFailure{Code::event_storm,
                      t,
                      "",
                      "",
                      fmt::format("{} events in the last {:.2g} s, the last of them \"{}\"", kEvents, span, event),
                      "let the action leave the zero of `when` for good: a band (hysteresis), a latch, a smallest time between two events",
                      ""};
  earliest = t;
  ++events_seen_;
  return {};
}

bool Headway::crawls(double t, double t_end) {
  constexpr int kMost = 50;
  if (t - t_limited_ > 1e-6 * (t_end - t)) limited_ = 0;
  t_limited_ = t;
  return ++limited_ > kMost;
}

void Headway::remember(Archive& a) { a(steps_, std::span(events_), events_seen_, limited_, t_limited_); }

}  // namespace cardan
