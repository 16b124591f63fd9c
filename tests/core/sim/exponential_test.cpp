// The frozen linear vehicle against matrix exponentials, and runs by the methods `exponential` and `multirate` against other methods.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <set>
#include <string>

#include "core/dynamics/inverse.hpp"
#include "core/io/checkpoint_text.hpp"
#include "core/linalg/dense.hpp"
#include "core/sim/simulation.hpp"
#include "core/sim/vehicle_linear_part.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/support/builders.hpp"
#include "tests/support/modal_samples.hpp"
#include "tests/support/random_tree.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

BodySpec flexible(const std::string& name, ModalData data, int level, const std::string& inboard, const std::string& hinge,
                  const std::vector<Eigen::Vector3d>& axes, const Eigen::Vector3d& onode) {
  BodySpec b = on(BodySpec(), inboard, hinge, axes, onode);
  b.name = name, b.type = "modal_flexible", b.level = level;
  b.modal = std::make_shared<const ModalData>(std::move(data));
  return b;
}

/// A free bus with a sprung arm on which a flexible boom turns, a boom fixed to the bus, and a wheel.
SystemSpec flexible_spacecraft(int level = 1, bool damped = true) {
  BodySpec bus = on(rigid("bus", 40.0, {0.02, -0.01, 0.05}, diagonal({8.0, 6.0, 9.0})), "", "free_body");
  BodySpec arm = on(rigid("arm", 3.0, {0.0, 0.0, 0.5}, diagonal({0.4, 0.5, 0.1})), "bus", "revolute", {{0, 1, 0}}, {0.3, 0, 0.4});
  SpringDamper spring;
  spring.stiffness = 60.0, spring.damping = damped ? 0.3 : 0.0;
  arm.hinge.springs = {spring};
  ModalData masses = lumped();
  masses.C = 0.02 * masses.K;  // which its own modes make diagonal
  BodySpec boom = flexible("boom", masses, level, "arm", "revolute", {{1, 0, 0}}, {0, 0, 1.0});
  BodySpec beam_body = flexible("beam", beam(), level, "bus", "locked", {}, {0.0, 0.5, 0.0});
  BodySpec wheel = on(rigid("wheel", 2.0, {0, 0, 0}, diagonal({0.01, 0.01, 0.02})), "bus", "revolute", {{0, 0, 1}}, {0.1, 0.2, -0.3});
  return system({bus, arm, boom, beam_body, wheel});
}

/// At rest, turned and bent.
State posture(const Model& m) {
  State s = m.initial_state();
  VectorXd d(m.nv);
  for (int i = 0; i < m.nv; ++i) d[i] = (i < 6 ? 0.3 : 0.02) * std::sin(1.0 + 1.7 * i);
  for (const SweepBody& b : m.bodies)
    for (int k = 0; k < b.n_modes; ++k) d[b.etadot + k] = 0.0;  // M as with modes at zero
  VectorXd q(m.nq);
  m.retract(s.q.data(), d.data(), q.data());
  s.q = q, s.v.setZero();
  return s;
}

struct Linear {
  MatrixXd M, K, C;
};
/// Of the model at q, in the user's order of velocities.
Linear linear_of(const Model& m, const State& s) {
  Linear l;
  Workspace workspace(m);
  l.M = mass_matrix(m, workspace, s.q.data());
  l.K.setZero(m.nv, m.nv), l.C.setZero(m.nv, m.nv);
  for (const HingeLoad& load : m.loads) l.K(load.v, load.v) = load.p[0], l.C(load.v, load.v) = load.p[2];
  for (const SweepBody& b : m.bodies) {
    if (b.n_modes == 0) continue;
    const FlexibleBody& f = m.flexible[static_cast<std::size_t>(b.flexible)];
    for (int i = 0; i < b.n_modes; ++i)
      for (int j = 0; j < b.n_modes; ++j) {
        if (f.K_diagonal && i != j) continue;
        const auto at = static_cast<std::size_t>(f.K_diagonal ? i : j * b.n_modes + i);
        l.K(b.etadot + i, b.etadot + j) = f.K[at], l.C(b.etadot + i, b.etadot + j) = f.C[at];
      }
  }
  return l;
}

/// exp(A t) x of x' = A x + B, by Taylor series over small pieces.
VectorXd flow(const MatrixXd& A, const VectorXd& B, VectorXd x, double t) {
  const int pieces = 1 + static_cast<int>(2.0 * A.norm() * t);
  const double h = t / pieces;
  for (int p = 0; p < pieces; ++p) {
    VectorXd term = A * x + B, sum = x;
    double factor = h;
    for (int k = 1; k < 30; ++k) {
      sum += factor * term;
      term = A * term;
      factor *= h / (k + 1);
    }
    x = sum;
  }
  return x;
}

TEST(FrozenVehicle, TellsForcesAsTheMassMatrixDoes) {
  const auto model = compiled(flexible_spacecraft());
  const Model& m = *model;
  const State s = posture(m);
  const Linear l = linear_of(m, s);
  FrozenVehicle frozen(model);
  frozen.freeze(s.q.data(), s.v.data());
  VectorXd y = VectorXd::Zero(m.nq), u(m.nv), du(m.nv), r(m.nv), displacement = VectorXd::Zero(m.nv);
  for (int i = 0; i < m.nv; ++i) u[i] = std::cos(2.0 * i), du[i] = std::sin(3.0 * i + 1.0);
  for (const PlainRates& p : m.plain_rates)
    for (int i = 0; i < p.n; ++i) y[p.q + i] = displacement[p.v + i] = std::sin(5.0 * (p.v + i));
  frozen.force(y.data(), u.data(), du.data(), r.data());
  // Of the boom, whose modes are none of its K and M, r is told in its own: compared as power.
  const VectorXd wanted = l.M * du + l.C * u + l.K * displacement;
  for (int i = 0; i < m.nv; ++i) {
    bool modal = false;
    for (const SweepBody& b : m.bodies) modal = modal || (b.n_modes > 0 && i >= b.etadot && i < b.etadot + b.n_modes);
    if (modal) continue;
    EXPECT_NEAR(r[i], wanted[i], 1e-12 * wanted.norm()) << i;
  }
}

/// One step from rest-free and forced motion against the exponential of the whole matrix: exact up to what the degrees resolve. A pod turns
/// in a ball with dampers, whose velocities have no coordinates of their own.
TEST(FrozenVehicle, AdvancesAsTheMatrixExponential) {
  SystemSpec spec = flexible_spacecraft();
  BodySpec pod = on(rigid("pod", 1.5, {0.1, 0.0, 0.2}, diagonal({0.05, 0.06, 0.04})), "arm", "ball", {}, {0, 0, 0.6});
  SpringDamper about_x, about_z;
  about_x.damping = 0.4, about_z.component = 2, about_z.damping = 0.7;
  pod.hinge.springs = {about_x, about_z};
  spec.bodies.push_back(pod);
  const auto model = compiled(system(std::move(spec.bodies)));
  const Model& m = *model;
  const State s = posture(m);
  const Linear l = linear_of(m, s);
  const MatrixXd inverse = positive_inverse(l.M).value();
  MatrixXd A = MatrixXd::Zero(2 * m.nv, 2 * m.nv);
  A.topRightCorner(m.nv, m.nv).setIdentity();
  A.bottomLeftCorner(m.nv, m.nv) = -inverse * l.K, A.bottomRightCorner(m.nv, m.nv) = -inverse * l.C;
  FrozenVehicle frozen(model);
  frozen.freeze(s.q.data(), s.v.data());
  VectorXd y = VectorXd::Zero(m.nq), u(m.nv), x(2 * m.nv), B = VectorXd::Zero(2 * m.nv), tau = VectorXd::Zero(m.nv);
  x.setZero();
  for (const PlainRates& p : m.plain_rates)
    for (int i = 0; i < p.n; ++i) y[p.q + i] = x[p.v + i] = 1e-2 * std::sin(5.0 * (p.v + i));
  for (int i = 0; i < m.nv; ++i) u[i] = x[m.nv + i] = 0.1 * std::cos(2.0 * i);
  for (const int i : {0, 1, 3, m.user[1].v, m.user[4].v}) tau[i] = 1.0 + i;  // no modes: those of the boom are others in r
  B.tail(m.nv) = inverse * tau;
  const VectorXd zero = VectorXd::Zero(m.nv);
  double before = 0.0;
  for (const double h : {0.2, 0.1, 0.05, 0.02}) {
    VectorXd travel(m.nv), rate(m.nv);
    frozen.advance(h, y.data(), u.data(), {tau.data(), zero.data(), zero.data()}, travel.data(), rate.data());
    const VectorXd end = flow(A, B, x, h);
    const double error =
        worse(distance(travel, end.head(m.nv) - x.head(m.nv)) / (0.1 * h), distance(rate, end.tail(m.nv)) / largest(end.tail(m.nv)));
    if (h == 0.05) {
      EXPECT_LT(error, 1e-7);
    }
    if (h == 0.02) {
      EXPECT_LT(error, 1e-11);
      EXPECT_LT(error, 2e-2 * before);  // of a high order
    }
    before = error;
  }
}

/// A spacecraft with a second wheel, on its sprung arm; both turn fast.
SystemSpec with_fast_wheels(double damping = 0.3) {
  SystemSpec spec = flexible_spacecraft(1, damping > 0.0);
  spec.bodies.push_back(on(rigid("spinner", 0.5, {0, 0, 0}, diagonal({0.004, 0.002, 0.002})), "arm", "revolute", {{1, 0, 0}}, {0, 0, 0.6}));
  return system(std::move(spec.bodies));
}

/// The moments that the bus and the arm turn their wheels against are those of the bias forces, bilinear in the speeds of the wheels and
/// all other rates: as a matrix they belong to C.
TEST(FrozenVehicle, TurnsWithItsFastWheels) {
  const auto model = compiled(with_fast_wheels());
  const Model& m = *model;
  State s = posture(m);
  const int wheel = m.user[4].v, spinner = m.user[5].v;
  s.v[wheel] = 2000.0, s.v[spinner] = -1500.0;  // 40 N m s on 8 kg m^2, 6 N m s on 0.4 kg m^2
  ASSERT_EQ(m.rotors.size(), 2u);
  Linear l = linear_of(m, s);
  Workspace workspace(m);
  const auto bias = [&](const VectorXd& v) -> VectorXd { return bias_force(m, workspace, s.q.data(), v.data()); };
  const MatrixXd C = l.C;
  for (int i = 0; i < m.nv; ++i) {
    const VectorXd unit = VectorXd::Unit(m.nv, i);
    if (i != wheel && i != spinner) l.C.col(i) += bias(s.v + unit) - bias(s.v) - bias(unit);
  }
  ASSERT_GT(largest(l.C - C), 30.0);
  FrozenVehicle frozen(model, true), without(model);
  frozen.freeze(s.q.data(), s.v.data()), without.freeze(s.q.data(), s.v.data());
  VectorXd y = VectorXd::Zero(m.nq), u(m.nv), du(m.nv), r(m.nv), of_others(m.nv);
  for (int i = 0; i < m.nv; ++i) u[i] = 0.1 * std::cos(2.0 * i), du[i] = std::sin(3.0 * i + 1.0);
  frozen.force(y.data(), u.data(), du.data(), r.data()), without.force(y.data(), u.data(), du.data(), of_others.data());
  EXPECT_LT(distance(r - of_others, (l.C - C) * u), 1e-12 * ((l.C - C) * u).norm());

  const MatrixXd inverse = positive_inverse(l.M).value();
  MatrixXd A = MatrixXd::Zero(2 * m.nv, 2 * m.nv);
  A.topRightCorner(m.nv, m.nv).setIdentity();
  A.bottomLeftCorner(m.nv, m.nv) = -inverse * l.K, A.bottomRightCorner(m.nv, m.nv) = -inverse * l.C;
  VectorXd x = VectorXd::Zero(2 * m.nv);
  x.tail(m.nv) = u;
  const VectorXd zero = VectorXd::Zero(m.nv);
  double before = 0.0;
  for (const double h : {0.1, 0.05, 0.02}) {
    VectorXd travel(m.nv), rate(m.nv);
    frozen.advance(h, y.data(), u.data(), {zero.data(), zero.data(), zero.data()}, travel.data(), rate.data());
    const VectorXd end = flow(A, VectorXd::Zero(2 * m.nv), x, h);
    const double error = worse(distance(travel, end.head(m.nv)) / (0.1 * h), distance(rate, end.tail(m.nv)) / largest(end.tail(m.nv)));
    if (h == 0.02) {
      EXPECT_LT(error, 1e-10);
      EXPECT_LT(error, 2e-2 * before);  // of a high order
    }
    before = error;
  }
  EXPECT_FALSE(frozen.spun(s.v.data()));
  s.v[spinner] *= 1.1;
  EXPECT_TRUE(frozen.spun(s.v.data()));
  EXPECT_FALSE(without.spun(s.v.data()));
}

/// Without damping the energy of the frozen vehicle stays to round-off, whatever the step resolves.
TEST(FrozenVehicle, KeepsItsEnergy) {
  const auto model = compiled(flexible_spacecraft(1, false));
  const Model& m = *model;
  const State s = posture(m);
  Linear l = linear_of(m, s);
  auto own = std::make_shared<Model>(*model);
  for (FlexibleBody& f : own->flexible) std::ranges::fill(f.C, 0.0);
  FrozenVehicle frozen(own);
  frozen.freeze(s.q.data(), s.v.data());
  for (const double h : {0.02, 0.3, 3.0}) {
    VectorXd y = VectorXd::Zero(m.nq), x = VectorXd::Zero(m.nv), u(m.nv), travel(m.nv), rate(m.nv);
    const VectorXd zero = VectorXd::Zero(m.nv);
    for (int i = 0; i < m.nv; ++i) u[i] = 0.1 * std::cos(2.0 * i);
    const auto energy = [&] { return 0.5 * u.dot(l.M * u) + 0.5 * x.dot(l.K * x); };
    const double at_start = energy();
    double worst = 0.0;
    for (int k = 0; k < 1000; ++k) {
      frozen.advance(h, y.data(), u.data(), {zero.data(), zero.data(), zero.data()}, travel.data(), rate.data());
      x += travel, u = rate;
      for (const PlainRates& p : m.plain_rates)
        for (int i = 0; i < p.n; ++i) y[p.q + i] += travel[p.v + i];
      for (int i = 0; i < 6; ++i) x[i] = 0.0;
      worst = worse(worst, std::abs(energy() / at_start - 1.0));
    }
    EXPECT_LT(worst, 1e-10) << h;
  }
}

TEST(FrozenVehicle, GivesItsDenseOutputAsStepsThatEndThere) {
  const auto model = compiled(flexible_spacecraft());
  const Model& m = *model;
  const State s = posture(m);
  FrozenVehicle frozen(model);
  frozen.freeze(s.q.data(), s.v.data());
  VectorXd y = VectorXd::Zero(m.nq), u(m.nv), tau(m.nv), slope(m.nv), bend(m.nv);
  for (int i = 0; i < m.nv; ++i)
    u[i] = 0.1 * std::cos(2.0 * i), tau[i] = std::sin(i), slope[i] = std::cos(3.0 * i), bend[i] = std::sin(7.0 * i);
  const double h = 0.05;
  for (const double part : {0.0, 0.3, 1.0}) {
    VectorXd travel(m.nv), rate(m.nv), travel_there(m.nv), rate_there(m.nv);
    if (part > 0.0) {
      const VectorXd slope_there = part * slope, bend_there = part * part * bend;
      frozen.advance(part * h, y.data(), u.data(), {tau.data(), slope_there.data(), bend_there.data()}, travel_there.data(),
                     rate_there.data());
    } else {
      travel_there.setZero(), rate_there = u;
    }
    frozen.advance(h, y.data(), u.data(), {tau.data(), slope.data(), bend.data()}, travel.data(), rate.data());
    frozen.inside(part, travel.data(), rate.data());
    EXPECT_LT((travel - travel_there).norm(), 1e-7 * h) << part;
    EXPECT_LT(distance(rate, rate_there), 1e-6) << part;
  }
}

SimulationOptions by_exponential(double max_step = 0.0, double tolerance = 1e-3, const std::string& method = "exponential") {
  SimulationOptions o;
  o.integrator.method = method;
  o.integrator.relative_tolerance = tolerance;
  o.integrator.max_step = max_step;
  return o;
}

/// The spacecraft turns, its arm swings, a torque changes ten times in a second.
VectorXd run_spacecraft(const std::shared_ptr<const Model>& model, const SimulationOptions& options, double t_end = 2.0,
                        IntegratorStatistics* statistics = nullptr) {
  Simulation sim(model, options);
  State s = posture(*model);
  for (int i = 0; i < model->nv; ++i) s.v[i] = 0.05 * std::cos(2.0 * i);
  for (const UserBody& u : model->user)
    if (u.n_modes > 0) s.v.segment(u.etadot, u.n_modes) *= u.name == "beam" ? 0.0 : 0.02;
  sim.set_state(s);
  const int wheel = model->user[4].v;
  sim.every({1, 10}, [&sim, wheel] { sim.set_force(wheel, 0.2 * std::cos(2.0 * sim.time())); });
  sim.run(t_end);
  if (statistics) *statistics = sim.statistics();
  VectorXd x(model->nq + model->nv);
  x << sim.state().q, sim.state().v;
  return x;
}

SimulationOptions reference() {
  SimulationOptions o;
  o.integrator.method = "dop853";
  o.integrator.relative_tolerance = 1e-13;
  return o;
}

TEST(Exponential, IsOfOrderThreeThroughTicks) {
  for (const int level : {0, 1}) {
    const auto model = compiled(flexible_spacecraft(level));
    const VectorXd wanted = run_spacecraft(model, reference());
    std::vector<double> errors;
    for (const double h : {0.025, 0.0125, 0.00625})
      errors.push_back((run_spacecraft(model, by_exponential(h)) - wanted).norm() / wanted.norm());
    for (std::size_t i = 0; i + 1 < errors.size(); ++i) {
      EXPECT_GT(errors[i] / errors[i + 1], 5.5) << "level " << level << ": " << errors[i] << ", " << errors[i + 1];
    }
    EXPECT_LT(errors.back(), 1e-7) << level;
  }
}

TEST(Multirate, IsOfOrderFourThroughTicks) {
  for (const int level : {0, 1}) {
    const auto model = compiled(flexible_spacecraft(level));
    const VectorXd wanted = run_spacecraft(model, reference());
    const auto error = [&](double h) {
      return (run_spacecraft(model, by_exponential(h, 1e-4, "multirate")) - wanted).norm() / wanted.norm();
    };
    const double coarse = error(0.1), fine = error(0.0125);
    EXPECT_NEAR(std::log2(coarse / fine) / 3.0, 4.0, 0.35) << "level " << level << ": " << coarse << ", " << fine;
  }
}

/// The tolerance is kept: errors fall with it.
TEST(Exponential, FollowsItsTolerance) {
  const auto model = compiled(flexible_spacecraft());
  const VectorXd wanted = run_spacecraft(model, reference());
  for (const std::string method : {"exponential", "multirate"})
    for (const double tolerance : {1e-4, 1e-6, 1e-8, 1e-10}) {
      if (method == "exponential" && tolerance < 1e-8) continue;
      const double error = (run_spacecraft(model, by_exponential(0.0, tolerance, method)) - wanted).norm() / wanted.norm();
      EXPECT_LT(error, 30.0 * tolerance) << method;
    }
}

/// An arm on a spring that swings ten and a hundred times as fast, and counts: where one closed form through a step does not resolve it,
/// several pieces of the step do.
TEST(Multirate, FollowsWhatIsFastByItsPieces) {
  for (const double faster : {1.0, 10.0, 100.0}) {
    SystemSpec spec = flexible_spacecraft(0, false);
    spec.bodies[1].hinge.springs[0].stiffness *= faster * faster;
    const auto model = compiled(spec);
    long calls = 0;
    const auto run = [&](SimulationOptions options) {
      Simulation sim(model, options);
      State s = model->initial_state();
      s.v[model->user[1].v] = 1e-3;
      sim.set_state(s);
      sim.run(1.0);
      calls = sim.statistics().rhs_calls;
      VectorXd x(model->nq + model->nv);
      x << sim.state().q, sim.state().v;
      return x;
    };
    SimulationOptions options = by_exponential(0.0, 1e-6, "multirate");
    options.absolute_tolerance = 1e-10;
    const VectorXd wanted = run(reference()), got = run(options);
    const long own = calls;
    EXPECT_LT(largest(got - wanted), 1e-3 * 3e-5) << faster;
    options.integrator.method = "dop853";
    run(options);
    EXPECT_LT(2 * own, calls) << faster;
  }
}

/// The bus nutates, and so does the arm with its wheel: what is left of f beside that is slow.
TEST(Multirate, LetsStepsFollowNoFastWheels) {
  const auto model = compiled(with_fast_wheels());
  std::vector<IntegratorStatistics> counts;
  const auto run = [&](const SimulationOptions& options) {
    Simulation sim(model, options);
    State s = model->initial_state();
    for (int i = 0; i < 3; ++i) s.v[i] = 1e-5 * (i + 1);
    s.v[model->user[4].v] = 2e4, s.v[model->user[5].v] = -1.5e4;
    sim.set_state(s);
    sim.run(2.0);
    counts.push_back(sim.statistics());
    VectorXd x(model->nq + model->nv);
    x << sim.state().q, sim.state().v;
    x[model->user[4].q] = x[model->user[5].q] = 0.0;  // thousands of turns
    for (const int i : {4, 5}) x[model->nq + model->user[i].v] = 0.0;
    return x;
  };
  const VectorXd wanted = run(reference());
  SimulationOptions options = by_exponential(0.0, 1e-7, "multirate");
  options.absolute_tolerance = 1e-13;
  const VectorXd got = run(options);
  EXPECT_LT(largest(got - wanted), 1e-5 * 1e-4);
  options.integrator.method = "dop853";
  run(options);
  EXPECT_LT(4 * counts[1].rhs_calls, counts[2].rhs_calls);
}

/// The stiffer the modes, the smaller what they do; the steps do not follow them.
TEST(Exponential, TakesNoSmallerStepsForFasterModes) {
  std::vector<long> calls;
  std::vector<double> errors;
  for (const double faster : {1.0, 10.0, 100.0}) {
    SystemSpec spec = flexible_spacecraft(0);
    for (BodySpec& b : spec.bodies) {
      if (!b.modal || b.name != "beam") continue;
      ModalData data = *b.modal;
      data.K *= faster * faster, data.C *= faster;
      b.modal = std::make_shared<const ModalData>(data);
    }
    const auto model = compiled(spec);
    IntegratorStatistics s;
    const VectorXd got = run_spacecraft(model, by_exponential(0.0, 1e-5), 1.0, &s);
    calls.push_back(s.rhs_calls);
    errors.push_back((got - run_spacecraft(model, reference(), 1.0)).norm());
  }
  EXPECT_LE(calls[2], 2 * calls[0]);
  EXPECT_LT(errors[2], 1e-4);
}

/// A beam on a free hinge with a body on it: nearly all of f is linear, so that N asks for no step. Its modes are
/// as heavy as the hinge they hang on, and go through many radians between two ticks. `at`: the node that the body is on; none, the root:
/// in closed form; the tip: coordinates like those of hinges.
SystemSpec beam_with_a_body(const std::string& at) {
  ModalData stiff = lumped();
  stiff.K *= 1e3;
  BodySpec boom = flexible("boom", at.empty() ? beam() : stiff, 0, "", "revolute", {{0, 1, 0}}, {0, 0, 0});
  BodySpec load = on(rigid("load", 2.0, {0.1, 0.05, 0.2}, diagonal({0.3, 0.5, 0.4})), "boom", "locked");
  load.hinge.inboard_node = at;
  return system({boom, load});
}

TEST(Exponential, SeesWhatItsPolynomialsDoNotFollow) {
  SystemSpec spring = flexible_spacecraft(0, false);
  spring.bodies[1].hinge.springs[0].stiffness *= 1e4;
  for (const SystemSpec& spec : {beam_with_a_body(""), beam_with_a_body("tip"), spring}) {
    const auto model = compiled(spec);
    for (const double tolerance : {1e-6, 1e-8}) {
      const auto end = [&](const SimulationOptions& options) {
        Simulation sim(model, options);
        State s = model->initial_state();
        for (const UserBody& u : model->user) {
          if (u.name == "arm") s.v[u.v] = 1e-6;
          if (u.parent < 0)
            for (int k = 0; k < u.n_modes; ++k) s.v[u.etadot + k] = 1e-6 / (k + 1);
        }
        sim.set_state(s);
        sim.run(1.0);
        return VectorXd(sim.state().v);
      };
      SimulationOptions fine = reference(), options = by_exponential(0.0, tolerance);
      fine.absolute_tolerance = 1e-18, options.absolute_tolerance = 1e-6 * tolerance;
      const VectorXd wanted = end(fine), got = end(options);
      EXPECT_LT(distance(got, wanted), 100.0 * tolerance * largest(wanted)) << model->user[0].name << " at " << tolerance;
    }
  }
}

/// What turns at the tip of a boom makes the closed form another one at each place.
struct TurningLoad {
  TurningLoad(const std::string& method, double relative) : sim(compiled(spec()), by_exponential(0.0, relative, method)) {
    State s = sim.state();
    for (int i = 0; i < sim.model().nv; ++i) s.v[i] = 0.3 * std::cos(2.0 * i);
    sim.set_state(s);
    sim.every({2}, [this] { made.push_back(sim.checkpoint()); });
  }
  static SystemSpec spec() {
    ModalData stiff = lumped();
    stiff.K *= 1e5;
    BodySpec load = on(rigid("load", 0.5, {0.2, 0.05, 0.1}, diagonal({0.03, 0.05, 0.04})), "boom", "ball");
    load.hinge.inboard_node = "tip";
    return system({on(rigid("bus", 40.0, {0.02, -0.01, 0.05}, diagonal({8.0, 6.0, 9.0})), "", "free_body"),
                   flexible("boom", std::move(stiff), 1, "bus", "locked", {}, {0.5, 0, 0}), load});
  }
  VectorXd velocities() const { return sim.state().v; }
  Simulation sim;
  std::vector<Checkpoint> made;
};

/// A stiff boom on a bus, with a load at its tip: modes of less than a micrometre take the steps that they take without weight. The
/// rounding of the weight of all is above what they are asked for.
TEST(Exponential, FallsWithoutWeight) {
  for (const double stiffer : {1.0, 100.0}) {
    SystemSpec spec = beam_with_a_body("tip");
    ModalData boom = *spec.bodies[0].modal;
    boom.K *= stiffer;
    spec.bodies[0].modal = std::make_shared<const ModalData>(boom);
    SpringDamper joint;
    joint.damping = 1e3;
    spec.bodies[0].hinge.springs = {joint};
    spec.bodies[0].hinge.inboard_body = "bus";
    spec.bodies.insert(spec.bodies.begin(), rigid("bus", 4000.0, {0.02, -0.01, 0.05}, diagonal({800.0, 600.0, 900.0})));
    for (const std::string root : {"free", "free_body"})
      for (const std::string method : {"exponential", "multirate"}) {
        spec.bodies[0] = on(spec.bodies[0], "", root);
        const auto steps = [&](const Eigen::Vector3d& weight) {
          spec.gravity.kind = GravitySpec::Kind::uniform, spec.gravity.g = weight;
          const auto model = compiled(spec);
          Simulation sim(model, by_exponential(0.0, 1e-10, method));
          State s = model->initial_state();
          for (const UserBody& u : model->user)
            for (int k = 0; k < u.n_modes; ++k) s.v[u.etadot + k] = 1e-8 / (k + 1);
          sim.set_state(s);
          sim.run(1.0);
          return sim.statistics().steps + sim.statistics().inner_steps;
        };
        EXPECT_EQ(steps({3.0, -5.0, 7.0}), steps(Eigen::Vector3d::Zero())) << root << ", " << method << ", " << stiffer;
      }
  }
}

TEST(Exponential, GivesWayForAWhileWhereItsStepsAreShort) {
  const double relative = 1e-8;
  TurningLoad truth("dop853", 1e-13), alone("exponential", relative), automatic("auto", relative);
  for (TurningLoad* run : {&truth, &alone, &automatic}) run->sim.run(20.0);
  const IntegratorStatistics of_alone = alone.sim.statistics(), of_both = automatic.sim.statistics();
  std::printf("20 s at 1e-8: %ld evaluations by auto, %ld by exponential alone\n", of_both.rhs_calls, of_alone.rhs_calls);
  EXPECT_LT(2 * of_both.rhs_calls, of_alone.rhs_calls);
  EXPECT_LT(3 * of_both.steps, of_alone.steps);
  EXPECT_LT(distance(automatic.velocities(), truth.velocities()), 1e-4 * largest(truth.velocities()));
  EXPECT_TRUE(automatic.sim.ledger().pass);
  EXPECT_TRUE(automatic.sim.warnings().all().empty());
}

/// A boom on a bus, which swings and moves a body at its tip, under ticks of 20 Hz.
struct SwingingLoad {
  double bus, stiffer, damping;  // [kg]; of the boom; [N m s] of its joint

  std::unique_ptr<Simulation> run(const std::string& method, double relative, double until) const {
    SystemSpec spec = beam_with_a_body("tip");
    ModalData boom = *spec.bodies[0].modal;
    boom.K *= stiffer;
    spec.bodies[0].modal = std::make_shared<const ModalData>(boom);
    SpringDamper joint;
    joint.damping = damping;
    spec.bodies[0].hinge.springs = {joint};
    spec.bodies[0].hinge.inboard_body = "bus";
    spec.bodies.insert(spec.bodies.begin(),
                       on(rigid("bus", bus, {0.02, -0.01, 0.05}, diagonal({0.2 * bus, 0.15 * bus, 0.22 * bus})), "", "free_body"));
    const auto model = compiled(spec);
    SimulationOptions options = by_exponential(0.0, relative, method);
    options.absolute_tolerance = 1e-6 * relative;
    auto sim = std::make_unique<Simulation>(model, options);
    State s = model->initial_state();
    for (const UserBody& u : model->user)
      for (int k = 0; k < u.n_modes; ++k) s.v[u.etadot + k] = 1e-6 / (k + 1);
    sim->set_state(s);
    sim->every({1, 20}, [sim = sim.get()] { sim->set_force(0, 1e-7 * std::cos(sim->time())); });
    sim->run(until);
    return sim;
  }
};

/// A mode of 80 Hz makes four turns between two ticks, one in each quarter, and what it does to others must not pass for what stands still.
TEST(Exponential, PiecesSeeSwingsThatFitIntoAStep) {
  for (const double stiffer : {940.0, 990.0, 1040.0}) {
    const SwingingLoad load{40.0, stiffer, 0.0};
    const auto wanted = load.run("dop853", 1e-12, 2.0), got = load.run("multirate", 1e-8, 2.0);
    EXPECT_LT(distance(got->state().v, wanted->state().v), 1e-6 * largest(wanted->state().v)) << stiffer;
  }
}

/// Modes that move a body at the tip are followed by polynomials, whose steps are all that keeps `exponential` from those of the ticks.
TEST(Exponential, GivesWayToPiecesWhereSwingsAloneSetItsSteps) {
  const SwingingLoad load{4000.0, 1e3, 1e3};
  const auto alone = load.run("exponential", 1e-8, 20.0), both = load.run("auto", 1e-8, 20.0), wanted = load.run("dop853", 1e-12, 20.0);
  const IntegratorStatistics of_alone = alone->statistics(), of_both = both->statistics();
  std::printf("20 s at 1e-8: %ld evaluations and %ld pieces by auto, %ld evaluations by exponential alone\n", of_both.rhs_calls,
              of_both.inner_steps, of_alone.rhs_calls);
  EXPECT_LT(2 * of_both.rhs_calls, of_alone.rhs_calls);
  EXPECT_LT(distance(both->state().v, wanted->state().v), 1e-5 * largest(wanted->state().v));
  EXPECT_TRUE(both->ledger().pass);
}

TEST(Exponential, GoesOnBitForBitBeforeAndAfterItGaveWay) {
  TurningLoad whole("auto", 1e-8);
  whole.sim.run(20.0);
  ASSERT_EQ(whole.made.size(), 11u);
  const std::string end = checkpoint_text(whole.sim.checkpoint());
  std::set<std::string> methods;
  for (const std::size_t at : {0u, 2u, 6u, 9u}) {
    TurningLoad rest("auto", 1e-8);
    rest.sim.resume(checkpoint_of(checkpoint_text(whole.made[at])));
    methods.insert(rest.sim.integrator_name());
    rest.sim.run(20.0);
    EXPECT_TRUE(rest.sim.state().q == whole.sim.state().q && rest.sim.state().v == whole.sim.state().v) << at;
    EXPECT_EQ(checkpoint_text(rest.sim.checkpoint()), end) << at;
  }
  EXPECT_EQ(methods, (std::set<std::string>{"dop853", "exponential"}));
}

/// The thousandth step looks at rounding, and may be the first after a checkpoint.
TEST(Exponential, GoesOnFromACheckpointBeforeItLooksAtRounding) {
  for (const std::string method : {"exponential", "multirate"}) {
    const auto model = compiled(flexible_spacecraft());
    const SimulationOptions options = by_exponential(0.0, 1e-3, method);
    Simulation whole(model, options);
    double t = 0.0;
    for (int tick = 1; whole.statistics().steps < 999; ++tick) whole.run(t = 0.05 * tick);
    ASSERT_EQ(whole.statistics().steps, 999) << method;
    Checkpoint made = whole.checkpoint();
    for (int i = 0; i < 2; ++i) {
      Simulation rest(model, options);
      rest.resume(checkpoint_of(checkpoint_text(made)));
      rest.run(++t);
      made = rest.checkpoint();
    }
  }
}

/// Torques between its bodies change no momentum, whatever the error of the steps; events inside of steps too.
TEST(Exponential, KeepsTheMomentumOfAFreeVehicle) {
  for (const std::string method : {"exponential", "multirate"}) {
    const auto model = compiled(flexible_spacecraft());
    Simulation sim(model, by_exponential(0.05, 1e-3, method));
    State s = posture(*model);
    for (int i = 0; i < model->nv; ++i) s.v[i] = 0.05 * std::cos(2.0 * i);
    for (const UserBody& u : model->user)
      if (u.n_modes > 0) s.v.segment(u.etadot, u.n_modes) *= 0.02;
    sim.set_state(s);
    const int wheel = model->user[4].v, arm = model->user[1].q;
    int events = 0;
    sim.add_event({"arm passes", [arm](double, const double* q, const double*) { return q[arm]; }, 0, [&] { ++events; }});
    sim.every({1, 10}, [&sim, wheel] { sim.set_force(wheel, 0.2 * std::cos(2.0 * sim.time())); });
    const Momentum before = sim.momentum();
    sim.run(5.0);
    const Momentum after = sim.momentum();
    EXPECT_GT(events, 3);
    EXPECT_LT((after.linear - before.linear).norm(), 1e-13 * before.linear_magnitude);
    EXPECT_LT((after.angular - before.angular).norm(), 1e-13 * before.angular_magnitude);
  }
}

/// A force on the bus from outside is not taken away.
TEST(Exponential, LeavesMomentumToForcesFromOutside) {
  const auto model = compiled(flexible_spacecraft());
  Simulation sim(model, by_exponential(0.0, 1e-8));
  sim.set_force(model->user[0].v + 4, 2.0);  // along y of the bus
  sim.run(1.0);
  EXPECT_NEAR(sim.momentum().linear.norm(), 2.0, 0.01);
  EXPECT_TRUE(sim.ledger().pass);
}

/// Every hinge, flexible bodies at every level and place of the tree, springs, stops, friction, given motions, fields of gravity.
TEST(Exponential, AgreesOnRandomTrees) {
  int taken = 0;
  for (const auto gravity : {GravitySpec::Kind::none, GravitySpec::Kind::uniform, GravitySpec::Kind::central})
    for (unsigned seed = first_seed(); seed < first_seed() + 40; ++seed) {
      const RandomTree tree =
          random_tree(seed, {.bodies = 6, .prescribed = 0.03, .springs = true, .loads = seed % 5 == 0, .gravity = gravity});
      const auto model = compiled(tree.spec);
      if (!VehicleLinearPart::refusal(*model).empty()) continue;
      ++taken;
      const auto end = [&](const std::string& method, double relative) {
        SimulationOptions options;
        options.integrator.method = method, options.integrator.relative_tolerance = relative;
        Simulation sim(model, options);
        sim.run(0.2);
        return sim.state();
      };
      for (const std::string method : {"exponential", "multirate"}) {
        const State wanted = end("dop853", 1e-12), got = end(method, 1e-7);
        VectorXd d(model->nv);
        model->difference(wanted.q.data(), got.q.data(), d.data());
        const double size = 1.0 + wanted.v.norm();
        EXPECT_LT(largest(d) / size, 3e-6) << method << " seed " << seed << "\n" << describe(tree);
        EXPECT_LT(distance(got.v, wanted.v) / size, 3e-6) << method << " seed " << seed << "\n" << describe(tree);
      }
    }
  EXPECT_GT(taken, 70);
}

/// A particle thrown up to a stiff stop a millimetre below where it would turn round, which it meets for 2 / w atan(v w / g): its motion
/// without that is in the linear part, steps of seconds.
TEST(Exponential, DoesNotGoPastAShortContact) {
  const double g = 9.81, level = 1.273, w = 50.0, up = 5.0, t = 20.0;
  BodySpec ball = on(particle("ball", 2.0, {0, 0, 0}), "", "prismatic", {{0, 0, 1}});
  ball.hinge.v = {up},
  ball.hinge.loads = {{0, HingeLaw::stop, {-std::numeric_limits<double>::infinity(), level, 2.0 * w * w, 1.0, 0.0}, {}}};
  SystemSpec spec = system({ball});
  spec.gravity = uniform_gravity({0, 0, -g});
  const double into = std::sqrt(up * up - 2.0 * g * level), left = t - 2.0 * (up - into) / g - 2.0 / w * std::atan(into * w / g);
  for (const char* method : {"exponential", "multirate"}) {
    Simulation sim(compiled(spec), by_exponential(0.0, 1e-9, method));
    sim.run(t);
    EXPECT_NEAR(sim.state().q[0], -up * left - 0.5 * g * left * left, 1e-6 * 1863.0) << method;
    EXPECT_TRUE(sim.ledger().pass) << method;
  }
}

/// A boom that a spring turns to its end: a latch catches it there, or it presses into a stop. Both are springs and dampers once they act,
/// and in the linear part from then on: with them in what is left both methods took hundreds of times these steps.
TEST(Exponential, TakesWhatActsAtHingesInClosedForm) {
  for (const bool latch : {true, false}) {
    BodySpec wing = flexible("wing", beam(), 0, "bus", "revolute", {{0, 1, 0}}, {0.0, -0.5, 0.0});
    SpringDamper spring;
    spring.stiffness = 0.4, spring.rest = -0.1;
    wing.hinge.springs = {spring};
    wing.hinge.q = {0.1};
    if (!latch) wing.hinge.loads = {{0, HingeLaw::stop, {0.0, std::numeric_limits<double>::infinity(), 5000.0, 1.0, 0.0}, {}}};
    SystemSpec spec = system({on(rigid("bus", 40.0, {0, 0, 0}, diagonal({8.0, 6.0, 9.0})), "", "free"), wing});
    if (latch)
      spec.devices.push_back(device("latch", "latch", {{"max_rate", 10.0}, {"stiffness", 5000.0}, {"damping", 40.0}}, {{"at", "wing"}}));
    const auto model = compiled(spec);
    Simulation wanted(model, by_exponential(0.0, 1e-11, "dop853"));
    wanted.run(3.0);
    for (const std::string method : {"exponential", "multirate"}) {
      Simulation sim(model, by_exponential(0.0, 1e-8, method));
      sim.run(3.0);
      VectorXd d(model->nv);
      model->difference(wanted.state().q.data(), sim.state().q.data(), d.data());
      EXPECT_LT(largest(d), 1e-6) << method << (latch ? " latch" : " stop");
      EXPECT_LT(sim.statistics().steps, 3 * wanted.statistics().steps) << method << (latch ? " latch" : " stop");
    }
  }
}

TEST(Exponential, RefusesWhatItDoesNotHonour) {
  SystemSpec spec = flexible_spacecraft();
  spec.bodies[0].hinge.prescribed = {0};
  const auto model = compiled(spec);
  try {
    VehicleLinearPart part(model, "exponential");
    FAIL() << "a given motion of a free body";
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics().at(0).code, Code::unsupported);
    EXPECT_EQ(e.diagnostics().at(0).at.key_path, "integrator.method");
  }
}

}  // namespace
}  // namespace cardan::test
