// Bodies given by the matrices of another program: those of our own meshes, written out, give what the meshes give.
#include "bodies/modal/matrices.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <fstream>
#include <functional>
#include <limits>
#include <random>
#include <regex>

#include "bodies/modal/eigen_modes.hpp"
#include "bodies/modal/elements.hpp"
#include "bodies/modal/modal_file.hpp"
#include "bodies/modal/mode_cache.hpp"
#include "bodies/modal/solids.hpp"
#include "core/linalg/dense.hpp"
#include "tests/bodies/modal/solid_samples.hpp"
#include "tests/support/scratch.hpp"
#include "tests/support/worse.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using test::worse;

void write_file(const std::string& path, const std::string& text) { std::ofstream(path) << text; }

std::string matrix_text(const SparseMatrix& A) {
  std::string entries;
  int n = 0;
  for (int j = 0; j < A.outerSize(); ++j)
    for (SparseMatrix::InnerIterator it(A, j); it; ++it)
      if (it.row() >= j && it.value() != 0.0) entries += fmt::format("{} {} {:.17g}\n", it.row() + 1, j + 1, it.value()), ++n;
  return fmt::format("%%MatrixMarket matrix coordinate real symmetric\n% of a test\n{} {} {}\n{}", A.rows(), A.cols(), n, entries);
}

std::string table_text(const FeModel& mesh) {
  std::string out = "name, x, y, z\n# in m\n";
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
    out += fmt::format("n{}, {:.17g}, {:.17g}, {:.17g}\n", i, mesh.nodes[i].x(), mesh.nodes[i].y(), mesh.nodes[i].z());
  return out;
}

/// The files of a mesh, and the source that names them.
struct Written {
  TemporaryFolder dir;
  MatrixModel model{dir / "nodes.csv", dir / "M.mtx", dir / "K.mtx", "", {}, Vector3d::Zero(), 0};
  explicit Written(const FeModel& mesh) {
    write_file(model.nodes, table_text(mesh));
    write_file(model.mass, matrix_text(mesh.M));
    write_file(model.stiffness, matrix_text(mesh.K));
    for (int node : mesh.root_nodes) model.root.names.push_back(fmt::format("n{}", node));
  }
  ModalSource source(ModalSource like) const {
    like.model = model;
    like.masses.clear();  // they are in M
    return like;
  }
};

ModalSource panel_on_yoke() {
  PlateModel p;
  p.length = 4.0, p.width = 1.5;
  p.panel = SolidPanel{{70e9, 0.3, 2700.0}, 0.01};
  p.elements_x = 8, p.elements_y = 4;
  p.yoke = {1.0, 0.75, {70e9, 0.3, 2700.0}, tube_section(0.03, 0.003)};
  ModalSource s;
  s.model = p;
  s.modes.count = 8;
  s.points = {{"tip", {5.0, 0.0, 0.0}, false}};
  s.masses = {{2.0, {5.0, 0.75, 0.0}, Vector3d(0.1, 0.2, 0.25).asDiagonal()}};
  s.at.key_path = "modal";
  return s;
}
FeModel mesh_of(const ModalSource& s) {
  return std::holds_alternative<PlateModel>(s.model) ? plate_mesh(std::get<PlateModel>(s.model), s.masses, s.at)
                                                     : beam_mesh(std::get<BeamModel>(s.model), s.masses, s.at);
}
ModalSource slender_boom() {
  BeamModel b;
  b.length = 6.0;
  b.material = {70e9, 0.3, 2700.0};
  b.section = tube_section(0.05, 0.002);
  b.elements = 12;
  ModalSource s;
  s.model = b;
  s.modes.count = 6;
  s.points = {{"tip", {6.0, 0.0, 0.0}, false}};
  s.at.key_path = "modal";
  return s;
}

void expect_part(const std::string& text, const std::string& part) { EXPECT_NE(text.find(part), std::string::npos) << text; }

double apart(const MatrixXd& a, const MatrixXd& b) {
  if (a.rows() != b.rows() || a.cols() != b.cols() || !a.allFinite() || !b.allFinite()) return HUGE_VAL;
  return (a - b).norm() / (1e-300 + worse(a.norm(), b.norm()));
}

TEST(Matrices, OfAMeshGiveItsModes) {
  for (const Boundary boundary : {Boundary::cantilever, Boundary::free, Boundary::craig_bampton}) {
    ModalSource like = panel_on_yoke();
    like.boundary = boundary;
    like.points[0].interface = boundary == Boundary::craig_bampton;
    if (boundary == Boundary::free) {  // a node at the origin for the root
      like.model = std::get<BeamModel>(slender_boom().model);
      like.points[0].position.x() = 6.0;
      like.masses[0].position = {6.0, 0.0, 0.0};
    }
    const Written written(mesh_of(like));
    const ModalData want = make_modal_data(like), got = make_modal_data(written.source(like));
    ASSERT_EQ(got.n_modes, want.n_modes);
    write_modal_file(written.dir / "modes.h5", got);
    EXPECT_EQ(read_modal_file(written.dir / "modes.h5").content_hash, got.content_hash);
    EXPECT_LE(apart(got.K, want.K), 1e-9);
    EXPECT_LE(apart(got.C, want.C), 1e-9);
    const ModalIntegrals &a = got.integrals, &b = want.integrals;
    EXPECT_NEAR(a.I1, b.I1, 1e-12 * b.I1);
    EXPECT_LE((a.I2 - b.I2).norm(), 1e-12 * b.I1);
    EXPECT_LE(apart(a.I7, b.I7), 1e-12);
    // Eigenvectors are right to 1e-9 where frequencies lie apart, but for their sign.
    MatrixXd sign = MatrixXd::Identity(want.n_modes, want.n_modes);
    for (int k = 0; k < want.n_modes; ++k) {
      const double along = got.nodes[1].Phi.col(k).dot(want.nodes[1].Phi.col(k)) + got.nodes[1].Psi.col(k).dot(want.nodes[1].Psi.col(k));
      sign(k, k) = along < 0.0 ? -1.0 : 1.0;
    }
    if (boundary == Boundary::free) continue;  // bending in two planes has equal frequencies
    EXPECT_LE(apart(a.I3 * sign, b.I3), 1e-7);
    EXPECT_LE(apart(a.I4 * sign, b.I4), 1e-7);
    for (int node : {0, 1}) {
      const auto i = static_cast<std::size_t>(node);
      EXPECT_EQ(got.nodes[i].name, want.nodes[i].name);
      EXPECT_EQ(got.nodes[i].position, want.nodes[i].position);
      EXPECT_LE((got.nodes[i].Phi * sign - want.nodes[i].Phi).norm(), 1e-7 * (1.0 + want.nodes[i].Phi.norm()));
      EXPECT_LE((got.nodes[i].Psi * sign - want.nodes[i].Psi).norm(), 1e-7 * (1.0 + want.nodes[i].Psi.norm()));
    }
  }
}

/// Bulk data of bricks of eight nodes.
std::string bulk_text(const SolidMesh& mesh) {
  std::string out = "PSOLID,1,1\nMAT1,1,7.0+10,,.3,2700.0\n";
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
    out += fmt::format("GRID,{},,{:.4f},{:.4f},{:.4f}\n", i + 1, mesh.nodes[i].x(), mesh.nodes[i].y(), mesh.nodes[i].z());
  for (const SolidMesh::Element& e : mesh.elements) {
    out += fmt::format("CHEXA,{},1", e.number);
    for (std::size_t k = 0; k < 8; ++k) out += fmt::format("{}{}", k == 6 ? "\n," : ",", e.nodes[k] + 1);
    out += "\n";
  }
  return out;
}

TEST(Matrices, OfNodesWithoutRotationsAreThoseOfSolids) {
  const SolidMesh mesh = test::block(
      SolidShape::hexa8, {6, 2, 2},
      [](const Vector3d& s) { return Vector3d(3 * s.x(), (1 - 0.25 * s.x()) * (s.y() - 0.5), 0.5 * s.z() + 0.128 * s.x() * s.x()); }, {});
  NodeSet base, end;
  base.normal = end.normal = Vector3d::UnitX();
  for (const Boundary boundary : {Boundary::cantilever, Boundary::free, Boundary::craig_bampton}) {
    TemporaryFolder dir;
    write_file(dir / "m.bdf", bulk_text(mesh));
    ModalSource like;
    like.at.key_path = "modal";
    like.model = SolidModel{dir / "m.bdf", SolidModel::Units::si, {}, base, Vector3d::Zero()};
    like.boundary = boundary;
    like.modes.count = 6;
    NamedPoint tip{.name = "tip", .position = {3.0, 0.1, 0.3}, .nodes = end};
    tip.interface = boundary == Boundary::craig_bampton;
    like.points = {tip, {.name = "middle", .position = {1.5, 0.0, 0.282}}};
    NodeSet near;
    near.within = 0.7;
    like.masses = {{40.0, {2.0, 0.1, 0.2}, Vector3d(1.0, 2.0, 2.5).asDiagonal(), near}};
    const FeModel bare = solid_model(std::get<SolidModel>(like.model), {}, {});
    Written written(bare);
    ModalSource source = written.source(like);
    source.masses = like.masses;
    const ModalData want = make_modal_data(like), got = make_modal_data(source);
    ASSERT_EQ(got.n_modes, want.n_modes);
    EXPECT_LE(apart(got.K, want.K), 1e-9);
    MatrixXd sign = MatrixXd::Identity(want.n_modes, want.n_modes);
    for (int k = 0; k < want.n_modes; ++k) sign(k, k) = got.nodes[1].Phi.col(k).dot(want.nodes[1].Phi.col(k)) < 0.0 ? -1.0 : 1.0;
    const ModalIntegrals &a = got.integrals, &b = want.integrals;
    EXPECT_NEAR(a.I1, b.I1, 1e-12 * b.I1);
    EXPECT_LE((a.I2 - b.I2).norm(), 1e-12 * b.I1);
    EXPECT_LE(apart(a.I7, b.I7), 1e-12);
    if (boundary != Boundary::free) {
      EXPECT_LE(apart(a.I3 * sign, b.I3), 1e-7);
      EXPECT_LE(apart(a.I4 * sign, b.I4), 1e-7);
    }
    ASSERT_EQ(a.rotary_ww.size(), b.rotary_ww.size());
    for (int k = 0; k < want.n_modes; ++k) {
      const auto i = static_cast<std::size_t>(k), ii = static_cast<std::size_t>(k * want.n_modes + k);
      EXPECT_LE(apart(a.I5[i] * sign * sign(k, k), b.I5[i]), 1e-7);
      EXPECT_LE(apart(a.I8[i] * sign(k, k), b.I8[i]), 1e-7);
      EXPECT_LE(apart(a.I9[ii], b.I9[ii]), 1e-7);
      EXPECT_LE(apart(a.rotary_ww[i] * sign(k, k), b.rotary_ww[i]), 1e-7);
    }
    for (const std::size_t i : {0u, 1u, 2u}) {
      EXPECT_LE((got.nodes[i].position - want.nodes[i].position).norm(), 1e-12) << i;
      EXPECT_LE((got.nodes[i].Phi * sign - want.nodes[i].Phi).norm(), 1e-7 * (1.0 + want.nodes[i].Phi.norm())) << i;
      EXPECT_LE((got.nodes[i].Psi * sign - want.nodes[i].Psi).norm(), 1e-7 * (1.0 + want.nodes[i].Psi.norm())) << i;
    }
    // A plane holds what the list of its nodes does.
    if (boundary != Boundary::cantilever) continue;
    ModalSource by_plane = source;
    std::get<MatrixModel>(by_plane.model).root = base;
    EXPECT_EQ(make_modal_data(by_plane).content_hash, got.content_hash);
    NodeSet three, at_mean;  // the second without a place of its own
    three.names = {"n3", "n17", "n31"};
    at_mean = three, at_mean.at_mean = true;
    const Vector3d mean = (bare.nodes[3] + bare.nodes[17] + bare.nodes[31]) / 3.0;
    by_plane.points = {{.name = "placed", .position = mean, .nodes = three}, {.name = "named", .nodes = at_mean}};
    const ModalData both = make_modal_data(by_plane);
    EXPECT_LE((both.nodes[2].position - mean).norm(), 1e-12);
    EXPECT_LE((both.nodes[2].Phi - both.nodes[1].Phi).norm(), 1e-12 * both.nodes[1].Phi.norm());
    std::get<MatrixModel>(by_plane.model).root.normal.setZero();
    std::get<MatrixModel>(by_plane.model).root.names = {"n0"};
    EXPECT_THROW(make_modal_data(by_plane), InputError) << "it turns about one node";
  }
}

/// What programs hand over of a part: matrices of the nodes it is held at and of modes with these at rest (Craig, Bampton 1968).
TEST(Matrices, OfComponentModesAreThoseOfTheWholeMesh) {
  ModalSource like = slender_boom();
  like.modes.count = 5;
  like.boundary = Boundary::craig_bampton;
  like.points[0].interface = true;
  const FeModel mesh = mesh_of(like);
  const std::vector<int> held = dofs_of({0, 12});
  const FeModes inner = normal_modes(mesh, held, 5, RigidModes::refuse, {});
  const FreePart free(mesh.n_dofs(), held);
  MatrixXd T = MatrixXd::Zero(mesh.n_dofs(), 17);  // rows of the mesh, of the two ends and of the modes
  for (int i = 0; i < 12; ++i) T(held[static_cast<std::size_t>(i)], i) = 1.0;
  const MatrixXd force = mesh.K * T.leftCols(12);
  MatrixXd load(static_cast<Eigen::Index>(free.dofs.size()), 12);
  for (std::size_t i = 0; i < free.dofs.size(); ++i) load.row(static_cast<Eigen::Index>(i)) = -force.row(free.dofs[i]);
  T.leftCols(12) += free.expand(SparseFactor(free.block(mesh.K)).solve(load));
  T.rightCols(5) = 3.0 * inner.shapes;  // of any scale
  FeModel reduced;
  reduced.nodes = {mesh.nodes[0], mesh.nodes[12]};
  const MatrixXd M = T.transpose() * (mesh.M * T), K = T.transpose() * (mesh.K * T);
  reduced.M = MatrixXd(0.5 * (M + M.transpose())).sparseView(), reduced.K = MatrixXd(0.5 * (K + K.transpose())).sparseView();
  reduced.root_nodes = {0};
  Written written(reduced);
  written.model.component_modes = 5;

  ModalSource source = written.source(like);
  source.boundary = Boundary::cantilever;
  source.points[0].interface = false;
  source.modes.count = 11;
  const ModalData want = make_modal_data(like), got = make_modal_data(source);
  ASSERT_EQ(want.n_modes, 11);
  ASSERT_EQ(got.n_modes, 11);
  for (int k = 0; k < 11; ++k) EXPECT_NEAR(got.K(k, k), want.K(k, k), 1e-8 * want.K(k, k)) << k;
  const ModalIntegrals &a = got.integrals, &b = want.integrals;
  EXPECT_NEAR(a.I1, b.I1, 1e-11 * b.I1);
  EXPECT_LE((a.I2 - b.I2).norm(), 1e-11 * b.I1);
  EXPECT_LE(apart(a.I7, b.I7), 1e-11);
  // Modes of a round boom come in pairs; what a pair carries, and how far it moves the tip, does not ask for its axes.
  EXPECT_LE(apart(a.I3 * inverse(got.K) * a.I3.transpose(), b.I3 * inverse(want.K) * b.I3.transpose()), 1e-7);
  EXPECT_LE(apart(a.I4 * inverse(got.K) * a.I4.transpose(), b.I4 * inverse(want.K) * b.I4.transpose()), 1e-7);
  EXPECT_LE(apart(got.nodes[1].Phi * inverse(got.K) * a.I3.transpose(), want.nodes[1].Phi * inverse(want.K) * b.I3.transpose()), 1e-7);
  EXPECT_LE(apart(got.nodes[1].Psi * inverse(got.K) * a.I4.transpose(), want.nodes[1].Psi * inverse(want.K) * b.I4.transpose()), 1e-7);

  EXPECT_FALSE(a.of_change) << "masses between the nodes are known by their sums alone";
  EXPECT_TRUE(b.of_change);
  const std::string file = written.dir / "reduced.h5";
  write_modal_file(file, got);
  const ModalData read = read_modal_file(file);
  EXPECT_FALSE(read.integrals.of_change);
  EXPECT_EQ(read.content_hash, got.content_hash);

  for (const int wrong : {4, std::numeric_limits<int>::max()}) try {
      written.model.component_modes = wrong;
      make_modal_data(written.source(source));
      ADD_FAILURE();
    } catch (const InputError& e) {
      if (wrong != 4)
        expect_part(e.what(), "at: modal.matrices.component_modes\n  expected: a number from 0 to 10000");
      else
        expect_part(
            e.what(),
            "expected: 16 rows and columns: six for each node, or 10 rows and columns: three for each node, and 4 of component modes");
    }
}

TEST(Matrices, AtSecondOrderConvergeLikeTheMesh) {
  double error[2];
  for (const int finer : {1, 2}) {
    ModalSource like = panel_on_yoke();
    like.masses[0].inertia.setZero();  // that of rotations moves with them linearly in what M tells
    auto& plate = std::get<PlateModel>(like.model);
    plate.elements_x *= finer, plate.elements_y *= finer;
    const Written written(mesh_of(like));
    const ModalData want = make_modal_data(like), got = make_modal_data(written.source(like));
    MatrixXd nine_got(3, 3 * want.n_modes), nine_want(3, 3 * want.n_modes);
    for (int k = 0; k < want.n_modes; ++k) {  // of a mode with itself: its sign does not matter
      const auto kk = static_cast<std::size_t>(k * want.n_modes + k);
      nine_got.middleCols(3 * k, 3) = got.integrals.I9[kk], nine_want.middleCols(3 * k, 3) = want.integrals.I9[kk];
    }
    error[finer - 1] = apart(nine_got, nine_want);
  }
  EXPECT_LE(error[0], 0.1);
  EXPECT_LE(error[1], 0.35 * error[0]) << error[0] << ", " << error[1] << ": order 2 is a quarter";
}

/// A free body about a point at which no node is, as the mass centre of a frame: its root node carries the axes there.
TEST(Matrices, OfAFreeBodyAreAboutAnyOrigin) {
  ModalSource like = slender_boom();
  like.boundary = Boundary::free;
  FeModel mesh = mesh_of(like);
  const Vector3d d(-2.9, 0.4, 0.3);
  for (Vector3d& node : mesh.nodes) node += d;
  const Written written(mesh);
  ModalSource source = written.source(like);
  source.points[0].position += d;
  const ModalData got = make_modal_data(source);
  const FeModel read = matrix_mesh(written.model, {}, {});
  const FeModes modes = normal_modes(read, {}, got.n_modes, RigidModes::remove, {});
  ASSERT_EQ(got.nodes[0].name, "root");
  EXPECT_EQ(got.nodes[0].position, Vector3d::Zero());
  const int root = read.root_nodes.front();
  for (int k = 0; k < got.n_modes; ++k) {
    const Vector3d u = modes.shapes.block<3, 1>(6 * root, k), theta = modes.shapes.block<3, 1>(6 * root + 3, k);
    const Vector3d want = u - theta.cross(d);
    EXPECT_LE((got.nodes[0].Phi.col(k) - want).norm(), 1e-9 * u.norm()) << k;
    EXPECT_LE((got.nodes[0].Psi.col(k) - theta).norm(), 1e-9 * theta.norm()) << k;
  }
}

TEST(Matrices, ChangeInertiaAlikeAboutAnyOrigin) {  // I8 was 1 % (first mode) to 22 % (fifth) off with this one
  ModalSource like = slender_boom();
  std::get<BeamModel>(like.model).section = rectangle_section(0.05, 0.08);  // frequencies lie apart
  std::get<BeamModel>(like.model).elements = 4;
  FeModel mesh = mesh_of(like);
  const Written here(mesh);
  const Vector3d d(6.0, -7.0, 4.0);
  for (Vector3d& node : mesh.nodes) node += d;
  const Written there(mesh);
  ModalSource moved = there.source(like);
  moved.points[0].position += d;
  const ModalIntegrals a = make_modal_data(here.source(like)).integrals, b = make_modal_data(moved).integrals;
  ASSERT_EQ(a.I8.size(), b.I8.size());
  for (std::size_t k = 0; k < a.I8.size(); ++k) {  // r + d in sum m ((r.phi) 1 - phi r*)
    const Vector3d I3 = a.I3.col(static_cast<Eigen::Index>(k));
    const double sign = I3.dot(b.I3.col(static_cast<Eigen::Index>(k))) < 0.0 ? -1.0 : 1.0;
    EXPECT_LE(apart(sign * b.I8[k], a.I8[k] + d.dot(I3) * Matrix3d::Identity() - I3 * d.transpose()), 1e-7) << "mode " << k;
  }
}

TEST(Matrices, ChangeInertiaByWhatAMassAddsAndNoMore) {
  ModalSource like = slender_boom();
  std::get<BeamModel>(like.model).elements = 2;
  like.boundary = Boundary::craig_bampton, like.modes.count = 0, like.points[0].interface = true;
  const Written written(mesh_of(like));
  const Vector3d tip(6.0, 0.0, 0.0);
  const auto of_tip = [&](std::vector<PointMass> masses) {  // I8 by unit motions of the tip, that the shapes are made of
    ModalSource source = written.source(like);
    source.masses = std::move(masses);
    const ModalData data = make_modal_data(source);
    MatrixXd motion(6, 6);
    motion << data.nodes[1].Phi, data.nodes[1].Psi;
    const MatrixXd back = motion.inverse();
    std::array<Matrix3d, 6> I8;
    for (int j = 0; j < 6; ++j) {
      I8[static_cast<std::size_t>(j)].setZero();
      for (int k = 0; k < 6; ++k) I8[static_cast<std::size_t>(j)] += back(k, j) * data.integrals.I8[static_cast<std::size_t>(k)];
    }
    return I8;
  };
  const auto bare = of_tip({}), loaded = of_tip({{3.0, tip, Matrix3d::Zero()}});
  for (int j = 0; j < 6; ++j) {
    const Vector3d phi = j < 3 ? Vector3d(Vector3d::Unit(j)) : Vector3d(Vector3d::Zero());
    const Matrix3d mass = 3.0 * (tip.dot(phi) * Matrix3d::Identity() - phi * tip.transpose());
    EXPECT_LE((loaded[static_cast<std::size_t>(j)] - bare[static_cast<std::size_t>(j)] - mass).norm(), 1e-9) << "motion " << j;
  }
}

TEST(Matrices, TakeMassesBesideTheFiles) {
  const ModalSource like = panel_on_yoke();
  ModalSource bare = like;
  bare.masses.clear();
  const Written written(mesh_of(bare));
  ModalSource source = written.source(like);
  EXPECT_TRUE(make_modal_data(source).integrals.rotary_ww.empty());
  source.masses = like.masses;
  const ModalData want = make_modal_data(like), got = make_modal_data(source);
  EXPECT_LE(apart(got.K, want.K), 1e-9);
  EXPECT_NEAR(got.integrals.I1, want.integrals.I1, 1e-12 * want.integrals.I1);
  EXPECT_LE((got.integrals.I2 - want.integrals.I2).norm(), 1e-12 * want.integrals.I1);
  EXPECT_LE(apart(got.integrals.I7, want.integrals.I7), 1e-12);
  // What turns with the node of the mass: psi~ J - J psi~.
  const FeModel read = matrix_mesh(written.model, source.masses, {});
  const FeModes modes = normal_modes(read, dofs_of(read.root_nodes), 1, RigidModes::refuse, {});
  const int node = read.find_node(source.masses[0].position);
  const Vector3d psi = modes.shapes.block<3, 1>(6 * node + 3, 0);
  Matrix3d tilde;
  tilde << 0, -psi.z(), psi.y(), psi.z(), 0, -psi.x(), -psi.y(), psi.x(), 0;
  const Matrix3d J = source.masses[0].inertia;
  ASSERT_FALSE(got.integrals.rotary_ww.empty());
  EXPECT_LE(apart(got.integrals.rotary_ww[0], tilde * J - J * tilde), 1e-7);
}

TEST(Matrices, WhereMassesWeighAllDirectionsAlikeAllIntegralsAreTheirs) {
  // The stiffness of a boom; masses m_ij between its nodes, a positive matrix of any kind, and little rotary inertia.
  FeModel mesh = mesh_of(slender_boom());
  const int n = static_cast<int>(mesh.nodes.size());
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  MatrixXd m = MatrixXd::Zero(n, n);
  for (int i = 0; i < n; ++i) {
    m(i, i) = 3.0 + uniform(random);
    if (i > 0) m(i, i - 1) = m(i - 1, i) = uniform(random);
  }
  MatrixXd M = MatrixXd::Zero(6 * n, 6 * n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) M.block<3, 3>(6 * i, 6 * j) = m(i, j) * Matrix3d::Identity();
  for (int i = 0; i < n; ++i) M.block<3, 3>(6 * i + 3, 6 * i + 3) = 1e-12 * Matrix3d::Identity();
  mesh.M = M.sparseView();
  const Written written(mesh);
  const FeModel read = matrix_mesh(written.model, {}, {});
  EXPECT_LE(apart(MatrixXd(read.M), M), 1e-15);
  const ModalData got = make_modal_data(written.source(slender_boom()));

  // The same integrals as double sums over nodes, of shapes that are found again from the reader's model.
  const FeModes modes = normal_modes(read, dofs_of(read.root_nodes), got.n_modes, RigidModes::refuse, {});
  const auto phi = [&](int node, int k) { return Vector3d(modes.shapes.block<3, 1>(6 * node, k)); };
  const auto minus = [](const Vector3d& a, const Vector3d& b) { return Matrix3d(a.dot(b) * Matrix3d::Identity() - b * a.transpose()); };
  const auto turned = [](const Matrix3d& I8) { return Matrix3d(I8 + I8.transpose()); };  // dJ/d eta; the rest is in I4, with rotations
  double error = 0.0;
  for (int k = 0; k < got.n_modes; ++k)
    for (int l = 0; l < got.n_modes; ++l) {
      Vector3d I5 = Vector3d::Zero();
      Matrix3d I8 = Matrix3d::Zero(), I9 = Matrix3d::Zero();
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          I5 += m(i, j) * phi(i, l).cross(phi(j, k));
          I9 += m(i, j) * minus(phi(i, l), phi(j, k));
          I8 += m(i, j) * minus(mesh.nodes[static_cast<std::size_t>(i)], phi(j, k));
        }
      const auto lk = static_cast<std::size_t>(l * got.n_modes + k);
      error = worse({error, (got.integrals.I5[static_cast<std::size_t>(l)].col(k) - I5).norm(), (got.integrals.I9[lk] - I9).norm(),
                     (turned(got.integrals.I8[static_cast<std::size_t>(k)]) - turned(I8)).norm()});
    }
  EXPECT_LE(error, 1e-9);
  EXPECT_NEAR(got.integrals.I1, m.sum(), 1e-12 * m.sum());
}

/// Lumped masses with offsets from their nodes, as programs of finite elements have them: a mass that turns with its node is where it is,
/// and spin bends what carries it (a boom by 26 % less than it does, when the mass was taken to be at the node).
TEST(Matrices, OfMassesWithOffsetsKnowWhereTheyAre) {
  FeModel mesh = mesh_of(slender_boom());
  const int n = static_cast<int>(mesh.nodes.size());
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  struct Mass {
    int node;
    double m;
    Vector3d offset;
  };
  std::vector<Mass> masses;
  MatrixXd M = MatrixXd::Zero(6 * n, 6 * n);
  for (int i = 0; i < 3 * n; ++i) {
    masses.push_back({i / 3, 2.0 + uniform(random), 0.3 * Vector3d(uniform(random), uniform(random), uniform(random))});
    const Mass& p = masses.back();
    MatrixXd move(3, 6);  // of the mass by its node
    move << Matrix3d::Identity(), Matrix3d::Zero();
    for (int a = 0; a < 3; ++a) move.col(3 + a) = Vector3d::Unit(a).cross(p.offset);
    M.block<6, 6>(6 * p.node, 6 * p.node) += p.m * move.transpose() * move;
  }
  mesh.M = M.sparseView();
  const Written written(mesh);
  const ModalData got = make_modal_data(written.source(slender_boom()));
  const FeModel read = matrix_mesh(written.model, {}, {});
  const FeModes modes = normal_modes(read, dofs_of(read.root_nodes), got.n_modes, RigidModes::refuse, {});
  MassField field;
  const auto count = static_cast<Eigen::Index>(masses.size());
  field.mass.resize(count), field.position.resize(3, count);
  for (MatrixXd& x : field.Phi) x.resize(count, got.n_modes);
  for (Eigen::Index j = 0; j < count; ++j) {
    const Mass& p = masses[static_cast<std::size_t>(j)];
    field.mass[j] = p.m, field.position.col(j) = mesh.nodes[static_cast<std::size_t>(p.node)] + p.offset;
    for (int k = 0; k < got.n_modes; ++k) {
      const Vector3d phi = modes.shapes.block<3, 1>(6 * p.node, k) + Vector3d(modes.shapes.block<3, 1>(6 * p.node + 3, k)).cross(p.offset);
      for (int a = 0; a < 3; ++a) field.Phi[a](j, k) = phi[a];
    }
  }
  const ModalIntegrals want = modal_integrals(field);
  EXPECT_LE(apart(got.integrals.I3, want.I3), 1e-9);
  EXPECT_LE(apart(got.integrals.I4, want.I4), 1e-9);
  EXPECT_LE(apart(got.integrals.I7, want.I7), 1e-12);
  for (std::size_t k = 0; k < want.I8.size(); ++k) {
    EXPECT_LE(apart(got.integrals.I5[k], want.I5[k]), 1e-8) << k;
    EXPECT_LE(apart(got.integrals.I8[k], want.I8[k]), 1e-8) << k;
    for (std::size_t l = 0; l < want.I8.size(); ++l)
      EXPECT_LE((got.integrals.I9[k * want.I8.size() + l] - want.I9[k * want.I8.size() + l]).norm(), 1e-8) << k << ", " << l;
  }
}

TEST(Matrices, OfMassesOnALineSayNothingOfTurnsAboutIt) {  // which move none: shares of it were -nan %
  ModalSource like = slender_boom();
  like.modes.count = 3;
  FeModel mesh = mesh_of(like);
  mesh.M.setZero();
  for (int i = 0; i < mesh.n_dofs(); ++i) mesh.M.coeffRef(i, i) = i % 6 < 3 ? 1.0 : 0.0;
  Warnings warnings;
  make_modal_data(Written(mesh).source(like), &warnings);
  ASSERT_EQ(warnings.all().size(), 1u) << "the pair of the third mode";
  expect_part(warnings.all()[0].what.about, "% of the effective mass in translation along");
}

TEST(Matrices, ThatCoupleAllNodesHaveNoPicture) {  // as condensed ones do: more lines than a file holds, and the modes were refused
  ModalSource like = slender_boom();
  auto& beam = std::get<BeamModel>(like.model);
  beam.elements = 20;
  EXPECT_EQ(make_modal_data(Written(mesh_of(like)).source(like)).drawing.lines.rows(), 20);
  beam.elements = 100;
  FeModel mesh = mesh_of(like);
  MatrixXd K = mesh.K;
  for (int i = 0; i < mesh.n_dofs(); i += 6)
    for (int j = 0; j < mesh.n_dofs(); j += 6) K(i, i) += 1.0, K(i, j) -= 1.0;
  mesh.K = K.sparseView();
  const Written written(mesh);
  const ModalData data = make_modal_data(written.source(like));
  EXPECT_EQ(data.drawing.lines.rows(), 0);
  write_modal_file(written.dir / "modes.h5", data);
  EXPECT_EQ(read_modal_file(written.dir / "modes.h5").content_hash, data.content_hash);
}

TEST(Matrices, ADampingMatrixTakesThePlaceOfRatios) {
  const FeModel mesh = mesh_of(slender_boom());
  Written written(mesh);
  constexpr double kTime = 1e-4;  // [s] C = kTime K
  written.model.damping = written.dir / "C.mtx";
  write_file(written.model.damping, matrix_text(kTime * mesh.K));
  const ModalData data = make_modal_data(written.source(slender_boom()));
  EXPECT_LE(apart(data.C, kTime * data.K), 1e-7);
}

TEST(Matrices, AreSolvedAnewWhereAFileChanged) {
  const FeModel mesh = mesh_of(slender_boom());
  const Written written(mesh);
  const std::string name = ModeCache::name_of(written.source(slender_boom()));
  EXPECT_FALSE(name.empty());
  EXPECT_EQ(ModeCache::name_of(written.source(slender_boom())), name);
  write_file(written.model.mass, matrix_text(1.5 * mesh.M));
  EXPECT_NE(ModeCache::name_of(written.source(slender_boom())), name);
  write_file(written.model.mass, "");
  std::filesystem::remove(written.model.mass);
  EXPECT_EQ(ModeCache::name_of(written.source(slender_boom())), "");
  ModalSource endless = written.source(slender_boom());
  std::get<MatrixModel>(endless.model).mass = "/dev/zero";
  EXPECT_EQ(ModeCache::name_of(endless), "") << "what is no file is not read";
}

TEST(Matrices, FromTheCacheTellTheFilesTheyAreOf) {  // a file of another name had that of the one before
  const FeModel mesh = mesh_of(slender_boom());
  Written written(mesh);
  const ModeCache cache(written.dir / "cache");
  cache.make(written.source(slender_boom()));
  const std::string other = written.dir / "other.mtx";
  std::filesystem::rename(written.model.mass, other);
  written.model.mass = other;
  const ModalData again = cache.make(written.source(slender_boom())).data;
  expect_part(again.source, "other.mtx");
  EXPECT_EQ(again.content_hash, make_modal_data(written.source(slender_boom())).content_hash);
}

/// The answer to files of which one was changed.
std::string answer(const std::function<void(Written&)>& change, const std::function<void(ModalSource&)>& more = {}) {
  static const FeModel mesh = mesh_of(slender_boom());
  Written written(mesh);
  change(written);
  ModalSource source = written.source(slender_boom());
  if (more) more(source);
  try {
    make_modal_data(source);
    return "taken";
  } catch (const InputError& e) {
    std::string text = e.what();
    for (std::size_t at; (at = text.find(written.dir.path())) != std::string::npos;) text.replace(at, written.dir.path().size(), "DIR");
    return std::regex_replace(text, std::regex("\n *[0-9]+ \\| [^\n]*"), "");  // the line itself, which the message shows
  }
}
std::string with_mass(const std::string& text) {
  return answer([&](Written& w) { write_file(w.model.mass, text); });
}
std::string with_nodes(const std::string& text) {
  return answer([&](Written& w) { write_file(w.model.nodes, text); });
}

TEST(Matrices, ThatCannotBeReadAreRefusedWithTheLine) {
  const std::string head = "%%MatrixMarket matrix coordinate real symmetric\n";
  expect_part(with_mass("%%MatrixMarket matrix array real general\n78 78\n"),
              "error[C0321]: modal data do not fit together\n  --> DIR/M.mtx:1\n  at: modal.matrices.mass\n"
              "  expected: %%MatrixMarket matrix coordinate real symmetric (or general)\n"
              "  got:      %%MatrixMarket matrix array real general\n");
  expect_part(with_mass(head + "77 77 1\n1 1 1\n"),
              "M.mtx:2\n  at: modal.matrices.mass\n  expected: 78 rows and columns: six for each node\n  got:      77 77 1");
  expect_part(with_mass(head + "78 78 2\n1 1 1\n"),
              "M.mtx:3\n  at: modal.matrices.mass\n  expected: 1 more entries\n  got:      the end of the file");
  expect_part(with_mass(head + "% c\n78 78 1\n79 1 1\n"),
              "M.mtx:4\n  at: modal.matrices.mass\n  expected: a row and a column from 1 to 78\n  got:      79 1 1");
  expect_part(with_mass(head + "78 78 1\n1 2 1\n"), "expected: the lower triangle of a symmetric matrix\n  got:      1 2 1");
  for (const char* bad : {"1 1 nan", "1 1 inf", "1 1", "1 1 1 1", "1 1 one", "1.5 1 1", "1e99 1 1", ""})
    EXPECT_NE(with_mass(head + "78 78 1\n" + bad + "\n").find("M.mtx:3"), std::string::npos) << bad;
  expect_part(with_mass(head + "78 78 1e12\n"), "expected: at most 100000000 entries");
  expect_part(with_mass(head + "78 78 1\n1 1 1\n% end\n \n2 2 1\n"),
              "M.mtx:6\n  at: modal.matrices.mass\n  expected: 1 entries, as the line of sizes says\n  got:      2 2 1");
  expect_part(with_mass("%%MatrixMarket matrix coordinate real general\n78 78 3\n1 1 1\n1 2 0.5\n2 2 1\n"),
              "expected: a symmetric matrix\n  got:      0 in row 2, column 1, and 0.5 in row 1, column 2");
  expect_part(answer([](Written& w) { std::filesystem::remove(w.model.stiffness); }), "error[C0102]: file not found");
  expect_part(with_nodes("a, 0, 0, 0\na, 1, 0, 0\n"),
              "nodes.csv:2\n  at: modal.matrices.nodes\n  expected: a node with a name of its own\n  got:      a, 1, 0, 0");
  expect_part(answer([](Written& w) { w.model.mass = "/dev/zero"; }), "error[C0102]: file not found");
  expect_part(with_mass(std::string(5000, '%')),
              "M.mtx:1\n  at: modal.matrices.mass\n  expected: a line of less than 1000 bytes\n  got:      a longer one");
  expect_part(with_nodes("a, 0, 0\n"), "nodes.csv:1\n  at: modal.matrices.nodes\n  expected: name, x, y, z [m]\n  got:      a, 0, 0");
  expect_part(with_nodes("a, 0, 0, nan\n"), "expected: name, x, y, z [m]");
  for (const char* columns : {"name, x, z, y", "name, x, y, w"})  // they were read as x, y, z
    expect_part(with_nodes(columns + std::string("\na, 0, 0, 0\n")),
                "nodes.csv:1\n  at: modal.matrices.nodes\n  expected: name, x, y, z [m]");
  expect_part(with_nodes("# none\n"), "got:      no node");
}

// The first node, which is the root, has the mark in front of its name; the line that was shown as wrong looked as it should.
TEST(Matrices, AreReadBehindAByteOrderMark) {
  EXPECT_EQ(answer([](Written& w) {
              for (const std::string& file : {w.model.nodes, w.model.mass, w.model.stiffness}) {
                std::ifstream in(file);
                const std::string text(std::istreambuf_iterator<char>(in), {});
                write_file(file, "\xEF\xBB\xBF" + text.substr(file == w.model.nodes ? text.find("n0") : 0));
              }
            }),
            "taken");
}

TEST(Matrices, ThatAreIndefiniteAreRefused) {  // their lowest modes are found all the same
  const FeModel mesh = mesh_of(slender_boom());
  const auto with = [&](double M33) {
    return answer([&](Written& w) {
      SparseMatrix M = mesh.M;
      for (int a = 3; a < 6; ++a) M.coeffRef(36 + a, 36 + a) += M33;
      write_file(w.model.mass, matrix_text(M));
    });
  };
  const double J = mesh.M.coeff(41, 41);
  EXPECT_EQ(with(-0.1 * J), "taken");
  expect_part(with(-0.9 * J), "at: modal.matrices.mass\n  expected: a mass matrix without negative eigenvalues\n  got:      ");
  expect_part(with(-2.0 * J), "at: modal.matrices.mass\n  expected: a mass matrix without negative eigenvalues\n  got:      -");
  expect_part(answer([&](Written& w) { write_file(w.model.damping = w.dir / "C.mtx", matrix_text(-1e-4 * mesh.K)); }),
              "at: modal.matrices.damping\n  expected: a damping matrix without negative eigenvalues");
  expect_part(answer([&](Written& w) { write_file(w.model.stiffness, matrix_text(-1.0 * mesh.K)); }),
              "expected: a stiffness matrix that is positive definite where the root is held\n  got:      72 negative eigenvalues");
  for (const double mass : {0.0, -0.01})
    expect_part(answer([](Written&) {},
                       [&](ModalSource& s) {
                         s.masses = {{mass, {6.0, 0.0, 0.0}, Matrix3d::Zero()}};
                       }),
                "error[C0301]: value out of range\n  at: modal.masses[0].mass\n  expected: a number > 0 [kg]");
  expect_part(answer([&](Written& w) {
                w.model.root = {};
                for (std::size_t i = 0; i < mesh.nodes.size(); ++i) w.model.root.names.push_back(fmt::format("n{}", i));
              }),
              "expected: degrees of freedom that are not held");
}

TEST(Matrices, ThatAreOfNoBodyAreRefused) {
  const FeModel mesh = mesh_of(slender_boom());
  const auto with = [&](double K00, double M22) {
    return answer([&](Written& w) {
      SparseMatrix K = mesh.K, M = mesh.M;
      K.coeffRef(6, 6) += K00, M.coeffRef(8, 8) += M22;
      write_file(w.model.stiffness, matrix_text(K));
      write_file(w.model.mass, matrix_text(M));
    });
  };
  EXPECT_EQ(with(0.0, 0.0), "taken");
  expect_part(with(1e6, 0.0),
              "error[C0323]: the finite-element model cannot be used\n  at: modal.matrices.stiffness\n"
              "  expected: a matrix that rigid motions do not load: nothing in it is held\n  got:      translation along x takes forces of "
              "1e+06 N or N m, "
              "where its entries make ");
  expect_part(with(0.0, 1.0), "at: modal.matrices.mass\n  expected: the same mass in all directions\n");
  expect_part(answer([](Written& w) { w.model.root.names = {"n99"}; }),
              "at: modal.matrices.root\n  expected: names of nodes of the table\n  got:      \"n99\"");
  expect_part(answer([](Written&) {}, [](ModalSource& s) { s.points[0].position.x() = 5.9; }),
              "at: modal.points[0].position\n  expected: the position of a node\n  got:      (5.9, 0, 0) m");
  expect_part(answer([](Written&) {},
                     [](ModalSource& s) {
                       s.points[0].nodes.names = {"n3", "n4"};
                     }),
              "error[C0323]: the finite-element model cannot be used\n  at: modal.points[0]\n  expected: `position` alone: nodes with "
              "rotations move what stands on "
              "them each by itself\n  got:      several nodes");
  expect_part(answer([](Written&) {},
                     [](ModalSource& s) {
                       s.masses = {{1.0, {5.9, 0.0, 0.0}, Matrix3d::Zero()}};
                     }),
              "at: modal.masses[0].position\n  expected: the position of a node");
  // Masses on a line do not resist turns about it.
  expect_part(answer(
                  [&](Written& w) {
                    SparseMatrix M(mesh.M.rows(), mesh.M.cols());
                    for (int i = 0; i < M.rows(); ++i)
                      if (i % 6 < 3) M.coeffRef(i, i) = 0.5;
                    write_file(w.model.mass, matrix_text(M));
                  },
                  [](ModalSource& s) { s.boundary = Boundary::free; }),
              "error[C0323]: the finite-element model cannot be used\n  at: modal\n  expected: a free body with inertia about every axis\n"
              "  got:      none about the line through (3, 0, 0) m along (1, 0, 0): all its masses are on it\n"
              "  hint:     one of `masses` with an `inertia`, or moments of inertia of the nodes in the mass matrix");
  // Nodes in another order than the matrices: the mass centre is not one.
  FeModel turned = mesh;
  for (Vector3d& x : turned.nodes) x = Vector3d(x.y(), x.x() * x.x(), 0.0);
  expect_part(answer([&](Written& w) { write_file(w.model.nodes, table_text(turned)); }),
              "expected: a matrix that rigid motions do not load");
}

}  // namespace
}  // namespace cardan
