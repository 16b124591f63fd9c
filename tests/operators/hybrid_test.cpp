// Hybrid dynamics with any mask, and what carries no actuator, against the dense twin: on trees, subtrees, paths.
#include "core/operators/hybrid.hpp"
#include "core/linalg/dense.hpp"

#include "core/model/components.hpp"
#include "core/operators/mass_matrix.hpp"
#include "core/operators/system_properties.hpp"
#include "tests/operators/views.hpp"
#include "tests/support/equations.hpp"

namespace cardan::test {
namespace {

using namespace cardan::operators;

TEST(Hybrid, AnyMaskAgainstTheTwin) {  // inside hinges and among modes; wrenches, gravity, elasticity, velocities
  for (std::vector<TreeOptions> kinds = kinds_of_trees(); const TreeOptions& options : kinds)
    for_all_trees(
        options, kIdentity,
        [](const RandomTree& tree) {
          Scene s(tree);
          const int n = s.model->nv;
          if (n == 0) return 0.0;
          const std::vector<std::uint8_t> mask = some_mask(tree.seed, n);
          std::vector<bool> given(static_cast<std::size_t>(n));
          for (std::size_t i = 0; i < given.size(); ++i) given[i] = mask[i] == 0;
          const VectorXd tau = some_vector(tree.seed + 1, n), vdot = some_vector(tree.seed + 2, n);
          const auto want = s.twin.hybrid(tau, given, vdot, s.twin_wrenches());
          prepare(s.ops, mask);
          cardan::Workspace ws(*s.model);
          const std::vector<cardan::NodeWrench> wrenches = s.wrenches();
          const VectorXd known = bias(s.ops, ws, {.v = s.state.v.data(), .wrenches = wrenches});
          const Hybrid got = hybrid_dynamics(s.ops, known, tau, vdot);
          const std::vector<int> f = where(mask, 1);
          const double forces = worse(largest(known), largest(s.twin.bias));
          return worse(differ(got.vdot, want.vdot), differ(got.tau, want.tau, forces)) / scaled_condition(s.twin.M(f, f));
        },
        kTrees);
}

TEST(Hybrid, OnSubgraphs) {
  for_all_views(kinds_of_trees(), kIdentity, [](View& v, Scene& s) {
    const Eigen::Index n = v.M.cols();
    const std::vector<std::uint8_t> mask = some_mask(s.tree.seed, n);
    const std::vector<int> f = where(mask, 1), p = where(mask, 0);
    prepare(v.ops, mask);
    VectorXd known = some_vector(s.tree.seed + 9, n);
    if (std::string_view(v.name) == "subtree") {  // inboard of it all stands still
      cardan::Workspace ws(*s.model);
      VectorXd moving = VectorXd::Zero(s.model->nv);
      for (const int j : v.components) moving[j] = s.state.v[j];
      const auto rest = reference::DenseTwin<double>(s.tree.spec).at(s.state.q, moving);
      const VectorXd want = rest.inverse(VectorXd::Zero(s.model->nv))(v.components);
      known = bias(v.ops, ws, {.v = s.state.v.data()});
      if (const double error = differ(known, want, worse(largest(rest.bias), largest(rest.gravity_force))); !(error <= kIdentity))
        return error;
    }
    const VectorXd tau = some_vector(s.tree.seed + 1, n), vdot = some_vector(s.tree.seed + 2, n);
    const Hybrid got = hybrid_dynamics(v.ops, known, tau, vdot);
    VectorXd a = vdot, t = tau;
    if (!f.empty()) {
      const VectorXd rest = tau(f) - known(f) - v.M(f, p) * vdot(p);
      a(f) = VectorXd(positive_solve(v.M(f, f), rest));
    }
    t(p) = VectorXd(v.M * a + known)(p);
    return worse(differ(got.vdot, a), differ(got.tau, t)) / scaled_condition(v.M(f, f));
  });
}

std::shared_ptr<const Model> two_links() {
  return compiled(system({on(rigid("upper", 2.0, {0.5, 0, 0}, diagonal({0.1, 0.2, 0.3})), "", "revolute", {{0, 0, 1}}),
                          on(rigid("lower", 2.0, {0.5, 0, 0}, diagonal({0.1, 0.2, 0.3})), "upper", "revolute", {{0, 0, 1}}, {1, 0, 0})},
                         uniform_gravity({0, -9.0, 0})));
}

TEST(Hybrid, DrivesByName) {
  const auto model = two_links();
  TreeOperators ops(model);
  const double q[] = {0.0, 0.0};
  const double v[] = {0.0, 0.0}, moving[] = {0.0, 0.4};
  ops.at(q);
  cardan::Workspace ws(*model);
  const std::vector<Drive> drives = {Drive::passive, Drive::locked};
  ops.articulate({.free = free_mask(drives)});
  const VectorXd junk = VectorXd::Constant(2, 17.0);
  const Hybrid got = hybrid_dynamics(ops, drives, ws, {.q = q, .v = v}, junk, junk);
  // one stiff body: J about the hinge 2 (0.3) + 2 (0.25 + 2.25), moment of gravity -9 (2 0.5 + 2 1.5)
  EXPECT_NEAR(got.vdot[0], -36.0 / 5.6, 1e-13);
  EXPECT_EQ(got.vdot[1], 0.0);
  EXPECT_EQ(got.tau[0], 0.0);
  // the lock carries the lower link: its moment of momentum about its hinge less that of gravity
  EXPECT_NEAR(got.tau[1], -36.0 / 5.6 * (0.3 + 2.0 * 0.5 * 1.5) + 9.0 * 2.0 * 0.5, 1e-13);
  const auto code = [](const auto& call) {
    try {
      call();
    } catch (const InputError& e) {
      return e.diagnostics()[0].code;
    }
    return Code::yaml_syntax;
  };
  EXPECT_EQ(code([&] { hybrid_dynamics(ops, drives, ws, {.q = q, .v = moving}, junk, junk); }), Code::out_of_range);
  EXPECT_EQ(code([&] {
              hybrid_dynamics(ops, std::vector{Drive::forced, Drive::forced}, ws, {.q = q, .v = v}, junk, junk);
            }),
            Code::operator_shape);
  EXPECT_EQ(code([&] { hybrid_dynamics(ops, std::vector{Drive::forced}, ws, {.q = q, .v = v}, junk, junk); }), Code::operator_shape);
  EXPECT_EQ(code([&] { hybrid_dynamics(ops, VectorXd::Zero(3), junk, junk); }), Code::operator_shape);
  TreeOperators upper = ops.subgraph({1});
  EXPECT_NEAR(bias(upper, ws, {.q = q, .v = v})[0], 9.0 * 2.0 * 0.5, 1e-13);  // the lower link is not there
  EXPECT_EQ(code([&] { hybrid_dynamics(upper, VectorXd::Zero(1), VectorXd::Zero(1), VectorXd::Zero(1)); }), Code::operator_stage);
  EXPECT_EQ(code([&] { base_momenta(ops, Vector6d::Zero()); }), Code::unsupported);
}

// The base: hinges of all roots, rigid or flexible; then any other set.
TEST(Components, OfModesAreFoundByName) {
  const auto model = compiled(random_tree(1, {.bodies = 4, .flexible = 1.0}).spec);
  int modes = 0;
  for (const UserBody& u : model->user) {
    std::vector<int> all;
    for (int j = 0; j < u.n_modes; ++j, ++modes) {
      all.push_back(u.etadot + j);
      EXPECT_EQ(components_of(*model, fmt::format("{}.etadot_{}", u.name, j + 1)), std::vector{u.etadot + j});
    }
    EXPECT_EQ(components_of(*model, u.name + ".eta"), all);
  }
  EXPECT_GT(modes, 4);
}

TEST(Unactuated, AgainstTheBlocksOfTheMassMatrix) {
  for (const bool base : {true, false})
    for_all_views(floating_trees(), kIdentity, [&](View& v, Scene& s) {
      const Eigen::Index n = v.M.cols();
      const std::vector<std::uint8_t> mask = base ? base_mask(v.ops) : some_mask(s.tree.seed + 3, n);
      const std::vector<int> p = where(mask, 1), a = where(mask, 0);
      if (p.empty()) return 0.0;
      prepare(v.ops, mask);
      const Unactuated u(v.ops);
      const Task task{v.nodes, {}};
      const MatrixXd J = v.jacobian(v.nodes), Mpp = v.M(p, p), Mpa = v.M(p, a), back = positive_solve(Mpp, Mpa),
                     Jg = J(Eigen::all, a) - J(Eigen::all, p) * back;
      const MatrixXd Mg = v.M(a, a) - Mpa.transpose() * back;
      const VectorXd rates = some_vector(s.tree.seed, n), momenta = some_vector(s.tree.seed + 1, n), tau = some_vector(s.tree.seed + 2, n);
      VectorXd want = rates;
      want(p) = VectorXd(positive_solve(Mpp, VectorXd(momenta(p))) - back * rates(a));
      const MatrixXd got_Jg = u.generalised_jacobian(task), coupling = u.coupling();
      const MatrixXd Mg_got = matrix_of(n, [&](const VectorXd& x) { return u.reduced_mass_times(x); });
      double worst =
          worse({differ(u.velocities(rates, momenta), want), differ(got_Jg(Eigen::all, a), Jg, largest(J)), largest(got_Jg(Eigen::all, p)),
                 differ(u.task_rates(task, rates, momenta), J * want), differ(coupling(p, a), -back, 1.0), largest(coupling(a, Eigen::all)),
                 differ(Mg_got(a, a), Mg, largest(v.M)), differ(u.reduced_forces(tau)(a), tau(a) - back.transpose() * tau(p))});
      return worst / scaled_condition(Mpp);
    });
}

TEST(Unactuated, MomentumOfAFloatingBase) {  // what is asked for is what the system has
  std::vector<TreeOptions> kinds = floating_trees();
  for (TreeOptions& options : kinds) {
    options.roots = 1;
    for_all_trees(
        options, kIdentity,
        [](const RandomTree& tree) {
          Scene s(tree);
          prepare(s.ops, base_mask(s.ops));
          const Unactuated u(s.ops);
          const VectorXd rates = some_vector(tree.seed, s.model->nv);
          Vector6d h = some_vector(tree.seed + 5, 6);
          const double size = largest(momentum_matrix(s.ops, About::world_origin));
          double worst = 0.0;
          for (int zero = 0; zero < 2; ++zero, h.setZero()) {
            const VectorXd v = u.velocities(rates, base_momenta(s.ops, h));
            const auto moving = reference::DenseTwin<double>(tree.spec).at(s.state.q, v);
            Vector6d got;
            got << moving.angular_momentum, moving.linear_momentum;
            worst = worse(worst, largest(got - h) / (size * worse(1.0, largest(v))));
          }
          const std::vector<std::uint8_t> base = base_mask(s.ops);
          const std::vector<int> p = where(base, 1);
          const MatrixXd Mpp = s.twin.M(p, p);
          const double log_det = std::log(determinant(Mpp));
          return worse(worst, std::abs(u.log_det() - log_det) / worse(1.0, std::abs(log_det))) / scaled_condition(Mpp);
        },
        kTrees);
  }
}

}  // namespace
}  // namespace cardan::test
