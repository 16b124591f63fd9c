#pragma once
// What a person at a prompt asks of Lua values: how they look, and how a name goes on. Nothing of the script's runs
// here but __tostring.
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "scripts/lua/host.hpp"
#include "scripts/lua/reference.hpp"

namespace cardan {

/// The value at `index` as text (inside protect): numbers with the digits that give them back, tables one level deep in the
/// order of `pairs`, the rest as `tostring` has it.
std::string value_text(lua_State* L, int index);

/// A number with six digits: in matrices and tables.
std::string short_text(double x);

/// What completion knows beyond the values of the script.
struct CompletionSources {
  const ApiReference* api = nullptr;  // what calls return: sat:hinge("wheel"):
  /// Names for a text in quotes, by the word before the quote.
  std::function<std::vector<std::string>(std::string_view word)> names = [](std::string_view) { return std::vector<std::string>(); };
};

/// How the expression at the end of `line` may go on: globals, fields, after a colon methods, also of userdata (by the table in
/// __index, or the names in __members) and of what methods return; in quotes names. Nothing is called.
struct Completion {
  std::size_t start = 0;           // where the unfinished name begins in `line`
  std::vector<std::string> names;  // whole names that begin with it, sorted
};
Completion complete(LuaHost& host, std::string_view line, const CompletionSources& sources = {});

}  // namespace cardan
