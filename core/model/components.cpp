#include "core/model/components.hpp"

#include <fmt/format.h>

namespace cardan {
namespace {

/// The names of component j of a hinge, the first one that of its velocity.
std::vector<std::string> names_of(const UserBody& u, int j) {
  const auto at = static_cast<std::size_t>(j);
  std::vector<std::string> out{u.v_names[at], deviation_name(u, j)};
  if (u.has_attitude() && j >= 3) out.push_back(u.q_names[at + 1]);  // x, y, z behind a quaternion
  return out;
}

}  // namespace

std::string deviation_name(const UserBody& u, int j) {
  const bool is_curved = u.nq > 0 && u.hinge->retract;
  if (!is_curved) return u.q_names[j];
  if (!u.has_attitude()) return "d_" + u.v_names[j];
  return fmt::format("{}_{}", j < 3 ? "turn" : "shift", "xyz"[j % 3]);
}

std::vector<int> components_of(const Model& model, std::string_view name) {
  std::vector<int> out;
  for (const UserBody& u : model.user) {
    if (!name.starts_with(u.name)) continue;
    const std::string_view rest = name.substr(u.name.size());
    if (rest.empty()) {
      for (int j = 0; j < u.nv; ++j) out.push_back(u.v + j);
    } else if (rest[0] == '.') {
      const std::string_view part = rest.substr(1);
      for (int j = 0; j < u.nv; ++j)
        for (const std::string& known : names_of(u, j))
          if (part == known && (out.empty() || out.back() != u.v + j)) out.push_back(u.v + j);
      for (int j = 0; j < u.n_modes; ++j)
        if (part == "eta" || part == "etadot" || part == fmt::format("eta_{}", j + 1) || part == fmt::format("etadot_{}", j + 1))
          out.push_back(u.etadot + j);
    }
    if (!out.empty()) return out;  // names of bodies differ, and have no point
  }
  return out;
}

std::string component_name(const Model& model, int v) {
  for (const UserBody& u : model.user) {
    if (v >= u.v && v < u.v + u.nv) return u.name + "." + deviation_name(u, v - u.v);
    if (v >= u.etadot && v < u.etadot + u.n_modes) return fmt::format("{}.eta_{}", u.name, v - u.etadot + 1);
  }
  return fmt::format("component {}", v);
}

std::vector<std::string> component_names(const Model& model) {
  std::vector<std::string> out;
  for (const UserBody& u : model.user) {
    if (u.nv > 0) out.push_back(u.name);
    for (int j = 0; j < u.nv; ++j)
      for (const std::string& name : names_of(u, j)) out.push_back(u.name + "." + name);
    for (int j = 1; j <= u.n_modes; ++j) out.push_back(fmt::format("{}.eta_{}", u.name, j));
  }
  return out;
}

}  // namespace cardan
