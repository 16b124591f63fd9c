// The program `cardan`. Exit codes: 0 done, 1 a check failed, 2 wrong input, 3 numerics, 4 a result could not be written, 70 a fault of
// ours, 128 + n ended by signal n.
#include <fmt/format.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <system_error>

#include "scripts/commands/commands.hpp"
#include "scripts/commands/streams.hpp"

namespace {

/// The exit code of a command that is done: another one where its text did not reach standard output.
int with_output(int code, bool as_json) {
  using namespace cardan;
  const std::string_view why = output_fault();
  if (why.empty() || code != 0) return code;
  return report_error(InputError(Diagnostic{Code::cannot_write, {{}, {"standard output"}}, {}, std::string(why)}), as_json, kNotWritten);
}

bool main_is_over = false;

int cardan_main(int argc, char** argv) {
  using namespace cardan;
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

}  // namespace

int main(int argc, char** argv) {
  std::atexit([] {  // a plugin that calls exit() must not look like a run that went well
    if (main_is_over) return;
    std::fputs("internal error: the process was ended from inside (exit); is a plugin loaded?\n", stderr);
    _exit(70);
  });
  const int code = cardan_main(argc, argv);
  main_is_over = true;
  return code;
}
