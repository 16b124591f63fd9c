#include "core/model/initial.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string_view>

#include "core/abi/registry.hpp"

namespace cardan {
namespace {

using Names = std::span<const char* const>;

/// Appends the group if the three components stand side by side.
void add_vector(std::vector<ComponentGroup>& groups, Names names, Names units, const std::array<const char*, 3>& components,
                std::vector<std::string> called, const char* unit) {
  const auto equal = [](std::string_view a, std::string_view b) { return a == b; };
  const auto found = std::search(names.begin(), names.end(), components.begin(), components.end(), equal);
  if (found == names.end()) return;
  const auto first = static_cast<std::size_t>(found - names.begin());
  if (std::all_of(&units[first], &units[first] + 3, [&](std::string_view u) { return u == unit; }))
    groups.push_back({std::move(called), unit, first, 3});
}

/// One of the forms of a group: as many numbers as it has, of unit length if it is an attitude.
void read_group(const DocRef& value, const ComponentGroup& group, bool attitude, double* x, ReadContext& context) {
  if (attitude) {
    const Eigen::Vector4d wxyz = read_quaternion_wxyz(value, context);
    std::copy(wxyz.begin(), wxyz.end(), x);
  } else {
    const std::vector<double> values = read_numbers(value, group.unit, group.size, context);
    std::copy(values.begin(), values.end(), x);
  }
}

/// Component by component, or by groups; nothing twice. False: the map gives none.
bool read_components(MapReader& map, Names names, Names units, const std::vector<ComponentGroup>& groups, bool quaternion, double* x) {
  ReadContext& context = map.context();
  std::vector<std::string> given(names.size());  // the key that gave a component
  const auto take = [&](const std::string& key, const DocRef& value, std::size_t first, std::size_t size) {
    if (const std::string& other = given[first]; !other.empty()) {
      context.sink.report(Code::wrong_type, value.at(), fmt::format("{} or {}, not both", other, key), "both");
      return false;
    }
    std::fill_n(given.begin() + static_cast<std::ptrdiff_t>(first), size, key);
    return true;
  };
  for (const ComponentGroup& group : groups) {
    const bool attitude = quaternion && group.first == 0;
    for (const std::string& name : group.names)
      if (const auto value = map.find(name); value && take(name, *value, group.first, group.size))
        read_group(*value, group, attitude, x + group.first, context);
    if (!attitude) continue;
    if (const auto value = map.find("orientation"); value && take("orientation", *value, 0, 4)) {
      const Eigen::Quaterniond r(read_orientation(*value, context));
      x[0] = r.w(), x[1] = r.x(), x[2] = r.y(), x[3] = r.z();
    }
  }
  const bool whole = quaternion && !given[0].empty();
  for (std::size_t i = 0; i < names.size(); ++i)
    if (const auto value = map.find(names[i]); value && take(names[i], *value, i, 1)) x[i] = read_number(*value, units[i], context);
  const auto missing = [](const std::string& key) { return key.empty(); };
  const bool any = !std::all_of(given.begin(), given.end(), missing);
  if (!quaternion || whole || std::all_of(given.begin(), given.begin() + 4, missing)) return any;
  Eigen::Map<Eigen::Vector4d> q(x);
  if (!q.allFinite()) return any;  // told already
  if (std::abs(q.norm() - 1.0) > 1e-6)
    context.sink.report(Code::non_unit_quaternion, map.ref().at(), "w, x, y, z of length 1 within 1e-6",
                        fmt::format("length {:.6g}", q.norm()), "what is not given stays: 1, 0, 0, 0 at first");
  q.normalize();
  return any;
}

}  // namespace

std::vector<ComponentGroup> coordinate_groups(const cardan_hinge_family& family) {
  std::vector<ComponentGroup> groups;
  if (has_quaternion(family)) groups.push_back({{"attitude", "quaternion_wxyz"}, "1", 0, 4});
  add_vector(groups, {family.q_names, family.nq}, {family.q_units, family.nq}, {"x", "y", "z"}, {"position"}, "m");
  return groups;
}

std::vector<ComponentGroup> velocity_groups(const cardan_hinge_family& family) {
  std::vector<ComponentGroup> groups;
  const Names names{family.v_names, family.nv}, units{family.v_units, family.nv};
  add_vector(groups, names, units, {"wx", "wy", "wz"}, {"rate", "angular_velocity"}, "rad/s");
  add_vector(groups, names, units, {"vx", "vy", "vz"}, {"velocity"}, "m/s");
  return groups;
}

InitialGiven read_initial(MapReader& map, const cardan_hinge_family& family, double* q, double* v) {
  const bool coordinates =
      read_components(map, {family.q_names, family.nq}, {family.q_units, family.nq}, coordinate_groups(family), has_quaternion(family), q);
  return {coordinates, read_components(map, {family.v_names, family.nv}, {family.v_units, family.nv}, velocity_groups(family), false, v)};
}

void settle_coordinates(const cardan_hinge_family& family, const double* packed, double* q, const Located& at, DiagnosticSink& sink) {
  if (!family.normalise || has_quaternion(family)) return;
  const Eigen::VectorXd given = Eigen::VectorXd::Map(q, family.nq);
  family.normalise(packed, q);
  const Eigen::VectorXd settled = Eigen::VectorXd::Map(q, family.nq);
  const bool is_place = settled.allFinite();
  if (is_place && (settled - given).cwiseAbs().maxCoeff() <= 1e-6 * std::max(1.0, settled.cwiseAbs().maxCoeff())) return;
  const Names names(family.q_names, family.nq);
  sink.report(Code::bad_initial_state, at,
              fmt::format("coordinates {} of hinge type {} that belong to a place, within 1e-6", fmt::join(names, ", "), family.type),
              fmt::format("{:.9g}", fmt::join(given, ", ")),
              is_place ? fmt::format("normalised they are {:.9g}", fmt::join(settled, ", ")) : "");
}

std::vector<double> initial_coordinates(const cardan_hinge_family& family, const double* packed, const std::vector<double>& given) {
  std::vector<double> q(family.nq, 0.0);
  if (family.zero) family.zero(packed, q.data());
  if (given.size() == q.size()) q = given;
  DiagnosticSink told;  // by validate()
  settle_coordinates(family, packed, q.data(), {}, told);
  return q;
}

}  // namespace cardan
