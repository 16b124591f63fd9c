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
/// step_overhead_<method>: the loop of a run, the method and all of the right-hand side but the sweeps, which the program of
/// the model is relieved of (v' stays 0); step_ledger_<method>: what the ledger adds to a step, with all sweeps.
std::vector<StepOverhead> step_overheads(const Registry& registry, double seconds);

}  // namespace cardan::bench
