#pragma once
// What scripts find in place of parts of Lua's standard library (LuaHost::open_libraries).
#include <lua.h>

#include <string_view>

namespace cardan {

/// Pushes what `tostring` gives for the value at `index`.
std::string_view push_text(lua_State* L, int index);

/// Pushes an array of the keys of a table in the order of `pairs`; returns how many.
lua_Integer push_keys(lua_State* L, int table);

// The parts, each working on the library table at the top of the stack or on the globals.
void open_order(lua_State* L);     // order.cpp: pairs, next, tostring, print, string.format, table.sort
void open_patterns(lua_State* L);  // pattern.cpp: string.find, match, gmatch, gsub

}  // namespace cardan
