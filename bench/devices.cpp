// What devices cost in a right-hand side:  cardan-bench-devices [--seconds S]
// The spacecraft of 28 velocities with and without devices, in turn in one run: bytes and nanoseconds of one device of each type, mean of
// ten of them; hinges, bodies, fields and devices of a plugin made of the same sources (--plugin); ten frictions and four thrusters; and
// how the same is solved (error of v' against the dense twin in 113 bits where devices act).
#include <fmt/format.h>

#include "bench/bench_model.hpp"
#include "bench/command_line.hpp"
#include "bench/time_ring.hpp"
#include "bodies/register.hpp"
#include "core/abi/device_family.hpp"
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
      else
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
  spec.gravity.kind = GravitySpec::Kind::field, spec.gravity.field = "pull";
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
  line.option("--seconds", seconds, "time spent on each figure");
  line.option("--plugin", plugin, "a plugin with twins of built-in devices: tests/plugins/twins");
  if (const auto code = line.parse(argc, argv)) return *code;
  try {
    return cardan::bench::run(seconds, plugin);
  } catch (const std::exception& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 2;
  }
}
