// astro: dates, how the Earth stands, where celestial bodies are.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "core/base/units.hpp"
#include "plugins/astronomy/celestial.hpp"
#include "plugins/astronomy/dates.hpp"
#include "plugins/astronomy/earth.hpp"
#include "plugins/astronomy/planets.hpp"
#include "plugins/fields/upper_air.hpp"
#include "scripts/bindings/bind.hpp"
#include "scripts/lua/matrix.hpp"
#include "scripts/lua/table.hpp"

namespace cardan {
namespace {

using std::string;

const char* text_at(lua_State* L, int index, const char* function, const char* expected) {
  if (lua_type(L, index) != LUA_TSTRING)
    refuse(L, Code::lua_argument, function, expected, index > lua_gettop(L) ? "nothing" : describe_value(L, index));
  return lua_tostring(L, index);
}
constexpr double kAny = std::numeric_limits<double>::max();
/// The number at `index`, of at most `most` either way, or `fallback` where nothing stands there.
double number_at(lua_State* L, int index, const char* function, const char* expected, double most, double fallback = std::nan("")) {
  if (lua_isnoneornil(L, index) && !std::isnan(fallback)) return fallback;
  if (lua_type(L, index) != LUA_TNUMBER || !(std::abs(lua_tonumber(L, index)) <= most))
    refuse(L, Code::lua_argument, function, expected, index > lua_gettop(L) ? "nothing" : describe_value(L, index));
  return lua_tonumber(L, index);
}

double dut1_at(lua_State* L, int index, const char* function) {
  return number_at(L, index, function, "UT1 - UTC, a number from -1 to 1 [s]", 1.0, 0.0);
}

/// (date, [t], [dut1]) from the argument `first` on: t seconds after the date.
Epoch epoch_at(lua_State* L, int first, const char* function) {
  constexpr const char* kDate =
      "a date from 1960 to 2200: \"2026-11-26T12:00:00 UTC\" (or UT1, TT, TAI), \"JD 2461371.0 UTC\", \"MJD 61370.5 TT\"";
  const char* text = text_at(L, first, function, kDate);
  const double t = number_at(L, first + 1, function, "seconds after the date, a number of at most 1e10", 1e10, 0.0);
  const double dut1 = dut1_at(L, first + 2, function);
  const auto epoch = Epoch::of(text, dut1);
  if (!epoch) refuse(L, Code::lua_argument, function, kDate, in_quotes(text));
  return {epoch->tt.after(t), epoch->ut1.after(t)};
}

constexpr const char* kBody = "a celestial body";
int choice_at(lua_State* L, int index, const char* function, const char* what, const std::vector<string>& all) {
  const char* text = text_at(L, index, function, what);
  const auto at = std::ranges::find(all, string(text));
  if (at == all.end())
    refuse(L, Code::unknown_name, function, fmt::format("{}: {}", what, listed(all)), in_quotes(text), did_you_mean(text, all));
  return static_cast<int>(at - all.begin());
}
template <std::size_t n>
int choice_at(lua_State* L, int index, const char* function, const char* what, const char* const (&names)[n]) {
  return choice_at(L, index, function, what, std::vector<string>(names, names + n));
}

int numbers(lua_State* L, const std::array<double, 3>& three) {
  lua_createtable(L, 3, 0);
  for (int i = 0; i < 3; ++i) lua_pushnumber(L, three[static_cast<std::size_t>(i)]), lua_rawseti(L, -2, i + 1);
  return 1;
}
template <std::size_t n>
int results(lua_State* L, const std::array<double, n>& each) {
  for (const double x : each) lua_pushnumber(L, x);
  return static_cast<int>(n);
}

int julian_date(lua_State* L) {
  const char* text = text_at(L, 1, "astro.julian_date", "a date, and the scale that it is told in");
  const auto to =
      lua_isnoneornil(L, 2) ? TimeScale::tt : static_cast<TimeScale>(choice_at(L, 2, "astro.julian_date", "a scale", kTimeScales));
  const auto days = read_date(text, to, dut1_at(L, 3, "astro.julian_date"));
  if (!days) refuse(L, Code::lua_argument, "astro.julian_date", "a date from 1960 to 2200: \"2026-11-26T12:00:00 UTC\"", in_quotes(text));
  return results(L, std::array{Days::kJ2000 + days->whole, days->part});
}

int leap_seconds_of(lua_State* L) {
  const auto number = [&](int i) {
    constexpr const char* kWhole = "year, month and day, whole numbers";
    const double x = number_at(L, i, "astro.leap_seconds", kWhole, 1e6);
    if (x != std::floor(x)) refuse(L, Code::lua_argument, "astro.leap_seconds", kWhole, describe_value(L, i));
    return static_cast<int>(x);
  };
  const int year = number(1), month = number(2), day = number(3);
  const auto seconds = leap_seconds(year, month, day);
  if (!seconds)
    refuse(L, Code::lua_argument, "astro.leap_seconds", "a day of UTC, which began in 1960", fmt::format("{}-{}-{}", year, month, day));
  return results(L, std::array{*seconds});
}

int rotation_angle(lua_State* L) { return results(L, std::array{earth_rotation_angle(epoch_at(L, 1, "astro.earth_rotation_angle").ut1)}); }
int sidereal_time(lua_State* L) {
  const Epoch e = epoch_at(L, 1, "astro.sidereal_time");
  return results(L, std::array{mean_sidereal_time(e.ut1, e.tt), apparent_sidereal_time(e.ut1, e.tt)});
}
int nutation_of(lua_State* L) {
  const Epoch e = epoch_at(L, 1, "astro.nutation");
  const auto angles = nutation(e.tt);
  return results(L, std::array{angles[0], angles[1], mean_obliquity(e.tt)});
}
int pole(lua_State* L) {
  const Epoch e = epoch_at(L, 1, "astro.intermediate_pole");
  const auto cip = intermediate_pole(e.tt);
  return results(L, std::array{cip[0], cip[1], cip[2], tio_locator(e.tt)});
}
int precession_nutation(lua_State* L) {
  const auto rows = bias_precession_nutation(epoch_at(L, 1, "astro.precession_nutation").tt);
  push_matrix(L, Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.data()));
  return 1;
}
int axes(lua_State* L) {
  const Epoch e = epoch_at(L, 1, "astro.earth_axes");
  const double x = number_at(L, 4, "astro.earth_axes", "polar motion x, a number from -1e-4 to 1e-4 [rad]", 1e-4, 0.0);
  const double y = number_at(L, 5, "astro.earth_axes", "polar motion y, a number from -1e-4 to 1e-4 [rad]", 1e-4, 0.0);
  const auto offset = [&](int i) {
    return number_at(L, i, "astro.earth_axes", "what adds to the pole X, Y, a number from -1e-6 to 1e-6 [rad]", 1e-6, 0.0);
  };
  const auto columns = earth_axes(e.tt, e.ut1, x, y, offset(6), offset(7));
  push_matrix(L, Eigen::Map<const Eigen::Matrix3d>(columns.data()));
  return 1;
}
/// (body, date, t) of a body, or of moon_principal.
int axes_of_body(lua_State* L) {
  std::vector<string> names(std::begin(kCelestialNames), std::end(kCelestialNames));
  names.emplace_back("moon_principal");
  const int body = choice_at(L, 1, "astro.axes", kBody, names);
  lua_settop(L, 3);
  const Epoch e = epoch_at(L, 2, "astro.axes");
  const auto columns = body == static_cast<int>(std::size(kCelestialNames)) ? principal_axes_of_moon(e.tt)
                       : body == static_cast<int>(Celestial::earth)         ? earth_axes(e.tt, e.ut1, 0.0, 0.0)
                                                                            : planet_axes(static_cast<Celestial>(body), e.tt);
  push_matrix(L, Eigen::Map<const Eigen::Matrix3d>(columns.data()));
  return 1;
}

int position(lua_State* L) {
  const auto body = static_cast<Celestial>(choice_at(L, 1, "astro.position", kBody, kCelestialNames));
  const auto origin =
      lua_isnoneornil(L, 4) ? Celestial::earth : static_cast<Celestial>(choice_at(L, 4, "astro.position", kBody, kCelestialNames));
  lua_settop(L, 3);
  return numbers(L, celestial_position_of_day(body, origin, epoch_at(L, 2, "astro.position").tt));
}
int gm(lua_State* L) {
  return results(L, std::array{gravitational_parameter(static_cast<Celestial>(choice_at(L, 1, "astro.gm", kBody, kCelestialNames)))});
}

int to_geodetic(lua_State* L) {
  const Eigen::VectorXd x = to_vector(L, 1, 3, "the place");
  if (!x.allFinite()) refuse(L, Code::lua_argument, "astro.geodetic", "a place [m], finite numbers", describe_value(L, 1));
  return results(L, geodetic({x[0], x[1], x[2]}));
}
int from_geodetic(lua_State* L) {
  const auto number = [&](int i, double most) {
    return number_at(L, i, "astro.from_geodetic", "longitude, latitude from -pi/2 to pi/2 [rad] and height [m], numbers", most);
  };
  return numbers(L, place_of_geodetic(number(1, kAny), number(2, 0.5 * std::numbers::pi), number(3, kAny)));
}

/// astro.nrlmsise00 { day, seconds, altitude, latitude, longitude, solar_time, f107, f107_average, ap } -> what it tells.
int nrlmsise00(lua_State* L) {
  DiagnosticSink sink;
  LuaTable t(L, 1, "astro.nrlmsise00", sink);
  sink.throw_if_any();  // no table
  t.require({"day", "altitude", "latitude", "longitude", "f107"});
  UpperAirAsked asked;
  const auto within = [&](const char* key, const char* unit, double low, double high, double fallback) {
    const double x = t.number(key, unit).value_or(fallback);
    if (!(x >= low && x <= high)) t.reject(key, fmt::format("from {:.7g} to {:.7g} {}", low, high, unit));
    return x;
  };
  constexpr double kPi = std::numbers::pi;
  const double day = within("day", "1", 1.0, 366.0, 1.0);
  if (day != std::floor(day)) t.reject("day", "a day of the year, whole, from 1", "the time goes into `seconds`");
  asked.day = static_cast<int>(day);
  asked.seconds = within("seconds", "s", 0.0, 86401.0, 0.0);
  asked.altitude = within("altitude", "m", 0.0, 1000e3, 400e3);
  asked.latitude = within("latitude", "rad", -0.5 * kPi, 0.5 * kPi, 0.0);
  asked.longitude = within("longitude", "rad", -2.0 * kPi, 2.0 * kPi, 0.0);
  asked.solar_time = within("solar_time", "s", -86400.0, 2.0 * 86400.0, asked.seconds + asked.longitude / (2.0 * kPi) * 86400.0);
  asked.f107 = within("f107", "1", 50.0, 400.0, 150.0);
  asked.f107_average = within("f107_average", "1", 50.0, 400.0, asked.f107);
  lua_getfield(L, 1, "ap");
  asked.history = lua_istable(L, -1);
  lua_pop(L, 1);
  if (asked.history) {
    if (const auto seven = t.numbers("ap", asked.ap.size())) std::ranges::copy(*seven, asked.ap.begin());
  } else {
    asked.ap.fill(t.number("ap").value_or(4.0));
  }
  if (std::ranges::any_of(asked.ap, [](double x) { return !(x >= 0.0 && x <= 400.0); }))
    t.reject("ap", "from 0 to 400: one number, or seven of the 57 h before");
  t.finish();
  sink.throw_if_any();
  const UpperAir air = upper_air(asked);
  if (!air.is_air)
    refuse(L, Code::lua_argument, "astro.nrlmsise00",
           "F10.7 and ap for which the model has a density there, and a temperature from 0 to 4000 K",
           fmt::format("{:g} kg/m^3 at {:g} K", air.density, air.temperature));
  constexpr const char* kNames[] = {"He", "O", "N2", "O2", "Ar", "H", "N", "hot_O"};
  lua_createtable(L, 0, 12);
  const auto put = [&](const char* key, double x) { lua_pushnumber(L, x), lua_setfield(L, -2, key); };
  for (std::size_t i = 0; i < air.number.size(); ++i) put(kNames[i], air.number[i]);
  put("density", air.density), put("drag_density", air.drag_density), put("temperature", air.temperature), put("exosphere", air.exosphere);
  return 1;
}

}  // namespace

void bind_astronomy(Scenario& s) {
  bind_module(s, "astro",
              {{"julian_date", julian_date, 3},
               {"leap_seconds", leap_seconds_of, 3},
               {"earth_rotation_angle", rotation_angle, 3},
               {"sidereal_time", sidereal_time, 3},
               {"nutation", nutation_of, 2},
               {"intermediate_pole", pole, 2},
               {"precession_nutation", precession_nutation, 2},
               {"earth_axes", axes, 7},
               {"axes", axes_of_body, 3},
               {"position", position, 4},
               {"gm", gm, 1},
               {"nrlmsise00", nrlmsise00, 1},
               {"geodetic", to_geodetic, 1},
               {"from_geodetic", from_geodetic, 3}});
}

}  // namespace cardan
