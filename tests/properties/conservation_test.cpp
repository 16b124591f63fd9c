// What simulations of random trees must keep, and what must close: momentum, energy, impulse and work. Ledgers compare
// the quantity now with that at the start and with what came from outside, which is integrated beside the state.
#include "tests/properties/loaded_simulation.hpp"

namespace cardan::test {
namespace {

struct Drift {
  double momentum, energy;
  double worst() const { return worse(momentum, energy); }
};

Drift drift_of(Simulation& sim, double t_end) {
  sim.run(t_end);
  const LedgerState l = sim.ledger();
  return {worse(l.linear_relative, l.angular_relative), l.energy_relative};
}

Drift free_drift(const RandomTree& tree, double relative) {
  SimulationOptions options;
  options.integrator.method = "dopri5";
  options.integrator.relative_tolerance = relative;
  Simulation sim(compiled(tree.spec), options);
  return drift_of(sim, 0.5);
}

class Isolated : public testing::TestWithParam<int> {
 protected:
  TreeOptions options_{.bodies = 5,
                       .roots = 1,
                       .flexible = 0.6,
                       .level = GetParam(),
                       .floating = true,
                       .damping = false,
                       .gravity = GravitySpec::Kind::none};
};

// Some dozen steps, each within 1e-11 of the state.
TEST_P(Isolated, TreesKeepMomentumAndEnergy) {
  for_all_trees(
      options_, 1e-10, [](const RandomTree& tree) { return free_drift(tree, 1e-11).worst(); }, 12);
}

// An inconsistent pair of mass matrix and bias drifts whatever the tolerance. Three digits tighter must give two digits
// less.
TEST_P(Isolated, DriftVanishesWithTheTolerance) {
  for_all_trees(
      options_, 1e-2,
      [](const RandomTree& tree) {
        const double coarse = free_drift(tree, 1e-5).worst(), fine = free_drift(tree, 1e-8).worst();
        return fine < 1e-12 ? 0.0 : fine / coarse;  // nothing left to gain
      },
      12);
}
INSTANTIATE_TEST_SUITE_P(Level, Isolated, testing::Values(0, 1, 2));

/// Everything at once: actuators, springs and dampers, prescribed motion, wrenches in both axes, modal damping.
double open_balance(const RandomTree& tree) {
  CompileOptions with_world;
  with_world.world_wrenches = true;
  SimulationOptions options;
  options.integrator.relative_tolerance = 1e-11;
  options.integrator.method = "dopri5";
  Simulation sim(compiled(tree.spec, with_world), options);
  set_loads(sim, tree);
  return drift_of(sim, 0.5).worst();
}

TEST(Energy, BalanceMatchesPower) {
  for (const auto kind : {GravitySpec::Kind::none, GravitySpec::Kind::uniform})
    for_all_trees({.bodies = 5, .flexible = 0.5, .locked = 0.1, .prescribed = 0.2, .springs = true, .gravity = kind}, 1e-10, open_balance,
                  40);  // several with folded wheels
}

TEST(Energy, BalanceMatchesPowerWithStopsAndFriction) {
  for_all_trees({.bodies = 5, .flexible = 0.3, .prescribed = 0.2, .springs = true, .loads = true}, 1e-9, open_balance, 12);
}

// The pull of a centre and the torque of its gradient come from one potential, for rigid bodies and for the modes of
// level 0, 1 and, without nodal rotary inertia and second-order displacements, level 2.
TEST(Energy, BalanceMatchesPowerInACentralField) {
  for (const int level : {0, 1, 2})
    for (const bool gradient : {false, true})
      for_all_trees({.bodies = 4, .flexible = 0.5, .level = level, .gravity = GravitySpec::Kind::central, .gradient = gradient}, 1e-10,
                    open_balance, 6);
}

/// Floating hub with a flexible body on a hinge.
RandomTree hub_with_flexible_body() {
  return random_tree(5, {.bodies = 2,
                         .roots = 1,
                         .flexible = 1.0,
                         .level = 1,
                         .floating = true,
                         .hinges = {"universal"},
                         .gravity = GravitySpec::Kind::none});
}

// Modes that start at rest and stiffen: what remains is their static deflection, proportional to 1 / K.
TEST(Flexible, StiffLimitIsRigid) {
  const RandomTree tree = hub_with_flexible_body();
  const auto end = [&](double stiffer, bool frozen_bodies) {
    SystemSpec spec = tree.spec;
    for (BodySpec& b : spec.bodies) {
      const int m = b.modal->n_modes;
      if (frozen_bodies) {
        b = frozen(b);
        continue;
      }
      auto modal = std::make_shared<ModalData>(*b.modal);
      modal->K *= stiffer;
      modal->C = std::sqrt(stiffer) * 0.3 * b.modal->K;  // near critical: the transient dies out at once
      b.modal = modal;
      b.eta.assign(static_cast<std::size_t>(m), 0.0);
      b.etadot = b.eta;
    }
    SimulationOptions options;
    options.integrator = {.method = "cvode_bdf", .relative_tolerance = 1e-11};
    Simulation sim(compiled(spec), options);
    sim.run(0.5);
    const Observer& o = sim.observe();
    VectorXd x(24);
    for (int k = 0; k < 2; ++k) x.segment<12>(12 * k) << to_eigen(o.body_pose(k).R).reshaped(), to_eigen(o.body_pose(k).p);
    return x;
  };
  const VectorXd rigid_end = end(0.0, true);
  const double at_1e5 = apart(end(1e5, false), rigid_end), at_1e7 = apart(end(1e7, false), rigid_end);
  EXPECT_LT(at_1e7, 1e-5);
  EXPECT_NEAR(at_1e5 / at_1e7, 100.0, 50.0) << at_1e5 << " at 1e5, " << at_1e7 << " at 1e7 times the stiffness";
}

TEST(Determinism, SameRunGivesTheSameBits) {
  const auto run = [](const char* method) {
    const RandomTree tree = random_tree(7, {.bodies = 6, .floating = true});
    SimulationOptions options;
    options.integrator.method = method;
    if (options.integrator.method == "rk4") options.integrator.fixed_step = 1e-2;
    Simulation sim(compiled(tree.spec), options);
    sim.every({1, 10}, [&sim] { sim.set_force(0, std::sin(sim.time())); });
    sim.run(0.5);
    VectorXd x(sim.model().nq + sim.model().nv);
    x << sim.state().q, sim.state().v;
    return x;
  };
  for (const char* method :
       {"rk4", "dopri5", "dop853", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit", "exponential", "multirate"})
    EXPECT_EQ(largest(run(method) - run(method)), 0.0) << method;
}

}  // namespace
}  // namespace cardan::test
