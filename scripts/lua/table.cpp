#include "scripts/lua/table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/units.hpp"

namespace cardan {
namespace {

/// Entries, and no keys beside them.
bool is_array(lua_State* L, int index) { return lua_istable(L, index) && count_keys(L, index) == lua_rawlen(L, index); }

std::string describe_list(lua_State* L, int index) {
  return lua_istable(L, index) && !is_array(L, index) ? "a table with other keys than 1, 2, ..." : describe_value(L, index);
}

}  // namespace

LuaTable::LuaTable(lua_State* L, int index, std::string path, DiagnosticSink& sink)
    : L_(L), index_(lua_absindex(L, index)), path_(std::move(path)), sink_(&sink) {
  if (lua_istable(L, index)) return;
  report(path_, "a table", describe_value(L, index));
  luaL_checkstack(L, LUA_MINSTACK, nullptr);
  lua_newtable(L);
  index_ = lua_gettop(L);
}

std::string LuaTable::path_of(const std::string& key) const { return path_.empty() ? key : path_ + "." + key; }

void LuaTable::report(const std::string& path, std::string expected, std::string got, std::string hint, Code code) {
  sink_->report(
      Diagnostic{code, {path, LuaHost::caller(L_)}, std::move(expected), std::move(got), std::move(hint), LuaHost::traceback(L_)});
}

int LuaTable::get(const std::string& key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) known_.push_back(key);
  luaL_checkstack(L_, LUA_MINSTACK, nullptr);
  lua_pushlstring(L_, key.data(), key.size());
  return lua_rawget(L_, index_);
}

bool LuaTable::has(const std::string& key) {
  const bool is_there = get(key) != LUA_TNIL;
  lua_pop(L_, 1);
  return is_there;
}

std::optional<double> LuaTable::quantity(const std::string& path, std::string_view unit) {
  if (lua_type(L_, -1) == LUA_TNUMBER) {
    const double x = lua_tonumber(L_, -1);
    if (std::isfinite(x)) return x;
  } else if (lua_type(L_, -1) == LUA_TSTRING) {
    const auto value = parse_quantity(lua_tostring(L_, -1), unit);
    if (const double* x = std::get_if<double>(&value)) return *x;
    const auto& fault = std::get<QuantityFault>(value);
    report(path, fault.expected, fault.got, fault.hint, fault.code);
    return {};
  }
  report(path, unit == "1" ? std::string("a finite number") : fmt::format("a number in {}, or a text with a unit", unit),
         describe_value(L_, -1));
  return {};
}

std::optional<double> LuaTable::number(const std::string& key, std::string_view unit) {
  std::optional<double> x;
  if (get(key) != LUA_TNIL) x = quantity(path_of(key), unit);
  lua_pop(L_, 1);
  return x;
}

std::optional<std::vector<double>> LuaTable::numbers(const std::string& key, std::size_t n, std::string_view unit) {
  const int type = get(key), array = lua_gettop(L_);
  const bool is_one = is_array(L_, array);
  const std::size_t size = is_one ? lua_rawlen(L_, array) : 0;
  std::optional<std::vector<double>> all;
  if (type != LUA_TNIL && (!is_one || (n > 0 && size != n))) {
    report(path_of(key), n > 0 ? fmt::format("an array of {} numbers", n) : "an array of numbers",
           is_one ? fmt::format("{} entries", size) : describe_list(L_, array));
  } else if (is_one) {
    all.emplace();
    for (std::size_t i = 1; i <= size && all; ++i) {
      lua_rawgeti(L_, array, static_cast<lua_Integer>(i));
      const std::optional<double> x = quantity(fmt::format("{}[{}]", path_of(key), i), unit);
      lua_pop(L_, 1);
      if (x)
        all->push_back(*x);
      else
        all.reset();
    }
  }
  lua_settop(L_, array - 1);
  return all;
}

std::optional<double> LuaTable::first() {
  first_ = true;
  luaL_checkstack(L_, LUA_MINSTACK, nullptr);
  lua_rawgeti(L_, index_, 1);
  const std::optional<double> x = quantity(path_ + "[1]", "1");
  lua_pop(L_, 1);
  return x;
}

std::optional<std::int64_t> LuaTable::integer(const std::string& key, std::int64_t least, std::int64_t most) {
  std::optional<std::int64_t> n;
  const int type = get(key);
  int is_integer = 0;
  const lua_Integer value = lua_tointegerx(L_, -1, &is_integer);
  if (type == LUA_TNUMBER && is_integer && value >= least && value <= most)
    n = value;
  else if (type != LUA_TNIL)
    report(path_of(key), fmt::format("an integer from {} to {}", least, most), describe_value(L_, -1));
  lua_pop(L_, 1);
  return n;
}

std::optional<std::string> LuaTable::text(const std::string& key) {
  std::optional<std::string> s;
  const int type = get(key);
  if (type == LUA_TSTRING) {
    std::size_t n = 0;
    const char* bytes = lua_tolstring(L_, -1, &n);
    s.emplace(bytes, n);
  } else if (type != LUA_TNIL) {
    report(path_of(key), "a string", describe_value(L_, -1));
  }
  lua_pop(L_, 1);
  return s;
}

std::optional<std::vector<std::string>> LuaTable::texts(const std::string& key) {
  const int type = get(key), array = lua_gettop(L_);
  std::optional<std::vector<std::string>> all;
  if (is_array(L_, array)) all.emplace();
  for (lua_Integer i = 1; all && i <= static_cast<lua_Integer>(lua_rawlen(L_, array)); ++i) {
    if (lua_rawgeti(L_, array, i) == LUA_TSTRING)
      all->emplace_back(lua_tostring(L_, -1));
    else
      all.reset();
    lua_pop(L_, 1);
  }
  if (type != LUA_TNIL && !all) report(path_of(key), "an array of strings", describe_list(L_, array));
  lua_settop(L_, array - 1);
  return all;
}

std::optional<std::string> LuaTable::choice(const std::string& key, const std::vector<std::string>& words) {
  std::optional<std::string> word = text(key);
  if (!word || std::find(words.begin(), words.end(), *word) != words.end()) return word;
  reject(key, fmt::format("one of: {}", fmt::join(words, ", ")), did_you_mean(*word, words));
  return {};
}

std::optional<bool> LuaTable::flag(const std::string& key) {
  std::optional<bool> b;
  const int type = get(key);
  if (type == LUA_TBOOLEAN)
    b = lua_toboolean(L_, -1) != 0;
  else if (type != LUA_TNIL)
    report(path_of(key), "true or false", describe_value(L_, -1));
  lua_pop(L_, 1);
  return b;
}

std::optional<LuaFunction> LuaTable::function(const std::string& key) {
  const int type = get(key);
  if (type == LUA_TFUNCTION) return LuaFunction(LuaRef::pop(L_));
  if (type != LUA_TNIL) report(path_of(key), "a function", describe_value(L_, -1));
  lua_pop(L_, 1);
  return {};
}

std::optional<LuaTable> LuaTable::table(const std::string& key, std::string expected) {
  const int type = get(key);
  if (type == LUA_TTABLE) return LuaTable(L_, -1, path_of(key), *sink_);  // stays on the stack while it is read
  if (type != LUA_TNIL) report(path_of(key), std::move(expected), describe_value(L_, -1));
  lua_pop(L_, 1);
  return {};
}

std::vector<LuaTable> LuaTable::tables(const std::string& key) {
  std::vector<LuaTable> all;
  const int type = get(key), array = lua_gettop(L_);
  if (!is_array(L_, array)) {
    if (type != LUA_TNIL) report(path_of(key), "an array of tables", describe_list(L_, array));
    lua_pop(L_, 1);
    return all;
  }
  const auto size = static_cast<lua_Integer>(lua_rawlen(L_, array));
  for (lua_Integer i = 1; i <= size; ++i) {
    luaL_checkstack(L_, LUA_MINSTACK, nullptr);
    lua_rawgeti(L_, array, i);
    all.emplace_back(L_, -1, fmt::format("{}[{}]", path_of(key), i), *sink_);
  }
  return all;
}

void LuaTable::require(std::initializer_list<const char*> keys) {
  for (const char* key : keys)
    if (!has(key)) report(path_of(key), "a value: this key is required", "nothing");
}

void LuaTable::reject(const std::string& key, const std::string& expected, const std::string& hint) {
  get(key);
  report(path_of(key), expected, describe_value(L_, -1), hint);
  lua_pop(L_, 1);
}

void LuaTable::finish() {
  std::vector<std::string> unknown;
  luaL_checkstack(L_, LUA_MINSTACK, nullptr);
  for (lua_pushnil(L_); lua_next(L_, index_); lua_pop(L_, 1)) {
    const bool is_text = lua_type(L_, -2) == LUA_TSTRING;
    if (first_ && lua_isinteger(L_, -2) && lua_tointeger(L_, -2) == 1) continue;
    const std::string key = is_text ? lua_tostring(L_, -2) : describe_value(L_, -2);
    if (!is_text || std::find(known_.begin(), known_.end(), key) == known_.end()) unknown.push_back(key);
  }
  std::sort(unknown.begin(), unknown.end());  // their order in the table differs from run to run
  std::sort(known_.begin(), known_.end());
  for (const std::string& key : unknown)
    report(path_of(key), fmt::format("one of the keys: {}", fmt::join(known_, ", ")), in_quotes(key), did_you_mean(key, known_));
}

}  // namespace cardan
