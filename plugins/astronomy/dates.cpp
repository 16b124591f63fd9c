#include "plugins/astronomy/dates.hpp"

#include <erfa.h>

#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <iterator>
#include <string_view>

namespace cardan {
namespace {

constexpr double kMjd = 2400000.5, kFirst = 2436934.5, kEnd = 2524958.5;  // [d]: from 1960 to 2200, the day after

/// What is read before a scale: a calendar date or a Julian date. Whether there is such a date ERFA says.
struct Read {
  int year = 0, month = 0, day = 0, hour = 0, minute = 0;
  double second = 0.0, jd = 0.0, fraction = 0.0;
  bool julian = false;
};

/// Whether a text begins as a pattern, in which 0 stands for any digit.
bool begins_as(const char* pattern, const char* text) {
  for (; *pattern != 0; ++pattern, ++text)
    if (*pattern == '0' ? *text < '0' || *text > '9' : *text != *pattern) return false;
  return true;
}

/// ISO 8601, in full: 2026-11-26T12:00:00, with digits of a second behind a point.
std::optional<Read> calendar(const char* text, const char** rest) {
  Read r;
  if (!begins_as("0000-00-00T00:00:00", text)) return {};
  std::sscanf(text, "%4d-%2d-%2dT%2d:%2d", &r.year, &r.month, &r.day, &r.hour, &r.minute);
  const char *seconds = text + 17, *end = seconds + std::strspn(seconds, "0123456789.");
  if (std::from_chars(seconds, end, r.second).ptr != end || end[-1] == '.') return {};
  *rest = end;
  return r;
}

/// What stands behind the number that follows `before` and spaces; null: none does. With a point in any locale.
const char* behind_number(const char* text, std::string_view before, double& number) {
  if (!std::string_view(text).starts_with(before)) return nullptr;
  text += before.size();
  text += std::strspn(text, " ");
  const auto [end, error] = std::from_chars(text, text + std::strlen(text), number);
  return error == std::errc() ? end : nullptr;
}

std::optional<Read> julian(const char* text, const char** rest) {
  Read r;
  r.julian = true;
  const bool modified = text[0] == 'M';
  *rest = behind_number(text, modified ? "MJD" : "JD", r.jd);
  if (!*rest) return {};
  if (const char* more = behind_number(*rest + std::strspn(*rest, " "), "+", r.fraction)) *rest = more;
  const double whole = std::floor(r.jd);
  r.fraction += r.jd - whole, r.jd = whole + (modified ? kMjd : 0.0);
  return r;
}

std::optional<TimeScale> scale_of(std::string_view rest) {
  while (!rest.empty() && rest.front() == ' ') rest.remove_prefix(1);
  if (rest.empty() || rest == "Z") return TimeScale::utc;
  for (std::size_t i = 0; i < std::size(kTimeScales); ++i)
    if (rest == kTimeScales[i]) return static_cast<TimeScale>(i);
  return {};
}

/// A Julian date in two parts, as ERFA has them.
struct Parts {
  double a, b;
};
/// In TAI, and from TAI; UT1 by way of UTC. Empty where ERFA refuses; its warning that leap seconds may be missing is none.
std::optional<Parts> to_tai(const Parts& p, TimeScale scale, double dut1) {
  Parts utc = p, out = p;
  if (scale == TimeScale::ut1 && eraUt1utc(p.a, p.b, dut1, &utc.a, &utc.b) < 0) return {};
  const int status = scale == TimeScale::tai  ? 0
                     : scale == TimeScale::tt ? eraTttai(p.a, p.b, &out.a, &out.b)
                                              : eraUtctai(utc.a, utc.b, &out.a, &out.b);
  return status < 0 ? std::nullopt : std::optional(out);
}
std::optional<Parts> from_tai(const Parts& p, TimeScale scale, double dut1) {
  Parts out = p;
  if (scale == TimeScale::tai) return out;
  const int status = scale == TimeScale::tt ? eraTaitt(p.a, p.b, &out.a, &out.b) : eraTaiutc(p.a, p.b, &out.a, &out.b);
  if (status < 0 || (scale == TimeScale::ut1 && eraUtcut1(out.a, out.b, dut1, &out.a, &out.b) < 0)) return {};
  return out;
}

}  // namespace

std::optional<Days> read_date(const char* text, TimeScale to, double dut1) {
  const char* rest = text;
  const auto read = text[0] == 'J' || text[0] == 'M' ? julian(text, &rest) : calendar(text, &rest);
  const auto scale = read ? scale_of(rest) : std::nullopt;
  if (!scale) return {};
  Parts p{read->jd, read->fraction};
  if (!read->julian) {
    const char* name = *scale == TimeScale::utc ? "UTC" : "";
    const int status = eraDtf2d(name, read->year, read->month, read->day, read->hour, read->minute, read->second, &p.a, &p.b);
    if (status < 0 || status > 1) return {};  // 1: so far from the last leap second that some may be missing
  }
  if (!(p.a + p.b >= kFirst && p.a + p.b < kEnd)) return {};  // before 1960 there is no UTC
  if (*scale != to) {
    const auto tai = to_tai(p, *scale, dut1), converted = tai ? from_tai(*tai, to, dut1) : std::nullopt;
    if (!converted) return {};
    p = *converted;
  }
  const double whole = std::floor(p.a - 0.5) + 0.5, part = (p.a - whole) + p.b, more = std::floor(part);
  return Days{whole + more - Days::kJ2000, part - more};  // whole ends with .5, 0 <= part < 1
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
