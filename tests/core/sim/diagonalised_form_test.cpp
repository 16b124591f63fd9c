// Runs in (q, nu) against runs in (q, v), and what they keep.
#include "core/sim/diagonalised_form.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/base/diagnostic.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/sim/choose_method.hpp"
#include "core/sim/description.hpp"
#include "core/sim/simulation.hpp"
#include "tests/support/builders.hpp"
#include "tests/support/modal_samples.hpp"
#include "tests/support/random_tree.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::VectorXd;

SimulationOptions by(Dynamics dynamics, const std::string& method = "dop853", double relative = 1e-11) {
  SimulationOptions options;
  options.dynamics = dynamics;
  options.integrator.method = method, options.integrator.relative_tolerance = relative;
  if (method == "rk4") options.integrator.fixed_step = 1e-3;
  return options;
}
constexpr Dynamics kBoth[] = {Dynamics::diagonalised, Dynamics::diagonalised_rates};

/// Of the end, over its size.
double difference(const Model& m, const State& a, const State& b) {
  VectorXd d(m.nv);
  m.difference(b.q.data(), a.q.data(), d.data());
  return worse(largest(d), distance(a.v, b.v)) / (1.0 + b.v.norm());
}

/// Every hinge, flexible bodies at every level and place of the tree, springs, stops, friction, given motions that vary, gravity.
TEST(DiagonalisedForm, AgreesWithStandardDynamicsOnRandomTrees) {
  for (const auto gravity : {GravitySpec::Kind::none, GravitySpec::Kind::uniform, GravitySpec::Kind::central})
    for (unsigned seed = first_seed(); seed < first_seed() + 25; ++seed) {
      const RandomTree tree = with_factor(random_tree(seed, {.bodies = 6,
                                                             .modes = seed % 3 == 0 ? 7 : 0,
                                                             .prescribed = 0.1,
                                                             .springs = true,
                                                             .loads = seed % 5 == 0,
                                                             .gravity = gravity}),
                                          seed % 2 == 0 ? HingeFactor::square_root : HingeFactor::cholesky);
      const auto model = compiled(tree.spec);
      if (!DiagonalisedForm::refusal(*model).empty()) continue;
      bool balanced = true;  // a rate that jumps at the start is left out of the balance, whatever is integrated
      const auto end = [&](Dynamics dynamics) {
        Simulation sim(model, by(dynamics));
        for (int i = 0; i < model->nv; ++i)
          if (model->has_given_motion(i)) sim.prescribe(i, MotionProfile::sine(0.1, 2.0, 0.3 * i));
        sim.run(0.2);
        if (dynamics == Dynamics::standard) balanced = sim.ledger().pass;
        EXPECT_EQ(sim.ledger().pass, balanced) << name_of(dynamics) << ", seed " << seed;
        return sim.state();
      };
      const State wanted = end(Dynamics::standard);
      for (const Dynamics dynamics : kBoth)
        EXPECT_LT(difference(*model, end(dynamics), wanted), 1e-8) << name_of(dynamics) << ", seed " << seed << "\n" << describe(tree);
    }
}

SystemSpec tumbling(const GravitySpec& gravity = {}) {
  BodySpec bus = on(rigid("bus", 40.0, {0.02, -0.01, 0.05}, diagonal({8.0, 6.0, 9.0})), "", "free_body");
  bus.hinge.v = {0.4, -0.7, 0.5, 0.1, 0.0, -0.1};
  BodySpec arm =
      on(rigid("arm", 3.0, {0.1, 0.0, 0.5}, diagonal({0.4, 0.5, 0.1})), "bus", "universal", {{0, 1, 0}, {1, 0, 0}}, {0.3, 0, 0.4});
  arm.hinge.v = {1.0, -0.6};
  BodySpec hand = on(rigid("hand", 1.0, {0.0, 0.1, 0.3}, diagonal({0.02, 0.03, 0.01})), "arm", "ball", {}, {0.0, 0.0, 1.0});
  hand.hinge.v = {0.5, 1.5, -1.0};
  BodySpec wheel = on(rigid("wheel", 2.0, {0, 0, 0}, diagonal({0.01, 0.01, 0.02})), "bus", "revolute", {{0, 0, 1}}, {0.1, 0.2, -0.3});
  wheel.hinge.v = {30.0};
  return system({bus, arm, hand, wheel}, gravity);
}

/// The whole of every method that steps it, at ticks, an event and a command.
TEST(DiagonalisedForm, GoesWithEachMethodThatItTakes) {
  const auto model = compiled(tumbling(uniform_gravity({0, 0, -1.0})));
  const auto end = [&](Dynamics dynamics, const std::string& method, double relative) {
    Simulation sim(model, by(dynamics, method, relative));
    const int arm = model->user[1].v, q = model->user[1].q;
    sim.every({1, 8}, [&sim, arm] { sim.set_force(arm, 0.5 * std::cos(3.0 * sim.time())); });
    int events = 0;
    sim.add_event({"arm passes", [q](double, const double* x, const double* v) { return x[q] - 0.2 - 0.01 * v[0]; }, 0,
                   [&] { ++events, sim.set_force(arm + 1, 0.1 * events); }});
    sim.run(1.0);
    EXPECT_GT(events, 0) << method;
    EXPECT_TRUE(sim.ledger().pass) << method;
    EXPECT_EQ(sim.integrator_name(), method);
    return sim.state();
  };
  const State wanted = end(Dynamics::standard, "dop853", 1e-12);
  for (const Dynamics dynamics : kBoth)
    for (const std::string method : {"rk4", "dopri5", "dop853", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_implicit", "ark_imex"})
      EXPECT_LT(difference(*model, end(dynamics, method, 1e-9), wanted), method.starts_with("cvode") ? 3e-6 : 1e-7)
          << method << ", " << name_of(dynamics);
}

/// Equal steps, halved: the error falls by 2^4.
TEST(DiagonalisedForm, KeepsTheOrderOfTheMethod) {
  const auto model = compiled(tumbling());
  for (const Dynamics dynamics : kBoth) {
    const auto end = [&](double step) {
      SimulationOptions options = by(dynamics, "rk4");
      options.integrator.fixed_step = step;
      Simulation sim(model, options);
      sim.run(0.5);
      return sim.state();
    };
    const State finest = end(1.0 / 1024);
    const double coarse = difference(*model, end(1.0 / 32), finest), fine = difference(*model, end(1.0 / 64), finest);
    EXPECT_NEAR(std::log2(coarse / fine), 4.0, 0.3) << name_of(dynamics);
  }
}

/// 1/2 |nu|^2 is the kinetic energy of each state that a run comes to, and stays what it was at the start where nothing works, to the
/// error of the method.
TEST(DiagonalisedForm, EnergyIsANorm) {
  const auto model = compiled(tumbling());
  DiagonalVelocities velocities(model, true);
  Simulation sim(model, by(Dynamics::diagonalised));
  const double before = sim.energy().kinetic;
  for (int i = 1; i <= 10; ++i) {
    sim.run(0.3 * i);
    VectorXd nu(model->nv);
    ASSERT_TRUE(velocities.at(sim.state().q.data()));
    velocities.from_velocity(sim.state().v.data(), nu.data());
    EXPECT_NEAR(0.5 * nu.squaredNorm(), sim.energy().kinetic, 1e-14 * before * 10);
    EXPECT_NEAR(sim.energy().kinetic, before, 1e-10 * before);
  }
}

/// What devices hold, and let go: given motions that come and go in the run.
TEST(DiagonalisedForm, FollowsWhatDevicesHold) {
  SystemSpec spec = system(base_with_sprung_arm());
  DeviceSpec brake;
  brake.name = "brake", brake.type = "dry_friction";
  brake.params["coulomb"].value = 1.0, brake.params["breakaway"].value = 1.5;
  brake.mounts["at"].target = "arm";
  spec.devices = {brake};
  const auto model = compiled(spec);
  const auto end = [&](Dynamics dynamics, int& held) {
    Simulation sim(model, by(dynamics));
    const int arm = model->user[1].v;
    sim.every({1, 2}, [&sim, arm] { sim.set_force(arm, sim.time() == 1.0 ? 4.0 : sim.time() == 2.5 ? -5.0 : 0.0); });
    for (int i = 1; i <= 40; ++i) sim.run(0.1 * i), held += sim.state().marks[0] != 0.0;
    return sim.state();
  };
  int held = 0, same = 0;
  const State wanted = end(Dynamics::standard, held);
  EXPECT_GT(held, 0);
  EXPECT_LT(held, 40);
  for (const Dynamics dynamics : kBoth) {
    EXPECT_LT(difference(*model, end(dynamics, same = 0), wanted), 1e-8) << name_of(dynamics);
    EXPECT_EQ(same, held);
  }
}

/// Absolute tolerances of rates become those of nu by the roots of the articulated inertias of the vehicle as it is described, also where
/// the run begins elsewhere: a smaller inertia asks for smaller errors of nu.
TEST(DiagonalisedForm, TolerancesAreTheRootsOfEnergies) {
  const auto steps = [](double scale) {
    SystemSpec spec = tumbling();
    for (BodySpec& b : spec.bodies) b.mass *= scale, b.inertia_com *= scale;
    Simulation sim(compiled(spec), by(Dynamics::diagonalised, "dopri5", 1e-8));
    sim.run(2.0);
    return sim.statistics().rhs_calls;
  };
  // Masses times a constant change nothing but the unit of energy; powers of four change no bit of the motion.
  EXPECT_EQ(steps(1.0), steps(1024.0));
  EXPECT_EQ(steps(1.0), steps(1.0 / 4096.0));
}

TEST(DiagonalisedForm, IsToldAndNamed) {
  Simulation sim(compiled(tumbling()), by(Dynamics::diagonalised_rates));
  EXPECT_NE(integrator_text(sim.options()).find(", diagonalised_rates dynamics"), std::string::npos);
  EXPECT_EQ(integrator_text(by(Dynamics::standard)).find("dynamics"), std::string::npos);
}

template <class Work>
void expect_refused(const Work& work, const std::string& what) {
  try {
    work();
    FAIL() << what;
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics().at(0).code, Code::unsupported) << what;
    EXPECT_EQ(e.diagnostics().at(0).at.key_path, "dynamics") << what;
    EXPECT_NE(e.diagnostics().at(0).expected.find(what), std::string::npos) << e.diagnostics().at(0).expected;
  }
}

TEST(DiagonalisedForm, RefusesMethodsThatItDoesNotTake) {
  for (const std::string method : {"exponential", "multirate", "variational", "variational4"}) {
    SimulationOptions options = by(Dynamics::diagonalised, method);
    if (method.starts_with("variational")) options.integrator.fixed_step = 0.01;
    expect_refused([&] { Simulation(compiled(tumbling()), options).run(0.1); }, "the method " + method);
  }
  SimulationOptions options = by(Dynamics::diagonalised, "cvode_bdf");
  options.integrator.linear_solver = "krylov";
  expect_refused([&] { Simulation(compiled(tumbling()), options).run(0.1); }, "linear_solver krylov");
}

TEST(DiagonalisedForm, AutoChoosesAMethodThatItTakes) {
  SystemSpec spec = tumbling();
  SpringDamper stiff;
  stiff.stiffness = 1e8, stiff.damping = 1e7;
  spec.bodies[3].hinge.springs = {stiff};
  for (const bool damped : {true, false}) {
    if (!damped) spec.bodies[3].hinge.springs[0].damping = 0.0;
    const MethodChoice choice =
        choose_method(compiled(spec), 0.01, by(Dynamics::diagonalised, "auto", 1e-6).integrator, Dynamics::diagonalised);
    EXPECT_EQ(DiagonalisedForm::refusal(choice.options), "") << choice.options.method;
    EXPECT_NE(choice.why.find("diagonalised dynamics"), std::string::npos) << choice.why;
  }
}

/// A direction without inertia is told as that of standard dynamics is.
TEST(DiagonalisedForm, TellsADirectionWithoutInertia) {
  SystemSpec spec = system({on(particle("mass", 1.0, {0, 0, 0}), "", "revolute", {{0, 0, 1}})});
  const auto told = [&](Dynamics dynamics) {
    Simulation sim(compiled(spec), by(dynamics));
    try {
      sim.run(1.0);
    } catch (const NumericsError& e) {
      return e.failure().code == Code::singular_hinge && e.failure().body == "mass";
    }
    return false;
  };
  EXPECT_TRUE(told(Dynamics::standard));
  for (const Dynamics dynamics : kBoth) EXPECT_TRUE(told(dynamics));
}

}  // namespace
}  // namespace cardan::test
