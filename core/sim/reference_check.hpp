#pragma once
// v' of the sweeps against the dense twin, which shares no formula with them (--check-against-reference).
#include <vector>

#include "core/io/range_recorder.hpp"
#include "core/io/summary.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {

inline constexpr double kReferenceLimit = 1e-9;  // rounding of both sides on stiff or badly scaled systems stays below; an error does not

/// A channel of its own, `reference/difference`: the largest |v' - v' of the twin|, relative. Costs a dense solution per row. Refers to
/// the simulation.
Output reference_output(Simulation& sim);

/// Whether that channel stayed below the limit: fails where it was no number in any row, or was not recorded.
Check reference_check(const std::vector<Range>& ranges);

}  // namespace cardan
