// The identities of the operator algebra (mathematics 4 - 6) on random trees: rigid, flexible and mixed, every hinge, branching,
// forests. Each is a statement about matrices: the composed form is applied to unit vectors. Scales: the size of the largest
// term on either side; what contains an inverse is compared after multiplication by the operator, so that no condition number
// enters but that of D.
#include "core/operators/apply.hpp"
#include "core/operators/tree_operators.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "tests/operators/compare.hpp"

namespace cardan::test {
namespace {

using namespace cardan::operators;
using namespace cardan::operators::letters;

constexpr double kIdentity = 1e-12;

struct Letters {
  explicit Letters(const RandomTree& tree) : model(compiled(tree.spec)), state(model->initial_state()), ops(model) {
    ops.at(state.q.data());
    ops.articulate();
    ops.operational_space();
  }
  std::shared_ptr<const Model> model;
  State state;
  TreeOperators ops;
};

/// The dense form of one expression equals that of another. The scale is the largest entry of either: products of those
/// along the way would be too generous.
template <Symbolic L, Symbolic R>
void expect_same(const char* what, L left, R right) {
  SCOPED_TRACE(what);
  for (const TreeOptions& options : kinds_of_trees())
    for_all_trees(
        options, kIdentity,
        [&](const RandomTree& tree) {
          Letters s(tree);
          const MatrixXd a = dense<false>(left, s.ops), b = dense<false>(right, s.ops);
          return differ(a, b);
        },
        kTrees);
}

TEST(Operators, InverseOfPhiIsOneStep) { expect_same("phi (1 - E_phi)", phi * (I - E_phi), Identity<Space::body>{}); }
TEST(Operators, InverseOfPsiIsOneStep) { expect_same("psi (1 - E_psi)", psi * inv(psi), Identity<Space::body>{}); }
TEST(Operators, PsiIsPhiWithTheHingesLetGo) { expect_same("psi^-1 - phi^-1 = K H", inv(psi) - inv(phi), K * H); }
TEST(Operators, PushThrough) {
  expect_same("(1 - H psi K) H phi = H psi", (I - H * psi * K) * H * phi, H * psi);
  expect_same("phi K (1 - H psi K) = psi K", phi * K * (I - H * psi * K), psi * K);
}
TEST(Operators, TheGainIsALeftInverseOfTheHinge) { expect_same("H G = 1", H * G, Identity<Space::hinge>{}); }
TEST(Operators, WhatIsLetGoCarriesNoHingeForce) {
  SCOPED_TRACE("H P+ = 0");
  for (const TreeOptions& options : kinds_of_trees())
    for_all_trees(
        options, kIdentity,
        [](const RandomTree& tree) {
          Letters s(tree);
          return largest(dense(H * P_plus, s.ops)) / largest(dense(H * P, s.ops));
        },
        kTrees);
}
TEST(Operators, Riccati) { expect_same("P = M + E_psi P E_psi*", P, M + E_psi * P * star(E_psi)); }
TEST(Operators, Lyapunov) {
  expect_same("phi M phi* = P + phi~ P + P phi~* + phi K D K* phi*", phi * M * star(phi),
              P + (phi - I) * P + P * (star(phi) - I) + phi * K * D * star(K) * star(phi));
}
TEST(Operators, BothFactorisationsOfTheMassMatrix) { expect_same("Newton-Euler = innovations", mass, mass_innovations); }
TEST(Operators, OmegaFromItsBlocks) {
  expect_same("Y = H* D^-1 H + E_psi-step", Y, star(H) * inv(D) * H + star(tau_bar) * Y_plus * tau_bar);
  for (const TreeOptions& options : kinds_of_trees())
    for_all_trees(
        options, kIdentity,
        [](const RandomTree& tree) {  // the blocks of Omega on the diagonal are Y
          Letters s(tree);
          const MatrixXd whole = dense(omega, s.ops), blocks = dense(Y, s.ops);
          double worst = 0.0;
          for (const auto& b : s.ops.bodies())
            worst = worse(worst, largest(whole.block(b.at, b.at, 6 + b.m, 6 + b.m) - blocks.block(b.at, b.at, 6 + b.m, 6 + b.m)));
          return worst / largest(whole);
        },
        kTrees);
}

TEST(Operators, InverseOfTheMassMatrix) {
  for (const TreeOptions& options : kinds_of_trees())
    for_all_trees(
        options, kIdentity,
        [](const RandomTree& tree) {
          Letters s(tree);
          if (s.model->nv == 0) return 0.0;
          const MatrixXd A = dense<false>(mass, s.ops), B = dense<false>(mass_inverse, s.ops), one = MatrixXd::Identity(A.rows(), A.cols());
          // in units in which the diagonal of the mass matrix is 1
          const VectorXd d = A.diagonal().cwiseSqrt();
          const MatrixXd scaled = d.asDiagonal() * (B * A) * d.cwiseInverse().asDiagonal();
          return largest(scaled - one) / scaled_condition(A);
        },
        kTrees);
}

TEST(Operators, FusedKernelsAndDenseTwinAgreeWithTheRules) {
  for (const TreeOptions& options : kinds_of_trees())
    for_all_trees(
        options, kIdentity,
        [](const RandomTree& tree) {
          Letters s(tree);
          if (s.model->nv == 0) return 0.0;
          const MatrixXd A = dense<false>(mass, s.ops), fused = dense(mass, s.ops);
          const auto twin = reference::DenseTwin<double>(tree.spec).at(s.state.q, s.state.v);
          return worse(differ(fused, A, largest(A)), differ(twin.M, A, largest(A)));
        },
        kTrees);
}

TEST(Operators, Adjoints) {  // x . (A y) = (A* x) . y for every leaf and kind of expression
  const auto check = [](auto e, auto rounded_as) {
    for (const TreeOptions& options : kinds_of_trees())
      for_all_trees(
          options, kIdentity,
          [&](const RandomTree& tree) {
            Letters s(tree);
            std::vector<double> u(static_cast<std::size_t>(s.model->nv), 0.3);
            s.ops.along(u.data());
            const MatrixXd a = dense(e, s.ops), b = dense(star(e), s.ops);
            const double size = worse(largest(a), largest(dense(rounded_as, s.ops)));
            return size > 0.0 ? differ(a.transpose(), b, size) : largest(b);
          },
          20);
  };
  const auto of_its_own_size = [&](auto... e) { (check(e, e), ...); };
  of_its_own_size(H, phi, E_phi, M, B, P, P_plus, D, G, tau_bar, K, psi, Y, Y_plus, dH, dE_phi, dM);
  of_its_own_size(mass, mass_inverse, mass_innovations, omega, jacobian, I - H * psi * K, -(H * phi), inv(M));
  check(E_psi, E_phi);  // E_phi (1 - G H): nothing beyond a free body but what E_phi is rounded to
}

}  // namespace
}  // namespace cardan::test
