#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <limits>
#include <map>
#include <new>

#include "core/base/activity.hpp"
#include "core/base/units.hpp"
#include "core/io/checkpoint_text.hpp"
#include "core/io/json.hpp"
#include "core/io/result_folder.hpp"
#include "core/io/sha256.hpp"
#include "core/sim/outputs.hpp"
#include "core/sim/reference_check.hpp"
#include "scripts/bindings/open.hpp"
#include "scripts/commands/commands.hpp"
#include "scripts/commands/gathered_warnings.hpp"
#include "scripts/commands/interrupt.hpp"
#include "scripts/commands/progress.hpp"
#include "scripts/commands/streams.hpp"
#include "scripts/mission/describe_scenario.hpp"
#include "scripts/mission/examine.hpp"
#include "scripts/mission/mission_run.hpp"
#include "scripts/mission/run_again.hpp"
#include "scripts/report/report.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
constexpr const char* kResults = "run.h5";
constexpr const char* kSummary = "summary.json";
constexpr const char* kReport = "report.html";
constexpr int kBySignal = 128;  // exit code: + its number, as shells count

/// [s] of this thread, which a run has to itself: that of the process goes by ticks of the scheduler, some ms, where RLIMIT_CPU is set.
double processor_time() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

struct RunArguments {
  ScenarioArguments scenario;
  std::string out, again, resume;
  std::optional<double> until, at;
  bool quiet = false, check_against_reference = false, json_errors = false, profile = false, no_report = false;
  std::vector<std::string> command;
};

[[noreturn]] void wrong_line(std::string option, std::string expected, std::string got, std::string hint = {}) {
  refuse(Code::command_line, {std::move(option)}, std::move(expected), std::move(got), std::move(hint));
}

/// What is to be run: as the command line says, or as results say.
RecordedRun job_of(const RunArguments& a) {
  const int given = !a.scenario.file.empty() + !a.again.empty() + !a.resume.empty();
  if (given != 1)
    wrong_line("cardan run", "a scenario, or --again or --resume with the results of a run", given == 0 ? "none of them" : "more than one");
  if (a.at && a.resume.empty()) wrong_line("--at", "--resume beside it", "none");
  RecordedRun job;
  if (!a.scenario.file.empty()) {
    job.options = a.scenario.options();
    job.command = a.command;
    job.until = a.until;
    job.check_against_reference = a.check_against_reference;
  } else {
    const bool resumes = !a.resume.empty();
    if (!a.scenario.settings.empty() || !a.scenario.settings_files.empty() || !a.scenario.seed.empty() || (a.until && !resumes) ||
        a.check_against_reference)
      wrong_line(resumes ? "--resume" : "--again",
                 resumes ? "the run as it was: beside --resume only --at, --until, --out, --quiet, --no-report, --profile and --json-errors"
                         : "the run as it was: beside --again only --out, --quiet, --no-report, --profile and --json-errors",
                 "an option that changes it");
    job = resumes ? read_run_to_resume(a.resume, a.at) : read_recorded_run(a.again);
    if (a.until) job.until = a.until;
  }
  const double start = job.resume ? job.resume->t : 0.0;
  const bool at_its_end = !a.until && job.until == start;  // a checkpoint where `--until` stopped the run
  if (job.until && !at_its_end && !(*job.until > start && std::isfinite(*job.until)))
    wrong_line("--until", fmt::format("a finite time > {:g} s", start), fmt::format("{}", *job.until));
  return job;
}

/// Default: out/<name of the scenario's folder>, of a repetition the folder `again`, of a run that goes on `resumed` beside the results.
fs::path folder_of(const RunArguments& a, const fs::path& scenario) {
  if (!a.out.empty()) return a.out;
  if (!a.again.empty()) return fs::path(a.again).parent_path() / "again";
  if (!a.resume.empty()) return fs::path(a.resume).parent_path() / "resumed";
  return fs::path("out") / fs::absolute(scenario).lexically_normal().parent_path().filename();
}

const char* name_of_signal(int number) { return number == SIGINT ? "SIGINT (Ctrl-C)" : number == SIGTERM ? "SIGTERM" : "SIGHUP"; }

class RunCommand {
 public:
  explicit RunCommand(const RunArguments& a) : arguments_(a), job_(job_of(a)), scenario_(load()) {}

  int execute() {
    // What `--until` has stopped goes on to the end of the mission.
    if (job_.resume && job_.resume->at_its_end && !arguments_.until && job_.until < scenario_->mission.duration) job_.until.reset();
    const double t_end = job_.until.value_or(scenario_->mission.duration);
    std::vector<Output> outputs = mission_outputs(*scenario_);
    if (job_.check_against_reference) outputs.push_back(reference_output(*scenario_->sim));
    channels_ = channels_of(outputs);
    RunHeader header = run_header(*scenario_);
    header.command = job_.command;
    header.until = job_.until ? fmt::format("{}", *job_.until) : "";
    header.check_against_reference = job_.check_against_reference;
    header.most_rows = most_rows(t_end);
    const fs::path path = folder_of(arguments_, scenario_->file);
    if (job_.resume) header.resumed = job_.resume->resumed;
    for (const std::string& results : {arguments_.again, arguments_.resume})
      if (std::error_code none; !results.empty() && fs::weakly_canonical(path / kResults, none) == fs::weakly_canonical(results, none))
        wrong_line("--out", "another folder than that of the results to be repeated or resumed", in_quotes(path.string()));

    folder_.emplace(path, std::vector<std::string_view>{kResults, kSummary, kReport});
    const Interruption interruption;
    file_ = make_hdf5_recorder((*folder_ / kResults).string(), 2.0, [this] {
      for (const char* of_an_earlier_run : {kSummary, kReport}) remove_file(*folder_ / of_an_earlier_run);
    });
    RangeRecorder recorder(*file_);
    recorder.set_deaf(job_.resume != nullptr);  // what is known before the run is known from the results
    MissionRun mission(*scenario_, recorder, std::move(outputs));
    tell_warnings();
    // Refused before begin() takes the place of earlier results.
    if (job_.resume)
      resume(mission);
    else
      scenario_->sim->vdot();
    {
      const Activity activity(fmt::format("the recorder of {} channels", channels_.size()));
      recorder.begin(header, channels_);
    }
    recorder_ = &recorder;
    for (const std::string& line : printed_) recorder.note(Note::printed, std::nan(""), {line, "the scenario"});
    recorder.set_deaf(false);
    if (!arguments_.quiet && !arguments_.json_errors) say(modes_line(*scenario_));

    run(mission, t_end);
    keep(kSummary, [&] { write_whole_file(*folder_ / kSummary, summary_json()); });
    if (!disk_is_full()) {
      if (keep(kResults, [&] { close_results(); }) && !arguments_.no_report)
        keep(kReport, [&] { write_report((*folder_ / kResults).string(), (*folder_ / kReport).string()); });
    } else {  // the rows up to the last flush
      kept_.insert(kept_.begin(), (*folder_ / kResults).string());
    }
    const int code = exit_code();
    tell(code);
    return code;
  }

 private:
  std::unique_ptr<Scenario> load() {
    ScenarioOptions options = job_.options;
    options.interrupt = &Interruption::flag();
    options.until = job_.resume && job_.resume->at_its_end ? arguments_.until : job_.until;
    options.print = [this](std::string_view line) {
      if (progress_) progress_->clear();
      say(fmt::format("{}\n", line));
      if (recorder_)
        recorder_->note(Note::printed, scenario_->sim->time(), {std::string(line), std::string(scenario_->actor)});
      else
        printed_.emplace_back(line);
    };
    auto scenario = open_scenario(options);
    scenario->warnings.add(job_.warnings);
    if (arguments_.profile) scenario->sim->take_times();
    return scenario;
  }

  /// To the end, to a failure or to a signal; what was reached is kept whatever happens.
  void run(MissionRun& mission, double t_end) {
    mission.on_checkpoint([this](double t, Checkpoint checkpoint) {
      Archive more;
      RangeRecorder::Counts counts = recorder_->counts();
      more.block(kRecorderCounts)(counts);
      checkpoint.merge(Checkpoint(more.checkpoint()));
      recorder_->checkpoint(t, checkpoint_text(checkpoint));
    });
    Progress progress(progress_look(arguments_.quiet), t_end);
    progress_ = &progress;
    const double cpu_before = processor_time();
    const auto guarded = [&](const auto& part) {
      try {
        part();
      } catch (const NumericsError& e) {
        if (!summary_.failure) summary_.failure = e.failure();
      } catch (const InputError&) {
        if (!Interruption::flag()) fault_ = std::current_exception();
      } catch (const std::bad_alloc&) {
        if (!summary_.failure)
          summary_.failure = RunFailure{
              Code::no_memory_in_run, scenario_->sim->time(), "", "", "", "a smaller scenario, or a larger limit (ulimit -v)", ""};
      } catch (const std::exception&) {
        fault_ = std::current_exception();
      }
    };
    guarded([&] {
      if (job_.resume) replay();
      mission.run(t_end, [&](double t) {
        if (Interruption::flag()) scenario_->sim->stop();
        progress.update(t);
      });
    });
    const double wall_s = progress.wall_s(), cpu_s = processor_time() - cpu_before;
    progress.clear();
    progress_ = nullptr;
    if (!disk_is_full()) guarded([&] { scenario_->sim->keep_steps(); });
    std::optional<RunFailure> failure = std::move(summary_.failure);
    summary_ = run_summary(*scenario_, wall_s);
    summary_.failure = std::move(failure);
    summary_.cpu_s = cpu_s;
    summary_.planned_s = t_end;
    summary_.kept_elsewhere = mission.kept_elsewhere();
    const bool interrupted = Interruption::flag() && !summary_.failure;
    if (!summary_.failure && !fault_ && !interrupted) {
      for (const Measure& m : scenario_->checks) guarded([&] { summary_.checks.push_back(mission.check(m)); });
      for (const Measure& m : scenario_->figures) guarded([&] { summary_.figures.push_back(mission.figure(m)); });
      if (job_.check_against_reference) summary_.checks.push_back(reference_check(recorder_->ranges()));
    }
    if (!disk_is_full()) guarded([&] { keep_state(); });
    if (summary_.failure && !disk_is_full()) summary_.failure->last_good = (*folder_ / kResults).string() + ":/restart";
    const bool good = std::all_of(summary_.checks.begin(), summary_.checks.end(), [](const Check& c) { return c.pass; });
    summary_.verdict = summary_.failure || fault_ ? Verdict::aborted
                       : interrupted              ? Verdict::interrupted
                       : good                     ? Verdict::passed
                                                  : Verdict::failed;
    summary_.ended_by = what_ended();
  }

  /// The state of all that goes on, where the results fit the scenario in them.
  void resume(MissionRun& mission) {
    const ResumePoint& from = *job_.resume;
    const auto misfit = [&](const std::string& path, std::string got) {
      throw InputError(Diagnostic{Code::bad_result_file,
                                  {path, {arguments_.resume}},
                                  "what the scenario in these results makes",
                                  std::move(got),
                                  "made by another program?"});
    };
    for (const Channel& c : channels_) {
      const auto found = from.columns.find(c.path);
      if (found == from.columns.end() || found->second.components != c.components)
        misfit("/channels/" + c.path, "another channel, or none");
      columns_.push_back(&found->second);
    }
    try {
      mission.resume(from.checkpoint);
    } catch (const CheckpointFault& fault) {
      misfit("/restart/checkpoints/text", fault.what());
    }
    scenario_->warnings.add(job_.warnings);
    told_ = scenario_->warnings.all().size();
  }

  /// Everything up to the checkpoint as the results have it.
  void replay() {
    const ResumePoint& from = *job_.resume;
    for (const ResumePoint::Noted& n : from.notes) recorder_->note(n.note, n.t, n.texts);
    for (const NoteKind& kind : note_kinds()) recorder_->left_out(kind.kind, from.left_out[static_cast<std::size_t>(kind.kind)]);
    std::vector<double> row;
    for (std::size_t i = 0; i < from.times.size(); ++i) {
      row.clear();
      for (const ResumePoint::Column* c : columns_) {
        const auto first = c->values.begin() + static_cast<std::ptrdiff_t>(i * c->components.size());
        row.insert(row.end(), first, first + static_cast<std::ptrdiff_t>(c->components.size()));
      }
      recorder_->row(from.times[i], row);
    }
    for (const auto& [numbers, worst] : from.intervals) recorder_->steps(numbers, worst);
    for (const auto& [t, text] : from.checkpoints) recorder_->checkpoint(t, text);
  }

  /// In a few words.
  std::string what_ended() const {
    if (summary_.failure) return fmt::format("{}: {}", number_of(summary_.failure->code), title_of(summary_.failure->code));
    if (fault_) return "an internal error";
    if (summary_.verdict == Verdict::interrupted) return name_of_signal(Interruption::signal());
    return scenario_->sim->stopped() ? "stop() in " + scenario_->stopped_by : "the planned end";
  }

  bool disk_is_full() const { return summary_.failure && summary_.failure->code == Code::disk_full; }

  void keep_state() {
    const State& state = scenario_->sim->state();
    std::vector<double> x(state.q.begin(), state.q.end());
    x.insert(x.end(), state.v.begin(), state.v.end());
    x.insert(x.end(), state.z.begin(), state.z.end());
    recorder_->restart_state(state.t, x);
    Sha256 hash;
    hash.add(&state.t, sizeof state.t);
    hash.add(x.data(), x.size() * sizeof(double));
    summary_.final_state = hash.digest();
    summary_.hashes = recorder_->hashes();
  }

  /// A number that is not finite is a failure of the run.
  std::string summary_json() {
    if (!text_.empty()) return text_;
    try {
      text_ = to_json(summary_);
    } catch (const NumericsError& e) {
      if (!summary_.failure) summary_.failure = e.failure();
      summary_.verdict = Verdict::aborted;
      text_ = to_json(summary_);
    }
    return text_;
  }

  void close_results() {
    recorder_->attach("summary", summary_json());
    recorder_->close(name_of(summary_.verdict));
  }

  /// One of the results; what keeps it from being written is told at the end, with what else there is.
  template <class Write>
  bool keep(const char* name, const Write& write) {
    const std::string path = (*folder_ / name).string();
    const auto lost = [&](const std::string& why) {
      unwritten_.push_back(Diagnostic{Code::cannot_write, {{}, {path}}, "a file that can be written", why});
      return false;
    };
    try {
      write();
      if (!fs::exists(path)) return lost("it was taken away while the run went on");
      kept_.push_back(path);
      return true;
    } catch (const InputError& e) {
      unwritten_.insert(unwritten_.end(), e.diagnostics().begin(), e.diagnostics().end());
      return false;
    } catch (const NumericsError& e) {
      return lost(e.failure().what);
    } catch (const std::bad_alloc&) {
      return lost("no more memory");
    } catch (const std::exception& e) {
      return lost(e.what());
    }
  }

  static void remove_file(const fs::path& path) {
    std::error_code error;
    fs::remove(path, error);
    if (error) refuse(Code::cannot_write, {{}, {path.string()}}, "a file of an earlier run that can be removed", error.message());
  }

  int exit_code() const {
    switch (summary_.verdict) {
      case Verdict::aborted:
        return fault_ ? 70 : 3;
      case Verdict::interrupted:
        return kBySignal + Interruption::signal();
      case Verdict::failed:
        return 1;
      case Verdict::passed:
        break;
    }
    return unwritten_.empty() ? 0 : kNotWritten;
  }

  void tell(int code) {
    if (arguments_.json_errors) {
      tell_as_data(code);
    } else {
      tell_late_warnings();
      complain(count_of_warnings());
      if (summary_.failure) complain(render(*summary_.failure));
      if (summary_.verdict == Verdict::interrupted)
        complain(fmt::format("interrupted by {} at t = {:.6g} of {:g} s\n", name_of_signal(Interruption::signal()), summary_.simulated_s,
                             summary_.planned_s));
      for (const Diagnostic& d : unwritten_) complain(render(d) + "\n");
      if (!unwritten_.empty())
        complain(fmt::format("{} result{} not written. Kept: {}\n", unwritten_.size(), unwritten_.size() == 1 ? "" : "s",
                             kept_.empty() ? "nothing" : fmt::format("{}", fmt::join(kept_, ", "))));
    }
    const bool ended = summary_.verdict != Verdict::aborted;
    if (ended && (!arguments_.quiet || summary_.verdict == Verdict::failed || !unwritten_.empty())) {
      say(fmt::format("{}\n", summary_text(*scenario_, summary_, recorder_->ranges())));
      say(fmt::format("{}\n", fmt::join(kept_, "\n")));
    }
    if (fault_) std::rethrow_exception(fault_);
  }

  void tell_as_data(int code) {
    Json errors = Json::array(), warnings = Json::array();
    if (summary_.failure) errors.push_back(to_json(*summary_.failure));
    for (const Diagnostic& d : unwritten_) errors.push_back(to_json(d));
    for (const Warning& w : summary_.warnings.all()) warnings.push_back(to_json(w));
    if (errors.empty() && warnings.empty() && summary_.verdict != Verdict::interrupted) return;
    complain(json_text(
        {{"exit_code", code}, {"verdict", name_of(summary_.verdict)}, {"errors", errors}, {"warnings", warnings}, {"kept", kept_}}));
  }

  /// Those of the input at once, those of the run when each comes up first; with --quiet none but the line at the end.
  void tell_warnings() {
    if (arguments_.quiet || arguments_.json_errors) return;
    scenario_->sim->on_warning([this](const Warning& w) { tell_warning(w); });
    for (const Warning& w : gathered(scenario_->warnings.all())) tell_warning(w);
    told_ = scenario_->warnings.all().size();
  }

  /// What the end of the run added to those of the input.
  void tell_late_warnings() const {
    if (arguments_.quiet) return;
    for (const Warning& w : gathered(std::span(scenario_->warnings.all()).subspan(told_))) tell_warning(w);
  }
  void tell_warning(const Warning& w) const {
    if (progress_) progress_->clear();
    complain(render(w.what) + "\n");
  }

  /// How many there were of each.
  std::string count_of_warnings() const {
    std::map<std::string_view, long> counts;
    for (const Warning& w : summary_.warnings.all()) counts[number_of(w.what.code)] += w.count;
    std::string codes;
    for (const auto& [code, count] : counts)
      codes += fmt::format("{}{}{}", codes.empty() ? "" : ", ", code, count > 1 ? fmt::format(" ({} times)", count) : "");
    return codes.empty() ? codes : fmt::format("warnings: {}; see {}\n", codes, (*folder_ / kSummary).string());
  }

  /// Start, end and one per period between them; one more for round-off.
  std::size_t most_rows(double t_end) const {
    const Rational& period = scenario_->mission.output_period;
    const double rows = t_end * static_cast<double>(period.denominator) / static_cast<double>(period.numerator) + 3;
    return static_cast<std::size_t>(std::clamp(rows, 1.0, 1e9));
  }

  RunArguments arguments_;
  RecordedRun job_;
  Progress* progress_ = nullptr;
  RangeRecorder* recorder_ = nullptr;
  std::vector<Channel> channels_;
  std::vector<const ResumePoint::Column*> columns_;  // of the results that are resumed, as channels_
  std::vector<std::string> printed_;                 // lines, before the recorder was there
  std::unique_ptr<Scenario> scenario_;
  std::optional<ResultFolder> folder_;
  std::unique_ptr<Recorder> file_;
  Summary summary_;
  std::string text_;               // of summary.json
  std::exception_ptr fault_;       // of ours, during the run
  std::size_t told_ = 0;           // warnings of the scenario that were told before the run
  std::vector<std::string> kept_;  // files
  std::vector<Diagnostic> unwritten_;
};

}  // namespace

void add_run(CommandLine& line) {
  Command& command = line.command("run", "Run a scenario; writes run.h5, report.html and summary.json");
  auto a = std::make_shared<RunArguments>();
  a->scenario.add_to(command, line).required(false);
  command.option("--again", a->again, "Instead of a scenario: repeat the run that made these results: run.h5, or the folder it is in")
      .type_name("RESULTS");
  command
      .option("--resume", a->resume,
              "Instead of a scenario: go on from the last checkpoint of the run that made these results, with the same bits as if it had "
              "never stopped: run.h5, or the folder it is in")
      .type_name("RESULTS");
  command.option("--at", a->at, "With --resume: from the last checkpoint at or before this time in s").type_name("SECONDS");
  command
      .option("--out", a->out,
              "Folder of the results; default: out/<folder of the scenario>, beside the results `again` with --again, `resumed` with "
              "--resume")
      .type_name("DIR");
  command.option("--until", a->until, "End of the run in s, instead of the mission's duration").type_name("SECONDS");
  command.flag("--quiet", a->quiet, "No progress, and a summary only if a check failed");
  command.flag("--no-report", a->no_report, "No report.html, which `cardan report` makes of run.h5 at any time");
  command.flag("--profile", a->profile, "Tell where the time of the run went: right-hand side, method, controllers, ledger, outputs");
  command.flag("--check-against-reference", a->check_against_reference, "Compare with the dense twin at every output time (slow)");
  command.action([&line, a] {
    a->json_errors = line.json_errors();
    a->command = line.words();
    for (std::string* results : {&a->again, &a->resume})
      if (std::error_code ignored; fs::is_directory(*results, ignored)) *results = (fs::path(*results) / kResults).string();
    return RunCommand(*a).execute();
  });
}

}  // namespace cardan
