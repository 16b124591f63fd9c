#pragma once
// Inputs and outputs of a linear model, from their names.
#include "core/operators/linear_scope.hpp"

namespace cardan::operators::linear {

/// One number that goes in or comes out.
struct Port {
  enum Kind {
    hinge,
    force,
    torque,
    state,
    position,
    velocity,
    acceleration,
    attitude,
    rate,
    specific_force,
    linear_momentum,
    angular_momentum,
    device_input,
    device_output
  } kind;
  int index;  // velocity component of the model, node, state, or port of devices
  int axis;   // of three
};
struct PortList {
  std::vector<Port> ports;
  SpaceLabels labels;
  bool has(std::initializer_list<Port::Kind> kinds) const {
    return std::any_of(ports.begin(), ports.end(),
                       [&](const Port& p) { return std::find(kinds.begin(), kinds.end(), p.kind) != kinds.end(); });
  }
};

/// states: state_labels(). InputError C0208 for an unknown name.
PortList inputs_of(const Scope& scope, const SpaceLabels& states, const std::vector<std::string>& wanted);
PortList outputs_of(const Scope& scope, const SpaceLabels& states, const std::vector<std::string>& wanted);

}  // namespace cardan::operators::linear
