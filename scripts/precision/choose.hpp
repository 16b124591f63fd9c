#pragma once
// What a digit costs: the Pareto front of settings, and the cheapest that keeps an error.
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "scripts/precision/kinds.hpp"
#include "scripts/precision/settings.hpp"

namespace cardan {

/// A setting and what became of its run.
struct PrecisionRow {
  PrecisionSetting setting;
  bool own = false;                     // as the scenario has it
  std::string failure;                  // why there are no numbers; empty: there are
  double cpu_s = 0.0, process_s = 0.0;  // [s] of processor time: of the integration, of the whole process; least of the repeats
  int repeats = 1;
  long steps = 0, rhs_calls = 0, rejected = 0, restarts = 0, jacobian_products = 0;
  bool checks_passed = true;
  std::string ended_by;                       // "the planned end"
  double end_s = 0.0;                         // [s] simulated
  KindErrors errors;                          // against the reference
  std::map<std::string, KindErrors> against;  // likewise, by the folder of each run that it was measured by
  bool taken = false;                         // from an earlier study
  std::string folder;                         // of the results, seen from that of the study
};

enum class RunCost { cpu, rhs_calls, steps };
std::string_view name_of(RunCost);
double cost_of(const PrecisionRow& row, RunCost cost);
/// Of a row that ended; empty: it did not, or has nothing of this kind.
std::optional<double> error_of(const PrecisionRow& row, std::size_t kind, ErrorMeasure measure);

/// Rows that no other beats: none is as good in cost and error and better in one. `floor`: what the reference itself may be off by;
/// errors below it count as equal to it. Indices by ascending cost.
std::vector<std::size_t> pareto_front(const std::vector<PrecisionRow>& rows, std::size_t kind, ErrorMeasure measure, RunCost cost,
                                      double floor);

/// What must be kept: an error of a kind, in its unit.
struct ErrorBudget {
  std::size_t kind;
  double most;
};
struct PrecisionChoice {
  std::optional<std::size_t> row;      // the cheapest that keeps all; else
  std::optional<std::size_t> nearest;  // that which comes nearest: the smallest of the largest ratios of error and budget
  double ratio = 0.0;                  // of the row or the nearest: largest of error over budget
};
/// A row keeps a budget where its error, or `floors` if they are larger, is at most that, and so is that of every tighter rung of the same
/// method that was run: what is met by chance is not met. floors: by kind.
PrecisionChoice cheapest_within(const std::vector<PrecisionRow>& rows, const std::vector<ErrorBudget>& budgets,
                                const std::vector<double>& floors, ErrorMeasure measure, RunCost cost);

}  // namespace cardan
