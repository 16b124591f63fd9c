#include "core/abi/registry.hpp"

#include <algorithm>

namespace cardan {

namespace {
[[noreturn]] void taken(const char* type, std::string origin) {
  refuse(Code::duplicate_name, {type, {std::move(origin)}}, "a type that is not taken yet", std::string("\"") + type + "\"",
         "prefix the type with the name of the plugin: \"acme/...\"");
}
}  // namespace

void Registry::add(const cardan_hinge_family& family, std::string origin) {
  if (hinge(family.type)) taken(family.type, std::move(origin));
  hinges_.push_back({&family, std::move(origin)});
}

void Registry::add(const cardan_body_family& family, std::string origin) {
  if (body(family.type)) taken(family.type, std::move(origin));
  bodies_.push_back(&family);
}

const cardan_body_family* Registry::body(std::string_view type) const {
  const auto it = std::ranges::find_if(bodies_, [&](const auto* f) { return type == f->type; });
  return it == bodies_.end() ? nullptr : *it;
}

std::vector<std::string> Registry::body_types() const {
  std::vector<std::string> types;
  for (const auto* f : bodies_) types.emplace_back(f->type);
  return types;
}

const cardan_hinge_family* Registry::hinge(std::string_view type) const {
  const auto it = std::ranges::find_if(hinges_, [&](const Entry& e) { return type == e.family->type; });
  return it == hinges_.end() ? nullptr : it->family;
}

std::vector<std::string> Registry::hinge_types() const {
  std::vector<std::string> types;
  for (const auto& e : hinges_) types.emplace_back(e.family->type);
  return types;
}

}  // namespace cardan
