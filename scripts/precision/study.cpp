#include "scripts/precision/study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <thread>

#include "core/io/json.hpp"
#include "core/io/result_folder.hpp"
#include "core/io/sha256.hpp"
#include "core/io/yaml_reader.hpp"
#include "scripts/regress/runner.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

constexpr const char* kKept = "row.json";  // beside run.h5 in the folder of a run: what became of it
constexpr const char* kSaid = "errors.json";
constexpr const char* kChannels = "run.h5";
constexpr int kFormat = 2;

/// Of all that the numbers of a run depend on.
std::string key_of(const PrecisionOrder& order, const PrecisionSetting& setting) {
  std::string text = fmt::format("{}\n{}\n{}\n{}\n", kFormat, order.identity, order.seed, order.until);
  for (const auto& [key, value] : order.settings) text += fmt::format("{}={}\n", key, value);
  for (const auto& [key, value] : setting.sets(order.own)) text += fmt::format("{}={}\n", key, value);
  return sha256(text).substr(0, 16);
}

std::string folder_name(const PrecisionOrder& order, const PrecisionSetting& s) {
  std::string name = fmt::format("{}_{}", s.name(), s.rung());
  if (!s.model.empty()) name += "_simplified";
  std::ranges::replace_if(
      name, [](char c) { return c == '/' || c == ' '; }, '-');
  return fmt::format("runs/{}_{}", name, key_of(order, s));
}

Json to_json(const KindErrors& errors) {
  Json out = Json::object();
  for (std::size_t k = 0; k < errors.size(); ++k)
    if (const auto& e = errors[k])
      out[precision_kinds()[k].name] = {
          {"final", e->final}, {"l2", e->l2}, {"largest", e->largest}, {"size", e->size}, {"channel", e->channel}};
  return out;
}

KindErrors kind_errors(const Json& j) {
  KindErrors out(precision_kinds().size());
  for (std::size_t k = 0; k < out.size(); ++k) {
    const auto found = j.find(precision_kinds()[k].name);
    if (found == j.end()) continue;
    const auto number = [&](const char* name) {
      const Json& x = found->at(name);
      return x.is_null() ? std::numeric_limits<double>::infinity() : x.get<double>();
    };
    out[k] = KindError{number("final"), number("l2"), number("largest"), number("size"), found->at("channel").get<std::string>()};
  }
  return out;
}

Json to_json(const PrecisionRow& row, double limit) {
  Json against = Json::object();
  for (const auto& [folder, errors] : row.against) against[folder] = to_json(errors);
  return {{"format", kFormat},
          {"failure", row.failure},
          {"limit_s", limit},
          {"cpu_s", row.cpu_s},
          {"process_s", row.process_s},
          {"repeats", row.repeats},
          {"steps", row.steps},
          {"rhs_calls", row.rhs_calls},
          {"rejected", row.rejected},
          {"restarts", row.restarts},
          {"jacobian_products", row.jacobian_products},
          {"checks_passed", row.checks_passed},
          {"ended_by", row.ended_by},
          {"end_s", row.end_s},
          {"against", against}};
}

/// What an earlier study kept; false: nothing, or a run that ended for want of time and would have more now.
bool take(PrecisionRow& row, const PrecisionOrder& order, const std::vector<const Yardstick*>& by) {
  const fs::path folder = order.out / row.folder;
  std::error_code none;
  if (!fs::is_regular_file(folder / kKept, none)) return false;
  try {
    const Json j = Json::parse(read_text_file((folder / kKept).string()));
    if (j.at("format") != kFormat) return false;
    PrecisionRow kept = row;
    kept.failure = j.at("failure").get<std::string>();
    kept.cpu_s = j.at("cpu_s"), kept.process_s = j.at("process_s"), kept.repeats = j.at("repeats");
    kept.steps = j.at("steps"), kept.rhs_calls = j.at("rhs_calls"), kept.rejected = j.at("rejected");
    kept.restarts = j.at("restarts"), kept.jacobian_products = j.at("jacobian_products");
    kept.checks_passed = j.at("checks_passed"), kept.ended_by = j.at("ended_by"), kept.end_s = j.at("end_s");
    const double limit = j.at("limit_s");
    if (!kept.failure.empty() && limit < order.cpu_s) return false;
    for (const auto& [other, errors] : j.at("against").items()) kept.against[other] = kind_errors(errors);
    const bool measured =
        !by.empty() && !order.keep_runs && std::ranges::all_of(by, [&](const Yardstick* y) { return kept.against.contains(y->folder); });
    if (kept.failure.empty() && (kept.repeats < order.repeats || !(measured || fs::is_regular_file(folder / kChannels, none))))
      return false;
    row = std::move(kept);
    return row.taken = true;
  } catch (const InputError&) {
  } catch (const Json::exception&) {
  }
  return false;
}

ProgramOrder program_order(const PrecisionOrder& order, const PrecisionRow& row) {
  const std::string folder = (order.out / row.folder).string();
  ProgramOrder out;
  out.command = {order.program, "run", order.scenario.string(), "--out", folder, "--quiet", "--json-errors"};
  for (const auto& [key, value] : order.settings) out.command.insert(out.command.end(), {"--set", key + "=" + value});
  for (const auto& [key, value] : row.setting.sets(order.own)) out.command.insert(out.command.end(), {"--set", key + "=" + value});
  if (!order.seed.empty()) out.command.insert(out.command.end(), {"--seed", order.seed});
  if (!order.until.empty()) out.command.insert(out.command.end(), {"--until", order.until});
  out.out = folder + "/printed.txt";
  out.err = folder + "/" + kSaid;
  out.limits.cpu_s = order.cpu_s;
  out.limits.wall_s = 10.0 * order.cpu_s + 60.0;
  out.limits.memory = std::size_t{16} << 30;
  return out;
}

constexpr int kRepeats = 5;         // of short runs
constexpr double kShortRuns = 1.0;  // [s] of processor time, of all of them together

/// Whether one more repeat is wanted after `done` of them.
bool once_more(const PrecisionOrder& order, const PrecisionRow& row, int done) {
  if (!row.failure.empty()) return false;
  return order.repeats > 0 ? done < order.repeats : done < kRepeats && (done + 1) * row.process_s < kShortRuns;
}

/// What one process came to; of several the least time.
void read_run(PrecisionRow& row, const RunEnding& ending, const PrecisionOrder& order, int repeat) {
  const fs::path folder = order.out / row.folder;
  std::error_code none;
  fs::remove(folder / "report.html", none);
  if (!ending.as_planned()) {
    row.failure = ending.complaints.empty() ? ending.text : ending.complaints.front();
    if (ending.how != RunEnding::How::ended) row.failure = ending.text;
    return;
  }
  try {
    const Json j = Json::parse(read_text_file((folder / "summary.json").string()));
    const double cpu_s = j.at("cpu_s");
    row.cpu_s = repeat == 0 ? cpu_s : std::min(row.cpu_s, cpu_s);
    row.process_s = repeat == 0 ? ending.cpu_s : std::min(row.process_s, ending.cpu_s);
    row.repeats = repeat + 1;
    row.steps = j.at("steps"), row.rhs_calls = j.at("rhs_calls"), row.rejected = j.at("rejected"), row.restarts = j.at("restarts");
    row.jacobian_products = j.at("jacobian_products");
    row.checks_passed = ending.exit_code == 0;
    row.ended_by = j.at("ended_by"), row.end_s = j.at("simulated_s");
  } catch (const InputError& e) {
    row.failure = e.diagnostics().front().got;
  } catch (const Json::exception& e) {
    row.failure = fmt::format("summary.json cannot be read: {}", e.what());
  }
}

/// Runs rows, some side by side, and measures them.
class Runs {
 public:
  Runs(const PrecisionOrder& order, PrecisionStudy& study) : order_(order), study_(study) {}

  bool stopped() const { return order_.stop && order_.stop(); }

  /// Calls `done` for each row that has ended, failed or was taken, and was measured by these. Of a row that is measured the channels go.
  void all(std::vector<PrecisionRow*> rows, const std::vector<const Yardstick*>& by, const std::function<void(PrecisionRow&)>& done) {
    struct Going {
      PrecisionRow* row;
      int repeat;
      ChildLimits limits;
      std::unique_ptr<RunningProgram> process;
    };
    std::vector<Going> going;
    std::size_t next = 0;
    const auto start = [&](PrecisionRow* row, int repeat) {
      const ProgramOrder order = program_order(order_, *row);
      ++study_.runs;
      return Going{row, repeat, order.limits, std::make_unique<RunningProgram>(order)};
    };
    while (!stopped() && (next < rows.size() || !going.empty())) {
      while (next < rows.size() && going.size() < static_cast<std::size_t>(order_.jobs) && !stopped()) {
        PrecisionRow* row = rows[next++];
        row->folder = folder_name(order_, row->setting);
        if (take(*row, order_, by)) {
          ++study_.taken, ++study_.kept;
          if (measure(*row, by)) keep(*row);
          done(*row);
          continue;
        }
        const fs::path folder = order_.out / row->folder;
        std::error_code error;
        for (const char* old : {kKept, kChannels, "summary.json", "report.html"}) fs::remove(folder / old, error);
        fs::create_directories(folder, error);
        if (error) {
          row->failure = fmt::format("{}: {}: {}", number_of(Code::cannot_write), folder.string(), error.message());
          done(*row);
          continue;
        }
        going.push_back(start(row, 0));
      }
      bool ended = false;
      for (std::size_t i = 0; i < going.size();) {
        if (!going[i].process->has_ended()) {
          ++i;
          continue;
        }
        ended = true;
        PrecisionRow& row = *going[i].row;
        const int repeat = going[i].repeat;
        const RunEnding ending = ending_of_run(*going[i].process, going[i].limits, order_.out / row.folder / kSaid);
        read_run(row, ending, order_, repeat);
        if (once_more(order_, row, repeat + 1)) {
          going[i] = start(&row, repeat + 1);
          continue;
        }
        going.erase(going.begin() + static_cast<std::ptrdiff_t>(i));
        const bool failed = !row.failure.empty();
        measure(row, by);
        // A file that cannot be read is run again, and so is what a full disk has ended.
        if ((failed || row.failure.empty()) && !ending.from_outside()) keep(row);
        if (std::error_code none; !by.empty() && !order_.keep_runs) fs::remove(order_.out / row.folder / kChannels, none);
        ++study_.kept;
        done(row);
      }
      if (!ended) std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    if (stopped()) study_.complete = false;
  }

  /// The channels of a row that ended; a file that cannot be read is its failure.
  std::optional<RunColumns> columns(PrecisionRow& row) {
    if (!row.failure.empty()) return std::nullopt;
    try {
      return read_run_columns((order_.out / row.folder / kChannels).string());
    } catch (const InputError& e) {
      row.failure = fmt::format("{}: {}", number_of(e.diagnostics().front().code), e.diagnostics().front().got);
      return std::nullopt;
    }
  }

 private:
  /// False: it was measured by all of these before, or failed.
  bool measure(PrecisionRow& row, const std::vector<const Yardstick*>& by) {
    if (std::ranges::all_of(by, [&](const Yardstick* y) { return row.against.contains(y->folder); })) return false;
    const auto is = columns(row);
    for (const Yardstick* y : by)
      if (is) row.against[y->folder] = errors_of_run(*is, y->columns);
    return is.has_value();
  }
  void keep(const PrecisionRow& row) const {
    try {
      write_whole_file(order_.out / row.folder / kKept, json_text_with_nulls(to_json(row, order_.cpu_s)));
    } catch (const InputError&) {  // the next study runs it again
    }
  }

  const PrecisionOrder& order_;
  PrecisionStudy& study_;
};

/// One run that is fit to be a reference: from the tolerance of `setting` to ten times looser, and so on.
std::optional<PrecisionRow> reference_run(Runs& runs, const PrecisionOrder& order, PrecisionStudy& study, const PrecisionSetting& setting,
                                          std::size_t& told) {
  for (double relative = setting.relative; relative <= 1.0001 * order.loosest_reference && !runs.stopped(); relative *= 10.0) {
    PrecisionRow row;
    row.setting = with_tolerance(setting, relative, order.own);
    runs.all({&row}, {}, [](PrecisionRow&) {});
    if (runs.stopped()) return std::nullopt;
    ++told;
    if (order.told) order.told(told, 0, row, true);
    if (row.failure.empty()) return row;
    study.reference.attempts.push_back(
        fmt::format("{} {}: {}", row.setting.name(), row.setting.rung(), row.failure.substr(0, row.failure.find('\n'))));
    if (row.failure.starts_with("C")) break;  // wrong input: it is wrong at every tolerance
  }
  return std::nullopt;
}

}  // namespace

double PrecisionStudy::floor(std::size_t kind, ErrorMeasure measure) const {
  if (precision_kinds()[kind].of_the_run_itself) return 0.0;
  if (kind >= reference.difference.size() || !reference.difference[kind]) return std::numeric_limits<double>::quiet_NaN();
  const KindError& off = *reference.difference[kind];
  const double bit = reference.extended ? std::numeric_limits<double>::epsilon() * off.size : 0.0;
  return std::max(value_of(off, measure), bit);
}

std::vector<double> floors_of(const PrecisionStudy& study, ErrorMeasure measure) {
  std::vector<double> out;
  for (std::size_t k = 0; k < precision_kinds().size(); ++k) {
    const double floor = study.floor(k, measure);
    out.push_back(std::isnan(floor) ? std::numeric_limits<double>::infinity() : floor);
  }
  return out;
}

std::vector<std::size_t> PrecisionStudy::not_converged() const {
  std::vector<std::size_t> out;
  for (std::size_t k = 0; k < reference.difference.size(); ++k)
    if (const auto& d = reference.difference[k]; d && !precision_kinds()[k].of_the_run_itself && !(d->largest <= kConverged * d->size))
      out.push_back(k);
  return out;
}

std::vector<std::size_t> PrecisionStudy::kinds() const {
  std::vector<std::size_t> out;
  for (std::size_t k = 0; k < precision_kinds().size(); ++k) {
    bool there = false;
    for (const PrecisionRow& row : rows)
      there = there || (row.failure.empty() && k < row.errors.size() && row.errors[k] && row.errors[k]->largest > 0.0);
    if (there) out.push_back(k);
  }
  return out;
}

std::optional<Yardstick> yardstick(const PrecisionOrder& order, PrecisionStudy& study, PrecisionRow row) {
  Runs runs(order, study);
  std::error_code none;
  if (!fs::is_regular_file(order.out / row.folder / kChannels, none)) runs.all({&row}, {}, [](PrecisionRow&) {});
  if (runs.stopped()) return std::nullopt;
  auto columns = runs.columns(row);
  if (!columns) return std::nullopt;
  return Yardstick{row.folder, std::move(*columns)};
}

void run_rows(const PrecisionOrder& order, PrecisionStudy& study, const std::vector<PrecisionRow*>& rows,
              const std::vector<const Yardstick*>& by) {
  Runs(order, study).all(rows, by, [](PrecisionRow&) {});
}

PrecisionStudy run_study(const PrecisionOrder& order) {
  PrecisionStudy study;
  study.own = order.own;
  Runs runs(order, study);
  const auto own = std::ranges::find(order.grid, order.own);
  std::vector<PrecisionSetting> settings = order.grid;
  if (own == order.grid.end()) settings.insert(settings.begin(), order.own);
  for (const PrecisionSetting& s : settings) {
    PrecisionRow& row = study.rows.emplace_back();
    row.setting = s;
    row.own = s == order.own;
  }

  // The reference: the first two methods that get there.
  std::size_t told = 0;
  PrecisionReference& reference = study.reference;
  std::optional<RunColumns> truth;
  if (!order.extended.empty()) {
    PrecisionOrder limited = order;
    limited.cpu_s = order.extended_cpu_s;
    Runs in_time(limited, study);
    for (const PrecisionSetting& s : order.extended) {
      PrecisionRow row;
      row.setting = s;
      in_time.all({&row}, {}, [](PrecisionRow&) {});
      if (in_time.stopped()) break;
      if (order.told) order.told(++told, 0, row, true);
      auto is = in_time.columns(row);
      if (!is) {
        reference.why_double = row.failure.substr(0, row.failure.find('\n'));
        break;
      }
      if (reference.runs.empty()) truth = std::move(is);
      reference.runs.push_back(std::move(row));
    }
    reference.extended = reference.runs.size() == order.extended.size();
    if (!reference.extended) reference.runs.clear(), truth.reset();
  } else {
    reference.why_double = order.not_extended;
  }
  for (const PrecisionSetting& s : order.reference) {
    if (reference.runs.size() == 2 || runs.stopped()) break;
    if (auto row = reference_run(runs, order, study, s, told)) {
      if (reference.runs.empty() && !(truth = runs.columns(*row))) {
        reference.attempts.push_back(fmt::format("{} {}: {}", row->setting.name(), row->setting.rung(), row->failure));
        continue;
      }
      reference.runs.push_back(std::move(*row));
    }
  }
  if (reference.runs.size() == 1 && !runs.stopped()) {  // one method alone: at ten times the tolerance too
    reference.one_method = true;
    PrecisionSetting looser = reference.runs[0].setting;
    looser.relative *= 10.0;
    PrecisionOrder wider = order;
    wider.loosest_reference *= 10.0;
    if (auto row = reference_run(runs, wider, study, looser, told)) reference.runs.push_back(std::move(*row));
  }
  if (runs.stopped()) {
    study.complete = false;
    return study;
  }
  if (reference.runs.size() < 2) return study;
  if (const auto other = runs.columns(reference.runs[1])) reference.difference = errors_of_run(*other, *truth);
  reference.runs[0].errors = errors_of_run(*truth, *truth);

  std::size_t done = 0;
  std::vector<PrecisionRow*> rows;
  for (PrecisionRow& row : study.rows) rows.push_back(&row);
  const Yardstick by{reference.runs[0].folder, std::move(*truth)};
  runs.all(rows, {&by}, [&](PrecisionRow& row) {
    if (row.failure.empty()) row.errors = row.against[by.folder];
    if (order.told) order.told(++done, rows.size(), row, false);
  });
  return study;
}

}  // namespace cardan
