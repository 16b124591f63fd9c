// Wheels that turn with hinges: gears, belts, cables, dead centres.
#include "core/dynamics/loops.hpp"

#include <numeric>
#include <random>

#include "core/model/embedding.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/closed_mechanisms.hpp"
#include "tests/properties/forms_of_loops.hpp"

namespace cardan::test {
namespace {

void expect_forms_to_agree_where_driven(const SystemSpec& spec, std::size_t first, std::size_t second) {
  EXPECT_LE(forms_apart(spec), 1e-12);
  std::vector<VectorXd> moved;
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
    SystemSpec driven = spec;
    driven.loops[first].prescribed = driven.loops[second].prescribed = true, driven.loop_form = form;
    const auto m = compiled(driven);
    State open = m->initial_state();
    for (Eigen::Index i = 0; i < open.v.size(); ++i) open.v[i] += 0.01 * std::sin(3.0 * static_cast<double>(i));
    const LoopDrive drives[] = {{.more = 0.01, .rate = 0.3, .acceleration = 1.7}, {.more = -0.02, .rate = 0.1, .acceleration = -0.4}};
    LoopProjection projection(*m);
    ASSERT_TRUE(projection.close(open.q.data(), open.v.data(), drives));
    Workspace ws(*m);
    VectorXd out(m->nv);
    ASSERT_TRUE(forward_dynamics(*m, ws, {.q = open.q.data(), .v = open.v.data(), .drives = drives}, out.data()));
    VectorXd both(open.q.size() + open.v.size() + out.size());
    both << open.q, open.v, out;
    moved.push_back(both);
  }
  EXPECT_LE(error_of(moved[0], moved[1]), 1e-12);
}

/// A free base, arms on it whose hinges turn wheels on the inboard bodies, one way or the other, faster or slower or as fast. `bevel`: the
/// axis of one wheel is across that of its hinge. `cable`: two hinges of the arm are coupled, and one between them is not.
SystemSpec geared_arms(std::uint64_t seed, int arms, bool bevel = false, bool cable = false) {
  std::mt19937_64 random(seed - 1 + first_seed());
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  const auto vector = [&] { return Eigen::Vector3d(number(random), number(random), number(random)); };
  BodySpec base = on(rigid("base", 10.0, {0.1, 0, 0}, diagonal({2, 3, 4})), "", "free");
  base.hinge.v = {0.3, -0.2, 0.1, 0, 0, 0};
  SystemSpec spec = system({base}, uniform_gravity({0.5, -0.3, -9.81}));
  std::vector<Eigen::Vector3d> axes;
  for (int i = 0; i < 3; ++i) {
    axes.push_back(vector().normalized());
    if (seed % 3 == 0) axes[static_cast<std::size_t>(i)] = Eigen::Vector3d::Unit((i + static_cast<int>(seed)) % 3);
  }
  axes.emplace_back(0, 1, 0);
  for (int j = 0; j < arms; ++j) {
    const std::string of_arm = j == 0 ? "" : " of arm " + std::to_string(j);
    std::string inboard = "base";
    for (int i = 0; i < 4; ++i) {
      const std::string link = "link" + std::to_string(i) + of_arm, wheel = "wheel" + std::to_string(i) + of_arm;
      const Eigen::Vector3d& axis = axes[static_cast<std::size_t>(i)];
      const double ratio = i == 2 && seed % 4 == 0 ? 1.0 : 6.0 * number(random) + (seed % 2 ? 8.0 : -8.0);
      const double sense = number(random) > 0.0 ? 1.0 : -1.0;
      BodySpec arm = on(rigid(link, 2.0 + number(random), vector(), diagonal({0.4, 0.5, 0.6})), inboard, "revolute", {axis}, vector());
      const bool across = bevel && i == 2;
      const Eigen::Vector3d along_wheel = across ? Eigen::Vector3d(axis.unitOrthogonal()) : Eigen::Vector3d(sense * axis);
      const double Ja = 0.02 + 0.01 * number(random), across_it = 0.6 * Ja;
      const Eigen::Matrix3d J = across_it * Eigen::Matrix3d::Identity() + (Ja - across_it) * along_wheel * along_wheel.transpose();
      BodySpec turns = on(rigid(wheel, 0.5, Eigen::Vector3d::Zero(), J), inboard, "revolute", {along_wheel}, vector());
      arm.hinge.q = {number(random)}, arm.hinge.v = {number(random)};
      if (cable && i == 2) arm.hinge.q = {0.5 * spec.bodies[1].hinge.q[0]}, arm.hinge.v = {0.5 * spec.bodies[1].hinge.v[0]};
      turns.hinge.q = {ratio * arm.hinge.q[0]}, turns.hinge.v = {ratio * arm.hinge.v[0]};
      LoopSpec gear;
      gear.name = "gear" + std::to_string(i) + of_arm, gear.type = "coupling";
      gear.terms = {{link, -2.0 * ratio, {}}, {wheel, 2.0, {}}};
      if (i % 2) std::swap(gear.terms[0], gear.terms[1]), std::swap(arm, turns);
      spec.bodies.push_back(arm), spec.bodies.push_back(turns);
      spec.loops.push_back(gear);
      inboard = link;
    }
  }
  if (cable) {
    LoopSpec tie;
    tie.name = "cable", tie.type = "coupling";
    tie.terms = {{"link0", 0.5, {}}, {"link2", -1.0, {}}};
    spec.loops.push_back(tie);
  }
  return spec;
}

TEST(Loops, AWheelGearedToAHingeBesideItIsMoreInertiaOfThatHinge) {
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    const SystemSpec spec = geared_arms(seed, 1);
    const auto model = compiled(spec);
    ASSERT_EQ(model->rotors.size(), 4U);
    EXPECT_EQ(model->loops.embedding->gears.size(), 4U);
    EXPECT_EQ(model->loops.embedding->width, 0);
    EXPECT_LE(forms_apart(spec), 1e-12) << seed;
  }
  // Across its hinge a wheel is a body of a loop; so is one whose hinge coordinates of another loop cross.
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    EXPECT_EQ(compiled(geared_arms(seed, 1, true))->loops.embedding->gears.size(), 3U);
    EXPECT_LE(forms_apart(geared_arms(seed, 1, true)), 1e-12) << seed;
    EXPECT_LT(compiled(geared_arms(seed, 1, false, true))->loops.embedding->gears.size(), 3U);
    EXPECT_LE(forms_apart(geared_arms(seed, 1, false, true)), 1e-12) << seed;
  }
}

// Arms that are alike: their hinges of one level go side by side, four, two and one at a time.
TEST(Loops, GearsThatAreAlikeGoSideBySide) {
  for (const auto& [arms, sides] : std::map<int, std::vector<int>>{{2, {2}}, {3, {2, 1}}, {4, {4}}, {7, {4, 2, 1}}})
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
      SCOPED_TRACE(seed);
      const SystemSpec spec = geared_arms(seed, arms);
      const auto model = compiled(spec);
      std::vector<int> found;
      for (const AlikeGears& gears : model->loops.embedding->alike_gears)
        if (!gears.half) found.push_back(gears.n);
      std::vector<int> wanted;
      for (int level = 0; level < 4; ++level) wanted.insert(wanted.end(), sides.begin(), sides.end());
      if (seed % 3 == 0)
        EXPECT_EQ(found, wanted);
      else  // axes in any direction: kernels of one level differ by how the bodies beyond stand
        EXPECT_EQ(std::accumulate(found.begin(), found.end(), 0), 4 * arms);
      expect_forms_to_agree_where_driven(spec, 1, 4 * static_cast<std::size_t>(arms) - 3);
    }
}

/// What arms with wheels are made of, from numbers drawn one after the other.
struct ArmBuilder {
  std::mt19937_64 random;
  std::uniform_real_distribution<double> number{-1.0, 1.0};
  SystemSpec spec = system({}, uniform_gravity({0.5, -0.3, -9.81}));
  std::string base;

  ArmBuilder(std::uint64_t seed, bool on_ground) : random(seed - 1 + first_seed()) {
    if (on_ground) return;
    BodySpec body = on(rigid("base", 10.0, {0.1, 0, 0}, diagonal({2, 3, 4})), "", "free");
    body.hinge.v = {0.3, -0.2, 0.1, 0, 0, 0};
    spec.bodies.push_back(body);
    base = "base";
  }
  Eigen::Vector3d vector() { return {number(random), number(random), number(random)}; }
  void wheel(const std::string& name, const std::string& carrier) {
    const Eigen::Vector3d u = vector().normalized();
    const double Ja = 0.02 + 0.01 * number(random), across = 0.6 * Ja;
    spec.bodies.push_back(
        on(rigid(name, 0.5, Eigen::Vector3d::Zero(), across * Eigen::Matrix3d::Identity() + (Ja - across) * u * u.transpose()), carrier,
           "revolute", {u}, vector()));
  }
  void link(const std::string& name, const std::string& inboard) {
    BodySpec link =
        on(rigid(name, 2.0 + number(random), vector(), diagonal({0.4, 0.5, 0.6})), inboard, "revolute", {vector().normalized()}, vector());
    link.hinge.q = {number(random)}, link.hinge.v = {number(random)};
    spec.bodies.push_back(link);
  }
  LoopSpec& couple(const std::string& name, std::vector<LoopSpec::Term> terms) {
    LoopSpec loop;
    loop.name = name, loop.type = "coupling", loop.terms = std::move(terms);
    spec.loops.push_back(loop);
    return spec.loops.back();
  }
};

/// Chains of a few links whose hinges turn three wheels that stand inboard of them: one by a belt to its first and last hinge, two by a
/// differential with sines, of which some have one argument. Bodies hang on its first and last link.
SystemSpec geared_chains(std::uint64_t seed, int chains, int hinges, bool on_ground) {
  ArmBuilder arm(seed, on_ground);
  const auto number = [&] { return arm.number(arm.random); };
  for (int chain = 0; chain < chains; ++chain) {
    const std::string of = chain == 0 ? "" : " of chain " + std::to_string(chain);
    const auto link = [&](int i) { return "link" + std::to_string(i) + of; };
    const std::string first = link(0), last = link(hinges - 1), left = "left" + of, right = "right" + of;
    arm.wheel("belt" + of, arm.base), arm.wheel(left, arm.base), arm.wheel(right, arm.base);
    for (int i = 0; i < hinges; ++i) arm.link(link(i), i == 0 ? arm.base : link(i - 1));
    arm.link("side" + of, first), arm.link("tool" + of, last);
    std::vector<LoopSpec::Term> belt{{"belt" + of, 0.5, {}}, {first, 2.0 + number(), {}}};
    if (hinges > 1) belt.push_back({last, -1.5 + 0.5 * number(), {}});
    arm.couple("of belt" + of, belt);
    arm.couple("sum" + of, {{left, 0.5, {}}, {right, 0.5, {}}, {last, -2.0 + number(), {}}});
    LoopSpec& difference = arm.couple("difference" + of, {{left, 0.4, {}}, {right, -0.5, {}}});
    for (int i = 0; i < 9; ++i) {
      LoopSpec::Function f;
      f.kind = i % 3 ? "sine" : "cosine", f.numbers = {0.1 * number()}, f.phase = number();
      const double turned = i % 2 ? -0.7 : 0.7;
      if (i < 4)
        f.of = {{last, 1.3 * turned, {}}, {left, turned, {}}};
      else
        f.of = {{last, number(), {}}, {i % 2 && hinges > 1 ? first : left, number(), {}}};
      difference.functions.push_back(f);
    }
  }
  return arm.spec;
}

/// An arm of four links whose hinges turn wheels that stand further inboard: a gear beside the first hinge; a belt to the third that leaves
/// out the second; one wheel across its hinge; and a differential of two wheels on the second link, a sum and a function of sines and a
/// square.
SystemSpec belted_arm(std::uint64_t seed, bool on_ground) {
  ArmBuilder arm(seed, on_ground);
  const auto number = [&](std::mt19937_64& random) { return arm.number(random); };
  std::mt19937_64& random = arm.random;
  arm.wheel("gear", arm.base), arm.wheel("belt", arm.base);
  for (int i = 0; i < 4; ++i) arm.link("link" + std::to_string(i), i == 0 ? arm.base : "link" + std::to_string(i - 1));
  arm.wheel("bevel", "link0"), arm.wheel("left", "link1"), arm.wheel("right", "link1");
  arm.couple("of gear", {{"link0", 4.0 + number(random), {}}, {"gear", -1.0, {}}});
  arm.couple("of belt", {{"belt", 0.5, {}}, {"link0", 2.0 + number(random), {}}, {"link2", -1.5, {}}});
  arm.couple("of bevel", {{"link1", -3.0 + number(random), {}}, {"bevel", 1.0, {}}});
  arm.couple("sum", {{"left", 0.5, {}}, {"right", 0.5, {}}, {"link2", -2.0 + number(random), {}}});
  LoopSpec& difference = arm.couple("difference", {{"left", 0.4, {}}, {"right", -0.5, {}}});
  for (int i = 0; i < 10; ++i) {
    LoopSpec::Function f;
    f.kind = i % 3 ? "sine" : "cosine", f.numbers = {0.1 * number(random)}, f.phase = number(random);
    f.of = {{"link3", 1.0 + number(random), {}}, {i % 2 ? "link2" : "left", number(random), {}}};
    difference.functions.push_back(f);
  }
  LoopSpec::Function square;
  square.kind = "polynomial", square.numbers = {0.1, 0.9, 0.3}, square.of = {{"link3", 1.0, {}}};
  difference.functions.push_back(square);
  return arm.spec;
}

TEST(Loops, WheelsMayTurnWithHingesFurtherOut) {
  for (const bool on_ground : {false, true})
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      SCOPED_TRACE(seed);
      const SystemSpec spec = belted_arm(seed, on_ground);
      const auto model = compiled(spec);
      EXPECT_EQ(model->loops.embedding->transmissions.size(), 4U);
      EXPECT_EQ(model->loops.embedding->wheels.size(), 5U);
      EXPECT_EQ(model->loops.embedding->geared.size(), 4U);
      EXPECT_TRUE(model->loops.embedding->loops.empty());
      expect_forms_to_agree_where_driven(spec, 1, 4);
    }
}

TEST(Loops, WheelsOfOneCarrierMayTurnWithAFewHinges) {
  for (const bool on_ground : {false, true})
    for (const int hinges : {1, 2, 3})
      for (std::uint64_t seed = 1; seed <= 12; ++seed) {
        SCOPED_TRACE(seed);
        const SystemSpec spec = geared_chains(seed, 1, hinges, on_ground);
        const auto model = compiled(spec);
        const Embedding& e = *model->loops.embedding;
        EXPECT_EQ(e.transmissions.size(), 2U);
        ASSERT_EQ(e.chains.size(), 1U);
        EXPECT_EQ(std::ssize(e.chains[0].hinges), hinges);
        EXPECT_TRUE(e.loops.empty() && e.geared.empty());
        expect_forms_to_agree_where_driven(spec, 0, 2);
      }
}
TEST(Loops, ChainsWithWheelsThatAreAlikeGoSideBySide) {
  for (const bool on_ground : {false, true})
    for (const int hinges : {1, 2, 3})
      for (const auto& [chains, sides] : std::map<int, std::vector<int>>{{2, {2}}, {4, {4}}, {7, {4, 2, 1}}})
        for (std::uint64_t seed = 1; seed <= 4; ++seed) {
          SCOPED_TRACE(seed);
          const SystemSpec spec = geared_chains(seed, chains, hinges, on_ground);
          const auto model = compiled(spec);
          std::vector<int> found;
          for (const AlikeChains& side : model->loops.embedding->alike_chains)
            if (!side.half) found.push_back(side.n);
          EXPECT_EQ(found, sides);
          expect_forms_to_agree_where_driven(spec, 3, 5);
        }
}

// A crank turns a slide by a sine: near its dead centre the crank does not follow the slide, and the slide follows the crank.
TEST(Loops, AWheelMayPassADeadCentreOfItsHinge) {
  for (const double angle : {0.3, 1.3, 1.5707, 1.58, 2.0}) {
    BodySpec base = on(rigid("base", 5.0, {0.1, 0, 0}, diagonal({2, 3, 4})), "", "revolute", {{0, 0, 1}});
    base.hinge.q = {0.2}, base.hinge.v = {0.4};
    BodySpec arm = on(rigid("arm", 2.0, {0.5, 0.1, 0}, diagonal({0.1, 0.2, 0.3})), "base", "revolute", {{0, 1, 0}});
    BodySpec crank = on(rigid("crank", 0.5, {0, 0, 0}, diagonal({0.05, 0.05, 0.1})), "base", "revolute", {{0, 0, 1}}, {0.3, 0, 0});
    SystemSpec spec = system({base, arm, crank}, uniform_gravity({0.5, -0.3, -9.81}));
    LoopSpec loop;
    loop.name = "crank and arm", loop.type = "coupling", loop.terms = {{"arm", 1.0, {}}};
    LoopSpec::Function sine;
    sine.kind = "sine", sine.numbers = {-0.8}, sine.of = {{"crank", 1.0, {}}};
    loop.functions = {sine};
    spec.loops = {loop};
    spec.bodies[2].hinge.q = {0.3};  // where wheels follow
    spec.bodies[2].hinge.v = {2.0};
    spec.bodies[1].hinge.q = {0.8 * std::sin(0.3)};
    std::vector<VectorXd> vdot;
    for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
      spec.loop_form = form;
      const auto model = compiled(spec);
      EXPECT_TRUE(form == LoopForm::multipliers || model->loops.embedding->wheels.size() == 1);
      VectorXd q(3), v(3), out(3);
      for (const UserBody& b : model->user) {
        q[b.q] = b.name == "base" ? 0.2 : b.name == "arm" ? 0.8 * std::sin(angle) : angle;
        v[b.v] = b.name == "base" ? 0.4 : b.name == "arm" ? 1.6 * std::cos(angle) : 2.0;
      }
      Workspace ws(*model);
      ASSERT_TRUE(forward_dynamics(*model, ws, {.q = q.data(), .v = v.data()}, out.data()));
      vdot.push_back(out);
    }
    EXPECT_LE(error_of(vdot[0], vdot[1]), 1e-12) << angle;
  }
}

// sin a = sin b holds nothing where both are upright: the ratio of a wheel and its hinge is 1 all the way there.
TEST(Loops, AWheelTellsOfASingularPostureAsOtherLoopsDo) {
  BodySpec base = on(rigid("base", 5.0, {0.1, 0, 0}, diagonal({2, 3, 4})), "", "revolute", {{0, 0, 1}});
  BodySpec arm = on(rigid("arm", 2.0, {0.0, 0.1, 0}, diagonal({0.1, 0.2, 0.3})), "base", "revolute", {{0, 1, 0}});
  BodySpec crank = on(rigid("crank", 0.5, {0, 0, 0}, diagonal({0.05, 0.05, 0.1})), "base", "revolute", {{0, 0, 1}}, {0.3, 0, 0});
  arm.hinge.q = crank.hinge.q = {1.2}, arm.hinge.v = crank.hinge.v = {0.5};
  SystemSpec spec = system({base, arm, crank});
  LoopSpec loop;
  loop.name = "both", loop.type = "coupling";
  LoopSpec::Function sine;
  sine.kind = "sine", sine.numbers = {1.0}, sine.of = {{"arm", 1.0, {}}};
  loop.functions.push_back(sine);
  sine.numbers = {-1.0}, sine.of = {{"crank", 1.0, {}}};
  loop.functions.push_back(sine);
  spec.loops = {loop};
  for (const LoopForm form : {LoopForm::multipliers, LoopForm::embedding}) {
    spec.loop_form = form;
    SimulationOptions steps;  // which end near it: one step over it sees nothing
    steps.integrator.method = "rk4", steps.integrator.fixed_step = 1e-3;
    Simulation sim(compiled(spec), steps);
    EXPECT_TRUE(form == LoopForm::multipliers || !sim.model().loops.embedding->transmissions.empty());
    sim.run(1.0);
    ASSERT_EQ(sim.warnings().all().size(), 1u) << static_cast<int>(form) << render(sim.warnings());
    EXPECT_EQ(sim.warnings().all()[0].what.code, Code::near_singular);
    EXPECT_NEAR(sim.state().q[1], sim.state().q[2], 1e-7) << "in its own branch";
  }
}

TEST(Loops, AGearMayBeDriven) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SystemSpec spec = geared_arms(seed, 1);
    spec.loops[1].prescribed = true;
    std::vector<VectorXd> vdot, lambda, moved;
    for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
      spec.loop_form = form;
      const auto model = compiled(spec);
      Workspace ws(*model);
      const State at = model->initial_state();
      const LoopDrive drive{.more = 0.0, .rate = 0.0, .acceleration = 1.7};
      VectorXd out(model->nv), tau = VectorXd::LinSpaced(model->nv, -0.5, 1.5);
      const Inputs in{.q = at.q.data(), .v = at.v.data(), .tau = tau.data(), .drives = &drive};
      ASSERT_TRUE(forward_dynamics(*model, ws, in, out.data()));
      vdot.push_back(out), lambda.push_back(multipliers(*model, ws, in));
      const VectorXd missing = loop_matrix(*model, ws, at.q.data()) * out;
      EXPECT_NEAR(missing[1], 1.7, 1e-12);
      // The nearest closed state in the metric of the mass matrix.
      State open = at;
      for (Eigen::Index i = 0; i < open.v.size(); ++i) open.v[i] += 0.01 * std::sin(3.0 * static_cast<double>(i));
      for (const UserBody& b : model->user)
        if (b.nq == 1) open.q[b.q] += 0.01 * std::cos(5.0 * b.q);
      LoopProjection projection(*model);
      ASSERT_TRUE(projection.close(open.q.data(), open.v.data(), &drive));
      VectorXd both(open.q.size() + open.v.size());
      both << open.q, open.v;
      moved.push_back(both);
    }
    EXPECT_LE(error_of(vdot[0], vdot[1]), 1e-12) << seed;
    EXPECT_LE(error_of(lambda[0], lambda[1]), 1e-12) << seed;
    EXPECT_LE(error_of(moved[0], moved[1]), 1e-12) << seed;
  }
}

}  // namespace
}  // namespace cardan::test
