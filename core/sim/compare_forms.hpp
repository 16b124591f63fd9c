#pragma once
// The three ways in which closed loops are solved, beside each other at one state (docs/mathematics/loops.md): `cardan describe --forms`.
#include <optional>
#include <string>
#include <vector>

#include "core/sim/simulation.hpp"

namespace cardan {

/// Largest differences, each relative to the largest number that it is compared with, of multipliers and reactions also to what the
/// accelerations of all bodies take: on a vehicle that falls freely they are zero.
struct ComparedForm {
  LoopForm form = LoopForm::embedding;
  std::string refused;       // what it does not take of this vehicle; then there are no numbers
  double vdot = 0.0;         // of v' from that of the dense twin, relative to what any one force causes by itself (reference_check.hpp)
  double multipliers = 0.0;  // from those of the first form that takes the vehicle
  double reactions = 0.0;    // of wrenches of all hinges, likewise; moments and forces each by itself
};
struct ComparedForms {
  std::string no_twin;              // why v' is compared with that of the first form
  std::vector<ComparedForm> forms;  // embedding, multipliers, dae
};

/// At the present state of a simulation that has not run, as compiled by `options`. Empty where no loop is closed.
std::optional<ComparedForms> compare_forms(Simulation& sim, const Registry& registry, const CompileOptions& options);

}  // namespace cardan
