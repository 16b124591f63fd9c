// A step allocates nothing: malloc is counted in forward dynamics of every reference tree and in runs with everything
// on.
#include "tests/support/malloc_counter.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/abi/registry.hpp"
#include "core/dynamics/loops.hpp"
#include "core/operators/apply.hpp"
#include "core/operators/tree_operators.hpp"
#include "core/sim/simulation.hpp"
#include "tests/plugins/told_modal.hpp"
#include "tests/properties/equipped_vehicle.hpp"
#include "tests/support/builders.hpp"
#include "tests/support/custom_cam.hpp"
#include "tests/support/modal_samples.hpp"
#include "tests/support/oracle_reader.hpp"
#include "tests/support/random_tree.hpp"

namespace cardan::test {
namespace {

template <class Function>
long mallocs_in(const Function& function) {
  const long before = malloc_calls;
  function();
  return malloc_calls - before;
}

TEST(Alloc, TheCounterCounts) {
  if (!counting) GTEST_SKIP() << "a sanitizer brings its own malloc";
  std::vector<double> kept;
  EXPECT_GT(mallocs_in([&] { kept.resize(1000); }), 0);
}

TEST(Alloc, OperatorExpressions) {  // once the scratch is there
  using namespace operators;
  using namespace operators::letters;
  const auto model = compiled(random_tree(5, {.bodies = 8, .flexible = 0.4}).spec);
  TreeOperators tree(model);
  tree.at(model->initial_state().q.data());
  tree.articulate();
  tree.operational_space();
  const Eigen::VectorXd x = Eigen::VectorXd::Ones(tree.size(Space::hinge)), f = Eigen::VectorXd::Ones(tree.size(Space::body));
  Eigen::VectorXd y = x, g = f;
  const auto all = [&] {
    apply<false>(mass, tree, x.data(), y.data());
    apply<false>(mass_inverse, tree, x.data(), y.data());
    apply(mass, tree, x.data(), y.data());
    apply(mass_inverse, tree, x.data(), y.data());
    apply(omega, tree, f.data(), g.data());
    apply(phi * star(tau_bar) * Y + psi * E_phi - star(B * star(B)), tree, f.data(), g.data());
  };
  all();
  EXPECT_EQ(mallocs_in(all), 0);
}

TEST(Alloc, NodesThatAFamilyMoves) {
  Registry all = registry();
  all.bodies.add(told_modal(), "test");
  SystemSpec spec = random_tree(4, {.bodies = 8, .flexible = 0.7}).spec;
  for (BodySpec& b : spec.bodies)
    if (b.modal) b.type = told_modal().type;
  const auto model = compile(spec, all);
  std::vector<NodeWrench> wrenches;
  int curved = 0;
  for (int i = 0; i < static_cast<int>(model->nodes.size()); ++i) {
    curved += model->nodes[static_cast<std::size_t>(i)].shapes.is_curved();
    wrenches.push_back({i, false, {{1, 2, 3}, {4, 5, 6}}});
  }
  ASSERT_GT(curved, 3);
  Workspace ws(*model);
  const State s = model->initial_state();
  const Inputs in{.q = s.q.data(), .v = s.v.data(), .wrenches = wrenches};
  Eigen::VectorXd vdot(model->nv);
  bool ok = false;
  EXPECT_EQ(mallocs_in([&] { ok = forward_dynamics(*model, ws, in, vdot.data()); }), 0);
  EXPECT_TRUE(ok);
}

class ForwardDynamics : public testing::TestWithParam<std::filesystem::path> {};

TEST_P(ForwardDynamics, AllocatesNothing) {
  const oracle::Case c = oracle::read(GetParam());
  for (const int level : {0, 1, 2}) {
    const auto model = compile(oracle::at_level(c.spec, level), registry_with_cam());
    Workspace ws(*model);
    std::vector<NodeWrench> wrenches;
    for (const auto& p : c.points) {
      NodeWrench w;
      w.node = model->find_node(p.body + "." + p.node);
      w.f = force(p.wrench.data());
      wrenches.push_back(w);
    }
    Inputs in;
    in.q = c.q.data(), in.v = c.v.data(), in.tau = c.tau.data(), in.wrenches = wrenches;
    Eigen::VectorXd vdot(model->nv);
    bool ok = false;
    EXPECT_EQ(mallocs_in([&] { ok = forward_dynamics(*model, ws, in, vdot.data()); }), 0) << "level " << level;
    EXPECT_TRUE(ok);
  }
}
INSTANTIATE_TEST_SUITE_P(Files, ForwardDynamics, testing::ValuesIn(oracle::files()),
                         [](const auto& file) { return file.param.stem().string(); });

TEST(Alloc, HingesInSquareRootForm) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const RandomTree tree = with_factor(random_tree(seed, {.prescribed = 0.1}), HingeFactor::square_root);
    const auto model = compiled(tree.spec);
    Workspace ws(*model);
    const State s = model->initial_state();
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(model->nv);
    Eigen::VectorXd vdot(model->nv);
    const Inputs in{.q = s.q.data(), .v = s.v.data(), .vdot = zero.data()};
    bool ok = false;
    EXPECT_EQ(mallocs_in([&] { ok = forward_dynamics(*model, ws, in, vdot.data()); }), 0) << seed;
    EXPECT_TRUE(ok) << seed;
  }
}

TEST(Alloc, RefinementOfForwardDynamics) {  // masses that grow by large ratios, under gravity of a centre and a load
  std::vector<BodySpec> bodies;
  for (const double mass : {1e-6, 0.01, 100.0, 1e6}) {
    const std::string i = std::to_string(bodies.size());
    bodies.push_back(on(rigid("b" + i, mass, {0.1, 0, -1}, mass * diagonal({0.1, 0.15, 0.2})), bodies.empty() ? "" : bodies.back().name,
                        "ball", {}, {0, 0, -0.5}));
  }
  const auto model = compiled(system(bodies, central_gravity(2e4, true, {3, -4, 20})), {.world_wrenches = true});
  ASSERT_TRUE(model->has(OpCode::refine));
  Workspace ws(*model);
  const State s = model->initial_state();
  const std::vector<NodeWrench> loads{{model->find_node("b2"), true, {{0, 0, 0}, {1, 2, 3}}}};
  const Inputs in{.q = s.q.data(), .v = s.v.data(), .wrenches = loads};
  Eigen::VectorXd vdot(model->nv);
  bool ok = false;
  EXPECT_EQ(mallocs_in([&] { ok = forward_dynamics(*model, ws, in, vdot.data()); }), 0);
  EXPECT_TRUE(ok);
}

class ARun : public testing::TestWithParam<const char*> {};

// A tree with flexible bodies, ledgers, wrenches in both axes, springs, prescribed motion, a controller and an event.
// The first 0.3 s warm up: the integrator makes its memory there.
TEST_P(ARun, AllocatesNothingOnceItIsUnderWay) {
  for (const int level : {0, 1, 2}) {
    const RandomTree tree = random_tree(
        3, {.bodies = 8, .flexible = 0.6, .level = level, .prescribed = 0.15, .springs = true, .gravity = GravitySpec::Kind::central});
    CompileOptions with_world;
    with_world.world_wrenches = true;
    SimulationOptions run;
    run.integrator.method = GetParam();
    if (run.integrator.method == "rk4") run.integrator.fixed_step = 1e-2;
    run.integrator.relative_tolerance = 1e-6;
    Simulation sim(compiled(tree.spec, with_world), run);
    const Model& m = sim.model();
    ASSERT_TRUE(m.has_prescribed() && m.n_modes > 4);
    for (std::size_t i = 0; i < m.prescribed.size(); ++i)
      if (m.prescribed[i]) sim.prescribe(static_cast<int>(i), MotionProfile::sine(0.05, 1.0, 0.0));
    const int in_node = sim.add_wrench(m.find_node("b1.tip"), false), in_world = sim.add_wrench(m.find_node("b2.tip"), true);
    sim.every({1, 20}, [&] {
      sim.set_wrench(in_node, {{0.1, 0, 0}, {0, std::sin(sim.time()), 0}});
      sim.set_wrench(in_world, {{0, 0.1, 0}, {std::cos(sim.time()), 0, 0}});
    });
    int events = 0;
    sim.add_event({"beat", [](double t, const double*, const double*) { return std::sin(20.0 * t); }, 0, [&] { ++events; }});
    sim.run(0.3);
    const int before = events;
    EXPECT_EQ(mallocs_in([&] { sim.run(1.0); }), 0) << "level " << level;
    EXPECT_GT(events, before);
  }
}
/// Devices that tick, switch, hold, carry mass and read fields; what they are commanded.
TEST_P(ARun, WithDevicesAndFieldsAllocatesNothing) {
  SimulationOptions run;
  run.integrator.method = GetParam();
  if (run.integrator.method == "rk4") run.integrator.fixed_step = 2e-3;
  Simulation sim(equipped(), run);
  const int voltage = sim.model().devices.all[static_cast<std::size_t>(sim.model().devices.find("motor"))].in;
  sim.every({1, 20}, [&] { sim.set_device_input(voltage, 2.0 * std::cos(3.0 * sim.time())); });
  sim.run(0.3);
  const Eigen::VectorXd before = sim.state().marks;
  EXPECT_EQ(mallocs_in([&] { sim.run(1.0); }), 0);
  EXPECT_FALSE(sim.state().marks == before);
}
/// Noise and losses are drawn at the ticks of a device, of what it reads and of what it gives; what is late is kept there.
TEST_P(ARun, WithFaultsOfPortsAllocatesNothing) {
  SimulationOptions run;
  run.integrator.method = GetParam();
  if (run.integrator.method == "rk4") run.integrator.fixed_step = 2e-3;
  Simulation sim(equipped(), run);
  const auto device = [&](const char* name) { return sim.model().devices.find(name); };
  sim.fault({.device = device("law"), .input = true, .noise = 1e-3, .drop = 0.2});
  sim.fault({.device = device("imu"), .scale = 1.1, .noise = 1e-3});
  sim.fault({.device = device("imu"), .place = 1, .delay = 0.05});
  sim.fault({.device = device("imu"), .place = 3, .swap = 4});
  sim.run(0.3);
  EXPECT_EQ(mallocs_in([&] { sim.run(1.0); }), 0);
}
/// What only looks lies inside of steps, and an event is looked for among its instants.
TEST_P(ARun, WithRowsInsideOfStepsAllocatesNothing) {
  const RandomTree tree = random_tree(3, {.bodies = 8, .flexible = 0.6, .level = 1, .springs = true});
  SimulationOptions run;
  run.integrator.method = GetParam();
  if (run.integrator.method == "rk4") run.integrator.fixed_step = 1e-2;
  run.between_steps = true;
  Simulation sim(compiled(tree.spec), run);
  long looks = 0, events = 0;
  double seen = 0.0;
  sim.watch({1, 5000}, [&] {
    sim.observe();
    seen += sim.state().q.sum();
    ++looks;
  });
  sim.add_event({"beat", [](double t, const double*, const double*) { return std::sin(20.0 * t); }, 0, [&] { ++events; }});
  sim.run(0.3);
  const long before = looks, steps = sim.statistics().steps;
  EXPECT_EQ(mallocs_in([&] { sim.run(1.0); }), 0);
  EXPECT_EQ(looks - before, 3500);
  EXPECT_LT(sim.statistics().steps - steps, 3500 / 2) << "looks would have ended steps";
  EXPECT_GT(events, 4);
  EXPECT_TRUE(std::isfinite(seen));
}
INSTANTIATE_TEST_SUITE_P(By, ARun, testing::Values("rk4", "dopri5"), [](const auto& method) { return std::string(method.param); });

/// Steps of one length about one configuration; they allocate where they take another.
TEST(Alloc, StepsBesideALinearPart) {
  if (!counting) GTEST_SKIP() << "a sanitizer brings its own malloc";
  BodySpec boom = on(BodySpec(), "bus", "locked", {}, {0.5, 0, 0});
  boom.name = "boom", boom.type = "modal_flexible", boom.level = 1;
  boom.modal = std::make_shared<const ModalData>(beam());
  const BodySpec bus = on(rigid("bus", 40.0, {0.02, -0.01, 0.05}, diagonal({8.0, 6.0, 9.0})), "", "free_body");
  const BodySpec wheel = on(rigid("wheel", 2.0, {0, 0, 0}, diagonal({0.01, 0.01, 0.02})), "bus", "revolute", {{0, 0, 1}});
  for (const char* method : {"exponential", "multirate"}) {
    SimulationOptions run;
    run.integrator.method = method;
    run.integrator.relative_tolerance = 1e-4;
    SystemSpec spec = system({bus, boom, wheel});
    spec.devices = {device("catch", "latch", {{"max_rate", 10.0}, {"stiffness", 0.2}, {"damping", 0.1}}, {{"at", "wheel"}})};
    Simulation sim(compiled(spec), run);
    sim.v(0) = 0.1;
    const int motor = sim.model().user[2].v;
    sim.every({1, 8}, [&] { sim.set_force(motor, 0.01 * std::cos(sim.time())); });
    sim.run(2.0);
    EXPECT_EQ(mallocs_in([&] { sim.run(4.0); }), 0) << method;
  }
}

/// In (q, nu), with all that the run by ARun has but loads on nodes; modes that a step eliminates through the nodes of their body too.
TEST(Alloc, DiagonalisedDynamics) {
  if (!counting) GTEST_SKIP() << "a sanitizer brings its own malloc";
  for (const Dynamics dynamics : {Dynamics::diagonalised, Dynamics::diagonalised_rates})
    for (const int modes : {0, 8}) {
      const RandomTree tree = random_tree(
          4, {.bodies = 8, .flexible = 0.6, .modes = modes, .prescribed = 0.1, .springs = true, .gravity = GravitySpec::Kind::central});
      SimulationOptions run;
      run.dynamics = dynamics;
      run.integrator.relative_tolerance = 1e-6;
      Simulation sim(compiled(tree.spec), run);
      ASSERT_TRUE(sim.model().has_prescribed() && sim.model().n_modes > 4);
      int events = 0;
      sim.add_event(
          {"beat", [](double t, const double*, const double* v) { return std::sin(20.0 * t) + 1e-6 * v[0]; }, 0, [&] { ++events; }});
      sim.run(0.3);
      EXPECT_EQ(mallocs_in([&] { sim.run(0.6); }), 0) << name_of(dynamics) << ", " << modes << " modes";
      EXPECT_GT(events, 0);
    }
}

TEST(Alloc, AVariationalStep) {
  if (!counting) GTEST_SKIP() << "a sanitizer brings its own malloc";
  BodySpec boom = on(BodySpec(), "bus", "universal", {{0, 1, 0}, {1, 0, 0}}, {0.0, 0.5, 0.0});
  boom.name = "boom", boom.type = "modal_flexible", boom.level = 2;
  boom.modal = std::make_shared<const ModalData>(lumped());
  const BodySpec bus = on(rigid("bus", 40.0, {0.02, -0.01, 0.05}, diagonal({8.0, 6.0, 9.0})), "", "free_body");
  const BodySpec wheel = on(rigid("wheel", 2.0, {0, 0, 0}, diagonal({0.01, 0.01, 0.02})), "bus", "revolute", {{0, 0, 1}});
  SystemSpec spec = system({bus, boom, wheel});
  spec.gravity.kind = GravitySpec::Kind::central;
  spec.gravity.mu = 1e4, spec.gravity.centre = {200, 0, 0};
  for (const char* method : {"variational", "variational4"}) {
    SimulationOptions run;
    run.integrator.method = method;
    run.integrator.fixed_step = 0.01;
    Simulation sim(compiled(spec), run);
    sim.v(0) = 0.1;
    const int motor = sim.model().user[2].v;
    sim.every({1, 8}, [&] { sim.set_force(motor, 0.01 * std::cos(sim.time())); });
    sim.run(2.0);
    EXPECT_EQ(mallocs_in([&] { sim.run(4.0); }), 0) << method;
  }
}

TEST(Alloc, ClosedLoops) {  // from the second evaluation on
  if (!counting) GTEST_SKIP() << "a sanitizer brings its own malloc";
  for (const auto& path : oracle::files()) {
    const oracle::Case c = oracle::read(path);
    if (!c.has_loops()) continue;
    for (const LoopForm form : {LoopForm::automatic, LoopForm::multipliers}) {
      SystemSpec spec = oracle::with_loops(c);
      spec.loop_form = form;
      const auto model = compiled(spec);
      Workspace ws(*model);
      Eigen::VectorXd vdot(model->nv), q = c.q, v = c.v;
      const Inputs in{.q = c.q.data(), .v = c.v.data(), .tau = c.tau.data()};
      LoopProjection projection(*model);
      ASSERT_TRUE(forward_dynamics(*model, ws, in, vdot.data()));
      ASSERT_TRUE(projection.close(q.data(), v.data()));
      EXPECT_EQ(mallocs_in([&] { forward_dynamics(*model, ws, in, vdot.data()); }), 0) << c.name;
      EXPECT_EQ(mallocs_in([&] { projection.close(q.data(), v.data()); }), 0) << c.name;
      EXPECT_EQ(mallocs_in([&] { settle_loops(*model, ws, in); }), 0) << c.name;
    }
  }
}

}  // namespace
}  // namespace cardan::test
