#include "scripts/report/happenings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/io/hdf5_file.hpp"
#include "core/io/recorder.hpp"
#include "scripts/report/series.hpp"

namespace cardan {
namespace {

constexpr std::size_t kNoteBytes = 60'000;       // of one list
constexpr std::size_t kPictureBytes = 350'000;   // of all shapes
constexpr std::size_t kBytesPerShortNumber = 5;  // -1000 and a comma
constexpr std::size_t kMostNames = 200;          // of bodies that are left out
constexpr std::size_t kIntervals = 500;          // of the history of steps
constexpr double kThousand = 1000.0;

Json notes_of(const Hdf5File& file, const NoteKind& kind, Json& left_out) {
  Json out = Json::array();
  const std::string path = std::string("/run/") + kind.name, of_times = path + "/t", of_texts = path + "/text";
  if (!file.has(path)) return out;
  const auto shape = file.shape(of_texts);
  if (shape.size() != 2 || shape[1] != kind.columns.size())
    bad_content(file, of_texts, fmt::format("rows of {} texts", kind.columns.size()), "another shape");
  const auto t = file.read_doubles(of_times);
  if (t.shape.size() != 1) bad_content(file, of_times, "one time for each", "another shape");
  const auto texts = file.read_texts(of_texts);
  const std::size_t rows = std::min(t.values.size(), shape[0]);  // a killed run may have one more in one of them
  std::size_t bytes = 0, row = 0;
  for (; row < rows && bytes < kNoteBytes; ++row) {
    Json one = Json::array({std::isfinite(t.values[row]) ? Json(t.values[row]) : Json()});
    for (std::size_t k = 0; k < kind.columns.size(); ++k) {
      const std::string& text = texts[row * kind.columns.size() + k];
      bytes += text.size() + 10;
      one.push_back(text);
    }
    out.push_back(std::move(one));
  }
  const auto not_recorded = file.read_doubles(path + "/left_out");
  const double more = not_recorded.values.size() == 1 ? not_recorded.values[0] : -1.0;
  if (!(more >= 0.0 && more < 1e15)) bad_content(file, path + "/left_out", "a number of notes", "something else");
  if (const double all = more + static_cast<double>(rows - row); all > 0.0) left_out[kind.name] = all;
  return out;
}

/// The numbers of `path` if they have this shape and are finite.
std::vector<double> numbers_of(const Hdf5File& file, const std::string& path, const std::vector<std::size_t>& shape) {
  if (file.shape(path) != shape) bad_content(file, path, "a shape that fits to the others", "another one");
  std::vector<double> values = file.read_doubles(path).values;
  if (!std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x); }))
    bad_content(file, path, "finite numbers", "others");
  return values;
}

/// In thousandths of `scale`.
Json thousandths(std::span<const double> values, double scale) {
  Json out = Json::array();
  for (const double x : values)
    out.push_back(scale > 0.0 ? static_cast<int>(std::lround(std::clamp(x / scale, -1.0, 1.0) * kThousand)) : 0);
  return out;
}

/// Moves the points to the middle of the box around them; returns the largest of its sides [m].
double centre(std::vector<double>& points) {
  double size = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    double least = HUGE_VAL, largest = -HUGE_VAL;
    for (std::size_t i = k; i < points.size(); i += 3) least = std::min(least, points[i]), largest = std::max(largest, points[i]);
    for (std::size_t i = k; i < points.size(); i += 3) points[i] -= 0.5 * least + 0.5 * largest;
    if (least < largest) size = std::max(size, largest - least);
  }
  return size;
}

}  // namespace

Json happenings(const Hdf5File& file) {
  Json out = Json::object(), left_out = Json::object();
  for (const NoteKind& kind : note_kinds()) out[kind.name] = notes_of(file, kind, left_out);
  out["left_out"] = left_out;
  return out;
}

Json step_history(const Hdf5File& file) {
  Json out = {
      {"t", Json::array()}, {"shortest", Json::array()}, {"longest", Json::array()}, {"order", Json::array()}, {"rejected", Json::array()}};
  const std::string path = "/run/steps/numbers";
  if (!file.has(path)) return out;
  const auto columns = file.texts_attribute(path, "columns");
  const auto numbers = file.read_doubles(path);
  const std::size_t width = columns.size();
  if (numbers.shape.size() != 2 || numbers.shape[1] != width) bad_content(file, path, "a column for each name", "another shape");
  const auto column = [&](const char* name) {
    const auto found = std::ranges::find(columns, name);
    if (found == columns.end()) bad_content(file, path, fmt::format("a column {}", name), "none");
    return static_cast<std::size_t>(found - columns.begin());
  };
  const std::size_t end = column("end"), steps = column("steps"), shortest = column("shortest"), longest = column("longest"),
                    order = column("order"), rows = numbers.shape[0], together = rows / kIntervals + 1;
  for (std::size_t first = 0; first < rows; first += together) {
    double least = HUGE_VAL, most = 0.0, orders = 0.0, all = 0.0, rejected = 0.0, t = 0.0;
    for (std::size_t row = first; row < std::min(rows, first + together); ++row) {
      const double* x = numbers.values.data() + row * width;
      t = x[end];
      if (!std::isfinite(t)) bad_content(file, path, "intervals that end at a finite time", "others");
      all += x[steps], orders += x[order] * x[steps];
      if (x[steps] > 0.0) least = std::min(least, x[shortest]), most = std::max(most, x[longest]);
      for (std::size_t i = 0; i < width; ++i)
        if (columns[i].starts_with("rejected_")) rejected += x[i];
    }
    const auto number = [](double x) { return rounded(x, std::abs(x), std::abs(x)); };
    out["t"].push_back(number(t)), out["rejected"].push_back(number(rejected));
    out["shortest"].push_back(all > 0.0 ? number(least) : Json()), out["longest"].push_back(all > 0.0 ? number(most) : Json());
    out["order"].push_back(all > 0.0 ? number(orders / all) : Json());
  }
  return out;
}

Json mode_shapes(const Hdf5File& file) {
  const std::string root = "/mode_shapes";
  Json pictures = Json::array(), left_out = Json::array();
  std::size_t bytes = 0, modes_left_out = 0;
  if (file.has(root)) {
    const auto leave_out = [&](const std::vector<std::string>& bodies) {
      for (const std::string& body : bodies)
        if (left_out.size() < kMostNames) left_out.push_back(left_out.size() + 1 < kMostNames ? body : "...");
    };
    leave_out(file.texts_attribute(root, "left_out"));
    for (const std::string& member : file.members(root)) {
      const std::string path = root + "/" + member;
      const auto bodies = file.texts_attribute(path, "bodies");
      for (const std::string& body : bodies) bytes += body.size() + 4;
      const auto of_points = file.shape(path + "/points"), of_lines = file.shape(path + "/lines"), of_shapes = file.shape(path + "/shapes");
      if (of_points.size() != 2) bad_content(file, path + "/points", "rows of x, y, z", "another shape");
      if (of_lines.size() != 2) bad_content(file, path + "/lines", "pairs of points", "another shape");
      if (of_shapes.size() != 3) bad_content(file, path + "/shapes", "modes x points x 3", "another shape");
      const std::size_t n = of_points[0], modes = of_shapes[0], stride = 3 * n;
      const auto frequency = numbers_of(file, path + "/frequency", {modes});
      auto points = numbers_of(file, path + "/points", {n, 3});
      const auto shapes = numbers_of(file, path + "/shapes", {modes, n, 3}), lines = numbers_of(file, path + "/lines", {of_lines[0], 2});
      if (!std::all_of(lines.begin(), lines.end(), [&](double i) { return i >= 0.0 && i < static_cast<double>(n); }))
        bad_content(file, path + "/lines", "indices of points", "others");

      const std::size_t fixed = (stride + 2 * of_lines[0]) * kBytesPerShortNumber;
      std::size_t shown = 0;
      if (n > 0 && bytes + fixed < kPictureBytes)
        shown = std::min(modes, (kPictureBytes - bytes - fixed) / (stride * kBytesPerShortNumber));
      if (shown == 0) {
        leave_out(bodies);
        continue;
      }
      bytes += fixed + shown * stride * kBytesPerShortNumber;
      modes_left_out += modes - shown;
      const double size = centre(points);
      Json drawn = Json::array(), at = Json::array(), ends = Json::array();
      for (std::size_t j = 0; j < shown; ++j) {
        const std::span<const double> shape = std::span(shapes).subspan(j * stride, stride);
        double largest = 0.0;
        for (const double x : shape) largest = std::max(largest, std::abs(x));
        drawn.push_back(thousandths(shape, largest));
        at.push_back(rounded(frequency[j], std::abs(frequency[j]), std::abs(frequency[j])));
      }
      for (const double i : lines) ends.push_back(static_cast<int>(i));
      pictures.push_back({{"bodies", bodies},
                          {"source", file.text_attribute(path, "source")},
                          {"size", rounded(size, size, size)},
                          {"frequency", at},
                          {"points", thousandths(points, size)},
                          {"lines", ends},
                          {"shapes", drawn}});
    }
  }
  return {{"pictures", pictures}, {"left_out", left_out}, {"modes_left_out", modes_left_out}};
}

}  // namespace cardan
