// Postures at rest: closed forms, random trees and mechanisms, and what has none.
#include "core/sim/equilibrium.hpp"

#include <numbers>
#include <numeric>
#include <random>

#include "core/dynamics/loops.hpp"
#include "core/model/components.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/closed_mechanisms.hpp"
#include "tests/properties/loaded_simulation.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/support/four_bar.hpp"

namespace cardan::test {
namespace {

std::vector<int> named(const Model& m, const std::vector<std::string>& names) {
  std::vector<int> out;
  for (const std::string& name : names) {
    const std::vector<int> found = components_of(m, name);
    EXPECT_FALSE(found.empty()) << name;
    out.insert(out.end(), found.begin(), found.end());
  }
  return out;
}

constexpr double kLength = 0.7, kWeight = 9.81;

/// A point on a rod, hinged where a shaft turns with `spin`; from `start`.
SystemSpec conical_pendulum(double spin, double start) {
  SystemSpec spec = system({on(rigid("shaft", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {{0, 0, 1}}),
                            on(rigid("rod", 2.0, {0, 0, -kLength}, diagonal({0.03, 0.03, 0.03})), "shaft", "revolute", {{0, 1, 0}})},
                           uniform_gravity({0, 0, -kWeight}));
  spec.bodies[0].hinge.prescribed = {0};
  spec.bodies[0].hinge.v = {spin};
  spec.bodies[1].hinge.q = {start};
  return spec;
}

TEST(Equilibrium, OfAPendulumThatTurnsIsThatOfHuygens) {
  constexpr double kSpin = 5.0;
  Simulation sim(compiled(conical_pendulum(kSpin, 0.9)), {});
  const State before = sim.state();
  const Equilibrium found = find_equilibrium(sim, {.move = named(sim.model(), {"rod"})});
  ASSERT_TRUE(found.reached) << found.message;
  EXPECT_TRUE(found.statically_stable);
  EXPECT_NEAR(found.q[1], std::acos(kWeight / (kSpin * kSpin * kLength)), 1e-14);
  EXPECT_EQ(found.v, (VectorXd(2) << kSpin, 0.0).finished());
  EXPECT_LE(found.iterations, 7);  // each squares the distance
  EXPECT_EQ(sim.state().q, before.q);
  EXPECT_EQ(sim.state().v, before.v);
}

TEST(Equilibrium, IsTheNearestOneAlsoIfItIsNotStable) {
  Simulation sim(compiled(conical_pendulum(0.0, 3.0)), {});
  const Equilibrium up = find_equilibrium(sim, {.move = {1}});
  ASSERT_TRUE(up.reached) << up.message;
  EXPECT_FALSE(up.statically_stable);
  EXPECT_NE(up.message.find("a small move drives itself on there"), std::string::npos) << up.message;
  EXPECT_NEAR(up.q[1], std::numbers::pi, 1e-14);
  sim.q(1) = 0.5 * std::numbers::pi;  // level: the slope of its weight is zero there
  const Equilibrium level = find_equilibrium(sim, {.move = {1}});
  EXPECT_TRUE(level.reached) << level.message;
  EXPECT_LT(std::abs(std::sin(level.q[1])), 1e-14);
}

/// Round links on ball hinges hang straight, however each is turned about its own axis: no posture stands alone, and the slope has no
/// rank there.
TEST(Equilibrium, WherePosturesAreNextToEachOther) {
  for (const double angle : {0.1, 0.5, 1.0}) {
    std::vector<BodySpec> links;
    for (int i = 0; i < 3; ++i) {
      BodySpec link = on(rigid("link" + std::to_string(i), 1.0 + i, {0, 0, -0.4}, diagonal({0.1, 0.1, 0.02})),
                         i > 0 ? "link" + std::to_string(i - 1) : "", "ball", {}, i > 0 ? Vector3d(0, 0, -1) : Vector3d(0, 0, 0));
      const Eigen::Quaterniond turned(Eigen::AngleAxisd(angle, Vector3d(1, -2 + i, 0.7).normalized()));
      link.hinge.q = {turned.w(), turned.x(), turned.y(), turned.z()};
      links.push_back(link);
    }
    Simulation sim(compiled(system(links, uniform_gravity({0, 0, -kWeight}))), {});
    const Equilibrium found = find_equilibrium(sim, {.move = named(sim.model(), {"link0", "link1", "link2"})});
    ASSERT_TRUE(found.reached) << angle << ": " << found.message;
    EXPECT_TRUE(found.statically_stable) << angle;
    for (int i = 0; i < 3; ++i)  // turned about z alone
      EXPECT_LT(std::hypot(found.q[4 * i + 1], found.q[4 * i + 2]), 1e-9) << angle << ", link " << i;
  }
}

TEST(Equilibrium, ThatThereIsNoneIsTold) {
  Simulation sim(compiled(conical_pendulum(0.0, 0.3)), {});
  sim.set_force(1, 1.01 * 2.0 * kWeight * kLength);  // more than the weight can hold
  const Equilibrium pushed = find_equilibrium(sim, {.move = {1}});
  EXPECT_FALSE(pushed.reached);
  EXPECT_NE(pushed.message.find("not in equilibrium"), std::string::npos) << pushed.message;
  EXPECT_TRUE(pushed.q.allFinite());
  SystemSpec free = system({on(rigid("wheel", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {{0, 0, 1}})});
  Simulation wheel(compiled(free), {});
  EXPECT_TRUE(find_equilibrium(wheel, {.move = {0}}).statically_stable);  // it stays wherever it is
  wheel.set_force(0, 0.25);
  const Equilibrium driven = find_equilibrium(wheel, {.move = {0}});
  EXPECT_FALSE(driven.reached);
  EXPECT_EQ(driven.message,
            "not in equilibrium: wheel.angle has an acceleration of 0.25 wherever it moves, nothing that it moves holds it");
  EXPECT_EQ(driven.residual, 0.25);
}

/// A stiff arm carries a pendulum: one that is pushed by more than its weight can hold leaves what is no rounding beside the stiffness of
/// the arm, and one that stands upright falls.
TEST(Equilibrium, IsToldOfWhatIsSoftBesideWhatIsStiff) {
  SystemSpec spec =
      system({on(rigid("arm", 1.0, {0.5, 0, 0}, diagonal({0.1, 0.1, 0.1})), "", "revolute", {{0, 1, 0}}),
              on(rigid("bob", 2.0, {0, 0, -kLength}, diagonal({1e-3, 1e-3, 1e-3})), "arm", "revolute", {{0, 1, 0}}, {1, 0, 0})},
             uniform_gravity({0, 0, -kWeight}));
  spec.bodies[0].hinge.springs = {{0, 1e12, 0.0, 0.0, {}}};
  Simulation sim(compiled(spec), {});
  sim.set_force(1, 1.01 * 2.0 * kWeight * kLength);
  const Equilibrium found = find_equilibrium(sim, {.move = {0, 1}});
  EXPECT_FALSE(found.reached) << found.message;
  sim.set_force(1, 0.5 * 2.0 * kWeight * kLength);
  const Equilibrium held = find_equilibrium(sim, {.move = {0, 1}});
  EXPECT_TRUE(held.reached) << held.message;
  EXPECT_NEAR(std::abs(std::sin(held.q[1])), 0.5, 1e-9);
  EXPECT_TRUE(held.statically_stable);
  spec.bodies[1].hinge.q = {std::numbers::pi};
  Simulation upright(compiled(spec), {});
  const Equilibrium falls = find_equilibrium(upright, {.move = {0, 1}});
  EXPECT_TRUE(falls.reached) << falls.message;
  EXPECT_FALSE(falls.statically_stable);
}

TEST(Equilibrium, RefusesWhatCannotMove) {
  Simulation sim(compiled(conical_pendulum(1.0, 0.3)), {});
  const auto refused = [&](std::vector<int> move) {
    try {
      find_equilibrium(sim, {.move = std::move(move)});
    } catch (const InputError& e) {
      return e.diagnostics().front().code;
    }
    return Code::not_a_rotation;
  };
  EXPECT_EQ(refused({}), Code::missing_key);
  EXPECT_EQ(refused({7}), Code::out_of_range);
  EXPECT_EQ(refused({0}), Code::unsupported);  // its motion is given
}

/// Two cranks on the ground and two links between their tips: while one crank turns, the others cannot be at rest.
TEST(Equilibrium, RefusesLoopsThatTurnWithWhatKeepsItsRate) {
  const double rise = std::asin(std::sqrt(0.16 - 0.0625) / 0.4), quarter = 0.5 * std::numbers::pi;
  std::vector<BodySpec> bodies;
  const auto link = [&](const std::string& name, const std::string& onto, double length, double at, double angle) {
    bodies.push_back(on(rigid(name, 1.0, {0.5 * length, 0, 0}, diagonal({0.002, 0.01, 0.01})), onto, "revolute", {{0, 0, 1}}, {at, 0, 0}));
    bodies.back().hinge.q = {angle};
  };
  link("crank", "", 0.2, 0.0, quarter);
  link("left", "crank", 0.4, 0.2, rise - quarter);
  link("right", "left", 0.4, 0.4, -2.0 * rise);
  link("other", "right", 0.2, 0.4, rise - quarter);
  SystemSpec spec = system(bodies, uniform_gravity({0, -kWeight, 0}));
  LoopSpec pivot;
  pivot.name = "pivot", pivot.type = "point", pivot.from.position = {0.5, 0, 0};
  pivot.to.body = "other", pivot.to.position = {0.2, 0, 0};
  spec.loops = {pivot};
  const auto refused = [](const SystemSpec& of, const char* because) {
    Simulation sim(compiled(of), {});
    try {
      find_equilibrium(sim, {.move = {1, 2, 3}});
      ADD_FAILURE() << "it was taken";
    } catch (const InputError& e) {
      EXPECT_EQ(e.diagnostics().front().code, Code::unsupported);
      EXPECT_NE(std::string(e.what()).find(because), std::string::npos) << e.what();
    }
  };
  refused(spec, "let move while all others stand");  // the crank falls, and the others with it
  SystemSpec turning = spec;
  turning.bodies[0].hinge.v = {1.0};
  refused(turning, "while all others keep their rates");
  spec.bodies[0].hinge.prescribed = {0};
  Simulation still(compiled(spec), {});
  EXPECT_TRUE(find_equilibrium(still, {.move = {1, 2, 3}}).reached);
}

/// The largest v' of what moved, in the simulation itself.
double left_of(Simulation& sim, const Equilibrium& found, const std::vector<int>& moved) {
  State at = sim.state();
  at.q = found.q, at.v = found.v;
  sim.set_state(at);
  double most = 0.0;
  for (const int v : moved) most = worse(most, std::abs(sim.vdot()[v]));
  return most;
}

/// A tree under its loads, with devices; of its hinges only the root turns.
std::unique_ptr<Simulation> under_loads(const RandomTree& tree) {
  SystemSpec spec = tree.spec;
  for (BodySpec& b : spec.bodies) b.hinge.loads.clear();
  for (std::size_t i = 1; i < spec.bodies.size(); ++i) std::ranges::fill(spec.bodies[i].hinge.v, 0.0);
  CompileOptions options;
  options.world_wrenches = true;
  auto sim = std::make_unique<Simulation>(compiled(with_devices(spec, tree.seed), options), SimulationOptions{});
  set_loads(*sim, tree);
  return sim;
}

/// Modes, and hinges of one component on springs.
std::vector<int> sprung(const Model& m) {
  std::vector<int> moved;
  for (const UserBody& u : m.user)
    for (int v = 0; v < m.nv; ++v) {
      const bool of_mode = v >= u.etadot && v < u.etadot + u.n_modes;
      const bool of_spring = v >= u.v && v < u.v + u.nv && !m.has_given_motion(v) &&
                             std::ranges::any_of(m.spec->bodies[static_cast<std::size_t>(&u - m.user.data())].hinge.springs,
                                                 [](const auto& s) { return s.stiffness > 0.0; });
      if (of_mode || (of_spring && u.nv == 1)) moved.push_back(v);
    }
  return moved;
}

/// Newton's method goes on to modes of 1e4, where what hangs on the gimbal is rounding; the descent finds the place that there is.
TEST(Equilibrium, IsFoundByDescentWhereNewtonsMethodEndsInRounding) {
  const auto sim = under_loads(random_tree(2036, {.bodies = 6, .flexible = 0.5, .springs = true}));
  const std::vector<int> moved = sprung(sim->model());
  const Equilibrium found = find_equilibrium(*sim, {.move = moved});
  EXPECT_TRUE(found.reached && found.statically_stable) << found.message;
  EXPECT_LT(left_of(*sim, found, moved), 1e-9);
}

/// Hinges on springs and modes, under weight, loads, devices and what given motions and a moving root do to them.
TEST(Equilibrium, OfRandomTreesUnderTheirLoads) {
  int found_some = 0;
  for (const double flexible : {0.0, 0.5})
    for_all_trees({.bodies = 6, .flexible = flexible, .springs = true}, 1e-9, [&](const RandomTree& tree) {
      const auto loaded = under_loads(tree);
      Simulation& sim = *loaded;
      const std::vector<int> moved = sprung(sim.model());
      if (moved.empty()) return 0.0;
      const Equilibrium found = find_equilibrium(sim, {.move = moved});
      if (!found.reached) return 0.0;
      ++found_some;
      const double size = 1.0 + largest(sim.vdot());
      return relative(left_of(sim, found, moved), size);
    });
  EXPECT_GT(found_some, 60);  // of 120 trees
}

/// A chain whose hinges all have a spring, soft or stiff, bent at the start, under weight: whatever hangs on them, its energy has a lowest
/// place.
SystemSpec sprung_chain(unsigned seed) {
  std::mt19937_64 engine(seed);
  const auto number = [&](double from, double to) { return std::uniform_real_distribution<double>(from, to)(engine); };
  const auto vector = [&](double size) { return Vector3d(number(-size, size), number(-size, size), number(-size, size)); };
  std::vector<BodySpec> links;
  for (unsigned i = 0; i < 2 + seed % 5; ++i) {
    const double mass = number(0.5, 4.0);
    const std::string type = number(0.0, 1.0) < 0.25 ? "prismatic" : "revolute";
    links.push_back(on(rigid("link" + std::to_string(i), mass, vector(0.4), diagonal(mass * Vector3d(0.04, 0.05, 0.03))),
                       i == 0 ? "" : links.back().name, type, {vector(1.0).normalized()}, vector(0.7)));
    links.back().hinge.q = {number(-2.0, 2.0)};
    links.back().hinge.springs = {{0, std::pow(10.0, number(-0.5, 2.5)), number(-1.0, 1.0), 0.0, {}}};
  }
  return system(links, uniform_gravity(vector(9.81)));
}

TEST(Equilibrium, OfSprungChainsUnderTheirWeightIsFoundInAll) {
  for (unsigned seed = first_seed(); seed < first_seed() + 200; ++seed) {
    Simulation sim(compiled(sprung_chain(seed)), {});
    std::vector<int> all(static_cast<std::size_t>(sim.model().nv));
    std::iota(all.begin(), all.end(), 0);
    const double size = 1.0 + largest(sim.vdot());
    const Equilibrium found = find_equilibrium(sim, {.move = all});
    EXPECT_TRUE(found.reached) << "seed " << seed << ": " << found.message;
    EXPECT_LT(left_of(sim, found, all), 1e-9 * size) << seed;
  }
}

/// A four-bar linkage on a spring and under its weight, closed in each form: where its energy has no slope.
/// A chain that is crumpled swings over on its way down: it hangs there with each hinge within half a turn of where it began, rather than
/// whole turns beyond. A soft spring counts turns: they stay, or the posture would be no equilibrium.
TEST(Equilibrium, CountsNoWholeTurnsThatNothingFeels) {
  const std::vector<double> start = {-1.5837114615753929, -2.3810037946157054,  -0.62365054433591371, -2.0701663751855381,
                                     -2.6009094259224605, -0.59045391308955075, 2.5077302585263137,   1.8027141089748513};
  for (const double stiffness : {0.0, 1e-3}) {
    std::vector<BodySpec> links;
    std::vector<std::string> names;
    for (std::size_t i = 0; i < start.size(); ++i) {
      names.push_back("link" + std::to_string(i));
      links.push_back(on(rigid(names[i], 1.0, {0.5, 0, 0}, diagonal({0.001, 0.083, 0.083})), i > 0 ? names[i - 1] : "", "revolute",
                         {{0, 1, 0}}, i > 0 ? Vector3d(1, 0, 0) : Vector3d(0, 0, 0)));
      links.back().hinge.q = {start[i]};
      if (stiffness > 0.0) links.back().hinge.springs = {{0, stiffness, 0.0, 0.0, {}}};
    }
    Simulation sim(compiled(system(links, uniform_gravity({0, 0, -kWeight}))), {});
    const Equilibrium found = find_equilibrium(sim, {.move = named(sim.model(), names)});
    ASSERT_TRUE(found.reached) << found.message;
    EXPECT_TRUE(found.statically_stable);
    EXPECT_LT(found.residual, 1e-9);
    double farthest = 0.0;
    for (std::size_t i = 0; i < start.size(); ++i)
      farthest = std::max(farthest, std::abs(found.q[static_cast<Eigen::Index>(i)] - start[i]));
    EXPECT_EQ(farthest <= std::numbers::pi, stiffness == 0.0) << farthest;
  }
}

TEST(Equilibrium, OfAMechanismIsWhereItsEnergyHasNoSlope) {
  std::vector<double> crank;
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers, LoopForm::dae}) {
    SystemSpec spec = four_bar();
    spec.gravity = uniform_gravity({0.3, -1.7, 0.0});
    spec.loop_form = form;
    for (BodySpec& b : spec.bodies) std::ranges::fill(b.hinge.v, 0.0);
    Simulation sim(compiled(spec), {});
    std::vector<int> all(static_cast<std::size_t>(sim.model().nv));
    std::iota(all.begin(), all.end(), 0);
    const Equilibrium found = find_equilibrium(sim, {.move = all});
    ASSERT_TRUE(found.reached) << found.message;
    EXPECT_LT(left_of(sim, found, all), 1e-11);
    crank.push_back(found.q[0]);
    Workspace ws(sim.model());
    EXPECT_LT(largest(loop_rows(sim.model(), ws, found.q.data()).c), 1e-13);
    const LoopFreedom freedom = loop_freedom(sim.model(), ws, found.q.data());
    const auto energy = [&](double h) {
      State at = sim.state();
      at.q = found.q;
      sim.model().retract(found.q.data(), VectorXd(h * freedom.X.col(0)).eval().data(), at.q.data());
      VectorXd still = VectorXd::Zero(sim.model().nv);
      LoopProjection(sim.model()).close(at.q.data(), still.data());
      at.v = still;
      sim.set_state(at);
      return sim.energy().total();
    };
    constexpr double kStep = 1e-4;
    EXPECT_LT(std::abs(energy(kStep) - energy(-kStep)) / (2.0 * kStep), 1e-7);
    EXPECT_GT(std::abs(energy(kStep) + energy(-kStep) - 2.0 * energy(0.0)) / (kStep * kStep), 1e-3);
  }
  EXPECT_NEAR(crank[1], crank[0], 1e-12);
  EXPECT_NEAR(crank[2], crank[0], 1e-12);
}

/// Links that bend under their weight, and the first crank on a spring: at rest by all forms, loops that touch closed.
TEST(Equilibrium, OfMechanismsWhoseLinksBend) {
  std::vector<VectorXd> postures;
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
    SystemSpec spec = bending_four_bars(3, true);
    spec.gravity = uniform_gravity({0, -9.81, 1.3});
    spec.bodies[0].hinge.springs = {{0, 300.0, 0.9, 0.0, {}}};
    spec.loop_form = form;
    Simulation sim(compiled(spec), {});
    std::vector<int> all(static_cast<std::size_t>(sim.model().nv));
    std::iota(all.begin(), all.end(), 0);
    const Equilibrium found = find_equilibrium(sim, {.move = all});
    ASSERT_TRUE(found.reached) << found.message;
    const double size = largest(sim.vdot());
    EXPECT_LT(left_of(sim, found, all), 1e-12 * size);
    postures.push_back(found.q);
  }
  EXPECT_LT(apart(postures[1], postures[0]), 1e-12);
}

}  // namespace
}  // namespace cardan::test
