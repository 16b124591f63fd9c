// Masses that grow by large ratios from link to link: forward dynamics keeps its digits, one state at a time and in lanes,
// judged by the dense twin in 113 bits on the description itself. Every family of them would lose from 1e-11 to all digits
// without the refinement that compile() puts into the program (docs/mathematics/tree_algorithms.md, 10).
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/dynamics/batch.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/dynamics/observe.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "core/reference/factor.hpp"
#include "core/reference/quad.hpp"
#include "tests/support/builders.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::Vector3d, Eigen::VectorXd;
using reference::DenseTwin, reference::Quad;
using QuadVector = reference::VecX<Quad>;

double random(std::mt19937_64& rng) { return -1.0 + 2.0 * static_cast<double>(rng() >> 11) * 0x1.0p-53; }
Vector3d random_vector(std::mt19937_64& rng) { return {random(rng), random(rng), random(rng)}; }

enum class Order { growing, mixed, shrinking };

/// A chain whose masses span `ratio`; its i-th mass counted from the base.
struct Chain {
  const char* kind;
  int bodies;
  double ratio;
  Order order;
};
std::string name_of(const Chain& c) {
  static constexpr const char* kOrder[] = {"growing", "mixed", "shrinking"};
  return fmt::format("{}_{}_bodies_{}_1e{:.0f}", c.kind, c.bodies, kOrder[static_cast<int>(c.order)], std::log10(c.ratio));
}

SystemSpec chain(const Chain& c, std::mt19937_64& rng) {
  const std::string kind = c.kind;
  const bool planar = kind.starts_with("planar") || kind == "pendulum", pendulum = kind == "pendulum";
  const bool particles = pendulum || kind.ends_with("particles"), balls = kind.starts_with("balls");
  std::vector<int> place(static_cast<std::size_t>(c.bodies));
  for (int i = 0; i < c.bodies; ++i) place[static_cast<std::size_t>(i)] = c.order == Order::shrinking ? c.bodies - 1 - i : i;
  if (c.order == Order::mixed) std::shuffle(place.begin(), place.end(), rng);
  std::vector<BodySpec> bodies;
  for (int i = 0; i < c.bodies; ++i) {
    const double mass = std::pow(c.ratio, place[static_cast<std::size_t>(i)] / (c.bodies - 1.0) - 0.5) * (1.5 + 0.5 * random(rng));
    const std::string name = "b" + std::to_string(i), inboard = i > 0 ? "b" + std::to_string(i - 1) : "";
    Vector3d com = random_vector(rng), next = random_vector(rng);
    if (planar) com.y() = next.y() = 0.0;
    if (pendulum) com = next = {0.0, 0.0, -1.0};
    if (kind == "balls_along_the_rod") next = {0.0, 0.0, -1.0 - 0.3 * random(rng)};
    BodySpec body = particle(name, mass, com);
    // a particle has no inertia about an axis through it: a ball needs a body, and so do six degrees of freedom
    if (!particles) {
      const Vector3d a = Vector3d(0.1, 0.15, 0.2) + 0.05 * random_vector(rng).cwiseAbs();
      body = rigid(name, mass, com, diagonal(mass * Vector3d(a.y() + a.z(), a.x() + a.z(), a.x() + a.y())));
    }
    const Vector3d onode = i > 0 ? bodies.back().nodes.front().position : Vector3d(Vector3d::Zero());
    std::string type = balls ? "ball" : "revolute";
    if (kind == "free_root" && i == 0) type = "free";
    const Vector3d axis = planar ? Vector3d(0, 1, 0) : Vector3d(random_vector(rng));
    body = on(body, inboard, type, type == "revolute" ? std::vector<Vector3d>{axis.normalized()} : std::vector<Vector3d>{}, onode);
    NodeSpec tip;
    tip.name = "tip";
    tip.position = next;
    body.nodes.push_back(tip);
    bodies.push_back(std::move(body));
  }
  return system(std::move(bodies), uniform_gravity({0.3, -0.4, -9.81}));
}

struct RandomState {
  VectorXd q, v, tau;
};
RandomState random_state(const Model& m, std::mt19937_64& rng) {
  const auto vector = [&](int n, double size) { return VectorXd(VectorXd::NullaryExpr(n, [&] { return size * random(rng); })); };
  RandomState s{m.initial_state().q, vector(m.nv, 2.0), VectorXd::Zero(m.nv)};
  const VectorXd zero = s.q, move = vector(m.nv, 3.0);
  m.retract(zero.data(), move.data(), s.q.data());
  return s;
}

VectorXd exact(const DenseTwin<Quad>& twin, const RandomState& s) {
  return twin.at(s.q.cast<Quad>(), s.v.cast<Quad>()).forward(s.tau.cast<Quad>()).cast<double>();
}
double relative_to(const VectorXd& a, const VectorXd& b) {
  const double e = VectorXd(a - b).stableNorm() / b.stableNorm();
  return std::isfinite(e) ? e : HUGE_VAL;
}

/// What half an ulp in every number of the input, taken up or down at random, changes in v'.
template <class Truth>
double of_inputs(SystemSpec spec, RandomState s, const VectorXd& vdot, std::mt19937_64& rng, const Truth& truth) {
  const auto touch = [&](auto& x) { x *= 1.0 + 0x1p-53 * (random(rng) > 0 ? 2.0 : -1.0); };
  const auto touch_all = [&](auto&& list) {
    for (auto& x : list) touch(x);
  };
  for (BodySpec& b : spec.bodies) {
    touch(b.mass);
    touch_all(b.com);
    touch_all(b.hinge.onode_position);
    for (int i = 0; i < 3; ++i) touch(b.inertia_com(i, i));
  }
  touch_all(s.q);
  touch_all(s.v);
  const double moved = relative_to(truth(spec, s), vdot);
  EXPECT_TRUE(std::isfinite(moved)) << "as a limit it would let anything pass";
  return moved;
}
double of_inputs(const SystemSpec& spec, const RandomState& s, const VectorXd& vdot, std::mt19937_64& rng) {
  return of_inputs(spec, s, vdot, rng, [](const SystemSpec& d, const RandomState& x) { return exact(DenseTwin<Quad>(d), x); });
}

/// The same model, its program without refinement.
std::shared_ptr<Model> unrefined(const Model& m) {
  auto without = std::make_shared<Model>(m);
  std::erase_if(without->program, [](const Op& op) { return op.code == OpCode::refine; });
  return without;
}
VectorXd forward(const Model& m, const RandomState& s) {
  Workspace ws(m);
  VectorXd vdot(m.nv);
  const VectorXd zero = VectorXd::Zero(m.nv);
  const Inputs in{.q = s.q.data(), .v = s.v.data(), .tau = s.tau.data(), .vdot = zero.data()};
  return forward_dynamics(m, ws, in, vdot.data()) ? vdot : VectorXd::Constant(m.nv, NAN);
}

constexpr double kEnough = 1e-13;  // or a hundred times what half an ulp of the inputs does

class GradedChains : public testing::TestWithParam<Chain> {};

// 30 states of chains with other random numbers each, one state at a time and in lanes.
TEST_P(GradedChains, KeepTheDigitsOfForwardDynamics) {
  const Chain& c = GetParam();
  std::mt19937_64 rng(static_cast<std::uint64_t>(c.bodies) * 1000 + static_cast<std::uint64_t>(std::log10(c.ratio)));
  double worst = 0.0, worst_lanes = 0.0, without = 0.0;
  int refined = 0;
  for (int model = 0; model < 6; ++model) {
    const SystemSpec spec = chain(c, rng);
    const auto m = compiled(spec);
    refined += m->has(OpCode::refine);
    const auto plain = unrefined(*m);
    const DenseTwin<Quad> twin(spec);
    Batch batch(*m);
    std::vector<RandomState> states;
    for (int i = 0; i < 5; ++i) states.push_back(random_state(*m, rng));
    const auto many = static_cast<Eigen::Index>(states.size());
    Eigen::MatrixXd q(m->nq, many), v(m->nv, many), in_lanes(m->nv, many);
    for (Eigen::Index i = 0; i < many; ++i)
      q.col(i) = states[static_cast<std::size_t>(i)].q, v.col(i) = states[static_cast<std::size_t>(i)].v;
    EXPECT_EQ(batch.forward_dynamics({.n = static_cast<int>(many), .q = q.data(), .v = v.data()}, in_lanes.data(), nullptr), 0);
    for (Eigen::Index i = 0; i < many; ++i) {
      const RandomState& s = states[static_cast<std::size_t>(i)];
      const VectorXd vdot = exact(twin, s);
      const double error = relative_to(forward(*m, s), vdot), lanes = relative_to(in_lanes.col(i), vdot);
      without = worse(without, relative_to(forward(*plain, s), vdot));
      worst = worse(worst, error), worst_lanes = worse(worst_lanes, lanes);
      if (error <= kEnough && lanes <= kEnough) continue;
      const double allowed = 100 * of_inputs(spec, s, vdot, rng);
      EXPECT_LE(error, worse(kEnough, allowed)) << "model " << model << " state " << i;
      EXPECT_LE(lanes, worse(kEnough, allowed)) << "in lanes; model " << model << " state " << i;
    }
  }
  RecordProperty("worst",
                 fmt::format("{:.1e}, lanes {:.1e}, without refinement {:.1e}, refined {} of 6", worst, worst_lanes, without, refined));
}

std::vector<Chain> chains() {
  std::vector<Chain> all;
  for (const char* kind :
       {"pendulum", "planar_particles", "planar_rigid", "spatial_particles", "spatial_rigid", "balls", "balls_along_the_rod", "free_root"})
    for (const int bodies : {3, 4, 6})
      for (const double ratio : {1e6, 1e9, 1e12})
        for (const Order order : {Order::growing, Order::mixed, Order::shrinking})
          if (order != Order::shrinking || bodies == 4) all.push_back({kind, bodies, ratio, order});
  return all;
}
INSTANTIATE_TEST_SUITE_P(All, GradedChains, testing::ValuesIn(chains()), [](const auto& p) { return name_of(p.param); });

// Growing chains with all that enters the residual beside inertia: forces on nodes (at mass centres and elsewhere, in node axes and in
// world axes), a central field with its gradient, wheels and merged bodies, a prescribed hinge.
TEST(GradedMasses, KeepTheirDigitsUnderLoadsWithWheelsAndGivenMotions) {
  std::mt19937_64 rng(5);
  int refined = 0;
  for (const char* kind : {"planar_particles", "spatial_particles", "planar_rigid", "balls", "free_root"})
    for (int model = 0; model < 6; ++model) {
      SystemSpec spec = chain({kind, 4, 1e12, Order::growing}, rng);
      const bool central = model % 2 == 1, given = model >= 4 && spec.bodies[1].hinge.type == "revolute";
      if (central) spec.gravity = central_gravity(2e4, true, {3.0, -4.0, 20.0});
      for (BodySpec& b : spec.bodies) {
        NodeSpec com;
        com.name = "com";
        com.position = b.com;
        b.nodes.push_back(com);
      }
      if (model >= 2) {
        BodySpec wheel = rigid("wheel", 0.3 * spec.bodies[1].mass, {0, 0, 0}, 0.1 * spec.bodies[1].mass * diagonal({0.5, 0.5, 1.0}));
        spec.bodies.push_back(on(wheel, "b1", "revolute", {{0, 0, 1}}, {0.1, -0.2, 0.3}));
        spec.bodies.push_back(on(particle("ballast", 0.5 * spec.bodies[2].mass, {0.1, 0.2, -0.3}), "b2", "locked", {}, {0.2, 0.1, 0.1}));
      }
      if (given) spec.bodies[1].hinge.prescribed = {0};
      // a central field is expanded about the mass centre of what is merged: another (L / r)^3 than that of its parts
      const auto m = compiled(spec, {.merge_locked = !central, .world_wrenches = true});
      refined += m->has(OpCode::refine);
      const std::vector<bool> prescribed = [&] {
        std::vector<bool> all(static_cast<std::size_t>(m->nv), false);
        for (std::size_t i = 0; i < m->prescribed.size(); ++i) all[i] = m->prescribed[i] != 0;
        return all;
      }();
      Workspace ws(*m);
      for (int i = 0; i < 5; ++i) {
        RandomState s = random_state(*m, rng);
        VectorXd vdot_given = VectorXd::Zero(m->nv);
        for (int j = 0; j < m->nv; ++j) {
          if (prescribed[static_cast<std::size_t>(j)]) vdot_given[j] = random(rng);
        }
        const auto reference_of = [&](const SystemSpec& description, const RandomState& state, const std::vector<NodeWrench>& loads) {
          const DenseTwin<Quad> judge(description);
          const auto at = judge.at(state.q.cast<Quad>(), state.v.cast<Quad>());
          reference::NodeWrenches<Quad> wrenches;
          for (const NodeWrench& w : loads) {
            const UserNode& node = m->nodes[static_cast<std::size_t>(w.node)];
            const std::string& body = m->user[static_cast<std::size_t>(node.body)].name;
            const std::string name = node.name.substr(body.size() + 1);
            QuadVector f = to_eigen(w.f).cast<Quad>();
            if (w.world_axes) {
              const reference::Mat3<Quad> R = at.node(body, name).R.transpose();
              const reference::Vec3<Quad> n = R * f.head(3), force = R * f.tail(3);
              f << n, force;
            }
            wrenches.push_back({body, name, f});
          }
          return VectorXd(at.hybrid(state.tau.cast<Quad>(), prescribed, vdot_given.cast<Quad>(), wrenches).vdot.cast<double>());
        };
        std::vector<NodeWrench> loads;
        for (int k = 0; k < 4; ++k)
          for (const char* node : {"com", "tip"}) {
            const double size = spec.bodies[static_cast<std::size_t>(k)].mass;
            const bool couple = spec.bodies[static_cast<std::size_t>(k)].type != "particle";
            NodeWrench w{m->find_node("b" + std::to_string(k) + "." + node),
                         k % 2 == 0,
                         {from_eigen(Vector3d(couple ? size * random_vector(rng) : Vector3d(0, 0, 0))),
                          from_eigen(Vector3d(5.0 * size * random_vector(rng)))}};
            loads.push_back(w);
          }
        const Inputs in{.q = s.q.data(), .v = s.v.data(), .tau = s.tau.data(), .vdot = vdot_given.data(), .wrenches = loads};
        VectorXd vdot(m->nv);
        ASSERT_TRUE(forward_dynamics(*m, ws, in, vdot.data()));
        const VectorXd expected = reference_of(spec, s, loads);
        const double error = relative_to(vdot, expected);
        if (error <= kEnough) continue;
        EXPECT_LE(error, 100 * of_inputs(spec, s, expected, rng,
                                         [&](const SystemSpec& d, const RandomState& x) { return reference_of(d, x, loads); }))
            << kind << " model " << model << " state " << i;
      }
    }
  EXPECT_GE(refined, 25) << "of 30";
}

// The first four of the pendulum of the documents: 1e-6, 0.01, 100, 1e6 kg.
SystemSpec pendulum() {
  std::vector<BodySpec> bodies;
  for (const double mass : {1e-6, 0.01, 100.0, 1e6}) {
    const auto i = bodies.size();
    bodies.push_back(on(particle("p" + std::to_string(i), mass, {0, 0, -1}), i > 0 ? "p" + std::to_string(i - 1) : "", "revolute",
                        {{0, 1, 0}}, i > 0 ? Vector3d(0, 0, -1) : Vector3d(0, 0, 0)));
  }
  return system(std::move(bodies), uniform_gravity({0, 0, -9.81}));
}

// By 60 digits (the equations of the pendulum in closed form, in multiple precision).
TEST(GradedMasses, PendulumOfParticlesHasItsKnownAcceleration) {
  const auto m = compiled(pendulum());
  RandomState s{VectorXd(4), VectorXd(4), VectorXd::Zero(4)};
  s.q << 0.3, -0.5, 0.9, 0.4;
  s.v << 0.5, -1, 2, 0.3;
  VectorXd known(4);
  known << -27.812618417906, 58.391643377350, -29.321318458907, -1.257910442427;
  EXPECT_LT(relative_to(forward(*m, s), known), 1e-13) << "digits given: 1e-14";
  EXPECT_GT(relative_to(forward(*unrefined(*m), s), known), 1e-12) << "without: 1.4e-9, or 1.3e-12 where products are not fused";
}

// A lane does not see its neighbours, whatever number of passes they take; and a second call at the same q, where P, D and G stay,
// gives the bits of the first.
TEST(GradedMasses, HaveTheSameBitsBesideOtherStatesAndAgain) {
  std::mt19937_64 rng(9);
  const SystemSpec spec = chain({"balls", 4, 1e12, Order::growing}, rng);
  const auto m = compiled(spec);
  Batch batch(*m);
  constexpr int kStates = 19;
  Eigen::MatrixXd q(m->nq, kStates), v(m->nv, kStates), together(m->nv, kStates), alone(m->nv, 1);
  for (int i = 0; i < kStates; ++i) {
    const RandomState s = random_state(*m, rng);
    q.col(i) = s.q, v.col(i) = (i % 3 == 0 ? 0.0 : 1.0) * s.v;
  }
  batch.forward_dynamics({.n = kStates, .q = q.data(), .v = v.data()}, together.data());
  Workspace ws(*m);
  for (int i = 0; i < kStates; ++i) {
    batch.forward_dynamics({.n = 1, .q = q.col(i).data(), .v = v.col(i).data()}, alone.data());
    EXPECT_EQ((alone.col(0) - together.col(i)).cwiseAbs().maxCoeff<Eigen::PropagateNaN>(), 0.0) << i;
    VectorXd first(m->nv), again(m->nv);
    const VectorXd other = VectorXd::Random(m->nv);
    const Inputs in{.q = q.col(i).data(), .v = v.col(i).data()}, between{.q = q.col(i).data(), .v = other.data()};
    Workspace fresh(*m);
    ASSERT_TRUE(forward_dynamics(*m, fresh, in, first.data()));
    ASSERT_TRUE(forward_dynamics(*m, ws, between, again.data()) && forward_dynamics(*m, ws, in, again.data()));
    EXPECT_EQ((again - first).cwiseAbs().maxCoeff<Eigen::PropagateNaN>(), 0.0) << i;
  }
}

TEST(GradedMasses, InverseOfTheMassMatrixKeepsItsDigits) {
  std::mt19937_64 rng(3);
  for (const char* kind : {"pendulum", "planar_rigid", "balls", "free_root"}) {
    const SystemSpec spec = chain({kind, 4, 1e9, Order::growing}, rng);
    const auto m = compiled(spec);
    const RandomState s = random_state(*m, rng);
    Workspace ws(*m);
    Eigen::MatrixXd inverse(m->nv, m->nv);
    ASSERT_TRUE(mass_matrix_inverse(*m, ws, s.q.data(), inverse.data()));
    const auto at = DenseTwin<Quad>(spec).at(s.q.cast<Quad>(), s.v.cast<Quad>());
    const reference::Factor<Quad> M(at.M);
    for (int j = 0; j < m->nv; ++j) {
      const QuadVector unit = QuadVector::Unit(m->nv, j);
      EXPECT_LT(relative_to(inverse.col(j), M.solve(unit).cast<double>()), kEnough) << kind << ", column " << j;
    }
    EXPECT_EQ((inverse - inverse.transpose()).cwiseAbs().maxCoeff<Eigen::PropagateNaN>(), 0.0);
  }
}

// The frames that are turned for the refinement are nobody's business: poses, velocities, accelerations, reactions, the mass matrix and
// inverse dynamics are those of the user's frames.
TEST(GradedMasses, AreSeenInTheUsersFrames) {
  std::mt19937_64 rng(4);
  const SystemSpec spec = chain({"balls", 4, 1e6, Order::growing}, rng);
  const auto m = compiled(spec);
  ASSERT_TRUE(m->has(OpCode::refine) && m->graded.turned.size() == 3);
  const RandomState s = random_state(*m, rng);
  const auto at = DenseTwin<Quad>(spec).at(s.q.cast<Quad>(), s.v.cast<Quad>());
  const VectorXd exact_vdot = at.forward(s.tau.cast<Quad>()).cast<double>();
  Workspace ws(*m);
  Observer observer(*m, ws);
  VectorXd again(m->nv);
  const Inputs in{.q = s.q.data(), .v = s.v.data(), .tau = s.tau.data()};
  ASSERT_TRUE(forward_dynamics(*m, ws, in, again.data()));
  observer.update(in, again.data());
  const auto wrenches = at.hinge_wrenches(exact_vdot.cast<Quad>());
  const double largest = wrenches.back().cast<double>().norm();
  for (int k = 0; k < 4; ++k) {
    const std::string body = "b" + std::to_string(k);
    const NodeState seen = observer.node(m->find_node(body + ".tip"));
    const auto truth = at.node(body, "tip");
    EXPECT_LT((seen.position - truth.x.cast<double>()).norm(), 1e-14) << body;
    EXPECT_LT((seen.R_WN - truth.R.cast<double>()).norm(), 1e-14) << body;
    EXPECT_LT((seen.velocity - truth.velocity.cast<double>()).norm(), 1e-13) << body;
    EXPECT_LT(relative_to(seen.acceleration, truth.acceleration(exact_vdot.cast<Quad>()).cast<double>()), 1e-12) << body;
    EXPECT_LT((to_eigen(observer.hinge_wrench(k)) - wrenches[static_cast<std::size_t>(k)].cast<double>()).norm(), 1e-12 * largest) << body;
  }
  EXPECT_LT(relative_to(mass_matrix(*m, ws, s.q.data()).reshaped(), at.M.cast<double>().eval().reshaped()), 1e-14);
  VectorXd tau(m->nv);
  const VectorXd given = VectorXd::Ones(m->nv);
  inverse_dynamics(*m, ws, Inputs{.q = s.q.data(), .v = s.v.data(), .vdot = given.data()}, tau.data());
  EXPECT_LT(relative_to(tau, at.inverse(given.cast<Quad>()).cast<double>()), 1e-13);
}

// Who does not need it has nothing of it: no op, no memory, no numbers beside the model.
TEST(GradedMasses, AloneHaveTheOpAndItsMemory) {
  const auto m = compiled(pendulum());
  ASSERT_TRUE(m->has(OpCode::refine));
  EXPECT_NE(m->refinement.find("p3"), std::string::npos) << m->refinement;
  SystemSpec other = pendulum();
  for (std::size_t i = 0; i < 4; ++i) other.bodies[i].mass = std::pow(10.0, 3.0 - static_cast<double>(i));
  const auto plain = compiled(other);
  EXPECT_FALSE(plain->has(OpCode::refine));
  EXPECT_TRUE(plain->refinement.empty() && plain->graded.swept.empty() && plain->graded.arm.empty());
  const Workspace with(*m), without(*plain);
  EXPECT_EQ(with.bytes() - without.bytes(), 4 * sizeof(double) + 5 * sizeof(Force<double>));
  // heavy on light, yet nothing is lost: a satellite on a yoke of a hundredth of its mass
  const auto yoke =
      compiled(system({on(rigid("yoke", 5.0, {0, 0, 0.1}, diagonal({0.1, 0.1, 0.05})), "", "revolute", {{0, 0, 1}}),
                       on(rigid("payload", 1000.0, {0, 0, 0.5}, diagonal({200, 210, 220})), "yoke", "revolute", {{1, 0, 0}}, {0, 0, 0.2})},
                      uniform_gravity({0, 0, -9.81})));
  EXPECT_FALSE(yoke->has(OpCode::refine)) << yoke->refinement;
}

}  // namespace
}  // namespace cardan::test
