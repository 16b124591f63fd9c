// What was built against an older contract of the same major still means the same: the header of 2.0 against the present one, a plugin
// of 2.0, and tables that are shorter or longer than ours.
#include <gtest/gtest.h>

#include <cstddef>
#include <cstring>
#include <map>

#include "core/abi/kinds.hpp"
#include "core/abi/param_values.hpp"
#include "core/abi/plugin_host.hpp"
#include "tests/abi/layout_test.hpp"

namespace cardan {
namespace {

std::map<std::string, Place> present_fields() {
  return {
#define CONSTANT(name)
#define FIELD(type, member) {#type "." #member, {offsetof(type, member), sizeof(type::member)}},
#include "tests/abi/2.0/fields.inc"
#undef FIELD
#undef CONSTANT
  };
}
std::map<std::string, long> present_constants() {
  return {
#define FIELD(type, member)
#define CONSTANT(name) {#name, static_cast<long>(name)},
#include "tests/abi/2.0/fields.inc"
#undef CONSTANT
#undef FIELD
  };
}

TEST(Contract20, HasItsMembersWhereTheyWere) {
  expect_where_they_were({frozen_fields, n_frozen_fields}, present_fields());
  // These are arrays that functions of a plugin read or write: their length is theirs for the whole major.
  EXPECT_EQ(sizeof(cardan_hinge_out), 54 * sizeof(double));
}

TEST(Contract20, HasItsConstants) {
  expect_what_they_were({frozen_constants, n_frozen_constants}, present_constants());
  EXPECT_EQ(CARDAN_ABI_MAJOR, 2u);
}

TEST(Contract20, APluginOfItIsLoadedAndWorks) {
  std::string said;
  on_plugin_message([&](const std::string& file, std::uint32_t severity, const std::string& text) {
    said += file.substr(file.rfind('/') + 1) + ", " + std::to_string(severity) + ", " + text + "\n";
  });
  Registry registry;
  load_plugin(CARDAN_BINARY_DIR "/plugins/frozen_2_0.so", registry);
  on_plugin_message({});
  EXPECT_EQ(said, "frozen_2_0.so, 0, contract 2.0\n") << "once, from the process that uses it";
  const cardan_hinge_family* slide = registry.hinge("frozen/slide");
  ASSERT_NE(slide, nullptr);
  EXPECT_EQ(slide->struct_size, sizeof(cardan_hinge_family));
  EXPECT_EQ(slide->packed_size, nullptr);
  ParamTable values;
  values.numbers = {{"gain", {2.0}}, {"gears", {3.0}}, {"sense", {1.0}}};
  values.texts = {{"sense", "backward"}};
  const std::vector<double> packed = pack(slide->params_size, slide->pack, values);
  const double q = 0.5, v = 2.0;
  const std::uint32_t zero = 0;
  cardan_hinge_out out{};
  slide->kinematics(packed.data(), 1, &zero, &zero, &q, &v, &out);
  EXPECT_EQ(out.p_OP[0], -3.0);
  EXPECT_EQ(out.Ht[3], -6.0);
}

const FamilyKind& hinge_kind() {
  for (const FamilyKind& kind : family_kinds())
    if (std::strcmp(kind.kind, CARDAN_KIND_HINGE) == 0) return kind;
  throw std::logic_error("no hinges");
}

/// A table as a plugin of another minor would have it: `size` bytes of ours, then something.
template <class Table>
std::vector<char> of_size(Table table, std::size_t size) {
  std::vector<char> bytes(std::max(size, sizeof table), '\x5A');
  table.struct_size = static_cast<std::uint32_t>(size);
  std::memcpy(bytes.data(), &table, sizeof table);
  std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(std::min(size, sizeof table)), bytes.end(), '\x5A');
  return bytes;
}

cardan_hinge_family any_hinge() {
  cardan_hinge_family t{};
  t.type = "any", t.summary = "";
  t.zero = [](const void*, double*) {};
  t.packed_size = [](const cardan_param_values*) { return std::uint64_t{1}; };
  return t;
}

TEST(Tables, ThatAreShorterAreFilledWithNothing) {
  static const std::vector<char> bytes = of_size(any_hinge(), offsetof(cardan_hinge_family, normalise));
  const KeptTable kept = hinge_kind().keep(bytes.data());
  ASSERT_NE(kept.table, nullptr) << kept.fault;
  const auto& t = *static_cast<const cardan_hinge_family*>(kept.table);
  EXPECT_STREQ(t.type, "any");
  EXPECT_NE(t.zero, nullptr);
  EXPECT_EQ(t.normalise, nullptr);
  EXPECT_EQ(t.packed_size, nullptr);
  EXPECT_EQ(hinge_kind().keep(bytes.data()).table, kept.table) << "the same table gives the same copy";
}

TEST(Tables, ThatAreLongerAreReadAsFarAsTheyAreKnown) {
  static const std::vector<char> bytes = of_size(any_hinge(), sizeof(cardan_hinge_family) + 64);
  const KeptTable kept = hinge_kind().keep(bytes.data());
  ASSERT_NE(kept.table, nullptr) << kept.fault;
  EXPECT_NE(static_cast<const cardan_hinge_family*>(kept.table)->packed_size, nullptr);
  EXPECT_EQ(static_cast<const cardan_hinge_family*>(kept.table)->struct_size, sizeof(cardan_hinge_family));
}

TEST(Tables, ThatLackWhatTheirKindNeedsAreRefused) {
  static const std::vector<char> bytes = of_size(any_hinge(), offsetof(cardan_hinge_family, qdot));
  const KeptTable kept = hinge_kind().keep(bytes.data());
  EXPECT_EQ(kept.table, nullptr);
  EXPECT_EQ(kept.fault.find("struct_size: 112, expected at least 120"), 0u) << kept.fault;
}

TEST(Descriptions, AreReadInStepsOfTheirOwnSize) {
  struct Newer {
    cardan_param_desc known;
    double unknown;
  };
  struct Older {  // without range and names
    const char* name;
    std::uint32_t kind, flags;
    const char *unit, *meaning;
    double fallback[3];
  };
  static const Newer newer[] = {{{"a", 0, 0, "m", "x", {1, 2, 3}, 4, 5, 6, nullptr, nullptr}, 7},
                                {{"b", 1, 1, "kg", "y", {8}, 9, 10, 0, nullptr, nullptr}, 11}};
  static const Older older[] = {{"a", 0, 0, "m", "x", {1, 2, 3}}, {"b", 1, 1, "kg", "y", {8, 0, 0}}};
  static cardan_hinge_family of_newer = any_hinge(), of_older = any_hinge(), of_none = any_hinge();
  const auto kept = [](cardan_hinge_family& t, const void* params, std::size_t size) {
    t.struct_size = sizeof t, t.params = static_cast<const cardan_param_desc*>(params), t.n_params = 2;
    t.param_size = static_cast<std::uint32_t>(size);
    return hinge_kind().keep(&t);
  };
  const auto* n = static_cast<const cardan_hinge_family*>(kept(of_newer, newer, sizeof(Newer)).table);
  const auto* o = static_cast<const cardan_hinge_family*>(kept(of_older, older, sizeof(Older)).table);
  ASSERT_TRUE(n && o);
  for (const auto* t : {n, o}) {
    EXPECT_STREQ(t->params[1].name, "b");
    EXPECT_EQ(t->params[1].fallback[0], 8);
    EXPECT_EQ(t->param_size, sizeof(cardan_param_desc));
  }
  EXPECT_EQ(n->params[1].upper, 10);
  EXPECT_EQ(o->params[1].upper, 0) << "no range";
  EXPECT_EQ(o->params[0].names, nullptr);
  EXPECT_EQ(kept(of_none, older, 16).fault.find("param_size: 16, expected sizeof(cardan_param_desc)"), 0u);
}

}  // namespace
}  // namespace cardan
