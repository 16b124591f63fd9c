#pragma once
#include <lua.h>

#include <string_view>

namespace cardan {

/// Opens the safe part of the standard library and replaces what is unsafe, unbounded or differs between runs:
/// - absent: os, io, debug, package, dofile, loadfile, collectgarbage, warn, string.dump;
/// - pairs, next: numbers ascending, strings by their bytes, false, true, then other keys in order of creation;
/// - tostring, string.format: "table: #1" by order of first printing, never an address;
/// - setmetatable refuses finalisers (they run outside the budget) and weak tables (they show when memory is
/// collected);
/// - load takes text only; math.randomseed needs a seed; table.sort is stable;
/// - each function that can work long is charged to the budget, patterns included; pcall does not catch a budget's end.
void open_sandbox(lua_State* L, std::uint64_t seed);

/// Pushes what `tostring` gives for the value at `index`.
std::string_view push_text(lua_State* L, int index);

/// Pushes an array of the keys of a table in the order of `pairs`; returns how many.
lua_Integer push_keys(lua_State* L, int table);

// The parts, each working on the library table at the top of the stack or on the globals.
void open_order(lua_State* L);     // lua_order.cpp: pairs, next, tostring, print, string.format, table.sort
void open_patterns(lua_State* L);  // lua_pattern.cpp: string.find, match, gmatch, gsub

}  // namespace cardan
