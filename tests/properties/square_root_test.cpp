// Hinges factored in square-root form: everywhere the same dynamics, and near the lock of a gimbal with the errors of a condition number
// where D has those of its square (docs/mathematics/tree_algorithms.md, 11). Judged by the dense twin in 113 bits.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/dynamics/batch.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/operators/mass_matrix.hpp"
#include "core/operators/tree_operators.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "core/reference/quad.hpp"
#include "tests/properties/accurate.hpp"

namespace cardan::test {
namespace {

using reference::DenseTwin, reference::Quad;

/// Rigid ones, any, those with given motions, and those whose many modes are eliminated through their nodes.
const TreeOptions kKinds[] = {{.flexible = 0.0},
                              {},
                              {.locked = 0.1, .prescribed = 0.3},
                              {.bodies = 5, .flexible = 0.6, .modes = 20, .plain_masses = true},
                              {.flexible = 0.0, .wheels = 0.0, .prescribed = 0.3, .hinges = {"gimbal", "universal", "planar", "ball"}}};

TEST(SquareRoot, ForwardInvertsInverse) {
  for (const TreeOptions& options : kKinds)
    for_all_trees(options, 1e-11, [](const RandomTree& tree) {
      Loaded s(with_factor(tree, HingeFactor::square_root));
      s.tau = s.inverse(s.vdot_given);
      return apart(s.forward(), s.vdot_given);
    });
}

// Reactions, the response to forces and the mass matrix's inverse are made of D, G and nu, which stand where they always do.
TEST(SquareRoot, GivesTheSameReactionsAndInverseOfTheMassMatrix) {
  for (const TreeOptions& options : kKinds)
    for_all_trees(
        options, 1e-10,
        [](const RandomTree& tree) {
          Loaded plain(with_factor(tree, HingeFactor::cholesky)), rooted(with_factor(tree, HingeFactor::square_root));
          const VectorXd vdot = plain.forward(), other = rooted.forward();
          Observer of_plain(*plain.model, plain.ws), of_rooted(*rooted.model, rooted.ws);
          of_plain.update(plain.in(), vdot.data()), of_rooted.update(rooted.in(), other.data());
          double difference = apart(other, vdot), largest_force = 0.0, between = 0.0;
          for (std::size_t i = 0; i < plain.model->user.size(); ++i) {
            const Vector6d f = to_eigen(of_plain.hinge_wrench(static_cast<int>(i)));
            largest_force = worse(largest_force, largest(f));
            between = worse(between, distance(to_eigen(of_rooted.hinge_wrench(static_cast<int>(i))), f));
          }
          difference = worse(difference, relative(between, largest_force == 0.0 ? 1.0 : largest_force));
          const double* q = rooted.state.q.data();
          if (!plain.model->has_prescribed()) {
            const int nv = plain.model->nv;
            MatrixXd one(nv, nv), two(nv, nv);
            if (!mass_matrix_inverse(*plain.model, plain.ws, q, one.data()) ||
                !mass_matrix_inverse(*rooted.model, rooted.ws, q, two.data()))
              return HUGE_VAL;
            difference = worse(difference, apart(two, one));
          }
          return difference;
        },
        30);
}

TEST(SquareRoot, OfManyStatesIsThatOfEach) {
  for (const TreeOptions& options : kKinds)
    for_all_trees(
        options, 1e-11,
        [](const RandomTree& tree) {
          Loaded s(with_factor(tree, HingeFactor::square_root));
          s.wrenches.clear();
          Batch batch(*s.model);
          const int n = batch.width();
          MatrixXd q(s.model->nq, n), v(s.model->nv, n), vdot(s.model->nv, n);
          for (int k = 0; k < n; ++k) {
            const VectorXd move = VectorXd::Constant(s.model->nv, 0.01 * k);
            s.model->retract(s.state.q.data(), move.data(), q.col(k).data());
            v.col(k) = s.state.v - move;
          }
          const MatrixXd tau = s.tau.replicate(1, n), given = s.vdot_given.replicate(1, n);
          if (batch.forward_dynamics({n, q.data(), v.data(), tau.data(), given.data(), true}, vdot.data()) != 0) return HUGE_VAL;
          double difference = 0.0;
          for (int k = 0; k < n; ++k) {
            s.state.q = q.col(k), s.state.v = v.col(k);
            difference = worse(difference, apart(vdot.col(k), s.forward()));
          }
          return difference;
        },
        30);
}

TEST(SquareRoot, IsDifferentiated) {
  for (const TreeOptions& options : kKinds)
    for_all_trees(
        options, 1e-9, [](const RandomTree& tree) { return jacobian_error(with_factor(tree, HingeFactor::square_root).spec); }, 12);
}

// Masked components too: D, G and P+ are by definition those of the other form.
TEST(SquareRoot, OperatorsAreTheSame) {
  using operators::TreeOperators;
  for_all_trees(
      {.bodies = 6}, 1e-11,
      [](const RandomTree& tree) {
        double difference = 0.0;
        for (const bool masked : {false, true}) {
          Loaded plain(with_factor(tree, HingeFactor::cholesky)), rooted(with_factor(tree, HingeFactor::square_root));
          std::vector<std::uint8_t> free(static_cast<std::size_t>(plain.model->nv), 1);
          for (std::size_t i = 0; masked && i < free.size(); i += 3) free[i] = 0;
          TreeOperators a(plain.model), b(rooted.model);
          a.at(plain.state.q.data()), b.at(rooted.state.q.data());
          a.articulate({.W = nullptr, .free = free}), b.articulate({.W = nullptr, .free = free});
          for (int i = 0; i < static_cast<int>(a.bodies().size()); ++i)
            difference = worse({difference, apart(b.D(i), a.D(i)), apart(b.G(i), a.G(i), 1.0), apart(b.S(i), a.S(i)),
                                apart(b.P_plus(i), a.P_plus(i), largest(a.P(i)))});
        }
        return difference;
      },
      30);
}

/// With all gimbals at this distance from their lock: their axes are perpendicular.
RandomTree near_lock(RandomTree tree, double distance) {
  for (BodySpec& b : tree.spec.bodies)
    if (b.hinge.type == "gimbal") b.hinge.q[1] = 0.5 * std::numbers::pi - distance;
  tree.loads.clear();
  return tree;
}

/// Errors of v' in both forms, medians and largest, over `count` trees that have gimbals, their states and forces random; exact is the twin
/// in 113 bits.
struct NearLock {
  std::vector<double> cholesky, square_root;
};
NearLock errors_near_lock(const TreeOptions& options, std::size_t count, double distance) {
  NearLock out;
  for (unsigned seed = 1; out.square_root.size() < count; ++seed) {
    const RandomTree tree = near_lock(random_tree(seed, options), distance);
    if (std::ranges::find(tree.spec.bodies, "gimbal", [](const BodySpec& b) { return b.hinge.type; }) == tree.spec.bodies.end()) continue;
    VectorXd exact;
    const auto error = [&](HingeFactor factor) {
      Loaded s(with_factor(tree, factor));
      if (exact.size() == 0) {
        std::vector<bool> given(idx(s.model->nv));
        for (std::size_t i = 0; i < s.model->prescribed.size(); ++i) given[i] = s.model->prescribed[i] != 0;
        const auto twin = DenseTwin<Quad>(tree.spec).at(s.state.q.cast<Quad>(), s.state.v.cast<Quad>());
        exact = twin.hybrid(s.tau.cast<Quad>(), given, s.vdot_given.cast<Quad>()).vdot.cast<double>();
      }
      return relative((s.forward() - exact).norm(), exact.norm());
    };
    out.square_root.push_back(error(HingeFactor::square_root));
    if (distance > 3e-7) out.cholesky.push_back(error(HingeFactor::cholesky));  // nearer, D has no digit and no positive pivot
  }
  std::ranges::sort(out.square_root), std::ranges::sort(out.cholesky);
  return out;
}

// The columns of H* have a condition number of 1 / distance. Half an ulp of the coordinate that tells the distance moves v' by half an ulp
// over the distance, 1.1e-16 / distance: the data allow no less. Some such roundings add up, fifty at most. By D the error is half an ulp
// over the square of the distance.
TEST(SquareRoot, ErrorsGrowAsTheConditionNumberAndThoseOfDAsItsSquare) {
  struct Kind {
    const char* name;
    TreeOptions options;
    std::size_t count;
    std::vector<double> distances;
  };
  const Kind kinds[] = {{"rigid",
                         {.bodies = 5, .flexible = 0.0, .wheels = 0.0, .hinges = {"gimbal", "revolute", "universal"}},
                         15,
                         {1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8}},
                        {"given motions",
                         {.bodies = 5, .flexible = 0.0, .wheels = 0.0, .prescribed = 0.2, .hinges = {"gimbal", "revolute", "universal"}},
                         15,
                         {1e-3, 1e-6}},
                        {"modes", {.bodies = 4, .flexible = 0.7, .wheels = 0.0, .hinges = {"gimbal", "revolute"}}, 5, {1e-3, 1e-6}},
                        {"by nodes",
                         {.bodies = 3, .flexible = 0.6, .modes = 9, .wheels = 0.0, .plain_masses = true, .hinges = {"gimbal", "revolute"}},
                         5,
                         {1e-3, 1e-6}}};
  for (const Kind& kind : kinds)
    for (const double distance : kind.distances) {
      const double data = 0x1p-53 / distance;
      const NearLock e = errors_near_lock(kind.options, kind.count, distance);
      const auto keep = [&](const char* factor, const std::vector<double>& errors) {
        RecordProperty(fmt::format("{}, {:g} rad, {}", kind.name, distance, factor),
                       fmt::format("{:.1e}, {:.1e}", errors[errors.size() / 2], errors.back()));
      };
      keep("square_root", e.square_root);
      EXPECT_LT(e.square_root.back(), 50.0 * data) << kind.name << ", " << distance;
      if (e.cholesky.empty()) continue;
      keep("cholesky", e.cholesky);
      EXPECT_GT(e.cholesky[e.cholesky.size() / 2], 0.3 * data / distance)
          << kind.name << ", " << distance << ": is there something to gain?";
    }
}

// Of the sweeps and of the operators, by two QR that share no line; M^-1 itself grows as the square of 1 / distance.
TEST(SquareRoot, InverseOfTheMassMatrixKeepsItsDigitsNearALock) {
  for (const double distance : {1e-3, 1e-6}) {
    const RandomTree tree =
        near_lock(random_tree(3, {.bodies = 5, .flexible = 0.4, .wheels = 0.0, .hinges = {"gimbal", "revolute"}}), distance);
    const Loaded s(with_factor(tree, HingeFactor::square_root));
    Workspace ws(*s.model);
    MatrixXd by_sweeps(s.model->nv, s.model->nv);
    ASSERT_TRUE(mass_matrix_inverse(*s.model, ws, s.state.q.data(), by_sweeps.data()));
    operators::TreeOperators letters(s.model);
    letters.at(s.state.q.data());
    letters.articulate(), letters.operational_space();
    EXPECT_LT(apart(by_sweeps, operators::mass_matrix_inverse(letters)), 50.0 * 0x1p-53 / distance) << distance;
    EXPECT_GT(largest(by_sweeps), 0.01 / (distance * distance));
  }
}

// A gimballed base with an arm on a ball, its tip held at a distance.
TEST(SquareRoot, LoopsAreClosedByMultipliersThen) {
  const auto vdot = [](HingeFactor factor, LoopForm form, std::string* why) {
    BodySpec base = on(rigid("base", 4.0, {0.1, 0.2, 0}, diagonal({0.5, 0.6, 0.7})), "", "gimbal", {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}});
    BodySpec arm = on(rigid("arm", 2.0, {0.4, 0, 0.1}, diagonal({0.1, 0.3, 0.2})), "base", "ball", {}, {1.0, 0.0, 0.0});
    base.hinge.factor = arm.hinge.factor = factor;
    SystemSpec spec = system({base, arm}, uniform_gravity({1.0, -2.0, -9.81}));
    LoopSpec loop;
    loop.name = "rod", loop.type = "distance", loop.length = std::hypot(0.7, 1.0);
    loop.from.position = {2.5, 0.3, 1.0}, loop.to.body = "arm", loop.to.position = {0.8, 0.3, 0.0};
    spec.loops = {loop}, spec.loop_form = form;
    const auto model = compiled(spec);
    if (why) *why = model->loops.sets.front().form + ": " + model->loops.sets.front().why;
    const State s = model->initial_state();
    Workspace ws(*model);
    VectorXd out(model->nv);
    EXPECT_TRUE(forward_dynamics(*model, ws, Inputs{.q = s.q.data(), .v = s.v.data()}, out.data()));
    return out;
  };
  std::string why;
  const VectorXd wanted = vdot(HingeFactor::cholesky, LoopForm::embedding, nullptr);
  EXPECT_LT(apart(vdot(HingeFactor::square_root, LoopForm::automatic, &why), wanted), 1e-13);
  EXPECT_EQ(why, "multipliers: a hinge is factored in square-root form");
}

}  // namespace
}  // namespace cardan::test
