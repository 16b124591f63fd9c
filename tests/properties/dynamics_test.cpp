// Laws of the equations of motion on random trees. Round-off: a sum of some hundred terms leaves 1e-14 of its largest;
// what contains the inverse of the mass matrix loses its condition number, 1e2 ... 1e4 for these trees.
#include <Eigen/Core>
#include <algorithm>
#include <random>

#include "bodies/modal/lumped.hpp"
#include "core/linalg/dense.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "core/reference/quad.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {
namespace {

constexpr double kForces = 1e-12, kAccelerations = 1e-10;

std::vector<TreeOptions> every_gravity(TreeOptions options) {
  std::vector<TreeOptions> out;
  for (const auto kind : {GravitySpec::Kind::none, GravitySpec::Kind::uniform, GravitySpec::Kind::central})
    for (const bool gradient : {false, true}) {
      options.gravity = kind;
      options.gradient = gradient;
      if (gradient && kind != GravitySpec::Kind::central) continue;
      out.push_back(options);
    }
  return out;
}

/// As above, in the gradient of a central field only what the sweeps and the twin define alike: the field is expanded about the mass
/// centre of a body, so bodies that were merged are one there; level 0 takes J of its potential to first order.
std::vector<TreeOptions> every_gravity_of_the_twin(const TreeOptions& options) {
  std::vector<TreeOptions> out;
  for (TreeOptions o : every_gravity(options)) {
    if (o.gravity == GravitySpec::Kind::central && o.gradient) {
      o.locked = 0.0;
      std::erase(o.hinges, "locked");
      o.level = 1;
      out.push_back(o);
      o.level = 2;
    }
    out.push_back(o);
  }
  return out;
}

/// Modal bodies with so many modes that they are eliminated through their nodes.
const TreeOptions kManyModes = {.bodies = 5, .flexible = 0.6, .modes = 20, .plain_masses = true};

TEST(Dynamics, ForwardInvertsInverse) {
  for (const TreeOptions& options : every_gravity({}))
    for_all_trees(options, kAccelerations, [](const RandomTree& tree) {
      Loaded s(tree);
      s.tau = s.inverse(s.vdot_given);
      return apart(s.forward(), s.vdot_given);
    });
  for_all_trees(kManyModes, kAccelerations, [](const RandomTree& tree) {
    Loaded s(tree);
    s.tau = s.inverse(s.vdot_given);
    return apart(s.forward(), s.vdot_given);
  });
}

TEST(Dynamics, AtTheSameQTheSameBits) {
  for_all_trees({.flexible = 0.0}, 0.0, [](const RandomTree& tree) {
    Loaded s(tree), fresh(tree);
    s.forward();
    VectorXd tau = s.tau, v = s.state.v;
    s.tau = fresh.tau = 1.5 * tau - VectorXd::Ones(tau.size());
    s.state.v = fresh.state.v = -0.5 * v;
    const VectorXd again = s.forward(), anew = fresh.forward();
    const VectorXd other = s.inverse(again);  // inverse dynamics at another q must not be taken for the same
    VectorXd moved(s.model->nq);
    const VectorXd step = VectorXd::Constant(s.model->nv, 0.1);
    s.model->retract(s.state.q.data(), step.data(), moved.data());
    const VectorXd q = s.state.q;
    s.state.q = moved;
    s.inverse(again);
    s.state.q = q;
    return worse(largest(again - anew), largest(s.forward() - anew)) + 0.0 * other.sum();
  });
}

TEST(Dynamics, InverseInvertsForward) {
  for (const TreeOptions& options : every_gravity({}))
    for_all_trees(options, kForces, [](const RandomTree& tree) {
      Loaded s(tree);
      const VectorXd vdot = s.forward(), got = s.inverse(vdot);
      const MatrixXd M = mass_matrix(*s.model, s.ws, s.state.q.data());
      // The forces that cancel in it: M v' term by term.
      return apart(got, s.tau, largest(M.cwiseAbs() * vdot.cwiseAbs()));
    });
}

TEST(MassMatrix, IsPositiveDefiniteAndItsColumnsAreInverseDynamics) {
  for_all_trees({.gravity = GravitySpec::Kind::none}, kForces, [](const RandomTree& tree) {
    Loaded s(tree);
    const MatrixXd M = mass_matrix(*s.model, s.ws, s.state.q.data());
    if (!cholesky(M)) return HUGE_VAL;
    const VectorXd zero = VectorXd::Zero(s.model->nv);
    double worst = 0.0;
    for (int i = 0; i < s.model->nv; ++i) {
      const VectorXd unit = VectorXd::Unit(s.model->nv, i);
      VectorXd column(s.model->nv);
      inverse_dynamics(*s.model, s.ws, {.q = s.state.q.data(), .v = zero.data(), .vdot = unit.data()}, column.data(),
                       {.velocity = true, .gravity = true, .elastic = false});
      worst = worse(worst, largest(column - M.col(i)));
    }
    return worst / largest(M);
  });
}

TEST(Dynamics, InvariantUnderBodyRelabelling) {
  for_all_trees({}, kAccelerations, [](const RandomTree& tree) {
    RandomTree other = tree;
    std::mt19937 engine(tree.seed);
    for (std::size_t i = other.spec.bodies.size(); i > 1; --i) std::swap(other.spec.bodies[i - 1], other.spec.bodies[engine() % i]);
    std::reverse(other.loads.begin(), other.loads.end());
    Loaded a(tree), b(other);
    const VectorXd va = a.forward(), vb = b.forward();
    return worse(apart(by_body(*a.model, va), by_body(*b.model, vb)), apart(a.node_accelerations(va), b.node_accelerations(vb)));
  });
}

TEST(Dynamics, InvariantUnderWorldRotation) {
  for (const TreeOptions& options : every_gravity({}))
    for_all_trees(options, kAccelerations, [](const RandomTree& tree) {
      const Eigen::Matrix3d R = Eigen::AngleAxisd(1.1, Vector3d(1, -2, 3).normalized()).toRotationMatrix();
      const Vector3d p(3.0, -4.0, 5.0);
      RandomTree other = tree;
      for (BodySpec& b : other.spec.bodies) {
        if (!b.hinge.inboard_body.empty()) continue;
        b.hinge.onode_R = R * b.hinge.onode_R;
        b.hinge.onode_position = R * b.hinge.onode_position + p;
      }
      other.spec.gravity.g = R * tree.spec.gravity.g;
      other.spec.gravity.centre = R * tree.spec.gravity.centre + p;
      for (Load& l : other.loads)
        if (l.world_axes) l.wrench << R * l.wrench.head<3>().eval(), R * l.wrench.tail<3>().eval();
      Loaded a(tree), b(other);
      const VectorXd va = a.forward(), vb = b.forward();
      return worse(apart(va, vb), apart(a.node_accelerations(va), b.node_accelerations(vb)));
    });
}

// A vehicle held at an orbit's radius moves as one held at the origin: no inertia is told about a place as far as that from its hinge.
TEST(Dynamics, InvariantUnderWorldTranslation) {
  for (const auto kind : {GravitySpec::Kind::none, GravitySpec::Kind::uniform}) {
    TreeOptions options;
    options.gravity = kind;
    for_all_trees(options, kAccelerations, [](const RandomTree& tree) {
      RandomTree other = tree;
      for (BodySpec& b : other.spec.bodies)
        if (b.hinge.inboard_body.empty()) b.hinge.onode_position += Vector3d(7e6, -3e6, 2e6);
      Loaded a(tree), b(other);
      const VectorXd va = a.forward(), vb = b.forward();
      return worse(apart(va, vb), apart(a.node_accelerations(va), b.node_accelerations(vb)));
    });
  }
}

/// The floating tree with another body at its root. Hinges on the way from the old root are turned round: O and P
/// change places and the axis its sign, so that their coordinates stay.
RandomTree rooted_at(const RandomTree& tree, const std::string& new_root) {
  RandomTree out = tree;
  const auto body = [&](RandomTree& t, const std::string& name) -> BodySpec& {
    return *std::find_if(t.spec.bodies.begin(), t.spec.bodies.end(), [&](const BodySpec& b) { return b.name == name; });
  };
  std::vector<std::string> path = {new_root};
  while (!tree.spec.find(path.back())->hinge.inboard_body.empty()) path.push_back(tree.spec.find(path.back())->hinge.inboard_body);
  for (std::size_t i = 0; i + 1 < path.size(); ++i) {
    const HingeSpec& old = tree.spec.find(path[i])->hinge;
    HingeSpec turned = old;
    turned.inboard_body = path[i];
    turned.inboard_node = old.body_node;
    turned.body_node = old.inboard_node;
    for (auto& [name, value] : turned.params)
      if (name == "axis")
        for (double& x : std::get<std::vector<double>>(value.value)) x = -x;
    body(out, path[i + 1]).hinge = turned;
    const int nv = old.locked ? 0 : static_cast<int>(old.v.size());
    for (ByBody* loads : {&out.tau, &out.vdot}) {  // the hinge part goes with the hinge, the modal part stays
      const ByBody& from = loads == &out.tau ? tree.tau : tree.vdot;
      const BodySpec& to = *tree.spec.find(path[i + 1]);
      const int m = to.modal ? to.modal->n_modes : 0;
      VectorXd x(nv + m);
      x << from.at(path[i]).head(nv), from.at(to.name).tail(m);
      (*loads)[to.name] = x;
    }
  }
  // The new root floats on its node `tip`.
  Loaded s(tree);
  s.forward();
  Observer observer(*s.model, s.ws);
  observer.update(s.in(), nullptr);
  const NodeState at = observer.node(s.model->find_node(new_root + ".tip"));
  BodySpec& root = body(out, new_root);
  root.hinge = HingeSpec();
  root.hinge.type = "free";
  root.hinge.body_node = "tip";
  const Eigen::Quaterniond q(at.R_WN);
  const Vector3d v = at.R_WN * at.velocity.tail<3>();
  root.hinge.q = {q.w(), q.x(), q.y(), q.z(), at.position.x(), at.position.y(), at.position.z()};
  root.hinge.v = {at.velocity[0], at.velocity[1], at.velocity[2], v.x(), v.y(), v.z()};
  const int m = root.modal ? root.modal->n_modes : 0;
  for (ByBody* loads : {&out.tau, &out.vdot}) {
    VectorXd x = VectorXd::Zero(6 + m);
    x.tail(m) = (loads == &out.tau ? tree.tau : tree.vdot).at(new_root).tail(m);
    (*loads)[new_root] = x;
  }
  return out;
}

TEST(Dynamics, InvariantUnderBaseChange) {
  TreeOptions options{.roots = 1, .floating = true, .locked = 0.1, .hinges = {"revolute", "prismatic", "helical", "cylindrical", "locked"}};
  for_all_trees(options, kAccelerations, [](const RandomTree& tree) {
    RandomTree at_rest = tree;
    at_rest.tau[tree.spec.bodies[0].name].head(6).setZero();  // a floating root has no actuators
    const auto& bodies = tree.spec.bodies;
    Loaded a(at_rest), b(rooted_at(at_rest, bodies[tree.seed % bodies.size()].name));
    return apart(a.node_accelerations(a.forward()), b.node_accelerations(b.forward()));
  });
}

class GalileanInvariance : public testing::TestWithParam<int> {};

// No linear velocity of a body enters the equations (gamma form): what is left is the round-off of v itself, 1e-12 m/s
// in 7500 m/s, which none of them reads.
TEST_P(GalileanInvariance, HoldsAtTenAndAtOrbitalSpeed) {
  TreeOptions options{.roots = 2, .flexible = 0.6, .level = GetParam(), .floating = true};
  for_all_trees(options, 1e-13, [](const RandomTree& tree) {
    Loaded still(tree);
    const VectorXd vdot = still.forward();
    const auto nodes = still.node_accelerations(vdot);
    double worst = 0.0;
    for (const double speed : {10.0, 7500.0}) {
      Loaded moving(tree);
      for (const UserBody& u : moving.model->user)
        if (u.parent < 0) {
          const Eigen::Matrix3d& R = tree.spec.find(u.name)->hinge.onode_R;  // v is in the axes of O
          moving.state.v.segment<3>(u.v + 3) += R.transpose() * (speed * Vector3d(0.6, -0.48, 0.64));
        }
      const VectorXd got = moving.forward();
      worst = worse({worst, apart(got, vdot), apart(moving.node_accelerations(got), nodes)});
      worst = worse(worst, apart(moving.inverse(vdot), still.inverse(vdot)));
    }
    return worst;
  });
}
INSTANTIATE_TEST_SUITE_P(Level, GalileanInvariance, testing::Values(0, 1, 2));

/// A NodeWrench of the twin; the twin takes node axes only.
reference::NodeWrenches<double> for_twin(const RandomTree& tree, const reference::DenseState<double>& state) {
  reference::NodeWrenches<double> out;
  for (const Load& l : tree.loads) {
    Eigen::VectorXd w = l.wrench;
    if (l.world_axes) {
      const Eigen::Matrix3d R = state.node(l.body, l.node).R;
      w << R.transpose() * l.wrench.head<3>(), R.transpose() * l.wrench.tail<3>();
    }
    out.push_back({l.body, l.node, w});
  }
  return out;
}

TEST(DenseTwin, AgreesWithTheSweepsInForces) {
  for (const TreeOptions& options : every_gravity_of_the_twin({.locked = 0.15}))
    for_all_trees(options, kForces, [](const RandomTree& tree) {
      Loaded s(tree);
      const double *q = s.state.q.data(), *v = s.state.v.data();
      const auto twin = reference::DenseTwin<double>(tree.spec).at(s.state.q, s.state.v);
      const double size = twin.bias.size() == 0 ? 1.0 : worse({1.0, largest(twin.bias), largest(twin.gravity_force)});
      double worst = worse({apart(mass_matrix(*s.model, s.ws, q), twin.M), apart(bias_force(*s.model, s.ws, q, v), twin.bias, size),
                            apart(gravity_force(*s.model, s.ws, q), twin.gravity_force, size),
                            apart(elastic_force(*s.model, q, v), twin.elastic_force, size),
                            apart(external_force(*s.model, s.ws, q, s.wrenches), twin.external_force(for_twin(tree, twin)), size)});
      VectorXd qdot(s.model->nq);
      s.model->qdot(q, v, qdot.data());
      return worse(worst, apart(qdot, twin.qdot));
    });
}

/// Fixed to the world each of them carries its own weight, 5 m and 7 m from where the field is centred.
TEST(DenseTwin, AgreesInReactionsOfWhatIsFixedToTheWorld) {
  constexpr double mu = 2000.0;
  BodySpec post = on(rigid("post", 10.0, {0, 0, 1}, diagonal({1, 1, 1})), "", "locked");
  BodySpec arm = on(rigid("arm", 3.0, {0, 0, 0}, diagonal({1, 1, 1})), "post", "locked", {}, {0, 0, 3});
  const SystemSpec spec =
      system({post, arm, on(particle("bus", 5.0, {0, 0, 0}), "", "translational")}, central_gravity(mu, false, {0, 0, -4}));
  const auto model = compiled(spec);
  Simulation sim(model, {});
  sim.vdot();
  const auto twin = reference::DenseTwin<double>(spec).at(sim.state().q, sim.state().v);
  const auto wrenches = twin.hinge_wrenches(sim.vdot());
  const double of_arm = 3.0 * mu / 49.0, of_post = 10.0 * mu / 25.0 + of_arm;
  EXPECT_NEAR(sim.observe().hinge_wrench(0).f.z, of_post, 1e-12 * of_post);
  EXPECT_NEAR(sim.observe().hinge_wrench(1).f.z, of_arm, 1e-12 * of_arm);
  EXPECT_NEAR(wrenches[0][5], of_post, 1e-12 * of_post);
  EXPECT_NEAR(wrenches[1][5], of_arm, 1e-12 * of_arm);
}

TEST(DenseTwin, AgreesWithTheSweepsInMotionAndReactions) {
  std::vector<TreeOptions> all = every_gravity_of_the_twin({.locked = 0.15});
  for (const TreeOptions& options : every_gravity_of_the_twin(kManyModes)) all.push_back(options);
  for (const TreeOptions& options : all)
    for_all_trees(options, kAccelerations, [](const RandomTree& tree) {
      Loaded s(tree);
      const VectorXd vdot = s.forward();
      const auto twin = reference::DenseTwin<double>(tree.spec).at(s.state.q, s.state.v);
      const auto loads = for_twin(tree, twin);
      const VectorXd want = twin.forward(s.tau, loads);
      double worst = apart(vdot, want);
      Observer observer(*s.model, s.ws);
      observer.update(s.in(), vdot.data());
      const auto wrenches = twin.hinge_wrenches(want, loads);
      double size = 0.0;
      for (const auto& w : wrenches) size = worse(size, largest(w));
      for (std::size_t k = 0; k < wrenches.size(); ++k)
        worst = worse(worst, apart(to_eigen(observer.hinge_wrench(static_cast<int>(k))), wrenches[k], size));
      const Energy e = observer.energy();
      const Momentum m = observer.momentum();
      worst = worse(worst, std::abs(e.kinetic - twin.kinetic_energy) / worse(1.0, twin.kinetic_energy));
      worst = worse(worst, std::abs(e.gravity - twin.gravity_energy) / worse(1.0, std::abs(twin.gravity_energy)));
      worst = worse(worst, std::abs(e.modal - twin.elastic_energy) / worse(1.0, twin.elastic_energy));
      worst = worse({worst, apart(m.linear, twin.linear_momentum), apart(m.angular, twin.angular_momentum), apart(m.com, twin.com)});
      for (const Load& l : tree.loads) {
        const auto node = twin.node(l.body, l.node);
        const NodeState got = observer.node(s.model->find_node(l.body + "." + l.node));
        worst = worse({worst, apart(got.position, node.x), apart(got.R_WN, node.R), apart(got.velocity, node.velocity, 1.0),
                       apart(got.acceleration, node.acceleration(want), largest(want))});
      }
      return worst;
    });
}

TEST(Prescribed, ComponentsAgreeWithTheTwin) {
  TreeOptions many_modes = kManyModes;
  many_modes.prescribed = 0.3;
  many_modes.free_modes = true;
  std::vector<TreeOptions> all = every_gravity_of_the_twin({.locked = 0.1, .prescribed = 0.3});
  for (const TreeOptions& options : every_gravity_of_the_twin(many_modes)) all.push_back(options);
  for (const TreeOptions& options : all)
    for_all_trees(options, kAccelerations, [](const RandomTree& tree) {
      Loaded s(tree);
      const VectorXd vdot = s.forward();
      VectorXd tau(s.model->nv);
      Observer observer(*s.model, s.ws);
      observer.update(s.in(), vdot.data());
      observer.prescribed_forces(tau.data());
      std::vector<bool> given(static_cast<std::size_t>(s.model->nv), false);
      for (std::size_t i = 0; i < s.model->prescribed.size(); ++i) given[i] = s.model->prescribed[i] != 0;
      const auto twin = reference::DenseTwin<double>(tree.spec).at(s.state.q, s.state.v);
      const auto want = twin.hybrid(s.tau, given, s.vdot_given, for_twin(tree, twin));
      VectorXd forces = want.tau;
      for (Eigen::Index i = 0; i < forces.size(); ++i)
        if (!given[static_cast<std::size_t>(i)]) forces[i] = 0.0;
      return worse(apart(vdot, want.vdot), apart(tau, forces, largest(want.tau)));
    });
}

TEST(Prescribed, TheirForcesOnAFreeTreeGiveTheSameMotion) {
  for_all_trees({.prescribed = 0.3}, kAccelerations, [](const RandomTree& tree) {
    Loaded s(tree);
    const VectorXd vdot = s.forward();
    VectorXd tau(s.model->nv);
    Observer observer(*s.model, s.ws);
    observer.update(s.in(), vdot.data());
    observer.prescribed_forces(tau.data());
    RandomTree free = tree;
    for (BodySpec& b : free.spec.bodies) b.hinge.prescribed.clear(), b.prescribed_modes.clear();
    Loaded f(free);
    for (std::size_t i = 0; i < s.model->prescribed.size(); ++i)
      if (s.model->prescribed[i]) f.tau[static_cast<Eigen::Index>(i)] = tau[static_cast<Eigen::Index>(i)];
    return apart(f.forward(), vdot);
  });
}

// Uniform gravity: a central field is expanded about the mass centre of what was merged.
TEST(LockedHinges, MergedBodiesMoveAndReactLikeUnmergedOnes) {
  for_all_trees({.flexible = 0.2, .locked = 0.5}, kAccelerations, [](const RandomTree& tree) {
    CompileOptions apart_bodies;
    apart_bodies.merge_locked = false;
    Loaded a(tree), b(tree, apart_bodies);
    const VectorXd va = a.forward(), vb = b.forward();
    double worst = worse(apart(va, vb), apart(a.node_accelerations(va), b.node_accelerations(vb)));
    Observer oa(*a.model, a.ws), ob(*b.model, b.ws);
    oa.update(a.in(), va.data());
    ob.update(b.in(), vb.data());
    double size = 0.0, difference = 0.0;
    for (int k = 0; k < static_cast<int>(tree.spec.bodies.size()); ++k) {
      const Vector6d wa = to_eigen(oa.hinge_wrench(k)), wb = to_eigen(ob.hinge_wrench(k));
      size = worse(size, largest(wb));
      difference = worse(difference, largest(wa - wb));
    }
    worst = worse(worst, relative(difference, size));
    return worse(worst, std::abs(oa.energy().kinetic - ob.energy().kinetic) / worse(1.0, ob.energy().kinetic));
  });
}

// `locked: true` at q is the hinge `locked` with the displacement at q put into O.
TEST(LockedHinges, HeldAnywhereAreLockedHingesThere) {
  for_all_trees(
      {.locked = 0.5, .hinges = {"revolute", "prismatic", "helical", "ball", "translational"}}, kAccelerations, [](const RandomTree& tree) {
        RandomTree other = tree;
        for (BodySpec& b : other.spec.bodies) {
          HingeSpec& h = b.hinge;
          const BodySpec* inboard = other.spec.find(h.inboard_body);
          if (!h.locked || !inboard || inboard->modal || h.inboard_node.empty()) continue;
          const auto node =
              std::find_if(inboard->nodes.begin(), inboard->nodes.end(), [&](const NodeSpec& n) { return n.name == h.inboard_node; });
          Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
          Vector3d p = Vector3d::Zero();
          if (h.type == "ball") R = quaternion(h.q.data()).toRotationMatrix();
          if (h.type == "translational") p = Vector3d(h.q.data());
          if (h.params.count("axis") > 0) {
            const Vector3d u(std::get<std::vector<double>>(h.params["axis"].value).data());
            if (h.type != "prismatic") R = Eigen::AngleAxisd(h.q[0], u).toRotationMatrix();
            if (h.type == "prismatic") p = h.q[0] * u;
            if (h.type == "helical") p = h.q[0] * std::get<double>(h.params["pitch"].value) * u;
          }
          h.onode_position = node->position + node->R_BN * p;
          h.onode_R = node->R_BN * R;
          h.inboard_node.clear();
          h.type = "locked";
          h.locked = false;
          h.params.clear();
          h.q.clear(), h.v.clear();
        }
        Loaded a(tree), b(other);
        const VectorXd va = a.forward(), vb = b.forward();
        return worse(apart(va, vb), apart(a.node_accelerations(va), b.node_accelerations(vb)));
      });
}

/// exp(d / 2), by a series where d is small.
TEST(Ball, TurnsOfAnySizeAreExact) {
  const auto model = compiled(system({on(rigid("body", 1.0, {0, 0, 0}, diagonal({1, 2, 3})), "", "ball")}));
  const Vector3d u(2.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0);
  const double none[4] = {1.0, 0.0, 0.0, 0.0};
  for (const double turn : {1e-9, 0.99e-4, 1.01e-4, 1e-2, 3.0}) {
    double q[4];
    model->retract(none, Vector3d(turn * u).data(), q);
    EXPECT_NEAR(q[0], std::cos(0.5 * turn), 1e-15);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(q[i + 1], std::sin(0.5 * turn) * u[i], 2e-15 * turn) << turn;  // of a dozen roundings
  }
}

using Any = std::function<double(double size)>;
Any any_number() {
  return [random = std::mt19937(7)](double size) mutable { return size * (static_cast<double>(random()) / 2147483648.0 - 1.0); };
}
/// A boom of 1 kg on a hinge to the world, with the deforming nodes tip0, tip1 ...
BodySpec boom_with_tips(const Any& any, int tips, int modes, int level) {
  const auto shapes = [&](double size) { return MatrixXd(MatrixXd::NullaryExpr(3, modes, [&] { return any(size); })); };
  std::vector<MassNode> masses;
  for (int i = 0; i < modes + 6; ++i)
    masses.push_back({1.0 / (modes + 6), Vector3d(any(1.0), any(0.3), any(0.3)), Eigen::Matrix3d::Zero(), shapes(1.0), {}, {}});
  std::vector<ModalNode> nodes;
  for (int i = 0; i < tips; ++i)
    nodes.push_back({"tip" + std::to_string(i), Vector3d(1.0 + i, 0.2, 0.1 * i), Eigen::Matrix3d::Identity(), shapes(0.5), shapes(0.5)});
  BodySpec boom;
  boom.name = "boom";
  boom.type = "modal_flexible";
  boom.level = level;
  boom.modal =
      std::make_shared<const ModalData>(lumped_modal_data(masses, VectorXd::LinSpaced(modes, 10.0, 500.0).asDiagonal(), MatrixXd(), nodes));
  return on(boom, "", "revolute", {Vector3d(0.3, 1.0, -0.2)});
}

/// One mass that three modes take anywhere: nothing is left for the hinge that carries them, and what rounding leaves of it is no inertia.
TEST(Dynamics, AHingeWhoseModesTakeAllMassIsRefused) {
  for (unsigned seed = first_seed(); seed < first_seed() + 40; ++seed) {
    const Any any = [rng = std::mt19937(seed)](double size) mutable { return size * (static_cast<double>(rng()) / 2147483648.0 - 1.0); };
    const auto vector = [&] { return Vector3d(any(1.0), any(1.0), any(1.0)); };
    const Vector3d place = vector(), x = vector(), y = vector(), turn = vector();
    const Eigen::Matrix3d shapes = Eigen::AngleAxisd(turn.norm(), turn.normalized()) * diagonal({0.7, 1.3, -1.0});
    const BodySpec bus = on(rigid("bus", 5.0, Vector3d(0.1, 0.2, -0.1), diagonal({1.0, 2.0, 2.5})), "", "free");
    BodySpec wing;
    wing.name = "wing", wing.type = "modal_flexible";
    wing.modal = std::make_shared<const ModalData>(lumped_modal_data({{1.5, place, Eigen::Matrix3d::Zero(), shapes, {}, {}}},
                                                                     VectorXd::LinSpaced(3, 5.0, 7.0).asDiagonal(), MatrixXd(), {}));
    const std::pair<const char*, std::vector<Vector3d>> hinges[] = {
        {"revolute", {x}}, {"prismatic", {x}}, {"universal", {x, y}}, {"ball", {}}, {"free", {}}};
    for (const auto& [hinge, axes] : hinges)
      for (const HingeFactor factor : {HingeFactor::cholesky, HingeFactor::square_root})
        for (const int level : {0, 1, 2}) {
          if (factor == HingeFactor::square_root && hinge != std::string_view("universal")) continue;
          wing.level = level;
          BodySpec held = on(wing, "bus", hinge, axes);
          held.hinge.factor = factor;
          const auto model = compiled(system({bus, held}, uniform_gravity({0.0, 0.0, -1.0})));
          Workspace ws(*model);
          const State state = model->initial_state();
          VectorXd vdot(model->nv);
          ASSERT_FALSE(forward_dynamics(*model, ws, {.q = state.q.data(), .v = state.v.data()}, vdot.data()))
              << seed << " " << hinge << " level " << level;
          EXPECT_GE(ws.breakdown.component, 0);
          EXPECT_GT(ws.breakdown.limit, 0.0);
        }
  }
}

/// `tips` rigid bodies on deforming nodes of a boom of 1 kg, of any mass; against the twin in 113 bits. Returns the larger of the
/// relative errors of v' and of what the hinges transmit.
double error_with_heavy_tips(const std::string& hinge, const std::vector<Vector3d>& axes, int tips, int modes, int level, double mass) {
  const Any any = any_number();
  std::vector<BodySpec> bodies = {boom_with_tips(any, tips, modes, level)};
  for (int i = 0; i < tips; ++i) {
    BodySpec tip = on(rigid("payload" + std::to_string(i), mass / (1 + i), Vector3d(0.1, -0.2, 0.3), mass * diagonal({0.5, 0.6, 0.7})),
                      "boom", hinge, axes);
    tip.hinge.inboard_node = "tip" + std::to_string(i);
    bodies.push_back(tip);
  }
  const SystemSpec spec = system(bodies, uniform_gravity({1.0, -2.0, 9.0}));
  const auto model = compiled(spec);
  Workspace ws(*model);
  State state = model->initial_state();
  VectorXd move(model->nv), tau(model->nv), vdot(model->nv);
  for (int i = 0; i < model->nv; ++i) move[i] = any(0.2), state.v[i] = any(0.5), tau[i] = any(1.0);
  model->retract(VectorXd(state.q).data(), move.data(), state.q.data());
  const Inputs in{.q = state.q.data(), .v = state.v.data(), .tau = tau.data()};
  if (!forward_dynamics(*model, ws, in, vdot.data())) throw NumericsError(describe_breakdown(*model, ws.breakdown, 0.0));
  using reference::Quad;
  const auto twin = reference::DenseTwin<Quad>(spec).at(state.q.cast<Quad>(), state.v.cast<Quad>());
  const auto want = twin.forward(tau.cast<Quad>());
  const auto wrenches = twin.hinge_wrenches(want);
  Observer observer(*model, ws);
  observer.update(in, vdot.data());
  double worst = apart(vdot, want.cast<double>());
  for (std::size_t k = 0; k < wrenches.size(); ++k)
    worst = worse(worst, apart(to_eigen(observer.hinge_wrench(static_cast<int>(k))), wrenches[k].cast<double>()));
  return worst;
}

// A node that gives in every direction hangs on a heavy payload as on the ground: the motion of the boom and what it transmits
// stay of the size they have with a light one, and so must the rounding.
TEST(Flexible, HeavyPayloadsOnDeformingNodesLoseNoDigits) {
  const Vector3d x = Vector3d::UnitX(), y = Vector3d::UnitY(), z = Vector3d::UnitZ();
  const std::pair<const char*, std::vector<Vector3d>> hinges[] = {
      {"locked", {}},        {"revolute", {z}}, {"revolute", {Vector3d(0.3, -0.5, 0.7)}}, {"prismatic", {x + y}}, {"ball", {}},
      {"universal", {x, y}}, {"free", {}}};
  for (const auto& [hinge, axes] : hinges)
    for (const int tips : {1, 2})
      for (const int level : {0, 1, 2})
        for (const double mass : level == 0 ? std::vector{1e-12, 1.0, 1e6, 1e12} : std::vector{1e12})
          EXPECT_LE(error_with_heavy_tips(hinge, axes, tips, 10 * tips, level, mass), 3e-14)
              << tips << " of " << mass << " kg on " << hinge << ", level " << level;
}

// A point mass does not resist a torque, so that the factor of its inertia does not reach it: the hinge hands it on.
TEST(Flexible, TorqueOnAParticleThatTurnsOnADeformingNodeIsPassedOn) {
  const Vector3d x = Vector3d::UnitX(), y = Vector3d::UnitY(), z = Vector3d::UnitZ();
  for (const auto& [hinge, axes] : {std::pair<const char*, std::vector<Vector3d>>{"revolute", {z}}, {"universal", {y, z}}}) {
    const Any any = any_number();
    BodySpec mass = on(particle("mass", 2.0, 0.7 * x), "boom", hinge, axes);
    mass.hinge.inboard_node = "tip0";
    const auto model = compiled(system({boom_with_tips(any, 1, 10, 0), mass}));
    Workspace ws(*model);
    State state = model->initial_state();
    VectorXd tau(model->nv), vdot(model->nv), back(model->nv);
    for (int i = 0; i < model->nv; ++i) state.v[i] = any(0.5), tau[i] = any(1.0);
    std::vector<NodeWrench> torque = {{.node = model->find_node("mass"), .f = {{any(1.0), any(1.0), any(1.0)}, {0.0, 0.0, 0.0}}}};
    Inputs in{.q = state.q.data(), .v = state.v.data(), .tau = tau.data(), .wrenches = torque};
    ASSERT_TRUE(forward_dynamics(*model, ws, in, vdot.data())) << hinge;
    in.vdot = vdot.data();
    inverse_dynamics(*model, ws, in, back.data());  // which knows no factors
    EXPECT_LE(apart(back, tau), kForces) << hinge;
  }
}

TEST(Flexible, ModesHeldAtZeroAreARigidBody) {
  for_all_trees({.flexible = 0.6}, kAccelerations, [](const RandomTree& tree) {
    RandomTree held = tree, rigid_tree = tree;
    for (std::size_t i = 0; i < tree.spec.bodies.size(); ++i) {
      BodySpec& b = held.spec.bodies[i];
      if (!b.modal) continue;
      const int m = b.modal->n_modes;
      b.eta.assign(static_cast<std::size_t>(m), 0.0);
      b.etadot = b.eta;
      for (int j = 0; j < m; ++j) b.prescribed_modes.push_back(j);
      held.vdot[b.name].tail(m).setZero();
      rigid_tree.spec.bodies[i] = frozen(b);
      for (ByBody* x : {&rigid_tree.tau, &rigid_tree.vdot}) (*x)[b.name].conservativeResize((*x)[b.name].size() - m);
    }
    Loaded a(held), b(rigid_tree);
    return apart(a.node_accelerations(a.forward()), b.node_accelerations(b.forward()));
  });
}

// The rigid body is given by its mass centre and the inertia about it; compile() goes the same way from the integrals.
TEST(Flexible, ZeroModesIsBitwiseRigid) {
  for_all_trees({.flexible = 0.6}, 0.0, [](const RandomTree& tree) {
    RandomTree empty = tree, rigid_tree = tree;
    for (std::size_t i = 0; i < tree.spec.bodies.size(); ++i) {
      BodySpec& b = empty.spec.bodies[i];
      if (!b.modal) continue;
      const int m = b.modal->n_modes;
      rigid_tree.spec.bodies[i] = frozen(b);
      auto none = std::make_shared<ModalData>();
      none->integrals.I1 = b.modal->integrals.I1;
      none->integrals.I2 = b.modal->integrals.I2;
      none->integrals.I7 = b.modal->integrals.I7;
      none->integrals.I3 = none->integrals.I4 = MatrixXd(3, 0);
      for (const ModalNode& n : b.modal->nodes) none->nodes.push_back({n.name, n.position, n.R_BN, {}, {}});
      b.modal = none;
      b.eta.clear(), b.etadot.clear();
      for (RandomTree* t : {&empty, &rigid_tree})
        for (ByBody* x : {&t->tau, &t->vdot}) (*x)[b.name].conservativeResize((*x)[b.name].size() - m);
    }
    Loaded a(empty), b(rigid_tree);
    return (a.forward() - b.forward()).cwiseAbs().sum();
  });
}

TEST(Determinism, SameBitsFromAFreshAndFromAUsedWorkspace) {
  for_all_trees({.locked = 0.1, .prescribed = 0.1, .gravity = GravitySpec::Kind::central}, 0.0, [](const RandomTree& tree) {
    Loaded a(tree), b(tree);
    const VectorXd first = a.forward();
    b.state.q *= 0.9;  // what another state leaves behind must not matter
    b.state.v *= -2.0;
    b.forward();
    mass_matrix(*b.model, b.ws, b.state.q.data());
    b.inverse(b.vdot_given);
    b.state = a.state;
    return (b.forward() - first).cwiseAbs().sum() + (a.forward() - first).cwiseAbs().sum();
  });
}

}  // namespace
}  // namespace cardan::test
