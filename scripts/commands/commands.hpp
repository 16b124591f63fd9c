#pragma once
// The commands of the program, one file each. A command declares its options and what to do; main() does it. Help, the manual page
// and completion are made from the declarations. What an argument is stands in its type name (type_name): completion offers files by it.
#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <vector>

#include "scripts/mission/scenario.hpp"

namespace cardan {

struct CommandLine {
  std::function<int()> action;         // returns the exit code
  std::vector<std::string> arguments;  // as given, the name of the program first
  bool json_errors = false;
};

void add_run(CLI::App&, CommandLine&);
void add_check(CLI::App&, CommandLine&);
void add_describe(CLI::App&, CommandLine&);
void add_report(CLI::App&, CommandLine&);
void add_regress(CLI::App&, CommandLine&);
void add_precision(CLI::App&, CommandLine&);
void add_diff(CLI::App&, CommandLine&);
void add_workbench(CLI::App&, CommandLine&);
void add_modes(CLI::App&, CommandLine&);
void add_types(CLI::App&, CommandLine&);
/// What plugins say goes to standard error.
void show_plugin_messages();
void add_import(CLI::App&, CommandLine&);
void add_new(CLI::App&, CommandLine&);
void add_check_plugin(CLI::App&, CommandLine&);
void add_completion(CLI::App&, CommandLine&);
void add_help(CLI::App&, CommandLine&);
void add_version(CLI::App&, CommandLine&);

/// What every command about a scenario takes: FILE, --set, --settings, --seed, --json-errors.
struct ScenarioArguments {
  std::string file;
  std::vector<std::string> settings, settings_files;
  std::string seed;
  const bool* json_errors = nullptr;  // of the command line: what scripts print would spoil standard error

  void add_to(CLI::App& command, CommandLine& line, const char* what = "The scenario: a Lua file, or a folder with scenario.lua",
              const char* type = "SCENARIO");
  /// Throws InputError C0801 for a --set, or a line of --settings, that is not key=value and a --seed that is no whole number of 64 bits,
  /// C0102 for a file that is not there.
  ScenarioOptions options() const;
};

inline constexpr int kNotWritten = 4;  // exit code: done, but a result or the text on standard output could not be written

/// The exit code of a run that ends with this error (`wrong_input` for an InputError); what the user reads goes to standard
/// error.
int report_error(const std::exception& error, bool as_json, int wrong_input = 2);

/// Every code of errors and warnings, in the order of error_codes.inc.
inline constexpr Code kAllCodes[] = {
#define CARDAN_ERROR(number, name, title) Code::name,
#include "core/base/error_codes.inc"
#undef CARDAN_ERROR
};

// ---- for main() ----

/// `cardan` alone: the commands, one line each, and where to read on.
std::string overview(const CLI::App& app);

/// C0801 with what may be meant, if the first word of the command line is neither a command nor an option.
void expect_command(const CLI::App& app, const std::vector<std::string>& arguments);

/// What is wrong with a command line that cannot be parsed, with what may be meant.
Diagnostic wrong_command_line(const CLI::App& app, const CLI::ParseError& error);

}  // namespace cardan
