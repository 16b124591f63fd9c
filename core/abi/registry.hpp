#pragma once
// Type name -> table. Built-in and foreign families are indistinguishable after registration.
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "core/abi/cardan_abi.h"
#include "core/base/diagnostic.hpp"

namespace cardan {

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
  const cardan_body_family* body(std::string_view type) const;    ///< null if unknown
  std::vector<std::string> body_types() const;

 private:
  std::vector<Entry> hinges_;
  std::vector<const cardan_body_family*> bodies_;
};

/// Opens a plugin, checks its version, runs the executable laws on its families and registers them.
/// Throws InputError (C0601 ... C0604). The library stays loaded until the process ends.
void load_plugin(const std::string& path, Registry& registry, const Located& at = {});

}  // namespace cardan
