#include "scripts/report/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include "core/base/diagnostic.hpp"
#include "core/io/hdf5_file.hpp"
#include "core/io/json.hpp"
#include "core/io/result_folder.hpp"
#include "core/io/summary.hpp"
#include "scripts/report/page.hpp"

namespace cardan {
namespace {

constexpr double kPageBytes = 2.2e6;    // for the numbers of all plots
constexpr double kBytesPerNumber = 9;   // as text, with its comma
constexpr double kFewestPoints = 100;   // of a plot that is drawn
constexpr double kBytesPerChannel = 300, kBytesPerComponent = 15;  // path, unit, meaning; names
constexpr std::size_t kTextBytes = 120'000;                        // of one list or text at the end of the page

/// How rows become points of a plot: all of them, or the extremes of every `stretch` rows and the last row.
struct Thinning {
  std::size_t rows = 0, stretch = 1;

  Thinning(std::size_t n_rows, std::size_t n_components, double bytes) : rows(n_rows) {
    const double points =
        std::clamp(bytes / kBytesPerNumber / static_cast<double>(n_components + 1), kFewestPoints, 4000.0);
    if (static_cast<double>(rows) > points)
      stretch = static_cast<std::size_t>(std::ceil(2.0 * static_cast<double>(rows) / points));
  }
};

/// `value` with so many significant digits that a plot over a range `range` is drawn to 1e-5 of its height.
Json rounded(double value, double largest, double range) {
  if (!std::isfinite(value)) return nullptr;
  const double offset = range > 0.0 ? std::log10(largest / range) : 0.0;
  const int digits = std::clamp(static_cast<int>(std::ceil(offset)) + 5, 5, 17);
  const std::string text = fmt::format("{:.{}g}", value, digits);
  double near = value;  // kept where the rounded one is out of range
  std::from_chars(text.data(), text.data() + text.size(), near);
  return near;
}

Json times(std::span<const double> t, const Thinning& thin) {
  Json out = Json::array();
  const auto put = [&](std::size_t row) {
    out.push_back(rounded(t[row], std::abs(t[thin.rows - 1]), std::abs(t[thin.rows - 1]) / 1e3));
  };
  for (std::size_t row = 0; row < thin.rows; row += thin.stretch) {
    put(row);
    if (thin.stretch > 1) put(std::min(row + thin.stretch / 2, thin.rows - 1));
  }
  if (thin.stretch > 1) put(thin.rows - 1);
  return out;
}

/// One component of a channel at the points of `times`.
Json points(std::span<const double> values, std::size_t components, std::size_t component, const Thinning& thin) {
  const auto at = [&](std::size_t row) { return values[row * components + component]; };
  double low = HUGE_VAL, high = -HUGE_VAL;
  for (std::size_t row = 0; row < thin.rows; ++row)
    if (std::isfinite(at(row))) low = std::min(low, at(row)), high = std::max(high, at(row));
  Json out = Json::array();
  const auto put = [&](std::size_t row) {
    out.push_back(rounded(at(row), std::max(std::abs(low), std::abs(high)), high - low));
  };
  for (std::size_t first = 0; first < thin.rows; first += thin.stretch) {
    std::size_t smallest = first, largest = first;
    for (std::size_t row = first; row < std::min(first + thin.stretch, thin.rows); ++row) {
      if (!(at(row) >= at(smallest))) smallest = row;
      if (!(at(row) <= at(largest))) largest = row;
    }
    put(std::min(smallest, largest));
    if (thin.stretch > 1) put(std::max(smallest, largest));
  }
  if (thin.stretch > 1) put(thin.rows - 1);
  return out;
}

[[noreturn]] void bad(const Hdf5File& file, const std::string& path, const std::string& expected, const std::string& got) {
  throw InputError({Code::bad_result_file, {path, {file.file_name(), 0, 0}}, expected, got, "", "", "", 0});
}

/// The numbers at `path`: rows of `components` each (0: one number per row, rank 1), at least `rows` of them.
std::vector<double> rows_of(const Hdf5File& file, const std::string& path, std::size_t rows, std::size_t components) {
  const auto data = file.read_doubles(path);
  const bool fits = components == 0 ? data.shape.size() == 1 : data.shape.size() == 2 && data.shape[1] == components;
  if (!fits || data.shape[0] < rows) bad(file, path, "as many rows and columns as before", "others");
  return data.values;
}

struct ChannelSize {
  std::string path;
  std::string group;  // the first folder
  std::size_t components;
};

/// The channels that the page has room for: of each group as many as its fair share of the bytes holds, in their order.
std::vector<ChannelSize> chosen(const std::vector<ChannelSize>& all, std::size_t rows) {
  const auto bytes = [&](const ChannelSize& c) {
    const double points = std::min(static_cast<double>(rows), kFewestPoints);
    return kBytesPerChannel + static_cast<double>(c.components) * (kBytesPerComponent + points * kBytesPerNumber);
  };
  std::map<std::string, double> wanted;
  for (const ChannelSize& c : all) wanted[c.group] += bytes(c);
  std::vector<std::pair<double, std::string>> smallest_first;
  for (const auto& [group, size] : wanted) smallest_first.emplace_back(size, group);
  std::sort(smallest_first.begin(), smallest_first.end());
  std::map<std::string, double> left;
  double room = kPageBytes;
  for (std::size_t i = 0; i < smallest_first.size(); ++i) {
    const double share = std::min(smallest_first[i].first, room / static_cast<double>(smallest_first.size() - i));
    left[smallest_first[i].second] = share;
    room -= share;
  }
  std::vector<ChannelSize> out;
  for (const ChannelSize& c : all)
    if (double& room_of_group = left[c.group]; room_of_group >= bytes(c) * (1.0 - 1e-9)) {
      room_of_group -= bytes(c);
      out.push_back(c);
    } else {
      room_of_group = 0.0;  // no gaps: the first ones are shown
    }
  return out;
}

Json series(const Hdf5File& file) {
  const std::string root = "/channels";
  const auto time = file.shape("/time");
  if (time.size() != 1) bad(file, "/time", "one time per row", fmt::format("an array of rank {}", time.size()));
  std::size_t rows = time[0], components = 0;
  std::vector<ChannelSize> all;
  for (const auto& path : file.datasets(root)) {
    const auto shape = file.shape(path);
    const std::size_t names = file.texts_attribute(path, "components").size();
    if (shape.size() != 2 || shape[1] != names || names == 0)
      bad(file, path, fmt::format("rows of {} components, as many as have names", names),
          shape.size() == 2 ? fmt::format("rows of {}", shape[1]) : fmt::format("an array of rank {}", shape.size()));
    rows = std::min(rows, shape[0]);  // a killed run may have one more row in some
    const std::string name = path.substr(root.size() + 1);
    all.push_back({path, name.find('/') == std::string::npos ? "other" : name.substr(0, name.find('/')), names});
  }
  const std::vector<ChannelSize> shown = chosen(all, rows);
  for (const ChannelSize& c : shown) components += c.components;
  const double names_bytes = kBytesPerChannel * static_cast<double>(shown.size()) + kBytesPerComponent * static_cast<double>(components);
  const Thinning thin(rows, components, kPageBytes - names_bytes);
  Json left_out = Json::object();
  const auto count = [](const std::vector<ChannelSize>& list, const std::string& group) {
    return std::count_if(list.begin(), list.end(), [&](const ChannelSize& c) { return c.group == group; });
  };
  if (shown.size() < all.size())
    for (const ChannelSize& c : all)
      if (!left_out.contains(c.group) && count(shown, c.group) < count(all, c.group))
        left_out[c.group] = {{"shown", count(shown, c.group)}, {"channels", count(all, c.group)}};
  Json channels = Json::array();
  for (const auto& [path, group, width] : shown) {
    const auto names = file.texts_attribute(path, "components");
    const auto data = rows_of(file, path, rows, names.size());
    Json values = Json::array();
    for (std::size_t k = 0; k < names.size(); ++k) values.push_back(points(data, names.size(), k, thin));
    channels.push_back({{"path", path.substr(root.size() + 1)},
                        {"unit", file.text_attribute(path, "unit")},
                        {"frame", file.text_attribute(path, "frame")},
                        {"meaning", file.text_attribute(path, "meaning")},
                        {"components", names},
                        {"values", values}});
  }
  return {{"rows", rows},
          {"stretch", thin.stretch},
          {"t", times(rows_of(file, "/time", rows, 0), thin)},
          {"channels", channels},
          {"left_out", left_out}};
}

Json pairs(const Hdf5File& file, const std::string& path) {
  const auto shape = file.shape(path);
  if (shape.size() != 2 || shape[1] != 2) bad(file, path, "two columns", "another shape");
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
    return value.is_array() && (pattern.empty() || std::all_of(value.begin(), value.end(), [&](const Json& item) { return is_like(item, pattern[0]); }));
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
  one.warnings.add(Code::stiff_scene, {}, "");
  const Json pattern = Json::parse(to_json(one));
  const Json summary = Json::parse(file.read_text(path), nullptr, false);
  if (summary.is_discarded() || !is_like(summary, pattern)) bad(file, path, "the text of a summary.json", "something else");
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
  for (const char* key : {"scenario", "title", "program_version", "commit", "compiler", "flags", "sweeps", "sweep_flags", "seed", "until", "integrator",
                          "started", "finished", "verdict"})
    if (file.has_attribute("/run", key)) run[key] = file.text_attribute("/run", key);
  return {{"run", run},
          {"inputs", pairs(file, "/run/inputs")},
          {"plugins", pairs(file, "/run/plugins")},
          {"parameters", pairs(file, "/spec/parameters")},
          {"defaults", pairs(file, "/spec/defaults")},
          {"sweeps", beginning(file.read_text("/spec/sweeps"), "/spec/sweeps")},
          {"spec", beginning(input_texts(file), "/spec/files")},
          {"summary", summary_of(file)},
          {"series", series(file)}};
}

std::string replaced(std::string_view text, std::string_view what, std::string_view with) {
  std::string out;
  for (std::size_t from = 0;;) {
    const auto at = text.find(what, from);
    out += text.substr(from, at - from);
    if (at == std::string_view::npos) return out;
    out += with;
    from = at + what.size();
  }
}

/// The template with its marks (@title@) filled in, in one pass: what is put in is not searched.
std::string filled(std::string_view html, const std::vector<std::pair<std::string_view, std::string>>& parts) {
  std::string out;
  for (const auto& [mark, text] : parts) {
    const auto at = html.find(mark);
    out.append(html.substr(0, at)).append(text);
    html.remove_prefix(at + mark.size());
  }
  return out.append(html);
}

}  // namespace

std::string report_page(const Hdf5File& file) {
  const Json data = page_data(file);
  const std::string title = data["run"].value("title", "");
  return filled(page::html(), {{"@title@", replaced(replaced(title, "&", "&amp;"), "<", "&lt;")},
                               {"@style@", std::string(page::style())},
                               {"@data@", replaced(json_line(data), "<", "\\u003c")},
                               {"@notice@", std::string(page::notice())},
                               {"@script@", replaced(page::script(), "</script", "<\\/script")}});
}

void write_report(const std::string& h5_path, const std::string& html_path) {
  write_report(h5_path, html_path, limits_for_file(h5_path));
}

void write_report(const std::string& h5_path, const std::string& html_path, const ChildLimits& limits) {
  const std::string html = in_bounded_child(h5_path, [&h5_path] { return report_page(Hdf5File::open(h5_path)); }, limits);
  write_whole_file(html_path, html);
}

}  // namespace cardan
