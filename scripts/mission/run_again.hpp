#pragma once
// A run that is repeated from its results: the texts come from them; files that are too large to be kept there are held to their hashes.
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/warnings.hpp"
#include "scripts/mission/scenario.hpp"

namespace cardan {

/// Where a run is resumed, and what its results hold up to there.
struct ResumePoint {
  double t = 0.0;  // [s]
  Checkpoint checkpoint;
  struct Column {
    std::vector<std::string> components;
    std::vector<double> values;  // row-major
  };
  std::vector<double> times;              // [s] of the rows
  std::map<std::string, Column> columns;  // by the path of the channel
  struct Noted {
    Note note;
    double t;
    std::vector<std::string> texts;
  };
  std::vector<Noted> notes;
  std::array<std::size_t, 4> left_out{};                               // by Note: notes that were only counted
  std::vector<std::pair<std::vector<double>, std::string>> intervals;  // of the history of steps
  std::vector<std::pair<double, std::string>> checkpoints;             // up to this one: time, text
  std::string resumed;                                                 // RunHeader::resumed, this time included
  bool at_its_end = false;                                             // the run that left it came to the end that it was given
};

/// What run.h5 tells about how it was made.
struct RecordedRun {
  std::shared_ptr<const RecordedInputs> inputs;
  ScenarioOptions options;  // file, settings, seed, inputs
  std::vector<std::string> command;
  std::optional<double> until;  // [s]
  bool check_against_reference = false;
  std::shared_ptr<const ResumePoint> resume;  // null: from the start
  Warnings warnings;                          // W0601 where this program, or the sweeps that it would run, are others
};

/// Throws InputError C0702: no results, damaged, or made before results kept what a repetition needs.
RecordedRun read_recorded_run(const std::string& h5_path);
/// The same, to go on from its last checkpoint, or from the last at or before `at` [s]. C0704 where there is none, or one that does not
/// hold all that the script keeps.
RecordedRun read_run_to_resume(const std::string& h5_path, std::optional<double> at);

}  // namespace cardan
