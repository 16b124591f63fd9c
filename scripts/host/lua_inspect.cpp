#include "scripts/host/lua_inspect.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include "scripts/host/lua_sandbox.hpp"

namespace cardan {
namespace {

constexpr lua_Integer kShown = 100;  // entries of a table
constexpr std::array<std::string_view, 22> kKeywords = {
    "and", "break", "do", "else", "elseif", "end", "false", "for", "function", "goto", "if",
    "in",  "local", "nil", "not", "or",     "repeat", "return", "then", "true", "until", "while"};

std::string number_text(lua_State* L, int index) {
  if (lua_isinteger(L, index)) return std::to_string(lua_tointeger(L, index));
  const double x = lua_tonumber(L, index);
  if (std::isnan(x)) return "nan";  // its sign differs between processors
  if (std::isinf(x)) return x > 0 ? "inf" : "-inf";
  const std::string text = fmt::format("{}", x);
  return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;  // a float, as Lua shows it
}

std::string quoted(std::string_view text) {
  std::string out = "\"";
  for (char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c == '\n' ? "\\n" : std::string(1, c);
  }
  return out + '"';
}

bool is_name(std::string_view text) {
  return !text.empty() && !std::isdigit(static_cast<unsigned char>(text[0])) &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isalnum(c) || c == '_'; }) &&
         std::find(kKeywords.begin(), kKeywords.end(), text) == kKeywords.end();
}

/// A value inside of a table: on one line.
std::string brief(lua_State* L, int index) {
  switch (lua_type(L, index)) {
    case LUA_TNUMBER:
      return number_text(L, index);
    case LUA_TSTRING: {
      std::size_t n = 0;
      const char* text = lua_tolstring(L, index, &n);
      return quoted({text, n});
    }
    case LUA_TTABLE:
      lua_pushnil(L);
      if (lua_next(L, index < 0 ? index - 1 : index) == 0) return "{}";
      lua_pop(L, 2);
      return "{...}";
    default: {
      const std::string text(push_text(L, index));
      lua_pop(L, 1);
      return text.substr(0, text.find('\n'));
    }
  }
}

std::string table_text(lua_State* L, int table) {
  std::string out;
  const lua_Integer n = push_keys(L, table);
  const int keys = lua_gettop(L), key = keys + 1, value = keys + 2;
  for (lua_Integer i = 1; i <= std::min(n, kShown); ++i) {
    lua_rawgeti(L, keys, i);
    lua_pushvalue(L, key);
    lua_rawget(L, table);
    if (i > 1) out += ", ";
    if (lua_type(L, key) == LUA_TSTRING && is_name(lua_tostring(L, key)))
      out += std::string(lua_tostring(L, key)) + " = ";
    else if (!lua_isinteger(L, key) || lua_tointeger(L, key) != i)  // integers come first
      out += "[" + brief(L, key) + "] = ";
    out += brief(L, value);
    lua_settop(L, keys);
  }
  lua_settop(L, keys - 1);
  if (n > kShown) out += fmt::format(", ... {} more", n - kShown);
  return "{" + out + "}";
}

// ---- completion: raw access only, so that looking changes nothing ----

bool begins(const char* name, std::string_view with) { return std::string_view(name).substr(0, with.size()) == with; }

/// The table of methods of the value at the top, or what its metatable's __index says, in its place; false if there is none.
bool replace_by_index(lua_State* L) {
  for (const char* field : {"__members", "__index"}) {
    if (luaL_getmetafield(L, -1, field) == LUA_TNIL) continue;
    if (lua_istable(L, -1)) {
      lua_replace(L, -2);
      return true;
    }
    lua_pop(L, 1);
  }
  return false;
}

/// The value at the top becomes its field `name`; false if it has none.
bool enter(lua_State* L, std::string_view name) {
  if (!lua_istable(L, -1) && !replace_by_index(L)) return false;
  for (int depth = 0; depth < 10; ++depth) {
    lua_pushlstring(L, name.data(), name.size());
    if (lua_rawget(L, -2) != LUA_TNIL) {
      lua_replace(L, -2);
      return true;
    }
    lua_pop(L, 1);
    if (!replace_by_index(L)) return false;
  }
  return false;
}

void collect(lua_State* L, std::string_view beginning, bool methods, std::vector<std::string>& names) {
  if (!lua_istable(L, -1) && !replace_by_index(L)) return;
  int depth = 0;
  do {
    for (lua_pushnil(L); lua_next(L, -2); lua_pop(L, 1))
      if (lua_type(L, -2) == LUA_TSTRING && begins(lua_tostring(L, -2), beginning) && is_name(lua_tostring(L, -2)) &&
          (!methods || lua_isfunction(L, -1)))
        names.emplace_back(lua_tostring(L, -2));
  } while (++depth < 10 && replace_by_index(L));
}

}  // namespace

std::string value_text(lua_State* L, int index) {
  index = lua_absindex(L, index);
  if (lua_type(L, index) == LUA_TNUMBER) return number_text(L, index);
  if (lua_istable(L, index)) {
    if (luaL_getmetafield(L, index, "__tostring") == LUA_TNIL) return table_text(L, index);
    lua_pop(L, 1);
  }
  std::string text(push_text(L, index));
  lua_pop(L, 1);
  return text;
}

Completion complete(LuaHost& host, std::string_view line) {
  const auto is_part = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; };
  const auto name_before = [&](std::size_t end) {
    while (end > 0 && is_part(line[end - 1])) --end;
    return end;
  };
  Completion c;
  c.start = name_before(line.size());
  const std::string_view beginning = line.substr(c.start);
  if (!beginning.empty() && !is_name(beginning) && std::isdigit(static_cast<unsigned char>(beginning[0]))) return c;
  std::vector<std::string_view> path;  // the names before, innermost first
  char joint = 0;                      // '.' or ':' before the unfinished name
  for (std::size_t at = c.start; at > 0 && (line[at - 1] == '.' || line[at - 1] == ':');) {
    if (joint == 0) joint = line[at - 1];
    else if (line[at - 1] == ':') return c;  // a:b.c is no expression
    const std::size_t from = name_before(at - 1);
    if (!is_name(line.substr(from, at - 1 - from))) return c;  // a call or an index: its value is not known
    path.push_back(line.substr(from, at - 1 - from));
    at = from;
  }
  host.protect([&](lua_State* L) {
    lua_pushglobaltable(L);
    for (auto name = path.rbegin(); name != path.rend(); ++name)
      if (!enter(L, *name)) return;
    if (path.empty())
      for (std::string_view word : kKeywords)
        if (word.substr(0, beginning.size()) == beginning) c.names.emplace_back(word);
    collect(L, beginning, joint == ':', c.names);
  });
  std::sort(c.names.begin(), c.names.end());
  c.names.erase(std::unique(c.names.begin(), c.names.end()), c.names.end());
  return c;
}

}  // namespace cardan
