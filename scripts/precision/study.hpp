#pragma once
// A scene run with many settings of its integrator, and a reference with its own error estimate. Each run is a process of its own,
// bounded in time; what was run before for the same inputs is taken from the folder.
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "core/io/run_columns.hpp"
#include "scripts/precision/choose.hpp"

namespace cardan {

struct PrecisionOrder {
  std::string program;                  // this program, by its path
  std::filesystem::path scenario, out;  // results: a folder for each run in out/runs
  Sets settings;                        // --set of the user
  std::string seed, until;              // as written; empty: not given
  std::string identity;                 // of all that the numbers depend on beside these and the integrator
  PrecisionSetting own;                 // what the scenario says
  std::vector<PrecisionSetting> grid;
  std::vector<PrecisionSetting> extended;   // two runs in extended precision that are tried before; none: there are none ...
  std::string not_extended;                 // ... because of this; empty: two others are wished
  double extended_cpu_s = 60.0;             // limit of one of them
  std::vector<PrecisionSetting> reference;  // methods, the best first; the tolerance is where they begin
  double loosest_reference = 1e-10;         // tolerance beyond which a run is no reference
  int jobs = 1;
  int repeats = 0;  // of each run, the least time counts; 0: of short ones up to five, as long as they take less than a second together
  double cpu_s = 600.0;    // limit of one run
  bool keep_runs = false;  // the channels of every run; else those of runs that others are measured by
  std::function<void(std::size_t done, std::size_t all, const PrecisionRow&, bool reference)> told;
  std::function<void(const std::string& without, const PrecisionRow&)> told_model;  // of a model that leaves something out
  std::function<bool()> stop;                                                       // true: start no more, end those that run
};

/// Two runs in extended precision at two tolerances; where a scene has none, in double by two methods, or, where one method alone gets
/// there, by one at two tolerances. The first is the truth of the table.
struct PrecisionReference {
  std::vector<PrecisionRow> runs;     // two; fewer: there is no reference
  std::vector<std::string> attempts;  // settings that did not get there, with their reasons
  bool one_method = false, extended = false;
  std::string why_double;  // "device wheel (motor), which computes in double"; empty: two methods were named
  KindErrors difference;   // of the second against the first: what the reference may be off by
};

/// By how much the two runs of a reference may differ, over the size of what is measured, for it to have converged.
inline constexpr double kConverged = 1e-6;

struct PrecisionStudy {
  std::string title, scenario;
  std::vector<std::string> about;  // lines: program, seed, settings
  PrecisionSetting own;            // what the scenario says
  PrecisionReference reference;
  std::vector<PrecisionRow> rows;   // that of the scenario itself first, unless one of the grid is the same
  bool complete = true;             // false: it was stopped
  std::size_t runs = 0, taken = 0;  // processes that ran, rows that were taken from an earlier study
  std::size_t kept = 0;             // rows whose results are there for a later study

  /// What the reference may be off by in this kind and measure, at least the last bit of what is recorded; 0 of balances. Without a
  /// reference NaN.
  double floor(std::size_t kind, ErrorMeasure measure) const;
  /// Kinds in which the two runs of the reference differ by more than kConverged of the size.
  std::vector<std::size_t> not_converged() const;
  /// Kinds that some row has, and that are not zero in all of them.
  std::vector<std::size_t> kinds() const;
};

/// By kind, for cheapest_within; infinite, which nothing keeps, where there is no reference.
std::vector<double> floors_of(const PrecisionStudy& study, ErrorMeasure measure);

/// Throws InputError C0701 for a folder that cannot be made.
PrecisionStudy run_study(const PrecisionOrder& order);
/// A run that others are measured by.
struct Yardstick {
  std::string folder;  // PrecisionRow::folder
  RunColumns columns;
};
/// Of a row whose setting is given, run again where its channels were not kept; empty: it failed, or its file cannot be read.
std::optional<Yardstick> yardstick(const PrecisionOrder& order, PrecisionStudy& study, PrecisionRow row);
/// More rows of a study, of which the setting is given, measured by each of these: PrecisionRow::against.
void run_rows(const PrecisionOrder& order, PrecisionStudy& study, const std::vector<PrecisionRow*>& rows,
              const std::vector<const Yardstick*>& by);

}  // namespace cardan
