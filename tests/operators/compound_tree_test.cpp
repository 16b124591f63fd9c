// The algebra over the tree of compound bodies that closed loops leave: the identities of identities_test.cpp again, against the dense
// twin, whose loops are closed by multipliers, against exact results, and against the sweeps. Random mechanisms of every hinge, rigid and
// flexible; chains and towers whose loops share links.
#include "core/operators/compound_tree.hpp"

#include "core/operators/apply.hpp"
#include "core/operators/expression.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "tests/operators/compare.hpp"
#include "tests/properties/closed_mechanisms.hpp"
#include "tests/support/bench_loops.hpp"

namespace cardan::test {
namespace {

using namespace cardan::operators;
using namespace cardan::operators::letters;

constexpr double kCompoundIdentity = 1e-11;  // G_D of random mechanisms has a condition of some hundred

struct Mechanism {
  explicit Mechanism(const SystemSpec& spec) : model(compiled(spec)), state(model->initial_state()), ops(model) {
    ops.at(state.q.data());
    ops.articulate();
    ops.operational_space();
  }
  std::shared_ptr<const Model> model;
  State state;
  CompoundTree ops;
  int size() const { return ops.size(Space::hinge); }
};

/// property(scene) stays below the tolerance on random mechanisms, and on chains and towers.
void for_all_mechanisms(double tolerance, const std::function<double(Mechanism&)>& property, int count = kTrees) {
  for (TreeOptions options : kinds_of_trees()) {
    options.roots = 1;
    for_all_trees(
        options, tolerance,
        [&](const RandomTree& tree) {
          const Cut both = cut(tree, tree.seed % 3);
          if (both.bodies.empty()) return 0.0;
          Mechanism s(both.closed.spec);
          return s.size() == 0 ? 0.0 : property(s);
        },
        count / 3);
  }
  for (const SystemSpec& spec : {touching_four_bars(4), bending_four_bars(2, true), bending_tower(2)}) {
    Mechanism s(spec);
    EXPECT_LE(property(s), tolerance);
  }
}
template <Symbolic L, Symbolic R>
void expect_same_over_compounds(const char* what, L left, R right) {
  SCOPED_TRACE(what);
  for_all_mechanisms(kCompoundIdentity, [&](Mechanism& s) { return differ(dense<false>(left, s.ops), dense<false>(right, s.ops)); });
}
/// In units in which the diagonal of M is 1, over its condition.
double differs_from_inverse(const MatrixXd& inverse, const MatrixXd& M) {
  const VectorXd d = M.diagonal().cwiseSqrt();
  const MatrixXd scaled = d.asDiagonal() * (inverse * M) * d.cwiseInverse().asDiagonal();
  return largest(scaled - MatrixXd::Identity(M.rows(), M.cols())) / scaled_condition(M);
}

TEST(CompoundTree, IdentitiesOfTheAlgebraHoldOverIt) {
  expect_same_over_compounds("phi (1 - E_phi) = 1", phi * (I - E_phi), Identity<Space::body>{});
  expect_same_over_compounds("psi psi^-1 = 1", psi * inv(psi), Identity<Space::body>{});
  expect_same_over_compounds("psi^-1 - phi^-1 = K H", inv(psi) - inv(phi), K * H);
  expect_same_over_compounds("(1 - H psi K) H phi = H psi", (I - H * psi * K) * H * phi, H * psi);
  expect_same_over_compounds("H G = 1", H * G, Identity<Space::hinge>{});
  expect_same_over_compounds("P+ = tau_bar P", P_plus, tau_bar * P);
  expect_same_over_compounds("P = M + E_psi P E_psi*", P, M + E_psi * P * star(E_psi));
  expect_same_over_compounds("phi M phi* = P + phi~ P + P phi~* + phi K D K* phi*", phi * M * star(phi),
                             P + (phi - I) * P + P * (star(phi) - I) + phi * K * D * star(K) * star(phi));
  expect_same_over_compounds("D = H P H*", D, H * P * star(H));
  expect_same_over_compounds("Newton-Euler = innovations", mass, mass_innovations);
  expect_same_over_compounds("Y = H* D^-1 H + tau_bar* Y+ tau_bar", Y, star(H) * inv(D) * H + star(tau_bar) * Y_plus * tau_bar);
  expect_same_over_compounds("J M^-1 J* = B* Omega B", jacobian * mass_inverse * star(jacobian), star(B) * omega * B);
}

TEST(CompoundTree, YIsTheBlockOfOmegaOfEachCompound) {
  for_all_mechanisms(
      kCompoundIdentity,
      [](Mechanism& s) {
        const MatrixXd whole = dense(omega, s.ops), blocks = dense(Y, s.ops);
        double worst = 0.0;
        for (const Compound& c : s.ops.compounds())
          for (const int i : c.members)
            for (const int j : c.members) {
              const OperatorBody &a = s.ops.bodies()[idx(i)], &b = s.ops.bodies()[idx(j)];
              worst = worse(worst, largest(whole.block(a.at, b.at, 6 + a.m, 6 + b.m) - blocks.block(a.at, b.at, 6 + a.m, 6 + b.m)));
            }
        return worst / largest(whole);
      },
      60);
}

TEST(CompoundTree, AdjointsOfAllLetters) {
  for_all_mechanisms(
      kCompoundIdentity,
      [](Mechanism& s) {
        const std::vector<double> u(idx(s.model->nv), 0.3);
        s.ops.along(u.data());
        double worst = 0.0;
        const auto check = [&](const char* what, auto e) {  // not of its own rounding: a free hinge lets all go, and E_psi is zero then
          const MatrixXd a = dense(e, s.ops), b = dense(star(e), s.ops);
          const double error = differ(a.transpose(), b, worse(largest(a), 1e-3));
          if (!(error <= kCompoundIdentity)) ADD_FAILURE() << what << ": " << error << " of " << largest(a);
          worst = worse(worst, error);
        };
        check("H", H), check("phi", phi), check("E_phi", E_phi), check("M", M), check("B", B), check("P", P), check("P_plus", P_plus);
        check("D", D), check("G", G), check("tau_bar", tau_bar), check("K", K), check("E_psi", E_psi), check("psi", psi), check("Y", Y);
        check("Y_plus", Y_plus), check("dH", dH), check("dE_phi", dE_phi), check("dM", dM), check("X", X), check("dX", dX);
        check("mass", mass), check("mass_inverse", mass_inverse), check("omega", omega), check("jacobian", jacobian);
        check("mass_derivative", mass_derivative);
        return worst;
      },
      9);
}

// X keeps all rows, and H phi M phi* H* is the twin's mass matrix of the open tree along it.
TEST(CompoundTree, MassMatrixIsThatOfTheTwinAlongTheLoops) {
  for (TreeOptions options : kinds_of_trees()) {
    options.roots = 1;
    for_all_trees(
        options, kCompoundIdentity,
        [&](const RandomTree& tree) {
          const Cut both = cut(tree, tree.seed % 3);
          if (both.bodies.empty()) return 0.0;
          Mechanism s(both.closed.spec);
          const MatrixXd along = dense(X, s.ops);
          Workspace ws(*s.model);
          MatrixXd rates = along;
          for (Eigen::Index j = 0; j < rates.cols(); ++j)
            for (int v = 0; v < s.model->nv; ++v) rates(v, j) = along(v, j);  // the rate space of a whole vehicle is v
          const MatrixXd Gm = loop_rows(*s.model, ws, s.state.q.data()).G;
          const double open = relative(largest(Gm * rates), largest(Gm) * largest(rates));
          if (s.size() == 0) return open;
          const auto twin = reference::DenseTwin<double>(both.closed.spec).at(s.state.q, s.state.v);
          const MatrixXd Mc = dense<false>(mass, s.ops);
          return worse({open, differ(Mc, rates.transpose() * twin.M * rates), differ(dense(mass, s.ops), Mc)});
        },
        kTrees / 3);
  }
}

// The twin's, by multipliers: v' of the system at rest changes with tau by X M_c^-1 X*.
TEST(CompoundTree, InverseMassMatrixGivesTheAccelerationsOfTheTwin) {
  for (TreeOptions options : kinds_of_trees()) {
    options.roots = 1;
    for_all_trees(
        options, 1e-10,
        [&](const RandomTree& tree) {
          const Cut both = cut(tree, tree.seed % 3);
          if (both.bodies.empty()) return 0.0;
          Mechanism s(both.closed.spec);
          if (s.size() == 0) return 0.0;
          const VectorXd still = VectorXd::Zero(s.model->nv);
          const auto twin = reference::DenseTwin<double>(both.closed.spec).at(s.state.q, still);
          VectorXd tau(s.model->nv);
          for (int i = 0; i < s.model->nv; ++i) tau[i] = std::sin(1.0 + 2.0 * i);
          const VectorXd change = twin.closed(tau).vdot - twin.closed(still).vdot;
          const VectorXd by_rules = apply<false>(X * mass_inverse * star(X), s.ops, tau);
          const VectorXd by_sweeps = apply(X * mass_inverse * star(X), s.ops, tau);
          return worse(differ(by_rules, change), differ(by_sweeps, change));
        },
        kTrees / 3);
  }
}

TEST(CompoundTree, InverseOfTheMassMatrix) {
  for_all_mechanisms(kCompoundIdentity, [](Mechanism& s) {
    const MatrixXd A = dense<false>(mass, s.ops);
    return worse(differs_from_inverse(dense<false>(mass_inverse, s.ops), A), differs_from_inverse(dense(mass_inverse, s.ops), A));
  });
}

// v' = X v_I' + X' v_I with v_I' = M_c^-1 X* (tau - C - M X' v_I): the whole of forward dynamics as one expression.
/// Trees in which a loop begins at a body that is locked to one that bends: it has no rates, and moves with the modes of the other.
TEST(CompoundTree, ALoopMayBeginAtABodyThatIsHeldToOneThatBends) {
  for (const unsigned seed : {69u, 90u, 150u, 170u, 234u}) {
    const RandomTree tree = random_tree(seed, {.bodies = 6, .roots = 1, .flexible = 0.5});
    Loaded closed(cut(tree, seed % 3).closed);
    CompoundTree ops(closed.model);
    ops.at(closed.state.q.data());
    ops.articulate();
    VectorXd v(ops.size(Space::hinge));
    for (Eigen::Index i = 0; i < v.size(); ++i) v[i] = closed.state.v[ops.independent()[static_cast<std::size_t>(i)]];
    EXPECT_LT(distance(VectorXd(apply(X, ops, v)), closed.state.v), 1e-12 * largest(closed.state.v)) << seed << "\n" << describe(tree);
  }
}

TEST(CompoundTree, AccelerationsByTheExpressionAreThoseOfForwardDynamics) {
  for (TreeOptions options : kinds_of_trees()) {
    options.roots = 1;
    for_all_trees(
        options, 1e-10,
        [&](const RandomTree& tree) {
          const Cut both = cut(tree, tree.seed % 3);
          if (both.bodies.empty()) return 0.0;
          Loaded closed(both.closed);
          const VectorXd want = closed.forward();
          CompoundTree ops(closed.model);
          if (ops.size(Space::hinge) == 0) return largest(want);
          ops.at(closed.state.q.data());
          ops.articulate();
          ops.along(closed.state.v.data());
          VectorXd v(ops.size(Space::hinge));
          for (Eigen::Index i = 0; i < v.size(); ++i) v[i] = closed.state.v[ops.independent()[static_cast<std::size_t>(i)]];
          const VectorXd turning = apply(dX, ops, v);  // the rate space of a whole vehicle is v
          RandomTree open = both.closed;
          open.spec.loops.clear();
          Loaded without_loops(open);
          without_loops.state = closed.state;
          const VectorXd missing = closed.tau - without_loops.inverse(turning);
          const VectorXd got = apply(X * inv(mass) * star(X), ops, missing) + turning;
          return relative(distance(got, want), largest(want));
        },
        kTrees / 3);
  }
}

// Along motions that keep the loops closed, by differences of fourth order in the same independent rates.
TEST(CompoundTree, DerivativeOfTheMassMatrixIsItsChangeAlongTheLoops) {
  const auto differences = [](Mechanism& s) {
    VectorXd rates = VectorXd::Zero(s.model->nv);
    for (int j = 0; j < s.size(); ++j) rates[s.ops.independent()[idx(j)]] = std::cos(0.4 + j);
    s.ops.along(rates.data());
    const MatrixXd slope = dense(mass_derivative, s.ops);
    VectorXd u(s.size());
    for (int j = 0; j < s.size(); ++j) u[j] = rates[s.ops.independent()[idx(j)]];
    const VectorXd way = apply(X, s.ops, u);
    LoopProjection projection(*s.model);
    CompoundTree other(s.model);
    bool same = true;
    const auto at = [&](double h) {
      // the closed state whose independent coordinates are those moved: what projection moves of them is taken back
      VectorXd q(s.model->nq), v = VectorXd::Zero(s.model->nv), d(s.model->nv), back(s.model->nq);
      s.model->retract(s.state.q.data(), VectorXd(h * way).data(), q.data());
      for (int twice = 0; twice < 4; ++twice) {
        if (!projection.close(q.data(), v.data())) return MatrixXd(MatrixXd::Constant(s.size(), s.size(), HUGE_VAL));
        s.model->difference(s.state.q.data(), q.data(), d.data());
        VectorXd missing = VectorXd::Zero(s.size());
        for (int j = 0; j < s.size(); ++j) missing[j] = h * u[j] - d[s.ops.independent()[idx(j)]];
        const VectorXd more = apply(X, s.ops, missing);
        s.model->retract(q.data(), more.data(), back.data());
        q = back;
      }
      projection.close(q.data(), v.data());
      other.at(q.data());
      same = same && other.independent() == s.ops.independent();
      return dense(mass, other);
    };
    const double h = 2e-3;
    const MatrixXd by_differences = (8.0 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12.0 * h);
    return same ? differ(slope, by_differences, 1e-3 * largest(dense(mass, s.ops))) : 0.0;
  };
  for (const SystemSpec& spec : {touching_four_bars(2), bending_four_bars(1, true), bending_tower(1)}) {
    Mechanism s(spec);
    EXPECT_LE(differences(s), 1e-6);  // fourth order in steps of 2e-3
  }
  for (const char* name : {"four_bar", "andrews", "hexapod_free", "tello", "rocker_bogie"}) {
    Mechanism s(bench_loops::read(std::string(CARDAN_SOURCE_DIR "/tests/reference/bench_loops/") + name + ".json").spec);
    EXPECT_LE(differences(s), 1e-6) << name;
  }
}

class BenchOperators : public testing::TestWithParam<std::filesystem::path> {};

// M_c^-1 by rules: accelerations and log det X* M X of the independent rates of the file, exact to 34 digits. 1e-13, or what rounding in
// the mass matrix of the open tree amounts to: sets of many touching loops are one compound, whose rates are eliminated together.
TEST_P(BenchOperators, HaveTheirExactDeterminantAndInverse) {
  const bench_loops::Model bench = bench_loops::read(GetParam());
  const auto model = compiled(bench.spec);
  CompoundTree ops(model);
  for (std::size_t i = 0; i < bench.states.size(); ++i) {
    const bench_loops::State& s = bench.states[i];
    ops.at(s.q.data());
    ops.articulate();
    const MatrixXd along = dense(X, ops), Mc = dense<false>(mass, ops);
    const double rounding = worse(1e-13, std::numeric_limits<double>::epsilon() * 10.0 * scaled_condition(Mc));
    EXPECT_EQ(along.cols(), bench.mobility);
    // Free hinges have their components in another order there, which a determinant does not mind.
    EXPECT_NEAR(ops.log_det(), s.log_det + 2.0 * std::log(std::abs(determinant(along(bench.independent, Eigen::all)))),
                worse(1e-11, 1e3 * rounding) * (1.0 + std::abs(s.log_det)));
    Workspace ws(*model);
    VectorXd one(model->nv), other(model->nv), tau = s.tau;
    ASSERT_TRUE(forward_dynamics(*model, ws, {.q = s.q.data(), .v = s.v.data(), .tau = tau.data()}, one.data()));
    for (int v = 0; v < model->nv; ++v) tau[v] = std::cos(0.5 + v);
    ASSERT_TRUE(forward_dynamics(*model, ws, {.q = s.q.data(), .v = s.v.data(), .tau = VectorXd(s.tau + tau).data()}, other.data()));
    const VectorXd change = other - one;
    const double lost = std::numeric_limits<double>::epsilon() * largest(one) / largest(change);
    EXPECT_LE(differ(apply<false>(X * mass_inverse * star(X), ops, tau), change), worse(1e3 * rounding, 100.0 * lost));
    EXPECT_LE(differ(apply(X * mass_inverse * star(X), ops, tau), change), worse(1e3 * rounding, 100.0 * lost));
  }
}
INSTANTIATE_TEST_SUITE_P(Of, BenchOperators, testing::ValuesIn(bench_loops::files()),
                         [](const auto& file) { return file.param.stem().string(); });

TEST(CompoundTree, LoopsOfFixedSizeMakeCompoundsOfFixedSize) {
  const auto most = [](const std::string& name) {
    const CompoundTree ops(compiled(bench_loops::read(CARDAN_SOURCE_DIR "/tests/reference/bench_loops/" + name + ".json").spec));
    std::size_t members = 0;
    for (const Compound& c : ops.compounds()) members = std::max(members, c.members.size());
    return members;
  };
  EXPECT_EQ(most("fourbar_chain_4"), 3u);
  EXPECT_EQ(most("fourbar_chain_32"), 3u);
  EXPECT_EQ(most("n_fourbar_40"), 81u);  // all cranks and couplers are one
  EXPECT_EQ(most("revolute_rotor_chain"), 2u);
}

TEST(CompoundTree, WithoutLoopsIsTheTree) {
  for (const TreeOptions& options : kinds_of_trees())
    for_all_trees(
        options, 1e-13,
        [](const RandomTree& tree) {
          Mechanism s(tree.spec);
          TreeOperators plain(s.model);
          plain.at(s.state.q.data());
          plain.articulate();
          plain.operational_space();
          if (s.model->nv == 0) return 0.0;
          const auto apart = [&](auto e) { return differ(dense<false>(e, s.ops), dense<false>(e, plain)); };
          const double condition = scaled_condition(dense<false>(mass, plain));  // of which what D^-1 is in is rounded
          return worse({apart(mass), apart(P), apart(X),
                        worse({apart(omega), apart(K), apart(P_plus), apart(Y), apart(Y_plus)}) / worse(1.0, 1e-2 * condition)});
        },
        20);
}

// Given components are left out of D, a diagonal is added to it: as dense matrices have it.
TEST(CompoundTree, SomeRatesGivenAndADiagonalAdded) {
  for_all_mechanisms(
      kCompoundIdentity,
      [](Mechanism& s) {
        const int n = s.size();
        std::vector<std::uint8_t> free(idx(n), 1);
        std::vector<int> left;
        for (int j = 0; j < n; ++j)
          if (j % 3 == 1)
            free[idx(j)] = 0;
          else
            left.push_back(j);
        const MatrixXd Mc = dense<false>(mass, s.ops);
        s.ops.articulate({.free = free});
        const MatrixXd masked = dense(mass_inverse, s.ops)(left, left), of_free = Mc(left, left);
        const double one = differs_from_inverse(masked, of_free);
        const double det = relative(std::abs(s.ops.log_det() - std::log(determinant(of_free))), 1.0 + std::abs(s.ops.log_det()));
        VectorXd W(n);
        for (int j = 0; j < n; ++j) W[j] = 0.3 * Mc(j, j) * (1.0 + std::sin(j));
        s.ops.articulate({.W = W.data()});
        const MatrixXd weighted = Mc + MatrixXd(W.asDiagonal());
        return worse({one, det, differs_from_inverse(dense<false>(inv(mass_innovations), s.ops), weighted)});
      },
      60);
}

TEST(CompoundTree, ComposesAtRunTime) {
  const auto model = compiled(touching_four_bars(3));
  const auto tree = std::make_shared<CompoundTree>(model);
  tree->at(model->initial_state().q.data());
  tree->articulate();
  const Expression Xe = Expression::leaf(tree, Kind::X), M_c = Expression::named()[0].of(tree);
  const Expression response = Xe * M_c.inv() * Xe.star();
  EXPECT_EQ(response.text(), "X (I - K* psi* H*) D^-1 (I - H psi K) X*");
  EXPECT_EQ(response.shape(), "rate x rate (7 x 7)");
  EXPECT_EQ(M_c.shape(), "hinge x hinge (1 x 1)");
  EXPECT_LE(differ(response.dense(), dense(X * mass_inverse * star(X), *tree)), 1e-14);
}

// Cranks in line: both ways on are free to first order.
TEST(CompoundTree, IsRefusedAtASingularPosture) {
  const auto model = compiled(touching_four_bars(1));
  CompoundTree ops(model);
  const VectorXd flat = VectorXd::Zero(model->nq);
  try {
    ops.at(flat.data());
    FAIL();
  } catch (const NumericsError& e) {
    EXPECT_EQ(e.failure().code, Code::loop_failed);
    EXPECT_NE(e.failure().hint.find("a singular posture"), std::string::npos);
  }
}

}  // namespace
}  // namespace cardan::test
