// `cardan regress --update`: references that are our own numbers, written anew.
#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "core/base/units.hpp"
#include "core/base/version.hpp"
#include "core/io/result_folder.hpp"
#include "core/io/yaml_reader.hpp"
#include "core/model/schema.hpp"
#include "scripts/regress/runner.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

/// A scalar of YAML in double quotes.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

/// The text of the golden file with one more entry in `updates`, which stands at its end, below the others.
std::string with_update(const Golden& golden, const std::string& why) {
  const auto updates_of = [&](const std::string& text) {
    const DocNode root = parse_yaml(text, golden.file.string()), *found = root.find("updates");
    return found ? *found : DocNode{};
  };
  std::string text = golden.text, indent = "  ";
  if (!text.ends_with('\n')) text += '\n';
  const DocNode old = updates_of(text);
  if (old.items.empty()) {
    text += "updates:\n";
  } else {
    std::size_t line = 0;
    for (int i = 1; i < old.items.back().mark.line; ++i) line = text.find('\n', line) + 1;
    indent = text.substr(line, text.find_first_not_of(' ', line) - line);
  }
  text += fmt::format("{0}- program: {1}\n{0}  why: {2}\n", indent, quoted(fmt::format("{} ({})", version::kNumber, version::kCommit)),
                      quoted(why));
  try {
    if (updates_of(text).items.size() == old.items.size() + 1) return text;
  } catch (const InputError&) {
  }
  refuse(Code::wrong_type, {"updates", old.items.empty() ? SourceMark{golden.file.string()} : old.mark},
         "a list with a dash for each entry as the last key of the file, so that more can be added", "another form");
}

/// The recorded references of a golden file, by their names.
std::map<std::string, std::vector<const GoldenChannel*>> recorded_files(const Golden& golden) {
  std::map<std::string, std::vector<const GoldenChannel*>> out;
  for (const GoldenChannel& c : golden.channels)
    if (!c.recorded.empty()) out[c.recorded].push_back(&c);
  return out;
}

/// Of a run what these channels keep.
RunColumns kept_of(const RunColumns& run, const std::vector<const GoldenChannel*>& channels) {
  RunColumns kept;
  const auto every = static_cast<std::size_t>(channels.front()->every);
  std::vector<std::size_t> rows;
  for (std::size_t row = 0; row < run.times.size(); ++row)
    if (row % every == 0 || row + 1 == run.times.size()) rows.push_back(row), kept.times.push_back(run.times[row]);
  std::vector<std::string> all;
  for (const Column& one : run.columns) all.push_back(one.path);
  for (const GoldenChannel* c : channels) {
    const Column* column = run.find(c->channel);
    if (!column)
      refuse(Code::unknown_name, c->at, "a channel of the run: " + one_of(all), in_quotes(c->channel), did_you_mean(c->channel, all));
    if (kept.find(c->channel)) continue;  // other components of it
    Column part{column->path, column->components, column->units, {}};
    for (const std::size_t row : rows) {
      const auto first = column->values.begin() + static_cast<std::ptrdiff_t>(row * column->components.size());
      part.values.insert(part.values.end(), first, first + static_cast<std::ptrdiff_t>(column->components.size()));
    }
    kept.columns.push_back(std::move(part));
  }
  return kept;
}

/// Files that wait beside those that they will replace. What still waits at the end of the scope is removed.
class Waiting {
 public:
  Waiting() = default;
  Waiting(const Waiting&) = delete;
  Waiting& operator=(const Waiting&) = delete;
  ~Waiting() {
    std::error_code ignored;
    for (const fs::path& file : files_) fs::remove(name_before(file), ignored);
  }
  /// Where to write what will be `file`.
  fs::path before(const fs::path& file) {
    files_.push_back(file);
    return name_before(file);
  }
  void take_names() {
    std::error_code error;
    for (const fs::path& file : files_) {
      fs::rename(name_before(file), file, error);
      if (error) refuse(Code::cannot_write, {{}, {file.string()}}, "a file that can be replaced", error.message());
    }
  }

 private:
  std::vector<fs::path> files_;
};

}  // namespace

void expect_recordable(const Golden& golden, const std::string& why) {
  const auto files = recorded_files(golden);
  if (files.empty())
    refuse(Code::command_line, {"--update"}, "a scenario with recorded references", in_quotes(golden.name),
           "truths from elsewhere are edited by hand");
  for (const auto& [name, channels] : files) {
    const fs::path file = golden.folder() / name;
    if (std::error_code none; !fs::exists(fs::symlink_status(file, none))) continue;
    const RunColumns there = read_run_columns(file.string(), [](const std::string&) { return false; });
    if (there.why.empty() || (!there.golden.empty() && there.golden != golden.file.filename()))
      refuse(Code::cannot_write, {{}, {file.string()}}, "a recorded reference of this golden file, or nothing yet",
             there.why.empty() ? "another file" : "that of " + there.golden, "take it away, or choose another name");
  }
  with_update(golden, why);
}

std::vector<ClaimRow> record_references(Golden& golden, const fs::path& folder, const RunEnding& ending, const std::string& why) {
  if (!ending.as_planned()) return judge(golden, folder, ending);
  try {
    Waiting waiting;
    const RunColumns run = read_run_columns((folder / "run.h5").string());
    for (const auto& [name, channels] : recorded_files(golden))
      write_packed_columns(waiting.before(golden.folder() / name).string(), kept_of(run, channels),
                           {{"why", why},
                            {"golden", golden.file.filename().string()},
                            {"program_version", version::kNumber},
                            {"commit", version::kCommit},
                            {"sweeps", run.sweeps}});
    write_whole_file(waiting.before(golden.file), with_update(golden, why));
    Golden next = read_golden(golden.file, golden.name, Recorded::waiting);
    std::vector<ClaimRow> rows = judge(next, folder, ending);
    if (std::ranges::all_of(rows, &ClaimRow::pass)) {
      if (read_text_file(golden.file.string()) != golden.text)
        refuse(Code::cannot_write, {{}, {golden.file.string()}}, "the golden file as it was before the run", "another text");
      waiting.take_names();
    }
    golden = std::move(next);
    return rows;
  } catch (const InputError& e) {
    return rows_of(e.diagnostics());
  }
}

}  // namespace cardan
