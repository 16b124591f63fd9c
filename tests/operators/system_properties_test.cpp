// Mass properties, momentum, and what is felt at a hinge, against the dense twin and against definitions.
#include "core/operators/system_properties.hpp"

#include "core/linalg/dense.hpp"
#include "core/operators/mass_matrix.hpp"
#include "tests/operators/views.hpp"
#include "tests/support/equations.hpp"

namespace cardan::test {
namespace {

using namespace cardan::operators;

double off(const Vector3d& a, const Vector3d& b, double scale) { return (a - b).norm() / scale; }

TEST(MassProperties, OfTheTreeAndOfPathsAgainstTheTwin) {
  for_all_views(kinds_of_trees(), kIdentity, [](View& v, Scene& s) {
    const MassProperties all = mass_properties(v.ops);
    if (std::string_view(v.name) == "subtree") {  // with the rest it makes the whole
      std::vector<int> rest;
      for (const auto& b : s.ops.bodies())
        if (v.ops.index_of(b.sweep) < 0) rest.push_back(b.sweep);
      const MassProperties other = mass_properties(s.ops.subgraph(rest)), whole = mass_properties(s.ops);
      const double m = all.mass * other.mass / whole.mass;
      const Vector3d d = all.com - other.com;
      const Eigen::Matrix3d J = all.inertia + other.inertia + m * (d.squaredNorm() * Eigen::Matrix3d::Identity() - d * d.transpose());
      const Vector3d com = (all.mass * all.com + other.mass * other.com) / whole.mass;
      return worse({std::abs(all.mass + other.mass - whole.mass) / whole.mass, off(com, whole.com, 1.0 + whole.com.norm()),
                    differ(J, whole.inertia)});
    }
    const auto twin = s.twin_of(v.ops);
    return worse(std::abs(all.mass - twin.total_mass) / twin.total_mass, off(all.com, twin.com, 1.0 + twin.com.norm()));
  });
}

TEST(MassProperties, InertiaIsWhatTurnsStiffly) {  // angular momentum of a rigid rotation about the mass centre
  std::vector<TreeOptions> kinds = floating_trees();
  for (TreeOptions& options : kinds) {
    options.roots = 1;
    for_all_trees(
        options, kIdentity,
        [](const RandomTree& tree) {
          Scene s(tree);
          const MassProperties all = mass_properties(s.ops);
          const UserBody& root = s.model->user[static_cast<std::size_t>(s.ops.bodies()[0].user)];
          const auto tip = s.twin.node(root.name, "tip");
          const Vector3d w(0.3, -0.5, 0.8);
          Vector6d at_tip;
          at_tip << tip.R.transpose() * w, tip.R.transpose() * w.cross(Vector3d(tip.x) - all.com);
          VectorXd v = VectorXd::Zero(s.model->nv);
          v.segment<6>(root.v) = least_squares(tip.J.middleCols(root.v, 6), at_tip);
          const auto turning = reference::DenseTwin<double>(tree.spec).at(s.state.q, v);
          const Vector3d h = Vector3d(turning.angular_momentum) - all.com.cross(Vector3d(turning.linear_momentum));
          const Placement frame = place_of_node(s.ops, s.model->find_node(root.name + ".tip"));
          const MassProperties seen = all.seen_from(frame);
          return worse({(h - all.inertia * w).norm() / h.norm(), turning.linear_momentum.norm() / (all.mass * (1.0 + all.com.norm())),
                        off(frame.p, tip.x, 1.0 + tip.x.norm()), differ(frame.R, tip.R),
                        off(frame.p + frame.R * seen.com, all.com, 1.0 + all.com.norm()),
                        differ(frame.R * seen.inertia * frame.R.transpose(), all.inertia)});
        },
        kTrees);
  }
}

TEST(MassProperties, KeepTheirDigitsInOrbit) {
  std::vector<BodySpec> bodies = {
      on(rigid("bus", 800.0, {0.1, 0.2, -0.1}, diagonal({300, 350, 400})), "", "free_body"),
      on(rigid("wing", 40.0, {0.0, 2.0, 0.0}, diagonal({30, 5, 33})), "bus", "revolute", {{0, 1, 0}}, {0.0, 1.0, 0.0})};
  const auto near = compiled(system(bodies));
  State state = near->initial_state();
  TreeOperators here(near), far(near);
  here.at(state.q.data());
  Eigen::Map<Vector3d>(state.q.data() + 4) += Vector3d(4.1e6, -5.2e6, 2.3e6);
  far.at(state.q.data());
  EXPECT_LT(differ(mass_properties(far).inertia, mass_properties(here).inertia), 1e-14);
  const VectorXd v = some_vector(1, 7);
  EXPECT_LT(differ(momentum_matrix(far, About::mass_centre), momentum_matrix(here, About::mass_centre)), 1e-14);
  EXPECT_NEAR(momentum(far, About::mass_centre, v).norm() / momentum(here, About::mass_centre, v).norm(), 1.0, 1e-14);
}

TEST(Momentum, MatrixProductsAndTwin) {
  for_all_views(kinds_of_trees(), kIdentity, [](View& v, Scene& s) {
    const VectorXd x = some_vector(s.tree.seed, v.M.cols()), w = some_vector(s.tree.seed + 1, 6);
    double worst = 0.0;
    for (const About about : {About::world_origin, About::mass_centre}) {
      const MatrixXd A = momentum_matrix(v.ops, about);
      worst = worse({worst, differ(momentum(v.ops, about, x), A * x, largest(A)),
                     differ(momentum_adjoint(v.ops, about, w), A.transpose() * w, largest(A))});
    }
    if (std::string_view(v.name) == "subtree") return worst;
    const SystemSpec spec = s.only(v.ops);
    const auto twin = reference::DenseTwin<double>(spec).at(compiled(spec)->initial_state().q, x);
    Vector6d h, centroidal;
    h << twin.angular_momentum, twin.linear_momentum;
    centroidal << Vector3d(twin.angular_momentum) - Vector3d(twin.com).cross(Vector3d(twin.linear_momentum)), twin.linear_momentum;
    return worse({worst, differ(momentum(v.ops, About::world_origin, x), h, largest(momentum_matrix(v.ops, About::world_origin))),
                  differ(momentum(v.ops, About::mass_centre, x), centroidal, largest(momentum_matrix(v.ops, About::world_origin)))});
  });
}

TEST(Momentum, OfASubtreeIsTheDifference) {  // of the whole and of what is left, moving alike
  for_all_views(kinds_of_trees(), kIdentity, [](View& v, Scene& s) {
    if (std::string_view(v.name) != "subtree") return 0.0;
    VectorXd all = VectorXd::Zero(s.model->nv);
    const VectorXd x = some_vector(s.tree.seed, v.M.cols());
    for (std::size_t i = 0; i < v.components.size(); ++i) all[v.components[i]] = x[static_cast<Eigen::Index>(i)];
    return differ(momentum(v.ops, About::world_origin, x), momentum(s.ops, About::world_origin, all),
                  largest(momentum_matrix(s.ops, About::world_origin)));
  });
}

TEST(Momentum, SharedAmongBodies) {
  for_all_views(kinds_of_trees(), kIdentity, [](View& v, Scene& s) {
    const VectorXd x = some_vector(s.tree.seed, v.M.cols());
    const MomentumSharing shared = momentum_sharing(v.ops, x);
    double worst = differ(shared.total, momentum(v.ops, About::mass_centre, x), largest(shared.bodies));
    if (shared.linear.size() > 0) worst = worse(worst, std::abs(shared.linear.sum() - 1.0) / worse(1.0, largest(shared.linear)));
    if (shared.angular.size() > 0) worst = worse(worst, std::abs(shared.angular.sum() - 1.0) / worse(1.0, largest(shared.angular)));
    return worst;
  });
  // By hand: 1 kg and 3 kg in a row along x at rates 2 and 2 + 1.
  const auto model = compiled(system({on(rigid("a", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "prismatic", {{1, 0, 0}}),
                                      on(rigid("b", 3.0, {0, 0, 0}, diagonal({1, 1, 1})), "a", "prismatic", {{1, 0, 0}}, {1, 0, 0})}));
  TreeOperators ops(model);
  const double q[] = {0.0, 0.0};
  ops.at(q);
  const MomentumSharing shared = momentum_sharing(ops, Eigen::Vector2d(2.0, 1.0));
  EXPECT_NEAR(shared.linear[0], 2.0 / 11.0, 1e-15);
  EXPECT_NEAR(shared.linear[1], 9.0 / 11.0, 1e-15);
  EXPECT_EQ(shared.angular.size(), 0);                                            // none
  EXPECT_EQ(momentum_sharing(ops, Eigen::Vector2d(3.0, -4.0)).linear.size(), 0);  // 3 and -3
}

TEST(ReflectedInertia, ByItsDefinitions) {
  for_all_views(kinds_of_trees(), kIdentity, [](View& v, Scene&) {
    prepare(v.ops);
    const ReflectedInertia felt = reflected_inertia(v.ops);
    const MatrixXd inverse = positive_solve(v.M, MatrixXd::Identity(v.M.rows(), v.M.cols()));
    double worst = 0.0;
    for (Eigen::Index k = 0; k < v.M.cols(); ++k)
      worst = worse(
          {worst, std::abs(felt.others_locked[k] / v.M(k, k) - 1.0), std::abs(felt.others_free[k] * inverse(k, k) - 1.0) / v.condition()});
    for (const auto& b : v.ops.bodies()) {  // hold what is not outboard
      const std::vector<int> outboard = v.ops.subtree(b.sweep);
      std::vector<int> free;
      for (const auto& other : v.ops.bodies())
        if (std::find(outboard.begin(), outboard.end(), other.sweep) != outboard.end())
          for (int j = 0; j < other.nh + other.m; ++j) free.push_back(other.v + j);
      const MatrixXd M = v.M(free, free), part = positive_solve(M, MatrixXd::Identity(M.rows(), M.cols()));
      for (std::size_t i = 0; i < free.size(); ++i)
        if (const int k = free[i]; k >= b.v && k < b.v + b.nh + b.m)
          worst = worse(worst, std::abs(felt.outboard_free[k] * part(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(i)) - 1.0) /
                                   scaled_condition(M));
    }
    return worst;
  });
}

TEST(ReflectedInertia, OfWhatIsHeldIsInfinite) {
  const auto model = compiled(system({on(rigid("a", 2.0, {0.5, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {{0, 0, 1}}),
                                      on(rigid("b", 3.0, {0.5, 0, 0}, diagonal({1, 1, 1})), "a", "revolute", {{0, 0, 1}}, {1, 0, 0})}));
  TreeOperators ops(model);
  const double q[] = {0.0, 0.0};
  ops.at(q);
  const std::uint8_t mask[] = {1, 0};
  prepare(ops, mask);
  const ReflectedInertia felt = reflected_inertia(ops);
  EXPECT_TRUE(std::isinf(felt.others_free[1]));
  EXPECT_NEAR(felt.others_free[0], 2.0 + 0.5 + 3.0 * 2.25, 1e-13);  // as one stiff body
  EXPECT_NEAR(felt.others_locked[1], 1.0 + 0.75, 1e-14);
}

}  // namespace
}  // namespace cardan::test
