#include "scripts/bindings/profile.hpp"

#include <fmt/format.h>

#include <cmath>
#include <utility>
#include <vector>

#include "core/base/units.hpp"

namespace cardan {
namespace {

/// {{t, rate}, ...} with rising t.
std::vector<std::pair<double, double>> rate_points(lua_State* L, LuaTable& t, const std::string& unit) {
  std::vector<std::pair<double, double>> points;
  lua_getfield(L, 2, "rate_table");
  const int table = lua_gettop(L);
  const auto number = [&](lua_Integer i, const char* as) {
    const int type = lua_rawgeti(L, -1, i);
    double x = std::nan("");
    if (type == LUA_TNUMBER) x = lua_tonumber(L, -1);
    if (type == LUA_TSTRING) {
      const auto value = parse_quantity(lua_tostring(L, -1), as);
      if (const double* got = std::get_if<double>(&value)) x = *got;
    }
    lua_pop(L, 1);
    return x;
  };
  bool good = lua_istable(L, table) && lua_rawlen(L, table) > 0;
  std::string wrong;  // the first point that does not fit, and why
  for (lua_Integer i = 1; good && i <= static_cast<lua_Integer>(lua_rawlen(L, table)); ++i) {
    good = lua_rawgeti(L, table, i) == LUA_TTABLE && lua_rawlen(L, -1) == 2;
    if (!good) wrong = fmt::format("point {} is no pair {{t, rate}}", i);
    if (good) points.emplace_back(number(1, "s"), number(2, unit.c_str()));
    if (good && !(std::isfinite(points.back().first) && std::isfinite(points.back().second)))
      good = false, wrong = fmt::format("point {} has no finite numbers in s and {}", i, unit);
    if (good && i > 1 && !(points.back().first > points[points.size() - 2].first))
      good = false, wrong = fmt::format("point {} is at {:g} s, the one before at {:g} s; a rate that jumps changes over a short time", i,
                                        points.back().first, points[points.size() - 2].first);
    lua_pop(L, 1);
  }
  lua_pop(L, 1);
  if (!good) t.reject("rate_table", fmt::format("{{{{t, rate}}, ...}} in s and {}, at least one point, t rising", unit), wrong);
  return points;
}

}  // namespace

MotionProfile read_profile(lua_State* L, LuaTable& t, const std::string& rate) {
  const std::string unit = rate.starts_with("1/") ? "1" : rate.substr(0, rate.find('/'));
  MotionProfile profile;
  if (int(t.has("rate_table")) + int(t.has("sine")) + int(t.has("hold")) != 1) {
    t.reject(t.has("hold") ? "hold" : "rate_table", "exactly one of rate_table, sine, hold");
  } else if (t.has("rate_table")) {
    profile = MotionProfile::rate_table(rate_points(L, t, rate));
  } else if (const auto hold = t.number("hold", rate)) {
    profile = MotionProfile::hold(*hold);
  } else if (auto sine = t.table("sine")) {
    sine->require({"amplitude", "frequency"});
    profile = MotionProfile::sine(sine->number("amplitude", unit).value_or(0.0), sine->number("frequency", "Hz").value_or(0.0),
                                  sine->number("phase", "rad").value_or(0.0));
    sine->finish();
  }
  return profile;
}

}  // namespace cardan
