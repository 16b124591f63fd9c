#include "scripts/report/report.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "core/io/result_folder.hpp"
#include "scripts/commands/commands.hpp"

namespace cardan {

void add_report(CLI::App& app, CommandLine& line) {
  auto* command = app.add_subcommand("report", "Make the report page of a run again");
  auto h5 = std::make_shared<std::string>(), html = std::make_shared<std::string>();
  command->add_option("run", *h5, "Results: run.h5, or the folder it is in")->required()->type_name("RESULTS");
  command->add_option("--out", *html, "The page; default: report.html beside the results")->type_name("PAGE");
  command->add_flag("--json-errors", line.json_errors, "Errors as JSON on standard error");
  command->callback([&line, h5, html] {
    line.action = [h5, html] {
      std::error_code ignored;
      if (std::filesystem::is_directory(*h5, ignored)) *h5 = (std::filesystem::path(*h5) / "run.h5").string();
      const std::string page = html->empty() ? (std::filesystem::path(*h5).parent_path() / "report.html").string() : *html;
      read_between_flushes(*h5, [&] { write_report(*h5, page); });
      fmt::print("{}\n", page);
      return 0;
    };
  });
}

}  // namespace cardan
