// Fields of families: gravity by way of the table against the one that is built into the sweeps, and what devices read.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "core/abi/device_family.hpp"
#include "core/abi/field_family.hpp"
#include "core/abi/field_laws.hpp"
#include "core/abi/param_values.hpp"
#include "core/sim/reference_check.hpp"
#include "core/soa/field_pull.hpp"
#include "core/soa/tangent.hpp"
#include "tests/properties/loaded_simulation.hpp"
#include "tests/properties/random_devices.hpp"

namespace cardan::test {
namespace {

using Eigen::Vector3d;

FieldSpec field(const std::string& name, const std::string& type, const std::vector<std::pair<std::string, double>>& numbers = {}) {
  FieldSpec f;
  f.name = name, f.type = type;
  for (const auto& [key, x] : numbers) f.params[key] = number(x);
  return f;
}

/// The gravity of a centre by way of a field.
SystemSpec by_field(SystemSpec spec) {
  const GravitySpec g = spec.gravity;
  spec.fields.push_back(field("attractor", "point_mass", {{"mu", g.mu}}));
  spec.fields.back().params["centre"].value = std::vector<double>(g.centre.data(), g.centre.data() + 3);
  spec.gravity = {};
  spec.gravity.kind = GravitySpec::Kind::field;
  spec.gravity.fields = {"attractor"};
  spec.gravity.gradient = g.gradient;
  return spec;
}
RandomTree by_field(RandomTree tree) {
  tree.spec = by_field(tree.spec);
  return tree;
}

std::vector<TreeOptions> trees_about_a_centre() {
  std::vector<TreeOptions> all;
  for (const int level : {0, 1, 2})
    for (const bool gradient : {false, true}) {
      all.push_back(
          {.bodies = 5, .flexible = 0.5, .level = level, .locked = 0.1, .gravity = GravitySpec::Kind::central, .gradient = gradient});
      all.push_back(
          {.bodies = 6, .flexible = 0.0, .wheels = 0.5, .locked = 0.2, .gravity = GravitySpec::Kind::central, .gradient = gradient});
    }
  return all;
}

// The force of second order, some 1e-3 of the weight here, comes from differences that are good to 1e-9 of it.
TEST(FieldGravity, OfAPointIsThatOfACentre) {
  for (const TreeOptions& options : trees_about_a_centre())
    for_all_trees(
        options, 1e-10,
        [](const RandomTree& tree) {
          Loaded central(tree), fielded(by_field(tree));
          const VectorXd a = central.forward(), b = fielded.forward();
          Observer here(*central.model, central.ws), there(*fielded.model, fielded.ws);
          here.update(central.in(), a.data()), there.update(fielded.in(), b.data());
          double worst = worse(apart(b, a), apart(fielded.inverse(a), central.inverse(a)));
          worst = worse(worst, std::abs(here.energy().gravity / there.energy().gravity - 1.0));
          for (std::size_t i = 0; i < central.model->user.size(); ++i)
            worst =
                worse(worst, apart(to_eigen(there.hinge_wrench(static_cast<int>(i))), to_eigen(here.hinge_wrench(static_cast<int>(i)))));
          for (std::size_t i = 0; i < central.model->nodes.size(); ++i)
            worst = worse(worst, apart(there.node(static_cast<int>(i)).specific_force, here.node(static_cast<int>(i)).specific_force, 1.0));
          return worst;
        },
        8);
}

/// Trees that the sweeps and the twin take alike: the field is expanded about the mass centre of a body, and bodies that are locked to
/// rigid ones are one with them in the sweeps.
TreeOptions apart_in_a_field() {
  TreeOptions options{.bodies = 4, .flexible = 0.4, .level = 1, .gravity = GravitySpec::Kind::central, .gradient = true};
  std::erase(options.hinges, "locked");
  return options;
}

TEST(FieldGravity, AgreesWithTheDenseTwin) {
  for_all_trees(
      apart_in_a_field(), 1e-9,
      [](const RandomTree& tree) {
        Simulation sim(compiled(by_field(tree.spec)), {});
        double difference = 0.0;
        reference_output(sim).fill(&difference);
        return difference;
      },
      8);
}

/// A potential that does not depend on time is in the energy.
TEST(FieldGravity, BalanceMatchesPower) {
  for (const int level : {0, 1})
    for_all_trees(
        {.bodies = 4, .flexible = 0.5, .level = level, .gravity = GravitySpec::Kind::central, .gradient = true}, 0.0,
        [](const RandomTree& tree) {
          SimulationOptions options;
          options.integrator.relative_tolerance = 1e-10;
          options.integrator.method = "dopri5";
          Simulation sim(compiled(by_field(tree.spec), {.world_wrenches = true}), options);
          set_loads(sim, tree);
          sim.run(0.4);
          return sim.ledger().pass ? 0.0 : 1.0;
        },
        4);
}

/// J dx of what BDF asks, in a field and with devices that read fields, against differences of the right-hand side.
double jacobian_error_in_field(const SystemSpec& spec, const Registry& types = registry()) {
  SimulationOptions options;
  options.integrator.method = "cvode_bdf";
  options.integrator.linear_solver = "krylov";
  options.ledger = false;
  Simulation sim(compile(spec, types), options);
  const OdeProblem ode = sim.ode();
  VectorXd x(ode.n), d(ode.n), truth(ode.n), work(ode.n), out(ode.n);
  x << sim.state().q, sim.state().v, sim.state().z;
  for (int i = 0; i < ode.n; ++i) d[i] = std::sin(2.7 * i + 0.3);
  soa::derivative(
      [&](double h, double* to) {
        const VectorXd at = x + h * d;
        if (!ode.rhs(0.2, at.data(), to)) throw std::runtime_error("breakdown");
      },
      0.004, ode.n, truth.data(), work.data());
  if (!ode.jacobian_times(0.2, x.data(), d.data(), out.data())) throw std::runtime_error("breakdown");
  return apart(out, truth);
}

TEST(FieldGravity, TakesPartInTheJacobian) {
  for (const TreeOptions& options : trees_about_a_centre())
    for_all_trees(
        options, 1e-8, [](const RandomTree& tree) { return jacobian_error_in_field(by_field(tree.spec)); }, 4);
}

/// An attractor that runs along x, prepared once for a time; with a potential and without, with gradients and without.
template <unsigned kFacts>
struct Runner {
  static constexpr const char *type = "runner", *summary = "an attractor that runs along x";
  static constexpr std::uint32_t quantity = CARDAN_GRAVITY;
  static constexpr unsigned facts = kFacts;
  static constexpr cardan_limit_desc limits[] = {{"near", 0, "nearer than 0.1 m"}};
  struct Packed {
    double mu, y;
  };
  struct Prepared {
    double x;
  };
  static constexpr cardan_param_desc schema[] = {param::required("mu", CARDAN_NUMBER, "m^3/s^2", "gravitational parameter"),
                                                 param::optional("y", CARDAN_NUMBER, "m", "where it runs")};
  static bool pack(const Params& params, Packed& p) {
    p = {params.number("mu"), params.number("y")};
    return true;
  }
  static int prepare(const Packed&, double t, Prepared& out) noexcept {
    out = {2.0 * t};
    return 0;
  }
  static int beyond(const Packed& p, const FieldPoint<Runner, double>& at) noexcept {
    const Vec3<double> d = at.x - Vec3<double>{at.prepared->x, p.y, 0.0};
    return dot(d, d) < 0.01 ? 1 : 0;
  }
  template <class T>
  static void evaluate(const Packed& p, const FieldPoint<Runner, T>& at, T* out) noexcept {
    using std::sqrt;
    const Vec3<T> d = at.x - Vec3<T>{T(at.prepared->x), T(p.y), T(0.0)};
    const T r2 = dot(d, d), r = sqrt(r2);
    const Vec3<T> a = (T(-p.mu) / (r2 * r)) * d;
    out[0] = a.x, out[1] = a.y, out[2] = a.z, out[3] = facts & CARDAN_FIELD_POTENTIAL ? T(-p.mu) / r : T(0.0);
  }
};

template <unsigned kFacts>
Registry with_runner(bool gradients = true) {
  static const cardan_field_family with = field_table<Runner<kFacts>>();
  static const cardan_field_family without = [] {
    cardan_field_family table = with;
    table.facts &= ~static_cast<unsigned>(CARDAN_FIELD_GRADIENT);
    return table;
  }();
  Registry all = registry();
  all.fields.add(gradients ? with : without);
  return all;
}

/// Quadratic in the place: the pull on masses is that of second order to round-off. With sources and curl, or the slope of a potential
/// without either.
template <bool kHarmonic>
struct Quadratic {
  static constexpr const char *type = "quadratic", *summary = "gravity that is quadratic in the place";
  static constexpr std::uint32_t quantity = CARDAN_GRAVITY;
  static constexpr unsigned facts = kHarmonic ? CARDAN_FIELD_POTENTIAL | CARDAN_FIELD_SOURCE_FREE | CARDAN_FIELD_CURL_FREE : 0;
  struct Packed {};
  template <class T>
  static void evaluate(const Packed&, const FieldPoint<Quadratic, T>& at, T* out) noexcept {
    const T &x = at.x.x, &y = at.x.y, &z = at.x.z;
    if constexpr (kHarmonic) {  // of -U = x y z + x^3 - 3 x y^2 + z^3 - 3 z x^2 + 2 x
      out[0] = y * z + T(3.0) * x * x - T(3.0) * y * y - T(6.0) * z * x + T(2.0);
      out[1] = x * z - T(6.0) * x * y;
      out[2] = x * y + T(3.0) * z * z - T(3.0) * x * x;
      out[3] = -(x * y * z + x * x * x - T(3.0) * x * y * y + z * z * z - T(3.0) * z * x * x + T(2.0) * x);
    } else {
      out[0] = x * x + T(2.0) * y * z - T(0.5) * z * z + T(1.0);
      out[1] = T(3.0) * x * y - z * z + T(0.7) * y * y;
      out[2] = T(0.3) * x * z + T(1.1) * y * y + T(2.0) * z * z - x;
      out[3] = T(0.0);
    }
  }
};

template <bool kHarmonic>
double pull_on_masses_error() {
  const cardan_field_family& family = field_table<Quadratic<kHarmonic>>();
  EXPECT_TRUE(field_law_violations(family).empty());
  FieldSource source;
  source.family = &family, source.packed.assign(1, 0.0);
  GravityField g;
  g.source = &source;
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  double worst = 0.0;
  for (int trial = 0; trial < 20; ++trial) {
    Eigen::Matrix<double, 3, 5> place;
    Eigen::Matrix<double, 5, 1> mass;
    for (double& x : place.reshaped()) x = number(random);
    for (double& m : mass) m = 1.5 + number(random);
    const double m = mass.sum();
    const Vector3d centre = place * mass / m;
    const Eigen::Matrix3d S = (place.colwise() - centre) * mass.asDiagonal() * (place.colwise() - centre).transpose();
    const double body[soa::detail::kBodyNumbers] = {m,       centre.x(), centre.y(), centre.z(), S(0, 0),
                                                    S(1, 1), S(2, 2),    S(0, 1),    S(0, 2),    S(1, 2)};
    double out[soa::detail::kPullNumbers];
    soa::detail::pull(g, nullptr, body, out);
    Vector3d force = Vector3d::Zero();
    for (int i = 0; i < 5; ++i) {
      const Vector3d x = place.col(i);
      const cardan_field_args args{sizeof args, 0.0, source.packed.data(), nullptr};
      double a[4];
      family.evaluate(&args, 1, x.data(), a, nullptr);
      force += mass[i] * Vector3d(a);
    }
    worst = worse(worst, (Eigen::Map<const Vector3d>(out) - force).norm() / force.norm());
  }
  return worst;
}
/// By differences of a slope over 1e-5 of a length: 1e-11 and what rounding leaves of a length that is small, some hundredfold.
TEST(FieldGravity, OfSecondOrderIsThatOfMasses) {
  EXPECT_LE(pull_on_masses_error<true>(), 1e-9);
  EXPECT_LE(pull_on_masses_error<false>(), 1e-9);
}

/// Along what changes ever slower, as by the flow of a valve that was shut: the derivative is linear in the rate as far down as numbers go.
TEST(FieldGravity, OfAFlowThatHasFadedStaysANumber) {
  const auto model = compiled(by_field(random_tree(3, {.bodies = 2, .gravity = GravitySpec::Kind::central, .gradient = true}).spec));
  const double body[soa::detail::kBodyNumbers] = {50.0, 7e6, 1e5, -3e5, 12.0, 7.0, 5.0, 1.0, -2.0, 0.5};
  const double rate[soa::detail::kBodyNumbers] = {-3.0, 0.02, -0.01, 0.03, 0.4, -0.2, 0.1, 0.02, 0.03, -0.01};
  const auto along = [&](double scale) {
    double slower[soa::detail::kBodyNumbers];
    std::array<double, soa::detail::kPullNumbers> out;
    for (int i = 0; i < soa::detail::kBodyNumbers; ++i) slower[i] = scale * rate[i];
    soa::detail::pull_along(model->field, nullptr, body, slower, out.data());
    return out;
  };
  const auto one = along(1.0), slow = along(1e-60);
  for (std::size_t i = 0; i < one.size(); ++i) EXPECT_LE(std::abs(1e60 * slow[i] - one[i]), 1e-12 * std::abs(one[i])) << i;
  for (const double scale : {1e-120, 1e-280, 1e-302, 1e-307, 1e-320})
    for (const double x : along(scale)) EXPECT_LE(std::abs(x), 1e-50) << scale;
}

/// Its work is from outside, with a potential and without: the ledger closes.
template <unsigned kFacts>
void expect_work_from_outside(const RandomTree& tree) {
  SystemSpec spec = tree.spec;
  spec.fields = {field("attractor", "runner", {{"mu", 4000.0}, {"y", 20.0}})};
  spec.gravity.kind = GravitySpec::Kind::field;
  spec.gravity.fields = {"attractor"};
  SimulationOptions options;
  options.integrator.relative_tolerance = 1e-10;
  options.integrator.method = "dopri5";
  Simulation sim(compile(spec, with_runner<kFacts>(kFacts != 0)), options);
  sim.run(0.5);
  EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy;
  EXPECT_EQ(sim.energy().gravity, 0.0);
}
TEST(FieldGravity, ThatDependsOnTimeWorksFromOutside) {
  for (const unsigned seed : {3U, 4U, 5U})
    for (const int level : {1, 2}) {  // of 2 the inertia is quadratic in the modes
      const RandomTree tree = random_tree(seed, {.bodies = 4, .flexible = 0.5, .level = level, .gravity = GravitySpec::Kind::none});
      expect_work_from_outside<CARDAN_FIELD_POTENTIAL>(tree);
      expect_work_from_outside<0>(tree);
    }
}

/// Of two centres, the mass of one apart in two fields, against the whole in one and beside a third field that is the rest of it: the sum
/// is linear, so that {a, b} pulls as {a}, {b} and no gravity do together.
TEST(FieldGravity, OfSeveralFieldsIsTheirSum) {
  for (const TreeOptions& options : trees_about_a_centre())
    for_all_trees(
        options, 1e-9,
        [](const RandomTree& tree) {
          RandomTree both = by_field(tree), one = both, other = both, none = both;
          FieldSpec second = field("second", "point_mass", {{"mu", 0.7 * tree.spec.gravity.mu}});
          const Vector3d place = tree.spec.gravity.centre + 0.3 * Vector3d(1.0, -2.0, 0.5);
          second.params["centre"].value = std::vector<double>(place.data(), place.data() + 3);
          both.spec.fields.push_back(second), both.spec.gravity.fields.emplace_back("second");
          other.spec.fields = {second}, other.spec.gravity.fields = {"second"};
          none.spec.gravity = {};
          Loaded sum(both), a(one), b(other), c(none);
          const VectorXd vdot = sum.forward();
          const VectorXd tau = sum.inverse(vdot), parts = a.inverse(vdot) + b.inverse(vdot) - c.inverse(vdot);
          Observer of_sum(*sum.model, sum.ws), of_a(*a.model, a.ws), of_b(*b.model, b.ws);
          of_sum.update(sum.in(), vdot.data()), of_a.update(a.in(), vdot.data()), of_b.update(b.in(), vdot.data());
          const double energy = of_a.energy().gravity + of_b.energy().gravity;
          return worse(apart(tau, parts), std::abs(of_sum.energy().gravity / energy - 1.0));
        },
        6);
}
TEST(FieldGravity, OfSeveralFieldsAgreesWithTheDenseTwin) {
  for_all_trees(
      apart_in_a_field(), 1e-9,
      [](const RandomTree& tree) {
        SystemSpec spec = by_field(tree.spec);
        spec.fields.push_back(field("runner", "runner", {{"mu", 0.3 * tree.spec.gravity.mu}, {"y", 20.0}}));
        spec.gravity.fields.emplace_back("runner");
        Simulation sim(compile(spec, with_runner<CARDAN_FIELD_POTENTIAL>()), {});
        double difference = 0.0;
        reference_output(sim).fill(&difference);
        return worse(difference, sim.energy().gravity == 0.0 ? 0.0 : 1.0);  // one of them changes in time: work from outside
      },
      4);
}
/// A steady field beside one that runs, and one without gradients of its own: prepared, differenced, its limits behind those of the others.
TEST(FieldGravity, OfSeveralFieldsHasWhatItsPartsHave) {
  SystemSpec spec = system({on(rigid("stone", 2.0, {0, 0, 0}, diagonal({1e-6, 1e-6, 1e-6})), "", "free")});
  spec.bodies[0].hinge.q = {1, 0, 0, 0, 3.0, 4.0, 0.0};
  spec.fields = {field("fixed", "point_mass", {{"mu", 30.0}}), field("attractor", "runner", {{"mu", 50.0}}),
                 field("below", "runner", {{"mu", 10.0}, {"y", -2.0}})};
  spec.gravity.kind = GravitySpec::Kind::field;
  spec.gravity.fields = {"fixed", "attractor", "below"};
  for (const bool gradients : {true, false}) {
    const auto model = compile(spec, with_runner<CARDAN_FIELD_POTENTIAL>(gradients));
    const FieldSource& sum = *model->field.source;
    EXPECT_EQ(model->fields.back().name, "fixed + attractor + below");
    EXPECT_EQ(sum.family->facts & (CARDAN_FIELD_GRADIENT | CARDAN_FIELD_POTENTIAL | CARDAN_FIELD_STEADY),
              static_cast<unsigned>(CARDAN_FIELD_POTENTIAL) | (gradients ? static_cast<unsigned>(CARDAN_FIELD_GRADIENT) : 0U));
    ASSERT_EQ(sum.family->n_limits, 2U);
    EXPECT_STREQ(sum.family->limits[1].name, "below: near");
    Simulation sim(model, {});
    State state = sim.state();
    state.t = 1.5;  // both are at x = 3
    sim.set_state(state);
    EXPECT_NEAR(sim.vdot()[4], -30.0 * 4.0 / 125.0 - 50.0 / 16.0 - 10.0 / 36.0, 1e-12);
    EXPECT_NEAR(sim.vdot()[3], -30.0 * 3.0 / 125.0, 1e-12);
    const double nearby[3] = {3.0, -2.05, 0.0};
    FieldMoments moments(*model);
    const FieldMoment& now = moments.at(field_of_gravity(*model), 1.5);
    double values[4], slopes[12];
    EXPECT_EQ(soa::ask_field(sum, now, 1, nearby, values, slopes), 2);
  }
}

/// Where one of several holds, the warning stands where gravity names them: the sum has no key of its own.
TEST(FieldGravity, OfSeveralFieldsTellsWhichOfThemHolds) {
  static constexpr cardan_limit_desc kHolds[] = {{"near", 1, "nearer than 0.1 m"}};
  static const cardan_field_family holding = [] {
    cardan_field_family table = field_table<Runner<CARDAN_FIELD_POTENTIAL>>();
    table.limits = kHolds;
    return table;
  }();
  Registry all = registry();
  all.fields.add(holding);
  SystemSpec spec = system({on(rigid("stone", 2.0, {0, 0, 0}, diagonal({1e-6, 1e-6, 1e-6})), "", "free")});
  spec.bodies[0].hinge.q = {1, 0, 0, 0, 3.0, 4.05, 0.0};
  spec.fields = {field("fixed", "point_mass", {{"mu", 1e-6}}), field("attractor", "runner", {{"mu", 1e-6}, {"y", 4.0}})};
  spec.fields[1].hold = true;
  spec.gravity.kind = GravitySpec::Kind::field;
  spec.gravity.fields = {"fixed", "attractor"};
  Simulation sim(compile(spec, all), {});
  sim.every({1, 100}, [&] { sim.observe(); });
  sim.run(1.5);  // both are at x = 3
  ASSERT_EQ(sim.warnings().all().size(), 1u);
  const Diagnostic& told = sim.warnings().all()[0].what;
  EXPECT_EQ(told.code, Code::field_held);
  EXPECT_EQ(told.at.key_path, "gravity.field");
  EXPECT_NE(told.about.find("(attractor: near)"), std::string::npos) << told.about;
}

/// A free particle in the field of the runner, by a formula: a = -mu d / d^3 at the time of the run.
TEST(FieldGravity, IsThatOfTheTime) {
  SystemSpec spec = system({on(rigid("stone", 2.0, {0, 0, 0}, diagonal({1e-6, 1e-6, 1e-6})), "", "free")});
  spec.bodies[0].hinge.q = {1, 0, 0, 0, 3.0, 4.0, 0.0};
  spec.fields = {field("attractor", "runner", {{"mu", 50.0}})};
  spec.gravity.kind = GravitySpec::Kind::field;
  spec.gravity.fields = {"attractor"};
  Simulation sim(compile(spec, with_runner<CARDAN_FIELD_POTENTIAL>()), {});
  State state = sim.state();
  state.t = 1.5;  // it is at x = 3
  sim.set_state(state);
  EXPECT_NEAR(sim.vdot()[4], -50.0 / 16.0, 1e-12);
  EXPECT_NEAR(sim.vdot()[3], 0.0, 1e-12);
}

std::string failure(Simulation& sim, double t_end, Code code) {
  try {
    sim.run(t_end);
  } catch (const NumericsError& e) {
    EXPECT_EQ(e.failure().code, code);
    return e.failure().what;
  }
  return "it ran";
}

TEST(FieldGravity, BeyondItsLimitEndsTheRunByName) {
  SystemSpec spec = system({on(rigid("stone", 2.0, {0, 0, 0}, diagonal({1e-6, 1e-6, 1e-6})), "", "free")});
  spec.bodies[0].hinge.q = {1, 0, 0, 0, 1.0, 0.0, 0.0};  // it is overrun
  spec.fields = {field("attractor", "runner", {{"mu", 1e-6}})};
  spec.gravity.kind = GravitySpec::Kind::field;
  spec.gravity.fields = {"attractor"};
  Simulation sim(compile(spec, with_runner<CARDAN_FIELD_POTENTIAL>()), {});
  EXPECT_EQ(failure(sim, 1.0, Code::field_failed),
            "field attractor (runner) at stone: attractor is asked beyond its limit near: nearer than 0.1 m");
  EXPECT_GT(sim.time(), 0.4);
}

BodySpec satellite(double radius, const Vector3d& velocity = {0, 0, 0}) {
  BodySpec bus = on(rigid("bus", 100.0, {0, 0, 0}, diagonal({20, 25, 30})), "", "free");
  bus.hinge.q = {std::sqrt(0.5), 0.5, 0, 0.5, radius, 0, 0};
  bus.hinge.v = {0.1, -0.2, 0.3, velocity[0], velocity[1], velocity[2]};
  NodeSpec node;
  node.name = "tip", node.position = {0.4, -0.2, 0.1};
  bus.nodes = {node};
  return bus;
}

/// f = a - g at the node, whatever gives g.
TEST(FieldsOfDevices, AnImuInAFieldReadsWhatItReadsAboutACentre) {
  SystemSpec central = system({satellite(7e6, {0, 7546, 0})}, central_gravity(3.986004415e14, true));
  central.devices = {device("imu", "imu", {}, {{"at", "bus.tip"}})};
  central.devices[0].rate = 10.0;
  SimulationOptions options;
  options.integrator.relative_tolerance = 1e-11;
  Simulation a(compiled(central), options), b(compiled(by_field(central)), options);
  a.run(1.0), b.run(1.0);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(a.device_output(i), b.device_output(i), 1e-8) << i;  // 8 m/s^2 of gravity cancel
  EXPECT_GT(std::abs(b.device_output(3)) + std::abs(b.device_output(4)), 1e-3);
}

/// 1 kg/m^3 for |x| < 1 m, held up to 2 m, unknown beyond; from t = 3 s on unknown everywhere.
struct Box {
  static constexpr const char *type = "box", *summary = "air in a box";
  static constexpr std::uint32_t quantity = CARDAN_DENSITY;
  static constexpr unsigned facts = 0;
  static constexpr cardan_limit_desc limits[] = {{"wall", 1, "out of the box"}, {"far", 0, "far away"}, {"late", 0, "after the end"}};
  struct Packed {};
  struct Prepared {
    double none;
  };
  static int prepare(const Packed&, double t, Prepared& out) noexcept {
    out = {};
    return t > 3.0 ? 4 : 0;
  }
  static int beyond(const Packed&, const FieldPoint<Box, double>& at) noexcept {
    return (std::abs(at.x.x) > 1.0 ? 1 : 0) | (std::abs(at.x.x) > 2.0 ? 2 : 0);
  }
  template <class T>
  static void evaluate(const Packed&, const FieldPoint<Box, T>&, T* out) noexcept {
    out[0] = T(1.0);
  }
};
/// The same limits of a gravity of -1 m/s^2 along y.
struct Plank : Box {
  static constexpr const char* type = "plank";
  static constexpr std::uint32_t quantity = CARDAN_GRAVITY;
  static int beyond(const Packed& p, const FieldPoint<Plank, double>& at) noexcept { return Box::beyond(p, {at.t, at.x, nullptr}); }
  template <class T>
  static void evaluate(const Packed&, const FieldPoint<Plank, T>&, T* out) noexcept {
    out[0] = out[2] = out[3] = T(0.0), out[1] = T(-1.0);
  }
};
struct Epoch {
  static constexpr const char *type = "epoch", *summary = "time from an epoch";
  static constexpr std::uint32_t quantity = CARDAN_TIME;
  static constexpr unsigned facts = 0;
  struct Packed {};
  template <class T>
  static void evaluate(const Packed&, const FieldPoint<Epoch, T>& at, T* out) noexcept {
    out[0] = T(at.t + 1000.0);
  }
};
/// Tells the density; nothing hangs on it.
struct Barometer {
  static constexpr const char *type = "barometer", *summary = "the density of the air at a node";
  static constexpr unsigned facts = 0;
  struct Packed {};
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_POSE, "where"},
                                                 {"air", CARDAN_MOUNT_FIELD, CARDAN_DENSITY, "air"}};
  static constexpr cardan_port_desc ports[] = {{"density", CARDAN_PORT_OUT, "kg/m^3", 0.0, 0, "of the air"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.out[0] = in.at[1].field[0];
  }
};
/// Rings at 1002 s of the epoch.
struct Alarm {
  static constexpr const char *type = "alarm", *summary = "rings at a time";
  static constexpr unsigned facts = 0;
  struct Packed {};
  static constexpr cardan_mount_desc mounts[] = {{"clock", CARDAN_MOUNT_FIELD, CARDAN_TIME, "the time"}};
  static constexpr cardan_port_desc ports[] = {{"rings", CARDAN_PORT_OUT, "1", 0.0, 0, "since"}};
  static constexpr cardan_state_desc marks[] = {{"since", "s", 0.0, 1.0, "when it began to ring"}};
  static constexpr std::uint32_t n_roots = 1;
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.out[0] = T(in.d[0]);
  }
  static void roots(const Packed&, const DeviceIn<double>& in, double* g) noexcept { g[0] = in.at[0].field[0] - 1002.0; }
  static void event(const Packed&, const DeviceIn<double>& in, std::uint32_t root, int, double*, double* d) noexcept {
    if (root == 0) d[0] = in.t;
  }
};

const Registry& with_limits() {
  static const Registry types = [] {
    Registry all = registry();
    all.fields.add(field_table<Box>()), all.fields.add(field_table<Plank>()), all.fields.add(field_table<Epoch>());
    all.devices.add(device_table<Barometer>()), all.devices.add(device_table<Alarm>());
    return all;
  }();
  return types;
}

/// At 1 m/s along x from the origin.
SystemSpec thrown() {
  BodySpec stone = on(rigid("stone", 2.0, {0, 0, 0}, diagonal({1e-6, 1e-6, 1e-6})), "", "free");
  stone.hinge.v = {0, 0, 0, 1, 0, 0};
  return system({stone});
}

TEST(Fields, OfGravityEndARunBeyondEachLimitThatIsNotHeld) {
  SystemSpec spec = thrown();
  spec.fields = {field("floor", "plank")};
  spec.gravity.kind = GravitySpec::Kind::field, spec.gravity.fields = {"floor"};
  for (const std::string method : {"rk4", "dopri5", "cvode_adams", "cvode_bdf"}) {
    SimulationOptions options;
    options.integrator.method = method;
    if (method == "rk4") options.integrator.fixed_step = 0.01;
    spec.fields[0].hold = false;
    Simulation refused(compile(spec, with_limits()), options);
    EXPECT_EQ(failure(refused, 10.0, Code::field_failed),
              "field floor (plank) at stone: floor is asked beyond its limit wall: out of the box")
        << method;
    EXPECT_NEAR(refused.time(), 1.0, 0.02) << method;
    spec.fields[0].hold = true;
    Simulation held(compile(spec, with_limits()), options);
    EXPECT_EQ(failure(held, 10.0, Code::field_failed), "field floor (plank) at stone: floor is asked beyond its limit far: far away")
        << method;
    EXPECT_NEAR(held.time(), 2.0, 0.02) << method;
    SystemSpec slow = spec;
    slow.bodies[0].hinge.v[3] = 0.1;
    Simulation late(compile(slow, with_limits()), options);
    EXPECT_EQ(failure(late, 10.0, Code::field_failed), "field floor (plank) at stone: floor is asked beyond its limit late: after the end")
        << method;
    EXPECT_NEAR(late.time(), 3.0, 0.02) << method;
  }
}

/// Also where nothing hangs on what it tells, and of several readers the one that is beyond.
TEST(FieldsOfDevices, BlameTheReaderThatIsBeyond) {
  SystemSpec spec = thrown();
  BodySpec rock = on(rigid("rock", 2.0, {0, 0, 0}, diagonal({1e-6, 1e-6, 1e-6})), "", "free");
  spec.bodies.push_back(rock);
  spec.fields = {field("air", "box")};
  for (const std::string type : {"barometer", "drag"}) {
    const std::vector<std::pair<std::string, double>> area = {{"area", 1e-12}};
    const auto at = [&](const std::string& name, const std::string& body) {
      return device(name, type, type == "drag" ? area : decltype(area){}, {{"at", body}});
    };
    spec.devices = {at("a", "rock"), at("b", "stone"), at("c", "rock")};
    Simulation sim(compile(spec, with_limits()), {});
    sim.every({1, 10}, [&] { sim.observe(); });
    EXPECT_EQ(failure(sim, 2.0, Code::device_failed), "device b (" + type + "): air is asked beyond its limit wall: out of the box");
    EXPECT_NEAR(sim.time(), 1.0, 0.11);
  }
}

/// Readers in steps and between them hold as one.
TEST(FieldsOfDevices, HeldForOneReaderIsHeld) {
  SystemSpec spec = thrown();
  spec.bodies.push_back(on(rigid("rock", 2.0, {0, 0, 0}, diagonal({1e-6, 1e-6, 1e-6})), "", "free"));
  spec.fields = {field("air", "box")}, spec.fields[0].hold = true;
  spec.devices = {device("drag", "drag", {{"area", 1e-12}}, {{"at", "stone"}}), device("far", "barometer", {}, {{"at", "rock"}})};
  Simulation sim(compile(spec, with_limits()), {});
  sim.run(1.5);
  sim.observe();
  EXPECT_EQ(sim.warnings().all().size(), 1U);
}

TEST(FieldsOfDevices, OfTimeReachRoots) {
  SystemSpec spec = thrown();
  spec.fields = {field("clock", "epoch")};
  spec.devices = {device("alarm", "alarm", {}, {})};
  Simulation sim(compile(spec, with_limits()), {});
  sim.run(5.0);
  EXPECT_NEAR(sim.device_output(0), 2.0, 1e-12);
}

/// Its own devices and fields take part in J dx: torque of coils, drag.
TEST(FieldsOfDevices, TakePartInTheJacobian) {
  SystemSpec spec = system({satellite(2.0, {0.3, -0.4, 0.5})});
  spec.fields = {field("earth", "dipole", {{"strength", 3.0}}),
                 field("air", "exponential_atmosphere",
                       {{"density", 0.5}, {"radius", 1e6}, {"height", -1e6}, {"lowest", -1e7}, {"scale_height", 1e3}})};
  spec.devices = {device("rods", "magnetorquer", {{"max_moment", 30.0}}, {{"at", "bus.tip"}}),
                  device("drag", "drag", {{"area", 2.0}}, {{"at", "bus.tip"}})};
  spec.devices[0].inputs["moment_x"] = {5.0, {}};
  spec.devices[0].inputs["moment_z"] = {-3.0, {}};
  EXPECT_LT(jacobian_error_in_field(spec), 1e-9);
}

TEST(FieldsOfDevices, DragTakesWhatItsFormulaSays) {
  SystemSpec spec = system({satellite(6878.137e3, {0, 7600, 0})});
  spec.bodies[0].hinge.v = {0, 0, 0, 0, 7600, 0};
  spec.fields = {field("air", "exponential_atmosphere", {{"density", 2e-12}})};
  spec.devices = {device("drag", "drag", {{"area", 3.0}, {"coefficient", 2.0}}, {{"at", "bus"}})};
  Simulation sim(compiled(spec), {});
  const double rho = 2e-12 * std::exp(-100e3 / 58.515e3);
  EXPECT_NEAR(sim.device_output(0) / rho, 1.0, 1e-12);
  EXPECT_NEAR(sim.vdot()[4] / (-0.5 * rho * 2.0 * 3.0 * 7600.0 * 7600.0 / 100.0), 1.0, 1e-12);
}

/// Each reads a field where it is: of several devices in one, with a number or a vector, none what another one reads.
TEST(FieldsOfDevices, AreReadWhereEachReaderIs) {
  const std::vector<double> radii = {6.9e6, 6.96e6, 7.05e6};
  SystemSpec spec = system({});
  spec.fields = {field("air", "exponential_atmosphere", {{"density", 2e-12}}), field("earth", "dipole")};
  for (const double r : radii) {
    const std::string name = "stone_" + std::to_string(spec.bodies.size());
    spec.bodies.push_back(on(rigid(name, 2.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "free"));
    spec.bodies.back().hinge.q = {1, 0, 0, 0, r, 0, 0}, spec.bodies.back().hinge.v = {0, 0, 0, 0, 7600, 0};
    spec.devices.push_back(device("drag_of_" + name, "drag", {{"area", 3.0}}, {{"at", name}}));
    spec.devices.push_back(device("rod_of_" + name, "magnetorquer", {{"max_moment", 30.0}}, {{"at", name}}));
    spec.devices.back().inputs["moment_x"] = {20.0, {}};
  }
  Simulation sim(compiled(spec), {});
  const VectorXd vdot = sim.vdot();
  for (std::size_t k = 0; k < radii.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(6 * k);
    EXPECT_NEAR(vdot[i + 4] / vdot[4], std::exp((radii[0] - radii[k]) / 58.515e3), 1e-12);
    EXPECT_NEAR(vdot.segment<3>(i).norm() / vdot.head<3>().norm(), std::pow(radii[0] / radii[k], 3), 1e-12);
  }
  EXPECT_LT(vdot[4], -1e-6);
  EXPECT_GT(vdot.head<3>().norm(), 1e-5);
}

/// What flies with the air feels none of it; what stands still in a planet's air that turns is blown along.
TEST(FieldsOfDevices, DragKnowsAirThatTurnsWithItsPlanet) {
  const double r = 6878.137e3, omega = 7.292115e-5;
  const auto acceleration = [&](const Vector3d& v) {
    SystemSpec spec = system({satellite(r, v)});
    spec.bodies[0].hinge.v = {0, 0, 0, v.x(), v.y(), v.z()};
    spec.fields = {field("air", "exponential_atmosphere", {{"density", 2e-12}}), field("wind", "co_rotating_wind")};
    spec.devices = {device("drag", "drag", {{"area", 3.0}, {"coefficient", 2.0}}, {{"at", "bus"}, {"wind", "wind"}})};
    Simulation sim(compiled(spec), {});
    return Vector3d(sim.vdot().segment<3>(3));
  };
  const double rho = 2e-12 * std::exp(-100e3 / 58.515e3);
  EXPECT_LT(acceleration({0, omega * r, 0}).norm(), 1e-24);
  const Vector3d still = acceleration({0, 0, 0}), orbiting = acceleration({0, 7600, 0});
  EXPECT_NEAR(still.y() / (0.5 * rho * 2.0 * 3.0 * std::pow(omega * r, 2) / 100.0), 1.0, 1e-12);
  EXPECT_NEAR(orbiting.y() / (-0.5 * rho * 2.0 * 3.0 * std::pow(7600.0 - omega * r, 2) / 100.0), 1.0, 1e-12);
}

/// The sphere that falls on a windy day: drag is along the air's velocity past it, which is another one at another height.
TEST(FieldsOfDevices, DragKnowsWindsOnAPlanetAndTheirShear) {
  const double R = 6.1e6, rate = 3e-4, latitude = 0.6, longitude = -1.1, h = 9e3;
  const Vector3d axis = Vector3d(0.3, -0.2, 0.9).normalized(), centre(2e5, -1e5, 3e5);
  const Vector3d x0 = axis.cross(Vector3d::UnitX()).normalized(), y0 = axis.cross(x0);
  const Vector3d out = std::cos(longitude) * x0 + std::sin(longitude) * y0, east = std::cos(longitude) * y0 - std::sin(longitude) * x0;
  const Vector3d up = std::cos(latitude) * out + std::sin(latitude) * axis, north = std::cos(latitude) * axis - std::sin(latitude) * out;
  const Vector3d x = centre + (R + h) * up, v(-3.0, 8.0, -60.0);
  const auto acceleration = [&](double more_east, double more_north, double east_shear, double north_shear) {
    SystemSpec spec = system({satellite(0.0)});
    spec.bodies[0].hinge.q = {1, 0, 0, 0, x.x(), x.y(), x.z()};
    spec.bodies[0].hinge.v = {0, 0, 0, v.x(), v.y(), v.z()};
    FieldSpec wind = field("wind", "co_rotating_wind",
                           {{"rate", rate},
                            {"east", more_east},
                            {"north", more_north},
                            {"east_shear", east_shear},
                            {"north_shear", north_shear},
                            {"radius", R}});
    for (const auto& [key, a] : {std::pair("axis", axis), std::pair("centre", centre)})
      wind.params[key].value = std::vector<double>{a.x(), a.y(), a.z()};
    spec.fields = {field("air", "exponential_atmosphere", {{"density", 1.2}, {"radius", 1e6}, {"height", x.norm() - 1e6}}), wind};
    spec.devices = {device("drag", "drag", {{"area", 0.3}, {"coefficient", 0.5}}, {{"at", "bus"}, {"wind", "wind"}})};
    Simulation sim(compiled(spec), {});
    return Vector3d(sim.vdot().segment<3>(3));
  };
  for (const auto& [e, n, de, dn] :
       {std::array{0.0, 0.0, 0.0, 0.0}, std::array{30.0, -12.0, 0.0, 0.0}, std::array{-6.0, 4.0, 3e-3, -2e-3}}) {
    const Vector3d air = rate * (R + h) * std::cos(latitude) * east + (e + de * h) * east + (n + dn * h) * north, past = v - air;
    const Vector3d want = -0.5 * 1.2 * 0.5 * 0.3 * past.norm() * past / 100.0;
    EXPECT_LE((acceleration(e, n, de, dn) - want).norm(), 1e-11 * want.norm()) << e << " " << n << " " << de << " " << dn;
  }
}

/// A sphere takes E A C_R / c along the light; a plate what falls on it, and what it throws back.
TEST(FieldsOfDevices, LightPressesOnSpheresAndPlates) {
  const double E = 1361.0, c = 299792458.0, A = 3.0;
  const Vector3d towards = Vector3d(0.3, -0.5, 0.8).normalized(), n = Vector3d(-0.2, 0.4, 0.7).normalized();
  const auto force = [&](std::vector<std::pair<std::string, double>> numbers, const Vector3d& normal, bool plate = true,
                         bool both = false) {
    SystemSpec spec = system({satellite(7e6, {0, 0, 0})});
    FieldSpec sun = field("sun", "sunlight", {{"irradiance", E}, {"radius", 0.0}});
    sun.params["direction"].value = std::vector<double>{towards.x(), towards.y(), towards.z()};
    spec.fields = {sun};
    numbers.emplace_back("area", A);
    spec.devices = {device("pressure", "radiation_pressure", numbers, {{"at", "bus"}})};
    spec.devices[0].params["shape"].value = std::string(plate ? "plate" : "sphere");
    spec.devices[0].params["both_sides"].value = both;
    const Vector3d of_body = quaternion(spec.bodies[0].hinge.q.data()).inverse() * normal;
    spec.devices[0].params["normal"].value = std::vector<double>{of_body.x(), of_body.y(), of_body.z()};
    Simulation sim(compiled(spec), {});
    return Vector3d(100.0 * sim.vdot().segment<3>(3));
  };
  const double P = E / c, s = n.dot(towards), tiny = 1e-14 * P * A;
  EXPECT_LE((force({{"coefficient", 1.5}}, n, false) + 1.5 * P * A * towards).norm(), tiny);
  EXPECT_LE((force({}, n) + P * A * s * towards).norm(), tiny);
  EXPECT_LE((force({{"specular", 1.0}}, n) + 2.0 * P * A * s * s * n).norm(), tiny);
  EXPECT_LE((force({{"diffuse", 1.0}}, n) + P * A * s * (towards + 2.0 / 3.0 * n)).norm(), tiny);
  EXPECT_EQ(force({{"specular", 0.4}}, -n).norm(), 0.0);
  EXPECT_LE((force({{"specular", 0.4}, {"diffuse", 0.3}}, -n, true, true) - force({{"specular", 0.4}, {"diffuse", 0.3}}, n)).norm(), tiny);
  EXPECT_NO_THROW(force({{"specular", 0.6}, {"diffuse", 0.4}}, n));
  EXPECT_THROW(force({{"specular", 0.6}, {"diffuse", 0.5}}, n), InputError);
}

/// U by Legendre polynomials of another hand; that the pull is its slope is a law of fields.
TEST(ZonalHarmonics, HaveThePotentialOfTheirSeries) {
  const cardan_field_family& f = *registry().field("zonal_harmonics");
  const double mu = 398600.4418e9, a = 6378.137e3;
  const Vector3d axis = Vector3d(0.3, -0.2, 0.9).normalized(), centre(1e5, -2e5, 3e5), x(4e6, -5e6, 3.5e6);
  const double r = (x - centre).norm(), s = (x - centre).dot(axis) / r;
  for (int n = 2; n <= 6; ++n) {
    ParamTable values;
    values.numbers = {
        {"mu", {mu}}, {"radius", {a}}, {"axis", {axis.x(), axis.y(), axis.z()}}, {"centre", {centre.x(), centre.y(), centre.z()}}};
    for (int k = 2; k <= 6; ++k) values.numbers[fmt::format("J{}", k)] = {k == n ? 1e-3 * k : 0.0};
    std::vector<double> packed(f.params_size / sizeof(double) + 1);
    const cardan_param_values view = values.view();
    ASSERT_EQ(f.pack(&view, packed.data()), 0);
    const cardan_field_args args{sizeof args, 0.0, packed.data(), nullptr};
    double value[4];
    ASSERT_EQ(f.evaluate(&args, 1, x.data(), value, nullptr), 0);
    const double U = -mu / r * (1.0 - 1e-3 * n * std::pow(a / r, n) * std::legendre(static_cast<unsigned>(n), s));
    EXPECT_NEAR(value[3] / U, 1.0, 1e-15) << n;
  }
}

/// On a line across the shadow of the Earth, against the overlap of two discs by quadrature.
TEST(Sunlight, IsThePartOfTheDiscThatIsSeen) {
  const cardan_field_family& f = *registry().field("sunlight");
  const double R = 6378.137e3, a = 4.6524e-3, E = 1361.0, behind = 7e6;
  ParamTable values;
  values.numbers = {{"irradiance", {E}}, {"direction", {-1, 0, 0}}, {"radius", {R}}, {"disc", {a}}, {"centre", {0, 0, 0}}};
  std::vector<double> packed(f.params_size / sizeof(double) + 1);
  const cardan_param_values view = values.view();
  ASSERT_EQ(f.pack(&view, packed.data()), 0);
  const auto light = [&](double beside) {
    const cardan_field_args args{sizeof args, 0.0, packed.data(), nullptr};
    const double x[3] = {behind, beside, 0.0};
    double value[3];
    EXPECT_EQ(f.evaluate(&args, 1, x, value, nullptr), 0);
    EXPECT_EQ(value[1], 0.0);
    return value[0];
  };
  const auto edges = [&](double beside) {
    const cardan_field_args args{sizeof args, 0.0, packed.data(), nullptr};
    const double x[3] = {behind, beside, 0.0};
    Eigen::Vector2d g;
    EXPECT_EQ(f.edges(&args, x, g.data()), 2u);
    EXPECT_EQ(g[0] > 0.0, light(beside) == E) << beside;
    EXPECT_EQ(g[1] < 0.0, light(beside) == 0.0) << beside;
    return g;
  };
  EXPECT_EQ(light(0.0), 0.0);
  EXPECT_EQ(light(0.9 * R), 0.0);
  EXPECT_EQ(light(1.1 * R), E);
  for (const double x : {0.1, 0.5, 0.9, 0.99, 1.001, 1.01, 1.1}) edges(x * R);
  EXPECT_NEAR((edges(1.1 * R) - edges(1.1 * R + 1e3))[0],
              std::acos(behind / std::hypot(behind, 1.1 * R)) - std::acos(behind / std::hypot(behind, 1.1 * R + 1e3)) -
                  std::asin(R / std::hypot(behind, 1.1 * R)) + std::asin(R / std::hypot(behind, 1.1 * R + 1e3)),
              1e-14);
  int in_penumbra = 0;
  for (int i = -40; i <= 40; ++i) {
    const double beside = R + 1e3 * i, r = std::hypot(behind, beside), b = std::asin(R / r), c = std::acos(behind / r);
    constexpr int kStrips = 20000;
    double hidden = 0.0;
    for (int k = 0; k < kStrips; ++k) {
      const double u = a * (2.0 * (k + 0.5) / kStrips - 1.0);  // towards the planet
      const double of_sun = std::sqrt(a * a - u * u), of_planet = std::sqrt(std::max(0.0, b * b - (c - u) * (c - u)));
      hidden += 2.0 * std::min(of_sun, of_planet) * 2.0 * a / kStrips;
    }
    const double wanted = 1.0 - hidden / (M_PI * a * a);
    edges(beside);
    EXPECT_NEAR(light(beside) / E, wanted, 1e-5) << beside;  // of strips of a half circle: their number to -1.5
    in_penumbra += wanted > 0.01 && wanted < 0.99;
  }
  EXPECT_GT(in_penumbra, 20);
}

/// Two into the shadow of the Earth and two out of it, where the light pushes; of two vehicles their own; none where it is only looked at,
/// or nothing throws a shadow.
TEST(FieldsOfDevices, EdgesOfAShadowEndSteps) {
  const double r = 6778.137e3, mu = 398600.4418e9, period = 2.0 * M_PI * std::sqrt(r * r * r / mu);
  const auto orbiting = [&](const std::string& name, double angle) {
    BodySpec b = on(rigid(name, 250.0, {0, 0, 0}, diagonal({20, 25, 30})), "", "free");
    const double v = std::sqrt(mu / r), c = std::cos(angle), s = std::sin(angle);
    b.hinge.q = {1, 0, 0, 0, r * c, r * s, 0}, b.hinge.v = {0, 0, 0, -v * s, v * c, 0};
    return b;
  };
  const auto restarts = [&](const std::string& method, int vehicles, const std::string& type, double radius) {
    std::vector<BodySpec> bodies;
    for (int i = 0; i < vehicles; ++i) bodies.push_back(orbiting(fmt::format("sat{}", i), 0.1 * i));
    SystemSpec spec = system(bodies, central_gravity(mu, false));
    spec.fields = {field("sun", "sunlight", {{"radius", radius}})};
    spec.fields[0].params["direction"].value = std::vector<double>{1.0, 0.0, 0.1};
    for (int i = 0; i < vehicles; ++i)
      for (const char* side : {"a", "b"}) {
        spec.devices.push_back(device(fmt::format("{}{}", side, i), type, {}, {{"at", fmt::format("sat{}", i)}}));
        if (type == "radiation_pressure")
          spec.devices.back().params = {{"area", number(3.0)}};
        else
          spec.devices.back().rate = 0.001;
      }
    SimulationOptions options;
    options.integrator.method = method, options.integrator.relative_tolerance = 1e-8;
    if (method == "rk4") options.integrator.fixed_step = 20.0;
    Simulation sim(compiled(spec), options);
    sim.run(period);
    return sim.statistics().restarts;
  };
  for (const char* method : {"dop853", "dopri5", "cvode_adams", "rk4"}) {
    EXPECT_EQ(restarts(method, 1, "radiation_pressure", 6378.137e3), 5) << method;
    EXPECT_EQ(restarts(method, 2, "radiation_pressure", 6378.137e3), 9) << method;
    EXPECT_EQ(restarts(method, 1, "radiation_pressure", 0.0), 1) << method;
    EXPECT_EQ(restarts(method, 1, "coarse_sun_sensor", 6378.137e3), 1) << method;
  }
}

// Of two discs one of which is far larger, its edge is straight: the part of the smaller one beyond it is (acos u - u sqrt(1 - u^2)) / pi,
// u the distance of its middle from the edge over its radius, but for the ratio of the radii.
TEST(Sunlight, KeepsItsDigitsBehindDiscsOfAnySize) {
  const cardan_field_family& f = *registry().field("sunlight");
  for (const auto& [a, R] : {std::pair(1e-6, 6378.137e3), {1e-4, 6378.137e3}, {4.6524e-3, 50.0}, {0.3, 200.0}}) {
    ParamTable values;
    values.numbers = {{"irradiance", {1.0}}, {"direction", {-1, 0, 0}}, {"radius", {R}}, {"disc", {a}}, {"centre", {0, 0, 0}}};
    std::vector<double> packed(f.params_size / sizeof(double) + 1);
    const cardan_param_values view = values.view();
    ASSERT_EQ(f.pack(&view, packed.data()), 0);
    const double far = 7e6, b = std::asin(R / far), small = std::min(a, b), large = std::max(a, b);
    for (const double u : {-0.99, -0.5, -0.1, 0.0, 0.3, 0.7, 0.99}) {
      const double c = large + u * small, x[3] = {far * std::cos(c), far * std::sin(c), 0.0};
      const cardan_field_args args{sizeof args, 0.0, packed.data(), nullptr};
      double value[3], beyond = (std::acos(u) - u * std::sqrt(1.0 - u * u)) / std::numbers::pi;
      ASSERT_EQ(f.evaluate(&args, 1, x, value, nullptr), 0);
      const double hidden = a < b ? beyond : beyond * b * b / (a * a);
      EXPECT_NEAR(value[0], 1.0 - hidden, (a < b ? 1.0 : b * b / (a * a)) * small / large + 1e-9 * std::min(1.0, 1e-6 / a))
          << a << " " << u;
    }
  }
}

// There the cosine of the angle between Sun and planet is 1, and rounding may carry it beyond.
TEST(Sunlight, IsDarkInTheMiddleOfTheShadow) {
  const cardan_field_family& f = *registry().field("sunlight");
  std::vector<double> packed(f.params_size / sizeof(double) + 1);
  std::mt19937_64 rng(1);
  for (int i = 0; i < 1000; ++i) {
    const auto any = [&] { return -1.0 + 2.0 * static_cast<double>(rng() >> 11) * 0x1.0p-53; };
    const double a = any(), b = any(), c = any();
    const Vector3d sun = Vector3d(a, b, c).normalized();
    ParamTable values;
    values.numbers = {{"irradiance", {1361.0}},
                      {"direction", {sun[0], sun[1], sun[2]}},
                      {"radius", {6378.137e3}},
                      {"disc", {4.6524e-3}},
                      {"centre", {0, 0, 0}}};
    const cardan_param_values view = values.view();
    ASSERT_EQ(f.pack(&view, packed.data()), 0);
    const cardan_field_args args{sizeof args, 0.0, packed.data(), nullptr};
    for (const double side : {-1.0, 1.0}) {
      const Vector3d x = side * 7e6 * sun;
      Vector3d light;
      Eigen::Matrix3d gradient;
      ASSERT_EQ(f.evaluate(&args, 1, x.data(), light.data(), gradient.data()), 0);
      EXPECT_TRUE(light == (side < 0.0 ? Vector3d::Zero().eval() : Vector3d(-1361.0 * sun))) << i << " " << side << "\n" << light;
      EXPECT_TRUE(gradient.isZero(0.0)) << i << " " << side << "\n" << gradient;
    }
  }
}

TEST(FieldsOfDevices, BeyondTheirLimitsAreRefusedOrHeld) {
  SystemSpec spec = system({satellite(6778.137e3, {-1000, 0, 0})});
  spec.fields = {field("air", "exponential_atmosphere", {{"density", 2e-12}, {"lowest", 399.5e3}})};
  spec.devices = {device("drag", "drag", {{"area", 3.0}}, {{"at", "bus"}})};
  Simulation refused(compiled(spec), {});
  EXPECT_EQ(failure(refused, 2.0, Code::device_failed),
            "device drag (drag): air is asked beyond its limit lowest: below the lowest height of the atmosphere");
  EXPECT_NEAR(refused.time(), 0.5, 0.6);  // within a step
  spec.fields[0].hold = true;
  Simulation held(compiled(spec), {});
  held.every({1, 10}, [&] { held.observe(); });
  held.run(2.0);
  EXPECT_NEAR(held.device_output(0) / (2e-12 * std::exp(0.5e3 / 58.515e3)), 1.0, 1e-12);
  ASSERT_EQ(held.warnings().all().size(), 1u);
  EXPECT_EQ(held.warnings().all()[0].what.code, Code::field_held);
  EXPECT_NE(held.warnings().all()[0].what.about.find("air holds what it has at the end of what it knows (lowest)"), std::string::npos);
}

/// Above `highest` what holds is the density there.
TEST(FieldsOfDevices, HoldAtEitherEnd) {
  SystemSpec spec = system({satellite(6778.137e3)});
  spec.fields = {field("air", "exponential_atmosphere", {{"density", 2e-12}, {"highest", 380e3}})};
  spec.fields[0].hold = true;
  spec.devices = {device("drag", "drag", {{"area", 3.0}}, {{"at", "bus"}})};
  Simulation held(compiled(spec), {});
  EXPECT_NEAR(held.device_output(0) / (2e-12 * std::exp(20e3 / 58.515e3)), 1.0, 1e-12);
}

TEST(Fields, ThatAreNotThereAreRefusedByName) {
  SystemSpec spec = system({satellite(7e6)});
  spec.devices = {device("rods", "magnetorquer", {{"max_moment", 30.0}}, {{"at", "bus"}})};
  EXPECT_NE(refusal(spec).find("none of the quantity magnetic field in `fields`"), std::string::npos) << refusal(spec);
  spec.fields = {field("a", "dipole"), field("b", "dipole"), field("air", "exponential_atmosphere", {{"density", 1e-12}})};
  EXPECT_NE(refusal(spec).find("several, and no such key"), std::string::npos) << refusal(spec);
  spec.devices[0].mounts["field"] = {"air", {}};
  EXPECT_NE(refusal(spec).find("\"air\", which is of the quantity density of the air"), std::string::npos) << refusal(spec);
  spec.devices[0].mounts["field"] = {"b", {}};
  EXPECT_EQ(refusal(spec), "it compiled");
  spec.gravity.kind = GravitySpec::Kind::field;
  spec.gravity.fields = {"a"};
  EXPECT_NE(refusal(spec).find("a field of the quantity gravity, of which there is none"), std::string::npos) << refusal(spec);
  spec.gravity = {};
  spec.fields[0].hold = true;
  EXPECT_NE(refusal(spec).find("this field has no limits"), std::string::npos) << refusal(spec);
  spec.fields[0] = field("a", "dipol");
  EXPECT_NE(refusal(spec).find("did you mean \"dipole\""), std::string::npos) << refusal(spec);
}

/// What is not there costs nothing: no op, the same bits.
TEST(Fields, ThatNobodyReadsChangeNoBit) {
  const RandomTree tree = random_tree(11, {});
  SystemSpec with = tree.spec;
  with.fields = {field("earth", "dipole"), field("moon", "point_mass", {{"mu", 1.0}})};
  Loaded a(tree);
  RandomTree more = tree;
  more.spec = with;
  Loaded b(more);
  EXPECT_EQ(a.model->program.size(), b.model->program.size());
  EXPECT_TRUE(a.forward() == b.forward());
}

/// The dipole of a plugin, from the same source, gives the bits of the one that is built in.
TEST(Fields, OfAPluginGiveTheSameBits) {
  Registry types = registry();
  load_plugin(CARDAN_BINARY_DIR "/plugins/twins.so", types);
  const auto end = [&](const std::string& dipole, const std::string& mass) {
    SystemSpec spec = system({satellite(7e6, {0, 7546, 0})});
    spec.fields = {field("earth", dipole), field("pull", mass, {{"mu", 3.986004415e14}})};
    spec.gravity.kind = GravitySpec::Kind::field;
    spec.gravity.fields = {"pull"};
    spec.devices = {device("rods", "magnetorquer", {{"max_moment", 30.0}}, {{"at", "bus.tip"}})};
    spec.devices[0].inputs["moment_x"] = {5.0, {}};
    Simulation sim(compile(spec, types), {});
    sim.run(5.0);
    return VectorXd((VectorXd(13) << sim.state().q, sim.state().v).finished());
  };
  EXPECT_TRUE(end("dipole", "point_mass") == end("twin/dipole", "twin/point_mass"));
}

}  // namespace
}  // namespace cardan::test
