#pragma once
// What can be said about a scenario before it runs.
#include "scripts/mission/scenario.hpp"

namespace cardan {

/// The warnings of the vehicle, and those that need the mission and the initial state: rates beyond what linear modes can tell,
/// prescribed hinges that nothing moves, ticks, results and matrices that grow large. Into Scenario::warnings. Throws InputError for
/// a body at the centre of a central field, for `ida` with tolerances below the rounding of places and for a controller that would never
/// get through.
void examine(Scenario&);

/// What is recorded: bodies, hinges, modes, ledger, what the mission asks for, and signals.
std::vector<Output> mission_outputs(Scenario&);

/// Throws InputError for a body nearer to the centre of central gravity than its radius of gyration: the law makes no sense there.
void expect_away_from_centre(const std::shared_ptr<const Model>&, const double* q);
/// Prescribed components that stand still and were given no motion.
Warnings still_hinges(const Simulation&);
/// Devices that wait to catch something, as a mark `closed` says, and have not: `missed`, another one, says how often they could have.
Warnings open_latches(const Simulation&);
/// Faults of ports that were still to begin when the run ended.
Warnings faults_to_come(const Simulation&);
/// [s] Between ticks of its controllers, or rows.
double shortest_interval(const Scenario&);
/// True if the script has functions that run during the mission: what stands still before it may move then.
bool scripts_act(const Scenario&);

/// What a run does first: forward dynamics at the initial state, and each event's function. Throws NumericsError, InputError.
void try_start(Scenario&);
/// After it: sequences go as far as their first waits. Their commands are left behind: no run follows.
void try_sequences(Scenario&);
/// After try_start(): what the script keeps outside of persist{} once its first phase has begun, sequences wait and each controller has
/// ticked, in the first instant of a run. Their commands are left behind: no run follows.
std::vector<std::string> kept_elsewhere_at_start(Scenario& s);
/// After it: checks and figures whose functions fail. What these change is left behind: no run follows.
Warnings measures_at_start(Scenario& s);

}  // namespace cardan
