// Closed loops: what does not honour them says so, what is open or contradicts is told, and so are singular postures.
#include "core/dynamics/loops.hpp"

#include <algorithm>
#include <numbers>
#include <tuple>

#include "core/dynamics/batch.hpp"
#include "core/model/embedding.hpp"
#include "core/operators/closed_system.hpp"
#include "core/operators/linear_model.hpp"
#include "core/operators/sensitivity.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/closed_mechanisms.hpp"
#include "tests/properties/forms_of_loops.hpp"
#include "tests/support/four_bar.hpp"

namespace cardan::test {
namespace {

TEST(Loops, AreRefusedByNameWhereTheyAreNotHonoured) {
  const auto model = compiled(four_bar());
  const VectorXd q = model->initial_state().q, v = model->initial_state().v;
  Workspace ws(*model);
  VectorXd out(model->nv);
  const auto refused = [](const std::string& what, const auto& work) {
    try {
      work();
      ADD_FAILURE() << what << " took a vehicle with loops";
    } catch (const InputError& e) {
      EXPECT_EQ(e.diagnostics().front().code, Code::unsupported) << what;
      EXPECT_EQ(e.diagnostics().front().got, "loops: pivot") << what;
      EXPECT_NE(e.diagnostics().front().expected.find("an open tree: " + what), std::string::npos) << e.what();
    }
  };
  const Inputs in{.q = q.data(), .v = v.data()};
  refused("spatial operators", [&] { operators::TreeOperators tree(model); });
  refused("sensitivities", [&] { operators::Sensitivities s(model); });
  refused("batches of states", [&] { Batch batch(*model); });
  refused("inverse dynamics", [&] { inverse_dynamics(*model, ws, in, out.data()); });
  refused("mass matrices", [&] { mass_matrix(*model, ws, q.data()); });
  refused("inverse mass matrices", [&] { mass_matrix_inverse(*model, ws, q.data(), MatrixXd(3, 3).data()); });
  SimulationOptions krylov;
  krylov.integrator.method = "cvode_bdf", krylov.integrator.linear_solver = "krylov";
  refused("Newton's equations by linear_solver krylov", [&] { Simulation(model, krylov).run(0.1); });
}

template <class Work>
std::string told(const Work& work) {
  try {
    work();
  } catch (const std::exception& e) {
    return e.what();
  }
  return "nothing";
}

TEST(Loops, AnOpenStartIsToldRowByRow) {
  SystemSpec open = four_bar();
  open.loops[0].from.position = {0.5, 0.01, 0};
  EXPECT_EQ(
      told([&] { compiled(open); }),
      "error[C1103]: a loop is not closed at the start\n"
      "  at: loops.pivot\n"
      "  expected: initial coordinates that close it\n"
      "  got:      pivot: row 2, along y -0.01 m\n"
      "  hint:     give `initial` of the hinges between its ends the values that bring them together, or none: they are found then\n\n"
      "1 error. Nothing was run.\n");
  SystemSpec moving = four_bar();
  moving.bodies[0].hinge.v = {2.5};
  EXPECT_EQ(told([&] { compiled(moving); }),
            "error[C1103]: a loop is not closed at the start\n"
            "  at: loops.pivot\n"
            "  expected: initial rates that keep it closed\n"
            "  got:      pivot: row 2, along y 0.25 m/s\n"
            "  hint:     give `initial` of the hinges rates that move both ends alike, or none: they are found then; where other rows "
            "should imply these, places or axes are off by more than 1e-4 of the loop\n\n"
            "1 error. Nothing was run.\n");
}

// Both ends stand on the hinges of their bodies, 7000 km from home: that way is no size of the loop, by which it would be closed within
// metres and each row lie near nothing.
TEST(Loops, InOrbitAreMeasuredByThemselves) {
  const auto two = [](const char* type, double length, double more, double rate, bool slide) {
    const auto flying = [](BodySpec b, const char* hinge, double away, double speed) {
      b = on(b, "", hinge);
      if (std::string(hinge) == "free") b.hinge.q = {1, 0, 0, 0, away, 0, 0}, b.hinge.v = {0, 0, 0, speed, 7600, 0};
      if (std::string(hinge) == "translational") b.hinge.q = {away, 0, 0}, b.hinge.v = {speed, 7600, 0};
      return b;
    };
    const bool is_point = slide || length > 0.0;
    SystemSpec spec = system({slide ? flying(particle("bus", 400.0, {0, 0, 0}), "translational", 7e6, 0.0)
                                    : flying(rigid("bus", 400.0, {0, 0, 0}, diagonal({50, 60, 70})), "free", 7e6, 0.0),
                              flying(is_point ? particle("other", 100.0, {0, 0, 0}) : rigid("other", 100.0, {0, 0, 0}, diagonal({5, 6, 7})),
                                     is_point ? "translational" : "free", 7e6 + length + more, rate)});
    LoopSpec tether;
    tether.name = "tether", tether.type = type, tether.length = length, tether.from.body = "bus", tether.to.body = "other";
    spec.loops = {tether};
    return spec;
  };
  for (const auto& [type, length, slide] :
       {std::tuple("distance", 50.0, false), std::tuple("distance", 5000.0, false), std::tuple("point", 0.0, false),
        std::tuple("weld", 0.0, false), std::tuple("distance", 50.0, true), std::tuple("point", 0.0, true)}) {
    SCOPED_TRACE(std::string(type) + " " + std::to_string(length) + (slide ? " of particles" : ""));
    const SystemSpec apart = two(type, length, 0.1, 0.0, slide), parting = two(type, length, 0.0, 0.1, slide);
    EXPECT_NE(told([&] { compiled(apart); }).find("0.1 m\n"), std::string::npos);
    EXPECT_NE(told([&] { compiled(parting); }).find("0.1 m/s\n"), std::string::npos);
    Simulation closed(compiled(two(type, length, 0.0, 0.0, slide)), {});
    closed.run(1.0);
    EXPECT_TRUE(std::ranges::none_of(closed.warnings().all(), [](const auto& w) { return w.what.code == Code::near_singular; }))
        << render(closed.warnings());
  }
}

// A parallelogram loses a row where its links are in line: there pivots and singular values go to zero with the angle.
TEST(Loops, NearASingularPostureIsTold) {
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
    const auto at = [&](double angle, double rate) {
      SystemSpec spec = touching_four_bars(1, angle, rate);
      spec.gravity = {};
      spec.loop_form = form;
      return compiled(spec);
    };
    const auto distance_at = [&](double angle) {
      const auto model = at(angle, 0.0);
      Workspace ws(*model);
      return loop_rank(*model, ws, model->initial_state().q.data()).distance;
    };
    EXPECT_NEAR(distance_at(1e-3) / distance_at(1e-4), 10.0, 1e-3);
    EXPECT_GT(distance_at(0.6), 0.05);
    Simulation good(at(0.6, -0.04), {}), near(at(3e-3, -0.1), {});
    good.run(0.02), near.run(0.028);  // to 2e-4
    EXPECT_TRUE(good.warnings().all().empty()) << render(good.warnings());
    near.run(0.029);
    ASSERT_EQ(near.warnings().all().size(), 1u) << render(near.warnings());
    const Diagnostic& d = near.warnings().all()[0].what;
    EXPECT_EQ(d.code, Code::near_singular);
    EXPECT_EQ(d.at.key_path, "loops.pin0");
  }
}

// What the motion was before a checkpoint tells nobody how to pass a posture after it.
TEST(Loops, ACheckpointBeforeASingularPostureGoesOnWithTheSameBits) {
  SimulationOptions options;
  options.integrator.method = "rk4", options.integrator.fixed_step = 1e-3;
  SystemSpec spec = touching_four_bars(1, 0.0203, -1.0);
  spec.gravity = {};
  const auto model = compiled(spec);
  for (const double t : {0.016, 0.018, 0.019}) {
    Simulation whole(model, options), rest(model, options);
    whole.run(t);
    rest.resume(whole.checkpoint());
    whole.run(0.04), rest.run(0.04);
    EXPECT_EQ(whole.state().q, rest.state().q) << t;
    EXPECT_EQ(whole.state().v, rest.state().v) << t;
  }
}

/// A scissor of n bays in the plane, stretched by a slide in which its second bar stands: bars a and b of 1 m are pinned at their middles
/// and at their ends to those of the next bay. In line all of its loops lose a row at once.
SystemSpec scissor(int n, double angle, LoopForm form) {
  std::vector<BodySpec> bodies{on(rigid("slide", 0.2, {0, 0, 0}, diagonal({0.01, 0.01, 0.01})), "", "prismatic", {{0, 1, 0}})};
  bodies[0].hinge.q = {std::sin(angle)};
  SpringDamper spring;
  spring.stiffness = 30.0, spring.damping = 2.0, spring.rest = 0.1;
  bodies[0].hinge.springs = {spring};
  SystemSpec spec;
  for (int i = 0; i < n; ++i) {
    const auto bar = [&](const std::string& name, const std::string& inboard, double mass, double turn) {
      BodySpec b = on(rigid(fmt::format("{}{}", name, i), mass, {0.5, 0, 0}, diagonal({0.001, 0.1, 0.1})), inboard, "revolute", {{0, 0, 1}},
                      {i > 0 ? 1.0 : 0.0, 0, 0});
      b.hinge.q = {turn};
      bodies.push_back(b);
    };
    bar("a", i > 0 ? fmt::format("b{}", i - 1) : "", 1.03 + 0.1 * i, i > 0 ? 2.0 * angle : angle);
    bar("b", i > 0 ? fmt::format("a{}", i - 1) : "slide", 0.97 + 0.1 * i, i > 0 ? -2.0 * angle : -angle);
    LoopSpec pin;
    pin.name = fmt::format("pin{}", i), pin.type = "revolute", pin.params = test::along({{0, 0, 1}});
    pin.from.body = fmt::format("a{}", i), pin.to.body = fmt::format("b{}", i);
    pin.from.position = pin.to.position = {0.5, 0, 0};
    spec.loops.push_back(pin);
  }
  const std::vector<LoopSpec> loops = spec.loops;
  spec = system(bodies, {});
  spec.loops = loops;
  spec.loop_form = form;
  return spec;
}

/// The angle of its bars by the equation of its one degree of freedom, one bay: (d/dt)(J w) = 1/2 J' w^2 + tau, J = 2 I + (m_a + m_b) / 4 +
/// m_s cos^2.
double scissor_angle(double angle, double t_end) {
  double w = 0.0;
  const auto slope = [](double x, double rate) {
    const double c = std::cos(x), J = 0.2 + 2.0 * 0.25 + 0.2 * c * c, dJ = -0.4 * c * std::sin(x);
    return (-(30.0 * (std::sin(x) - 0.1) + 2.0 * c * rate) * c - 0.5 * dJ * rate * rate) / J;
  };
  const int n = 20000;
  const double h = t_end / n;
  for (int i = 0; i < n; ++i) {
    const double k1 = w, l1 = slope(angle, w), k2 = w + 0.5 * h * l1, l2 = slope(angle + 0.5 * h * k1, k2), k3 = w + 0.5 * h * l2,
                 l3 = slope(angle + 0.5 * h * k2, k3), k4 = w + h * l3, l4 = slope(angle + h * k3, k4);
    angle += h / 6.0 * (k1 + 2 * k2 + 2 * k3 + k4), w += h / 6.0 * (l1 + 2 * l2 + 2 * l3 + l4);
  }
  return angle;
}

// Steps whose errors are tested end ever nearer to the posture in line, down to where rounding alone tells its branches apart: there the
// bars went on turning as one, 1.5e-8 rad from it. In the branch of the motion it bends to both sides and comes to rest beside the rest of
// its spring.
TEST(Loops, GoOnInTheirOwnBranchPastPosturesInLine) {
  const double start = 25.0 * std::numbers::pi / 180.0;
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers})
    for (const auto& [method, relative, near] : {std::tuple{"dopri5", 1e-9, 1e-8},
                                                 {"dop853", 1e-9, 1e-8},
                                                 {"dop853", 1e-12, 2e-11},
                                                 {"cvode_adams", 1e-10, 1e-8},
                                                 {"rk4", 1e-9, 1e-7}})
      for (const int n : {1, 2, 3}) {
        SimulationOptions options;
        options.integrator.method = method, options.integrator.relative_tolerance = relative;
        if (options.integrator.method == "rk4") options.integrator.fixed_step = 0.005;
        Simulation sim(compiled(scissor(n, start, form)), options);
        const auto at = [&](const char* body, int i) {
          return sim.state().q[sim.model().user[idx(sim.model().find_body(fmt::format("{}{}", body, i)))].q];
        };
        const std::string of = fmt::format("{} at {:g}, {} bays, form {}", method, relative, n, static_cast<int>(form));
        double least = start;
        for (int k = 1; k <= 40; ++k) {
          sim.run(0.1 * k);
          // Adams' history is off the loops of many bays by some thousand tolerances there, and that may be told.
          EXPECT_TRUE(sim.ledger().pass || (n > 1 && options.integrator.method == "cvode_adams")) << of;
          const double angle = at("a", 0);
          least = std::min(least, angle);
          ASSERT_NEAR(at("b", 0), -angle, near) << of;
          for (int i = 1; i < n; ++i)
            ASSERT_TRUE(std::abs(at("a", i) - 2 * angle) <= near && std::abs(at("b", i) + 2 * angle) <= near) << of;
          if (n == 1 && k % 10 == 0) {
            EXPECT_NEAR(angle, scissor_angle(start, 0.1 * k), near) << of;
          }
        }
        EXPECT_LT(least, -0.05) << of;
        ASSERT_FALSE(sim.warnings().all().empty()) << of;
        EXPECT_EQ(sim.warnings().all()[0].what.code, Code::near_singular) << render(sim.warnings());
      }
}

/// Crank and rod of 1 m each, the rod's end on a slide through the pin of the crank (Wehage and Haug 1982): with the crank across it, twice
/// a turn, the rod lies on the crank, and might stay there.
SystemSpec equal_slider_crank(double angle, double rate) {
  SystemSpec spec = system({on(rigid("crank", 1.3, {0.5, 0, 0}, diagonal({0.1, 0.1, 0.1})), "", "revolute", {{0, 0, 1}}),
                            on(rigid("rod", 0.7, {0.4, 0, 0}, diagonal({0.1, 0.1, 0.1})), "crank", "revolute", {{0, 0, 1}}, {1, 0, 0}),
                            on(rigid("slider", 0.9, {0, 0, 0}, diagonal({0.1, 0.1, 0.1})), "", "prismatic", {{1, 0, 0}})});
  spec.bodies[0].hinge.q = {angle}, spec.bodies[1].hinge.q = {-2.0 * angle}, spec.bodies[2].hinge.q = {2.0 * std::cos(angle)};
  spec.bodies[0].hinge.v = {rate}, spec.bodies[1].hinge.v = {-2.0 * rate}, spec.bodies[2].hinge.v = {-2.0 * std::sin(angle) * rate};
  LoopSpec wrist;
  wrist.name = "wrist", wrist.type = "revolute", wrist.params = test::along({{0, 0, 1}});
  wrist.from.body = "slider", wrist.to.body = "rod", wrist.to.position = {1, 0, 0};
  spec.loops = {wrist};
  return spec;
}

// In 113 bits too: steps off the loops by their tolerance end ever nearer to the posture, and there went on in the other branch.
TEST(Loops, OfACrankAndARodOfOneLengthGoOnPastEachOther) {
  constexpr double start = 0.3, rate = 6.0;
  const auto inertia = [](double a) {
    return 0.2 + 1.3 * 0.25 + 0.7 * (std::pow(1.4 * std::sin(a), 2) + std::pow(0.6 * std::cos(a), 2)) +
           0.9 * std::pow(2.0 * std::sin(a), 2);
  };
  for (const auto& [method, relative, near] : {std::tuple{"dopri5", 1e-9, 1e-7}, {"dop853", 1e-11, 1e-9}, {"extended", 1e-15, 1e-8}}) {
    SimulationOptions options;
    options.integrator.method = method, options.integrator.relative_tolerance = relative;
    Simulation sim(compiled(equal_slider_crank(start, rate)), options);
    for (int k = 1; k <= 30; ++k) {
      sim.run(0.1 * k);
      const Eigen::VectorXd &q = sim.state().q, &v = sim.state().v;
      ASSERT_NEAR(q[1], -2.0 * q[0], near) << method << ' ' << k;
      ASSERT_NEAR(q[2], 2.0 * std::cos(q[0]), near) << method << ' ' << k;
      ASSERT_NEAR(v[0], rate * std::sqrt(inertia(start) / inertia(q[0])), near * rate) << method << ' ' << k;
    }
    EXPECT_GT(sim.state().q[0], 3.0 * std::numbers::pi) << method;
  }
}

/// The wheels of a locomotive, a quarter of a turn between the pins of their two rods: where one of them is in line, the other one leads.
SystemSpec quartered_wheels(double angle, double rate) {
  const auto wheel = [](const char* name, double mass, double x) {
    return on(rigid(name, mass, {0.05, 0, 0}, diagonal({0.2, 0.2, 0.4})), "", "revolute", {{0, 0, 1}}, {x, 0, 0});
  };
  const auto rod = [](const char* name, double mass, const Vector3d& pin) {
    return on(rigid(name, mass, {0.7, 0, 0}, diagonal({0.02, 0.3, 0.3})), "front", "revolute", {{0, 0, 1}}, pin);
  };
  const Vector3d left{0.3, 0, 0.5}, right{0, 0.3, -0.5};
  SystemSpec spec = system({wheel("front", 5.0, 0.0), wheel("rear", 4.0, 1.5), rod("l", 1.1, left), rod("r", 0.8, right)},
                           uniform_gravity({0, -9.81, 0}));
  for (const std::size_t i : {0, 1, 2, 3})
    spec.bodies[i].hinge.q = {i < 2 ? angle : -angle}, spec.bodies[i].hinge.v = {i < 2 ? rate : -rate};
  for (const auto& [name, pin] : {std::pair{"l", left}, {"r", right}}) {
    LoopSpec end;
    end.name = fmt::format("end_{}", name), end.type = "point";
    end.from.body = "rear", end.from.position = pin, end.to.body = name, end.to.position = {1.5, 0, 0};
    spec.loops.push_back(end);
  }
  return spec;
}

// Of a row that is left out c'' follows from the others where loops are closed, their rates too: states that an implicit method tries, and
// those that it takes differences at, are not, and were said to contradict each other.
TEST(Loops, OfWhichAnotherRowCountsInEachQuarterOfATurnGoOnByImplicitMethods) {
  constexpr double start = 7.0, J = 0.8 + 9.0 * 0.05 * 0.05 + 1.9 * 0.3 * 0.3;
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers})
    for (const char* method : {"cvode_bdf", "ark_implicit"}) {
      SimulationOptions options;
      options.integrator.method = method, options.integrator.relative_tolerance = 1e-8;
      SystemSpec spec = quartered_wheels(0.0, start);
      spec.loop_form = form;
      Simulation sim(compiled(spec), options);
      for (int k = 1; k <= 30; ++k) {
        sim.run(0.1 * k);
        const Eigen::VectorXd &q = sim.state().q, &v = sim.state().v;
        ASSERT_NEAR(q[1], q[0], 1e-12) << method;
        const double lifted = 9.0 * 0.05 * std::sin(q[0]) + 0.3 * (1.1 * std::sin(q[0]) + 0.8 * (std::cos(q[0]) - 1.0));
        ASSERT_NEAR(v[0], std::sqrt(start * start - 2.0 * 9.81 * lifted / J), 1e-4) << method << ' ' << k;
      }
    }
}

// Loop by loop, a rod that is almost in line would tell how the rear wheel turns, by its angle to the line: where another loop has
// a better row, rows are chosen among all of them. Rounding, 4e-15, is over pivots of 1e-2 at least then.
TEST(Loops, OfWhichAnotherRowCountsInEachQuarterOfATurnFollowAGivenMotion) {
  SystemSpec spec = quartered_wheels(0.6, 7.0);
  spec.bodies[0].hinge.prescribed = {0};
  spec.loop_form = LoopForm::embedding;
  const auto model = compiled(spec);
  Workspace ws(*model);
  for (const double in_line : {0.0, 0.5 * std::numbers::pi})
    for (const double off : {0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, -1e-3}) {
      const double a = in_line + off;
      const Eigen::Vector4d q(a, a, -a, -a), v(7, 7, -7, -7), given(1, 0, 0, 0);
      Eigen::VectorXd vdot(4);
      ASSERT_TRUE(forward_dynamics(*model, ws, {.q = q.data(), .v = v.data(), .vdot = given.data()}, vdot.data())) << a;
      EXPECT_LE(test::largest(Eigen::VectorXd(vdot - Eigen::Vector4d(1, 1, -1, -1))), 1e-12) << in_line << ' ' << off;
    }
}

TEST(Loops, ThatContradictGivenMotionEndTheRun) {
  SystemSpec spec = four_bar("point", 0.0);
  spec.bodies[0].hinge.prescribed = {0};
  spec.bodies[1].hinge.prescribed = {0};
  Simulation sim(compiled(spec), {});
  for (const int i : {0, 1}) sim.prescribe(i, MotionProfile::sine(0.1, 0.7, 0.0));
  EXPECT_THROW(sim.run(1.0), NumericsError);
  SystemSpec one = four_bar("point", 0.0);
  one.bodies[0].hinge.prescribed = {0};
  Simulation good(compiled(one), {});
  good.prescribe(0, MotionProfile::sine(0.5, 0.7, 0.0));
  good.run(5.0);
  for (const double c : good.loop_forces().residual) EXPECT_LE(std::abs(c), 1e-14);
  EXPECT_TRUE(good.ledger().pass) << render(good.warnings());
}

TEST(Loops, AStateThatIsFarFromThemIsNotTaken) {
  Simulation sim(compiled(four_bar()), {});
  sim.q(0) += 0.1;
  EXPECT_EQ(told([&] { sim.run(1.0); }),
            "failure[N0601]: a loop cannot be kept closed\n"
            "  t = 0 s   body: pivot\n"
            "  row 2 of loop pivot: residual 0.0927, limit 1e-06\n"
            "  hint:     it contradicts other loops or given motions, or its ends are out of reach of each other; see docs/errors.md\n");
}

/// Crank, coupler and rocker of a parallelogram, at this angle of the crank.
SystemSpec parallelogram(double angle) {
  const auto link = [](const char* name, double length, double q, const char* inboard, const Vector3d& at) {
    BodySpec b = on(rigid(name, 1.0, {0.5 * length, 0, 0}, diagonal({0.01, 0.1, 0.1})), inboard, "revolute", {{0, 0, 1}}, at);
    b.hinge.q = {q};
    return b;
  };
  SystemSpec spec = system({link("crank", 1.0, angle, "", {0, 0, 0}), link("coupler", 2.0, -angle, "crank", {1, 0, 0}),
                            link("rocker", 1.0, angle + std::numbers::pi, "coupler", {2, 0, 0})},
                           uniform_gravity({0, -9.81, 0}));
  LoopSpec pin;
  pin.name = "pin", pin.type = "point";
  pin.from.position = {2, 0, 0}, pin.to.body = "rocker", pin.to.position = {1, 0, 0};
  spec.loops = {pin};
  return spec;
}

// Turned by half a turn about itself the rocker has the axis of its pin the other way round: moments across it are nothing there, as on
// closed loops, and its ends meet.
TEST(Loops, AHingeTurnedByHalfATurnIsNotClosed) {
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers, LoopForm::dae}) {
    SystemSpec spec = parallelogram(0.6);
    spec.loop_form = form;
    HingeSpec& hinge = spec.bodies[2].hinge;
    hinge.type = "universal", hinge.params = test::along({{0, 0, 1}, {1, 0, 0}}), hinge.q = {0.6 + std::numbers::pi, 0.0};
    LoopSpec& pin = spec.loops[0];
    pin.type = "revolute", pin.params = test::along({{0, 0, 1}});
    for (const double turn : {0.0, std::numbers::pi, std::numbers::pi - 1e-9, -std::numbers::pi}) {
      SimulationOptions options;
      if (form == LoopForm::dae) options.integrator.method = "ida", options.integrator.relative_tolerance = 1e-7;
      Simulation sim(compiled(spec), options);
      sim.q(3) = turn;
      const std::string why = told([&] { sim.run(0.1); });
      EXPECT_EQ(why.starts_with("failure[N0601]"), turn != 0.0) << turn << ": " << why;
    }
  }
}

/// In line after 0.5 s, at rates that nothing changes.
SystemSpec turning_parallelogram(LoopForm form) {
  SystemSpec spec = parallelogram(-0.5);
  spec.gravity = {};
  spec.loop_form = form;
  for (std::size_t i = 0; i < 3; ++i) spec.bodies[i].hinge.v = {i == 1 ? -1.0 : 1.0};
  return spec;
}

// The state at which it failed is none that was accepted; what is told of it is what leads there, and no contradiction.
TEST(Loops, AFailureAtASingularPostureTellsWhereItIs) {
  SimulationOptions options;
  options.integrator.method = "dopri5", options.integrator.relative_tolerance = 1e-8;
  Simulation sim(compiled(turning_parallelogram(LoopForm::multipliers)), options);
  sim.every({1, 3}, [] {});
  sim.add_event({"in line", [](double, const double* q, const double*) { return q[0]; }, 0, [] {}});
  const std::string why = told([&] { sim.run(1.0); });
  for (const char* part : {"failure[N0601]: a loop cannot be kept closed\n  t = 0.333333 s   body: pin\n  row 1 of loop pin: residual ",
                           ", at a singular posture: a scaled pivot of ", " at t = 0.5 s, crank.angle = ", ", coupler.angle = ",
                           ", rocker.angle = 3.14159 rad\n", "  hint:     a row of the loops holds nothing there, and a step ended there"})
    EXPECT_NE(why.find(part), std::string::npos) << part << "\n" << why;
}

// No plugin is blamed where there is none.
TEST(Loops, ABalanceThatASingularPostureOpensIsToldAsThat) {
  SimulationOptions options;
  options.integrator.method = "dopri5", options.integrator.relative_tolerance = 1e-8;
  Simulation sim(compiled(turning_parallelogram(LoopForm::embedding)), options);
  sim.every({1, 2}, [&] { sim.ledger(); });
  sim.run(0.49);
  sim.run(0.6);
  for (const int i : {0, 1, 2}) sim.v(i) *= 1.001;
  sim.run(0.7);
  sim.ledger();
  const std::string warnings = render(sim.warnings());
  EXPECT_NE(warnings.find("W0402"), std::string::npos) << warnings;
  EXPECT_NE(warnings.find("closed loops came near a singular posture (a scaled pivot of "), std::string::npos) << warnings;
  EXPECT_EQ(warnings.find("plugin"), std::string::npos) << warnings;
}

// Flat it may go on as a parallelogram or crossed: two motions to first order, of which no mixture goes on.
TEST(Loops, WhatIsLinearIsRefusedAtASingularPosture) {
  for (const LoopForm form : {LoopForm::automatic, LoopForm::multipliers}) {
    for (const double angle : {0.0, 1e-3}) {
      SystemSpec spec = parallelogram(angle);
      spec.loop_form = form;
      const auto model = compiled(spec);
      const State s = model->initial_state();
      const auto linear = [&] { operators::linearize(*model, {.q = s.q.data(), .v = s.v.data()}); };
      const auto inverse = [&] { operators::ClosedSystem(model, s.q.data()); };
      if (angle != 0.0) {
        EXPECT_NO_THROW(linear());
        EXPECT_NO_THROW(inverse());
        continue;
      }
      const std::string why = told(inverse);
      EXPECT_NE(why.find("failure[N0601]: a loop cannot be kept closed\n  t = 0 s   body: pin\n  row 1 of loop pin: residual "),
                std::string::npos)
          << why;
      EXPECT_NE(why.find("  hint:     a singular posture: loops leave motions free that cannot all go on. Ask beside it\n"),
                std::string::npos)
          << why;
      EXPECT_EQ(told(linear), why);
    }
  }
}

// What is common to both ends is in no row: an orbit costs no digits.
TEST(Loops, CostNoDigitsAtOrbitalSpeed) {
  const auto vdot_of = [](double far) {
    SystemSpec spec = four_bar();
    BodySpec bus = on(rigid("bus", 50.0, {0.1, 0.2, 0}, diagonal({5, 6, 7})), "", "free");
    bus.hinge.q = {1, 0, 0, 0, far * 7e6, 0, 0}, bus.hinge.v = {0.3, -0.2, 0.1, 0, far * 7.5e3, 0};
    spec.bodies.insert(spec.bodies.begin(), bus);
    spec.bodies[1].hinge.inboard_body = "bus";
    spec.loops[0].from.body = "bus";
    spec.gravity = {};
    const auto model = compiled(spec);
    Workspace ws(*model);
    const State at = model->initial_state();
    VectorXd vdot(model->nv);
    EXPECT_TRUE(forward_dynamics(*model, ws, {.q = at.q.data(), .v = at.v.data()}, vdot.data()));
    return vdot;
  };
  EXPECT_LE(error_of(vdot_of(1.0), vdot_of(0.0)), 1e-15);
}

}  // namespace
}  // namespace cardan::test
