#pragma once
// Where a result comes from: what a recorder is told before the first row.
#include <string>

#include "core/io/recorder.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {

/// All that a simulation knows of its origin: program, compiler, sweeps, the parameters and the initial state as the model has them (SI,
/// each with its unit), defaults, the program of sweeps, the integrator. What stands outside of it (files, seed, command) is the
/// caller's.
RunHeader run_header(const Simulation& sim);

/// Instruction set of the sweeps that run: "x86-64-v3".
std::string sweeps_name();
/// Value and unit as one text: "0.5 rad/s"; "1" is no unit.
std::string quantity_text(double x, const std::string& unit);

}  // namespace cardan
