#pragma once
// Devices of every kind that comes with Cardan on the nodes and hinges of a tree.
#include <fmt/format.h>

#include <map>
#include <random>

#include "core/base/diagnostic.hpp"
#include "core/dynamics/observe.hpp"
#include "core/dynamics/part.hpp"
#include "tests/support/builders.hpp"

namespace cardan::test {

inline ParamValue number(double x) { return {x, {}}; }

inline DeviceSpec device(const std::string& name, const std::string& type, const std::vector<std::pair<std::string, double>>& numbers,
                         const std::vector<std::pair<std::string, std::string>>& mounts) {
  DeviceSpec d;
  d.name = name, d.type = type;
  for (const auto& [key, x] : numbers) d.params[key] = number(x);
  for (const auto& [key, target] : mounts) d.mounts[key] = {target, {}};
  return d;
}

inline DeviceSpec with_vector(DeviceSpec d, const std::string& key, const Eigen::Vector3d& x) {
  d.params[key].value = std::vector<double>(x.data(), x.data() + 3);
  return d;
}

/// What is said of a system that is refused.
inline std::string refusal(const SystemSpec& spec) {
  try {
    compiled(spec);
  } catch (const InputError& e) {
    return e.what();
  }
  return "it compiled";
}

/// Springs between nodes, wheels on nodes, friction on hinges.
inline SystemSpec with_devices(SystemSpec spec, unsigned seed) {
  const auto bare = compiled(spec);
  std::mt19937 random(seed);
  const auto any = [&](const auto& all) { return all[random() % all.size()]; };
  const auto x = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  std::vector<std::string> nodes, components;
  std::map<std::string, Eigen::Vector3d> places;  // of nodes at a hinge, there is no line between the two
  Workspace ws(*bare);
  Observer observer(*bare, ws);
  const State at = bare->initial_state();
  const Inputs in{.q = at.q.data(), .v = at.v.data()};
  outward(*bare, soa::sweeps<double>(), ws, in, {});
  observer.update(in, nullptr);
  for (const UserNode& n : bare->nodes) nodes.push_back(n.name), places[n.name] = observer.node(bare->find_node(n.name)).position;
  for (const UserBody& u : bare->user)
    for (int i = 0; i < u.nv; ++i)  // friction has a corner where its rate is zero, which differences would reach over
      if ((!bare->has_prescribed() || bare->prescribed[static_cast<std::size_t>(u.v + i)] == 0) && std::abs(at.v[u.v + i]) > 0.05)
        components.push_back(u.name + "." + u.v_names[static_cast<std::size_t>(i)]);
  for (int i = 0; i < 3; ++i) {
    const std::string from = any(nodes), to = any(nodes);
    if ((places[from] - places[to]).norm() > 1e-3)
      spec.devices.push_back(device(fmt::format("spring_{}", i), "spring_damper",
                                    {{"stiffness", x(1, 20)}, {"rest", x(0, 1)}, {"damping", x(0, 2)}}, {{"from", from}, {"to", to}}));
  }
  DeviceSpec wheel = device("wheel", "momentum_wheel", {{"inertia", x(0.01, 0.1)}, {"viscous", x(0, 0.01)}}, {{"at", any(nodes)}});
  wheel.params["axis"].value = std::vector<double>{x(-1, 1), x(-1, 1), 1.0};
  wheel.initial["momentum"] = number(x(-1, 1));
  wheel.inputs["torque"] = {x(-0.1, 0.1), {}};
  spec.devices.push_back(std::move(wheel));
  if (components.empty()) return spec;
  DeviceSpec friction = device("friction", "lugre_friction",
                               {{"coulomb", x(0.1, 1)},
                                {"breakaway", 1.5},
                                {"stribeck_rate", 0.5},
                                {"stiffness", x(5, 20)},
                                {"damping", x(0, 1)},
                                {"viscous", x(0, 0.3)},
                                {"fading_rate", 2.0}},
                               {{"at", any(components)}});
  friction.initial["bending"] = number(x(-0.02, 0.02));
  spec.devices.push_back(std::move(friction));
  return spec;
}

/// And what follows the motion of a node.
inline SystemSpec with_followers(const SystemSpec& bare, unsigned seed) {
  SystemSpec spec = with_devices(bare, seed);
  const auto nodes = compiled(bare)->nodes;
  spec.devices.push_back(device("counter", "integrating_imu", {}, {{"at", nodes[seed % nodes.size()].name}}));
  spec.devices.back().rate = 10.0;
  return spec;
}

}  // namespace cardan::test
