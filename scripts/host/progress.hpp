#pragma once
// The line that shows how far a run is: simulated time, rate against real time, expected end.
#include <chrono>
#include <string>
#include <string_view>

namespace cardan {

class Progress {
 public:
  enum class Look { none, bar, lines };  // bar: a terminal; lines: a log, with a line now and then
  Progress(Look look, double t_end);
  ~Progress() { clear(); }

  void update(double t);
  /// A line of output, above the bar.
  void print(std::string_view line);
  void clear();
  double wall_s() const;

 private:
  using Clock = std::chrono::steady_clock;
  std::string text(double t) const;
  Look look_;
  double t_end_;
  Clock::time_point start_ = Clock::now(), next_ = start_;
  bool shown_ = false;
};

/// What suits standard error.
Progress::Look progress_look(bool quiet);

}  // namespace cardan
