#pragma once
// What a run comes to: printed at its end, written to summary.json and shown at the top of the report.
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/step_interval.hpp"
#include "core/base/warnings.hpp"

namespace cardan {

/// An acceptance check of the scenario, or a measured figure with its unit.
struct Check {
  std::string name;
  double value = 0.0, limit = 0.0;  // limit: the nearer of the two bounds
  bool pass = false;
  std::string unit, detail;
  double least = -HUGE_VAL, most = HUGE_VAL;  // what is permitted; infinite: no bound
};
struct Figure {
  std::string name;
  double value = 0.0;
  std::string unit;
};

/// Balances: |residual| over the largest sum of magnitudes over bodies, external impulse and work subtracted [-].
struct Ledger {
  double linear_momentum = 0.0, angular_momentum = 0.0, energy = 0.0;
  double linear_limit = 0.0, angular_limit = 0.0, energy_limit = 0.0;  // what the errors of the steps explain of each
  bool pass = true;                                                    // none is above its limit
  std::vector<std::string> undecided{};                                // limits of these judge nothing: "linear momentum"
};

/// Size of the model: counts of bodies, hinges, coordinates q, velocities v, modes.
struct ModelSize {
  int bodies = 0, hinges = 0, n_q = 0, n_v = 0, n_modes = 0;
};

/// How a run ended.
enum class Verdict {
  passed,       // at its end, and every check passed (or there is none)
  failed,       // at its end, and a check did not pass
  interrupted,  // by a signal, before its end: checks were not worked out
  aborted       // by a failure, which Summary::failure tells
};
std::string_view name_of(Verdict);  ///< "passed"

struct Summary {
  std::string scenario;
  Verdict verdict = Verdict::passed;
  std::string ended_by;  // "the planned end", "stop() in event \"docked\"", "SIGTERM", "N0101: ..."
  std::optional<RunFailure> failure;
  std::vector<Check> checks;
  std::optional<Ledger> ledger;                             // absent: the mission has none
  double simulated_s = 0.0, planned_s = 0.0, wall_s = 0.0;  // planned: the end that the run was to reach
  double cpu_s = 0.0;                                       // of processor time, from the first step to the last
  long steps = 0, rhs_calls = 0, rejected = 0, restarts = 0;
  long jacobian_products = 0, preconditioner_setups = 0, linear_iterations = 0;  // of the linear solver "krylov", else 0
  long inner_steps = 0;                                                          // of the method "multirate", else 0
  StepInterval integration;                                                      // of the whole run
  std::vector<std::pair<std::string, long>> worst;  // by component how many steps its error set the length of, the largest number first
  std::vector<Figure> figures;
  std::vector<Figure> drawn;  // parameters that chance set, in SI
  Warnings warnings;
  std::vector<std::string> kept_elsewhere;  // variables of the script that change outside of persist{}: the run cannot be resumed
  ModelSize model;
  std::string final_state;                                    // SHA-256 of t, q, v, z at the end; empty: not reached
  std::vector<std::pair<std::string, std::string>> hashes{};  // of the times and of each channel: RangeRecorder::hashes
  std::map<std::string, std::string> versions;                // program, compiler, libraries
};

/// The text of summary.json. Throws NumericsError N0108 when a number is not finite; of a run that was aborted such numbers are null.
std::string to_json(const Summary& summary);

}  // namespace cardan
