// A scene pays for what it has: memory and lines of the program follow from it.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include "core/dynamics/forward.hpp"
#include "core/soa/record.hpp"
#include "tests/support/builders.hpp"
#include "tests/support/random_tree.hpp"

namespace cardan::test {
namespace {

using Eigen::Vector3d;

SystemSpec chain(int n, const std::string& hinge = "revolute") {
  std::vector<BodySpec> bodies;
  for (int i = 0; i < n; ++i) {
    bodies.push_back(on(rigid(fmt::format("b{}", i), 1.0 + i % 3, Vector3d(0.1, 0.2, 0.5), diagonal({1, 1.5, 2})),
                        i == 0 ? "" : fmt::format("b{}", i - 1), hinge,
                        hinge == "revolute" ? std::vector<Vector3d>{Vector3d::Unit(i % 3)} : std::vector<Vector3d>{},
                        Vector3d(0, 0, 1)));
  }
  return system(bodies);
}

std::size_t rounded(std::size_t bytes) { return (bytes + 63) / 64 * 64; }

TEST(Cost, ARigidChainHasNoModalField) {
  const int n = 40;
  const auto model = compiled(chain(n));
  Workspace ws(*model);
  for (int k = 1; k <= n; ++k) EXPECT_EQ(ws.modal_of(k), nullptr);
  EXPECT_FALSE(ws.has_world());
  // Record of the body; angle, sine and cosine of its hinge (40 of them: a multiple of 8); q of the last evaluation.
  const std::size_t one = rounded(sizeof(soa::AxisRecord<double>)) + 4 * sizeof(double);
  EXPECT_EQ(ws.bytes(), rounded(sizeof(soa::Core<double>)) + n * one);
}

TEST(Cost, BytesGrowLinearly) {
  for (const char* hinge : {"revolute", "ball", "free"}) {
    const auto bytes = [&](int n) { return Workspace(*compiled(chain(n, hinge))).bytes(); };
    EXPECT_EQ(bytes(401) - bytes(201), bytes(201) - bytes(1)) << hinge;
  }
}

TEST(Cost, OneFlexibleBodyDoesNotMakeTheOthersDearer) {
  const RandomTree tree = random_tree(11, {.bodies = 12, .roots = 1, .flexible = 0.15, .floating = true});
  const auto model = compiled(tree.spec);
  const Workspace ws(*model);
  int rigid_records = 0;
  for (int k = 1; k < static_cast<int>(model->bodies.size()); ++k) {
    const SweepBody& b = model->bodies[static_cast<std::size_t>(k)];
    EXPECT_EQ(ws.modal_of(k) != nullptr, b.n_modes > 0 || b.onode >= 0);
    if (!ws.modal_of(k)) ++rigid_records;
  }
  EXPECT_GT(rigid_records, 3);
}

TEST(Cost, TheProgramOfAnUnforcedSceneIsItsHingesAndTheThreeSweeps) {
  CompileOptions bare;
  bare.node_wrenches = false;
  const auto model = compiled(chain(5), bare);
  for (const Kernel k : {Kernel::elastic, Kernel::world, Kernel::central_gravity, Kernel::node_wrenches})
    EXPECT_FALSE(model->has(k));
  EXPECT_EQ(model->program.size(), 1 + 3 * model->runs.size());
}

TEST(Cost, AnOpIsThereForWhatNeedsIt) {
  SystemSpec spec = chain(2, "ball");
  EXPECT_TRUE(compiled(spec)->has(Kernel::node_wrenches));
  EXPECT_FALSE(compiled(spec)->has(Kernel::world));
  CompileOptions with_world;
  with_world.world_wrenches = true;
  EXPECT_TRUE(compiled(spec, with_world)->has(Kernel::world));
  spec.gravity = uniform_gravity({0, 0, -9.81});
  EXPECT_FALSE(compiled(spec)->has(Kernel::central_gravity));
  spec.gravity = central_gravity(1.0, true, {100, 0, 0});
  EXPECT_TRUE(compiled(spec)->has(Kernel::central_gravity));
  EXPECT_TRUE(compiled(spec)->has(Kernel::world));
}

}  // namespace
}  // namespace cardan::test
