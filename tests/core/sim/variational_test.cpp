// The methods `variational` and `variational4`: order, symplecticity, what they keep and what they do not take.
#include <gtest/gtest.h>

#include <cmath>

#include "core/sim/simulation.hpp"
#include "core/sim/vehicle_momentum_form.hpp"
#include "tests/support/builders.hpp"
#include "tests/support/modal_samples.hpp"
#include "tests/support/random_tree.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

SimulationOptions equal_steps(const std::string& method, double h) {
  SimulationOptions o;
  o.integrator.method = method;
  o.integrator.fixed_step = h;
  o.ledger = false;
  return o;
}

State run(const std::shared_ptr<const Model>& model, const SimulationOptions& options, double t_end, const State* from = nullptr) {
  Simulation sim(model, options);
  if (from) sim.set_state(*from);
  sim.run(t_end);
  return sim.state();
}
State accurate_run(const std::shared_ptr<const Model>& model, double t_end) {
  SimulationOptions o;
  o.integrator.method = "dop853";
  o.integrator.relative_tolerance = 1e-13;
  o.ledger = false;
  return run(model, o, t_end);
}

/// Largest difference of coordinates (by their hinges) and velocities.
double apart_of(const Model& m, const State& a, const State& b) {
  VectorXd d(m.nv);
  m.difference(a.q.data(), b.q.data(), d.data());
  return std::max(d.cwiseAbs().maxCoeff<Eigen::PropagateNaN>(), (a.v - b.v).cwiseAbs().maxCoeff<Eigen::PropagateNaN>());
}

/// Trees of rigid and modal bodies on every built-in hinge, with springs, dampers and gravity of each kind.
TEST(Variational, HasItsOrderOnRandomTrees) {
  int trees = 0;
  for (unsigned seed = first_seed(); seed < first_seed() + 12; ++seed) {
    TreeOptions options{.bodies = 4, .springs = true};
    options.gravity = seed % 3 == 0 ? GravitySpec::Kind::none : seed % 3 == 1 ? GravitySpec::Kind::uniform : GravitySpec::Kind::central;
    options.floating = seed % 2 == 0;
    const auto model = compiled(random_tree(seed, options).spec);
    const double t_end = 0.25;
    const State exact = accurate_run(model, t_end);
    for (const auto& [method, order] : {std::pair{"variational", 2}, std::pair{"variational4", 4}}) {
      const double h = order == 2 ? 1.0 / 512 : 1.0 / 64;
      double coarse = apart_of(*model, run(model, equal_steps(method, h), t_end), exact);
      double fine = apart_of(*model, run(model, equal_steps(method, h / 2), t_end), exact);
      const double expected = std::pow(2.0, order);
      EXPECT_NEAR(coarse / fine, expected, 0.15 * expected) << method << ", seed " << seed << ": " << coarse << ", " << fine << "\n"
                                                            << describe(random_tree(seed, options));
    }
    ++trees;
  }
  EXPECT_EQ(trees, 12);
}

/// A chain on the ground with a ball hinge, a free one, rotations and modes; nothing is damped.
SystemSpec chain() {
  BodySpec first = on(rigid("first", 4.0, {0.1, -0.2, 0.3}, diagonal({0.8, 0.6, 0.9})), "", "ball");
  BodySpec second =
      on(rigid("second", 3.0, {0.0, 0.1, 0.4}, diagonal({0.4, 0.5, 0.1})), "first", "universal", {{0, 1, 0}, {1, 0, 0}}, {0.3, 0, 0.4});
  BodySpec beam_body = on(BodySpec(), "second", "revolute", {{1, 0, 0}}, {0, 0, 0.5});
  beam_body.name = "beam", beam_body.type = "modal_flexible", beam_body.level = 2;
  ModalData masses = lumped();
  masses.C.setZero();
  beam_body.modal = std::make_shared<const ModalData>(masses);
  BodySpec loose = on(rigid("loose", 2.0, {0.1, 0.2, 0.0}, diagonal({0.2, 0.1, 0.15})), "first", "free", {}, {-0.2, 0.3, 0});
  SystemSpec spec = system({first, second, beam_body, loose});
  spec.gravity.kind = GravitySpec::Kind::uniform;
  spec.gravity.g = {0.3, -0.5, -1.0};
  return spec;
}

/// A state with everything in motion.
State lively(const Model& m, double size = 1.0) {
  State s = m.initial_state();
  VectorXd d(m.nv);
  for (int i = 0; i < m.nv; ++i) d[i] = 0.3 * std::sin(1.0 + 1.7 * i), s.v[i] = size * std::cos(0.3 + 2.1 * i);
  for (const SweepBody& b : m.bodies)
    for (int k = 0; k < b.n_modes; ++k) d[b.etadot + k] *= 0.02, s.v[b.etadot + k] *= 0.05;
  VectorXd q(m.nq);
  m.retract(s.q.data(), d.data(), q.data());
  s.q = q;
  return s;
}

struct Form {
  explicit Form(const std::shared_ptr<const Model>& model, double h = 0.05)
      : sim(model, equal_steps("variational", h)), problem(sim.ode()) {}
  MomentumForm& operator*() { return *problem.momenta; }
  VectorXd z_of(const State& s) {
    VectorXd x(problem.n), z(problem.momenta->size());
    x << s.q, s.v;
    EXPECT_TRUE(problem.momenta->enter(x.data(), z.data()));
    return z;
  }
  VectorXd step(const VectorXd& z0, double h) {
    VectorXd v(problem.momenta->velocities()), z1(z0.size());
    EXPECT_TRUE(problem.momenta->velocity(z0.data(), v.data()));
    EXPECT_GT(problem.momenta->step(0.0, h, z0.data(), v.data(), z1.data()), 0);
    return z1;
  }
  Simulation sim;
  OdeProblem problem;
};

/// z moved by a tangent vector [of q; of p]: quaternions by a rotation in their own axes, all else as it stands; and back.
VectorXd moved(const Model& m, const VectorXd& z, const VectorXd& d) {
  VectorXd out = z;
  for (const PlainRates& r : m.plain_rates) out.segment(r.q, r.n) += d.segment(r.v, r.n);
  for (const int i : m.curved) {
    const UserBody& u = m.user[static_cast<std::size_t>(i)];
    VectorXd turn = VectorXd::Zero(u.nv);
    turn.head<3>() = d.segment<3>(u.v);
    u.hinge->retract(u.hinge_packed.data(), z.data() + u.q, turn.data(), out.data() + u.q);
    for (int j = 3; j < u.nv; ++j) out[u.q + 1 + j] = z[u.q + 1 + j] + d[u.v + j];
  }
  out.segment(m.nq, m.nv) += d.tail(m.nv);
  return out;
}
VectorXd between(const Model& m, const VectorXd& a, const VectorXd& b) {
  VectorXd d(2 * m.nv);
  m.difference(a.data(), b.data(), d.data());
  for (const int i : m.curved) {
    const UserBody& u = m.user[static_cast<std::size_t>(i)];
    for (int j = 3; j < u.nv; ++j) d[u.v + j] = b[u.q + 1 + j] - a[u.q + 1 + j];
  }
  d.tail(m.nv) = b.segment(m.nq, m.nv) - a.segment(m.nq, m.nv);
  return d;
}
/// d(p dq) at z, of tangent vectors: of a quaternion hinge with the momentum pi in its own axes pi . (eta1 x eta2) joins it.
MatrixXd symplectic_form(const Model& m, const VectorXd& z) {
  MatrixXd B = MatrixXd::Zero(2 * m.nv, 2 * m.nv);
  B.topRightCorner(m.nv, m.nv) = -MatrixXd::Identity(m.nv, m.nv);
  B.bottomLeftCorner(m.nv, m.nv) = MatrixXd::Identity(m.nv, m.nv);
  for (const int i : m.curved) {
    const UserBody& u = m.user[static_cast<std::size_t>(i)];
    const Vector3d pi = z.segment<3>(m.nq + u.v);
    B.block<3, 3>(u.v, u.v) << 0, -pi.z(), pi.y(), pi.z(), 0, -pi.x(), -pi.y(), pi.x(), 0;
  }
  return B;
}

/// The step is a canonical map: its derivative D takes the symplectic form at its end to that at its start. Differences of order four.
TEST(Variational, StepIsSymplectic) {
  for (const char* hinge : {"free", "free_body"}) {
    SystemSpec spec = chain();
    for (BodySpec& b : spec.bodies)
      if (b.name == "loose") b.hinge.type = hinge;
    const auto model = compiled(spec);
    const Model& m = *model;
    Form form(model);
    const VectorXd z0 = form.z_of(lively(m));
    const double h = 0.05;
    const VectorXd z1 = form.step(z0, h);
    MatrixXd D(2 * m.nv, 2 * m.nv);
    for (int i = 0; i < 2 * m.nv; ++i) {
      const auto at = [&](double s) { return between(m, z1, form.step(moved(m, z0, s * VectorXd::Unit(2 * m.nv, i)), h)); };
      const double s = 1e-3;
      D.col(i) = (8.0 * (at(s) - at(-s)) - (at(2 * s) - at(-2 * s))) / (12.0 * s);
    }
    const MatrixXd B0 = symplectic_form(m, z0), taken = D.transpose() * symplectic_form(m, z1) * D;
    EXPECT_LT((taken - B0).cwiseAbs().maxCoeff<Eigen::PropagateNaN>(),
              1e-9 * D.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() * D.cwiseAbs().maxCoeff<Eigen::PropagateNaN>())
        << hinge;
    EXPECT_GT((D - MatrixXd::Identity(2 * m.nv, 2 * m.nv)).cwiseAbs().maxCoeff<Eigen::PropagateNaN>(), 0.1);
    EXPECT_LT(between(m, z0, form.step(z1, -h)).cwiseAbs().maxCoeff<Eigen::PropagateNaN>(),
              1e-12 * (1.0 + z0.cwiseAbs().maxCoeff<Eigen::PropagateNaN>()))
        << "and its own inverse";
  }
}

/// A free bus with an arm, a boom that turns on it and one that does not, and a wheel.
SystemSpec spacecraft(int level, const std::string& root = "free") {
  BodySpec bus = on(rigid("bus", 40.0, {0.02, -0.01, 0.05}, diagonal({8.0, 6.0, 9.0})), "", root);
  BodySpec arm = on(rigid("arm", 3.0, {0.0, 0.0, 0.5}, diagonal({0.4, 0.5, 0.1})), "bus", "revolute", {{0, 1, 0}}, {0.3, 0, 0.4});
  const auto boom = [&](const std::string& name, const std::string& inboard, const std::string& hinge, const std::vector<Vector3d>& axes) {
    BodySpec b = on(BodySpec(), inboard, hinge, axes, {0, 0.5, 0.3});
    b.name = name, b.type = "modal_flexible", b.level = level;
    ModalData data = lumped();
    data.K *= 100.0;  // it bends by centimetres
    data.C.setZero();
    b.modal = std::make_shared<const ModalData>(data);
    return b;
  };
  BodySpec wheel = on(rigid("wheel", 2.0, {0, 0, 0}, diagonal({0.01, 0.01, 0.02})), "bus", "revolute", {{0, 0, 1}}, {0.1, 0.2, -0.3});
  return system({bus, arm, boom("turning", "arm", "ball", {}), boom("fixed", "bus", "locked", {}), wheel});
}

TEST(Variational, KeepsMomentumToRoundOff) {
  for (const int level : {0, 1, 2})
    for (const std::string root : {"free", "free_body"}) {
      const auto model = compiled(spacecraft(level, root));
      Simulation sim(model, equal_steps("variational", 0.01));
      sim.set_state(lively(*model, 0.3));
      const Momentum before = sim.momentum();
      sim.run(20.0);
      const Momentum after = sim.momentum();
      // 2000 steps of rounding, of about 1e-16 of the sums of magnitudes each.
      EXPECT_LT((after.linear - before.linear).norm(), 1e-13 * before.linear_magnitude) << level << root;
      EXPECT_LT((after.angular - before.angular).norm(), 1e-12 * before.angular_magnitude) << level << root;
    }
}

/// Uniform motion changes nothing but the place: at 7.5 km/s attitudes are those at rest, of which a step in base coordinates would lose
/// (7500 m/s over the rates of points of the vehicle) times its error.
TEST(Variational, IsTheSameInEveryInertialFrame) {
  const auto model = compiled(spacecraft(1));
  State still = lively(*model, 0.3), fast = still;
  fast.v.segment<3>(3) += Vector3d(7000.0, -2000.0, 500.0);
  const State a = run(model, equal_steps("variational", 0.02), 10.0, &still), b = run(model, equal_steps("variational", 0.02), 10.0, &fast);
  VectorXd d(model->nv);
  model->difference(a.q.data(), b.q.data(), d.data());
  EXPECT_LT((d.segment<3>(3) - 10.0 * Vector3d(7000.0, -2000.0, 500.0)).norm(), 1e-8);
  d.segment<3>(3).setZero();
  EXPECT_LT(d.cwiseAbs().maxCoeff<Eigen::PropagateNaN>(), 1e-9);  // 7500 m/s in doubles are rounded to 1e-12 m/s
}

/// Energy swings with the square of the step, or its fourth power, and goes nowhere: the swing of 200 s against the distance of the means
/// over the first and the last tenth, between which slow motions are left.
TEST(Variational, EnergyHasNoTrend) {
  const auto model =
      compiled(system({on(rigid("body", 6.0, {0.1, 0, 0.2}, diagonal({1, 2, 3})), "", "free"),
                       on(rigid("arm", 2.0, {0, 0, 0.5}, diagonal({0.3, 0.2, 0.1})), "body", "revolute", {{0, 1, 0}}, {0, 0.3, 0})}));
  const auto swing_and_trend = [&](const char* method, double h) {
    Simulation sim(model, equal_steps(method, h));
    sim.set_state(lively(*model, 0.5));
    const double begin = sim.energy().total();
    std::vector<double> energy;
    sim.every({1, 10}, [&] { energy.push_back(sim.energy().total() / begin - 1.0); });
    sim.run(200.0);
    const std::size_t tenth = energy.size() / 10;
    const auto mean = [&](std::size_t from) {
      double sum = 0.0;
      for (std::size_t i = from; i < from + tenth; ++i) sum += energy[i] / static_cast<double>(tenth);
      return sum;
    };
    const auto [least, most] = std::minmax_element(energy.begin(), energy.end());
    return std::pair{*most - *least, std::abs(mean(energy.size() - tenth) - mean(0))};
  };
  const auto [swing, trend] = swing_and_trend("variational", 0.02);
  const auto [swing_2, trend_2] = swing_and_trend("variational", 0.01);
  EXPECT_LT(trend, 0.2 * swing);
  EXPECT_LT(trend_2, 0.2 * swing_2);
  EXPECT_NEAR(swing / swing_2, 4.0, 0.5);  // both of 200 s
  const auto [swing_4, trend_4] = swing_and_trend("variational4", 0.02);
  EXPECT_LT(swing_4, 0.05 * swing);
  EXPECT_LT(trend_4, 0.2 * swing_4 + 1e-13);
}

/// A million steps of a body that tumbles, 25 a turn. Rounding alone is left: momentum and energy go a random way of 1e-16 a step.
TEST(Variational, KeepsEnergyAndMomentumOverAMillionSteps) {
  const auto model = compiled(system({on(rigid("body", 6.0, {0.1, 0, 0.2}, diagonal({1, 2, 3})), "", "free")}));
  Simulation sim(model, equal_steps("variational", 0.1));
  sim.v(0) = 1.0, sim.v(1) = 2.0, sim.v(2) = 0.7;
  sim.v(3) = -0.4, sim.v(4) = 0.13, sim.v(5) = 0.2;  // its mass centre stays where it is
  const double begin = sim.energy().total();
  const Momentum p = sim.momentum();
  std::vector<double> energy;
  sim.every({1, 1}, [&] { energy.push_back(sim.energy().total() / begin - 1.0); });
  sim.run(1e5);
  EXPECT_GE(sim.statistics().steps, 1'000'000);
  // The means of ten stretches, over which the swing averages out: their slope is the trend.
  const std::size_t n = energy.size() / 10;
  double slope = 0.0, weight = 0.0;
  for (std::size_t k = 0; k < 10; ++k) {
    double mean = 0.0;
    for (std::size_t i = k * n; i < (k + 1) * n; ++i) mean += energy[i] / static_cast<double>(n);
    const double at = static_cast<double>(k) - 4.5;
    slope += at * mean, weight += at * at;
  }
  const double trend = 10.0 * slope / weight;
  const auto [least, most] = std::minmax_element(energy.begin(), energy.end());
  EXPECT_LT(std::abs(trend), 1e-4 * (*most - *least));
  const double turned = (sim.momentum().angular - p.angular).norm() / p.angular.norm();
  EXPECT_LT(turned, 1e-11);
  std::printf("energy: swing %.2e, trend %.1e; momentum: %.1e; %.2f evaluations a step\n", *most - *least, trend, turned,
              static_cast<double>(sim.statistics().rhs_calls) / static_cast<double>(sim.statistics().steps));
}

/// The intermediate axis: rates at whole seconds from a Taylor series of 22 digits (tests/reference/cases/rigid-dzhanibekov-elliptic.yaml).
/// Errors grow by exp(2.9 t) until it flips: those of the method with its order.
TEST(Variational, FollowsTheIntermediateAxis) {
  const auto model = compiled(system({on(rigid("body", 6.0, {0, 0, 0}, diagonal({1, 2, 3})), "", "free")}));
  const Vector3d known(-2.468405718431412, -4.348215060138482, 1.425134939901587);  // at 4 s
  State start = model->initial_state();
  start.v.head<3>() = Vector3d(0.001, 5, 0.001);
  const auto error = [&](const char* method, double h) {
    return (run(model, equal_steps(method, h), 4.0, &start).v.head<3>() - known).norm();
  };
  const double coarse = error("variational", 1e-3), fine = error("variational", 5e-4);
  EXPECT_LT(fine, 1e-3);
  EXPECT_NEAR(coarse / fine, 4.0, 0.1);
  EXPECT_LT(error("variational4", 2e-3), 1e-8);
}

/// Steady spin about a principal axis is exact whatever the step: exp stands for the turn, and nothing else moves.
TEST(Variational, TurnsExactlyAboutAPrincipalAxis) {
  const auto model = compiled(system({on(rigid("body", 6.0, {0, 0, 0}, diagonal({1, 2, 3})), "", "ball")}));
  State start = model->initial_state();
  start.v = Vector3d(0, 0, 5);
  const State end = run(model, equal_steps("variational", 0.2), 2.0, &start);
  EXPECT_NEAR(end.v[2], 5.0, 1e-13);
  EXPECT_NEAR(std::abs(end.q[0]), std::abs(std::cos(5.0)), 1e-13);
  EXPECT_NEAR(std::abs(end.q[3]), std::abs(std::sin(5.0)), 1e-13);
}

/// A motor whose torque changes at ticks, an event that changes a wrench, checkpoints: a run goes on from each with the same bits.
TEST(Variational, GoesOnFromACheckpointBitForBit) {
  struct Slew {
    Slew() : sim(compiled(spacecraft(1), {.node_wrenches = true, .world_wrenches = true}), options()) {
      const Model& m = sim.model();
      sim.set_state(lively(m, 0.1));
      const int slot = sim.add_wrench(m.find_node("arm"), true), motor = m.user[1].v, q = m.user[1].q;
      sim.every({1, 8}, [this, motor] { sim.set_force(motor, 0.5 * std::cos(3.0 * sim.time())); });
      sim.add_event({"arm passes", [q, threshold = sim.q(q) + 0.02](double, const double* x, const double*) { return x[q] - threshold; }, 0,
                     [this, slot] {
                       Force<double> f{};
                       f.f.x = sim.wrenches()[static_cast<std::size_t>(slot)].f.f.x > 0.0 ? -0.2 : 0.2;
                       sim.set_wrench(slot, f);
                       ++events;
                     }});
      sim.every({1, 10}, [this] { made.push_back(sim.checkpoint()); }, {1, 10});
    }
    static SimulationOptions options() {
      SimulationOptions o = equal_steps("variational", 0.007);
      o.ledger = true;
      return o;
    }
    Simulation sim;
    int events = 0;
    std::vector<Checkpoint> made;
  };
  Slew whole;
  whole.sim.run(2.0);
  EXPECT_GT(whole.events, 0);
  EXPECT_TRUE(whole.sim.ledger().pass);
  ASSERT_EQ(whole.made.size(), 20u);
  for (const std::size_t at : {0u, 9u}) {
    Slew rest;
    rest.sim.resume(whole.made[at]);
    rest.sim.run(2.0);
    ASSERT_EQ(rest.made.size(), 19u - at);
    for (std::size_t i = 0; i < rest.made.size(); ++i) EXPECT_EQ(rest.made[i], whole.made[at + 1 + i]) << at << " " << i;
  }
}

TEST(Variational, RefusesWhatItDoesNotTake) {
  SystemSpec spec = chain();
  spec.bodies[1].hinge.prescribed = {0};
  EXPECT_EQ(VehicleMomentumForm::refusal(*compiled(spec)), "given motions");
  EXPECT_EQ(VehicleMomentumForm::refusal(*compiled(chain())), "");
}

}  // namespace
}  // namespace cardan::test
