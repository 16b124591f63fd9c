#pragma once
// Type name -> table. Built-in and foreign families are indistinguishable after registration.
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "core/abi/cardan_abi.h"
#include "core/base/diagnostic.hpp"

namespace cardan {

/// q begins with a unit quaternion w, x, y, z.
inline bool has_quaternion(const cardan_hinge_family& family) {
  return family.shape >= CARDAN_SHAPE_BALL && family.shape <= CARDAN_SHAPE_FREE_BODY;
}

class Registry {
 public:
  struct Entry {
    const cardan_hinge_family* family;
    std::string origin;  // "built-in" or the path of the plugin
  };
  /// Both `add` throw InputError (C0207) for a type that exists already.
  void add(const cardan_hinge_family& family, std::string origin = "built-in");
  const cardan_hinge_family* hinge(std::string_view type) const;  ///< null if unknown
  std::vector<std::string> hinge_types() const;                   ///< in order of registration
  const std::vector<Entry>& hinges() const { return hinges_; }

  void add(const cardan_body_family& family, std::string origin = "built-in");
  const cardan_body_family* body(std::string_view type) const;  ///< null if unknown
  std::vector<std::string> body_types() const;

 private:
  std::vector<Entry> hinges_;
  std::vector<const cardan_body_family*> bodies_;
};

/// A hinge of a plugin, and what is wrong with it.
struct PluginFamily {
  const cardan_hinge_family* family;
  std::string type;  ///< "no. 2" where the table has no type that can be shown
  std::vector<std::string> violations;
};

/// Opens a plugin, checks its version and its tables, and runs the executable laws on its families; all this in a process of its own
/// first, so that a plugin that crashes, never returns or ends the process is answered. Throws InputError (C0601 ... C0604). The
/// library stays loaded until the process ends.
std::vector<PluginFamily> examine_plugin(const std::string& path, int samples, const Located& at = {});

/// The same with fewer samples; then registers the families. Throws C0604 for the first violation as well.
void load_plugin(const std::string& path, Registry& registry, const Located& at = {});

}  // namespace cardan
