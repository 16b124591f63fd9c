// A plugin is served like what is built in: the same source gives the same bits.
#include <gtest/gtest.h>

#include <cstring>

#include "bodies/register.hpp"
#include "core/dynamics/forward.hpp"
#include "hinges/register.hpp"
#include "tests/support/random_tree.hpp"

namespace cardan {
namespace {

const Registry& registry() {
  static const Registry all = [] {
    Registry r;
    register_hinges(r), register_bodies(r);
    load_plugin(CARDAN_BINARY_DIR "/plugins/twins.so", r);
    return r;
  }();
  return all;
}

/// The same system made of the families of the plugin, where it has them; counts them.
SystemSpec of_twins(SystemSpec spec, int& hinges, int& bodies) {
  for (BodySpec& b : spec.bodies) {
    if (registry().hinge("twin/" + b.hinge.type)) b.hinge.type = "twin/" + b.hinge.type, ++hinges;
    if (registry().body("twin/" + b.type)) b.type = "twin/" + b.type, ++bodies;
  }
  return spec;
}

std::vector<double> acceleration(const SystemSpec& spec) {
  const auto model = compile(spec, registry());
  const State state = model->initial_state();
  Workspace workspace(*model);
  std::vector<double> tau(static_cast<std::size_t>(model->nv), 0.5), vdot(static_cast<std::size_t>(model->nv));
  Inputs in{};
  in.q = state.q.data(), in.v = state.v.data(), in.tau = tau.data();
  EXPECT_TRUE(forward_dynamics(*model, workspace, in, vdot.data()));
  return vdot;
}

TEST(PluginTwins, GiveTheSameBits) {
  int hinges = 0, bodies = 0;
  for (unsigned seed = test::first_seed(); seed < test::first_seed() + 30; ++seed) {
    test::TreeOptions options;
    options.hinges = {"universal", "revolute", "ball", "gimbal"};
    const SystemSpec spec = test::random_tree(seed, options).spec;
    const std::vector<double> built_in = acceleration(spec), foreign = acceleration(of_twins(spec, hinges, bodies));
    ASSERT_EQ(built_in.size(), foreign.size());
    EXPECT_EQ(std::memcmp(built_in.data(), foreign.data(), built_in.size() * sizeof(double)), 0) << "seed " << seed;
  }
  EXPECT_GT(hinges, 50);
  EXPECT_GT(bodies, 20);
}

TEST(PluginTwins, AreKnownByTheirOrigin) {
  EXPECT_EQ(registry().bodies.entry("twin/modal_flexible")->origin, CARDAN_BINARY_DIR "/plugins/twins.so");
  EXPECT_EQ(registry().bodies.entry("modal_flexible")->origin, "built-in");
}

}  // namespace
}  // namespace cardan
