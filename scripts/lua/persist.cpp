#include "scripts/lua/persist.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <set>
#include <utility>

#include "core/base/units.hpp"
#include "core/base/utf8.hpp"
#include "scripts/lua/matrix.hpp"

namespace cardan {
namespace {

constexpr std::size_t kRandomWords = 4;  // of the generator of Lua 5.4, xoshiro256**
constexpr int kDeepest = 200;            // tables in tables

std::string hex(std::string_view bytes) {
  std::string out;
  for (const char c : bytes) out += fmt::format("{:02x}", static_cast<unsigned char>(c));
  return out;
}

bool is_utf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t n = utf8_character(text);
    if (n == 0) return false;
    text.remove_prefix(n);
  }
  return true;
}

bool is_plain(int type) { return type == LUA_TNIL || type == LUA_TBOOLEAN || type == LUA_TNUMBER || type == LUA_TSTRING; }
bool is_numbers(lua_State* L, int index) { return is_vector(L, index) || is_matrix(L, index); }

/// A plain value: "true", "i12", "f0.1", "stext", "x" and bytes in hexadecimal.
std::string plain_text(lua_State* L, int index) {
  switch (lua_type(L, index)) {
    case LUA_TBOOLEAN:
      return lua_toboolean(L, index) ? "true" : "false";
    case LUA_TNUMBER:
      return lua_isinteger(L, index) ? fmt::format("i{}", lua_tointeger(L, index)) : fmt::format("f{}", lua_tonumber(L, index));
    case LUA_TSTRING: {
      std::size_t n = 0;
      const char* text = lua_tolstring(L, index, &n);
      return is_utf8({text, n}) ? "s" + std::string(text, n) : "x" + hex({text, n});
    }
    default:
      return "nil";
  }
}

/// Keys of the table at `index`, as plain texts in their order; `others`: there are keys that are none.
std::vector<std::string> keys_of(lua_State* L, int index, bool* others = nullptr) {
  index = lua_absindex(L, index);
  std::vector<std::string> keys;
  for (lua_pushnil(L); lua_next(L, index); lua_pop(L, 1)) {
    if (is_plain(lua_type(L, -2)))
      keys.push_back(plain_text(L, -2));
    else if (others)
      *others = true;
  }
  std::sort(keys.begin(), keys.end());
  return keys;
}

/// Pushes it.
bool push_plain(lua_State* L, const std::string& text) {
  if (text == "true" || text == "false" || text == "nil") {
    if (text == "nil")
      lua_pushnil(L);
    else
      lua_pushboolean(L, text == "true");
    return true;
  }
  if (text.empty()) return false;
  const std::string rest = text.substr(1);
  char* end = nullptr;
  switch (text[0]) {
    case 'i':
      lua_pushinteger(L, std::strtoll(rest.c_str(), &end, 10));
      return *end == '\0';
    case 'f': {
      double x = 0.0;
      const auto [last, error] = std::from_chars(rest.data(), rest.data() + rest.size(), x);
      lua_pushnumber(L, x);
      return error == std::errc() && last == rest.data() + rest.size();
    }
    case 's':
      lua_pushlstring(L, rest.data(), rest.size());
      return true;
    case 'x': {
      std::string bytes;
      for (std::size_t i = 0; i + 1 < rest.size(); i += 2) bytes += static_cast<char>(std::strtoul(rest.substr(i, 2).c_str(), nullptr, 16));
      lua_pushlstring(L, bytes.data(), bytes.size());
      return true;
    }
    default:
      return false;
  }
}

}  // namespace

// ---- what has changed ----

/// Everything that functions of the script can reach: globals, modules and what C++ holds, their fields and upvalues.
class Persistent::Walk {
 public:
  Walk(Persistent& of, lua_State* L) : of_(of), L_(L) {}

  Slots run() {
    lua_newtable(L_);  // what is still to be looked at, and for each its name
    queue_ = lua_gettop(L_);
    lua_rawgeti(L_, LUA_REGISTRYINDEX, LUA_RIDX_GLOBALS);
    later("");
    lua_getfield(L_, LUA_REGISTRYINDEX, LuaHost::kModules);
    later("require");
    work();
    const auto n = static_cast<lua_Integer>(lua_rawlen(L_, LUA_REGISTRYINDEX));
    for (lua_Integer i = LUA_RIDX_LAST + 1; i <= n; ++i) {  // what C++ holds and no name leads to
      lua_rawgeti(L_, LUA_REGISTRYINDEX, i);
      later("");
      work();
    }
    lua_settop(L_, queue_ - 1);
    return std::move(slots_);
  }

 private:
  /// Takes the value at the top.
  void later(const std::string& name) {
    if (!(lua_istable(L_, -1) || lua_isfunction(L_, -1)) || !seen_.insert(lua_topointer(L_, -1)).second) {
      lua_pop(L_, 1);
      return;
    }
    names_.push_back(name);
    lua_rawseti(L_, queue_, static_cast<lua_Integer>(names_.size()));
  }

  void work() {
    for (; done_ < names_.size(); ++done_) {
      lua_rawgeti(L_, queue_, static_cast<lua_Integer>(done_) + 1);
      const std::string name = names_[done_];
      if (lua_istable(L_, -1))
        table(name);
      else
        function(name);
      lua_settop(L_, queue_);
    }
  }

  void table(const std::string& name) {
    const int at = lua_gettop(L_);
    const void* self = lua_topointer(L_, at);
    const bool kept = of_.numbers_.contains(self);  // tables that the run has put into declared ones: Writer
    std::map<std::string, Slot>& fields = slots_[self];
    if (lua_getmetatable(L_, at)) {
      fields["metatable"] = {name + " (its metatable)", fmt::format("{}", lua_topointer(L_, -1))};
      later(name);
    }
    if (fields_of(at) > kManyFields) {
      if (!kept) fields["fields"] = {name + " (its fields)", fingerprint_of_fields(at)};
      return inner_fields(at, name);
    }
    const auto field = [&](const std::string& key, const std::string& told, bool plain) {  // the value is at the top, and goes
      const std::string full = below(name, told);
      const bool held = kept && plain && (is_plain(lua_type(L_, -1)) || lua_istable(L_, -1) || is_numbers(L_, -1));
      if (!held) fields[key] = {full, value()};
      later(full);
    };
    bool others = false;
    for (const std::string& key : keys_of(L_, at, &others)) {
      push_plain(L_, key);
      lua_rawget(L_, at);
      field(key, shown(key), true);
    }
    if (!others) return;
    for (lua_pushnil(L_); lua_next(L_, at); lua_pop(L_, 1)) {
      if (is_plain(lua_type(L_, -2))) continue;
      lua_pushvalue(L_, -1);
      field(fmt::format("{}", lua_topointer(L_, -3)), lua_typename(L_, lua_type(L_, -3)), false);
    }
  }

  /// Of a field: as long as a reader reads. In a chain of tables each name would else be longer than the one before, without end.
  static std::string below(const std::string& name, const std::string& field) {
    if (name.size() > kLongName) return name;
    const std::string full = name.empty() ? field : name + "." + field;
    return full.size() > kLongName ? full.substr(0, kLongName) + "..." : full;
  }

  /// Of a key as plain_text() has it.
  static std::string shown(const std::string& key) { return key == "true" || key == "false" ? key : key.substr(1); }

  std::size_t fields_of(int at) {
    std::size_t n = 0;
    for (lua_pushnil(L_); lua_next(L_, at); lua_pop(L_, 1)) ++n;
    return n;
  }

  /// Of a large table as a whole, whatever the order of its keys.
  std::string fingerprint_of_fields(int at) {
    std::size_t sum = 0, n = 0;
    for (lua_pushnil(L_); lua_next(L_, at); lua_pop(L_, 1), ++n) {
      lua_pushvalue(L_, -2);
      const std::string key = value();
      lua_pop(L_, 1);
      sum += std::hash<std::string>()(key + "=" + value());
    }
    return fmt::format("{} fields, {}", n, sum);
  }

  /// Tables and functions in a large table are looked at each by itself.
  void inner_fields(int at, const std::string& name) {
    std::vector<std::string> keys;
    for (lua_pushnil(L_); lua_next(L_, at); lua_pop(L_, 1))
      if (is_plain(lua_type(L_, -2)) && (lua_istable(L_, -1) || lua_isfunction(L_, -1))) keys.push_back(plain_text(L_, -2));
    std::sort(keys.begin(), keys.end());
    for (const std::string& key : keys) {
      push_plain(L_, key);
      lua_rawget(L_, at);
      later(below(name, shown(key)));
    }
  }

  /// A variable is named with the place of the first function that keeps it.
  void function(const std::string& name) {
    const int at = lua_gettop(L_);
    const bool in_lua = !lua_iscfunction(L_, at);
    const SourceMark mark = in_lua ? of_.host_.definition(L_, at) : SourceMark{};
    const std::string file = mark.file.substr(mark.file.rfind('/') + 1);
    for (int n = 1; const char* variable = lua_getupvalue(L_, at, n); ++n) {
      const std::string called = in_lua ? variable : name;
      const auto [slot, fresh] = slots_[lua_upvalueid(L_, at, n)].try_emplace("");
      std::pair<std::string, int>& place = places_[&slot->second];
      if (fresh || std::pair(file, mark.line) < place) {
        place = {file, mark.line};
        slot->second = {in_lua ? fmt::format("{} ({}:{})", called, file, mark.line) : called, value()};
      }
      later(called);
    }
  }

  /// Of the value at the top.
  std::string value() {
    const int type = lua_type(L_, -1);
    if (type == LUA_TSTRING) {
      std::size_t n = 0;
      const char* s = lua_tolstring(L_, -1, &n);
      return n <= kLongText ? std::string(s, n) : fmt::format("{} bytes, {}", n, std::hash<std::string_view>()({s, n}));
    }
    if (is_plain(type)) return plain_text(L_, -1);
    std::string text = fmt::format("{} {}", lua_typename(L_, type), lua_topointer(L_, -1));
    if (type == LUA_TTHREAD && lua_status(lua_tothread(L_, -1)) == LUA_YIELD)
      text += fmt::format(" {}", ++of_.suspended_);                 // inside a function: it can go on anywhere
    if (of_.numbers_.contains(lua_topointer(L_, -1))) return text;  // its numbers are in a declared table
    for (const double x : numbers_of(L_, -1)) text += fmt::format(" {}", x);
    return text;
  }

  static constexpr std::size_t kManyFields = 1000, kLongText = 64, kLongName = 200;

  Persistent& of_;
  lua_State* L_;
  int queue_ = 0;
  std::vector<std::string> names_;
  std::set<const void*> seen_;
  std::map<const Slot*, std::pair<std::string, int>> places_;
  std::size_t done_ = 0;
  Slots slots_;
};

// ---- tables as texts ----

class Persistent::Writer {
 public:
  Writer(const Persistent& of, lua_State* L) : of_(of), L_(L) {}

  /// The value at the top, which stays there; `name`: what it is called, `fresh`: in a table that the run has made.
  void value(const std::string& name, bool fresh, int depth) {
    luaL_checkstack(L_, LUA_MINSTACK, nullptr);
    const bool table = lua_istable(L_, -1), numbers = !table && is_numbers(L_, -1);
    if (is_plain(lua_type(L_, -1))) return texts.push_back(plain_text(L_, -1));
    const bool deep = (table || numbers) && depth > kDeepest;
    if (deep || (!table && !numbers)) {
      if (deep) loose.push_back(fmt::format("persist (tables more than {} deep)", kDeepest));
      if (fresh && !deep) loose.push_back(name);
      return void(texts.emplace_back("as set up"));
    }
    const void* self = lua_topointer(L_, -1);
    const auto [again, first] = written_.emplace(self, written_.size());
    if (!first) {
      if (again->second < n_declared_ && !of_.numbers_.contains(self)) shared.push_back(name);
      return texts.push_back(fmt::format("again {}", again->second));
    }
    const auto of_setup = of_.numbers_.find(self);
    const std::string which = of_setup == of_.numbers_.end() ? "new" : fmt::format("{}", of_setup->second);
    if (table) {
      texts.push_back("table " + which);
      const bool made = which == "new";
      if (made && lua_getmetatable(L_, -1)) {
        loose.push_back(name + " (its metatable)");
        lua_pop(L_, 1);
      }
      bool others = false;
      const std::vector<std::string> keys = keys_of(L_, -1, &others);
      if (others) loose.push_back(name + " (keys that are neither numbers nor texts)");
      for (const std::string& key : keys) {
        texts.push_back(key);
        push_plain(L_, key);
        lua_rawget(L_, -2);
        value(name + "." + key.substr(1), made, depth + 1);
        lua_pop(L_, 1);
      }
      texts.emplace_back("end");
      return;
    }
    const std::span<const double> x = numbers_of(L_, -1);
    const Labels rows = row_labels(L_, -1), columns = column_labels(L_, -1);
    const std::size_t n_rows = is_vector(L_, -1) ? x.size() : to_matrix(L_, -1, kAnySize, kAnySize, "matrix").rows();
    texts.push_back(fmt::format("{} {} {} {}", is_vector(L_, -1) ? "vector" : "matrix", which, n_rows, n_rows > 0 ? x.size() / n_rows : 0));
    for (const double number : x) texts.push_back(fmt::format("f{}", number));
    for (const Labels* labels : {&rows, &columns})
      for (const auto* list : {&labels->names, &labels->units}) {
        texts.push_back(fmt::format("i{}", list->size()));
        for (const std::string& text : *list) texts.push_back("s" + text);
      }
  }

  /// The declared tables.
  void declared() {
    for (const LuaRef& table : of_.declared_) {
      table.push(L_);
      value("persist", false, 0);
      lua_pop(L_, 1);
    }
    n_declared_ = written_.size();
  }

  std::vector<std::string> texts;
  std::vector<std::string> loose;   // what the texts cannot hold
  std::vector<std::string> shared;  // what is in the declared tables as well, and was made in the run

 private:
  const Persistent& of_;
  lua_State* L_;
  std::map<const void*, std::size_t> written_;
  std::size_t n_declared_ = 0;  // of those written
};

class Persistent::Reader {
 public:
  Reader(const Persistent& of, lua_State* L, const Archive& archive, const std::vector<std::string>& texts)
      : of_(of), L_(L), archive_(archive), texts_(texts) {
    lua_newtable(L);
    read_ = lua_gettop(L);
  }

  /// Pushes the next one. Where it is "as set up", nothing: false.
  bool value(int depth) {
    luaL_checkstack(L_, LUA_MINSTACK, nullptr);
    const std::string& text = next();
    if (text == "as set up") return false;
    if (const std::size_t space = text.find(' '); text.starts_with("again ")) {
      lua_rawgeti(L_, read_, static_cast<lua_Integer>(std::strtoul(text.c_str() + space, nullptr, 10) + 1));
      if (lua_isnil(L_, -1)) wrong("a table is not there", text);
    } else if (text.starts_with("table ")) {
      table(text, depth);
    } else if (text.starts_with("vector ") || text.starts_with("matrix ")) {
      numbers(text);
    } else if (!push_plain(L_, text)) {
      wrong("not a value", text);
    }
    return true;
  }

 private:
  [[noreturn]] void wrong(const char* what, const std::string& text) const { archive_.wrong(fmt::format("{}: {}", what, in_quotes(text))); }

  const std::string& next() {
    if (at_ == texts_.size()) archive_.wrong("a value is missing");
    return texts_[at_++];
  }

  /// The object of set-up with this number, or false.
  bool push_object(const std::string& which) {
    if (which == "new") return false;
    const std::size_t number = std::strtoul(which.c_str(), nullptr, 10);
    if (number < 1 || number > of_.numbers_.size()) wrong("a table that set-up does not make", which);
    of_.objects_.push(L_);
    lua_rawgeti(L_, -1, static_cast<lua_Integer>(number));
    lua_remove(L_, -2);
    return true;
  }

  void read(int index) {  // the object at `index` has the next number
    lua_pushvalue(L_, index);
    lua_rawseti(L_, read_, static_cast<lua_Integer>(++n_read_));
  }

  void table(const std::string& text, int depth) {
    if (depth > kDeepest) archive_.wrong("tables too deep");
    std::set<std::string> gone;  // keys of set-up that the checkpoint does not name
    if (push_object(text.substr(6))) {
      if (!lua_istable(L_, -1)) wrong("no table of set-up", text);
      const std::vector<std::string> keys = keys_of(L_, -1);
      gone.insert(keys.begin(), keys.end());
    } else {
      lua_newtable(L_);
    }
    const int self = lua_gettop(L_);
    read(self);
    while (true) {
      const std::string key = next();
      if (key == "end") break;
      if (key == "nil" || !push_plain(L_, key) || (lua_isnumber(L_, -1) && std::isnan(lua_tonumber(L_, -1)))) wrong("not a key", key);
      gone.erase(key);
      if (value(depth + 1))
        lua_rawset(L_, self);
      else
        lua_pop(L_, 1);
    }
    for (const std::string& key : gone) {
      push_plain(L_, key);
      lua_pushnil(L_);
      lua_rawset(L_, self);
    }
  }

  void numbers(const std::string& text) {
    char which[16] = "";
    std::size_t rows = 0, columns = 0;
    const bool vector = text.starts_with("vector");
    if (std::sscanf(text.c_str(), "%*s %15s %zu %zu", which, &rows, &columns) != 3 || rows > texts_.size() || columns > texts_.size() ||
        rows * columns > texts_.size() || (vector && columns != (rows > 0 ? 1 : 0)))
      wrong("not a matrix", text);
    Eigen::MatrixXd x(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(columns));
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      const std::string& number = next();
      if (!push_plain(L_, number) || lua_type(L_, -1) != LUA_TNUMBER) wrong("not a number", number);
      x(i) = lua_tonumber(L_, -1);
      lua_pop(L_, 1);
    }
    Labels labels[2];
    for (Labels& l : labels)
      for (auto* list : {&l.names, &l.units}) {
        const std::string count = next();
        if (count != "i0" && count != fmt::format("i{}", &l == labels ? rows : columns)) wrong("one label each, or none", count);
        for (std::size_t n = count == "i0" ? 0 : &l == labels ? rows : columns; n > 0; --n) {
          if (!next().starts_with('s')) wrong("not a label", texts_[at_ - 1]);
          list->push_back(texts_[at_ - 1].substr(1));
        }
      }
    if (push_object(which)) {
      if (vector ? !is_vector(L_, -1) : !is_matrix(L_, -1)) wrong("of another kind than at set-up", text);
      const std::span<double> own = numbers_of(L_, -1);
      if (own.size() != rows * columns) wrong("another size than at set-up", text);
      std::copy_n(x.data(), own.size(), own.begin());
    } else if (vector) {
      push_vector(L_, x.reshaped(), labels[0]);
    } else {
      push_matrix(L_, x, labels[0], labels[1]);
    }
    read(lua_gettop(L_));
  }

  const Persistent& of_;
  lua_State* L_;
  const Archive& archive_;
  const std::vector<std::string>& texts_;
  std::size_t at_ = 0, n_read_ = 0;
  int read_;
};

// ---- the whole ----

Persistent::Persistent(LuaHost& host) : host_(host) {
  host_.protect([this](lua_State* L) {
    lua_getglobal(L, "math");
    lua_getfield(L, -1, "random");
    lua_getupvalue(L, -1, 1);
    if (lua_rawlen(L, -1) == kRandomWords * sizeof(std::uint64_t)) random_ = LuaRef::pop(L);
  });
}

/// LuaHost::protect; what no line of the script does is told at the place of the first declaration.
template <class Job>
void Persistent::protect(Job&& job) {
  try {
    host_.protect(job);
  } catch (const InputError& e) {
    std::vector<Diagnostic> all = e.diagnostics();
    for (Diagnostic& d : all)
      if (d.at.mark.file.empty()) d.at.mark = at_;
    throw InputError(std::move(all));
  }
}

void Persistent::declare(lua_State* L, int index) {
  if (declared_.empty()) at_ = LuaHost::caller(L);
  lua_pushvalue(L, index);
  declared_.push_back(LuaRef::pop(L));
}

void Persistent::seal() {
  if (std::exchange(sealed_, true)) return;
  protect([this](lua_State* L) {
    lua_newtable(L);
    const int list = lua_gettop(L);
    const std::function<void(int)> collect = [&](int depth) {  // the value at the top, and what is in it
      luaL_checkstack(L, LUA_MINSTACK, nullptr);
      const bool table = lua_istable(L, -1);
      if ((!table && !is_numbers(L, -1)) || depth > kDeepest) return;
      if (!numbers_.emplace(lua_topointer(L, -1), numbers_.size() + 1).second) return;
      lua_pushvalue(L, -1);
      lua_rawseti(L, list, static_cast<lua_Integer>(numbers_.size()));
      if (!table) return;
      for (const std::string& key : keys_of(L, -1)) {
        push_plain(L, key);
        lua_rawget(L, -2);
        collect(depth + 1);
        lua_pop(L, 1);
      }
    };
    for (const LuaRef& table : declared_) {
      table.push(L);
      collect(0);
      lua_pop(L, 1);
    }
    objects_ = LuaRef::pop(L);
    at_seal_ = Walk(*this, L).run();
  });
}

void Persistent::remember(Archive& archive) {
  std::vector<std::string> texts, random(kRandomWords);
  std::size_t n = declared_.size();
  protect([&](lua_State* L) {
    if (archive.reading()) return;
    Writer writer(*this, L);
    writer.declared();
    texts = std::move(writer.texts);
    if (!random_) return;
    random_.push(L);
    std::uint64_t words[kRandomWords];
    std::memcpy(words, lua_touserdata(L, -1), sizeof words);
    for (std::size_t i = 0; i < kRandomWords; ++i) random[i] = fmt::format("{:016x}", words[i]);
  });
  archive(n, texts, std::span(random));
  if (!archive.reading()) return;
  if (n != declared_.size()) archive.wrong("another number of persist{} tables");
  protect([&](lua_State* L) {
    Reader reader(*this, L, archive, texts);
    for (const LuaRef& table : declared_) {
      table.push(L);
      if (!reader.value(0) || !lua_rawequal(L, -1, -2)) archive.wrong("another table of persist{}");
      lua_pop(L, 2);
    }
    if (!random_) return;
    random_.push(L);
    std::uint64_t words[kRandomWords];
    for (std::size_t i = 0; i < kRandomWords; ++i) words[i] = std::strtoull(random[i].c_str(), nullptr, 16);
    std::memcpy(lua_touserdata(L, -1), words, sizeof words);
  });
}

bool Persistent::write(lua_State* L, std::vector<std::string>& texts) {
  Writer writer(*this, L);
  writer.value("", true, 0);
  texts = std::move(writer.texts);
  return writer.loose.empty();
}

void Persistent::read(lua_State* L, const Archive& archive, const std::vector<std::string>& texts) {
  const int before = lua_gettop(L);
  if (!Reader(*this, L, archive, texts).value(0)) archive.wrong("no value");
  lua_replace(L, before + 1);
  lua_settop(L, before + 1);
}

std::vector<std::string> Persistent::stack_of(lua_State* coroutine, std::vector<std::string>& shared) {
  std::vector<std::string> all;
  protect([&](lua_State* L) {
    Writer writer(*this, L);
    writer.declared();
    writer.texts.clear();
    lua_Debug frame;
    for (int level = 0; lua_getstack(coroutine, level, &frame); ++level) {
      lua_getinfo(coroutine, "Sl", &frame);
      if (*frame.what == 'C') continue;
      const std::string place = fmt::format("{}:{}", frame.short_src, frame.currentline);
      writer.texts.push_back(place);
      luaL_checkstack(coroutine, LUA_MINSTACK, nullptr);
      for (int n = 1; const char* name = lua_getlocal(coroutine, &frame, n); ++n) {
        lua_xmove(coroutine, L, 1);
        if (*name != '(') {  // else what is worked out at the moment
          writer.texts.emplace_back(name);
          writer.value(fmt::format("{} ({})", name, place), false, 0);
        }
        lua_pop(L, 1);
      }
    }
    all = std::move(writer.texts);
    shared = std::move(writer.shared);
  });
  return all;
}

std::vector<std::string> Persistent::elsewhere() {
  Slots now;
  std::set<std::string> names;
  protect([&](lua_State* L) {
    now = Walk(*this, L).run();
    Writer writer(*this, L);
    writer.declared();
    names.insert(writer.loose.begin(), writer.loose.end());
  });
  for (const auto& [self, fields] : now) {
    const auto before = at_seal_.find(self);
    if (before == at_seal_.end()) continue;  // new: so is the variable that leads here
    for (const auto& [key, slot] : fields) {
      const auto old = before->second.find(key);
      if (old == before->second.end() || old->second.value != slot.value) names.insert(slot.name);
    }
    for (const auto& [key, slot] : before->second)
      if (!fields.contains(key)) names.insert(slot.name);
  }
  std::vector<std::string> sorted(names.begin(), names.end());
  if (sorted.size() > kMost) sorted.resize(kMost);
  return sorted;
}

}  // namespace cardan
