#include "core/operators/linear_scope.hpp"

#include <fmt/format.h>

#include "core/model/components.hpp"
#include "core/model/device_units.hpp"

namespace cardan::operators::linear {

Scope scope_of(const Model& m, const TreeOperators* blocks) {
  Scope out{m, blocks};
  out.place.resize(m.nv), out.given.resize(m.nv);
  out.components.resize(blocks ? blocks->size(Space::hinge) : m.nv);
  for (int v = 0; v < m.nv; ++v) {
    const int i = out.place[v] = blocks ? blocks->place_of_velocity(v) : v;
    if (i >= 0) out.components[i] = v;
    out.given[v] = i >= 0 && ((m.has_prescribed() && m.prescribed[v]) || (blocks && !blocks->is_free(i)));
  }
  return out;
}

void keep_all_states(Scope& scope) {
  for (int i = 0; i < 2 * scope.nv() + scope.n_z(); ++i) scope.states.push_back(i);
}

namespace {

bool is_curved(const UserBody& u) { return u.nq > 0 && u.hinge->retract; }

/// "rad/s" -> "rad".
std::string without_second(const std::string& unit) { return unit.ends_with("/s") ? unit.substr(0, unit.size() - 2) : unit + " s"; }

}  // namespace

SpaceLabels state_labels(const Scope& scope) {
  SpaceLabels out;
  const int nv = scope.nv();
  out.names.resize(2 * nv), out.units.resize(2 * nv);
  for (std::size_t k = 0; k < scope.devices.size(); ++k)
    for (std::uint32_t i = 0; scope.devices[k] && i < scope.m.devices.all[k].family->n_states; ++i) {
      const Device& d = scope.m.devices.all[k];
      out.names.push_back(d.name + "." + d.family->states[i].name);
      out.units.push_back(unit_where(turns(scope.m, d), d.family->states[i].unit));
    }
  const auto put = [&](int i, std::string name, std::string unit) { out.names[i] = std::move(name), out.units[i] = std::move(unit); };
  for (const UserBody& u : scope.m.user) {
    if (!scope.has(u.sweep)) continue;
    for (int j = 0; j < u.nv; ++j) {
      const int i = scope.place[u.v + j];
      put(i, u.name + "." + deviation_name(u, j), is_curved(u) ? without_second(u.v_units[j]) : u.q_units[j]);
      put(nv + i, u.name + "." + u.v_names[j], u.v_units[j]);
    }
    for (int j = 0; j < u.n_modes; ++j) {
      const int i = scope.place[u.etadot + j];
      put(i, fmt::format("{}.eta_{}", u.name, j + 1), "1");
      put(nv + i, fmt::format("{}.etadot_{}", u.name, j + 1), "1/s");
    }
  }
  return out;
}

}  // namespace cardan::operators::linear
