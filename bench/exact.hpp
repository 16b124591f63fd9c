#pragma once
#include <Eigen/Core>
#include <filesystem>

#include "bench/bench_model.hpp"
#include "core/model/model.hpp"

namespace cardan::bench {

/// What is to come out for one state, by the same sweeps in 113 bits on the very same doubles, rounded at the end; nv numbers
/// each, user's order. Rigid bodies, and flexible ones at level 0; the last two of rigid bodies only.
struct Exact {
  Eigen::VectorXd vdot;      // of q, v, tau
  Eigen::VectorXd tau;       // of q, v, vdot of the state
  Eigen::VectorXd M_vdot;    // M(q) times vdot of the state: what a mass matrix is checked with
  Eigen::VectorXd Minv_tau;  // M(q)^-1 times tau of the state
};

/// Of the first three states. `spec` is compiled without merging and re-chosen frames.
std::vector<Exact> exact(const BenchModel& bm, const Registry& registry);

/// |computed - exact| / |exact| in the 2-norm; infinite where it is not a number.
double relative_error(const Eigen::VectorXd& computed, const Eigen::VectorXd& exact);

/// Writes DIR/<name>.json, from which the peers read the same.
void write_exact(const std::filesystem::path& folder, const BenchModel& bm, const std::vector<Exact>& states);

}  // namespace cardan::bench
