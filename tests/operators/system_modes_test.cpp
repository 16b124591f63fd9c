// Modes of the assembled system: against the dense generalised problem on random trees, and closed forms of uniform chains.
#include "core/operators/system_modes.hpp"

#include <Eigen/Dense>
#include <numbers>

#include "core/linalg/dense.hpp"
#include "core/linalg/eigenpairs.hpp"
#include "core/operators/apply.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {
namespace {

using namespace cardan::operators;
using namespace cardan::operators::letters;
using operators::system_modes;
using operators::SystemModes;

/// K of springs and modes, dense.
MatrixXd stiffness(const Model& m) {
  MatrixXd K = MatrixXd::Zero(m.nv, m.nv);
  for (const HingeLoad& s : m.loads) K(s.v, s.v) += s.p[0];  // springs
  for (const SweepBody& b : m.bodies)
    for (int j = 0; j < b.n_modes; ++j)
      for (int i = 0; i < b.n_modes; ++i) {
        const FlexibleBody& f = m.flexible[static_cast<std::size_t>(b.flexible)];
        if (f.K_diagonal && i == j) K(b.etadot + i, b.etadot + i) = f.K[static_cast<std::size_t>(i)];
        if (!f.K_diagonal) K(b.etadot + i, b.etadot + j) = f.K[static_cast<std::size_t>(j * b.n_modes + i)];
      }
  return K;
}

TEST(SystemModes, AgreeWithTheDenseProblem) {
  for (const double flexible : {0.0, 0.5, 1.0})
    for (const double prescribed : {0.0, 0.2})
      for_all_trees({.bodies = 7, .flexible = flexible, .modes = 0, .prescribed = prescribed, .springs = true}, 1e-9,
                    [](const RandomTree& tree) {
                      const auto model = compiled(tree.spec);
                      TreeOperators ops(model);
                      ops.at(model->initial_state().q.data());
                      const MatrixXd M = dense<false>(mass, ops), K = stiffness(*model);
                      std::vector<int> free;
                      for (int v = 0; v < model->nv; ++v)
                        if (!model->has_prescribed() || !model->prescribed[static_cast<std::size_t>(v)]) free.push_back(v);
                      const SystemModes modes = system_modes(ops, {.elastic = model->nv, .rigid = model->nv});
                      if (modes.frequency.size() != static_cast<Eigen::Index>(free.size())) return HUGE_VAL;
                      if (free.empty()) return 0.0;
                      const VectorXd lambda = generalised_eigenvalues(K(free, free), M(free, free)).value();
                      const double size = largest(lambda);
                      double worst = 0.0;
                      for (Eigen::Index j = 0; j < lambda.size(); ++j) {
                        const double mine = std::pow(2.0 * std::numbers::pi * modes.frequency[j], 2);
                        worst = worse(worst, relative(mine - lambda[j], worse(std::abs(lambda[j]), 1e-6 * size)));
                      }
                      const MatrixXd X = modes.shapes;
                      const MatrixXd one = MatrixXd::Identity(X.cols(), X.cols());
                      worst = worse(worst, largest(X.transpose() * M * X - one));
                      worst = worse(worst, largest(modes.kinetic.colwise().sum().array() - 1.0));
                      if (modes.frequency.size() > modes.first_elastic)
                        worst = worse(worst, largest(modes.strain.rightCols(X.cols() - modes.first_elastic).colwise().sum().array() - 1.0));
                      return worse(worst, (K * X.leftCols(modes.first_elastic)).cwiseAbs().sum());
                    });
}

TEST(SystemModes, OfASubgraph) {  // the operators carry over: what is not in the set is ground
  for_all_trees({.bodies = 7, .roots = 1, .flexible = 0.5, .springs = true}, 1e-9, [](const RandomTree& tree) {
    const auto model = compiled(tree.spec);
    if (model->bodies.size() < 3) return 0.0;
    TreeOperators ops(model);
    ops.at(model->initial_state().q.data());
    const TreeOperators part = ops.subgraph(ops.subtree(2));
    const int n = part.size(Space::hinge);
    if (n == 0) return 0.0;
    const MatrixXd M = dense(mass, part), K_whole = stiffness(*model);
    MatrixXd K = MatrixXd::Zero(n, n);
    for (int v = 0; v < model->nv; ++v)
      for (int w = 0; w < model->nv; ++w)
        if (part.place_of_velocity(v) >= 0 && part.place_of_velocity(w) >= 0)
          K(part.place_of_velocity(v), part.place_of_velocity(w)) = K_whole(v, w);
    const VectorXd lambda = generalised_eigenvalues(K, M).value();
    const SystemModes modes = system_modes(part, {.elastic = n, .rigid = n});
    double worst = 0.0;
    for (int j = 0; j < n; ++j)
      worst = worse(worst,
                    relative(std::pow(2.0 * std::numbers::pi * modes.frequency[j], 2) - lambda[j], worse(lambda[j], 1e-6 * lambda[n - 1])));
    return worst;
  });
}

TEST(SystemModes, OfComponentsThatAreFree) {  // the rest is held, as in all that is made of the tree after articulate({.free})
  for_all_trees({.bodies = 7, .roots = 2, .flexible = 0.5, .springs = true}, 1e-9, [](const RandomTree& tree) {
    const auto model = compiled(tree.spec);
    TreeOperators ops(model);
    ops.at(model->initial_state().q.data());
    const MatrixXd M_whole = dense(mass, ops), K_whole = stiffness(*model);
    std::vector<std::uint8_t> free(static_cast<std::size_t>(model->nv));
    std::vector<int> left;
    for (int v = 0; v < model->nv; ++v)
      if ((free[static_cast<std::size_t>(v)] = v % 3 != 1) != 0) left.push_back(v);
    ops.articulate({.free = free});
    const auto n = static_cast<int>(left.size());
    const MatrixXd M = M_whole(left, left), K = K_whole(left, left);
    const VectorXd lambda = generalised_eigenvalues(K, M).value();
    const SystemModes modes = system_modes(ops, {.elastic = n, .rigid = n});
    if (modes.frequency.size() != n) return 1.0;
    double worst = 0.0;
    for (int j = 0; j < n; ++j)
      worst = worse(worst,
                    relative(std::pow(2.0 * std::numbers::pi * modes.frequency[j], 2) - lambda[j], worse(lambda[j], 1e-6 * lambda[n - 1])));
    return worst;
  });
}

SpringDamper spring(double stiffness, double damping) {
  SpringDamper s;
  s.stiffness = stiffness, s.damping = damping;
  return s;
}
BodySpec mass_on_spring(int i, double k, double c = 0.0) {
  BodySpec b = on(rigid("m" + std::to_string(i), 2.0, Vector3d::Zero(), diagonal({1, 1, 1})), i == 0 ? "" : "m" + std::to_string(i - 1),
                  "prismatic", {Vector3d::UnitX()});
  if (k > 0.0) b.hinge.springs.push_back(spring(k, c));
  return b;
}

// n masses m on a line, springs k, the first to ground or free: omega = 2 sqrt(k/m) sin((2j - 1) pi / (4 n + 2)), 2 sqrt(k/m) sin(j pi / (2
// n)).
void check_chain(int n, bool free, int wanted) {
  std::vector<BodySpec> bodies;
  for (int i = 0; i < n; ++i) bodies.push_back(mass_on_spring(i, free && i == 0 ? 0.0 : 50.0));
  const auto model = compiled(system(std::move(bodies)));
  TreeOperators ops(model);
  ops.at(model->initial_state().q.data());
  const SystemModes modes = system_modes(ops, {.elastic = wanted});
  EXPECT_TRUE(modes.complete);
  EXPECT_EQ(modes.n_rigid, free ? 1 : 0);
  ASSERT_EQ(modes.frequency.size(), wanted + modes.n_rigid);
  for (int j = 1; j <= wanted; ++j) {
    const double angle = free ? j * std::numbers::pi / (2.0 * n) : (2.0 * j - 1.0) * std::numbers::pi / (4.0 * n + 2.0);
    const double exact = 2.0 * 5.0 * std::sin(angle) / (2.0 * std::numbers::pi);
    EXPECT_NEAR(modes.frequency[j - 1 + modes.n_rigid] / exact, 1.0, 1e-9) << j;
  }
}

TEST(SystemModes, UniformChain) {
  check_chain(100, false, 12);
  check_chain(100, true, 12);
  check_chain(20000, false, 8);
  check_chain(20000, true, 8);
}

TEST(SystemModes, RigidModesOfAFreeBase) {
  BodySpec base = on(rigid("base", 3.0, {0.1, 0.2, 0.0}, diagonal({1, 2, 3})), "", "free");
  BodySpec arm =
      on(rigid("arm", 1.0, {0.5, 0.0, 0.0}, diagonal({0.1, 0.4, 0.4})), "base", "revolute", {Vector3d::UnitZ()}, {1.0, 0.0, 0.0});
  arm.hinge.springs.push_back(spring(20.0, 0.3));
  const auto model = compiled(system({base, arm}));
  TreeOperators ops(model);
  ops.at(model->initial_state().q.data());
  const SystemModes modes = system_modes(ops);
  EXPECT_EQ(modes.n_rigid, 6);
  ASSERT_EQ(modes.frequency.size(), 7);
  EXPECT_EQ(modes.frequency.head(6).norm(), 0.0);
  ops.articulate();
  const MatrixXd inverse = dense(mass_inverse, ops);  // of one spring: omega^2 = k (M^-1)_jj, 2 zeta omega = c (M^-1)_jj
  const double omega = std::sqrt(20.0 * inverse(6, 6));
  EXPECT_NEAR(modes.frequency[6], omega / (2.0 * std::numbers::pi), 1e-12);
  EXPECT_NEAR(modes.damping[6], 0.3 * inverse(6, 6) / (2.0 * omega), 1e-12);
  EXPECT_EQ(modes.labels.names[6], "arm.rate");
  EXPECT_NEAR(modes.strain(6, 6), 1.0, 1e-12);
}

TEST(SystemModes, EqualAppendagesComeAllOfThem) {  // 40 equal wings on a heavy hub: a cluster of 39 equal modes
  std::vector<BodySpec> bodies{on(rigid("hub", 1e3, Vector3d::Zero(), diagonal({500, 500, 500})), "", "locked")};
  for (int i = 0; i < 40; ++i) {
    BodySpec b =
        on(rigid("w" + std::to_string(i), 1.0, {0.5, 0.0, 0.0}, diagonal({0.1, 0.2, 0.2})), "hub", "revolute", {Vector3d::UnitZ()});
    b.hinge.springs.push_back(spring(9.0 + (i < 3 ? i : 0), 0.0));
    bodies.push_back(b);
  }
  const auto model = compiled(system(bodies));
  TreeOperators ops(model);
  ops.at(model->initial_state().q.data());
  const SystemModes modes = system_modes(ops, {.elastic = 39});
  EXPECT_TRUE(modes.complete);
  const double J = 0.2 + 0.25;
  for (int j = 0; j < 38; ++j) EXPECT_NEAR(modes.frequency[j], std::sqrt(9.0 / J) / (2.0 * std::numbers::pi), 1e-10);
  EXPECT_NEAR(modes.frequency[38], std::sqrt(10.0 / J) / (2.0 * std::numbers::pi), 1e-10);
}

TEST(SystemModes, HundredsOfEqualAppendages) {  // two distinct eigenvalues for 300 modes: nothing for Lanczos to iterate on
  std::vector<BodySpec> bodies{on(rigid("hub", 1e3, Vector3d::Zero(), diagonal({500, 500, 500})), "", "free")};
  for (int i = 0; i < 300; ++i) {
    BodySpec b =
        on(rigid("w" + std::to_string(i), 1.0, {0.5, 0.0, 0.0}, diagonal({0.1, 0.2, 0.2})), "hub", "revolute", {Vector3d::UnitZ()});
    b.hinge.springs.push_back(spring(9.0, 0.0));
    bodies.push_back(b);
  }
  const auto model = compiled(system(bodies));
  TreeOperators ops(model);
  ops.at(model->initial_state().q.data());
  const SystemModes modes = system_modes(ops);
  EXPECT_TRUE(modes.complete);
  for (int j = 6; j < 16; ++j) EXPECT_NEAR(modes.frequency[j], std::sqrt(9.0 / 0.45) / (2.0 * std::numbers::pi), 1e-10);
}

TEST(SystemModes, ManyComponentsWithoutStiffness) {  // more than are eliminated by their modes
  std::vector<BodySpec> bodies;
  for (int i = 0; i < 80; ++i) bodies.push_back(mass_on_spring(i, i % 2 == 0 ? 0.0 : 50.0 + i));
  const auto model = compiled(system(bodies));
  TreeOperators ops(model);
  ops.at(model->initial_state().q.data());
  const SystemModes modes = system_modes(ops, {.elastic = 40, .rigid = 40});
  ASSERT_EQ(modes.frequency.size(), 80);
  const MatrixXd M = dense(mass, ops);
  const VectorXd lambda = generalised_eigenvalues(stiffness(*model), M).value();
  for (int j = 40; j < 80; ++j) EXPECT_NEAR(std::pow(2.0 * std::numbers::pi * modes.frequency[j], 2) / lambda[j], 1.0, 1e-9);
  EXPECT_LT(largest(modes.shapes.transpose() * M * modes.shapes - MatrixXd::Identity(80, 80)), 1e-10);
}

TEST(SystemModes, ManyFlexibleBodies) {  // 500 bodies with 40 modes each, free: 20,500 degrees of freedom
  TreeOptions one{.bodies = 1, .roots = 1, .flexible = 1.0, .level = 1, .modes = 40, .springs = false, .hinges = {"revolute"}};
  const BodySpec panel = random_tree(3, one).spec.bodies[0];
  std::vector<BodySpec> bodies{on(rigid("bus", 500.0, Vector3d::Zero(), diagonal({300, 300, 300})), "", "free")};
  for (int i = 0; i < 500; ++i) {
    BodySpec b = panel;
    b.name = "p" + std::to_string(i);
    b.eta.assign(40, 0.0), b.etadot.clear();
    b.hinge = on(BodySpec{}, i < 2 ? "bus" : "p" + std::to_string(i - 2), "revolute", {Vector3d::UnitZ()}, {1.0 + i % 2, 0.2, 0.0}).hinge;
    b.hinge.springs.push_back(spring(1e4 + 10.0 * i, 1.0));
    bodies.push_back(b);
  }
  const auto model = compiled(system(bodies));
  EXPECT_EQ(model->nv, 20506);
  TreeOperators ops(model);
  ops.at(model->initial_state().q.data());
  const SystemModes modes = system_modes(ops, {.elastic = 12});
  EXPECT_EQ(modes.n_rigid, 6);
  EXPECT_TRUE(modes.complete);
  EXPECT_LT(largest(modes.residual), 1e-9);
  EXPECT_LT(largest(modes.kinetic.colwise().sum().array() - 1.0), 1e-9);
}

TEST(Poles, OfAnOscillator) {
  const auto p = operators::poles((MatrixXd(2, 2) << 0.0, 1.0, -4.0, -0.4).finished());
  ASSERT_EQ(p.size(), 2u);
  EXPECT_NEAR(p[0].frequency, 2.0 / (2.0 * std::numbers::pi), 1e-15);
  EXPECT_NEAR(p[0].damping, 0.1, 1e-15);
  EXPECT_GT(p[0].value.imag(), 0.0);
}

// M = [1 1/2; 1/2 1], K = diag(k, K): 3/4 s^4 + (k + K) s^2 + k K = 0.
TEST(Poles, OfAStiffModeBesideASoftOneHaveTheirDigits) {
  for (const double k : {1e-6, 1.0})
    for (const double K : {1e4, 1e10, 1e14}) {
      MatrixXd A = MatrixXd::Zero(4, 4);
      A.topRightCorner(2, 2).setIdentity();
      A.bottomLeftCorner(2, 2) << -k / 0.75, 0.5 * K / 0.75, 0.5 * k / 0.75, -K / 0.75;
      const double sum = k + K + std::sqrt((k + K) * (k + K) - 3.0 * k * K), soft = std::sqrt(2.0 * k * K / sum),
                   stiff = std::sqrt(sum / 1.5);
      const auto p = operators::poles(A);
      ASSERT_EQ(p.size(), 4u);
      EXPECT_NEAR(p[0].value.imag() / soft, 1.0, 1e-8) << k << ", " << K;  // the stiff square rounds the soft one through the mass between
      EXPECT_NEAR(p[2].value.imag() / stiff, 1.0, 1e-14) << k << ", " << K;
    }
}

}  // namespace
}  // namespace cardan::test
