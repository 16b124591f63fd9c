#pragma once
// What a loop would cost were it cut at another of its hinges (docs/adr/0016-cuts-of-loops.md): for `cardan describe`.
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/abi/registry.hpp"
#include "core/model/model.hpp"

namespace cardan {

/// The same mechanism with the hinge of `body`, which is on the way of this loop, cut, and what closes the loop in the tree instead: the
/// bodies between turn round. Of its start: no rates; without springs, loads of hinges, devices. None where one of the two, or a hinge
/// between, cannot change sides: revolute, ball and prismatic hinges of the tree do, and closures by lines, points, revolutes and balls.
std::optional<SystemSpec> cut_at(const Model& model, std::string_view loop, std::string_view body);

/// Additions and multiplications of inward and outward sweeps with the loops in them, by formula (Embedding::flops).
struct CutCost {
  std::string loop, hinge;  // a body, whose hinge would be cut
  long flops = 0;
};
struct CutCosts {
  long flops = 0;               // as it is
  std::vector<CutCost> others;  // one loop cut elsewhere, all others as they are; in the order of the loops, each from home outward
  bool all = true;              // false: there are more than were counted
};
/// Empty where loops are not closed inside of the sweeps.
std::optional<CutCosts> cut_costs(const Model& model, const Registry& registry);

}  // namespace cardan
