// What would differ from run to run in plain Lua: the order of keys (it follows addresses and a random seed), addresses
// as text, and the random pivot of table.sort.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <new>
#include <string_view>
#include <tuple>
#include <vector>

#include "scripts/lua/host.hpp"
#include "scripts/lua/sandbox.hpp"

namespace cardan {
namespace {

constexpr char kNumbers[] = "cardan.numbers";  // registry: object -> its number in texts, weak

/// A key as it is ordered: numbers, strings, false, true, objects by creation. A view: the key itself stays in its
/// table.
struct Key {
  enum Kind : std::uint8_t { number, text, truth, object } kind;
  bool is_integer = false;
  std::uint32_t size = 0;  // [B] of a text: the budget keeps all memory below 4 GiB
  union {
    lua_Integer integer;  // of an integer, a boolean
    double real;
    const char* bytes;
    std::uint64_t created;
  };
  std::string_view text_bytes() const { return {bytes, size}; }
};
static_assert(sizeof(Key) == 16);

Key key_at(lua_State* L, int index) {
  Key key{};
  switch (lua_type(L, index)) {
    case LUA_TNUMBER:
      key.kind = Key::number;
      key.is_integer = lua_isinteger(L, index) != 0;
      if (key.is_integer)
        key.integer = lua_tointeger(L, index);
      else
        key.real = lua_tonumber(L, index);
      break;
    case LUA_TSTRING: {
      std::size_t n = 0;
      key.kind = Key::text;
      key.bytes = lua_tolstring(L, index, &n);
      key.size = static_cast<std::uint32_t>(n);
      break;
    }
    case LUA_TBOOLEAN:
      key.kind = Key::truth;
      key.integer = lua_toboolean(L, index);
      break;
    default:
      key.kind = Key::object;
      key.created = LuaHost::of(L).creation_order(L, index);
  }
  return key;
}

bool number_less(const Key& a, const Key& b) {
  if (a.is_integer && b.is_integer) return a.integer < b.integer;
  const auto as_real = [](const Key& k) {  // holds 64 bits exactly
    return k.is_integer ? static_cast<long double>(k.integer) : static_cast<long double>(k.real);
  };
  return as_real(a) < as_real(b);
}

bool operator<(const Key& a, const Key& b) {
  if (a.kind != b.kind) return a.kind < b.kind;
  switch (a.kind) {
    case Key::number:
      return number_less(a, b);
    case Key::text:
      return a.text_bytes() < b.text_bytes();
    case Key::truth:
      return a.integer < b.integer;
    default:
      return a.created < b.created;
  }
}

/// Upvalues: the keys in order, how many were visited, how many there are. Entries that have been cleared are passed
/// over.
int next_pair(lua_State* L) {
  const lua_Integer n = lua_tointeger(L, lua_upvalueindex(3));
  lua_Integer i = lua_tointeger(L, lua_upvalueindex(2));
  lua_settop(L, 1);
  while (i < n) {
    lua_rawgeti(L, lua_upvalueindex(1), ++i);
    lua_pushvalue(L, -1);
    if (lua_rawget(L, 1) != LUA_TNIL) {
      lua_pushinteger(L, i);
      lua_replace(L, lua_upvalueindex(2));
      return 2;
    }
    lua_settop(L, 1);
  }
  lua_pushinteger(L, n);
  lua_replace(L, lua_upvalueindex(2));
  lua_pushnil(L);
  return 1;
}

int after_metamethod(lua_State*, int, lua_KContext) { return 3; }

int pairs(lua_State* L) {
  luaL_checkany(L, 1);
  if (luaL_getmetafield(L, 1, "__pairs") != LUA_TNIL) {
    lua_pushvalue(L, 1);
    lua_callk(L, 1, 3, 0, after_metamethod);
    return 3;
  }
  luaL_checktype(L, 1, LUA_TTABLE);
  lua_settop(L, 1);

  const lua_Integer n = push_keys(L, 1);
  lua_pushinteger(L, 0);
  lua_pushinteger(L, n);
  lua_pushcclosure(L, next_pair, 3);
  lua_pushvalue(L, 1);
  return 2;  // the third, the control variable, begins as nil
}

/// The smallest key above the given one: a scan of the table, but without memory, so any change in between is allowed.
int next(lua_State* L) {
  luaL_checktype(L, 1, LUA_TTABLE);
  lua_settop(L, 2);
  const bool from_start = lua_isnil(L, 2);
  const Key after = from_start ? Key{} : key_at(L, 2);
  lua_pushnil(L);  // 3: best so far
  Key best{};
  lua_Integer work = 0;
  for (lua_pushnil(L); lua_next(L, 1);) {
    lua_pop(L, 1);
    const Key key = key_at(L, -1);
    work += 1 + static_cast<lua_Integer>(key.kind == Key::text ? key.size / 16 : 0);
    if ((!from_start && !(after < key)) || (!lua_isnil(L, 3) && !(key < best))) continue;
    best = key;
    lua_pushvalue(L, -1);
    lua_replace(L, 3);
  }
  LuaHost::charge(L, work);
  lua_settop(L, 3);
  if (lua_isnil(L, 3)) return 1;
  lua_pushvalue(L, 3);
  lua_rawget(L, 1);
  return 2;
}

int to_string(lua_State* L) {
  luaL_checkany(L, 1);
  push_text(L, 1);
  return 1;
}

/// Whose sign differs between processors, and is not told.
bool is_nan(lua_State* L, int index) { return lua_type(L, index) == LUA_TNUMBER && std::isnan(lua_tonumber(L, index)); }

int print(lua_State* L) {
  const int n = lua_gettop(L);
  luaL_Buffer line;
  luaL_checkstack(L, n + LUA_MINSTACK, "too many values to print");
  for (int i = 1; i <= n; ++i) push_text(L, i);
  luaL_buffinit(L, &line);
  for (int i = 1; i <= n; ++i) {
    if (i > 1) luaL_addchar(&line, '\t');
    std::size_t length = 0;
    const char* text = lua_tolstring(L, n + i, &length);
    luaL_addlstring(&line, text, length);
  }
  luaL_pushresult(&line);
  std::size_t length = 0;
  const char* text = lua_tolstring(L, -1, &length);
  if (const LuaHost& host = LuaHost::of(L); !host.is_played()) host.options().print({text, length});
  return 0;
}

/// string.format with texts of ours for %s, and no %p; all the rest is the library's.
int format(lua_State* L) {
  std::size_t n = 0;
  const char* pattern = luaL_checklstring(L, 1, &n);
  LuaHost::charge(L, static_cast<lua_Integer>(n / 16));
  const char* const end = pattern + n;
  const int arguments = lua_gettop(L);
  int argument = 1;
  for (const char* c = pattern; c < end; ++c) {
    if (*c != '%' || *++c == '%') continue;
    while (c < end && *c && std::strchr("-+ #.0123456789", *c)) ++c;
    if (c == end) break;
    ++argument;
    if (*c == 'p') return luaL_error(L, "format '%%p' is not available to scripts: addresses differ from run to run");
    if (argument > arguments) continue;
    if (*c == 's')
      push_text(L, argument);
    else if (is_nan(L, argument))
      lua_pushnumber(L, std::abs(lua_tonumber(L, argument)));
    else
      continue;
    lua_replace(L, argument);
  }
  return lua_tocfunction(L, lua_upvalueindex(1))(L);
}

/// Calls the order at index 2, or `<`: is element a of the table at `values` less than element b?
bool is_less(lua_State* L, int values, lua_Integer a, lua_Integer b) {
  LuaHost::charge(L, 1);
  const bool has_order = !lua_isnil(L, 2);
  if (has_order) lua_pushvalue(L, 2);
  lua_rawgeti(L, values, a);
  lua_rawgeti(L, values, b);
  if (has_order) lua_call(L, 2, 1);
  const bool less = has_order ? lua_toboolean(L, -1) : lua_compare(L, -2, -1, LUA_OPLT);
  lua_pop(L, has_order ? 1 : 2);
  return less;
}

/// table.sort as a stable merge sort, bottom up: the same result on every run, n log n comparisons whatever the order
/// says.
int sort(lua_State* L) {
  luaL_checktype(L, 1, LUA_TTABLE);
  lua_settop(L, 2);
  if (!lua_isnil(L, 2)) luaL_checktype(L, 2, LUA_TFUNCTION);
  const lua_Integer n = luaL_len(L, 1);
  LuaHost::charge(L, std::max<lua_Integer>(n, 0));
  if (n < 2) return 0;
  luaL_argcheck(L, n < INT32_MAX, 1, "array too big");

  lua_createtable(L, static_cast<int>(n), 0);  // 3: the values
  const auto size = static_cast<std::size_t>(n);
  auto* order = static_cast<lua_Integer*>(lua_newuserdatauv(L, 2 * size * sizeof(lua_Integer), 0));  // 4: counts as the script's memory
  lua_Integer* merged = order + size;
  for (lua_Integer i = 1; i <= n; ++i) {
    lua_geti(L, 1, i);
    lua_rawseti(L, 3, i);
    order[i - 1] = i;
  }
  for (std::size_t width = 1; width < size; width *= 2) {
    for (std::size_t low = 0; low < size; low += 2 * width) {
      const std::size_t middle = std::min(low + width, size), high = std::min(low + 2 * width, size);
      std::size_t a = low, b = middle;
      for (std::size_t k = low; k < high; ++k) {
        const bool from_right = a == middle || (b < high && is_less(L, 3, order[b], order[a]));
        merged[k] = from_right ? order[b++] : order[a++];
      }
    }
    std::swap(order, merged);
  }
  for (lua_Integer i = 1; i <= n; ++i) {
    lua_rawgeti(L, 3, order[i - 1]);
    lua_seti(L, 1, i);
  }
  return 0;
}

}  // namespace

lua_Integer push_keys(lua_State* L, int table) {
  table = lua_absindex(L, table);
  lua_Integer n = 0, work = 0;
  bool in_order = true;  // 1, 2, 3, ... as they come: the keys of an array
  lua_newtable(L);
  const int keys = lua_gettop(L);
  for (lua_pushnil(L); lua_next(L, table);) {
    lua_pop(L, 1);
    in_order = in_order && lua_isinteger(L, -1) && lua_tointeger(L, -1) == n + 1;
    lua_pushvalue(L, -1);
    lua_rawseti(L, keys, ++n);
    if (lua_type(L, -1) == LUA_TSTRING) work += static_cast<lua_Integer>(lua_rawlen(L, -1) / 16);
  }
  LuaHost::charge(L, n + work);
  if (in_order) return n;

  struct Entry {
    Key key;
    lua_Integer at;
  };
  const auto size = static_cast<std::size_t>(n);
  auto* const entries = static_cast<Entry*>(lua_newuserdatauv(L, size * sizeof(Entry), 0));  // counts as the script's memory
  for (lua_Integer i = 1; i <= n; ++i) {
    lua_rawgeti(L, keys, i);
    new (entries + i - 1) Entry{key_at(L, -1), i};
    lua_pop(L, 1);
  }
  std::sort(entries, entries + size, [](const Entry& x, const Entry& y) { return x.key < y.key; });
  lua_createtable(L, static_cast<int>(std::min<std::size_t>(size, 1 << 20)), 0);
  for (std::size_t i = 0; i < size; ++i) {
    lua_rawgeti(L, keys, entries[i].at);
    lua_rawseti(L, -2, static_cast<lua_Integer>(i) + 1);
  }
  lua_replace(L, keys);
  lua_settop(L, keys);
  return n;
}

std::string_view push_text(lua_State* L, int index) {
  index = lua_absindex(L, index);
  std::size_t n = 0;
  const int type = lua_type(L, index);
  if (is_nan(L, index)) return lua_pushliteral(L, "nan");
  const bool is_plain = type == LUA_TNIL || type == LUA_TBOOLEAN || type == LUA_TNUMBER || type == LUA_TSTRING;
  if (is_plain || luaL_getmetafield(L, index, "__tostring") != LUA_TNIL) {
    if (!is_plain) lua_pop(L, 1);
    const char* text = luaL_tolstring(L, index, &n);
    return {text, n};
  }
  lua_getfield(L, LUA_REGISTRYINDEX, kNumbers);
  lua_pushvalue(L, index);
  if (lua_rawget(L, -2) == LUA_TNIL) {
    lua_pop(L, 1);
    lua_rawgeti(L, -1, 0);  // how many have a number
    const lua_Integer number = lua_tointeger(L, -1) + 1;
    lua_pop(L, 1);
    lua_pushinteger(L, number);
    lua_rawseti(L, -2, 0);
    lua_pushvalue(L, index);
    lua_pushinteger(L, number);
    lua_rawset(L, -3);
    lua_pushinteger(L, number);
  }
  const lua_Integer number = lua_tointeger(L, -1);
  lua_pop(L, 2);
  const char* kind = lua_typename(L, type);
  const int name_type = luaL_getmetafield(L, index, "__name");
  if (name_type == LUA_TSTRING) kind = lua_tostring(L, -1);
  const char* text = lua_pushfstring(L, "%s: #%I", kind, static_cast<LUAI_UACINT>(number));
  if (name_type != LUA_TNIL) lua_remove(L, -2);
  lua_tolstring(L, -1, &n);
  return {text, n};
}

void open_order(lua_State* L) {
  lua_newtable(L);
  lua_newtable(L);
  lua_pushliteral(L, "k");
  lua_setfield(L, -2, "__mode");
  lua_setmetatable(L, -2);
  lua_setfield(L, LUA_REGISTRYINDEX, kNumbers);

  constexpr luaL_Reg kGlobals[] = {{"pairs", pairs}, {"next", next}, {"tostring", to_string}, {"print", print}, {nullptr, nullptr}};
  lua_pushglobaltable(L);
  luaL_setfuncs(L, kGlobals, 0);
  lua_getfield(L, -1, "table");
  lua_pushcfunction(L, sort);
  lua_setfield(L, -2, "sort");
  lua_pop(L, 1);
  lua_getfield(L, -1, "string");
  lua_getfield(L, -1, "format");
  lua_pushcclosure(L, format, 1);
  lua_setfield(L, -2, "format");
  lua_pop(L, 2);
}

}  // namespace cardan
