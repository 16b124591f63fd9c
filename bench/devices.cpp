// What devices cost in a right-hand side:  cardan-bench-devices [--seconds S]
// The spacecraft of 28 velocities with and without devices, in turn in one run: bytes and nanoseconds of one device of each type, mean of
// ten of them; hinges, bodies, fields and devices of a plugin made of the same sources (--plugin); ten frictions and four thrusters;
// devices between two nodes far from the origin of the world; and how the same is solved (error of v' against the dense twin in 113 bits
// where devices act). --fields: what fields cost at a point.
#include <fmt/format.h>

#include <fstream>

#include "bench/bench_model.hpp"
#include "bench/command_line.hpp"
#include "bench/time_ring.hpp"
#include "bodies/register.hpp"
#include "core/abi/device_family.hpp"
#include "core/abi/device_laws.hpp"
#include "core/abi/param_values.hpp"
#include "core/sim/reference_check.hpp"
#include "core/sim/simulation.hpp"
#include "hinges/register.hpp"
#include "plugins/devices/register.hpp"

namespace cardan::bench {
namespace {

/// `count` devices of this type on the nodes and hinges of the model, one after the other.
SystemSpec with(SystemSpec spec, const Model& bare, const cardan_device_family& family, int count) {
  std::vector<std::string> nodes, hinges, bodies;
  for (const UserBody& u : bare.user)
    if (u.n_modes == 0) bodies.push_back(u.name);
  for (const UserNode& n : bare.nodes) nodes.push_back(n.name);
  for (const UserBody& u : bare.user)
    if (u.nv == 1) hinges.push_back(u.name);
  for (std::uint32_t k = 0; k < family.n_mounts; ++k)
    if (family.mounts[k].kind == CARDAN_MOUNT_FIELD && family.mounts[k].use == CARDAN_MAGNETIC)
      spec.fields.push_back({"magnetic", "dipole", {}, false, {}});
    else if (family.mounts[k].kind == CARDAN_MOUNT_FIELD && family.mounts[k].use == CARDAN_DENSITY)
      spec.fields.push_back(
          {"air", "exponential_atmosphere", {{"density", {1.0, {}}}, {"height", {-7e6, {}}}, {"lowest", {-7e6, {}}}}, false, {}});
    else if (family.mounts[k].kind == CARDAN_MOUNT_FIELD && family.mounts[k].use == CARDAN_LIGHT)
      spec.fields.push_back({"sun", "sunlight", {{"direction", {std::vector<double>{0.0, 0.6, 0.8}, {}}}}, false, {}});
  for (int i = 0; i < count; ++i) {
    DeviceSpec d;
    d.name = fmt::format("{}_{}", family.type, i);
    d.type = family.type;
    for (std::uint32_t k = 0; k < family.n_params; ++k) {
      const cardan_param_desc& p = family.params[k];
      if ((p.flags & CARDAN_REQUIRED) == 0) continue;
      if (p.kind == CARDAN_NUMBER)
        d.params[p.name] = {1.0 + k, {}};
      else if (p.kind == CARDAN_CHOICE)
        d.params[p.name] = {std::string("sphere"), {}};  // of contact
      else if (p.kind == CARDAN_TABLE) {
        std::vector<double> rows;  // of which the first column grows
        for (std::uint32_t j = 0; j < 4 * p.count; ++j) rows.push_back(j % p.count == 0 ? j / p.count + 1.0 : 0.1 * (j % p.count));
        d.params[p.name] = {rows, {}};
      } else
        d.params[p.name] = {std::vector<double>{0.0, 0.6, 0.8}, {}};
    }
    if (std::string_view(family.type) == "contact") d.params["from_radius"] = d.params["to_radius"] = {1e-3, {}};  // which do not touch
    if (std::string_view(family.type) == "tape_spring") d.params["steady_moment"] = {0.1, {}};
    for (std::uint32_t k = 0; k < family.n_mounts; ++k) {
      const std::uint32_t kind = family.mounts[k].kind;
      if (kind == CARDAN_MOUNT_FIELD) continue;  // the one of its quantity
      const auto& places = kind == CARDAN_MOUNT_NODE ? nodes : kind == CARDAN_MOUNT_MASS ? bodies : hinges;
      d.mounts[family.mounts[k].name] = {places[(static_cast<std::size_t>(i) + 3 * k) % places.size()], {}};
    }
    if (family.tick) d.rate = 100.0;
    for (std::uint32_t k = 0; k < family.n_ports; ++k)
      if (family.ports[k].kind == CARDAN_PORT_IN) d.inputs[family.ports[k].name] = {0.5, {}};
    spec.devices.push_back(std::move(d));
  }
  return spec;
}

/// Right-hand sides over the states of the ring; the simulation must outlive it.
class RightHandSides {
 public:
  RightHandSides(const SystemSpec& spec, const Registry& registry, const std::vector<BenchState>& states)
      : sim_(compile(spec, registry, {.node_wrenches = false}), without_ledger()), ode_(sim_.ode()), xdot_(ode_.n) {
    for (const BenchState& s : states) {
      Eigen::VectorXd x(ode_.n);
      x << s.q, s.v, Eigen::VectorXd::Constant(sim_.state().z.size(), 0.01);
      x_.push_back(std::move(x));
    }
  }
  double nanoseconds(double seconds) {
    return time_ring(static_cast<int>(x_.size()), seconds,
                     [this](int k) { ode_.rhs(0.0, x_[static_cast<std::size_t>(k)].data(), xdot_.data()); })
        .min_ns;
  }
  std::size_t bytes() const { return sim_.workspace_bytes(); }
  double error() {
    double x = 0.0;
    reference_output(sim_).fill(&x);
    return x;
  }

 private:
  static SimulationOptions without_ledger() {
    SimulationOptions o;
    o.ledger = false;
    return o;
  }
  Simulation sim_;
  OdeProblem ode_;
  std::vector<Eigen::VectorXd> x_;
  Eigen::VectorXd xdot_;
};

/// The least of both over rounds in turn: what the machine does besides meets both.
std::pair<double, double> in_turn(RightHandSides& a, RightHandSides& b, double seconds) {
  double least_a = 1e30, least_b = 1e30;
  for (int round = 0; round < 5; ++round)
    least_a = std::min(least_a, a.nanoseconds(seconds)), least_b = std::min(least_b, b.nanoseconds(seconds));
  return {least_a, least_b};
}

/// A chain of ten rigid bodies on universal hinges: types of hinges that a step asks for their records.
BenchModel chain_of_universals() {
  BenchModel model;
  model.name = "10 bodies on universal hinges";
  constexpr int kBodies = 10;
  for (int i = 0; i < kBodies; ++i) {
    BodySpec b;
    b.name = fmt::format("b{}", i);
    b.mass = 2.0, b.com = {0.5, 0.1, 0}, b.inertia_com = Eigen::Vector3d(0.1, 0.3, 0.35).asDiagonal();
    b.hinge.type = "universal";
    b.hinge.params["axes"] = {std::vector<double>{0, 0, 1, 0, 1, 0}, {}};
    if (i > 0) b.hinge.inboard_body = fmt::format("b{}", i - 1), b.hinge.onode_position = {1, 0, 0};
    model.spec.bodies.push_back(std::move(b));
  }
  for (int k = 0; k < 8; ++k) {
    const Eigen::VectorXd x =
        Eigen::VectorXd::NullaryExpr(2 * kBodies, [k](Eigen::Index i) { return std::sin(2.7 * static_cast<double>(i) + k); });
    model.states.push_back({x, 0.5 * x, {}, {}});
  }
  return model;
}

/// Pulled by a field of this type.
SystemSpec pulled_by(SystemSpec spec, const std::string& type) {
  spec.fields = {{"pull", type, {{"mu", {4e14, {}}}, {"centre", {std::vector<double>{7e6, 0, 0}, {}}}}, false, {}}};
  spec.gravity.kind = GravitySpec::Kind::field, spec.gravity.fields = {"pull"};
  return spec;
}

/// The same with twins in place of the hinges, or of the bodies, that are built in.
SystemSpec with_twin_hinges(SystemSpec spec, const Registry& registry) {
  for (BodySpec& b : spec.bodies)
    if (registry.hinge("twin/" + b.hinge.type)) b.hinge.type = "twin/" + b.hinge.type;
  return spec;
}
SystemSpec with_twin_bodies(SystemSpec spec, const Registry& registry) {
  for (BodySpec& b : spec.bodies)
    if (registry.body("twin/" + b.type)) b.type = "twin/" + b.type;
  return spec;
}

/// Of every field that there is, harmonics to several degrees: nanoseconds at a point, for what it makes of a new time once for all points,
/// and how far the divergence of gravity and magnetic fields is from 0, of its largest part.
int fields(double seconds) {
  Registry registry;
  register_devices(registry);  // and fields
  fmt::print("| {:<53} | {:>10} | {:>18} | {:>12} | {:>10} |\n|---|---:|---:|---:|---:|\n", "field at a point", "values, ns",
             "with gradients, ns", "new time, ns", "divergence");
  const auto row = [&](const cardan_field_family& f, int degree, const std::string& stands) {
    ParamTable values;
    for (std::uint32_t i = 0; i < f.n_params; ++i) {
      const cardan_param_desc& d = f.params[i];
      const bool three = d.kind == CARDAN_VECTOR || d.kind == CARDAN_UNIT_VECTOR;
      values.numbers[d.name].assign(d.fallback, d.fallback + (three ? 3 : 1));
      if ((d.flags & CARDAN_REQUIRED) != 0) values.numbers[d.name] = {1e-3};
      if (d.name == std::string_view("epoch")) values.texts["epoch"] = "2026-11-26T12:00:00 UTC";
      if (d.name == std::string_view("body")) values.numbers["body"] = {1.0};  // the Moon
    }
    if (f.type == std::string_view("polyhedron")) {  // Eros, as large as a planet or a tenth of that
      std::ifstream file(CARDAN_SOURCE_DIR "/tests/reference/data/gravity/eros_shape_856.txt");
      values.bytes["shape"].assign(std::istreambuf_iterator<char>(file), {});
      values.texts["shape"] = "eros_shape_856.txt", values.numbers["unit"] = {stands.empty() ? 1e5 : 1e4};
    }
    if (stands == "with shear") values.numbers["east"] = {10.0}, values.numbers["east_shear"] = {1e-3};
    if (stands == "mars") values.numbers["orientation"] = {7.0}, values.numbers["rate"] = {7.088218e-5};
    if (stands.starts_with("iau2006")) values.numbers["orientation"] = {1.0}, values.numbers["rate"] = {7.292115e-5};
    if (stands.ends_with("bulletin")) {
      std::string& days = values.bytes["bulletin"] = "mjd,x,y,ut1_utc\n";
      for (int mjd = 61360; mjd < 61400; ++mjd) days += fmt::format("{},0.1,0.3,0.05\n", mjd);
      values.texts["bulletin"] = "days";
    }
    if (f.type != std::string_view("third_body")) values.numbers["mu"] = {4e14};
    values.numbers["coefficients"].clear();
    if (f.quantity == CARDAN_GRAVITY) values.numbers["radius"] = {6378e3};
    values.numbers["f107"] = {150.0};
    values.numbers["table"] = {0.0, 1.2, 100e3, 5e-7, 500e3, 1e-12, 1000e3, 1e-15};
    for (int n = f.quantity == CARDAN_MAGNETIC ? 1 : 2; n <= degree; ++n)  // of the size that Kaula found
      for (int m = 0; m <= n; ++m)
        for (const double x : {1.0 * n, 1.0 * m, 1e-5 * std::sin(7.0 * n + m) / (n * n), 1e-5 * std::cos(5.0 * n - m) / (n * n)})
          values.numbers["coefficients"].push_back(x);
    if (f.quantity == CARDAN_MAGNETIC) {
      std::vector<double> with_rates;
      const std::vector<double>& rows = values.numbers["coefficients"];
      for (std::size_t i = 0; i < rows.size(); i += 4) {
        with_rates.insert(with_rates.end(), rows.begin() + static_cast<std::ptrdiff_t>(i),
                          rows.begin() + static_cast<std::ptrdiff_t>(i) + 4);
        with_rates.insert(with_rates.end(), 2, 1e-17);
      }
      values.numbers["coefficients"] = with_rates;
    }
    const cardan_param_values view = values.view();
    std::vector<double> packed((f.packed_size ? f.packed_size(&view) : f.params_size) / sizeof(double) + 1);
    std::vector<double> prepared(f.prepared_size / sizeof(double) + 1);
    if (f.pack && f.pack(&view, packed.data()) != 0)
      throw std::runtime_error(fmt::format("{}: {}", f.type, values.failures.front().expected));
    if (f.prepare) f.prepare(0.0, packed.data(), prepared.data());
    const cardan_field_args args{sizeof args, 0.0, packed.data(), f.prepare ? prepared.data() : nullptr};
    constexpr int kPoints = 16;
    double points[kPoints][3], value[CARDAN_FIELD_NUMBERS], gradient[3 * CARDAN_FIELD_NUMBERS], worst = 0.0;
    for (int k = 0; k < kPoints; ++k)
      for (int j = 0; j < 3; ++j) points[k][j] = 3.9e6 * (1.0 + 0.2 * std::sin(3.0 * k + j)) * (j == k % 3 ? -1.0 : 1.0);
    double least[2] = {1e30, 1e30};
    for (int round = 0; round < 5; ++round)
      for (const bool with : {false, true})
        least[with] = std::min(least[with], time_ring(kPoints, seconds / 5.0, [&](int k) {
                                              f.evaluate(&args, 1, points[k], value, with ? gradient : nullptr);
                                            }).min_ns);
    const double anew =
        f.prepare ? time_ring(kPoints, seconds / 5.0, [&](int k) { f.prepare(1000.0 * k, packed.data(), prepared.data()); }).min_ns : 0.0;
    const bool told = f.quantity == CARDAN_GRAVITY || f.quantity == CARDAN_MAGNETIC;
    for (int k = 0; told && k < kPoints; ++k) {
      f.evaluate(&args, 1, points[k], value, gradient);
      double most = 0.0;
      for (int i = 0; i < 9; ++i) most = std::max(most, std::abs(gradient[i]));
      worst = std::max(worst, std::abs(gradient[0] + gradient[4] + gradient[8]) / most);
    }
    fmt::print("| {:<39} | {:>10.0f} | {:>18.0f} | {:>12} | {:>10} |\n",
               f.type + (degree > 0 ? fmt::format(", degree {}", degree) : "") + (stands.empty() ? "" : ", " + stands), least[0], least[1],
               f.prepare ? fmt::format("{:.0f}", anew) : "", told ? fmt::format("{:.1e}", worst) : "");
  };
  for (const auto& [family, origin] : registry.fields.all()) {
    const std::string_view type = family->type;
    const std::vector<int> degrees = type == "spherical_harmonics"  ? std::vector<int>{4, 8, 20, 70, 120}
                                     : type == "magnetic_harmonics" ? std::vector<int>{13}
                                                                    : std::vector<int>{0};
    for (const int degree : degrees) row(*family, degree, "");
    for (const char* stands : {"iau2006", "iau2006 by a bulletin", "mars"})
      if (type == "spherical_harmonics") row(*family, degrees.front(), stands);
    if (type == "polyhedron") row(*family, 0, "far away");
    if (type == "co_rotating_wind") row(*family, 0, "with shear");
  }
  return 0;
}

int run(double seconds, const std::string& plugin) {
  Registry registry;
  register_hinges(registry), register_bodies(registry), register_devices(registry);
  const BenchModel bm = read_model(CARDAN_SOURCE_DIR "/tests/reference/bench/spacecraft.json");
  const auto bare = compile(bm.spec, registry);
  RightHandSides without(bm.spec, registry, bm.states);
  constexpr int kTen = 10;
  fmt::print("| {:<35} | {:>8} | {:>8} | {:>10} | {:>8} |\n|---|---:|---:|---:|---:|\n", bm.name, "bare, ns", "with, ns", "of one, ns",
             "bytes");
  const auto row = [&](const std::string& name, const SystemSpec& spec, int count) {
    RightHandSides has(spec, registry, bm.states);
    const auto [least, more] = in_turn(without, has, seconds);
    fmt::print("| {:<35} | {:>8.0f} | {:>8.0f} | {:>10.1f} | {:>8.0f} |\n", name, least, more, (more - least) / count,
               static_cast<double>(has.bytes() - without.bytes()) / count);
    return more / least;
  };
  for (const auto& [family, origin] : registry.devices.all())
    row(fmt::format("{} {}", kTen, family->type), with(bm.spec, *bare, *family, kTen), kTen);
  for (const auto& [family, origin] : registry.devices.all()) {  // as in an orbit: places of both nodes are counted from what carries them
    if (!reads_between_nodes(*family) || family->mounts[0].kind != CARDAN_MOUNT_NODE) continue;
    SystemSpec flying = with(bm.spec, *bare, *family, kTen);
    for (BodySpec& b : flying.bodies)
      if (b.hinge.inboard_body.empty()) b.hinge.onode_position.x() += 7e6;
    row(fmt::format("{} {}, 7000 km away", kTen, family->type), flying, kTen);
  }
  SystemSpec creeping = with(bm.spec, *bare, *registry.device("lugre_friction"), kTen);
  for (DeviceSpec& d : creeping.devices) d.params["breakaway"] = {2.0, {}}, d.params["stribeck_rate"] = {1.0, {}};
  row(fmt::format("{} lugre_friction that creep", kTen), creeping, kTen);  // the exponential of their law does not vanish
  const SystemSpec several = with(with(bm.spec, *bare, *registry.device("lugre_friction"), 10), *bare, *registry.device("thruster"), 4);
  const double ratio = row("10 lugre_friction, 4 thruster", several, 14);
  RightHandSides acting(several, registry, bm.states);
  fmt::print("\n10 lugre_friction and 4 thruster: {:.3f} of the bare right-hand side; v' differs from the dense twin by {:.1e}.\n", ratio,
             acting.error());
  if (plugin.empty()) return 0;
  load_plugin(plugin, registry);
  fmt::print("\n| {:<35} | {:>12} | {:>10} | ratio |\n|---|---:|---:|---:|\n", "a plugin of the same source", "built in, ns", "plugin, ns");
  const auto compare = [&](const std::string& what, const SystemSpec& ours, const SystemSpec& theirs,
                           const std::vector<BenchState>& states) {
    RightHandSides here(ours, registry, states), there(theirs, registry, states);
    const auto [built_in, foreign] = in_turn(here, there, seconds);
    fmt::print("| {:<35} | {:>12.0f} | {:>10.0f} | {:.3f} |\n", what, built_in, foreign, foreign / built_in);
  };
  const BenchModel chain = chain_of_universals(), hub = hub_appendages(4, 10, 1);
  compare(chain.name, chain.spec, with_twin_hinges(chain.spec, registry), chain.states);
  compare("4 bodies of 10 modes, level 1", hub.spec, with_twin_bodies(hub.spec, registry), hub.states);
  compare("the same on 4 revolute hinges", hub.spec, with_twin_hinges(hub.spec, registry), hub.states);
  compare("gravity of a point_mass field", pulled_by(bm.spec, "point_mass"), pulled_by(bm.spec, "twin/point_mass"), bm.states);
  SystemSpec rods = with(bm.spec, *bare, *registry.device("magnetorquer"), kTen), of_field = rods;
  for (FieldSpec& f : of_field.fields) f.type = "twin/dipole";
  compare("10 magnetorquers in a dipole field", rods, of_field, bm.states);
  for (const auto& [family, origin] : registry.devices.all()) {
    const cardan_device_family* twin = registry.device("twin/" + std::string(family->type));
    if (!twin) continue;
    compare(fmt::format("{} {}", kTen, family->type), with(bm.spec, *bare, *family, kTen), with(bm.spec, *bare, *twin, kTen), bm.states);
  }
  return 0;
}

}  // namespace
}  // namespace cardan::bench

int main(int argc, char** argv) {
  cardan::bench::CommandLine line("What devices cost in a right-hand side.");
  double seconds = 0.2;
  std::string plugin;
  bool of_fields = false;
  line.option("--seconds", seconds, "time spent on each figure");
  line.option("--plugin", plugin, "a plugin with twins of built-in devices: tests/plugins/twins");
  line.option("--fields", of_fields, "what fields cost at a point, and nothing else");
  if (const auto code = line.parse(argc, argv)) return *code;
  try {
    return of_fields ? cardan::bench::fields(seconds) : cardan::bench::run(seconds, plugin);
  } catch (const std::exception& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 2;
  }
}
