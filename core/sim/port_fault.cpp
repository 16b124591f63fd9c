#include "core/sim/port_fault.hpp"

#include <fmt/format.h>

#include <cmath>

namespace cardan {

void PortFault::expect_good(const Located& at) const {
  const auto expect = [&at](bool good, const char* key, const char* expected, double got) {
    if (!good) refuse(Code::out_of_range, {at.key_path + "." + key, at.mark}, expected, fmt::format("{:g}", got));
  };
  expect(std::isfinite(scale), "scale", "a finite number", scale);
  expect(std::isfinite(bias), "bias", "a finite number", bias);
  expect(std::isfinite(drift), "drift", "a finite number", drift);
  expect(!value || std::isfinite(*value), "stuck", "a finite number", value.value_or(0.0));
  expect(std::isfinite(noise) && noise >= 0.0, "noise", "a standard deviation >= 0", noise);
  expect(drop >= 0.0 && drop <= 1.0, "drop", "a probability from 0 to 1", drop);
  expect(std::isfinite(from), "from", "a finite time [s]", from);
  expect(until > from, "until", "a time [s] after that at which it begins", until);
  expect(std::isfinite(delay) && delay >= 0.0, "delay", "a time >= 0 s", delay);
  const auto expect_alone = [&](const char* key, const PortFault& others, const char* expected) {
    if (others.any()) refuse(Code::out_of_range, {at.key_path + "." + key, at.mark}, expected, "others as well");
  };
  PortFault others = *this;
  others.stuck = false;
  if (stuck) expect_alone("stuck", others, "nothing beside it: what is stuck has no scale, bias, drift, noise, drop, delay or swap");
  others.swap = -1;
  if (swap >= 0) expect_alone("swap", others, "nothing beside it: what is swapped has no scale, bias, drift, noise, drop or delay");
}

AlteredPort RunningFault::altered(int index) const {
  if (stuck || lost) return {index, 0.0, kept};
  if (swap >= 0) return {.index = index, .of = swap - place};
  if (!line.empty()) return {index, 0.0, scale * late + bias + drawn, drift, from};
  return {index, scale, bias + drawn, drift, from};
}

void RunningFault::remember(Archive& a) {
  bool has_value = value.has_value();
  double at = value.value_or(0.0);
  a(device, input, place).finite(scale, bias, drift, at, noise, drop, delay, from, drawn, kept, late)(until, stuck, has_value, begun, lost);
  a(swap, oldest).finite(line);
  if (oldest < 0 || (oldest > 0 && oldest >= static_cast<int>(line.size()))) a.wrong("a delay that is none");
  value = has_value ? std::optional(at) : std::nullopt;
}

}  // namespace cardan
