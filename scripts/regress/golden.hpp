#pragma once
// golden.yaml: what a scenario must give, where that comes from, and how near it must come. The format: docs/golden.md.
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/diagnostic.hpp"
#include "core/io/compare_runs.hpp"

namespace cardan {

/// A claim about numbers: how near, and why not nearer.
struct Claim {
  Located at;
  Agreement agreement = Agreement::same_bits;
  Tolerance tolerance;  // absolute in `unit`
  std::string unit;     // of reference and tolerance; empty where each component of a recorded reference has its own
  std::string why;
};

/// A channel of run.h5 against its reference.
struct GoldenChannel : Claim {
  enum class Kind {
    rows,       // `times` and `values`, row by row
    always,     // `values` at every row of the run
    final,      // `values` at its last row
    statistics  // `values` are means, `deviations` beside them
  };
  std::string channel;
  std::vector<std::string> components;  // empty: all of the channel
  std::vector<std::string> named;       // where that is empty: all that a reference in the layout of run.h5 has, by name
  Kind kind = Kind::rows;
  std::vector<double> times;       // [s]
  std::vector<double> values;      // row-major, in `unit`, or in `units` of a recorded reference
  std::vector<double> deviations;  // of statistics; may be empty
  std::vector<std::string> units;  // one for each component; empty: `unit` for all
  std::size_t width = 0;           // numbers per row
  double independent = 0.0, confidence = 0.0;
  double from = -HUGE_VAL, to = HUGE_VAL;  // [s] of the rows that count
  std::string recorded;                    // file of our own numbers, that `--update` may write again; empty: a truth from elsewhere
  int every = 1;                           // of the rows of a run, how many a recorded reference keeps
  std::string compared_sweeps;             // instruction set that made a recorded reference
};

/// A figure or a check of the scenario by its name.
struct GoldenFigure : Claim {
  std::string name;
  double value = 0.0;  // in `unit`
};

/// Bounds on the balances of the run [-]; absent: the verdict of the run's own ledger.
struct GoldenLedger {
  Located at;
  std::optional<double> linear_momentum, angular_momentum, energy;
  std::string why;
};

/// A --set of the run.
struct GoldenSetting {
  Located at;
  std::string key, value;
};

/// What a script prints at the workbench: the same words, and numbers within the tolerance, each beside its own size.
struct GoldenPrint : Claim {
  std::filesystem::path file;
  std::string text;
};

/// Recorded references of a golden file: read; not read, since they will be written; or read as they wait, with the golden file itself,
/// beside those that they will replace (name_before).
enum class Recorded { in_place, unread, waiting };

struct Golden {
  std::string name;            // of the row: the folder, seen from the one that was searched
  std::filesystem::path file;  // golden.yaml, or NAME.golden.yaml for more than one in a folder
  std::string text;
  std::string truth;  // where the references come from
  std::filesystem::path scenario;
  std::vector<GoldenSetting> settings;
  std::string seed, until, kernels;              // as written; empty: not given. until [s]
  double cpu_s = 120.0;                          // of processor time
  double clock_s = 0.0;                          // by the clock; 0: ten times as much and a minute
  std::size_t memory = std::size_t{4} << 30;     // [bytes] of addresses
  std::size_t file_size = std::size_t{2} << 30;  // [bytes] of each file that it writes
  std::vector<GoldenChannel> channels;
  std::vector<GoldenFigure> figures;
  std::vector<std::pair<Located, std::string>> checks;  // that the scenario must have; all that it has must pass
  std::optional<GoldenLedger> ledger;
  std::filesystem::path script;  // run by the workbench on `scenario`, a vehicle or a scenario; empty: the scenario is run
  std::optional<GoldenPrint> prints;
  std::vector<Diagnostic> faults;  // where it is wrong: it is not run, or was refused for its settings

  std::filesystem::path folder() const { return file.parent_path(); }
  /// [s] Enough that a busy machine changes nothing; a process that waits for ever ends.
  double wall_s() const { return clock_s > 0.0 ? clock_s : 10.0 * cpu_s + 60.0; }
};

/// Reads and checks one file, its references included. Throws InputError with everything that is wrong.
Golden read_golden(const std::filesystem::path& file, const std::string& name, Recorded recorded = Recorded::in_place);

/// The text of a file. Throws InputError C0102, of a pipe or a device too: it would be waited for.
std::string text_of(const std::filesystem::path& file);

/// All golden files below `folder`, sorted by name: the folder of each as seen from `folder` ("." of the folder itself becomes its name),
/// of NAME.golden.yaml with "/NAME". Hidden files and folders, results (a folder `out`) and links to folders are left out. Throws
/// InputError C0102 for a folder that is not there or cannot be read, C0207 where two have one name.
std::vector<std::pair<std::string, std::filesystem::path>> find_goldens(const std::filesystem::path& folder);

/// Numbers with a head line "t [s], x [rad/s]", separated by commas; # begins a comment. Rows in the order of the file.
struct Table {
  std::vector<std::string> names, units;
  std::vector<double> values;  // row-major
};
/// Throws InputError: C0102, C0108 with the line of a number that is none, C0106 for a line of another length.
Table read_table(const std::filesystem::path& file);

}  // namespace cardan
