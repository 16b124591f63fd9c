#include <fmt/format.h>

#include "core/sim/description.hpp"
#include "scripts/bindings/open.hpp"
#include "scripts/commands/commands.hpp"
#include "scripts/mission/describe_scenario.hpp"

namespace cardan {

void add_describe(CommandLine& line) {
  Command& command = line.command("describe", "Tell what a scenario is made of: bodies, masses, modes, program of sweeps");
  auto arguments = std::make_shared<ScenarioArguments>();
  auto as_json = std::make_shared<bool>(false);
  auto options = std::make_shared<DescribeOptions>();
  arguments->add_to(command, line);
  command.flag("--json", *as_json, "As JSON");
  command.flag("--measure", options->measured, "Time each op of the program as well");
  command.flag("--forms", options->forms,
               "Compare the three solutions of closed loops at the initial state: accelerations, multipliers, reactions");
  command.option("--modes", options->n_modes, "So many modes of the assembled system (default: 10, of up to 400 velocities)")
      .between(0, 1000);
  command.action([arguments, as_json, options] {
    ScenarioOptions scenario = arguments->options();
    bool quiet = false;
    scenario.print = [&quiet, print = scenario.print](std::string_view text) {
      if (!quiet) print(text);
    };
    const auto s = open_scenario(scenario);
    quiet = true;  // what sequences say on the way to their first wait is said in a run
    const Json description = describe_scenario(*s, *options);
    fmt::print("{}", *as_json ? json_text(description) : modes_line(*s) + description_text(description));
    return 0;
  });
}

}  // namespace cardan
