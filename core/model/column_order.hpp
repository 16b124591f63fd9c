#pragma once
// In which order columns of matrices stand while they are computed.
#include "core/model/sweep_model.hpp"

namespace cardan {

ColumnOrder column_order(const SweepModel& model);

}  // namespace cardan
