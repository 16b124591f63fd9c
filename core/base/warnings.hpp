#pragma once
// What does not stop a run but must not pass in silence: collected while the input is read, the model is compiled and the run goes
// on; counted where it repeats; told by check, describe and at the end of a run, and kept in the results.
#include <cmath>
#include <filesystem>
#include <limits>
#include <vector>

#include "core/base/checkpoint.hpp"
#include "core/base/diagnostic.hpp"

namespace cardan {

/// A Diagnostic whose code is a W of error_codes.inc: `about` says what with its numbers, `hint` what to do.
struct Warning {
  Diagnostic what;
  long count = 1;                                       // how often it was added
  double t = std::numeric_limits<double>::quiet_NaN();  // [s] simulated time of the first; NaN: before the run
};

/// Warnings in the order of their first appearance, one for each code and key path. At most kLimit are kept, the others counted.
class Warnings {
 public:
  static constexpr std::size_t kLimit = 200;
  /// Of two with the same code, place and key path the first text stays, and is counted.
  void add(Diagnostic warning, double t = std::numeric_limits<double>::quiet_NaN());
  void add(Code code, Located at, std::string about, std::string hint = {}, double t = std::numeric_limits<double>::quiet_NaN());
  void add(const Warnings& others);
  const std::vector<Warning>& all() const { return all_; }
  /// Places in files of the folder; in a checkpoint they go by their names in it, so that it can be another folder where it is read.
  void remember(Archive& archive);
  void set_folder(const std::filesystem::path& folder) { folder_ = folder; }
  bool empty() const { return all_.empty(); }
  /// Kinds that found no room in all().
  long left_out() const { return left_out_; }

 private:
  std::vector<Warning> all_;
  std::filesystem::path folder_;
  long left_out_ = 0;
};

/// "warning[W0301]: ..." in the form of a Diagnostic; with count and time where it repeats.
std::string render(const Warning&);
/// All of them, each followed by an empty line, then "N warnings."; empty text if there are none.
std::string render(const Warnings&);

}  // namespace cardan
