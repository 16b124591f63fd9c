// Hinges and loops that become others while a vehicle moves (core/sim/rejoin.hpp; docs/mathematics/topology.md).
#include "core/sim/rejoin.hpp"

#include <gtest/gtest.h>

#include "core/base/diagnostic.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {
namespace {

/// Every body as it moves, whatever joins it to others.
class Bodies {
 public:
  explicit Bodies(const Model& model) : model_(model), ws_(model), observer_(model, ws_) {}

  /// Of each body [w body axes; v world axes; rates of its modes].
  VectorXd velocities(const VectorXd& q, const VectorXd& v) {
    look(q, v);
    std::vector<double> all;
    for (const UserBody& u : model_.user) {
      const NodeState s = observer_.node(model_.find_node(u.name));
      const Vector3d w = s.velocity.head<3>(), along = s.R_WN * s.velocity.tail<3>();
      all.insert(all.end(), w.data(), w.data() + 3), all.insert(all.end(), along.data(), along.data() + 3);
      all.insert(all.end(), v.data() + u.etadot, v.data() + u.etadot + u.n_modes);
    }
    return VectorXd::Map(all.data(), static_cast<Eigen::Index>(all.size()));
  }
  /// [quaternion; position; modes] of each body.
  VectorXd places(const VectorXd& q) {
    look(q, VectorXd::Zero(model_.nv));
    std::vector<double> all;
    for (std::size_t i = 0; i < model_.user.size(); ++i) {
      const UserBody& u = model_.user[i];
      const Pose<double> X = observer_.body_pose(static_cast<int>(i));
      Eigen::Quaterniond turn(to_eigen(X.R));
      if (turn.w() < 0.0) turn.coeffs() = -turn.coeffs();
      for (const double x : {turn.w(), turn.x(), turn.y(), turn.z(), X.p.x, X.p.y, X.p.z}) all.push_back(x);
      all.insert(all.end(), q.data() + u.eta, q.data() + u.eta + u.n_modes);
    }
    return VectorXd::Map(all.data(), static_cast<Eigen::Index>(all.size()));
  }
  Momentum momentum(const VectorXd& q, const VectorXd& v) { return look(q, v), observer_.momentum(); }

 private:
  void look(const VectorXd& q, const VectorXd& v) {
    q_ = q, v_ = v;
    VectorXd vdot(model_.nv);
    forward_dynamics(model_, ws_, Inputs{.q = q_.data(), .v = v_.data(), .tau = zero(), .vdot = zero(), .gravity = false}, vdot.data());
    observer_.update(Inputs{.q = q_.data(), .v = v_.data(), .tau = zero(), .vdot = zero(), .gravity = false}, nullptr);
  }
  const double* zero() {
    zero_.setZero(model_.nv);
    return zero_.data();
  }
  const Model& model_;
  Workspace ws_;
  Observer observer_;
  VectorXd q_, v_, zero_;
};

/// The same bodies, each by itself on the world: its mass matrix is that of the bodies.
SystemSpec all_let_go(const SystemSpec& spec, const VectorXd& places) {
  SystemSpec out = spec;
  out.gravity = {}, out.devices.clear(), out.loops.clear();
  Eigen::Index at = 0;
  for (BodySpec& b : out.bodies) {
    b.hinge = HingeSpec{};
    b.hinge.type = "free";
    b.hinge.q.assign(places.data() + at, places.data() + at + 7);
    const int modes = b.modal ? b.modal->n_modes : 0;
    b.eta.assign(places.data() + at + 7, places.data() + at + 7 + modes);
    b.etadot.clear();
    at += 7 + modes;
  }
  return out;
}

struct Errors {
  double places = 0.0, nearest = 0.0, momentum = 0.0, kept = 0.0;
  double largest() const {
    return std::max({places, nearest, momentum, kept}, [](double a, double b) { return !(a >= b); });
  }
};

/// What holds of every event: no body jumps; the velocities are the nearest allowed ones in the metric of M, by T* M (V+ - V-) = 0 with T
/// column by column from observers; momentum is kept. `free_motion`: nothing was joined, so no velocity changes.
Errors errors_of(Simulation& sim, const Rejoined& next, bool free_motion) {
  Bodies were(sim.model()), are(*next.model);
  const State &a = sim.state(), &b = next.state;
  const VectorXd before = were.places(a.q), after = are.places(b.q);
  Errors e;
  e.places = largest(after - before) / (1.0 + largest(before));
  const auto bodies = compiled(all_let_go(*next.model->spec, after));
  Workspace ws(*bodies);
  const MatrixXd M = mass_matrix(*bodies, ws, bodies->initial_state().q.data());
  const VectorXd V0 = were.velocities(a.q, a.v), V1 = are.velocities(b.q, b.v);
  MatrixXd T(V0.size(), next.model->nv);
  for (int i = 0; i < next.model->nv; ++i) T.col(i) = are.velocities(b.q, VectorXd::Unit(next.model->nv, i));
  VectorXd left = T.transpose() * (M * (V1 - V0));
  const VectorXd size = T.transpose().cwiseAbs() * (M.cwiseAbs() * (V0.cwiseAbs() + V1.cwiseAbs()));
  for (int i = 0; i < left.size(); ++i)
    if (next.model->has_prescribed() && next.model->prescribed[idx(i)]) left[i] = 0.0;
  e.nearest = relative(largest(left), largest(size));
  const Momentum p = were.momentum(a.q, a.v), r = are.momentum(b.q, b.v);
  const bool floats = std::ranges::all_of(next.model->spec->bodies, [](const BodySpec& x) {
    return !x.hinge.inboard_body.empty() || (x.hinge.type == "free" && !x.hinge.locked);
  });
  if (floats)
    e.momentum = std::max((p.linear - r.linear).norm() / p.linear_magnitude, (p.angular - r.angular).norm() / p.angular_magnitude);
  if (free_motion) e.kept = relative(largest(V1 - V0), largest(V0));
  return e;
}

bool hangs_on(const SystemSpec& spec, const std::string& body, const std::string& other) {
  for (const BodySpec* b = spec.find(body); b; b = spec.find(b->hinge.inboard_body))
    if (b->name == other) return true;
  return false;
}

constexpr double kRound = 1e-12;  // of sweeps over a few bodies, masses up to a few powers of ten apart, and their inverse

TreeOptions floating(double flexible) {
  return {.bodies = 7, .roots = 2, .flexible = flexible, .floating = true, .gravity = GravitySpec::Kind::none};
}

class Events : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(, Events, testing::Values(0.0, 0.5));

TEST_P(Events, ABodyThatIsLetGoFliesOnAsItMoves) {
  for_all_trees(floating(GetParam()), kRound, [](const RandomTree& tree) {
    double worst = 0.0;
    for (const BodySpec& b : tree.spec.bodies) {
      if (b.hinge.inboard_body.empty()) continue;
      Simulation sim(compiled(tree.spec), {});
      SystemSpec next = tree.spec;
      HingeSpec& hinge = next.bodies[idx(sim.model().find_body(b.name))].hinge;
      HingeSpec free;
      free.type = "free", free.body_node = hinge.body_node, free.pnode_position = hinge.pnode_position, free.pnode_R = hinge.pnode_R;
      hinge = free;
      worst = worse(worst, errors_of(sim, rejoin(sim, next, registry(), {}), true).largest());
    }
    return worst;
  });
}

TEST_P(Events, ABodyIsHeldWhereItIsByAnyOther) {
  for_all_trees(
      floating(GetParam()), kRound,
      [](const RandomTree& tree) {
        double worst = 0.0;
        for (const BodySpec& b : tree.spec.bodies)
          for (const BodySpec& to : tree.spec.bodies) {
            if (hangs_on(tree.spec, to.name, b.name)) continue;
            Simulation sim(compiled(tree.spec), {});
            SystemSpec next = tree.spec;
            HingeSpec& hinge = next.bodies[idx(sim.model().find_body(b.name))].hinge;
            HingeSpec held;
            held.type = "free", held.locked = true, held.inboard_body = to.name;
            if (to.modal) held.inboard_node = to.modal->nodes.back().name;
            if (b.modal)
              held.body_node = hinge.body_node, held.pnode_position = hinge.pnode_position, held.pnode_R = hinge.pnode_R;
            else  // a place without a name
              held.pnode_position = {0.3, -0.2, 0.5}, held.pnode_R = Eigen::AngleAxisd(0.7, Vector3d(0.6, 0, 0.8)).toRotationMatrix();
            hinge = held;
            worst = worse(worst, errors_of(sim, rejoin(sim, next, registry(), {}), false).largest());
          }
        return worst;
      },
      30);
}

TEST_P(Events, HingesAreLockedAndUnlocked) {
  TreeOptions options = floating(GetParam());
  options.locked = 0.3;
  for_all_trees(options, kRound, [](const RandomTree& tree) {
    double worst = 0.0;
    for (const BodySpec& b : tree.spec.bodies) {
      Simulation sim(compiled(tree.spec), {});
      const UserBody& u = sim.model().user[idx(sim.model().find_body(b.name))];
      if (u.hinge->nv == 0) continue;
      SystemSpec next = tree.spec;
      HingeSpec& hinge = next.bodies[idx(sim.model().find_body(b.name))].hinge;
      hinge.locked = !hinge.locked;
      hinge.springs.clear(), hinge.loads.clear();
      const bool unlocks = !hinge.locked;
      worst = worse(worst, errors_of(sim, rejoin(sim, next, registry(), {}), unlocks).largest());
    }
    return worst;
  });
}

/// Given rates go on as they are told, and the others are the nearest beside them.
TEST_P(Events, HingesAreLockedBesideGivenMotions) {
  TreeOptions options = floating(GetParam());
  options.prescribed = 0.3;
  for_all_trees(options, kRound, [](const RandomTree& tree) {
    double worst = 0.0;
    SystemSpec spec = tree.spec;
    for (BodySpec& b : spec.bodies)
      if (b.hinge.inboard_body.empty()) b.hinge.prescribed.clear();  // it would take momentum
    const auto model = compiled(spec);
    for (const BodySpec& b : spec.bodies) {
      const int body = model->find_body(b.name);
      if (b.hinge.inboard_body.empty() || !b.hinge.prescribed.empty() || model->user[idx(body)].nv == 0) continue;
      Simulation sim(model, {});
      SystemSpec next = spec;
      HingeSpec& hinge = next.bodies[idx(body)].hinge;
      hinge.locked = true;
      hinge.springs.clear(), hinge.loads.clear();
      worst = worse(worst, errors_of(sim, rejoin(sim, next, registry(), {}), false).largest());
    }
    return worst;
  });
}

/// A full tank on a body is a part of it.
TEST(Rejoin, MassesOfDevicesTakePartAsThoseOfBodies) {
  const double m_1 = 40.0, m_2 = 25.0, R = 0.3;
  const Vector3d c_1(0.2, -0.1, 0.4), c_2(-0.6, 0.5, 0.3);
  const Eigen::Matrix3d J_1 = Vector3d(5.0, 7.0, 8.0).asDiagonal();
  const auto vehicle = [&](bool tank) {
    BodySpec base = on(rigid("base", 300.0, {0.1, 0, 0.2}, diagonal({60, 80, 90})), "", "free");
    base.hinge.v = {0.1, -0.2, 0.3, 0.5, 0.4, -0.1};
    BodySpec arm = on(rigid("arm", m_1, c_1, J_1), "base", "ball", {}, {0.5, 0.6, 0.7});
    arm.hinge.v = {0.4, 0.7, -0.5};
    if (!tank) {
      const double m = m_1 + m_2;
      const Vector3d c = (m_1 * c_1 + m_2 * c_2) / m;
      const auto about = [&c](double mass, const Vector3d& at) -> Eigen::Matrix3d {
        const Vector3d d = at - c;
        return mass * (d.squaredNorm() * Eigen::Matrix3d::Identity() - d * d.transpose());
      };
      arm.mass = m, arm.com = c;
      arm.inertia_com = J_1 + about(m_1, c_1) + about(m_2, c_2) + 0.4 * m_2 * R * R * Eigen::Matrix3d::Identity();
    }
    SystemSpec spec = system({base, arm});
    if (!tank) return spec;
    DeviceSpec d = with_vector(device("tank", "tank", {{"radius", R}}, {{"at", "arm"}}), "position", c_2);
    d.initial["propellant"] = number(m_2);
    spec.devices = {d};
    return spec;
  };
  const auto locked = [&](bool tank) {
    Simulation sim(compiled(vehicle(tank)), {});
    SystemSpec next = vehicle(tank);
    next.bodies[1].hinge.locked = true;
    return rejoin(sim, next, registry(), {}).state.v;
  };
  EXPECT_LE(largest(locked(true) - locked(false)), kRound);
}

/// Where P of a body is, in the frame of another one.
Pose<double> seen_from(Simulation& sim, const std::string& body, const std::string& other, const HingeSpec& hinge) {
  const Observer& o = sim.observe();
  const Pose<double> X =
      o.body_pose(sim.model().find_body(body)) * Pose<double>{from_eigen(hinge.pnode_R), from_eigen(hinge.pnode_position)};
  return other.empty() ? X : inverse(o.body_pose(sim.model().find_body(other))) * X;
}

TEST(Rejoin, ABodyIsHungOnAHingeOfAnyTypeWhereItIs) {
  for (const std::string type : {"revolute", "prismatic", "helical", "cylindrical", "universal", "gimbal", "ball", "planar", "locked"}) {
    SCOPED_TRACE(type);
    for_all_trees(
        floating(0.0), kRound,
        [&](const RandomTree& tree) {
          double worst = 0.0;
          for (const BodySpec& b : tree.spec.bodies)
            for (const BodySpec& to : tree.spec.bodies) {
              if (hangs_on(tree.spec, to.name, b.name)) continue;
              Simulation sim(compiled(tree.spec), {});
              SystemSpec next = tree.spec;
              HingeSpec& hinge = next.bodies[idx(sim.model().find_body(b.name))].hinge;
              HingeSpec hung;
              hung.type = type, hung.inboard_body = to.name;
              if (type == "universal") hung.params["axes"].value = std::vector<double>{1, 0, 0, 0, 1, 0};
              if (type == "gimbal") hung.params["axes"].value = std::vector<double>{0, 0, 1, 0, 1, 0, 1, 0, 0};
              if (type == "planar") hung.params["axes"].value = std::vector<double>{1, 0, 0, 0, 0.6, 0.8};
              if (type == "helical") hung.params["pitch"].value = 0.1;
              if (type == "revolute" || type == "prismatic" || type == "helical" || type == "cylindrical")
                hung.params["axis"].value = std::vector<double>{0, 0.6, 0.8};
              hung.pnode_position = hinge.pnode_position, hung.pnode_R = hinge.pnode_R, hung.body_node = hinge.body_node;
              if (!hinge.body_node.empty()) hung.body_node.clear();
              const Pose<double> X = seen_from(sim, b.name, to.name, hung);
              hung.onode_position = to_eigen(X.p), hung.onode_R = to_eigen(X.R);
              hinge = hung;
              worst = worse(worst, errors_of(sim, rejoin(sim, next, registry(), {}), false).largest());
            }
          return worst;
        },
        8);
  }
}

/// Two trees that are docked by a closure, or by hanging one on the other: the same motion of all bodies.
TEST(Rejoin, AClosedWeldIsAnAttachment) {
  for_all_trees(
      {.bodies = 6, .roots = 2, .flexible = 0.0, .floating = true, .gravity = GravitySpec::Kind::none}, kRound, [](const RandomTree& tree) {
        const BodySpec& guest = *std::ranges::find_if(tree.spec.bodies, [](const BodySpec& b) { return b.hinge.inboard_body.empty(); });
        const auto host =
            std::ranges::find_if(tree.spec.bodies, [&](const BodySpec& b) { return !hangs_on(tree.spec, b.name, guest.name); });
        if (host == tree.spec.bodies.end()) return 0.0;
        SystemSpec open = tree.spec;
        HingeSpec frame;
        LoopSpec weld;
        weld.name = "dock", weld.type = "weld", weld.open = true;
        weld.from.body = host->name, weld.to.body = guest.name;
        {
          Simulation sim(compiled(tree.spec), {});
          const Pose<double> X = seen_from(sim, guest.name, host->name, frame);
          weld.from.position = to_eigen(X.p), weld.from.R = to_eigen(X.R);
        }
        open.loops = {weld};
        Simulation sim(compiled(open), {});
        SystemSpec closed = open, attached = open;
        closed.loops[0].open = false;
        HingeSpec& hinge = attached.bodies[idx(sim.model().find_body(guest.name))].hinge;
        hinge = HingeSpec{};
        hinge.type = "free", hinge.locked = true, hinge.inboard_body = host->name;
        const Rejoined by_loop = rejoin(sim, closed, registry(), {}), by_hinge = rejoin(sim, attached, registry(), {});
        const Errors e = errors_of(sim, by_hinge, false);
        const VectorXd a = Bodies(*by_loop.model).velocities(by_loop.state.q, by_loop.state.v),
                       b = Bodies(*by_hinge.model).velocities(by_hinge.state.q, by_hinge.state.v);
        return worse(e.largest(), relative(largest(a - b), largest(b)));
      });
}

TEST(Rejoin, EndsThatAreApartAreRefused) {
  BodySpec base = on(rigid("base", 10, {0, 0, 0}, diagonal({1, 2, 3})), "", "free"),
           probe = on(rigid("probe", 2, {0, 0, 0}, diagonal({1, 1, 1})), "", "free");
  probe.hinge.q = {1, 0, 0, 0, 0.5, 0, 0.003};
  const SystemSpec spec = system({base, probe});
  Simulation sim(compiled(spec), {});
  SystemSpec next = spec;
  next.bodies[1].hinge = {};
  next.bodies[1].hinge.inboard_body = "base", next.bodies[1].hinge.onode_position = {0.5, 0, 0};
  try {
    rejoin(sim, next, registry(), {});
    FAIL() << "no error";
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics().front().code, Code::ends_apart);
    EXPECT_EQ(e.diagnostics().front().at.key_path, "bodies.probe.hinge");
    EXPECT_EQ(e.diagnostics().front().got, "0 rad and 0.003 m between them at t = 0 s");
  }
}

/// Bodies of one tree are no further apart than rounding of their places, however far that is from the origin of the world.
TEST(Rejoin, AHingeBecomesAnotherFarFromTheOrigin) {
  for (int i = 1; i <= 10; ++i) {
    const double angle = 0.17 * i;
    BodySpec base = on(rigid("base", 10, {0, 0, 0}, diagonal({1, 2, 3})), "", "free"),
             arm = on(rigid("arm", 2, {0.3, 0, 0}, diagonal({1, 1, 1})), "base", "revolute", {{0, 0, 1}}, {1.3, 0.7, 0.9});
    base.hinge.q = {0.8, 0.36, 0.48, 0, 1.1e11 + i, 0.9e11, 1e9};  // [m] about the Sun
    arm.hinge.q = {angle}, arm.hinge.pnode_position = {0.37, 0.21, 0};
    SystemSpec next = system({base, arm});
    Simulation sim(compiled(next), {});
    next.bodies[1].hinge.type = "ball", next.bodies[1].hinge.params.clear(), next.bodies[1].hinge.q.clear();
    const Rejoined there = rejoin(sim, next, registry(), {});
    const UserBody& u = there.model->user[1];
    EXPECT_NEAR(there.state.q[u.q], std::cos(0.5 * angle), kRound);
    EXPECT_NEAR(there.state.q[u.q + 3], std::sin(0.5 * angle), kRound);
    next.bodies[1].hinge.onode_position.x() += 1e-3;
    EXPECT_THROW(rejoin(sim, next, registry(), {}), InputError);
  }
}

/// What is mounted at a hinge that is gone reads it where it was last.
TEST(Rejoin, ADeviceAtAHingeThatIsGoneReadsWhereItWas) {
  BodySpec bus = on(rigid("bus", 10.0, {0, 0, 0}, diagonal({2, 2, 3})), "", "free");
  BodySpec arm = on(rigid("arm", 2.0, {0, 0, 0}, diagonal({0.5, 0.6, 0.7})), "bus", "revolute", {{0, 0, 1}});
  arm.hinge.q = {0.2}, arm.hinge.v = {0.5};
  SystemSpec spec = system({bus, arm});
  spec.devices = {device("encoder", "encoder", {}, {{"at", "arm"}})};
  spec.devices[0].rate = 10.0;
  Simulation sim(compiled(spec), {});
  SystemSpec apart = spec;
  apart.bodies[1].hinge = {};
  apart.bodies[1].hinge.type = "free";
  sim.every({1, 1}, [&] {
    if (sim.time() == 1.0) sim.adopt([&] { return rejoin(sim, apart, registry(), {}); }, "let go");
  });
  sim.run(1.5);
  ASSERT_EQ(sim.state().v.size(), 12);
  EXPECT_NEAR(sim.device_output(0), 0.2 + 0.5 * 1.0, 1e-12);
}

/// 1 kg at 3 m/s catches 2 kg at rest: 1 m/s together, and the energy is that of the books.
TEST(Rejoin, APlasticImpactIsThatOfTheBooks) {
  BodySpec a = on(particle("a", 1.0, {0, 0, 0}), "", "translational"), b = on(particle("b", 2.0, {0, 0, 0}), "", "translational");
  a.hinge.v = {3, 0, 0};
  const SystemSpec spec = system({a, b});
  Simulation sim(compiled(spec), {});
  SystemSpec next = spec;
  next.bodies[1].hinge = {};
  next.bodies[1].hinge.inboard_body = "a";
  sim.every({1, 1}, [&] {
    if (sim.time() == 1.0)
      sim.adopt(
          [&] {
            SystemSpec docked = next;
            docked.bodies[1].hinge.type = "free", docked.bodies[1].hinge.locked = true;
            return rejoin(sim, docked, registry(), {});
          },
          "dock");
  });
  sim.run(2.0);
  ASSERT_EQ(sim.state().v.size(), 3);
  EXPECT_NEAR(sim.state().v[0], 1.0, 1e-15);
  EXPECT_NEAR(sim.state().q[0], 4.0, 1e-12);  // 3 m, then 1 m
  EXPECT_NEAR(sim.energy().kinetic, 1.5, 1e-14);
  EXPECT_TRUE(sim.ledger().pass);
}

}  // namespace
}  // namespace cardan::test
