#pragma once
// The workspace of the sweeps in double, and what goes into an evaluation.
#include "core/model/model.hpp"
#include "core/soa/kernels.hpp"

namespace cardan {

using Workspace = soa::Workspace<double>;
using Inputs = soa::Inputs<double>;
using NodeWrench = soa::NodeWrench<double>;

}  // namespace cardan
