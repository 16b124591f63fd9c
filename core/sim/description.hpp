#pragma once
// What a model is made of: as data, as text, and as the parameters that a result is recorded with.
#include <string>
#include <utility>
#include <vector>

#include "core/io/json.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {

/// Bodies, masses, modes, gravity, program of sweeps, what is not modelled, at the present state. Costs of the program are counted, with
/// `measured` also timed. `n_modes` of the assembled system; negative: ten, of a system small enough.
Json describe(Simulation& sim, bool measured = false, int n_modes = -1);
/// Of the part `loops`: what the assembler moved.
Json moved_at_start(const std::vector<MovedAtStart>& moved);
/// All of describe() as text; with what its owner added: `warnings`.
std::string description_text(const Json& description);

/// Key path and value, with its unit, of each parameter as the model has it.
std::vector<std::pair<std::string, std::string>> effective_parameters(const Model& m);
/// The program of sweeps, a line per op, with what it costs.
std::string sweep_program(const Model& m, const State& state);
/// "dopri5, relative tolerance 1e-09"
std::string integrator_text(const SimulationOptions& options);

}  // namespace cardan
