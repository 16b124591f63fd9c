#include "core/operators/linear_ports.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <span>

#include "core/base/diagnostic.hpp"
#include "core/base/units.hpp"
#include "core/model/components.hpp"
#include "core/model/device_units.hpp"

namespace cardan::operators::linear {
namespace {

constexpr const char* kXyz[] = {"x", "y", "z"};

struct Quantity {
  const char* name;
  Port::Kind kind;
  const char* unit;
};
constexpr Quantity kLoads[] = {{"force", Port::force, "N"}, {"torque", Port::torque, "N m"}};
constexpr Quantity kSeen[] = {
    {"position", Port::position, "m"},   {"velocity", Port::velocity, "m/s"}, {"acceleration", Port::acceleration, "m/s^2"},
    {"attitude", Port::attitude, "rad"}, {"rate", Port::rate, "rad/s"},       {"specific_force", Port::specific_force, "m/s^2"}};
constexpr Quantity kMomentum[] = {{"linear", Port::linear_momentum, "N s"}, {"angular", Port::angular_momentum, "N m s"}};

[[noreturn]] void unknown(const char* side, const std::string& text, std::string expected, const std::vector<std::string>& legal) {
  refuse(Code::unknown_name, {fmt::format("{} of the linear model", side)}, std::move(expected), "\"" + text + "\"",
         did_you_mean(text, legal));
}

/// "tip:force.x" behind the colon: one or three of a list of quantities.
void add_quantity(PortList& out, const char* side, const std::string& text, std::size_t colon, int node, std::span<const Quantity> list) {
  std::string what = text.substr(colon + 1);
  int axis = -1;
  if (what.size() > 2 && what[what.size() - 2] == '.')
    for (int i = 0; i < 3; ++i)
      if (what.back() == *kXyz[i]) axis = i;
  if (axis >= 0) what.resize(what.size() - 2);
  std::vector<std::string> legal;
  for (const Quantity& q : list) {
    legal.emplace_back(q.name);
    if (what != q.name) continue;
    for (int i = 0; i < 3; ++i) {
      if (axis >= 0 && axis != i) continue;
      out.ports.push_back({q.kind, node, i});
      out.labels.names.push_back(fmt::format("{}:{}.{}", text.substr(0, colon), q.name, kXyz[i]));
      out.labels.units.emplace_back(q.unit);
    }
    return;
  }
  unknown(side, text, fmt::format("one of {} behind the colon, all three or .x, .y, .z", fmt::join(legal, ", ")), legal);
}

int node_of(const Scope& scope, const char* side, const std::string& text, std::size_t colon) {
  const std::string name = text.substr(0, colon);
  const int node = scope.m.find_node(name);
  if (node >= 0 && scope.has(scope.m.nodes[node].sweep)) return node;
  std::vector<std::string> legal;
  for (const UserNode& n : scope.m.nodes)
    if (scope.has(n.sweep)) legal.push_back(n.name);
  unknown(side, name, scope.expected("the name of a node, or of a body for its origin"), legal);
}

/// "wheel:torque"; false: there is no such device, or it takes no part.
bool add_device_port(PortList& out, const Scope& scope, const char* side, const std::string& text, std::size_t colon, std::uint32_t kind) {
  const Model& m = scope.m;
  const int device = m.devices.find(text.substr(0, colon));
  if (device < 0 || (!scope.devices.empty() && !scope.devices[device])) return false;
  const Device& d = m.devices.all[device];
  std::vector<std::string> legal;
  int index = kind == CARDAN_PORT_IN ? d.in : d.out;
  for (std::uint32_t i = 0; i < d.family->n_ports; ++i) {
    const cardan_port_desc& port = d.family->ports[i];
    if (port.kind != kind) continue;
    const int at = index++;
    if (kind == CARDAN_PORT_IN && m.devices.from[at] >= 0) continue;  // another device gives it
    legal.emplace_back(port.name);
    if (text.substr(colon + 1) != port.name) continue;
    out.ports.push_back({kind == CARDAN_PORT_IN ? Port::device_input : Port::device_output, at, 0});
    out.labels.names.push_back(text), out.labels.units.push_back(unit_where(turns(m, d), port.unit));
    return true;
  }
  unknown(side, text,
          legal.empty() ? fmt::format("another device: {} has none", d.name)
                        : fmt::format("one of {} behind the colon", fmt::join(legal, ", ")),
          legal);
}

}  // namespace

PortList inputs_of(const Scope& scope, const SpaceLabels& states, const std::vector<std::string>& wanted) {
  const Model& m = scope.m;
  PortList out;
  const auto add = [&](int i) {  // component of the hinge space
    const std::string &name = states.names[i], &rate = states.units[scope.nv() + i];
    const int v = scope.components[i];
    out.ports.push_back({Port::hinge, v, 0});
    out.labels.names.push_back(name);
    out.labels.units.push_back(!scope.given[v] ? force_unit(rate) : rate == "1/s" ? "1/s^2" : rate + "^2");
  };
  const auto add_hinge = [&](const UserBody& u) {
    for (int j = 0; j < u.nv; ++j) add(scope.place[u.v + j]);
  };
  if (wanted.empty())
    for (const UserBody& u : m.user)
      if (scope.has(u.sweep)) add_hinge(u);
  for (const std::string& text : wanted) {
    if (const std::size_t colon = text.rfind(':'); colon != std::string::npos) {
      if (!add_device_port(out, scope, "inputs", text, colon, CARDAN_PORT_IN))
        add_quantity(out, "inputs", text, colon, node_of(scope, "inputs", text, colon), kLoads);
      continue;
    }
    std::vector<int> found = components_of(m, text);
    std::erase_if(found, [&](int v) { return scope.place[v] < 0; });
    if (found.empty())
      unknown("inputs", text, scope.expected("a component of a hinge, a hinge, a mode, or NODE:force, NODE:torque"), states.names);
    for (const int v : found) add(scope.place[v]);
  }
  return out;
}

PortList outputs_of(const Scope& scope, const SpaceLabels& states, const std::vector<std::string>& wanted) {
  const Model& m = scope.m;
  PortList out;
  const auto add = [&](int i) {
    out.ports.push_back({Port::state, i, 0});
    out.labels.names.push_back(states.names[i]), out.labels.units.push_back(states.units[i]);
  };
  if (wanted.empty())
    for (const int i : scope.states) add(i);
  for (const std::string& text : wanted) {
    if (const std::size_t colon = text.rfind(':'); colon != std::string::npos) {
      if (text.starts_with("momentum:") && m.find_node("momentum") < 0)
        add_quantity(out, "outputs", text, colon, -1, kMomentum);
      else if (!add_device_port(out, scope, "outputs", text, colon, CARDAN_PORT_OUT))
        add_quantity(out, "outputs", text, colon, node_of(scope, "outputs", text, colon), kSeen);
      continue;
    }
    if (const int i = m.find_body(text); i >= 0 && m.user[i].nv + m.user[i].n_modes > 0 && scope.has(m.user[i].sweep)) {
      const UserBody& u = m.user[i];
      for (const int side : {0, scope.nv()}) {
        for (int j = 0; j < u.nv; ++j) add(side + scope.place[u.v + j]);
        for (int j = 0; j < u.n_modes; ++j) add(side + scope.place[u.etadot + j]);
      }
      continue;
    }
    const auto found = std::find(states.names.begin(), states.names.end(), text);
    if (found == states.names.end())
      unknown("outputs", text, scope.expected("a state, a hinge, NODE:position ... or momentum:linear, momentum:angular"), states.names);
    add(static_cast<int>(found - states.names.begin()));
  }
  return out;
}

}  // namespace cardan::operators::linear
