// Contract 2.4: bodies that evaluate many states at once. What it added against the present header, and a plugin of it in C11.
#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <map>

#include "core/abi/cardan_body.h"
#include "core/abi/registry.hpp"
#include "tests/abi/2.4/layout.h"
#include "tests/abi/layout_test.hpp"

namespace cardan {
namespace {

TEST(Contract24, HasItsMembersWhereTheyWere) {
  const std::map<std::string, Place> fields = {
#define CONSTANT(name)
#define FIELD(type, member) {#type "." #member, {offsetof(type, member), sizeof(type::member)}},
#include "tests/abi/2.4/fields.inc"
#undef FIELD
#undef CONSTANT
  };
  expect_where_they_were({frozen_fields_2_4, n_frozen_fields_2_4}, fields);
}

/// Loading it has run the laws over it.
TEST(Contract24, APluginOfItIsLoadedAndWorks) {
  Registry registry;
  load_plugin(CARDAN_BINARY_DIR "/plugins/frozen_2_4.so", registry);
  const cardan_body_family* slider = registry.body("frozen/slider");
  ASSERT_NE(slider, nullptr);
  const double half = 2.0;  // [kg], as packed
  cardan_body_facts facts{};
  facts.struct_size = sizeof facts;
  slider->facts(&half, &facts);
  EXPECT_EQ(facts.states, 1u);
  alignas(16) const std::array<double, 2> eta = {0.5, -1.0}, etadot = {3.0, 0.0};
  alignas(16) const std::array<double, 6> omega = {0.0, 0.0, 2.0, 0.0, 0.0, 1.0};  // about y; about z
  alignas(16) std::array<double, 20> rr{};
  alignas(16) std::array<double, 14> b{};
  slider->states(&half, 2, eta.data(), etadot.data(), omega.data(), rr.data(), nullptr, nullptr, b.data());
  EXPECT_EQ(rr[0], 4.0);
  EXPECT_EQ(rr[2 * 3], 1.0);       // m c along z of the first: 2 kg, 0.5 m
  EXPECT_EQ(rr[2 * 3 + 1], -2.0);  // and of the second
  EXPECT_EQ(rr[2 * 8 + 1], 2.0);   // xz: minus 2 kg times x z
  EXPECT_EQ(b[2 * 3], 16.0);       // along x: 2 kg of 2 w z' - w^2 x = 12 - 4 (rad/s)^2 m
  EXPECT_EQ(b[2 * 3 + 1], -2.0);   // and - w^2 x of the second
}

}  // namespace
}  // namespace cardan
