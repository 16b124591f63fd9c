// Couplings beyond linear ones, and rows that are given as functions of time: the functions by differences, the rows against the dense
// twin on random trees, the motion in closed form, the balances of a run.
#include "core/model/coupling.hpp"

#include <numbers>
#include <numeric>
#include <optional>
#include <random>

#include "core/dynamics/loops.hpp"
#include "core/operators/closed_system.hpp"
#include "core/operators/linear_model.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "core/reference/quad.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/trees.hpp"
#include "tests/support/builders.hpp"
#include "tests/support/four_bar.hpp"
#include "tests/support/mass_on_a_string.hpp"

namespace cardan::test {
namespace {

using reference::DenseTwin;
using reference::Quad;

constexpr double kPi = std::numbers::pi;

// ---- functions ----

SmoothFunction polynomial(std::vector<double> c) { return {SmoothFunction::Kind::polynomial, std::move(c), 0.0}; }

TEST(SmoothFunctions, HaveTheDerivativesOfTheirValues) {
  const SmoothFunction table = SmoothFunction::through({-1.0, 0.1, 0.7, 2.0}, {0.3, -0.4, 1.1, 0.2}, false),
                       cam = SmoothFunction::through({0.0, 1.0, 2.5, 2.0 * kPi}, {0.2, 0.7, -0.3, 0.2}, true);
  const std::vector<SmoothFunction> all = {polynomial({0.3, -1.2, 0.7, 2.0, -0.4}),
                                           {SmoothFunction::Kind::sine, {0.7}, 0.0},
                                           {SmoothFunction::Kind::cosine, {-1.3}, 0.0},
                                           table,
                                           cam};
  for (const SmoothFunction& F : all)
    for (const double x : {-3.3, -0.4, 0.55, 1.3, 5.7, 8.0}) {
      constexpr double h = 1e-3;                                    // no point of a table is that near
      const auto slope = [&](double SmoothFunction::Jet::*which) {  // fourth order
        const auto f = [&](double at) { return F.at(at).*which; };
        return (8.0 * (f(x + h) - f(x - h)) - (f(x + 2.0 * h) - f(x - 2.0 * h))) / (12.0 * h);
      };
      const SmoothFunction::Jet at = F.at(x);
      EXPECT_NEAR(at.slope, slope(&SmoothFunction::Jet::value), 1e-9 * (1.0 + std::abs(at.slope))) << x;
      EXPECT_NEAR(at.curvature, slope(&SmoothFunction::Jet::slope), 1e-9 * (1.0 + std::abs(at.curvature))) << x;
      EXPECT_NEAR(at.third, slope(&SmoothFunction::Jet::curvature), 1e-9 * (1.0 + std::abs(at.third))) << x;
    }
}

TEST(SmoothFunctions, OfATableGoThroughItsPointsAndHaveNoCorner) {
  const std::vector<double> x = {0.0, 1.0, 2.5, 3.0, 2.0 * kPi}, F = {0.2, 0.7, -0.3, 0.1, 0.2};
  for (const bool repeats : {false, true}) {
    const SmoothFunction f = SmoothFunction::through(x, F, repeats);
    for (std::size_t i = 0; i < x.size(); ++i) {
      EXPECT_NEAR(f.at(x[i]).value, F[i], 1e-15);
      const SmoothFunction::Jet before = f.at(x[i] - 1e-9), after = f.at(x[i] + 1e-9);
      EXPECT_NEAR(before.slope, after.slope, 1e-7) << x[i];
      EXPECT_NEAR(before.curvature, after.curvature, 1e-7) << x[i];
    }
    if (repeats)
      EXPECT_NEAR(f.at(0.4).value, f.at(0.4 - 4.0 * kPi).value, 1e-14);
    else
      EXPECT_EQ(f.at(9.0).curvature, 0.0);
  }
  const SmoothFunction line = SmoothFunction::through({0.0, 0.3, 2.0}, {1.0, 1.6, 5.0}, false);  // of a straight line, itself
  for (const double at : {-1.0, 0.2, 1.1, 4.0}) EXPECT_NEAR(line.at(at).value, 1.0 + 2.0 * at, 1e-14);
}

/// What repeats may begin anywhere: before its first point it is what it is a period later.
TEST(SmoothFunctions, OfATableThatRepeatsMayBeginAnywhere) {
  const double period = 4.0;
  const SmoothFunction F = SmoothFunction::through({1.5, 2.5, 4.0, 5.5}, {0.2, 0.7, -0.3, 0.2}, true),
                       shifted = SmoothFunction::through({2.5, 4.0, 5.5, 6.5}, {0.7, -0.3, 0.2, 0.7}, true);
  for (const double x : {-3.2, 0.0, 0.7, 1.49, 3.1, 5.6, 9.9}) {
    EXPECT_NEAR(F.at(x).value, F.at(x + period).value, 1e-14) << x;
    EXPECT_NEAR(F.at(x).slope, F.at(x + period).slope, 1e-14) << x;
    EXPECT_NEAR(F.at(x).value, shifted.at(x).value, 1e-14) << x;
  }
}

// A function that repeats, through n of its points: four times the points, 4^-4 the error.
TEST(SmoothFunctions, OfATableConvergeWithTheFourthPower) {
  const auto error = [](int n) {
    std::vector<double> x, F;
    for (int i = 0; i <= n; ++i) {
      x.push_back(2.0 * kPi * i / n);
      F.push_back(std::sin(x.back()) + 0.3 * std::cos(2.0 * x.back()));
    }
    F.back() = F.front();
    const SmoothFunction f = SmoothFunction::through(x, F, true);
    double most = 0.0;
    for (int i = 0; i < 997; ++i) {
      const double at = 2.0 * kPi * i / 997.0;
      most = worse(most, std::abs(f.at(at).value - std::sin(at) - 0.3 * std::cos(2.0 * at)));
    }
    return most;
  };
  EXPECT_NEAR(std::log2(error(32) / error(128)), 8.0, 0.4);
}

// ---- rows on random trees, against the twin ----

/// Two couplings of all kinds of functions between coordinates of the tree, one of them given as a function of time, and a strut of a
/// length that is. Fewer where the tree has no room for them.
bool couple(RandomTree& tree, bool linear) {
  std::mt19937_64 random(tree.seed);
  const auto number = [&](double low, double high) { return std::uniform_real_distribution<>(low, high)(random); };
  std::vector<std::string> coordinates, bodies;
  for (BodySpec& b : tree.spec.bodies) {
    static const std::map<std::string, std::vector<std::string>> names = {{"revolute", {"angle"}},
                                                                          {"prismatic", {"displacement"}},
                                                                          {"helical", {"angle"}},
                                                                          {"cylindrical", {"angle", "displacement"}},
                                                                          {"universal", {"angle_1", "angle_2"}},
                                                                          {"planar", {"x", "y", "angle"}},
                                                                          {"translational", {"x", "y", "z"}}};
    if (!b.modal && !b.hinge.locked && b.hinge.type != "locked") bodies.push_back(b.name);
    if (const auto known = names.find(b.hinge.type); known != names.end() && !b.hinge.locked)
      for (const std::string& q : known->second) coordinates.push_back(b.name + "." + q);
  }
  if (coordinates.size() < 4) return false;
  std::ranges::shuffle(coordinates, random);
  for (int i = 0; i < 2; ++i) {
    LoopSpec loop;
    loop.name = fmt::format("coupling {}", i), loop.type = "coupling", loop.prescribed = i == 0 && !linear;
    loop.terms = {{coordinates[idx(2 * i)], number(0.5, 1.5), {}}};
    const auto add = [&](const char* kind, std::vector<double> numbers, bool periodic = false) {
      LoopSpec::Function f;
      f.kind = kind, f.numbers = std::move(numbers), f.periodic = periodic;
      f.scale = number(0.3, 0.8), f.phase = number(-1.0, 1.0);
      for (int k = 0; k < 3; ++k) f.of.push_back({coordinates[idx(k + i)], number(-1.0, 1.0), {}});
      loop.functions.push_back(f);
    };
    if (linear) {
      for (const int k : {1, 2}) loop.terms.push_back({coordinates[idx((2 * i + k) % 4)], number(-1.0, 1.0), {}});
      tree.spec.loops.push_back(loop);
      continue;
    }
    add("sine", {0.4}), add("cosine", {-0.3}), add("polynomial", {0.1, 0.5, -0.2, 0.1});
    add("table", {-2.0, 0.1, -0.5, 0.3, 0.2, -0.4, 1.7, 0.2}), add("table", {0.0, 0.1, 1.0, -0.2, 2.1, 0.3, 3.0, 0.1}, true);
    tree.spec.loops.push_back(loop);
  }
  if (bodies.size() > 1) {
    LoopSpec strut;
    strut.name = "strut", strut.type = "distance", strut.prescribed = !linear;
    strut.from.position = {1.5, -2.0, 2.5};
    strut.to.body = bodies.back(), strut.to.position = {0.3, 0.2, -0.1};
    SystemSpec bare = tree.spec;
    bare.loops.clear();
    const auto model = compiled(bare);
    Workspace ws(*model);
    const State s = model->initial_state();
    VectorXd vdot(model->nv);
    const Inputs in{.q = s.q.data(), .v = s.v.data()};
    forward_dynamics(*model, ws, in, vdot.data());
    Observer observer(*model, ws);
    observer.update(in, vdot.data());
    const NodeState n = observer.node(model->find_node(bodies.back()));
    strut.length = (n.position + n.R_WN * strut.to.position - strut.from.position).norm();
    tree.spec.loops.push_back(strut);
  }
  return true;
}

/// v' and multipliers of both forms and of the twin, at a state on moving rows.
double of_the_twin(const RandomTree& given, bool linear) {
  RandomTree tree = given;
  for (BodySpec& b : tree.spec.bodies) b.hinge.v.clear(), b.hinge.springs.clear(), b.hinge.loads.clear(), b.hinge.prescribed.clear();
  if (!couple(tree, linear)) return 0.0;
  // Offsets that the tree's place has, by the twin.
  {
    const DenseTwin<double> twin(tree.spec);
    SystemSpec bare = tree.spec;
    bare.loops.clear();
    const State s = compiled(bare)->initial_state();
    const auto rows = twin.at(s.q, s.v).loops();
    for (std::size_t l = 0; l < rows.size(); ++l)
      if (tree.spec.loops[l].type == "coupling") tree.spec.loops[l].offset = rows[l].c[0];
  }
  const DenseTwin<Quad> twin(tree.spec);
  double worst = 0.0;
  State at;
  std::vector<LoopDrive> drives;
  for (const LoopForm form : {LoopForm::multipliers, LoopForm::embedding}) {
    tree.spec.loop_form = form;
    const auto model = compiled(tree.spec);
    if (at.q.size() == 0) {
      at = model->initial_state();
      for (int i = 0; i < model->nv; ++i) at.v[i] = std::sin(1.3 * i + tree.seed);
      for (int i = 0; i < model->loops.n_drives; ++i) drives.push_back({0.003, 0.4 - 0.3 * i, 0.7 + 0.2 * i});
      LoopProjection projection(*model);
      if (!projection.close(at.q.data(), at.v.data(), drives.data())) return 0.0;  // out of reach
    }
    Workspace ws(*model);
    VectorXd vdot(model->nv), tau(model->nv);
    for (int i = 0; i < model->nv; ++i) tau[i] = std::cos(0.7 * i);
    const Inputs in{.q = at.q.data(), .v = at.v.data(), .tau = tau.data(), .drives = drives.data()};
    if (!forward_dynamics(*model, ws, in, vdot.data())) return HUGE_VAL;
    settle_loops(*model, ws, in);
    reference::Mat3X<Quad> moving(3, model->loops.n_drives);
    for (int i = 0; i < model->loops.n_drives; ++i)
      moving.col(i) << Quad(drives[idx(i)].more), Quad(drives[idx(i)].rate), Quad(drives[idx(i)].acceleration);
    const auto exact = twin.at(at.q.cast<Quad>(), at.v.cast<Quad>(), moving).closed(tau.cast<Quad>());
    VectorXd want(model->nv), lambda(model->loops.rows);
    for (int i = 0; i < model->nv; ++i) want[i] = static_cast<double>(exact.vdot[i]);
    for (int i = 0; i < model->loops.rows; ++i) lambda[i] = static_cast<double>(exact.lambda[i]);
    const LoopForces forces = loop_forces(ws);
    worst = worse({worst, relative(distance(vdot, want), largest(want)),
                   relative(distance(VectorXd::Map(forces.multipliers.data(), model->loops.rows), lambda), largest(lambda)),
                   largest(VectorXd::Map(forces.residual.data(), model->loops.rows)),
                   largest(VectorXd::Map(forces.rate.data(), model->loops.rows))});
  }
  return worst;
}

TEST(Couplings, OfAnyFunctionsAndRowsThatMoveAreThoseOfTheDenseTwin) {
  const auto any = [](const RandomTree& tree) { return of_the_twin(tree, false); };
  for_all_trees({.bodies = 7, .flexible = 0.0, .damping = false}, 1e-10, any, 100);
  for_all_trees({.bodies = 6, .flexible = 0.4, .wheels = 0.5}, 1e-10, any, 100);
  const auto linear = [](const RandomTree& tree) { return of_the_twin(tree, true); };
  TreeOptions drawn = {.bodies = 7, .flexible = 0.0, .damping = false};
  std::erase(drawn.hinges, "constant_velocity");  // as they were when 209 and 213 were wrong embedded
  for_all_trees(drawn, 1e-10, linear, 250);
}

/// Revolute joints about unequal axes in a random tree, and two to four couplings of two to four of their angles each.
SystemSpec coupled_revolutes(unsigned seed, int n) {
  std::mt19937_64 random(seed - 1 + first_seed());
  const auto number = [&](double a, double b) { return std::uniform_real_distribution<>(a, b)(random); };
  const auto pick = [&](int m) { return static_cast<int>(random() % static_cast<unsigned>(m)); };
  const auto vector = [&](double size) { return Vector3d(number(-size, size), number(-size, size), number(-size, size)); };
  const auto name = [](int i) { return fmt::format("b{}", i); };
  std::vector<BodySpec> bodies;
  for (int i = 0; i < n; ++i) {
    const int inboard = i == 0 ? -1 : pick(i + 1) - 1;
    const BodySpec body = rigid(name(i), number(1.0, 3.0), vector(0.3), diagonal({1.0, 1.2, 1.3}));
    bodies.push_back(on(body, inboard < 0 ? "" : name(inboard), "revolute", {vector(1.0).normalized()}, vector(0.5)));
    bodies.back().hinge.q = {number(-1.0, 1.0)};
  }
  SystemSpec spec = system(bodies);
  const int couplings = 2 + pick(3);
  for (int l = 0; l < couplings; ++l) {
    LoopSpec loop;
    loop.name = fmt::format("coupling {}", l), loop.type = "coupling";
    std::vector<int> on(idx(n));
    std::iota(on.begin(), on.end(), 0);
    std::ranges::shuffle(on, random);
    on.resize(idx(2 + pick(3)));
    loop.offset = 0.0;
    for (const int k : on) {
      loop.terms.push_back({name(k), number(0.5, 1.5), {}});
      loop.offset += loop.terms.back().coefficient * bodies[idx(k)].hinge.q[0];
    }
    spec.loops.push_back(loop);
  }
  return spec;
}

// Couplings that leave out hinges on their way, and share others: a body that one of them moves may be moved by another one from further
// inboard (b4 on b1 and b1 to b3 in a row, coupled {1, 2} and {3, 4}: wrong until it was counted from its inboard body).
TEST(Couplings, ThatShareHingesAndLeaveOutOthersAreEmbedded) {
  int tried = 0;
  for (int n = 5; n <= 9; ++n)
    for (unsigned seed = 1; seed <= 400; ++seed) {
      SystemSpec spec = coupled_revolutes(seed * 977 + static_cast<unsigned>(n), n);
      spec.loop_form = LoopForm::multipliers;
      std::shared_ptr<const Model> open;
      try {
        open = compiled(spec);
      } catch (const InputError&) {
        continue;  // more rows than coordinates
      }
      Workspace ws(*open);
      const State at = open->initial_state();
      const VectorXd tau = VectorXd::LinSpaced(n, 1.0, -0.7);
      const Inputs in{.q = at.q.data(), .v = at.v.data(), .tau = tau.data()};
      VectorXd want(n), got(n);
      if (!forward_dynamics(*open, ws, in, want.data())) continue;
      for (const std::uint8_t by_rates : std::initializer_list<std::uint8_t>{0, 1}) {
        const auto embedded = embedded_by(*open, std::vector<std::uint8_t>(spec.loops.size(), by_rates));
        ASSERT_TRUE(embedded->loops.embedding);
        Workspace own(*embedded);
        ASSERT_TRUE(forward_dynamics(*embedded, own, in, got.data()));
        EXPECT_LE(distance(got, want), 1e-9 * std::max(1.0, largest(want)))
            << n << " bodies, seed " << seed << ", by rates " << int{by_rates};
        ++tried;
      }
    }
  EXPECT_GT(tried, 2000);
}

// ---- one way to move, in closed form ----

/// A crank on the ground with an eccentric mass, and a follower that a spring pushes; the follower is where the crank's cam lets it:
/// x = 0.02 + 0.01 sin(2 theta + 0.3).
struct CamAndFollower {
  static constexpr double kJ = 0.03, km = 0.4, kr = 0.05, kM = 0.6, kg = 9.81, kk = 200.0;
  static double lift(double theta) { return 0.02 + 0.01 * std::sin(2.0 * theta + 0.3); }
  static double slope(double theta) { return 0.02 * std::cos(2.0 * theta + 0.3); }
  static double curvature(double theta) { return -0.04 * std::sin(2.0 * theta + 0.3); }
  static double acceleration(double theta, double rate) {
    const double F = slope(theta), force = -kM * kr * kg * std::cos(theta) - F * (kk * lift(theta) + km * kg);
    return (force - km * F * curvature(theta) * rate * rate) / (kJ + kM * kr * kr + km * F * F);
  }
  static SystemSpec spec(double theta, double rate) {
    BodySpec crank = on(rigid("crank", kM, {kr, 0, 0}, diagonal({0.01, 0.02, kJ})), "", "revolute", {{0, 0, 1}});
    BodySpec follower = on(rigid("follower", km, {0, 0, 0}, diagonal({0.01, 0.01, 0.01})), "", "prismatic", {{0, 1, 0}}, {0.3, 0, 0});
    crank.hinge.q = {theta}, crank.hinge.v = {rate};
    SpringDamper spring;
    spring.stiffness = kk;
    follower.hinge.springs = {spring};
    SystemSpec s = system({crank, follower}, uniform_gravity({0, -kg, 0}));
    LoopSpec cam;
    cam.name = "cam", cam.type = "coupling", cam.offset = 0.02;
    cam.terms = {{"follower", 1.0, {}}};
    LoopSpec::Function f;
    f.kind = "sine", f.numbers = {0.01}, f.scale = -1.0, f.phase = 0.3, f.of = {{"crank", 2.0, {}}};
    cam.functions = {f};
    s.loops = {cam};
    return s;
  }
};

TEST(Couplings, ACamMovesItsFollower) {
  for (const LoopForm form : {LoopForm::multipliers, LoopForm::embedding}) {
    SystemSpec spec = CamAndFollower::spec(0.7, 6.0);
    spec.loop_form = form;
    const auto model = compiled(spec);  // the assembler finds place and rate of the follower
    const State at = model->initial_state();
    EXPECT_NEAR(at.q[1], CamAndFollower::lift(0.7), 1e-15);
    EXPECT_NEAR(at.v[1], 6.0 * CamAndFollower::slope(0.7), 1e-14);
    Simulation sim(model, {});
    EXPECT_NEAR(sim.vdot()[0], CamAndFollower::acceleration(0.7, 6.0), 1e-11);
    const double x = at.q[1], lambda = sim.loop_forces().multipliers[0];
    EXPECT_NEAR(CamAndFollower::km * sim.vdot()[1], lambda - CamAndFollower::kk * x - CamAndFollower::km * 9.81, 1e-12);
  }
}

TEST(Couplings, ACamHasTheLinearModelOfItsOneWayToMove) {
  const auto model = compiled(CamAndFollower::spec(0.7, 6.0));
  const State at = model->initial_state();
  const operators::LinearModel linear = operators::linearize(*model, {.q = at.q.data(), .v = at.v.data()}, {{"crank"}, {"follower"}});
  ASSERT_EQ(linear.states.names.at(0), "crank.angle");
  const auto difference = [](const auto& f) {  // fourth order
    constexpr double h = 1e-3;
    return (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h);
  };
  const double of_angle = difference([](double h) { return CamAndFollower::acceleration(0.7 + h, 6.0); });
  const double of_rate = difference([](double h) { return CamAndFollower::acceleration(0.7, 6.0 + h); });
  EXPECT_NEAR(linear.A(1, 0), of_angle, 1e-8 * std::abs(of_angle));
  EXPECT_NEAR(linear.A(1, 1), of_rate, 1e-8 * std::abs(of_rate));
  EXPECT_NEAR(linear.C(0, 0), CamAndFollower::slope(0.7), 1e-14);
  EXPECT_NEAR(linear.C(1, 0), CamAndFollower::curvature(0.7) * 6.0, 1e-12);
  EXPECT_NEAR(linear.C(1, 1), CamAndFollower::slope(0.7), 1e-14);
}

TEST(Couplings, ARunWithACamKeepsItClosedAndEnergyHonest) {
  for (const std::string method : {"dopri5", "dop853", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit"}) {
    SimulationOptions options;
    options.integrator.method = method;
    options.integrator.relative_tolerance = 1e-10;
    Simulation sim(compiled(CamAndFollower::spec(0.7, 6.0)), options);
    const double before = sim.energy().total();
    double open = 0.0;
    sim.every({1, 10}, [&] {
      for (const double c : sim.loop_forces().residual) open = worse(open, std::abs(c));
      for (const double c : sim.loop_forces().rate) open = worse(open, std::abs(c));
    });
    sim.run(20.0);
    EXPECT_LE(open, 1e-14) << method;
    EXPECT_LE(std::abs(sim.energy().total() - before), 1e-6) << method;
    EXPECT_TRUE(sim.ledger().pass) << method << render(sim.warnings());
    EXPECT_NEAR(sim.loop_power(), 0.0, 1e-12);
  }
}

/// A bead on a cycloid, x = r (a + sin a), y = -r (1 + cos a), on which an arm hangs. The bead is a point: a has no inertia of its own in
/// the open tree, where nothing but the couplings tells its acceleration.
SystemSpec bead_on_a_cycloid(BodySpec bead) {
  constexpr double r = 0.5;
  bead = on(std::move(bead), "", "planar", {{1, 0, 0}, {0, 1, 0}});
  bead.hinge.q = {r * (1.2 + std::sin(1.2)), -r * (1.0 + std::cos(1.2)), 1.2};
  bead.hinge.v = {2.0 * r * (1.0 + std::cos(1.2)), 2.0 * r * std::sin(1.2), 2.0};
  BodySpec arm = on(rigid("arm", 0.7, {0.3, 0, 0}, diagonal({0.01, 0.02, 0.02})), "bead", "revolute", {{0, 0, 1}});
  arm.hinge.q = {0.4}, arm.hinge.v = {-3.0};
  SystemSpec s = system({bead, arm}, uniform_gravity({0, -9.81, 0}));
  const auto follows = [](const char* name, const char* coordinate, double slope, const char* kind, double scale) {
    LoopSpec l;
    l.name = name, l.type = "coupling";
    l.terms = {{coordinate, -1.0, {}}};
    if (slope != 0.0) l.terms.push_back({"bead.angle", slope, {}});
    LoopSpec::Function f;
    f.kind = kind, f.numbers = {1.0}, f.scale = scale, f.of = {{"bead.angle", 1.0, {}}};
    l.functions = {f};
    return l;
  };
  s.loops = {follows("along", "bead.x", r, "sine", r), follows("up", "bead.y", 0.0, "cosine", -r)};
  s.loops[1].offset = r;
  return s;
}

TEST(Couplings, WhatHasNoInertiaButByThemTellsTheForcesThatHoldIt) {
  Simulation sim(compiled(bead_on_a_cycloid(particle("bead", 2.0, {0, 0, 0}))), {.integrator = {.relative_tolerance = 1e-11}});
  Simulation light(compiled(bead_on_a_cycloid(rigid("bead", 2.0, {0, 0, 0}, diagonal({1e-8, 1e-8, 1e-8})))), {});
  for (const int body : {0, 1}) {
    const Vector6d got = to_eigen(sim.observe().hinge_wrench(body)), want = to_eigen(light.observe().hinge_wrench(body));
    EXPECT_LE((got - want).norm(), 1e-6 * want.norm()) << body;  // 1e-8 kg m^2 beside m r^2 = 0.5 kg m^2
    const int node = sim.model().find_node(body == 0 ? "bead" : "arm");
    const Vector6d a = sim.observe().node(node).acceleration, b = light.observe().node(node).acceleration;
    EXPECT_LE((a - b).norm(), 1e-6 * b.norm()) << body;
  }
  sim.run(2.0);
  EXPECT_TRUE(sim.ledger().pass) << render(sim.warnings());
}

/// Where gradients do not change on the way it may be as long as it likes: it was 400 steps of 0.1 rad, or of a tenth of the lever.
TEST(Couplings, AWheelThatHasTurnedFarFindsItsGear) {
  SystemSpec spec = system({on(rigid("motor", 1.0, {0, 0, 0}, diagonal({0.01, 0.01, 0.01})), "", "revolute", {{0, 0, 1}}),
                            on(rigid("drum", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {{0, 0, 1}})});
  spec.bodies[0].hinge.q = {5e5};
  LoopSpec gear;
  gear.name = "gear", gear.type = "coupling";
  gear.terms = {{"motor", 1.0, {}}, {"drum", -3.3, {}}};
  spec.loops = {gear};
  EXPECT_NEAR(compiled(spec)->initial_state().q[1], 5e5 / 3.3, 1e-9);
}
TEST(Couplings, ASpacecraftThatIsWeldedToOneInOrbitIsFoundThere) {
  SystemSpec spec = system({on(rigid("a", 300.0, {0, 0, 0}, diagonal({100, 120, 90})), "", "free"),
                            on(rigid("b", 200.0, {0, 0, 0}, diagonal({40, 50, 60})), "", "free")});
  spec.bodies[0].hinge.q = {1, 0, 0, 0, 6878e3, 0, 0}, spec.bodies[0].hinge.v = {0, 0, 0.02, 0, 7612, 0};
  LoopSpec dock;
  dock.name = "dock", dock.type = "weld";
  dock.from.body = "a", dock.from.position = {1, 0, 0}, dock.to.body = "b", dock.to.position = {-1, 0, 0};
  spec.loops = {dock};
  const State s = compiled(spec)->initial_state();
  EXPECT_LE((s.q.tail<3>() - Eigen::Vector3d(6878002.0, 0, 0)).norm(), 1e-8);
  EXPECT_LE((s.v.tail<6>() - (Eigen::VectorXd(6) << 0, 0, 0.02, 0, 7612.04, 0).finished()).norm(), 1e-10);
}

// ---- rows that are given as functions of time ----

/// A mass on a string that is hauled in and out: m r^2 theta' stays, r is given.
TEST(Couplings, AStringThatIsHauledInKeepsAngularMomentum) {
  SystemSpec spec = mass_on_a_string({0.0, 1.5, 0.0});
  for (const LoopForm form : {LoopForm::multipliers, LoopForm::embedding}) {
    spec.loop_form = form;
    SimulationOptions options;
    options.integrator.relative_tolerance = 1e-12;
    Simulation sim(compiled(spec), options);
    sim.prescribe_loop("string", MotionProfile::sine(0.4, 0.25, -0.5 * kPi));  // r = 1.4 - 0.4 cos(pi t / 2), from rest
    double power = 0.0;
    sim.every({1, 4}, [&] {
      const double t = sim.time(), r = 1.4 - 0.4 * std::cos(0.5 * kPi * t), rate = 0.2 * kPi * std::sin(0.5 * kPi * t);
      const double acceleration = 0.1 * kPi * kPi * std::cos(0.5 * kPi * t), theta_rate = 1.5 / (r * r);
      const Eigen::Vector3d x = sim.state().q, v = sim.state().v;
      EXPECT_NEAR(x.norm(), r, 1e-13);
      EXPECT_NEAR(x.dot(v) / r, rate, 1e-13);
      EXPECT_NEAR(x.cross(v).z(), 1.5, 1e-10);
      EXPECT_NEAR(sim.loop_forces().multipliers[0], 2.0 * (acceleration - r * theta_rate * theta_rate), 1e-9);
      EXPECT_NEAR(sim.loop_power(), sim.loop_forces().multipliers[0] * rate, 1e-12);
      power = worse(power, std::abs(sim.loop_power()));
    });
    sim.run(3.0);
    EXPECT_GT(power, 0.1);
    EXPECT_TRUE(sim.ledger().pass) << render(sim.warnings());
    EXPECT_LE(sim.ledger().energy_relative, 1e-9);
  }
}

// The mission tells the rate: initial rates that move the length are no open loop, but those of its profile.
TEST(Couplings, AStringMayBeginInMotion) {
  SystemSpec spec = mass_on_a_string({0.3, 1.5, 0.0});
  SimulationOptions options;
  options.integrator.relative_tolerance = 1e-12;
  Simulation sim(compiled(spec), options);
  sim.prescribe_loop("string", MotionProfile::hold(0.3));
  sim.run(2.0);
  EXPECT_EQ(sim.warnings().all().size(), 0u) << render(sim.warnings());
  const Eigen::Vector3d x = sim.state().q, v = sim.state().v;
  EXPECT_NEAR(x.norm(), 1.6, 1e-13);
  EXPECT_NEAR(x.cross(v).z(), 1.5, 1e-10);
  EXPECT_NEAR(sim.loop_forces().multipliers[0], -2.0 * 1.5 * 1.5 / std::pow(1.6, 3), 1e-9);

  Simulation untold(compiled(spec), options);
  try {
    untold.run(1.0);
    ADD_FAILURE() << "no profile, and it moves";
  } catch (const InputError& e) {
    EXPECT_NE(render(e.diagnostics()).find("error[C1103]"), std::string::npos) << render(e.diagnostics());
    EXPECT_NE(render(e.diagnostics()).find("0.3 m/s"), std::string::npos) << render(e.diagnostics());
  }
  Simulation otherwise(compiled(spec), options);
  otherwise.prescribe_loop("string", MotionProfile::hold(-0.1));
  otherwise.run(1.0);
  EXPECT_NE(render(otherwise.warnings()).find("the rate is 0.3 m/s and the profile's -0.1 m/s"), std::string::npos)
      << render(otherwise.warnings());
  EXPECT_NEAR(otherwise.state().q.norm(), 0.9, 1e-13);
}

// From rest that is a blow, by which the masses say what moves, and is told; of a mechanism that its given motion leaves nothing free it
// is no question.
TEST(Couplings, AStringThatBeginsToMoveFromRestIsToldToBeABlow) {
  Simulation sim(compiled(mass_on_a_string({0.0, 0.0, 0.0})), {});
  sim.prescribe_loop("string", MotionProfile::hold(-0.1));
  sim.run(0.5);
  ASSERT_EQ(sim.warnings().all().size(), 1u) << render(sim.warnings());
  EXPECT_NE(render(sim.warnings()).find("the rate is 0 m/s and the profile's -0.1 m/s: it jumps, and the vehicle takes it as a blow"),
            std::string::npos)
      << render(sim.warnings());
  EXPECT_NEAR(sim.state().q.norm(), 0.95, 1e-13);

  Simulation slow(compiled(mass_on_a_string({0.0, 0.0, 0.0})), {});
  slow.prescribe_loop("string", MotionProfile::rate_table({{0.0, 0.0}, {0.1, -0.1}}));
  slow.run(0.5);
  EXPECT_TRUE(slow.warnings().empty()) << render(slow.warnings());

  SystemSpec spec = four_bar("point", 0.0);
  for (BodySpec& b : spec.bodies) b.hinge.v.clear();
  LoopSpec servo;
  servo.name = "servo", servo.type = "coupling", servo.prescribed = true, servo.offset = spec.bodies[0].hinge.q[0];
  servo.terms = {{"crank", 1.0, {}}};
  spec.loops.push_back(servo);
  Simulation determined(compiled(spec), {});
  determined.prescribe_loop("servo", MotionProfile::hold(0.3));
  determined.run(0.1);
  EXPECT_TRUE(determined.warnings().empty()) << render(determined.warnings());
}

// Another loop is open in its rates: what closes it leaves the rate of the given length as it was.
TEST(Couplings, AStringInMotionStaysSoWhereAnotherLoopIsAssembled) {
  SystemSpec spec = mass_on_a_string({0.3, 1.5, 0.0});
  spec.bodies.push_back(on(rigid("wheel", 1.0, {0, 0, 0}, diagonal({0.1, 0.1, 0.2})), "", "revolute", {{0, 0, 1}}));
  LoopSpec gear;
  gear.name = "gear", gear.type = "coupling", gear.terms = {{"mass.y", 2.0, {}}, {"wheel", -1.0, {}}}, gear.offset = 0.0;
  spec.loops.push_back(gear);
  spec.assembly.hold = std::vector<std::string>{};  // what was given may move too
  const auto model = compiled(spec);
  const State s = model->initial_state();
  EXPECT_NEAR(s.v[0], 0.3, 1e-15);
  EXPECT_NEAR(s.v[3], 2.0 * s.v[1], 1e-14);
}

/// Three parallel legs, the third a rod whose length is given: the others imply it, and nothing closes what the length is more. Up to 1e-4
/// of its loop a row is left open; from there on the loops are not closed.
TEST(Couplings, ALengthThatOtherRowsImplyIsLeftOpenUpToItsLimit) {
  const std::vector<Eigen::Vector3d> z{{0, 0, 1}};
  const auto leg = [&](const char* name, double x) {
    BodySpec b = on(rigid(name, 1.0, {0, 0.2, 0}, diagonal({0.01, 0.01, 0.01})), "", "revolute", z, {x, 0, 0});
    b.hinge.q = {0.3};
    return b;
  };
  BodySpec plate = on(rigid("plate", 1.0, {0.5, 0.1, 0}, diagonal({0.05, 0.05, 0.05})), "leg_1", "revolute", z, {0, 0.5, 0});
  plate.hinge.q = {-0.3};
  SystemSpec spec = system({leg("leg_1", 0.0), leg("leg_2", 0.5), plate});
  LoopSpec second, rod;
  second.name = "second", second.type = "point";
  second.from.body = "leg_2", second.from.position = {0, 0.5, 0}, second.to.body = "plate", second.to.position = {0.5, 0, 0};
  rod.name = "rod", rod.type = "distance", rod.length = 0.5, rod.prescribed = true;
  rod.from.position = {1, 0, 0}, rod.to.body = "plate", rod.to.position = {1, 0, 0};
  spec.loops = {second, rod};
  const auto model = compiled(spec);
  const State start = model->initial_state();
  Workspace ws(*model);
  const auto row = static_cast<Eigen::Index>(std::ranges::find(model->loops.all, "rod", &Loop::name)->first);
  const auto open_by = [&](double more) {
    const LoopDrive drive{more, 0.0, 0.0};
    return std::abs(loop_rows(*model, ws, start.q.data(), &drive).c[row]);
  };
  ASSERT_LE(open_by(0.0), 1e-15);
  const double unit = 1e-3 / open_by(1e-3);  // [m] for each of the row
  const auto left_open = [&](double open) {  // nothing: the loops are not closed
    const LoopDrive drive{open * unit, 0.0, 0.0};
    State s = start;
    LoopProjection projection(*model);
    if (!projection.close(s.q.data(), s.v.data(), &drive)) return std::optional<double>();
    EXPECT_LE(largest(s.q - start.q), 10.0 * open) << "legs of half a metre, a row over a metre";
    return std::optional(projection.left_open());
  };
  // By least squares each of the rows that contradict each other has a share of the length.
  const auto small = left_open(1e-7);
  ASSERT_TRUE(small && *small > 0.1e-7 && *small <= 1e-7);
  const double share = *small / 1e-7;
  for (const double open : {1e-9, 1e-6, 0.99e-4}) {
    const auto left = left_open(open / share);
    ASSERT_TRUE(left) << open;
    EXPECT_NEAR(*left, open, 1e-14 + 10.0 * open * open) << "but for rounding and what is not linear";
  }
  for (const double open : {1.01e-4, 1e-3, 1e-2}) EXPECT_FALSE(left_open(open / share)) << open;
}

/// A coupling of one coordinate that is given moves as the hinge whose motion is given, and its multiplier is the force that this needs.
TEST(Couplings, ACoordinateThatIsGivenByARowIsAsOneThatIsGivenByItsHinge) {
  SystemSpec by_hinge = system(base_with_sprung_arm(), {});
  SystemSpec by_row = by_hinge;
  by_hinge.bodies[1].hinge.prescribed = {0};
  LoopSpec row;
  row.name = "servo", row.type = "coupling", row.offset = 0.4, row.prescribed = true;
  row.terms = {{"arm", 1.0, {}}};
  by_row.loops = {row};
  SimulationOptions options;
  options.integrator.relative_tolerance = 1e-12;
  for (const LoopForm form : {LoopForm::multipliers, LoopForm::embedding}) {
    by_row.loop_form = form;
    Simulation a(compiled(by_hinge), options), b(compiled(by_row), options);
    const MotionProfile profile = MotionProfile::rate_table({{0.0, 0.0}, {1.0, 0.8}, {2.0, -0.3}, {4.0, 0.0}});
    a.prescribe(6, profile), b.prescribe_loop("servo", profile);
    for (Simulation* sim : {&a, &b}) sim->run(3.5);
    EXPECT_LE(largest(VectorXd(a.state().q - b.state().q)), 1e-9);
    EXPECT_LE(largest(VectorXd(a.state().v - b.state().v)), 1e-9);
    std::vector<double> needed(7);
    a.observe().prescribed_forces(needed.data());
    EXPECT_NEAR(b.loop_forces().multipliers[0], needed[6] + 3.0 * a.state().q[7] + 0.05 * a.state().v[6], 1e-8);  // and the spring
    EXPECT_TRUE(b.ledger().pass) << render(b.warnings());
    EXPECT_LE(b.ledger().energy_relative, 1e-9);
  }
}

// A strut between two parts of a free vehicle whose rate jumps: nothing from outside acts, and the ledger has the energy.
TEST(Couplings, ARateThatJumpsIsABlow) {
  std::vector<BodySpec> bodies = base_with_sprung_arm();
  bodies[1].hinge.springs.clear();
  SystemSpec spec = system(bodies);
  LoopSpec strut;
  strut.name = "strut", strut.type = "distance", strut.prescribed = true;
  strut.from.body = "base", strut.from.position = {0, 1, 0};
  strut.to.body = "arm", strut.to.position = {0.6, 0, 0};
  strut.length = (Eigen::Vector3d(0.5 + 0.6 * std::cos(0.4), 0.6 * std::sin(0.4), 0) - Eigen::Vector3d(0, 1, 0)).norm();
  spec.loops = {strut};
  SimulationOptions options;
  options.integrator.relative_tolerance = 1e-11;
  for (const bool kept : {false, true}) {  // in checkpoints of the same instants
    Simulation sim(compiled(spec), options);
    sim.every({1, 1}, [&] {
      if (sim.time() == 1.0) sim.prescribe_loop("strut", MotionProfile::hold(0.2));
      if (sim.time() == 2.0) sim.prescribe_loop("strut", MotionProfile::hold(0.0));
      if (kept) sim.checkpoint();
    });
    const Momentum before = sim.momentum();
    const double energy = sim.energy().total();
    sim.run(3.0);
    EXPECT_LE((sim.momentum().angular - before.angular).norm(), 1e-9);
    EXPECT_LE((sim.momentum().linear - before.linear).norm(), 1e-10);
    EXPECT_GT(std::abs(sim.energy().total() - energy), 1e-3);
    EXPECT_TRUE(sim.ledger().pass) << render(sim.warnings());
    EXPECT_LE(sim.ledger().energy_relative, 1e-9);
    EXPECT_NEAR(sim.drives()[0].more, 0.2, 1e-12);
  }
}

// Three wings that are alike, coupled in a ring: nothing but rounding is for the couplings to take, and what it leaves of the redundant one
// is no contradiction.
TEST(Couplings, ARingOfWhatMovesAlikeAnywayIsKeptClosed) {
  std::vector<BodySpec> bodies = {on(rigid("hub", 100.0, {0, 0, 0}, diagonal({20, 20, 30})), "", "free")};
  const char* const names[] = {"a", "b", "c"};
  for (int k = 0; k < 3; ++k) {
    const double x = std::cos(2.0 * std::numbers::pi * k / 3.0), y = std::sin(2.0 * std::numbers::pi * k / 3.0);
    BodySpec wing = on(particle(names[k], 10.0, {0.5 * x, 0.5 * y, 0}), "hub", "revolute", {{-y, x, 0}}, {x, y, 0});
    wing.hinge.q = {-0.2}, wing.hinge.v = {0.3};
    bodies.push_back(wing);
  }
  SystemSpec spec = system(bodies);
  for (int k = 0; k < 3; ++k) {
    LoopSpec ring;
    ring.name = std::string("with_") + names[k], ring.type = "coupling";
    ring.terms = {{names[k], 1.0, {}}, {names[(k + 1) % 3], -1.0, {}}};
    spec.loops.push_back(ring);
  }
  spec.loop_form = LoopForm::multipliers;
  Simulation sim(compiled(spec), {});
  sim.run(1.0);
  EXPECT_GT(sim.state().q[7], 0.0);
  EXPECT_NEAR(sim.state().q[7], sim.state().q[8], 1e-12);
  EXPECT_NEAR(sim.state().q[8], sim.state().q[9], 1e-12);
}

// A cosine that rounding leaves at its zero is no jump, of a hinge and of a loop; a part in a million of the rate that was is one.
TEST(Couplings, WhatRoundingLeavesOfARateIsNoJump) {
  const auto warned = [](double rate) {
    std::vector<BodySpec> bodies = base_with_sprung_arm();
    bodies[1].hinge.springs.clear();
    bodies.push_back(on(rigid("mast", 1.0, {0, 0, 0.5}, diagonal({0.1, 0.1, 0.01})), "base", "revolute", {{1, 0, 0}}));
    bodies.back().hinge.prescribed = {0};
    SystemSpec spec = system(bodies);
    LoopSpec servo;
    servo.name = "servo", servo.type = "coupling", servo.prescribed = true, servo.offset = spec.bodies[1].hinge.q[0];
    servo.terms = {{"arm", 1.0, {}}};
    spec.loops = {servo};
    Simulation sim(compiled(spec), {});
    const int mast = sim.model().user[2].v;
    const MotionProfile swings = MotionProfile::sine(0.1, 1.25, 0.0);
    sim.prescribe(mast, swings), sim.prescribe_loop("servo", swings);
    sim.every({1, 1}, [&] {
      if (sim.time() != 1.0) return;
      EXPECT_NE(swings.rate(1.0), 0.0);  // the cosine of five quarters of a turn
      sim.prescribe(mast, MotionProfile::hold(rate)), sim.prescribe_loop("servo", MotionProfile::hold(rate));
    });
    sim.run(1.5);
    EXPECT_NEAR(sim.state().v[mast], rate, 1e-15);
    return std::ranges::count_if(sim.warnings().all(), [](const Warning& w) { return !w.what.at.key_path.ends_with("at the start"); });
  };
  EXPECT_EQ(warned(0.0), 0);
  EXPECT_EQ(warned(1e-6), 2);
}

TEST(Couplings, ACheckpointGoesOnInTheMiddleOfAGivenMotion) {
  SystemSpec spec = four_bar("point", 0.0);
  LoopSpec servo;
  servo.name = "servo", servo.type = "coupling", servo.prescribed = true, servo.offset = spec.bodies[0].hinge.q[0];
  servo.terms = {{"crank", 1.0, {}}};
  spec.loops.push_back(servo);
  const auto make = [&] {
    auto sim = std::make_unique<Simulation>(compiled(spec), SimulationOptions());
    sim->prescribe_loop("servo", MotionProfile::sine(0.3, 0.5, 0.2));
    return sim;
  };
  const auto whole = make(), first = make(), rest = make();
  whole->run(0.7), first->run(0.7);
  const Checkpoint middle = first->checkpoint();
  whole->checkpoint();  // which starts the integrator anew
  rest->resume(middle);
  whole->run(1.5), rest->run(1.5);
  EXPECT_EQ(whole->state().q, rest->state().q);
  EXPECT_EQ(whole->state().v, rest->state().v);
}

TEST(Couplings, WhatIsNotPrescribedTakesNoProfile) {
  Simulation sim(compiled(four_bar()), {});
  try {
    sim.prescribe_loop("pivot", MotionProfile::hold(1.0));
    FAIL() << "a loop that is not prescribed took a profile";
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics().front().code, Code::bad_initial_state);
    EXPECT_EQ(e.diagnostics().front().at.key_path, "profile of pivot");
  }
}

}  // namespace
}  // namespace cardan::test
