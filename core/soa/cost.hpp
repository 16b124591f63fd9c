#pragma once
// What a right-hand side of a scene costs, counted on its own kernels: for `cardan describe`.
#include <string>
#include <vector>

#include "core/model/model.hpp"

namespace cardan::soa {

struct OpCost {
  std::string name;    // "outward (rotation about z)"
  int bodies = 0;      // bodies it works on
  long flops = 0;      // additions, multiplications, divisions, roots; without what families compute
  long functions = 0;  // sines and cosines
};

/// One entry per op of model.program, in order. The state only has to be valid.
std::vector<OpCost> op_costs(const Model& model, const State& state);
/// Bytes of working memory of one evaluation in double.
std::size_t workspace_bytes(const Model& model);

}  // namespace cardan::soa
