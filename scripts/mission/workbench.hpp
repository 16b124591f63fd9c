#pragma once
// A loaded scene that a person, or a script beside the scenario, looks at: the global `sim`.
#include <memory>

#include "scripts/lua/matrix.hpp"
#include "scripts/mission/mission_run.hpp"
#include "scripts/mission/scenario.hpp"

namespace cardan {

/// For a run of which nothing is kept.
class NoRecorder final : public Recorder {
  void begin(const RunHeader&, const std::vector<Channel>&) override {}
  void row(double, std::span<const double>) override {}
  void attach(const std::string&, const std::string&) override {}
  void restart_state(double, std::span<const double>) override {}
  void flush() override {}
  void close(std::string_view) override {}
};

class Workbench {
 public:
  /// The scenario must outlive it.
  explicit Workbench(Scenario& scenario) : s_(scenario) {}
  Workbench(const Workbench&) = delete;
  Workbench& operator=(const Workbench&) = delete;

  Scenario& scenario() { return s_; }
  /// Sets the state. What has run is forgotten: the next run begins here, and declarations are open again.
  void set_state(State state);
  /// Runs the mission on, with its controllers, phases and events, to t or stop(). `between_steps` may throw.
  void run_to(double t, const std::function<void(double t)>& between_steps);
  bool is_running() const { return running_; }

 private:
  Scenario& s_;
  NoRecorder recorder_;
  std::unique_ptr<MissionRun> run_;  // null until something runs
  bool running_ = false;
};

}  // namespace cardan
