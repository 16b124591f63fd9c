// The program `cardan`. Exit codes: 0 done, 1 a check failed, 2 wrong input, 3 numerics, 70 a fault of ours.
#include <csignal>
#include <cstring>

#include "scripts/host/commands/commands.hpp"

int main(int argc, char** argv) {
  using namespace cardan;
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on the size of files is answered like a full disk
  CommandLine line;
  for (int i = 1; i < argc; ++i) line.json_errors = line.json_errors || std::strcmp(argv[i], "--json-errors") == 0;

  CLI::App app{"Simulator of spacecraft made of rigid and flexible bodies"};
  app.name("cardan");
  app.require_subcommand(1);
  add_run(app, line);
  add_check(app, line);
  add_describe(app, line);
  add_report(app, line);
  add_workbench(app, line);
  add_check_plugin(app, line);
  add_version(app, line);
  try {
    app.parse(argc, argv);
    return line.action();
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& e) {
    return report_error(
        InputError(Diagnostic{Code::command_line, {}, {}, e.what(), "cardan --help, or cardan run --help", {}, {}, 0}),
        line.json_errors);
  } catch (const std::exception& e) {
    return report_error(e, line.json_errors);
  }
}
