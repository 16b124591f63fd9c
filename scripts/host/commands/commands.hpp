#pragma once
// The commands of the program, one file each. A command declares its options and what to do; main() does it.
#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <vector>

#include "scripts/host/scenario.hpp"

namespace cardan {

struct CommandLine {
  std::function<int()> action;  // returns the exit code
  bool json_errors = false;
};

void add_run(CLI::App&, CommandLine&);
void add_check(CLI::App&, CommandLine&);
void add_describe(CLI::App&, CommandLine&);
void add_report(CLI::App&, CommandLine&);
void add_workbench(CLI::App&, CommandLine&);
void add_check_plugin(CLI::App&, CommandLine&);
void add_version(CLI::App&, CommandLine&);

/// What every command about a scenario takes: FILE, --set, --seed, --json-errors.
struct ScenarioArguments {
  std::string file;
  std::vector<std::string> settings;
  std::uint64_t seed = 0;

  void add_to(CLI::App& command, CommandLine& line,
              const char* what = "The scenario: a Lua file, or a folder with scenario.lua");
  /// Throws InputError C0801 for a --set that is not key=value.
  ScenarioOptions options() const;
};

/// The exit code of a run that ends with this error (`wrong_input` for an InputError); what the user reads goes to standard
/// error.
int report_error(const std::exception& error, bool as_json, int wrong_input = 2);

}  // namespace cardan
