#pragma once
// The motion that a prescribed component of a hinge, or a prescribed loop, is given.
#include <string>

#include "core/sim/motion_profile.hpp"
#include "scripts/bindings/bind.hpp"
#include "scripts/lua/table.hpp"

namespace cardan {

/// Exactly one of the keys rate_table, sine, hold of `t`, which is at index 2; `rate`: its unit, "rad/s". Faults go to the table's sink.
MotionProfile read_profile(lua_State* L, LuaTable& t, const std::string& rate);

}  // namespace cardan
