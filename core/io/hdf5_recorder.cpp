// Layout: docs/results.md.
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <set>

#include "core/base/diagnostic.hpp"
#include "core/io/hdf5_file.hpp"
#include "core/io/recorder.hpp"
#include "core/io/result_folder.hpp"

namespace cardan {
namespace {

constexpr std::size_t kRowsPerBlock = 256;  // rows buffered, and rows per block of the file unless fewer are expected
constexpr std::size_t kNotesPerBlock = 64, kCheckpointsPerBlock = 16, kMostNotes = 10'000, kMostNoteBytes = 1000;
constexpr std::size_t kMostPictureNumbers = 500'000;  // 4 MB

using Pairs = RunHeader::Pairs;
using Clock = std::chrono::steady_clock;

std::string now_utc() { return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr))); }

/// Channels are datasets in folders: a path can be neither given twice nor be the folder of another one.
void expect_distinct(const std::vector<Channel>& channels) {
  std::set<std::string> paths;
  for (const auto& c : channels)
    if (!paths.insert(c.path).second) refuse(Code::duplicate_name, {c.path}, "channel paths that differ", "the same path twice");
  for (const auto& path : paths)
    for (auto end = path.find('/'); end != std::string::npos; end = path.find('/', end + 1))
      if (paths.contains(path.substr(0, end)))
        refuse(Code::duplicate_name, {path}, "a channel or a folder of channels", "\"" + path.substr(0, end) + "\" is both");
}

/// A text of at most kMostNoteBytes, of a longer one the beginning.
std::string beginning(const std::string& text) {
  if (text.size() <= kMostNoteBytes) return text;
  std::size_t end = kMostNoteBytes - 3;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;  // not in the middle of a character
  return text.substr(0, end) + "...";
}

class Hdf5Recorder final : public Recorder {
 public:
  Hdf5Recorder(const std::string& path, double flush_period, std::function<void()> ready)
      : path_(path),
        file_(Hdf5File::create(name_before(path))),
        ready_(std::move(ready)),
        flush_period_(flush_period),
        last_flush_(Clock::now()) {}

  /// A run that is left without close() keeps its rows, but does not count as finished.
  ~Hdf5Recorder() override {
    if (file_.file_name() != path_) {  // never begun
      std::remove(file_.file_name().c_str());
      return;
    }
    try {
      if (!closed_) flush();
    } catch (const std::exception&) {  // nobody is left to tell
    }
  }

  void begin(const RunHeader& header, const std::vector<Channel>& channels) override {
    expect_distinct(channels);
    file_.make_group("/run");
    for (const auto& [key, text] : Pairs{{"scenario", header.scenario},
                                         {"folder", header.folder},
                                         {"title", header.title},
                                         {"program_version", header.program_version},
                                         {"commit", header.commit},
                                         {"compiler", header.compiler},
                                         {"flags", header.flags},
                                         {"sweeps", header.sweeps},
                                         {"sweep_flags", header.sweep_flags},
                                         {"seed", std::to_string(header.seed)},
                                         {"format", std::to_string(kResultFormat)},
                                         {"check_against_reference", header.check_against_reference ? "true" : "false"},
                                         {"integrator", header.integrator},
                                         {"started", now_utc()}})
      file_.set_attribute("/run", key, text);
    if (!header.resumed.empty()) file_.set_attribute("/run", "resumed", header.resumed);
    if (!header.until.empty()) file_.set_attribute("/run", "until", header.until);
    file_.write("/run/command", header.command, {header.command.size()});
    write_pairs("/run/settings", header.settings);
    for (const auto& [path, files] :
         {std::pair{"/run/inputs", &header.inputs}, {"/run/plugins", &header.plugins}, {"/run/modal_files", &header.modal_files}}) {
      Pairs hashes;
      for (const InputFile& f : *files) hashes.emplace_back(f.name, f.sha256);
      write_pairs(path, hashes);
    }
    Pairs texts;
    for (const InputFile& f : header.inputs) texts.emplace_back(f.name, f.text);
    write_pairs("/spec/files", texts);
    write_pairs("/spec/parameters", header.effective_parameters);
    write_pairs("/spec/defaults", header.defaults_used);
    file_.write("/spec/sweeps", header.sweep_program);

    write_pictures(header.mode_pictures);
    for (const NoteKind& kind : note_kinds()) {
      const std::string path = notes_path(kind);
      file_.make_rows(path + "/t", 0, kNotesPerBlock);
      file_.set_attribute(path + "/t", "unit", std::string("s"));
      file_.make_text_rows(path + "/text", kind.columns.size(), kNotesPerBlock);
      file_.set_attribute(path + "/text", "columns", kind.columns);
      file_.write(path + "/left_out", 0.0);
    }

    std::vector<std::string> names, units;
    for (const StepInterval::Column& c : StepInterval().columns()) names.push_back(c.name), units.emplace_back(c.unit);
    file_.make_rows("/run/steps/numbers", names.size(), kNotesPerBlock);
    file_.set_attribute("/run/steps/numbers", "columns", names);
    file_.set_attribute("/run/steps/numbers", "units", units);
    file_.make_text_rows("/run/steps/worst", 1, kNotesPerBlock);

    file_.make_rows("/restart/checkpoints/t", 0, kCheckpointsPerBlock);
    file_.set_attribute("/restart/checkpoints/t", "unit", std::string("s"));
    file_.make_text_rows("/restart/checkpoints/text", 1, kCheckpointsPerBlock);

    // A run of few rows gets blocks that hold all of them: less to store, and no index of blocks.
    const bool few = header.most_rows > 0 && header.most_rows <= kRowsPerBlock;
    const std::size_t rows = few ? header.most_rows : kRowsPerBlock, limit = few ? rows : 0;
    file_.make_rows("/time", 0, rows, limit);
    file_.set_attribute("/time", "unit", std::string("s"));
    file_.make_group("/channels");
    file_.make_group("/attachments");
    for (const auto& c : channels) {
      const std::string path = "/channels/" + c.path;
      file_.make_rows(path, c.components.size(), rows, limit);
      file_.set_attribute(path, "unit", c.unit);
      file_.set_attribute(path, "frame", c.frame);
      file_.set_attribute(path, "components", c.components);
      file_.set_attribute(path, "meaning", c.meaning);
      if (!c.commands.empty()) file_.set_attribute(path, "commands", c.commands);
      file_.set_attribute(path, "shape", fmt::format("time x {}", c.components.size()));
      columns_.push_back({path, c.components.size()});
      width_ += c.components.size();
    }
    times_.reserve(rows);
    values_.reserve(rows * width_);
    begun_ = true;
    flush();
    if (ready_) ready_();
    file_.rename(path_);
  }

  void row(double t, std::span<const double> values) override {
    if (values.size() != width_) throw std::invalid_argument("Recorder::row: a row is as wide as the channels declared");
    times_.push_back(t);
    values_.insert(values_.end(), values.begin(), values.end());
    const bool full = times_.size() == kRowsPerBlock;
    if (full) ++blocks_;
    // By the clock, and after 1, 2, 4, ... blocks: a disk that is soon full keeps about half of the rows at least.
    const bool doubled = full && (blocks_ & (blocks_ - 1)) == 0;
    if (doubled || is_flush_due())
      flush();
    else if (full)
      guarded([this] { write_block(); });
  }

  void note(Note kind, double t, const std::vector<std::string>& texts) override {
    if (closed_) return;
    Notes& notes = notes_[static_cast<std::size_t>(kind)];
    if (texts.size() != note_kinds()[static_cast<std::size_t>(kind)].columns.size())
      throw std::invalid_argument("Recorder::note: a text for each column");
    if (notes.kept < kMostNotes && notes.left_out == 0) {
      ++notes.kept;
      notes.t.push_back(t);
      for (const std::string& text : texts) notes.texts.push_back(beginning(text));
    } else {
      ++notes.left_out;
    }
    // Lines and some warnings come from the middle of a script, which no failure of the disk may leave.
    if ((kind == Note::phase || kind == Note::event) && is_flush_due()) flush();
  }

  void steps(std::span<const double> numbers, const std::string& worst) override {
    if (closed_) return;
    steps_.insert(steps_.end(), numbers.begin(), numbers.end());
    worst_.push_back(beginning(worst));
  }

  void left_out(Note kind, std::size_t more) override { notes_[static_cast<std::size_t>(kind)].left_out += more; }

  void attach(const std::string& name, const std::string& text) override {
    guarded([&] { file_.write("/attachments/" + name, text); });
  }

  void restart_state(double t, std::span<const double> x) override {
    guarded([&] {
      file_.write("/restart/t", t);
      file_.write("/restart/x", x);
    });
  }

  void checkpoint(double t, const std::string& text) override {
    if (closed_) return;
    checkpoint_times_.push_back(t);
    checkpoints_.push_back(text);
    if (is_flush_due() || checkpoints_.size() == kCheckpointsPerBlock) flush();
  }

  void flush() override {
    if (!begun_) return;  // a run that fails before it has begun has nothing to keep
    guarded([this] { write_all(); });
    last_flush_ = Clock::now();
  }

  void close(std::string_view verdict) override {
    if (closed_) return;
    guarded([&] {
      if (!verdict.empty()) file_.set_attribute("/run", "verdict", std::string(verdict));
      file_.set_attribute("/run", "finished", now_utc());
      write_all();
      file_.close();
    });
    closed_ = true;
  }

 private:
  struct Column {
    std::string path;
    std::size_t width;
  };

  struct Notes {
    std::size_t kept = 0, left_out = 0, told = 0;  // so far; left out as the file has it
    std::vector<double> t;                         // not yet in the file
    std::vector<std::string> texts;
  };

  static std::string notes_path(const NoteKind& kind) { return std::string("/run/") + kind.name; }
  bool is_flush_due() const { return std::chrono::duration<double>(Clock::now() - last_flush_).count() >= flush_period_; }

  /// Datasets in /mode_shapes/0 ... : all that stands before the first row is of bounded size.
  void write_pictures(const std::vector<ModePicture>& pictures) {
    std::vector<std::string> left_out;
    std::size_t n = 0, numbers = 0;
    file_.make_group("/mode_shapes");
    for (const ModePicture& p : pictures) {
      numbers += p.shapes.size();
      if (numbers > kMostPictureNumbers) {
        left_out.insert(left_out.end(), p.bodies.begin(), p.bodies.end());
        continue;
      }
      const std::string path = fmt::format("/mode_shapes/{}", n++);
      const std::size_t points = p.points.size() / 3;
      file_.write(path + "/points", p.points, {points, 3});
      file_.set_attribute(path + "/points", "unit", std::string("m"));
      file_.write(path + "/lines", p.lines, {p.lines.size() / 2, 2});
      file_.write(path + "/frequency", p.frequency);
      file_.set_attribute(path + "/frequency", "unit", std::string("Hz"));
      file_.write(path + "/shapes", p.shapes, {p.frequency.size(), points, 3});
      file_.set_attribute(path + "/shapes", "unit", std::string("m"));
      file_.set_attribute(path, "bodies", p.bodies);
      file_.set_attribute(path, "source", p.source);
    }
    file_.set_attribute("/mode_shapes", "left_out", left_out);
  }

  void write_notes() {
    for (const NoteKind& kind : note_kinds()) {
      Notes& notes = notes_[static_cast<std::size_t>(kind.kind)];
      const std::string path = notes_path(kind);
      if (!notes.t.empty()) {
        file_.append_rows(path + "/t", notes.t);
        file_.append_rows(path + "/text", notes.texts);
        notes.t.clear(), notes.texts.clear();
      }
      if (notes.left_out != notes.told) file_.write(path + "/left_out", static_cast<double>(notes.left_out));
      notes.told = notes.left_out;
    }
  }

  void write_all() {
    write_block();
    write_notes();
    write_steps();
    write_checkpoints();
    Hdf5Rows rows{{"/time", rows_}, {"/channels/", rows_}, {"/run/steps/", intervals_}, {"/restart/checkpoints/", n_checkpoints_}};
    for (const NoteKind& kind : note_kinds()) rows.emplace_back(notes_path(kind) + "/", notes_[static_cast<std::size_t>(kind.kind)].kept);
    file_.flush(rows);
  }

  void write_steps() {
    if (worst_.empty()) return;
    intervals_ += worst_.size();
    file_.append_rows("/run/steps/numbers", steps_);
    file_.append_rows("/run/steps/worst", worst_);
    steps_.clear(), worst_.clear();
  }

  /// After the rows and notes up to them.
  void write_checkpoints() {
    if (checkpoints_.empty()) return;
    n_checkpoints_ += checkpoints_.size();
    file_.append_rows("/restart/checkpoints/t", checkpoint_times_);
    file_.append_rows("/restart/checkpoints/text", checkpoints_);
    checkpoint_times_.clear(), checkpoints_.clear();
  }

  void write_pairs(const std::string& path, const Pairs& pairs) {
    std::vector<std::string> texts;
    for (const auto& [key, value] : pairs) texts.insert(texts.end(), {key, value});
    file_.write(path, texts, {pairs.size(), 2});
  }

  void write_block() {
    if (times_.empty()) return;
    rows_ += times_.size();
    file_.append_rows("/time", times_);
    std::size_t offset = 0;
    for (const auto& [path, width] : columns_) {
      block_.clear();
      for (std::size_t row = 0; row < times_.size(); ++row) {
        const auto first = values_.begin() + static_cast<std::ptrdiff_t>(row * width_ + offset);
        block_.insert(block_.end(), first, first + static_cast<std::ptrdiff_t>(width));
      }
      file_.append_rows(path, block_);
      offset += width;
    }
    times_.clear();
    values_.clear();
  }

  /// What fails for want of space fails once: the time of the run is added, and the file is not touched again.
  template <class F>
  void guarded(F&& write) {
    try {
      write();
    } catch (const NumericsError& error) {
      closed_ = true;
      RunFailure failure = error.failure();
      if (!times_.empty()) failure.t = times_.back();
      throw NumericsError(failure);
    }
  }

  std::string path_;  // the name that the file gets
  Hdf5File file_;
  std::function<void()> ready_;
  double flush_period_;
  Clock::time_point last_flush_;
  std::vector<Column> columns_;
  std::size_t width_ = 0, blocks_ = 0;                        // blocks: that were full
  std::size_t rows_ = 0, intervals_ = 0, n_checkpoints_ = 0;  // in the file
  std::vector<double> times_, values_, block_;                // rows not yet in the file
  std::vector<double> steps_;                                 // of intervals not yet in the file
  std::vector<std::string> worst_;
  std::vector<double> checkpoint_times_;  // of those not yet in the file
  std::vector<std::string> checkpoints_;
  std::array<Notes, 4> notes_;  // by Note
  bool begun_ = false, closed_ = false;
};

}  // namespace

int result_format(const Hdf5File& results) {
  if (!results.has("/run") || !results.has_attribute("/run", "format")) return 1;
  const std::string text = results.text_attribute("/run", "format");
  for (int known = 1; known <= kResultFormat; ++known)
    if (text == std::to_string(known)) return known;
  throw InputError(Diagnostic{Code::bad_result_file,
                              {"/run@format", {results.file_name()}},
                              fmt::format("results of a format up to {}", kResultFormat),
                              fmt::format("format {}", text),
                              "a newer cardan wrote them: use that one"});
}

std::unique_ptr<Recorder> make_hdf5_recorder(const std::string& path, double flush_period, std::function<void()> ready) {
  return std::make_unique<Hdf5Recorder>(path, flush_period, std::move(ready));
}

}  // namespace cardan
