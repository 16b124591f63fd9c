#pragma once
// The commands of the program, one file each. A command declares its arguments and what to do; main() does it. Help, the manual page
// and completion are made from the declarations. What an argument is stands in its type name (type_name): completion offers files by it.
#include <string>
#include <utility>
#include <vector>

#include "scripts/commands/command_line.hpp"
#include "scripts/mission/scenario.hpp"

namespace cardan {

void add_run(CommandLine&);
void add_check(CommandLine&);
void add_describe(CommandLine&);
void add_report(CommandLine&);
void add_regress(CommandLine&);
void add_campaign(CommandLine&);
void add_precision(CommandLine&);
void add_diff(CommandLine&);
void add_workbench(CommandLine&);
void add_modes(CommandLine&);
void add_types(CommandLine&);
/// What plugins say goes to standard error.
void show_plugin_messages();
void add_import(CommandLine&);
void add_new(CommandLine&);
void add_check_plugin(CommandLine&);
void add_completion(CommandLine&);
void add_help(CommandLine&);
void add_version(CommandLine&);

/// What every command about a scenario takes: FILE, --set, --settings, --seed.
struct ScenarioArguments {
  std::string file;
  std::vector<std::string> settings, settings_files;
  std::string seed;
  const CommandLine* to = nullptr;  // where errors are asked for as JSON, what scripts print would spoil them

  /// Returns FILE, which is required.
  Argument add_to(Command& command, const CommandLine& line, const char* what = "The scenario: a Lua file, or a folder with scenario.lua",
                  const char* type = "SCENARIO", const char* of_seed = "Seed of the script's random numbers: a whole number, 0 by default");
  /// Throws InputError C0801 for a --set, or a line of --settings, that is not key=value and a --seed that is no whole number of 64 bits,
  /// C0102 for a file that is not there.
  ScenarioOptions options() const;
};

/// "2/3" of --shard: the second of three parts; "" is the whole, {1, 1}. Throws InputError C0801.
std::pair<std::size_t, std::size_t> shard_of(const std::string& text);

inline constexpr int kNotWritten = 4;  // exit code: done, but a result or the text on standard output could not be written

/// The exit code of a run that ends with this error (`wrong_input` for an InputError); what the user reads goes to standard
/// error.
int report_error(const std::exception& error, bool as_json, int wrong_input = 2);
/// Writes one of the results of a command; what keeps it from being written joins `unwritten`, and the others are written all the same.
void write_result(const std::filesystem::path& file, std::string_view text, std::vector<Diagnostic>& unwritten);
/// Tells what could not be written of that which a command has done, and returns its exit code: `code`, and kNotWritten in place of 0.
int report_unwritten(std::vector<Diagnostic> unwritten, bool as_json, int code = 0);

/// Every code of errors and warnings, in the order of error_codes.inc.
inline constexpr Code kAllCodes[] = {
#define CARDAN_ERROR(number, name, title) Code::name,
#include "core/base/error_codes.inc"
#undef CARDAN_ERROR
};

// ---- for main() ----

/// `cardan` alone: the commands, one line each, and where to read on.
std::string overview(const CommandLine& line);

}  // namespace cardan
