// What no diagnostic, no helper and no given motion may do to the steps of a run, and what they must do.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/linalg/dense.hpp"
#include "core/sim/expected_stiffness.hpp"
#include "core/sim/fastest_motion.hpp"
#include "core/sim/simulation.hpp"
#include "tests/support/builders.hpp"
#include "tests/support/four_bar.hpp"
#include "tests/support/modal_samples.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kMu = 398600.4418e9, kRadius = 6878137.0;  // [m^3/s^2], [m]
const double kMeanMotion = std::sqrt(kMu / std::pow(kRadius, 3));
const std::vector<std::string> kMethods = {"rk4",         "dopri5",    "dop853",       "exponential", "multirate",
                                           "cvode_adams", "cvode_bdf", "ark_explicit", "ark_imex",    "ark_implicit"};

SimulationOptions by(const std::string& method, double relative = 1e-9, double fixed_step = 0.01) {
  SimulationOptions o;
  o.integrator.method = method;
  o.integrator.relative_tolerance = relative;
  if (method == "rk4") o.integrator.fixed_step = fixed_step;
  return o;
}

/// On the base beside the sprung arm an arm whose rate has corners, and one on the sprung arm that follows a sine.
SystemSpec base_with_arms() {
  BodySpec drive = on(rigid("drive", 1.5, {0, 0.6, 0}, diagonal({0.2, 0.1, 0.2})), "base", "revolute", {{1, 0, 0}}, {-0.5, 0, 0});
  drive.hinge.prescribed = {0};
  drive.hinge.q = {0.2};
  BodySpec shaker = on(rigid("shaker", 1.0, {0, 0, 0.7}, diagonal({0.1, 0.2, 0.1})), "arm", "revolute", {{0, 1, 0}}, {0.8, 0, 0});
  shaker.hinge.prescribed = {0};
  std::vector<BodySpec> bodies = base_with_sprung_arm();
  bodies.insert(bodies.end(), {drive, shaker});
  return system(std::move(bodies));
}

const std::vector<std::pair<double, double>> kCorners = {{0.13, 0.0}, {0.57, 1.1}, {1.01, -0.4}, {1.43, 0.3}};

/// Corners, ticks at 5 Hz that change a torque, and an event that does.
struct Scene {
  explicit Scene(const SimulationOptions& options, bool discontinuous = true) : sim(compiled(base_with_arms()), options) {
    arm = sim.model().user[1].v, drive = sim.model().user[2].v, shaker = sim.model().user[3].v;
    sim.prescribe(drive, MotionProfile::rate_table(kCorners));
    sim.prescribe(shaker, MotionProfile::sine(0.2, 0.8, 0.3));
    if (!discontinuous) return;
    sim.every({1, 5}, [this] { sim.set_force(arm, 0.5 * std::cos(3.0 * sim.time())); });
    const int q = sim.model().user[1].q;
    sim.add_event({"arm passes", [q](double, const double* x, const double*) { return x[q] - 0.2; }, 0,
                   [this] { sim.set_force(sim.model().user[0].v, sim.force(sim.model().user[0].v) == 0.0 ? 0.3 : 0.0); }});
  }
  VectorXd run(double t_end = 1.7) {
    sim.run(t_end);
    VectorXd x(sim.model().nq + sim.model().nv);
    x << sim.state().q, sim.state().v;
    return x;
  }
  Simulation sim;
  int arm = 0, drive = 0, shaker = 0;
};

/// One body in a central field. inertia_com is about its only point of interest.
SystemSpec orbit(const std::string& hinge, const Vector3d& inertia, bool gradient) {
  BodySpec s = on(rigid("s", 60.0, Vector3d::Zero(), diagonal(inertia)), "", hinge);
  const bool turns = hinge == "free";
  if (turns)
    s.hinge.q = {1, 0, 0, 0, kRadius, 0, 0}, s.hinge.v = {0, 0, 0, 0, kRadius * kMeanMotion, 0};
  else
    s.hinge.q = {kRadius, 0, 0}, s.hinge.v = {0, kRadius * kMeanMotion, 0};
  return system({s}, central_gravity(kMu, gradient));
}

// ---- the ledger ----

TEST(Ledger, ChangesNoBitOfTheMotion) {
  for (const std::string& method : kMethods) {
    std::vector<VectorXd> end;
    std::vector<IntegratorStatistics> counts;
    for (const bool ledger : {true, false}) {
      SimulationOptions options = by(method);
      options.ledger = ledger;
      Scene scene(options);
      end.push_back(scene.run());
      counts.push_back(scene.sim.statistics());
    }
    EXPECT_TRUE(end[0] == end[1]) << method;
    EXPECT_EQ(counts[0].steps, counts[1].steps) << method;
    const bool steps_over = method.starts_with("cvode") || method == "ida";  // and ends its integrals at the event
    EXPECT_EQ(counts[0].rhs_calls, counts[1].rhs_calls + (steps_over ? 1 : 0)) << method << ": the ledger evaluates no dynamics";
    EXPECT_GT(counts[0].integrand_calls, 0) << method;
    EXPECT_EQ(counts[1].integrand_calls, 0) << method;
  }
}

/// Until a plan unlocks something, say. There are no coordinates then, and what steps them has nothing to divide by.
TEST(Ledger, ClosesWhereEverythingIsLocked) {
  BodySpec held = on(rigid("held", 2.0, {0.1, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {{0, 1, 0}});
  held.hinge.locked = true;
  const auto model = compiled(system({held}, uniform_gravity({0, 0, -10})));
  ASSERT_EQ(model->nv, 0);
  std::vector<std::string> methods = kMethods;
  methods.insert(methods.end(), {"variational", "variational4"});
  for (const std::string& method : methods) {
    SimulationOptions options = by(method);
    if (method.starts_with("variational")) options.integrator.fixed_step = 0.01;
    Simulation sim(model, options);
    sim.run(1.0);
    const LedgerState l = sim.ledger();
    EXPECT_TRUE(l.pass) << method;
    EXPECT_TRUE(std::isfinite(l.linear_limit + l.angular_limit + l.energy_limit)) << method;
    EXPECT_TRUE(std::isfinite(sim.statistics().error_sum)) << method;
  }
}

/// Multistep methods take the rates at the ends of their steps, once.
TEST(Ledger, IsLookedAtOnceInAStepOfCvode) {
  for (const std::string method : {"cvode_adams", "cvode_bdf"}) {
    Scene scene(by(method));
    scene.run();
    const IntegratorStatistics s = scene.sim.statistics();
    EXPECT_LE(s.integrand_calls, s.steps + s.restarts + s.steps / 10) << method;  // and before a Jacobian
  }
}

/// Its own error is below that of the steps: what is left falls with the tolerance, and stays under its limit.
TEST(Ledger, ClosesToTheToleranceWithEveryMethod) {
  for (const std::string& method : kMethods)
    for (const double relative : {1e-6, 1e-9}) {
      Scene scene(by(method, relative, relative == 1e-6 ? 0.02 : 0.005));
      scene.run(8.0);
      const LedgerState l = scene.sim.ledger();
      EXPECT_TRUE(l.pass) << method << render(scene.sim.warnings());
      const double worst = std::max({l.linear_relative, l.angular_relative, l.energy_relative});
      const double most = std::max({l.linear_limit, l.angular_limit, l.energy_limit});
      EXPECT_LT(worst, 2e3 * relative) << method;  // some hundred steps, each within the tolerance
      // exponential, of order 3: ten times the steps, each with its error. dopri5: its steps are long for polynomials through their ends.
      const bool wide = method == "exponential" || method == "dopri5";
      EXPECT_LT(most, method == "rk4" ? 1e-2 : (wide ? 1e6 : 1e5) * relative) << method;
    }
}

TEST(Ledger, ClosesInOrbitWithEveryMethod) {
  const auto model = compiled(orbit("free", {0.4, 100, 100}, true));
  for (const std::string method : {"dopri5", "dop853", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit"}) {
    Simulation sim(model, by(method));
    sim.run(2.0 * M_PI / kMeanMotion);
    const LedgerState l = sim.ledger();
    EXPECT_TRUE(l.pass) << method << render(sim.warnings());
    EXPECT_LT(std::max({l.linear_relative, l.angular_relative, l.energy_relative}), 1e-6) << method;
  }
}

/// A push that no force explains: the verdict says so, once, while the run goes on.
TEST(Ledger, SaysWhenABalanceDoesNotClose) {
  Scene scene(by("dopri5"));
  std::vector<std::string> told;
  scene.sim.on_warning([&](const Warning& w) { told.push_back(render(w)); });
  scene.sim.every({1, 1}, [&] { scene.sim.ledger(); });
  bool pushed = false;
  scene.sim.every({1, 2}, [&] {
    if (scene.sim.time() > 0.4 && !pushed) pushed = true, scene.sim.v(scene.arm) += 1e-3;
  });
  scene.run(3.2);
  EXPECT_FALSE(scene.sim.ledger().pass);
  EXPECT_FALSE(scene.sim.worst_ledger().pass);
  ASSERT_FALSE(told.empty());
  EXPECT_NE(told.front().find("W0402"), std::string::npos) << told.front();
  EXPECT_NE(told.front().find("explain"), std::string::npos) << told.front();
  for (std::size_t i = 1; i < told.size(); ++i) EXPECT_NE(told[i], told[i - 1]);
}

/// Of rk4, which has no estimate of its own, one step of eight is looked at, the first of them: a short run is judged as well.
TEST(Ledger, KnowsWhatTheFirstStepsOfRk4AreOffBy) {
  Scene scene(by("rk4", 1e-9, 0.05), false);
  for (int steps = 1; steps < 10; ++steps) {
    scene.sim.run(0.05 * steps);
    EXPECT_TRUE(scene.sim.ledger().pass) << steps;
  }
}

/// Of a rotor out of balance that nothing accelerates steps are many turns long, and of the force of its bearing nothing is known: that is
/// told, and is no fault.
TEST(Ledger, HasNoVerdictWhereItsLimitIsTheSumItself) {
  for (const auto& [method, relative, rate] :
       {std::tuple{"dopri5", 1e-11, 57.1591864838323}, {"exponential", 1e-6, 23.514357889037875}, {"rk4", 1e-9, 3.0}}) {
    BodySpec rotor = on(rigid("rotor", 2.0, {0.1, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {{0, 0, 1}});
    rotor.hinge.v = {rate};
    Simulation sim(compiled(system({rotor})), by(method, relative, 1e-3));
    sim.every({1, 1}, [&] { sim.ledger(); });
    sim.run(20.0);
    EXPECT_TRUE(sim.worst_ledger().pass) << method;
    EXPECT_TRUE(sim.warnings().all().empty()) << method << render(sim.warnings());
    const std::vector<std::string> undecided = sim.worst_ledger().undecided();
    EXPECT_EQ(undecided, (rate > 10.0 ? std::vector<std::string>{"linear momentum"} : std::vector<std::string>{})) << method;
  }
}

/// The force that a given motion needs works: on its modes as well as on its hinges, and on a mode whose own motion is free it does none.
TEST(Ledger, CountsTheWorkOfModesWhoseMotionIsGiven) {
  BodySpec base = on(rigid("base", 10.0, {0.1, 0, 0}, diagonal({2, 3, 4})), "", "free");
  base.hinge.v = {0.3, -0.2, 0.1, 0.1, 0, 0};
  BodySpec panel;
  panel.name = "panel", panel.type = "modal_flexible", panel.level = 1;
  panel.modal = std::make_shared<const ModalData>(lumped());
  panel.prescribed_modes = {0};
  panel = on(panel, "base", "revolute", {{0, 0.6, 0.8}}, {0.5, 0, 0.2});
  panel.hinge.v = {0.4};
  for (const double relative : {1e-6, 1e-9})
    for (const std::string& method : kMethods) {
      Simulation sim(compiled(system({base, panel})), by(method, relative, relative == 1e-6 ? 0.02 : 0.005));
      const int rate = sim.model().user[1].etadot;
      sim.prescribe(rate, MotionProfile::sine(0.05, 1.3, 0.2));
      const double before = sim.observe().energy().total();
      sim.run(5.0);
      const LedgerState l = sim.ledger();
      EXPECT_TRUE(l.pass) << method << render(sim.warnings());
      EXPECT_LT(std::max({l.linear_relative, l.angular_relative, l.energy_relative}), 2e3 * relative) << method;
      // The balance is none of nothing: the mode puts energy in and takes it out.
      EXPECT_GT(std::abs(sim.observe().energy().total() - before), 1e-3 * before) << method;
    }
}

/// Energies beyond the largest number: there is no residual, and that is no reason to pass.
TEST(Ledger, ThatIsNotANumberDoesNotPass) {
  BodySpec flying = on(particle("flying", 1e10, Eigen::Vector3d::Zero()), "", "translational");
  flying.hinge.v = {1e152, 0, 0};                         // m v^2 overflows, v does not
  Simulation sim(compiled(system({flying})), by("rk4"));  // methods that choose their steps find none
  sim.run(0.1);
  EXPECT_FALSE(sim.ledger().pass);
  EXPECT_FALSE(sim.worst_ledger().pass);
  EXPECT_NE(render(sim.warnings()).find("the residual is not a finite number"), std::string::npos) << render(sim.warnings());
  EXPECT_TRUE(std::isfinite(sim.ledger().energy_relative)) << "summaries hold numbers";
}

TEST(Ledger, OfWhatDoesNotMoveIsZero) {
  SystemSpec spec = base_with_arms();
  for (BodySpec& b : spec.bodies) std::fill(b.hinge.v.begin(), b.hinge.v.end(), 0.0);
  spec.bodies[1].hinge.q = {0.0};  // its spring is relaxed
  for (const std::string& method : kMethods) {
    Simulation sim(compiled(spec), by(method));
    sim.run(2.0);
    const LedgerState l = sim.ledger();
    EXPECT_TRUE(l.pass) << method;
    EXPECT_EQ(l.linear_relative + l.angular_relative + l.energy_relative, 0.0) << method;
  }
}

// ---- steps ----

/// q' = 1/2 q o w, J w' = torque - w x J w, r' = u, u' = pull / m, of a body whose q, r, w, u stand where those of a free hinge do.
OdeProblem by_hand(const Vector3d& J, double mass, bool central, double tolerance) {
  OdeProblem p;
  p.n = 13;
  p.absolute_tolerance.assign(13, tolerance);
  p.rhs = [=](double, const double* x, double* d) {
    const Eigen::Quaterniond q(x[0], x[1], x[2], x[3]);
    const Vector3d r(x[4], x[5], x[6]), w(x[7], x[8], x[9]);
    const Eigen::Quaterniond rate = q * Eigen::Quaterniond(0, 0.5 * w[0], 0.5 * w[1], 0.5 * w[2]);
    d[0] = rate.w(), d[1] = rate.x(), d[2] = rate.y(), d[3] = rate.z();
    Vector3d torque = -w.cross(J.cwiseProduct(w)), pull = Vector3d::Zero();
    if (central) {
      const Eigen::Matrix3d R = q.normalized().toRotationMatrix();
      const Vector3d rb = R.transpose() * r, Jr = R * J.cwiseProduct(rb);
      const double a = r.norm(), a5 = std::pow(a, 5);
      torque += 3.0 * kMu / a5 * rb.cross(J.cwiseProduct(rb));
      pull = -kMu / (a * a * a) * mass * r - 1.5 * kMu / a5 * (J.sum() * r + 2.0 * Jr - 5.0 * r.dot(Jr) / (a * a) * r);
    }
    for (int i = 0; i < 3; ++i) d[4 + i] = x[10 + i], d[7 + i] = torque[i] / J[i], d[10 + i] = pull[i] / mass;
    return true;
  };
  return p;
}

/// Steps that a method takes of the same motion by hand, from the simulation's state to t_end.
long steps_by_hand(const Simulation& sim, const Vector3d& J, bool central, const IntegratorOptions& options, double t_end) {
  auto integrator = make_integrator(by_hand(J, 60.0, central, options.relative_tolerance), options);
  VectorXd x = VectorXd::Zero(13);
  const int nq = sim.model().nq;
  if (nq == 4) {
    x.head(4) = sim.state().q, x.segment(7, 3) = sim.state().v;
  } else if (nq == 3) {
    x[0] = 1.0, x.segment(4, 3) = sim.state().q, x.tail(3) = sim.state().v;
  } else {
    x.head(7) = sim.state().q, x.tail(6) = sim.state().v;
  }
  integrator->restart(0.0, x.data());
  for (double t = 0.0; t < t_end;) t = integrator->step(t_end, x.data()).t;
  return integrator->statistics().steps;
}

/// Neither the ledger nor the norm of quaternions costs steps: orbits of a body at rest and of a librating stick, and a body that
/// turns slowly, against the closed form. 1.5: the norm of the error test is over 6 or 7 states in place of 13 in some.
TEST(Steps, AreThoseOfTheEquationsOfMotion) {
  const double turn = M_PI / 180.0;
  SystemSpec stick = orbit("free", {0.4, 100, 100}, true);
  stick.bodies[0].hinge.q[0] = std::cos(turn / 2), stick.bodies[0].hinge.q[3] = std::sin(turn / 2);
  stick.bodies[0].hinge.v[2] = kMeanMotion;
  BodySpec slow = on(rigid("s", 60.0, Vector3d::Zero(), diagonal({100, 100, 100})), "", "ball");
  slow.hinge.v = {0, 0, 1e-3};
  struct Case {
    const char* name;
    SystemSpec spec;
    Vector3d J;
    bool central;
    double t_end;
  };
  const double day = 10.0 * 2.0 * M_PI / kMeanMotion;
  for (const Case& c :
       {Case{"orbit, translational", orbit("translational", {100, 100, 100}, false), {100, 100, 100}, true, day},
        Case{"orbit, free", orbit("free", {100, 100, 100}, false), {100, 100, 100}, true, day},
        Case{"libration", stick, {0.4, 100, 100}, true, day}, Case{"slow turn", system({slow}), {100, 100, 100}, false, 56770.0}})
    for (const std::string method : {"dopri5", "dop853", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit"})
      for (const double relative : {1e-6, 1e-9}) {
        const SimulationOptions options = by(method, relative);
        Simulation sim(compiled(c.spec), options);
        const long by_hand = steps_by_hand(sim, c.J, c.central, options.integrator, c.t_end);
        sim.run(c.t_end);
        fmt::print("{:<21} {:<12} {:>6.0e} {:>7} steps, by hand {:>7} {:>8} calls\n", c.name, method, relative, sim.statistics().steps,
                   by_hand, sim.statistics().rhs_calls);
        EXPECT_LE(static_cast<double>(sim.statistics().steps), 1.5 * static_cast<double>(by_hand))
            << c.name << ", " << method << ", " << relative;
      }
}

/// However far the history drifts off the unit sphere, what is handed out is on it and the attitude is right.
TEST(Steps, QuaternionsStayOnTheSphere) {
  BodySpec body = on(rigid("s", 1.0, Vector3d::Zero(), diagonal({1, 1, 1})), "", "ball");
  body.hinge.v = {0, 0, 1.0};
  for (const std::string method : {"dopri5", "dop853", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit"}) {
    Simulation sim(compiled(system({body})), by(method, 1e-4));
    sim.run(2000.0);
    EXPECT_NEAR(sim.state().q.norm(), 1.0, 1e-15) << method;
    EXPECT_NEAR(sim.state().v[2], 1.0, 1e-9) << method;
  }
}

// ---- corners, ticks, events ----

double error_of(const SimulationOptions& options) {
  static const VectorXd truth = Scene(by("dopri5", 1e-13)).run();
  return (Scene(options).run() - truth).cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
}

TEST(Corners, LeaveRk4ItsOrder) {
  const double coarse = error_of(by("rk4", 1e-9, 0.02)), fine = error_of(by("rk4", 1e-9, 0.01));
  EXPECT_NEAR(std::log2(coarse / fine), 4.0, 0.3) << coarse << " " << fine;
  EXPECT_LT(fine, 1e-7);
}

TEST(Corners, LeaveDopri5ItsOrder) {
  const auto equal_steps = [](double h) {
    SimulationOptions o = by("dopri5", 0.5);
    o.absolute_tolerance = 1.0;  // never rejects
    o.integrator.max_step = o.integrator.initial_step = h;
    return o;
  };
  const double coarse = error_of(equal_steps(0.04)), fine = error_of(equal_steps(0.02));
  EXPECT_NEAR(std::log2(coarse / fine), 5.0, 0.5) << coarse << " " << fine;
}

/// Three digits of the tolerance are two of the error at least; 1e4: some hundred steps after some twenty starts at order one.
TEST(Corners, LeaveErrorsThatFollowTheTolerance) {
  for (const std::string method : {"dopri5", "dop853", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit"}) {
    const double coarse = error_of(by(method, 1e-6)), fine = error_of(by(method, 1e-9));
    EXPECT_LT(fine, 1e-2 * coarse) << method;
    EXPECT_LT(fine, 1e4 * 1e-9) << method;
  }
}

TEST(Corners, PrescribedCoordinatesFollowTheirProfiles) {
  for (const std::string& method : kMethods) {
    Scene scene(by(method, 1e-3, 0.1));
    scene.run(1.7);
    const State& s = scene.sim.state();
    // 0.2, and the area below the straight lines up to 1.43 s, then 0.3 rad/s
    const double area = 0.5 * 1.1 * 0.44 + 0.5 * (1.1 - 0.4) * 0.44 + 0.5 * (-0.4 + 0.3) * 0.42 + 0.3 * 0.27;
    EXPECT_NEAR(s.q[scene.sim.model().user[2].q], 0.2 + area, 1e-14) << method;
    EXPECT_EQ(s.v[scene.drive], 0.3) << method;
    const double w = 2.0 * M_PI * 0.8;
    EXPECT_NEAR(s.q[scene.sim.model().user[3].q], 0.2 * (std::sin(w * 1.7 + 0.3) - std::sin(0.3)), 1e-14) << method;
    EXPECT_NEAR(s.v[scene.shaker], 0.2 * w * std::cos(w * 1.7 + 0.3), 1e-14) << method;
  }
}

TEST(Corners, AccelerationIsThatOfTheStretch) {
  const MotionProfile p = MotionProfile::rate_table({{1.0, 0.0}, {2.0, 3.0}, {4.0, 3.0}});
  EXPECT_EQ(p.acceleration(2.0, 1.5), 3.0);
  EXPECT_EQ(p.acceleration(2.0, 2.0), 0.0);
  EXPECT_EQ(p.acceleration(1.0, 0.5), 0.0);
  EXPECT_NEAR(p.travel(0.0, 5.0), 1.5 + 6.0 + 3.0, 1e-15);
  EXPECT_NEAR(p.travel(1.5, 2.5), 0.5 * (1.5 + 3.0) * 0.5 + 1.5, 1e-15);
}

// A drive that holds an arm against its spring gives what the spring pulls; one on a coupling as well, what the coupled wheel needs.
TEST(Prescribed, ADriveGivesWhatTheMotionNeedsBesideSpringsAndCouplings) {
  BodySpec arm = on(rigid("arm", 2.0, {1, 0, 0}, diagonal({0.1, 0.1, 0.1})), "", "revolute", {{0, 0, 1}});
  arm.hinge.prescribed = {0};
  SpringDamper spring;
  spring.stiffness = 50.0, spring.damping = 3.0, spring.rest = 1.0;
  arm.hinge.springs = {spring};
  const BodySpec wheel = on(rigid("wheel", 1.0, {0, 0, 0}, diagonal({0.3, 0.3, 0.5})), "", "revolute", {{0, 0, 1}});
  LoopSpec gear;
  gear.name = "gear", gear.type = "coupling", gear.terms = {{"arm", 2.0, {}}, {"wheel", -1.0, {}}};
  for (const LoopForm form : {LoopForm::multipliers, LoopForm::embedding, LoopForm::dae})
    for (const bool coupled : {false, true}) {
      SystemSpec spec = system({arm, wheel});
      spec.loop_form = form;
      if (coupled) spec.loops = {gear};
      Simulation sim(compiled(spec), by(coupled && form == LoopForm::dae ? "ida" : "dopri5"));
      sim.prescribe(0, MotionProfile::rate_table({{0.0, 0.0}, {1.0, 0.8}}));
      sim.run(0.5);
      const double acceleration = 0.8, inertia = 0.1 + 2.0 + (coupled ? 4.0 * 0.5 : 0.0);
      double drive[2];
      sim.drive_forces(drive);
      EXPECT_NEAR(drive[0], inertia * acceleration + 50.0 * (sim.state().q[0] - 1.0) + 3.0 * 0.4, 1e-8);
      EXPECT_EQ(drive[1], 0.0);
    }
}

/// Two wheels at rest, and 2 a - b given as t/5 + t^2/2, a blow first: 2 L and -L turn them.
TEST(Prescribed, APhaseTurnsWhatItCouplesInAllForms) {
  const BodySpec a = on(rigid("a", 1.0, {0, 0, 0}, diagonal({0.2, 0.2, 0.3})), "", "revolute", {{0, 0, 1}});
  const BodySpec b = on(rigid("b", 1.0, {0, 0, 0}, diagonal({0.3, 0.3, 0.5})), "", "revolute", {{0, 0, 1}});
  LoopSpec phase;
  phase.name = "phase", phase.type = "coupling", phase.terms = {{"a", 2.0, {}}, {"b", -1.0, {}}}, phase.prescribed = true;
  for (const LoopForm form : {LoopForm::multipliers, LoopForm::embedding, LoopForm::dae}) {
    SystemSpec spec = system({a, b});
    spec.loop_form = form, spec.loops = {phase};
    Simulation sim(compiled(spec), by(form == LoopForm::dae ? "ida" : "dopri5"));
    sim.prescribe_loop("phase", MotionProfile::rate_table({{0.0, 0.2}, {1.0, 1.2}}));
    sim.run(0.5);
    const double L = 0.7 / (4.0 / 0.3 + 1.0 / 0.5);
    EXPECT_NEAR(sim.state().v[0], 2.0 * L / 0.3, 1e-8);
    EXPECT_NEAR(sim.state().v[1], -L / 0.5, 1e-8);
    EXPECT_NEAR(2.0 * sim.state().q[0] - sim.state().q[1], 0.225, 1e-8);
  }
}

TEST(Prescribed, AComponentThatIsFreeIsRefused) {
  Scene scene(by("dopri5"));
  try {
    scene.sim.prescribe(scene.arm, MotionProfile::hold(1.0));
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics().front().code, Code::bad_initial_state);
    EXPECT_NE(e.diagnostics().front().at.key_path.find("arm."), std::string::npos);
  }
}

TEST(Prescribed, AnInitialRateThatTheProfileDoesNotHaveIsSaid) {
  SystemSpec spec = base_with_arms();
  spec.bodies[2].hinge.v = {0.7};
  Simulation sim(compiled(spec), by("dopri5"));
  sim.prescribe(sim.model().user[2].v, MotionProfile::rate_table(kCorners));
  sim.run(0.2);
  ASSERT_EQ(sim.warnings().all().size(), 1u) << render(sim.warnings());
  EXPECT_EQ(sim.warnings().all()[0].what.code, Code::mission_doubt);
  EXPECT_NE(sim.warnings().all()[0].what.about.find("0.7"), std::string::npos);
}

/// What a rate that jumps in the run brings in is said once, and is no error of the steps: balances close, of what follows in loops too.
TEST(Prescribed, ARateThatJumpsIsSaidOnce) {
  BodySpec arm = on(rigid("arm", 10.0, {0.5, 0, 0}, diagonal({1, 2, 2})), "", "revolute", {{0, 0, 1}});
  arm.hinge.v = {0.2};
  const BodySpec tip = on(rigid("tip", 2.0, {0.2, 0, 0}, diagonal({0.1, 0.1, 0.1})), "arm", "revolute", {{0, 0, 1}}, {1, 0, 0});
  for (SystemSpec spec : {system({arm, tip}, uniform_gravity({0, -9.81, 0})), four_bar("point", 0.2)}) {
    spec.bodies[0].hinge.prescribed = {0};
    Simulation sim(compiled(spec), by("dopri5"));
    sim.run(0.5);
    sim.prescribe(0, MotionProfile::hold(0.9));
    sim.run(1.0);
    EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
    ASSERT_EQ(sim.warnings().all().size(), 1u) << render(sim.warnings());
    EXPECT_EQ(sim.warnings().all()[0].what.code, Code::mission_doubt);
  }
}

/// Rates that a controller computes for what is to rest are rounding, and no jumps.
TEST(Prescribed, ARateOfRoundingIsNoJump) {
  BodySpec arm = on(rigid("arm", 10.0, {0.5, 0, 0}, diagonal({1, 2, 2})), "", "revolute", {{0, 0, 1}});
  arm.hinge.prescribed = {0};
  for (const double rate : {-2.9e-19, 1e-9}) {
    Simulation sim(compiled(system({arm})), by("dopri5"));
    sim.prescribe(0, MotionProfile::hold(0.0));
    sim.run(0.1);
    sim.prescribe(0, MotionProfile::hold(rate));
    sim.run(0.2);
    EXPECT_EQ(sim.warnings().empty(), rate < 0.0) << render(sim.warnings());
    EXPECT_EQ(sim.state().v[0], rate);
  }
}

/// From rest the rate of a given hinge in a loop is a blow where masses say what follows, and told; where it leaves nothing free it is no
/// question, nor is it where others begin with rates that go with it.
TEST(Prescribed, ARateFromRestInALoopIsToldToBeABlow) {
  const auto told = [](double follows) {
    const BodySpec base = on(rigid("base", 5.0, {0.1, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {{0, 0, 1}});
    BodySpec crank = on(rigid("crank", 1.0, {0.1, 0, 0}, diagonal({0.1, 0.1, 0.1})), "base", "revolute", {{0, 0, 1}});
    BodySpec drum = crank;
    crank.hinge.prescribed = {0}, crank.hinge.v = {0.5 * follows};
    drum.name = "drum", drum.hinge.v = {follows};
    SystemSpec spec = system({base, crank, drum});
    LoopSpec gear;
    gear.name = "gear", gear.type = "coupling", gear.terms = {{"crank", 2.0, {}}, {"drum", -1.0, {}}};
    spec.loops = {gear};
    Simulation sim(compiled(spec), by("dopri5"));
    sim.prescribe(1, MotionProfile::hold(0.9));
    sim.run(0.1);
    return render(sim.warnings());
  };
  for (const char* part : {"profile of crank.rate at the start", "it begins with 0.9"})
    EXPECT_NE(told(0.0).find(part), std::string::npos) << told(0.0);
  EXPECT_EQ(told(1.8), "");
  SystemSpec spec = four_bar("point", 0.0);
  spec.bodies[0].hinge.prescribed = {0};
  for (BodySpec& b : spec.bodies) b.hinge.v.clear();
  Simulation determined(compiled(spec), by("dopri5"));
  determined.prescribe(0, MotionProfile::hold(0.9));
  determined.run(0.1);
  EXPECT_TRUE(determined.warnings().empty()) << render(determined.warnings());
}

// ---- runs that do not end ----

/// A bar on a sprung and damped hinge, 2 kg m^2 about its axis.
SystemSpec sprung_bar(double stiffness, double damping) {
  BodySpec bar = on(rigid("bar", 6.0, {0.5, 0, 0}, diagonal({0.1, 0.5, 0.5})), "", "revolute", {{0, 0, 1}});
  bar.hinge.q = {0.1};
  SpringDamper spring;
  spring.stiffness = stiffness, spring.damping = damping;
  bar.hinge.springs = {spring};
  return system({bar});
}

TEST(FastestMotion, IsThatOfTheSpringOrTheDamper) {
  const double q = 0.1;
  const FastestMotion swings = fastest_motion(compiled(sprung_bar(800.0, 2.0)), &q);
  EXPECT_NEAR(swings.rate, 20.0, 1e-9);
  EXPECT_FALSE(swings.decays);
  EXPECT_EQ(swings.what.find("the spring of bar."), 0u) << swings.what;
  const FastestMotion decays = fastest_motion(compiled(sprung_bar(800.0, 200.0)), &q);
  EXPECT_NEAR(decays.rate, 100.0, 1e-9);
  EXPECT_TRUE(decays.decays);
  EXPECT_EQ(decays.what.find("the damper of bar."), 0u) << decays.what;
}

/// Of a damper at 281 1/s beside a mode at 282 rad/s it is the slower one that rk4 with steps of 10 ms does not stand (2.785 and 2.828
/// times 100): 1 / 281 of a turn became 1e13, and nothing was told of.
TEST(FastestMotion, ASlowerOneThatAsksForShorterStepsIsToldOf) {
  SystemSpec spec = sprung_bar(0.0, 2.0 * 281.0);
  spec.bodies[0].hinge.v = {1.0};
  spec.bodies.push_back(sprung_bar(2.0 * 282.0 * 282.0, 0.0).bodies[0]);
  spec.bodies[1].name = "other", spec.bodies[1].hinge.q = {0.0};
  const auto model = compiled(spec);
  Simulation sim(model, by("rk4", 1e-9, 0.01));
  sim.run(10.0);
  EXPECT_GT(std::abs(sim.state().q[0]), 1e3);
  ASSERT_EQ(sim.warnings().all().size(), 1u);
  EXPECT_EQ(sim.warnings().all()[0].what.code, Code::stiff_scene);
  EXPECT_NE(sim.warnings().all()[0].what.about.find("the damper of bar."), std::string::npos) << sim.warnings().all()[0].what.about;
  // A million steps for what decays are many, for what swings they are not.
  const Warnings adaptive = expected_stiffness(model, model->initial_state().q.data(), by("dopri5", 1e-9).integrator, 1.0, 1.3e4);
  ASSERT_EQ(adaptive.all().size(), 1u);
  EXPECT_NE(adaptive.all()[0].what.about.find("the damper of bar."), std::string::npos) << adaptive.all()[0].what.about;
  // The text is kept where the run is resumed, perhaps to another end: it says of which one it tells.
  EXPECT_NE(adaptive.all()[0].what.about.find("of them in 13000 s"), std::string::npos) << adaptive.all()[0].what.about;
}

// A body that turns through the lock of its gimbals at a distance e: their rates are 1/e times as fast as it turns, and steps e times as
// long. Through the lock itself, about the one axis, nothing whirls.
TEST(WhirlingHinge, IsToldOfGimbalsNearTheirLockAlone) {
  const auto warned = [](const std::string& type, double e, HingeFactor factor = HingeFactor::cholesky) {
    const std::vector<Eigen::Vector3d> axes{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    BodySpec body = on(rigid("top", 1.0, {0, 0, 0}, diagonal({1, 2, 3})), "", type, type == "gimbal" ? axes : decltype(axes){});
    body.hinge.v = {e, 1.0, 0.0}, body.hinge.factor = factor;
    Simulation sim(compiled(system({body})), {});
    sim.run(3.0);
    return render(sim.warnings());
  };
  const std::string told = warned("gimbal", 1e-5);
  EXPECT_NE(told.find("warning[W0308]"), std::string::npos) << told;
  EXPECT_NE(told.find("the rates of the hinge of top are"), std::string::npos) << told;
  EXPECT_NE(told.find("type ball"), std::string::npos) << told;
  EXPECT_EQ(told.find("times\n"), std::string::npos) << "once";
  for (const double e : {0.0, 0.1, 1e-2}) EXPECT_EQ(warned("gimbal", e), "") << e;
  EXPECT_EQ(warned("ball", 1e-5), "");
  EXPECT_EQ(warned("gimbal", 1e-5, HingeFactor::square_root), "");
  // Two axes keep the angle between them: how small it is was chosen.
  BodySpec cross = on(rigid("cross", 1.0, {0, 0, 0}, diagonal({1, 2, 3})), "", "universal", {{1, 0, 0}, {1, 1e-4, 0}});
  cross.hinge.v = {1.0, -1.0};
  Simulation sim(compiled(system({cross})), {});
  sim.run(0.1);
  EXPECT_EQ(render(sim.warnings()), "");
}

TEST(FastestMotion, IsThatOfTheModesOrTheirDamping) {
  BodySpec boom = on(BodySpec{}, "", "locked");
  boom.name = "boom", boom.type = "modal_flexible";
  ModalData modal = lumped();
  const auto largest_of = [&modal](const Eigen::MatrixXd& A) { return largest(*generalised_eigenvalues(A, modal.integrals.I6)); };
  for (const double times : {0.1, 10.0}) {  // damping that does not count, and one that does
    modal.C = times * modal.K;
    boom.modal = std::make_shared<const ModalData>(modal);
    const auto model = compiled(system({boom}));
    const FastestMotion fastest = fastest_motion(model, model->initial_state().q.data());
    EXPECT_EQ(fastest.decays, times > 1.0);
    const double rate = times > 1.0 ? largest_of(modal.C) : std::sqrt(largest_of(modal.K));
    EXPECT_NEAR(fastest.rate, rate, 1e-3 * rate);  // twenty steps of the power iteration
  }
}

// A gear of 2 makes 2 + 4 x 0.5 kg m^2 of both, and holds a shaft that no spring is on; the open tree has 20 rad/s and 0.
TEST(FastestMotion, OfClosedLoopsIsThatOfTheMotionsThatTheyAllow) {
  SystemSpec spec = sprung_bar(800.0, 200.0);
  spec.bodies.push_back(on(rigid("shaft", 1.0, {0, 0, 0}, diagonal({0.3, 0.3, 0.5})), "", "revolute", {{0, 0, 1}}));
  spec.bodies[1].hinge.q = {0.2};
  LoopSpec gear;
  gear.name = "gear", gear.type = "coupling", gear.terms = {{"bar", 2.0, {}}, {"shaft", -1.0, {}}};
  spec.loops = {gear};
  const double q[] = {0.1, 0.2};
  const FastestMotion decays = fastest_motion(compiled(spec), q);
  EXPECT_NEAR(decays.rate, 200.0 / 4.0, 1e-9);
  EXPECT_TRUE(decays.decays);
  spec.bodies[0].hinge.springs[0].damping = 0.0;
  const FastestMotion swings = fastest_motion(compiled(spec), q);
  EXPECT_NEAR(swings.rate, std::sqrt(800.0 / 4.0), 1e-9);
  EXPECT_EQ(swings.what.find("the spring of bar."), 0u) << swings.what;
  SimulationOptions options = by("rk4", 1e-9, 0.21);
  Simulation sim(compiled(spec), options);
  sim.run(0.42);
  ASSERT_EQ(sim.warnings().all().size(), 1u) << "2 sqrt(2) / 14.1 = 0.2 s";
  EXPECT_EQ(sim.warnings().all()[0].what.code, Code::stiff_scene);
}

TEST(Stiffness, IsSaidBeforeTheFirstStep) {
  for (const std::string method : {"dopri5", "cvode_adams"}) {
    Simulation sim(compiled(sprung_bar(1e12, 1e9)), by(method));
    std::string told;
    sim.on_warning([&](const Warning& w) { told += render(w); });
    sim.run(2.0, [&](double) { sim.stop(); });
    EXPECT_EQ(sim.statistics().steps, 1);
    for (const char* part : {"W0401", "the damper of bar.", "5e+08 1/s", "cvode_bdf"})
      EXPECT_NE(told.find(part), std::string::npos) << part << "\n" << told;
  }
  for (const auto& [method, many] : {std::pair("dopri5", true), {"dop853", false}}) {  // 4.5e6 1/s: steps of 3.3 and of 6.1 over that
    Simulation sim(compiled(sprung_bar(800.0, 9e6)), by(method));
    sim.run(1.0, [&](double) { sim.stop(); });
    EXPECT_EQ(!sim.warnings().empty(), many) << render(sim.warnings());
  }
  Simulation calm(compiled(sprung_bar(800.0, 2.0)), by("dopri5"));
  calm.run(2.0);
  EXPECT_TRUE(calm.warnings().empty()) << render(calm.warnings());
}

/// A run that ended early says nothing of steps that it never took; one that goes on from there takes them.
TEST(Stiffness, IsSaidOfARunThatIsResumed) {
  for (const double first : {1e-3, 2.0}) {  // the second knew already
    Simulation sim(compiled(sprung_bar(1e12, 1e9)), by("dopri5"));
    sim.run(first, [&](double) { sim.stop(); });
    EXPECT_EQ(sim.warnings().empty(), first < 1.0) << render(sim.warnings());
    Simulation further(compiled(sprung_bar(1e12, 1e9)), by("dopri5"));
    further.resume(sim.checkpoint());
    further.run(2.0, [&](double) { further.stop(); });
    ASSERT_EQ(further.warnings().all().size(), 1u) << render(further.warnings());
    EXPECT_EQ(further.warnings().all()[0].what.code, Code::stiff_scene);
    EXPECT_EQ(further.warnings().all()[0].count, 1);
  }
}

TEST(Stiffness, StepsOfRk4BeyondItsStabilityAreSaid) {
  Simulation sim(compiled(sprung_bar(800.0, 2.0)), by("rk4", 1e-9, 0.2));
  sim.run(0.2);
  ASSERT_FALSE(sim.warnings().empty());
  EXPECT_NE(sim.warnings().all()[0].what.about.find("unstable with steps above 0.141 s"), std::string::npos)
      << sim.warnings().all()[0].what.about;
}

/// A stop that sends what arrives back by next to nothing.
TEST(Events, ThatFollowEachOtherWithoutProgressEndTheRun) {
  Simulation sim(compiled(sprung_bar(0.0, 0.0)), by("dopri5"));
  sim.q(0) = -1.0, sim.v(0) = 1.0;
  sim.add_event({"at the stop", [](double, const double* q, const double*) { return q[0]; }, +1, [&] { sim.q(0) = -1e-10; }});
  try {
    sim.run(10.0);
    FAIL() << "ended at " << sim.time();
  } catch (const NumericsError& e) {
    EXPECT_EQ(e.failure().code, Code::event_storm);
    EXPECT_NE(e.failure().what.find("\"at the stop\""), std::string::npos) << e.failure().what;
    EXPECT_NEAR(e.failure().t, 1.0, 1e-6);
  }
}

TEST(Progress, TimeThatDoesNotAdvanceEndsTheRun) {
  SimulationOptions options = by("dopri5");
  options.integrator.max_step = 1e-12;
  Simulation sim(compiled(sprung_bar(1.0, 0.0)), options);
  try {
    sim.run(100.0);
    FAIL();
  } catch (const NumericsError& e) {
    EXPECT_EQ(e.failure().code, Code::step_too_small);
    EXPECT_NE(e.failure().what.find("does not advance"), std::string::npos) << e.failure().what;
  }
}

TEST(Progress, TolerancesOfAKindAreThoseOfItsStates) {
  std::vector<BodySpec> bodies = base_with_sprung_arm();
  bodies.push_back(on(rigid("cart", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "base", "prismatic", {{0, 0, 1}}));
  BodySpec boom = on(BodySpec(), "base", "locked", {}, {0, 0.4, 0});
  boom.name = "boom", boom.type = "modal_flexible", boom.level = 0;
  boom.modal = std::make_shared<const ModalData>(lumped());
  bodies.push_back(boom);
  SimulationOptions options = by("dopri5", 1e-6);
  options.tolerances = {.angle = 2e-8, .position = 3e-5, .rate = 5e-8, .velocity = 7e-5};
  const auto tolerances = [&] {
    Simulation sim(compiled(system(bodies)), options);
    return sim.absolute_tolerances();
  };
  Simulation sim(compiled(system(bodies)), options);
  const Model& m = sim.model();
  const std::vector<double> all = tolerances();
  const auto q = [&](int i) { return all[static_cast<std::size_t>(i)]; };
  const auto v = [&](int i) { return all[static_cast<std::size_t>(m.nq + i)]; };
  const UserBody &base = m.user[0], &arm = m.user[1], &cart = m.user[2], &flexible = m.user[3];
  EXPECT_EQ(q(base.q), 1e-8) << "half an angle";
  EXPECT_EQ(q(base.q + 4), 3e-5);
  EXPECT_EQ(v(base.v), 5e-8);
  EXPECT_EQ(v(base.v + 3), 7e-5);
  EXPECT_EQ(q(arm.q), 2e-8);
  EXPECT_EQ(q(cart.q), 3e-5);
  EXPECT_EQ(v(cart.v), 7e-5);
  const double of_mode = q(flexible.eta);
  options.tolerances.modes = 1e-4;
  EXPECT_NEAR(tolerances()[static_cast<std::size_t>(flexible.eta)], 100.0 * of_mode, 1e-12 * of_mode);
}

TEST(Progress, AbsoluteTolerancesAreLookedAt) {
  for (const double absolute : {-1.0, 1e300, std::nan("")}) {
    SimulationOptions options = by("dopri5");
    options.absolute_tolerance = absolute;
    Simulation sim(compiled(sprung_bar(1.0, 0.0)), options);
    EXPECT_THROW(sim.run(1.0), InputError) << absolute;
  }
  for (const double angle : {-1e-9, HUGE_VAL, std::nan("")}) {
    SimulationOptions options = by("dopri5");
    options.tolerances.angle = angle;
    Simulation sim(compiled(sprung_bar(1.0, 0.0)), options);
    EXPECT_THROW(sim.run(1.0), InputError) << angle;
  }
}

TEST(MotionProfiles, OfFrequencyZeroStandStill) {
  const MotionProfile still = MotionProfile::sine(0.2, 0.0, 0.3);
  EXPECT_EQ(still.travel(0.5, 2.0), 0.0);
  EXPECT_EQ(still.rate(1.0), 0.0);
}

TEST(MotionProfiles, TravelBackWhatTheyTravelled) {
  for (const MotionProfile& p : {MotionProfile::rate_table({{0.0, 1.0}, {1.0, 3.0}, {2.0, -1.0}}), MotionProfile::sine(0.2, 0.7, 0.3)}) {
    EXPECT_GT(std::abs(p.travel(0.3, 1.6)), 0.01);
    EXPECT_EQ(p.travel(1.6, 0.3), -p.travel(0.3, 1.6));
  }
}

TEST(MotionProfiles, AreHeldBeforeAndBehindTheirPoints) {
  const MotionProfile p = MotionProfile::rate_table({{1.0, 2.0}, {2.0, -3.0}, {3.0, 0.5}});
  EXPECT_EQ(p.rate(0.4), 2.0);
  EXPECT_EQ(p.rate(3.7), 0.5);
  EXPECT_EQ(p.acceleration(0.4, 0.4), 0.0);
  EXPECT_NEAR(p.travel(0.0, 1.0), 2.0, 1e-15);
  EXPECT_NEAR(p.travel(3.0, 5.0), 1.0, 1e-15);
  EXPECT_EQ(p.largest_rate(0.2, 1.2), 2.0);           // the point at 2 s is beyond
  EXPECT_NEAR(p.largest_rate(1.5, 1.9), 2.5, 1e-15);  // at its end
  EXPECT_EQ(p.largest_rate(1.5, 2.5), 3.0);           // in its midst
  EXPECT_EQ(p.largest_rate(3.0, 4.0), 0.5);           // those before are over
}

}  // namespace
}  // namespace cardan::test
