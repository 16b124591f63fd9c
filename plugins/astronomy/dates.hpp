#pragma once
// Dates in the scales of time that astronomy counts in. By ERFA (the library of the IAU's standards).
#include <optional>

namespace cardan {

/// Days from 2000 January 1, 12 h, whole and the rest of one: to nanoseconds.
struct Days {
  static constexpr double kJ2000 = 2451545.0;  // Julian date of 0
  double whole, part;
  Days after(double seconds) const { return {whole, part + seconds / 86400.0}; }
};

enum class TimeScale { utc, tai, tt, ut1 };
inline constexpr const char* kTimeScales[] = {"UTC", "TAI", "TT", "UT1"};

/// A date in a scale: "2026-11-26T12:00:00 TT", "JD 2453750.5 + 0.892 UTC", "MJD 53736.25 UT1"; without a scale it is of UTC,
/// whose leap seconds are those that ERFA knows. From 1960, with which UTC begins, to 2200. dut1 = UT1 - UTC [s], as the IERS tells it.
/// Empty: it is none of these.
std::optional<Days> read_date(const char* text, TimeScale to, double dut1);

/// TAI - UTC [s] on a day of UTC; empty where ERFA knows none.
std::optional<double> leap_seconds(int year, int month, int day);

/// A time in the two scales that count: TT, which runs on as t of a run does, and UT1, by which the Earth turns.
struct Epoch {
  Days tt, ut1;
  static std::optional<Epoch> of(const char* text, double dut1);
};

}  // namespace cardan
