#pragma once
// The files that `cardan new` writes, as text inside the program.
#include <map>
#include <string>

namespace cardan {

/// By their paths below plugins/templates.
std::map<std::string, std::string> project_templates();

}  // namespace cardan
