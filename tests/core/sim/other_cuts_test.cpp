// Loops cut at another of their hinges: the same mechanism, and what it would cost (docs/adr/0016-cuts-of-loops.md).
#include "core/sim/other_cuts.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "core/dynamics/observe.hpp"
#include "core/model/embedding.hpp"
#include "tests/support/bench_loops.hpp"
#include "tests/support/four_bar.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::VectorXd;

SystemSpec at_rest(SystemSpec spec) {
  for (BodySpec& b : spec.bodies) b.hinge.v.clear(), b.hinge.springs.clear(), b.hinge.loads.clear();
  return spec;
}

/// Accelerations of all bodies from rest.
std::map<std::string, Eigen::Matrix<double, 6, 1>> falling(const Model& model) {
  Workspace ws(model);
  const State s = model.initial_state();
  const VectorXd still = VectorXd::Zero(model.nv);
  VectorXd vdot(model.nv);
  const Inputs in{.q = s.q.data(), .v = still.data(), .tau = still.data()};
  EXPECT_TRUE(forward_dynamics(model, ws, in, vdot.data()));
  Observer observer(model, ws);
  observer.update(in, vdot.data());
  std::map<std::string, Eigen::Matrix<double, 6, 1>> out;
  for (const UserBody& u : model.user) out[u.name] = observer.node(model.find_node(u.name)).acceleration;
  return out;
}

TEST(OtherCuts, AreTheSameMechanism) {
  std::vector<std::pair<std::string, SystemSpec>> all = {{"four_bar", at_rest(four_bar())}, {"in space", at_rest(four_bar("revolute"))}};
  for (const char* name : {"andrews", "bricard", "six_bar", "lattice_4", "hexapod_free"})
    all.emplace_back(name, at_rest(bench_loops::read(fmt::format("{}/tests/reference/bench_loops/{}.json", CARDAN_SOURCE_DIR, name)).spec));
  for (const auto& [name, spec] : all) {
    const auto model = compiled(spec);
    const auto want = falling(*model);
    double size = 0.0;
    for (const auto& [body, a] : want) size = std::max(size, largest(a));
    int cuts = 0;
    for (const Loop& loop : model->loops.all)
      for (const UserBody& u : model->user) {
        const auto other = cut_at(*model, loop.name, u.name);
        if (!other) continue;
        ++cuts;
        const auto got = falling(*compiled(*other));
        for (const auto& [body, a] : want) EXPECT_LE(distance(got.at(body), a), 1e-10 * size) << name << " " << loop.name << " " << u.name;
      }
    EXPECT_GT(cuts, 2) << name;
  }
}

TEST(OtherCuts, AreNotThereWhereAHingeHasToStay) {
  SystemSpec spec = at_rest(four_bar());
  LoopSpec gear;
  gear.name = "gear", gear.type = "coupling", gear.open = true;
  gear.terms = {{"coupler", 1.0, {}}, {"crank", -2.0, {}}};
  spec.loops.push_back(gear);
  const auto model = compiled(spec);
  EXPECT_FALSE(cut_at(*model, "pivot", "coupler"));
  EXPECT_FALSE(cut_at(*model, "pivot", "crank"));
  EXPECT_TRUE(cut_at(*model, "pivot", "rocker"));
  EXPECT_FALSE(cut_at(*model, "gear", "rocker"));
  EXPECT_FALSE(cut_at(*model, "pivot", "nobody"));
}

// What the record of the decision says: elsewhere no published mechanism is 8 % cheaper, and none of another kind.
TEST(OtherCuts, GainLittleOnPublishedMechanisms) {
  for (const auto& file : bench_loops::files()) {
    const auto costs = cut_costs(*compiled(at_rest(bench_loops::read(file).spec)), registry());
    ASSERT_TRUE(costs) << file;
    for (const CutCost& c : costs->others)
      EXPECT_GE(static_cast<double>(c.flops), 0.92 * static_cast<double>(costs->flops)) << file << " " << c.loop << " " << c.hinge;
  }
}

}  // namespace
}  // namespace cardan::test
