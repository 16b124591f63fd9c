#include "scripts/bindings/bind.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/units.hpp"

namespace cardan {
namespace {

/// __index of the method tables: a method that does not exist.
int unknown_method(lua_State* L) {
  std::vector<std::string> names;
  for (lua_pushnil(L); lua_next(L, 1); lua_pop(L, 1)) names.emplace_back(lua_tostring(L, -2));
  std::sort(names.begin(), names.end());
  const std::string name = lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : luaL_typename(L, 2);
  refuse(L, Code::unknown_name, "method", "one of: " + listed(names), in_quotes(name), did_you_mean(name, names));
}

}  // namespace

void expect_setup(lua_State* L, const Scenario& s, const char* what, bool needs_vehicle) {
  if (s.stage != Scenario::Stage::setup)
    refuse(L, Code::lua_argument, what, "a declaration before the run", "one during the run", "move it to the top level of the script");
  if (needs_vehicle && !s.model)
    refuse(L, Code::lua_argument, what, "a vehicle before it", "no vehicle yet", "begin with: local sat = vehicle \"vehicle.yaml\"");
}

void bind_module(Scenario& s, const char* module, std::initializer_list<ModuleFunction> functions) {
  for (const auto& [name, function, arguments] : functions) s.lua.bind(fmt::format("{}.{}", module, name), limited(arguments, function));
}

std::string listed(const std::vector<std::string>& names) { return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", ")); }

double seconds_at(lua_State* L, int index, const char* what) {
  if (lua_type(L, index) == LUA_TNUMBER && std::isfinite(lua_tonumber(L, index))) return lua_tonumber(L, index);
  if (lua_type(L, index) != LUA_TSTRING)
    refuse(L, Code::lua_argument, what, "a time in s, or a text with a unit", describe_value(L, index));
  const auto value = parse_quantity(lua_tostring(L, index), "s");
  if (const double* seconds = std::get_if<double>(&value)) return *seconds;
  const auto& fault = std::get<QuantityFault>(value);
  refuse(L, fault.code, what, fault.expected, fault.got, fault.hint);
}

void make_handle_type(lua_State* L, const char* type, const std::vector<luaL_Reg>& methods, lua_CFunction text) {
  luaL_newmetatable(L, type);
  lua_newtable(L);
  for (const luaL_Reg& m : methods) {
    lua_pushcfunction(L, m.func);
    lua_setfield(L, -2, m.name);
  }
  lua_newtable(L);
  lua_pushcfunction(L, method<unknown_method>);
  lua_setfield(L, -2, "__index");
  lua_setmetatable(L, -2);
  lua_setfield(L, -2, "__index");
  lua_pushcfunction(L, text);
  lua_setfield(L, -2, "__tostring");
  lua_pushboolean(L, 0);
  lua_setfield(L, -2, "__metatable");
  lua_pop(L, 1);
}

}  // namespace cardan
