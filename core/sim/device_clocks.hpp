#pragma once
// When devices with a sampled part tick; inputs that come some ticks later, and commands that grow old.
#include <algorithm>
#include <limits>
#include <span>
#include <vector>

#include "core/model/model_map.hpp"
#include "core/sim/schedule.hpp"

namespace cardan {

/// Of the ticks of a device, and when the first of them comes. InputError C0301 where it is no ratio of whole numbers, or out of range.
Rational period_of(const Model& model, const Device& device);
Rational offset_of(const Model& model, const Device& device);
/// delay [s] / period of the device, a whole number up to kMostTicks; 0: it is none.
int ticks_of_delay(const Model& model, const Device& device, double delay);
/// "devices.wheel.inputs.torque"; index as in Devices::in0.
std::string told_input(const Model& model, int input);

/// What is on its way to inputs with a delay or latency: the memory of Devices::delays. docs/mathematics/devices.md.
class DelayLines {
 public:
  DelayLines() = default;
  /// All at their fallback. InputError C1002 where a latency is no whole number of ticks.
  explicit DelayLines(const Model& model);

  /// At a tick of the device `clock` its lines give their oldest number, until the next: `take(input, number)`.
  template <class Take>
  void shift(const Devices& devices, int clock, const Take& take) {
    each_of(devices, clock, [&](const DelayLine& line, std::span<double> numbers) {
      take(line.input, numbers[0]);
      std::ranges::copy(numbers.subspan(1), numbers.begin());
    });
  }
  /// After all ticks of an instant: what is taken later is `sum(outs)` of now.
  template <class Sum>
  void sample(const Devices& devices, int clock, const Sum& sum) {
    each_of(devices, clock, [&](const DelayLine& line, std::span<double> numbers) { numbers.back() = sum(line.outs); });
  }
  /// Line i goes on with what line `was` of another model had on its way.
  void go_on(std::size_t i, const DelayLines& before, std::size_t was) { std::ranges::copy(before.line(was), line(i).begin()); }
  /// All numbers, line by line, the oldest first.
  std::span<double> numbers() { return numbers_; }
  /// With those of another run of the same vehicle; else it stays as it is.
  void take_over(const DelayLines& other) {
    if (numbers_.size() == other.numbers_.size()) numbers_ = other.numbers_;
  }

 private:
  std::span<double> line(std::size_t i) { return std::span(numbers_).subspan(first_[i], first_[i + 1] - first_[i]); }
  std::span<const double> line(std::size_t i) const { return std::span(numbers_).subspan(first_[i], first_[i + 1] - first_[i]); }
  template <class Work>
  void each_of(const Devices& devices, int clock, const Work& work) {
    for (std::size_t i = 0; i < devices.delays.size(); ++i)
      if (devices.delays[i].clock == clock) work(devices.delays[i], line(i));
  }
  std::vector<std::size_t> first_{0};  // where each begins in numbers_, and where the last one ends
  std::vector<double> numbers_;
};

/// When commands of Devices::timeouts were set last: one that is too old goes to its safe value.
class CommandAges {
 public:
  CommandAges() = default;
  explicit CommandAges(const Devices& devices) : set_(devices.timeouts.size(), 0.0) {}

  void all_set(double t) { std::ranges::fill(set_, t); }
  void set(const Devices& devices, int input, double t) {
    for (std::size_t k = 0; k < set_.size(); ++k)
      if (devices.timeouts[k].input == input) set_[k] = t;
  }
  /// [s] When the next one is too old.
  double next(const Devices& devices) const {
    double t = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < set_.size(); ++k) t = std::min(t, due(k, devices));
    return t;
  }
  /// `expire(timeout)` of those that are too old at t.
  template <class Expire>
  void expire(const Devices& devices, double t, const Expire& expire) {
    for (std::size_t k = 0; k < set_.size(); ++k) {
      if (t < due(k, devices)) continue;
      expire(devices.timeouts[k]);
      set_[k] = std::numeric_limits<double>::infinity();
    }
  }
  /// In another model at t: those that were there before keep their age.
  CommandAges in(const Devices& before, const ModelMap& map, const Devices& now, double t) const;
  /// [s]; infinite: it is at its safe value.
  std::span<double> times() { return set_; }

 private:
  /// Later than a tick that comes after just `timeout`, whatever rounding did to both.
  double due(std::size_t k, const Devices& devices) const {
    return (set_[k] + devices.timeouts[k].timeout) * (1.0 + 4.0 * std::numeric_limits<double>::epsilon());
  }
  std::vector<double> set_;  // [s]
};

}  // namespace cardan
