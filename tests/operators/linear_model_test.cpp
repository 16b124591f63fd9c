// Linear models: against differences of eighth order of the true right-hand side and of the observer on random trees, and against
// closed forms: a spinning body, a pendulum, a beam on a hinge, a circular orbit.
#include "core/operators/linear_model.hpp"

#include <Eigen/Dense>
#include <numbers>

#include "core/operators/system_modes.hpp"
#include "core/soa/tangent.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {
namespace {

using operators::linearize;
using operators::LinearModel;

LinearModel at_initial_state(const Model& model, const operators::LinearPorts& ports = {}) {
  const State s = model.initial_state();
  return linearize(model, {.q = s.q.data(), .v = s.v.data()}, ports);
}

/// v' and outputs in double, as functions of the deviation and of the inputs.
class Truth {
 public:
  Truth(Loaded& at, int node, int pushed) : at_(at), node_(node), pushed_(pushed), ws_(*at.model), observer_(*at.model, ws_) {}

  /// z = [dtheta; dv; forces or given accelerations (nv); force, torque on a node (6)] -> [v'; outputs (24)].
  VectorXd operator()(const VectorXd& z) {
    const Model& m = *at_.model;
    VectorXd q(m.nq), d = z.head(m.nv), v = at_.state.v + z.segment(m.nv, m.nv), tau = at_.tau, vdot = at_.vdot_given, out(m.nv + 24);
    m.retract(at_.state.q.data(), d.data(), q.data());
    for (int i = 0; i < m.nv; ++i) {
      const bool given = m.has_prescribed() && m.prescribed[idx(i)];
      (given ? vdot : tau)[i] += z[2 * m.nv + i];
      if (given) tau[i] = 0.0;
    }
    for (const HingeLoad& s : m.loads) tau[s.v] -= s.p[0] * (q[s.q] - s.p[1]) + s.p[2] * v[s.v];  // springs
    std::vector<NodeWrench> wrenches = at_.wrenches;
    NodeWrench w;
    w.node = pushed_;
    const VectorXd f = z.tail(6);
    w.f = {{f[3], f[4], f[5]}, {f[0], f[1], f[2]}};
    wrenches.push_back(w);
    const Inputs in{.q = q.data(), .v = v.data(), .tau = tau.data(), .vdot = vdot.data(), .wrenches = wrenches};
    VectorXd acceleration(m.nv);
    if (!forward_dynamics(m, ws_, in, acceleration.data())) throw std::runtime_error("breakdown");
    observer_.update(in, acceleration.data());
    const NodeState n = observer_.node(node_);
    const Momentum p = observer_.momentum();
    if (R_.size() == 0) R_ = n.R_WN;
    const Eigen::AngleAxisd turn(Eigen::Matrix3d(R_.transpose() * n.R_WN));
    out << acceleration, n.position, n.R_WN * n.velocity.tail<3>(), n.R_WN * n.acceleration.tail<3>(), turn.angle() * turn.axis(),
        n.velocity.head<3>(), n.specific_force, p.linear, p.angular;
    return out;
  }

 private:
  Loaded& at_;
  int node_, pushed_;
  Workspace ws_;
  Observer observer_;
  MatrixXd R_;
};

double check_against_differences(const RandomTree& tree) {
  Loaded at(tree);
  const Model& m = *at.model;
  if (m.nv == 0) return 0.0;
  const int nv = m.nv, node = static_cast<int>(m.nodes.size()) - 1, pushed = static_cast<int>(m.nodes.size()) / 2;
  const std::string &seen = m.nodes[idx(node)].name, &on = m.nodes[idx(pushed)].name;
  operators::LinearPorts ports;
  const LinearModel names = linearize(m, {.q = at.state.q.data(), .v = at.state.v.data()});
  for (int i = 0; i < nv; ++i) ports.inputs.push_back(names.states.names[idx(nv + i)]);
  ports.inputs.insert(ports.inputs.end(), {on + ":force", on + ":torque"});
  for (const char* what : {":position", ":velocity", ":acceleration", ":attitude", ":rate", ":specific_force"})
    ports.outputs.push_back(seen + what);
  ports.outputs.insert(ports.outputs.end(), {"momentum:linear", "momentum:angular"});
  const LinearModel model = linearize(
      m, {.q = at.state.q.data(), .v = at.state.v.data(), .tau = at.tau.data(), .vdot = at.vdot_given.data(), .wrenches = at.wrenches},
      ports);
  EXPECT_EQ(model.B.cols(), nv + 6);
  EXPECT_EQ(model.C.rows(), 24);

  Truth truth(at, node, pushed);
  const VectorXd y0 = truth(VectorXd::Zero(3 * nv + 6));
  const int n = nv + 24;
  MatrixXd mine(n, 3 * nv + 6);
  mine << model.A.bottomRows(nv), model.B.bottomRows(nv), model.C, model.D;
  double worst = apart(model.drift.tail(nv), y0.head(nv));
  VectorXd y = y0.tail(24);
  y.segment<3>(9).setZero();
  worst = worse(worst, apart(model.y0, y));
  const auto of_rows = [&](double step) {
    MatrixXd J(n, 3 * nv + 6);
    VectorXd work(n);
    for (Eigen::Index j = 0; j < J.cols(); ++j) {
      const auto along = [&](double s, double* out) { Eigen::Map<VectorXd>(out, n) = truth(s * VectorXd::Unit(3 * nv + 6, j)); };
      soa::derivative(along, step, n, J.col(j).data(), work.data());
    }
    double error = 0.0;
    for (int i = 0; i < n; ++i) error = worse(error, largest(mine.row(i) - J.row(i)) / worse(largest(J.row(i)), 1e-3));
    return error;
  };
  return worse(worst, by_differences(0.02, of_rows));
}

TEST(LinearModel, AgreesWithDifferencesOfTheTrueRightHandSide) {
  for (const GravitySpec::Kind gravity : {GravitySpec::Kind::uniform, GravitySpec::Kind::central, GravitySpec::Kind::none})
    for (const double flexible : {0.0, 0.5})
      for (const double prescribed : {0.0, 0.2})
        for_all_trees({.bodies = 5, .flexible = flexible, .prescribed = prescribed, .springs = true, .gravity = gravity}, 1e-8,
                      check_against_differences, 12);
}

TEST(LinearModel, SeenFromWheels) {  // bodies that the sweeps fold into their carrier
  for_all_trees({.bodies = 4, .flexible = 0.0, .wheels = 0.9, .hinges = {"revolute", "ball"}}, 1e-8, check_against_differences, 40);
}

TEST(LinearModel, KinematicPart) {  // d^2/de dt of the deviation between two neighbours that both move with v
  for_all_trees(
      {.bodies = 4, .hinges = {"ball", "free", "free_body", "gimbal", "planar"}}, 1e-8,
      [](const RandomTree& tree) {
        Loaded at(tree);
        const Model& m = *at.model;
        const MatrixXd mine = linearize(m, {.q = at.state.q.data(), .v = at.state.v.data()}).A.topLeftCorner(m.nv, m.nv);
        MatrixXd J(m.nv, m.nv);
        const auto moved = [&](const VectorXd& q, const VectorXd& d) {
          VectorXd out(m.nq);
          m.retract(q.data(), d.data(), out.data());
          return out;
        };
        const auto apart_after = [&](double t, double e, int j) -> VectorXd {
          VectorXd d(m.nv);
          const VectorXd a = moved(at.state.q, t * at.state.v), b = moved(moved(at.state.q, e * VectorXd::Unit(m.nv, j)), t * at.state.v);
          m.difference(a.data(), b.data(), d.data());
          return d;
        };
        for (int j = 0; j < m.nv; ++j) {
          const auto mixed = [&](double h) -> VectorXd {
            return (apart_after(h, h, j) - apart_after(-h, h, j) - apart_after(h, -h, j) + apart_after(-h, -h, j)) / (4.0 * h * h);
          };
          const double h = 0.02;  // Richardson: sixth order
          const VectorXd a = mixed(h), b = mixed(h / 2), c = mixed(h / 4), ab = (4.0 * b - a) / 3.0, bc = (4.0 * c - b) / 3.0;
          J.col(j) = (16.0 * bc - ab) / 15.0;
        }
        return m.nv == 0 ? 0.0 : largest(mine - J) / worse(1.0, largest(J));
      },
      20);
}

/// Imaginary parts of the poles with a positive one, ascending.
std::vector<double> frequencies(const MatrixXd& A) {
  std::vector<double> out;
  for (const operators::Pole& p : operators::poles(A))
    if (p.value.imag() > 1e-9) out.push_back(p.value.imag());
  std::sort(out.begin(), out.end());
  return out;
}

TEST(LinearModel, SpinningBodyOnAQuaternion) {
  // axisymmetric, spin W: body-fixed nutation (J3 - J1)/J1 W, and the attitude in body axes turns with W
  BodySpec body = on(rigid("top", 5.0, Vector3d::Zero(), diagonal({2.0, 2.0, 3.0})), "", "ball");
  body.hinge.v = {0.0, 0.0, 0.7};
  const auto model = compiled(system({body}));
  const std::vector<double> w = frequencies(at_initial_state(*model).A);
  ASSERT_EQ(w.size(), 2u);
  EXPECT_NEAR(w[0], 0.35, 1e-12);
  EXPECT_NEAR(w[1], 0.7, 1e-12);
}

TEST(LinearModel, Pendulum) {
  BodySpec bob = on(rigid("bob", 2.0, {1.5, 0.0, 0.0}, diagonal({0.1, 0.3, 0.3})), "", "revolute", {Vector3d::UnitZ()});
  bob.hinge.springs.push_back({});
  bob.hinge.springs.back().damping = 0.4;
  const auto model = compiled(system({bob}, uniform_gravity({9.81, 0.0, 0.0})));
  const LinearModel l = at_initial_state(*model, {{"bob.angle"}, {"bob.angle", "bob:velocity.y"}});
  const double J = 0.3 + 2.0 * 1.5 * 1.5;
  const MatrixXd A = (MatrixXd(2, 2) << 0.0, 1.0, -2.0 * 9.81 * 1.5 / J, -0.4 / J).finished();
  EXPECT_LT(largest(l.A - A), 1e-14);
  EXPECT_NEAR(l.B(1, 0), 1.0 / J, 1e-15);
  EXPECT_EQ(l.C(0, 0), 1.0);
  EXPECT_EQ(l.outputs.names[1], "bob:velocity.y");
  EXPECT_EQ(l.inputs.units[0], "N m");
  EXPECT_EQ(l.states.names, (std::vector<std::string>{"bob.angle", "bob.rate"}));
  EXPECT_EQ(l.drift.norm(), 0.0);
}

TEST(LinearModel, FlexibleArmHasTheModesOfTheSystem) {  // at rest, free of stress: the poles are i omega of system_modes
  TreeOptions options{.bodies = 5,
                      .roots = 1,
                      .flexible = 1.0,
                      .level = 1,
                      .damping = false,
                      .springs = true,
                      .hinges = {"revolute", "universal"},
                      .gravity = GravitySpec::Kind::none};
  for_all_trees(
      options, 1e-9,
      [](const RandomTree& tree) {
        SystemSpec spec = tree.spec;
        for (BodySpec& b : spec.bodies) {
          b.eta.clear(), b.etadot.clear(), b.hinge.v.clear();
          for (SpringDamper& s : b.hinge.springs) s.damping = 0.0, s.rest = b.hinge.q.empty() ? 0.0 : b.hinge.q[idx(s.component)];
        }
        const auto model = compiled(spec);
        const LinearModel l = at_initial_state(*model);
        const std::vector<double> w = frequencies(l.A);
        operators::TreeOperators ops(model);
        ops.at(model->initial_state().q.data());
        const operators::SystemModes modes = system_modes(ops, {.elastic = model->nv, .rigid = 0});
        double worst = largest(l.drift);
        const std::size_t elastic = idx(static_cast<int>(modes.frequency.size()));
        if (w.size() < elastic) return HUGE_VAL;
        for (std::size_t j = 0; j < elastic; ++j)
          worst = worse(
              worst, std::abs(w[w.size() - elastic + j] / (2.0 * std::numbers::pi * modes.frequency[static_cast<Eigen::Index>(j)]) - 1.0));
        return worst;
      },
      15);
}

TEST(LinearModel, CircularOrbit) {  // a particle in a central field: poles 0 and +-i n (Clohessy & Wiltshire), in-plane n twice
  const double n = 0.05, r = 30.0;
  BodySpec body = on(rigid("sat", 1.0, Vector3d::Zero(), diagonal({1, 1, 1})), "", "translational");
  body.hinge.q = {r, 0.0, 0.0}, body.hinge.v = {0.0, n * r, 0.0};
  const auto model = compiled(system({body}, central_gravity(n * n * r * r * r, false)));
  const LinearModel l = at_initial_state(*model);
  const MatrixXd tidal = (MatrixXd(3, 3) << 2.0 * n * n, 0, 0, 0, -n * n, 0, 0, 0, -n * n).finished();
  EXPECT_LT(largest(l.A.bottomLeftCorner(3, 3) - tidal), 1e-17);
  EXPECT_EQ(l.A.bottomRightCorner(3, 3).norm(), 0.0);
  // In free fall an accelerometer reads nothing, wherever the orbit goes.
  const LinearModel free_fall = at_initial_state(*model, {{}, {"sat:specific_force"}});
  EXPECT_LT(largest(free_fall.y0), 1e-17);
  EXPECT_LT(largest(free_fall.C), 1e-17);
}

TEST(LinearModel, RefusesUnknownNames) {
  const auto model = compiled(system({on(rigid("wing", 2.0, {1, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {Vector3d::UnitZ()})}));
  const auto message = [&](operators::LinearPorts ports) -> std::string {
    try {
      at_initial_state(*model, ports);
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_NE(message({{"wing.angel"}, {}}).find("did you mean \"wing.angle\""), std::string::npos);
  EXPECT_NE(message({{}, {"tip:position"}}).find("C0208"), std::string::npos);
  EXPECT_NE(message({{}, {"wing:speed"}}).find("specific_force"), std::string::npos);
}

}  // namespace
}  // namespace cardan::test
