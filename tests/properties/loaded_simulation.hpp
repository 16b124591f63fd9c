#pragma once
// A random tree under its loads as a simulation: forces of actuators, wrenches on nodes, given components in motion.
#include "core/sim/simulation.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {

/// sim: of compiled(tree.spec) with world wrenches, before its run.
inline void set_loads(Simulation& sim, const RandomTree& tree) {
  const Model& m = sim.model();
  const Eigen::VectorXd tau = in_user_order(m, tree.tau);
  for (int i = 0; i < m.nv; ++i) sim.set_force(i, tau[i]);
  for (const Load& l : tree.loads) sim.set_wrench(sim.add_wrench(m.find_node(l.body + "." + l.node), l.world_axes), force(l.wrench.data()));
  for (std::size_t i = 0; i < m.prescribed.size(); ++i)
    if (m.prescribed[i]) sim.prescribe(static_cast<int>(i), MotionProfile::sine(0.1, 0.7, 0.3));
}

}  // namespace cardan::test
