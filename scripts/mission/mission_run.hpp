#pragma once
// Wires what a scenario declares to a simulation, runs it, and works out what it came to.
#include <exception>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/io/range_recorder.hpp"
#include "core/io/summary.hpp"
#include "core/sim/flexible_limits.hpp"
#include "scripts/mission/scenario.hpp"

namespace cardan {

/// The controllers, phases, events and sequences of a scenario at work.
class MissionRun {
 public:
  /// `recorder` must outlive the run.
  MissionRun(Scenario& scenario, Recorder& recorder, std::vector<Output> outputs);
  ~MissionRun() { s_.sequences.end(); }
  MissionRun(const MissionRun&) = delete;
  MissionRun& operator=(const MissionRun&) = delete;

  /// Throws NumericsError. `progress` is called between steps. What went beyond the model is added to the scenario's warnings. Ends
  /// where a function of the script is interrupted (LuaOptions::interrupt).
  void run(double t_end, const std::function<void(double t)>& progress);
  /// Called at each checkpoint with all that the run goes on from at t, before it does.
  void on_checkpoint(std::function<void(double t, Checkpoint checkpoint)> keep) { keep_ = std::move(keep); }
  /// Before run(): goes on from a checkpoint of the same scenario. CheckpointFault where it does not fit; also
  /// throws as run(), and InputError where the script has no memory for it.
  void resume(const Checkpoint& checkpoint);
  /// What the script keeps outside of persist{}, so that no checkpoint holds it: names of variables and fields. Of the last look.
  const std::vector<std::string>& kept_elsewhere() const { return elsewhere_; }
  /// After the run: the value of a check or a figure. Throws NumericsError where its function fails.
  Check check(const Measure& m);
  Figure figure(const Measure& m);

 private:
  template <class F>
  void call(const std::string& actor, F&& function);
  template <class F>
  void told_by_events(F&& part);
  void tick(const Controller&, const std::string& actor);
  void look_elsewhere();
  void add_limits();
  void add_seen_now(const Warnings& found);
  void remember(Archive& archive);
  void make_checkpoint();
  Warnings never_happened() const;  // events that are looked at until they happen once
  void note_warnings();             // those of the scenario that the recorder does not know yet
  double crossing(const LuaFunction& when, const std::string& actor, double t, const double* q, const double* v);
  void begin_sequences();
  void go_on_with_sequences();
  void change_phases(bool at_tick);
  std::optional<std::size_t> next_phase(bool at_tick);
  bool is_over(const Phase&);
  void call_phase(const LuaFunction&, const Phase&);
  double value(const Measure&, const char* what);

  Scenario& s_;
  Recorder& recorder_;
  std::size_t noted_ = 0;      // warnings of the scenario
  std::size_t phase_ = 0;      // 1 + index of the present one; 0 = not begun
  std::vector<int> happened_;  // events with `once`
  FlexibleLimits limits_;
  std::function<void(double t, Checkpoint checkpoint)> keep_;
  std::vector<std::string> elsewhere_;
  std::optional<RunFailure> event_failure_;  // of a function inside the integrator, which knows nothing of scripts
  std::exception_ptr event_interrupt_;       // likewise
};

/// All that is known of the origin of the results.
RunHeader run_header(const Scenario&);

/// The block of a checkpoint with the names of what it does not hold.
inline constexpr const char* kKeptElsewhere = "kept elsewhere";

/// Of its input and of the simulation so far.
Warnings run_warnings(const Scenario&);
/// The part of the summary that the simulation knows.
Summary run_summary(const Scenario&, double wall_s);
/// A line for the person.
std::string kept_elsewhere_text(const std::vector<std::string>& names);
/// What is printed at the end.
std::string summary_text(const Scenario&, const Summary&, const std::vector<Range>&);

}  // namespace cardan
