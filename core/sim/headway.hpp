#pragma once
// Whether a run comes to its end at all: steps that lead nowhere, events without end, a limit that is only come nearer to.
#include <optional>
#include <string>
#include <vector>

#include "core/base/checkpoint.hpp"
#include "core/base/diagnostic.hpp"

namespace cardan {

class Headway {
 public:
  /// There are events: their times are kept.
  void watch_events() { events_.resize(kEvents); }
  /// A run goes on at t [s].
  void begin(double t) { looked_at_ = steps_, t_looked_at_ = t; }
  void step() { ++steps_; }
  long steps() const { return steps_; }
  /// After a step. Looks once in so many of them whether time advances.
  std::optional<RunFailure> stalls(double t, double t_end);
  /// At an event: as many as are kept, in less than 1e-7 of the time that is left, are a storm of which 1e10 and more would follow.
  std::optional<RunFailure> storms(double t, double t_end, const std::string& event);
  /// After a step that a limit made smaller, as those before it that hardly went further: they were so many that no other will pass it.
  bool crawls(double t, double t_end);
  void remember(Archive& archive);

 private:
  static constexpr std::size_t kEvents = 1000;
  long steps_ = 0, looked_at_ = 0;  // made; when time was last seen to advance ...
  double t_looked_at_ = 0.0;        // ... [s]
  std::vector<double> events_;      // [s] ring of the last ones
  std::size_t events_seen_ = 0;
  int limited_ = 0;         // steps that a limit made smaller, and that hardly went further ...
  double t_limited_ = 0.0;  // ... [s] since then
};

}  // namespace cardan
