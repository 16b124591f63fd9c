#pragma once
// What a script remembers from call to call: tables declared with persist{...} and the state of math.random, which a checkpoint holds; and
// all else that it keeps in variables, which none can hold and which is named instead.
#include <map>
#include <string>
#include <vector>

#include "core/base/checkpoint.hpp"
#include "scripts/lua/function.hpp"

namespace cardan {

class Persistent {
 public:
  /// Before any script runs.
  explicit Persistent(LuaHost& host);

  /// During set-up, inside protect: the table at `index` is one of those that are kept.
  void declare(lua_State* L, int index);
  // What follows throws InputError, at the place of the first declaration, where the script has no memory left or a person interrupts.
  /// The end of set-up, the first time it is called: from here on changes count.
  void seal();
  /// After seal(): the declared tables with all that is in them, and the state of math.random. Tables and vectors of set-up stay the same
  /// objects; functions and handles in them stay those of set-up.
  void remember(Archive& archive);
  /// Variables and fields that have changed since seal() and that no checkpoint holds: "error_now (scenario.lua:64)", the place being that
  /// of a function which keeps it. Sorted; at most kMost.
  std::vector<std::string> elsewhere();
  static constexpr std::size_t kMost = 20;

  // Of values that the script is given, inside protect:
  /// The value at the top, which stays there, as texts; false: it holds what no text can.
  bool write(lua_State* L, std::vector<std::string>& texts);
  /// Pushes the value that these texts hold.
  void read(lua_State* L, const Archive& archive, const std::vector<std::string>& texts);
  /// Where a coroutine stands, function by function, with all its variables; those that hold what is in a declared table, and is not of
  /// set-up, are named in `shared`.
  std::vector<std::string> stack_of(lua_State* coroutine, std::vector<std::string>& shared);

 private:
  /// A variable, or a field of a table: its name, and what it holds, numbers, texts and truths by value, others by what they are.
  struct Slot {
    std::string name, value;
  };
  using Slots = std::map<const void*, std::map<std::string, Slot>>;  // of each table and variable
  template <class Job>
  void protect(Job&& job);
  class Walk;
  class Writer;
  class Reader;

  LuaHost& host_;
  std::vector<LuaRef> declared_;
  SourceMark at_;                               // where the first of them is declared
  LuaRef objects_;                              // tables, vectors and matrices of set-up inside the declared tables: a list
  std::map<const void*, std::size_t> numbers_;  // of each in that list, from 1
  LuaRef random_;                               // the state of math.random
  bool sealed_ = false;
  long suspended_ = 0;  // coroutines that elsewhere() has met inside a function: each has changed
  Slots at_seal_;
};

}  // namespace cardan
