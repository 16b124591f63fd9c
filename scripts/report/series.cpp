#include "scripts/report/series.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include "core/base/diagnostic.hpp"
#include "core/io/hdf5_file.hpp"
#include "core/io/recorder.hpp"
#include "core/io/run_columns.hpp"
#include "scripts/report/attitude.hpp"

namespace cardan {

Json rounded(double value, double largest, double range) {
  if (!std::isfinite(value)) return nullptr;
  const double offset = range > 0.0 ? std::log10(largest / range) : 0.0;
  const int digits = 5 + (offset > 0.0 ? static_cast<int>(std::min(std::ceil(offset), 12.0)) : 0);  // offset: -inf, NaN of odd channels
  const std::string text = fmt::format("{:.{}g}", value, digits);
  double near = value;  // kept where the rounded one is out of range
  std::from_chars(text.data(), text.data() + text.size(), near);
  return near;
}

void bad_content(const Hdf5File& file, const std::string& path, const std::string& expected, const std::string& got) {
  refuse(Code::bad_result_file, {path, {file.file_name()}}, expected, got);
}

namespace {

constexpr double kPageBytes = 1.6e6;                               // for the numbers of all plots
constexpr double kBytesPerNumber = 9;                              // as text, with its comma
constexpr double kFewestPoints = 100;                              // of a plot that is drawn
constexpr std::size_t kStillBytes = 80'000;                        // of the list of what does not move
constexpr double kBytesPerChannel = 300, kBytesPerComponent = 15;  // path, unit, meaning; names

/// How rows become points of a plot: all of them, or the extremes of every `stretch` rows and the last row.
struct Thinning {
  std::size_t rows = 0, stretch = 1;

  Thinning(std::size_t n_rows, std::size_t n_components, double bytes) : rows(n_rows) {
    const double points = std::clamp(bytes / kBytesPerNumber / static_cast<double>(n_components + 1), kFewestPoints, 4000.0);
    if (static_cast<double>(rows) > points) stretch = static_cast<std::size_t>(std::ceil(2.0 * static_cast<double>(rows) / points));
  }
};

Json times(std::span<const double> t, const Thinning& thin) {
  Json out = Json::array();
  const auto put = [&](std::size_t row) { out.push_back(rounded(t[row], std::abs(t[thin.rows - 1]), std::abs(t[thin.rows - 1]) / 1e3)); };
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
  const auto put = [&](std::size_t row) { out.push_back(rounded(at(row), std::max(std::abs(low), std::abs(high)), high - low)); };
  for (std::size_t first = 0; first < thin.rows; first += thin.stretch) {
    const std::size_t end = std::min(first + thin.stretch, thin.rows);
    std::size_t smallest = first, largest = first, missing = end;
    for (std::size_t row = first; row < end; ++row) {
      if (!std::isfinite(at(row))) missing = row;
      if (!(at(row) >= at(smallest))) smallest = row;
      if (!(at(row) <= at(largest))) largest = row;
    }
    if (thin.stretch == 1) {
      put(first);
    } else if (missing < end) {  // a gap stays one, beside the value that is farthest from zero
      put(missing);
      put(std::abs(at(smallest)) > std::abs(at(largest)) ? smallest : largest);
    } else {
      put(std::min(smallest, largest));
      put(std::max(smallest, largest));
    }
  }
  if (thin.stretch > 1) put(thin.rows - 1);
  return out;
}

/// The numbers at `path`: rows of `components` each (0: one number per row, rank 1), at least `rows` of them.
std::vector<double> rows_of(const Hdf5File& file, const std::string& path, std::size_t rows, std::size_t components) {
  const auto data = file.read_doubles(path);
  const bool fits = components == 0 ? data.shape.size() == 1 : data.shape.size() == 2 && data.shape[1] == components;
  if (!fits || data.shape[0] < rows) bad_content(file, path, "as many rows and columns as before", "others");
  return data.values;
}

/// Least and largest value of a component; least > largest if none is finite.
struct Range {
  double least = HUGE_VAL, largest = -HUGE_VAL;
  bool is_whole = true;  // all values are finite
  double magnitude() const { return least > largest ? 0.0 : std::max(std::abs(least), std::abs(largest)); }
};

struct ChannelSize {
  std::string path;   // of its dataset
  std::string group;  // the first folder
  std::size_t components;
  std::vector<std::string> units;  // of each component
  std::vector<Range> ranges;
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

std::vector<Range> ranges_of(std::span<const double> values, std::size_t components, std::size_t rows) {
  std::vector<Range> out(components);
  for (std::size_t row = 0; row < rows; ++row)
    for (std::size_t k = 0; k < components; ++k) {
      const double x = values[row * components + k];
      Range& r = out[k];
      if (std::isfinite(x))
        r.least = std::min(r.least, x), r.largest = std::max(r.largest, x);
      else
        r.is_whole = false;
    }
  return out;
}

/// Balances are looked at in powers of ten, however small they are.
bool is_residual(const ChannelSize& c) { return c.group == "ledger" || c.path.find("residual") != std::string::npos; }

/// The channels in which something moves: by more than rounding does beside the largest value of that unit in their group.
std::vector<bool> moving(const std::vector<ChannelSize>& all) {
  constexpr double kRounding = 1e-13;
  std::map<std::pair<std::string, std::string>, double> scales;
  for (const ChannelSize& c : all)
    for (std::size_t k = 0; k < c.components; ++k) {
      double& scale = scales[{c.group, c.units[k]}];
      scale = std::max(scale, c.ranges[k].magnitude());
    }
  std::vector<bool> out;
  for (const ChannelSize& c : all) {
    bool moves = false;
    for (std::size_t k = 0; k < c.components; ++k) {
      const Range& r = c.ranges[k];
      const double noise = is_residual(c) ? 0.0 : kRounding * scales[{c.group, c.units[k]}];
      moves = moves || r.largest - r.least > noise || (!r.is_whole && r.least <= r.largest);
    }
    out.push_back(moves);
  }
  return out;
}

Json channel(std::string path, std::string unit, std::string frame, std::string meaning, const std::vector<std::string>& components,
             std::span<const double> data, const Thinning& thin) {
  Json values = Json::array();
  for (std::size_t k = 0; k < components.size(); ++k) values.push_back(points(data, components.size(), k, thin));
  return {{"path", std::move(path)},       {"unit", std::move(unit)},  {"frame", std::move(frame)},
          {"meaning", std::move(meaning)}, {"components", components}, {"values", std::move(values)}};
}

/// `from`: what the attitude is seen from, row by row; empty: its first row.
Json angles_channel(const std::string& path, std::span<const double> quaternions, const Thinning& thin, std::span<const double> from = {},
                    const std::string& command = {}) {
  const AttitudeAngles angles = attitude_angles(quaternions, thin.rows, from);
  std::string meaning = fmt::format(
      "from {}: turn, the angle of the rotation (0 to 180 deg); yaw, pitch, roll, its 3-2-1 angles (about z, then the new y, then the "
      "new x), continued beyond 180 deg",
      from.empty() ? "the first attitude" : "the commanded attitude " + command);
  if (angles.jumps > 0)
    meaning += fmt::format(". The lines are broken at {} place{} where an angle goes more than 90 deg from one row to the next",
                           angles.jumps, angles.jumps == 1 ? "" : "s");
  return channel(path + (from.empty() ? " angles" : " off command"), "deg", "", meaning, {"turn", "yaw", "pitch", "roll"}, angles.rows,
                 thin);
}

/// What is not drawn, by group, with the one value that each component has.
void list_still(const Hdf5File& file, const ChannelSize& c, const std::string& name, Json& out, std::size_t& bytes) {
  if (bytes > kStillBytes) {
    ++out["still_left_out"].get_ref<Json::number_integer_t&>();
    return;
  }
  const auto names = file.texts_attribute(c.path, "components");
  Json values = Json::array();
  for (const Range& r : c.ranges) values.push_back(r.least > r.largest ? Json() : rounded(r.least, r.magnitude(), 1e-3 * r.magnitude()));
  const std::string unit = unit_of_channel(c.units);
  bytes += name.size() + unit.size() + 60;
  for (const std::string& component : names) bytes += component.size() + 12;
  out["still"][c.group].push_back({{"path", name}, {"unit", unit}, {"components", names}, {"values", values}});
}

}  // namespace

Json series(const Hdf5File& file) {
  const std::string root = "/channels";
  const auto time = file.shape("/time");
  if (time.size() != 1) bad_content(file, "/time", "one time per row", fmt::format("an array of rank {}", time.size()));
  std::size_t rows = time[0];
  std::vector<ChannelSize> all;
  for (const auto& path : file.datasets(root)) {
    const auto shape = file.shape(path);
    const std::size_t names = file.texts_attribute(path, "components").size();
    if (shape.size() != 2 || shape[1] != names || names == 0)
      bad_content(file, path, fmt::format("rows of {} components, as many as have names", names),
                  shape.size() == 2 ? fmt::format("rows of {}", shape[1]) : fmt::format("an array of rank {}", shape.size()));
    rows = std::min(rows, shape[0]);  // a killed run may have one more row in some
    const std::string name = path.substr(root.size() + 1);
    all.push_back({path,
                   name.find('/') == std::string::npos ? "other" : name.substr(0, name.find('/')),
                   names,
                   units_of_components(file.text_attribute(path, "unit"), names),
                   {}});
  }
  for (ChannelSize& c : all) c.ranges = ranges_of(rows_of(file, c.path, rows, c.components), c.components, rows);

  std::map<std::string, std::vector<std::string>> commanding;  // by an attitude the channels that say where it ought to be
  for (const ChannelSize& c : all)
    if (c.components == 4 && file.has_attribute(c.path, "commands")) commanding[file.text_attribute(c.path, "commands")].push_back(c.path);

  Json out = {{"rows", rows}, {"still", Json::object()}, {"still_left_out", 0}};
  std::vector<ChannelSize> drawn;
  std::size_t still_bytes = 0;
  const std::vector<bool> moves = moving(all);
  for (std::size_t i = 0; i < all.size(); ++i)
    if (moves[i])
      drawn.push_back(all[i]);
    else
      list_still(file, all[i], all[i].path.substr(root.size() + 1), out, still_bytes);

  const std::vector<ChannelSize> shown = chosen(drawn, rows);
  std::size_t components = 0, channels = 0;
  for (const ChannelSize& c : shown) {
    const std::size_t copies =
        is_attitude(file.texts_attribute(c.path, "components")) ? 2 + commanding[c.path.substr(root.size() + 1)].size() : 1;
    components += copies * c.components, channels += copies;
  }
  const double names_bytes = kBytesPerChannel * static_cast<double>(channels) + kBytesPerComponent * static_cast<double>(components);
  const Thinning thin(rows, components, kPageBytes - names_bytes);
  Json left_out = Json::object();
  const auto count = [](const std::vector<ChannelSize>& list, const std::string& group) {
    return std::count_if(list.begin(), list.end(), [&](const ChannelSize& c) { return c.group == group; });
  };
  if (shown.size() < drawn.size())
    for (const ChannelSize& c : drawn)
      if (!left_out.contains(c.group) && count(shown, c.group) < count(drawn, c.group))
        left_out[c.group] = {{"shown", count(shown, c.group)}, {"channels", count(drawn, c.group)}};
  out["channels"] = Json::array();
  for (const ChannelSize& c : shown) {
    const std::string name = c.path.substr(root.size() + 1);
    const auto names = file.texts_attribute(c.path, "components");
    const auto data = rows_of(file, c.path, rows, names.size());
    out["channels"].push_back(channel(name, unit_of_channel(c.units), file.text_attribute(c.path, "frame"),
                                      file.text_attribute(c.path, "meaning"), names, data, thin));
    if (!is_attitude(names)) continue;
    out["channels"].push_back(angles_channel(name, data, thin));
    for (const std::string& command : commanding[name])
      out["channels"].push_back(
          angles_channel(name, data, thin, rows_of(file, command, rows, names.size()), command.substr(root.size() + 1)));
  }
  out["stretch"] = thin.stretch;
  out["t"] = times(rows_of(file, "/time", rows, 0), thin);
  out["left_out"] = left_out;
  return out;
}

}  // namespace cardan
