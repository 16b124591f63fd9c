#pragma once
// v' of the sweeps against the dense twin, which shares no formula with them (--check-against-reference).
#include <vector>

#include "core/io/range_recorder.hpp"
#include "core/io/summary.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {

inline constexpr double kReferenceLimit = 1e-9;  // rounding of both sides on stiff or badly scaled systems stays below; an error does not

/// The largest |v' - v' of the twin| at the present state, relative to what any one force causes by itself: in double, and in 113 bits
/// where that is not enough to blame anybody. Infinite where the twin finds no v'. InputError C0401 where it does not know the vehicle.
double difference_from_twin(Simulation& sim);

/// A channel of its own, `reference/difference`: the largest |v' - v' of the twin|, relative. Costs a dense solution per row. Refers to
/// the simulation.
Output reference_output(Simulation& sim);

/// Whether that channel stayed below the limit: fails where it was no number in any row, or was not recorded.
Check reference_check(const std::vector<Range>& ranges);

}  // namespace cardan
