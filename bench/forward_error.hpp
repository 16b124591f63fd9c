#pragma once
#include <Eigen/Core>

#include "bench/bench_model.hpp"
#include "core/model/model.hpp"

namespace cardan::bench {

/// Relative error (2-norm) of vdot against the same sweeps in 113 bits on the very same doubles. Rigid bodies, and flexible
/// ones at level 0 (families compute in double).
double forward_error(const Model& model, const BenchState& state, const Eigen::VectorXd& vdot);

}  // namespace cardan::bench
