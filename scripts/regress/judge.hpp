#pragma once
// The results of a run against its golden file: a row for each claim.
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/io/json.hpp"
#include "scripts/regress/golden.hpp"

namespace cardan {

/// One claim and what became of it.
struct ClaimRow {
  std::string kind;  // "run", "check", "channel", "figure", "ledger", "prints", "golden"
  std::string name;  // "bodies/bus/rate x"
  std::string unit, agreement, why;
  std::optional<Difference> worst;    // of what was compared
  std::optional<Diagnostic> problem;  // why nothing could be compared, or what was wrong
  std::string note;                   // what there was where nothing was compared
  bool pass = true;
  std::vector<double> t, is, reference;  // of rows that were compared, for plots; empty for one number
};

/// What became of the process.
struct RunEnding {
  enum class How { ended, crashed, out_of_time, out_of_memory, not_run };
  How how = How::ended;
  int exit_code = 0;
  std::string text;                  // "killed by Segmentation fault", "more than 10 s of processor time"
  double wall_s = 0.0, cpu_s = 0.0;  // [s]
  /// By itself, with its results, whatever its checks found.
  bool as_planned() const { return how == How::ended && (exit_code == 0 || exit_code == 1); }
  /// A full disk, a folder that others hold or a signal was the reason: another time it ends otherwise. Who failed and says nothing could
  /// not even write that.
  bool from_outside() const;
  std::vector<std::string> complaints;  // codes with their titles and texts, as --json-errors gives them
};

struct CaseResult {
  std::string name;
  const Golden* golden = nullptr;
  std::filesystem::path folder;  // of the results
  RunEnding ending;
  std::vector<ClaimRow> rows;
  bool pass() const;
  /// The row that used most of its limit, or the first that failed; null: none.
  const ClaimRow* worst() const;
};

/// In the folder of the results: what the run printed.
inline constexpr const char* kPrinted = "printed.txt";

/// A failed row of this kind.
ClaimRow failed_row(std::string kind, std::string name, Diagnostic problem);
/// Failed rows of a golden file that is wrong.
std::vector<ClaimRow> rows_of(const std::vector<Diagnostic>& faults);

/// The rows of a run that ended as planned, in `folder`; of any other run the row "run" alone.
std::vector<ClaimRow> judge(const Golden& golden, const std::filesystem::path& folder, const RunEnding& ending);

/// "34 % of 1e-9 rad/s at t = 12 s"
std::string difference_text(const ClaimRow& row);
std::string share_text(const Difference& difference);

}  // namespace cardan
