#include "scripts/campaign/campaign.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <thread>

#include "core/base/child_process.hpp"
#include "core/io/json.hpp"
#include "core/io/result_folder.hpp"
#include "core/io/yaml_reader.hpp"
#include "scripts/regress/runner.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

constexpr const char* kErrors = "errors.json";  // what the run says on standard error
constexpr const char* kEnding = "ending.json";  // written last: of what input the run was, and how its process ended
constexpr const char* kSummary = "summary.json";
constexpr const char* kResults = "run.h5";
constexpr std::size_t kMemory = std::size_t{1} << 62;  // [bytes] of addresses: as many as there are
constexpr double kNoLimit = 1e9;                       // [s]

std::vector<Figure> figures_in(const Json& list) {
  std::vector<Figure> out;
  for (const Json& f : list)
    if (f.at("value").is_number()) out.push_back({f.at("name"), f.at("value"), f.at("unit")});
  return out;
}

/// What its summary tells; nothing where there is none that can be read, or one that another run has left: of a verdict that the exit code
/// does not tell.
void read_summary(CampaignRun& run) {
  try {
    const Json all = Json::parse(read_text_file((run.folder / kSummary).string()));
    constexpr const char* kVerdicts[] = {"passed", "failed", "", "aborted"};  // by exit code
    const int code = run.ending.exit_code;
    if (run.ending.how != RunEnding::How::ended || code < 0 || code > 3 || all.at("verdict") != kVerdicts[code]) return;
    run.figures = figures_in(all.at("figures")), run.drawn = figures_in(all.at("drawn"));
    for (const Json& c : all.at("checks")) {
      if (!c.at("value").is_number()) continue;
      Check check;
      check.name = c.at("name"), check.value = c.at("value"), check.unit = c.at("unit"), check.detail = c.at("detail");
      check.pass = c.at("verdict") == "pass";
      check.least = c.value("least", check.least), check.most = c.value("most", check.most);
      run.checks.push_back(std::move(check));
    }
    run.simulated_s = all.at("simulated_s"), run.cpu_s = all.at("cpu_s"), run.ended_by = all.at("ended_by");
    run.verdict = all.at("verdict");
  } catch (const InputError&) {
  } catch (const Json::exception&) {
    run.verdict.clear();
  }
}

/// Whether it ended by itself and would end so again.
bool is_done(const CampaignRun& run) {
  if (run.ending.how != RunEnding::How::ended || run.ending.exit_code > 3 || run.ending.from_outside()) return false;
  return !run.ending.as_planned() || run.measured();
}

/// The run as an earlier campaign left it: done where it was of the same input, and ended by itself.
void look_for(CampaignRun& run, const Campaign& c) {
  try {
    const Json ending = Json::parse(read_text_file((run.folder / kEnding).string()));
    if (ending.at("input") != c.input || ending.at("seed") != run.seed) return;
    run.ending.how = RunEnding::How::ended;
    run.ending.exit_code = ending.at("exit_code"), run.ending.text = ending.at("text"), run.ending.wall_s = ending.at("wall_s");
    run.ending.complaints = ending.at("complaints").get<std::vector<std::string>>();
  } catch (const InputError&) {
    return;
  } catch (const Json::exception&) {
    return;
  }
  read_summary(run);
  std::error_code ignored;
  const bool gone = c.read_later && run.measured() && !fs::exists(run.folder / kResults, ignored);
  run.done = run.was_there = is_done(run) && !gone;
}

ProgramOrder order_for(const Campaign& c, const CampaignRun& run) {
  ProgramOrder order;
  order.command = {c.program, "run"};
  order.command.insert(order.command.end(), c.words.begin(), c.words.end());
  for (const std::string& word : {std::string("--seed"), fmt::format("{}", run.seed), std::string("--out"), run.folder.string(),
                                  std::string("--quiet"), std::string("--json-errors"), std::string("--no-report")})
    order.command.push_back(word);
  order.err = (run.folder / kErrors).string();
  order.limits.cpu_s = kNoLimit, order.limits.memory = kMemory;
  return order;
}

/// Not done: its folder or its end could not be written, and the next campaign would not find it.
void leave(CampaignRun& run, const std::string& path, const std::string& why) {
  CampaignRun none;
  none.seed = run.seed, none.folder = run.folder;
  run = none;
  run.ending.complaints = {fmt::format("{}: {}, {}: {}", number_of(Code::cannot_write), title_of(Code::cannot_write), path, why)};
}

/// Takes what the process left; of a run that passed its numbers alone, where no more is to be kept.
void finish(const Campaign& c, CampaignRun& run, const RunningProgram& process, const ChildLimits& limits) {
  run.ending = ending_of_run(process, limits, run.folder / kErrors);
  read_summary(run);
  run.done = is_done(run);
  if (!run.done) return;
  std::error_code ignored;
  if (run.verdict == "passed" && c.lean) fs::remove(run.folder / kResults, ignored);
  if (fs::is_empty(run.folder / kErrors, ignored)) fs::remove(run.folder / kErrors, ignored);
  const Json ending = {{"cardan_campaign_run", 1},           {"input", c.input},        {"seed", run.seed},
                       {"exit_code", run.ending.exit_code},  {"text", run.ending.text}, {"wall_s", run.ending.wall_s},
                       {"complaints", run.ending.complaints}};
  try {
    write_whole_file(run.folder / kEnding, json_text_with_nulls(ending));
  } catch (const InputError& e) {
    leave(run, e.diagnostics().front().at.mark.file, e.diagnostics().front().got);
  }
}

}  // namespace

std::vector<CampaignRun> run_campaign(const Campaign& c) {
  struct Going {
    CampaignRun* run;
    ChildLimits limits;
    std::unique_ptr<RunningProgram> process;
  };
  std::vector<CampaignRun> runs(c.runs);
  std::vector<CampaignRun*> waiting;
  for (std::uint64_t i = 0; i < c.runs; ++i) {
    CampaignRun& run = runs[i];
    run.seed = c.first + i, run.folder = c.out / fmt::format("seed_{}", run.seed);
    run.ending.how = RunEnding::How::not_run;
    look_for(run, c);
    if (!run.done && i % c.shards == c.shard - 1) waiting.push_back(&run);
  }
  std::vector<Going> going;
  std::size_t next = 0;
  while (!(c.stop && c.stop()) && (next < waiting.size() || !going.empty())) {
    while (next < waiting.size() && going.size() < static_cast<std::size_t>(c.jobs)) {
      CampaignRun& run = *waiting[next++];
      std::error_code error;
      fs::create_directories(run.folder, error);
      if (error) {
        leave(run, run.folder.string(), error.message());
        if (c.told) c.told(run);
        continue;
      }
      for (const char* old : {kEnding, kSummary}) fs::remove(run.folder / old, error);  // of another input, or cut short
      const ProgramOrder order = order_for(c, run);
      going.push_back({&run, order.limits, std::make_unique<RunningProgram>(order)});
    }
    for (std::size_t i = 0; i < going.size();) {
      if (!going[i].process->has_ended()) {
        ++i;
        continue;
      }
      CampaignRun& run = *going[i].run;
      finish(c, run, *going[i].process, going[i].limits);
      going.erase(going.begin() + static_cast<std::ptrdiff_t>(i));
      if (c.told && !(c.stop && c.stop())) c.told(run);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return runs;
}

}  // namespace cardan
