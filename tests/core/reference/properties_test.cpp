// What the reference vectors do not contain: central gravity, springs, locked hinges, order of the bodies, refusals.
#include <gtest/gtest.h>

#include <algorithm>

#include "core/reference/dense_dynamics.hpp"
#include "core/reference/loops.hpp"
#include "core/reference/quad.hpp"
#include "tests/support/oracle_reader.hpp"
#include "tests/support/worse.hpp"

namespace cardan::reference {
namespace {
using test::largest;
using Vec = Eigen::VectorXd;

oracle::Case file(const std::string& name) { return oracle::read(CARDAN_SOURCE_DIR "/tests/reference/oracle/" + name + ".json"); }

ParamValues axis(double x, double y, double z) {
  ParamValues out;
  out["axis"].value = std::vector<double>{x, y, z};
  return out;
}

BodySpec rigid(const std::string& name, const std::string& hinge) {
  BodySpec b;
  b.name = name;
  b.mass = 3.0;
  b.com = {0.1, -0.2, 0.3};
  b.inertia_com = Eigen::Vector3d(1.0, 2.0, 2.5).asDiagonal();
  b.hinge.type = hinge;
  return b;
}

SystemSpec in_central_field(BodySpec body) {
  SystemSpec spec;
  spec.bodies.push_back(std::move(body));
  spec.gravity.kind = GravitySpec::Kind::central;
  spec.gravity.mu = 5e4;
  spec.gravity.centre = {1.0, 2.0, 3.0};
  return spec;
}

/// q = [attitude; position; eta].
Vec free_q(const Eigen::Vector3d& position, const Vec& eta = {}) {
  Vec q(7 + eta.size());
  q << Eigen::Vector4d(0.8, -0.2, 0.4, 0.3).normalized(), position, eta;
  return q;
}

void expect_near(const Vec& a, const Vec& b, double relative) {
  ASSERT_EQ(a.size(), b.size());
  EXPECT_LE(largest(a - b), relative * largest(b)) << a.transpose() << "\n" << b.transpose();
}

// A rigid body of eight points with the gradient, against the exact field summed over the same points: what is left out
// is of the order (size / distance)^2 = 4e-8 of the force and size / distance = 2e-4 of the torque (third-order
// moments).
TEST(TwinCentralGravity, GradientIsThatOfTheFieldSummedOverTheMasses) {
  SystemSpec spec = in_central_field(rigid("b", "free"));
  BodySpec& b = spec.bodies[0];
  b.mass = 0.0;
  b.com.setZero();
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 8; ++i) points.emplace_back(i & 1 ? 0.3 : -0.5, i & 2 ? 0.2 : -0.1, i & 4 ? 0.05 * i : -0.1);
  std::vector<double> masses = {1.0, 0.4, 2.0, 0.7, 1.1, 0.3, 0.9, 1.6};
  for (int i = 0; i < 8; ++i) b.mass += masses[i], b.com += masses[i] * points[i];
  b.com /= b.mass;
  b.inertia_com.setZero();
  for (int i = 0; i < 8; ++i) b.inertia_com -= masses[i] * tilde<double>(points[i] - b.com) * tilde<double>(points[i] - b.com);

  const Vec q = free_q({-2000.0, 1500.0, 1000.0}), v = Vec::Zero(6);
  const DenseState<double> s = DenseTwin<double>(spec).at(q, v);
  const Eigen::Matrix3d R = s.bodies[0].R;
  Eigen::Vector3d force = Eigen::Vector3d::Zero(), torque = force;  // world axes; torque about the mass centre
  double energy = 0.0;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d arm = R * (points[i] - b.com), d = s.com + arm - spec.gravity.centre;
    const Eigen::Vector3d f = -spec.gravity.mu * masses[i] / std::pow(d.norm(), 3) * d;
    force += f;
    torque += arm.cross(f);
    energy -= spec.gravity.mu * masses[i] / d.norm();
  }
  const Eigen::Vector3d got_force = s.gravity_force.tail(3);
  const Eigen::Vector3d got_torque = R * s.gravity_force.head(3) - (R * b.com).cross(got_force);
  expect_near(got_force, force, 1e-10);
  expect_near(got_torque, torque, 1e-3);
  EXPECT_NEAR(s.gravity_energy, energy, 1e-11 * std::abs(energy));  // next term: (size / distance)^3

  spec.gravity.gradient = false;
  const DenseState<double> plain = DenseTwin<double>(spec).at(q, v);
  const Eigen::Vector3d plain_force = plain.gravity_force.tail(3);
  EXPECT_LE((R * plain.gravity_force.head(3) - (R * b.com).cross(plain_force)).norm(), 1e-15 * force.norm());
}

// Two ways to the same body: the sum over its nodes and the integrals alone. Level 2, no rotary inertia: equal.
TEST(TwinModalBody, SumOverNodesEqualsIntegralsInCentralGravity) {
  const oracle::Case c = file("53_body_levels_translational");
  SystemSpec nodal = in_central_field(c.spec.bodies[0]), integral = nodal;
  nodal.bodies[0].hinge.type = integral.bodies[0].hinge.type = "free";
  auto bare = std::make_shared<ModalData>(*nodal.bodies[0].modal);
  bare->mass_nodes.clear();
  integral.bodies[0].modal = bare;
  const Vec q = free_q({8.0, -9.0, 11.0}, c.q.tail(3));
  const DenseState<double> a = DenseTwin<double>(nodal).at(q, c.v), b = DenseTwin<double>(integral).at(q, c.v);
  expect_near(a.M.reshaped(), b.M.reshaped(), 1e-14);
  expect_near(a.bias, b.bias, 1e-13);
  expect_near(a.gravity_force, b.gravity_force, 1e-14);
  expect_near(a.gravity_force.tail(3), b.gravity_force.tail(3), 1e-13);  // the modes by themselves
  expect_near(a.angular_momentum, b.angular_momentum, 1e-13);
  expect_near(a.com, b.com, 1e-14);
  EXPECT_NEAR(a.gravity_energy, b.gravity_energy, 1e-14 * std::abs(b.gravity_energy));
  const Vec vdot = Vec::LinSpaced(9, -1.0, 2.0);
  expect_near(a.hinge_wrenches(vdot)[0], b.hinge_wrenches(vdot)[0], 1e-13);
}

// Every component, attitude and modes included, is minus the slope of the energy: in 113 bits, where a difference with
// step h = 1e-9 is good to h^2 and 1e-34 / h. Close to the attractor, so that no term is small.
TEST(TwinCentralGravity, ForceIsTheGradientOfItsEnergyAtEveryLevel) {
  for (const char* name : {"53_body_levels_translational", "54_body_levels_rotary"}) {
    const oracle::Case c = file(name);
    SystemSpec spec = in_central_field(c.spec.bodies[0]);
    spec.bodies[0].hinge.type = "free";
    for (int level = 0; level <= 2; ++level) {
      const DenseTwin<Quad> twin(oracle::at_level(spec, level));
      const VecX<Quad> q = free_q({5.0, -3.0, 8.0}, c.q.tail(c.q.size() - 7)).cast<Quad>();
      const VecX<Quad> force = twin.at(q, c.v.cast<Quad>()).gravity_force;
      const Quad h("1e-9");
      for (int i = 0; i < twin.nv(); ++i) {
        const VecX<Quad> qdot = twin.at(q, VecX<Quad>::Unit(twin.nv(), i)).qdot;
        const VecX<Quad> still = VecX<Quad>::Zero(twin.nv());
        const Quad slope = (twin.at(q + h * qdot, still).gravity_energy - twin.at(q - h * qdot, still).gravity_energy) / (2 * h);
        EXPECT_NEAR(static_cast<double>(Quad(force[i] + slope)), 0.0, 1e-15 * static_cast<double>(force.norm()))
            << name << ", level " << level << ", component " << i;
      }
    }
  }
}

TEST(TwinHinge, SpringsAndDampersPullOnTheirComponent) {
  SystemSpec spec;
  spec.bodies = {rigid("a", "revolute"), rigid("b", "translational"), rigid("c", "ball")};
  spec.bodies[0].hinge.params = axis(0, 0, 2);
  spec.bodies[0].hinge.springs = {{0, 7.0, 0.25, 0.5, {}}};
  spec.bodies[1].hinge.springs = {{1, 2.0, -1.0, 0.0, {}}};
  spec.bodies[2].hinge.springs = {{1, 0.0, 0.0, 3.0, {}}};
  Vec q(8), v(7);
  q << 1.25, 10, 20, 30, 1, 0, 0, 0;
  v << 4, 1, 2, 3, 5, 6, 7;
  const DenseState<double> s = DenseTwin<double>(spec).at(q, v);
  Vec want = Vec::Zero(7);
  want[0] = -7.0 - 2.0;
  want[2] = -2.0 * 21.0;
  want[5] = -3.0 * 6.0;
  expect_near(s.hinge_force, want, 1e-15);
  EXPECT_DOUBLE_EQ(s.elastic_energy, 3.5 + 441.0);

  spec.bodies[2].hinge.springs[0].stiffness = 1.0;
  EXPECT_THROW(DenseTwin<double>{spec}, InputError);
}

TEST(TwinHinge, LockedHingeIsTheSystemWithThatVelocityHeldAtZero) {
  oracle::Case c = file("17_chain_multidof");  // universal, gimbal, ball, planar, cylindrical
  c.v.segment(2, 3).setZero();
  c.v.segment(5, 3).setZero();
  const DenseState<double> free = DenseTwin<double>(c.spec).at(c.q, c.v);
  std::vector<bool> prescribed(c.v.size(), false);
  std::fill_n(prescribed.begin() + 2, 6, true);
  const Vec vdot = free.hybrid(c.tau, prescribed, Vec::Zero(c.v.size())).vdot;

  SystemSpec locked = c.spec;
  locked.bodies[1].hinge.locked = locked.bodies[2].hinge.locked = true;
  const DenseTwin<double> twin(locked);
  ASSERT_EQ(twin.nq(), c.q.size() - 7);
  ASSERT_EQ(twin.nv(), c.v.size() - 6);
  const auto kept = [](const Vec& x, int from, int n) {
    Vec out(x.size() - n);
    out << x.head(from), x.tail(x.size() - from - n);
    return out;
  };
  const DenseState<double> s = twin.at(kept(c.q, 2, 7), kept(c.v, 2, 6));
  const Vec got = s.forward(kept(c.tau, 2, 6));
  expect_near(got, kept(vdot, 2, 6), 1e-13);
  for (int k = 0; k < 5; ++k) expect_near(s.hinge_wrenches(got)[k], free.hinge_wrenches(vdot)[k], 1e-12);
}

TEST(TwinTree, BodiesMayComeBeforeTheirParents) {
  const oracle::Case c = file("18_tree_rigid_7");
  SystemSpec reversed = c.spec;
  std::reverse(reversed.bodies.begin(), reversed.bodies.end());
  Vec q(c.q.size()), v(c.v.size()), tau(c.v.size());
  int iq = 0, iv = 0;
  const auto put = [](Vec& to, int end, const Vec& from, int begin, int n) { to.segment(end - begin - n, n) = from.segment(begin, n); };
  std::vector<std::pair<int, int>> blocks;
  for (const BodySpec& b : c.spec.bodies) {
    const int nq = static_cast<int>(b.hinge.q.size()), nv = static_cast<int>(b.hinge.v.size());
    put(q, static_cast<int>(q.size()), c.q, iq, nq);
    put(v, static_cast<int>(v.size()), c.v, iv, nv);
    put(tau, static_cast<int>(v.size()), c.tau, iv, nv);
    blocks.emplace_back(iv, nv);
    iq += nq;
    iv += nv;
  }
  const Vec vdot = DenseTwin<double>(c.spec).at(c.q, c.v).forward(c.tau);
  const Vec other = DenseTwin<double>(reversed).at(q, v).forward(tau);
  Vec want(vdot.size());
  for (const auto& [at, n] : blocks) put(want, static_cast<int>(want.size()), vdot, at, n);
  expect_near(other, want, 1e-12);
}

TEST(TwinHinge, GimbalSequenceIsTheListOfItsAxes) {
  SystemSpec spec;
  spec.bodies = {rigid("a", "gimbal")};
  const Vec q = Eigen::Vector3d(0.3, -0.4, 0.5), v = Eigen::Vector3d(1, 2, 3);
  spec.bodies[0].hinge.params["axes"].value = std::vector<double>{0, 0, 2, 0, 1, 0, 1, 0, 0};
  const DenseState<double> a = DenseTwin<double>(spec).at(q, v);
  for (const char* sequence : {"zyx", "321"}) {
    spec.bodies[0].hinge.params = {};
    spec.bodies[0].hinge.params["sequence"].value = std::string(sequence);
    expect_near(DenseTwin<double>(spec).at(q, v).bias, a.bias, 1e-15);
  }
}

Code refusal(const SystemSpec& spec) {
  try {
    DenseTwin<double> twin(spec);
  } catch (const InputError& e) {
    return e.diagnostics()[0].code;
  }
  ADD_FAILURE() << "not refused";
  return Code::empty_system;
}

TEST(TwinRefuses, WhatItCannotDo) {
  SystemSpec spec;
  spec.bodies = {rigid("a", "free"), rigid("b", "ball")};
  SystemSpec bad = spec;
  bad.bodies[0].hinge.type = "acme/helix";
  EXPECT_EQ(refusal(bad), Code::unsupported);
  bad = spec;
  bad.bodies[1].hinge.inboard_body = "c";
  EXPECT_EQ(refusal(bad), Code::unknown_body);
  bad.bodies[1].hinge.inboard_body = "b";
  EXPECT_EQ(refusal(bad), Code::cycle);
  bad.bodies[1].hinge.inboard_body = "a";
  bad.bodies[1].hinge.inboard_node = "nowhere";
  EXPECT_EQ(refusal(bad), Code::unknown_node);
}

TEST(TwinRefuses, AMassMatrixThatIsNotPositiveDefinite) {
  SystemSpec spec;
  spec.bodies = {rigid("point", "ball")};
  spec.bodies[0].com.setZero();
  spec.bodies[0].inertia_com.setZero();
  Vec q(4);
  q << 1, 0, 0, 0;
  EXPECT_THROW(DenseTwin<double>(spec).at(q, Vec::Zero(3)).forward(Vec::Zero(3)), NumericsError);
}

/// A row of rounding size is none, whatever it demands; a short one is.
TEST(ClosedMotion, KnowsRowsFromRoundings) {
  const auto of_second_row = [](double length) {
    Eigen::MatrixXd G = Eigen::MatrixXd::Zero(2, 3);
    G(0, 0) = 1.0, G(1, 1) = length;
    return closed_motion<double>(Eigen::MatrixXd::Identity(3, 3), Eigen::Vector3d(0, 0, 2), G, Eigen::Vector2d(1.0, 3.0 * length));
  };
  EXPECT_EQ(of_second_row(1e-17).rank, 1);
  EXPECT_LE((of_second_row(1e-17).vdot - Eigen::Vector3d(1, 0, 2)).norm(), 1e-15);
  EXPECT_EQ(of_second_row(1e-9).rank, 2);
  EXPECT_LE((of_second_row(1e-9).vdot - Eigen::Vector3d(1, 3, 2)).norm(), 1e-14);
}

}  // namespace
}  // namespace cardan::reference
