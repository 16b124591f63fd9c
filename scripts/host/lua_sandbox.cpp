#include "scripts/host/lua_sandbox.hpp"

#include <lualib.h>

#include <algorithm>
#include <array>
#include <initializer_list>
#include <string_view>

#include "scripts/host/lua_host.hpp"

namespace cardan {
namespace {

/// The library function that a wrapper replaces, called on the same frame: its messages name the right function.
int original(lua_State* L) { return lua_tocfunction(L, lua_upvalueindex(1))(L); }

constexpr lua_Integer kUnwinding = 200;  // a C++ exception costs about as much as that many instructions

/// Wraps a library function so that it first spends Cost(L) steps.
template <lua_Integer (*Cost)(lua_State*)>
int metered(lua_State* L) {
  LuaHost::charge(L, std::max<lua_Integer>(Cost(L), 0));
  return original(L);
}

lua_Integer length_of_texts(lua_State* L) {
  lua_Integer bytes = 0;
  for (int i = 1; i <= lua_gettop(L); ++i)
    if (lua_type(L, i) == LUA_TSTRING) bytes += static_cast<lua_Integer>(lua_rawlen(L, i));
  return bytes / 16;
}
lua_Integer span(lua_Integer first, lua_Integer last) {
  lua_Integer n = 0;
  if (first > last) return 0;
  return __builtin_sub_overflow(last, first, &n) ? LUA_MAXINTEGER : n;
}
/// rep of nothing would loop without allocating; else the memory bounds it.
lua_Integer repeats(lua_State* L) {
  const bool is_empty = lua_rawlen(L, 1) == 0 && (lua_isnoneornil(L, 3) || lua_rawlen(L, 3) == 0);
  return is_empty && lua_isstring(L, 1) ? lua_tointeger(L, 2) : 0;
}
lua_Integer moved(lua_State* L) { return span(lua_tointeger(L, 2), lua_tointeger(L, 3)); }
lua_Integer length(lua_State* L) { return lua_istable(L, 1) ? luaL_len(L, 1) : 0; }
lua_Integer inserted(lua_State* L) { return lua_gettop(L) > 2 ? span(lua_tointeger(L, 2), length(L)) : 0; }
lua_Integer removed(lua_State* L) { return lua_gettop(L) > 1 ? span(lua_tointeger(L, 2), length(L)) : 0; }
lua_Integer joined(lua_State* L) {  // concat(t, sep, i, j)
  return span(luaL_optinteger(L, 3, 1), lua_isnoneornil(L, 4) ? length(L) : lua_tointeger(L, 4));
}
lua_Integer unpacked(lua_State* L) {
  return span(luaL_optinteger(L, 2, 1), lua_isnoneornil(L, 3) ? length(L) : lua_tointeger(L, 3));
}
lua_Integer unwinding(lua_State*) { return kUnwinding; }
lua_Integer new_thread(lua_State*) {
  return 1000;
}  // what a short-lived coroutine can do before its own count is looked at

/// Replaces a field of the table at the top; the original becomes the wrapper's first upvalue.
void wrap(lua_State* L, const char* name, lua_CFunction wrapper) {
  lua_getfield(L, -1, name);
  lua_pushcclosure(L, wrapper, 1);
  lua_setfield(L, -2, name);
}

void keep_only(lua_State* L, std::initializer_list<std::string_view> names) {
  for (lua_pushnil(L); lua_next(L, -2);) {
    lua_pop(L, 1);
    const std::string_view name = lua_tostring(L, -1);
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    lua_pushvalue(L, -1);
    lua_pushnil(L);
    lua_rawset(L, -4);
  }
}

int set_metatable(lua_State* L) {
  if (lua_istable(L, 2)) {
    for (const char* refused : {"__gc", "__mode"}) {
      lua_pushstring(L, refused);
      if (lua_rawget(L, 2) != LUA_TNIL) return luaL_error(L, "metamethod '%s' is not available to scripts", refused);
      lua_pop(L, 1);
    }
  }
  return original(L);
}

/// load(text [, name [, mode [, env]]]): text only.
int load(lua_State* L) {
  std::size_t n = 0;
  luaL_checktype(L, 1, LUA_TSTRING);
  const char* text = lua_tolstring(L, 1, &n);
  const char* name = luaL_optstring(L, 2, text);
  const bool has_environment = !lua_isnone(L, 4);
  LuaHost::charge(L, static_cast<lua_Integer>(n));
  if (luaL_loadbufferx(L, text, n, name, "t") != LUA_OK) {
    lua_pushnil(L);
    lua_insert(L, -2);
    return 2;
  }
  if (has_environment) {
    lua_pushvalue(L, 4);
    lua_setupvalue(L, -2, 1);
  }
  return 1;
}

/// coroutine.resume and close return false and an error, but not that of a used-up budget.
int catching(lua_State* L) {
  const int results = original(L);
  LuaHost::charge(L, lua_toboolean(L, -results) ? 0 : kUnwinding);
  return results;
}

/// End of pcall and xpcall, also after the function has yielded; `below` values of the stack are no results.
int after_call(lua_State* L, int status, lua_KContext below) {
  if (status == LUA_OK || status == LUA_YIELD) return lua_gettop(L) - static_cast<int>(below);
  LuaHost::charge(L, kUnwinding);
  lua_pushboolean(L, 0);
  lua_insert(L, -2);
  return 2;
}

int pcall(lua_State* L) {
  luaL_checkany(L, 1);
  lua_pushboolean(L, 1);
  lua_insert(L, 1);
  return after_call(L, lua_pcallk(L, lua_gettop(L) - 2, LUA_MULTRET, 0, 0, after_call), 0);
}

/// Message handler around a script's own: it must not run once the budget is used up, because hooks are off there.
int guarded_handler(lua_State* L) {
  if (LuaHost::is_exhausted(L)) return 1;
  lua_pushvalue(L, lua_upvalueindex(1));
  lua_insert(L, 1);
  lua_call(L, lua_gettop(L) - 1, 1);
  return 1;
}

int xpcall(lua_State* L) {
  luaL_checktype(L, 2, LUA_TFUNCTION);
  const int arguments = lua_gettop(L) - 2;
  lua_pushvalue(L, 2);
  lua_pushcclosure(L, guarded_handler, 1);
  lua_replace(L, 2);
  lua_pushboolean(L, 1);
  lua_pushvalue(L, 1);
  lua_rotate(L, 3, 2);  // function, handler, true, function, arguments
  return after_call(L, lua_pcallk(L, arguments, LUA_MULTRET, 2, 2, after_call), 2);
}

int seed_random(lua_State* L) {
  luaL_checkany(L, 1);  // without a seed, the library would take the time and an address
  lua_pushvalue(L, lua_upvalueindex(1));
  lua_insert(L, 1);
  lua_call(L, lua_gettop(L) - 1, 0);
  return 0;
}

void open(lua_State* L, const char* name, lua_CFunction opener, std::initializer_list<std::string_view> functions) {
  luaL_requiref(L, name, opener, 1);
  keep_only(L, functions);
}

}  // namespace

void open_sandbox(lua_State* L, std::uint64_t seed) {
  open(L, LUA_GNAME, luaopen_base,
       {"_G",     "_VERSION", "assert",       "error",    "getmetatable", "ipairs", "load",
        "next",   "pairs",    "pcall",        "print",    "rawequal",     "rawget", "rawlen",
        "rawset", "select",   "setmetatable", "tonumber", "tostring",     "type",   "xpcall"});
  wrap(L, "tonumber", metered<length_of_texts>);
  wrap(L, "setmetatable", set_metatable);
  wrap(L, "load", load);
  wrap(L, "pcall", pcall);
  wrap(L, "xpcall", xpcall);
  lua_pop(L, 1);

  open(L, LUA_STRLIBNAME, luaopen_string,
       {"byte", "char", "find", "format", "gmatch", "gsub", "len", "lower", "match", "pack", "packsize", "rep",
        "reverse", "sub", "unpack", "upper"});
  wrap(L, "rep", metered<repeats>);
  for (const char* name : {"byte", "packsize", "unpack"}) wrap(L, name, metered<length_of_texts>);
  open_patterns(L);
  lua_pushliteral(L, "");
  lua_getmetatable(L, -1);
  lua_pushboolean(L, 0);
  lua_setfield(L, -2, "__metatable");  // methods of all strings: not for scripts to change
  lua_pop(L, 3);

  open(L, LUA_TABLIBNAME, luaopen_table, {"concat", "insert", "move", "pack", "remove", "sort", "unpack"});
  wrap(L, "concat", metered<joined>);
  wrap(L, "insert", metered<inserted>);
  wrap(L, "remove", metered<removed>);
  wrap(L, "move", metered<moved>);
  wrap(L, "unpack", metered<unpacked>);
  lua_pop(L, 1);

  open(L, LUA_MATHLIBNAME, luaopen_math,
       {"abs",  "acos",   "asin",       "atan", "ceil",       "cos", "deg",        "exp",  "floor",
        "fmod", "huge",   "log",        "max",  "maxinteger", "min", "mininteger", "modf", "pi",
        "rad",  "random", "randomseed", "sin",  "sqrt",       "tan", "tointeger",  "type", "ult"});
  lua_getfield(L, -1, "randomseed");
  lua_pushinteger(L, static_cast<lua_Integer>(seed));
  lua_call(L, 1, 0);
  wrap(L, "randomseed", seed_random);
  lua_pop(L, 1);

  open(L, LUA_UTF8LIBNAME, luaopen_utf8, {"char", "charpattern", "codepoint", "codes", "len", "offset"});
  for (const char* name : {"codepoint", "len", "offset"}) wrap(L, name, metered<length_of_texts>);
  lua_pop(L, 1);

  open(L, LUA_COLIBNAME, luaopen_coroutine,
       {"close", "create", "isyieldable", "resume", "running", "status", "wrap", "yield"});
  wrap(L, "create", metered<new_thread>);
  wrap(L, "wrap", metered<new_thread>);
  wrap(L, "yield", metered<unwinding>);  // in Lua as C++, a yield is an exception
  wrap(L, "resume", catching);
  wrap(L, "close", catching);
  lua_pop(L, 1);

  open_order(L);
}

}  // namespace cardan
