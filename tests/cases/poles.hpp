#pragma once
// Poles of linear models against those of a closed form.
#include <algorithm>
#include <cmath>
#include <complex>
#include <span>
#include <vector>

#include "core/operators/linear_model.hpp"
#include "core/operators/system_modes.hpp"
#include "core/sim/simulation.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {

/// About the start, under these loads.
inline operators::LinearModel linear_at_start(const Model& model, std::span<const NodeWrench> loads = {}) {
  const State s = model.initial_state();
  return operators::linearize(model, {.q = s.q.data(), .v = s.v.data(), .wrenches = loads});
}

/// With devices.
inline operators::LinearModel linear_at_start(Simulation& sim) {
  return operators::linearize(sim.model(),
                              {.q = sim.state().q.data(), .v = sim.state().v.data(), .wrenches = sim.wrenches(), .devices = sim.devices()});
}

/// From this pole to the nearest of them.
inline double distance_of(const std::vector<operators::Pole>& poles, std::complex<double> wanted) {
  double least = kInfinity;
  for (const operators::Pole& p : poles) least = std::min(least, std::abs(p.value - wanted));
  return least;
}

}  // namespace cardan::test
