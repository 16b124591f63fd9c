// Many states at once: each as by itself, whatever stands in the other lanes.
#include "core/dynamics/batch.hpp"

#include <algorithm>
#include <random>

#include "core/linalg/dense.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {
namespace {

// The kernels differ in the order of rounding only: 1e-13 of the largest value, times what the solution amplifies.
constexpr double kLanes = 1e-13;

/// Columns of states near that of the tree.
struct States {
  MatrixXd q, v, tau;
  States(const Loaded& s, int n, unsigned seed) : q(s.model->nq, n), v(s.model->nv, n), tau(s.model->nv, n) {
    std::mt19937 generator(seed);
    const auto draw = [&](double size) {
      VectorXd x(s.model->nv);
      for (Eigen::Index i = 0; i < x.size(); ++i) x[i] = size * (static_cast<double>(generator()) / 4294967296.0 - 0.5);
      return x;
    };
    for (int k = 0; k < n; ++k) {
      s.model->retract(s.state.q.data(), draw(0.3).eval().data(), q.col(k).data());
      v.col(k) = s.state.v + draw(0.5);
      tau.col(k) = s.tau + draw(1.0);
    }
  }
  BatchInputs in(const MatrixXd& vdot) const { return {static_cast<int>(q.cols()), q.data(), v.data(), tau.data(), vdot.data(), true}; }
};

/// Of the worst column, over its length in `b` and more.
double error_2norm(const MatrixXd& a, const MatrixXd& b, const VectorXd& more) {
  double worst = 0.0;
  for (Eigen::Index k = 0; k < a.cols(); ++k) worst = worse(worst, relative((a.col(k) - b.col(k)).norm(), b.col(k).norm() + more[k]));
  return worst;
}

double lanes_beside_one_state(const RandomTree& tree) {
  Loaded s(tree);
  s.wrenches.clear();
  Batch batch(*s.model);
  const int n = 2 * batch.width() + 3;
  const States states(s, n, tree.seed);
  const MatrixXd given = s.vdot_given.replicate(1, n);
  MatrixXd vdot(s.model->nv, n), tau(s.model->nv, n), one_vdot = vdot, one_tau = tau;
  if (batch.forward_dynamics(states.in(given), vdot.data()) != 0) return HUGE_VAL;
  batch.inverse_dynamics(states.in(vdot), tau.data());
  for (int k = 0; k < n; ++k) {
    Inputs in = s.in();
    in.q = states.q.col(k).data(), in.v = states.v.col(k).data(), in.tau = states.tau.col(k).data();
    if (!forward_dynamics(*s.model, s.ws, in, one_vdot.col(k).data())) return HUGE_VAL;
    in.vdot = vdot.col(k).data();
    inverse_dynamics(*s.model, s.ws, in, one_tau.col(k).data());
  }
  if (s.model->nv == 0) return 0.0;
  // v' carries the condition of M; the forces that it takes do not, but are rounded as M v' is, of which they are what is left
  const VectorXd sizes = singular_values(mass_matrix(*s.model, s.ws, states.q.col(0).data()));
  const double condition = sizes[0] / sizes[sizes.size() - 1];
  const VectorXd none = VectorXd::Zero(n), of_bodies = 0.1 * sizes[0] * vdot.colwise().norm();
  return worse(error_2norm(tau, one_tau, of_bodies), error_2norm(vdot, one_vdot, none) / worse(1.0, 1e-2 * condition));
}

TEST(Batch, AgreesWithOneStateAtATime) {
  for (const double prescribed : {0.0, 0.2}) for_all_trees({.bodies = 10, .prescribed = prescribed}, kLanes, lanes_beside_one_state);
}

// Large enough that bodies share cores and that limbs are numbered one after another: of revolute bodies, which share, and with others
// among them, which do not. Fifteen times the bodies of the test above, whose roundings add up.
TEST(Batch, AgreesOnLargeTrees) {
  for (const double flexible : {0.0, 0.1})
    for (const double wheels : {0.0, 0.1})
      for_all_trees({.bodies = 150, .flexible = flexible, .wheels = wheels, .hinges = {"revolute"}}, 15.0 * kLanes, lanes_beside_one_state,
                    4);
  for_all_trees({.bodies = 150, .roots = 5, .wheels = 0.1}, 15.0 * kLanes, lanes_beside_one_state, 8);
}

TEST(Batch, WithoutVelocitiesItIsAtRest) {
  for_all_trees(
      {.bodies = 6}, 0.0,
      [](const RandomTree& tree) {
        Loaded s(tree);
        Batch batch(*s.model);
        const States states(s, batch.width() + 1, tree.seed);
        const MatrixXd rest = MatrixXd::Zero(s.model->nv, states.q.cols());
        MatrixXd given = rest, left_out = rest;
        BatchInputs in = states.in(rest);
        in.v = rest.data();
        batch.forward_dynamics(in, given.data());
        in.v = nullptr;
        batch.forward_dynamics(in, left_out.data());
        return largest(given - left_out);
      },
      20);
}

TEST(Batch, AStateHasTheSameBitsWhereverItStands) {
  for_all_trees(
      {.bodies = 8}, 0.0,
      [](const RandomTree& tree) {
        Loaded s(tree);
        Batch batch(*s.model), fresh(*s.model);
        const int n = batch.width() + 1;
        const States states(s, n, tree.seed);
        const MatrixXd none = MatrixXd::Zero(s.model->nv, n);
        MatrixXd together(s.model->nv, n), alone(s.model->nv, n), reversed(s.model->nv, n);
        batch.forward_dynamics(states.in(none), together.data());
        States back = states;
        back.q = states.q.rowwise().reverse().eval(), back.v = states.v.rowwise().reverse().eval(),
        back.tau = states.tau.rowwise().reverse().eval();
        batch.forward_dynamics(back.in(none), reversed.data());
        for (int k = 0; k < n; ++k) {
          BatchInputs one{1, states.q.col(k).data(), states.v.col(k).data(), states.tau.col(k).data(), none.data(), true};
          fresh.forward_dynamics(one, alone.col(k).data());
        }
        return worse(largest(together - alone), largest(together - reversed.rowwise().reverse()));
      },
      20);
}

TEST(MassMatrix, ItsInverseIsFormedWithoutIt) {
  for (const double flexible : {0.0, 0.4})
    for_all_trees({.bodies = 9, .roots = 1, .flexible = flexible, .floating = true}, 1e-10, [](const RandomTree& tree) {
      Loaded s(tree);
      const int nv = s.model->nv;
      MatrixXd inverse(nv, nv);
      if (!mass_matrix_inverse(*s.model, s.ws, s.state.q.data(), inverse.data())) return HUGE_VAL;
      if (inverse != inverse.transpose()) return HUGE_VAL;
      return largest(mass_matrix(*s.model, s.ws, s.state.q.data()) * inverse - MatrixXd::Identity(nv, nv));
    });
}

TEST(Batch, AStateWithoutInertiaIsToldAndHarmsNoOther) {
  // A point on a universal hinge: with the second angle at a right angle it lies on the first axis and has no inertia about it.
  const auto model =
      compiled(system({on(particle("point", 2.0, {0, 0, 1}), "", "universal", {{1, 0, 0}, {0, 1, 0}})}, uniform_gravity({0, 0, -9.81})));
  Batch batch(*model);
  const int n = 2 * batch.width() + 1, bad = 1;
  MatrixXd q(2, n), v = MatrixXd::Ones(2, n), out(2, n), good(2, n);
  for (int k = 0; k < n; ++k) q.col(k) << 0.1 * k, k == bad ? 1.5707963267948966 : 0.05 * k;
  std::vector<std::uint8_t> failed(static_cast<std::size_t>(n));
  EXPECT_EQ(batch.forward_dynamics({n, q.data(), v.data(), nullptr, nullptr, true}, out.data(), failed.data()), 1);
  Workspace ws(*model);
  for (int k = 0; k < n; ++k) {
    EXPECT_EQ(failed[static_cast<std::size_t>(k)], k == bad) << k;
    Inputs in;
    in.q = q.col(k).data(), in.v = v.col(k).data();
    EXPECT_EQ(forward_dynamics(*model, ws, in, good.col(k).data()), k != bad);
    if (k == bad)
      EXPECT_TRUE(out.col(k).array().isNaN().all());
    else
      EXPECT_LT(apart(out.col(k), good.col(k)), 1e-13);
  }
}

TEST(Rotors, WheelsAreFoldedIntoWhatCarriesThem) {
  int rotors = 0;
  for (unsigned seed = 1; seed <= 60; ++seed) rotors += static_cast<int>(Loaded(random_tree(seed, {})).model->rotors.size());
  EXPECT_GT(rotors, 10);  // so that every law of this folder is a law of folded wheels too
}

}  // namespace
}  // namespace cardan::test
