#include "scripts/report/report.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "core/io/result_folder.hpp"
#include "scripts/commands/commands.hpp"
#include "scripts/commands/comparison.hpp"
#include "scripts/commands/streams.hpp"
#include "scripts/report/figure.hpp"

namespace cardan {

void add_report(CommandLine& line) {
  Command& command = line.command(
      "report", "Make the report page of a run again, a figure of some of its channels, or a page of what differs from a second run");
  auto h5 = std::make_shared<std::string>(), html = std::make_shared<std::string>();
  command.option("run", *h5, "Results: run.h5, or the folder it is in").required().type_name("RESULTS");
  auto second = std::make_shared<std::string>();
  command.option("second", *second, "Results of a second run: the page shows the differences, as of cardan diff").type_name("RESULTS");
  auto plotted = std::make_shared<std::vector<std::string>>();
  command.option("--out", *html, "The page or figure; default: report.html, figure.svg or differences.html beside the results")
      .type_name("PAGE");
  command
      .option("--plot", *plotted,
              "Instead of the page: an SVG of channels over time, a panel for each --plot; a channel (bodies/bus/rate), a component of "
              "it (bodies/bus/rate.y), or several with commas between them")
      .type_name("CHANNELS");
  command.action([h5, second, html, plotted, &line] {
    std::error_code ignored;
    if (std::filesystem::is_directory(*h5, ignored)) *h5 = (std::filesystem::path(*h5) / "run.h5").string();
    const auto beside = [&](const char* name) { return (std::filesystem::path(*h5).parent_path() / name).string(); };
    if (!second->empty()) {
      if (!plotted->empty()) refuse(Code::command_line, {"--plot"}, "one run", "two");
      return compare({.first = *h5,
                      .second = *second,
                      .page = html->empty() ? beside("differences.html") : *html,
                      .json = {},
                      .quiet = true,
                      .as_json = line.json_errors()});
    }
    const std::string page = html->empty() ? beside(plotted->empty() ? "report.html" : "figure.svg") : *html;
    expect_another_file(page, *h5);
    read_between_flushes(*h5, [&] { plotted->empty() ? write_report(*h5, page) : write_figure(*h5, page, *plotted); });
    say(fmt::format("{}\n", page));
    return 0;
  });
}

}  // namespace cardan
