#include "scripts/commands/comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "core/base/version.hpp"
#include "core/io/result_folder.hpp"
#include "scripts/commands/commands.hpp"
#include "scripts/commands/streams.hpp"
#include "scripts/regress/tables.hpp"

namespace cardan {
namespace {

constexpr std::size_t kMostDrawn = 60;  // numbers of two runs that differ, worst first

std::vector<double> component_of(const RunColumns& run, const ComponentDifference& c, const std::vector<std::size_t>& rows) {
  const Column& column = *run.find(c.channel);
  const auto k = static_cast<std::size_t>(std::ranges::find(column.components, c.component) - column.components.begin());
  std::vector<double> out;
  for (const std::size_t row : rows) out.push_back(column.values[row * column.components.size() + k]);
  return out;
}

DifferenceCase case_of(const RunDifference& d, const RunColumns& first, const RunColumns& second, bool pass) {
  DifferenceCase out;
  out.name = first.file + " against " + second.file;
  out.pass = pass;
  for (const std::string& line : structure_of(d, first.file, second.file)) out.text += line + "\n";
  const CommonRows rows = common_rows(first.times, second.times);
  std::vector<double> times;
  for (const std::size_t row : rows.first) times.push_back(first.times[row]);
  std::vector<const ComponentDifference*> worst;
  for (const ComponentDifference& c : d.components)
    if (!c.worst.pass || c.worst.difference != 0.0) worst.push_back(&c);
  std::ranges::stable_sort(worst, [](const auto* a, const auto* b) {  // relative to the size of the numbers
    const auto size = [](const ComponentDifference& c) { return c.worst.difference / std::max(std::abs(c.worst.reference), 1e-300); };
    return std::isnan(size(*b)) ? false : !(size(*a) <= size(*b));
  });
  for (const ComponentDifference* c : worst) {
    DifferencePart part;
    part.kind = "channel";
    part.name = c->channel + " " + c->component;
    part.unit = c->unit;
    part.pass = c->worst.pass;
    part.worst = c->worst;
    part.text = fmt::format("off by {:.3g}, limit {:.3g} at t = {:.9g} s ({:.15g} in place of {:.15g})", c->worst.difference,
                            c->worst.limit, c->worst.t, c->worst.is, c->worst.reference);
    if (out.parts.size() < kMostDrawn) {
      part.t = times;
      part.is = component_of(first, *c, rows.first);
      part.reference = component_of(second, *c, rows.second);
    }
    out.parts.push_back(std::move(part));
  }
  return out;
}

}  // namespace

std::string regression_page(const std::string& folder, const std::vector<CaseResult>& results) {
  std::vector<DifferenceCase> cases;
  for (const CaseResult& r : results) {
    DifferenceCase one{
        .name = r.name, .truth = r.golden->truth, .text = ending_text(r), .pass = r.pass(), .wall_s = r.ending.wall_s, .parts = {}};
    for (const ClaimRow& row : r.rows)
      one.parts.push_back(
          {row.kind, row.name, row.unit, row.agreement, found_text(row), row.why, row.pass, row.worst, row.t, row.is, row.reference});
    cases.push_back(std::move(one));
  }
  return differences_page("Scenarios and their golden files",
                          {folder, fmt::format("cardan {}, commit {}", version::kNumber, version::kCommit)}, "run", "reference", cases);
}

int compare(Comparison c) {
  for (std::string* results : {&c.first, &c.second})
    if (std::error_code ignored; std::filesystem::is_directory(*results, ignored))
      *results = (std::filesystem::path(*results) / "run.h5").string();
  for (const std::string& result : {c.page, c.json})
    for (const std::string& results : {c.first, c.second}) expect_another_file(result, results);
  const RunColumns first = read_run_columns(c.first), second = read_run_columns(c.second);
  const RunDifference d = compare_runs(first, second, {c.absolute, c.relative},
                                       c.relative > 0.0 || c.absolute > 0.0 ? Agreement::integration : Agreement::same_bits);
  const bool pass = d.pass(c.at_common_times);
  if (!c.quiet) {
    say(difference_table(d, c.first, c.second));
    if (!first.sweeps.empty() && !second.sweeps.empty() && first.sweeps != second.sweeps)
      say(fmt::format("the instruction sets differ: {} and {}\n", first.sweeps, second.sweeps));
  }
  std::vector<Diagnostic> unwritten;
  if (!c.json.empty()) write_result(c.json, json_text_with_nulls(difference_json(d, c.first, c.second, pass)), unwritten);
  if (!c.page.empty()) {
    const auto drawn = case_of(d, first, second, pass);
    write_result(c.page, differences_page("Two runs", {c.first, c.second}, "first", "second", {drawn}), unwritten);
    say(c.page + "\n");
  }
  say(pass ? "the same\n" : "different\n");
  return report_unwritten(std::move(unwritten), c.as_json, pass ? 0 : 1);
}

}  // namespace cardan
