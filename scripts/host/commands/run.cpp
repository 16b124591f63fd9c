#include <fmt/format.h>

#include <filesystem>
#include <fstream>

#include "scripts/host/commands/commands.hpp"
#include "scripts/host/progress.hpp"
#include "scripts/host/run_mission.hpp"
#include "scripts/report/report.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
constexpr double kReferenceLimit =
    1e-9;  // rounding of both sides on stiff or badly scaled systems stays below; an error does not

struct RunArguments {
  ScenarioArguments scenario;
  std::string out;
  std::optional<double> until;
  bool quiet = false, check_against_reference = false;
};

[[noreturn]] void cannot_write(const fs::path& path, const std::string& why) {
  throw InputError(Diagnostic{Code::cannot_write,
                              {{}, {path.string(), 0, 0}},
                              "a place that can be written to",
                              why,
                              "--out DIR chooses another",
                              {},
                              {},
                              0});
}

/// Default: out/<name of the scenario's folder>.
fs::path make_folder(const RunArguments& a, const Scenario& s) {
  const fs::path name = fs::absolute(s.file).lexically_normal().parent_path().filename();
  const fs::path folder = a.out.empty() ? fs::path("out") / name : fs::path(a.out);
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) cannot_write(folder, error.message());
  return folder;
}

void write_text(const fs::path& path, const std::string& text) {
  std::ofstream out(path, std::ios::binary);
  out << text;
  out.close();
  if (!out) cannot_write(path, "it cannot be written");
}

Check reference_check(const std::vector<Range>& ranges) {
  Check c{"agreement with the dense reference",
          0.0,
          kReferenceLimit,
          false,
          "1",
          fmt::format("below {:g}, at every output time", kReferenceLimit)};
  for (const Range& r : ranges)
    if (r.path == "reference/difference") c.value = r.largest;
  c.pass = c.value <= c.limit;
  c.most = c.limit;
  return c;
}

class RunCommand {
 public:
  explicit RunCommand(const RunArguments& a)
      : arguments_(a),
        scenario_(load(a)),
        folder_(make_folder(a, *scenario_)),
        file_(make_hdf5_recorder((folder_ / "run.h5").string())),
        recorder_(*file_) {}

  int execute() {
    if (arguments_.until && !(*arguments_.until > 0.0))
      throw InputError(Diagnostic{
          Code::command_line, {"--until", {}}, "a time > 0 s", fmt::format("{}", *arguments_.until), {}, {}, {}, 0});
    std::vector<Output> outputs = mission_outputs(*scenario_);
    if (arguments_.check_against_reference) outputs.push_back(reference_output(*scenario_));
    std::vector<Channel> channels;
    for (const Output& o : outputs) channels.push_back(o.channel);
    recorder_.begin(run_header(*scenario_), channels);

    const double t_end = arguments_.until.value_or(scenario_->mission.duration);
    MissionRun mission(*scenario_, recorder_, std::move(outputs));
    Progress progress(progress_look(arguments_.quiet), t_end);
    progress_ = &progress;
    std::optional<RunFailure> failure;
    Summary summary;
    const auto guarded = [&](const auto& part) {  // what was reached is kept, whatever fails
      try {
        part();
      } catch (const NumericsError& e) {
        if (!failure) failure = e.failure();
      }
    };
    guarded([&] { mission.run(t_end, [&progress](double t) { progress.update(t); }); });
    const double wall_s = progress.wall_s();
    progress.clear();
    progress_ = nullptr;
    summary = run_summary(*scenario_, wall_s);
    summary.planned_s = t_end;
    if (!failure) {
      guarded([&] {
        summary.checks = mission.checks();
        summary.figures = mission.figures();
      });
      if (arguments_.check_against_reference) summary.checks.push_back(reference_check(recorder_.ranges()));
    } else if (failure->code != Code::disk_full) {
      guarded([&] { keep_state(); });
      failure->last_good = (folder_ / "run.h5").string() + ":/restart";
    }
    const bool good = std::all_of(summary.checks.begin(), summary.checks.end(), [](const Check& c) { return c.pass; });
    summary.verdict = failure ? Verdict::aborted : good ? Verdict::passed : Verdict::failed;
    summary.failure = failure;
    finish(summary, failure ? failure->code != Code::disk_full : true);
    tell_warnings(summary.warnings);
    if (failure) throw NumericsError(*failure);
    if (!arguments_.quiet || !good) tell(summary);
    return good ? 0 : 1;
  }

 private:
  std::unique_ptr<Scenario> load(const RunArguments& a) {
    ScenarioOptions options = a.scenario.options();
    options.print = [this](std::string_view line) {
      if (progress_)
        progress_->print(line);
      else
        fmt::print("{}\n", line);
    };
    return load_scenario(options);
  }

  void keep_state() {
    const State& state = scenario_->sim->state();
    std::vector<double> x(state.q.begin(), state.q.end());
    x.insert(x.end(), state.v.begin(), state.v.end());
    recorder_.restart_state(state.t, x);
  }

  void finish(const Summary& summary, bool disk_has_room) {
    const std::string text = to_json(summary);
    write_text(folder_ / "summary.json", text);
    if (!disk_has_room) return;
    recorder_.attach("summary", text);
    recorder_.close();
    write_report((folder_ / "run.h5").string(), (folder_ / "report.html").string());
  }

  /// In full, or with --quiet their codes.
  void tell_warnings(const Warnings& all) {
    if (!arguments_.quiet) return fmt::print(stderr, "{}", render(all));
    if (all.empty()) return;
    std::string codes;
    for (const Warning& w : all.all()) codes += fmt::format("{}{}", codes.empty() ? "" : ", ", number_of(w.what.code));
    fmt::print(stderr, "warnings: {}, told in {}\n", codes, (folder_ / "summary.json").string());
  }

  void tell(const Summary& summary) {
    fmt::print("{}\n", summary_text(*scenario_, summary, recorder_.ranges()));
    for (const char* name : {"run.h5", "report.html", "summary.json"}) fmt::print("{}\n", (folder_ / name).string());
  }

  RunArguments arguments_;
  Progress* progress_ = nullptr;
  std::unique_ptr<Scenario> scenario_;
  fs::path folder_;
  std::unique_ptr<Recorder> file_;
  RangeRecorder recorder_;
};

}  // namespace

void add_run(CLI::App& app, CommandLine& line) {
  auto* command = app.add_subcommand("run", "Run a scenario; writes run.h5, report.html and summary.json");
  auto a = std::make_shared<RunArguments>();
  a->scenario.add_to(*command, line);
  command->add_option("--out", a->out, "Folder of the results; default: out/<folder of the scenario>")->type_name("DIR");
  command->add_option("--until", a->until, "End of the run in s, instead of the mission's duration")->type_name("SECONDS");
  command->add_flag("--quiet", a->quiet, "No progress, and a summary only if a check failed");
  command->add_flag("--check-against-reference", a->check_against_reference,
                    "Compare with the dense twin at every output time (slow)");
  command->callback([&line, a] { line.action = [a] { return RunCommand(*a).execute(); }; });
}

}  // namespace cardan
