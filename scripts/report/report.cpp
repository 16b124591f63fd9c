#include "scripts/report/report.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/diagnostic.hpp"
#include "core/io/hdf5_file.hpp"
#include "core/io/json.hpp"
#include "core/io/recorder.hpp"
#include "core/io/result_folder.hpp"
#include "core/io/summary.hpp"
#include "scripts/report/happenings.hpp"
#include "scripts/report/page.hpp"
#include "scripts/report/series.hpp"

namespace cardan {
namespace {

constexpr std::size_t kTextBytes = 120'000;  // of one list or text at the end of the page

Json pairs(const Hdf5File& file, const std::string& path) {
  const auto shape = file.shape(path);
  if (shape.size() != 2 || shape[1] != 2) bad_content(file, path, "two columns", "another shape");
  const auto texts = file.read_texts(path);
  Json out = Json::array();
  std::size_t bytes = 0, i = 0;
  for (; i + 1 < texts.size() && bytes < kTextBytes; i += 2) {
    out.push_back({texts[i], texts[i + 1]});
    bytes += texts[i].size() + texts[i + 1].size() + 8;
  }
  if (const std::size_t more = (texts.size() - i) / 2; more > 0)
    out.push_back({"...", fmt::format("{} more are in the results file, {}", more, path)});
  return out;
}

/// A text, of a long one the beginning.
std::string beginning(std::string text, const char* path) {
  if (text.size() <= kTextBytes) return text;
  text.resize(text.rfind('\n', kTextBytes) == std::string::npos ? kTextBytes : text.rfind('\n', kTextBytes));
  return text + fmt::format("\n... the whole text is in the results file, {}\n", path);
}

/// Whether the page can show `value` as it shows `pattern`: the same kinds of values under the same names. Keys may be
/// missing, but for a `name`; a number may be null.
bool is_like(const Json& value, const Json& pattern) {
  if (pattern.is_null()) return true;
  if (pattern.is_number()) return value.is_number() || value.is_null();
  if (pattern.is_array())
    return value.is_array() &&
           (pattern.empty() || std::all_of(value.begin(), value.end(), [&](const Json& item) { return is_like(item, pattern[0]); }));
  if (!pattern.is_object()) return value.type() == pattern.type();
  if (!value.is_object() || (pattern.contains("name") && !value.contains("name"))) return false;
  for (const auto& [key, like] : pattern.items())
    if (value.contains(key) && !is_like(value[key], like)) return false;
  return true;
}

Json summary_of(const Hdf5File& file) {
  const std::string path = "/attachments/summary";
  if (!file.has(path)) return nullptr;
  Summary one;  // of each list
  one.checks.emplace_back();
  one.figures.emplace_back();
  one.worst.emplace_back();
  one.ledger.emplace();
  one.warnings.add(Code::stiff_scene, {}, "");
  Json pattern = Json::parse(to_json(one));
  const Json summary = Json::parse(file.read_text(path), nullptr, false);
  if (summary.is_object() && summary.contains("ledger") && summary["ledger"].is_null()) pattern["ledger"] = nullptr;  // without one
  if (summary.is_discarded() || !is_like(summary, pattern)) bad_content(file, path, "the text of a summary.json", "something else");
  return summary;
}

std::string input_texts(const Hdf5File& file) {
  std::string all;
  const auto texts = file.read_texts("/spec/files");
  for (std::size_t i = 0; i + 1 < texts.size(); i += 2)
    all += fmt::format("==> {} <==\n{}{}", texts[i], texts[i + 1], texts[i + 1].ends_with('\n') ? "\n" : "\n\n");
  return all;
}

Json page_data(const Hdf5File& file) {
  Json run = Json::object();
  for (const char* key : {"scenario", "title", "program_version", "commit", "compiler", "flags", "sweeps", "sweep_flags", "seed", "until",
                          "integrator", "started", "finished", "verdict"})
    if (file.has_attribute("/run", key)) run[key] = file.text_attribute("/run", key);
  return {{"run", run},
          {"inputs", pairs(file, "/run/inputs")},
          {"plugins", pairs(file, "/run/plugins")},
          {"parameters", pairs(file, "/spec/parameters")},
          {"defaults", pairs(file, "/spec/defaults")},
          {"sweeps", beginning(file.read_text("/spec/sweeps"), "/spec/sweeps")},
          {"spec", beginning(input_texts(file), "/spec/files")},
          {"summary", summary_of(file)},
          {"notes", happenings(file)},
          {"steps", step_history(file)},
          {"mode_shapes", mode_shapes(file)},
          {"series", series(file)}};
}

}  // namespace

std::string report_page(const Hdf5File& file) {
  result_format(file);  // refuses what it does not know
  const Json data = page_data(file);
  const std::string title = data["run"].value("title", "");
  return page::filled(title, data, page::script());
}

void write_report(const std::string& h5_path, const std::string& html_path) { write_report(h5_path, html_path, limits_for_file(h5_path)); }

void write_report(const std::string& h5_path, const std::string& html_path, const ChildLimits& limits) {
  const std::string html = in_bounded_child(
      h5_path, [&h5_path] { return report_page(Hdf5File::open(h5_path)); }, limits);
  write_whole_file(html_path, html);
}

}  // namespace cardan
