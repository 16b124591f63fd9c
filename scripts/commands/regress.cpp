#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <set>
#include <thread>

#include "core/base/units.hpp"
#include "core/base/utf8.hpp"
#include "core/io/result_folder.hpp"
#include "scripts/commands/commands.hpp"
#include "scripts/commands/comparison.hpp"
#include "scripts/commands/interrupt.hpp"
#include "scripts/commands/streams.hpp"
#include "scripts/regress/runner.hpp"
#include "scripts/regress/tables.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

struct RegressArguments {
  std::string folder, out = "out/regress", shard, why;
  int jobs = 0;
  std::vector<std::string> only, update;
};

/// Those of `names` that are among the scenarios; the others are refused.
std::set<std::string> chosen(const char* option, const std::vector<std::string>& names,
                             const std::vector<std::pair<std::string, fs::path>>& all) {
  std::vector<std::string> legal;
  for (const auto& [name, file] : all) legal.push_back(name);
  for (const std::string& name : names)
    if (std::ranges::find(legal, name) == legal.end())
      refuse(Code::command_line, {option}, fmt::format("a scenario of the folder: {}", fmt::join(legal, ", ")), in_quotes(name),
             did_you_mean(name, legal));
  return {names.begin(), names.end()};
}

/// Results take the place of files: none may go to where a golden file is, with its references.
void expect_elsewhere(const std::string& out, const std::vector<std::pair<std::string, fs::path>>& all,
                      const std::vector<Golden>& goldens) {
  std::error_code none;
  std::set<fs::path> taken;
  for (const auto& [name, file] : all) taken.insert(fs::weakly_canonical(fs::absolute(file.parent_path()), none));
  std::vector<fs::path> folders{out};
  for (const Golden& g : goldens) folders.push_back(folders[0] / g.name);
  for (const fs::path& folder : folders)
    if (taken.contains(fs::weakly_canonical(fs::absolute(folder), none)))
      refuse(Code::command_line, {"--out"}, "a folder for results, where no golden file is", in_quotes(folder.string()));
}

int regress(const RegressArguments& a, bool as_json) {
  const bool blank = !a.why.empty() && a.why.find_first_not_of(" \t\r\n") == std::string::npos;
  if (a.update.empty() != a.why.empty() || blank)
    refuse(Code::command_line, {a.why.empty() ? "--update" : "--why"}, "--update NAME and --why \"...\", both or neither",
           blank ? "an empty reason" : "one of them");
  const auto all = find_goldens(a.folder);
  auto found = all;
  if (found.empty())
    refuse(Code::command_line, {"cardan regress"}, "a folder with scenarios that have a golden.yaml", in_quotes(a.folder),
           "docs/golden.md");
  for (const auto& [option, names] : {std::pair{"--only", &a.only}, {"--update", &a.update}})
    if (const auto only = chosen(option, *names, found); !only.empty())
      std::erase_if(found, [&](const auto& one) { return !only.contains(one.first); });
  const auto [shard, shards] = shard_of(a.shard);
  if (found.size() < shard)
    refuse(Code::command_line, {"cardan regress"}, "at least one scenario that is chosen by --only, --update and --shard",
           fmt::format("{} chosen, none for part {}", found.size(), shard));
  RegressionRun how;
  how.record = printable(a.why);
  std::vector<Golden> goldens;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (i % shards != shard - 1) continue;
    Golden& golden = goldens.emplace_back();
    golden.name = found[i].first;
    golden.file = found[i].second;
    try {
      golden = read_golden(golden.file, golden.name, how.record.empty() ? Recorded::in_place : Recorded::unread);
      if (!how.record.empty()) expect_recordable(golden, how.record);
    } catch (const InputError& e) {
      golden.faults = e.diagnostics();
    }
  }

  expect_elsewhere(a.out, all, goldens);
  const ResultFolder out(a.out, {"regress.json", "junit.xml", "regress.html"});

  std::size_t width = 0;
  for (const Golden& g : goldens) width = std::max(width, g.name.size());
  const Interruption interruption;
  how.program = fs::read_symlink("/proc/self/exe").string();
  how.out = out.path();
  how.jobs = a.jobs > 0 ? a.jobs : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  how.stop = [] { return Interruption::flag().load(); };
  how.told = [&](const CaseResult& r) { say(line_of(r, width) + "\n"); };
  const std::vector<CaseResult> results = run_goldens(goldens, how);
  if (Interruption::flag()) {
    const auto run = std::ranges::count_if(results, [](const CaseResult& r) { return r.ending.how != RunEnding::How::not_run; });
    say(fmt::format("\nInterrupted: {} of {} scenarios were run. No report is written; one of before stays.\n", run, results.size()));
    return 128 + Interruption::signal();
  }
  const auto failed = std::ranges::count_if(results, [](const CaseResult& r) { return !r.pass(); });
  for (const CaseResult& r : results)
    if (!r.pass() && r.golden->faults.empty()) say(faults_of(r));
  std::vector<Diagnostic> wrong;
  for (const Golden& g : goldens) wrong.insert(wrong.end(), g.faults.begin(), g.faults.end());
  const bool has_faults = !wrong.empty();
  for (const auto& [name, text] : {std::pair{"regress.json", json_text_with_nulls(regress_json(results))},
                                   {"junit.xml", junit_xml(results)},
                                   {"regress.html", regression_page(a.folder, results)}})
    write_result(out / name, text, wrong);
  say(fmt::format("\n{} of {} scenarios pass. {}\n", results.size() - static_cast<std::size_t>(failed), results.size(),
                  (out / "regress.html").string()));
  const int code = has_faults ? 2 : failed > 0 ? 1 : 0;
  return report_unwritten(std::move(wrong), as_json, code);
}

}  // namespace

void add_regress(CommandLine& line) {
  Command& command = line.command("regress", "Run scenarios and compare them with their golden files");
  auto a = std::make_shared<RegressArguments>();
  command.option("folder", a->folder, "Where to look for scenarios with a golden.yaml, in folders below too").required().type_name("DIR");
  command.option("-j,--jobs", a->jobs, "How many run side by side; default: as many as there are processors")
      .type_name("N")
      .between(1, 1024);
  command.option("--shard", a->shard, "The i-th of n parts of the scenarios alone, as machines share them: 2/3").type_name("I/N");
  command.option("--only", a->only, "This scenario alone, by its name in the table; may be repeated").type_name("NAME");
  command
      .option("--update", a->update,
              "Record the references of this scenario anew, and run no other; may be repeated. Truths from elsewhere stay as they are")
      .type_name("NAME");
  command.option("--why", a->why, "With --update: the reason, kept in the golden file").type_name("TEXT");
  command.option("--out", a->out, "Folder of the results, regress.html, regress.json and junit.xml; default: out/regress").type_name("DIR");
  command.action([&line, a] { return regress(*a, line.json_errors()); });
}

}  // namespace cardan
