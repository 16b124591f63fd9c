#pragma once
// Comparisons as pages: of scenarios with their golden files, and of two runs.
#include <string>
#include <vector>

#include "scripts/regress/judge.hpp"
#include "scripts/report/differences.hpp"

namespace cardan {

/// The page of what `cardan regress` found in `folder`.
std::string regression_page(const std::string& folder, const std::vector<CaseResult>& results);

struct Comparison {
  std::string first, second;              // run.h5 of both, or their folders
  double relative = 0.0, absolute = 0.0;  // Tolerance; both 0: the same bits
  bool at_common_times = false;
  std::string page, json;  // files to write; empty: none
  bool quiet = false;      // the verdict alone
  bool as_json = false;    // errors
};
/// Compares, tells the differences on standard output, and returns the exit code: 0 the same, 1 different, 4 the same, and a file could not
/// be written.
int compare(Comparison comparison);

}  // namespace cardan
