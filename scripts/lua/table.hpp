#pragma once
// Strict reading of tables that scripts pass to bindings: every key known, every type right, every unit right. Faults
// go to a sink with the place of the script line, the path of the key and what was expected; the binding goes on
// reading.
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scripts/lua/function.hpp"

namespace cardan {

/// A table on the stack of a running binding. Getters give nothing if the key is absent or, with a report, wrong.
class LuaTable {
 public:
  /// The argument at `index` of the binding, `path` naming it in messages ("run"); reported if it is not a table,
  /// and read as an empty one then.
  LuaTable(lua_State* L, int index, std::string path, DiagnosticSink& sink);

  bool has(const std::string& key);
  /// A finite number in SI units, or a text with a unit of the same dimension: "30 deg". `unit` as in units.hpp.
  std::optional<double> number(const std::string& key, std::string_view unit = "1");
  /// The same in an array of n entries (any number if n = 0).
  std::optional<std::vector<double>> numbers(const std::string& key, std::size_t n, std::string_view unit = "1");
  /// The first entry, before keys that have names: {x, tolerance = ...}.
  std::optional<double> first();
  /// From `least` to `most`.
  std::optional<std::int64_t> integer(const std::string& key, std::int64_t least, std::int64_t most = std::numeric_limits<int>::max());
  std::optional<std::string> text(const std::string& key);
  std::optional<std::vector<std::string>> texts(const std::string& key);
  /// One of the given words.
  std::optional<std::string> choice(const std::string& key, const std::vector<std::string>& words);
  std::optional<bool> flag(const std::string& key);
  std::optional<LuaFunction> function(const std::string& key);
  std::optional<LuaTable> table(const std::string& key, std::string expected = "a table");
  /// The tables of an array; entry i has the path "phases[i]".
  std::vector<LuaTable> tables(const std::string& key);

  /// Reports each of these keys that is absent.
  void require(std::initializer_list<const char*> keys);
  /// Reports the value of a key that the binding does not accept.
  void reject(const std::string& key, const std::string& expected, const std::string& hint = {});
  /// Reports the keys that no getter has asked for.
  void finish();

  const std::string& path() const { return path_; }

 private:
  int get(const std::string& key);  // pushes the value, returns its type
  std::string path_of(const std::string& key) const;
  void report(const std::string& path, std::string expected, std::string got, std::string hint = {}, Code code = Code::lua_argument);
  std::optional<double> quantity(const std::string& path, std::string_view unit);  // of the value at the top

  lua_State* L_;
  int index_ = 0;
  std::string path_;
  DiagnosticSink* sink_;
  std::vector<std::string> known_;
  bool first_ = false;  // it is known
};

}  // namespace cardan
