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
  /// Takes the bar away, until the next update.
  void clear();
  double wall_s() const;

 private:
  using Clock = std::chrono::steady_clock;
  Look look_;
  double t_end_;
  Clock::time_point start_ = Clock::now(), next_ = start_;
  bool shown_ = false;
  double shown_t_ = 0.0;  // [s] where it was shown last, and the steps since
  long steps_ = 0;
};

/// One line: t and t_end [s] with the same decimals, rate, time left; the mean step [s] where that is long. `wall`: seconds since the
/// start.
std::string progress_text(double t, double t_end, double wall, double step);

/// What suits standard error.
Progress::Look progress_look(bool quiet);

}  // namespace cardan
