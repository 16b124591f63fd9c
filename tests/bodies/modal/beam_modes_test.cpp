// Published roots of beams (tests/reference/cases/modal-beam-*.yaml, modal-timoshenko-ss.yaml).
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "bodies/modal/eigen_modes.hpp"
#include "bodies/modal/elements.hpp"
#include "core/linalg/dense.hpp"
#include "tests/bodies/modal/case_file.hpp"
#include "tests/support/worse.hpp"

namespace cardan {
namespace {

using Eigen::VectorXd;
using test::largest;

/// EI = rho A L^4 = 1 in the x-y plane: the square roots of the eigenvalues are the published x_k^2.
BeamModel unit_beam(int elements) {
  BeamModel b;
  b.length = 1.0;
  b.material = {1.0, 0.3, 1.0};
  b.section = {1.0, 1.0, 1.0, 1.0, 0.0, 0.0};
  b.elements = elements;
  b.rotary_inertia = false;
  return b;
}

/// All dofs but bending in the x-y plane (v, theta_z), and the given ones.
std::vector<int> plane_only(const FeModel& model, std::vector<int> held) {
  for (int i = 0; i < static_cast<int>(model.nodes.size()); ++i)
    for (int d : {0, 2, 3, 4}) held.push_back(6 * i + d);
  return held;
}

VectorXd roots(int elements, bool left_held, bool right_pinned, int count) {
  const FeModel model = beam_mesh(unit_beam(elements), {}, {});
  std::vector<int> held;
  if (left_held) held = {1, 5};
  if (right_pinned) held.push_back(6 * elements + 1);
  return normal_modes(model, plane_only(model, held), count, RigidModes::remove, {}).omega2.cwiseSqrt();
}

struct Roots {
  const char* id;
  bool left_held, right_pinned;
};

class BeamModes : public testing::TestWithParam<Roots> {};

// The case states 1e-6 for a fine mesh. Interpolation error of a cubic: (k h)^4 / 720, below 2e-8 here; rounding grows
// as n^4 and reaches 1e-8 or so at 400 elements.
TEST_P(BeamModes, ReachThePublishedRootsAtFourHundredElements) {
  const auto [id, left_held, right_pinned] = GetParam();
  const std::vector<double> want = case_values(id, "x_k^2");
  const VectorXd got = roots(400, left_held, right_pinned, 8);
  for (int k = 0; k < 8; ++k) test::expect_relative(fmt::format("root {}", k + 1), got(k), want[k], 1e-6);
}

TEST_P(BeamModes, ConvergeWithOrderFour) {
  const auto [id, left_held, right_pinned] = GetParam();
  const std::vector<double> want = case_values(id, "x_k^2");
  for (int n = 16; n <= 64; n *= 2) {
    const VectorXd coarse = roots(n, left_held, right_pinned, 4), fine = roots(2 * n, left_held, right_pinned, 4);
    for (int k = 0; k < 4; ++k) {
      const double e1 = coarse(k) / want[k] - 1, e2 = fine(k) / want[k] - 1;
      if (e2 < 2e-8) continue;  // rounding, 1e-9 at 128 elements, is no longer small beside it
      EXPECT_GT(e2, 0.0) << "a conforming element bounds from above";
      EXPECT_NEAR(std::log2(e1 / e2), 4.0, 0.1) << n << " elements, root " << k + 1;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Published, BeamModes,
                         testing::Values(Roots{"modal-beam-cantilever", true, false}, Roots{"modal-beam-free-free", false, false},
                                         Roots{"modal-beam-clamped-pinned", true, true}),
                         [](const auto& roots_of) {
                           std::string name = roots_of.param.id;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

// Shapes that are exact in statics only: with shear and rotary inertia the order is 2; mode 5 needs 700 elements for
// 1e-5 in bending and 1900 in the second spectrum. The second spectrum lies among the bending modes 12 to 16, together
// with the thickness-shear mode w = 0. In bending the section turns with the slope of the axis, in the second spectrum
// against it.
TEST(TimoshenkoBeam, HasBothPublishedSpectra) {
  BeamModel b;
  b.length = 1.0;
  b.material = {210e9, 0.3, 7850.0};
  b.section = rectangle_section(0.1, 0.1, true);
  b.elements = 2000;
  const FeModel model = beam_mesh(b, {}, {});
  const std::vector<int> held = plane_only(model, {1, 6 * b.elements + 1});
  const FeModes modes = normal_modes(model, held, 24, RigidModes::refuse, {});
  std::vector<double> bending, second;
  for (Eigen::Index k = 0; k < modes.omega2.size(); ++k) {
    double slope = 0.0, deflection = 0.0;  // sum of theta dw over elements, sum of w^2 h
    for (int i = 0; i < b.elements; ++i) {
      const auto w = [&](int node) { return modes.shapes(6 * node + 1, k); };
      const auto theta = [&](int node) { return modes.shapes(6 * node + 5, k); };
      slope += 0.5 * (theta(i) + theta(i + 1)) * (w(i + 1) - w(i));
      deflection += w(i) * w(i) / b.elements;
    }
    if (deflection < 1e-12) continue;  // thickness shear
    (slope > 0.0 ? bending : second).push_back(std::sqrt(modes.omega2(k)) / (2 * std::numbers::pi));
  }
  ASSERT_GE(bending.size(), 5u);
  ASSERT_GE(second.size(), 5u);
  for (const auto& [name, got] : {std::pair{"bending spectrum", bending}, std::pair{"second spectrum", second}}) {
    const std::vector<double> want = case_values("modal-timoshenko-ss", name);
    for (std::size_t k = 0; k < 5; ++k) test::expect_relative(fmt::format("{}, mode {} [Hz]", name, k + 1), got[k], want[k], 1e-5);
  }
}

// Eight arms from one rigid joint, outer ends pinned, in the plane: symmetry makes an arm pinned-pinned once and
// clamped-pinned seven times, so that frequencies come one, seven, one, seven. Two of the seven move the joint and feel
// the arms' stretch, which the published values leave out (it lowers modes 10 and 11 by 0.55 percent): here E A is a
// hundredfold at the same E I.
TEST(DoubleCross, HasTheFrequenciesOfNafemsFv2) {
  constexpr int arms = 8, elements = 16;
  const Material steel{100 * 200e9, 0.3, 8000.0};
  BeamSection section = rectangle_section(0.125, 0.125);
  section.Iy /= 100, section.Iz /= 100;
  FeBuilder b;
  const int joint = b.add_node(Eigen::Vector3d::Zero());
  std::vector<int> held;
  for (int arm = 0; arm < arms; ++arm) {
    const double angle = 2.0 * std::numbers::pi * arm / arms;
    const Eigen::Vector3d along(std::cos(angle), std::sin(angle), 0.0), across(-along.y(), along.x(), 0.0);
    int from = joint;
    for (int e = 1; e <= elements; ++e) {
      const int to = b.add_node(5.0 * e / elements * along);
      add_beam(b, from, to, across, steel, section, SectionInertia::torsional);
      from = to;
    }
    held.insert(held.end(), {6 * from, 6 * from + 1});
  }
  const FeModel model = b.finish({}, "");
  for (int i = 0; i < static_cast<int>(model.nodes.size()); ++i)  // in the plane: u, v and theta_z
    for (int d : {2, 3, 4}) held.push_back(6 * i + d);
  const VectorXd f = normal_modes(model, held, 16, RigidModes::refuse, {}).omega2.cwiseSqrt() / (2 * std::numbers::pi);
  const auto want = [](const char* quantity) { return case_values("modal-nafems-fv2", quantity)[0]; };
  for (int k = 0; k < 16; ++k) {
    const char* quantity = k == 0 ? "mode 1 " : k < 8 ? "modes 2-8" : k == 8 ? "mode 9" : "modes 10-16";
    test::expect_relative(fmt::format("mode {} [Hz]", k + 1), f(k), want(quantity), 0.005);
  }
}

TEST(BeamElement, BothPlanesAxialAndTorsionFollowTheirOwnStiffness) {
  BeamModel b = unit_beam(60);
  b.material = {1e4, 0.25, 2.0};
  b.section = {1.0, 3e-4, 1e-4, 2e-4, 0.0, 0.0};
  const FeModel model = beam_mesh(b, {}, {});
  const VectorXd omega = normal_modes(model, dofs_of({0}), 40, RigidModes::refuse, {}).omega2.cwiseSqrt();
  const auto contains = [&](double w, double tolerance) {
    return ((omega / w).array() - 1.0).abs().minCoeff<Eigen::PropagateNaN>() < tolerance;
  };
  const double bending = std::pow(1.875104068711961, 2);
  EXPECT_TRUE(contains(bending * std::sqrt(1e4 * 1e-4 / 2.0), 1e-6));                      // x-y plane: Iz
  EXPECT_TRUE(contains(bending * std::sqrt(1e4 * 3e-4 / 2.0), 1e-6));                      // x-z plane: Iy
  const double quarter_wave = 0.5 * std::numbers::pi;                                      // linear shapes: error (k h)^2 / 24
  EXPECT_TRUE(contains(quarter_wave * std::sqrt(1e4 * 2e-4 / 2.5 / (2.0 * 4e-4)), 1e-4));  // torsion: G J / (rho Ip)
  EXPECT_TRUE(contains(quarter_wave * std::sqrt(1e4 / 2.0), 1e-4));                        // axial: E / rho
}

TEST(BeamElement, AnObliqueBeamIsTheTurnedBeam) {
  const Eigen::AngleAxisd turn(0.7, Eigen::Vector3d(1, -2, 3).normalized());
  const Material m{1e4, 0.25, 2.0};
  const BeamSection s{1.0, 3e-4, 1e-4, 2e-4, 0.8, 0.7};
  const auto build = [&](const Eigen::Matrix3d& R) {
    FeBuilder b;
    b.add_node(Eigen::Vector3d::Zero());
    b.add_node(R * Eigen::Vector3d(0.5, 0, 0));
    add_beam(b, 0, 1, R.col(1), m, s, SectionInertia::all);
    return b.finish({0}, "");
  };
  const FeModel straight = build(Eigen::Matrix3d::Identity()), oblique = build(turn.toRotationMatrix());
  Eigen::MatrixXd T = Eigen::MatrixXd::Zero(12, 12);
  for (int i = 0; i < 4; ++i) T.block<3, 3>(3 * i, 3 * i) = turn.toRotationMatrix();
  const Eigen::MatrixXd K = T * Eigen::MatrixXd(straight.K) * T.transpose(), M = T * Eigen::MatrixXd(straight.M) * T.transpose();
  EXPECT_LE(largest(Eigen::MatrixXd(oblique.K) - K), 1e-13 * largest(K));
  EXPECT_LE(largest(Eigen::MatrixXd(oblique.M) - M), 1e-13 * largest(M));
}

/// Tip deflection under a unit tip load: L^3 / (3 EI) + L / (kappa G A), exact with one element.
TEST(BeamElement, ATipLoadGivesTheExactDeflectionWithShear) {
  BeamModel b = unit_beam(1);
  b.length = 2.0;
  b.material = {10.0, 0.25, 1.0};
  b.section = {0.5, 0.2, 0.3, 0.1, 0.8, 0.6};
  const FeModel model = beam_mesh(b, {}, {});
  const Eigen::MatrixXd K = Eigen::MatrixXd(model.K).bottomRightCorner(6, 6);
  const Eigen::MatrixXd u = inverse(K);
  EXPECT_NEAR(u(1, 1), 8.0 / (3 * 10 * 0.3) + 2.0 / (0.8 * 4.0 * 0.5), 1e-12);
  EXPECT_NEAR(u(2, 2), 8.0 / (3 * 10 * 0.2) + 2.0 / (0.6 * 4.0 * 0.5), 1e-12);
  EXPECT_NEAR(u(5, 1), 4.0 / (2 * 10 * 0.3), 1e-12);   // a force along y turns the tip about +z
  EXPECT_NEAR(u(4, 2), -4.0 / (2 * 10 * 0.2), 1e-12);  // a force along z turns it about -y
}

TEST(BeamSections, AgreeWithClosedForms) {
  const BeamSection r = rectangle_section(0.2, 0.1);
  EXPECT_NEAR(r.Iy, 0.2 * std::pow(0.1, 3) / 12, 1e-18);
  EXPECT_NEAR(r.Iz, 0.1 * std::pow(0.2, 3) / 12, 1e-18);
  EXPECT_NEAR(r.J / (0.2 * std::pow(0.1, 3)), 0.228681677, 1e-9);                    // the series in 30 digits: side ratio 2
  EXPECT_NEAR(rectangle_section(0.1, 0.1).J / std::pow(0.1, 4), 0.140577015, 1e-9);  // and 1 (Timoshenko and Goodier 1970: 0.1406)
  EXPECT_NEAR(rectangle_section(1.0, 1e-3).J / 1e-9, 0.333123250, 1e-9);             // a thin strip: b^3 (a - 0.63 b) / 3
  const BeamSection t = tube_section(0.05, 0.05, true);                              // full circle
  EXPECT_NEAR(t.J, 0.5 * std::numbers::pi * std::pow(0.05, 4), 1e-18);
  EXPECT_NEAR(t.shear_y, 6 * 1.3 / (7 + 6 * 0.3), 1e-12);
  EXPECT_NEAR(tube_section(0.05, 1e-6, true).shear_z, 2 * 1.3 / (4 + 3 * 0.3), 1e-4);  // thin tube
}

}  // namespace
}  // namespace cardan
