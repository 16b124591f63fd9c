// What BDF asks of a simulation when its linear solver is krylov: J dx against differences of eighth order of the
// right-hand side that the integrator gets, and the preconditioner as the exact inverse of 1 - gamma J at rest.
#include "core/sim/newton_operators.hpp"
#include "core/soa/tangent.hpp"
#include "tests/operators/compare.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/loaded_simulation.hpp"

namespace cardan::test {
namespace {

/// The tree under its loads, prescribed components in motion.
struct Scene {
  explicit Scene(const RandomTree& tree) : sim(compiled(tree.spec, {.world_wrenches = true}), krylov()) {
    set_loads(sim, tree);
    ode = sim.ode();
    x.resize(ode.n);
    x << sim.state().q, sim.state().v;
  }
  VectorXd rhs(const VectorXd& at) const {
    VectorXd out(ode.n);
    if (!ode.rhs(0.2, at.data(), out.data())) throw std::runtime_error("breakdown");
    return out;
  }
  VectorXd times(const VectorXd& dx) const {
    VectorXd out(ode.n);
    if (!ode.jacobian_times(0.2, x.data(), dx.data(), out.data())) throw std::runtime_error("breakdown");
    return out;
  }
  Simulation sim;
  OdeProblem ode;
  VectorXd x;
};

/// Any change of the state, quaternions off the sphere included.
VectorXd direction(int n, double turn) {
  VectorXd d(n);
  for (int i = 0; i < n; ++i) d[i] = std::sin(2.7 * i + turn);
  return d;
}

double jacobian_error_under_loads(const RandomTree& tree) {
  Scene s(tree);
  if (s.ode.n == 0) return 0.0;
  // a state such as CVODES has inside: no quaternion is of unit length
  for (int i = 0; i < s.sim.model().nq; ++i) s.x[i] *= 1.05;
  double worst = 0.0;
  for (const double turn : {0.3, 1.9}) {
    const VectorXd d = direction(s.ode.n, turn);
    const VectorXd got = s.times(d);
    VectorXd truth(s.ode.n), work(s.ode.n);
    worst = worse(worst, by_differences(0.004, [&](double step) {
                    soa::derivative([&](double h, double* out) { Eigen::Map<VectorXd>(out, s.ode.n) = s.rhs(s.x + h * d); }, step, s.ode.n,
                                    truth.data(), work.data());
                    return apart(got, truth);
                  }));
  }
  return worst;
}

TEST(Jacobian, TimesADirectionIsTheDerivativeOfTheRightHandSide) {
  for (const auto gravity : {GravitySpec::Kind::none, GravitySpec::Kind::uniform, GravitySpec::Kind::central})
    for (TreeOptions o : kinds_of_trees()) {
      o.springs = true, o.locked = 0.1, o.gravity = gravity;
      for (const double prescribed : {0.0, 0.2}) {
        o.prescribed = prescribed;
        for_all_trees(o, 1e-9, jacobian_error_under_loads, 12);
      }
    }
}

// A spinning bus by hand: J couples the rates by w x J w, and q' = 1/2 q o w.
TEST(Jacobian, OfAFreeBodyIsKnown) {
  BodySpec bus = on(rigid("bus", 3.0, Vector3d::Zero(), diagonal({2, 3, 5})), "", "ball");
  bus.hinge.v = {0.3, -0.2, 0.7};
  Simulation sim(compiled(system({bus})), krylov());
  const OdeProblem ode = sim.ode();
  VectorXd x(7), d(7), out(7);
  x << sim.state().q, sim.state().v;  // q = (1, 0, 0, 0)
  d << 0.1, 0.2, -0.3, 0.4, 1.0, 2.0, -1.0;
  ASSERT_TRUE(ode.jacobian_times(0.0, x.data(), d.data(), out.data()));
  const Vector3d w(0.3, -0.2, 0.7), dw(1, 2, -1), du(0.2, -0.3, 0.4), J(2, 3, 5);
  EXPECT_NEAR(out[0], -0.5 * du.dot(w), 1e-15);
  const Vector3d vector_part = 0.5 * (0.1 * w + du.cross(w) + dw);
  const Vector3d acceleration = -(dw.cross(J.cwiseProduct(w)) + w.cross(J.cwiseProduct(dw))).cwiseQuotient(J);
  EXPECT_LT((out.segment<3>(1) - vector_part).norm(), 1e-15);
  EXPECT_LT((out.tail<3>() - acceleration).norm(), 1e-15);
}

/// A hinge of a plugin with coordinates of its own: the closed forms again, by differences.
TEST(Jacobian, OfForeignHinges) {
  for (const char* type : {"ball", "free", "free_body"}) {
    const auto model = compiled(random_tree(4, {.bodies = 1, .roots = 1, .flexible = 0.0, .hinges = {type}}).spec);
    const auto foreign = std::make_shared<Model>(*model);
    cardan_hinge_family family = *model->user[0].hinge;
    family.shape = CARDAN_SHAPE_DENSE;
    foreign->user[0].hinge = &family;
    const State state = model->initial_state();
    const VectorXd zeros = VectorXd::Zero(model->nv), d = direction(model->nq + model->nv, 0.4);
    VectorXd want(d.size()), got(d.size());
    const Inputs in{.q = state.q.data(), .v = state.v.data(), .tau = zeros.data(), .vdot = zeros.data()};
    ASSERT_TRUE(NewtonOperators(model).jacobian_times(in, d.data(), want.data()));
    ASSERT_TRUE(NewtonOperators(foreign).jacobian_times(in, d.data(), got.data()));
    EXPECT_LT(differ(got, want), 1e-12) << type;
  }
}

/// At rest with all springs and modes relaxed and nothing that pulls.
RandomTree relaxed(RandomTree tree) {
  tree.loads.clear();
  for (auto& [name, tau] : tree.tau) tau.setZero();
  for (BodySpec& b : tree.spec.bodies) {
    std::fill(b.hinge.v.begin(), b.hinge.v.end(), 0.0);
    std::fill(b.eta.begin(), b.eta.end(), 0.0);
    std::fill(b.etadot.begin(), b.etadot.end(), 0.0);
    for (SpringDamper& s : b.hinge.springs) s.rest = b.hinge.q[static_cast<std::size_t>(s.component)];
    if (!b.modal) continue;
    auto modal = std::make_shared<ModalData>(*b.modal);
    modal->K = 500.0 * MatrixXd(modal->K.diagonal().asDiagonal());
    modal->C = MatrixXd(modal->C.diagonal().asDiagonal());
    b.modal = modal;
  }
  return tree;
}

double preconditioner_error(const RandomTree& from) {
  const RandomTree tree = relaxed(from);
  Simulation sim(compiled(tree.spec), krylov());
  const OdeProblem ode = sim.ode();
  VectorXd x(ode.n), z(ode.n), Jz(ode.n);
  if (ode.n == 0) return 0.0;
  x << sim.state().q, sim.state().v;
  double worst = 0.0;
  bool moved = true;
  for (const double gamma : {0.05, 0.7}) {
    if (!ode.prepare(0.0, x.data(), gamma, moved)) return HUGE_VAL;
    moved = false;
    const VectorXd r = direction(ode.n, gamma);
    if (!ode.precondition(r.data(), z.data()) || !ode.jacobian_times(0.0, x.data(), z.data(), Jz.data())) return HUGE_VAL;
    const VectorXd difference = z - gamma * Jz - r;
    worst = worse(worst, largest(difference) / worse({largest(r), largest(z), gamma * largest(Jz)}));
  }
  return worst;
}

TEST(Preconditioner, IsTheInverseAtRest) {
  for (TreeOptions o : kinds_of_trees()) {
    o.springs = true, o.locked = 0.1, o.gravity = GravitySpec::Kind::none;
    for (const double prescribed : {0.0, 0.2}) {
      o.prescribed = prescribed;
      for_all_trees(o, 1e-10, preconditioner_error, 20);
    }
  }
}

/// A free bus with a tree of flexible panels on springs: 8 panels of 20 modes, the slowest at some 100 rad/s, damped.
SystemSpec flexible_scene() {
  const BodySpec panel =
      random_tree(3, {.bodies = 1, .roots = 1, .flexible = 1.0, .level = 1, .modes = 20, .hinges = {"revolute"}}).spec.bodies[0];
  auto modal = std::make_shared<ModalData>(*panel.modal);
  modal->K *= 1e4;
  modal->C = 2e-3 * modal->K;
  std::vector<BodySpec> bodies{on(rigid("bus", 500.0, Vector3d::Zero(), diagonal({300, 250, 200})), "", "free")};
  bodies[0].hinge.v = {0.05, -0.02, 0.1, 0.0, 0.0, 0.0};
  for (int i = 0; i < 8; ++i) {
    BodySpec b = panel;
    b.name = "p" + std::to_string(i);
    b.modal = modal;
    b.eta.assign(20, 0.0), b.etadot.assign(20, 0.0);
    b.hinge = on(BodySpec{}, i < 2 ? "bus" : "p" + std::to_string(i - 2), "revolute", {Vector3d::UnitZ()}, {1.0 + i % 2, 0.2, 0.0}).hinge;
    b.hinge.q = {0.1};
    b.hinge.springs.push_back({.component = 0, .stiffness = 500.0 + 10.0 * i, .rest = 0.0, .damping = 20.0, .at = {}});
    bodies.push_back(b);
  }
  return system(bodies);
}

struct Arrival {
  VectorXd q;
  IntegratorStatistics counts;
};
/// After 0.25 s, with a controller that ticks at 10 Hz: torques of the first two hinges in proportion to their rates.
Arrival arrive(const std::shared_ptr<const Model>& model, const IntegratorOptions& integrator) {
  SimulationOptions options;
  options.integrator = integrator;
  Simulation sim(model, options);
  sim.every({1, 10}, [&sim] {
    for (const int i : {1, 2}) {
      const int v = sim.model().user[static_cast<std::size_t>(i)].v;
      sim.set_force(v, -30.0 * sim.state().v[v]);
    }
  });
  sim.run(0.25);
  EXPECT_LT(sim.ledger().angular_relative, 1e-4);
  return {sim.state().q, sim.statistics()};
}

// The same tolerance, the same answer, and no right-hand sides for a matrix of 349 columns.
TEST(Krylov, AgreesWithDenseBdfOnAFlexibleScene) {
  const auto model = compiled(flexible_scene());
  ASSERT_EQ(model->nq + model->nv, 7 + 6 + 2 * 8 * 21);
  const Arrival truth = arrive(model, {.method = "dopri5", .relative_tolerance = 1e-11});
  const Arrival dense = arrive(model, {.method = "cvode_bdf", .relative_tolerance = 1e-5});
  const Arrival krylov = arrive(model, {.method = "cvode_bdf", .relative_tolerance = 1e-5, .linear_solver = "krylov"});
  EXPECT_LT(differ(dense.q, truth.q), 1e-7);
  EXPECT_LT(differ(krylov.q, truth.q), 1e-7);
  EXPECT_GT(differ(truth.q, model->initial_state().q), 0.01);  // it did move
  EXPECT_NEAR(static_cast<double>(krylov.counts.steps), static_cast<double>(dense.counts.steps),
              0.2 * static_cast<double>(dense.counts.steps));
  EXPECT_EQ(krylov.counts.restarts, 3);
  EXPECT_GT(krylov.counts.jacobian_products, krylov.counts.steps / 2);
  EXPECT_GT(krylov.counts.preconditioner_setups, 3);
  EXPECT_LT(krylov.counts.linear_iterations, 2 * krylov.counts.steps);  // the preconditioner is nearly the inverse
  // what Newton's equations cost: dense, 349 evaluations of f for each matrix
  EXPECT_LT(krylov.counts.jacobian_products, (dense.counts.rhs_calls - krylov.counts.rhs_calls) / 4);
}

}  // namespace
}  // namespace cardan::test
