#pragma once
// How the method goes through a run, interval by interval, and whose error sets its steps.
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/time/integrator.hpp"

namespace cardan {

/// A step costs a few additions; names are looked up where somebody reads them.
class StepHistory {
 public:
  using Names = std::function<std::string(int state)>;

  /// The names of the present model's states, as long as the history lives.
  explicit StepHistory(Names name) : name_(std::move(name)) {}

  void begin(double t, int states) {
    if (whole_.steps == 0 && now_.steps == 0) whole_.begin = whole_.end = now_.begin = now_.end = t;
    resize(states);
  }
  /// Between two intervals, of another model: after leave_model().
  void resize(int states) {
    by_state_.resize(static_cast<std::size_t>(states));
    totals_.resize(static_cast<std::size_t>(states));
  }
  /// Its components are known by their names from now on.
  void leave_model();
  void restarted(RestartCause cause) { ++now_.restarts[static_cast<std::size_t>(cause)]; }
  /// A step of h [s]; worst: Integrator::worst().
  void stepped(const StepReport& report, double h, int worst) {
    now_.add_step(h, report.order);
    if (report.limit == StepLimit::stop) ++now_.by_stop;
    if (report.limit == StepLimit::error) ++now_.by_error, ++by_state_[static_cast<std::size_t>(worst)];
  }
  /// The step that the run ends with.
  void failed(int worst) {
    if (worst >= 0) ++by_state_[static_cast<std::size_t>(worst)];
  }

  /// Ends an interval at t, if there is something in it, and gives it, with the name of the worst component if `named`. statistics: of
  /// the whole run.
  const StepInterval* close(double t, const IntegratorStatistics& statistics, bool named);

  /// Of all intervals that were closed; without the worst component.
  const StepInterval& whole() const { return whole_; }
  /// By component how many steps its error set the length of, the largest number first.
  std::vector<std::pair<std::string, long>> worst() const;

  void remember(Archive& archive);

 private:
  std::map<std::string, long> by_name() const;

  Names name_;
  StepInterval now_, last_, whole_;
  std::vector<long> by_state_, totals_;  // in this interval; in those before, of this model
  std::map<std::string, long> by_name_;  // of models before
};

}  // namespace cardan
