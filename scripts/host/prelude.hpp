#pragma once
#include <map>
#include <string>

namespace cardan {

/// The modules of the program itself (scripts/lua/cardan), name -> Lua text.
std::map<std::string, std::string> prelude_modules();

}  // namespace cardan
