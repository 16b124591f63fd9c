// Many runs of one scenario that differ by their seed, and what they come to.
#include "scripts/campaign/campaign.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <limits>
#include <sstream>
#include <thread>
#include <tuple>

#include "core/base/utf8.hpp"
#include "core/base/version.hpp"
#include "core/io/result_folder.hpp"
#include "core/io/sha256.hpp"
#include "core/sim/outputs.hpp"
#include "scripts/bindings/open.hpp"
#include "scripts/campaign/bands.hpp"
#include "scripts/campaign/tables.hpp"
#include "scripts/commands/commands.hpp"
#include "scripts/commands/interrupt.hpp"
#include "scripts/commands/streams.hpp"
#include "scripts/mission/examine.hpp"
#include "scripts/mission/mission_run.hpp"
#include "scripts/report/page.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

constexpr const char* kJson = "campaign.json";
constexpr const char* kTable = "campaign.csv";
constexpr const char* kPage = "campaign.html";
constexpr int kMostRuns = 1'000'000;

struct CampaignArguments {
  ScenarioArguments scenario;
  std::string out, shard;
  std::optional<double> until;
  int runs = 0, jobs = 0;
  bool lean = false;
  std::vector<std::string> plots;
};

/// SHA-256 of the program and of all texts and files that the scenario is made of, of what the command line changes in it.
std::string input_of(const RunHeader& header, const std::string& until) {
  Sha256 hash;
  const auto add = [&](const std::string& text) {
    const std::uint64_t size = text.size();  // so that "ab", "c" is not "a", "bc"
    hash.add(&size, sizeof size);
    hash.add(text.data(), text.size());
  };
  add(header.program_version + " " + header.commit), add(header.flags), add(until);
  for (const auto* files : {&header.inputs, &header.plugins, &header.modal_files})
    for (const InputFile& file : *files) add(file.name), add(file.sha256);
  for (const auto& [key, value] : header.settings) add(key), add(value);
  return hash.digest();
}

std::vector<std::string> words_of_run(const CampaignArguments& a, const std::vector<Setting>& settings, const std::string& until) {
  std::vector<std::string> words{a.scenario.file};
  for (const Setting& set : settings) words.insert(words.end(), {"--set", set.key + "=" + set.value});
  if (!until.empty()) words.insert(words.end(), {"--until", until});
  return words;
}

/// `plots`: channels with commas between them, as of `cardan report`.
BandRequest request_of(const std::vector<std::string>& plots, const MissionSpec& mission, double duration) {
  const auto [numerator, denominator] = mission.output_period;
  BandRequest out{.channels = {}, .period = static_cast<double>(numerator) / static_cast<double>(denominator), .duration = duration};
  for (const std::string& plot : plots) {
    if (plot.empty()) out.channels.emplace_back();  // which is refused
    std::istringstream names(plot);
    for (std::string name; std::getline(names, name, ',');) out.channels.push_back(name);
  }
  return out;
}

int campaign(const CampaignArguments& a, bool as_json) {
  Campaign c;
  std::tie(c.shard, c.shards) = shard_of(a.shard);
  c.runs = static_cast<std::uint64_t>(a.runs);
  ScenarioOptions options = a.scenario.options();
  c.first = a.scenario.seed.empty() ? 1 : options.seed;
  options.seed = c.first;
  if (c.first > std::numeric_limits<std::uint64_t>::max() - c.runs)
    refuse(Code::command_line, {"--seed"}, fmt::format("a first seed that leaves room for {} more", c.runs), a.scenario.seed);
  if (a.until && !(*a.until > 0.0)) refuse(Code::command_line, {"--until"}, "a finite time > 0 s", fmt::format("{:g}", *a.until));
  options.until = a.until;
  const std::string until = a.until ? fmt::format("{}", *a.until) : "";
  c.words = words_of_run(a, options.settings, until);
  options.print = [](std::string_view) {};
  const auto scenario = open_scenario(options);  // what is wrong with it is told here, before any run
  scenario->sim->vdot();
  const BandRequest request = request_of(a.plots, scenario->mission, scenario->end());
  if (a.lean && !a.plots.empty())
    refuse(Code::command_line, {"--plot"}, "the run.h5 of all runs", "--lean, which keeps none of runs that pass");
  expect_channels(request, channels_of(mission_outputs(*scenario)));
  const RunHeader header = run_header(*scenario);
  c.input = input_of(header, until);
  const fs::path folder = fs::absolute(scenario->file).lexically_normal().parent_path().filename();
  c.out = a.out.empty() ? fs::path("out") / (folder.string() + "_campaign") : fs::path(a.out);
  std::error_code error;
  fs::create_directories(c.out, error);
  if (error)
    refuse(Code::cannot_write, {{}, {c.out.string()}}, "a place that can be written to", error.message(), "--out DIR chooses another");
  c.program = fs::read_symlink("/proc/self/exe").string();
  c.jobs = a.jobs > 0 ? a.jobs : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  c.lean = a.lean, c.read_later = !a.plots.empty();
  const Interruption interruption;
  c.stop = [] { return Interruption::flag().load(); };
  c.told = [](const CampaignRun& run) { say(line_of(run) + "\n"); };
  const std::vector<CampaignRun> runs = run_campaign(c);

  const auto done = static_cast<std::size_t>(std::ranges::count_if(runs, &CampaignRun::done));
  const auto there = static_cast<std::size_t>(std::ranges::count_if(runs, &CampaignRun::was_there));
  if (there > 0) say(fmt::format("{} of {} runs were there already\n", there, runs.size()));
  if (Interruption::flag()) {
    say(fmt::format("Interrupted: {} of {} runs are done. The same command goes on from there.\n", done, runs.size()));
    return 128 + Interruption::signal();
  }
  if (std::ranges::any_of(runs, [](const CampaignRun& run) { return run.ending.how == RunEnding::How::not_run; })) {  // of other shards
    say(fmt::format("{} of {} runs are done. The same command without --shard runs what is missing and writes the tables.\n", done,
                    runs.size()));
    return 0;
  }
  if (done < runs.size())
    say(fmt::format("{} of {} runs were ended from outside: the same command makes them again\n", runs.size() - done, runs.size()));
  const std::vector<Quantity> quantities = quantities_of(runs);
  std::vector<Diagnostic> unwritten;
  std::vector<Band> bands;
  try {
    bands = bands_of(request, runs);
  } catch (const InputError& e) {  // the run.h5 of one: the numbers of all are told
    unwritten = e.diagnostics();
  }
  const std::string title = scenario->mission.title.empty() ? folder.string() : scenario->mission.title;
  const Json about = {{"title", title},
                      {"scenario", a.scenario.file},
                      {"program", fmt::format("cardan {}, commit {}", version::kNumber, version::kCommit)},
                      {"arguments", c.words},
                      {"input", c.input},
                      {"first_seed", c.first},
                      {"runs_planned", c.runs}};
  const Json all = campaign_json(about, runs, quantities, bands);
  try {
    const ResultFolder out(c.out, {kJson, kTable, kPage});
    for (const auto& [name, text] : {std::pair{kJson, json_text_with_nulls(all)},
                                     {kTable, campaign_csv(runs, quantities)},
                                     {kPage, page::filled("Campaign: " + title, all, page::campaign())}})
      write_result(out / name, text, unwritten);
  } catch (const InputError& e) {  // the place of one: the runs are done
    unwritten.push_back(e.diagnostics().front());
  }
  say(campaign_text(runs, quantities, bands));
  say(fmt::format("{}\n", (c.out / kPage).string()));
  const bool passed = std::ranges::all_of(runs, [](const CampaignRun& run) { return run.verdict == "passed"; });
  return report_unwritten(std::move(unwritten), as_json, passed ? 0 : 1);
}

}  // namespace

void add_campaign(CommandLine& line) {
  Command& command = line.command("campaign", "Run a scenario with many seeds, and tell what chance makes of its checks and figures");
  auto a = std::make_shared<CampaignArguments>();
  a->scenario.add_to(command, line, "The scenario: a Lua file, or a folder with scenario.lua", "SCENARIO",
                     "The first of the seeds, 1 by default; a run with seed 0 has every parameter as it is given");
  command.option("-n,--runs", a->runs, "How many runs; those of the same input that are there are not made again")
      .required()
      .type_name("N")
      .between(1, kMostRuns);
  command.option("-j,--jobs", a->jobs, "How many run side by side; default: as many as there are processors")
      .type_name("N")
      .between(1, 1024);
  command.option("--shard", a->shard, "The i-th of n parts of the runs alone, as machines share them that see one folder: 2/3")
      .type_name("I/N");
  command.option("--until", a->until, "End of each run in s, instead of the mission's duration").type_name("SECONDS");
  command
      .option(
          "--plot", a->plots,
          "Also how these channels spread over time: a channel (bodies/bus/rate), a component of it (bodies/bus/rate.y), or several with "
          "commas between them; may be repeated. Of runs that are there too")
      .type_name("CHANNELS");
  command.flag("--lean", a->lean, "Of runs that pass keep no run.h5: `cardan run --seed` makes it anew, with the same bits");
  command
      .option("--out", a->out, "Folder of campaign.html, .csv and .json, and of the runs; default: out/<folder of the scenario>_campaign")
      .type_name("DIR");
  command.action([&line, a] { return campaign(*a, line.json_errors()); });
}

}  // namespace cardan
