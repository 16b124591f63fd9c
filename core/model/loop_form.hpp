#pragma once
// Words about closed loops that the description, the model and the sweeps share.
#include <cstdint>
#include <string>
#include <vector>

namespace cardan {

/// Which rows close a loop (docs/mathematics/loops.md).
enum class Closing : std::uint8_t { weld, point, line, plane, distance, hinge, coupling };
/// How the loops of a vehicle are closed; dae: all bodies in absolute coordinates, for comparison.
enum class LoopForm : std::uint8_t { automatic, multipliers, embedding, dae };

/// How a set of loops that share hinges is closed, and why.
struct LoopSet {
  std::vector<int> loops;
  std::string form;  // "rates", "multipliers in the sweep", "multipliers", "multipliers of all bodies"
  std::string why;   // empty: it is the cheaper one
  long flops = 0;
};

}  // namespace cardan
