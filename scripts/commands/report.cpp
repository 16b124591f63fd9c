#include "scripts/report/report.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "scripts/commands/commands.hpp"

namespace cardan {
namespace {

/// A run that is going on may flush its results while they are read: then once more.
void write_report_of_present_rows(const std::string& h5, const std::string& page) {
  namespace fs = std::filesystem;
  constexpr int kTries = 10;
  for (int i = 1;; ++i) {
    std::error_code none;
    const auto before = fs::last_write_time(h5, none);
    try {
      return write_report(h5, page);
    } catch (const InputError& e) {
      const bool is_written_to = fs::last_write_time(h5, none) != before;
      if (i == kTries || !is_written_to || e.diagnostics().front().code != Code::bad_result_file) throw;
    }
  }
}

}  // namespace

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
      write_report_of_present_rows(*h5, page);
      fmt::print("{}\n", page);
      return 0;
    };
  });
}

}  // namespace cardan
