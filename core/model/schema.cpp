#include "core/model/schema.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/base/units.hpp"
#include "core/base/warnings.hpp"

namespace cardan {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kUnitTolerance = 1e-6;  // of quaternions and rotation matrices as typed
using Kind = DocNode::Kind;

std::string with_unit(std::string value, std::string_view unit) {
  return unit.empty() || unit == "1" ? value : fmt::format("{} {}", value, unit);
}

std::string vector_text(const Eigen::Vector3d& v) { return fmt::format("[{:.6g}, {:.6g}, {:.6g}]", v.x(), v.y(), v.z()); }

/// Of a number without a unit, which is in SI by that: what one types in degrees, or for the mu of a planet in km^3/s^2.
void doubt_unit(const DocRef& value, double number, std::string_view unit, Warnings& doubts) {
  const std::string& text = value.node->text;
  if (const double turns = number / (2.0 * std::numbers::pi);
      unit == "rad" && std::abs(turns) > 1.0 && 2.0 * number == std::round(2.0 * number))
    doubts.add(Code::unusual_value, value.at(), fmt::format("{0} without a unit is {0} rad, {1:.3g} turns", text, turns),
               fmt::format(R"("{0} deg", or "{0} rad" where that is meant)", text));
  struct Planet {
    const char* name;
    double mu;  // [km^3/s^2]
  };
  constexpr Planet kPlanets[] = {{"the Sun", 1.32712440018e11}, {"Mercury", 22031.9},   {"Venus", 324859},         {"the Earth", 398600.44},
                                 {"the Moon", 4902.8},          {"Mars", 42828.4},      {"Jupiter", 1.26686534e8}, {"Saturn", 3.7931187e7},
                                 {"Uranus", 5.793939e6},        {"Neptune", 6.836529e6}};
  if (unit != "m^3/s^2") return;
  for (const auto& [name, mu] : kPlanets)
    if (std::abs(number - mu) < 1e-3 * mu)
      doubts.add(Code::unusual_value, value.at(),
                 fmt::format("{0} without a unit is {0} m^3/s^2: that of {1} is so much in km^3/s^2", text, name),
                 fmt::format(R"("{0} km^3/s^2", or "{0} m^3/s^2" where that is meant)", text));
}

}  // namespace

std::string expected_number(std::string_view unit) { return describe(parse_unit(unit).value_or(Unit{}).dimension); }

DocRef DocRef::item(std::size_t i) const {
  if (node->kind == Kind::list) return {&node->items[i], fmt::format("{}[{}]", path, i)};
  return {&node->items[i], path.empty() ? node->keys[i].name : fmt::format("{}.{}", path, node->keys[i].name)};
}

std::string describe(const DocNode& node) {
  switch (node.kind) {
    case Kind::scalar:
      return in_quotes(node.text);
    case Kind::list:
      return fmt::format("a list of {} value{}", node.items.size(), node.items.size() == 1 ? "" : "s");
    case Kind::map:
      return fmt::format("a map of {} key{}", node.items.size(), node.items.size() == 1 ? "" : "s");
    case Kind::empty:
      break;
  }
  return "nothing";
}

std::string one_of(const std::vector<std::string>& names) {
  constexpr std::size_t kMost = 30;
  std::string out;
  for (std::size_t i = 0; i < std::min(names.size(), kMost); ++i) out += (i == 0 ? "" : i + 1 == names.size() ? " or " : ", ") + names[i];
  return names.size() > kMost ? fmt::format("{} or one of {} more", out, names.size() - kMost) : out;
}

double read_number(const DocRef& value, std::string_view unit, ReadContext& context) {
  if (value.node->kind != Kind::scalar) {
    context.sink.report(Code::wrong_type, value.at(), expected_number(unit), describe(*value.node));
    return kNaN;
  }
  const std::string& text = value.node->text;
  const auto result = parse_quantity(text, unit);
  if (const double* number = std::get_if<double>(&result)) {
    if (context.doubts && parse_number(text)) doubt_unit(value, *number, unit, *context.doubts);
    return *number;
  }
  const auto& fault = std::get<QuantityFault>(result);
  context.sink.report(fault.code, value.at(), fault.expected, fault.got, fault.hint);
  return kNaN;
}

std::vector<double> read_numbers(const DocRef& value, std::string_view unit, std::size_t count, ReadContext& context) {
  const DocNode& node = *value.node;
  if (node.kind != Kind::list || (count > 0 && node.items.size() != count)) {
    const std::string expected = count > 0 ? fmt::format("a list of {} values, each: {}", count, expected_number(unit))
                                           : fmt::format("a list of values, each: {}", expected_number(unit));
    context.sink.report(Code::wrong_type, value.at(), expected, describe(node));
    return {};
  }
  std::vector<double> numbers(node.items.size());
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = read_number(value.item(i), unit, context);
  return numbers;
}

Eigen::Vector3d read_vector(const DocRef& value, std::string_view unit, ReadContext& context) {
  const auto numbers = read_numbers(value, unit, 3, context);
  return numbers.empty() ? Eigen::Vector3d::Constant(kNaN) : Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
}

int read_integer(const DocRef& value, int least, ReadContext& context) {
  constexpr double kMost = 1e9;
  bool too_large = false;
  if (value.node->kind == Kind::scalar) {
    const auto number = parse_number(value.node->text);
    if (number && *number == std::floor(*number) && *number >= least && *number <= kMost) return static_cast<int>(*number);
    too_large = number && *number > kMost;
  }
  context.sink.report(Code::out_of_range, value.at(),
                      fmt::format("a whole number of at least {}{}", least, too_large ? fmt::format(" and at most {:g}", kMost) : ""),
                      describe(*value.node));
  return least;
}

std::string read_text(const DocRef& value, std::string_view expected, ReadContext& context) {
  if (value.node->kind == Kind::scalar) return value.node->text;
  context.sink.report(Code::wrong_type, value.at(), std::string(expected), describe(*value.node));
  return {};
}

bool read_flag(const DocRef& value, ReadContext& context) {
  const DocNode& node = *value.node;
  if (node.kind == Kind::scalar && (node.text == "true" || node.text == "false")) return node.text == "true";
  context.sink.report(Code::wrong_type, value.at(), "true or false", describe(node));
  return false;
}

int read_choice(const DocRef& value, const std::vector<std::string>& legal, std::string_view what, Code code, ReadContext& context) {
  const DocNode& node = *value.node;
  const std::string expected = fmt::format("{}: {}", what, one_of(legal));
  if (node.kind != Kind::scalar) {
    context.sink.report(Code::wrong_type, value.at(), expected, describe(node));
    return -1;
  }
  const auto found = std::find(legal.begin(), legal.end(), node.text);
  if (found != legal.end()) return static_cast<int>(found - legal.begin());
  context.sink.report(code, value.at(), expected, describe(node), did_you_mean(node.text, legal));
  return -1;
}

Eigen::Vector4d read_quaternion_wxyz(const DocRef& value, ReadContext& context) {
  const Eigen::Vector4d identity(1.0, 0.0, 0.0, 0.0);
  const auto n = read_numbers(value, "1", 4, context);
  if (n.empty() || !std::all_of(n.begin(), n.end(), [](double x) { return std::isfinite(x); })) return identity;
  const Eigen::Vector4d q(n[0], n[1], n[2], n[3]);
  const double norm = q.stableNorm();
  if (std::abs(norm - 1.0) <= kUnitTolerance) return q / norm;
  std::string hint;
  if (norm > 0.0) {
    const Eigen::Vector4d u = q / norm;
    hint = fmt::format("the same rotation at unit length: [{:.9g}, {:.9g}, {:.9g}, {:.9g}]", u[0], u[1], u[2], u[3]);
  }
  context.sink.report(Code::non_unit_quaternion, value.at(),
                      fmt::format("w, x, y, z with w^2 + x^2 + y^2 + z^2 = 1 (within {:g})", kUnitTolerance),
                      fmt::format("length {:.9g}", norm), hint);
  return identity;
}

namespace {

Eigen::Vector3d read_direction(const DocRef& value, ReadContext& context) {
  const Eigen::Vector3d axis = read_vector(value, "1", context);
  const double length = axis.stableNorm();
  if (length > 0.0) return axis / length;
  if (length == 0.0) context.sink.report(Code::out_of_range, value.at(), "a direction: not all three zero", vector_text(axis));
  return Eigen::Vector3d::UnitX();
}

Eigen::Matrix3d read_euler(const DocRef& value, ReadContext& context) {
  MapReader euler(value, context);
  const auto sequence = euler.require("sequence", "three axes, such as zyx or 313");
  const auto angles = euler.require("angles", "three angles");
  euler.finish();
  if (!sequence || !angles) return Eigen::Matrix3d::Identity();
  std::string axes = read_text(*sequence, "three axes, such as zyx or 313", context);
  for (char& c : axes) c = c >= '1' && c <= '3' ? static_cast<char>('x' + (c - '1')) : c;
  if (axes.size() != 3 || axes.find_first_not_of("xyz") != std::string::npos || axes[0] == axes[1] || axes[1] == axes[2]) {
    context.sink.report(Code::out_of_range, sequence->at(), "three axes, no two neighbours equal, such as zyx or 313",
                        describe(*sequence->node));
    return Eigen::Matrix3d::Identity();
  }
  const Eigen::Vector3d angle = read_vector(*angles, "rad", context);
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  for (int i = 0; i < 3; ++i) R = R * Eigen::AngleAxisd(angle[i], Eigen::Vector3d::Unit(axes[i] - 'x'));
  return R;
}

Eigen::Matrix3d read_rotation_matrix(const DocRef& value, ReadContext& context) {
  if (value.node->kind != Kind::list || value.node->items.size() != 3) {
    context.sink.report(Code::wrong_type, value.at(), "a list of 3 rows", describe(*value.node));
    return Eigen::Matrix3d::Identity();
  }
  Eigen::Matrix3d R;
  for (int i = 0; i < 3; ++i) R.row(i) = read_vector(value.item(static_cast<std::size_t>(i)), "1", context).transpose();
  if (!R.allFinite()) return Eigen::Matrix3d::Identity();
  const double error = (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  const double determinant = R.determinant();
  if (error > kUnitTolerance || determinant < 0.0) {
    const std::string got = error > kUnitTolerance ? fmt::format("an entry of R R^T - 1 is {:.3g}", error)
                                                   : fmt::format("determinant {:.3g}: a reflection", determinant);
    context.sink.report(Code::not_a_rotation, value.at(),
                        fmt::format("three rows, orthonormal within {:g} and right-handed", kUnitTolerance), got);
    return Eigen::Matrix3d::Identity();
  }
  return Eigen::Quaterniond(R).normalized().toRotationMatrix();
}

}  // namespace

Eigen::Matrix3d read_orientation(const DocRef& value, ReadContext& context) {
  MapReader map(value, context);
  const auto form = map.one({"rotvec", "quaternion_wxyz", "axis", "euler", "matrix"});
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  if (form) {
    const DocRef& given = form->second;
    if (form->first == 0) {
      const Eigen::Vector3d t = read_vector(given, "rad", context);
      const double angle = t.stableNorm();
      if (angle > 0.0) R = Eigen::AngleAxisd(angle, t / angle).toRotationMatrix();
    } else if (form->first == 1) {
      const Eigen::Vector4d q = read_quaternion_wxyz(given, context);
      R = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
    } else if (form->first == 2) {
      R = Eigen::AngleAxisd(map.number("angle", "rad"), read_direction(given, context)).toRotationMatrix();
    } else if (form->first == 3) {
      R = read_euler(given, context);
    } else {
      R = read_rotation_matrix(given, context);
    }
  }
  map.finish();
  return R;
}

MapReader::MapReader(DocRef map, ReadContext& context) : map_(std::move(map)), context_(context) {
  if (!is_map()) context_.sink.report(Code::wrong_type, map_.at(), "a map of keys and values", describe(*map_.node));
}

std::optional<DocRef> MapReader::find(std::string_view key) {
  if (std::find(asked_.begin(), asked_.end(), key) == asked_.end()) asked_.emplace_back(key);
  for (std::size_t i = 0; i < map_.node->keys.size(); ++i)
    if (map_.node->keys[i].name == key) return map_.item(i);
  return {};
}

std::optional<DocRef> MapReader::require(std::string_view key, std::string_view expected, std::string_view hint) {
  auto value = find(key);
  if (value || !is_map()) return value;
  const std::string path = map_.path.empty() ? std::string(key) : fmt::format("{}.{}", map_.path, key);
  context_.sink.report(Code::missing_key, {path, map_.node->mark}, fmt::format("{}: {}", key, expected), "no such key", std::string(hint));
  return {};
}

std::optional<std::pair<std::size_t, DocRef>> MapReader::one(const std::vector<std::string>& keys) {
  std::optional<std::pair<std::size_t, DocRef>> found;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const auto value = find(keys[i]);
    if (!value) continue;
    if (found) {
      context_.sink.report(Code::wrong_type, value->at(), "one of these keys alone: " + one_of(keys),
                           fmt::format("{} and {}", keys[found->first], keys[i]));
      return {};
    }
    found.emplace(i, *value);
  }
  if (!found && is_map()) context_.sink.report(Code::missing_key, map_.at(), "one of the keys " + one_of(keys), describe(*map_.node));
  return found;
}

double MapReader::number(std::string_view key, std::string_view unit) {
  const auto value = require(key, expected_number(unit));
  return value ? read_number(*value, unit, context_) : kNaN;
}
double MapReader::number(std::string_view key, std::string_view unit, double fallback) {
  if (const auto value = find(key)) return read_number(*value, unit, context_);
  note_default(key, with_unit(fmt::format("{:.6g}", fallback), unit));
  return fallback;
}
Eigen::Vector3d MapReader::vector(std::string_view key, std::string_view unit) {
  const auto value = require(key, "a list of 3 values, each: " + expected_number(unit));
  return value ? read_vector(*value, unit, context_) : Eigen::Vector3d::Constant(kNaN);
}
Eigen::Vector3d MapReader::vector(std::string_view key, std::string_view unit, const Eigen::Vector3d& fallback) {
  if (const auto value = find(key)) return read_vector(*value, unit, context_);
  note_default(key, with_unit(vector_text(fallback), unit));
  return fallback;
}
int MapReader::integer(std::string_view key, int least, int fallback) {
  if (const auto value = find(key)) return read_integer(*value, least, context_);
  note_default(key, fmt::format("{}", fallback));
  return fallback;
}
std::string MapReader::text(std::string_view key, std::string_view expected) {
  const auto value = require(key, expected);
  return value ? read_text(*value, expected, context_) : std::string{};
}
std::string MapReader::text(std::string_view key, std::string_view expected, std::string_view fallback) {
  if (const auto value = find(key)) return read_text(*value, expected, context_);
  note_default(key, std::string(fallback));
  return std::string(fallback);
}
bool MapReader::flag(std::string_view key, bool fallback) {
  if (const auto value = find(key)) return read_flag(*value, context_);
  note_default(key, fallback ? "true" : "false");
  return fallback;
}

void MapReader::finish(std::string_view hint) {
  for (std::size_t i = 0; i < map_.node->keys.size() && !context_.sink.full(); ++i) {
    const DocKey& key = map_.node->keys[i];
    if (std::find(asked_.begin(), asked_.end(), key.name) != asked_.end()) continue;
    std::string near = did_you_mean(key.name, asked_);
    if (near.empty()) near = hint;
    context_.sink.report(Code::unknown_key, {map_.item(i).path, key.mark},
                         asked_.empty() ? "no keys here" : "one of the keys " + one_of(asked_), in_quotes(key.name), near);
  }
}

void MapReader::note_default(std::string_view key, std::string value) {
  if (!is_map()) return;
  context_.defaults_used.emplace_back(map_.path.empty() ? std::string(key) : fmt::format("{}.{}", map_.path, key), std::move(value));
}

}  // namespace cardan
