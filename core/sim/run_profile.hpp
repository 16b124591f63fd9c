#pragma once
// Where the time of a run goes. Taken only where it is asked for: clocks cost some twenty nanoseconds a call.
#include <chrono>

namespace cardan {

/// Times [s] by the wall clock, and calls.
struct RunProfile {
  struct Part {
    double time = 0.0;
    long calls = 0;
  };
  Part run;         // all of it
  Part step;        // of the integrator, with what it calls:
  Part rhs;         // evaluations of x' = f(t, x)
  Part ledger;      // rates of momentum and energy
  Part events;      // functions of events
  Part projection;  // onto unit quaternions, given motions, closed loops, momentum
  Part tasks;       // controllers, sampled devices, and outputs:
  Part outputs;     // looking at the state and writing it

  /// The integrator itself: step without what it calls.
  double method() const { return step.time - rhs.time - ledger.time - events.time - projection.time; }
  double controllers() const { return tasks.time - outputs.time; }
};

/// Adds the time until its end; does nothing without a part.
class Stopwatch {
 public:
  explicit Stopwatch(RunProfile::Part* part) : part_(part) {
    if (part_) start_ = Clock::now();
  }
  ~Stopwatch() {
    if (!part_) return;
    part_->time += std::chrono::duration<double>(Clock::now() - start_).count();
    ++part_->calls;
  }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  RunProfile::Part* part_;
  Clock::time_point start_;
};

}  // namespace cardan
