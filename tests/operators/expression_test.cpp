// Expressions at run time against those by type; what is refused, and the words; subgraphs; nothing allocated; cost.
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

#include "core/linalg/dense.hpp"
#include "core/linalg/eigenpairs.hpp"
#include "core/operators/apply.hpp"
#include "core/operators/expression.hpp"
#include "core/operators/tree_operators.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {
namespace {

using namespace cardan::operators;
using namespace cardan::operators::letters;
using operators::Expression;

constexpr double kSame = 1e-13;

std::shared_ptr<TreeOperators> at_initial_state(const RandomTree& tree) {
  const auto model = compiled(tree.spec);
  auto ops = std::make_shared<TreeOperators>(model);
  ops->at(model->initial_state().q.data());
  ops->articulate();
  return ops;
}

Expression named(std::shared_ptr<const TreeOperators> ops, std::string_view name) {
  const auto all = Expression::named();
  return std::ranges::find(all, name, &Expression::Named::name)->of(std::move(ops));
}

// The formula is the type.
static_assert(std::is_empty_v<decltype(mass_inverse)> && std::is_empty_v<decltype(omega)>);
static_assert(std::is_same_v<decltype(inv(I + H * phi * K)), decltype(I - H * psi * K)>);
static_assert(std::is_same_v<decltype(inv(star(I - H * psi * K))), decltype(star(I + H * phi * K))>);
static_assert(std::is_same_v<decltype(inv(inv(phi))), std::remove_const_t<decltype(phi)>>);
static_assert(std::is_same_v<decltype(star(mass)), std::remove_const_t<decltype(mass)>>, "the mass matrix is symmetric, by its formula");
static_assert(std::is_same_v<decltype(H * (phi * M) * star(H * phi)), std::remove_const_t<decltype(mass)>>, "brackets do not matter");
static_assert(std::is_same_v<decltype(inv(mass_innovations)), std::remove_const_t<decltype(mass_inverse)>>);

TEST(Expressions, AreThoseOfTheTypes) {
  const auto options = TreeOptions{.bodies = 6, .flexible = 0.4};
  for_all_trees(options, kSame, [](const RandomTree& tree) {
    const auto ops = at_initial_state(tree);
    const auto leaf = [&](Kind k) { return Expression::leaf(ops, k); };
    const Expression eH = leaf(Kind::H), ephi = leaf(Kind::phi), eM = leaf(Kind::M), eK = leaf(Kind::K), epsi = leaf(Kind::psi),
                     one = Expression::unit(ops);
    const Expression whole = eH * ephi * eM * ephi.star() * eH.star(), left = one + eH * ephi * eK;
    double worst = 0.0;
    const auto compare = [&](const Expression& a, const MatrixXd& b) { worst = worse(worst, apart(a.dense(), b)); };
    compare(whole, dense(mass, *ops));
    compare(whole.inv(), dense(mass_inverse, *ops));
    compare(left, dense(I + H * phi * K, *ops));
    compare(left.inv(), dense(I - H * psi * K, *ops));
    compare((eH * ephi * eK + one).star().inv(), dense(star(I - H * psi * K), *ops));
    compare(2.0 * whole - (eH * ephi) * (eM * ephi.star() * eH.star()), dense(mass, *ops));
    compare(ephi.inv() * ephi, MatrixXd::Identity(ops->size(Space::body), ops->size(Space::body)));
    compare((0.5 * left).inv(), 2.0 * dense(I - H * psi * K, *ops));
    compare(leaf(Kind::B).star() * ephi.star() * eH.star(), dense(jacobian, *ops));
    return worst;
  });
}

TEST(Expressions, PrintAsOnPaper) {
  const auto ops = at_initial_state(random_tree(1, {.bodies = 4, .flexible = 0.0}));
  const auto leaf = [&](Kind k) { return Expression::leaf(ops, k); };
  const Expression one = Expression::unit(ops);
  EXPECT_EQ(named(ops, "mass").text(), "H phi M phi* H*");
  EXPECT_EQ(named(ops, "mass").inv().text(), "(I - K* psi* H*) D^-1 (I - H psi K)");
  EXPECT_EQ((one - 2.0 * (leaf(Kind::H) * leaf(Kind::psi) * leaf(Kind::K))).text(), "I - 2 H psi K");
  EXPECT_EQ(leaf(Kind::phi).inv().text(), "I - E_phi");
}

TEST(Expressions, NormsAndEigenvalues) {
  const auto ops = at_initial_state(random_tree(7, {.bodies = 6, .flexible = 0.4}));
  const Expression mass_matrix = named(ops, "mass");
  const MatrixXd A = mass_matrix.dense();
  const VectorXd values = symmetric_eigenvalues(A);
  EXPECT_NEAR(mass_matrix.norm(), values[values.size() - 1], 1e-12 * mass_matrix.norm());
  const VectorXd three = mass_matrix.eigenvalues(3);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(three[i], values[values.size() - 1 - i], 1e-12 * values[values.size() - 1]);
}

TEST(Expressions, NormsOfManyBodiesWithoutAMatrix) {  // a chain of 400 revolute hinges: by ARPACK
  std::vector<BodySpec> bodies;
  for (int k = 0; k < 400; ++k)
    bodies.push_back(on(rigid(fmt::format("b{}", k), 1.0, {0.5, 0, 0}, diagonal({0.01, 0.09, 0.09})), k ? fmt::format("b{}", k - 1) : "",
                        "revolute", {{0, 0, 1}}, k ? Vector3d(1, 0, 0) : Vector3d::Zero()));
  const auto model = compiled(system(bodies));
  auto ops = std::make_shared<TreeOperators>(model);
  const VectorXd q = VectorXd::Constant(model->nq, 0.01);
  ops->at(q.data());
  const Expression mass_matrix = named(ops, "mass");
  const VectorXd values = symmetric_eigenvalues(mass_matrix.dense());
  EXPECT_NEAR(mass_matrix.norm() / values[399], 1.0, 1e-9);
  EXPECT_EQ((mass_matrix - mass_matrix).norm(), 0.0);
  const VectorXd ten = mass_matrix.eigenvalues(10);
  for (int i = 0; i < 10; ++i) EXPECT_NEAR(ten[i] / values[399 - i], 1.0, 1e-9);
  const VectorXd half = (-1.0 * mass_matrix).eigenvalues(200);
  for (int i = 0; i < 200; ++i) EXPECT_NEAR(half[i], -values[i], 1e-12 * values[399]);
}

TEST(Operators, ErasedForKrylovMethods) {  // the view that ARPACK takes, against the dense matrix; its adjoint too
  const RandomTree tree = random_tree(11, {.bodies = 40, .roots = 1, .flexible = 0.3, .modes = 3});
  const auto ops = at_initial_state(tree);
  const auto view = erase(mass_inverse, *ops);
  const LinearOperator& inverse = view;
  const int n = inverse.rows;
  ASSERT_GT(n, 60);
  const auto same = [](const VectorXd& x, VectorXd& y) { y = x; };
  const MultiplyRef one(same);
  const Eigenpairs lowest = lowest_eigenpairs(inverse, {n, n, one, one}, 5, 0.0);
  const VectorXd values = symmetric_eigenvalues(dense(mass, *ops));
  for (int i = 0; i < 5; ++i) EXPECT_NEAR(lowest.values[i] / values[i], 1.0, 1e-9);
  const auto jacobian_view = erase(jacobian, *ops);
  const LinearOperator& J = jacobian_view;
  const VectorXd x = VectorXd::LinSpaced(J.cols, -1, 1), f = VectorXd::LinSpaced(J.rows, 1, 2);
  VectorXd Jx(J.rows), Jf(J.cols);
  J.mult(x, Jx);
  J.mult_transpose(f, Jf);
  EXPECT_NEAR(f.dot(Jx), x.dot(Jf), 1e-12 * Jx.norm() * f.norm());
}

/// The text of the error that f throws.
template <class F>
std::string refusal(const F& f) {
  try {
    f();
  } catch (const InputError& e) {
    return e.what();
  }
  return "nothing was refused";
}
#define EXPECT_WORDS(text, words) EXPECT_NE((text).find(words), std::string::npos) << (text)

TEST(Expressions, RefuseWhatDoesNotFit) {
  const RandomTree tree = random_tree(3, {.bodies = 5, .flexible = 0.3});
  const auto ops = at_initial_state(tree);
  const auto leaf = [&](Kind k) { return Expression::leaf(ops, k); };
  const Expression one = Expression::unit(ops);
  const std::string sum = refusal([&] { leaf(Kind::H) + leaf(Kind::phi); });
  EXPECT_WORDS(sum, "C0902");
  EXPECT_WORDS(sum, "H + phi");
  EXPECT_WORDS(sum, fmt::format("hinge x body ({} x {})", ops->size(Space::hinge), ops->size(Space::body)));
  EXPECT_WORDS(refusal([&] { leaf(Kind::phi) * leaf(Kind::H); }), "star() may be missing");
  EXPECT_WORDS(refusal([&] { leaf(Kind::H) + one; }), "a square operator beside I");
  EXPECT_WORDS(refusal([&] { leaf(Kind::H).inv(); }), "C0903");
  EXPECT_WORDS(refusal([&] { (leaf(Kind::M) + leaf(Kind::P)).inv(); }), "no rule");
  const Expression passed = leaf(Kind::H) * leaf(Kind::phi) * leaf(Kind::K);
  for (const double none : {0.0, std::nan("")}) {
    EXPECT_WORDS(refusal([&] { (none * leaf(Kind::phi)).inv(); }), "no rule");
    EXPECT_WORDS(refusal([&] { (none * (passed + one)).inv(); }), "no rule");
    EXPECT_WORDS(refusal([&] { (none * passed + one).inv(); }), "no rule");
  }
  EXPECT_WORDS(refusal([&] { leaf(Kind::H).apply(VectorXd::Zero(1)); }), "C0902");
  EXPECT_WORDS(refusal([&] { leaf(Kind::phi).eigenvalues(1); }), "symmetric");
  EXPECT_WORDS(refusal([&] { leaf(Kind::phi) + Expression::leaf(at_initial_state(tree), Kind::phi); }), "two models");
  EXPECT_WORDS(refusal([&] { Expression::nodes(ops, {9999}); }), "C0202");
  const VectorXd W = VectorXd::Ones(ops->size(Space::hinge));
  ops->articulate({.W = W.data()});
  const Expression inertia = leaf(Kind::H) * leaf(Kind::phi) * leaf(Kind::M) * leaf(Kind::phi).star() * leaf(Kind::H).star();
  for (const Expression& of_mass : {inertia, -1.0 * inertia, 2.0 * inertia}) EXPECT_WORDS(refusal([&] { of_mass.inv(); }), "without W");
}

TEST(Operators, AStageThatIsMissingIsNamed) {
  const auto model = compiled(random_tree(3, {.bodies = 5}).spec);
  TreeOperators ops(model);
  const VectorXd x = VectorXd::Zero(ops.size(Space::hinge));
  EXPECT_WORDS(refusal([&] { apply(mass, ops, x); }), "stage Position");
  ops.at(model->initial_state().q.data());
  const std::string inertia = refusal([&] { apply(mass_inverse, ops, x); });
  EXPECT_WORDS(inertia, "C0901");
  EXPECT_WORDS(inertia, "stage Inertia");
  EXPECT_WORDS(inertia, "articulate()");
  EXPECT_WORDS(refusal([&] { dense(Y, ops); }), "stage OperationalSpace");
  EXPECT_WORDS(refusal([&] { dense(dM, ops); }), "stage Direction");
  ops.articulate();
  ops.at(model->initial_state().q.data());  // another q: what depends on it is gone
  EXPECT_WORDS(refusal([&] { dense(P, ops); }), "stage Inertia");
}

TEST(Operators, AHingeWithoutInertiaIsNamed) {
  SystemSpec spec = system({on(rigid("base", 2.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "free"),
                            on(particle("tip", 1.0, {0, 0, 0}), "base", "revolute", {{0, 0, 1}}, {1, 0, 0})});
  const auto model = compiled(spec);
  TreeOperators ops(model);
  ops.at(model->initial_state().q.data());
  try {
    ops.articulate();
    FAIL() << "a hinge without inertia was factored";
  } catch (const NumericsError& e) {
    EXPECT_EQ(e.failure().body, "tip");
    EXPECT_EQ(e.failure().code, Code::singular_hinge);
  }
}

TEST(Operators, SubgraphsAreTreesOfTheirOwn) {
  // The operators of a subtree are those of a model in which its root hangs on the world; of any set, those of the blocks.
  for (const double flexible : {0.0, 0.5})
    for_all_trees(
        {.bodies = 7, .flexible = flexible}, 1e-12,
        [](const RandomTree& tree) {
          const auto ops = at_initial_state(tree);
          double worst = 0.0;
          for (const auto& root : ops->bodies()) {
            TreeOperators sub = ops->subgraph(ops->subtree(root.sweep));
            sub.articulate();
            const MatrixXd whole = dense<false>(mass, *ops), part = dense(mass, sub), innovations = dense(mass_innovations, sub);
            MatrixXd restricted(part.rows(), part.cols());  // M of the subtree: the rows and columns of its hinges
            std::vector<int> place(static_cast<std::size_t>(part.rows()));
            for (int v = 0; v < ops->model().nv; ++v)
              if (sub.place_of_velocity(v) >= 0) place[static_cast<std::size_t>(sub.place_of_velocity(v))] = v;
            for (int i = 0; i < part.rows(); ++i)
              for (int j = 0; j < part.cols(); ++j)
                restricted(i, j) = whole(place[static_cast<std::size_t>(i)], place[static_cast<std::size_t>(j)]);
            worst = worse({worst, apart(part, restricted), apart(innovations, part)});
            TreeOperators way = ops->subgraph(ops->path(root.sweep, ops->bodies().back().sweep));
            way.articulate();
            worst = worse(worst, apart(dense(mass_innovations, way), dense(mass, way)));
          }
          return worst;
        },
        40);
}

TEST(Operators, HybridMaskKeepsTheIdentities) {  // components whose velocity is given: no row, no column
  for_all_trees({.bodies = 6, .flexible = 0.4}, 1e-12, [](const RandomTree& tree) {
    const auto ops = at_initial_state(tree);
    const int n = ops->size(Space::hinge);
    const MatrixXd whole = dense(mass, *ops);
    std::vector<std::uint8_t> free(static_cast<std::size_t>(n));
    for (int i = 0; i < n; ++i) free[static_cast<std::size_t>(i)] = (i * 7 + 3) % 3 != 0;
    ops->articulate({.free = free});
    MatrixXd expected = whole;
    for (int i = 0; i < n; ++i)
      if (!free[static_cast<std::size_t>(i)]) expected.row(i).setZero(), expected.col(i).setZero();
    MatrixXd one = MatrixXd::Zero(n, n);
    for (int i = 0; i < n; ++i) one(i, i) = free[static_cast<std::size_t>(i)];
    const MatrixXd inverse = dense(mass_inverse, *ops), A = dense(mass, *ops);
    const VectorXd d = whole.diagonal().cwiseSqrt();
    const MatrixXd left = d.asDiagonal() * (inverse * A) * d.cwiseInverse().asDiagonal();
    const MatrixXd given = MatrixXd::Identity(n, n) - one;
    const MatrixXd scaled =
        d.cwiseInverse().asDiagonal() * (expected + given * whole.diagonal().asDiagonal() * given) * d.cwiseInverse().asDiagonal();
    const VectorXd s = singular_values(scaled);
    return worse(apart(A, expected), largest(left - one) / (s[0] / s[s.size() - 1]));
  });
}

TEST(Operators, JointSpaceInertia) {  // (mass + W)^-1 by D = H P H* + W
  for_all_trees({.bodies = 6, .flexible = 0.4}, 1e-12, [](const RandomTree& tree) {
    const auto ops = at_initial_state(tree);
    const int n = ops->size(Space::hinge);
    const MatrixXd whole = dense(mass, *ops);
    VectorXd W(n);
    for (int i = 0; i < n; ++i) W[i] = whole(i, i) * (0.1 + 0.3 * (i % 4));
    ops->articulate({.W = W.data()});
    const MatrixXd sum = whole + MatrixXd(W.asDiagonal());
    return worse(apart(dense(mass_innovations, *ops), sum),
                 apart(dense(inv(mass_innovations), *ops) * sum, MatrixXd::Identity(n, n)) / 1e3);
  });
}

}  // namespace
}  // namespace cardan::test
