#include "scripts/lua/sandbox.hpp"

#include <lualib.h>

#include <algorithm>
#include <array>
#include <initializer_list>
#include <string_view>
#include <utility>

#include "scripts/lua/host.hpp"

namespace cardan {
namespace {

/// The library function that a wrapper replaces, called on the same frame: its messages name the right function.
int original(lua_State* L) { return lua_tocfunction(L, lua_upvalueindex(1))(L); }

constexpr char kResume[] = "cardan.resume", kClose[] = "cardan.close";  // registry: functions of the coroutine library
constexpr lua_Integer kUnwinding = 200;                                 // a C++ exception costs about as much as that many instructions

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
/// The arguments first and last of concat and unpack: the length is asked for once, here, because __len may answer otherwise
/// when it is asked again.
template <int kFirst>
lua_Integer range(lua_State* L) {
  const int last = kFirst + 1;
  if (lua_gettop(L) < last) lua_settop(L, last);
  if (lua_isnil(L, last) && lua_istable(L, 1)) {
    lua_pushinteger(L, luaL_len(L, 1));
    lua_replace(L, last);
  }
  return span(luaL_optinteger(L, kFirst, 1), lua_tointeger(L, last));
}
lua_Integer unwinding(lua_State*) { return kUnwinding; }

/// table.insert(t, [position,] value) and table.remove(t [, position]) as in the library, but with one length.
int insert(lua_State* L) {
  luaL_checktype(L, 1, LUA_TTABLE);
  const lua_Integer end = static_cast<lua_Integer>(static_cast<lua_Unsigned>(luaL_len(L, 1)) + 1);
  lua_Integer at = end;
  if (lua_gettop(L) == 3) {
    at = luaL_checkinteger(L, 2);
    luaL_argcheck(L, static_cast<lua_Unsigned>(at) - 1u < static_cast<lua_Unsigned>(end), 2, "position out of bounds");
    LuaHost::charge(L, span(at, end));
    for (lua_Integer i = end; i > at; --i) {
      lua_geti(L, 1, i - 1);
      lua_seti(L, 1, i);
    }
  } else if (lua_gettop(L) != 2) {
    return luaL_error(L, "wrong number of arguments to 'insert'");
  }
  lua_seti(L, 1, at);
  return 0;
}
int remove(lua_State* L) {
  luaL_checktype(L, 1, LUA_TTABLE);
  const lua_Integer size = luaL_len(L, 1);
  lua_Integer at = luaL_optinteger(L, 2, size);
  if (at != size) luaL_argcheck(L, static_cast<lua_Unsigned>(at) - 1u <= static_cast<lua_Unsigned>(size), 2, "position out of bounds");
  LuaHost::charge(L, span(at, size));
  lua_geti(L, 1, at);
  for (; at < size; ++at) {
    lua_geti(L, 1, at + 1);
    lua_seti(L, 1, at);
  }
  lua_pushnil(L);
  lua_seti(L, 1, at);
  return 1;
}
lua_Integer new_thread(lua_State*) { return 1000; }  // what a short-lived coroutine can do before its own count is looked at

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

/// coroutine.wrap: the library's closes a coroutine that failed without looking at the budget, and with its hooks off after the
/// budget's end. Upvalue: the coroutine.
int resume_wrapped(lua_State* L) {
  const auto call = [L](const char* name, int arguments) {  // a function of the library that takes the coroutine first
    lua_getfield(L, LUA_REGISTRYINDEX, name);
    lua_insert(L, -arguments - 1);
    lua_call(L, arguments, LUA_MULTRET);
  };
  lua_pushvalue(L, lua_upvalueindex(1));
  lua_insert(L, 1);
  call(kResume, lua_gettop(L));
  if (lua_toboolean(L, 1)) return lua_gettop(L) - 1;
  LuaHost::charge(L, kUnwinding);
  lua_State* const co = lua_tothread(L, lua_upvalueindex(1));
  if (lua_status(co) != LUA_OK && lua_status(co) != LUA_YIELD) {  // it failed: what it has to close is closed
    lua_settop(L, 0);
    lua_pushvalue(L, lua_upvalueindex(1));
    call(kClose, 1);
    LuaHost::charge(L, 0);
  }
  if (lua_type(L, -1) == LUA_TSTRING) {
    luaL_where(L, 1);
    lua_insert(L, -2);
    lua_concat(L, 2);
  }
  return lua_error(L);
}
int wrap_coroutine(lua_State* L) {
  luaL_checktype(L, 1, LUA_TFUNCTION);
  LuaHost::charge(L, new_thread(L));
  lua_State* const co = lua_newthread(L);
  lua_pushvalue(L, 1);
  lua_xmove(L, co, 1);
  lua_pushcclosure(L, resume_wrapped, 1);
  return 1;
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

/// Opens the safe part of the standard library and replaces what is unsafe, unbounded or differs between runs:
/// - absent: os, io, debug, package, dofile, loadfile, collectgarbage, warn, string.dump;
/// - pairs, next: numbers ascending, strings by their bytes, false, true, then other keys in order of creation;
/// - tostring, string.format: "table: #1" by order of first printing, never an address;
/// - setmetatable refuses finalisers (they run outside the budget) and weak tables (they show when memory is collected);
/// - load takes text only; math.randomseed needs a seed; table.sort is stable;
/// - each function that can work long is charged to the budget, patterns included; pcall does not catch a budget's end.
void open_sandbox(lua_State* L, std::uint64_t seed) {
  open(L, LUA_GNAME, luaopen_base,
       {"_G",       "_VERSION", "assert", "error",  "getmetatable", "ipairs",       "load",     "next",     "pairs", "pcall", "print",
        "rawequal", "rawget",   "rawlen", "rawset", "select",       "setmetatable", "tonumber", "tostring", "type",  "xpcall"});
  wrap(L, "tonumber", metered<length_of_texts>);
  wrap(L, "setmetatable", set_metatable);
  wrap(L, "load", load);
  wrap(L, "pcall", pcall);
  wrap(L, "xpcall", xpcall);
  lua_pop(L, 1);

  open(L, LUA_STRLIBNAME, luaopen_string,
       {"byte", "char", "find", "format", "gmatch", "gsub", "len", "lower", "match", "pack", "packsize", "rep", "reverse", "sub", "unpack",
        "upper"});
  wrap(L, "rep", metered<repeats>);
  for (const char* name : {"byte", "packsize", "unpack"}) wrap(L, name, metered<length_of_texts>);
  open_patterns(L);
  lua_pushliteral(L, "");
  lua_getmetatable(L, -1);
  lua_pushboolean(L, 0);
  lua_setfield(L, -2, "__metatable");  // methods of all strings: not for scripts to change
  lua_pop(L, 3);

  open(L, LUA_TABLIBNAME, luaopen_table, {"concat", "insert", "move", "pack", "remove", "sort", "unpack"});
  wrap(L, "concat", metered<range<3>>);
  wrap(L, "insert", insert);
  wrap(L, "remove", remove);
  wrap(L, "move", metered<moved>);
  wrap(L, "unpack", metered<range<2>>);
  lua_pop(L, 1);

  open(L, LUA_MATHLIBNAME, luaopen_math, {"abs",  "acos",   "asin",       "atan", "ceil",       "cos", "deg",        "exp",  "floor",
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

  open(L, LUA_COLIBNAME, luaopen_coroutine, {"close", "create", "isyieldable", "resume", "running", "status", "wrap", "yield"});
  for (const auto& [field, key] : {std::pair{"resume", kResume}, {"close", kClose}}) {
    lua_getfield(L, -1, field);
    lua_setfield(L, LUA_REGISTRYINDEX, key);
  }
  wrap(L, "create", metered<new_thread>);
  wrap(L, "wrap", wrap_coroutine);
  wrap(L, "yield", metered<unwinding>);  // in Lua as C++, a yield is an exception
  wrap(L, "resume", catching);
  wrap(L, "close", catching);
  lua_pop(L, 1);

  open_order(L);
}

}  // namespace

void LuaHost::open_libraries(lua_State* L) { open_sandbox(L, options_.seed); }

}  // namespace cardan
