#include <fmt/format.h>

#include "scripts/host/commands/commands.hpp"
#include "scripts/host/describe_model.hpp"

namespace cardan {

void add_describe(CLI::App& app, CommandLine& line) {
  auto* command =
      app.add_subcommand("describe", "Tell what a scenario is made of: bodies, masses, modes, program of sweeps");
  auto arguments = std::make_shared<ScenarioArguments>();
  auto as_json = std::make_shared<bool>(false), measured = std::make_shared<bool>(false);
  arguments->add_to(*command, line);
  command->add_flag("--json", *as_json, "As JSON");
  command->add_flag("--measure", *measured, "Time each op of the program as well");
  command->callback([&line, arguments, as_json, measured] {
    line.action = [arguments, as_json, measured] {
      const auto s = load_scenario(arguments->options());
      const Json description = describe_model(*s, *measured);
      fmt::print("{}", *as_json ? json_text(description) : description_text(description));
      return 0;
    };
  });
}

}  // namespace cardan
