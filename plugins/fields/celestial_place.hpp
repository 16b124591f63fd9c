#pragma once
// Where a celestial body is, for fields: as the ephemerides have it from a date on.
#include "core/abi/field_family.hpp"
#include "plugins/astronomy/celestial.hpp"
#include "plugins/fields/planet.hpp"

namespace cardan {

struct CelestialPlace {
  std::int64_t body, origin;  // of Celestial
  Days start;                 // TT of t = 0

  static constexpr cardan_param_desc body_desc =
      param::named(param::required("body", CARDAN_CHOICE, "1", "which it is; a planet with its moons from Mars on"), kCelestialNames);
  static constexpr cardan_param_desc origin_desc = param::named(
      param::optional("origin", CARDAN_CHOICE, "1", "the body whose centre is the origin of world axes, which are those of the GCRS",
                      static_cast<double>(Celestial::earth)),
      kCelestialNames);
  static constexpr cardan_param_desc epoch_desc =
      param::required("epoch", CARDAN_TEXT, "1", "date of t = 0, 2026-11-26T12:00:00 UTC (or UT1, TT, TAI)");

  /// Of fields that ask for it, as a bit of what they are asked beyond.
  static constexpr cardan_limit_desc dates_limit = {"dates", 0,
                                                    "before the year 1000 or after 3000, which the series of planets are made for"};
  bool is_known(double t) const noexcept { return celestial_is_known(start.after(t)); }

  bool pack(const Params& params) {
    const auto epoch = Epoch::of(params.text("epoch"), 0.0);
    if (!epoch) return params.fail("epoch", TurningPlanet::kDateExpected);
    *this = {params.choice("body"), params.choice("origin"), epoch->tt};
    return body != origin || params.fail("body", "another than the origin of world axes");
  }

  /// [m] world axes.
  Vec3<double> at(double t) const {
    const auto p = celestial_position_of_day(static_cast<Celestial>(body), static_cast<Celestial>(origin), start.after(t));
    return {p[0], p[1], p[2]};
  }
};

/// The Sun of a field: in a direction that does not move, or where it is from a date on.
struct SunPlace {
  double direction[3];
  std::int64_t moves;  // 1: `place` tells where it is
  CelestialPlace place;

  static constexpr cardan_param_desc direction_desc =
      param::optional("direction", CARDAN_UNIT_VECTOR, "1", "to a Sun that does not move, world axes");
  static constexpr cardan_param_desc epoch_desc =
      param::optional("epoch", CARDAN_TEXT, "1", "in its place: date of t = 0, 2026-11-26T12:00:00 UTC (or UT1, TT, TAI)");

  bool is_known(double t) const noexcept { return moves == 0 || place.is_known(t); }

  bool pack(const Params& params) {
    const Eigen::Vector3d s = params.vector("direction");
    *this = {{s[0], s[1], s[2]}, 0, {}};
    const char* text = params.text("epoch");
    if (!text) return s.norm() > 0.0 || params.fail("epoch", "the date of t = 0, or the `direction` to a Sun that does not move", "none");
    if (s.norm() > 0.0) return params.fail("direction", "none: the Sun is where the ephemerides have it at `epoch`");
    const auto epoch = Epoch::of(text, 0.0);
    if (!epoch) return params.fail("epoch", TurningPlanet::kDateExpected);
    moves = 1, place = {static_cast<int>(Celestial::sun), params.choice("origin"), epoch->tt};
    return true;
  }
};

}  // namespace cardan
