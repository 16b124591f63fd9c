#pragma once
// What came out of a study, for a screen, for programs and for the page.
#include <optional>
#include <string>
#include <vector>

#include "core/io/json.hpp"
#include "scripts/precision/simplify.hpp"

namespace cardan {

/// What was asked beside the table.
struct PrecisionQuestion {
  ErrorMeasure measure = ErrorMeasure::largest;
  std::optional<double> wanted;      // error of each kind by itself, in its unit
  std::vector<ErrorBudget> budgets;  // errors of several kinds, all at once
};

/// The reference, a line for each row with the Pareto front of each kind (by processor time) marked *, and what cannot be trusted.
std::string precision_table(const PrecisionStudy& study, const std::vector<std::size_t>& kinds, ErrorMeasure measure);
/// The settings that are recommended.
std::string precision_answers(const PrecisionStudy& study, const PrecisionQuestion& question);
/// Of one choice among rows that are measured as those of the study: the setting, its time and error; where none keeps the budget, the
/// nearest, and whether the reference is the reason.
std::string choice_text(const std::vector<PrecisionRow>& rows, const PrecisionStudy& study, const PrecisionChoice& choice,
                        const std::vector<ErrorBudget>& budgets, ErrorMeasure measure);

/// What may be left out of the model: each with the error it adds and what it saves, and what was chosen.
std::string simplified_text(const SimplifiedModel& model, const PrecisionStudy& study, const PrecisionQuestion& question);

/// model: null where nothing was left out, or could be.
Json precision_json(const PrecisionStudy& study, const PrecisionQuestion& question, const SimplifiedModel* model = nullptr);
/// docs/precision.md has the layout. Throws InputError C0701, NumericsError N0204.
void write_precision_h5(const std::string& path, const PrecisionStudy& study, const SimplifiedModel* model = nullptr);
/// `--set`s of a setting, a line each, as `--settings` reads them. about: lines of comment before it.
std::string settings_text(const PrecisionSetting& setting, const PrecisionSetting& own, const std::vector<std::string>& about);

}  // namespace cardan
