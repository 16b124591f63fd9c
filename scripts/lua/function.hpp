#pragma once
// Lua values held by C++, and the fast way to call a script's function again and again: no allocation by C++ in a call.
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "scripts/lua/host.hpp"

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

/// A function of a script.
class LuaFunction : public LuaRef {
 public:
  LuaFunction() = default;
  explicit LuaFunction(LuaRef function) : LuaRef(std::move(function)) {}
  /// Numbers in, numbers out, within the host's call_budget(). Errors: as LuaHost::run_file; C0503 if a result is missing or not
  /// a finite number, or there are more than `out` takes. Returns how many values (but nil) it has returned where there is no `out`.
  int call(std::span<const double> in, std::span<double> out) const;
};

/// How many keys the table at `index` has, whatever they are: of a list as many as its length.
lua_Unsigned count_keys(lua_State* L, int index);

/// `"1e-9 m" (string)`, `12 (number)`, `{2, 1}`, `nil`: for `got`.
std::string describe_value(lua_State* L, int index);

}  // namespace cardan
