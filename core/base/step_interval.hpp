#pragma once
// How a method went through a stretch of a run: its steps, what set their lengths, what was tried in vain, and why it started anew.
#include <algorithm>
#include <array>
#include <cstddef>
#include <numeric>
#include <string>
#include <vector>

#include "core/base/checkpoint.hpp"

namespace cardan {

/// Trial steps that were tried again, smaller, by the reason.
struct Rejections {
  static constexpr int kGroups = 3;
  std::array<long, kGroups> by_error{};  // too large, by the group (OdeProblem) of the worst state; the last: and further groups
  long not_evaluated = 0;                // f could not be had, or was not finite
  long not_converged = 0;                // the corrector of an implicit method

  bool operator==(const Rejections&) const = default;
  long all() const { return std::accumulate(by_error.begin(), by_error.end(), not_evaluated + not_converged); }
  void add(const Rejections& later) {
    for (std::size_t i = 0; i < by_error.size(); ++i) by_error[i] += later.by_error[i];
    not_evaluated += later.not_evaluated, not_converged += later.not_converged;
  }
  void subtract(const Rejections& earlier) {
    for (std::size_t i = 0; i < by_error.size(); ++i) by_error[i] -= earlier.by_error[i];
    not_evaluated -= earlier.not_evaluated, not_converged -= earlier.not_converged;
  }
  void remember(Archive& archive) { archive(std::span(by_error), not_evaluated, not_converged); }
};

/// Why a method started anew; of several reasons at once the first.
enum class RestartCause {
  start,       // of the run, or something changed between two calls of run()
  tick,        // a controller, a sampled device or a timeout changed a command or the state
  event,       // one of the mission or of a device, a stop that was touched
  corner,      // of a given motion
  loops,       // of a method with a history, which had drifted from closed loops
  checkpoint,  // each is a new start
  vehicle      // it became another one
};

struct StepInterval {
  double begin = 0.0, end = 0.0;  // [s]
  long steps = 0, evaluations = 0;
  long by_error = 0, by_stop = 0;        // steps as long as the error allowed; cut at an instant or an event. The others were given
  double shortest = 0.0, longest = 0.0;  // [s] steps; 0: there was none
  long orders = 0;                       // sum over the steps
  Rejections rejected;
  std::array<long, 7> restarts{};  // by RestartCause
  std::string worst;               // the component whose error set the length of the most steps, or was too large; empty: none
  long of_worst = 0;               // how often

  bool empty() const { return steps == 0 && rejected.all() == 0; }
  void add_step(double h, int order) {
    shortest = steps == 0 ? h : std::min(shortest, h), longest = std::max(longest, h);
    ++steps, orders += order;
  }
  /// But for the worst component.
  void add(const StepInterval& later) {
    end = later.end;
    if (later.steps > 0) shortest = steps == 0 ? later.shortest : std::min(shortest, later.shortest);
    longest = std::max(longest, later.longest);
    steps += later.steps, evaluations += later.evaluations, by_error += later.by_error, by_stop += later.by_stop, orders += later.orders;
    rejected.add(later.rejected);
    for (std::size_t i = 0; i < restarts.size(); ++i) restarts[i] += later.restarts[i];
  }
  void remember(Archive& archive) {
    archive(begin, end, steps, evaluations, by_error, by_stop, shortest, longest, orders, rejected, std::span(restarts), worst, of_worst);
  }

  /// As the results have it, the name of the worst component apart.
  struct Column {
    std::string name;
    const char* unit;
    double value;
  };
  std::vector<Column> columns() const;
};

}  // namespace cardan
