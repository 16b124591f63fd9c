// Contract 2.6: vectors that one number may stand for, and fields with edges. Its headers against the present ones, and a plugin of it in
// C11.
#include <gtest/gtest.h>

#include <map>

#include "core/abi/cardan_field.h"
#include "core/abi/registry.hpp"
#include "tests/abi/2.6/layout.h"
#include "tests/abi/layout_test.hpp"

namespace cardan {
namespace {

TEST(Contract26, HasItsMembersAndConstantsWhereTheyWere) {
  const std::map<std::string, Place> fields = {
#define CONSTANT(name)
#define FIELD(type, member) {#type "." #member, {offsetof(type, member), sizeof(type::member)}},
#include "tests/abi/2.6/fields.inc"
#undef FIELD
#undef CONSTANT
  };
  expect_where_they_were({frozen_fields_2_6, n_frozen_fields_2_6}, fields);
  const std::map<std::string, long> constants = {
#define FIELD(type, member)
#define CONSTANT(name) {#name, static_cast<long>(name)},
#include "tests/abi/2.6/fields.inc"
#undef CONSTANT
#undef FIELD
  };
  expect_what_they_were({frozen_constants_2_6, n_frozen_constants_2_6}, constants);
}

/// Loading it has run the laws over it.
TEST(Contract26, APluginOfItIsLoadedAndWorks) {
  Registry registry;
  load_plugin(CARDAN_BINARY_DIR "/plugins/frozen_2_6.so", registry);
  const cardan_field_family* band = registry.field("frozen/band");
  ASSERT_NE(band, nullptr);
  EXPECT_EQ(band->params[0].flags, static_cast<std::uint32_t>(CARDAN_EACH));
  const double edges[] = {1.0, 2.0, 0.0}, point[] = {1.5, 0.0, 0.0};
  double g[CARDAN_FIELD_EDGES] = {};
  const cardan_field_args at{sizeof at, 0.0, edges, nullptr};
  EXPECT_EQ(band->edges(&at, point, g), 2u);
  EXPECT_EQ(g[0], 2.5);
  EXPECT_EQ(g[1], -0.5);
}

}  // namespace
}  // namespace cardan
