#include <fmt/format.h>

#include <filesystem>

#include "core/base/units.hpp"
#include "core/io/result_folder.hpp"
#include "scripts/commands/commands.hpp"
#include "scripts/commands/streams.hpp"
#include "scripts/regress/tables.hpp"

namespace cardan {
namespace {

struct DiffArguments {
  std::string first, second, json;
  double relative = 0.0;
  bool at_common_times = false;
};

int diff(const DiffArguments& a) {
  if (!(a.relative >= 0.0 && a.relative < 1.0))
    refuse(Code::command_line, {"--relative"}, "a number from 0 to 1: 1e-9", fmt::format("{}", a.relative));
  const RunColumns first = read_run_columns(a.first), second = read_run_columns(a.second);
  const RunDifference difference =
      compare_runs(first, second, {0.0, a.relative}, a.relative > 0.0 ? Agreement::integration : Agreement::same_bits);
  const bool pass = difference.pass(a.at_common_times);
  say(difference_table(difference, a.first, a.second));
  if (!first.sweeps.empty() && !second.sweeps.empty() && first.sweeps != second.sweeps)
    say(fmt::format("the instruction sets differ: {} and {}\n", first.sweeps, second.sweeps));
  if (!a.json.empty()) write_whole_file(a.json, json_text_with_nulls(difference_json(difference, a.first, a.second, pass)));
  say(pass ? "the same\n" : "different\n");
  return pass ? 0 : 1;
}

}  // namespace

void add_diff(CLI::App& app, CommandLine& line) {
  auto* command = app.add_subcommand("diff", "Compare the results of two runs, channel by channel");
  auto a = std::make_shared<DiffArguments>();
  command->add_option("first", a->first, "Results: run.h5, or the folder it is in")->required()->type_name("RESULTS");
  command->add_option("second", a->second, "Results that they are compared with")->required()->type_name("RESULTS");
  command
      ->add_option("--relative", a->relative,
                   "Permitted difference over the largest magnitude of the second, of all components of a channel with the same unit; "
                   "default 0: the same bits")
      ->type_name("NUMBER");
  command->add_flag("--common-times", a->at_common_times, "Times that one of them alone has make no difference");
  command->add_option("--json", a->json, "The differences as data, in this file")->type_name("FILE");
  command->add_flag("--json-errors", line.json_errors, "Errors as JSON on standard error");
  command->callback([&line, a] {
    line.action = [a] {
      for (std::string* results : {&a->first, &a->second})
        if (std::error_code ignored; std::filesystem::is_directory(*results, ignored))
          *results = (std::filesystem::path(*results) / "run.h5").string();
      return diff(*a);
    };
  });
}

}  // namespace cardan
