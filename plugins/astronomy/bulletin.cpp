#include "plugins/astronomy/bulletin.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <numbers>
#include <optional>

namespace cardan {
namespace {

constexpr double kArcsecond = std::numbers::pi / 648000.0, kSecond = 1.0 / 86400.0, kTtTai = 32.184;
constexpr double kMjdOfJ2000 = 51544.5;

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t\r\"");
  return begin == std::string_view::npos ? "" : text.substr(begin, text.find_last_not_of(" \t\r\"") + 1 - begin);
}
std::optional<double> number(std::string_view text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  double out = 0.0;
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), out);
  if (error != std::errc() || rest != text.data() + text.size() || !std::isfinite(out)) return {};
  return out;
}

/// What a column holds, by its name in files of the IERS and in ours.
struct Column {
  std::string_view names[3];
  double unit, largest;  // of a number without one: in [rad] or [s]
};
constexpr Column kColumns[] = {{{"mjd"}, 1.0, 1e6},
                               {{"x", "x_pole"}, kArcsecond, 2.0 * kArcsecond},
                               {{"y", "y_pole"}, kArcsecond, 2.0 * kArcsecond},
                               {{"ut1_utc", "ut1-utc"}, 1.0, 1.0},
                               {{"dx"}, 1e-3 * kArcsecond, 0.1 * kArcsecond},
                               {{"dy"}, 1e-3 * kArcsecond, 0.1 * kArcsecond}};
constexpr std::size_t kCount = std::size(kColumns), kNeeded = 4, kUt1 = 3, kNowhere = std::string_view::npos;
constexpr double kFirstDay = 37665.0, kEndDay = 88069.0;  // modified Julian days
template <class T>
using Cells = std::array<T, kCount>;

/// Name and unit of "x [arcsec]", "x_arcsec", "dX_mas", "ut1_utc_s", in small letters; the unit 0 where none is told.
std::pair<std::string, double> name_and_unit(std::string_view head) {
  std::string name(head);
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr std::pair<std::string_view, double> kUnits[] = {
      {"arcsec", kArcsecond}, {"mas", 1e-3 * kArcsecond}, {"ms", 1e-3}, {"rad", 1.0}, {"s", 1.0}};
  for (const auto& [unit, factor] : kUnits)
    for (const std::string& end : {"_" + std::string(unit), " [" + std::string(unit) + "]"})
      if (name.size() > end.size() && name.ends_with(end)) return {name.substr(0, name.size() - end.size()), factor};
  return {name, 0.0};
}

std::vector<std::string_view> split(std::string_view line, char separator) {
  std::vector<std::string_view> out;
  for (std::size_t from = 0; from <= line.size();) {
    const std::size_t to = std::min(line.find(separator, from), line.size());
    out.push_back(trimmed(line.substr(from, to - from)));
    from = to + 1;
  }
  return out;
}

/// Where a line has its columns: CSV, or printed as finals2000A.
struct Layout {
  bool is_known = false;
  char separator = 0;          // of CSV
  Cells<std::size_t> place{};  // number of a column; of a printed one its first letter
  Cells<double> unit{};

  /// By the first line of a file.
  static Layout of(std::string_view line) {
    Layout out{true, line.find(';') != kNowhere ? ';' : line.find(',') != kNowhere ? ',' : '\0', {7, 18, 37, 58, 97, 116}, {}};
    for (std::size_t k = 0; k < kCount; ++k) out.unit[k] = kColumns[k].unit;
    if (out.separator == 0) return out;
    out.place.fill(kNowhere);
    const auto heads = split(line, out.separator);
    for (std::size_t i = 0; i < heads.size(); ++i) {
      const auto [name, told] = name_and_unit(heads[i]);
      for (std::size_t k = 0; k < kCount; ++k) {
        const auto& names = kColumns[k].names;
        if (name.empty() || out.place[k] != kNowhere || std::ranges::find(names, std::string_view(name)) == std::end(names)) continue;
        out.place[k] = i;
        if (told != 0.0) out.unit[k] = told;
      }
    }
    return out;
  }

  Cells<std::string_view> cells(std::string_view line) const {
    constexpr Cells<std::size_t> kWidths = {8, 9, 9, 10, 9, 9};
    Cells<std::string_view> out{};
    const auto all = separator ? split(line, separator) : std::vector<std::string_view>();
    for (std::size_t k = 0; k < kCount; ++k)
      if (separator)
        out[k] = place[k] < all.size() ? all[place[k]] : "";
      else
        out[k] = place[k] < line.size() ? trimmed(line.substr(place[k], kWidths[k])) : "";
    return out;
  }
};

}  // namespace

bool Bulletin::read(std::string_view file, std::string& fault) {
  Layout layout;
  int number_of_line = 0;
  bool over = false;
  if (file.starts_with("\xEF\xBB\xBF")) file.remove_prefix(3);
  while (!file.empty()) {
    const std::size_t end = std::min(file.find('\n'), file.size());
    const std::string_view line = file.substr(0, end);
    file.remove_prefix(std::min(end + 1, file.size()));
    ++number_of_line;
    if (trimmed(line).empty() || line.front() == '#') continue;
    const auto refuse = [&](const std::string& what) {
      fault = what + " in line " + std::to_string(number_of_line);
      return false;
    };
    if (!layout.is_known) {
      layout = Layout::of(line);
      const auto missing = std::ranges::find(layout.place, kNowhere);
      if (const auto k = static_cast<std::size_t>(missing - layout.place.begin()); k < kNeeded)
        return refuse("no column " + std::string(kColumns[k].names[0]));
      if (layout.separator != 0) continue;
    }
    const auto cells = layout.cells(line);
    if (cells[kUt1].empty() && !cells[0].empty() && !days_.empty()) {  // beyond what is predicted there are dates alone
      over = true;
      continue;
    }
    if (over) return refuse("no " + std::string(kColumns[kUt1].names[0]) + " of the day before, but again");
    Cells<double> x{};
    for (std::size_t k = 0; k < kCount; ++k) {
      const auto read = number(cells[k]);
      if (!read && (k < kNeeded || !cells[k].empty()))
        return refuse("\"" + std::string(cells[k]) + "\" for " + std::string(kColumns[k].names[0]));
      x[k] = layout.unit[k] * read.value_or(0.0);
      if (k > 0 && !(std::abs(x[k]) <= kColumns[k].largest)) return refuse("too much for " + std::string(kColumns[k].names[0]));
    }
    if (const char* none = add(x[0], {x[1], x[2], x[kUt1], x[4], x[5]})) return refuse(none);
  }
  if (days_.size() >= 4) return true;
  fault = std::to_string(days_.size()) + " days";
  return false;
}

/// Null, or why it is none. `day.ut1_tai` is UT1 - UTC here.
const char* Bulletin::add(double mjd, EarthRotation day) {
  if (std::floor(mjd) != mjd || (!days_.empty() && mjd != static_cast<double>(last() + 1)))
    return "not the day after the one before, at 0 h:";
  if (!(mjd >= kFirstDay && mjd < kEndDay)) return "not a day from 1962 to 2100:";
  using std::chrono::sys_days, std::chrono::year, std::chrono::year_month_day;
  const year_month_day date(sys_days(year(1858) / 11 / 17) + std::chrono::days(static_cast<int>(mjd)));
  const auto whole = [](auto part) { return static_cast<int>(static_cast<unsigned>(part)); };
  const double tai_utc = *leap_seconds(static_cast<int>(date.year()), whole(date.month()), whole(date.day()));
  if (days_.empty()) first_ = static_cast<std::int64_t>(mjd);
  day.ut1_tai -= tai_utc;
  days_.push_back(day);
  tai_utc_.push_back(tai_utc);
  return nullptr;
}

const Bulletin* Bulletin::of(std::string_view file, std::string& fault) {
  static std::mutex mutex;
  static std::map<std::string, std::unique_ptr<const Bulletin>, std::less<>> kept;
  const std::lock_guard lock(mutex);
  if (const auto at = kept.find(file); at != kept.end()) return at->second.get();
  auto made = std::make_unique<Bulletin>();
  if (!made->read(file, fault)) return nullptr;
  return kept.emplace(std::string(file), std::move(made)).first->second.get();
}

double Bulletin::since(const Days& tt) const noexcept {
  const double days = (tt.whole - (static_cast<double>(first_) - kMjdOfJ2000)) + tt.part;
  const double row = std::clamp(std::floor(days - (kTtTai + tai_utc_.front()) * kSecond), 0.0, static_cast<double>(tai_utc_.size() - 1));
  return days - (kTtTai + tai_utc_[static_cast<std::size_t>(row)]) * kSecond;
}

bool Bulletin::covers(const Days& tt) const noexcept {
  const double days = since(tt);
  return days >= 0.0 && days <= static_cast<double>(days_.size() - 1);
}

EarthRotation Bulletin::at(const Days& tt) const noexcept {
  const double days = std::clamp(since(tt), 0.0, static_cast<double>(days_.size() - 1));
  const std::size_t from = static_cast<std::size_t>(std::clamp(std::floor(days) - 1.0, 0.0, static_cast<double>(days_.size() - 4)));
  const double u = days - static_cast<double>(from);  // 0 to 3, by Lagrange
  const double w[] = {-(u - 1.0) * (u - 2.0) * (u - 3.0) / 6.0, u * (u - 2.0) * (u - 3.0) / 2.0, -u * (u - 1.0) * (u - 3.0) / 2.0,
                      u * (u - 1.0) * (u - 2.0) / 6.0};
  EarthRotation out{};
  for (std::size_t i = 0; i < 4; ++i) {
    const EarthRotation& d = days_[from + i];
    out.x += w[i] * d.x, out.y += w[i] * d.y, out.ut1_tai += w[i] * d.ut1_tai, out.dX += w[i] * d.dX, out.dY += w[i] * d.dY;
  }
  return out;
}

std::optional<Epoch> Bulletin::epoch(const char* text) const {
  double dut1 = 0.0;
  std::optional<Days> tt;
  for (int i = 0; i < 3; ++i) {  // a date of UT1 finds its own dut1
    tt = read_date(text, TimeScale::tt, std::clamp(dut1, -1.0, 1.0));
    if (!tt) return {};
    const double row = std::clamp(std::floor(since(*tt)), 0.0, static_cast<double>(tai_utc_.size() - 1));
    dut1 = at(*tt).ut1_tai + tai_utc_[static_cast<std::size_t>(row)];
  }
  return Epoch{*tt, ut1(*tt)};
}

}  // namespace cardan
