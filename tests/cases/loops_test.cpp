// Published mechanisms with closed loops, each to the tolerance its file recommends.
#include <boost/math/special_functions/jacobi_elliptic.hpp>
#include <cmath>
#include <numbers>

#include "core/model/loops.hpp"
#include "tests/cases/andrews.hpp"
#include "tests/cases/published.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

TEST(AndrewsSqueezer, TurnsItsCrankInThirtyMilliseconds) {
  const Published ref("loop-andrews-squeezer");
  EXPECT_EQ(ref.model()["spring"]["c0_Nm"].as<double>(), kAndrewsStiffness);
  EXPECT_EQ(ref.model()["spring"]["l0_m"].as<double>(), kAndrewsRest);
  EXPECT_EQ(ref.model()["drive_torque_Nm"].as<double>(), kAndrewsTorque);
  const auto sim = run_of(andrews_squeezer());
  sim->set_force(0, kAndrewsTorque);
  // Published: beta, Theta, gamma, Phi, delta, Omega, epsilon; ours: K1 ... of the model.
  const auto published_order = [](const VectorXd& x) {
    VectorXd out(7);
    out << x[0], x[1], x[2], x[4], x[3], x[6], x[5];
    return out;
  };
  const VectorXd start = Published::as_vector(ref.initial()["q"]), first = Published::as_vector(ref.initial()["qdd_first_two"]);
  expect_vector("q at the start", published_order(sim->state().q), start, 1e-14);
  expect_entries("accelerations at the start", sim->vdot().head(2), first, 1e-13);
  sim->run(0.03);
  const VectorXd q = ref.vector("q at 0.03"), v = ref.vector("qd at 0.03");
  expect_vector("q", published_order(sim->state().q), q, ref.tolerance("q_abs"));
  expect_vector("qd", published_order(sim->state().v), v, ref.tolerance("qd_rel"), largest(v));
  expect_vector("qdd", published_order(sim->vdot()), ref.vector("qdd at 0.03"), 1e-5, largest(ref.vector("qdd at 0.03")));
  double open = 0.0;
  for (const double c : sim->loop_forces().residual) open = worse(open, std::abs(c));
  expect_within("residual", open, 1e-15);
}

TEST(Bricard, TurnsWhereCountingGivesNoMobility) {
  const Published ref("loop-iftomm-a04-bricard");
  bench_loops::Model bricard = bench_loops::read(CARDAN_SOURCE_DIR "/tests/reference/bench_loops/bricard.json");
  for (BodySpec& b : bricard.spec.bodies) b.hinge.q = {0.0}, b.hinge.v = {0.0};  // the published start, at rest
  const auto sim = run_of(bricard.spec, "dopri5", 1e-12);
  const Model& m = sim->model();
  Workspace ws(m);
  const LoopRank rank = loop_rank(m, ws, sim->state().q.data());
  EXPECT_EQ(m.nv - rank.rank, ref.at("degrees of freedom").as<int>());
  EXPECT_EQ(static_cast<int>(rank.redundant.size()), ref.at("redundant constraints").as<int>());
  const double before = sim->energy().total();
  double open = 0.0, apart = 0.0;
  const auto look = [&] {
    for (const double c : sim->loop_forces().residual) open = worse(open, std::abs(c));
    apart = worse(apart, std::abs(sim->energy().total() - before));
  };
  sim->every({1, 100}, look);
  sim->run(10.0);
  look();
  expect_within("energy", apart / 9.81, ref.tolerance("energy_rel"));
  expect_within("residual", open, 1e-14);
}

/// n windows: n + 1 vertical cranks on the ground, n couplers from tip to tip, each closed at the next crank.
SystemSpec windows(int n, double rate) {
  SystemSpec spec = system({}, uniform_gravity(-9.81 * Y));
  const auto link = [](const std::string& name) { return rigid(name, 1.0, {0.5, 0, 0}, diagonal({0.001, 1.0 / 12.0, 1.0 / 12.0})); };
  for (int i = 0; i <= n; ++i) {
    spec.bodies.push_back(on(link(fmt::format("crank{}", i)), "", "revolute", {Z}, {1.0 * i, 0, 0}));
    spec.bodies.back().hinge.q = {std::numbers::pi / 2}, spec.bodies.back().hinge.v = {rate};
  }
  for (int i = 0; i < n; ++i) {
    spec.bodies.push_back(on(link(fmt::format("coupler{}", i)), fmt::format("crank{}", i), "revolute", {Z}, {1, 0, 0}));
    spec.bodies.back().hinge.q = {-std::numbers::pi / 2}, spec.bodies.back().hinge.v = {-rate};
    LoopSpec pin;
    pin.name = fmt::format("pin{}", i), pin.type = "point";
    pin.from.body = fmt::format("crank{}", i + 1), pin.to.body = fmt::format("coupler{}", i);
    pin.from.position = pin.to.position = {1, 0, 0};
    spec.loops.push_back(pin);
  }
  return spec;
}

TEST(NFourBar, StaysParallelThroughItsSingularPostures) {
  const Published ref("loop-iftomm-a02-n-fourbar");
  // Equal steps: where accelerations are those of a singular posture, no error test can be met.
  const auto sim = run_of(windows(2, -1.0), "rk4", 1e-9, 2e-4);
  const double before = sim->energy().total();
  sim->run(4.0);
  const auto tip = [&] { return Eigen::Vector2d(std::cos(sim->state().q[0]), std::sin(sim->state().q[0])); };
  expect_vector("B0 at 4 s", tip(), ref.vector("N=2, B0 at 4 s"), ref.tolerance("position_m"));
  sim->run(10.0);
  const Eigen::VectorXd& q = sim->state().q;
  expect_vector("B0 at 10 s", tip(), ref.vector("N=2, B0 at 10 s"), ref.tolerance("position_m"));
  for (int i = 1; i <= 2; ++i) expect_within("cranks apart", std::abs(std::remainder(q[i] - q[0], 2.0 * std::numbers::pi)), 1e-9);
  expect_within("energy", std::abs(sim->energy().total() - before), ref.tolerance("energy_J"));
}

/// All cranks parallel, couplers only move along: one pendulum, (N + 1) / 3 + N its inertia, (N + 1) / 2 + N its moment. From the top at
/// -1 rad/s it passes the bottom at W, W^2 = 1 + 4 g moment / inertia; with phi half the angle from there, phi' = W/2 sqrt(1 - m sin^2
/// phi).
struct Windows {
  explicit Windows(int n)
      : pull(9.81 * (0.5 * (n + 1) + n) / ((n + 1) / 3.0 + n)), W(std::sqrt(1.0 + 4.0 * pull)), k(std::sqrt(4.0 * pull) / W) {}
  struct Crank {
    Eigen::Vector2d tip;
    double rate;
  };
  Crank at(double t) const {
    double cn = 0.0, dn = 0.0;
    const double sn = boost::math::jacobi_elliptic(k, 0.5 * W * t - std::comp_ellint_1(k), &cn, &dn);
    return {{-2.0 * sn * cn, sn * sn - cn * cn}, -W * dn};
  }
  double pull, W, k;
};

/// The largest errors of all cranks and couplers: of directions, and of rates as a part of W.
double apart(const Simulation& sim, const Windows& truth, int n) {
  const Windows::Crank at = truth.at(sim.time());
  const Eigen::VectorXd &q = sim.state().q, &v = sim.state().v;
  double out = 0.0;
  for (int i = 0; i <= n; ++i) {
    out = worse({out, (Eigen::Vector2d(std::cos(q[i]), std::sin(q[i])) - at.tip).norm(), std::abs(v[i] - at.rate) / truth.W});
    if (i < n)
      out = worse({out, std::abs(std::remainder(q[n + 1 + i] + q[i], 2.0 * std::numbers::pi)), std::abs(v[n + 1 + i] + v[i]) / truth.W});
  }
  return out;
}
double open(Simulation& sim) {
  double out = 0.0;
  for (const double c : sim.loop_forces().residual) out = worse(out, std::abs(c));
  return out;
}
/// [J] between the highest and the lowest place.
double fall(int n) { return 9.81 * (3.0 * n + 1.0); }

// As far as the links are not in line yet. Of ida 1e3 tolerances: its test is of a step, and it takes hundreds, fewer with less to do.
TEST(NFourBar, FallsAsAPendulumInEachForm) {
  const Published ref("loop-iftomm-a02-n-fourbar");
  struct Way {
    LoopForm form;
    std::string method;
    double tolerance, span, limit;
  };
  for (const int n : {2, 40})
    for (const Way& by : {Way{LoopForm::embedding, "dop853", 1e-12, 0.6, 1e-11}, Way{LoopForm::multipliers, "dop853", 1e-12, 0.6, 1e-11},
                          Way{LoopForm::dae, "ida", 1e-9, n > 2 ? 0.02 : 0.6, 1e-6}}) {
      SystemSpec spec = windows(n, -1.0);
      spec.loop_form = by.form;
      const auto sim = run_of(spec, by.method, by.tolerance);
      const double before = sim->energy().total();
      sim->run(by.span);
      const std::string of = fmt::format("N={} by {}: ", n, loop_forms()[static_cast<std::size_t>(by.form)]);
      expect_within(of + "cranks and couplers", apart(*sim, Windows(n), n), by.limit);
      expect_within(of + "energy", std::abs(sim->energy().total() - before) / fall(n), by.limit);
      expect_within(of + "residual", open(*sim), 2e-14);  // of places up to 41 m from the origin
    }
}

// Ten seconds, six turns, two singular postures each.
TEST(NFourBar, OfFortyWindowsStaysParallelThroughItsSingularPostures) {
  const Published ref("loop-iftomm-a02-n-fourbar");
  const int n = 40;
  const auto sim = run_of(windows(n, -1.0), "rk4", 1e-9, 2e-3);
  const double before = sim->energy().total();
  sim->run(10.0);
  const double q = sim->state().q[0];
  expect_vector("N=40, B0 at 10 s", Eigen::Vector2d(std::cos(q), std::sin(q)), ref.vector("N=40, B0 at 10 s"), ref.tolerance("position_m"));
  expect_within("N=40: cranks and couplers", apart(*sim, Windows(n), n), ref.tolerance("position_m"));
  expect_within("N=40: residual", open(*sim), 2e-14);
  expect_within("N=40: energy", std::abs(sim->energy().total() - before) / fall(n), 1e-6);
}

// No loop: the rods hang on the shaft, springs and dampers hold the slider to them.
TEST(FlyballGovernor, IsHeldByStiffDampers) {
  const Published ref("loop-iftomm-a05-flyball-governor");
  const double rate = ref.initial()["angular_rate_z"].as<double>(),
               down = ref.model()["rod_angle_below_horizontal_deg"].as<double>() * std::numbers::pi / 180.0;
  const auto mass = [&](const char* name) { return ref.model()["masses_kg"][name].as<double>(); };
  const auto brick = [](double m, const Vector3d& a) -> Vector3d {
    return Vector3d(a.y() * a.y() + a.z() * a.z(), a.x() * a.x() + a.z() * a.z(), a.x() * a.x() + a.y() * a.y()) * m / 12.0;
  };
  const auto size = [&](const char* name) { return Vector3d(Published::as_vector(ref.model()[name])); };
  BodySpec shaft = on(rigid("shaft", mass("shaft"), {0, 0, 0.5}, diagonal(brick(mass("shaft"), size("shaft_m")))), "", "revolute", {Z});
  shaft.hinge.v = {rate};
  BodySpec slider =
      on(rigid("slider", mass("slider"), Vector3d::Zero(), diagonal(brick(mass("slider"), size("slider_m")))), "shaft", "prismatic", {Z});
  slider.hinge.q = {ref.model()["slider_height_m"].as<double>()};
  for (const int side : {1, -1})
    slider.nodes.push_back({side > 0 ? "right" : "left", {0.05 * side, 0, 0}, Eigen::Matrix3d::Identity(), {}});
  SystemSpec spec = system({shaft, slider}, uniform_gravity(Published::as_vector(ref.model()["gravity_ms2"])));
  double centre = 0.0;
  for (const int side : {1, -1}) {
    const double rod = mass("rod"), ball = mass("ball");
    centre = (0.5 * rod + ball) / (rod + ball);
    const double about = rod * std::pow(centre - 0.5, 2) + ball * std::pow(1.0 - centre, 2);
    const Vector3d own = brick(rod, size("rods_m"));
    BodySpec b = on(rigid(side > 0 ? "AC" : "BD", rod + ball, {side * centre, 0, 0}, diagonal({own.x(), own.y() + about, own.z() + about})),
                    "shaft", "revolute", {Y}, Vector3d(Published::as_vector(ref.model()["hinge_points_m"][side > 0 ? "A" : "B"])));
    b.hinge.q = {side * down};
    b.nodes.push_back({"middle", {0.5 * side, 0, 0}, Eigen::Matrix3d::Identity(), {}});
    b.nodes.push_back({"centre", {centre * side, 0, 0}, Eigen::Matrix3d::Identity(), {}});
    DeviceSpec damper;
    damper.name = side > 0 ? "right" : "left", damper.type = "spring_damper";
    const YAML::Node given = ref.model()["spring_damper"];
    damper.params["stiffness"].value = given["k_Nm"].as<double>(), damper.params["damping"].value = given["c_Nsm"].as<double>();
    damper.params["rest"].value = given["rest_length_m"].as<double>();
    damper.mounts["from"] = {b.name + ".middle", {}}, damper.mounts["to"] = {side > 0 ? "slider.right" : "slider.left", {}};
    spec.bodies.push_back(std::move(b));
    spec.devices.push_back(std::move(damper));
  }
  const auto sim = run_of(spec, "cvode_bdf", 1e-10);
  const auto speed = [&] {
    const NodeState n = sim->observe().node(sim->model().find_node("AC.centre"));
    return (n.R_WN * n.velocity.tail<3>()).y();
  };
  expect_relative("vy at the start", speed(), ref.number("initial vy"), 1e-4);
  sim->run(1e-3);
  expect_relative("vy at 1 ms", speed(), ref.number("vy of rod+ball"), ref.tolerance("rel"));
}

}  // namespace
}  // namespace cardan::test
