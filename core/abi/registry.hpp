#pragma once
// Type name -> table. Built-in and foreign families are indistinguishable after registration.
#include <algorithm>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/abi/cardan_abi.h"
#include "core/abi/cardan_body.h"
#include "core/abi/cardan_device.h"
#include "core/abi/cardan_field.h"
#include "core/abi/hinge_slopes.hpp"
#include "core/base/diagnostic.hpp"

namespace cardan {

/// q begins with a unit quaternion w, x, y, z.
inline bool has_quaternion(const cardan_hinge_family& family) {
  return family.shape >= CARDAN_SHAPE_BALL && family.shape <= CARDAN_SHAPE_FREE_BODY;
}
/// The body has modal coordinates; its mass and nodes are those of its modal data.
inline bool has_modes(const cardan_body_family& family) { return family.mass_source == CARDAN_MASS_MODES; }

/// The families of one kind, in order of registration.
template <class Table>
class Families {
 public:
  struct Entry {
    const Table* family;
    std::string origin;  // "built-in" or the path of the plugin
  };
  /// Throws InputError (C0207) for a type that exists already. `at`: where the plugin is asked for; none: its path.
  void add(const Table& family, std::string origin = "built-in", const Located& at = {}) {
    if (const Entry* taken = entry(family.type))
      refuse(Code::duplicate_name, at.mark.file.empty() ? Located{family.type, {origin}} : at, "a type that is not taken yet",
             std::string("\"") + family.type + "\" twice: " + taken->origin + ", and " + origin,
             "prefix the type with the name of the plugin: \"acme/...\"");
    all_.push_back({&family, std::move(origin)});
  }
  const Entry* entry(std::string_view type) const {
    const auto it = std::ranges::find_if(all_, [&](const Entry& e) { return type == e.family->type; });
    return it == all_.end() ? nullptr : &*it;
  }
  /// Null if unknown.
  const Table* find(std::string_view type) const {
    const Entry* e = entry(type);
    return e ? e->family : nullptr;
  }
  bool has(const Table& family) const {
    return std::ranges::any_of(all_, [&](const Entry& e) { return e.family == &family; });
  }
  std::vector<std::string> types() const {
    std::vector<std::string> types;
    for (const Entry& e : all_) types.emplace_back(e.family->type);
    return types;
  }
  const std::vector<Entry>& all() const { return all_; }

 private:
  std::vector<Entry> all_;
};

class Registry {
 public:
  Families<cardan_hinge_family> hinges;
  Families<cardan_body_family> bodies;
  Families<cardan_device_family> devices;
  Families<cardan_field_family> fields;

  /// Derivatives take a hinge by what it tells of its slopes; else by differences of eighth order of what its table fills.
  void add_slopes(const cardan_hinge_family& family, HingeSlopes told) { slopes_.emplace_back(&family, told); }
  HingeSlopes slopes(const cardan_hinge_family& family) const {  ///< null: by differences
    const auto it = std::ranges::find_if(slopes_, [&](const auto& s) { return s.first == &family; });
    return it == slopes_.end() ? nullptr : it->second;
  }

  const cardan_hinge_family* hinge(std::string_view type) const { return hinges.find(type); }     ///< null if unknown
  const cardan_body_family* body(std::string_view type) const { return bodies.find(type); }       ///< null if unknown
  const cardan_device_family* device(std::string_view type) const { return devices.find(type); }  ///< null if unknown
  const cardan_field_family* field(std::string_view type) const { return fields.find(type); }     ///< null if unknown

 private:
  std::vector<std::pair<const cardan_hinge_family*, HingeSlopes>> slopes_;
};

struct FamilyKind;

/// A family of a plugin, and what is wrong with it.
struct PluginFamily {
  const FamilyKind* kind;
  const void* family;   ///< its table, as the host keeps it; null where it cannot be read
  std::string type;     ///< "no. 2" where the table has no type that can be shown
  std::string summary;  ///< empty where the table is refused
  std::vector<std::string> violations;
};

/// Opens a plugin, checks its version and its tables, and runs the executable laws on its families; all this in a process of its own
/// first, so that a plugin that crashes, never returns or ends the process is answered. Throws InputError (C0601 ... C0605). The
/// library stays loaded until the process ends.
std::vector<PluginFamily> examine_plugin(const std::string& path, int samples, const Located& at = {});

/// The same with fewer samples; then registers the families. Throws C0604 for the first violation as well.
void load_plugin(const std::string& path, Registry& registry, const Located& at = {});

}  // namespace cardan
