#pragma once
// The host's side of cardan_param_values: a small named table that a family reads when it packs an instance.
#include <map>
#include <string>
#include <vector>

#include "core/abi/cardan_abi.h"

namespace cardan {

/// Values of one instance, already in SI and complete (defaults filled in).
struct ParamTable {
  std::map<std::string, std::vector<double>, std::less<>> numbers;
  std::map<std::string, std::string, std::less<>> texts;  // of a file its path
  std::map<std::string, std::string, std::less<>> bytes;  // of a file its content
  struct Failure {
    std::string name, expected, got, hint;  // no name: the instance as a whole; no `got`: the value that stands there
  };
  std::vector<Failure> failures;

  /// View for the C side; valid while this table lives and is not changed.
  cardan_param_values view();
};

/// Runs the pack of a family (null: nothing to pack) on a block of so many bytes, aligned to 8; an empty buffer when it failed, and then
/// there is a failure.
std::vector<double> pack(std::size_t bytes, int (*pack)(const cardan_param_values*, void* packed), ParamTable& values);

}  // namespace cardan
