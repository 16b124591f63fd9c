#pragma once
// The channels of a run: what its bodies, hinges and modes do, and what else is asked for.
#include <vector>

#include "core/sim/simulation.hpp"

namespace cardan {

struct OutputOptions {
  std::vector<int> reactions{};  // user bodies: the wrench that the inboard hinge transmits
  std::vector<int> nodes{};      // indices into Model::nodes: how they move
};

/// Attitude, rate, place and velocity of bodies on quaternion hinges; coordinates, velocities and forces of all other hinges; modes;
/// what the options ask for; the residuals of the ledger where it is on. Units and frames stand in each channel. The outputs refer to
/// the simulation and its model. What nobody asks for is not computed.
std::vector<Output> standard_outputs(Simulation& sim, const OutputOptions& wanted = {});

/// What Recorder::begin() is to be told of them.
std::vector<Channel> channels_of(const std::vector<Output>& outputs);

}  // namespace cardan
