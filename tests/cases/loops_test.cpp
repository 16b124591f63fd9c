// Published mechanisms with closed loops, each to the tolerance its file recommends.
#include <boost/math/special_functions/jacobi_elliptic.hpp>
#include <cmath>
#include <numbers>

#include "core/model/loops.hpp"
#include "core/sim/rejoin.hpp"
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

LoopSpec coupling(const char* name, std::vector<LoopSpec::Term> terms, double offset = 0.0) {
  LoopSpec l;
  l.name = name, l.type = "coupling", l.terms = std::move(terms), l.offset = offset;
  return l;
}

// The drum turns with the place where the cord leaves it, the ball slides along the cord. Neither arm has a mass that counts.
TEST(YoYo, DespinsItsSpacecraft) {
  const Published ref("loop-yoyo-despin");
  const double I = ref.model()["hub_inertia_kgm2"].as<double>(), R = ref.model()["drum_radius_m"].as<double>(),
               w0 = ref.initial()["rate_rads"].as<double>(), l0 = ref.initial()["cord_m"].as<double>(), light = 1e-12;
  const VectorXd mass = Published::as_vector(ref.model()["masses_kg"]);
  const double c = 1.0 + I / (mass.sum() * R * R);
  const auto rate = [&](double l) { return w0 * (c * R * R - l * l) / (c * R * R + l * l); };
  BodySpec hub = on(rigid("hub", 100.0, Vector3d::Zero(), diagonal({I, I, I})), "", "revolute", {Z});
  hub.hinge.v = {rate(l0)};
  SystemSpec spec = system({hub});
  for (int i = 0; i < 2; ++i) {
    const std::string arm = fmt::format("arm_{}", i), ball = fmt::format("ball_{}", i);
    const double side = i == 0 ? 1.0 : -1.0;
    BodySpec a = on(rigid(arm, light, Vector3d::Zero(), diagonal({light, light, light})), "hub", "revolute", {Z});
    a.hinge.q = {l0 / R}, a.hinge.v = {w0};
    BodySpec b = on(particle(ball, mass[i], Vector3d::Zero()), arm, "prismatic", {-side * Y}, side * R * X);
    b.hinge.q = {l0}, b.hinge.v = {R * w0};
    spec.bodies.insert(spec.bodies.end(), {a, b});
    spec.loops.push_back(coupling(arm.c_str(), {{arm, R, {}}, {ball, -1.0, {}}}));
  }
  const auto sim = run_of(spec, "dop853", 1e-12);
  double apart = 0.0;
  sim->every({1, 1000}, [&] { apart = worse(apart, std::abs(sim->state().v[0] - rate(sim->state().q[2]))); });
  const auto until = [&](double l) { sim->run((l - l0) / ref.number("speed of unwinding")); };
  until(1.0);
  expect_absolute("rate at l = 1 m", sim->state().v[0], ref.number("rate of the hub at l = 1 m"), ref.tolerance("abs"));
  until(2.0);
  expect_absolute("rate at l = 2 m", sim->state().v[0], ref.number("rate of the hub at l = 2 m"), ref.tolerance("abs"));
  until(ref.number("cord when the hub stands still"));
  expect_absolute("cord", sim->state().q[2], ref.number("cord when the hub stands still"), ref.tolerance("abs"));
  expect_absolute("rate at the end", sim->state().v[0], 0.0, ref.tolerance("abs"));
  expect_within("rate over the cord", apart, ref.tolerance("abs"));
}

TEST(SwingingAtwood, OfMassRatioThreeKeepsItsSecondIntegral) {
  const Published ref("loop-swinging-atwood");
  const double m = ref.model()["bob_kg"].as<double>(), M = ref.model()["weight_kg"].as<double>(), g = 9.81, light = 1e-14;
  const double start = ref.initial()["r_m"].as<double>();
  BodySpec arm = on(rigid("arm", light, Vector3d::Zero(), diagonal({light, light, light})), "", "revolute", {Y});
  arm.hinge.q = {ref.initial()["theta_rad"].as<double>()};
  BodySpec bob = on(particle("bob", m, Vector3d::Zero()), "arm", "prismatic", {-Z});
  bob.hinge.q = {start};
  BodySpec weight = on(particle("weight", M, Vector3d::Zero()), "", "prismatic", {-Z});
  SystemSpec spec = system({arm, bob, weight}, uniform_gravity(-g * Z));
  spec.loops = {coupling("string", {{"bob", 1.0, {}}, {"weight", 1.0, {}}}, start)};
  const auto sim = run_of(spec, "dop853");
  const auto polar = [&] {
    const State& s = sim->state();
    return Eigen::Vector4d(s.q[1], s.v[1], s.q[0], s.v[0]);
  };
  double off = 0.0;
  const double want = ref.number("second integral");
  sim->every({1, 100}, [&] {
    const Eigen::Vector4d x = polar();
    const double r = x[0], s = std::sin(0.5 * x[2]), c = std::cos(0.5 * x[2]);
    off = worse(off, std::abs((r * r * x[3] * (x[1] * c - 0.5 * r * x[3] * s) + g * r * r * s * c * c) / want - 1.0));
  });
  for (const char* t : {"0.5 s", "1 s"}) {
    sim->run(std::stod(t));
    expect_vector(std::string("state at ") + t, polar(), ref.vector(std::string("r, r', theta, theta' at ") + t),
                  ref.tolerance("state_abs"));
  }
  sim->run(5.0);
  expect_within("second integral", off, ref.tolerance("integral_rel"));
}

// x and y of a planar hinge follow its angle, which has no inertia: the bead is a point.
TEST(HuygensTautochrone, SwingsInTheSameTimeFromEverywhere) {
  const Published ref("loop-huygens-tautochrone");
  constexpr double r = 0.5;
  for (const double a : {0.5, 1.5, 2.5}) {
    BodySpec bead = on(particle("bead", 1.0, Vector3d::Zero()), "", "planar", {X, Y});
    bead.hinge.q = {r * (a + std::sin(a)), -r * (1.0 + std::cos(a)), a};
    SystemSpec spec = system({bead}, uniform_gravity(-9.81 * Y));
    LoopSpec along = coupling("along", {{"bead.x", -1.0, {}}, {"bead.angle", r, {}}}), up = coupling("up", {{"bead.y", -1.0, {}}}, r);
    LoopSpec::Function f;
    f.kind = "sine", f.numbers = {r}, f.of = {{"bead.angle", 1.0, {}}};
    along.functions = {f};
    f.kind = "cosine", f.numbers = {-r};
    up.functions = {f};
    spec.loops = {along, up};
    const auto sim = run_of(spec, "dop853");
    const auto turns = crossings(*sim, -1, [](const double*, const double* v) { return v[2]; });  // at +a
    const double period = ref.number("period");
    sim->run(2.25 * period);
    ASSERT_EQ(turns->size(), 2u);
    expect_relative(fmt::format("period from {} rad", a), turns->at(1) - turns->at(0), period, ref.tolerance("period_rel"));
    const LedgerState ledger = sim->ledger();
    expect_within(fmt::format("ledgers from {} rad", a), worse({ledger.linear_relative, ledger.angular_relative, ledger.energy_relative}),
                  ref.tolerance("ledger"));
  }
}

TEST(Bennett, TurnsAboutFourAxesOfWhichCountingAllowsNone) {
  const Published ref("loop-bennett");
  const double lengths[] = {1.0, 2.0, 1.0}, twist = ref.model()["twist_of_the_long_links_rad"].as<double>(), twists[] = {0.5, twist, 0.5};
  const double K = ref.number("tan(theta_1/2) tan(theta_2/2)"), first = ref.initial()["first_angle_rad"].as<double>();
  const double angles[] = {first, 2.0 * std::atan(K / std::tan(0.5 * first)), -first};
  SystemSpec spec = system({});
  for (int i = 0; i < 3; ++i) {
    BodySpec link =
        on(rigid(fmt::format("link_{}", i), 1.0, Vector3d::Zero(), diagonal({1, 1, 1})), i == 0 ? "" : fmt::format("link_{}", i - 1),
           "revolute", {Z}, i == 0 ? Vector3d(Vector3d::Zero()) : Vector3d(lengths[i - 1] * X));
    if (i > 0) link.hinge.onode_R = Eigen::AngleAxisd(twists[i - 1], X).toRotationMatrix();
    link.hinge.q = {angles[i]};
    if (i == 0) link.hinge.v = {ref.initial()["rate_rads"].as<double>()};
    spec.bodies.push_back(link);
  }
  LoopSpec last;
  last.name = "last", last.type = "revolute", last.params = along({Z});
  last.from.body = "link_2", last.from.position = lengths[2] * X, last.from.R = Eigen::AngleAxisd(twists[2], X).toRotationMatrix();
  last.to.position = -2.0 * X, last.to.R = Eigen::AngleAxisd(-twist, X).toRotationMatrix();
  spec.loops = {last};
  const auto sim = run_of(spec, "dop853", 1e-12);
  const Model& m = sim->model();
  Workspace ws(m);
  const LoopRank rank = loop_rank(m, ws, sim->state().q.data());
  EXPECT_EQ(m.nv - rank.rank, ref.at("degrees of freedom").as<int>());
  EXPECT_EQ(static_cast<int>(rank.redundant.size()), ref.at("rows that others imply").as<int>());
  double off = 0.0;
  sim->every({1, 100}, [&] {
    const VectorXd& q = sim->state().q;
    off = worse(off, std::abs(std::tan(0.5 * q[0]) * std::tan(0.5 * q[1]) - K));
  });
  sim->run(2.0);
  expect_within("tan(theta_1/2) tan(theta_2/2)", off, ref.tolerance("abs"));
  expect_within("residual", open(*sim), 2e-14);
}

/// O and A on the ground, the near corner P on the crank from A, B and C at the ends of the long rods from O, the far corner Q.
TEST(Peaucellier, DrawsAStraightLine) {
  const Published ref("loop-peaucellier");
  const auto of = [&](const char* name) { return ref.model()[name].as<double>(); };
  const double a = of("crank_m"), l = of("long_rods_m"), s = of("short_rods_m"), angle = ref.initial()["crank_rad"].as<double>();
  const Vector3d A = a * X, P = A + a * Vector3d(std::cos(angle), std::sin(angle), 0.0), u = P.normalized(), w = Z.cross(u);
  const double d = P.norm(), along = (l * l - s * s + d * d) / (2.0 * d), across = std::sqrt(l * l - along * along);
  const Vector3d B = along * u + across * w, C = along * u - across * w, Q = (2.0 * along - d) * u;
  const auto direction = [](const Vector3d& v) { return std::atan2(v.y(), v.x()); };
  const auto rod = [&](const std::string& name, const char* kind, const std::string& on_rod, double at, const Vector3d& way,
                       double before) {
    const double length = way.norm(), m = ref.model()["masses_kg"][kind].as<double>(), J = m * length * length / 12.0;
    BodySpec out = on(rigid(name, m, 0.5 * length * X, diagonal({1e-3, J, J})), on_rod, "revolute", {Z}, at * X);
    out.hinge.q = {direction(way) - before};
    return out;
  };
  std::vector<BodySpec> bodies = {rod("crank", "crank", "", a, P - A, 0.0),
                                  rod("OB", "long", "", 0.0, B, 0.0),
                                  rod("OC", "long", "", 0.0, C, 0.0),
                                  rod("PB", "short", "crank", a, B - P, angle),
                                  rod("PC", "short", "crank", a, C - P, angle),
                                  rod("BQ", "short", "OB", l, Q - B, direction(B)),
                                  rod("CQ", "short", "OC", l, Q - C, direction(C))};
  bodies[0].hinge.v = {ref.initial()["rate_rads"].as<double>()};
  NodeSpec corner;
  corner.name = "corner", corner.position = s * X;
  bodies[5].nodes = {corner};
  SystemSpec spec = system(bodies);
  for (const auto& [from, to, at] : {std::tuple("PB", "OB", l), {"PC", "OC", l}, {"BQ", "CQ", s}}) {
    LoopSpec pin;
    pin.name = fmt::format("{}_{}", from, to), pin.type = "revolute", pin.params = test::along({Z});
    pin.from.body = from, pin.from.position = s * X, pin.to.body = to, pin.to.position = at * X;
    spec.loops.push_back(pin);
  }
  spec.assembly.hold = {"crank"};
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
    spec.loop_form = form;
    const std::string by = form == LoopForm::embedding ? "embedded: " : "multipliers: ";
    const auto sim = run_of(spec, "dop853");
    const int node = sim->model().find_node("BQ.corner");
    double off = 0.0;
    sim->every({1, 100}, [&] { off = worse(off, std::abs(sim->observe().node(node).position.x() - ref.number("x of the far corner"))); });
    double rate = 0.0, y = 0.0;
    const auto there = crossings(
        *sim, +1, [](const double* q, const double*) { return q[0] - 1.2; },
        [&] { rate = sim->state().v[0], y = sim->observe().node(node).position.y(); });
    sim->run(0.7);
    ASSERT_EQ(there->size(), 1u);
    expect_within(by + "off the line", off, ref.tolerance("line_m"));
    expect_relative(by + "time at 1.2 rad", there->front(), ref.number("time at 1.2 rad"), ref.tolerance("rel"));
    expect_relative(by + "rate at 1.2 rad", rate, ref.number("rate at 1.2 rad"), ref.tolerance("rel"));
    expect_relative(by + "y of the far corner at 1.2 rad", y, ref.number("y of the far corner"), ref.tolerance("rel"));
  }
}

// The cross turns about the z axis of the first shaft, which is across the plane of both, and the y axis of the second.
TEST(CardanJoint, TurnsTheSecondShaftUnevenly) {
  const Published ref("loop-cardan-joint");
  const double W = ref.model()["rate_of_the_first_rads"].as<double>(), J = ref.model()["inertia_of_the_second_kgm2"].as<double>(),
               b = std::numbers::pi / 6.0;
  BodySpec first = on(rigid("first", 1.0, Vector3d::Zero(), diagonal({0.1, 0.1, 0.1})), "", "revolute", {X});
  first.hinge.prescribed = {0};
  first.hinge.v = {W};
  BodySpec second = on(rigid("second", 1.0, Vector3d::Zero(), diagonal({J, 0.1, 0.1})), "", "revolute", {X});
  second.hinge.onode_R = Eigen::AngleAxisd(b, Z).toRotationMatrix();
  second.hinge.v = {W * std::cos(b)};
  SystemSpec spec = system({first, second});
  LoopSpec cross;
  cross.name = "cross", cross.type = "universal";
  cross.from.body = "first", cross.to.body = "second";
  cross.params = along({Z, Y});
  spec.loops = {cross};
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
    spec.loop_form = form;
    const std::string by = form == LoopForm::embedding ? "embedded: " : "multipliers: ";
    const auto sim = run_of(spec, "dop853");
    double rate_off = 0.0, torque_off = 0.0, most = 0.0, least = HUGE_VAL;
    sim->every({1, 100}, [&] {
      const double angle = W * sim->time(), c = std::sin(angle), s = std::sin(b), D = 1.0 - s * s * c * c, rate = W * std::cos(b) / D,
                   accel = rate / D * 2.0 * s * s * c * std::cos(angle) * W;
      rate_off = worse(rate_off, std::abs(sim->state().v[1] - rate));
      std::vector<double> drive(2);
      sim->drive_forces(drive.data());
      torque_off = worse(torque_off, std::abs(drive[0] - J * rate * accel / W));
    });
    for (const int turns : {1, 2, 3, 4}) {
      sim->run(0.5 * std::numbers::pi / W * turns);
      most = std::max(most, sim->state().v[1]), least = std::min(least, sim->state().v[1]);
    }
    expect_within(by + "rate along the way", rate_off, ref.tolerance("rate_abs"));
    expect_within(by + "torque along the way", torque_off, ref.tolerance("torque_abs"));
    expect_vector(by + "largest and least rate", Eigen::Vector2d(most, least), ref.vector("largest and least rate"),
                  ref.tolerance("rate_abs"));
  }
}

TEST(PanelsOnCables, UnfoldInStepAndLock) {
  const Published ref("loop-panels-on-cables");
  const double l = ref.model()["panel_length_m"].as<double>(), m = ref.model()["panel_mass_kg"].as<double>(), I = m * l * l / 12.0,
               start = ref.initial()["q_rad"].as<double>();
  SystemSpec spec;
  for (int i = 0; i < 3; ++i) {
    BodySpec panel =
        on(rigid(fmt::format("panel_{}", i), m, 0.5 * l * X, diagonal({0.2 * I, I, I})), i == 0 ? "" : fmt::format("panel_{}", i - 1),
           "revolute", {Z}, i == 0 ? Vector3d(Vector3d::Zero()) : Vector3d(l * X));
    panel.hinge.springs = {{0, 5.0, 0.0, 0.0, {}}};
    panel.hinge.q = {i == 0 ? start : (i == 1 ? -2.0 : 2.0) * start};
    spec.bodies.push_back(panel);
  }
  spec.loops = {coupling("inner", {{"panel_1", 1.0, {}}, {"panel_0", 2.0, {}}}),
                coupling("outer", {{"panel_2", 1.0, {}}, {"panel_1", 1.0, {}}})};
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
    spec.loop_form = form;
    const std::string by = form == LoopForm::embedding ? "embedded: " : "multipliers: ";
    SystemSpec latched = spec;
    for (BodySpec& panel : latched.bodies) panel.hinge.locked = true;
    for (LoopSpec& cable : latched.loops) cable.open = true;
    const auto sim = run_of(spec, "dop853");
    double flat = 0.0, rate = 0.0;
    crossings(
        *sim, -1, [](const double* q, const double*) { return q[0]; },
        [&] {
          if (flat == 0.0) flat = sim->time(), rate = sim->state().v[0];
          sim->adopt([&] { return rejoin(*sim, latched, registry(), {}); }, "latched");
        });
    sim->run(1.01 * ref.number("time to flat"));
    expect_absolute(by + "time to flat", flat, ref.number("time to flat"), ref.tolerance("time_abs"));
    expect_relative(by + "rate when flat", rate, ref.number("rate of the first panel"), ref.tolerance("rate_rel"));
    EXPECT_EQ(sim->model().nv, 0);
  }
}

}  // namespace
}  // namespace cardan::test
