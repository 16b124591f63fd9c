#pragma once
// The page of a comparison: one HTML file that needs nothing else.
#include <optional>
#include <string>
#include <vector>

#include "core/io/compare_runs.hpp"

namespace cardan {

/// Something that was compared, or was to be.
struct DifferencePart {
  std::string kind, name, unit, agreement, text, why;
  bool pass = true;
  std::optional<Difference> worst;
  std::vector<double> t, is, reference;  // [s] and the numbers of both; empty: nothing to draw
};
struct DifferenceCase {
  std::string name, truth, text;  // text: what a run said that ended badly
  bool pass = true;
  double wall_s = 0.0;  // [s]; 0: not told
  std::vector<DifferencePart> parts;
};

/// The page as text. What differs is drawn with up to 2000 rows each, the rest with up to 300, the worst row always; beyond 8 MB of numbers
/// the rest is not drawn. facts: a line below the title. is, reference: what the two are called.
std::string differences_page(const std::string& title, const std::vector<std::string>& facts, const std::string& is,
                             const std::string& reference, const std::vector<DifferenceCase>& cases);

}  // namespace cardan
