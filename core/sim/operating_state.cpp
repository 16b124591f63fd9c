#include "core/sim/operating_state.hpp"

#include "core/dynamics/fields.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {

OperatingState operating_state(Simulation& sim) {
  const Model& m = sim.model();
  const DeviceForces* devices = sim.devices();
  OperatingState out{.t = sim.time(),
                     .v = sim.state().v,
                     .tau = Eigen::VectorXd(m.nv),
                     .vdot = Eigen::VectorXd::Zero(m.nv),
                     .wrenches = {sim.wrenches().begin(), sim.wrenches().end()},
                     .model = sim.own_model(),
                     .devices = devices ? std::make_shared<const DeviceForces>(*devices) : nullptr,
                     .moment = kept_moment(m, sim.gravity_moment()),
                     .drives = {sim.drives().begin(), sim.drives().end()},
                     .seed = sim.options().seed};
  const std::vector<double> tau = sim.applied_forces();
  std::copy(tau.begin(), tau.end(), out.tau.data());
  for (int v = 0; v < m.nv; ++v)
    if (m.has_given_motion(v)) out.vdot[v] = sim.vdot()[v];
  return out;
}

}  // namespace cardan
