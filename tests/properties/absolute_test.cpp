// All bodies in absolute coordinates: what they are made of against differences and against the tree. That v', multipliers and reactions
// are those of the other forms is in loops_test.cpp.
#include "core/dynamics/absolute.hpp"

#include "core/dynamics/hinge_laws.hpp"
#include "tests/properties/trees.hpp"
#include "tests/support/four_bar.hpp"

namespace cardan::test {
namespace {

/// A tree with a closure of its last body that changes nothing of what is looked at here: the form has to be asked for with loops.
struct Absolute {
  explicit Absolute(const RandomTree& given) : tree(given) {
    tree.spec.loop_form = LoopForm::dae;
    tree.spec.loops.clear();
    LoopSpec loop;
    loop.name = "tie", loop.type = "distance", loop.to.body = tree.spec.bodies.back().name;
    const Loaded still(given);
    Workspace ws(*still.model);
    const Inputs in{.q = still.state.q.data(), .v = still.state.v.data()};
    Observer observer(*still.model, ws);
    VectorXd vdot = VectorXd::Zero(still.model->nv);
    outward(*still.model, soa::sweeps<double>(), ws, in, {});
    observer.update(in, nullptr);
    const Eigen::Vector3d at = observer.node(still.model->find_node(loop.to.body)).position;
    loop.from.position = at - Eigen::Vector3d(0.3, 1.1, -0.7);
    loop.length = (at - loop.from.position).norm();
    tree.spec.loops = {loop};
    for (BodySpec& b : tree.spec.bodies) std::ranges::fill(b.hinge.v, 0.0), std::ranges::fill(b.etadot, 0.0);
    model = compiled(tree.spec);
    system = std::make_unique<AbsoluteSystem>(*model);
    state = model->initial_state();
    Q.resize(system->bodies().closed->nq), U.resize(system->bodies().closed->nv);
    system->enter(state.q.data(), given_rates(given).data(), Q.data(), U.data());
    v = given_rates(given);
    system->place(Q.data(), U.data(), nullptr, {state.q.data(), v.data()});
  }
  VectorXd given_rates(const RandomTree& given) const { return compiled(given.spec)->initial_state().v; }

  RandomTree tree;
  std::shared_ptr<const Model> model;
  std::unique_ptr<AbsoluteSystem> system;
  State state;
  VectorXd Q, U, v;
};

bool taken(const RandomTree& given) { return not_taken_absolutely(*compiled(given.spec)).empty(); }

TEST(Absolute, BodiesThatTheHingesPlaceTellTheirCoordinatesAndRates) {
  for_all_trees({.bodies = 6, .locked = 0.2, .prescribed = 0.1, .free_modes = true}, 1e-12, [](const RandomTree& given) {
    if (!taken(given)) return 0.0;
    const Absolute a(given);
    VectorXd q(a.model->nq), v(a.model->nv), d(a.model->nv);
    a.system->leave(q.data(), v.data(), true);
    a.model->difference(a.state.q.data(), q.data(), d.data());
    double open = 0.0;
    for (int i = 0; i < a.system->rows(); ++i) open = worse(open, std::abs(a.system->residual()[idx(i)]));
    return worse({largest(d), relative(distance(v, a.v), worse(1.0, largest(a.v))), open / worse(1.0, largest(a.Q))});
  });
}

// G and the rates of hinges are the derivatives of c and of their coordinates along U.
TEST(Absolute, RowsAreTheDerivativesOfWhatTheyHold) {
  for_all_trees({.bodies = 5, .locked = 0.2, .prescribed = 0.1, .free_modes = true}, 1e-7, [](const RandomTree& given) {
    if (!taken(given)) return 0.0;
    const Absolute a(given);
    const Model& bodies = *a.system->bodies().bodies;
    VectorXd along(bodies.nv), q(a.model->nq), v(a.model->nv), d(a.model->nv);
    for (int i = 0; i < bodies.nv; ++i) along[i] = std::sin(1.3 * i + given.seed);
    for (const AbsoluteModel::Joint& joint : a.system->bodies().joints) {  // modes are small
      const UserBody& u = bodies.user[idx(joint.user)];
      along.segment(u.etadot, u.n_modes) *= 0.01;
    }
    const int rows = a.system->rows(), rates = a.system->hinge_rates().size();
    VectorXd slope(rows + rates), difference(rows + rates);
    for (int i = 0; i < rows; ++i) slope[i] = a.system->G().times(i, along.data());
    for (int i = 0; i < rates; ++i) slope[rows + i] = a.system->hinge_rates().times(i, along.data());
    constexpr double h = 1e-5;
    difference.setZero();
    const VectorXd still = VectorXd::Zero(bodies.nv);
    for (const double side : {-1.0, 1.0}) {
      const VectorXd step = side * h * along;
      VectorXd Q(bodies.nq);
      bodies.retract(a.Q.data(), step.data(), Q.data());
      a.system->place(Q.data(), still.data(), nullptr, {a.state.q.data(), a.v.data()});
      a.system->leave(q.data(), v.data(), false);
      a.model->difference(a.state.q.data(), q.data(), d.data());
      for (int i = 0; i < rows; ++i)
        difference[i] += side * (a.system->holds_a_place(i) ? a.system->residual()[idx(i)] : 0.5 * side * 2.0 * h * slope[i]) / (2.0 * h);
      int rate = rows;
      for (const AbsoluteModel::Joint& joint : a.system->bodies().joints) {
        const UserBody& u = a.model->user[idx(joint.user)];
        // Components of a hinge with a quaternion or a linear velocity in turning axes are no differences of retract: those of others are.
        for (int i = 0; i < u.nv; ++i, ++rate) difference[rate] += u.nq == u.nv ? side * d[u.v + i] / (2.0 * h) : 0.5 * slope[rate];
      }
    }
    return relative(distance(difference, slope), worse(1.0, largest(slope)));
  });
}

/// Whether anything that is not given moves the ends of the closure.
bool gives_way(const Absolute& a) {
  Workspace ws(*a.model);
  const MatrixXd G = loop_matrix(*a.model, ws, a.state.q.data());
  for (int j = 0; j < a.model->nv; ++j)
    if ((!a.model->has_prescribed() || a.model->prescribed[idx(j)] == 0) && largest(G.col(j)) > 1e-9) return true;
  return false;
}

// What hinges transmit, forces of actuators included, is what observers tell of the tree.
TEST(Absolute, MultipliersOfHingesAreTheirReactions) {
  for (const TreeOptions& options : {TreeOptions{.bodies = 6, .flexible = 0.0, .wheels = 0.2, .prescribed = 0.1, .springs = true},
                                     TreeOptions{.bodies = 5, .prescribed = 0.1, .free_modes = true},
                                     TreeOptions{.bodies = 4, .level = 2, .gravity = GravitySpec::Kind::central}})
    for_all_trees(options, 1e-10, [](const RandomTree& given) {
      Absolute a(given);
      if (!gives_way(a)) return 0.0;
      Loaded at(a.tree);
      hinge_laws::add_forces(*at.model, at.state.q.data(), at.state.v.data(), at.tau.data());
      const VectorXd vdot = at.forward();
      Observer observer(*at.model, at.ws);
      observer.update(at.in(), vdot.data());
      AbsoluteSystem& system = *a.system;
      system.enter(at.state.q.data(), at.state.v.data(), a.Q.data(), a.U.data());
      system.place(a.Q.data(), a.U.data(), nullptr, {at.state.q.data(), at.state.v.data()});
      VectorXd Udot(a.U.size()), lambda(system.rows());
      Workspace ws(*a.model);
      const std::vector<std::uint8_t> kept = independent_rows(*a.model, ws, at.in(), system);
      if (!system.accelerate(at.in(), kept, Udot.data(), lambda.data())) return HUGE_VAL;
      double size = 0.0, apart = 0.0;
      for (const AbsoluteModel::Joint& joint : system.bodies().joints) {
        const UserBody& u = at.model->user[idx(joint.user)];
        const Force<double> f = system.hinge_wrench(joint.user, lambda.data(), at.tau.data()), g = observer.hinge_wrench(joint.user);
        if (u.nv == 6) continue;
        apart = worse({apart, distance(to_eigen(f.n), to_eigen(g.n)), distance(to_eigen(f.f), to_eigen(g.f))});
        size = worse({size, largest(to_eigen(g.n)), largest(to_eigen(g.f))});
      }
      return relative(apart, size);
    });
}

TEST(Absolute, ABodyHasSixCoordinatesOfItsOwnAndWhatIsPartOfAnotherHasNone) {
  SystemSpec spec = four_bar();
  BodySpec weight = on(rigid("weight", 0.3, {0, 0, 0.1}, diagonal({0.001, 0.001, 0.001})), "coupler", "locked", {}, {0.3, 0.1, 0});
  spec.bodies.push_back(weight);
  spec.loop_form = LoopForm::dae;
  const auto model = compiled(spec);
  const AbsoluteModel& a = *model->loops.absolute;
  EXPECT_EQ(a.bodies->nv, 18);
  EXPECT_EQ(a.joints.size(), 3u);
  EXPECT_EQ(a.closed->loops.rows, 3 + 3 * 5);
  EXPECT_TRUE(a.bodies->loops.empty());
  EXPECT_EQ(model->has(OpCode::absolute), true);
  EXPECT_EQ(model->has(OpCode::inward), false);
}

}  // namespace
}  // namespace cardan::test
