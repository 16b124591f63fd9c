// Linear models, modes, inverse of the mass matrix, operational space and inverse dynamics of vehicles with closed loops: against
// differences of the dense twin, which closes them by its own rows and multipliers, and against closed forms.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <numbers>

#include "core/dynamics/inverse.hpp"
#include "core/dynamics/loops.hpp"
#include "core/linalg/dense.hpp"
#include "core/model/loops.hpp"
#include "core/operators/closed_system.hpp"
#include "core/operators/linear_model.hpp"
#include "core/operators/operational_space.hpp"
#include "core/operators/sensitivity.hpp"
#include "core/operators/system_modes.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "core/sim/simulation.hpp"
#include "tests/support/bench_loops.hpp"
#include "tests/support/four_bar.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using operators::linearize;
using operators::LinearModel;

/// A closed vehicle by the twin: states near a point as functions of its independent deviations.
class ClosedTwin {
 public:
  ClosedTwin(const SystemSpec& spec, const Model& model, VectorXd q, VectorXd v, VectorXd tau)
      : model_(model), twin_(spec), q_(std::move(q)), v_(std::move(v)), tau_(std::move(tau)) {
    Workspace ws(model);
    freedom_ = loop_freedom(model, ws, q_.data());
  }

  /// [v_dependent and all others; v'] for deviations [theta_I; v_I; tau], dependent components by Newton's method on the twin's rows.
  VectorXd operator()(const VectorXd& x) const {
    const auto m = static_cast<Eigen::Index>(freedom_.independent.size());
    VectorXd v = v_;
    for (Eigen::Index i = 0; i < m; ++i) v[freedom_.independent[static_cast<std::size_t>(i)]] += x[m + i];
    const VectorXd q = place(x.head(m));
    follow(q, v);
    VectorXd out(2 * model_.nv);
    out << v, twin_.at(q, v).closed(tau_ + x.tail(model_.nv)).vdot;
    return out;
  }

  /// Its Jacobian by differences of fourth order.
  MatrixXd slopes() const {
    const auto n = static_cast<Eigen::Index>(2 * freedom_.independent.size()) + model_.nv;
    MatrixXd J(2 * model_.nv, n);
    const double h = 2e-3;
    for (Eigen::Index j = 0; j < n; ++j) {
      const auto at = [&](double s) { return (*this)(s * h * VectorXd::Unit(n, j)); };
      J.col(j) = (8.0 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12.0 * h);
    }
    return J;
  }

  const LoopFreedom& freedom() const { return freedom_; }
  /// Where independent components deviate by theta.
  VectorXd place(const VectorXd& theta) const {
    VectorXd d = freedom_.X * theta, q(model_.nq);
    model_.retract(q_.data(), d.data(), q.data());
    for (int i = 0; i < 6; ++i) {
      const auto [G, c] = rows(q);
      d.setZero();
      d(freedom_.dependent) = -dependent(G, c);
      const VectorXd from = q;
      model_.retract(from.data(), d.data(), q.data());
    }
    return q;
  }
  /// Dependent rates of v at q.
  void follow(const VectorXd& q, VectorXd& v) const {
    const MatrixXd G = rows(q).first;
    v(freedom_.dependent) = -dependent(G, G(Eigen::all, freedom_.independent) * v(freedom_.independent));
  }

 private:
  VectorXd dependent(const MatrixXd& G, const VectorXd& c) const { return least_squares(G(Eigen::all, freedom_.dependent), c); }
  std::pair<MatrixXd, VectorXd> rows(const VectorXd& q) const {
    const auto state = twin_.at(q, VectorXd::Zero(model_.nv));
    MatrixXd G(model_.loops.rows, model_.nv);
    VectorXd c(model_.loops.rows);
    int first = 0;
    for (const auto& loop : state.loops()) {
      G.middleRows(first, loop.G.rows()) = loop.G, c.segment(first, loop.G.rows()) = loop.c;
      first += static_cast<int>(loop.G.rows());
    }
    return {G, c};
  }

  const Model& model_;
  reference::DenseTwin<double> twin_;
  VectorXd q_, v_, tau_;
  LoopFreedom freedom_;
};

bench_loops::Model bench_of(const char* name) {
  return bench_loops::read(fmt::format("{}/tests/reference/bench_loops/{}.json", CARDAN_SOURCE_DIR, name));
}
constexpr const char* kMechanisms[] = {"bricard", "hexapod_free", "mini_cheetah", "andrews", "four_bar_revolute", "rocker_bogie"};

/// At the start, with `more` added to its rates as far as the loops allow.
double error_of_model(const SystemSpec& spec, const VectorXd& tau, const VectorXd& more = {}) {
  const auto model = compiled(spec);
  State s = model->initial_state();
  if (more.size() > 0) s.v += more;
  LoopProjection(*model).close(s.q.data(), s.v.data());
  const ClosedTwin twin(spec, *model, s.q, s.v, tau);
  std::vector<std::string> all;
  for (const int side : {0, 1})
    for (const UserBody& u : model->user)
      for (int j = 0; j < u.nv; ++j)
        if (u.nq == u.nv) all.push_back(u.name + "." + (side ? u.v_names : u.q_names)[static_cast<std::size_t>(j)]);
  const LinearModel linear = linearize(*model, {.q = s.q.data(), .v = s.v.data(), .tau = tau.data()}, {{}, all});
  const MatrixXd want = twin.slopes();
  const auto m = static_cast<Eigen::Index>(twin.freedom().independent.size());
  const int nv = model->nv;
  double worst = 0.0;
  const auto compare = [&](const VectorXd& got, const VectorXd& truth) {
    worst = worse(worst, distance(got, truth) / std::max(1.0, largest(truth)));
  };
  for (Eigen::Index j = 0; j < 2 * m; ++j) {
    const VectorXd vdot = want.col(j).tail(nv);
    compare(linear.A.col(j).tail(m), vdot(twin.freedom().independent));
    int row = 0;  // dependent states as outputs
    for (const int side : {0, 1})
      for (const UserBody& u : model->user)
        for (int i = 0; i < u.nv; ++i)
          if (u.nq == u.nv) {
            const double truth = side ? want(u.v + i, j) : j < m ? twin.freedom().X(u.v + i, j) : 0.0;
            worst = worse(worst, std::abs(linear.C(row++, j) - truth) / std::max(1.0, std::abs(truth)));
          }
  }
  for (int j = 0; j < nv; ++j) {
    const VectorXd vdot = want.col(2 * m + j).tail(nv);
    compare(linear.B.col(j).tail(m), vdot(twin.freedom().independent));
  }
  const auto about = operators::closed_derivatives(*model, {.q = s.q.data(), .v = s.v.data(), .tau = tau.data()});
  for (Eigen::Index j = 0; j < m; ++j) {
    compare(about.q.col(j), want.col(j).tail(nv));
    compare(about.v.col(j), want.col(m + j).tail(nv));
  }
  for (int j = 0; j < nv; ++j) compare(about.tau.col(j), want.col(2 * m + j).tail(nv));
  if (about.independent != twin.freedom().independent) return HUGE_VAL;
  return worst;
}

TEST(ClosedLinearModel, AgreesWithDifferencesOfTheTwin) {
  for (const char* closing : {"point", "revolute", "line"}) {
    const VectorXd tau = Eigen::Vector3d(0.4, -0.3, 0.2);
    EXPECT_LE(error_of_model(four_bar(closing), tau), 1e-7) << closing;
  }
  SystemSpec strut = four_bar();
  strut.loops[0].type = "distance", strut.loops[0].length = 0.2, strut.loops[0].from.position = {0.5, -0.2, 0};
  EXPECT_LE(error_of_model(strut, Eigen::Vector3d(0.4, -0.3, 0.2), Eigen::Vector3d(0.0, 0.9, 2.0)), 1e-7) << "distance";  // it turns
  for (const char* name : {"bricard", "hexapod_free", "mini_cheetah", "andrews", "four_bar_revolute", "rocker_bogie", "solar_array_8"})
    for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
      bench_loops::Model bench = bench_loops::read(fmt::format("{}/tests/reference/bench_loops/{}.json", CARDAN_SOURCE_DIR, name));
      bench.spec.loop_form = form;
      EXPECT_LE(error_of_model(bench.spec, bench.states[0].tau), 1e-6) << name;
    }
}

// A chain, one component of whose last hinge is driven, held by a strut. Of v' only that of the given motion is read, in each form.
TEST(ClosedLinearModel, ReadsTheAccelerationsOfGivenMotionsAlone) {
  const Eigen::Vector3d com(0.3, 0.1, -0.2), tip(0.7, -0.1, 0.2);
  const auto link = [&](const char* name, const char* inboard, const Eigen::Vector3d& axis, double angle) {
    BodySpec b = on(rigid(name, 1.1, com, diagonal({0.2, 0.3, 0.4})), inboard, "revolute", {axis}, tip);
    b.hinge.q = {angle}, b.hinge.v = {0.4 - angle};
    return b;
  };
  SystemSpec spec = system({link("first", "", {0, 0, 1}, 0.3), link("second", "first", {0, 1, 0}, -0.4),
                            link("third", "second", {0, 1, 1}, 0.7), link("driven", "third", {1, 0, 2}, -0.5)},
                           uniform_gravity({0.3, -0.5, -9.81}));
  spec.bodies[3].hinge.type = "universal", spec.bodies[3].hinge.params = along({{1, 0, 2}, {0, 1, 0.3}});
  spec.bodies[3].hinge.q = {-0.5, 0.2}, spec.bodies[3].hinge.v = {0.9, 0.3};
  spec.bodies[3].hinge.prescribed = {0};
  LoopSpec strut;
  strut.name = "strut", strut.type = "distance", strut.from.position = {0.4, 0.9, -0.6}, strut.to.body = "driven", strut.to.position = com;
  strut.length = 2.7;
  spec.bodies[2].hinge.q.clear(), spec.bodies[2].hinge.v.clear();  // these follow
  spec.loops = {strut};
  const Eigen::Vector<double, 5> tau(0.4, -0.3, 0.2, 0.0, -0.5);
  std::optional<LinearModel> first;
  for (const LoopForm form : {LoopForm::multipliers, LoopForm::embedding}) {
    spec.loop_form = form;
    const auto model = compiled(spec);
    const State s = model->initial_state();
    Simulation sim(model, {});
    sim.prescribe(3, MotionProfile::rate_table({{0.0, s.v[3]}, {1.0, s.v[3] + 0.7}}));
    for (const int v : {0, 1, 2, 4}) sim.set_force(v, tau[v]);
    const VectorXd vdot = sim.vdot();
    EXPECT_NEAR(vdot[3], 0.7, 1e-15);
    const LinearModel linear =
        linearize(*model, {.q = s.q.data(), .v = s.v.data(), .tau = tau.data(), .vdot = vdot.data()}, {{}, {"third"}});
    Workspace ws(*model);
    const VectorXd independent = vdot(loop_freedom(*model, ws, s.q.data()).independent);
    EXPECT_LE(distance(VectorXd(linear.drift.tail(4)), independent), 1e-12 * largest(vdot));
    const std::vector<std::uint8_t> all(5, 1);
    const Inputs in{.q = s.q.data(), .v = s.v.data(), .tau = tau.data(), .vdot = vdot.data()};
    const operators::ClosedForces none = operators::closed_inverse_dynamics(model, in, vdot, all);
    EXPECT_LE(largest(none.tau), 1e-12 * largest(vdot));  // it moves so by itself
    if (first) {
      EXPECT_LE(largest(MatrixXd(linear.A - first->A)), 1e-11 * largest(first->A));
    }
    first = linear;
  }
}

/// Two cranks on the ground, and what joins their tips, which stays level.
SystemSpec parallelogram(double stiffness) {
  const auto crank = [&](const char* name, double x) {
    BodySpec b = on(rigid(name, 1.3, {0.25, 0, 0}, diagonal({0.001, 0.03, 0.03})), "", "revolute", {{0, 0, 1}}, {x, 0, 0});
    b.hinge.q = {-0.5 * std::numbers::pi};
    return b;
  };
  BodySpec coupler = on(rigid("coupler", 2.1, {0.4, 0, 0}, diagonal({0.01, 0.2, 0.2})), "left", "revolute", {{0, 0, 1}}, {0.5, 0, 0});
  coupler.hinge.q = {0.5 * std::numbers::pi};
  SystemSpec spec = system({crank("left", 0.0), crank("right", 0.8), coupler}, uniform_gravity({0, -9.81, 0}));
  if (stiffness > 0.0) {
    SpringDamper spring;
    spring.stiffness = stiffness, spring.rest = -0.5 * std::numbers::pi;
    spec.bodies[0].hinge.springs = {spring};
  }
  LoopSpec pin;
  pin.name = "pin", pin.type = "point";
  pin.from.body = "right", pin.from.position = {0.5, 0, 0}, pin.to.body = "coupler", pin.to.position = {0.8, 0, 0};
  spec.loops = {pin};
  return spec;
}
constexpr double kInertia = 2.1 * 0.25 + 2 * (0.03 + 1.3 * 0.0625), kWeight = 9.81 * (2.1 * 0.5 + 2 * 1.3 * 0.25);

TEST(ClosedLinearModel, OfAParallelogramIsAPendulum) {
  const auto model = compiled(parallelogram(0.0));
  const State s = model->initial_state();
  const LinearModel linear = linearize(*model, {.q = s.q.data(), .v = s.v.data()}, {{"left.angle"}, {"left.angle", "right.angle"}});
  ASSERT_EQ(linear.A.rows(), 2);
  EXPECT_NEAR(linear.A(1, 0), -kWeight / kInertia, 1e-12);
  EXPECT_NEAR(linear.A(1, 1), 0.0, 1e-12);
  EXPECT_NEAR(std::abs(linear.B(1, 0)), 1.0 / kInertia, 1e-12);
  EXPECT_NEAR(linear.C(0, 0), linear.C(1, 0), 1e-13);  // both cranks turn alike
  EXPECT_LE(linear.drift.cwiseAbs().maxCoeff<Eigen::PropagateNaN>(), 1e-13);
  const auto poles = operators::poles(linear.A);
  EXPECT_NEAR(poles[0].frequency, std::sqrt(kWeight / kInertia) / (2 * std::numbers::pi), 1e-12);
}

TEST(ClosedSystemModes, OfAParallelogramOnASpring) {
  SystemSpec spec = parallelogram(35.0);
  spec.gravity = {};
  const auto model = compiled(spec);
  const State s = model->initial_state();
  Workspace ws(*model);
  operators::TreeOperators tree(open_tree(model));
  tree.at(s.q.data());
  const auto modes = operators::closed_system_modes(tree, loop_freedom(*model, ws, s.q.data()).X);
  ASSERT_EQ(modes.n_rigid, 0);
  ASSERT_EQ(modes.frequency.size(), 1);
  EXPECT_NEAR(modes.frequency[0], std::sqrt(35.0 / kInertia) / (2 * std::numbers::pi), 1e-13);
  EXPECT_NEAR(modes.kinetic.sum(), 1.0, 1e-13);
  EXPECT_NEAR(modes.strain.sum(), 1.0, 1e-13);
}

// Springs that are not strained, no gravity: the poles of the linear model and the modes are the same.
TEST(ClosedSystemModes, AreThePolesOfTheLinearModel) {
  bench_loops::Model bench = bench_loops::read(CARDAN_SOURCE_DIR "/tests/reference/bench_loops/fourbar_chain_8.json");
  bench.spec.gravity = {};
  double k = 20.0;
  for (BodySpec& b : bench.spec.bodies) {
    b.hinge.v.clear();
    if (b.hinge.type != "revolute" || b.hinge.q.empty()) continue;
    SpringDamper spring;
    spring.stiffness = k, spring.rest = b.hinge.q[0];
    b.hinge.springs = {spring};
    k *= 1.17;
  }
  const auto model = compiled(bench.spec);
  const State s = model->initial_state();
  Workspace ws(*model);
  operators::TreeOperators tree(open_tree(model));
  tree.at(s.q.data());
  const auto modes = operators::closed_system_modes(tree, loop_freedom(*model, ws, s.q.data()).X, {.elastic = 100});
  const LinearModel linear = linearize(*model, {.q = s.q.data(), .v = s.v.data()});
  const auto poles = operators::poles(linear.A);
  ASSERT_EQ(static_cast<std::size_t>(2 * modes.frequency.size()), poles.size());
  for (Eigen::Index i = 0; i < modes.frequency.size(); ++i)
    EXPECT_NEAR(poles[static_cast<std::size_t>(2 * i)].frequency / modes.frequency[i], 1.0, 1e-9) << i;
  EXPECT_LE(modes.residual.maxCoeff<Eigen::PropagateNaN>(), 1e-10);
}

// v' and its derivatives in the inertia of a body, against twins of other vehicles.
TEST(ClosedSensitivities, InABodysInertiaAgreeWithTheTwin) {
  for (const char* name : {"andrews", "four_bar_revolute", "hexapod_free"}) {
    const bench_loops::Model bench = bench_of(name);
    const auto model = compiled(bench.spec);
    const bench_loops::State& s = bench.states[0];
    const auto about = operators::closed_derivatives(*model, {.q = s.q.data(), .v = s.v.data(), .tau = s.tau.data()});
    EXPECT_LE(distance(about.vdot, s.vdot), 1e-10 * largest(s.vdot)) << name;
    const operators::ClosedSystem closed(model, s.q.data());
    operators::Sensitivities in_tree(closed.tree().model_pointer());
    in_tree.at({.q = s.q.data(), .v = s.v.data(), .vdot = about.vdot.data()});
    const std::size_t body = bench.spec.bodies.size() - 1;
    const MatrixXd dtau = in_tree.inverse_in_inertia(static_cast<int>(body));
    const auto heavier = [&](double share) {  // all of its inertia alike
      SystemSpec spec = bench.spec;
      spec.bodies[body].mass *= share, spec.bodies[body].inertia_com *= share;
      return reference::DenseTwin<double>(spec).at(s.q, s.v).closed(s.tau).vdot;
    };
    const double h = 5e-3;  // 4 h^4 of 1 / share, and of round-off as much
    const VectorXd want = (8.0 * (heavier(1 + h) - heavier(1 - h)) - (heavier(1 + 2 * h) - heavier(1 - 2 * h))) / (12.0 * h);
    const BodySpec& b = bench.spec.bodies[body];
    const Eigen::Vector3d c = b.com;
    const Eigen::Matrix3d J = b.inertia_com + b.mass * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
    VectorXd parameters(10);
    parameters << b.mass, b.mass * c, J(0, 0), J(1, 1), J(2, 2), J(0, 1), J(0, 2), J(1, 2);
    const VectorXd got = -closed.tree().to_model(closed.respond(dtau * parameters));
    EXPECT_LE(distance(got, want), 1e-8 * std::max(1.0, largest(want))) << name;
  }
}

// ---- the mass matrix ----

TEST(ClosedSystem, RespondsAsTheTwinDoes) {
  for (const char* name : kMechanisms) {
    bench_loops::Model bench = bench_of(name);
    bench.spec.gravity = {};
    const auto model = compiled(bench.spec);
    const VectorXd q = bench.states[0].q;
    const operators::ClosedSystem closed(model, q.data());
    const reference::DenseTwin<double> twin(bench.spec);
    const auto still = twin.at(q, VectorXd::Zero(model->nv));
    MatrixXd got(model->nv, model->nv), want(model->nv, model->nv);
    for (int i = 0; i < model->nv; ++i) {
      const VectorXd tau = VectorXd::Unit(model->nv, i);
      got.col(i) = closed.tree().to_model(closed.respond(closed.tree().from_model(tau)));
      want.col(i) = still.closed(tau).vdot;
    }
    EXPECT_LE((got - want).norm(), 1e-11 * want.norm()) << name;
  }
}

// M^-1 - M^-1 G* (G M^-1 G*)^+ G M^-1, in full, and what a projected inverse is.
TEST(ClosedSystem, IsTheProjectedInverse) {
  for (const char* closing : {"point", "revolute", "distance"}) {
    SystemSpec spec = four_bar(closing);
    if (spec.loops[0].type == "distance") spec.loops[0].length = 0.2, spec.loops[0].from.position = {0.5, -0.2, 0};
    const auto model = compiled(spec);
    const VectorXd q = model->initial_state().q;
    const operators::ClosedSystem closed(model, q.data());
    Workspace ws(*model), of_tree(closed.tree().model());
    const MatrixXd M = mass_matrix(closed.tree().model(), of_tree, q.data()), G = loop_matrix(*model, ws, q.data()), I = inverse(M);
    const MatrixXd L = G * I * G.transpose();
    const DensePairs of = symmetric_pairs(L);  // L+ by those of its eigenvalues that are not rounding
    const auto rank = (of.values.array() > 1e-10 * of.values.tail<1>()[0]).count();
    const MatrixXd U = of.vectors.rightCols(rank), LU = I * G.transpose() * U;
    const MatrixXd want = I - LU * of.values.tail(rank).cwiseInverse().asDiagonal() * LU.transpose();
    const MatrixXd got = closed.motions() * closed.motions().transpose();
    EXPECT_LE((got - want).norm(), 1e-12 * I.norm()) << closing;
    EXPECT_LE((G * got).norm(), 1e-13 * G.norm() * got.norm()) << closing;
    EXPECT_LE((got * M * got - got).norm(), 1e-13 * got.norm()) << closing;
    EXPECT_EQ(closed.mobility(), closing == std::string("distance") ? 2 : 1);
  }
}

// X and M of the twin; the gradient and nu' by differences of it along motions that keep the loops closed.
TEST(ClosedSystem, HasALogDetAndDiagonalisedVelocities) {
  for (const char* name : kMechanisms) {
    bench_loops::Model bench = bench_of(name);
    bench.spec.gravity = {};
    for (BodySpec& b : bench.spec.bodies) b.hinge.springs.clear();
    const auto model = compiled(bench.spec);
    State s = model->initial_state();
    for (int i = 0; i < model->nv; ++i) s.v[i] += std::sin(1.0 + 2.3 * i);
    LoopProjection(*model).close(s.q.data(), s.v.data());
    const VectorXd tau = bench.states[0].tau;
    const ClosedTwin twin(bench.spec, *model, s.q, s.v, tau);
    const auto m = static_cast<Eigen::Index>(twin.freedom().independent.size());
    const auto log_det = [&](const VectorXd& q) {
      Workspace ws(*model);
      const MatrixXd X = loop_freedom(*model, ws, q.data()).X, M = reference::DenseTwin<double>(bench.spec).at(q, s.v).M;
      return std::log(determinant(X.transpose() * M * X));
    };
    const operators::ClosedSystem closed(model, s.q.data());
    const operators::TreeOperators& tree = closed.tree();
    EXPECT_NEAR(closed.log_det(), log_det(s.q), 1e-10 * std::max(1.0, std::abs(closed.log_det()))) << name;
    const double h = 2e-3;
    const auto slope = [&](auto&& f) -> decltype(f(h)) { return (8.0 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12.0 * h); };
    const VectorXd gradient = closed.log_det_gradient();
    for (Eigen::Index j = 0; j < m; ++j) {
      const double want = slope([&](double x) { return log_det(twin.place(x * VectorXd::Unit(m, j))); });
      EXPECT_NEAR(gradient[j], want, 1e-7 * std::max(1.0, std::abs(want))) << name << " " << j;
    }

    const VectorXd nu = closed.nu(tree.from_model(s.v)), C = closed.coriolis(nu);
    const MatrixXd M = reference::DenseTwin<double>(bench.spec).at(s.q, s.v).M;
    EXPECT_NEAR(nu.squaredNorm(), s.v.dot(M * s.v), 1e-12 * nu.squaredNorm()) << name;
    EXPECT_LE(distance(VectorXd(tree.to_model(closed.velocity(nu))), s.v), 1e-11 * largest(s.v)) << name;
    EXPECT_NEAR(nu.dot(C), 0.0, 1e-12 * nu.norm() * std::max(C.norm(), nu.norm() * largest(s.v))) << name;  // C = 0 of one way to move
    const VectorXd vdot = twin(VectorXd::Zero(2 * m + model->nv)).tail(model->nv);
    const VectorXd want = slope([&](double x) -> VectorXd {
      const VectorXd q = twin.place(x * s.v(twin.freedom().independent));
      VectorXd v = s.v + x * vdot;
      twin.follow(q, v);
      const operators::ClosedSystem there(model, q.data());
      return there.nu(there.tree().from_model(v));
    });
    EXPECT_LE(distance(VectorXd(closed.eps(tree.from_model(tau)) - C), want), 1e-7 * std::max(1.0, largest(want))) << name;
  }
}

/// The parallelogram with its cranks at an angle from the x axis.
SystemSpec parallelogram_at(double angle, double stiffness = 0.0) {
  SystemSpec spec = parallelogram(stiffness);
  spec.bodies[0].hinge.q = {angle}, spec.bodies[1].hinge.q = {angle}, spec.bodies[2].hinge.q = {-angle};
  NodeSpec middle;
  middle.name = "middle", middle.position = {0.4, 0, 0};
  spec.bodies[2].nodes.push_back(middle);
  return spec;
}

// Its coupler does not turn: I/0.25 kg against a force along its circle of radius 0.5 m, no motion along anything else.
TEST(ClosedOperationalSpace, OfAParallelogramIsAMassOnACircle) {
  const double angle = 0.4;
  const auto model = compiled(parallelogram_at(angle));
  const VectorXd q = model->initial_state().q;
  const operators::ClosedSystem closed(model, q.data());
  const operators::OperationalSpace task(closed, {{model->find_node("coupler.middle")}, {}});
  VectorXd along = VectorXd::Zero(6);
  along.segment<2>(3) << -std::sin(angle), std::cos(angle);
  EXPECT_LE((task.compliance() - along * along.transpose() * (0.25 / kInertia)).norm(), 1e-13);
  EXPECT_EQ(task.rank(), 1);
  EXPECT_NEAR(along.dot(task.inertia() * along), kInertia / 0.25, 1e-11);
  const VectorXd v = task.consistent_inverse(along);
  EXPECT_LE(distance(task.rates(v), along), 1e-12);
  EXPECT_LE(distance(v, Eigen::Vector3d(2.0, 2.0, -2.0)), 1e-12);
}

// Two hinges about one axis, a sprung universal joint between them, and the last body welded to the ground: the first two turn against each
// other, and what rounding leaves of the others is neither a vibration nor a way to move.
TEST(ClosedSystem, WhatLoopsHoldIsNeitherStrainedNorMoved) {
  const Eigen::Vector3d axis(1, 2, 3), place(0.3, -0.2, 0.7), com(0.1, 0.2, -0.3);
  BodySpec joint = on(rigid("joint", 1.7, com, diagonal({1, 1.2, 1.4})), "first", "universal", {{3, 0.1, -1}, {0.2, 2, -1}});
  SpringDamper spring;
  spring.stiffness = 40.0, spring.damping = 0.3;
  joint.hinge.springs = {spring, spring};
  joint.hinge.springs[1].component = 1;
  SystemSpec spec = system({on(rigid("first", 1.3, com, diagonal({1, 1.3, 1.5})), "", "revolute", {axis}, place), joint,
                            on(rigid("last", 2.1, com, diagonal({1, 1.1, 1.6})), "joint", "revolute", {axis})});
  LoopSpec weld;
  weld.name = "weld", weld.type = "weld", weld.from.position = place, weld.to.body = "last";
  spec.loops = {weld};
  const auto model = compiled(spec);
  const State s = model->initial_state();
  Workspace ws(*model);
  operators::TreeOperators tree(open_tree(model));
  tree.at(s.q.data());
  const auto modes = operators::closed_system_modes(tree, loop_freedom(*model, ws, s.q.data()).X);
  EXPECT_EQ(modes.n_rigid, 1);
  EXPECT_EQ(modes.frequency.size(), 1);
  const operators::ClosedSystem closed(model, s.q.data());
  EXPECT_EQ(closed.mobility(), 1);
  EXPECT_EQ(operators::OperationalSpace(closed, {{model->find_node("last")}, {}}).rank(), 0);
  EXPECT_EQ(operators::OperationalSpace(closed, {{model->find_node("first")}, {}}).rank(), 1);
}

TEST(ClosedInverseDynamics, OfAParallelogramHoldsItsWeightAndItsSpring) {
  const double angle = 0.4, wanted = 0.7, stiffness = 3.0;
  const auto model = compiled(parallelogram_at(angle, stiffness));
  const State s = model->initial_state();
  const Inputs in{.q = s.q.data(), .v = s.v.data()};
  const double torque = kInertia * wanted + kWeight * std::cos(angle) + stiffness * (angle + 0.5 * std::numbers::pi);
  const VectorXd vdot = Eigen::Vector3d(wanted, wanted, -wanted);
  for (int drive : {0, 1, 2}) {
    std::vector<std::uint8_t> actuated(3, 0);
    actuated[static_cast<std::size_t>(drive)] = 1;
    const auto found = operators::closed_inverse_dynamics(model, in, vdot, actuated);
    EXPECT_NEAR(found.tau[drive], drive == 2 ? -torque : torque, 1e-12);
    EXPECT_LE(largest(found.missing), 1e-12);
  }
  const auto none = operators::closed_inverse_dynamics(model, in, vdot, std::vector<std::uint8_t>(3, 0));
  EXPECT_NEAR(none.missing.cwiseAbs().sum(), torque, 1e-12);
  // All of them, least in tau* diag(M)^-1 tau: as the diagonal of M.
  const auto tree = open_tree(model);
  Workspace ws(*tree);
  const VectorXd diagonal = mass_matrix(*tree, ws, s.q.data()).diagonal();
  const auto all = operators::closed_inverse_dynamics(model, in, vdot, std::vector<std::uint8_t>(3, 1));
  const VectorXd share = Eigen::Vector3d(1, 1, -1).cwiseProduct(diagonal) / diagonal.sum();
  EXPECT_LE(distance(all.tau, VectorXd(torque * share)), 1e-12);
}

// Published tau gives published v', so what is found for that v' pushes what is free as that tau does, and moves the twin so.
TEST(ClosedInverseDynamics, FindsWhatMovesPublishedMechanisms) {
  for (const char* name : kMechanisms) {
    const bench_loops::Model bench = bench_of(name);
    const auto model = compiled(bench.spec);
    const reference::DenseTwin<double> twin(bench.spec);
    for (const bench_loops::State& s : bench.states) {
      const Inputs in{.q = s.q.data(), .v = s.v.data()};
      Workspace ws(*model);
      const LoopFreedom freedom = loop_freedom(*model, ws, s.q.data());
      std::vector<std::uint8_t> all(static_cast<std::size_t>(model->nv), 1), few(all.size(), 0);
      for (const int v : freedom.independent) few[static_cast<std::size_t>(v)] = 1;
      const VectorXd want = freedom.X.transpose() * s.tau;
      for (const auto& actuated : {all, few}) {
        const auto found = operators::closed_inverse_dynamics(model, in, s.vdot, actuated);
        EXPECT_LE(distance(VectorXd(freedom.X.transpose() * found.tau), want), 1e-9 * std::max(1.0, largest(want))) << name;
        const VectorXd vdot = twin.at(s.q, s.v).closed(found.tau).vdot;
        EXPECT_LE(distance(vdot, s.vdot), 1e-9 * std::max(1.0, largest(s.vdot))) << name;
        for (int v = 0; v < model->nv; ++v) EXPECT_TRUE(actuated[static_cast<std::size_t>(v)] != 0 || found.tau[v] == 0.0);
      }
    }
  }
}

}  // namespace
}  // namespace cardan::test
