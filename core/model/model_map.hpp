#pragma once
// One model beside another one of the same vehicle: a description that was changed and compiled again.
#include <vector>

#include "core/model/model.hpp"

namespace cardan {

/// Where each part of a model is in another one: by names, whatever the order. Vectors by index in the first, with the index in the second,
/// -1 where it is not there.
struct ModelMap {
  std::vector<int> body, node, device;  // Model::user, Model::nodes, Devices::all
  std::vector<int> q, v;                // of hinges of one type, and of modes of one mass and stiffness
  std::vector<int> z, mark, in, out;    // of devices of one type
};
ModelMap model_map(const Model& from, const Model& to);

/// The map of a model to itself.
ModelMap identity(const Model& model);

/// First `first`, then `second`; what `second` adds follows at the end.
ModelMap then(const ModelMap& first, const ModelMap& second, const Model& last);

/// Which entry of a map leads to this index.
int id_of(const std::vector<int>& map, int index);

/// A model to go on with, and the state it goes on from.
struct Rejoined {
  std::shared_ptr<const Model> model;
  State state;
};

/// A state of the model `map` leads from, as one of the model `to` that it leads to; what is new starts as its description says.
State carried(const State& state, const ModelMap& map, const Model& to);

}  // namespace cardan
