// Analyses of a part of a tree against the same of a system that has these bodies alone: hung on the world where they hang now. Subtrees,
// paths, sets with gaps; carriers whose rotors are left out and rotors without their carrier; inter-body forces against the observer.
#include "core/dynamics/observe.hpp"
#include "core/operators/diagonalised.hpp"
#include "core/operators/hybrid.hpp"
#include "core/operators/inverse_kinematics.hpp"
#include "core/operators/linear_model.hpp"
#include "core/operators/mass_matrix.hpp"
#include "core/operators/sensitivity.hpp"
#include "core/operators/system_modes.hpp"
#include "tests/operators/views.hpp"

namespace cardan::test {
namespace {

using operators::Space;

constexpr double kSamePart = 1e-12;

/// The bodies that take part, on the world where their inboard bodies hold them at this state.
RandomTree on_their_own(const RandomTree& tree, Loaded& at, const TreeOperators& part) {
  const Model& m = *at.model;
  const auto takes_part = [&](const std::string& name) {
    const int k = name.empty() ? 0 : m.user[idx(m.find_body(name))].sweep;
    return k > 0 && part.index_of(k) >= 0;
  };
  at.forward();
  Observer observer(m, at.ws);
  observer.update(at.in(), nullptr);
  RandomTree out = tree;
  std::erase_if(out.spec.bodies, [&](const BodySpec& b) { return !takes_part(b.name); });
  std::erase_if(out.loads, [&](const Load& l) { return !takes_part(l.body); });
  for (BodySpec& b : out.spec.bodies) {
    HingeSpec& h = b.hinge;
    if (h.inboard_body.empty() || takes_part(h.inboard_body)) continue;
    const NodeState O = observer.node(m.find_node(h.inboard_node.empty() ? h.inboard_body : h.inboard_body + "." + h.inboard_node));
    if (!h.inboard_node.empty()) h.onode_position.setZero(), h.onode_R.setIdentity();
    h.onode_position = O.position + O.R_WN * h.onode_position;
    h.onode_R = O.R_WN * h.onode_R;
    h.inboard_body = h.inboard_node = "";
  }
  return out;
}

/// H f.
VectorXd through_hinges(const TreeOperators& tree, const VectorXd& f) {
  VectorXd out(tree.size(Space::hinge));
  tree.apply(operators::Kind::H, false, f.data(), out.data());
  return out;
}

/// A part of a tree, and the system that has its bodies alone.
struct Pair {
  Loaded& whole;
  TreeOperators part;
  RandomTree spec;
  Loaded alone;
  TreeOperators tree;  // of the latter
  Pair(const RandomTree& from, Loaded& at, TreeOperators of)
      : whole(at), part(std::move(of)), spec(on_their_own(from, at, part)), alone(spec), tree(alone.model) {
    tree.at(alone.state.q.data());
    alone.vdot_given = part.from_model(at.vdot_given);
  }
  int n() const { return part.size(Space::hinge); }
  std::vector<std::uint8_t> free() const {
    std::vector<std::uint8_t> out(idx(n()), 1);
    for (std::size_t i = 0; i < alone.model->prescribed.size(); ++i) out[i] = !alone.model->prescribed[i];
    return out;
  }
  /// Of bodies that can move.
  std::vector<std::string> nodes() const {
    std::vector<std::string> out;
    for (const UserNode& node : alone.model->nodes)
      if (node.sweep > 0) out.push_back(node.name);
    return out;
  }
};

using PairProperty = std::function<double(Pair&)>;

/// A subtree, the path from the tip to the base, one between two bodies, one body, and a set with gaps; of trees of every kind.
void for_all_parts(const std::vector<TreeOptions>& kinds, double tolerance, const PairProperty& property, int count = 30) {
  for (const TreeOptions& options : kinds)
    for_all_trees(
        options, tolerance,
        [&](const RandomTree& tree) {
          Loaded at(tree);
          TreeOperators ops(at.model);
          ops.at(at.state.q.data());
          const int n = static_cast<int>(at.model->bodies.size());
          double worst = 0.0;
          if (n < 3) return worst;
          const int some = 1 + static_cast<int>(tree.seed % static_cast<unsigned>(n - 1)),
                    other = 1 + static_cast<int>((tree.seed / 3) % static_cast<unsigned>(n - 1));
          std::vector<int> gaps;
          for (int k = 1; k < n; ++k)
            if ((tree.seed + static_cast<unsigned>(k * k)) % 3 != 0) gaps.push_back(k);
          for (const std::vector<int>& bodies : {ops.subtree(some), ops.path(n - 1, 0), ops.path(some, other), std::vector{other}, gaps}) {
            if (ops.subgraph(bodies).size(Space::hinge) == 0) continue;
            Pair pair(tree, at, ops.subgraph(bodies));
            EXPECT_EQ(pair.alone.model->nv, pair.n());
            const double error = property(pair);
            if (!(error <= worst)) worst = error;
            if (std::isnan(error)) return HUGE_VAL;
          }
          return worst;
        },
        count);
}

/// Rigid with many rotors, mixed with given motions, flexible; under uniform gravity and near a centre.
std::vector<TreeOptions> all_kinds(double prescribed = 0.2) {
  std::vector<TreeOptions> out;
  for (const GravitySpec::Kind gravity : {GravitySpec::Kind::uniform, GravitySpec::Kind::central}) {
    out.push_back({.bodies = 7,
                   .flexible = 0.0,
                   .wheels = 0.6,
                   .springs = true,
                   .hinges = {"revolute", "ball", "free", "universal"},
                   .gravity = gravity});
    out.push_back({.bodies = 7, .flexible = 0.4, .prescribed = prescribed, .springs = true, .gravity = gravity});
    out.push_back({.bodies = 4, .flexible = 1.0, .springs = true, .gravity = gravity});
  }
  return out;
}

TEST(Part, InverseDynamicsAndInterBodyForces) {
  std::size_t rotors_left_out = 0, gaps = 0;
  for_all_parts(all_kinds(), kSamePart, [&](Pair& p) {
    rotors_left_out += p.part.part()->rotors_left_out.size();
    for (const cardan::Run& run : p.part.part()->still)
      for (int k = run.begin; k < run.end; ++k) gaps += p.part.part()->takes_part[idx(k)];
    const VectorXd vdot = some_vector(p.spec.seed, p.n()),
                   all = p.part.to_model(vdot) + VectorXd::Ones(p.whole.model->nv) - p.part.to_model(VectorXd::Ones(p.n()));
    Inputs in = p.whole.in(), alone = p.alone.in();
    in.vdot = all.data();  // not zero where nobody takes part
    alone.vdot = vdot.data();
    Workspace dirty(*p.whole.model);
    VectorXd out(p.whole.model->nv);
    inverse_dynamics(*p.whole.model, dirty, p.whole.in(), out.data());
    const VectorXd tau = p.alone.inverse(vdot), forces = operators::interbody_forces(p.part, dirty, in),
                   other = operators::interbody_forces(p.tree, p.alone.ws, alone);
    const double left_of = 0.1 * largest(forces);  // which cancel in what acts along a hinge
    double worst = apart(operators::inverse_dynamics(p.part, dirty, in), tau, left_of);
    worst = worse(worst, apart(operators::bias(p.part, dirty, in), operators::bias(p.tree, p.alone.ws, alone), left_of));
    worst = worse(worst, apart(through_hinges(p.part, forces), tau, largest(forces)));
    double size = largest(other);
    for (const operators::OperatorBody& b : p.tree.bodies()) {
      const int u = p.whole.model->find_body(p.alone.model->user[idx(b.user)].name);
      const operators::OperatorBody& mine = p.part.bodies()[idx(p.part.index_of(p.whole.model->user[idx(u)].sweep))];
      EXPECT_EQ(mine.user, u);
      worst = worse(worst, apart(forces.segment(mine.at, 6 + mine.m), other.segment(b.at, 6 + b.m), size));
    }
    return worst;
  });
  EXPECT_GT(rotors_left_out, 50u);
  EXPECT_GT(gaps, 20u);
}

// Of the whole tree, after forward dynamics.
TEST(InterBodyForces, AreThoseOfTheObserverAndOfTheBlocks) {
  for (TreeOptions options : all_kinds())
    for_all_trees(options, 1e-11, [&](const RandomTree& tree) {
      Loaded s(tree);
      const Model& m = *s.model;
      TreeOperators ops(s.model);
      ops.at(s.state.q.data());
      const VectorXd tau = s.inverse(s.forward()), vdot = s.forward();
      Observer observer(m, s.ws);
      observer.update(s.in(), vdot.data());
      Workspace ws(m);
      Inputs in = s.in();
      in.vdot = vdot.data();
      const VectorXd f = operators::interbody_forces(ops, ws, in);
      const double size = largest(f);
      double worst = apart(through_hinges(ops, f), tau, size);
      VectorXd own(f.size());  // M alpha + b - f_ext = (1 - E_phi) f
      ops.apply(operators::Kind::E_phi, false, f.data(), own.data());
      own = f - own;
      for (const operators::OperatorBody& b : ops.bodies()) {
        const UserBody& u = m.user[idx(b.user)];
        if (m.bodies[idx(b.sweep)].pnode < 0) {
          const Vector6d at = f.segment<6>(b.at);
          worst = worse(worst, apart(to_eigen(to_outboard(u.pnode, force(at.data()))), to_eigen(observer.hinge_wrench(b.user)), size));
        }
        if (options.flexible > 0.0 || options.gravity != GravitySpec::Kind::uniform) continue;
        const NodeState node = observer.node(m.find_node(u.name));
        const MatrixXd& M = ops.M(ops.index_of(b.sweep));
        Vector6d alpha, y, w;
        alpha << node.acceleration.head<3>(), node.specific_force;
        const Vector3d omega = node.velocity.head<3>(), h{M(2, 4), M(0, 5), M(1, 3)};  // M = [J, h~; -h~, m]
        w << omega.cross(Vector3d(M.topLeftCorner<3, 3>() * omega)), omega.cross(omega.cross(h));
        y = M * alpha + w;
        for (const NodeWrench& load : s.wrenches) {
          if (m.nodes[idx(load.node)].sweep != b.sweep) continue;
          const NodeState at = observer.node(load.node);
          Vector3d moment = to_eigen(load.f.n), push = to_eigen(load.f.f);
          if (!load.world_axes) moment = at.R_WN * moment, push = at.R_WN * push;
          y.head<3>() -= node.R_WN.transpose() * (moment + (at.position - node.position).cross(push));
          y.tail<3>() -= node.R_WN.transpose() * push;
        }
        worst = worse(worst, apart(own.segment<6>(b.at), y, size));
      }
      return worst;
    });
}

TEST(Part, Sensitivities) {
  for_all_parts(all_kinds(), 1e-11, [](Pair& p) {
    operators::Sensitivities mine(p.part), other(p.alone.model);
    mine.solve(p.whole.in()), other.solve(p.alone.in());
    const double condition = scaled_condition(mass_matrix(*p.alone.model, p.alone.ws, p.alone.state.q.data()));
    double worst = worse(apart(mine.vdot(), other.vdot()) / condition, apart(mine.tau(), other.tau(), largest(other.vdot())) / condition);
    mine.at(p.whole.in()), other.at(p.alone.in());
    const operators::InverseDerivatives a = mine.inverse(), b = other.inverse();
    worst = worse({worst, apart(mine.tau(), other.tau()), apart(a.q, b.q), apart(a.v, b.v, 1.0)});
    const operators::ForwardDerivatives c = mine.forward(), d = other.forward();
    worst = worse({worst, apart(c.q, d.q, largest(d.tau) * largest(b.q)) / condition, apart(c.v, d.v, 1.0) / condition,
                   apart(c.tau, d.tau) / condition});
    const VectorXd u = some_vector(p.spec.seed, p.n()), w = some_vector(p.spec.seed + 1, p.n());
    VectorXd x(p.n()), y(p.n());
    mine.mass(u.data(), w.data(), x.data()), other.mass(u.data(), w.data(), y.data());
    worst = worse(worst, apart(x, y, 1.0));
    const operators::Direction along{.q = u.data(), .v = w.data(), .vdot = u.data(), .tau = w.data()};
    mine.forward(along, x.data()), other.forward(along, y.data());
    worst = worse(worst, apart(x, y) / condition);
    for (std::size_t i = 0; i < p.alone.model->user.size(); ++i) {
      const UserBody& body = p.alone.model->user[i];
      if (body.sweep == 0) continue;
      const int here = p.whole.model->find_body(body.name), there = static_cast<int>(i);
      if (body.n_modes > 0)
        worst = worse({worst, apart(mine.inverse_in_stiffness(here), other.inverse_in_stiffness(there)),
                       apart(mine.forward_in_stiffness(here, operators::Sensitivities::Stiffness::full),
                             other.forward_in_stiffness(there, operators::Sensitivities::Stiffness::full)) /
                           condition});
      else
        worst = worse({worst, apart(mine.inverse_in_inertia(here), other.inverse_in_inertia(there)),
                       apart(mine.forward_in_inertia(here), other.forward_in_inertia(there)) / condition});
    }
    return worst;
  });
}

double difference(const operators::LinearModel& a, const operators::LinearModel& b) {
  EXPECT_EQ(a.states.names, b.states.names);
  EXPECT_EQ(a.inputs.names, b.inputs.names);
  EXPECT_EQ(a.inputs.units, b.inputs.units);
  EXPECT_EQ(a.outputs.names, b.outputs.names);
  double worst = worse({apart(a.A, b.A, 1.0), apart(a.B, b.B, 1.0), apart(a.drift, b.drift, 1.0), apart(a.u0, b.u0, 1.0)});
  for (Eigen::Index i = 0; i < b.C.rows(); ++i) {
    const double size = worse({1.0, largest(b.C.row(i)), largest(b.D.row(i)), largest(b.A)});
    worst = worse({worst, largest(a.C.row(i) - b.C.row(i)) / size, largest(a.D.row(i) - b.D.row(i)) / size});
  }
  return worse(worst, apart(a.y0, b.y0, 1.0));
}

TEST(Part, LinearModels) {
  for_all_parts(
      all_kinds(), 1e-11,
      [](Pair& p) {
        operators::LinearPorts ports;
        const std::vector<std::string> nodes = p.nodes();
        for (const std::string& name : p.part.labels(Space::hinge, operators::Sort::motion).names) ports.inputs.push_back(name);
        for (std::size_t i = 0; i < nodes.size(); i += 2) {
          ports.inputs.push_back(nodes[i] + ":force");
          for (const char* what : {":position", ":velocity", ":acceleration", ":attitude", ":rate", ":specific_force"})
            ports.outputs.push_back(nodes[i] + what);
        }
        ports.outputs.push_back(p.part.labels(Space::hinge, operators::Sort::motion).names[0]);
        ports.outputs.insert(ports.outputs.end(), {"momentum:linear", "momentum:angular"});
        const auto at = [](const Loaded& s) {
          return operators::OperatingPoint{
              .q = s.state.q.data(), .v = s.state.v.data(), .tau = s.tau.data(), .vdot = s.vdot_given.data(), .wrenches = s.wrenches};
        };
        const double condition = scaled_condition(mass_matrix(*p.alone.model, p.alone.ws, p.alone.state.q.data()));
        return difference(operators::linearize(p.part, at(p.whole), ports), operators::linearize(*p.alone.model, at(p.alone), ports)) /
               condition;
      },
      15);
}

TEST(Part, DiagonalisedVelocitiesHybridDynamicsJdotAndModes) {
  for_all_parts(all_kinds(), 1e-11, [](Pair& p) {
    const std::vector<std::uint8_t> free = p.free();
    if (std::ranges::count(free, 1) == 0) return 0.0;
    p.part.articulate({.free = free}), p.tree.articulate({.free = free});
    double worst = 0.0;
    for (const auto form : {operators::Diagonalised::Form::normalised, operators::Diagonalised::Form::rates}) {
      operators::Diagonalised mine(p.part, form), other(p.tree, form);
      const VectorXd& v = p.alone.state.v;
      const VectorXd C = other.coriolis(v), rate = other.rate(p.alone.in());
      const double size = worse(largest(C), largest(rate));
      worst = worse({worst, apart(mine.coriolis(v), C, size), apart(mine.rate(p.whole.in()), rate, size)});
    }
    std::vector<operators::Drive> drives;
    for (const std::uint8_t f : free) drives.push_back(f ? operators::Drive::forced : operators::Drive::prescribed);
    Workspace dirty(*p.whole.model);
    VectorXd out(p.whole.model->nv);
    if (!forward_dynamics(*p.whole.model, dirty, p.whole.in(), out.data())) return HUGE_VAL;
    const operators::Hybrid h = hybrid_dynamics(p.part, drives, dirty, p.whole.in(), p.alone.tau, p.alone.vdot_given);
    const operators::Hybrid same = hybrid_dynamics(p.tree, drives, p.alone.ws, p.alone.in(), p.alone.tau, p.alone.vdot_given);
    const double condition = scaled_condition(operators::mass_matrix(p.tree));
    worst = worse({worst, apart(h.vdot, same.vdot) / condition, apart(h.tau, same.tau) / condition});
    operators::Task here, there;
    for (const std::string& name : p.nodes())
      here.nodes.push_back(p.whole.model->find_node(name)), there.nodes.push_back(p.alone.model->find_node(name));
    worst = worse(worst, apart(operators::task_bias(p.part, here, dirty, p.alone.state.v),
                               operators::task_bias(p.tree, there, p.alone.ws, p.alone.state.v), 1.0));
    const operators::SystemModesOptions options{.elastic = 3, .rigid = 2};
    const operators::SystemModes a = operators::system_modes(p.part, options), b = operators::system_modes(p.tree, options);
    EXPECT_EQ(a.n_rigid, b.n_rigid);
    return worse({worst, 1e-3 * apart(a.frequency, b.frequency), 1e-3 * apart(a.damping, b.damping, 1e-3)});
  });
}

TEST(Part, JdotAgreesWithADifferenceAlongTheMotion) {  // d/dt (J v) at constant v, world axes turned with the node
  for_all_trees({.bodies = 5, .flexible = 0.4, .hinges = {"revolute", "universal", "prismatic", "planar"}}, 1e-8,
                [](const RandomTree& tree) {
                  Loaded s(tree);
                  const Model& m = *s.model;
                  TreeOperators ops(s.model);
                  const std::vector<int> bodies = [&] {
                    ops.at(s.state.q.data());
                    return ops.path(static_cast<int>(m.bodies.size()) - 1, 0);
                  }();
                  TreeOperators part = ops.subgraph(bodies);
                  const VectorXd v = part.from_model(s.state.v), all = part.to_model(v);
                  if (v.size() == 0) return 0.0;
                  VectorXd qdot(m.nq);
                  m.qdot(s.state.q.data(), all.data(), qdot.data());
                  const operators::Task task{{part.nodes().back()}, {}};
                  Vector6d rate, work;
                  soa::derivative(
                      [&](double t, double* out) {
                        const VectorXd q = s.state.q + t * qdot;
                        ops.at(q.data());
                        Eigen::Map<Vector6d>(out, 6) = operators::task_rates(ops.subgraph(bodies), task, v);
                      },
                      1e-2, 6, rate.data(), work.data());
                  const Vector6d V = operators::task_rates(part, task, v);
                  rate.tail<3>() += V.head<3>().cross(Vector3d(V.tail<3>()));
                  Workspace ws(m);
                  return apart(operators::task_bias(part, task, ws, v), rate, worse(1.0, largest(V)));
                });
}

// What is not free in a tree counts as given: the same as where the model gives it.
TEST(Part, ComponentsThatAreNotFreeAreGiven) {
  for (const bool whole : {true, false})
    for_all_parts(
        all_kinds(0.0), 1e-11,
        [&](Pair& p) {
          const std::vector<std::uint8_t> free = some_mask(p.spec.seed, p.n());
          RandomTree spec = p.spec;
          for (BodySpec& b : spec.spec.bodies) {
            const UserBody& u = p.alone.model->user[idx(p.alone.model->find_body(b.name))];
            for (int j = 0; j < u.nv; ++j)
              if (!free[idx(u.v + j)]) b.hinge.prescribed.push_back(j);
            for (int j = 0; j < u.n_modes; ++j)
              if (!free[idx(u.etadot + j)]) b.prescribed_modes.push_back(j);
          }
          if (std::ranges::count(free, 1) == 0) return 0.0;
          Loaded given(spec);
          const double condition = scaled_condition(mass_matrix(*p.alone.model, p.alone.ws, p.alone.state.q.data()));
          TreeOperators& tree = whole ? p.tree : p.part;
          tree.articulate({.free = free});
          const VectorXd vdot = whole ? given.vdot_given : p.part.to_model(given.vdot_given);
          Inputs in = whole ? p.alone.in() : p.whole.in();
          in.vdot = vdot.data();
          operators::Sensitivities mine(tree), other(given.model);
          mine.solve(in), other.solve(given.in());
          const operators::ForwardDerivatives c = mine.forward(), d = other.forward();
          double worst = worse({apart(mine.vdot(), other.vdot(), 1.0), apart(c.q, d.q, 1.0), apart(c.v, d.v, 1.0), apart(c.tau, d.tau)});
          const operators::OperatingPoint at{.q = in.q, .v = in.v, .tau = in.tau, .vdot = in.vdot, .wrenches = in.wrenches};
          const operators::OperatingPoint there{.q = given.state.q.data(),
                                                .v = given.state.v.data(),
                                                .tau = given.tau.data(),
                                                .vdot = given.vdot_given.data(),
                                                .wrenches = given.wrenches};
          operators::LinearPorts ports{.inputs = {}, .outputs = {p.nodes()[0] + ":acceleration"}};
          return worse(worst, difference(operators::linearize(tree, at, ports), operators::linearize(*given.model, there, ports))) /
                 condition;
        },
        10);
}

TEST(Part, InverseKinematicsMovesWhatTakesPart) {
  int reached = 0;
  for_all_parts(
      {{.bodies = 6, .flexible = 0.3, .hinges = {"revolute", "universal", "ball", "prismatic"}}}, 1e-9,
      [&](Pair& p) {
        const std::string name = p.nodes().back();
        const Model &m = *p.whole.model, &own = *p.alone.model;
        VectorXd q(own.nq), d(m.nv), e = 0.2 * some_vector(p.spec.seed, p.n());
        for (const UserBody& u : own.user) e.segment(u.etadot, u.n_modes).setZero();
        own.retract(p.alone.state.q.data(), e.data(), q.data());
        const VectorXd none = VectorXd::Zero(p.n());
        const Inputs there{.q = q.data(), .v = none.data(), .vdot = none.data()};
        VectorXd out(p.n());
        if (!forward_dynamics(own, p.alone.ws, there, out.data())) return HUGE_VAL;
        Observer observer(own, p.alone.ws);
        observer.update(there, nullptr);
        const operators::IkTarget target = operators::IkTarget::at_position(m.find_node(name), observer.node(own.find_node(name)).position);
        for (const bool dynamic : {false, true}) {
          const operators::IkOptions options{.dynamic = dynamic, .starts = 1};
          const operators::IkResult mine = operators::inverse_kinematics(p.part, std::span(&target, 1), options);
          m.difference(p.whole.state.q.data(), mine.q.data(), d.data());
          if (!mine.reached || !(largest(d - p.part.to_model(p.part.from_model(d))) <= 1e-15)) return HUGE_VAL;
          operators::IkTarget other = target;
          other.node = own.find_node(name);
          const operators::IkResult same =
              operators::inverse_kinematics(p.alone.model, p.alone.state.q.data(), std::span(&other, 1), options);
          own.difference(p.alone.state.q.data(), same.q.data(), e.data());
          if (!(apart(p.part.from_model(d), e, 1e-3) <= 1e-6)) return HUGE_VAL;
          ++reached;
        }
        return 0.0;
      },
      20);
  EXPECT_GT(reached, 100);
}

Code code(const std::function<void()>& call) {
  try {
    call();
  } catch (const InputError& e) {
    return e.diagnostics()[0].code;
  }
  return Code::yaml_syntax;
}

TEST(Part, NamesOfOthersAreRefused) {
  SystemSpec spec;
  spec.name = "arm";
  spec.gravity.kind = GravitySpec::Kind::uniform;
  spec.gravity.g = {0.0, 0.0, -9.81};
  for (const char* name : {"a", "b", "c"})
    spec.bodies.push_back(on(rigid(name, 1.0, {0.5, 0.0, 0.0}, diagonal({0.1, 0.2, 0.3})),
                             spec.bodies.empty() ? "" : spec.bodies.back().name, "revolute", {Vector3d::UnitY()}, {1.0, 0.0, 0.0}));
  const auto model = compiled(spec);
  const State s = model->initial_state();
  TreeOperators tree(model);
  tree.at(s.q.data());
  const TreeOperators part = tree.subgraph(tree.subtree(2));
  const operators::OperatingPoint at{.q = s.q.data(), .v = s.v.data()};
  for (const char* name : {"a", "a.angle", "a:force"})
    EXPECT_EQ(code([&] { linearize(part, at, {.inputs = {name}, .outputs = {}}); }), Code::unknown_name) << name;
  for (const char* name : {"a", "a.rate", "a:position"})
    EXPECT_EQ(code([&] { linearize(part, at, {.inputs = {}, .outputs = {name}}); }), Code::unknown_name) << name;
  EXPECT_EQ(linearize(part, at, {.inputs = {"b"}, .outputs = {"c:position"}}).A.rows(), 4);
  operators::Sensitivities about(part);
  about.at({.q = s.q.data(), .v = s.v.data()});
  EXPECT_EQ(code([&] { about.inverse_in_inertia(0); }), Code::unknown_body);
  EXPECT_EQ(about.inverse_in_inertia(1).rows(), 2);
  Workspace ws(*model);
  EXPECT_EQ(code([&] { operators::task_bias(part, {{model->find_node("a")}, {}}, ws, VectorXd::Zero(2)); }), Code::unknown_node);
  EXPECT_EQ(code([&] { operators::task_bias(part, {{model->find_node("b")}, {}}, ws, VectorXd::Zero(3)); }), Code::operator_shape);
  const auto target = [&](const char* name) {
    return std::vector{operators::IkTarget::at_position(model->find_node(name), {1.0, 0.0, 0.0})};
  };
  EXPECT_EQ(code([&] { operators::inverse_kinematics(part, target("a")); }), Code::unknown_node);
  EXPECT_EQ(code([&] { operators::inverse_kinematics(part, target("b"), {.limits = {{0, -1.0, 1.0}}}); }), Code::unsupported);
  EXPECT_EQ(code([&] { operators::inverse_kinematics(part, target("b"), {.free = {0}}); }), Code::unsupported);
  // an arm of one link at rest: J_yy = 0.2 + 0.25, tau = -m g x
  const TreeOperators one = tree.subgraph({2});
  VectorXd still = VectorXd::Zero(3);
  EXPECT_NEAR(operators::bias(one, ws, {.v = still.data()})[0], -9.81 * 0.5, 1e-14);
  EXPECT_NEAR(operators::interbody_forces(one, ws, {})[5], 9.81, 1e-14);
}

}  // namespace
}  // namespace cardan::test
