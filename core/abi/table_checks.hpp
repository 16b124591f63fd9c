#pragma once
// What is looked at in the table of a family of any kind before one of its functions is called.
#include <fmt/format.h>

#include <cstdint>
#include <string>
#include <vector>

#include "core/abi/cardan_abi.h"

namespace cardan {

// What no family needs, and what a table of garbage has.
inline constexpr std::uint32_t kMostParameters = 256, kMostVectors = 1000, kMostBytes = 1 << 20;
inline constexpr std::uint64_t kMostInstanceBytes = std::uint64_t{1} << 31;

/// Collects faults as "member: what".
class TableChecks {
 public:
  void expect(bool good, const std::string& member, const std::string& what) {
    if (!good) found_.push_back(member + ": " + what);
  }
  /// One line that can be shown; a name has no spaces, quotes and brackets.
  void text(const std::string& member, const char* value, bool name);
  void unit(const std::string& member, const char* value);
  /// n names and their units.
  void names(const std::string& names_member, const std::string& units_member, const char* const* list, const char* const* units,
             std::uint32_t n);
  void parameters(const cardan_param_desc* params, std::uint32_t n);

  bool good() const { return found_.empty(); }
  std::vector<std::string> take() { return std::move(found_); }

 private:
  void parameter(const std::string& member, const cardan_param_desc& p);

  std::vector<std::string> found_;
};

}  // namespace cardan
