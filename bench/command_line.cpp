#include "bench/command_line.hpp"

#include <CLI/CLI.hpp>

namespace cardan::bench {

struct CommandLine::App : CLI::App {
  using CLI::App::App;
};

CommandLine::CommandLine(const std::string& what) : app_(std::make_unique<App>(what)) {}
CommandLine::~CommandLine() = default;

CommandLine& CommandLine::option(const std::string& name, std::string& value, const std::string& help) {
  CLI::Option* option = app_->add_option(name, value, help);
  if (help.empty()) option->group("");
  return *this;
}
CommandLine& CommandLine::option(const std::string& name, double& value, const std::string& help) {
  app_->add_option(name, value, help);
  return *this;
}
CommandLine& CommandLine::option(const std::string& name, int& value, const std::string& help) {
  app_->add_option(name, value, help)->check(CLI::PositiveNumber);
  return *this;
}
CommandLine& CommandLine::option(const std::string& name, bool& value, const std::string& help) {
  app_->add_flag(name, value, help);
  return *this;
}

std::optional<int> CommandLine::parse(int argc, const char* const* argv) {
  try {
    app_->parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app_->exit(e) == 0 ? 0 : 2;
  }
  return {};
}

}  // namespace cardan::bench
