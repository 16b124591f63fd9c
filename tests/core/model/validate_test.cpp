// What C++ and Lua can write and YAML cannot; the rest is in tests/errors.
#include "core/model/validate.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "bodies/register.hpp"
#include "core/model/initial.hpp"
#include "hinges/register.hpp"

namespace cardan {
namespace {

BodySpec body(std::string name, std::string inboard = "") {
  BodySpec b;
  b.name = std::move(name);
  b.mass = 2.0;
  b.inertia_com = Eigen::Vector3d(1, 1, 1).asDiagonal();
  b.hinge.inboard_body = std::move(inboard);
  return b;
}

std::string faults(const SystemSpec& spec) {
  static const Registry registry = [] {
    Registry all;
    register_hinges(all), register_bodies(all);
    return all;
  }();
  DiagnosticSink sink;
  validate(spec, registry, sink);
  std::string out;
  for (const Diagnostic& d : sink.all()) out += std::string(number_of(d.code)) + " " + d.at.key_path + "; ";
  return out;
}
std::string faults(const BodySpec& b) {
  SystemSpec spec;
  spec.bodies = {b};
  return faults(spec);
}

TEST(Validate, AcceptsATree) {
  SystemSpec spec;
  spec.bodies = {body("tip", "arm"), body("arm", "bus"), body("bus"), body("other")};
  EXPECT_EQ(faults(spec), "");
}

TEST(Validate, RefusesTheSameNameTwice) {
  SystemSpec spec;
  spec.bodies = {body("a"), body("a")};
  EXPECT_EQ(faults(spec), "C0207 bodies.a; ");
  BodySpec b = body("a");
  b.nodes = {{"n", {}, Eigen::Matrix3d::Identity(), {}}, {"n", {}, Eigen::Matrix3d::Identity(), {}}};
  b.nodes[0].position.setZero();
  b.nodes[1].position.setZero();
  EXPECT_EQ(faults(b), "C0207 bodies.a.nodes.n; ");
}

TEST(Validate, FindsEachCycleOnce) {
  SystemSpec spec;
  spec.bodies = {body("t", "a"), body("a", "b"), body("b", "a"), body("c", "c"), body("root"), body("leaf", "root")};
  EXPECT_EQ(faults(spec), "C0206 bodies.a.hinge.to; C0206 bodies.c.hinge.to; ");
}

TEST(Validate, RefusesWhatIsNotFinite) {
  BodySpec b = body("a");
  b.mass = NAN;
  EXPECT_EQ(faults(b), "C0302 bodies.a.mass; ");
  b = body("a");
  b.com.x() = INFINITY;
  EXPECT_EQ(faults(b), "C0301 bodies.a.com; ");
  b = body("a");
  b.inertia_com(0, 1) = NAN;
  EXPECT_EQ(faults(b), "C0311 bodies.a.inertia; ");
  b = body("a");
  b.hinge.onode_R(0, 0) = NAN;
  EXPECT_EQ(faults(b), "C0303 bodies.a.hinge.to.orientation; ");
}

TEST(Validate, KnowsThePhysicalInertias) {
  BodySpec b = body("a");
  b.inertia_com = Eigen::Vector3d(3, 1, 2).asDiagonal();  // a flat plate: exactly on the limit
  EXPECT_EQ(faults(b), "");
  b.inertia_com = Eigen::Vector3d(3.001, 1, 2).asDiagonal();
  EXPECT_EQ(faults(b), "C0311 bodies.a.inertia; ");
  b.inertia_com << 2, 1, 0, 0, 2, 0, 0, 0, 2;
  EXPECT_EQ(faults(b), "C0311 bodies.a.inertia; ") << "not symmetric";
  b.type = "particle";
  b.inertia_com.setZero();
  EXPECT_EQ(faults(b), "") << "a particle has none";
}

TEST(Validate, ReportsAnEmptySystem) { EXPECT_EQ(faults(SystemSpec{}), "C0209 bodies; "); }

TEST(Validate, NamesThePlaceOfTheNearestKnownObject) {
  SystemSpec spec;
  spec.bodies = {body("a", "b")};
  spec.marks["bodies.a"] = {"mission.lua", 7, 0};
  DiagnosticSink sink;
  validate(spec, sink);
  EXPECT_EQ(sink.all().at(0).at.mark.line, 7);
  EXPECT_EQ(sink.all().at(0).at.key_path, "bodies.a.hinge.to");
}

// One coordinate that is no number is enough, wherever it stands among the others.
TEST(Validate, CoordinatesThatCannotBeNormalisedAreToldOf) {
  static int bad;
  static const char* names[] = {"x", "y", "z"};
  cardan_hinge_family family{};
  family.type = "direction", family.nq = 3, family.nv = 2, family.q_names = names;
  family.normalise = [](const void*, double* q) { q[bad] = std::numeric_limits<double>::quiet_NaN(); };
  for (bad = 0; bad < 3; ++bad) {
    double q[3] = {0, 0, 1};
    DiagnosticSink sink;
    settle_coordinates(family, nullptr, q, {}, sink);
    ASSERT_EQ(sink.all().size(), 1u) << bad;
    EXPECT_EQ(sink.all()[0].code, Code::bad_initial_state);
  }
}

}  // namespace
}  // namespace cardan
