#pragma once
#include <map>
#include <string>
#include <vector>

namespace cardan {

/// The modules of the program itself (scripts/prelude/cardan), name -> Lua text.
std::map<std::string, std::string> prelude_modules();
/// All annotated files: meta.lua, then the modules.
std::vector<std::string> reference_files();

}  // namespace cardan
