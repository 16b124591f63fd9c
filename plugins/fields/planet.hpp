#pragma once
// What fields of planets share: how a planet stands and turns, how high a place is above its ellipsoid.
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>

#include "core/abi/field_family.hpp"
#include "plugins/astronomy/bulletin.hpp"
#include "plugins/astronomy/dates.hpp"
#include "plugins/astronomy/earth.hpp"
#include "plugins/astronomy/planets.hpp"
#include "plugins/fields/geodetic.hpp"

namespace cardan {

/// How a planet stands. It turns about its axis at a constant rate: its axes at t = 0, columns in world axes: along the prime meridian,
/// east of it, along the axis. Or it is the Earth or another body as the IAU has it, in axes of the GCRS.
struct PlanetTurn {
  enum Orientation : std::int64_t { mean, iau2006, moon_principal, of_body };  // of_body + i: of the i-th body but the Earth

  double axes[9], rate;      // [rad/s]
  std::int64_t orientation;  // but for `mean`, `epoch` and `pole` tell the axes
  Epoch epoch;
  double pole[2];            // polar motion x, y [rad]
  const Bulletin* bulletin;  // which in place of it and of UT1 tells how the Earth stands; lives for the whole program

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
      "epoch", CARDAN_TEXT, "1",
      "date of t = 0, 2026-11-26T12:00:00 UTC (or UT1, TT, TAI): longitude 0 of Earth is then its rotation angle ahead of `meridian`");
  static constexpr cardan_param_desc dut1_desc = param::in_range(
      param::optional("dut1", CARDAN_NUMBER, "s", "UT1 - UTC at `epoch`, as the IERS tells it; t goes on as UT1 does"), -1.0, 1.0);
  static constexpr const char* kOrientations[] = {"mean",  "iau2006", "moon_principal", "sun",    "moon",   "mercury",
                                                  "venus", "mars",    "jupiter",        "saturn", "uranus", "neptune"};
  static constexpr cardan_param_desc orientation_desc = param::named(
      param::optional("orientation", CARDAN_CHOICE, "1",
                      "mean: by `axis`, `meridian` and `rate`; at `epoch` and on, where world axes are those of the GCRS, iau2006: of "
                      "Earth with precession, nutation and polar motion; moon, mars and so on: of that body by the IAU's report of 2015, "
                      "moon_principal: of the Moon, in its principal axes"),
      kOrientations);
  static constexpr cardan_param_desc pole_x_desc = param::in_range(
      param::optional("pole_x", CARDAN_NUMBER, "rad", "polar motion: of the axis from the third axis of the planet, along its first"),
      -1e-4, 1e-4);
  static constexpr cardan_param_desc pole_y_desc = param::in_range(
      param::optional("pole_y", CARDAN_NUMBER, "rad", "polar motion: the same along its second, taken to the other side"), -1e-4, 1e-4);
  static constexpr cardan_param_desc bulletin_desc = param::optional("bulletin", CARDAN_FILE, "1",
                                                                     "in place of `dut1`, `pole_x`, `pole_y`, with orientation: iau2006: "
                                                                     "their days by a file of the IERS, finals2000A as it is printed or "
                                                                     "CSV with the columns mjd, x, y, ut1_utc and perhaps dX, dY");
  static constexpr cardan_limit_desc bulletin_limit = {"bulletin", 1, "outside of the days of `bulletin`"};
  static constexpr cardan_param_desc rate_desc =
      param::required("rate", CARDAN_NUMBER, "rad/s", "of the planet about its axis: 7.292115e-5 of Earth, 0 of one that does not turn");

  static constexpr double kEarthRate = 7.292115e-5;  // [rad/s]
  static constexpr const char* kDateExpected = "a date of UTC, UT1, TT or TAI from 1960 to 2200: 2026-11-26T12:00:00 UTC";

  /// By the keys above; `rate_key`: of its rate.
  bool pack(const Params& params, const char* rate_key = "rate") {
    const Eigen::Vector3d k = params.vector("axis"), m = params.vector("meridian");
    const Eigen::Vector3d across = m - m.dot(k) * k;
    if (across.norm() < 1e-6) return params.fail("meridian", "a direction that is not along `axis`");
    double ahead = 0.0;
    orientation = params.choice("orientation");
    const char* name = kOrientations[orientation];
    pole[0] = params.number("pole_x"), pole[1] = params.number("pole_y");
    bulletin = nullptr;
    if (params.text("bulletin")) {
      if (orientation != iau2006) return params.fail("bulletin", "orientation: iau2006, that of the Earth", name);
      if (pole[0] != 0.0 || pole[1] != 0.0 || params.number("dut1") != 0.0)
        return params.fail(pole[0] != 0.0 ? "pole_x" : pole[1] != 0.0 ? "pole_y" : "dut1", "none: `bulletin` tells it");
      std::string fault;
      bulletin = Bulletin::of(params.bytes("bulletin"), fault);
      if (!bulletin)
        return params.fail(
            "bulletin", "finals2000A of the IERS, or CSV with the columns mjd, x, y, ut1_utc, of at least four days, one after the other",
            fault.c_str());
    }
    if (const char* text = params.text("epoch")) {
      const auto read = bulletin ? bulletin->epoch(text) : Epoch::of(text, params.number("dut1"));
      if (!read) return params.fail("epoch", kDateExpected);
      epoch = *read;
      ahead = earth_rotation_angle(epoch.ut1);
    } else if (orientation != mean) {
      return params.fail("epoch", kDateExpected, (std::string("none, and orientation: ") + name).c_str());
    } else if (params.number("dut1") != 0.0) {
      return params.fail("dut1", "`epoch` beside it: UT1 - UTC is that of a date");
    }
    if (orientation != mean) {
      if (k != Eigen::Vector3d::UnitZ() || m != Eigen::Vector3d::UnitX())
        return params.fail("orientation", "mean", nullptr, (std::string(name) + " has an axis and a meridian of its own").c_str());
      const double turns = orientation == iau2006 ? kEarthRate : rotation_rate(body());
      if (!(std::abs(params.number(rate_key) - turns) < 1e-6 * std::abs(turns))) {
        char expected[100];
        std::snprintf(expected, sizeof expected, "%.7g rad/s, that of %s, whose orientation is %s", turns,
                      orientation == iau2006          ? "Earth"
                      : orientation == moon_principal ? "the Moon"
                                                      : "the body",
                      name);
        return params.fail(rate_key, expected);
      }
    }
    if (orientation > iau2006 && (pole[0] != 0.0 || pole[1] != 0.0 || params.number("dut1") != 0.0))
      return params.fail(pole[0] != 0.0 ? "pole_x" : pole[1] != 0.0 ? "pole_y" : "dut1", "0: only the Earth has it");
    Eigen::Map<Eigen::Matrix3d> columns(axes);
    columns.col(0) = Eigen::AngleAxisd(ahead, k) * across.normalized(), columns.col(1) = k.cross(columns.col(0)), columns.col(2) = k;
    rate = params.number(rate_key);
    return true;
  }

  /// False where its bulletin ends; there it stands as on the nearest of its days.
  bool is_known(double t) const noexcept { return !bulletin || bulletin->covers(epoch.tt.after(t)); }

  /// Which body it is, with an orientation beyond iau2006.
  Celestial body() const noexcept {
    if (orientation == moon_principal) return Celestial::moon;
    const std::int64_t i = orientation - of_body;  // those before the Earth are 0 to 3
    return static_cast<Celestial>(i < static_cast<std::int64_t>(Celestial::earth) ? i : i + 1);
  }
};

/// A planet that turns, and where it is.
struct TurningPlanet : PlanetTurn {
  double centre[3];  // [m] world axes

  static constexpr cardan_param_desc centre_desc = param::optional("centre", CARDAN_VECTOR, "m", "of the planet, world axes");

  bool pack(const Params& params, const char* rate_key = "rate") {
    Eigen::Map<Eigen::Vector3d>{centre} = params.vector("centre");
    return PlanetTurn::pack(params, rate_key);
  }
};

/// The axes of a planet at a time, columns in world axes.
struct PlanetAxes {
  double columns[9];
  static PlanetAxes at(const PlanetTurn& p, double t) noexcept {
    PlanetAxes out{};
    if (p.orientation != PlanetTurn::mean) {
      const Days tt = p.epoch.tt.after(t);
      const auto earth = [&] {
        if (!p.bulletin) return earth_axes(tt, p.epoch.ut1.after(t), p.pole[0], p.pole[1]);
        const EarthRotation now = p.bulletin->at(tt);
        return earth_axes(tt, p.bulletin->ut1(tt), now.x, now.y, now.dX, now.dY);
      };
      std::ranges::copy(p.orientation == PlanetTurn::iau2006          ? earth()
                        : p.orientation == PlanetTurn::moon_principal ? principal_axes_of_moon(tt)
                                                                      : planet_axes(p.body(), tt),
                        out.columns);
      return out;
    }
    const double c = std::cos(p.rate * t), s = std::sin(p.rate * t);
    for (int i = 0; i < 3; ++i) {
      out.columns[i] = c * p.axes[i] + s * p.axes[3 + i], out.columns[3 + i] = c * p.axes[3 + i] - s * p.axes[i];
      out.columns[6 + i] = p.axes[6 + i];
    }
    if (p.pole[0] != 0.0 || p.pole[1] != 0.0) move_pole(p.pole[0], p.pole[1], 0.0, out.columns);
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
    place(params);
    radius = params.number("radius"), flattening = params.number("flattening");
  }
  /// Of which no height is asked.
  void place(const Params& params) {
    const Eigen::Vector3d c = params.vector("centre"), k = params.vector("axis");
    *this = {{c[0], c[1], c[2]}, {k[0], k[1], k[2]}, 0.0, 0.0};
  }

  /// Above the ellipsoid, along its normal [m].
  template <class T>
  T height(const Vec3<T>& place) const noexcept {
    using std::sqrt;
    const Vec3<T> d = place - Vec3<T>{T(centre[0]), T(centre[1]), T(centre[2])}, k{T(axis[0]), T(axis[1]), T(axis[2])};
    if (flattening == 0.0) return sqrt(dot(d, d)) - T(radius);
    const T z = dot(d, k);
    const Vec3<T> out = d - z * k;
    return Geodetic<T>::of(sqrt(dot(out, out)), z, radius, flattening).height;
  }
};

}  // namespace cardan
