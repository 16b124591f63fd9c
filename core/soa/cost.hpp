#pragma once
// What a right-hand side of a scene costs, counted on its own kernels: for `cardan describe`.
#include <functional>
#include <string>
#include <vector>

#include "core/model/model.hpp"
#include "core/soa/workspace.hpp"

namespace cardan::soa {

struct OpCost {
  std::string name;       // "outward (rotation about z)"
  int bodies = 0;         // bodies it works on, or devices
  long flops = 0;         // additions, multiplications, divisions, roots; without what families compute. Devices: -1, not counted
  long functions = 0;     // sines and cosines
  std::size_t bytes = 0;  // records of its bodies in double
  double ns = -1.0;       // measured; negative: not
};

/// One entry per op of model.program, in order. The state only has to be valid. Loads cost where they are given: none by default.
std::vector<OpCost> op_costs(const Model& model, const State& state, std::span<const NodeWrench<double>> wrenches = {});
/// Fills OpCost::ns: the time of the program up to an op less that up to the one before, each the least of many; a difference
/// of a few nanoseconds is noise. `act`: what the op `devices` does. Takes about 0.1 s.
void measure(const Model& model, const Inputs<double>& in, std::vector<OpCost>& costs,
             const std::function<void(Workspace<double>&)>& act = {});
/// Bytes of working memory of one evaluation in double.
std::size_t workspace_bytes(const Model& model);

}  // namespace cardan::soa
