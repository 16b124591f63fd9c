#pragma once
// A vehicle in absolute coordinates: each of its bodies flies by itself, and hinges of the tree close loops like all others
// (docs/mathematics/loops.md, 5).
#include <memory>
#include <string>
#include <vector>

#include "core/model/model.hpp"

namespace cardan {

struct AbsoluteModel {
  /// What a hinge of the vehicle became.
  struct Joint {
    int user, loop;  // its body; index into closed->loops.all
  };
  /// The bodies of the vehicle, in its order, each on a hinge `free` on the world, its own frame P; what is rigidly part of another one
  /// stays so. Without loops, devices, springs and given motions.
  std::shared_ptr<const Model> bodies;
  /// The same with what holds bodies to each other: the loops of the vehicle but couplings, then its hinges, of six components also.
  std::shared_ptr<const Model> closed;
  std::vector<Joint> joints;
  std::vector<int> loop_of;  // per loop of the vehicle: index into closed->loops.all, -1: a coupling
  std::vector<int> node_of;  // per node of the vehicle
};

/// What of a model the form does not take, "masses that change"; empty: it takes all.
std::string not_taken_absolutely(const Model& model);
/// InputError C0401 where there is such a thing.
std::shared_ptr<const AbsoluteModel> in_absolute_coordinates(const Model& model, const Registry& registry, const CompileOptions& options);

}  // namespace cardan
