#include "scripts/lua/function.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/units.hpp"

namespace cardan {

LuaRef LuaRef::pop(lua_State* L) {
  LuaRef r;
  r.ref_ = luaL_ref(L, LUA_REGISTRYINDEX);
  r.host_ = &LuaHost::of(L);
  return r;
}

LuaRef::~LuaRef() {
  if (host_) luaL_unref(host_->state(), LUA_REGISTRYINDEX, ref_);  // allocates nothing, raises nothing
}

lua_Unsigned count_keys(lua_State* L, int index) {
  index = lua_absindex(L, index);
  luaL_checkstack(L, LUA_MINSTACK, nullptr);
  lua_Unsigned keys = 0;
  for (lua_pushnil(L); lua_next(L, index); lua_pop(L, 1)) ++keys;
  return keys;
}

namespace {

std::string text_of(lua_State* L, int index) {
  std::size_t n = 0;
  const char* text = lua_tolstring(L, index, &n);
  return in_quotes({text, n});
}

std::string number_of(lua_State* L, int index) {
  if (lua_isinteger(L, index)) return fmt::format("{}", lua_tointeger(L, index));
  if (std::isnan(lua_tonumber(L, index))) return "nan";  // its sign differs between processors
  return fmt::format("{}", lua_tonumber(L, index));
}

/// `{2, 1}` of a short list, to `depth` lists in it; else `table`.
std::string table_of(lua_State* L, int index, int depth) {
  constexpr lua_Unsigned kLongest = 6;
  const lua_Unsigned n = lua_rawlen(L, index);
  if (n == 0 || n > kLongest || count_keys(L, index) != n) return "table";
  index = lua_absindex(L, index);
  std::string entries;
  for (lua_Unsigned i = 1; i <= n; ++i, lua_pop(L, 1)) {
    const int type = lua_rawgeti(L, index, static_cast<lua_Integer>(i));
    entries += i == 1 ? "" : ", ";
    entries += type == LUA_TNUMBER               ? number_of(L, -1)
               : type == LUA_TSTRING             ? text_of(L, -1)
               : type == LUA_TTABLE && depth > 0 ? table_of(L, -1, depth - 1)
                                                 : luaL_typename(L, -1);
  }
  return "{" + entries + "}";
}

}  // namespace

std::string describe_value(lua_State* L, int index) {
  switch (lua_type(L, index)) {
    case LUA_TSTRING:
      return text_of(L, index) + " (string)";
    case LUA_TNUMBER:
      return number_of(L, index) + " (number)";
    case LUA_TBOOLEAN:
      return lua_toboolean(L, index) ? "true (boolean)" : "false (boolean)";
    case LUA_TTABLE:
      return table_of(L, index, 1);
    default:
      return luaL_typename(L, index);
  }
}

// ---- calls ----

int LuaFunction::call(std::span<const double> in, std::span<double> out) const try {
  int left = 0;
  host_->protect(
      [&](lua_State* L) {
        luaL_checkstack(L, static_cast<int>(in.size() + out.size()) + LUA_MINSTACK, nullptr);
        push(L);
        for (const double x : in) lua_pushnumber(L, x);
        const int before = lua_gettop(L) - static_cast<int>(in.size()) - 1;
        lua_call(L, static_cast<int>(in.size()), LUA_MULTRET);
        const int results = lua_gettop(L) - before, wanted = static_cast<int>(out.size());
        for (int i = lua_gettop(L); out.empty() && i > before; --i) left += lua_isnil(L, i) ? 0 : 1;
        if (!out.empty() && results > wanted) {  // `return bus:rate()` for one number would be its first component
          push(L);
          refuse(Code::lua_runtime, {"results", host_->definition(L, -1)}, "a finite number", fmt::format("{} values", results),
                 "of several the first alone: (bus:rate()); of all of them vec.norm { bus:rate() }");
        }
        lua_settop(L, before + wanted);
        for (std::size_t i = 0; i < out.size(); ++i) {
          const int at = static_cast<int>(i) + 1;
          out[i] = lua_tonumber(L, at);
          if (lua_type(L, at) == LUA_TNUMBER && std::isfinite(out[i])) continue;
          push(L);
          refuse(Code::lua_runtime, {fmt::format("result {}", at), host_->definition(L, -1)}, "a finite number", describe_value(L, at));
        }
      },
      host_->call_budget());
  return left;
} catch (const InputError& e) {
  // `return vec.norm(x)` is a tail call: what fails, in a module of ours or in the program, is all that stands on the stack, and this
  // function is its place.
  const std::string& file = e.diagnostics().front().at.mark.file;
  if (!file.empty() && !file.starts_with("[cardan.")) throw;
  std::vector<Diagnostic> all = e.diagnostics();
  host_->protect([&](lua_State* L) {
    push(L);
    all.front().at.mark = host_->definition(L, -1);
  });
  throw InputError(std::move(all));
}

}  // namespace cardan
