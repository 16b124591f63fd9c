#include "core/io/yaml_reader.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <sstream>

#include "bodies/register.hpp"
#include "hinges/register.hpp"
#include "tests/support/worse.hpp"

namespace cardan {
namespace {

using test::largest;
constexpr double kPi = std::numbers::pi;
constexpr double kExact = 1e-15;  // a few roundings of numbers of order one

const Registry& hinges() {
  static const Registry registry = [] {
    Registry r;
    register_hinges(r);
    register_bodies(r);
    return r;
  }();
  return registry;
}

SystemSpec read(const std::string& text, const Overrides& overrides = {}) {
  return vehicle_from_text(text, "test.yaml", hinges(), overrides);
}

/// One body "b" with this hinge, or with these further keys.
SystemSpec with_hinge(const std::string& hinge) {
  return read(fmt::format("cardan: 1\nbodies:\n  b: {{mass: 1, inertia: [1, 1, 1], hinge: {{{}}}}}\n", hinge));
}
SystemSpec with_body(const std::string& keys) {
  return read(fmt::format("cardan: 1\nbodies:\n  b: {{{}, hinge: {{type: free, to: world}}}}\n", keys));
}

std::string first_fault(const std::string& text, const Overrides& overrides = {}) {
  try {
    read(text, overrides);
  } catch (const InputError& e) {
    const Diagnostic& d = e.diagnostics().at(0);
    return fmt::format("{} {}", number_of(d.code), d.at.key_path);
  }
  return "none";
}

constexpr const char* kSatellite = R"(cardan: 1
name: a satellite
gravity: {central: {mu: 398600.4418 km^3/s^2, gradient: false}}
bodies:
  bus:
    mass: 1.6 t
    com: [0, 0, 10 cm]
    inertia: {xx: 900, yy: 1100, zz: 700, xy: 1, xz: 2, yz: 3, about: origin}
    nodes:
      saddle: {position: [0, 1.1, 0], orientation: {axis: [0, 0, 2], angle: 90 deg}}
    hinge: {type: free, to: world, initial: {position: [7000 km, 0, 0], velocity: [0, 7.5 km/s, 0], angular_velocity: [0, 0, 1 deg/s]}}
  wheel:
    type: particle
    mass: 3
    hinge:
      type: revolute
      to: bus.saddle
      axis: [0, 3, 4]
      prescribed: true
      spring: {stiffness: 5000 N m/rad, rest: 10 deg, damping: 75 N m s/rad}
      initial: {angle: 10 deg, rate: 1500 rpm}
)";

TEST(Vehicle, HasStopsAndFrictionOnItsHinges) {
  const SystemSpec spec = read(R"(cardan: 1
bodies:
  arm:
    mass: 1
    inertia: [1, 1, 1]
    hinge:
      type: cylindrical
      to: world
      axis: [0, 0, 1]
      loads:
        - {type: stop, component: angle, lower: -10 deg, upper: 90 deg, stiffness: 200, dissipation: 0.3 s/rad}
        - {type: stop, component: displacement, upper: 20 mm, stiffness: 5 N/mm, exponent: 1}
        - {type: friction, component: rate, coulomb: 20 mN m, breakaway: 0.03 N m, viscous: 1 mN m s/rad, width: 0.01 deg/s}
)");
  const std::vector<HingeLoadSpec>& loads = spec.bodies[0].hinge.loads;
  ASSERT_EQ(loads.size(), 3u);
  EXPECT_EQ(loads[0].law, HingeLaw::stop);
  EXPECT_EQ(loads[0].component, 0);
  EXPECT_EQ(loads[0].parameters, (HingeLoad::Parameters{-kPi / 18, kPi / 2, 200.0, 1.5, 0.3}));
  EXPECT_EQ(loads[1].component, 1);
  EXPECT_EQ(loads[1].parameters, (HingeLoad::Parameters{-HUGE_VAL, 0.02, 5000.0, 1.0, 0.0}));
  EXPECT_EQ(loads[2].law, HingeLaw::friction);
  EXPECT_EQ(loads[2].parameters, (HingeLoad::Parameters{0.02, 0.03, 10.0 * (0.01 * (kPi / 180)), 1e-3, 0.01 * (kPi / 180)}));
}

TEST(Vehicle, IsReadInSi) {
  const SystemSpec spec = read(kSatellite);
  EXPECT_EQ(spec.name, "a satellite");
  EXPECT_EQ(spec.gravity.kind, GravitySpec::Kind::central);
  EXPECT_EQ(spec.gravity.mu, 398600.4418e9);
  EXPECT_FALSE(spec.gravity.gradient);
  ASSERT_EQ(spec.bodies.size(), 2u);
  const BodySpec& bus = spec.bodies[0];
  EXPECT_EQ(bus.name, "bus");
  EXPECT_EQ(bus.mass, 1600.0);
  EXPECT_EQ(bus.com, Eigen::Vector3d(0, 0, 0.1));
  EXPECT_EQ(bus.hinge.type, "free");
  EXPECT_EQ(bus.hinge.inboard_body, "");
  EXPECT_EQ(bus.hinge.q, (std::vector<double>{1, 0, 0, 0, 7e6, 0, 0}));
  EXPECT_EQ(bus.hinge.v, (std::vector<double>{0, 0, kPi / 180, 0, 7500, 0}));
  const HingeSpec& hinge = spec.bodies[1].hinge;
  EXPECT_EQ(hinge.inboard_body, "bus");
  EXPECT_EQ(hinge.inboard_node, "saddle");
  EXPECT_EQ(std::get<std::vector<double>>(hinge.params.at("axis").value), (std::vector<double>{0, 3, 4}));
  EXPECT_EQ(hinge.prescribed, std::vector<int>{0});
  ASSERT_EQ(hinge.springs.size(), 1u);
  EXPECT_EQ(hinge.springs[0].stiffness, 5000.0);
  EXPECT_EQ(hinge.springs[0].damping, 75.0);
  EXPECT_DOUBLE_EQ(hinge.springs[0].rest, kPi / 18);
  EXPECT_DOUBLE_EQ(hinge.q.at(0), kPi / 18);
  EXPECT_DOUBLE_EQ(hinge.v.at(0), 50 * kPi);
}

TEST(Vehicle, KeepsThePlaceOfEachValue) {
  const SystemSpec spec = read(kSatellite);
  EXPECT_EQ(spec.locate("bodies.wheel.hinge.axis").mark.line, 18);
  EXPECT_EQ(spec.locate("bodies.wheel.hinge.axis").mark.column, 13);
  EXPECT_EQ(spec.locate("bodies.bus.com[2]").mark.column, 17);
  EXPECT_EQ(spec.locate("bodies.bus.nothing.such").mark.line, 5);
  EXPECT_EQ(spec.bodies[1].hinge.params.at("axis").at.key_path, "bodies.wheel.hinge.axis");
  EXPECT_EQ(spec.bodies[0].nodes[0].at.mark.line, 10);
}

TEST(Vehicle, ListsTheDefaultsItUsed) {
  const auto defaults = with_hinge("type: helical, to: world, axis: [0, 0, 1], pitch: 1 mm/rev").defaults_used;
  const auto has = [&](const char* key, const char* value) {
    return std::find(defaults.begin(), defaults.end(), std::pair<std::string, std::string>(key, value)) != defaults.end();
  };
  EXPECT_TRUE(has("name", "vehicle"));
  EXPECT_TRUE(has("gravity", "none"));
  EXPECT_TRUE(has("bodies.b.type", "rigid"));
  EXPECT_TRUE(has("bodies.b.com", "[0, 0, 0] m"));
  EXPECT_TRUE(has("bodies.b.hinge.locked", "false"));
  EXPECT_TRUE(has("bodies.b.hinge.at", "the origin of the body"));
}

TEST(Inertia, IsAboutTheMassCentreUnlessSaidOtherwise) {
  const Eigen::Matrix3d I =
      with_body("mass: 2, com: [1, 2, 3], inertia: {xx: 40, yy: 50, zz: 60, xy: -1, xz: 2, yz: 3}").bodies[0].inertia_com;
  Eigen::Matrix3d given;
  given << 40, -1, 2, -1, 50, 3, 2, 3, 60;
  EXPECT_EQ(I, given);
}

TEST(Inertia, AboutTheOriginIsShifted) {
  // Two point masses of 1 kg at (2, 2, 3) and (0, 2, 3) and a third of 2 kg at (1, 2, 4): tensor about the origin by
  // its definition.
  Eigen::Matrix3d about_origin = Eigen::Matrix3d::Zero(), about_com = Eigen::Matrix3d::Zero();
  const Eigen::Vector3d points[] = {{2, 2, 3}, {0, 2, 3}, {1, 2, 4}, {1, 3, 3}};
  const double masses[] = {1, 1, 2, 1};
  double mass = 0;
  Eigen::Vector3d com = Eigen::Vector3d::Zero();
  for (int i = 0; i < 4; ++i) mass += masses[i], com += masses[i] * points[i];
  com /= mass;
  const auto add = [](Eigen::Matrix3d& I, double m, const Eigen::Vector3d& r) {
    I += m * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
  };
  for (int i = 0; i < 4; ++i) add(about_origin, masses[i], points[i]), add(about_com, masses[i], points[i] - com);
  std::ostringstream text;
  text.precision(17);
  text << "mass: " << mass << ", com: [" << com.x() << ", " << com.y() << ", " << com.z() << "], inertia: {xx: " << about_origin(0, 0)
       << ", yy: " << about_origin(1, 1) << ", zz: " << about_origin(2, 2) << ", xy: " << about_origin(0, 1)
       << ", xz: " << about_origin(0, 2) << ", yz: " << about_origin(1, 2) << ", about: origin}";
  // Entries of order 100 cancel to order 1.
  EXPECT_LT(largest(with_body(text.str()).bodies[0].inertia_com - about_com), 1e-13);
}

Eigen::Matrix3d orientation(const std::string& text) {
  return with_body(fmt::format("mass: 1, inertia: [1, 1, 1], nodes: {{n: {{orientation: {{{}}}}}}}", text)).bodies[0].nodes[0].R_BN;
}

TEST(Orientation, TakesNodeAxesToBodyAxes) {
  // A quarter turn about z: the node's x axis is the body's y axis.
  for (const char* text :
       {"rotvec: [0, 0, 90 deg]", "axis: [0, 0, 5], angle: 90 deg", "quaternion_wxyz: [0.70710678118654757, 0, 0, 0.70710678118654757]",
        "euler: {sequence: zyx, angles: [90 deg, 0, 0]}", "matrix: [[0, -1, 0], [1, 0, 0], [0, 0, 1]]"})
    EXPECT_LT((orientation(text) * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), kExact) << text;
}

TEST(Orientation, EulerAnglesTurnAboutTheMovedAxes) {
  // zyx = yaw, then pitch about the new y, then roll about the newest x.
  using Eigen::AngleAxisd, Eigen::Vector3d;
  const Eigen::Matrix3d R =
      (AngleAxisd(0.1, Vector3d::UnitZ()) * AngleAxisd(0.2, Vector3d::UnitY()) * AngleAxisd(0.3, Vector3d::UnitX())).toRotationMatrix();
  EXPECT_LT((orientation("euler: {sequence: zyx, angles: [0.1, 0.2, 0.3]}") - R).norm(), kExact);
  EXPECT_LT((orientation("euler: {sequence: 321, angles: [0.1, 0.2, 0.3]}") - R).norm(), kExact);
}

TEST(Orientation, AsInitialAttitudeIsAQuaternion) {
  const auto q = with_hinge("type: ball, to: world, initial: {orientation: {rotvec: [0, 0.2, 0]}}").bodies[0].hinge.q;
  EXPECT_NEAR(q.at(0), std::cos(0.1), kExact);
  EXPECT_NEAR(q.at(2), std::sin(0.1), kExact);
}

TEST(Quaternion, WithinTheToleranceIsMadeUnit) {
  const auto q = with_hinge("type: ball, to: world, initial: {quaternion_wxyz: [0.8000005, 0, 0.6, 0]}").bodies[0].hinge.q;
  EXPECT_NEAR(q[0] * q[0] + q[2] * q[2], 1.0, kExact);
}

TEST(Hinge, OfEachTypeIsRead) {
  EXPECT_EQ(with_hinge("type: locked, to: world").bodies[0].hinge.type, "locked");
  EXPECT_EQ(with_hinge("type: prismatic, to: world, axis: [1, 0, 0], initial: {displacement: 2 mm}").bodies[0].hinge.q,
            std::vector<double>{0.002});
  const HingeSpec helical = with_hinge("type: helical, to: world, axis: [1, 0, 0], pitch: 2 mm/rev").bodies[0].hinge;
  EXPECT_DOUBLE_EQ(std::get<double>(helical.params.at("pitch").value), 1e-3 / kPi);
  EXPECT_EQ(with_hinge("type: cylindrical, to: world, axis: [1, 0, 0], springs: [{component: displacement, stiffness: 3 N/mm}]")
                .bodies[0]
                .hinge.springs.at(0)
                .component,
            1);
  const HingeSpec universal = with_hinge("type: universal, to: world, axes: [[1, 0, 0], [0, 0, 2]]").bodies[0].hinge;
  EXPECT_EQ(std::get<std::vector<double>>(universal.params.at("axes").value), (std::vector<double>{1, 0, 0, 0, 0, 2}));
  EXPECT_EQ(std::get<std::string>(with_hinge("type: gimbal, to: world, sequence: \"313\"").bodies[0].hinge.params.at("sequence").value),
            "313");
  EXPECT_EQ(with_hinge("type: gimbal, to: world, axes: [[1, 0, 0], [0, 0, 2], [0, 1, 0]], prescribed: [rate_3, angle_1]")
                .bodies[0]
                .hinge.prescribed,
            (std::vector<int>{2, 0}));
  EXPECT_EQ(with_hinge("type: planar, to: world, axes: [[1, 0, 0], [0, 1, 0]], initial: {y: 1 cm, angle: 1, vx: 2}").bodies[0].hinge.q,
            (std::vector<double>{0, 0.01, 1}));
  EXPECT_EQ(with_hinge("type: translational, to: world, initial: {position: [1, 2, 3], velocity: [4, 5, 6]}").bodies[0].hinge.v,
            (std::vector<double>{4, 5, 6}));
  EXPECT_EQ(with_hinge("type: free_body, to: world, locked: true").bodies[0].hinge.locked, true);
}

TEST(Hinge, MayBePlacedWithoutNames) {
  const HingeSpec hinge = with_hinge(
                              "type: locked, to: {body: world, position: [1, 2, 3], orientation: {rotvec: [0, 0, 90 "
                              "deg]}}, at: {position: [4, 5, 6]}")
                              .bodies[0]
                              .hinge;
  EXPECT_EQ(hinge.inboard_body, "");
  EXPECT_EQ(hinge.onode_position, Eigen::Vector3d(1, 2, 3));
  EXPECT_LT((hinge.onode_R * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), kExact);
  EXPECT_EQ(hinge.pnode_position, Eigen::Vector3d(4, 5, 6));
}

TEST(Gravity, IsNoneUniformOrCentral) {
  const std::string body = "bodies: {b: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world}}}\n";
  EXPECT_EQ(read("cardan: 1\ngravity: none\n" + body).gravity.kind, GravitySpec::Kind::none);
  const GravitySpec uniform = read("cardan: 1\ngravity: {uniform: [0, 0, -9.81 m/s^2]}\n" + body).gravity;
  EXPECT_EQ(uniform.kind, GravitySpec::Kind::uniform);
  EXPECT_EQ(uniform.g, Eigen::Vector3d(0, 0, -9.81));
  EXPECT_TRUE(read("cardan: 1\ngravity: {central: {mu: 1, centre: [1, 2, 3]}}\n" + body).gravity.gradient);
}

TEST(FlexibleBody, HandsItsSourceOnAsWritten) {
  const SystemSpec spec = read(
      "cardan: 1\nbodies:\n  w:\n    type: modal_flexible\n    level: 2\n    modal: {file: wing.h5}\n    initial: "
      "{eta: [1, 2], etadot: [3, 4]}\n"
      "    hinge: {type: locked, to: world, at: root}\n  tip: {type: particle, mass: 1, hinge: {type: locked, to: "
      "w.tip}}\n");
  const BodySpec& wing = spec.bodies[0];
  EXPECT_EQ(wing.level, 2);
  ASSERT_TRUE(wing.modal_source);
  EXPECT_EQ(wing.modal_source->find("file")->text, "wing.h5");
  EXPECT_EQ(wing.eta, (std::vector<double>{1, 2}));
  EXPECT_EQ(wing.hinge.body_node, "root") << "checked once the modes are there";
}

TEST(Yaml, AnchorsAreResolved) {
  const SystemSpec spec = read(
      "cardan: 1\nbodies:\n  a: {mass: &m 3 kg, inertia: &I [1, 2, 2], hinge: {type: free, to: world}}\n  b: {mass: "
      "*m, inertia: *I, hinge: {type: ball, to: a}}\n");
  EXPECT_EQ(spec.bodies[1].mass, 3.0);
  EXPECT_EQ(spec.bodies[1].inertia_com(1, 1), 2.0);
}

TEST(Yaml, AliasesOfAliasesDoNotFillTheMemory) {
  std::string text = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 12; ++i)
    text += fmt::format("a{0}: &a{0} [*a{1}, *a{1}, *a{1}, *a{1}, *a{1}, *a{1}, *a{1}, *a{1}, *a{1}, *a{1}]\n", i, i - 1);
  EXPECT_EQ(first_fault(text), "C0101 ");
}

TEST(Yaml, AliasesOfALongTextDoNotFillTheMemory) {
  std::string text = "a: &a " + std::string(1u << 20, 'x') + "\nb: [*a";
  for (int i = 0; i < 100'000; ++i) text += ", *a";
  EXPECT_EQ(first_fault(text + "]\n"), "C0101 ");
}

// yaml-cpp makes empty documents of a comma that belongs to nothing, without end.
TEST(Yaml, ThatBeginsWithACommaIsRefused) {
  for (const char* text : {",", ", a", "--- ,", "!,", "a: 1\n...\n,"}) EXPECT_EQ(first_fault(text), "C0101 ") << text;
  for (const char* value : {",", ", a", "1\n--- 2", "[1]]"})
    EXPECT_EQ(first_fault(kSatellite, {{"bodies.bus.mass", value}}), "C0101 ") << value;
}

// The tokens of a bracket are held until it closes.
TEST(Yaml, OfCommasAloneIsRefusedBeforeItIsTakenApart) { EXPECT_EQ(first_fault("[" + std::string(15u << 20, ',')), "C0101 "); }

TEST(Yaml, WithAQuoteThatIsNotClosedIsRefused) {
  const std::string good = "cardan: 1\nbodies: {b: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world}}}\n";
  for (const char* end : {"\"name\n", "'name\n", "name: \"a\n", "name: 'it''s\n", "name: &n \"a\\\"\n", "'\n"})
    EXPECT_EQ(first_fault(good + end), "C0101 ") << end;
  for (const char* end : {"name: \"a\"\n", "name: 'it''s'\n", "name: &n \"a\\\"\"\n", "name: ''", "name: |\n  it's\n",
                          "name: 'a'  # it's\n", "name: ä 'b'\n"})
    EXPECT_EQ(first_fault(good + end), "none") << end;
}

TEST(Yaml, WithAnEndlessKeyIsRefused) { EXPECT_EQ(first_fault("? " + std::string(2000, 'k') + "\n: 1\n"), "C0101 "); }

TEST(Yaml, OfTooManyBytesIsRefused) { EXPECT_EQ(first_fault(std::string(20u << 20, '#')), "C0101 "); }

TEST(Yaml, WithByteOrderMarkAndCrlfIsRead) {
  EXPECT_EQ(read("\xEF\xBB\xBF"
                 "cardan: 1\r\nbodies:\r\n  b: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world}}\r\n")
                .bodies.size(),
            1u);
}

TEST(Yaml, OfManyBodiesIsReadInReasonableTime) {
  std::string text = "cardan: 1\nbodies:\n";
  for (int i = 0; i < 2000; ++i)
    text += fmt::format("  b{}: {{mass: 1, inertia: [1, 1, 1], hinge: {{type: revolute, axis: [0, 0, 1], to: {}}}}}\n", i,
                        i == 0 ? "world" : fmt::format("b{}", i - 1));
  EXPECT_EQ(read(text).bodies.size(), 2000u);
}

TEST(VehicleFile, ThatIsNotThereIsReported) {
  try {
    read_vehicle("no/such.yaml", hinges());
    FAIL();
  } catch (const InputError& e) {
    EXPECT_STREQ(e.what(),
                 "error[C0102]: file not found\n  --> no/such.yaml\n  expected: a file that can be read\n  got:      "
                 "No such file or directory\n\n1 error. Nothing was run.\n");
  }
  EXPECT_THROW(read_vehicle(".", hinges()), InputError) << "a folder";
  EXPECT_THROW(read_vehicle("/dev/zero", hinges()), InputError) << "a file without end";
}

TEST(Override, SetsAValue) {
  const SystemSpec spec = read(kSatellite, {{"bodies.bus.mass", "1700 kg"},
                                            {"bodies.bus.com[2]", "0.2"},
                                            {"bodies.wheel.hinge.axis", "[1, 0, 0]"},
                                            {"bodies.wheel.hinge.locked", "true"},
                                            {"bodies.wheel.hinge.prescribed", "false"},
                                            {"gravity", "none"}});
  EXPECT_EQ(spec.bodies[0].mass, 1700.0);
  EXPECT_EQ(spec.bodies[0].com.z(), 0.2);
  EXPECT_EQ(std::get<std::vector<double>>(spec.bodies[1].hinge.params.at("axis").value), (std::vector<double>{1, 0, 0}));
  EXPECT_TRUE(spec.bodies[1].hinge.locked);
  EXPECT_EQ(spec.gravity.kind, GravitySpec::Kind::none);
}

TEST(Override, MakesTheObjectsItNeeds) {
  const SystemSpec spec =
      read("cardan: 1\nbodies: {b: {mass: 1, inertia: [1, 1, 1], hinge: {type: revolute, to: world, axis: [0, 0, 1]}}}\n",
           {{"bodies.b.hinge.initial.angle", "5 deg"}});
  EXPECT_DOUBLE_EQ(spec.bodies[0].hinge.q.at(0), kPi / 36);
}

TEST(Override, IsCheckedAgainstTheSchema) {
  EXPECT_EQ(first_fault(kSatellite, {{"bodies.bus.masss", "1"}}), "C0104 bodies.bus.masss");
  EXPECT_EQ(first_fault(kSatellite, {{"bodies.bsu.mass", "1"}}), "C0104 bodies.bsu");
  EXPECT_EQ(first_fault(kSatellite, {{"bodies.bus.nodes.sadle.position", "[0, 0, 0]"}}), "C0104 bodies.bus.nodes.sadle");
  EXPECT_EQ(first_fault(kSatellite, {{"bodies.bus.com[3]", "1"}}), "C0104 bodies.bus.com[3]");
  EXPECT_EQ(first_fault(kSatellite, {{"bodies.wheel.com[0]", "1"}}), "C0104 bodies.wheel.com[0]")
      << "of a list that the file does not have";
  for (const char* index : {"0x1", "1e0", "-1", "", " 0", "0 ", "18446744073709551616"})
    EXPECT_EQ(first_fault(kSatellite, {{fmt::format("bodies.bus.com[{}]", index), "1"}}), fmt::format("C0104 bodies.bus.com[{}]", index));
  for (const char* path : {"bodies.bus.com[0", "bodies.bus.com[0]1", "bodies.bus.com[", "bodies.bus[com"})
    EXPECT_EQ(first_fault(kSatellite, {{path, "1"}}), fmt::format("C0104 {}", path));
  EXPECT_EQ(first_fault(kSatellite, {{"bodies.bus.mass.value", "1"}}), "C0104 bodies.bus.mass.value");
  EXPECT_EQ(first_fault(kSatellite, {{"gravty.uniform", "[0, 0, 1]"}}), "C0104 gravty");
  EXPECT_EQ(first_fault(kSatellite, {{"bodies.bus.mass", "12 m"}}), "C0107 bodies.bus.mass");
  EXPECT_EQ(first_fault(kSatellite, {{"bodies.bus.mass", "[1"}}), "C0101 ");
  EXPECT_EQ(first_fault(kSatellite, {{"bodies.bus.mass", ""}}), "C0106 bodies.bus.mass");
}

TEST(Override, IsNamedInTheAnswer) {
  try {
    read(kSatellite, {{"bodies.bus.masss", "1700 kg"}});
    FAIL();
  } catch (const InputError& e) {
    EXPECT_STREQ(e.what(),
                 "error[C0104]: unknown key\n"
                 "  --> --set bodies.bus.masss=1700 kg\n"
                 "  at: bodies.bus.masss\n"
                 "  expected: one of the keys type, mass, com, inertia, nodes or hinge\n"
                 "  got:      \"masss\"\n"
                 "  hint:     did you mean \"mass\"?\n"
                 "\n"
                 "1 error. Nothing was run.\n");
  }
}

// Whatever the text: a vehicle, or an answer.
TEST(Vehicle, OfADamagedFileIsReadOrRefused) {
  const std::string original = kSatellite;
  const std::string pieces[] = {"\n",  "  ",   "\t",    ":",    ": ",           "- ",    "[",    "]",    "{",  "}",
                                ",",   "\"",   "'",     "#",    "&a",           "*a",    "<<: ", "|",    ">",  "? ",
                                "!",   "~",    "---\n", "010",  "-1",           "1e400", "nan",  "deg",  "kg", "world",
                                "bus", "null", "true",  "\x80", "\xEF\xBB\xBF", "\x01",  "axis", "hinge"};
  std::uint32_t state = 12345;  // a linear congruential generator: the same mutations everywhere (Numerical Recipes constants)
  const auto random = [&](std::size_t n) { return static_cast<std::size_t>((state = state * 1664525u + 1013904223u) >> 8) % n; };
  int read_well = 0, refused = 0;
  for (int i = 0; i < 4000; ++i) {
    std::string text = original;
    for (std::size_t k = random(4); k < 4; ++k) {
      const std::size_t place = random(text.size()), length = std::min(random(20), text.size() - place);
      switch (random(4)) {
        case 0:
          text.erase(place, length);
          break;
        case 1:
          text.insert(place, pieces[random(std::size(pieces))]);
          break;
        case 2:
          text.insert(random(text.size()), text.substr(place, length));
          break;
        default:
          text[place] = static_cast<char>(random(256));
          break;
      }
      if (text.empty()) text.push_back('x');
    }
    try {
      const SystemSpec spec = read(text);
      ++read_well;
    } catch (const InputError& e) {
      EXPECT_FALSE(e.diagnostics().empty());
      ++refused;
    }
  }
  EXPECT_EQ(read_well + refused, 4000);
  EXPECT_GT(read_well, 20);
  EXPECT_GT(refused, 1000);
}

}  // namespace
}  // namespace cardan
