// Contract 2.2: ports that say whether they hold, and impulses. Its headers against the present ones, and a plugin of it in C11.
#include <gtest/gtest.h>

#include <cstddef>
#include <map>

#include "core/abi/cardan_device.h"
#include "core/abi/param_values.hpp"
#include "core/abi/plugin_host.hpp"
#include "core/abi/registry.hpp"
#include "tests/abi/2.2/layout.h"
#include "tests/abi/layout_test.hpp"

namespace cardan {
namespace {

TEST(Contract22, HasItsMembersAndConstantsWhereTheyWere) {
  const std::map<std::string, Place> fields = {
#define CONSTANT(name)
#define FIELD(type, member) {#type "." #member, {offsetof(type, member), sizeof(type::member)}},
#include "tests/abi/2.2/fields.inc"
#undef FIELD
#undef CONSTANT
  };
  const std::map<std::string, long> constants = {
#define FIELD(type, member)
#define CONSTANT(name) {#name, static_cast<long>(name)},
#include "tests/abi/2.2/fields.inc"
#undef CONSTANT
#undef FIELD
  };
  expect_where_they_were({frozen_fields_2_2, n_frozen_fields_2_2}, fields);
  expect_what_they_were({frozen_constants_2_2, n_frozen_constants_2_2}, constants);
}

/// Loading it has run the laws over it.
TEST(Contract22, APluginOfItIsLoadedAndWorks) {
  Registry registry;
  load_plugin(CARDAN_BINARY_DIR "/plugins/frozen_2_2.so", registry);
  const cardan_device_family* striker = registry.device("frozen/striker");
  ASSERT_NE(striker, nullptr);
  EXPECT_STREQ(striker->ports[0].valid, "whole");
  EXPECT_EQ(striker->ports[1].valid, nullptr);
  ParamTable values;
  values.numbers = {{"blow", {2.5}}};
  const std::vector<double> packed = pack(striker->params_size, striker->pack, values);
  cardan_mount_motion mount{};
  const double d = 0.0;
  const cardan_device_args at{sizeof at, 1.0, packed.data(), nullptr, &mount, nullptr, &d};
  cardan_mount_load load{};
  EXPECT_EQ(striker->impulse(&at, 0, -1, &load), 0);
  EXPECT_EQ(load.force[0], 0.0);
  EXPECT_EQ(striker->impulse(&at, 0, 1, &load), 0);
  EXPECT_EQ(load.force[0], 2.5);
}

}  // namespace
}  // namespace cardan
