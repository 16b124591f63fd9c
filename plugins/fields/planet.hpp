#pragma once
// What fields of planets share: how a planet stands and turns, how high a place is above its ellipsoid.
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <optional>
#include <string_view>

#include "core/abi/field_family.hpp"

namespace cardan {

/// Days from 2000 January 1, 12 h, whole and the rest of one, of "2026-11-26T12:00:00" (a fraction of seconds and Z may follow).
struct Days {
  double whole, part;
  static std::optional<Days> of(const char* text) {
    int year = 0, month = 0, day = 0, hour = 0, minute = 0, end = 0;
    double second = 0.0;
    if (std::sscanf(text, "%4d-%2d-%2dT%2d:%2d:%lf%n", &year, &month, &day, &hour, &minute, &second, &end) != 6) return {};
    if (std::string_view(text + end) != "" && std::string_view(text + end) != "Z") return {};
    const bool leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    const int days[] = {31, leap ? 29 : 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
    if (year < 1900 || year > 2200 || month < 1 || month > 12 || day < 1 || day > days[month - 1] || hour < 0 || hour > 23 || minute < 0 ||
        minute > 59 || !(second >= 0.0) || !(second < 60.0))
      return {};
    const int y = year - (month <= 2), m = month + (month <= 2 ? 12 : 0);                            // a year that begins in March
    const int since = 365 * y + y / 4 - y / 100 + y / 400 + (153 * (m - 3) + 2) / 5 + day - 730426;  // from 2000 January 1
    return Days{since - 0.5, (hour + (minute + second / 60.0) / 60.0) / 24.0};
  }
};

/// The angle by which the Earth has turned at a time of UT1 [rad] (IAU 2000: Capitaine, Guinot, McCarthy 2000).
inline double earth_rotation_angle(const Days& ut1) {
  const double turns = (ut1.whole + ut1.part) * 0.00273781191135448 + 0.7790572732640;
  return 2.0 * std::numbers::pi * std::fmod(turns + std::fmod(ut1.whole, 1.0) + ut1.part, 1.0);
}

/// A planet that turns about its axis at a constant rate: where it is, and its axes at t = 0, columns in world axes: along the prime
/// meridian, east of it, along the axis.
struct TurningPlanet {
  double centre[3], axes[9], rate;  // [m], [rad/s]

  static constexpr cardan_param_desc centre_desc = param::optional("centre", CARDAN_VECTOR, "m", "of the planet, world axes");
  static constexpr cardan_param_desc axis_desc = {
      "axis", CARDAN_UNIT_VECTOR, 0u, "1", "of the planet, to the north, world axes", {0.0, 0.0, 1.0}, 0.0, 0.0, 0, nullptr, nullptr};
  static constexpr cardan_param_desc meridian_desc = {
      "meridian",
      CARDAN_UNIT_VECTOR,
      0u,
      "1",
      "where longitude 0 points at t = 0, world axes; what it has along the axis does not count",
      {1.0, 0.0, 0.0},
      0.0,
      0.0,
      0,
      nullptr,
      nullptr};
  static constexpr cardan_param_desc epoch_desc = param::optional(
      "epoch", CARDAN_TEXT, "1", "UT1 of t = 0, 2026-11-26T12:00:00: longitude 0 of Earth is then its rotation angle ahead of `meridian`");
  static constexpr cardan_param_desc rate_desc =
      param::required("rate", CARDAN_NUMBER, "rad/s", "of the planet about its axis: 7.292115e-5 of Earth, 0 of one that does not turn");

  bool pack(const Params& params) {
    const Eigen::Vector3d c = params.vector("centre"), k = params.vector("axis"), m = params.vector("meridian");
    const Eigen::Vector3d across = m - m.dot(k) * k;
    if (across.norm() < 1e-6) return params.fail("meridian", "a direction that is not along `axis`");
    double ahead = 0.0;
    if (const char* epoch = params.text("epoch")) {
      const auto days = Days::of(epoch);
      if (!days) return params.fail("epoch", "a date and a time of day from 1900 to 2200: 2026-11-26T12:00:00");
      ahead = earth_rotation_angle(*days);
    }
    Eigen::Map<Eigen::Matrix3d> columns(axes);
    columns.col(0) = Eigen::AngleAxisd(ahead, k) * across.normalized(), columns.col(1) = k.cross(columns.col(0)), columns.col(2) = k;
    Eigen::Map<Eigen::Vector3d> to(centre);
    to = c;
    rate = params.number("rate");
    return true;
  }
};

/// The axes of a planet at a time, columns in world axes.
struct PlanetAxes {
  double columns[9];
  static PlanetAxes at(const TurningPlanet& p, double t) noexcept {
    const double c = std::cos(p.rate * t), s = std::sin(p.rate * t);
    PlanetAxes out{};
    for (int i = 0; i < 3; ++i) {
      out.columns[i] = c * p.axes[i] + s * p.axes[3 + i], out.columns[3 + i] = c * p.axes[3 + i] - s * p.axes[i];
      out.columns[6 + i] = p.axes[6 + i];
    }
    return out;
  }
};

/// A sphere, or an ellipsoid about its axis: radius at the equator [m], flattening 1 - (radius at the poles) / radius.
struct Ellipsoid {
  double centre[3], axis[3], radius, flattening;

  static constexpr cardan_param_desc radius_desc = param::in_range(
      param::optional("radius", CARDAN_NUMBER, "m", "of the planet, at its equator; the default is Earth's", 6378.137e3), 1e6, 1e8);
  static constexpr cardan_param_desc flattening_desc = param::in_range(
      param::optional("flattening", CARDAN_NUMBER, "1", "of its ellipsoid: 0 of a sphere, 1/298.257223563 of WGS 84"), 0.0, 0.2);

  void pack(const Params& params) {
    const Eigen::Vector3d c = params.vector("centre"), k = params.vector("axis");
    *this = {{c[0], c[1], c[2]}, {k[0], k[1], k[2]}, params.number("radius"), params.number("flattening")};
  }

  /// Above the ellipsoid, along its normal [m]. The latitude by Bowring (1976), three times: to round-off from far below to far above.
  template <class T>
  T height(const Vec3<T>& place) const noexcept {
    using std::sqrt;
    const Vec3<T> d = place - Vec3<T>{T(centre[0]), T(centre[1]), T(centre[2])}, k{T(axis[0]), T(axis[1]), T(axis[2])};
    const T square = dot(d, d);
    if (flattening == 0.0) return sqrt(square) - T(radius);
    const double polar = radius * (1.0 - flattening), e2 = flattening * (2.0 - flattening), e2_polar = e2 / (1.0 - e2);
    const T z = dot(d, k);
    const Vec3<T> out = d - z * k;
    const T p = sqrt(dot(out, out));
    // Cosine and sine of the reduced latitude, first that of Bowring's first guess.
    T cosine = T(radius) * p, sine = T(polar) * z * (T(1.0) + T(e2_polar * polar) / sqrt(square)), north(0.0), east(1.0);
    for (int i = 0; i < 3; ++i) {
      const T size = T(1.0) / sqrt(cosine * cosine + sine * sine);
      cosine = size * cosine, sine = size * sine;
      const T up = z + T(e2_polar * polar) * sine * sine * sine, over = p - T(e2 * radius) * cosine * cosine * cosine;
      const T whole = T(1.0) / sqrt(up * up + over * over);
      north = whole * up, east = whole * over;
      cosine = east, sine = T(1.0 - flattening) * north;
    }
    const T size = T(1.0) / sqrt(cosine * cosine + sine * sine);
    return (p - T(radius) * size * cosine) * east + (z - T(polar) * size * sine) * north;
  }
};

}  // namespace cardan
