// Robots of URDF and MJCF as vehicles: their accelerations against closed forms, against the same vehicle written by hand, and against
// random trees that were written as URDF.
#include "scripts/import/import.hpp"
#include "core/linalg/dense.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <fstream>
#include <random>
#include <sstream>

#include "core/dynamics/forward.hpp"
#include "core/dynamics/loops.hpp"
#include "core/dynamics/node_motion.hpp"
#include "core/io/yaml_reader.hpp"
#include "tests/support/bench_loops.hpp"
#include "tests/support/builders.hpp"
#include "tests/support/random_tree.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

const std::string kRobots = CARDAN_SOURCE_DIR "/tests/import/robots/";

std::string text_of(const std::string& name) {
  std::ostringstream text;
  text << std::ifstream(kRobots + name).rdbuf();
  return text.str();
}

SystemSpec spec_of(const std::string& text, const ImportOptions& options = {}, std::vector<std::string>* notes = nullptr) {
  const Imported imported = import_robot(text, "robot.xml", options);
  if (notes) *notes = imported.notes;
  try {
    return vehicle_from_text(imported.yaml, "robot.yaml", registry());
  } catch (const InputError& e) {
    ADD_FAILURE() << e.what() << imported.yaml;
    throw;
  }
}
SystemSpec spec_of_file(const std::string& name, const ImportOptions& options = {}, std::vector<std::string>* notes = nullptr) {
  return spec_of(text_of(name), options, notes);
}

/// What is told first of a robot that cannot be read.
Code fault_of(const std::string& text) {
  try {
    const Imported imported = import_robot(text, "robot.xml", {});
    ADD_FAILURE() << "it was read:\n" << imported.yaml;
  } catch (const InputError& e) {
    return e.diagnostics().at(0).code;
  }
  return {};
}

VectorXd vdot_of(const Model& model, const VectorXd& q, const VectorXd& v, const VectorXd& tau) {
  soa::Workspace<double> ws(model);
  VectorXd vdot = VectorXd::Constant(model.nv, kNaN);
  EXPECT_EQ(q.size(), model.nq);
  EXPECT_EQ(v.size(), model.nv);
  EXPECT_EQ(tau.size(), model.nv);
  EXPECT_TRUE(forward_dynamics(model, ws, Inputs{.q = q.data(), .v = v.data(), .tau = tau.data()}, vdot.data()));
  return vdot;
}

VectorXd numbers(std::initializer_list<double> all) {
  return Eigen::Map<const VectorXd>(std::data(all), static_cast<Eigen::Index>(all.size()));
}

double error_of(const VectorXd& got, const VectorXd& want) { return relative(distance(got, want), largest(want)); }

TEST(ImportUrdf, ADoublePendulumHasTheAccelerationsOfItsClosedForm) {
  std::vector<std::string> notes;
  SystemSpec spec = spec_of_file("double_pendulum.urdf", {}, &notes);
  ASSERT_EQ(spec.bodies.size(), 2u) << "the root without mass is the world, the tip a node";
  ASSERT_EQ(spec.bodies[1].nodes.size(), 1u);
  EXPECT_EQ(spec.bodies[1].nodes[0].name, "tip");
  EXPECT_LE(distance(spec.bodies[1].nodes[0].R_BN, Eigen::AngleAxisd(0.5, Vector3d::UnitY()).toRotationMatrix()), 1e-15);
  ASSERT_EQ(spec.bodies[0].hinge.springs.size(), 1u);
  EXPECT_EQ(spec.bodies[0].hinge.springs[0].damping, 0.3);
  EXPECT_EQ(spec.bodies[0].hinge.springs[0].stiffness, 0.0);
  spec.gravity = uniform_gravity({0, 0, -9.81});
  const auto model = compiled(spec);
  const double m1 = 3, m2 = 2, c1 = 0.4, c2 = 0.3, l = 0.8, I1 = 0.2, I2 = 0.08, g = 9.81;
  for (const auto& [q1, q2, w1, w2] : {std::array{0.3, -0.7, 1.1, -2.0}, std::array{2.0, 1.2, -0.4, 0.9}}) {
    const double t1 = 1.7, t2 = -0.6;
    Eigen::Matrix2d M;
    M(1, 1) = m2 * c2 * c2 + I2;
    M(0, 1) = M(1, 0) = M(1, 1) + m2 * l * c2 * std::cos(q2);
    M(0, 0) = m1 * c1 * c1 + I1 + m2 * l * l + M(1, 1) + 2 * m2 * l * c2 * std::cos(q2);
    const double h = m2 * l * c2 * std::sin(q2), both = m2 * c2 * g * std::sin(q1 + q2);
    const Eigen::Vector2d f(t1 + h * (2 * w1 * w2 + w2 * w2) - (m1 * c1 + m2 * l) * g * std::sin(q1) - both, t2 - h * w1 * w1 - both);
    // The damper of the shoulder is not part of forward_dynamics: Simulation adds it.
    EXPECT_LE(error_of(vdot_of(*model, numbers({q1, q2}), numbers({w1, w2}), numbers({t1, t2})),
                       symmetric_solve(Eigen::MatrixXd(M), VectorXd(f))),
              1e-13);
  }
  ASSERT_EQ(notes.size(), 3u);
  EXPECT_EQ(notes[0], "left out, without meaning here: 1 collision, 1 material, 1 transmission, 1 visual");
}

TEST(ImportUrdf, LimitsAndFrictionAreTakenOverWhereAskedFor) {
  ImportOptions options;
  options.stop_stiffness = 500.0;
  options.friction_width = 0.01;
  const SystemSpec spec = spec_of_file("double_pendulum.urdf", options);
  const auto& loads = spec.bodies[0].hinge.loads;
  ASSERT_EQ(loads.size(), 2u);
  EXPECT_EQ(loads[0].law, HingeLaw::stop);
  EXPECT_EQ(loads[1].law, HingeLaw::friction);
  EXPECT_TRUE(spec.bodies[1].hinge.loads.empty());
  EXPECT_TRUE(spec_of_file("double_pendulum.urdf").bodies[0].hinge.loads.empty());
}

TEST(ImportUrdf, DynamicsThatAreLeftOutAreGone) {
  ImportOptions options;
  options.leave_out = {"dynamics"};
  for (const char* type : {"floating", "planar"}) {
    const SystemSpec spec =
        spec_of(fmt::format("<robot name='r'><link name='world'/><link name='a'><inertial><mass value='1'/><inertia ixx='1' iyy='1' "
                            "izz='1'/></inertial></link><joint name='j' type='{}'><parent link='world'/><child link='a'/><dynamics "
                            "damping='1'/></joint></robot>",
                            type),
                options);
    EXPECT_TRUE(spec.bodies[0].hinge.springs.empty()) << type;
  }
}

TEST(ImportUrdf, AMimicJointMovesWithTheOther) {
  for (const bool free : {false, true}) {
    ImportOptions options;
    options.base = free ? ImportOptions::Base::free : ImportOptions::Base::fixed;
    options.initial = {{"left", "0.02"}};
    const SystemSpec spec = spec_of_file("gripper.urdf", options);
    const auto model = compiled(spec);
    EXPECT_EQ(spec.bodies[1].name, "finger_1");
    EXPECT_EQ(spec.bodies[0].hinge.type, free ? "free" : "locked");
    const State start = model->initial_state();
    const Eigen::Index n = model->nv - 2;
    EXPECT_EQ(start.q[model->nq - 2], 0.02);
    EXPECT_NEAR(start.q[model->nq - 1], 0.0, 1e-17) << "-0.5 of 0.02, and 0.01";
    VectorXd v = VectorXd::Zero(model->nv), tau = v;
    v[n] = 0.2, v[n + 1] = -0.1;
    tau[n] = 3.0, tau[n + 1] = 1.0;
    const VectorXd vdot = vdot_of(*model, start.q, v, tau);
    const double s = (3.0 - 0.5 * 1.0) / (0.4 + 0.25 * 0.6);  // one coordinate: the fingers move by s and -0.5 s along y
    if (!free) {
      EXPECT_LE(std::abs(vdot[n] - s) / s, 1e-13);
    }
    EXPECT_LE(std::abs(vdot[n + 1] + 0.5 * vdot[n]) / std::abs(vdot[n]), 1e-13);
  }
}

/// The text of a tree as URDF: every place and inertia in axes of its own, so that a frame taken for another shows.
std::string urdf_of(const SystemSpec& spec, std::mt19937& random, const std::map<std::string, std::string>& mimics = {},
                    const std::string& more = {}) {
  const auto number = [&] { return -1.0 + 2.0 * static_cast<double>(random()) / 4294967296.0; };
  const auto rpy_of = [](const Matrix3d& R) {  // R = Rz(yaw) Ry(pitch) Rx(roll)
    return fmt::format("{} {} {}", std::atan2(R(2, 1), R(2, 2)), std::atan2(-R(2, 0), std::hypot(R(2, 1), R(2, 2))),
                       std::atan2(R(1, 0), R(0, 0)));
  };
  const auto three = [](const Vector3d& a) { return fmt::format("{} {} {}", a.x(), a.y(), a.z()); };
  std::string out = "<robot name=\"random\">\n<link name=\"root\"/>\n";
  for (auto b = spec.bodies.rbegin(); b != spec.bodies.rend(); ++b) {  // outboard first: the order of a URDF is free
    const Matrix3d R = Eigen::Quaterniond(number(), number(), number(), number()).normalized().toRotationMatrix();
    const Matrix3d J = R.transpose() * b->inertia_com * R;
    out += fmt::format("<link name=\"{}\"><inertial><origin xyz=\"{}\" rpy=\"{}\"/><mass value=\"{}\"/>", b->name, three(b->com), rpy_of(R),
                       b->mass);
    out += fmt::format("<inertia ixx=\"{}\" iyy=\"{}\" izz=\"{}\" ixy=\"{}\" ixz=\"{}\" iyz=\"{}\"/></inertial></link>\n", J(0, 0), J(1, 1),
                       J(2, 2), J(0, 1), J(0, 2), J(1, 2));
    const HingeSpec& h = b->hinge;
    static const std::map<std::string, std::string> types{{"revolute", "continuous"}, {"prismatic", "prismatic"}, {"free", "floating"},
                                                          {"locked", "fixed"},        {"planar", "planar"},       {"ball", "spherical"},
                                                          {"free_body", "floating"}};
    out += fmt::format("<joint name=\"to {}\" type=\"{}\"><parent link=\"{}\"/><child link=\"{}\"/><origin xyz=\"{}\" rpy=\"{}\"/>",
                       b->name, types.at(h.type), h.inboard_body.empty() ? "root" : h.inboard_body, b->name, three(h.onode_position),
                       rpy_of(h.onode_R));
    if (const auto axis = h.params.find("axis"); axis != h.params.end()) {
      const auto& u = std::get<std::vector<double>>(axis->second.value);
      out += fmt::format("<axis xyz=\"{} {} {}\"/>", u[0], u[1], u[2]);
    }
    if (const auto mimic = mimics.find(b->name); mimic != mimics.end()) out += mimic->second;
    out += "</joint>\n";
  }
  return out + more + "</robot>\n";
}

TEST(ImportUrdf, RandomTreesComeBackWithTheirAccelerations) {
  double worst = 0.0;
  for (unsigned seed = first_seed(); seed < first_seed() + 60; ++seed) {
    std::mt19937 random(seed);
    const auto number = [&] { return -1.0 + 2.0 * static_cast<double>(random()) / 4294967296.0; };
    const auto vector = [&] { return Vector3d(number(), number(), number()); };
    std::vector<BodySpec> bodies;
    const int n = 2 + static_cast<int>(random() % 9);
    for (int k = 0; k < n; ++k) {
      Matrix3d J = Matrix3d::Zero();
      for (int i = 0; i < 5; ++i) {
        const Vector3d r = vector();
        J += 0.1 * (r.squaredNorm() * Matrix3d::Identity() - r * r.transpose());
      }
      const char* types[] = {"revolute", "revolute", "prismatic", "free", "locked", "ball"};
      const std::string type = types[random() % 6];
      BodySpec b = on(rigid(fmt::format("b{}", k), 1.5 + number(), vector(), J),
                      k == 0 || random() % 5 == 0 ? "" : fmt::format("b{}", random() % static_cast<unsigned>(k)), type,
                      type == "revolute" || type == "prismatic" ? std::vector<Vector3d>{vector()} : std::vector<Vector3d>{}, vector());
      b.hinge.onode_R = Eigen::Quaterniond(number(), number(), number(), number()).normalized().toRotationMatrix();
      if (type == "free" && b.hinge.inboard_body.empty())
        b.hinge.onode_position.setZero(), b.hinge.onode_R.setIdentity();  // it starts there
      bodies.push_back(b);
    }
    SystemSpec spec = system(bodies, uniform_gravity({0.3, -1.0, -9.81}));
    SystemSpec back = spec_of(urdf_of(spec, random));
    back.gravity = spec.gravity;
    ASSERT_EQ(back.bodies.size(), spec.bodies.size());
    const auto here = compiled(spec), there = compiled(back);
    VectorXd q = here->initial_state().q, v(here->nv), tau(here->nv);
    for (double& x : v) x = number();
    for (double& x : tau) x = 5 * number();
    for (const UserBody& u : here->user)
      for (int i = 0; i < u.nq; ++i) q[u.q + i] += u.nq > 3 && i < 4 ? 0.0 : 0.8 * number();
    for (const UserBody& u : here->user)
      if (u.has_attitude()) {
        const Eigen::Vector4d quaternion = Eigen::Vector4d(number(), number(), number(), number()).normalized();
        q.segment<4>(u.q) = quaternion;
      }
    // The bodies come in another order.
    VectorXd q2(there->nq), v2(there->nv), tau2(there->nv), want(there->nv);
    const VectorXd vdot = vdot_of(*here, q, v, tau);
    for (const UserBody& a : here->user)
      for (const UserBody& b : there->user)
        if (a.name == b.name) {
          ASSERT_EQ(a.nq, b.nq);
          ASSERT_EQ(a.hinge_type, b.hinge_type);
          q2.segment(b.q, b.nq) = q.segment(a.q, a.nq);
          v2.segment(b.v, b.nv) = v.segment(a.v, a.nv);
          tau2.segment(b.v, b.nv) = tau.segment(a.v, a.nv);
          want.segment(b.v, b.nv) = vdot.segment(a.v, a.nv);
        }
    if (here->nv == 0) continue;
    worst = worse(worst, error_of(vdot_of(*there, q2, v2, tau2), want));
  }
  EXPECT_LE(worst, 1e-13);
}

/// Published mechanisms with exact accelerations, their loops written as those of research codes. Bodies that are none (no mass, a tensor
/// of no body) go through URDF as others and get theirs afterwards.
class ImportedBenchLoops : public testing::TestWithParam<std::filesystem::path> {};

TEST_P(ImportedBenchLoops, HaveTheirExactAccelerations) {
  const bench_loops::Model bench = bench_loops::read(GetParam());
  if (std::ranges::any_of(bench.spec.loops, [](const LoopSpec& l) { return !l.functions.empty(); }))
    GTEST_SKIP() << "a coupling that is not linear has no element";
  SystemSpec written = bench.spec;
  for (BodySpec& b : written.bodies) b.mass = 1.0, b.com.setZero(), b.inertia_com.setIdentity();
  std::map<std::string, std::string> mimics;
  std::string more;
  const auto end = [](const char* name, const PlaceSpec& place) {
    const Matrix3d& R = place.R;
    return fmt::format("<{} link='{}'><origin xyz='{} {} {}' rpy='{} {} {}'/></{}>", name, place.body.empty() ? "root" : place.body,
                       place.position.x(), place.position.y(), place.position.z(), std::atan2(R(2, 1), R(2, 2)),
                       std::atan2(-R(2, 0), std::hypot(R(2, 1), R(2, 2))), std::atan2(R(1, 0), R(0, 0)), name);
  };
  for (const LoopSpec& loop : bench.spec.loops) {
    if (loop.type == "line" || loop.type == "revolute")  // a pin
      more += fmt::format("<loop name='{}' type='revolute'>{}{}<axis xyz='0 0 1'/></loop>", loop.name, end("predecessor", loop.from),
                          end("successor", loop.to));
    else if (loop.type == "point")
      more += fmt::format("<constraint name='{}' type='position'>{}{}</constraint>", loop.name, end("predecessor", loop.from),
                          end("successor", loop.to));
    else if (loop.type != "coupling")
      GTEST_SKIP() << loop.type << " has no element";
    else if (loop.terms.size() == 2)
      mimics[loop.terms[1].target] =
          fmt::format("<mimic joint='to {}' multiplier='{}' offset='{}'/>", loop.terms[0].target,
                      -loop.terms[0].coefficient / loop.terms[1].coefficient, loop.offset / loop.terms[1].coefficient);
    else {
      const LoopSpec::Term* tips[2] = {nullptr, nullptr};  // the first of each sign is the outermost
      for (const LoopSpec::Term& term : loop.terms)
        if (const LoopSpec::Term*& tip = tips[term.coefficient > 0 ? 0 : 1]; !tip) tip = &term;
      ASSERT_TRUE(tips[0] && tips[1]);
      more += fmt::format("<coupling name='{}'><predecessor link='{}'/><successor link='{}'/><ratio value='{}'/></coupling>", loop.name,
                          tips[0]->target, tips[1]->target, -tips[0]->coefficient / tips[1]->coefficient);
    }
  }
  std::mt19937 random(1);
  SystemSpec back = spec_of(urdf_of(written, random, mimics, more));
  ASSERT_EQ(back.bodies.size(), bench.spec.bodies.size());
  ASSERT_EQ(back.loops.size(), bench.spec.loops.size());
  back.gravity = bench.spec.gravity;
  const auto as_ours = [](std::string name) {
    std::ranges::replace(name, ' ', '_');
    return name;
  };
  std::vector<std::size_t> order;  // ours of theirs
  for (BodySpec& b : back.bodies)
    for (std::size_t i = 0; i < bench.spec.bodies.size(); ++i)
      if (const BodySpec& from = bench.spec.bodies[i]; as_ours(from.name) == b.name) {
        b.type = from.type, b.mass = from.mass, b.com = from.com, b.inertia_com = from.inertia_com;
        b.hinge.q = from.hinge.q, b.hinge.v = from.hinge.v;
        if (from.hinge.type == "free_body") b.hinge.type = "free_body";
        order.push_back(i);
      }
  ASSERT_EQ(order.size(), back.bodies.size());
  const auto theirs = compiled(bench.spec), ours = compiled(back);
  for (const bench_loops::State& s : bench.states) {
    VectorXd q(ours->nq), v(ours->nv), tau(ours->nv), want(ours->nv);
    for (std::size_t i = 0; i < order.size(); ++i) {
      const UserBody &a = theirs->user[order[i]], &b = ours->user[i];
      q.segment(b.q, b.nq) = s.q.segment(a.q, a.nq);
      v.segment(b.v, b.nv) = s.v.segment(a.v, a.nv);
      tau.segment(b.v, b.nv) = s.tau.segment(a.v, a.nv);
      want.segment(b.v, b.nv) = s.vdot.segment(a.v, a.nv);
    }
    EXPECT_LE(error_of(vdot_of(*ours, q, v, tau), want), worse(1e-13, 100.0 * s.floor));
  }
}
INSTANTIATE_TEST_SUITE_P(File, ImportedBenchLoops, testing::ValuesIn(bench_loops::files()),
                         [](const auto& c) { return c.param.stem().string(); });

TEST(ImportUrdf, LinksWithoutMassBecomeNodesOrPartsOfAHinge) {
  const std::string inertial =
      "<inertial><origin xyz='0.1 0.2 0.3'/><mass value='2'/><inertia ixx='0.3' iyy='0.4' izz='0.5' ixy='0.01'/></inertial>";
  // base (no mass) - fixed - hull; a gimbal of two links without mass between hull and dish; a camera fixed to the dish.
  const std::string text =
      "<robot name='r'><link name='base'/><link name='hull'>" + inertial +
      "</link><link name='ring'/><link name='plate'/><link name='dish'>" + inertial +
      "</link><link name='camera'/>"
      "<joint name='a' type='fixed'><parent link='base'/><child link='hull'/><origin xyz='0 0 1' rpy='0 0 0.4'/></joint>"
      "<joint name='az' type='continuous'><parent link='base'/><child link='ring'/><origin xyz='1 0 0' rpy='0.2 0 0'/><axis xyz='0 0 "
      "1'/></joint>"
      "<joint name='m' type='fixed'><parent link='ring'/><child link='plate'/><origin xyz='0 0 0.5' rpy='0 0 0.3'/></joint>"
      "<joint name='el' type='continuous'><parent link='plate'/><child link='dish'/><origin rpy='0 0 0.7'/><axis xyz='0 1 0'/></joint>"
      "<joint name='c' type='fixed'><parent link='dish'/><child link='camera'/><origin xyz='0.3 0 0'/></joint></robot>";
  ImportOptions options;
  options.base = ImportOptions::Base::free;
  const SystemSpec spec = spec_of(text, options);
  ASSERT_EQ(spec.bodies.size(), 2u);
  const BodySpec &hull = spec.bodies[0], &dish = spec.bodies[1];
  EXPECT_EQ(hull.hinge.type, "free");
  EXPECT_EQ(dish.hinge.type, "universal");
  ASSERT_EQ(hull.nodes.size(), 1u);
  EXPECT_EQ(hull.nodes[0].name, "base");
  ASSERT_EQ(dish.nodes.size(), 1u);
  EXPECT_EQ(dish.nodes[0].name, "camera");
  // Where the dish is, from base, by the chain as the file has it.
  const auto model = compiled(spec);
  const double az = 0.6, el = -0.9;
  const VectorXd q = model->initial_state().q;  // of the hull: free where the file has it
  EXPECT_LE(distance(Eigen::Vector4d(q.segment<4>(0)), Eigen::Vector4d(std::cos(0.2), 0, 0, std::sin(0.2))), 1e-15);
  EXPECT_LE(distance(Vector3d(q.segment<3>(4)), Vector3d(0, 0, 1)), 0.0);
  using A = Eigen::AngleAxisd;
  const Matrix3d Rb = A(0.4, Vector3d::UnitZ()).toRotationMatrix();  // hull in base
  Eigen::Isometry3d want = Eigen::Isometry3d::Identity();
  want.linear() = Rb, want.translation() = Vector3d(0, 0, 1);
  want = want.inverse() * Eigen::Translation3d(1, 0, 0) * A(0.2, Vector3d::UnitX()) * A(az, Vector3d::UnitZ()) *
         Eigen::Translation3d(0, 0, 0.5) * A(0.3, Vector3d::UnitZ()) * A(0.7, Vector3d::UnitZ()) *
         A(el, Vector3d::UnitY());  // dish in hull
  const HingeSpec& h = dish.hinge;
  const auto& axes = std::get<std::vector<double>>(h.params.at("axes").value);
  Eigen::Isometry3d got = Eigen::Isometry3d::Identity(), pnode = got;
  got.linear() = h.onode_R, got.translation() = h.onode_position;
  pnode.linear() = h.pnode_R, pnode.translation() = h.pnode_position;
  got = got * A(az, Vector3d(axes[0], axes[1], axes[2]).normalized()) * A(el, Vector3d(axes[3], axes[4], axes[5]).normalized()) *
        pnode.inverse();
  EXPECT_LE(distance(got.matrix(), want.matrix()), 1e-15);
}

// A bracket without mass turns, and the dish is fixed to it: the dish takes the hinge, which stays where the bracket has it.
TEST(ImportUrdf, WhatIsFixedToALinkWithoutMassTakesItsHinge) {
  const SystemSpec spec = spec_of(
      "<robot name='r'><link name='world'/><link name='bracket'/><link name='dish'><inertial><mass value='2'/><inertia ixx='0.3' "
      "iyy='0.4' izz='0.5'/></inertial></link>"
      "<joint name='el' type='continuous'><parent link='world'/><child link='bracket'/><origin xyz='1 0 0.5' rpy='0.2 0 0'/><axis "
      "xyz='0 1 1'/></joint>"
      "<joint name='m' type='fixed'><parent link='bracket'/><child link='dish'/><origin xyz='0.3 0.1 -0.2' rpy='0 0 "
      "0.7'/></joint></robot>");
  ASSERT_EQ(spec.bodies.size(), 1u);
  const HingeSpec& h = spec.bodies[0].hinge;
  ASSERT_EQ(h.type, "revolute");
  using A = Eigen::AngleAxisd;
  for (const double el : {0.0, 0.6}) {
    const Eigen::Isometry3d want = Eigen::Translation3d(1, 0, 0.5) * A(0.2, Vector3d::UnitX()) * A(el, Vector3d(0, 1, 1).normalized()) *
                                   Eigen::Translation3d(0.3, 0.1, -0.2) * A(0.7, Vector3d::UnitZ());
    const auto& axis = std::get<std::vector<double>>(h.params.at("axis").value);
    Eigen::Isometry3d onode = Eigen::Isometry3d::Identity(), pnode = onode;
    onode.linear() = h.onode_R, onode.translation() = h.onode_position;
    pnode.linear() = h.pnode_R, pnode.translation() = h.pnode_position;
    const Eigen::Isometry3d got = onode * A(el, Vector3d(axis[0], axis[1], axis[2]).normalized()) * pnode.inverse();
    EXPECT_LE(distance(got.matrix(), want.matrix()), 1e-15);
  }
}

TEST(ImportUrdf, TheLoopsOfResearchCodesCloseAFourBar) {
  const SystemSpec spec = spec_of_file("four_bar.urdf");
  ASSERT_EQ(spec.loops.size(), 1u);
  const auto model = compiled(spec);
  // A parallelogram: crank and rocker turn alike, the coupler not at all.
  const VectorXd q = model->initial_state().q, vdot = vdot_of(*model, q, numbers({1.5, -1.5, 1.5}), numbers({0.7, 0, 0}));
  // L = (0.5 * 0.05^2 + 0.001 + 0.7 * 0.05^2 + 0.001 + 1.2 * 0.1^2) w^2 / 2: no gravity, so w' = tau / inertia.
  const double a = 0.7 / (1.2 * 0.0025 + 0.002 + 1.2 * 0.01);
  EXPECT_LE(error_of(vdot, numbers({a, -a, a})), 1e-13);
}

// Its end stands on what is fixed to a body, and turned there.
TEST(ImportUrdf, ALoopMayHoldALinkWithoutMass) {
  const std::string inertial = "<inertial><mass value='2'/><inertia ixx='0.3' iyy='0.4' izz='0.5'/></inertial>";
  const SystemSpec spec = spec_of("<robot name='r'><link name='world'/><link name='arm'>" + inertial + "</link><link name='claw'/>" +
                                  "<joint name='q' type='floating'><parent link='world'/><child link='arm'/></joint>"
                                  "<joint name='m' type='fixed'><parent link='arm'/><child link='claw'/><origin xyz='1 0 0' rpy='0 0 "
                                  "1.5707963267948966'/></joint>"
                                  "<loop name='l' type='fixed'><predecessor link='claw'><origin xyz='0.2 0 0' rpy='0.3 0 0'/></predecessor>"
                                  "<successor link='world'><origin xyz='1 0.2 0'/></successor></loop></robot>");
  ASSERT_EQ(spec.loops.size(), 1u);
  const PlaceSpec& end = spec.loops[0].from.body.empty() ? spec.loops[0].to : spec.loops[0].from;
  EXPECT_EQ(end.body, "arm");
  EXPECT_LE(distance(end.position, Vector3d(1, 0.2, 0)), 1e-15);
  using A = Eigen::AngleAxisd;
  EXPECT_LE(distance(end.R, (A(M_PI / 2, Vector3d::UnitZ()) * A(0.3, Vector3d::UnitX())).toRotationMatrix()), 1e-15);
}

// ratio times the angles on the way to the predecessor = those on the way to the successor, from their nearest common ancestor on.
TEST(ImportUrdf, TheCouplingsOfResearchCodesSumTheAnglesOfTheirWays) {
  std::string text = "<robot name='r'><link name='root'/>";
  const auto link = [&](const std::string& name, const std::string& parent) {
    text += fmt::format(
        "<link name='{0}'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1'/></inertial></link><joint name='to {0}' "
        "type='continuous'><parent link='{1}'/><child link='{0}'/><axis xyz='0 0 1'/></joint>",
        name, parent);
  };
  link("a", "root"), link("a2", "a"), link("b", "root"), link("b2", "b");
  const std::string ways = "<predecessor link='a2'/><successor link='b2'/><ratio value='3'/>";
  for (const std::string& one :
       {"<coupling name='c'>" + ways + "</coupling>", "<constraint type='rolling' name='c'>" + ways + "</constraint>",
        std::string("<joint_constraint name='c'><parent link='a2'/><child link='b2'/><gear_ratio value='3'/></joint_constraint>")}) {
    const SystemSpec spec = spec_of(text + one + "</robot>");
    ASSERT_EQ(spec.loops.size(), 1u);
    std::map<std::string, double> terms;
    for (const auto& term : spec.loops[0].terms) terms[term.target] = term.coefficient;
    EXPECT_EQ(terms, (std::map<std::string, double>{{"a", 3.0}, {"a2", 3.0}, {"b", -1.0}, {"b2", -1.0}}));
    ImportOptions options;
    options.initial = {{"to a", "0.2"}, {"to b", "0.1"}};
    const SystemSpec begun = spec_of(text + one + "</robot>", options);
    ASSERT_EQ(begun.find("b2")->hinge.q.size(), 1u) << "the last joint of the successor follows";
    EXPECT_NEAR(begun.find("b2")->hinge.q[0], 3 * 0.2 - 0.1, 1e-15);
  }
  // Angles and lengths are not summed.
  std::string slides = text;
  slides.replace(slides.find("name='to b2' type='continuous'"), 30, "name='to b2' type='prismatic'");
  EXPECT_EQ(fault_of(slides + "<coupling><predecessor link='a2'/><successor link='b2'/><ratio value='3'/></coupling></robot>"),
            Code::not_imported);
}

// `world` is the ground by its name, whatever it weighs.
TEST(ImportUrdf, ARootThatIsCalledWorldIsHeld) {
  for (const auto& [name, type] : {std::pair{"world", "locked"}, {"hull", "free"}}) {
    const SystemSpec spec = spec_of(fmt::format(
        "<robot name='r'><link name='{}'><inertial><mass value='2'/><inertia ixx='0.3' iyy='0.4' izz='0.5'/></inertial></link></robot>",
        name));
    EXPECT_EQ(spec.bodies.at(0).hinge.type, type) << name;
  }
}

TEST(ImportUrdf, ALoopDoesNotHoldALinkWithoutMassBetweenTwoJoints) {
  const std::string inertial = "<inertial><mass value='2'/><inertia ixx='0.3' iyy='0.4' izz='0.5'/></inertial>";
  const std::string gimbal =
      "<robot name='r'><link name='world'/><link name='ring'/><link name='dish'>" + inertial +
      "</link><joint name='az' type='continuous'><parent link='world'/><child link='ring'/><axis xyz='0 0 1'/></joint>"
      "<joint name='el' type='continuous'><parent link='ring'/><child link='dish'/><axis xyz='0 1 0'/></joint>";
  const auto held = [&](const std::string& link) {
    return gimbal + "<loop name='l' type='spherical'><predecessor link='" + link + "'/><successor link='world'/></loop></robot>";
  };
  EXPECT_EQ(spec_of(held("dish")).loops.size(), 1u);
  EXPECT_EQ(fault_of(held("ring")), Code::not_imported);
}

TEST(ImportMjcf, AFourBarIsTheOneWrittenByHand) {
  const SystemSpec spec = spec_of_file("four_bar.xml");
  const SystemSpec by_hand = vehicle_from_text(R"(
cardan: 1
gravity: {uniform: [0, 0, -9.81]}
bodies:
  crank: {mass: 0.5, com: [0, 0, 0.05], inertia: [0.001, 0.001, 0.0005],
          hinge: {type: revolute, to: {body: world, position: [0, 0, 0.5]}, axis: [0, 1, 0]}}
  coupler: {mass: 1.2, com: [0.15, 0, 0], inertia: [0.001, 0.01, 0.01],
          hinge: {type: revolute, to: {body: crank, position: [0, 0, 0.1]}, axis: [0, 1, 0]}}
  rocker: {mass: 0.7, com: [0, 0, 0.06], inertia: [0.002, 0.002, 0.0005],
          hinge: {type: revolute, to: {body: world, position: [0.3, 0, 0.5]}, axis: [0, 1, 0]}}
loops:
  pin: {type: revolute, axis: [0, 1, 0], from: {body: rocker, position: [0, 0, 0.1]}, to: {body: coupler, position: [0.3, 0, 0]}}
)",
                                               "by_hand.yaml", registry());
  const auto a = compiled(spec), b = compiled(by_hand);
  const double s = 0.4;
  const VectorXd q = numbers({s, -s, s}), v = numbers({2.0, -2.0, 2.0}), tau = numbers({0.3, -0.1, 0.2});
  EXPECT_LE(error_of(vdot_of(*a, q, v, tau), vdot_of(*b, q, v, tau)), 1e-13);
  EXPECT_EQ(spec.bodies[0].hinge.springs.at(0).damping, 0.01);
  EXPECT_TRUE(spec.bodies[1].hinge.springs.empty()) << "the class is overruled";
  EXPECT_EQ(spec.bodies[2].nodes.at(0).name, "pen");
}

TEST(ImportMjcf, ChainsOfJointsAreHingesWithTheSamePoses) {
  const SystemSpec spec = spec_of_file("arm.xml");
  ASSERT_EQ(spec.bodies.size(), 6u);
  const auto body = [&](const char* name) -> const BodySpec& { return *spec.find(name); };
  EXPECT_EQ(body("base").hinge.type, "free");
  EXPECT_EQ(body("shoulder").hinge.type, "universal");
  EXPECT_EQ(body("lens").hinge.type, "locked");
  EXPECT_EQ(body("sled").hinge.type, "planar");
  EXPECT_EQ(body("puck").hinge.type, "ball");
  EXPECT_EQ(body("shoulder").hinge.pnode_position, Vector3d(0.01, 0, 0));
  EXPECT_EQ(body("shoulder").hinge.onode_position, Vector3d(0.31, 0, 0));
  EXPECT_EQ(body("sled").hinge.pnode_position, Vector3d(0.2, 0.1, 0));
  EXPECT_EQ(body("puck").hinge.springs.size(), 3u);
  ASSERT_EQ(body("hand").hinge.springs.size(), 1u);
  EXPECT_EQ(body("hand").hinge.springs[0].stiffness, 2.0) << "of the class in a class";
  EXPECT_EQ(body("hand").hinge.springs[0].damping, 0.02) << "of the class around it";
  EXPECT_NEAR(body("hand").hinge.springs[0].rest, 20 * M_PI / 180, 1e-15) << "angles are in degrees";
  ImportOptions stops;
  stops.stop_stiffness = 10.0;
  EXPECT_NEAR(spec_of_file("arm.xml", stops).find("shoulder")->hinge.loads.at(0).parameters.at(0), -100 * M_PI / 180, 1e-15)
      << "counted from ref";
  EXPECT_NEAR(spec_of_file("arm.xml", stops).find("shoulder")->hinge.loads.at(0).parameters.at(1), 35 * M_PI / 180, 1e-15);
  EXPECT_EQ(body("hand").nodes.at(0).name, "frame");
  EXPECT_LE(distance(Vector3d(body("lens").nodes.at(0).R_BN * Vector3d::UnitZ()), Vector3d::UnitX()), 1e-15);
  // The base starts where the file has it, turned by a quarter about z.
  const auto model = compiled(spec);
  const State start = model->initial_state();
  EXPECT_LE(distance(Vector3d(start.q.segment<3>(4)), Vector3d(0, 0, 1)), 0.0);
  EXPECT_LE(distance(Eigen::Vector4d(start.q.segment<4>(0)), Eigen::Vector4d(std::sqrt(0.5), 0, 0, std::sqrt(0.5))), 1e-15);
  ASSERT_EQ(spec.loops.size(), 1u);
  EXPECT_EQ(spec.loops[0].terms.at(0).target, "shoulder.angle_1");
  EXPECT_EQ(spec.loops[0].terms.at(1).target, "hand");
  EXPECT_EQ(spec.loops[0].terms.at(1).coefficient, 2.0);
  // Of the cylinder, turned from z by 2 atan(0.75) about y.
  const double m = 500 * M_PI * 0.03 * 0.03 * 0.1, across = m * (0.03 * 0.03 / 4 + 0.1 * 0.1 / 12), along = m * 0.03 * 0.03 / 2;
  const Vector3d axis(0.96, 0, 0.28);
  const Matrix3d J = across * Matrix3d::Identity() + (along - across) * axis * axis.transpose();
  EXPECT_LE(relative(distance(body("hand").inertia_com, J), across), 1e-14);
}

/// A robot of one body of MJCF, turned and shifted, on these joints.
std::string on_joints(const std::string& joints) {
  return "<mujoco><worldbody><body name='b' pos='1 2 3' euler='30 0 0'>" + joints +
         "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body></worldbody></mujoco>";
}

TEST(ImportMjcf, JointsOfABodyThatAreOneHingeBecomeIt) {
  const Matrix3d R = Eigen::AngleAxisd(M_PI / 6, Vector3d::UnitX()).toRotationMatrix();
  const auto hinge = [](const std::string& joints) { return spec_of(on_joints(joints)).bodies.at(0).hinge; };
  const auto expect_through = [&](const HingeSpec& h, const char* type, const Vector3d& point) {
    EXPECT_EQ(h.type, type);
    EXPECT_LE(distance(h.pnode_position, point), 1e-15);
    EXPECT_LE(distance(h.onode_position, Vector3d(Vector3d(1, 2, 3) + R * point)), 1e-15);
  };
  // The axis about which it turns has a place, that along which it slides has none.
  const std::string turns = "<joint type='hinge' axis='0 0 1' pos='0.1 0.2 0'/>", slides = "<joint type='slide' axis='0 0 2' pos='5 5 5'/>";
  expect_through(hinge(turns + slides), "cylindrical", {0.1, 0.2, 0});
  expect_through(hinge(slides + turns), "cylindrical", {0.1, 0.2, 0});
  // Axes at 45 degrees that meet away from the place of either.
  expect_through(hinge("<joint axis='0 0 1'/><joint axis='1 0 1' pos='0.5 0 1.5'/>"), "universal", {0, 0, 1});
  const HingeSpec h = hinge("<joint type='slide' axis='0 1 0'/><joint type='slide' axis='0 0 1'/><joint type='slide' axis='1 0 0'/>");
  EXPECT_EQ(h.type, "translational");
  EXPECT_LE(distance(Vector3d(h.onode_R * Vector3d::UnitX()), Vector3d(R * Vector3d::UnitY())), 1e-15) << "x is the first slide";
  EXPECT_LE(distance(Matrix3d(h.onode_R * h.pnode_R.transpose()), R), 1e-15) << "as the file has it where all are zero";
  for (const char* no_hinge : {"<joint axis='0 0 1'/><joint axis='0 0 1'/>",
                               "<joint type='slide' axis='1 0 0'/><joint type='slide' axis='1 1 0'/><joint axis='0 0 1'/>"})
    EXPECT_EQ(fault_of(on_joints(no_hinge)), Code::not_imported) << no_hinge;
}

// Two axes that meet, one of them of a body without mass: seen from the other's it stands elsewhere.
TEST(ImportMjcf, TheJointOfABodyWithoutMassKeepsItsPlace) {
  const HingeSpec h = spec_of(
                          "<mujoco><worldbody><body name='ring'><joint axis='0 0 1' pos='0.1 0.2 0'/><body name='dish' pos='0.5 0 0' "
                          "euler='0 0 90'><joint axis='0 1 0' pos='0.2 0 0.3'/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>"
                          "</body></body></worldbody></mujoco>")
                          .bodies.at(0)
                          .hinge;
  EXPECT_EQ(h.type, "universal");
  EXPECT_LE(distance(h.pnode_position, Vector3d(0.2, 0.4, 0.3)), 1e-15);
  EXPECT_LE(distance(h.onode_position, Vector3d(0.1, 0.2, 0.3)), 1e-15);
}

TEST(ImportMjcf, WhatStandsOnABodyWithoutMassStandsOnTheOneThatCarriesIt) {
  const std::string text =
      "<worldbody><body name='a'><joint/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/><body name='b' pos='1 0 0'><geom size='1'/>"
      "<site name='s' pos='0 2 0'/></body></body></worldbody></mujoco>";
  const SystemSpec spec = spec_of("<mujoco><compiler inertiafromgeom='false'/>" + text);
  ASSERT_EQ(spec.bodies.size(), 1u) << "geoms have no mass there";
  const auto node = std::ranges::find(spec.bodies[0].nodes, "s", &NodeSpec::name);
  ASSERT_NE(node, spec.bodies[0].nodes.end());
  EXPECT_LE(distance(node->position, Vector3d(1, 2, 0)), 0.0);
  EXPECT_EQ(spec_of("<mujoco>" + text).bodies.size(), 2u);
}

TEST(ImportMjcf, SpringsRestWhereTheyAreCountedFromRef) {
  const SystemSpec spec = spec_of(on_joints("<joint stiffness='2' springref='20' ref='5'/>"));
  EXPECT_NEAR(spec.bodies.at(0).hinge.springs.at(0).rest, 15 * M_PI / 180, 1e-15);
}

// Its default is 0 1 0 0 0, of which the first is given.
TEST(ImportMjcf, APolynomialOfOneNumberIsALineOfSlopeOne) {
  const LoopSpec loop =
      spec_of(
          "<mujoco><worldbody><body><joint name='j'/><geom size='1'/></body><body><joint name='k'/><geom size='1'/></body>"
          "</worldbody><equality><joint joint1='j' joint2='k' polycoef='0.1'/></equality></mujoco>",
          [] {
            ImportOptions options;
            options.initial = {{"k", "0.3"}};
            return options;
          }())
          .loops.at(0);
  ASSERT_EQ(loop.terms.size(), 2u);
  EXPECT_EQ(loop.terms[1].coefficient, -loop.terms[0].coefficient);
  EXPECT_EQ(loop.offset, 0.1);
}

// Its mass would be gone without a word: what has none and is fixed becomes a node.
TEST(ImportMjcf, ABodyWithoutGeomsKeepsItsInertialWhereGeomsGoBeforeIt) {
  const SystemSpec spec = spec_of(
      "<mujoco><compiler inertiafromgeom='true'/><worldbody><body name='a'><joint/><inertial pos='0 0 0' mass='7' diaginertia='1 1 1'/>"
      "<geom type='box' size='1 1 1' mass='3'/><body name='b'><inertial pos='0 0 0' mass='2' diaginertia='1 1 1'/></body></body>"
      "</worldbody></mujoco>");
  ASSERT_EQ(spec.bodies.size(), 2U);
  EXPECT_EQ(spec.find("a")->mass, 3.0);
  EXPECT_EQ(spec.find("b")->mass, 2.0);
}

TEST(ImportMjcf, ForcesThatAreLeftOutAreToldByKind) {
  std::vector<std::string> notes;
  spec_of(
      "<mujoco><worldbody><body name='b'><joint name='j'/><geom size='1'/></body></worldbody><actuator><position joint='j' kp='10'/><motor "
      "joint='j'/></actuator><sensor><jointpos joint='j'/></sensor></mujoco>",
      {}, &notes);
  EXPECT_EQ(notes, (std::vector<std::string>{
                       "left out, without meaning here: 1 sensor jointpos",
                       "left to devices of the vehicle and to the mission, no force here: 1 actuator motor, 1 actuator position"}));
}

// Of the forms of orientation one counts: another than quat goes before quat, that of the element before that of its class.
TEST(ImportMjcf, OneFormOfOrientationCounts) {
  const auto axis_of = [](const std::string& of_class, const std::string& own) {  // z of a site
    const SystemSpec spec = spec_of("<mujoco><default><site " + of_class +
                                    "/></default><worldbody><body name='b'><joint/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>"
                                    "<site name='s' " +
                                    own + "/></body></worldbody></mujoco>");
    return Vector3d(spec.bodies[0].nodes.at(0).R_BN * Vector3d::UnitZ());
  };
  const auto x = Vector3d::UnitX(), y = Vector3d::UnitY();
  EXPECT_LE(distance(axis_of("euler='0 90 0'", ""), x), 1e-15);
  EXPECT_LE(distance(axis_of("euler='0 90 0'", "zaxis='0 1 0'"), y), 1e-15);
  EXPECT_LE(distance(axis_of("quat='1 0 1 0'", "euler='-90 0 0'"), y), 1e-15);
  EXPECT_LE(distance(axis_of("euler='0 90 0'", "quat='1 0 0 0'"), x), 1e-15);
  EXPECT_LE(distance(axis_of("quat='1 0 1 0'", "quat='1 -1 0 0'"), y), 1e-15);
}

TEST(ImportMjcf, ASiteLiesInTheMiddleOfItsEnds) {
  const SystemSpec spec = spec_of(
      "<mujoco><worldbody><body name='b'><joint/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>"
      "<site name='s' type='capsule' fromto='1 0 2 5 0 2'/></body></worldbody></mujoco>");
  const auto& node = spec.bodies[0].nodes.at(0);
  EXPECT_LE(distance(node.position, Vector3d(3, 0, 2)), 0.0);
  EXPECT_LE(distance(Vector3d(node.R_BN * Vector3d::UnitZ()), Vector3d(-1, 0, 0)), 1e-15) << "z from the second end to the first";
}

// What follows by a polynomial starts where it must, and stays there.
TEST(ImportMjcf, EqualitiesBeyondLinearAreCouplingsToo) {
  ImportOptions options;
  options.initial.emplace_back("k", "0.4");
  const SystemSpec spec = spec_of(
      "<mujoco><compiler angle='radian'/><worldbody>"
      "<body name='a'><joint name='j' axis='0 1 0'/><inertial pos='0.1 0 0' mass='1' diaginertia='1 1 1'/></body>"
      "<body name='b'><joint name='k' axis='1 0 0'/><inertial pos='0 0.2 0' mass='1' diaginertia='1 1 1'/></body></worldbody>"
      "<equality><joint joint1='j' joint2='k' polycoef='0.1 -0.5 2 0 -1'/></equality></mujoco>",
      options);
  ASSERT_EQ(spec.loops.size(), 1U);
  const auto model = compiled(spec);
  const double x = 0.4, follows = 0.1 - 0.5 * x + 2 * x * x - std::pow(x, 4), slope = -0.5 + 4 * x - 4 * std::pow(x, 3);
  EXPECT_NEAR(model->initial_state().q[0], follows, 1e-15);
  EXPECT_EQ(model->initial_state().q[1], 0.4);
  Workspace ws(*model);
  const Eigen::MatrixXd G = loop_matrix(*model, ws, model->initial_state().q.data());
  EXPECT_LE(distance(VectorXd(G.row(0)), VectorXd(Eigen::Vector2d(1, -slope))), 1e-14);
}

TEST(ImportMjcf, GeomsHaveTheMomentsOfTheirVolume) {
  // Slices across z: a disc or an ellipse at each height, Simpson's rule.
  const auto check = [](const std::string& geom, double height, auto&& half_axes) {
    const SystemSpec spec = spec_of("<mujoco><worldbody><body name='b'><freejoint/>" + geom + "</body></worldbody></mujoco>");
    const int n = 20000;
    double m = 0, xx = 0, zz = 0;
    for (int i = 0; i <= n; ++i) {
      const double z = -height + 2 * height * i / n, weight = (i == 0 || i == n ? 1 : i % 2 ? 4 : 2) * 2 * height / n / 3;
      const auto [a, b] = half_axes(z);
      const double slice = 1000 * M_PI * a * b * weight;
      m += slice, xx += slice * (b * b / 4 + z * z), zz += slice * (a * a + b * b) / 4;
    }
    EXPECT_LE(relative(spec.bodies[0].mass - m, m), 1e-7) << geom;
    EXPECT_LE(relative(spec.bodies[0].inertia_com(0, 0) - xx, xx), 1e-7) << geom;
    EXPECT_LE(relative(spec.bodies[0].inertia_com(2, 2) - zz, zz), 1e-7) << geom;
  };
  const auto round = [](double square) { return std::sqrt(std::max(square, 0.0)); };
  const auto ball = [&](double z) {
    const double r = round(0.04 - z * z);
    return std::pair(r, r);
  };
  const auto pill = [&](double z) {
    const double over = std::max(std::abs(z) - 0.5, 0.0), r = round(0.04 - over * over);
    return std::pair(r, r);
  };
  const auto egg = [&](double z) {
    const double f = round(1 - z * z / 0.09);
    return std::pair(0.1 * f, 0.2 * f);
  };
  check("<geom size='0.2'/>", 0.2, ball);
  check("<geom type='capsule' size='0.2 0.5'/>", 0.7, pill);
  check("<geom type='ellipsoid' size='0.1 0.2 0.3'/>", 0.3, egg);
  check("<geom type='cylinder' size='0.2 0.5'/>", 0.5, [](double) { return std::pair(0.2, 0.2); });
  // Two boxes that make one: parallel axes.
  const SystemSpec two = spec_of(
      "<mujoco><worldbody><body name='b'><freejoint/><geom type='box' size='0.1 0.2 0.3' pos='0.1 1 0'/><geom type='box' size='0.1 0.2 "
      "0.3' pos='-0.1 "
      "1 0'/></body></worldbody></mujoco>");
  const double m = 1000 * 8 * 0.2 * 0.2 * 0.3;
  EXPECT_LE(relative(two.bodies[0].mass - m, m), 1e-15);
  EXPECT_LE(distance(two.bodies[0].com, Vector3d(0, 1, 0)), 1e-15);
  EXPECT_LE(distance(two.bodies[0].inertia_com, diagonal({m / 3 * 0.13, m / 3 * 0.13, m / 3 * 0.08})), 1e-13 * m);
  // Two balls aside of every axis.
  const Vector3d d(0.3, -0.2, 0.5);
  const SystemSpec aside = spec_of(
      "<mujoco><worldbody><body name='b'><freejoint/><geom size='0.1' mass='2' pos='0.3 -0.2 0.5'/><geom size='0.1' mass='2' pos='-0.3 0.2 "
      "-0.5'/></body></worldbody></mujoco>");
  const Matrix3d J = 4 * ((0.4 * 0.01 + d.squaredNorm()) * Matrix3d::Identity() - d * d.transpose());
  EXPECT_LE(distance(aside.bodies[0].inertia_com, J), 1e-15);
}

TEST(ImportMjcf, OrientationsAreReadInEachOfTheirForms) {
  const auto turned = [](const std::string& compiler, const std::string& form) {
    return spec_of("<mujoco>" + compiler + "<worldbody><body name='b' " + form +
                   "><joint/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body></worldbody></mujoco>")
        .bodies[0]
        .hinge.onode_R;
  };
  using A = Eigen::AngleAxisd;
  const auto x = Vector3d::UnitX(), y = Vector3d::UnitY(), z = Vector3d::UnitZ();
  const double d = M_PI / 180;
  EXPECT_LE(distance(turned("", "euler='10 20 30'"), (A(10 * d, x) * A(20 * d, y) * A(30 * d, z)).toRotationMatrix()), 1e-15);
  EXPECT_LE(distance(turned("<compiler eulerseq='XYZ' angle='radian'/>", "euler='0.1 0.2 0.3'"),
                     (A(0.3, z) * A(0.2, y) * A(0.1, x)).toRotationMatrix()),
            1e-15);
  EXPECT_LE(distance(turned("", "axisangle='0 2 0 90'"), A(90 * d, y).toRotationMatrix()), 1e-15);
  EXPECT_LE(distance(turned("", "quat='2 0 2 0'"), A(90 * d, y).toRotationMatrix()), 1e-15);
  EXPECT_LE(distance(turned("", "xyaxes='0 1 0 -3 1 0'"), A(90 * d, z).toRotationMatrix()), 1e-15);
  EXPECT_LE(distance(turned("", "zaxis='1 0 0'"), A(90 * d, y).toRotationMatrix()), 1e-15);
  // Whichever of the four numbers of its quaternion is the largest, and where all but one are none.
  for (int k = 0; k < 4; ++k)
    for (const double largest : {0.9, -0.9}) {
      Eigen::Vector4d q(0.1, -0.2, 0.3, 0.25);
      q[k] = largest;
      Eigen::Vector4d alone = Eigen::Vector4d::Zero();
      alone[k] = 1.0;
      for (const Eigen::Vector4d& one : {q, alone})
        EXPECT_LE(distance(turned("", fmt::format("quat='{} {} {} {}'", one[0], one[1], one[2], one[3])),
                           Eigen::Quaterniond(one[0], one[1], one[2], one[3]).normalized().toRotationMatrix()),
                  1e-15)
            << one.transpose();
    }
}

TEST(ImportMjcf, WeldsHoldTheRelativePose) {
  const std::string bodies =
      "<worldbody><body name='a' pos='1 0 0' euler='0 0 90'><joint axis='1 0 0'/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/><site "
      "name='s' pos='0 0 "
      "1'/></body><body name='b' pos='0 2 0'><joint axis='0 1 0'/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/><site name='t' "
      "pos='1 -2 1' euler='0 0 "
      "90'/></body></worldbody>";
  const auto loop = [&](const std::string& equality) {
    return spec_of("<mujoco>" + bodies + "<equality>" + equality + "</equality></mujoco>").loops.at(0);
  };
  const LoopSpec weld = loop("<weld body1='a' body2='b'/>");
  EXPECT_EQ(weld.type, "weld");
  EXPECT_LE(distance(weld.from.position, Vector3d(2, 1, 0)), 1e-15);
  EXPECT_LE(distance(weld.from.R, Eigen::AngleAxisd(-M_PI / 2, Vector3d::UnitZ()).toRotationMatrix()), 1e-15);
  const LoopSpec given = loop("<weld body1='a' body2='b' relpose='2 1 0 1 0 0 -1'/>");
  EXPECT_LE(distance(given.from.position, weld.from.position), 1e-15);
  EXPECT_LE(distance(given.from.R, weld.from.R), 1e-15);
  const LoopSpec to_world = loop("<connect body1='a' anchor='0 0 1'/>");
  EXPECT_EQ(to_world.to.body, "");
  EXPECT_LE(distance(to_world.to.position, Vector3d(1, 0, 1)), 1e-15);
  const LoopSpec from_world = loop("<weld body1='world' body2='b'/>");
  EXPECT_EQ(from_world.from.body, "");
  EXPECT_LE(distance(from_world.from.position, Vector3d(0, 2, 0)), 0.0);
  EXPECT_EQ(loop("<connect body1='a' body2='world' anchor='0 0 1'/>").to.position, to_world.to.position);
  const LoopSpec sites = loop("<connect site1='s' site2='t'/>");
  EXPECT_LE(distance(sites.to.position, Vector3d(1, -2, 1)), 0.0);
}

// MuJoCo: torquescale 0 makes the weld a connect, at its anchor on the second body.
TEST(ImportMjcf, AWeldThatDoesNotCareForRotationsIsAPoint) {
  const std::string bodies =
      "<worldbody><body name='a' pos='1 0 0' euler='0 0 90'><joint axis='1 0 0'/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/><site "
      "name='s' pos='0 0 1'/></body><body name='b' pos='0 2 0'><joint axis='0 1 0'/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>"
      "<site name='t' pos='1 -2 1'/></body></worldbody>";
  const auto loop = [&](const std::string& equality) {
    return spec_of("<mujoco>" + bodies + "<equality>" + equality + "</equality></mujoco>").loops.at(0);
  };
  const LoopSpec as_it_is = loop("<weld body1='a' body2='b' anchor='0.3 0.2 0.1' torquescale='0'/>");
  EXPECT_EQ(as_it_is.type, "point");
  EXPECT_LE(distance(as_it_is.to.position, Vector3d(0.3, 0.2, 0.1)), 0.0);
  EXPECT_LE(distance(as_it_is.from.position, Vector3d(2.2, 0.7, 0.1)), 1e-15);
  const LoopSpec given = loop("<weld body1='a' body2='b' anchor='0.3 0.2 0.1' relpose='2 1 0 1 0 0 1' torquescale='0'/>");
  EXPECT_EQ(given.type, "point");
  EXPECT_LE(distance(given.from.position, Vector3d(1.8, 1.3, 0.1)), 1e-15);
  const LoopSpec sites = loop("<weld site1='s' site2='t' torquescale='0'/>");
  EXPECT_EQ(sites.type, "point");
  EXPECT_LE(distance(sites.to.position, Vector3d(1, -2, 1)), 0.0);
  EXPECT_EQ(loop("<weld body1='a' body2='b' torquescale='0.5'/>").type, "weld");
}

TEST(Import, NamesAndTextsOfOthersStayInsideOfTheirComments) {
  const std::string text =
      "<robot name=\"it's: &#10;x: 1\"><link name=\"a.b&#10;  evil: 1\"><inertial><mass value='1'/><inertia ixx='1' iyy='1' "
      "izz='1'/></inertial></link>"
      "<link name='world'/><joint name='j &quot; #&#10;- x' type='continuous'><parent link='world'/><child link=\"a.b&#10;  evil: "
      "1\"/></joint></robot>";
  const SystemSpec spec = spec_of(text);
  ASSERT_EQ(spec.bodies.size(), 1u);
  EXPECT_EQ(spec.bodies[0].name, "a_b___evil__1");
  EXPECT_EQ(spec.name, "it's: ?x: 1");
}

}  // namespace
}  // namespace cardan::test
