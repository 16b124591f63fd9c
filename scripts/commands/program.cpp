// From a command line to an exit code: the commands, and what is done with their errors.
#include <fmt/format.h>

#include <csignal>
#include <cstdio>
#include <cstring>
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
  return report_error(InputError(Diagnostic{Code::cannot_write, {{}, {"standard output"}}, {}, std::string(why)}), as_json, kNotWritten);
}

}  // namespace

int run_command_line(int argc, char** argv) {
  open_standard_streams();
  show_plugin_messages();
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on the size of files is answered like a full disk
  CommandLine line;
  line.arguments.assign(argv, argv + argc);
  for (int i = 1; i < argc; ++i) line.json_errors = line.json_errors || std::strcmp(argv[i], "--json-errors") == 0;

  CLI::App app{"Simulator of spacecraft made of rigid and flexible bodies"};
  app.name("cardan");
  app.require_subcommand(0, 1);  // further words are arguments of the command, also where they name another
  add_run(app, line);
  add_check(app, line);
  add_describe(app, line);
  add_report(app, line);
  add_regress(app, line);
  add_precision(app, line);
  add_diff(app, line);
  add_workbench(app, line);
  add_modes(app, line);
  add_types(app, line);
  add_import(app, line);
  add_new(app, line);
  add_check_plugin(app, line);
  add_help(app, line);
  add_completion(app, line);
  add_version(app, line);
  try {
    expect_command(app, {argv + 1, argv + argc});
    app.parse(argc, argv);
    if (!line.action) fmt::print("{}", overview(app));
    return with_output(line.action ? line.action() : 0, line.json_errors);
  } catch (const CLI::CallForHelp& help) {
    if (app.get_subcommands().empty()) fmt::print("{}", overview(app));
    return with_output(app.get_subcommands().empty() ? 0 : app.exit(help), line.json_errors);
  } catch (const CLI::ParseError& e) {
    return report_error(InputError(wrong_command_line(app, e)), line.json_errors);
  } catch (const std::system_error& e) {
    if (!std::ferror(stdout)) return report_error(e, line.json_errors);
    note_output_fault(e.code().value());
    return with_output(0, line.json_errors);
  } catch (const std::exception& e) {
    return report_error(e, line.json_errors);
  } catch (...) {
    return report_error(std::runtime_error("an exception that is none of ours; is a plugin loaded?"), line.json_errors);
  }
}

}  // namespace cardan
