#pragma once
// What the laws of a kind tried on one family, law by law.
#include <cstddef>
#include <string>
#include <vector>

namespace cardan {

struct TriedLaw {
  std::string law;
  std::size_t trials = 0, broken = 0;
  std::string untried;              // why there are no trials
  bool measured = false;            // it has an error and a limit, else it holds or does not
  double error = 0.0, limit = 0.0;  // of the sample whose error is the largest part of its limit
  int sample = 0;                   // that sample, or the first that broke the law
  std::string where;                // which of several numbers
};
using LawRecord = std::vector<TriedLaw>;

}  // namespace cardan
