// Layout: docs/results.md.
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <chrono>
#include <set>

#include "core/base/diagnostic.hpp"
#include "core/io/hdf5_file.hpp"
#include "core/io/recorder.hpp"

namespace cardan {
namespace {

constexpr std::size_t kRowsPerBlock = 256;  // rows buffered, and rows per compressed block of the file

using Pairs = std::vector<std::pair<std::string, std::string>>;
using Clock = std::chrono::steady_clock;

std::string now_utc() { return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr))); }

/// Channels are datasets in folders: a path can be neither given twice nor be the folder of another one.
void expect_distinct(const std::vector<Channel>& channels) {
  std::set<std::string> paths;
  for (const auto& c : channels)
    if (!paths.insert(c.path).second)
      throw InputError(
          {Code::duplicate_name, {c.path, {}}, "channel paths that differ", "the same path twice", "", "", "", 0});
  for (const auto& path : paths)
    for (auto end = path.find('/'); end != std::string::npos; end = path.find('/', end + 1))
      if (paths.contains(path.substr(0, end)))
        throw InputError({Code::duplicate_name,
                          {path, {}},
                          "a channel or a folder of channels",
                          "\"" + path.substr(0, end) + "\" is both",
                          "",
                          "",
                          "",
                          0});
}

class Hdf5Recorder final : public Recorder {
 public:
  Hdf5Recorder(const std::string& path, double flush_period)
      : file_(Hdf5File::create(path)), flush_period_(flush_period), last_flush_(Clock::now()) {}

  /// A run that is left without close() keeps its rows, but does not count as finished.
  ~Hdf5Recorder() override {
    try {
      if (!closed_) flush();
    } catch (const std::exception&) {  // nobody is left to tell
    }
  }

  void begin(const RunHeader& header, const std::vector<Channel>& channels) override {
    expect_distinct(channels);
    file_.make_group("/run");
    for (const auto& [key, text] : Pairs{{"scenario", header.scenario},
                                         {"title", header.title},
                                         {"program_version", header.program_version},
                                         {"commit", header.commit},
                                         {"compiler", header.compiler},
                                         {"flags", header.flags},
                                         {"seed", std::to_string(header.seed)},
                                         {"integrator", header.integrator},
                                         {"started", now_utc()}})
      file_.set_attribute("/run", key, text);
    write_pairs("/run/inputs", header.input_hashes);
    write_pairs("/run/plugins", header.plugins);
    file_.write("/spec/text", header.spec_text);
    write_pairs("/spec/parameters", header.effective_parameters);
    write_pairs("/spec/defaults", header.defaults_used);
    file_.write("/spec/sweeps", header.sweep_program);

    file_.make_rows("/time", 0, kRowsPerBlock);
    file_.set_attribute("/time", "unit", std::string("s"));
    file_.make_group("/channels");
    for (const auto& c : channels) {
      const std::string path = "/channels/" + c.path;
      file_.make_rows(path, c.components.size(), kRowsPerBlock);
      file_.set_attribute(path, "unit", c.unit);
      file_.set_attribute(path, "frame", c.frame);
      file_.set_attribute(path, "components", c.components);
      file_.set_attribute(path, "meaning", c.meaning);
      file_.set_attribute(path, "shape", fmt::format("time x {}", c.components.size()));
      columns_.push_back({path, c.components.size()});
      width_ += c.components.size();
    }
    times_.reserve(kRowsPerBlock);
    values_.reserve(kRowsPerBlock * width_);
    flush();
  }

  void row(double t, std::span<const double> values) override {
    if (values.size() != width_)
      throw std::invalid_argument("Recorder::row: a row is as wide as the channels declared");
    times_.push_back(t);
    values_.insert(values_.end(), values.begin(), values.end());
    if (std::chrono::duration<double>(Clock::now() - last_flush_).count() >= flush_period_)
      flush();
    else if (times_.size() == kRowsPerBlock)
      guarded([this] { write_block(); });
  }

  void attach(const std::string& name, const std::string& text) override {
    guarded([&] { file_.write("/attachments/" + name, text); });
  }

  void restart_state(double t, std::span<const double> x) override {
    guarded([&] {
      file_.write("/restart/t", t);
      file_.write("/restart/x", x);
    });
  }

  void flush() override {
    guarded([this] {
      write_block();
      file_.flush();
    });
    last_flush_ = Clock::now();
  }

  void close() override {
    if (closed_) return;
    guarded([this] {
      write_block();
      file_.set_attribute("/run", "finished", now_utc());
      file_.close();
    });
    closed_ = true;
  }

 private:
  struct Column {
    std::string path;
    std::size_t width;
  };

  void write_pairs(const std::string& path, const Pairs& pairs) {
    std::vector<std::string> texts;
    for (const auto& [key, value] : pairs) texts.insert(texts.end(), {key, value});
    file_.write(path, texts, {pairs.size(), 2});
  }

  void write_block() {
    if (times_.empty()) return;
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

  Hdf5File file_;
  double flush_period_;
  Clock::time_point last_flush_;
  std::vector<Column> columns_;
  std::size_t width_ = 0;
  std::vector<double> times_, values_, block_;  // rows not yet in the file
  bool closed_ = false;
};

}  // namespace

std::unique_ptr<Recorder> make_hdf5_recorder(const std::string& path, double flush_period) {
  return std::make_unique<Hdf5Recorder>(path, flush_period);
}

}  // namespace cardan
