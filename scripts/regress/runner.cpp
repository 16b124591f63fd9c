#include "scripts/regress/runner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstring>
#include <memory>
#include <thread>

#include "core/base/child_process.hpp"
#include "core/io/yaml_reader.hpp"
#include "scripts/regress/tables.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

constexpr const char* kErrors = "errors.json";  // what the run says on standard error
constexpr const char* kText = kPrinted;         // and on standard output

ProgramOrder order_for(const Golden& g, const std::string& program, const fs::path& folder) {
  ProgramOrder order;
  order.command = {program, "run", g.scenario.string(), "--out", folder.string(), "--quiet", "--json-errors"};
  if (!g.script.empty()) order.command = {program, "workbench", g.scenario.string(), "--script", g.script.string()};
  for (const auto& [at, key, value] : g.settings) order.command.insert(order.command.end(), {"--set", key + "=" + value});
  if (!g.seed.empty()) order.command.insert(order.command.end(), {"--seed", g.seed});
  if (!g.until.empty()) order.command.insert(order.command.end(), {"--until", g.until});
  if (!g.kernels.empty()) order.environment.emplace_back("CARDAN_KERNELS", g.kernels);
  order.out = (folder / kText).string();
  order.err = (folder / kErrors).string();
  order.limits.cpu_s = g.cpu_s;
  order.limits.wall_s = g.wall_s();
  order.limits.memory = g.memory;
  order.limits.file_size = g.file_size;
  return order;
}

/// Errors of --json-errors, one text each; of anything else its end.
std::vector<std::string> complaints_in(const fs::path& file) {
  std::string text;
  try {
    text = read_text_file(file.string());
    std::vector<std::string> out;
    const Json all = Json::parse(text);
    for (const Json& e : all.at("errors")) {
      std::string line = fmt::format("{}: {}", e.value("code", ""), e.value("title", ""));
      if (const std::string at = place_text(e.value("file", ""), e.value("line", 0), e.value("at", "")); !at.empty()) line += ", " + at;
      if (const std::string what = e.value("what", ""); !what.empty()) line += ": " + what;
      if (const std::string got = e.value("got", ""); !got.empty()) line += ": " + got;
      if (const std::string expected = e.value("expected", ""); !expected.empty()) line += ", expected " + expected;
      out.push_back(line);
    }
    return out;
  } catch (const InputError&) {
  } catch (const Json::exception&) {
  }
  if (text.empty()) return {};
  return {text.size() > 2000 ? "..." + text.substr(text.size() - 2000) : text};
}

/// What the run said of settings, at their places in the golden file.
std::vector<Diagnostic> faults_of_settings(const Golden& golden, const fs::path& errors) {
  std::vector<Diagnostic> out;
  try {
    const Json all = Json::parse(read_text_file(errors.string()));
    for (const Json& e : all.at("errors"))
      for (const auto& [at, key, value] : golden.settings)
        if (const auto code = find_code(e.value("code", "")); code && e.value("file", "") == setting_mark(key, value).file)
          out.push_back({*code, at, e.value("expected", ""), e.value("got", ""), e.value("hint", "")});
  } catch (const InputError&) {
  } catch (const Json::exception&) {
  }
  return out;
}

}  // namespace

bool RunEnding::from_outside() const {
  if (how != How::ended) return how == How::crashed;
  if (!as_planned() && complaints.empty()) return true;
  return std::ranges::any_of(complaints, [](const std::string& c) { return c.starts_with("C0701") || c.starts_with("N0204"); });
}

RunEnding ending_of_run(const RunningProgram& process, const ChildLimits& limits, const fs::path& errors) {
  RunEnding out;
  out.wall_s = process.wall_s();
  out.cpu_s = process.cpu_s();
  out.complaints = complaints_in(errors);
  const ChildEnd& end = process.end();
  const auto says = [&](const char* code) { return !out.complaints.empty() && out.complaints.front().starts_with(code); };
  switch (end.how) {
    case ChildEnd::How::not_started:
      out.how = RunEnding::How::crashed;
      out.text = fmt::format("not started: {}", std::strerror(end.status));
      break;
    case ChildEnd::How::late:
      out.how = RunEnding::How::out_of_time;
      out.text = fmt::format("hung: more than {:g} s, of which {:.3g} s of processor time", limits.wall_s, out.cpu_s);
      break;
    case ChildEnd::How::killed:
      // The kernel counts by ticks what it limits, and tells afterwards what it has counted exactly.
      out.how = end.status == SIGXCPU || out.cpu_s >= std::ceil(limits.cpu_s) - 0.5 ? RunEnding::How::out_of_time : RunEnding::How::crashed;
      out.text = out.how == RunEnding::How::out_of_time
                     ? fmt::format("more than {:g} s of processor time", std::ceil(limits.cpu_s))
                     : fmt::format("crashed: killed by signal {} ({})", end.status, strsignal(end.status));
      break;
    case ChildEnd::How::ended:
      out.exit_code = end.status;
      if (end.status == 0 || end.status == 1) break;
      // A plugin that found no memory is named by what it threw.
      if (says("N0205") || says("C0802") || (says("N0503") && out.complaints.front().ends_with("std::bad_alloc"))) {
        out.how = RunEnding::How::out_of_memory;
        out.text = fmt::format("more than {} MiB of memory", limits.memory >> 20);
      } else {
        out.text = fmt::format("ended with exit code {}", end.status);
      }
  }
  return out;
}

std::vector<CaseResult> run_goldens(std::vector<Golden>& goldens, const RegressionRun& how) {
  struct Going {
    std::size_t index;
    ChildLimits limits;
    std::unique_ptr<RunningProgram> process;
  };
  std::vector<CaseResult> results(goldens.size());
  for (std::size_t i = 0; i < goldens.size(); ++i) {
    results[i].name = goldens[i].name;
    results[i].golden = &goldens[i];
    results[i].folder = how.out / goldens[i].name;
    results[i].ending.how = RunEnding::How::not_run;
    results[i].ending.text = "not run";
  }
  std::vector<Going> going;
  std::size_t next = 0;
  const auto end = [&](CaseResult& result, std::vector<ClaimRow> rows) {
    result.rows = std::move(rows);
    if (how.told) how.told(result);
  };
  const auto stopped = [&] { return how.stop && how.stop(); };
  while (!stopped() && (next < goldens.size() || !going.empty())) {
    while (next < goldens.size() && going.size() < static_cast<std::size_t>(how.jobs)) {
      const std::size_t index = next++;
      CaseResult& result = results[index];
      if (!goldens[index].faults.empty()) {
        end(result, rows_of(goldens[index].faults));
        continue;
      }
      std::error_code error;
      for (const char* old : {"run.h5", "summary.json", "report.html", kErrors, kText}) fs::remove(result.folder / old, error);
      fs::create_directories(result.folder, error);
      if (error)
        end(result,
            {failed_row("run", "folder", {Code::cannot_write, {{}, {result.folder.string()}}, "a folder for results", error.message()})});
      else {
        const ProgramOrder order = order_for(goldens[index], how.program, result.folder);
        going.push_back({index, order.limits, std::make_unique<RunningProgram>(order)});
      }
    }
    for (std::size_t i = 0; i < going.size();) {
      if (!going[i].process->has_ended()) {
        ++i;
        continue;
      }
      const std::size_t index = going[i].index;
      CaseResult& result = results[index];
      result.ending = ending_of_run(*going[i].process, going[i].limits, result.folder / kErrors);
      going.erase(going.begin() + static_cast<std::ptrdiff_t>(i));
      goldens[index].faults = faults_of_settings(goldens[index], result.folder / kErrors);
      if (!goldens[index].faults.empty()) {
        end(result, rows_of(goldens[index].faults));
        continue;
      }
      end(result, how.record.empty() ? judge(goldens[index], result.folder, result.ending)
                                     : record_references(goldens[index], result.folder, result.ending, how.record));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  for (CaseResult& result : results)
    if (result.rows.empty()) result.rows = judge(*result.golden, result.folder, result.ending);
  return results;
}

}  // namespace cardan
