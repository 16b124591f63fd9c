// Comma-separated text: "# " lines about the run, one line of column names with units, then the rows.
#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <sstream>

#include "core/base/diagnostic.hpp"
#include "core/io/recorder.hpp"
#include "core/io/run_columns.hpp"

namespace cardan {
namespace {

class TextRecorder final : public Recorder {
 public:
  explicit TextRecorder(const std::string& path) : path_(path), out_(path == "-" ? stdout : std::fopen(path.c_str(), "w")) {
    if (!out_)
      refuse(Code::cannot_write, {"", {path}}, "a file that can be written", std::strerror(errno),
             "is the folder there, and may it be written to?");
  }

  ~TextRecorder() override {
    if (out_ && out_ != stdout) std::fclose(out_);
  }

  void begin(const RunHeader& header, const std::vector<Channel>& channels) override {
    comment("scenario", header.scenario);
    comment("version", header.program_version + " " + header.commit);
    comment("seed", std::to_string(header.seed));
    std::string names = "t [s]";
    for (const auto& c : channels) {
      const auto units = units_of_components(c.unit, c.components.size());
      for (std::size_t k = 0; k < units.size(); ++k) names += fmt::format(",{}.{} [{}]", c.path, c.components[k], units[k]);
    }
    put(names + "\n");
  }

  void row(double t, std::span<const double> values) override {
    line_.clear();
    fmt::format_to(std::back_inserter(line_), "{}", t);
    for (const double value : values) fmt::format_to(std::back_inserter(line_), ",{}", value);  // shortest exact digits
    line_ += '\n';
    t_ = t;
    put(line_);
  }

  void attach(const std::string& name, const std::string& text) override { comment(name, text); }
  void restart_state(double, std::span<const double>) override {}  // the text holds rows alone

  void flush() override {
    if (std::fflush(out_) != 0) fail();
  }

  void close(std::string_view) override { flush(); }

 private:
  void comment(const std::string& name, const std::string& text) {
    std::istringstream lines(name + ": " + text);
    for (std::string line; std::getline(lines, line);) put("# " + line + "\n");
  }

  void put(const std::string& text) {
    if (std::fputs(text.c_str(), out_) < 0) fail();
  }

  [[noreturn]] void fail() const {
    throw NumericsError({Code::disk_full, t_, "", "", path_ + ": " + std::strerror(errno), "free space, or write to another disk", ""});
  }

  std::string path_, line_;
  std::FILE* out_;
  double t_ = 0.0;
};

}  // namespace

std::unique_ptr<Recorder> make_text_recorder(const std::string& path) { return std::make_unique<TextRecorder>(path); }

}  // namespace cardan
