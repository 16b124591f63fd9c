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

}  // namespace cardan
