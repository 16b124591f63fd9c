// From a command line to an exit code: the commands, and what is done with their errors.
#include <fmt/format.h>

#include <csignal>
#include <cstdio>
#include <stdexcept>
#include <system_error>

#include "scripts/commands/commands.hpp"
#include "scripts/commands/program.hpp"
#include "scripts/commands/streams.hpp"

namespace cardan {
namespace {

/// The exit code of a command that is done: another one where its text did not reach standard output.
int with_output(int code, bool as_json) {
  const std::string_view why = output_fault();
  if (why.empty() || code != 0) return code;
  return report_unwritten({{Code::cannot_write, {{}, {"standard output"}}, {}, std::string(why)}}, as_json);
}

}  // namespace

int run_command_line(int argc, char** argv) {
  open_standard_streams();
  show_plugin_messages();
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on the size of files is answered like a full disk
  CommandLine line({argv, argv + argc});
  add_run(line);
  add_check(line);
  add_describe(line);
  add_report(line);
  add_regress(line);
  add_campaign(line);
  add_precision(line);
  add_diff(line);
  add_workbench(line);
  add_modes(line);
  add_types(line);
  add_import(line);
  add_new(line);
  add_check_plugin(line);
  add_help(line);
  add_completion(line);
  add_version(line);
  try {
    const std::function<int()> action = line.read([&line] {
      fmt::print("{}", overview(line));
      return 0;
    });
    return with_output(action(), line.json_errors());
  } catch (const std::system_error& e) {
    if (!std::ferror(stdout)) return report_error(e, line.json_errors());
    note_output_fault(e.code().value());
    return with_output(0, line.json_errors());
  } catch (const std::exception& e) {
    return report_error(e, line.json_errors());
  } catch (...) {
    return report_error(std::runtime_error("an exception that is none of ours; is a plugin loaded?"), line.json_errors());
  }
}

}  // namespace cardan
