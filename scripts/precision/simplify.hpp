#pragma once
// What of a model an error budget has no need of: each simplification by itself, then as many together as keep the budget.
#include <functional>
#include <string>
#include <vector>

#include "scripts/precision/study.hpp"

namespace cardan {

struct Simplification {
  std::string group;    // those of one stand in each other's place, the mildest first
  std::string what;     // "wing: 3 of 8 modes"
  Sets sets;            // as `--set` takes them
  std::string refusal;  // why the scene does not take it; empty: it does
};

/// A model as it ran.
struct SimplifiedRun {
  std::vector<std::size_t> of;  // what is left out, indices into SimplifiedModel::all; none: nothing
  PrecisionRow row;             // its errors are those against the reference
  KindErrors added;             // by how much it differs from the whole model with the same setting; empty where that was another one
  double operations = 0.0;      // counted: those of one evaluation of v', times evaluations
};

struct SimplifiedModel {
  std::vector<Simplification> all;
  std::vector<SimplifiedRun> runs;  // the whole model, each simplification by itself that was tried, then several together
  std::size_t chosen = 0;           // of runs: the cheapest that keeps the budget
};

/// Starts from a row of the study that keeps the budgets. Of groups of more than three those are tried that bisection asks for: what is
/// milder is taken to err less. Where the study was stopped, what ran until then.
/// operations: of one evaluation of v' with these values.
SimplifiedModel simplify(const PrecisionOrder& order, PrecisionStudy& study, std::vector<Simplification> all,
                         const std::vector<ErrorBudget>& budgets, ErrorMeasure measure, std::size_t row,
                         const std::function<double(const Sets&)>& operations);

}  // namespace cardan
