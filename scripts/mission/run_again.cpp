#include "scripts/mission/run_again.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>

#include "core/base/units.hpp"
#include "core/base/version.hpp"
#include "core/io/bounded_child.hpp"
#include "core/io/checkpoint_text.hpp"
#include "core/io/hdf5_file.hpp"
#include "core/io/range_recorder.hpp"
#include "core/io/result_folder.hpp"
#include "core/io/sha256.hpp"
#include "core/io/summary.hpp"
#include "core/sim/run_header.hpp"
#include "scripts/mission/mission_run.hpp"

namespace cardan {
namespace {

using Pairs = std::vector<std::pair<std::string, std::string>>;

class Reader {
 public:
  explicit Reader(const std::string& path) : file_(Hdf5File::open(path)), format_(result_format(file_)) {}

  RecordedRun to_resume(std::optional<double> at) const {
    RecordedRun run = read();
    const char* const texts = "/restart/checkpoints/text";
    if (format_ < 2) refuse("results with checkpoints", "results of format 1, which have none", "run the scenario with this program");
    const std::vector<double> times = file_.read_doubles("/restart/checkpoints/t").values;
    const std::vector<std::string> all = file_.read_texts(texts);
    std::size_t n = std::min(times.size(), all.size());
    while (n > 0 && at && times[n - 1] > *at) --n;
    if (n == 0)
      refuse("a checkpoint", at && !times.empty() ? fmt::format("the first one at t = {:g} s", times[0]) : std::string("none"),
             "mission.checkpoint.period says when they are made; --again begins at the start");
    auto point = std::make_shared<ResumePoint>();
    try {
      point->t = times[n - 1];
      point->checkpoint = checkpoint_of(all[n - 1]);
      for (std::size_t i = 0; i < n; ++i) point->checkpoints.emplace_back(times[i], all[i]);
      RangeRecorder::Counts counts;
      std::vector<std::string> elsewhere;
      Archive from(point->checkpoint);
      from.block(kRecorderCounts)(counts);
      from.block(kKeptElsewhere)(elsewhere);
      from.finish();
      if (!elsewhere.empty())
        refuse("a script that keeps what it remembers in persist{}", fmt::format("variables that change: {}", fmt::join(elsewhere, ", ")),
               "local memory = persist { integral = 0.0 }, and memory.integral in the functions; --again begins at the start");
      read_rows(*point, counts.rows);
      read_notes(*point, counts);
      read_steps(*point, counts.intervals);
    } catch (const CheckpointFault& fault) {
      wrong(texts, "a checkpoint of this program", fault.what(), {});
    }
    point->resumed = file_.has_attribute("/run", "resumed") ? text("resumed") + ", " : "";
    point->resumed += fmt::format("{}", point->t);
    const std::string verdict = file_.has_attribute("/run", "verdict") ? text("verdict") : "";
    // A check or a figure that fails there, as one of what was still to come, aborts the run at its end.
    point->at_its_end = verdict == name_of(Verdict::passed) || verdict == name_of(Verdict::failed) ||
                        (verdict == name_of(Verdict::aborted) && run.until && file_.read_doubles("/restart/t").values[0] >= *run.until);
    run.resume = std::move(point);
    return run;
  }

  RecordedRun read() const {
    RecordedRun run;
    if (!file_.has("/spec/files") || !file_.has("/run/command"))
      wrong("/spec/files", "the texts of the input files", "results without them", "only results of cardan run can be repeated");
    auto inputs = std::make_shared<RecordedInputs>();
    inputs->results = file_.file_name();
    const Pairs files = pairs("/spec/files"), hashes = pairs("/run/inputs");
    for (std::size_t i = 0; i < files.size(); ++i) {
      const auto& [name, text] = files[i];
      if (i >= hashes.size() || hashes[i].first != name || hashes[i].second != sha256(text))
        wrong("/spec/files", "texts that have the recorded hashes", in_quotes(name) + " has another",
              "the results were changed after the run");
      inputs->texts[name] = text;
    }
    for (const char* path : {"/run/plugins", "/run/modal_files"})
      for (const auto& [name, hash] : pairs(path)) inputs->hashes[name] = hash;
    run.inputs = inputs;
    run.command = file_.read_texts("/run/command");
    run.options.file = std::filesystem::path(text("folder")) / text("scenario");
    run.options.recorded = inputs;
    for (const auto& [key, value] : pairs("/run/settings")) run.options.settings.push_back({key, value});
    const auto seed = parse_seed(text("seed"));
    if (!seed) wrong("/run@seed", "a whole number from 0 to 18446744073709551615", in_quotes(text("seed")), {});
    run.options.seed = *seed;
    if (file_.has_attribute("/run", "until") && !(run.until = parse_number(text("until"))))
      wrong("/run@until", "a time in s", in_quotes(text("until")), {});
    run.check_against_reference = text("check_against_reference") == "true";
    compare("cardan", text("program_version") + " " + text("commit"), fmt::format("{} {}", version::kNumber, version::kCommit), run);
    compare("compiler", text("compiler") + ", " + text("flags"), fmt::format("{}, {}", version::kCompiler, version::kFlags), run);
    compare("sweeps", text("sweeps"), sweeps_name(), run);
    return run;
  }

 private:
  std::string text(const char* key) const { return file_.text_attribute("/run", key); }

  Pairs pairs(const std::string& path) const {
    Pairs out;
    const std::vector<std::string> texts = file_.read_texts(path);
    for (std::size_t i = 0; i + 1 < texts.size(); i += 2) out.emplace_back(texts[i], texts[i + 1]);
    return out;
  }

  [[noreturn]] void wrong(const char* path, std::string expected, std::string got, std::string hint) const {
    cardan::refuse(Code::bad_result_file, {path, {file_.file_name()}}, std::move(expected), std::move(got), std::move(hint));
  }

  void compare(const char* what, const std::string& then, const std::string& now, RecordedRun& run) const {
    if (then == now) return;
    run.warnings.add(
        Code::other_program, {what, {file_.file_name(), 0, 0}},
        fmt::format("the run was made by another program: then {}, now {}", then, now),
        what == std::string_view("sweeps") ? "CARDAN_KERNELS chooses the instruction set: v2, v3, v4" : "the last bits may differ");
  }

  [[noreturn]] void refuse(std::string expected, std::string got, std::string hint) const {
    cardan::refuse(Code::not_resumable, {"/restart/checkpoints", {file_.file_name()}}, std::move(expected), std::move(got),
                   std::move(hint));
  }

  void read_rows(ResumePoint& point, std::size_t n) const {
    point.times = file_.read_doubles("/time").values;
    if (point.times.size() < n) wrong("/time", fmt::format("{} rows before the checkpoint", n), fmt::format("{}", point.times.size()), {});
    point.times.resize(n);
    for (const std::string& path : file_.datasets("/channels")) {
      Hdf5Array<double> values = file_.read_doubles(path);
      ResumePoint::Column& c = point.columns[path.substr(std::string_view("/channels/").size())];
      c.components = file_.texts_attribute(path, "components");
      if (values.shape.size() != 2 || values.shape[0] < n || values.shape[1] != c.components.size())
        wrong(path.c_str(), fmt::format("{} rows of {} numbers", n, c.components.size()), "another shape", {});
      c.values = std::move(values.values);
    }
  }

  void read_notes(ResumePoint& point, const RangeRecorder::Counts& counts) const {
    for (const NoteKind& kind : note_kinds()) {
      const std::string path = std::string("/run/") + kind.name;
      const std::vector<double> times = file_.read_doubles(path + "/t").values;
      const std::vector<std::string> texts = file_.read_texts(path + "/text");
      const std::size_t columns = kind.columns.size(), all = counts.notes[static_cast<std::size_t>(kind.kind)];
      const std::size_t n = std::min(all, times.size());
      if (texts.size() < n * columns) wrong(path.c_str(), "a row for each time", "fewer", {});
      const std::vector<double> left_out = file_.read_doubles(path + "/left_out").values;
      if (all > n && !(left_out.size() == 1 && left_out[0] >= static_cast<double>(all - n)))
        wrong(path.c_str(), fmt::format("{} rows before the checkpoint", all), fmt::format("{}", n), {});
      point.left_out[static_cast<std::size_t>(kind.kind)] = all - n;
      for (std::size_t i = 0; i < n; ++i) {
        const auto first = texts.begin() + static_cast<std::ptrdiff_t>(i * columns);
        point.notes.push_back({kind.kind, times[i], {first, first + static_cast<std::ptrdiff_t>(columns)}});
      }
    }
  }

  void read_steps(ResumePoint& point, std::size_t n) const {
    const char* const path = "/run/steps/numbers";
    const Hdf5Array<double> numbers = file_.read_doubles(path);
    const std::vector<std::string> worst = file_.read_texts("/run/steps/worst");
    const std::size_t columns = StepInterval().columns().size();
    if (numbers.shape.size() != 2 || numbers.shape[0] < n || numbers.shape[1] != columns || worst.size() < n)
      wrong(path, fmt::format("{} rows of {} numbers", n, columns), "another shape", {});
    for (std::size_t i = 0; i < n; ++i) {
      const auto first = numbers.values.begin() + static_cast<std::ptrdiff_t>(i * columns);
      point.intervals.emplace_back(std::vector<double>(first, first + static_cast<std::ptrdiff_t>(columns)), worst[i]);
    }
  }

  Hdf5File file_;
  int format_;
};

}  // namespace

namespace {
/// What breaks the library that reads a file breaks it in a child.
template <class Read>
RecordedRun read_safely(const std::string& h5_path, const Read& read) {
  const auto probe = [&] {
    read();
    return std::string();
  };
  RecordedRun run;
  read_between_flushes(h5_path, [&] {
    in_bounded_child(h5_path, probe, limits_for_file(h5_path));
    run = read();
  });
  return run;
}
}  // namespace

RecordedRun read_recorded_run(const std::string& h5_path) {
  return read_safely(h5_path, [&] { return Reader(h5_path).read(); });
}

RecordedRun read_run_to_resume(const std::string& h5_path, std::optional<double> at) {
  return read_safely(h5_path, [&] { return Reader(h5_path).to_resume(at); });
}

}  // namespace cardan
