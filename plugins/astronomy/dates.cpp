#include "plugins/astronomy/dates.hpp"

#include <erfa.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <string_view>

namespace cardan {
namespace {

constexpr double kMjd = 2400000.5, kFirst = 2436934.5, kEnd = 2524958.5;  // [d]: from 1960 to 2200, the day after
constexpr std::array<const char*, 4> kScales = {"UTC", "TAI", "TT", "UT1"};

/// What is read before a scale: a calendar date or a Julian date. Whether there is such a date ERFA says.
struct Read {
  int year = 0, month = 0, day = 0, hour = 0, minute = 0;
  double second = 0.0, jd = 0.0, fraction = 0.0;
  bool julian = false;
};

std::optional<Read> calendar(const char* text, const char** rest) {
  Read r;
  int end = 0;
  if (std::sscanf(text, "%4d-%2d-%2dT%2d:%2d:%lf%n", &r.year, &r.month, &r.day, &r.hour, &r.minute, &r.second, &end) != 6) return {};
  *rest = text + end;
  return r;
}

std::optional<Read> julian(const char* text, const char** rest) {
  Read r;
  r.julian = true;
  const bool modified = text[0] == 'M';
  int end = 0;
  if (std::sscanf(text, modified ? "MJD %lf%n" : "JD %lf%n", &r.jd, &end) != 1) return {};
  *rest = text + end;
  if (int more = 0; std::sscanf(*rest, " + %lf%n", &r.fraction, &more) == 1) *rest += more;
  const double whole = std::floor(r.jd);
  r.fraction += r.jd - whole, r.jd = whole + (modified ? kMjd : 0.0);
  return r;
}

std::optional<TimeScale> scale_of(std::string_view rest) {
  while (!rest.empty() && rest.front() == ' ') rest.remove_prefix(1);
  if (rest.empty() || rest == "Z") return TimeScale::utc;
  for (std::size_t i = 0; i < kScales.size(); ++i)
    if (rest == kScales[i]) return static_cast<TimeScale>(i);
  return {};
}

/// Two parts of a Julian date as Days: whole ends with .5, 0 <= part < 1.
Days days(double jd, double fraction) {
  const double whole = std::floor(jd - 0.5) + 0.5, part = (jd - whole) + fraction, more = std::floor(part);
  return {whole + more - Days::kJ2000, part - more};
}

}  // namespace

std::optional<Days> read_date(const char* text, TimeScale to, double dut1) {
  const char* rest = text;
  const auto read = text[0] == 'J' || text[0] == 'M' ? julian(text, &rest) : calendar(text, &rest);
  const auto scale = read ? scale_of(rest) : std::nullopt;
  if (!scale) return {};
  double a = read->jd, b = read->fraction;
  const char* name = *scale == TimeScale::utc ? "UTC" : "";
  if (!read->julian) {
    const int status = eraDtf2d(name, read->year, read->month, read->day, read->hour, read->minute, read->second, &a, &b);
    if (status < 0 || status > 1) return {};  // 1: so far from the last leap second that some may be missing
  }
  if (!(a + b >= kFirst && a + b < kEnd)) return {};  // before 1960 there is no UTC
  // To TAI and on; TAI to UT1 by way of UTC.
  const auto fits = [](int status) { return status >= 0; };
  double c = a, d = b;
  if (*scale == to) return days(a, b);
  bool good = true;
  if (*scale == TimeScale::ut1) good = fits(eraUt1utc(a, b, dut1, &c, &d)), a = c, b = d;
  if (good && (*scale == TimeScale::ut1 || *scale == TimeScale::utc)) {
    if (to == TimeScale::utc) return days(a, b);
    if (to == TimeScale::ut1) return fits(eraUtcut1(a, b, dut1, &c, &d)) ? std::optional(days(c, d)) : std::nullopt;
    good = fits(eraUtctai(a, b, &c, &d));
  } else if (good && *scale == TimeScale::tt) {
    good = fits(eraTttai(a, b, &c, &d));
  }
  if (!good) return {};
  if (to == TimeScale::tai) return days(c, d);
  if (to == TimeScale::tt) return fits(eraTaitt(c, d, &a, &b)) ? std::optional(days(a, b)) : std::nullopt;
  if (!fits(eraTaiutc(c, d, &a, &b))) return {};
  if (to == TimeScale::utc) return days(a, b);
  return fits(eraUtcut1(a, b, dut1, &c, &d)) ? std::optional(days(c, d)) : std::nullopt;
}

std::optional<double> leap_seconds(int year, int month, int day) {
  double out = 0.0;
  if (year < 1960 || eraDat(year, month, day, 0.0, &out) < 0) return {};
  return out;
}

std::optional<Epoch> Epoch::of(const char* text, double dut1) {
  const auto tt = read_date(text, TimeScale::tt, dut1), ut1 = read_date(text, TimeScale::ut1, dut1);
  if (!tt || !ut1) return {};
  return Epoch{*tt, *ut1};
}

}  // namespace cardan
