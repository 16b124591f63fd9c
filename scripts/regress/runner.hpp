#pragma once
// Scenarios with their golden files, run side by side: each in a process of its own, bounded in time and memory.
#include <filesystem>
#include <functional>
#include <vector>

#include "core/base/child_process.hpp"
#include "scripts/regress/judge.hpp"

namespace cardan {

struct RegressionRun {
  std::string program;        // this program, by its path
  std::filesystem::path out;  // results: a folder for each scenario in it
  int jobs = 1;               // side by side
  std::string record;         // not empty: why the recorded references are written anew; the goldens were read without them
  std::function<void(const CaseResult&)> told;  // called when one is done, in any order
  std::function<bool()> stop;                   // true: start no more, end those that run
};

/// Whether the references of a golden file can be recorded, as far as it tells without a run. Throws InputError: C0801 where it has none,
/// C0701 where another file has the name of one, C0106 where nothing can be added to its `updates`.
void expect_recordable(const Golden& golden, const std::string& why);

/// Records the references of a golden file that was read without them from the results in `folder`: every file named by `recorded`, and
/// the reason among the `updates` of the golden file. They are written beside those that are there and take their place together, where
/// all rows of the case pass; nothing is touched otherwise.
std::vector<ClaimRow> record_references(Golden& golden, const std::filesystem::path& folder, const RunEnding& ending,
                                        const std::string& why);

/// What became of a run of `cardan` with --json-errors that has ended: bounded by `limits`, its standard error in the file `errors`.
RunEnding ending_of_run(const RunningProgram& process, const ChildLimits& limits, const std::filesystem::path& errors);

/// Runs and compares them all; results in the order of `goldens`. What is stopped has RunEnding::How::not_run, and so has a golden file
/// with faults.
std::vector<CaseResult> run_goldens(std::vector<Golden>& goldens, const RegressionRun& how);

}  // namespace cardan
