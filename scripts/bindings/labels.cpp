#include "scripts/bindings/labels.hpp"

#include <fmt/format.h>

namespace cardan {
namespace {

void append(Labels& labels, const std::string& body, const std::vector<std::string>& names, const std::vector<std::string>& units) {
  for (const std::string& name : names) labels.names.push_back(body + "." + name);
  labels.units.insert(labels.units.end(), units.begin(), units.end());
}
void append_modes(Labels& labels, const UserBody& u, const char* name, const char* unit) {
  for (int j = 1; j <= u.n_modes; ++j) labels.names.push_back(fmt::format("{}.{}_{}", u.name, name, j));
  labels.units.insert(labels.units.end(), static_cast<std::size_t>(u.n_modes), unit);
}

}  // namespace

Labels coordinate_labels(const Model& m) {
  Labels all;
  for (const UserBody& u : m.user) {
    append(all, u.name, u.q_names, u.q_units);
    append_modes(all, u, "eta", "1");
  }
  return all;
}

Labels velocity_labels(const Model& m) {
  Labels all;
  for (const UserBody& u : m.user) {
    append(all, u.name, u.v_names, u.v_units);
    append_modes(all, u, "etadot", "1/s");
  }
  return all;
}

}  // namespace cardan
