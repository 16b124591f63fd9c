// Operational space, mass matrix by composite inertias and its inverse by blocks, against their dense definitions: J M^-1 J* with
// J and M of the dense twin, on trees, subtrees and paths.
#include "core/operators/operational_space.hpp"
#include "core/linalg/dense.hpp"

#include <random>

#include "core/dynamics/node_compliance.hpp"
#include "core/operators/mass_matrix.hpp"
#include "tests/operators/views.hpp"
#include "tests/support/equations.hpp"
#include "tests/support/modal_samples.hpp"

namespace cardan::test {
namespace {

using namespace cardan::operators;

TEST(MassMatrix, ByCompositeInertias) {
  for_all_views(kinds_of_trees(), kIdentity, [](View& v, Scene&) {
    const MatrixXd products = matrix_of(v.M.cols(), [&](const VectorXd& x) { return mass_times(v.ops, x); });
    return worse(differ(mass_matrix(v.ops), v.M), differ(products, v.M));
  });
}

TEST(MassMatrix, InverseByItsBlocks) {
  for_all_views(kinds_of_trees(), kIdentity, [](View& v, Scene& s) {
    double worst = 0.0;
    for (const bool masked : {false, true}) {
      const std::vector<std::uint8_t> mask = some_mask(s.tree.seed, v.M.cols(), masked ? -0.2 : -2.0);
      prepare(v.ops, mask);
      const std::vector<int> f = where(mask, 1), p = where(mask, 0);
      const MatrixXd inverse = mass_matrix_inverse(v.ops), M = v.M(f, f);
      const VectorXd d = M.diagonal().cwiseSqrt();
      const MatrixXd one = d.asDiagonal() * (inverse(f, f) * M) * d.cwiseInverse().asDiagonal();
      worst = worse({worst, largest(one - MatrixXd::Identity(one.rows(), one.cols())) / scaled_condition(M),
                     largest(inverse(p, Eigen::all)), differ(inverse, inverse.transpose())});
    }
    return worst;
  });
}

TEST(OperationalSpace, ComplianceOfAnyNodes) {
  for_all_views(kinds_of_trees(), kIdentity, [](View& v, Scene& s) {
    prepare(v.ops);
    std::vector<int> nodes(v.nodes.rbegin(), v.nodes.rend());
    nodes.push_back(nodes[s.tree.seed % nodes.size()]);  // one of them twice
    const MatrixXd J = v.jacobian(nodes);
    return differ(compliance(v.ops, nodes), J * positive_solve(v.M, J.transpose())) / v.condition();
  });
}

/// Trees of rigid bodies with every hinge, all components free; deep ones, and wide ones with wheels.
std::vector<TreeOptions> rigid_trees() {
  std::vector<TreeOptions> out;
  for (const int bodies : {3, 8, 20}) {
    TreeOptions o;
    o.bodies = bodies, o.flexible = 0.0, o.locked = 0.1, o.wheels = bodies == 8 ? 0.6 : 0.2;
    out.push_back(o);
  }
  return out;
}

TEST(NodeCompliance, IsThatOfTheTwin) {
  for_all_views(rigid_trees(), kIdentity, [](View& v, Scene& s) {
    if (!v.ops.whole()) return 0.0;
    if (!NodeCompliance::takes(*s.model)) return s.model->has(OpCode::refine) ? 0.0 : HUGE_VAL;
    std::vector<int> nodes(v.nodes.rbegin(), v.nodes.rend());
    nodes.push_back(nodes[s.tree.seed % nodes.size()]);  // one of them twice
    NodeCompliance by_sweeps(s.model);
    MatrixXd C, again, one;
    by_sweeps.compliance(s.state.q.data(), nodes, C);
    by_sweeps.compliance(s.state.q.data(), std::span(nodes).first(1), one);
    by_sweeps.compliance(s.state.q.data(), nodes, again);
    const MatrixXd J = v.jacobian(nodes);
    const double error = differ(C, J * positive_solve(v.M, J.transpose())) / v.condition();
    return worse({error, largest(C - C.transpose()), largest(again - C), largest(one - C.topLeftCorner<6, 6>())});
  });
}

TEST(NodeCompliance, ItsInverseIsTheInertia) {
  TreeOptions options;
  options.flexible = 0.0, options.floating = true, options.wheels = 0.0;
  options.hinges = {"ball", "free", "free_body", "translational"};
  for_all_views({options}, kIdentity, [](View& v, Scene& s) {
    if (!v.ops.whole() || !NodeCompliance::takes(*s.model)) return 0.0;
    NodeCompliance by_sweeps(s.model);
    MatrixXd C, Lambda;
    by_sweeps.compliance(s.state.q.data(), std::span(v.nodes).first(1), C);
    by_sweeps.inertia(s.state.q.data(), std::span(v.nodes).first(1), Lambda);
    const VectorXd d = C.diagonal().cwiseSqrt();
    const MatrixXd one = d.cwiseInverse().asDiagonal() * (C * Lambda) * d.asDiagonal();
    return worse(largest(one - MatrixXd::Identity(6, 6)) / scaled_condition(C), largest(Lambda - Lambda.transpose()));
  });
}

TEST(NodeCompliance, SaysWhatItDoesNotTake) {
  TreeOptions options;
  options.flexible = 0.0, options.bodies = 1, options.wheels = 0.0, options.hinges = {"revolute"};
  const Scene turning(random_tree(3, options));
  const int tip = turning.model->find_node(turning.tree.spec.bodies[0].name);
  MatrixXd Lambda;
  EXPECT_THROW(NodeCompliance(turning.model).inertia(turning.state.q.data(), std::span(&tip, 1), Lambda), NumericsError);
  options.flexible = 1.0;
  const Scene flexible(random_tree(3, options));
  EXPECT_FALSE(NodeCompliance::takes(*flexible.model));
  EXPECT_THROW(NodeCompliance{flexible.model}, InputError);
}

TEST(OperationalSpace, ComplianceOfTheFreeComponents) {
  for_all_views(kinds_of_trees(), kIdentity, [](View& v, Scene& s) {
    const std::vector<std::uint8_t> mask = some_mask(s.tree.seed, v.M.cols());
    const std::vector<int> f = where(mask, 1);
    prepare(v.ops, mask);
    const MatrixXd J = v.jacobian(v.nodes)(Eigen::all, f), M = v.M(f, f);
    const MatrixXd want = f.empty() ? MatrixXd::Zero(J.rows(), J.rows()) : MatrixXd(J * positive_solve(M, J.transpose()));
    return differ(compliance(v.ops, v.nodes), want) / scaled_condition(M);
  });
}

TEST(OperationalSpace, BlocksOfOmega) {
  for_all_views(
      kinds_of_trees(), kIdentity,
      [](View& v, Scene&) {
        prepare(v.ops);
        const MatrixXd whole = operators::dense(operators::letters::omega, v.ops);
        double worst = 0.0;
        const int n = static_cast<int>(v.ops.bodies().size());
        for (int a = 0; a < n; ++a)
          for (int b = 0; b < n; ++b) {
            const auto &x = v.ops.bodies()[static_cast<std::size_t>(a)], &y = v.ops.bodies()[static_cast<std::size_t>(b)];
            worst = worse(worst, largest(omega_block(v.ops, a, b) - whole.block(x.at, y.at, 6 + x.m, 6 + y.m)));
          }
        return worst / largest(whole) / v.condition();
      },
      60);
}

TEST(OperationalSpace, JacobianAndItsAdjoint) {
  for_all_views(kinds_of_trees(), kIdentity, [](View& v, Scene&) {
    prepare(v.ops);
    const Task task{v.nodes, {}};
    const MatrixXd J = v.jacobian(v.nodes);
    return worse(differ(task_jacobian(v.ops, task), J),
                 differ(matrix_of(J.cols(), [&](const VectorXd& x) { return task_rates(v.ops, task, x); }), J));
  });
}

TEST(OperationalSpace, BiasOfATask) {  // Jdot v = the acceleration of the nodes at v' = 0
  for (const TreeOptions& options : kinds_of_trees())
    for_all_trees(
        options, kIdentity,
        [](const RandomTree& tree) {
          Scene s(tree);
          if (s.model->nv == 0) return 0.0;
          cardan::Workspace ws(*s.model);
          Task task;
          VectorXd want(6 * static_cast<Eigen::Index>(tree.spec.bodies.size()));
          double scale = 1e-3;
          for (const BodySpec& b : tree.spec.bodies) {
            want.segment<6>(6 * static_cast<Eigen::Index>(task.nodes.size())) = s.twin.node(b.name, "tip").acceleration_bias;
            task.nodes.push_back(s.model->find_node(b.name + ".tip"));
          }
          // it is a difference: the size is that of what it is the difference of
          const MatrixXd J = task_jacobian(s.ops, task);
          VectorXd vdot(s.model->nv), none = VectorXd::Zero(s.model->nv);
          cardan::Inputs in{.q = s.state.q.data(), .v = s.state.v.data(), .tau = none.data(), .gravity = false};
          if (!forward_dynamics(*s.model, ws, in, vdot.data())) return HUGE_VAL;
          scale = worse({scale, largest(J * vdot), largest(want)});
          return differ(task_bias(s.ops, task, ws, s.state.v), want, scale);
        },
        kTrees);
}

/// Rows of a task that a tree can surely move: as many as its rank allows is for the other test.
Task some_task(const View& v, unsigned seed) {
  const int most = static_cast<int>(std::min<std::size_t>(3, v.nodes.size()));
  Task task{{v.nodes.begin(), v.nodes.begin() + most}, {}};
  const Eigen::Index rows = std::min<Eigen::Index>(4, v.M.cols());
  const VectorXd x = some_vector(seed, rows * 6 * most);
  task.T = Eigen::Map<const MatrixXd>(x.data(), rows, 6 * most);
  return task;
}

TEST(OperationalSpace, InertiaConsistentInverseAndNullSpace) {
  for_all_views(floating_trees(), kIdentity, [](View& v, Scene& s) {
    prepare(v.ops);
    const Task task = some_task(v, s.tree.seed);
    const OperationalSpace os(v.ops, task);
    const MatrixXd J = task.T * v.jacobian(task.nodes), MiJ = positive_solve(v.M, J.transpose()), C = J * MiJ,
                   one = MatrixXd::Identity(v.M.cols(), v.M.cols());
    if (os.rank() < os.rows()) return differ(os.compliance() * os.inertia() * os.compliance(), C) / v.condition();
    const MatrixXd L = positive_solve(C, MatrixXd::Identity(C.rows(), C.rows())), Jbar = MiJ * L;
    const MatrixXd got_bar = matrix_of(os.rows(), [&](const VectorXd& x) { return os.consistent_inverse(x); });
    const MatrixXd N = matrix_of(v.M.cols(), [&](const VectorXd& x) { return os.null_motion(x); });
    const MatrixXd Nt = matrix_of(v.M.cols(), [&](const VectorXd& x) { return os.null_forces(x); });
    const VectorXd F = some_vector(s.tree.seed + 7, os.rows()), tau = some_vector(s.tree.seed + 8, v.M.cols());
    const VectorXd control = os.torque(F, tau), xdd = J * positive_solve(v.M, control);
    // T may cancel most of what it combines: what is left of the digits
    const double left = std::min(1.0, largest(J) / largest(task.T.cwiseAbs() * v.jacobian(task.nodes).cwiseAbs()));
    const double scale = v.condition() * os.condition() / (left * left);
    return worse({differ(os.compliance(), C), differ(os.inertia(), L), differ(got_bar, Jbar),
                  differ(J * got_bar, MatrixXd::Identity(C.rows(), C.rows())), differ(N, one - Jbar * J, 1.0),
                  differ(Nt, N.transpose(), 1.0), differ(xdd, C * F, largest(J * positive_solve(v.M, tau))),
                  differ(os.force_for(C * F, VectorXd::Zero(os.rows())), F)}) /
           scale;
  });
}

TEST(OperationalSpace, WithoutActuatorsOnSomeComponents) {  // J_g, M_g: those of the rest, the passive ones moving as they must
  for_all_views(floating_trees(), kIdentity, [](View& v, Scene& s) {
    const Eigen::Index n = v.M.cols();
    std::vector<std::uint8_t> passive = some_mask(s.tree.seed + 3, n);
    for (auto& p : passive) p = !p;
    const std::vector<int> a = where(passive, 0), p = where(passive, 1);
    if (a.size() < 4) return 0.0;
    prepare(v.ops);
    TreeOperators other = v.ops.subgraph([&] {
      std::vector<int> all;
      for (const auto& b : v.ops.bodies()) all.push_back(b.sweep);
      return all;
    }());
    prepare(other, passive);
    const Task task = some_task(v, s.tree.seed);
    const OperationalSpace os(v.ops, task, &other);
    const MatrixXd J = task.T * v.jacobian(task.nodes), Mpp = v.M(p, p), Mpa = v.M(p, a);
    const MatrixXd back = p.empty() ? MatrixXd::Zero(0, Mpa.cols()) : MatrixXd(positive_solve(Mpp, Mpa));
    const MatrixXd Jg = J(Eigen::all, a) - J(Eigen::all, p) * back, Mg = v.M(a, a) - Mpa.transpose() * back;
    const MatrixXd C = Jg * positive_solve(Mg, Jg.transpose());
    const MatrixXd rates = matrix_of(n, [&](const VectorXd& x) { return os.rates(x); });
    const MatrixXd forces = matrix_of(os.rows(), [&](const VectorXd& x) { return os.forces(x); });
    double worst = worse({differ(os.compliance(), C, largest(J * positive_solve(v.M, J.transpose()))), differ(rates(Eigen::all, a), Jg),
                          differ(forces, rates.transpose())}) /
                   v.condition();
    worst = worse({worst, largest(rates(Eigen::all, p)), largest(forces(p, Eigen::all))});
    if (os.rank() < os.rows()) return worst;
    const VectorXd F = some_vector(s.tree.seed + 7, os.rows()), tau_0 = some_vector(s.tree.seed + 8, n);
    const VectorXd tau = os.torque(F, tau_0), xdd = J * positive_solve(v.M, tau);  // no force on p, and the task obeys
    const double size = largest(C) * largest(F) + largest(J * positive_solve(v.M, tau_0));
    return worse({worst, largest(tau(p)), differ(xdd, C * F, size) / (v.condition() * os.condition())});
  });
}

// The control law closes: with the torque that it gives the nodes accelerate as wanted, gravity, velocities and wrenches included.
TEST(OperationalSpace, TheTaskObeys) {
  for (const bool thrusters : {true, false})
    for (const TreeOptions& options : floating_trees())
      for_all_trees(
          options, kIdentity,
          [&](const RandomTree& tree) {
            Scene s(tree);
            const Eigen::Index n = s.model->nv;
            prepare(s.ops);
            TreeOperators base(s.model);
            base.at(s.state.q.data());
            std::vector<std::uint8_t> mask(static_cast<std::size_t>(n), 0);
            const auto& root = s.ops.bodies()[0];
            std::fill_n(mask.begin() + root.v, root.nh, std::uint8_t{1});
            prepare(base, mask);
            const int tip = s.model->find_node(tree.spec.bodies.back().name + ".tip");
            const int rows[] = {0, 4};
            const Task task = Task::of_rows({tip}, rows);
            const OperationalSpace os(s.ops, task, thrusters ? nullptr : &base);
            if (os.rank() < os.rows() || os.condition() > 1e6) return 0.0;
            cardan::Workspace ws(*s.model);
            const std::vector<cardan::NodeWrench> wrenches = s.wrenches();
            VectorXd tau = VectorXd::Zero(n), vdot(n);
            const auto accelerate = [&] {
              const cardan::Inputs in{.q = s.state.q.data(), .v = s.state.v.data(), .tau = tau.data(), .wrenches = wrenches};
              if (!forward_dynamics(*s.model, ws, in, vdot.data())) return VectorXd(VectorXd::Constant(2, NAN));
              Observer observer(*s.model, ws);
              observer.update(in, vdot.data());
              return VectorXd(task.T * observer.node(tip).acceleration);
            };
            const VectorXd before = accelerate();
            const VectorXd drift = task_rates(s.ops, task, vdot) + task_bias(s.ops, task, ws, s.state.v);
            const VectorXd wanted = some_vector(tree.seed, 2), posture = some_vector(tree.seed + 1, n);
            tau = os.torque(os.force_for(wanted, drift), posture);
            for (int j = 0; !thrusters && j < root.nh; ++j)
              if (tau[root.v + j] != 0.0) return HUGE_VAL;
            const VectorXd after = accelerate();
            const double size = worse({largest(before), largest(vdot), largest(os.compliance()) * largest(tau)});
            return worse(differ(drift, before, size), differ(after, wanted, size)) / (scaled_condition(s.twin.M) * os.condition());
          },
          kTrees);
}

// Two links of length 1 in a plane, hinges about z.
std::shared_ptr<const Model> planar_arm() {
  const auto link = [](const std::string& name) {
    BodySpec b = rigid(name, 2.0, {0.5, 0, 0}, diagonal({0.1, 0.2, 0.3}));
    b.nodes.push_back({"tip", {1, 0, 0}, Eigen::Matrix3d::Identity(), {}});
    return b;
  };
  return compiled(system({on(link("upper"), "", "revolute", {{0, 0, 1}}), on(link("lower"), "upper", "revolute", {{0, 0, 1}}, {1, 0, 0})}));
}

TEST(OperationalSpace, TellsTheRankAndNeverDividesByZero) {
  const auto model = planar_arm();
  TreeOperators ops(model);
  const int tip = model->find_node("lower.tip");
  const auto at = [&](double q1, double q2) {
    const double q[] = {q1, q2};
    ops.at(q);
    prepare(ops);
  };
  const int plane[] = {3, 4};
  at(0.3, 1.0);
  EXPECT_EQ(OperationalSpace(ops, {{tip}, {}}).rank(), 2);  // of six rows
  const OperationalSpace bent(ops, Task::of_rows({tip}, plane));
  EXPECT_EQ(bent.rank(), 2);
  EXPECT_NO_THROW(bent.require_full_rank());
  at(0.3, 0.0);  // stretched: it can only move across
  const OperationalSpace stretched(ops, Task::of_rows({tip}, plane));
  EXPECT_EQ(stretched.rank(), 1);
  EXPECT_TRUE(stretched.inertia().allFinite());
  EXPECT_NEAR(stretched.inertia()(0, 0), 0.0, 1e-12);  // tip axes: x along the arm
  try {
    stretched.require_full_rank();
    FAIL();
  } catch (const NumericsError& e) {
    EXPECT_EQ(e.failure().code, Code::singular_task);
    EXPECT_NE(std::string(e.what()).find("rank 1 of 2"), std::string::npos);
  }
  // Felt at the tip, sideways: by hand, M = [2 + 2 + ..., ...].
  Eigen::Matrix2d M;
  const double J = 0.3 + 2.0 * 0.25;
  M << 2 * J + 2.0 * (1.0 + 2 * 0.5), J + 2.0 * 0.5, J + 2.0 * 0.5, J;
  const Eigen::Vector2d across(2.0, 1.0);
  Vector6d u = Vector6d::Zero();
  u[4] = 1.0;
  EXPECT_NEAR(effective_inertia(ops, tip, u) * across.dot(M.inverse() * across), 1.0, 1e-13);
  u << 0, 0, 0, 1, 0, 0;
  EXPECT_TRUE(std::isinf(effective_inertia(ops, tip, u)));
  EXPECT_THROW(participation(ops, tip, u), NumericsError);
  EXPECT_NEAR(manipulability(ops, Task::of_rows({tip}, plane)).kinematic, 0.0, 1e-15);
  at(0.3, 1.0);  // Yoshikawa: l1 l2 |sin q2|
  const Manipulability w = manipulability(ops, Task::of_rows({tip}, plane));
  EXPECT_NEAR(w.kinematic, std::sin(1.0), 1e-14);
  const Eigen::MatrixXd A = mass_matrix(ops);
  EXPECT_NEAR(w.dynamic, std::sin(1.0) / std::sqrt(determinant(A)), 1e-13);
}

// The node that the hinge of a flexible body holds cannot move along: what rounding leaves there is no mobility.
TEST(OperationalSpace, ANodeThatAHingeHoldsHasNoMobilityAlong) {
  BodySpec body;
  body.name = "body", body.type = "modal_flexible";
  body.modal = std::make_shared<const ModalData>(lumped());
  body = on(std::move(body), "", "gimbal", {{1, 0.2, 0}, {0, 1, 0.3}, {0.1, 0, 1}}, {0.3, -0.2, 0.7});
  body.hinge.body_node = "tip";
  body.hinge.q = {0.3, -0.8, 0.5}, body.eta = {0.11, -0.07};
  const auto model = compiled(system({body}));
  TreeOperators ops(model);
  ops.at(model->initial_state().q.data());
  prepare(ops);
  const int tip = model->find_node("body.tip");
  EXPECT_EQ(OperationalSpace(ops, {{tip}, {}}).rank(), 3);
  const int along[] = {3, 4, 5};
  const OperationalSpace held(ops, Task::of_rows({tip}, along));
  EXPECT_EQ(held.rank(), 0);
  EXPECT_EQ(largest(held.inertia()), 0.0);
  for (const int row : along) EXPECT_TRUE(std::isinf(effective_inertia(ops, tip, Vector6d::Unit(row))));
}

// A point mass on its own axis: what rounding leaves of its inertia turns nothing.
TEST(SingularHinge, OfAPointOnItsAxisIsSaid) {
  for (const Eigen::Vector3d& at : {Eigen::Vector3d(0.1, 0.2, 0.2), {0.03, 0.04, 0.12}, {0.01, 0.03, 0.07}, {0, 0, 0.2}}) {
    const auto model = compiled(system({on(rigid("bus", 3.0, {0, 0, 0}, diagonal({1, 2, 2.5})), "", "free"),
                                        on(particle("point", 1.3, at), "bus", "revolute", {at}, {0.3, 0.2, 0.1})}));
    TreeOperators ops(model);
    ops.at(model->initial_state().q.data());
    try {
      ops.articulate();
      ADD_FAILURE() << at.transpose();
    } catch (const NumericsError& e) {
      EXPECT_EQ(e.failure().code, Code::singular_hinge);
    }
  }
}

// A point on a ball or on gimbals turns about the line to it without inertia: the last of three pivots is what rounding leaves of two
// eliminations, and v' was that of noise at one place in twenty.
TEST(SingularHinge, OfAPointOnThreeAxesIsSaid) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> some(-0.2, 0.2);
  for (int i = 0; i < 400; ++i) {
    const Eigen::Vector3d at(some(random), some(random), some(random));
    const BodySpec point = i % 2 == 0
                               ? on(particle("point", 1.3, at), "bus", "ball", {}, {0.3, 0.2, 0.1})
                               : on(particle("point", 1.3, at), "bus", "gimbal", {{1, 0, 0.1}, {0, 1, 0}, {0.2, 0, 1}}, {0.3, 0.2, 0.1});
    const auto model = compiled(system({on(rigid("bus", 3.0, {0, 0, 0}, diagonal({1, 2, 2.5})), "", "free"), point}));
    Workspace ws(*model);
    const State start = model->initial_state();
    VectorXd vdot(model->nv);
    EXPECT_FALSE(forward_dynamics(*model, ws, {.q = start.q.data(), .v = start.v.data()}, vdot.data())) << i << ": " << vdot.transpose();
    TreeOperators ops(model);
    ops.at(start.q.data());
    EXPECT_THROW(ops.articulate(), NumericsError) << i;
  }
}

TEST(OperationalSpace, FeltAtANodeAndParticipation) {
  for_all_views(floating_trees(), kIdentity, [](View& v, Scene& s) {
    prepare(v.ops);
    const int node = v.nodes[s.tree.seed % v.nodes.size()];
    const Vector6d u = some_vector(s.tree.seed, 6);
    const VectorXd shape = v.J(node).transpose() * u, response = positive_solve(v.M, shape);
    if (shape.norm() < 1e-6) return 0.0;
    const double mobility = shape.dot(response);
    const Participation p = participation(v.ops, node, u);
    const VectorXd share = shape.cwiseProduct(response) / mobility;
    // What sums of both signs have lost: J* u against its terms, the shares against 1.
    const double cancelled = share.cwiseAbs().sum() * largest(v.J(node).cwiseAbs().transpose() * u.cwiseAbs()) / largest(shape);
    return worse({differ(p.shape, shape), differ(p.response, response), differ(p.share, share), std::abs(p.share.sum() - 1.0),
                  std::abs(effective_inertia(v.ops, node, u) * mobility - 1.0)}) /
           cancelled / v.condition();
  });
}

TEST(OperationalSpace, Refusals) {
  const auto model = planar_arm();
  TreeOperators ops(model);
  const double q[] = {0.1, 0.2};
  ops.at(q);
  const int tip = model->find_node("lower.tip");
  const auto code = [](const auto& call) {
    try {
      call();
    } catch (const InputError& e) {
      return e.diagnostics()[0].code;
    }
    return Code::yaml_syntax;
  };
  EXPECT_EQ(code([&] { compliance(ops, std::vector{tip}); }), Code::operator_stage);
  prepare(ops);
  EXPECT_EQ(code([&] { compliance(ops, std::vector{99}); }), Code::unknown_node);
  EXPECT_EQ(code([&] { compliance(ops.subgraph({1}), std::vector{tip}); }), Code::operator_stage);
  EXPECT_EQ(code([&] { task_rates(ops, {{tip}, {}}, VectorXd::Zero(3)); }), Code::operator_shape);
  EXPECT_EQ(code([&] { task_forces(ops, {{tip}, {}}, VectorXd::Zero(5)); }), Code::operator_shape);
  EXPECT_EQ(code([&] { task_rates(ops, {{tip}, MatrixXd::Zero(2, 5)}, VectorXd::Zero(2)); }), Code::operator_shape);
  const int rows[] = {6};
  EXPECT_EQ(code([&] { Task::of_rows({tip}, rows); }), Code::out_of_range);
  TreeOperators other(planar_arm());
  other.at(q);
  prepare(other);
  EXPECT_EQ(code([&] { OperationalSpace(ops, {{tip}, {}}, &other); }), Code::operator_shape);
  cardan::Workspace ws(*model);
  EXPECT_EQ(code([&] { task_bias(ops.subgraph({1}), {{tip}, {}}, ws, VectorXd::Zero(1)); }), Code::unknown_node);
  EXPECT_EQ(code([&] { omega_block(ops, 0, 2); }), Code::unknown_body);
}

}  // namespace
}  // namespace cardan::test
