// Every type of device in every place: on a bus, on a carrier that moves, at the tip of a beam that bends, or on the hinge of what hangs
// there.
#include <gtest/gtest.h>

#include "bodies/modal/lumped.hpp"
#include "core/abi/device_laws.hpp"
#include "core/abi/field_family.hpp"
#include "core/sim/reference_check.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/random_devices.hpp"

namespace cardan::test {
namespace {

struct Place {
  std::string name, node, hinge, body;  // `body`: rigid, for a device that carries mass
};
const std::vector<Place> kPlaces = {
    {"bus", "bus.pad", "vane", "bus"}, {"carrier", "arm.pad", "hand", "arm"}, {"tip", "boom.tip", "head", "head"}};

/// What a type needs; where it is mounted follows from its table.
struct Entry {
  std::vector<std::pair<std::string, double>> numbers{}, initial{};
  std::map<std::string, DeviceSpec::Input, std::less<>> inputs{};
  double rate = 0.0;        // [Hz]
  std::string beside{};     // a type that it works with, as "other"
  std::string direction{};  // a parameter that is a direction
  std::vector<std::pair<std::string, std::string>> choices{};
  std::vector<std::string> truths{};                                // that are true
  std::map<std::string, std::vector<double>, std::less<>> lists{};  // vectors, rows of a table
};
using Input = DeviceSpec::Input;

const std::map<std::string, Entry>& entries() {
  static const std::map<std::string, Entry> all = {
      {"bushing",
       {{},
        {},
        {},
        0.0,
        "",
        "",
        {},
        {},
        {{"stiffness", {20, 30, 10}},
         {"turn_stiffness", {3, 2, 4}},
         {"damping", {1, 0.5, 2}},
         {"turn_damping", {0.2, 0.1, 0.3}},
         {"rest", {1, 0, 0.3}},
         {"preload_moment", {0.3, -0.2, 0.5}}}}},
      {"cable", {{{"stiffness", 20.0}, {"length", 0.3}, {"damping", 1.0}}}},
      {"coarse_sun_sensor", {{{"noise", 1e-3}}, {}, {}, 20.0}},  // it faces the light
      {"contact",
       {{{"from_radius", 1.2},
         {"to_radius", 1.0},
         {"stiffness", 20.0},
         {"restitution", 0.5},
         {"speed", 1.0},
         {"friction", 0.3},
         {"width", 0.5}},
        {},
        {},
        0.0,
        "",
        "",
        {{"from_shape", "sphere"}, {"to_shape", "sphere"}}}},
      {"dc_motor",
       {{{"constant", 0.3}, {"resistance", 1.5}, {"inductance", 0.1}, {"gear", 3}}, {{"current", 0.5}}, {{"voltage", Input{4.0, {}}}}}},
      {"drag", {{{"area", 2.0}}}},
      {"dry_friction", {{{"coulomb", 0.3}, {"breakaway", 0.5}, {"viscous", 0.1}}}},
      {"encoder", {{{"noise", 1e-3}, {"step", 1e-3}}, {}, {}, 20.0}},
      {"gnss", {{{"position_noise", 1.0}, {"position_wander", 2.0}, {"velocity_noise", 0.01}}, {}, {}, 20.0, "", "", {{"axes", "planet"}}}},
      {"horizon_sensor", {{{"half_angle", 3.0}, {"noise", 1e-3}, {"exclusion", 0.1}}, {}, {}, 20.0, "", "boresight"}},
      {"imu", {{{"angle_random_walk", 1e-3}}, {}, {}, 20.0}},
      {"integrating_imu", {{{"angle_random_walk", 1e-3}}, {}, {}, 20.0}},
      {"latch", {{{"place", 0.1}, {"max_rate", 100.0}, {"stiffness", 15.0}, {"damping", 0.5}}, {{"closed", 1.0}}}},
      {"lugre_friction",
       {{{"coulomb", 0.4}, {"breakaway", 0.6}, {"stribeck_rate", 0.5}, {"stiffness", 12.0}, {"damping", 0.4}, {"viscous", 0.1}},
        {{"bending", 0.01}}}},
      {"magnetometer", {{{"noise", 1e-4}}, {}, {}, 20.0}},
      {"magnetorquer", {{{"max_moment", 30.0}}, {}, {{"moment_x", Input{20.0, {}}}, {"moment_z", Input{-10.0, {}}}}}},
      {"momentum_wheel", {{{"inertia", 0.05}, {"viscous", 0.01}}, {{"momentum", 0.8}}, {{"torque", Input{0.05, {}}}}, 0.0, "", "axis"}},
      {"plate_drag",
       {{{"area", 2.0}, {"temperature", 0.01}, {"wall_temperature", 0.02}, {"accommodation", 0.8}},
        {},
        {},
        0.0,
        "",
        "normal",
        {},
        {"both_sides"}}},
      {"pulsed_thruster", {{{"bit", 0.5}, {"scatter", 0.1}}, {}, {{"fire", Input{1.0, {}}}}, 20.0, "", "direction"}},
      {"pulse_modulator", {{{"minimum", 0.01}}, {}, {{"command", Input{0.4, {}}}}, 10.0, "thruster"}},
      {"radiation_pressure",
       {{{"area", 1e6}, {"specular", 0.4}, {"diffuse", 0.3}}, {}, {}, 0.0, "", "normal", {{"shape", "plate"}}, {"both_sides"}}},
      {"recorded_load", {{}, {}, {}, 0.0, "", "", {{"outside", "hold"}}, {}, {{"record", {0, 1, 2,  3,   0.5, -1, 2, 0.15, 2, 0, 1,
                                                                                          1, 1, -1, 0.3, -1,  2,  2, 0,    1, 1}}}}},
      {"rotor_disturbance", {{}, {}, {}, 0.0, "", "axis", {}, {}, {{"harmonics", {1, 2, 0.5, 0, 0.3, 2.9, 1, 0, 2, 1}}}}},
      {"spring_damper", {{{"stiffness", 20.0}, {"rest", 0.3}, {"damping", 1.0}}}},
      {"star_tracker", {{{"cross_noise", 1e-3}, {"exclusion", 0.5}}, {}, {}, 20.0, "", "boresight"}},
      {"stepper",
       {{{"step", 1.0}, {"holding_torque", 1.0}, {"detent_torque", 0.1}, {"microsteps", 4.0}, {"damping", 0.2}},
        {{"steps", 10.1}},
        {{"rate", Input{5.0, {}}}}}},
      {"sun_sensor", {{{"half_angle", 2.5}, {"noise", 1e-3}}, {}, {}, 20.0, "", "boresight"}},
      {"tank",
       {{{"radius", 0.2}, {"density", 1000.0}, {"pressure", 20.0}, {"loaded", 2.0}},
        {{"propellant", 2.0}},
        {{"flow", Input{"other.flow", {}}}},
        0.0,
        "thruster"}},
      {"tape_spring", {{{"peak_moment", 2.0}, {"peak_angle", 0.3}, {"steady_moment", 0.3}, {"damping", 0.05}}}},
      {"thruster",
       {{{"thrust", 2.0}, {"specific_impulse", 60.0}, {"rise_time", 0.05}, {"fall_time", 0.08}},
        {{"level", 0.4}},
        {{"command", Input{1.0, {}}}},
        0.0,
        "",
        "direction"}},
      {"vibration", {{}, {}, {}, 0.0, "", "", {}, {}, {{"tones", {1.5, 0.4, 1, -2, 0, 0.5, 0, 1, 4, 0, 0, 1, 1, 0, 0.2, 0}}}}},
      {"wheel_disturbance",
       {{},
        {{"angle", 0.4}},
        {{"rate", Input{3.0, {}}}},
        0.0,
        "",
        "axis",
        {},
        {},
        {{"harmonics", {1, 0.2, 0.05, 0, 0.3, 2.9, 0.1, 0, 0.2, 1}}}}}};
  return all;
}

/// A boom of five masses along x with two bending modes, a tip that turns with them, and something heavy there.
std::shared_ptr<const ModalData> bending_boom(bool second_order) {
  std::vector<MassNode> masses;
  const auto shape = [](double s) { return MatrixXd((MatrixXd(3, 2) << 0, 0, s * s, 0, 0, s * s).finished()); };
  for (int i = 1; i <= 5; ++i) {
    MassNode m;
    const double s = 0.2 * i;
    m.mass = 0.2, m.position = {2.0 * s, 0, 0}, m.Phi = shape(s);
    if (second_order) m.Q = {MatrixXd(-0.4 * s * s * s * MatrixXd::Identity(2, 2)), MatrixXd::Zero(2, 2), MatrixXd::Zero(2, 2)};
    masses.push_back(m);
  }
  const MatrixXd turn = (MatrixXd(3, 2) << 0, 0, 0, -1, 1, 0).finished();
  return std::make_shared<const ModalData>(lumped_modal_data(masses, Eigen::Vector2d(30, 50).asDiagonal(),
                                                             Eigen::Vector2d(0.2, 0.3).asDiagonal(),
                                                             {{"tip", {2, 0, 0}, Eigen::Matrix3d::Identity(), shape(1.0), turn}}));
}

SystemSpec vehicle(int level) {
  NodeSpec pad;
  pad.name = "pad", pad.position = {0.2, -0.1, 0.15}, pad.R_BN = Eigen::AngleAxisd(0.4, Vector3d(1, 2, 2) / 3.0).toRotationMatrix();
  BodySpec bus = on(rigid("bus", 20.0, {0.05, 0, 0.02}, diagonal({2, 3, 4})), "", "free");
  bus.hinge.q = {1, 0, 0, 0, 8, -3, 5}, bus.hinge.v = {0.3, -0.2, 0.4, 1.0, 2.0, -0.5}, bus.nodes = {pad};
  BodySpec arm = on(rigid("arm", 4.0, {0.3, 0.1, 0}, diagonal({0.2, 0.5, 0.6})), "bus", "revolute", {{0, 0.6, 0.8}}, {0, 0.5, 0.1});
  arm.hinge.q = {0.4}, arm.hinge.v = {0.7}, arm.nodes = {pad};
  BodySpec boom = on({}, "bus", "locked", {}, {-0.5, 0, 0});
  boom.name = "boom", boom.type = "modal_flexible", boom.level = level, boom.modal = bending_boom(level == 2);
  boom.eta = {0.03, -0.02}, boom.etadot = {0.1, 0.05};
  const auto small = [](const char* name, const char* inboard, const Vector3d& axis) {
    BodySpec b = on(rigid(name, 1.0, {0.1, 0.05, 0}, diagonal({0.05, 0.06, 0.07})), inboard, "revolute", {axis});
    b.hinge.q = {0.2}, b.hinge.v = {0.6};
    return b;
  };
  BodySpec vane = small("vane", "bus", {0, 1, 0}), hand = small("hand", "arm", {1, 0, 0}), head = small("head", "boom", {0, 0, 1});
  vane.hinge.onode_position = {0.4, 0.3, 0}, hand.hinge.onode_position = {0.5, 0, 0.1}, head.hinge.inboard_node = "tip";
  SystemSpec spec = system({bus, arm, boom, vane, hand, head}, uniform_gravity({0.5, -1, -0.3}));
  FieldSpec earth, air;
  earth.name = "earth", earth.type = "dipole", earth.params["strength"] = number(50.0);
  air.name = "air", air.type = "exponential_atmosphere";
  for (const auto& [key, x] : {std::pair("density", 0.3), std::pair("radius", 1e6), std::pair("height", 10.0 - 1e6),
                               std::pair("scale_height", 1e3), std::pair("lowest", -2e6)})
    air.params[key] = number(x);
  FieldSpec wind;
  wind.name = "wind", wind.type = "co_rotating_wind", wind.params["rate"] = number(0.3);
  FieldSpec sun;
  sun.name = "sun", sun.type = "sunlight", sun.params["radius"] = number(0.0);
  sun.params["direction"].value = std::vector<double>{0.6, 0.0, 0.8};
  spec.fields = {earth, air, wind, sun};
  return spec;
}

DeviceSpec mounted(const std::string& name, const std::string& type, const Place& place) {
  const Entry& e = entries().at(type);
  DeviceSpec d = device(name, type, e.numbers, {});
  for (const auto& [key, x] : e.initial) d.initial[key] = number(x);
  d.inputs = e.inputs, d.rate = e.rate;
  for (const auto& [key, choice] : e.choices) d.params[key].value = choice;
  for (const std::string& key : e.truths) d.params[key].value = true;
  for (const auto& [key, list] : e.lists) d.params[key].value = list;
  if (!e.direction.empty()) d = with_vector(d, e.direction, Vector3d(1, 2, -2) / 3.0);
  const cardan_device_family& f = *registry().device(type);
  int nodes = 0;
  for (std::uint32_t i = 0; i < f.n_mounts; ++i) {
    const cardan_mount_desc& m = f.mounts[i];
    std::string& target = d.mounts[m.name].target;
    if (m.kind == CARDAN_MOUNT_NODE) target = nodes++ == 0 ? place.node : place.name == "tip" ? "hand" : "head";
    if (m.kind == CARDAN_MOUNT_HINGE) target = place.hinge;
    if (m.kind == CARDAN_MOUNT_MASS) target = place.body;
    const std::uint32_t quantity = m.use & ~std::uint32_t{CARDAN_USE_OPTIONAL};
    if (m.kind == CARDAN_MOUNT_FIELD)
      target = quantity == CARDAN_MAGNETIC ? "earth" : quantity == CARDAN_DENSITY ? "air" : quantity == CARDAN_LIGHT ? "sun" : "wind";
  }
  return d;
}

SystemSpec with_device(const std::string& type, const Place& place, int level) {
  SystemSpec spec = vehicle(level);
  spec.devices = {mounted("tried", type, place)};
  if (const std::string& beside = entries().at(type).beside; !beside.empty()) {
    spec.devices.push_back(mounted("other", beside, place));
    if (type == "pulse_modulator") spec.devices.back().inputs["command"] = {"tried.open", {}};
    if (type == "tank") spec.devices.back().inputs["supply"] = {"tried.supply", {}};
  }
  return spec;
}

double error_against_the_twin(Simulation& sim) {
  Output difference = reference_output(sim);
  double x = 0.0;
  difference.fill(&x);
  return x;
}

class DeviceInPlace : public testing::TestWithParam<std::string> {
 protected:
  const cardan_device_family& family() const { return *registry().device(GetParam()); }
  /// f(vehicle with the device, the same without) in each place, beside a boom of either level.
  template <class F>
  void everywhere(const F& f) const {
    for (const Place& place : kPlaces)
      for (const int level : {1, 2}) {
        SCOPED_TRACE(fmt::format("on the {}, level {}", place.name, level));
        f(with_device(GetParam(), place, level), vehicle(level));
      }
  }
};

/// What it pushes with is seen by the twin, and is not nothing; or what it reads is a number that is not zero.
TEST_P(DeviceInPlace, ActsAsInTheDenseTwin) {
  everywhere([](const SystemSpec& spec, const SystemSpec& without) {
    Simulation sim(compiled(spec), accurate("dopri5", 1e-9)), bare(compiled(without), {});
    EXPECT_LT(error_against_the_twin(sim), 1e-12);
    const double change = (sim.vdot() - bare.vdot()).norm();
    sim.run(0.2);
    EXPECT_LT(error_against_the_twin(sim), 1e-12);
    double read = 0.0;
    for (int i = 0; i < sim.model().devices.n_out; ++i) read += std::abs(sim.device_output(i));
    const Device& d = sim.model().devices.all[0];
    EXPECT_GT(d.acts && !d.family->impulse ? change : read, 1e-4);
  });
}

/// Places in orbit are rounded to 1e-9 m, what lies between two of one vehicle is not.
TEST_P(DeviceInPlace, PushesTheSameInOrbitIfItReadsWhatLiesBetweenNodes) {
  if (!reads_between_nodes(family())) return;
  everywhere([](const SystemSpec& spec, const SystemSpec&) {
    SystemSpec orbiting = spec;
    HingeSpec& bus = orbiting.bodies[0].hinge;
    bus.q[4] += 7e6, bus.v[4] += 7.5e3;
    Simulation here(compiled(spec), {}), there(compiled(orbiting), {});
    EXPECT_LT((there.vdot() - here.vdot()).norm() / here.vdot().norm(), 1e-14);
  });
}

TEST_P(DeviceInPlace, HasItsDerivativeInJv) {
  everywhere([](const SystemSpec& spec, const SystemSpec&) { EXPECT_LT(jacobian_error(spec), 1e-8); });
}

TEST_P(DeviceInPlace, IsInTheLedger) {
  everywhere([](const SystemSpec& spec, const SystemSpec&) {
    Simulation sim(compiled(spec), accurate("dopri5", 1e-11));
    sim.run(0.4);
    const LedgerState l = sim.ledger();
    EXPECT_TRUE(l.pass);
    EXPECT_LT(l.linear_relative, 1e-10);  // some dozen steps, each within 1e-11 of the state
    EXPECT_LT(l.angular_relative, 1e-10);
    EXPECT_LT(l.energy_relative, 1e-10);
  });
}

/// Nothing from outside but the device, which sits between parts of the vehicle: momentum stays to round-off.
TEST_P(DeviceInPlace, KeepsMomentumIfItIsInternal) {
  const cardan_device_family& f = family();
  const bool on_hinges = std::all_of(f.mounts, f.mounts + f.n_mounts, [](const cardan_mount_desc& m) {
    return m.kind == CARDAN_MOUNT_HINGE || (m.use & CARDAN_USE_LOAD) == 0;  // by its reaction
  });
  if (f.impulse || !entries().at(GetParam()).beside.empty()) return;
  if (!on_hinges && (f.facts & CARDAN_FACT_INTERNAL) == 0 && !f.momentum) return;  // from outside: in the ledger
  everywhere([](SystemSpec alone, const SystemSpec&) {
    alone.gravity = {};
    SimulationOptions options = accurate("dop853", 1e-14);
    options.ledger = false;
    Simulation sim(compiled(alone), options);
    const Momentum before = sim.momentum();
    sim.run(0.01);  // steps too short for errors of the method
    const Momentum after = sim.momentum();
    EXPECT_LT((after.linear - before.linear).norm() / before.linear_magnitude, 1e-13);
    EXPECT_LT((after.angular - before.angular).norm() / before.angular_magnitude, 1e-13);
  });
}

/// Where it says so it takes energy at every evaluation, and gets none; else the sum that it has lost never falls over a whole motion.
TEST_P(DeviceInPlace, LosesIfItIsPassive) {
  if ((family().facts & CARDAN_FACT_PASSIVE) == 0) return;
  everywhere([](const SystemSpec& spec, const SystemSpec&) {
    Simulation sim(compiled(spec), accurate("dopri5", 1e-9));
    for (int i = 1; i <= 40; ++i) {
      sim.run(0.01 * i);
      sim.observe();
      const auto [delivered, lost] = sim.devices()->powers(0);
      EXPECT_GE(lost, 0.0) << "at " << sim.time() << " s";
      EXPECT_EQ(delivered, 0.0);
    }
  });
}

TEST_P(DeviceInPlace, GoesOnFromACheckpointBitForBit) {
  everywhere([](const SystemSpec& spec, const SystemSpec&) {
    for (const char* method : {"dopri5", "cvode_bdf"}) {
      const auto model = compiled(spec);
      Simulation whole(model, accurate(method, 1e-7)), part(model, accurate(method, 1e-7));
      whole.run(0.17);
      part.resume(whole.checkpoint());
      whole.run(0.4), part.run(0.4);
      EXPECT_TRUE(whole.state().q == part.state().q && whole.state().v == part.state().v) << method;
      EXPECT_TRUE(whole.state().z == part.state().z && whole.state().marks == part.state().marks) << method;
      for (int i = 0; i < model->devices.n_out; ++i) EXPECT_EQ(whole.device_output(i), part.device_output(i)) << method;
    }
  });
}

std::vector<std::string> types_tried() {
  std::vector<std::string> types;
  for (const auto& [type, entry] : entries()) types.push_back(type);
  return types;
}
INSTANTIATE_TEST_SUITE_P(Every, DeviceInPlace, testing::ValuesIn(types_tried()), [](const auto& type) { return type.param; });

/// A new type is tried as well, or this fails.
TEST(DevicesInPlaces, AreAllThatTheRegistryHas) {
  std::vector<std::string> types = registry().devices.types();
  std::ranges::sort(types);
  EXPECT_EQ(types, types_tried());
}

}  // namespace
}  // namespace cardan::test
