// log det M and its gradient (mathematics/log_det.md) on random trees: against the dense matrix and its derivative, against the rates of
// the Riccati recursion; on subgraphs and with given components; passes counted.
#include "core/operators/log_det.hpp"
#include "core/linalg/dense.hpp"

#include <Eigen/Core>

#include "core/operators/apply.hpp"
#include "core/operators/diagonalised.hpp"
#include "tests/operators/compare.hpp"
#include "tests/support/equations.hpp"

namespace cardan::test {
namespace {

using operators::dense;
using operators::TreeOperators;

constexpr double kGradient = 1e-12;

/// tr(M^-1 dM) in units in which the diagonal of M is 1, over the free components.
double trace_of_log(const MatrixXd& M, const MatrixXd& dM) { return positive_solve(M, dM).trace(); }

TEST(LogDet, GradientIsTheTraceOfTheDense) {
  for (const TreeOptions& options : kinds_of_trees())
    for_all_trees(
        options, kGradient,
        [](const RandomTree& tree) {
          const auto model = compiled(tree.spec);
          if (model->nv == 0) return 0.0;
          const State state = model->initial_state();
          TreeOperators ops(model);
          ops.at(state.q.data());
          ops.articulate();
          ops.operational_space();
          const VectorXd gradient = operators::log_det_gradient(ops);
          const MatrixXd M = dense(operators::letters::mass, ops);
          VectorXd want(model->nv), unit = VectorXd::Zero(model->nv);
          for (int i = 0; i < model->nv; ++i) {
            unit[i] = 1.0;
            ops.along(unit.data());
            want[i] = trace_of_log(M, dense(operators::letters::mass_derivative, ops));
            unit[i] = 0.0;
          }
          const double value = std::abs(ops.log_det() - std::log(determinant(M)));
          return worse(largest(gradient - want), value) / worse(1.0, largest(want));
        },
        kTrees);
}

/// Sum of tr(D^-1 D') with D' of the differentiated Riccati recursion: the adjoint statement of the same, also for larger trees.
TEST(LogDet, GradientIsTheAdjointOfTheRiccatiRates) {
  std::vector<TreeOptions> kinds = kinds_of_trees();
  for (TreeOptions& options : kinds) options.bodies *= 4;
  for (const TreeOptions& options : kinds)
    for_all_trees(
        options, kGradient,
        [](const RandomTree& tree) {
          const auto model = compiled(tree.spec);
          const State state = model->initial_state();
          TreeOperators ops(model);
          ops.at(state.q.data());
          VectorXd u(model->nv), W(model->nv);
          std::vector<std::uint8_t> free(static_cast<std::size_t>(model->nv));
          for (int i = 0; i < model->nv; ++i)
            u[i] = std::sin(1.0 + i), W[i] = 0.1 + 0.05 * (i % 3), free[static_cast<std::size_t>(i)] = i % 4 != 1;
          ops.articulate({.W = W.data(), .free = free});
          ops.operational_space();
          operators::RiccatiRates rates;
          operators::riccati_rates(ops, ops.derivatives(u.data()), rates);
          double along = 0.0, size = 1.0;
          for (std::size_t i = 0; i < rates.D.size(); ++i) {
            const MatrixXd& S = ops.S(static_cast<int>(i));
            const double term = positive_solve(S * S.transpose(), rates.D[i]).trace();
            along += term, size += std::abs(term);
          }
          const VectorXd gradient = operators::log_det_gradient(ops);
          return std::abs(gradient.dot(u) - along) / worse(size, gradient.cwiseAbs().dot(u.cwiseAbs()));
        },
        kTrees);
}

TEST(LogDet, GradientOfASubgraph) {
  TreeOptions options{.bodies = 7, .roots = 1, .flexible = 0.4};
  for_all_trees(
      options, kGradient,
      [](const RandomTree& tree) {
        const auto model = compiled(tree.spec);
        if (model->bodies.size() < 3) return 0.0;
        const State state = model->initial_state();
        TreeOperators whole(model);
        whole.at(state.q.data());
        TreeOperators sub = whole.subgraph(whole.subtree(2));
        if (sub.size(operators::Space::hinge) == 0) return 0.0;
        sub.articulate();
        sub.operational_space();
        const VectorXd gradient = operators::log_det_gradient(sub);
        const MatrixXd M = dense(operators::letters::mass, sub);
        double worst = 0.0;
        VectorXd unit = VectorXd::Zero(model->nv);
        for (int i = 0; i < model->nv; ++i) {
          const int place = sub.place_of_velocity(i);
          if (place < 0) continue;
          unit[i] = 1.0;
          sub.along(unit.data());
          worst = worse(worst, std::abs(gradient[place] - trace_of_log(M, dense(operators::letters::mass_derivative, sub))));
          unit[i] = 0.0;
        }
        return worst / worse(1.0, largest(gradient));
      },
      60);
}

TEST(LogDet, PassesDoNotGrowWithTheNumberOfBodies) {
  TreeOptions options{.flexible = 0.5};
  for (const int n : {10, 40, 160}) {
    options.bodies = n;
    TreeOperators ops(compiled(random_tree(1, options).spec));
    EXPECT_LE(operators::log_det_passes(ops), 6 + 2 * 4);
  }
}

TEST(LogDet, StageIsNamed) {
  TreeOperators ops(compiled(random_tree(1, {.bodies = 2}).spec));
  const State state = ops.model().initial_state();
  ops.at(state.q.data());
  EXPECT_THROW(operators::log_det_gradient(ops), InputError);
}

}  // namespace
}  // namespace cardan::test
