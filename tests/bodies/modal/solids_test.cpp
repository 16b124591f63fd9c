// Solid elements against closed forms: constant strains, rigid bodies, waves between smooth walls, beams, the sphere of NAFEMS FV42.
#include "bodies/modal/solids.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include "bodies/modal/eigen_modes.hpp"
#include "bodies/modal/elements.hpp"
#include "bodies/modal/node_sets.hpp"
#include "core/linalg/dense.hpp"
#include "tests/bodies/modal/case_file.hpp"
#include "tests/bodies/modal/solid_samples.hpp"
#include "tests/support/worse.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using test::block;
using test::kSolidShapes;

const Material kSteel = {200e9, 0.3, 8000.0}, kAluminium = {70e9, 0.33, 2700.0};

/// Moves what is inside of the unit cube by up to a tenth, and nothing on its sides.
Vector3d stirred(const Vector3d& s) {
  const double bump = 6.4 * s.x() * (1 - s.x()) * s.y() * (1 - s.y()) * s.z() * (1 - s.z());
  return s + bump * Vector3d(std::sin(3 * s.y() + 1), std::cos(5 * s.z()), std::sin(4 * s.x() + 2 * s.y()));
}
/// A block 2 x 1 x 0.5 m with its inside stirred.
Vector3d brick(const Vector3d& s) { return Vector3d(2, 1, 0.5).cwiseProduct(stirred(s)); }

std::vector<int> nodes_at(const FeModel& model, const std::function<bool(const Vector3d&)>& where) {
  std::vector<int> out;
  for (std::size_t i = 0; i < model.nodes.size(); ++i)
    if (where(model.nodes[i])) out.push_back(static_cast<int>(i));
  return out;
}
/// Nodal values of a field.
VectorXd field_of(const FeModel& model, const std::function<Vector3d(const Vector3d&)>& u) {
  VectorXd out(model.n_dofs());
  for (std::size_t i = 0; i < model.nodes.size(); ++i) out.segment<3>(3 * static_cast<Eigen::Index>(i)) = u(model.nodes[i]);
  return out;
}
double apart_of(const MatrixXd& a, const MatrixXd& b) {
  return a.rows() == b.rows() && a.cols() == b.cols() ? (a - b).norm() / b.norm() : test::kInfinity;
}
VectorXd frequencies_of(const FeModel& model, const std::vector<int>& held, int count) {
  return normal_modes(model, held, count, held.empty() ? RigidModes::remove : RigidModes::refuse, {}).omega2.cwiseSqrt() /
         (2 * std::numbers::pi);
}

TEST(SolidShapesOf, EachElementAreOneAtTheirNodeAndHaveTheSlopesOfTheirValues) {
  for (const SolidShape shape : kSolidShapes) {
    const Matrix3Xd& places = places_of(shape);
    for (Eigen::Index i = 0; i < places.cols(); ++i)
      EXPECT_LE((shapes_at(shape, places.col(i)).N - VectorXd::Unit(places.cols(), i)).norm(), 1e-14) << name_of(shape) << i;
    const Vector3d at(0.21, 0.34, 0.13);
    const SolidShapes s = shapes_at(shape, at);
    EXPECT_NEAR(s.N.sum(), 1.0, 1e-14);
    EXPECT_LE((places * s.N - at).norm(), 1e-14) << name_of(shape);
    EXPECT_LE((places * s.dN - Matrix3d::Identity()).norm(), 1e-13) << name_of(shape);
    for (int a = 0; a < 3; ++a) {
      const double h = 1e-5;
      const VectorXd slope = (shapes_at(shape, at + h * Vector3d::Unit(a)).N - shapes_at(shape, at - h * Vector3d::Unit(a)).N) / (2 * h);
      EXPECT_LE((s.dN.col(a) - slope).norm(), 1e-9) << name_of(shape) << a;
    }
    if (shape == SolidShape::hexa8) continue;
    // All quadratic polynomials, which is what order 2 p = 4 of frequencies rests on.
    const auto q = [](const Vector3d& x) {
      return x.x() * x.y() - 2 * x.y() * x.z() + 3 * x.x() * x.z() + x.x() * x.x() - x.y() * x.y() + 0.5 * x.z() * x.z();
    };
    double sum = 0.0;
    for (Eigen::Index i = 0; i < places.cols(); ++i) sum += s.N(i) * q(places.col(i));
    EXPECT_NEAR(sum, q(at), 1e-14) << name_of(shape);
  }
}

TEST(Solids, PassThePatchTest) {
  const Matrix3d slope = (Matrix3d() << 1.0, 0.7, -0.3, 0.2, -0.8, 0.5, 0.6, -0.4, 0.9).finished();
  const Matrix3d strain = 0.5 * (slope + slope.transpose());
  const double mu = kSteel.E / 2.6, lambda = 2 * mu * 0.3 / 0.4, volume = 1.0;
  const double energy = volume * (0.5 * lambda * std::pow(strain.trace(), 2) + mu * strain.squaredNorm());
  for (const SolidShape shape : kSolidShapes)
    for (const bool straight : {true, false}) {
      const FeModel model = solid_mesh(block(shape, {3, 3, 3}, brick, kSteel, straight), {}, {});
      const VectorXd u = field_of(model, [&](const Vector3d& x) { return Vector3d(slope * x + Vector3d(1, 2, 3)); });
      const VectorXd f = model.K * u, size = model.K.cwiseAbs() * u.cwiseAbs();
      EXPECT_NEAR(0.5 * u.dot(f), energy, 1e-11 * energy) << name_of(shape) << straight;
      double inside = 0.0;
      const auto inner = nodes_at(model, [](const Vector3d& x) {
        return x.x() > 1e-9 && x.x() < 2 - 1e-9 && x.y() > 1e-9 && x.y() < 1 - 1e-9 && x.z() > 1e-9 && x.z() < 0.5 - 1e-9;
      });
      EXPECT_GE(inner.size(), 8u);
      for (const int i : inner)
        for (int a = 0; a < 3; ++a) inside = test::worse(inside, std::abs(f(3 * i + a)) / size(3 * i + a));
      EXPECT_LE(inside, 1e-13) << name_of(shape) << straight;
    }
}

TEST(Solids, MoveRigidlyWithoutForceAndHaveSixModesOfNoFrequency) {
  for (const SolidShape shape : kSolidShapes) {
    const FeModel model = solid_mesh(block(shape, {2, 2, 1}, brick, kSteel), {}, {});
    const RigidShapes R = model.rigid_shapes();
    const MatrixXd force = model.K * R, size = model.K.cwiseAbs() * R.cwiseAbs();
    EXPECT_LE(test::largest(force.cwiseQuotient(size)), 1e-13) << name_of(shape);
    const VectorXd lambda = generalised_eigenvalues(MatrixXd(model.K), MatrixXd(model.M)).value();
    EXPECT_LE(test::largest(lambda.head(6)), 1e-10 * lambda(6)) << name_of(shape);
    EXPECT_GT(lambda(6), 0.0);
  }
}

TEST(Solids, HaveTheMassOfTheirBody) {
  // x = 2 s + 0.6 t^2, y = t, z = 0.5 u: volume 1, and E of what bends with t^2: mean 1/3, of squares 1/5, of t t^2: 1/4.
  const auto bent = [](const Vector3d& s) { return Vector3d(2 * s.x() + 0.6 * s.y() * s.y(), s.y(), 0.5 * s.z()); };
  const double xx = 4.0 / 3 + 2 * 0.6 / 3 + 0.36 / 5, yy = 1.0 / 3, zz = 1.0 / 12, xy = 0.5 + 0.6 / 4, xz = (1 + 0.2) / 4, yz = 0.125;
  const Matrix3d moments = (Matrix3d() << xx, xy, xz, xy, yy, yz, xz, yz, zz).finished();
  const Vector3d centre(1.2, 0.5, 0.25);
  for (const SolidShape shape : {SolidShape::tetra10, SolidShape::hexa20, SolidShape::penta15}) {
    const auto both = [&](const Vector3d& s) { return bent(s); };
    const FeModel model = solid_mesh(block(shape, {2, 2, 2}, both, kSteel), {}, {});
    const RigidShapes R = model.rigid_shapes();
    const Eigen::Matrix<double, 6, 6> A = R.transpose() * (model.M * R);
    EXPECT_LE(apart_of(A.bottomRightCorner<3, 3>(), 8000 * Matrix3d::Identity()), 1e-13) << name_of(shape);
    EXPECT_LE(apart_of(A.topLeftCorner<3, 3>(), 8000 * (moments.trace() * Matrix3d::Identity() - moments)), 1e-13) << name_of(shape);
    EXPECT_NEAR(A(2, 4), 8000 * centre.x(), 1e-9);
    EXPECT_NEAR(A(0, 5), 8000 * centre.y(), 1e-9);
    EXPECT_NEAR(A(1, 3), 8000 * centre.z(), 1e-9);
  }
  for (const SolidShape shape : kSolidShapes) {  // a brick whose inside is stirred is the same brick
    const FeModel model = solid_mesh(block(shape, {3, 2, 2}, brick, kSteel), {}, {});
    const ModalIntegrals I = modal_integrals(model.mass_field(MatrixXd::Zero(model.n_dofs(), 1)));
    EXPECT_NEAR(I.I1, 8000, 8000 * 1e-13) << name_of(shape);
    EXPECT_LE((I.I2 - 8000 * Vector3d(1, 0.5, 0.25)).norm(), 8000 * 1e-13);
    const Vector3d square(4.0 / 3, 1.0 / 3, 0.25 / 3);
    Matrix3d J = -Vector3d(1, 0.5, 0.25) * Vector3d(1, 0.5, 0.25).transpose();
    J.diagonal() = Vector3d::Constant(square.sum()) - square;
    EXPECT_LE(apart_of(I.I7, 8000 * J), 1e-13) << name_of(shape);
  }
}

/// The integrals of displacement fields over the elements, point by point, by a rule of its own.
TEST(Solids, HaveModalIntegralsOfTheFieldsBetweenTheirNodes) {
  const double gauss[4] = {0.06943184420297371, 0.33000947820757187, 0.66999052179242813, 0.93056815579702629};
  const double weight[4] = {0.17392742256872693, 0.32607257743127307, 0.32607257743127307, 0.17392742256872693};
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const SolidMesh mesh = block(SolidShape::hexa20, {2, 2, 1}, brick, kSteel, true);  // straight edges: degree 6 in each direction
  const FeModel model = solid_mesh(mesh, {}, {});
  MatrixXd shapes = MatrixXd::NullaryExpr(model.n_dofs(), 2, [&] { return uniform(random); });
  Matrix3Xd I3 = Matrix3Xd::Zero(3, 2), I4 = I3;
  MatrixXd I6 = MatrixXd::Zero(2, 2);
  Vector3d I5 = Vector3d::Zero();
  Matrix3d I8 = Matrix3d::Zero(), I9 = Matrix3d::Zero();
  const auto minus = [](const Vector3d& a, const Vector3d& b) { return Matrix3d(a.dot(b) * Matrix3d::Identity() - b * a.transpose()); };
  for (const SolidMesh::Element& e : mesh.elements)
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j)
        for (int k = 0; k < 4; ++k) {
          const SolidShapes s = shapes_at(e.shape, Vector3d(gauss[i], gauss[j], gauss[k]) * 2 - Vector3d::Ones());
          Matrix3Xd x(3, 20);
          for (int c = 0; c < 20; ++c) x.col(c) = mesh.nodes[static_cast<std::size_t>(e.nodes[static_cast<std::size_t>(c)])];
          const double m = 8000 * 8 * weight[i] * weight[j] * weight[k] * Matrix3d(x * s.dN).determinant();
          const Vector3d r = x * s.N;
          Matrix3Xd phi = Matrix3Xd::Zero(3, 2);
          for (int c = 0; c < 20; ++c) phi += s.N(c) * shapes.middleRows(3 * e.nodes[static_cast<std::size_t>(c)], 3);
          I3 += m * phi;
          for (int l = 0; l < 2; ++l) I4.col(l) += m * r.cross(Vector3d(phi.col(l)));
          I6 += m * phi.transpose() * phi;
          I5 += m * Vector3d(phi.col(0)).cross(Vector3d(phi.col(1)));
          I8 += m * minus(r, phi.col(1));
          I9 += m * minus(phi.col(0), phi.col(1));
        }
  const ModalIntegrals I = modal_integrals(model.mass_field(shapes));
  EXPECT_LE(apart_of(I.I3, I3), 1e-12);
  EXPECT_LE(apart_of(I.I4, I4), 1e-12);
  EXPECT_LE(apart_of(I.I6, I6), 1e-12);
  EXPECT_LE(apart_of(I.I5[0].col(1), I5), 1e-12);
  EXPECT_LE(apart_of(I.I8[1], I8), 1e-12);
  EXPECT_LE(apart_of(I.I9[1], I9), 1e-12);
  const RigidShapes R = model.rigid_shapes();  // and of first order by M itself
  EXPECT_LE(apart_of(I.I3, (R.transpose() * (model.M * shapes)).bottomRows(3)), 1e-12);
  EXPECT_LE(apart_of(I.I4, (R.transpose() * (model.M * shapes)).topRows(3)), 1e-12);
}

TEST(Solids, KeepTheirFrequenciesWhenTurned) {
  const Matrix3d R = Eigen::AngleAxisd(1.1, Vector3d(1, -2, 3).normalized()).toRotationMatrix();
  for (const SolidShape shape : kSolidShapes) {
    const FeModel model = solid_mesh(block(shape, {3, 2, 2}, brick, kSteel), {}, {});
    const FeModel turned =
        solid_mesh(block(
                       shape, {3, 2, 2}, [&](const Vector3d& s) { return Vector3d(R * brick(s) + Vector3d(1, 2, 3)); }, kSteel),
                   {}, {});
    const VectorXd a = frequencies_of(model, {}, 8), b = frequencies_of(turned, {}, 8);
    EXPECT_LE(test::largest(b.cwiseQuotient(a).array() - 1.0), 1e-10) << name_of(shape);
  }
}

/// Renumberings of corners that leave an element what it is, with the nodes on edges: turned into itself, or with `mirrored` its image in a
/// mirror.
std::vector<std::vector<int>> renumberings(SolidShape shape, bool mirrored) {
  const int corners = corners_of(shape);
  const auto &own = edges_of(shape), &edges = own.empty() ? edges_of(SolidShape::hexa20) : own;
  const auto edge = [&](int a, int b) {
    const auto found = std::ranges::find_if(edges, [&](const auto& e) { return e == std::pair(a, b) || e == std::pair(b, a); });
    return found == edges.end() ? -1 : static_cast<int>(found - edges.begin());
  };
  const Matrix3Xd& places = places_of(shape);
  std::vector<std::vector<int>> out;
  std::vector<int> to(static_cast<std::size_t>(corners));
  std::iota(to.begin(), to.end(), 0);
  do {
    if (!std::ranges::all_of(
            edges, [&](const auto& e) { return edge(to[static_cast<std::size_t>(e.first)], to[static_cast<std::size_t>(e.second)]) >= 0; }))
      continue;
    std::vector<int> all = to;
    for (const auto& [a, b] : own) all.push_back(corners + edge(to[static_cast<std::size_t>(a)], to[static_cast<std::size_t>(b)]));
    if ((places(Eigen::all, all) * shapes_at(shape, Vector3d(0.25, 0.25, 0)).dN).determinant() * (mirrored ? -1 : 1) > 0)
      out.push_back(all);
  } while (std::next_permutation(to.begin(), to.end()));
  return out;
}

/// Which corner of an element a file lists first is nothing that the body knows, however crooked the element is.
TEST(Solids, DoNotKnowTheirFirstCorner) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> shift(-0.08, 0.08);
  for (const SolidShape shape : kSolidShapes) {
    Matrix3Xd x = places_of(shape);
    for (double& c : x.reshaped()) c += shift(random);
    const SolidMatrices as_listed = solid_matrices(shape, x, kSteel);
    const std::vector<std::vector<int>> turned = renumberings(shape, false), mirrored = renumberings(shape, true);
    const std::size_t turns = shape == SolidShape::tetra10 ? 12 : shape == SolidShape::penta15 ? 6 : 24;
    ASSERT_EQ(turned.size(), turns);
    ASSERT_EQ(mirrored.size(), turns);
    const auto expect_same = [&](const std::vector<int>& order, const Matrix3d& mirror) {
      const SolidMatrices one = solid_matrices(shape, Matrix3Xd(mirror * x(Eigen::all, order)), kSteel);
      MatrixXd K = one.K;
      for (std::size_t i = 0; i < order.size(); ++i)
        for (std::size_t j = 0; j < order.size(); ++j)
          K.block<3, 3>(3 * order[i], 3 * order[j]) =
              mirror * one.K.block<3, 3>(3 * static_cast<Eigen::Index>(i), 3 * static_cast<Eigen::Index>(j)) * mirror;
      EXPECT_LE(apart_of(K, as_listed.K), 1e-13) << name_of(shape);
      EXPECT_LE(apart_of(one.m, as_listed.m(order, order)), 1e-13) << name_of(shape);
    };
    for (const std::vector<int>& order : turned) expect_same(order, Matrix3d::Identity());
    for (const std::vector<int>& order : mirrored) expect_same(order, Vector3d(1, -1, 1).asDiagonal());
  }
}

/// Between smooth walls, which hold what is normal to them, a square box of any height has the waves u = (A sin x cos y cos z,
/// B cos x sin y cos z, ...) with omega^2 = (mu / rho) k^2 across k and (lambda + 2 mu) / rho k^2 along it, k = pi (l, m, n) / L.
TEST(Solids, ConvergeWithTheOrderOfTheirPolynomials) {
  const double mu = kSteel.E / 2.6, exact = std::sqrt(mu / kSteel.rho) * std::numbers::sqrt2 / 2.0;  // k = pi (1, 1, 0)
  for (const SolidShape shape : kSolidShapes) {
    double previous = 0.0;
    for (const int n : shape == SolidShape::tetra10 || shape == SolidShape::penta15 ? std::array{8, 16} : std::array{4, 8}) {
      const double height = 1.0 / n;
      const FeModel model =
          solid_mesh(block(
                         shape, {n, n, 1}, [&](const Vector3d& x) { return Vector3d(x.x(), x.y(), height * x.z()); }, kSteel),
                     {}, {});
      std::vector<int> held;
      for (int i = 0; i < static_cast<int>(model.nodes.size()); ++i)
        for (int a = 0; a < 3; ++a)
          if (const double x = model.nodes[static_cast<std::size_t>(i)][a]; x < 1e-9 || x > (a == 2 ? height : 1.0) - 1e-9)
            held.push_back(3 * i + a);
      const double error = frequencies_of(model, held, 1)(0) / exact - 1;
      EXPECT_GT(error, 0.0) << name_of(shape) << ": too stiff, as conforming elements are";
      if (previous != 0.0) {
        const double order = std::log2(previous / error), theory = shape == SolidShape::hexa8 ? 2.0 : 4.0;
        EXPECT_NEAR(order, theory, 0.2) << name_of(shape) << " " << error;
        RecordProperty(fmt::format("order, {}", name_of(shape)), fmt::format("{:.3f}, error {:.3g}", order, error));
      }
      previous = error;
    }
  }
}

TEST(Solids, BendAsATimoshenkoBeam) {
  const Material m = {70e9, 0.0, 2700.0};  // without a Poisson's ratio the clamped end has no stress of its own
  BeamModel beam;
  beam.length = 2.0;
  beam.material = m;
  beam.section = rectangle_section(0.1, 0.2, true);
  beam.elements = 200;
  const FeModel slender = beam_mesh(beam, {}, {});
  const VectorXd want = frequencies_of(slender, dofs_of({0}), 5);
  for (const SolidShape shape : kSolidShapes) {
    const test::Map map = [](const Vector3d& s) { return Vector3d(2 * s.x(), 0.1 * (s.y() - 0.5), 0.2 * (s.z() - 0.5)); };
    const FeModel model =
        solid_mesh(block(shape, shape == SolidShape::hexa8 ? std::array{40, 2, 4} : std::array{20, 1, 2}, map, m), {}, {});
    const auto end = nodes_at(model, [](const Vector3d& x) { return x.x() < 1e-9; });
    const VectorXd got = frequencies_of(model, dofs_of(end, 3), 5);
    for (int k = 0; k < 4; ++k)  // bending in both planes twice: 0.1 m and 0.2 m deep on 2 m
      EXPECT_NEAR(got(k), want(k), 5e-3 * want(k)) << name_of(shape) << ", mode " << k + 1;
  }
}

/// A third of an octant: the directions between (1, 0, 0) and its neighbours; the three make the octant.
SolidMesh octant(int n, int layers, double inner, double outer, const Material& material) {
  SolidMesh all;
  all.materials = {material};
  for (int third = 0; third < 3; ++third) {
    const auto map = [&](const Vector3d& s) {
      const double a = s.x(), b = s.y();  // a square with a corner on an axis, the opposite one in the middle of the octant
      Vector3d d(1.0, std::tan(a * std::numbers::pi / 4), std::tan(b * std::numbers::pi / 4));
      d = Vector3d(d[(3 - third) % 3], d[(4 - third) % 3], d[(5 - third) % 3]);
      return Vector3d((inner + (outer - inner) * s.z()) * d.normalized());
    };
    const SolidMesh part = block(SolidShape::hexa20, {n, n, layers}, map, material);
    std::vector<int> index;
    for (const Vector3d& x : part.nodes) {
      int same = -1;
      for (std::size_t i = 0; i < all.nodes.size() && same < 0; ++i)
        if ((all.nodes[i] - x).norm() < 1e-9 * outer) same = static_cast<int>(i);
      if (same < 0) {
        same = static_cast<int>(all.nodes.size());
        all.nodes.push_back(x);
        all.numbers.push_back(same + 1), all.lines.push_back(same + 1);
      }
      index.push_back(same);
    }
    for (SolidMesh::Element e : part.elements) {
      for (int& node : e.nodes) node = index[static_cast<std::size_t>(node)];
      e.number = e.line = static_cast<int>(all.elements.size()) + 1;
      all.elements.push_back(std::move(e));
    }
  }
  return all;
}

// The sphere moves radially, alike in all directions: nodes of one radius have one displacement. An octant between its planes of symmetry
// has these modes among its others, of which the first is found by itself.
TEST(Solids, SphereHasTheFrequenciesOfNafemsFv42) {
  const std::vector<double> want = case_values("modal-sphere-fv42", "f exact [Hz]");
  const Material m = {200e9, 0.3, 8000.0};
  constexpr int kLayers = 16;
  const FeModel model = solid_mesh(octant(3, kLayers, 1.8, 6.0, m), {}, {});
  std::vector<int> held;
  for (int i = 0; i < static_cast<int>(model.nodes.size()); ++i)
    for (int a = 0; a < 3; ++a)
      if (std::abs(model.nodes[static_cast<std::size_t>(i)][a]) < 1e-9) held.push_back(3 * i + a);

  MatrixXd radial = MatrixXd::Zero(model.n_dofs(), 2 * kLayers + 1);
  for (std::size_t i = 0; i < model.nodes.size(); ++i) {
    const Vector3d& x = model.nodes[i];
    const auto layer = static_cast<Eigen::Index>(std::lround((x.norm() - 1.8) / 4.2 * 2 * kLayers));
    radial.block<3, 1>(3 * static_cast<Eigen::Index>(i), layer) = x.normalized();
  }
  const VectorXd lambda = generalised_eigenvalues(radial.transpose() * (model.K * radial), radial.transpose() * (model.M * radial)).value();
  for (int k = 0; k < 5; ++k)
    test::expect_relative(fmt::format("radial mode {} [Hz]", k + 1), std::sqrt(lambda(k)) / (2 * std::numbers::pi),
                          want[static_cast<std::size_t>(k)], 0.002);

  const FeModel coarse = solid_mesh(octant(2, 4, 1.8, 6.0, m), {}, {});
  held.clear();
  VectorXd outward = VectorXd::Zero(coarse.n_dofs());
  for (int i = 0; i < static_cast<int>(coarse.nodes.size()); ++i) {
    const Vector3d& x = coarse.nodes[static_cast<std::size_t>(i)];
    outward.segment<3>(3 * i) = x.normalized();
    for (int a = 0; a < 3; ++a)
      if (std::abs(x[a]) < 1e-9) held.push_back(3 * i + a);
  }
  const FeModes modes = normal_modes(coarse, held, 12, RigidModes::refuse, {});
  Eigen::Index first;
  (modes.shapes.transpose() * (coarse.M * outward)).cwiseAbs().maxCoeff(&first);
  test::expect_relative("radial mode 1 [Hz], among all of an octant", std::sqrt(modes.omega2(first)) / (2 * std::numbers::pi), want[0],
                        0.002);
}

// --- what holds on to a solid -----------------------------------------------------------------------------------------------------------

TEST(SolidGrips, MoveWithARigidBodyAndTurnWithABentOne) {
  const FeModel model = solid_mesh(
      block(
          SolidShape::tetra10, {8, 2, 2}, [](const Vector3d& s) { return Vector3d(4 * s.x(), s.y() - 0.5, s.z() - 0.5); }, kSteel),
      {}, {});
  NodeSet face;
  face.normal = Vector3d::UnitX();
  const Vector3d at(4, 0.3, -0.2);
  const FeModel::Grip grip = grip_of(model, face, at, "points[0]", {});
  MatrixXd want = MatrixXd::Identity(6, 6);
  const MatrixXd got = grip.of(model.rigid_shapes(), 3);
  for (int a = 0; a < 3; ++a) {
    want.col(a) << Vector3d::Unit(a).cross(at), Vector3d::Unit(a);
    want.col(3 + a) << Vector3d::Unit(a), Vector3d::Zero();
  }
  EXPECT_LE((got - want).norm(), 1e-13);
  // Pure bending: u = (-kappa x y, kappa x^2 / 2, 0) turns a section by kappa x about z.
  const MatrixXd bent = field_of(model, [](const Vector3d& x) { return Vector3d(-0.1 * x.x() * x.y(), 0.05 * x.x() * x.x(), 0); });
  const MatrixXd end = grip.of(bent, 3);
  EXPECT_NEAR(end(5), 0.4, 1e-13);
  EXPECT_LE(std::hypot(end(3), end(4)), 1e-13);
  EXPECT_NEAR(end(1), 0.8, 1e-13);
  EXPECT_NEAR(end(0), -0.4 * at.y(), 1e-13);
  // Around one node, of elements 0.5 m: to their size.
  const FeModel::Grip near = grip_of(model, {}, {2, 0, 0}, "points[0]", {});
  EXPECT_NEAR(near.of(bent, 3)(5), 0.2, 1e-3);
  EXPECT_EQ(near.position, Vector3d(2, 0, 0));
}

TEST(SolidGrips, CarryLumpedMasses) {
  const SolidMesh mesh = block(
      SolidShape::hexa20, {4, 1, 1}, [](const Vector3d& s) { return Vector3d(2 * s.x(), 0.2 * s.y(), 0.2 * s.z()); }, kAluminium);
  PointMass mass{7.0, {2.3, 0.1, 0.4}, Vector3d(0.3, 0.4, 0.5).asDiagonal()};
  mass.nodes.normal = Vector3d::UnitX();
  mass.nodes.within = 0.0;
  const Vector3d on_face(2.0, 0.1, 0.4);
  mass.position = on_face;
  const FeModel bare = solid_mesh(mesh, {}, {}), loaded = solid_mesh(mesh, {mass}, {});
  const RigidShapes R = bare.rigid_shapes();
  const MatrixXd more = R.transpose() * (loaded.M * R) - R.transpose() * (bare.M * R);
  const Matrix3d at = 7.0 * (on_face.squaredNorm() * Matrix3d::Identity() - on_face * on_face.transpose());
  EXPECT_LE((more.bottomRightCorner(3, 3) - 7.0 * Matrix3d::Identity()).norm(), 1e-9);
  EXPECT_LE((more.topLeftCorner(3, 3) - at - mass.inertia).norm(), 1e-9);
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const MatrixXd shapes = MatrixXd::NullaryExpr(loaded.n_dofs(), 3, [&] { return uniform(random); });
  const ModalIntegrals I = modal_integrals(loaded.mass_field(shapes));
  EXPECT_LE(apart_of(I.I6, shapes.transpose() * (loaded.M * shapes)), 1e-12);
  EXPECT_LE(apart_of(I.I3, (R.transpose() * (loaded.M * shapes)).bottomRows(3)), 1e-12);
  EXPECT_LE(apart_of(I.I4, (R.transpose() * (loaded.M * shapes)).topRows(3)), 1e-12);
  EXPECT_NEAR(I.I1, 2 * 0.04 * 2700 + 7, 1e-10);
  EXPECT_FALSE(I.rotary_ww.empty());
}

TEST(SolidGrips, OfAnInterfaceMoveRigidlyWithTheStaticStiffness) {
  // A bar pulled, twisted and bent at a rigid end plate.
  const Material m = {70e9, 0.0, 2700.0};
  const FeModel model = solid_mesh(block(
                                       SolidShape::hexa20, {10, 2, 2},
                                       [](const Vector3d& s) { return Vector3d(2 * s.x(), 0.1 * (s.y() - 0.5), 0.1 * (s.z() - 0.5)); }, m),
                                   {}, {});
  const std::vector<int> held = dofs_of(nodes_at(model, [](const Vector3d& x) { return x.x() < 1e-9; }), 3);
  NodeSet face;
  face.normal = Vector3d::UnitX();
  const FeModel::Grip grip = grip_of(model, face, {2, 0, 0}, "points[0]", {});
  const FeModes modes = craig_bampton(model, held, dofs_of(grip.nodes, 3), model.rigid_motion(grip), 4, {});
  ASSERT_EQ(modes.omega2.size(), 10);
  const MatrixXd end = grip.of(modes.shapes, 3);
  const MatrixXd flexibility = end * modes.omega2.cwiseInverse().asDiagonal() * end.transpose();
  const double EA = 70e9 * 0.01, EI = 70e9 * 1e-4 / 12, GA = 35e9 * 0.01 * 5 / 6;
  EXPECT_NEAR(flexibility(0, 0), 2 / EA, 1e-9 * 2 / EA);
  EXPECT_NEAR(flexibility(1, 1), 8 / (3 * EI) + 2 / GA, 2e-3 * 8 / (3 * EI));
  EXPECT_NEAR(flexibility(1, 5), 4 / (2 * EI), 2e-3 * 4 / (2 * EI));
  EXPECT_NEAR(flexibility(5, 5), 2 / EI, 2e-3 * 2 / EI);
  EXPECT_NEAR(flexibility(2, 4), -4 / (2 * EI), 2e-3 * 4 / (2 * EI));
  // In torsion both ends keep their sections flat, which is felt within the depth of the bar: its length less 0 to 5 %.
  const double twist = 2 / (35e9 * 0.1406e-4);
  EXPECT_LT(flexibility(3, 3), twist);
  EXPECT_GT(flexibility(3, 3), 0.95 * twist);
  // The plate is rigid: its nodes move as its frame does.
  MatrixXd plate = MatrixXd::Zero(static_cast<Eigen::Index>(3 * grip.nodes.size()), 10), frame = plate;
  const MatrixXd by_frame = model.rigid_motion(grip) * end;
  for (std::size_t i = 0; i < grip.nodes.size(); ++i) {
    plate.middleRows(3 * static_cast<Eigen::Index>(i), 3) = modes.shapes.middleRows(3 * grip.nodes[i], 3);
    frame.middleRows(3 * static_cast<Eigen::Index>(i), 3) = by_frame.middleRows(3 * grip.nodes[i], 3);
  }
  EXPECT_LE(apart_of(plate, frame), 1e-10);
}

// --- what is refused
// ----------------------------------------------------------------------------------------------------------------------

Diagnostic refused(const std::function<void()>& what) {
  try {
    what();
  } catch (const InputError& e) {
    return e.diagnostics().front();
  }
  return {};
}

TEST(SolidMeshes, ThatAreNoBodyAreRefusedWithTheirLine) {
  const auto identity = [](const Vector3d& s) { return s; };
  for (const SolidShape shape : kSolidShapes) {
    const auto expect = [&](const std::function<void(SolidMesh&)>& spoil, const std::string& got, int line) {
      SolidMesh mesh = block(shape, {2, 1, 1}, identity, kSteel);
      mesh.file = "mesh.bdf";
      spoil(mesh);
      const Diagnostic d = refused([&] { solid_mesh(mesh, {}, {"modal", {}}); });
      EXPECT_EQ(number_of(d.code), "C0323") << name_of(shape) << got;
      EXPECT_NE(d.got.find(got), std::string::npos) << name_of(shape) << ": " << d.got;
      EXPECT_EQ(d.at.mark.file, "mesh.bdf");
      EXPECT_EQ(d.at.mark.line, line) << d.got;
      EXPECT_FALSE(d.hint.empty());
    };
    expect(
        [](SolidMesh& m) {
          for (Vector3d& x : m.nodes) x.x() = -x.x();
        },
        "element 1, a", 1);
    expect(
        [](SolidMesh& m) {
          for (Vector3d& x : m.nodes) x.x() = 0;
        },
        "inside out", 1);
    expect([](SolidMesh& m) { m.nodes.push_back({5, 5, 5}), m.numbers.push_back(77), m.lines.push_back(99); }, "node 77", 99);
    expect([](SolidMesh& m) { m.elements.push_back(m.elements[0]), m.elements.back().line = 50; }, "has the nodes of element 1", 50);
    expect([](SolidMesh& m) { m.elements[0].nodes[1] = m.elements[0].nodes[0]; }, "a node twice", 1);
    expect(
        [&](SolidMesh& m) {
          const SolidMesh far = block(
              shape, {1, 1, 1}, [](const Vector3d& s) { return Vector3d(s + Vector3d(5, 0, 0)); }, kSteel);
          const int first = static_cast<int>(m.nodes.size());
          for (const Vector3d& x : far.nodes) m.nodes.push_back(x), m.numbers.push_back(100), m.lines.push_back(100);
          for (SolidMesh::Element e : far.elements) {
            for (int& i : e.nodes) i += first;
            e.number = 500, e.line = 60;
            m.elements.push_back(e);
          }
        },
        "no way from element 1 to element 500", 60);
  }
}

TEST(SolidMeshes, OfNodesInAWrongOrderAreRefused) {
  // Every exchange of two nodes of an element folds it, or turns it inside out, but none that is a turn of the whole.
  for (const SolidShape shape : kSolidShapes) {
    const Matrix3Xd places = places_of(shape);
    for (Eigen::Index i = 0; i < places.cols(); ++i)
      for (Eigen::Index j = 0; j < i; ++j) {
        Matrix3Xd x = places;
        x.col(i).swap(x.col(j));
        EXPECT_LE(determinants(shape, x).first, 0.0) << name_of(shape) << ": " << i << " and " << j;
      }
    EXPECT_GT(determinants(shape, places).first, 0.0);
  }
  // The order of the edges of Gmsh, taken for that of NASTRAN.
  Matrix3Xd x = places_of(SolidShape::tetra10);
  x.col(8).swap(x.col(9));
  EXPECT_LE(determinants(SolidShape::tetra10, x).first, 0.0);
  SolidMesh mixed = block(
      SolidShape::hexa20, {1, 1, 1}, [](const Vector3d& s) { return s; }, kSteel);
  const SolidMesh linear = block(
      SolidShape::hexa8, {1, 1, 1}, [](const Vector3d& s) { return Vector3d(s + Vector3d(1, 0, 0)); }, kSteel);
  SolidMesh::Element e = linear.elements[0];
  for (int& i : e.nodes) i += static_cast<int>(mixed.nodes.size());
  for (const Vector3d& y : linear.nodes) mixed.nodes.push_back(y), mixed.numbers.push_back(1), mixed.lines.push_back(1);
  mixed.elements.push_back(e);
  EXPECT_EQ(refused([&] { solid_mesh(mixed, {}, {}); }).expected, "elements of one order");
}

}  // namespace
}  // namespace cardan
