#include "bodies/modal/modal_source.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "bodies/modal/elements.hpp"
#include "bodies/modal/lumped.hpp"
#include "bodies/modal/modal_file.hpp"
#include "core/linalg/dense.hpp"
#include "tests/support/scratch.hpp"
#include "tests/support/worse.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using test::worse;

/// Cantilever of round section without rotary inertia, EI = rho A = L = 1: pairs of modes in y and z.
ModalSource round_beam(int elements, int count) {
  BeamModel b;
  b.length = 1.0;
  b.material = {1e6, 0.0, 1.0};
  b.section = {1.0, 1e-6, 1e-6, 1e-3, 0.0, 0.0};  // axial and torsion modes far above
  b.elements = elements;
  b.rotary_inertia = false;
  ModalSource s;
  s.model = b;
  s.modes.count = count;
  s.points = {{"tip", {1, 0, 0}, false}};
  return s;
}

/// The main mission's wing: 12 m x 2.4 m sandwich on a yoke.
ModalSource wing(int nx = 40, int ny = 8) {
  PlateModel p;
  p.length = 11.0;
  p.width = 2.4;
  p.panel = SandwichPanel{{70e9, 0.3, 1600.0}, 2e-4, 0.022, 32.0, 0.9};
  p.elements_x = nx;
  p.elements_y = ny;
  p.yoke = {1.0, 1.2, {70e9, 0.3, 1600.0}, tube_section(0.03, 0.002)};
  ModalSource s;
  s.model = p;
  s.modes.count = 10;
  s.points = {{"tip", {12, 0, 0}, false}};
  return s;
}

// Closed forms for mass-normalised cantilever modes, x_k the root and sigma_k = (cosh x + cos x) / (sinh x + sin x):
// integral of phi = 2 sigma / x, integral of x phi = 2 / x^2 (Blevins 1979), to the discretisation error (k h)^4.
TEST(BeamIntegrals, OfUniformCantileverModesAreTheClosedForms) {
  const ModalData d = make_modal_data(round_beam(60, 4));
  const double x[2] = {1.875104068711961, 4.694091132974175};
  const ModalNode& tip = d.nodes.at(1);
  EXPECT_EQ(tip.name, "tip");
  for (int k = 0; k < 4; ++k) {  // the tip's rotation is the largest entry, and theta_y stands before theta_z: z before y
    const int direction = 2 - k % 2;
    const double r = x[k / 2], sigma = (std::cosh(r) + std::cos(r)) / (std::sinh(r) + std::sin(r));
    const double tip_value = tip.Phi(direction, k),
                 sign = (tip_value > 0) == (k < 2) ? 1.0 : -1.0;  // mode 2 changes sign
    EXPECT_NEAR(std::abs(tip_value), 2.0, 1e-5) << k;
    EXPECT_NEAR(tip.Phi.col(k).norm(), 2.0, 1e-5) << "one plane only";
    const double slope = k < 2 ? 1.376505 : 4.780778;  // phi'(1) / phi(1)
    EXPECT_NEAR(tip.Psi(direction == 1 ? 2 : 1, k) / tip_value, direction == 1 ? slope : -slope, 1e-5);
    Vector3d I3 = Vector3d::Zero(), I4 = Vector3d::Zero();
    I3(direction) = sign * 2 * sigma / r;
    I4(direction == 1 ? 2 : 1) = (direction == 1 ? sign : -sign) * 2 / (r * r);  // r x phi
    EXPECT_LE((d.integrals.I3.col(k) - I3).norm(), 2e-5) << k;
    EXPECT_LE((d.integrals.I4.col(k) - I4).norm(), 2e-5) << k;
    Matrix3d I8 = Matrix3d::Zero();
    I8(direction, 0) = -sign * 2 / (r * r);  // -phi r*
    EXPECT_LE((d.integrals.I8[k] - I8).norm(), 2e-5) << k;
    EXPECT_NEAR(std::sqrt(d.K(k, k)), r * r, 1e-4);
    EXPECT_NEAR(d.audit[k].effective_mass(3 + direction), 4 * sigma * sigma / (r * r), 4e-5);
  }
  // phi_1 (along z) x phi_2 (along y) = -x: the same shape, so the integral is the product of signs.
  const double sign = tip.Phi(2, 0) * tip.Phi(1, 1) > 0 ? 1.0 : -1.0;
  EXPECT_LE((d.integrals.I5[0].col(1) + sign * Vector3d::UnitX()).norm(), 1e-6);
  EXPECT_LE((d.integrals.I5[1].col(0) - sign * Vector3d::UnitX()).norm(), 1e-6);
  EXPECT_LE((d.integrals.I9[0] - Matrix3d(Vector3d(1, 1, 0).asDiagonal())).norm(), 1e-9);
}

TEST(BeamIntegrals, OfTheConsistentMassAreTheLimitOfLumpedMasses) {
  const auto difference = [](int n) {
    ModalSource s = round_beam(n, 4);
    s.points.clear();
    for (int i = 1; i <= n; ++i) s.points.push_back({std::to_string(i), {static_cast<double>(i) / n, 0, 0}, false});
    const ModalData d = make_modal_data(s);
    std::vector<MassNode> lumps;
    for (int i = 0; i <= n; ++i) {
      MassNode node;
      node.mass = (i == 0 || i == n ? 0.5 : 1.0) / n;
      node.position = d.nodes[i].position;
      node.Phi = d.nodes[i].Phi;
      lumps.push_back(node);
    }
    const ModalIntegrals a = lumped_modal_data(lumps, d.K, d.C, {}).integrals;
    const ModalIntegrals& b = d.integrals;
    double worst = worse({(a.I3 - b.I3).norm(), (a.I4 - b.I4).norm(), (a.I6 - b.I6).norm()});
    for (int l = 0; l < 4; ++l) worst = worse({worst, (a.I5[l] - b.I5[l]).norm(), (a.I8[l] - b.I8[l]).norm()});
    for (int i = 0; i < 16; ++i) worst = worse(worst, (a.I9[i] - b.I9[i]).norm());
    return worst;
  };
  const double coarse = difference(20), fine = difference(40);
  EXPECT_LT(fine, 5e-3);
  EXPECT_NEAR(std::log2(coarse / fine), 2.0, 0.1);  // the trapezoidal rule
}

TEST(Wing, OfTheMissionHasItsMassAndSlowFirstBending) {
  const ModalData d = make_modal_data(wing());
  EXPECT_GT(d.integrals.I1, 60.0);
  EXPECT_LT(d.integrals.I1, 90.0);
  EXPECT_GT(d.audit[0].frequency, 0.1);
  EXPECT_LT(d.audit[0].frequency, 0.5);
  EXPECT_TRUE(d.nodes[0].Phi.isZero(0.0)) << "the root is held: B = P";
  EXPECT_TRUE(d.nodes[0].Psi.isZero(0.0));
  const ModalData coarse = make_modal_data(wing(20, 4));
  EXPECT_NEAR(coarse.audit[0].frequency / d.audit[0].frequency, 1.0, 0.01);
}

TEST(ModalSource, GivesTheSameBitsEveryTime) {
  const ModalData a = make_modal_data(wing(10, 4)), b = make_modal_data(wing(10, 4));
  EXPECT_EQ(a.content_hash, b.content_hash);
  EXPECT_EQ(a.nodes[1].Phi, b.nodes[1].Phi);
  EXPECT_NE(a.content_hash, make_modal_data(wing(12, 4)).content_hash);
}

TEST(ModalSource, DampsEachModeByItsRatio) {
  ModalSource s = round_beam(10, 3);
  s.damping = {0.01, 0.02, 0.0};
  const ModalData d = make_modal_data(s);
  EXPECT_NEAR(d.C(0, 0), 2 * 0.01 * std::sqrt(d.K(0, 0)), 1e-15);
  EXPECT_NEAR(d.C(1, 1), 2 * 0.02 * std::sqrt(d.K(1, 1)), 1e-15);
  EXPECT_EQ(d.C(2, 2), 0.0);
  EXPECT_TRUE(MatrixXd(d.C - MatrixXd(d.C.diagonal().asDiagonal())).isZero(0.0));
}

TEST(ModalSource, KeepsModesByFrequency) {
  ModalSource s = round_beam(40, 1);
  s.modes = {{}, 12.0, 0.0};  // x^2 / (2 pi): 0.56, 3.51, 9.82, 19.2 Hz, each twice
  const ModalData d = make_modal_data(s);
  EXPECT_EQ(d.n_modes, 6);
  EXPECT_GT(d.audit.size(), 6u);
  EXPECT_TRUE(d.audit[5].kept);
  EXPECT_FALSE(d.audit[6].kept);
  EXPECT_EQ(d.audit[6].reason, "above 12 Hz");
}

TEST(ModalSource, KeepsModesByEffectiveMass) {
  ModalSource s = round_beam(40, 20);
  s.modes.effective_mass = 0.85;  // along y: 0.613, 0.188, 0.065 of the mass of 0.95 or so found: two modes, or three
  const ModalData d = make_modal_data(s);
  Eigen::Matrix<double, 6, 1> all = Eigen::Matrix<double, 6, 1>::Zero(), kept = all;
  for (const ModeRecord& r : d.audit) {
    all += r.effective_mass;
    if (r.kept) kept += r.effective_mass;
  }
  for (int i : {1, 2, 4, 5}) EXPECT_GE(kept(i), 0.85 * all(i)) << i;
  EXPECT_EQ(d.n_modes, 6);
  EXPECT_EQ(d.audit[19].reason, "no direction needs it to reach 85 %");
}

TEST(ModalSource, CraigBamptonKeepsItsConstraintModes) {
  ModalSource s = round_beam(20, 4);
  s.boundary = Boundary::craig_bampton;
  s.points[0].interface = true;
  for (const Boundary other : {Boundary::cantilever, Boundary::free}) {
    ModalSource without = s;
    without.boundary = other;
    EXPECT_THROW(make_modal_data(without), InputError) << "an interface without Craig-Bampton modes";
  }
  const ModalData d = make_modal_data(s);
  EXPECT_EQ(d.n_modes, 10);
  EXPECT_EQ(d.audit[9].reason, "set of 4 fixed-interface and 6 constraint modes");
  const Eigen::VectorXd sizes = singular_values((MatrixXd(6, 10) << d.nodes[1].Phi, d.nodes[1].Psi).finished());
  EXPECT_GT(sizes[5], 1e-10 * sizes[0]);
}

/// The cubic of one element is the static shape of any number of them: 140 x^2 - 408 x + 12 = 0, x = omega^2 / 420.
TEST(ModalSource, ConstraintModesAloneAreGuyansCondensation) {
  for (const int elements : {1, 8}) {
    ModalSource s = round_beam(elements, 0);
    EXPECT_THROW(make_modal_data(s), InputError) << "a cantilever without modes";
    s.boundary = Boundary::craig_bampton;
    s.points[0].interface = true;
    const ModalData d = make_modal_data(s);
    ASSERT_EQ(d.n_modes, 6);
    EXPECT_EQ(d.audit[0].reason, "set of 0 fixed-interface and 6 constraint modes");
    for (const int k : {0, 1, 2, 3}) {
      const double x = (204.0 + (k < 2 ? -1.0 : 1.0) * std::sqrt(204.0 * 204.0 - 12.0 * 140.0)) / 140.0;
      EXPECT_NEAR(d.K(k, k), 420.0 * x, 1e-15 * d.K(5, 5)) << elements << " elements, mode " << k;  // torsion rounds it
    }
  }
  ModalSource held = round_beam(1, 2);
  held.boundary = Boundary::craig_bampton;
  held.points[0].interface = true;
  EXPECT_THROW(make_modal_data(held), InputError) << "nothing is left that could move between root and tip";
  held.modes.count.reset(), held.modes.max_frequency = 1.0;
  EXPECT_THROW(make_modal_data(held), InputError);
}

TEST(ModalSource, FreeModesAreOnMeanAxes) {
  ModalSource s = wing(10, 4);
  s.boundary = Boundary::free;
  const ModalData d = make_modal_data(s);
  EXPECT_TRUE(d.integrals.I3.isZero(0.0));
  EXPECT_TRUE(d.integrals.I4.isZero(0.0));
  EXPECT_GT(d.nodes[0].Phi.norm(), 0.0) << "the root moves";
}

// The wing's plate as 33 x 9 points, its arms of 8 elements and the root; modes beyond the first thirty and points of finer meshes are not
// drawn.
TEST(ModalSource, DrawsItsMesh) {
  const ModalData d = make_modal_data(wing());
  const ModalDrawing& drawing = d.drawing;
  EXPECT_LT(drawing.points.rows(), 500);
  EXPECT_GT(drawing.points.rows(), 300);
  ASSERT_EQ(static_cast<int>(drawing.shapes.size()), std::min(d.n_modes, 30));
  const ModalNode& tip = d.nodes.back();
  int found = 0;
  for (Eigen::Index i = 0; i < drawing.points.rows(); ++i)
    if ((drawing.points.row(i).transpose() - tip.position).norm() < 1e-12) {
      ++found;
      for (std::size_t j = 0; j < drawing.shapes.size(); ++j)
        EXPECT_EQ(Eigen::Vector3d(drawing.shapes[j].row(i).transpose()), Eigen::Vector3d(tip.Phi.col(static_cast<Eigen::Index>(j))));
    }
  EXPECT_EQ(found, 1) << "the corner is on the lines, with the displacement of its node";
  EXPECT_TRUE((drawing.lines.array() >= 0.0).all() && (drawing.lines.array() < static_cast<double>(drawing.points.rows())).all());
  EXPECT_EQ(make_modal_data(round_beam(100, 3)).drawing.points.rows(), 41);
}

TEST(ModalFile, ReturnsWhatWasWritten) {
  const std::string path = test::scratch("modal.h5");
  ModalSource s = wing(10, 4);
  const ModalData a = make_modal_data(s);
  write_modal_file(path, a);
  s.model = FileModel{path};
  const ModalData b = make_modal_data(s);
  EXPECT_EQ(a.content_hash, b.content_hash);
  EXPECT_EQ(a.source, b.source);
  EXPECT_EQ(a.K, b.K);
  EXPECT_EQ(a.integrals.I5.back(), b.integrals.I5.back());
  EXPECT_EQ(a.integrals.rotary_ww.back(), b.integrals.rotary_ww.back());
  EXPECT_EQ(a.nodes.back().Psi, b.nodes.back().Psi);
  EXPECT_EQ(a.audit.back().reason, b.audit.back().reason);
  EXPECT_EQ(a.drawing.lines, b.drawing.lines);
  EXPECT_EQ(a.drawing.shapes.back(), b.drawing.shapes.back());

  MassNode node;
  node.mass = 1.0;
  node.Phi = Vector3d::UnitX();
  node.Q.assign(3, MatrixXd::Constant(1, 1, 0.25));
  ModalData lumped = lumped_modal_data({node}, MatrixXd::Identity(1, 1), {}, {});
  write_modal_file(path, lumped);
  EXPECT_EQ(read_modal_file(path).mass_nodes[0].Q[2], node.Q[2]);
  EXPECT_EQ(read_modal_file(path).content_hash, content_hash(lumped));
  std::filesystem::remove(path);
}

/// "C0301 wing.length": number and key path of the only diagnostic.
std::string answer(ModalSource s) {
  s.at.key_path = "wing";
  try {
    make_modal_data(s);
  } catch (const InputError& e) {
    const Diagnostic& d = e.diagnostics().front();
    return std::string(number_of(d.code)) + " " + d.at.key_path;
  }
  return "accepted";
}

template <class F>
std::string beam_with(F&& change) {
  ModalSource s = round_beam(10, 2);
  change(s, std::get<BeamModel>(s.model));
  return answer(s);
}

template <class F>
std::string plate_with(F&& change) {
  ModalSource s = wing(4, 2);
  change(s, std::get<PlateModel>(s.model));
  return answer(s);
}

TEST(ModalSourceErrors, TellHowFarTheModesGo) {
  ModalSource s = round_beam(10, 2);
  s.modes = {30, 0.0, 0.0};  // half of 60 degrees of freedom
  const double last = std::sqrt(make_modal_data(s).K(29, 29)) / (2.0 * std::numbers::pi);
  s.modes = {{}, 1e9, 0.0};
  try {
    make_modal_data(s);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics().front().expected, "a limit that keeps fewer than 31 modes");
    EXPECT_EQ(e.diagnostics().front().got, fmt::format("1000000000 Hz, above mode 30 at {:.6g} Hz", last));
  }
}

/// 166 interfaces have 996 modes of their own: 1005 took 8 GB, and minutes, without an end.
TEST(ModalSourceErrors, TellHowManyModesABodyHasAtMost) {
  ModalSource s = round_beam(200, 9);
  s.boundary = Boundary::craig_bampton;
  const double length = std::get<BeamModel>(s.model).length;
  s.points.clear();
  for (int i = 1; i <= 166; ++i)
    s.points.push_back({.name = fmt::format("n{}", i), .position = {length * i / 200.0, 0.0, 0.0}, .interface = true});
  try {
    make_modal_data(s);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics().front().expected, "at most 1000 modes, six of each point with `interface` among them");
    EXPECT_EQ(e.diagnostics().front().got, "1005: 9 with interfaces held, 996 of interfaces");
  }
}

TEST(ModalSourceErrors, TellWhichKeyIsWrong) {
  EXPECT_EQ(beam_with([](auto&, auto&) {}), "accepted");
  EXPECT_EQ(beam_with([](auto&, auto& b) { b.length = 0; }), "C0301 wing.length");
  EXPECT_EQ(beam_with([](auto&, auto& b) { b.length = NAN; }), "C0301 wing.length");
  EXPECT_EQ(beam_with([](auto&, auto& b) { b.material.E = -1; }), "C0301 wing.material.E");
  EXPECT_EQ(beam_with([](auto&, auto& b) { b.material.rho = 0; }), "C0301 wing.material.rho");
  EXPECT_EQ(beam_with([](auto&, auto& b) { b.material.nu = 0.5; }), "C0301 wing.material.nu");
  EXPECT_EQ(beam_with([](auto&, auto& b) { b.section.J = 0; }), "C0301 wing.section.J");
  EXPECT_EQ(beam_with([](auto&, auto& b) { b.section.shear_y = 3.3; }), "C0301 wing.section.shear_y") << "an area in m^2";
  EXPECT_EQ(beam_with([](auto&, auto& b) { b.section.shear_z = -0.1; }), "C0301 wing.section.shear_z");
  EXPECT_EQ(beam_with([](auto&, auto& b) { b.elements = 0; }), "C0301 wing.elements");
  EXPECT_EQ(beam_with([](auto& s, auto&) { s.modes = {}; }), "C0105 wing.modes");
  EXPECT_EQ(beam_with([](auto& s, auto&) { s.modes.count = -1; }), "C0301 wing.modes.count");
  EXPECT_EQ(beam_with([](auto& s, auto&) { s.modes.count = 70; }), "C0323 wing");
  EXPECT_EQ(beam_with([](auto& s, auto&) { s.modes = {{}, 1e9, 0}; }), "C0301 wing.modes.max_frequency");
  EXPECT_EQ(beam_with([](auto& s, auto&) { s.modes = {{}, 1e-3, 0}; }), "C0301 wing.modes");
  EXPECT_EQ(beam_with([](auto& s, auto&) { s.modes.effective_mass = 1.5; }), "C0301 wing.modes.effective_mass");
  EXPECT_EQ(beam_with([](auto& s, auto&) { s.modes.effective_mass = 0.5, s.boundary = Boundary::free; }),
            "C0401 wing.modes.effective_mass");
  EXPECT_EQ(beam_with([](auto& s, auto&) { s.damping = {-0.1}; }), "C0301 wing.damping");
  EXPECT_EQ(beam_with([](auto& s, auto&) { s.damping = {0.1, 0.1, 0.1}; }), "C0321 wing.damping");
  EXPECT_EQ(beam_with([](auto& s, auto&) { s.points[0].name = "root"; }), "C0207 wing.points[0].name");
  EXPECT_EQ(beam_with([](auto& s, auto&) { s.points[0].position.x() = 1.2; }), "C0323 wing.points[0].position");
  EXPECT_EQ(beam_with([](auto& s, auto&) { s.boundary = Boundary::craig_bampton; }), "C0323 wing.points");
  EXPECT_EQ(beam_with([](auto& s, auto&) { s.masses = {{0.0, {1, 0, 0}, {}}}; }), "C0301 wing.masses[0].mass");
  EXPECT_EQ(beam_with([](auto& s, auto&) { s.masses = {{1.0, {1, 3, 0}, {}}}; }), "C0323 wing.masses[0].position");
  EXPECT_EQ(plate_with([](auto&, auto&) {}), "accepted");
  EXPECT_EQ(plate_with([](auto&, auto& p) { p.elements_y = 3; }), "C0301 wing.elements_y");
  EXPECT_EQ(plate_with([](auto&, auto& p) { p.panel = SolidPanel{{1e9, 0.3, 1000}, 0.0}; }), "C0301 wing.panel.thickness");
  EXPECT_EQ(plate_with([](auto&, auto& p) { std::get<SandwichPanel>(p.panel).face_thickness = 0; }), "C0301 wing.panel.face_thickness");
  EXPECT_EQ(plate_with([](auto&, auto& p) { p.yoke.spread = 3.0; }), "C0301 wing.yoke.spread");
  EXPECT_EQ(plate_with([](auto&, auto& p) { p.yoke.section = {}; }), "C0301 wing.yoke.section.area");
  ModalSource s;
  s.model = FileModel{"/nowhere/modes.h5"};
  EXPECT_EQ(answer(s).substr(0, 5), "C0102");
}

// Half of all degrees of freedom of the mesh: the upper ones lose digits to the lowest, 1e10 below, unless they are refined.
TEST(ManyModes, OfASmallMeshAreThoseOfADenseSolver) {
  ModalSource s = round_beam(40, 120);
  std::get<BeamModel>(s.model).material = {70e9, 0.3, 2700.0};
  std::get<BeamModel>(s.model).length = 12.0;
  std::get<BeamModel>(s.model).section = tube_section(0.05, 0.001);
  std::get<BeamModel>(s.model).rotary_inertia = true;
  s.points.clear();
  const ModalData d = make_modal_data(s);
  ASSERT_EQ(d.n_modes, 120);
  const FeModel mesh = beam_mesh(std::get<BeamModel>(s.model), {}, {});
  const Eigen::Index n = mesh.n_dofs() - 6;
  const MatrixXd K = MatrixXd(mesh.K).bottomRightCorner(n, n), M = MatrixXd(mesh.M).bottomRightCorner(n, n);
  const Eigen::VectorXd exact = generalised_eigenvalues(K, M).value();
  for (Eigen::Index j = 20; j < 120; ++j)  // of the lowest the dense solver has few digits
    EXPECT_NEAR(d.K(j, j), exact(j), 1e-7 * exact(j)) << j;
}

TEST(Doubts, OfPlatesBeamsMaterialsAndDampingHaveNumbers) {
  const auto of = [](const ModalSource& s) {
    Warnings all;
    make_modal_data(s, &all);
    std::string codes;
    for (const Warning& w : all.all()) codes += fmt::format("{} {} ", number_of(w.what.code), w.what.at.key_path);
    return codes;
  };
  ModalSource s = round_beam(20, 4);
  s.at.key_path = "modal";
  std::get<BeamModel>(s.model).material = {70e9, 0.3, 2700.0};
  std::get<BeamModel>(s.model).section = rectangle_section(0.02, 0.02);
  EXPECT_EQ(of(s), "");
  std::get<BeamModel>(s.model).section = rectangle_section(0.02, 0.2);
  EXPECT_EQ(of(s), "W0304 modal.section ") << "0.2 m deep, 1 m long, without shear";
  std::get<BeamModel>(s.model).section = rectangle_section(0.02, 0.2, true);
  EXPECT_EQ(of(s), "");
  std::get<BeamModel>(s.model).section.shear_y = 5e-3;
  EXPECT_EQ(of(s), "W0302 modal.section.shear_y ") << "an area in m^2";
  std::get<BeamModel>(s.model).section.shear_y = 0.5;
  std::get<BeamModel>(s.model).material.rho = 2700e3;
  EXPECT_EQ(of(s), "W0302 modal.material.rho ");

  ModalSource w = wing(8, 4);
  w.at.key_path = "modal";
  std::get<PlateModel>(w.model).panel = SolidPanel{{70e9, 0.3, 2700.0}, 0.3};
  EXPECT_EQ(of(w).substr(0, 28), "W0304 modal.panel.thickness ") << "0.3 m on 2.4 m";
  w.damping = {1.0};
  EXPECT_NE(of(w).find("W0302 modal.damping"), std::string::npos) << "critical";
  w = wing(8, 4);
  w.at.key_path = "modal";
  std::get<PlateModel>(w.model).yoke.spread = 0.7;
  EXPECT_EQ(of(w).find("modal.yoke"), std::string::npos);
  std::get<PlateModel>(w.model).yoke.spread = 0.25;
  EXPECT_NE(of(w).find("W0302 modal.yoke.spread"), std::string::npos) << "one beam of two, of elements of 0.6 m";
}

TEST(Doubts, OfPointsAndMassesThatAreMovedToTheMesh) {  // of 0.05 m here: they were moved without a word
  ModalSource s = round_beam(20, 4);
  s.at.key_path = "modal";
  s.points = {{"on", {0.5, 0, 0}, false}, {"off", {0.52, 0, 0}, false}, {"beyond", {1.04, 0, 0}, false}};
  s.masses = {{0.1, {0.5, 0, 0}, Eigen::Matrix3d::Zero()}, {0.1, {0.26, 0, 0}, Eigen::Matrix3d::Zero()}};
  Warnings all;
  const ModalData data = make_modal_data(s, &all);
  std::vector<std::string> places;
  for (const Warning& w : all.all())
    if (w.what.code == Code::unusual_value) places.push_back(w.what.at.key_path);
  EXPECT_EQ(places, (std::vector<std::string>{"modal.points[1].position", "modal.points[2].position", "modal.masses[1].position"}));
  EXPECT_EQ(data.nodes[2].position, Eigen::Vector3d(0.5, 0, 0));
  EXPECT_NE(all.all()[0].what.about.find("(0.52, 0, 0) m is not on the mesh: it was moved to its nearest node at (0.5, 0, 0) m"),
            std::string::npos)
      << all.all()[0].what.about;
}

TEST(Doubts, OfModesThatAreLeftOut) {
  const auto of = [](ModalSource s) {
    s.damping = {0.005};
    Warnings all;
    make_modal_data(s, &all);
    return all;
  };
  const Warnings one_plane = of(round_beam(20, 1));
  ASSERT_EQ(one_plane.all().size(), 1u);
  EXPECT_EQ(one_plane.all()[0].what.code, Code::truncated_modes);
  EXPECT_NE(one_plane.all()[0].what.about.find("97"), std::string::npos)
      << "the first mode of the other plane has 97 % of the rotation: " << one_plane.all()[0].what.about;
  EXPECT_TRUE(of(round_beam(20, 2)).empty());
  EXPECT_TRUE(of(round_beam(20, 8)).empty());
  // What the root carries itself is in no mode: it is told where there are modes to keep, and not where all are kept.
  ModalSource heavy = round_beam(1, 4);
  heavy.masses = {{100.0, {0, 0, 0}, 100.0 * Eigen::Matrix3d::Identity()}};
  EXPECT_NE(of(heavy).all().back().what.about.find("the modes kept carry at most"), std::string::npos);
  heavy.modes.count = 6;
  EXPECT_TRUE(of(heavy).empty());
}

TEST(Sections, OutOfRangeAreRefusedByTheirKey) {
  const auto key = [](auto make) -> std::string {
    try {
      make();
    } catch (const InputError& e) {
      return e.diagnostics().front().at.key_path;
    }
    return "";
  };
  EXPECT_EQ(key([] { tube_section(0.02, 0.03); }), "tube.wall");
  EXPECT_EQ(key([] { tube_section(0.02, 0.0201); }), "tube.wall");
  EXPECT_EQ(key([] { tube_section(0.02, 0.02); }), "") << "a solid rod";
  EXPECT_EQ(key([] { tube_section(-0.02, -0.03); }), "tube.radius");
  EXPECT_EQ(key([] { rectangle_section(0.02, 0.0); }), "rectangle.height");
}

TEST(Meshes, TooFineAreRefusedBeforeTheyAreMade) {
  ModalSource beam = round_beam(100'000'000, 4);
  EXPECT_THROW(make_modal_data(beam), InputError);
  ModalSource plate = wing(331'212, 8);
  EXPECT_THROW(make_modal_data(plate), InputError);
}

}  // namespace
}  // namespace cardan
