#pragma once
// Reading a DocNode by key, type and unit. Each fault is reported with its key path and place, and the reading goes on
// with a NaN or an empty value, so that one pass finds all faults.
#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/diagnostic.hpp"
#include "core/model/doc_node.hpp"

namespace cardan {

class Warnings;

/// Where faults go, the list of defaults that were used (key path, value), and, where it is wanted, what is legal but hardly meant.
struct ReadContext {
  DiagnosticSink& sink;
  std::vector<std::pair<std::string, std::string>>& defaults_used;
  Warnings* doubts = nullptr;
};

/// A value of the document and the path of its key.
struct DocRef {
  const DocNode* node = nullptr;
  std::string path;

  Located at() const { return {path, node->mark}; }
  DocRef item(std::size_t i) const;  ///< entry i of a list ("com[1]") or map ("bus.mass")
};

/// What stands there, for `got`: `"12 kg"`, `a list of 3 values`, `nothing`.
std::string describe(const DocNode& node);
/// What a number of that unit may be, for `expected`: "a mass, as in 12 kg".
std::string expected_number(std::string_view unit);
/// "a, b or c"
std::string one_of(const std::vector<std::string>& names);

/// A number with a unit that converts to `unit` (core/base/units.hpp), in SI. NaN after a fault. Without a unit, whole and half numbers of
/// more than a turn that are an angle, and the mu of a planet in km^3/s^2, are doubted (W0302).
double read_number(const DocRef& value, std::string_view unit, ReadContext& context);
/// A list of `count` numbers (0: any number of them); empty after a fault of the list itself.
std::vector<double> read_numbers(const DocRef& value, std::string_view unit, std::size_t count, ReadContext& context);
Eigen::Vector3d read_vector(const DocRef& value, std::string_view unit, ReadContext& context);
/// A whole number of at least `least`; `least` after a fault.
int read_integer(const DocRef& value, int least, ReadContext& context);
std::string read_text(const DocRef& value, std::string_view expected, ReadContext& context);
/// `true` or `false`, nothing else.
bool read_flag(const DocRef& value, ReadContext& context);
/// Index of the text among `legal`, or -1 after a fault (reported as `code`).
int read_choice(const DocRef& value, const std::vector<std::string>& legal, std::string_view what, Code code, ReadContext& context);
/// Rotation from one of {rotvec}, {quaternion_wxyz}, {axis, angle}, {euler: {sequence, angles}}, {matrix}: the matrix
/// that takes components in the axes described to components in the axes they are described in.
Eigen::Matrix3d read_orientation(const DocRef& value, ReadContext& context);
/// Four numbers of unit length within 1e-6, then exactly so. (1, 0, 0, 0) after a fault.
Eigen::Vector4d read_quaternion_wxyz(const DocRef& value, ReadContext& context);

/// The keys of one map. Whatever key was asked for is legal; finish() reports the others.
class MapReader {
 public:
  MapReader(DocRef map, ReadContext& context);

  bool is_map() const { return map_.node->kind == DocNode::Kind::map; }
  const DocRef& ref() const { return map_; }
  ReadContext& context() { return context_; }
  /// The value of the key, if it is there.
  std::optional<DocRef> find(std::string_view key);
  /// The value of the key; its absence is a fault (C0105).
  std::optional<DocRef> require(std::string_view key, std::string_view expected, std::string_view hint = {});
  /// Which of several keys is there: exactly one must be. Empty after a fault.
  std::optional<std::pair<std::size_t, DocRef>> one(const std::vector<std::string>& keys);

  double number(std::string_view key, std::string_view unit);
  double number(std::string_view key, std::string_view unit, double fallback);
  Eigen::Vector3d vector(std::string_view key, std::string_view unit);
  Eigen::Vector3d vector(std::string_view key, std::string_view unit, const Eigen::Vector3d& fallback);
  int integer(std::string_view key, int least, int fallback);
  std::string text(std::string_view key, std::string_view expected);
  std::string text(std::string_view key, std::string_view expected, std::string_view fallback);
  bool flag(std::string_view key, bool fallback);

  /// Reports a key that was never asked for (C0104).
  void finish(std::string_view hint = {});
  /// Notes that `value` was taken because the key is absent.
  void note_default(std::string_view key, std::string value);

 private:
  DocRef map_;
  ReadContext& context_;
  std::vector<std::string> asked_;
};

}  // namespace cardan
