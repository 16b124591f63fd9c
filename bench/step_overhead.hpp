#pragma once
// What a step of a run costs beyond its evaluations of forward dynamics.
#include <string>
#include <vector>

#include "core/abi/registry.hpp"

namespace cardan::bench {

struct StepOverhead {
  std::string model, op;
  int bodies;
  double min_ns, median_ns;  // per step
};

/// On 15 pendulums on the world (30 states), a task every second, steps of 0.01 s:
/// step_<method>: a whole step without the ledger; step_overhead_<method>: the loop of a run, the method and all of the right-hand side but
/// the sweeps, which the program of the model is relieved of (v' stays 0); step_ledger_<method>: what the ledger adds to a step, the median
/// of differences between runs with and without it, measured in turn.
std::vector<StepOverhead> step_overheads(const Registry& registry, double seconds);

}  // namespace cardan::bench
