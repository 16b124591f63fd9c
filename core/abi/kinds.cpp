#include "core/abi/kinds.hpp"

#include <fmt/format.h>

#include <cstddef>
#include <cstring>
#include <map>
#include <memory>
#include <mutex>

#include "core/abi/body_laws.hpp"
#include "core/abi/cardan_constraint.h"
#include "core/abi/device_laws.hpp"
#include "core/abi/field_laws.hpp"
#include "core/abi/laws.hpp"
#include "core/abi/table_checks.hpp"

namespace cardan {
namespace {

constexpr std::size_t kLeastParam = offsetof(cardan_param_desc, fallback);

/// A table with the descriptions that it points to.
template <class Table>
struct Kept {
  Table table{};
  std::vector<cardan_param_desc> params;
};

template <>
struct Kept<cardan_device_family> {
  cardan_device_family table{};
  std::vector<cardan_param_desc> params;
  std::vector<cardan_mount_desc> mounts;
  std::vector<cardan_port_desc> ports;
  std::vector<cardan_state_desc> states, marks;
};

template <>
struct Kept<cardan_field_family> {
  cardan_field_family table{};
  std::vector<cardan_param_desc> params;
  std::vector<cardan_limit_desc> limits;
};

/// n descriptions of `size` bytes each, of which every plugin of this major has `least`, into full ones. Absurd counts and null are told
/// by the checks of the table.
template <class Desc>
std::string copy_list(const Desc*& list, std::uint32_t n, std::uint32_t& size, std::size_t least, const char* what, const char* of,
                      std::vector<Desc>& kept) {
  if (n == 0 || n > kMostParameters || !list) return {};
  if (size < least || size > kMostBytes)
    return fmt::format("{}_size: {}, expected sizeof(cardan_{}_desc), at least {} bytes", what, size, of, least);
  kept.resize(n);
  for (std::uint32_t i = 0; i < n; ++i)
    std::memcpy(&kept[i], reinterpret_cast<const char*>(list) + std::size_t{i} * size, std::min<std::size_t>(size, sizeof(Desc)));
  list = kept.data();
  size = sizeof(Desc);
  return {};
}

/// The other lists of a table than its parameters.
template <class Table>
std::string copy_lists(Kept<Table>&) {
  return {};
}
std::string copy_lists(Kept<cardan_device_family>& kept) {
  cardan_device_family& t = kept.table;
  for (std::string fault : {copy_list(t.mounts, t.n_mounts, t.mount_size, sizeof(cardan_mount_desc), "mount", "mount", kept.mounts),
                            copy_list(t.ports, t.n_ports, t.port_size, offsetof(cardan_port_desc, valid), "port", "port", kept.ports),
                            copy_list(t.states, t.n_states, t.state_size, sizeof(cardan_state_desc), "state", "state", kept.states),
                            copy_list(t.marks, t.n_marks, t.mark_size, sizeof(cardan_state_desc), "mark", "state", kept.marks)})
    if (!fault.empty()) return fault;
  return {};
}

std::string copy_lists(Kept<cardan_field_family>& kept) {
  cardan_field_family& t = kept.table;
  return copy_list(t.limits, t.n_limits, t.limit_size, sizeof(cardan_limit_desc), "limit", "limit", kept.limits);
}

/// `least`: what every plugin of this major has.
template <class Table>
std::string copy_by_size(const void* theirs, std::size_t least, Kept<Table>& kept) {
  std::uint32_t size = 0;
  std::memcpy(&size, theirs, sizeof size);
  if (size < least) return fmt::format("struct_size: {}, expected at least {} bytes", size, least);
  Table& t = kept.table;
  std::memcpy(&t, theirs, std::min<std::size_t>(size, sizeof t));
  t.struct_size = sizeof t;
  if (std::string fault = copy_list(t.params, t.n_params, t.param_size, kLeastParam, "param", "param", kept.params); !fault.empty())
    return fault;
  return copy_lists(kept);
}

template <class Table, std::size_t least>
KeptTable keep(const void* theirs) {
  static std::mutex access;
  static std::map<const void*, std::unique_ptr<Kept<Table>>> all;
  const std::lock_guard lock(access);
  if (const auto found = all.find(theirs); found != all.end()) return {&found->second->table, {}};
  auto kept = std::make_unique<Kept<Table>>();
  if (std::string fault = copy_by_size(theirs, least, *kept); !fault.empty()) return {nullptr, std::move(fault)};
  return {&(all[theirs] = std::move(kept))->table, {}};
}

template <class Table>
const Table& as(const void* table) {
  return *static_cast<const Table*>(table);
}

/// faults and violations are functions of the table; `families` says where the registry keeps them.
template <class Table, std::size_t least, auto faults, auto violations, auto families>
constexpr FamilyKind kind_of(const char* kind, const char* word) {
  return {
      .kind = kind,
      .word = word,
      .keep = keep<Table, least>,
      .type = [](const void* t) { return as<Table>(t).type; },
      .summary = [](const void* t) { return as<Table>(t).summary; },
      .faults = [](const void* t) { return faults(as<Table>(t)); },
      .violations = [](const void* t, int samples, std::uint64_t seed, const TellPhase& before,
                       LawRecord* record) { return violations(as<Table>(t), samples, seed, before, record); },
      .known = [](const Registry& r, const void* t) { return (r.*families).has(as<Table>(t)); },
      .add = [](Registry& r, const void* t, const std::string& origin, const Located& at) { (r.*families).add(as<Table>(t), origin, at); }};
}

constexpr FamilyKind kKinds[] = {
    kind_of<cardan_hinge_family, offsetof(cardan_hinge_family, zero), hinge_table_faults, hinge_law_violations, &Registry::hinges>(
        CARDAN_KIND_HINGE, "hinge"),
    kind_of<cardan_body_family, offsetof(cardan_body_family, node), body_table_faults, body_law_violations, &Registry::bodies>(
        CARDAN_KIND_BODY, "body"),
    kind_of<cardan_device_family, offsetof(cardan_device_family, nominal), device_table_faults, device_law_violations, &Registry::devices>(
        CARDAN_KIND_DEVICE, "device"),
    kind_of<cardan_field_family, offsetof(cardan_field_family, prepared_size), field_table_faults, field_law_violations, &Registry::fields>(
        CARDAN_KIND_FIELD, "field")};
constexpr DeclaredKind kDeclared[] = {{CARDAN_KIND_CONSTRAINT, "constraint"}};

}  // namespace

std::span<const FamilyKind> family_kinds() { return kKinds; }
std::span<const DeclaredKind> declared_kinds() { return kDeclared; }

}  // namespace cardan
