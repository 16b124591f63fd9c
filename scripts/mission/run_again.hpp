#pragma once
// A run that is repeated from its results: the texts come from them; files that are too large to be kept there are held to their hashes.
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/warnings.hpp"
#include "scripts/mission/scenario.hpp"

namespace cardan {

/// What run.h5 tells about how it was made.
struct RecordedRun {
  std::shared_ptr<const RecordedInputs> inputs;
  ScenarioOptions options;  // file, settings, seed, inputs
  std::vector<std::string> command;
  std::optional<double> until;  // [s]
  bool check_against_reference = false;
  Warnings warnings;  // W0601 where this program, or the sweeps that it would run, are others
};

/// A whole number from 0 to 2^64 - 1 in decimal digits, and nothing else.
std::optional<std::uint64_t> parse_seed(std::string_view text);

/// Throws InputError C0702: no results, damaged, or made before results kept what a repetition needs.
RecordedRun read_recorded_run(const std::string& h5_path);

}  // namespace cardan
