#pragma once
// Errors of a run by physical kind: what its channels are off by, against a reference at the same instants.
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/run_columns.hpp"

namespace cardan {

/// What is measured, each with one unit.
struct PrecisionKind {
  const char *name, *unit, *meaning;
  bool of_the_run_itself;  // a balance: its residual is the error, without a reference
};

/// attitude, position, angle, rate, velocity, modes, forces, signals, end, momentum, energy, constraint.
std::span<const PrecisionKind> precision_kinds();
std::size_t index_of_kind(std::string_view name);  ///< precision_kinds().size(): there is none of this name

/// The measures of the public solver benchmarks, of the error e_i at the recorded instants t_i: each the largest of the channels of
/// its kind, each channel by the Euclidean norm of its vector or the angle of its rotation.
struct KindError {
  double final = 0.0;    // at the last instant that both runs have
  double l2 = 0.0;       // root mean square over the instants
  double largest = 0.0;  // of all instants
  double size = 0.0;     // of the quantity itself in the reference: largest norm; 1 of what is relative already, and of rotations
  std::string channel;   // where the largest is
};
enum class ErrorMeasure { final, l2, largest };
std::string_view name_of(ErrorMeasure);
double value_of(const KindError&, ErrorMeasure);

/// By kind, as precision_kinds(); empty where the runs have no channel of it, or nothing of it moves.
using KindErrors = std::vector<std::optional<KindError>>;

/// Errors of `run`, with `reference` as the truth. Modes that `run` has left out count as zero. A number that one of the two alone has not
/// (NaN) is an infinite error.
KindErrors errors_of_run(const RunColumns& run, const RunColumns& reference);

}  // namespace cardan
