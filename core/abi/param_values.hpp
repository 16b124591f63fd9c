#pragma once
// The host's side of cardan_param_values: a small named table that a family reads in pack().
#include <map>
#include <string>
#include <vector>

#include "core/abi/cardan_abi.h"

namespace cardan {

/// Values of one instance, already in SI and complete (defaults filled in).
struct ParamTable {
  std::map<std::string, std::vector<double>, std::less<>> numbers;
  std::map<std::string, std::string, std::less<>> texts;
  std::vector<std::pair<std::string, std::string>> failures;  // parameter, what was expected

  /// View for the C side; valid while this table lives and is not changed.
  cardan_param_values view();
};

/// Runs the pack of a family (null: nothing to pack); returns an empty buffer when it failed (see failures). The buffer is aligned to 8
/// bytes.
std::vector<double> pack(std::size_t bytes, int (*pack)(const cardan_param_values*, void* packed), ParamTable& values);

}  // namespace cardan
