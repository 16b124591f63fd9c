#pragma once
// In which order columns of matrices stand while they are computed.
#include "core/model/sweep_model.hpp"

namespace cardan {

/// The user's order where that is depth-first and takes few slots; else of siblings the one with most columns comes last, which takes
/// fewest.
ColumnOrder column_order(const SweepModel& model);

}  // namespace cardan
