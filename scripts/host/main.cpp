// The program `cardan`. Exit codes: 0 done, 1 a check failed, 2 wrong input, 3 numerics, 70 a fault of ours.
#include <csignal>
#include <cstring>

#include <fmt/format.h>

#include "scripts/host/commands/commands.hpp"

int main(int argc, char** argv) {
  using namespace cardan;
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on the size of files is answered like a full disk
  CommandLine line;
  for (int i = 1; i < argc; ++i) line.json_errors = line.json_errors || std::strcmp(argv[i], "--json-errors") == 0;

  CLI::App app{"Simulator of spacecraft made of rigid and flexible bodies"};
  app.name("cardan");
  app.require_subcommand(0, 1);  // further words are arguments of the command, also where they name another
  add_run(app, line);
  add_check(app, line);
  add_describe(app, line);
  add_report(app, line);
  add_workbench(app, line);
  add_types(app, line);
  add_check_plugin(app, line);
  add_help(app, line);
  add_completion(app, line);
  add_version(app, line);
  try {
    expect_command(app, {argv + 1, argv + argc});
    app.parse(argc, argv);
    if (line.action) return line.action();
    fmt::print("{}", overview(app));
    return 0;
  } catch (const CLI::CallForHelp& help) {
    if (!app.get_subcommands().empty()) return app.exit(help);
    fmt::print("{}", overview(app));
    return 0;
  } catch (const CLI::ParseError& e) {
    return report_error(InputError(wrong_command_line(app, e)), line.json_errors);
  } catch (const std::exception& e) {
    return report_error(e, line.json_errors);
  }
}
