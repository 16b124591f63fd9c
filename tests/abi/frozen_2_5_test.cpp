// Contract 2.5: devices that need a hinge component that turns, or has a coordinate. Its headers against the present ones, and a plugin of
// it in C11.
#include <gtest/gtest.h>

#include <map>

#include "core/abi/cardan_device.h"
#include "core/abi/registry.hpp"
#include "tests/abi/2.5/layout.h"
#include "tests/abi/layout_test.hpp"

namespace cardan {
namespace {

TEST(Contract25, HasItsConstantsWhereTheyWere) {
  const std::map<std::string, long> constants = {
#define CONSTANT(name) {#name, static_cast<long>(name)},
#include "tests/abi/2.5/fields.inc"
#undef CONSTANT
  };
  expect_what_they_were({frozen_constants_2_5, n_frozen_constants_2_5}, constants);
}

/// Loading it has run the laws over it.
TEST(Contract25, APluginOfItIsLoadedAndWorks) {
  Registry registry;
  load_plugin(CARDAN_BINARY_DIR "/plugins/frozen_2_5.so", registry);
  const cardan_device_family* back = registry.device("frozen/return");
  ASSERT_NE(back, nullptr);
  EXPECT_EQ(back->mounts[0].use, CARDAN_USE_LOAD | CARDAN_USE_TURN | CARDAN_USE_COORDINATE);
  const double stiffness = 3.0;
  cardan_mount_motion mount{};
  mount.q = 0.5;
  const cardan_device_args at{sizeof at, 0.0, &stiffness, nullptr, &mount, nullptr, nullptr};
  cardan_mount_load load{};
  cardan_device_out out{nullptr, nullptr, &load, 0.0, 0.0};
  EXPECT_EQ(back->evaluate(&at, &out), 0);
  EXPECT_EQ(load.tau, -1.5);
}

}  // namespace
}  // namespace cardan
