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

/// A scalar of YAML in double quotes.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return out + "\"";
}

/// The text of the golden file with one more entry in `updates`, which stands at its end.
std::string with_update(const Golden& golden, const std::string& why) {
  std::string text = golden.text;
  if (!text.ends_with('\n')) text += '\n';
  const DocNode root = parse_yaml(text, golden.file.string());
  const bool has = root.find("updates") != nullptr;
  if (has && root.keys.back().name != "updates")
    refuse(Code::wrong_type, {"updates", root.find("updates")->mark}, "`updates` as the last key of the file, so that more can be added",
           "keys after it");
  if (!has) text += "updates:\n";
  return text +
         fmt::format("  - program: {}\n    why: {}\n", quoted(fmt::format("{} ({})", version::kNumber, version::kCommit)), quoted(why));
}

}  // namespace

void record_references(const Golden& golden, const std::filesystem::path& folder, const std::string& why) {
  std::map<std::string, std::vector<const GoldenChannel*>> files;
  for (const GoldenChannel& c : golden.channels)
    if (!c.recorded.empty()) files[c.recorded].push_back(&c);
  if (files.empty())
    refuse(Code::command_line, {"--update"}, "a scenario with recorded references", in_quotes(golden.name),
           "truths from elsewhere are edited by hand");
  const RunColumns run = read_run_columns((folder / "run.h5").string());
  for (const auto& [name, channels] : files) {
    RunColumns kept;
    const auto every = static_cast<std::size_t>(channels.front()->every);
    std::vector<std::size_t> rows;
    for (std::size_t row = 0; row < run.times.size(); ++row)
      if (row % every == 0 || row + 1 == run.times.size()) rows.push_back(row), kept.times.push_back(run.times[row]);
    for (const GoldenChannel* c : channels) {
      if (static_cast<std::size_t>(c->every) != every)
        refuse(Code::wrong_type, c->at, fmt::format("the same `every` for all channels in {}", name),
               fmt::format("{} and {}", every, c->every));
      const Column* column = run.find(c->channel);
      std::vector<std::string> all;
      for (const Column& one : run.columns) all.push_back(one.path);
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
    write_packed_columns((golden.folder() / name).string(), kept,
                         {{"why", why}, {"program_version", version::kNumber}, {"commit", version::kCommit}, {"sweeps", run.sweeps}});
  }
  write_whole_file(golden.file, with_update(golden, why));
}

}  // namespace cardan
