#pragma once
// Lua values held by C++, and the fast way to call a script's function again and again: no allocation by C++ in a call.
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "scripts/host/lua_host.hpp"

namespace cardan {

/// Keeps a Lua value alive; empty by default. Must not outlive its host.
class LuaRef {
 public:
  LuaRef() = default;
  /// Takes the value at the top of the stack (inside protect).
  static LuaRef pop(lua_State* L);
  LuaRef(LuaRef&& other) noexcept : host_(std::exchange(other.host_, nullptr)), ref_(other.ref_) {}
  LuaRef& operator=(LuaRef&& other) noexcept {
    std::swap(host_, other.host_);
    std::swap(ref_, other.ref_);
    return *this;
  }
  ~LuaRef();
  void push(lua_State* L) const { lua_rawgeti(L, LUA_REGISTRYINDEX, ref_); }
  explicit operator bool() const { return host_ != nullptr; }

 protected:
  LuaHost* host_ = nullptr;

 private:
  int ref_ = 0;
};

/// A number, or an array of `size` > 1 numbers.
struct LuaField {
  std::string name;
  int size = 1;
};

/// What is wrong with a table that should be a record: the field ("torque", "rate[2]"), what was expected and what
/// stands there.
struct LuaRecordFault {
  enum Kind { not_a_table, missing, extra, wrong_type, not_finite } kind;
  std::string field, expected, got;
};

/// A table of named numbers whose fields are known beforehand.
class LuaRecord {
 public:
  LuaRecord(LuaHost& host, std::vector<LuaField> fields);
  int n_values() const { return n_values_; }

  /// Pushes the record's own table, filled with `values` (n_values(), array after array). It is the same table at each
  /// call: a script that wants to remember values must copy the numbers, not the table.
  void push(lua_State* L, std::span<const double> values) const;

  /// Reads the table at `index` into `values`; every field must be there and finite, and nothing else. On a fault
  /// `values` is partly written.
  std::optional<LuaRecordFault> read(lua_State* L, int index, std::span<double> values) const;

 private:
  struct Field {
    LuaField is;
    LuaRef key, array;
  };
  std::optional<LuaRecordFault> fault(lua_State* L, LuaRecordFault::Kind kind, const Field* field, int element) const;
  std::optional<LuaRecordFault> read_number(lua_State* L, const Field& field, int element, double& value) const;

  std::vector<Field> fields_;
  LuaRef table_;
  int n_values_ = 0;
};

/// A function of a script.
class LuaFunction : public LuaRef {
 public:
  LuaFunction() = default;
  explicit LuaFunction(LuaRef function) : LuaRef(std::move(function)) {}
  /// Where the script defines it.
  SourceMark defined_at() const;
  /// Numbers in, numbers out. Errors: as LuaHost::run_file; C0503 if a result is missing or not a finite number.
  void call(std::span<const double> in, std::span<double> out, const LuaBudget& budget = kTickBudget) const;
  /// One call of a controller, f(t, input) -> output: the faults of the output are returned, those of the script
  /// thrown.
  std::optional<LuaRecordFault> tick(double t, const LuaRecord& input, std::span<const double> in,
                                     const LuaRecord& output, std::span<double> out,
                                     const LuaBudget& budget = kTickBudget) const;
};

/// `"1e-9 m" (string)`, `12 (number)`, `nil`: for `got`.
std::string describe_value(lua_State* L, int index);

}  // namespace cardan
