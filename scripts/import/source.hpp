#pragma once
// What the readers of robot files share: values with their places, answers, and what is left out.
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/diagnostic.hpp"
#include "core/io/xml_reader.hpp"
#include "scripts/import/options.hpp"
#include "scripts/import/robot.hpp"

namespace cardan {

/// Attributes that elements have by default, by the names of the elements; what is not here is in `parent`.
struct XmlDefaults {
  const XmlDefaults* parent = nullptr;
  std::map<std::string, const XmlElement*, std::less<>> elements;
};

/// An element, and the attributes that it has by default.
struct XmlView {
  const XmlElement& element;
  const XmlDefaults* defaults = nullptr;
  std::string_view tag{};  // under which it stands among the defaults; empty: its own name

  /// An attribute, or of several (words separated by spaces) the one nearest: the element's own before those of classes.
  const XmlAttribute* find(std::string_view names) const;
};

class RobotSource {
 public:
  RobotSource(std::string name, const ImportOptions& asked) : file(std::move(name)), options(asked) {}

  const std::string file;
  const ImportOptions& options;
  DiagnosticSink sink;

  /// At a mark that has no element at hand.
  void report_at(Code code, Located at, std::string expected, std::string got, std::string hint = {}) {
    sink.report(Diagnostic{code, std::move(at), std::move(expected), std::move(got), std::move(hint), {}, {}, 1});
  }
  void report(Code code, const XmlElement& e, std::string_view attribute, std::string expected, std::string got, std::string hint = {});

  /// The `n` numbers of an attribute, or what is given for want of it; after a fault, which is reported, the latter too. Without
  /// `otherwise` the attribute is required.
  std::vector<double> numbers(const XmlView& v, std::string_view attribute, std::size_t n, const std::vector<double>* otherwise,
                              std::size_t at_most = 0);
  double number(const XmlView& v, std::string_view attribute, std::optional<double> otherwise);
  Vec3<double> vector(const XmlView& v, std::string_view attribute, std::optional<Vec3<double>> otherwise);
  /// The text of a required attribute; empty after a fault.
  std::string text(const XmlView& v, std::string_view attribute);

  /// What cannot be honoured: C1202, unless --leave-out names `feature` or the element's own name. True: it is left out, and counted.
  bool cannot(const XmlElement& e, const std::string& feature, std::string why, std::string hint = {});
  bool asked_to_leave_out(const std::string& feature, std::string_view name);
  /// Counts what is left out because it means nothing here: "visual".
  void leave(const std::string& what) { ++left_[what]; }
  /// Counts what pushes, by a command or without one, and is left to devices and the mission: "actuator position".
  void leave_force(const std::string& what) { ++forces_[what]; }
  /// Attributes that are neither `known` nor `ignored` are refused by name.
  void expect_attributes(const XmlElement& e, std::string_view known, std::string_view ignored = {});

  void note(std::string text) { notes_.push_back(std::move(text)); }
  /// What the user should know, the counts of what was left out first. Refuses a --leave-out that named nothing.
  std::vector<std::string> notes();

 private:
  std::map<std::string, int> left_, forces_, asked_;
  std::set<std::string, std::less<>> used_;
  std::vector<std::string> notes_;
};

/// One of the words of a text in which they are separated by spaces.
bool is_word_of(std::string_view words, std::string_view word);

Mat3<double> rotation_of_rpy(const Vec3<double>& rpy);
/// The rotation that takes z to the direction d by the shortest way.
Mat3<double> rotation_of_z_to(const Vec3<double>& d);
double length(const Vec3<double>& v);
std::string list_of(const Vec3<double>& v);  // "[1, 2, 3]"

/// The two formats. Faults go to the source.
Robot read_urdf(const XmlElement& root, RobotSource& source);
Robot read_mjcf(const XmlElement& root, RobotSource& source);

}  // namespace cardan
