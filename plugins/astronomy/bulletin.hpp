#pragma once
// What observation tells of the Earth's rotation, day by day: files of the IERS (finals2000A, C04).
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "plugins/astronomy/dates.hpp"

namespace cardan {

/// Polar motion x, y [rad], UT1 - TAI [s] (which no leap second breaks), what adds to the celestial pole X, Y [rad].
struct EarthRotation {
  double x, y, ut1_tai, dX, dY;
};

/// A file of days, at 0 h of UTC each. Between them by the cubic through the four nearest: to 1e-5 s of UT1; tides within a day are
/// left out.
class Bulletin {
 public:
  /// The one that `file` contains: `finals2000A` as the IERS prints it, or CSV, by , or ;, whose first line names the columns mjd, x, y,
  /// ut1_utc and perhaps dX and dY, with their units ([arcsec], _arcsec, [mas]; without one those of the IERS's own CSV files: arcseconds,
  /// seconds, milliarcseconds). Kept for the whole program: the same content is the same bulletin. Null: `fault` tells why.
  static const Bulletin* of(std::string_view file, std::string& fault);

  /// Outside of its days the nearest of them.
  EarthRotation at(const Days& tt) const noexcept;
  bool covers(const Days& tt) const noexcept;

  /// A date, UT1 by this bulletin. Empty: there is no such date.
  std::optional<Epoch> epoch(const char* text) const;
  Days ut1(const Days& tt) const noexcept { return tt.after(at(tt).ut1_tai - 32.184); }

  std::int64_t first() const { return first_; }  // modified Julian days
  std::int64_t last() const { return first_ + static_cast<std::int64_t>(days_.size()) - 1; }

 private:
  bool read(std::string_view file, std::string& fault);
  const char* add(double mjd, EarthRotation day);
  /// Days from the first one.
  double since(const Days& tt) const noexcept;

  std::int64_t first_ = 0;
  std::vector<EarthRotation> days_;
  std::vector<double> tai_utc_;  // [s]
};

}  // namespace cardan
