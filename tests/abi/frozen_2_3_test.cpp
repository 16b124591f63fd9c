// Contract 2.3: bodies. Its header against the present one, and a plugin of it in C11.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <map>

#include "core/abi/cardan_body.h"
#include "core/abi/modal_view.hpp"
#include "core/abi/param_values.hpp"
#include "core/abi/plugin_host.hpp"
#include "core/abi/registry.hpp"
#include "tests/abi/2.3/layout.h"
#include "tests/abi/layout_test.hpp"

namespace cardan {
namespace {

TEST(Contract23, HasItsMembersAndConstantsWhereTheyWere) {
  const std::map<std::string, Place> fields = {
#define CONSTANT(name)
#define FIELD(type, member) {#type "." #member, {offsetof(type, member), sizeof(type::member)}},
#include "tests/abi/2.3/fields.inc"
#undef FIELD
#undef CONSTANT
  };
  const std::map<std::string, long> constants = {
#define FIELD(type, member)
#define CONSTANT(name) {#name, static_cast<long>(name)},
#include "tests/abi/2.3/fields.inc"
#undef CONSTANT
#undef FIELD
  };
  expect_where_they_were({frozen_fields_2_3, n_frozen_fields_2_3}, fields);
  expect_what_they_were({frozen_constants_2_3, n_frozen_constants_2_3}, constants);
}

/// Loading it has run the laws over it.
TEST(Contract23, APluginOfItIsLoadedAndWorks) {
  Registry registry;
  load_plugin(CARDAN_BINARY_DIR "/plugins/frozen_2_3.so", registry);
  const cardan_body_family *slab = registry.body("frozen/slab"), *hanger = registry.body("frozen/hanger");
  ASSERT_NE(slab, nullptr);
  ASSERT_NE(hanger, nullptr);

  ParamTable values;
  values.numbers = {{"edge", {3.0}}, {"areal", {2.0}}};
  const cardan_param_values slab_values = values.view();
  double mass = 0.0;
  std::array<double, 3> com{};
  std::array<double, 6> inertia{};
  EXPECT_EQ(slab->rigid(&slab_values, &mass, com.data(), inertia.data()), 0);
  EXPECT_EQ(mass, 18.0);
  EXPECT_EQ(inertia, (std::array<double, 6>{13.5, 13.5, 27.0, 0.0, 0.0, 0.0}));

  ModalData modes;
  modes.n_modes = 1;
  modes.integrals.I1 = 6.0;
  modes.integrals.I3 = modes.integrals.I4 = Eigen::MatrixXd::Zero(3, 1);
  modes.integrals.I6 = Eigen::MatrixXd::Identity(1, 1);
  modes.nodes.push_back(
      {"end", Eigen::Vector3d(0, 0, -2), Eigen::Matrix3d::Identity(), Eigen::MatrixXd::Zero(3, 1), Eigen::MatrixXd::Zero(3, 1)});
  const ModalView view(modes, 0);
  EXPECT_EQ(view.get()->n_nodes, 1u);
  EXPECT_STREQ(view.get()->nodes[0].name, "end");
  ParamTable none;
  const cardan_param_values no_values = none.view();
  std::vector<double> packed(hanger->packed_size(&no_values, view.get()) / sizeof(double));
  ASSERT_EQ(hanger->pack(&no_values, view.get(), packed.data()), 0);
  cardan_body_facts facts{};
  facts.struct_size = sizeof facts;
  hanger->facts(packed.data(), &facts);
  EXPECT_EQ(facts.m_ee_constant, 1u);
  EXPECT_EQ(facts.j_constant, 0u);

  const double angle = 0.5, rate = 2.0, s = std::sin(angle), c = std::cos(angle);
  std::array<double, 10> rr{};
  std::array<double, 6> re{};
  double ee = 0.0;
  hanger->mass(packed.data(), &angle, rr.data(), re.data(), &ee);
  EXPECT_EQ(rr[0], 6.0);
  EXPECT_DOUBLE_EQ(rr[1], -6.0 * s);
  EXPECT_DOUBLE_EQ(rr[8], -12.0 * s * c);  // xz: minus 3 kg times x z
  EXPECT_EQ(re[1], 12.0);
  EXPECT_DOUBLE_EQ(re[5], 6.0 * s);
  EXPECT_EQ(ee, 12.0);
  const std::array<double, 3> still{};
  std::array<double, 7> b{};
  hanger->bias(packed.data(), &angle, &rate, still.data(), b.data());
  EXPECT_DOUBLE_EQ(b[3], 24.0 * s);  // towards the axis: 3 kg, 2 m, (2 rad/s)^2
  EXPECT_DOUBLE_EQ(b[5], 24.0 * c);
  std::array<double, 6> x{}, S{}, a{};
  hanger->node(packed.data(), 0, &angle, &rate, x.data(), S.data(), a.data());
  EXPECT_EQ(x[1], angle);
  EXPECT_DOUBLE_EQ(x[5], 2.0 - 2.0 * c);
  EXPECT_DOUBLE_EQ(S[3], -2.0 * c);
  EXPECT_DOUBLE_EQ(a[5], 8.0 * c);
}

}  // namespace
}  // namespace cardan
