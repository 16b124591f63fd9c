#pragma once
// Robot descriptions of others (URDF, MJCF) as vehicles in YAML (docs/import.md).
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/diagnostic.hpp"
#include "scripts/import/options.hpp"

namespace cardan {

struct Imported {
  std::string yaml;
  std::vector<std::string> notes;           // what was left out, and other things worth knowing
  std::map<std::string, SourceMark> marks;  // key paths of the vehicle, and where the robot file has what stands there
  int bodies = 0, loops = 0;

  /// The same answer at the place in the robot file that it is about.
  Diagnostic at_its_source(Diagnostic d) const;
};

/// `text` is URDF or MJCF, by its root element; `file` names it in answers and comments. Throws InputError.
Imported import_robot(std::string_view text, const std::string& file, const ImportOptions& options = {});

}  // namespace cardan
