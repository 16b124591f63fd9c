// What holds for every mesh, whatever it is made of.
#include "bodies/modal/fe_model.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "bodies/modal/eigen_modes.hpp"
#include "bodies/modal/elements.hpp"
#include "bodies/modal/mode_audit.hpp"
#include "core/linalg/dense.hpp"
#include "tests/support/worse.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using test::largest;

double relative(const MatrixXd& got, const MatrixXd& want) { return largest(got - want) / largest(want); }

BeamModel beam() {
  BeamModel b;
  b.length = 2.0;
  b.material = {70e9, 0.33, 2700.0};
  b.section = rectangle_section(0.06, 0.03, true);
  b.elements = 20;
  return b;
}

/// A small wing with everything on it: sandwich plate, yoke, a tip mass.
FeModel wing_elements(int nx = 10, int ny = 4) {
  PlateModel p;
  p.length = 3.0;
  p.width = 1.2;
  p.panel = SandwichPanel{{70e9, 0.3, 1600.0}, 2e-4, 0.02, 30.0, 1.5};
  p.elements_x = nx;
  p.elements_y = ny;
  p.yoke = {0.8, 0.6, {70e9, 0.3, 1600.0}, tube_section(0.02, 0.0015)};
  return plate_mesh(p, {{2.0, {3.8, 0.6, 0}, Vector3d(0.1, 0.2, 0.25).asDiagonal()}}, {});
}

class Meshes : public testing::TestWithParam<int> {
 protected:
  FeModel model() const { return GetParam() == 0 ? beam_mesh(beam(), {{0.7, {2, 0, 0}, Matrix3d::Zero()}}, {}) : wing_elements(); }
};

// K sums terms that cancel; each is as large as the stiffest entry times the size of the body.
TEST_P(Meshes, MoveRigidlyWithoutForce) {
  const FeModel m = model();
  const MatrixXd force = m.K * m.rigid_shapes();
  const double scale = largest(MatrixXd(m.K)) * largest(m.rigid_shapes());
  EXPECT_LE(largest(force), 1e-13 * scale);
}

TEST_P(Meshes, HaveTheMassOfTheirPoints) {
  const FeModel m = model();
  const MatrixXd rigid = m.rigid_shapes().transpose() * (m.M * m.rigid_shapes());
  Eigen::Matrix<double, 6, 6> want;
  want.setZero();
  for (Eigen::Index p = 0; p < m.point_mass.size(); ++p) {
    Matrix3d r;
    const Vector3d x = m.point_position.col(p);
    r << 0, -x.z(), x.y(), x.z(), 0, -x.x(), -x.y(), x.x(), 0;
    want.topLeftCorner(3, 3) += m.point_mass(p) * r.transpose() * r + m.point_inertia[p];
    want.topRightCorner(3, 3) += m.point_mass(p) * r;
    want.bottomRightCorner(3, 3) += m.point_mass(p) * Matrix3d::Identity();
  }
  want.bottomLeftCorner(3, 3) = want.topRightCorner(3, 3).transpose();
  EXPECT_LE(relative(rigid, want), 1e-13);
}

TEST_P(Meshes, HaveMatricesThatAreSymmetricToTheLastBit) {
  const FeModel m = model();
  EXPECT_EQ(MatrixXd(m.K), MatrixXd(m.K).transpose());
  EXPECT_EQ(MatrixXd(m.M), MatrixXd(m.M).transpose());
}

TEST_P(Meshes, GiveIntegralsThatAreProductsWithTheMassMatrix) {
  const FeModel m = model();
  const FeModes modes = normal_modes(m, dofs_of(m.root_nodes), 8, RigidModes::refuse, {});
  const ModalIntegrals I = modal_integrals(m.mass_field(modes.shapes));
  const MatrixXd R = m.rigid_shapes(), rigid = R.transpose() * (m.M * R);
  const MatrixXd coupling = participation(m, modes);
  EXPECT_NEAR(I.I1, rigid(3, 3), 1e-12 * I.I1);
  EXPECT_LE(relative(I.I4, coupling.topRows(3)), 1e-12);
  EXPECT_LE(relative(I.I3, coupling.bottomRows(3)), 1e-12);
  EXPECT_LE(relative(I.I6, MatrixXd::Identity(8, 8)), 1e-12);
  EXPECT_LE(relative(I.I7, rigid.topLeftCorner(3, 3)), 1e-12);
  EXPECT_LE(relative(modes.shapes.transpose() * (m.K * modes.shapes), modes.omega2.asDiagonal()), 1e-9);
}

INSTANTIATE_TEST_SUITE_P(Kinds, Meshes, testing::Values(0, 1),
                         [](const auto& kind) { return kind.param == 0 ? std::string("beam") : std::string("wing"); });

TEST(BeamMesh, HasTheMassAndInertiaOfARod) {
  const BeamModel b = beam();
  const FeModel m = beam_mesh(b, {}, {});
  const double mass = 2700.0 * 0.06 * 0.03 * 2.0;
  const MatrixXd rigid = m.rigid_shapes().transpose() * (m.M * m.rigid_shapes());
  EXPECT_NEAR(rigid(3, 3), mass, 1e-12);
  EXPECT_NEAR(rigid(0, 0), mass * (0.06 * 0.06 + 0.03 * 0.03) / 12, 1e-13);
  EXPECT_NEAR(rigid(1, 1), mass * (4.0 / 3 + 0.03 * 0.03 / 12), 1e-12);  // about y at the root; z is the height 0.03
  EXPECT_NEAR(rigid(2, 2), mass * (4.0 / 3 + 0.06 * 0.06 / 12), 1e-12);
  EXPECT_NEAR(rigid(2, 4), mass * 1.0, 1e-12);  // m c: rotation about z moves the mass centre along y
}

TEST(PlateMesh, HasTheMassAndInertiaOfASlab) {
  PlateModel p;
  p.length = 3.0;
  p.width = 2.0;
  p.panel = SolidPanel{{70e9, 0.3, 2700.0}, 0.1};
  p.elements_x = 3;
  p.elements_y = 2;
  const FeModel m = plate_mesh(p, {}, {});
  const MatrixXd rigid = m.rigid_shapes().transpose() * (m.M * m.rigid_shapes());
  const double mass = 2700.0 * 0.6;
  EXPECT_NEAR(rigid(3, 3), mass, 1e-9);
  EXPECT_NEAR(rigid(0, 0), mass * (4.0 / 12 + 0.01 / 12), 1e-9);
  EXPECT_NEAR(rigid(1, 1), mass * (9.0 / 3 + 0.01 / 12), 1e-9);
  EXPECT_NEAR(rigid(2, 2), mass * (4.0 / 12 + 9.0 / 3),
              1e-9);  // a thin plate has no inertia of its fibres about the normal
}

TEST(PlateMesh, SandwichIsTheDifferenceOfTwoSlabs) {
  const PlateSection whole = plate_section(SolidPanel{{70e9, 0.3, 1600.0}, 0.024}, true);
  const PlateSection core = plate_section(SolidPanel{{70e9, 0.3, 1600.0}, 0.020}, true);
  const PlateSection s = plate_section(SandwichPanel{{70e9, 0.3, 1600.0}, 0.002, 0.020, 50.0, 0.3}, true);
  EXPECT_LE(relative(s.bending, whole.bending - core.bending), 1e-13);
  EXPECT_LE(relative(s.membrane, whole.membrane - core.membrane), 1e-13);
  EXPECT_NEAR(s.mass, whole.mass - core.mass + 50.0 * 0.020 + 0.3, 1e-12);
  EXPECT_NEAR(s.rotary, whole.rotary - core.rotary + 50.0 * std::pow(0.02, 3) / 12, 1e-12);
}

/// A strip one element wide bends in its plane like a beam: the incompatible modes do not lock, the drilling penalty is
/// weak.
TEST(PlateMesh, BendsInItsPlaneLikeABeam) {
  PlateModel p;
  p.length = 10.0;
  p.width = 1.0;
  p.panel = SolidPanel{{200e9, 0.3, 8000.0}, 0.05};
  p.elements_x = 10;
  p.elements_y = 2;
  const FeModel m = plate_mesh(p, {}, {});
  const FreePart free(m.n_dofs(), dofs_of(m.root_nodes));
  VectorXd load = VectorXd::Zero(m.n_dofs());
  for (int i = 0; i < 3; ++i) load(6 * (static_cast<int>(m.nodes.size()) - 1 - i) + 1) = 1.0 / 3;
  VectorXd f(free.dofs.size());
  for (std::size_t i = 0; i < free.dofs.size(); ++i) f(i) = load(free.dofs[i]);
  const VectorXd u = free.expand(SparseFactor(free.block(m.K)).solve(f));
  const double EI = 200e9 * 0.05 / 12, GA = 5.0 / 6 * 200e9 / 2.6 * 0.05;
  EXPECT_NEAR(u.dot(load) / (1000 / (3 * EI) + 10 / GA), 1.0,
              0.02);  // the clamped edge also keeps the width: slightly stiffer
}

TEST(EffectiveMass, OfAllModesIsTheMassThatIsNotHeld) {
  BeamModel b = beam();
  b.elements = 3;
  const FeModel m = beam_mesh(b, {}, {});
  const FeModes all = normal_modes(m, dofs_of({0}), 18, RigidModes::refuse, {});
  const MatrixXd G = participation(m, all);
  // R* M_af M_ff^-1 M_fa R over the free dofs f.
  const MatrixXd load = (m.M * m.rigid_shapes()).bottomRows(18);
  const MatrixXd want = load.transpose() * symmetric_solve(MatrixXd(m.M).bottomRightCorner(18, 18), load);
  EXPECT_LE(relative(G * G.transpose(), want), 1e-9);
}

TEST(EffectiveMass, TendsToTheRigidMass) {
  BeamModel b = beam();
  b.elements = 40;
  const FeModel m = beam_mesh(b, {}, {});
  const MatrixXd rigid = m.rigid_shapes().transpose() * (m.M * m.rigid_shapes());
  const FeModes modes = normal_modes(m, dofs_of({0}), 110, RigidModes::refuse, {});
  const VectorXd sum = participation(m, modes).cwiseAbs2().rowwise().sum();
  for (int d = 0; d < 6; ++d) {
    EXPECT_LT(sum(d), rigid(d, d) * (1 + 1e-12)) << d;
    EXPECT_GT(sum(d), rigid(d, d) * 0.97)
        << d;  // a third of the mass of the element at the root is held, and the highest modes are missing
  }
}

TEST(FreeModes, CarryNoMomentum) {
  for (const FeModel& m : {beam_mesh(beam(), {}, {}), wing_elements()}) {
    const FeModes modes = normal_modes(m, {}, 6, RigidModes::remove, {});
    const MatrixXd rigid = m.rigid_shapes().transpose() * (m.M * m.rigid_shapes());
    EXPECT_LE(largest(participation(m, modes)), 1e-12 * largest(rigid.diagonal().cwiseSqrt()));
    EXPECT_GT(modes.omega2(0), 1.0);
  }
}

TEST(FreeModes, ARigidMotionThatIsLeftInIsRefused) {
  const FeModel m = beam_mesh(beam(), {}, {});
  for (const std::vector<int>& held : {std::vector<int>{}, {0, 1, 2}, {0, 1, 2, 3, 4}, {1, 7, 2, 8, 3}}) try {
      normal_modes(m, held, 2, RigidModes::refuse, {});
      ADD_FAILURE();
    } catch (const InputError& e) {
      EXPECT_EQ(number_of(e.diagnostics().front().code), "C0322");
    }
}

TEST(FreeModes, AMechanismIsRefusedWithItsPlace) {
  FeBuilder b;
  for (double x : {0.0, 1.0}) b.add_node({x, 0, 0});
  b.add_node({1.5, 0, 0});  // a loose end
  add_beam(b, 0, 1, Vector3d::UnitY(), {1e9, 0.3, 1000.0}, rectangle_section(0.1, 0.1), SectionInertia::all);
  b.add_mass(2, 1.0, Matrix3d::Identity());
  const FeModel m = b.finish({0}, "");
  try {
    normal_modes(m, dofs_of({0}), 2, RigidModes::refuse, {});
    ADD_FAILURE();
  } catch (const InputError& e) {
    EXPECT_EQ(number_of(e.diagnostics().front().code), "C0323");
    EXPECT_EQ(e.diagnostics().front().got.substr(0, 20), "no stiffness against") << e.what();
    EXPECT_NE(e.diagnostics().front().got.find("at (1.5, 0, 0) m"), std::string::npos) << e.what();
  }
}

/// Modes of the wing with a heavy hinged load at the tip, from few modes without the load.
TEST(CraigBampton, ServesALoadAtTheInterfaceThatNormalModesMiss) {
  BeamModel b = beam();
  b.elements = 40;
  const FeModel bare = beam_mesh(b, {}, {});
  const double load = 20.0;  // three times the beam
  const FeModel loaded = beam_mesh(b, {{load, {2, 0, 0}, Matrix3d::Identity() * 0.5}}, {});
  const VectorXd truth = normal_modes(loaded, dofs_of({0}), 4, RigidModes::refuse, {}).omega2;
  const std::vector<int> tip = dofs_of({40});
  const auto with_load = [&](const FeModes& modes) {
    MatrixXd M = MatrixXd::Identity(modes.omega2.size(), modes.omega2.size());
    const MatrixXd at_tip = modes.shapes(tip, Eigen::all);
    M += load * at_tip.topRows(3).transpose() * at_tip.topRows(3) + 0.5 * at_tip.bottomRows(3).transpose() * at_tip.bottomRows(3);
    return VectorXd(generalised_eigenvalues(modes.omega2.asDiagonal(), M).value().head(4));
  };
  const FeModes cb =
      craig_bampton(bare, dofs_of({0}), tip, MatrixXd(MatrixXd::Identity(bare.n_dofs(), bare.n_dofs())).middleCols(tip[0], 6), 4, {});
  EXPECT_EQ(cb.omega2.size(), 10);
  EXPECT_LE(relative(cb.shapes.transpose() * (bare.M * cb.shapes), MatrixXd::Identity(10, 10)), 1e-10);
  EXPECT_LE(relative(cb.shapes.transpose() * (bare.K * cb.shapes), cb.omega2.asDiagonal()), 1e-9);
  EXPECT_LE(largest((with_load(cb) - truth).array() / truth.array()), 2e-3);
  EXPECT_GE(largest((with_load(normal_modes(bare, dofs_of({0}), 10, RigidModes::refuse, {})) - truth).array() / truth.array()), 1e-2);
  // Static stiffness at the interface is exact: Phi K^-1 Phi* is the tip's flexibility L^3 / (3 EI) + L / (kappa G A).
  const VectorXd y = cb.shapes.row(tip[1]);
  const double EI = 70e9 * b.section.Iz, GA = 5.0 / 6 * 70e9 / 2.66 * b.section.area;
  EXPECT_NEAR(y.dot(cb.omega2.cwiseInverse().asDiagonal() * y) / (8 / (3 * EI) + 2 / GA), 1.0, 1e-8);
}

}  // namespace
/// A straight beam bends as it would whatever it resists torsion with: the stiffest constraint mode takes no digits from the lowest.
TEST(CraigBampton, FrequenciesOfBendingDoNotKnowTheStiffnessOfTorsion) {
  BeamModel soft = beam(), stiff = beam();
  soft.elements = stiff.elements = 8;
  stiff.section.J = 1e9 * soft.section.J;
  const auto modes_of = [](const BeamModel& b) {
    const FeModel mesh = beam_mesh(b, {}, {});
    const std::vector<int> tip = dofs_of({8});
    return craig_bampton(mesh, dofs_of({0}), tip, MatrixXd(MatrixXd::Identity(mesh.n_dofs(), mesh.n_dofs())).middleCols(tip[0], 6), 4, {});
  };
  const VectorXd of_soft = modes_of(soft).omega2, of_stiff = modes_of(stiff).omega2;
  ASSERT_GT(of_stiff(9), 1e4 * of_soft(9)) << "torsion is the stiffest";
  for (int j = 0; j < 4; ++j) EXPECT_NEAR(of_stiff(j), of_soft(j), 1e-11 * of_soft(j)) << j;
}

}  // namespace cardan
