// Contract 2.1, which released devices and fields: the headers of 2.1 against the present ones, and a plugin of 2.1 in C11.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <map>

#include "core/abi/cardan_device.h"
#include "core/abi/cardan_field.h"
#include "core/abi/param_values.hpp"
#include "core/abi/plugin_host.hpp"
#include "core/abi/registry.hpp"
#include "tests/abi/2.1/layout.h"
#include "tests/abi/layout_test.hpp"

namespace cardan {
namespace {

std::map<std::string, Place> present_fields() {
  return {
#define CONSTANT(name)
#define FIELD(type, member) {#type "." #member, {offsetof(type, member), sizeof(type::member)}},
#include "tests/abi/2.1/fields.inc"
#undef FIELD
#undef CONSTANT
  };
}
std::map<std::string, long> present_constants() {
  return {
#define FIELD(type, member)
#define CONSTANT(name) {#name, static_cast<long>(name)},
#include "tests/abi/2.1/fields.inc"
#undef CONSTANT
#undef FIELD
  };
}

TEST(Contract21, HasItsMembersWhereTheyWere) {
  expect_where_they_were({frozen_fields_2_1, n_frozen_fields_2_1}, present_fields());
  // Arrays of these have no stride of their own: their length is theirs for the whole major.
  EXPECT_EQ(sizeof(cardan_mount_motion), 35 * sizeof(double));
  EXPECT_EQ(sizeof(cardan_mount_load), 7 * sizeof(double));
  EXPECT_EQ(sizeof(cardan_mass), 10 * sizeof(double));
}

TEST(Contract21, HasItsConstants) {
  expect_what_they_were({frozen_constants_2_1, n_frozen_constants_2_1}, present_constants());
  EXPECT_STREQ(CARDAN_KIND_DEVICE, "device");
  EXPECT_STREQ(CARDAN_KIND_FIELD, "field");
}

/// Loading it has run the laws of both kinds over it.
TEST(Contract21, APluginOfItIsLoadedAndWorks) {
  Registry registry;
  load_plugin(CARDAN_BINARY_DIR "/plugins/frozen_2_1.so", registry);
  const cardan_device_family* paddle = registry.device("frozen/paddle");
  ASSERT_NE(paddle, nullptr);
  EXPECT_EQ(paddle->role, static_cast<std::uint32_t>(CARDAN_ROLE_FORCE));
  EXPECT_EQ(paddle->ports[0].flags, static_cast<std::uint32_t>(CARDAN_PORT_REQUIRED));
  EXPECT_STREQ(paddle->ports[1].frame, "at");
  ParamTable values;
  values.numbers = {{"drag", {2.0}}};
  const std::vector<double> packed = pack(paddle->params_size, paddle->pack, values);
  cardan_mount_motion mounts[2]{};
  mounts[0].omega[1] = 3.0, mounts[1].alpha[0] = 5.0;
  const double in = 1.0, z = 0.0;
  double d = 0.0, zdot = 0.0, out = 0.0;
  const cardan_device_args at{sizeof at, 0.0, packed.data(), &in, mounts, &z, &d};
  cardan_mount_load loads[2]{};
  cardan_device_out given{nullptr, &out, loads, 0.0, 0.0};
  EXPECT_EQ(paddle->evaluate(&at, &given), 0);
  EXPECT_EQ(loads[0].moment[1], -12.0);
  EXPECT_EQ(paddle->follow(&at, &zdot), 0);
  EXPECT_EQ(zdot, 5.0);
  EXPECT_EQ(paddle->tick(&at, 0.1, nullptr, nullptr, &d), 0);
  EXPECT_EQ(d, 1.0);
  EXPECT_STREQ(paddle->explain(packed.data(), paddle->tick(&at, 1e7, nullptr, nullptr, &d)), "a period beyond 1e6 s");

  const cardan_field_family* coil = registry.field("frozen/coil");
  ASSERT_NE(coil, nullptr);
  values.numbers = {{"flux", {0.5}}};
  const std::vector<double> flux = pack(coil->params_size, coil->pack, values);
  double prepared = 0.0, value[3];
  const double point[3] = {1.0, 2.0, 3.0};
  EXPECT_EQ(coil->prepare(2.0, flux.data(), &prepared), 0);
  const cardan_field_args when{sizeof when, 2.0, flux.data(), &prepared};
  EXPECT_EQ(coil->evaluate(&when, 1, point, value, nullptr), 0);
  EXPECT_DOUBLE_EQ(value[2], 0.5 * std::exp(-0.2));
  EXPECT_EQ(coil->prepare(11.0, flux.data(), &prepared), 1) << "beyond its limit, whose value it holds";
}

}  // namespace
}  // namespace cardan
