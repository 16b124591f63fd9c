#pragma once
// A scenario: what its script declares (bindings/mission.cpp, declarations.cpp), and what the handles of the script read and set
// (bindings/handles.cpp). Names are resolved when a handle is made; a tick works with numbers only.
#include <atomic>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/warnings.hpp"
#include "core/io/summary.hpp"
#include "core/io/yaml_reader.hpp"
#include "core/sim/simulation.hpp"
#include "scripts/lua/function.hpp"
#include "scripts/lua/host.hpp"
#include "scripts/lua/persist.hpp"
#include "scripts/mission/script_device.hpp"
#include "scripts/mission/sequences.hpp"
#include "scripts/mission/vehicle_changes.hpp"

namespace cardan {

/// One `--set key=value`.
struct Setting {
  std::string key, value;
  bool used = false;
};

/// Files of a run that is repeated (run_again.hpp), by their names in the scenario: texts are taken from here and not from the disk;
/// plugins and modal files are refused where their SHA-256 is another.
struct RecordedInputs {
  std::string results;  // the file that tells this
  std::map<std::string, std::string> texts, hashes;
};

struct ScenarioOptions {
  std::filesystem::path file;  ///< the script, or a folder with scenario.lua
  std::vector<Setting> settings;
  std::uint64_t seed = 0;
  std::optional<double> until{};                   ///< [s] end of the run; empty: the mission's duration
  std::shared_ptr<const RecordedInputs> recorded;  ///< null: the files are read
  std::function<void(std::string_view line)> print = [](std::string_view) {};
  std::function<std::size_t()> width = [] { return std::size_t{0}; };  ///< of the window; 0: none
  std::filesystem::path output;                  ///< folder of files that the script itself writes; empty: it writes none
  const std::atomic<bool>* interrupt = nullptr;  ///< once true, the script ends
};

struct MissionSpec {
  bool declared = false;
  std::string title;
  double duration = 0.0;  // [s]
  Rational output_period{1, 10};
  std::optional<Rational> checkpoint_period;                       // empty: never
  std::vector<int> reactions;                                      // user bodies
  std::vector<int> nodes;                                          // indices into Model::nodes
  std::vector<std::pair<std::string, std::string>> defaults_used;  // key path, value
  SimulationOptions simulation;
  std::string why_method;  // of `method = "auto"`, once the script has been read; else empty
};

struct Controller {
  std::string name;
  Rational period;
  Located at;
  LuaFunction step;
};

struct Phase {
  std::string name;
  double duration = std::numeric_limits<double>::infinity();  // [s]
  LuaFunction until, enter, exit;                             // each may be absent
  std::string next;                                           // empty: the one that is declared after it
  SourceMark declared;
};

std::vector<std::string> names_of(const std::vector<Phase>&);
/// Of the phase of that name; how many there are if none has it.
std::size_t index_of_phase(const std::vector<Phase>&, std::string_view name);

struct ScriptEvent {
  std::string name;
  LuaFunction when, action;
  int direction = 0;  // +1 rising, -1 falling, 0 both
  bool once = false;  // not looked at after it has happened
};

/// A number that the script works out at the end; a check if it has limits.
struct Measure {
  std::string name, unit;
  LuaFunction value;
  double low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();
  std::string condition;  // "below 0.01 deg"; empty for a figure
};

struct Scenario;
/// Numbers of the script's own that are recorded.
struct Signal {
  Scenario* scenario;
  SourceMark declared;
  Channel channel;
  std::vector<double> values;
};

struct Load {
  int node;
  bool world_axes;
};

struct Scenario {
  enum class Stage { setup, run, end };

  explicit Scenario(const ScenarioOptions& options);
  ~Scenario();
  Scenario(const Scenario&) = delete;
  Scenario& operator=(const Scenario&) = delete;

  // Given
  std::filesystem::path file, folder;
  std::vector<Setting> settings;
  std::uint64_t seed;
  std::optional<double> until;  // [s]
  std::shared_ptr<const RecordedInputs> recorded;

  LuaHost lua;  // before everything that holds a Lua function
  Persistent persistent;
  std::vector<std::unique_ptr<ScriptDevice>> script_devices;  // their tables are in the registry

  // Declared
  Registry registry;
  std::vector<InputFile> inputs, plugins, modal_files;
  std::vector<std::string> modes_from_cache;  // bodies
  std::string vehicle_file;
  std::vector<std::string> parameter_names;
  std::set<std::pair<std::string, std::string>> names;          // that declarations have taken: kind, name
  std::vector<std::pair<std::string, std::string>> parameters;  // name, value: for the results
  std::vector<Figure> drawn;                                    // parameters that chance sets, as they are in this run
  std::vector<std::string> spreads;                             // of each: "normal 10 kg, within 25 kg"
  MissionSpec mission;
  std::vector<Controller> controllers;
  std::vector<Phase> phases;
  std::vector<ScriptEvent> events;
  Sequences sequences{{lua, persistent, sim, in_event_function, trial_time}};
  std::vector<Measure> checks, figures;
  std::vector<std::unique_ptr<Signal>> signals;
  std::vector<Load> loads;
  std::shared_ptr<const SystemSpec> beginning;   // the vehicle with the initial values of the mission, where it has loops; null: none
  std::vector<MovedAtStart> moved_by_beginning;  // what closes the loops with these
  /// Why the vehicle's own start is no start: loops are open there. Until initial{} gives one that closes them `model` is the vehicle with
  /// all its loops open. Empty: it is one.
  std::vector<Diagnostic> open_start;
  Warnings warnings;  // of vehicle and mission, and of what the run did to the model; the simulation has its own

  // The system
  std::shared_ptr<const Model> model;  // null before `vehicle`
  std::unique_ptr<Simulation> sim;
  /// [s]
  double end() const { return until.value_or(mission.duration); }
  /// With the masses of the present state, where they vary.
  const Model& present() const { return sim ? sim->model() : *model; }

  // What handles see
  Stage stage = Stage::setup;
  std::string_view phase;                                 // name of the present one; empty before the first and after the last
  double phase_begun = 0.0;                               // [s]
  std::optional<std::size_t> wanted_phase;                // that a function asked for: it begins when that has returned
  const double *q = nullptr, *v = nullptr, *z = nullptr;  // the state, of devices behind it, or the trial state of an event function
  bool in_event_function = false;
  bool in_device = false;   // a function of device{...} runs
  double trial_time = 0.0;  // [s] of an event function
  std::string_view actor;   // whose function runs: `controller "attitude"`
  VehicleChanges changes{{vehicle_file, registry, model, sim, actor, [this] { return compile_options(); }}};
  bool begins_far = false;          // by initial{}: what acts between nodes is counted from home
  std::string stopped_by;           // the actor that called stop()
  std::optional<RunFailure> fault;  // a command that is not finite; a script cannot catch it

  /// Compiles again with what has been declared, and keeps the state, the commands and the motion profiles.
  void use_model(std::shared_ptr<const Model> compiled);
  /// What to compile: the vehicle as it is described, with its loops open as long as no start closes them.
  std::shared_ptr<const SystemSpec> described() const;
  /// InputError where loops are still open.
  void expect_closed() const;
  /// A scene without loads has no op for them.
  CompileOptions compile_options() const;
  void look_at_state();
  /// What scripts see: the time, in an event function that of the trial state.
  double time() const { return in_event_function ? trial_time : sim ? sim->time() : 0.0; }
};

/// The vehicle with all its loops open.
std::shared_ptr<const SystemSpec> with_open_loops(SystemSpec spec);

/// "\n  --> scenario.lua:4\n    4 | the line", for RunFailure::what; empty without a place.
std::string place_of_failure(const SourceMark& mark);

}  // namespace cardan
