#include "scripts/report/figure.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <sstream>

#include "core/base/diagnostic.hpp"
#include "core/base/utf8.hpp"
#include "core/io/bounded_child.hpp"
#include "core/io/hdf5_file.hpp"
#include "core/io/recorder.hpp"
#include "core/io/result_folder.hpp"
#include "core/io/run_columns.hpp"
#include "scripts/report/series.hpp"

namespace cardan {
namespace {

// In points (1/72 inch) of the figure.
constexpr double kWidth = 720, kLeft = 76, kRight = 12, kTop = 30, kPanel = 150, kBetween = 34, kBottom = 40;
constexpr double kTolerance = 0.1;       // of a line
constexpr std::size_t kStretches = 640;  // one for each point of width: rows within one are drawn by their extremes
constexpr std::array kColours = {"#2f6db3", "#b53d2a", "#2a7d5f", "#8a5fb5", "#c0841f", "#4b5563"};

struct Line {
  std::string name, unit;
  std::vector<double> values;
};

struct Point {
  double x, y;
};

/// Not a NaN, not infinite, and so far from it that differences are neither.
bool is_drawn(double x) { return std::abs(x) < 1e300; }

std::vector<Line> lines_of(const Hdf5File& file, const std::string& name, std::size_t& rows) {
  std::vector<std::string> channels;
  for (const std::string& one : file.datasets("/channels")) channels.push_back(one.substr(10));
  const auto components_of = [&](const std::string& channel) { return file.texts_attribute("/channels/" + channel, "components"); };
  const auto [channel, places] = part_of_channel(name, channels, components_of, file.file_name());
  const std::string path = "/channels/" + channel;
  const auto components = components_of(channel);
  const auto data = file.read_doubles(path);
  if (data.shape.size() != 2 || data.shape[1] != components.size())
    bad_content(file, path, "as many columns as components have names", "others");
  rows = std::min(rows, data.shape[0]);
  const auto units = units_of_components(file.text_attribute(path, "unit"), components.size());
  std::vector<Line> out;
  for (const std::size_t k : places) {
    Line line{components.size() == 1 ? channel : channel + "." + components[k], units[k], {}};
    for (std::size_t row = 0; row < data.shape[0]; ++row) line.values.push_back(data.values[row * components.size() + k]);
    out.push_back(std::move(line));
  }
  return out;
}

/// What of a line is needed to draw it to kTolerance [Douglas, Peucker 1973], with the height in place of the distance.
void simplify(std::span<const Point> points, std::vector<Point>& out) {
  std::size_t farthest = 0;
  double most = kTolerance;
  const Point a = points.front(), b = points.back();
  for (std::size_t i = 1; i + 1 < points.size(); ++i)
    if (const double off = std::abs(points[i].y - (a.y + (b.y - a.y) * (points[i].x - a.x) / (b.x - a.x))); off > most)
      most = off, farthest = i;
  if (farthest > 0) {
    simplify(points.first(farthest + 1), out);
    simplify(points.subspan(farthest), out);
  } else {
    out.push_back(b);
  }
}

std::string path_of(std::span<const Point> points) {
  std::vector<Point> kept{points.front()};
  if (points.size() > 1) simplify(points, kept);
  std::string out;
  for (const Point& p : kept)
    out += fmt::format("{}{:.6g} {:.6g}", out.empty() ? "M" : "L", std::round(p.x * 10) / 10, std::round(p.y * 10) / 10);
  return out;
}

/// An axis from `low` to `high` with marks at whole multiples of 1, 2 or 5 times a power of ten, about `marks` of them.
struct Axis {
  double low, high, step;
  Axis(double from, double to, int marks) : low(from), high(to) {
    const double least = std::max(1e-300, 1e-9 * std::max(std::abs(low), std::abs(high)));  // what does not move is drawn flat
    if (high - low < least) low -= 1e8 * least, high += 1e8 * least;
    const double rough = (high - low) / marks, power = std::pow(10.0, std::floor(std::log10(rough)));
    step = power * (rough > 5 * power ? 10 : rough > 2 * power ? 5 : rough > power ? 2 : 1);
  }
  template <class F>
  void each(F&& see) const {
    const double largest = std::max(std::abs(low), std::abs(high));
    const int digits = std::clamp(1 + static_cast<int>(std::floor(std::log10(largest)) - std::floor(std::log10(step))), 5, 15);
    for (double k = std::ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k)
      see(k * step, fmt::format("{:.{}g}", k * step + 0.0, digits));
  }
};

std::string panel(const std::vector<double>& t, const Axis& x, double top, const std::vector<Line>& lines, bool is_last) {
  double low = HUGE_VAL, high = -HUGE_VAL;
  for (const Line& line : lines)
    for (std::size_t row = 0; row < t.size(); ++row)
      if (const double y = line.values[row]; is_drawn(y)) low = std::min(low, y), high = std::max(high, y);
  if (low > high) low = high = 0.0;
  std::vector<std::string> units;
  for (const Line& line : lines)
    if (std::ranges::find(units, line.unit) == units.end()) units.push_back(line.unit);
  const double room = high > low ? 0.05 * (high - low) : high != 0.0 ? 0.0 : 1.0;
  const Axis y(low - room, high + room, 5);
  const double right = kWidth - kRight, bottom = top + kPanel;
  const auto across = [&](double value) { return kLeft + (value - x.low) / (x.high - x.low) * (right - kLeft); };
  const auto down = [&](double value) { return bottom - (value - y.low) / (y.high - y.low) * kPanel; };

  std::string out = fmt::format(R"(<g font-size="11" fill="#69717c">)"
                                "\n");
  const auto rule = [&](double x1, double y1, double x2, double y2) {
    out += fmt::format(R"(<path d="M{:.1f} {:.1f}L{:.1f} {:.1f}" stroke="#e2e3e0"/>)"
                       "\n",
                       x1, y1, x2, y2);
  };
  y.each([&](double value, const std::string& text) {
    rule(kLeft, down(value), right, down(value));
    out += fmt::format(R"(<text x="{}" y="{:.1f}" text-anchor="end">{}</text>)"
                       "\n",
                       kLeft - 6, down(value) + 4, text);
  });
  x.each([&](double value, const std::string& text) {
    rule(across(value), top, across(value), bottom);
    if (is_last)
      out += fmt::format(R"(<text x="{:.1f}" y="{:.1f}" text-anchor="middle">{}</text>)"
                         "\n",
                         across(value), bottom + 16, text);
  });
  out += fmt::format(R"x(<text x="16" y="{0}" text-anchor="middle" transform="rotate(-90 16 {0})">{1}</text>)x"
                     "\n",
                     top + kPanel / 2, xml_text(fmt::format("{}", fmt::join(units, ", "))));
  if (is_last)
    out += fmt::format(R"(<text x="{}" y="{}" text-anchor="middle">t [s]</text>)"
                       "\n",
                       (kLeft + right) / 2, bottom + 32);
  out += "</g>\n";

  std::string names;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const char* colour = kColours[i % kColours.size()];
    const char* dash = i < kColours.size() ? "" : R"( stroke-dasharray="5 3")";
    const std::vector<double>& values = lines[i].values;
    std::string d;
    std::vector<Point> piece;
    const auto end_piece = [&] {
      if (!piece.empty()) d += path_of(piece);
      piece.clear();
    };
    const std::size_t stretch = t.size() / kStretches + 1;
    for (std::size_t first = 0; first < t.size(); first += stretch) {
      const std::size_t end = std::min(first + stretch, t.size());
      std::size_t least = first, most = first, missing = end;
      for (std::size_t row = first; row < end; ++row) {
        if (!is_drawn(values[row])) missing = row;
        if (!(values[row] >= values[least])) least = row;
        if (!(values[row] <= values[most])) most = row;
      }
      if (missing < end) {
        end_piece();
        continue;
      }
      for (const std::size_t row : {std::min(least, most), std::max(least, most)})
        if (piece.empty() || across(t[row]) > piece.back().x) piece.push_back({across(t[row]), down(values[row])});
    }
    if (const std::size_t last = t.size() - 1; !piece.empty() && across(t[last]) > piece.back().x && is_drawn(values[last]))
      piece.push_back({across(t[last]), down(values[last])});
    end_piece();
    out += fmt::format(R"(<path d="{}" fill="none" stroke="{}"{}/>)"
                       "\n",
                       d, colour, dash);
    names += fmt::format(R"(<tspan dx="{}" fill="{}">{}</tspan>)", i > 0 ? 14 : 0, colour, xml_text(lines[i].name));
  }
  return out + fmt::format(R"(<text x="{}" y="{}" font-size="11">{}</text>)"
                           "\n",
                           kLeft, top - 6, names);
}

}  // namespace

std::string figure_svg(const Hdf5File& file, const std::vector<std::string>& plots) {
  result_format(file);  // refuses what it does not know
  std::vector<double> t = file.read_doubles("/time").values;
  std::size_t rows = t.size();
  std::vector<std::vector<Line>> lines;
  for (const std::string& plot : plots) {
    std::istringstream names(plot);
    lines.emplace_back();
    for (std::string name; std::getline(names, name, ',');)
      for (Line& line : lines_of(file, name, rows)) lines.back().push_back(std::move(line));
    if (lines.back().empty()) lines_of(file, plot, rows);  // refuses
  }
  t.resize(rows);  // a killed run may have one more row in some
  if (rows == 0 || !std::all_of(t.begin(), t.end(), is_drawn) || !std::is_sorted(t.begin(), t.end()))
    bad_content(file, "/time", "times, ascending, at least one", "others");
  const Axis x(t.front(), t.back() > t.front() ? t.back() : t.front() + 1.0, 8);
  const double height = kTop + static_cast<double>(lines.size()) * (kPanel + kBetween) + kBottom - 8;
  std::string out =
      fmt::format(R"(<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0} {1}" width="{0}" height="{1}" font-family="sans-serif">)"
                  "\n"
                  R"(<rect width="{0}" height="{1}" fill="#fff"/>)"
                  "\n"
                  R"(<text x="{2}" y="20" font-size="13" fill="#22262b">{3}</text>)"
                  "\n",
                  kWidth, height, kLeft, xml_text(file.has_attribute("/run", "title") ? file.text_attribute("/run", "title") : ""));
  for (std::size_t i = 0; i < lines.size(); ++i)
    out += panel(t, x, kTop + kBetween - 8 + static_cast<double>(i) * (kPanel + kBetween), lines[i], i + 1 == lines.size());
  return out + "</svg>\n";
}

void write_figure(const std::string& h5_path, const std::string& svg_path, const std::vector<std::string>& plots) {
  write_whole_file(svg_path, in_bounded_child(
                                 h5_path, [&] { return figure_svg(Hdf5File::open(h5_path), plots); }, limits_for_file(h5_path)));
}

}  // namespace cardan
