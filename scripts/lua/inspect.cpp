#include "scripts/lua/inspect.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include "scripts/lua/sandbox.hpp"

namespace cardan {
namespace {

constexpr lua_Integer kShown = 100;  // entries of a table
constexpr std::array<std::string_view, 22> kKeywords = {"and",      "break",  "do",   "else", "elseif", "end",  "false", "for",
                                                        "function", "goto",   "if",   "in",   "local",  "nil",  "not",   "or",
                                                        "repeat",   "return", "then", "true", "until",  "while"};

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

/// An array of tables that have the same names for plain values, as a table with a line each; empty for anything else. `keys` are
/// those of the array.
std::string rows_text(lua_State* L, int array, int keys, lua_Integer n) {
  std::vector<std::string> names;
  std::vector<std::vector<std::string>> lines;
  const int top = lua_gettop(L);
  const auto end = [&](std::string text) {
    lua_settop(L, top);
    return text;
  };
  for (lua_Integer i = 1; i <= n; ++i) {
    if (lua_rawgeti(L, keys, i) != LUA_TNUMBER || !lua_isinteger(L, -1) || lua_tointeger(L, -1) != i) return end({});
    if (lua_rawgeti(L, array, i) != LUA_TTABLE) return end({});
    const int row = lua_gettop(L);
    const lua_Integer columns = push_keys(L, row);
    const int own = lua_gettop(L);
    lines.emplace_back();
    for (lua_Integer j = 1; j <= columns; ++j) {
      if (lua_rawgeti(L, own, j) != LUA_TSTRING) return end({});
      const std::string name = lua_tostring(L, -1);
      if (i == 1) names.push_back(name);
      if (j > static_cast<lua_Integer>(names.size()) || names[static_cast<std::size_t>(j) - 1] != name) return end({});
      const int type = lua_rawget(L, row);
      if (type == LUA_TTABLE || type == LUA_TFUNCTION || type == LUA_TUSERDATA || type == LUA_TTHREAD) return end({});
      lines.back().push_back(type == LUA_TNUMBER && !lua_isinteger(L, -1) ? short_text(lua_tonumber(L, -1)) : brief(L, -1));
      lua_pop(L, 1);
    }
    if (lines.back().size() != names.size() || names.empty()) return end({});
    lua_settop(L, top);
    if (i == kShown) break;
  }
  std::vector<std::size_t> widths;
  for (std::size_t j = 0; j < names.size(); ++j) {
    widths.push_back(names[j].size());
    for (const auto& line : lines) widths[j] = std::max(widths[j], line[j].size());
  }
  const std::size_t digits = std::to_string(lines.size()).size();
  std::string out = std::string(digits + 2, ' ');
  for (std::size_t j = 0; j < names.size(); ++j) out += fmt::format("  {:>{}}", names[j], widths[j]);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    out += fmt::format("\n  {:>{}}", i + 1, digits);
    for (std::size_t j = 0; j < names.size(); ++j) out += fmt::format("  {:>{}}", lines[i][j], widths[j]);
  }
  if (n > kShown) out += fmt::format("\n  ... {} more", n - kShown);
  return out;
}

std::string table_text(lua_State* L, int table) {
  std::string out;
  const lua_Integer n = push_keys(L, table);
  const int keys = lua_gettop(L), key = keys + 1, value = keys + 2;
  if (n > 1) out = rows_text(L, table, keys, n);
  if (!out.empty()) {
    lua_settop(L, keys - 1);
    return out;
  }
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

std::string short_text(double x) { return std::isnan(x) ? "nan" : fmt::format("{:.6g}", x); }

std::string value_text(lua_State* L, int index) {
  index = lua_absindex(L, index);
  if (lua_type(L, index) == LUA_TNUMBER) return number_text(L, index);
  if (lua_istable(L, index)) {
    if (luaL_getmetafield(L, index, "__tostring") == LUA_TNIL) return table_text(L, index);
    lua_pop(L, 1);
  }
  constexpr std::size_t kLongest = 64 << 10;  // [B]; print shows all
  const std::string_view whole = push_text(L, index);
  std::string text(whole.substr(0, kLongest));
  if (whole.size() > kLongest) text += fmt::format("\n... ({} bytes more)", whole.size() - kLongest);
  lua_pop(L, 1);
  return text;
}

namespace {

bool is_part(char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; }

/// Where the name that ends at `end` begins.
std::size_t name_before(std::string_view line, std::size_t end) {
  while (end > 0 && is_part(line[end - 1])) --end;
  return end;
}

/// Where the text in quotes begins that the line ends in; npos if it ends outside of quotes.
std::size_t open_quote(std::string_view line) {
  std::size_t start = std::string_view::npos;
  char quote = 0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (quote != 0 && line[i] == '\\')
      ++i;
    else if (quote != 0 && line[i] == quote)
      quote = 0;
    else if (quote == 0 && (line[i] == '"' || line[i] == '\''))
      quote = line[i], start = i + 1;
  }
  return quote != 0 ? start : std::string_view::npos;
}

/// Where the arguments begin that end at `end`: "(...)" or a text in quotes; `end` itself if there are none.
std::size_t before_arguments(std::string_view line, std::size_t end) {
  if (end == 0) return end;
  const char last = line[end - 1];
  if (last == '"' || last == '\'') {
    const std::size_t quote = end < 2 ? std::string_view::npos : line.rfind(last, end - 2);
    if (quote == std::string_view::npos) return end;
    end = quote;
  } else if (last == ')') {
    int depth = 0;
    std::size_t at = end;
    do {
      --at;
      if ((line[at] == '"' || line[at] == '\'') && at > 0) {
        at = line.rfind(line[at], at - 1);
        if (at == std::string_view::npos) return end;
      }
      depth += line[at] == ')' ? 1 : line[at] == '(' ? -1 : 0;
    } while (at > 0 && depth > 0);
    if (depth > 0) return end;
    end = at;
  } else {
    return end;
  }
  while (end > 0 && line[end - 1] == ' ') --end;
  return end;
}

/// A name on the way to the one that is unfinished: `hinge` in sat:hinge("wheel"):ra
struct Link {
  std::string_view name;
  char joint = 0;  // before it; 0 for the first one
  bool called = false;
};

/// The class of the first of the types that a function returns, or a field has; null if it is none.
const ApiClass* class_of(const ApiReference& api, std::string_view type) { return api.find_class(type.substr(0, type.find('|'))); }
const ApiClass* next_class(const ApiReference& api, const ApiClass& c, const Link& link) {
  for (const ApiFunction* f : api.functions_of(c))
    if (link.called && f->name == link.name) return f->results.empty() ? nullptr : class_of(api, f->results[0].type);
  for (const ApiValue& f : c.fields)
    if (!link.called && f.name == link.name) return class_of(api, f.type);
  return nullptr;
}
/// Of the value at the top, by its metatable.
const ApiClass* class_of_value(lua_State* L, const ApiReference& api) {
  const ApiClass* c = nullptr;
  if (luaL_getmetafield(L, -1, "__name") == LUA_TNIL) return c;
  const std::string_view type = lua_type(L, -1) == LUA_TSTRING ? lua_tostring(L, -1) : "";
  if (type.starts_with("cardan.")) c = api.find_class(type.substr(7));
  lua_pop(L, 1);
  return c;
}

}  // namespace

Completion complete(LuaHost& host, std::string_view line, const CompletionSources& sources) {
  Completion c;
  const auto sorted = [&c] {
    std::sort(c.names.begin(), c.names.end());
    c.names.erase(std::unique(c.names.begin(), c.names.end()), c.names.end());
    return c;
  };
  if (const std::size_t quote = open_quote(line); quote != std::string_view::npos) {
    std::size_t end = quote - 1;
    while (end > 0 && std::string_view(" ({[=").find(line[end - 1]) != std::string_view::npos) --end;
    const std::size_t word = name_before(line, end);
    c.start = quote;
    for (std::string& name : sources.names(line.substr(word, end - word)))
      if (name.starts_with(line.substr(quote))) c.names.push_back(std::move(name));
    return sorted();
  }
  c.start = name_before(line, line.size());
  const std::string_view beginning = line.substr(c.start);
  if (!beginning.empty() && !is_name(beginning) && std::isdigit(static_cast<unsigned char>(beginning[0]))) return c;
  std::vector<Link> path;  // the names before, innermost first
  char joint = 0;          // '.' or ':' before the unfinished name
  for (std::size_t at = c.start; at > 0 && (line[at - 1] == '.' || line[at - 1] == ':');) {
    const std::size_t end = before_arguments(line, at - 1), from = name_before(line, end);
    const Link link{line.substr(from, end - from), 0, end != at - 1};
    if (joint == 0)
      joint = line[at - 1];
    else
      path.back().joint = line[at - 1];
    if (!path.empty() && path.back().joint == ':' && !path.back().called) return c;  // a:b.c is no expression
    if (!is_name(link.name)) return c;                                               // an index: its value is not known
    path.push_back(link);
    at = from;
  }
  host.protect([&](lua_State* L) {
    lua_pushglobaltable(L);
    const ApiClass* type = nullptr;  // of what a call has returned
    for (auto link = path.rbegin(); link != path.rend(); ++link) {
      if (!type && !link->called) {
        if (!enter(L, link->name)) return;
        continue;
      }
      if (!sources.api) return;
      if (!type && link->joint == 0) {  // a global function that is called
        for (const ApiFunction& f : sources.api->functions())
          if (f.name == link->name && !f.results.empty()) type = class_of(*sources.api, f.results[0].type);
      } else if (const ApiClass* of = type ? type : class_of_value(L, *sources.api)) {
        type = next_class(*sources.api, *of, *link);
      }
      if (!type) return;
    }
    if (type) {
      for (const ApiFunction* f : sources.api->functions_of(*type))
        if (joint == ':' && f->name.starts_with(beginning)) c.names.push_back(f->name);
      for (const ApiValue& f : type->fields)
        if (joint == '.' && is_name(f.name) && f.name.starts_with(beginning)) c.names.push_back(f.name);
      return;
    }
    if (path.empty())
      for (std::string_view word : kKeywords)
        if (word.substr(0, beginning.size()) == beginning) c.names.emplace_back(word);
    collect(L, beginning, joint == ':', c.names);
  });
  return sorted();
}

}  // namespace cardan
