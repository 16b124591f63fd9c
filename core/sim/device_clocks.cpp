#include "core/sim/device_clocks.hpp"

#include <fmt/format.h>

#include <cmath>

#include "core/abi/port_vectors.hpp"

namespace cardan {
namespace {

const DeviceSpec& spec_of(const Model& m, const Device& d) { return m.spec->devices[static_cast<std::size_t>(d.spec)]; }

}  // namespace

Rational period_of(const Model& m, const Device& d) {
  const DeviceSpec& spec = spec_of(m, d);
  const std::string path = "devices." + d.name;
  return spec.rate > 0.0 ? period_from_hertz(spec.rate, m.spec->locate(path + ".rate"))
                         : period_from_seconds(spec.period, m.spec->locate(path + ".period"));
}

Rational offset_of(const Model& m, const Device& d) {
  const double offset = spec_of(m, d).offset;
  if (offset == 0.0) return {};
  const auto exact = to_rational(offset);
  if (!(offset > 0.0) || !exact || exact->numerator > Rational::kLargest)
    refuse(Code::out_of_range, m.spec->locate("devices." + d.name + ".offset"), "a time >= 0 that is a ratio of whole numbers",
           fmt::format("{:g} s", offset));
  return *exact;
}

int ticks_of_delay(const Model& m, const Device& d, double delay) {
  const Rational period = period_of(m, d);
  const auto ratio = to_rational(delay);
  // delay / period = (a d) / (b n)
  const std::int64_t above = ratio ? ratio->numerator * period.denominator : 1, below = ratio ? ratio->denominator * period.numerator : 0;
  return below == 0 || above % below != 0 || above / below > kMostTicks ? 0 : static_cast<int>(above / below);
}

std::string told_input(const Model& m, int input) {
  for (const Device& d : m.devices.all)
    if (input >= d.in && input < d.in + d.n_in)
      return fmt::format("devices.{}.inputs.{}", d.name, port_at(*d.family, CARDAN_PORT_IN, input - d.in).name);
  return "devices";
}

DelayLines::DelayLines(const Model& m) {
  for (const DelayLine& line : m.devices.delays) {
    const Device& clock = m.devices.all[static_cast<std::size_t>(line.clock)];
    int ticks = line.ticks;
    if (ticks == 0) {
      const double tick = period_of(m, clock).value();
      ticks = ticks_of_delay(m, clock, line.latency);
      if (ticks == 0) {
        const double nearest = std::max(1.0, std::round(line.latency / tick));
        refuse(Code::bad_connection, m.spec->locate(told_input(m, line.input) + ".latency"),
               fmt::format("a whole number of ticks of {}, {:g} s each, at most {}", clock.name, tick, kMostTicks),
               fmt::format("{:g} s", line.latency), fmt::format("{:g} s, or another rate of {}", nearest * tick, clock.name));
      }
    }
    numbers_.insert(numbers_.end(), static_cast<std::size_t>(ticks), line.fallback);
    first_.push_back(numbers_.size());
  }
}

CommandAges CommandAges::in(const Devices& before, const ModelMap& map, const Devices& now, double t) const {
  CommandAges ages(now);
  ages.all_set(t);
  for (std::size_t i = 0; i < set_.size(); ++i) ages.set(now, map.in[static_cast<std::size_t>(before.timeouts[i].input)], set_[i]);
  return ages;
}

}  // namespace cardan
