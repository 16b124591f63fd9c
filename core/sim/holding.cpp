#include "core/sim/holding.hpp"

namespace cardan {

Holding::Holding(const Model& model, Model* own)
    : model_(model), workspace_(model), observer_(model, workspace_), devices_(model, own), forces_(model.devices.holds.size()) {
  for (std::vector<double>* x : {&tau_, &needed_, &vdot_}) x->resize(static_cast<std::size_t>(model.nv));
}

bool Holding::look(const DeviceForces& known, const Inputs& in, double t, const double* z, const double* marks) {
  devices_.commands = known.commands;
  tau_.assign(in.tau, in.tau + model_.nv);
  wrenches_.assign(in.wrenches.begin(), in.wrenches.end());
  devices_.set({t, z, marks, tau_.data(), wrenches_.data()});
  Inputs use = in;
  use.tau = tau_.data(), use.wrenches = wrenches_;
  if (!forward_dynamics(model_, workspace_, use, vdot_.data(), &devices_)) return false;
  observer_.prescribed_forces(use, vdot_.data(), needed_.data());
  for (std::size_t i = 0; i < forces_.size(); ++i) {
    const DeviceHold& h = model_.devices.holds[i];
    const auto v = static_cast<std::size_t>(h.v);
    forces_[i] = model_.prescribed[v] != 0 ? Force{needed_[v] - tau_[v], devices_.most_held(h.device), true} : Force{};
  }
  return true;
}

}  // namespace cardan
