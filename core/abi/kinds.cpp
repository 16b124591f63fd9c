#include "core/abi/kinds.hpp"

#include <fmt/format.h>

#include <cstddef>
#include <cstring>
#include <map>
#include <memory>
#include <mutex>

#include "core/abi/body_laws.hpp"
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

/// `least`: what every plugin of this major has.
template <class Table>
std::string copy_by_size(const void* theirs, std::size_t least, Kept<Table>& kept) {
  std::uint32_t size = 0;
  std::memcpy(&size, theirs, sizeof size);
  if (size < least) return fmt::format("struct_size: {}, expected at least {} bytes", size, least);
  Table& t = kept.table;
  std::memcpy(&t, theirs, std::min<std::size_t>(size, sizeof t));
  t.struct_size = sizeof t;
  if (t.n_params == 0 || t.n_params > kMostParameters || !t.params) return {};  // told by the checks of the table
  if (t.param_size < kLeastParam || t.param_size > kMostBytes)
    return fmt::format("param_size: {}, expected sizeof(cardan_param_desc), at least {} bytes", t.param_size, kLeastParam);
  kept.params.resize(t.n_params);
  for (std::uint32_t i = 0; i < t.n_params; ++i)
    std::memcpy(&kept.params[i], reinterpret_cast<const char*>(t.params) + std::size_t{i} * t.param_size,
                std::min<std::size_t>(t.param_size, sizeof(cardan_param_desc)));
  t.params = kept.params.data();
  t.param_size = sizeof(cardan_param_desc);
  return {};
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
  return {.kind = kind,
          .word = word,
          .keep = keep<Table, least>,
          .type = [](const void* t) { return as<Table>(t).type; },
          .summary = [](const void* t) { return as<Table>(t).summary; },
          .faults = [](const void* t) { return faults(as<Table>(t)); },
          .violations = [](const void* t, int samples, std::uint64_t seed,
                           const TellPhase& before) { return violations(as<Table>(t), samples, seed, before); },
          .known = [](const Registry& r, const void* t) { return (r.*families).has(as<Table>(t)); },
          .add = [](Registry& r, const void* t, const std::string& origin) { (r.*families).add(as<Table>(t), origin); }};
}

constexpr FamilyKind kKinds[] = {
    kind_of<cardan_hinge_family, offsetof(cardan_hinge_family, zero), hinge_table_faults, hinge_law_violations, &Registry::hinges>(
        CARDAN_KIND_HINGE, "hinge"),
    kind_of<cardan_body_family, sizeof(cardan_body_family), body_table_faults, body_law_violations, &Registry::bodies>(CARDAN_KIND_BODY,
                                                                                                                       "body")};

}  // namespace

std::span<const FamilyKind> family_kinds() { return kKinds; }

}  // namespace cardan
