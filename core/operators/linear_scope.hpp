#pragma once
// What a linear model is of, and what its states are called.
#include <string>
#include <vector>

#include "core/dynamics/loop_tangent.hpp"
#include "core/operators/tree_operators.hpp"

namespace cardan::operators::linear {

/// What the model is of: all bodies, or those of a tree.
struct Scope {
  const Model& m;
  const TreeOperators* blocks = nullptr;         // articulated, by which v' is found; null: all bodies, by the sweeps of forward dynamics
  std::vector<int> components = {}, place = {};  // of the hinge space: velocity component of the model; and back, -1 for others
  std::vector<std::uint8_t> given = {};          // per velocity component of the model
  std::vector<std::uint8_t> devices = {};        // per device: it is in the model; empty: none is
  std::vector<int> z = {};                       // of the states of the model that are states of devices: which of those of all devices
  void take(std::vector<std::uint8_t> taken) {
    devices = std::move(taken);
    for (std::size_t i = 0; i < devices.size(); ++i)
      for (std::uint32_t j = 0; devices[i] && j < m.devices.all[i].family->n_states; ++j)
        z.push_back(m.devices.all[i].z + static_cast<int>(j));
  }
  int n_z() const { return static_cast<int>(z.size()); }
  LoopTangents* loops = nullptr;  // of a vehicle with closed loops; m is its open tree
  std::vector<int> states = {};   // of all 2 nv + n_z: those of the linear model; with loops the independent ones
  int nv() const { return static_cast<int>(components.size()); }
  const Part* part() const { return blocks ? blocks->part() : nullptr; }
  bool has(int sweep) const { return !part() || part()->takes_part[sweep] != 0; }
  /// Of those that are asked for by name.
  std::string expected(std::string what) const { return part() ? what + ", of the bodies that take part" : what; }
};
Scope scope_of(const Model& model, const TreeOperators* blocks);
void keep_all_states(Scope& scope);

/// Of all 2 nv + n_z.
SpaceLabels state_labels(const Scope& scope);

}  // namespace cardan::operators::linear
