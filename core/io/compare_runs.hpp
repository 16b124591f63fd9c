#pragma once
// How much two series of one quantity differ, and whether that is permitted: of a run and a reference, or of two runs.
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/run_columns.hpp"

namespace cardan {

/// What keeps two right programs from giving the same number, and with it what a tolerance means.
enum class Agreement {
  same_bits,    // nothing: the numbers are equal bit by bit
  round_off,    // the order of operations and the instruction set
  integration,  // the steps: their tolerance or their size
  truth,        // the truth itself: digits that were printed, terms that its theory leaves out
  statistical   // chance: mean and deviation lie where they are with the stated confidence
};
std::string_view name_of(Agreement);  ///< "same bits"

/// |difference| <= absolute + relative * scale, where scale is the largest magnitude of the reference over all times and all components of
/// the same unit. Both zero: no difference is permitted.
struct Tolerance {
  double absolute = 0.0;  // in the unit of the numbers compared
  double relative = 0.0;
};

/// The worst of one component.
struct Difference {
  double difference = 0.0;  // |is - reference|; 0 where both are the same that is not finite, NaN where one of them is not
  double limit = 0.0;       // what was permitted there
  double t = 0.0;           // [s] where; NaN where time has no meaning
  double is = 0.0, reference = 0.0;
  bool pass = true;
  /// Part of the limit that was used; infinite where nothing is permitted and something differs.
  double share() const {
    return difference == 0.0 ? 0.0 : std::isnan(difference) || limit == 0.0 ? std::numeric_limits<double>::infinity() : difference / limit;
  }
};

/// Rows of a run and of a reference at the same times. `is` and `reference` hold one component each, row by row; `scale` as of Tolerance.
/// Bits are compared where `agreement` is same_bits. What is not finite is the same where both are (all NaN alike) and else differs, with
/// any tolerance. Without rows nothing agrees.
Difference worst_difference(std::span<const double> times, std::span<const double> is, std::span<const double> reference, double scale,
                            const Tolerance& tolerance, Agreement agreement);

/// Rows of two grids of times that are the same instant: within 1e-9 s and 1e-12 of the time, which the conversion of a decimal time
/// leaves. Times ascend.
struct CommonRows {
  std::vector<std::size_t> first, second;  // indices, pair by pair
};
CommonRows common_rows(std::span<const double> first, std::span<const double> second);

/// Whether mean and deviation of `values` are those stated: each of the two tests is passed by a right program with a probability such
/// that both together are by `confidence`. `independent`: how many of the values count as independent of each other. The first
/// difference is of the mean (normal distribution), the second of the deviation (chi-squared, by the cube root of Wilson & Hilferty
/// 1931). No deviation: the mean alone, with the deviation of the values themselves (Student's distribution is replaced by the normal
/// one, so at least 30 values must be independent).
struct Statistics {
  Difference mean;
  std::optional<Difference> deviation;
};
Statistics compare_statistics(std::span<const double> values, double mean, std::optional<double> deviation, double independent,
                              double confidence);

/// One component of one channel of two runs.
struct ComponentDifference {
  std::string channel, component, unit;
  Difference worst;
  std::vector<double> not_finite;  // [s] where both are the same that is not finite: no difference, but told
};

/// Two runs, `second` as the reference of `first`, at the times that both have. Residuals of the ledger and of loops are relative numbers
/// as they are: their scale is at least 1.
struct RunDifference {
  std::size_t rows = 0;                                    // compared
  std::size_t rows_of_first = 0, rows_of_second = 0;       // in all
  std::vector<std::string> only_in_first, only_in_second;  // paths of channels
  std::vector<std::string> misfits;                        // "bodies/bus/rate: components x, y, z against x, y"
  std::vector<ComponentDifference> components;             // of channels that both have, in the order of `first`
  bool same_times() const { return rows == rows_of_first && rows == rows_of_second; }
  bool pass(bool at_common_times) const;
};
RunDifference compare_runs(const RunColumns& first, const RunColumns& second, const Tolerance& tolerance, Agreement agreement);

}  // namespace cardan
