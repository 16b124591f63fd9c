#include <fmt/format.h>

#include <cmath>

#include "scripts/commands/commands.hpp"
#include "scripts/commands/comparison.hpp"

namespace cardan {

void add_diff(CommandLine& line) {
  Command& command = line.command("diff", "Compare the results of two runs, channel by channel");
  auto c = std::make_shared<Comparison>();
  command.option("first", c->first, "Results: run.h5, or the folder it is in").required().type_name("RESULTS");
  command.option("second", c->second, "Results that they are compared with").required().type_name("RESULTS");
  command
      .option("--relative", c->relative,
              "Permitted difference over the largest magnitude of the second, of all components of a channel with the same unit; "
              "default 0: the same bits")
      .type_name("NUMBER");
  command
      .option("--absolute", c->absolute,
              "Permitted difference beside that, in the unit of each channel: of what is zero but for rounding; default 0")
      .type_name("NUMBER");
  command.flag("--common-times", c->at_common_times, "Times that one of them alone has make no difference");
  command.option("--page", c->page, "A page that draws over each other what differs").type_name("PAGE");
  command.option("--json", c->json, "The differences as data, in this file").type_name("FILE");
  command.action([c, &line] {
    c->as_json = line.json_errors();
    if (!(c->relative >= 0.0 && c->relative < 1.0))
      refuse(Code::command_line, {"--relative"}, "a number from 0 to 1: 1e-9", fmt::format("{}", c->relative));
    if (!(c->absolute >= 0.0 && std::isfinite(c->absolute)))
      refuse(Code::command_line, {"--absolute"}, "a number that is not negative: 1e-12", fmt::format("{}", c->absolute));
    return compare(*c);
  });
}

}  // namespace cardan
