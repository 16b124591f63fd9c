#include "bodies/modal/matrices.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>

#include "bodies/modal/matrix_market.hpp"
#include "bodies/modal/node_sets.hpp"
#include "bodies/modal/refuse.hpp"
#include "bodies/modal/text_lines.hpp"
#include "core/base/units.hpp"
#include "core/linalg/linear_operator.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr std::size_t kMostNodes = 50'000, kMostDrawnNodes = 300, kMostDrawnPairs = 5000;
constexpr int kMostComponentModes = 10'000;
constexpr double kRigid = 1e-6;         // relative: what matrices printed with seven digits are right to
constexpr double kSemidefinite = 1e-5;  // of a matrix with a unit diagonal: what rows of matrices printed with seven digits sum up to
constexpr double kSamePlace = 1e-6;     // of the size of the body
constexpr const char* kRigidMotions[] = {"rotation about x",    "rotation about y",    "rotation about z",
                                         "translation along x", "translation along y", "translation along z"};
constexpr const char* kUnits =
    "six degrees of freedom for each node, in the order of the table: ux, uy, uz, rx, ry, rz, or the first three; SI; the same axes and "
    "origin";

void read_nodes(const std::string& path, const Located& at, FeModel& model) {
  TextLines lines(path, at, "a table of nodes: name, x, y, z");
  std::map<std::string, int>& names = model.names;
  while (lines.next()) {
    const std::string& line = lines.line();
    const auto bad = [&](const char* expected) { refuse(Code::bad_modal_data, lines.here(), expected, line); };
    if (line.empty() || line[0] == '#') continue;
    std::vector<std::string> fields(1);
    for (char c : line)
      if (c == ',')
        fields.emplace_back();
      else if (c != ' ' && c != '\t')
        fields.back() += c;
    if (fields.size() != 4 || fields[0].empty()) bad("name, x, y, z [m]");
    Vector3d position;
    bool numbers = true;
    for (int a = 0; a < 3; ++a) {
      const std::string& f = fields[static_cast<std::size_t>(a) + 1];
      const auto [end, error] = std::from_chars(f.data() + f.starts_with('+'), f.data() + f.size(), position[a]);
      numbers = numbers && error == std::errc() && end == f.data() + f.size() && std::isfinite(position[a]);
    }
    if (names.empty() && fields[1] == "x" && fields[2] == "y" && fields[3] == "z") continue;  // what stands above the columns
    if (!numbers) bad("name, x, y, z [m]");
    if (!names.emplace(fields[0], static_cast<int>(names.size())).second) bad("a node with a name of its own");
    if (names.size() > kMostNodes) bad("at most 50000 nodes");
    model.nodes.push_back(position);
  }
  if (names.empty()) refuse(Code::bad_modal_data, {at.key_path, {path}}, "a table of nodes: name, x, y, z", "no node");
}

/// M is a quadratic form in the velocities of the nodes. Where it weighs their three directions alike, m_ij x_i' x_j', it is that of masses
/// between the nodes. What differs between the directions they do not know. With rotations, what M has of node j is at its distance d from
/// there, as a mass with an offset is, and has the velocity u' + theta' x d: s_ij and P_ij are the sums of m d_j and of m d_i d_j*, and
/// (FeModel::N) the components of d are three more points of each node.
SparseMatrix masses_between(const FeModel& model) {
  const int n = static_cast<int>(model.nodes.size()), k = model.per_node, nodal = k * n;
  std::vector<Eigen::Triplet<double>> m;
  const auto add = [&](int row, int col, double value) { m.emplace_back(row, col, value); };
  for (int j = 0; j < nodal; ++j)
    for (SparseMatrix::InnerIterator it(model.M, j); it; ++it) {
      if (it.row() >= nodal) continue;
      const int from = static_cast<int>(it.row()) / k, to = j / k, a = static_cast<int>(it.row()) % k, b = j % k;
      const double value = it.value();
      if (a < 3 && b < 3) {
        if (a == b) add(from, to, value / 3.0);
      } else if (a < 3 && a != b - 3) {  // - s~ of the velocity of `from` and the rotation of `to`: half of each of two entries
        const int axis = 3 - a - (b - 3);
        const double share = (b - 3 == (a + 1) % 3 ? 0.5 : -0.5) * value;
        add(from, n + 3 * to + axis, share), add(n + 3 * to + axis, from, share);
      } else if (a >= 3 && b >= 3) {  // (d_i . d_j) 1 - d_j d_i*
        add(n + 3 * from + b - 3, n + 3 * to + a - 3, -value);
        if (a == b)
          for (int c = 0; c < 3; ++c) add(n + 3 * from + c, n + 3 * to + c, 0.5 * value);
      }
    }
  const int points = k == 6 ? 4 * n : n;
  SparseMatrix out(points, points);
  out.setFromTriplets(m.begin(), m.end());
  return out;
}

/// Rigid motions are to take no force: what would is held to something, or turns its own axes.
void expect_free(const SparseMatrix& A, const FeModel& model, const std::string& field, const char* unit, const Located& at) {
  const RigidShapes R = model.rigid_shapes();
  const MatrixXd force = A * R, sizes = A.cwiseAbs() * R.cwiseAbs();
  for (int d = 0; d < 6; ++d)
    if (!(force.col(d).norm() <= kRigid * sizes.col(d).norm()))
      refuse(at, field, Code::fe_model, "a matrix that rigid motions do not load: nothing in it is held",
             fmt::format("{} takes forces of {:.4g} {}, where its entries make {:.4g}", kRigidMotions[d], force.col(d).norm(), unit,
                         sizes.col(d).norm()),
             kUnits);
}

/// No motion of the nodes may have less than no kinetic energy, or give energy where C should take it.
void expect_semidefinite(const SparseMatrix& A, const std::string& field, const char* what, const char* hint, const Located& at) {
  const auto refuse_it = [&](std::string got) { refuse(at, field, Code::fe_model, what, std::move(got), hint); };
  const auto n = static_cast<int>(A.rows());
  Eigen::VectorXd scale = A.diagonal();
  for (int i = 0; i < n; ++i) {
    if (scale[i] < 0.0) refuse_it(fmt::format("{:.6g} in row and column {}", scale[i], i + 1));
    scale[i] = scale[i] > 0.0 ? 1.0 / std::sqrt(scale[i]) : 0.0;
  }
  for (int j = 0; j < n; ++j)
    for (SparseMatrix::InnerIterator it(A, j); it; ++it)
      if (it.value() != 0.0 && scale[j] == 0.0)
        refuse_it(fmt::format("{:.6g} in row {}, column {}, and 0 in row and column {}", it.value(), it.row() + 1, j + 1, j + 1));
  SparseMatrix unit(n, n);  // with a unit diagonal, raised by what rounding may have taken
  unit.setIdentity();
  SparseMatrix raised = scale.asDiagonal() * A * scale.asDiagonal();
  raised += kSemidefinite * unit;
  for (int i = 0; i < n; ++i)
    if (scale[i] == 0.0) raised.coeffRef(i, i) = 1.0;
  raised.makeCompressed();
  int negative = 1;
  try {
    negative = SparseFactor(raised).negative_pivots();
  } catch (const LinalgError&) {  // a pivot of zero is one that is not positive
  }
  if (negative > 0)
    refuse_it(fmt::format("{} negative eigenvalue{} of the matrix with a unit diagonal", negative, negative == 1 ? "" : "s"));
}

/// The 6 x 6 mass matrix of a rigid body, angular first, about the origin.
void expect_body(const FeModel& model, const Located& at) {
  const RigidShapes R = model.rigid_shapes();
  const Matrix6 A = R.transpose() * (model.M * R);
  const double m = A.bottomRightCorner<3, 3>().trace() / 3.0;
  if (!(m > 0.0)) refuse(at, "matrices.mass", Code::fe_model, "a mass > 0", fmt::format("{:.6g} kg", m), kUnits);
  const Matrix3d of_directions = A.bottomRightCorner<3, 3>() - m * Matrix3d::Identity();
  const Matrix3d S = A.topRightCorner<3, 3>();
  const double size = std::sqrt(std::max(A.topLeftCorner<3, 3>().trace() / m, 0.0));
  const Matrix3d even = S + S.transpose();
  if (!(of_directions.norm() <= kRigid * m))
    refuse(at, "matrices.mass", Code::fe_model, "the same mass in all directions",
           fmt::format("{:.7g}, {:.7g} and {:.7g} kg along x, y and z", A(3, 3), A(4, 4), A(5, 5)), kUnits);
  if (!(even.norm() <= kRigid * m * size))
    refuse(at, "matrices.mass", Code::fe_model, "one mass centre",
           fmt::format("others for forces along different axes, by up to {:.4g} m", even.norm() / m), kUnits);
}

}  // namespace

FeModel matrix_mesh(const MatrixModel& source, const std::vector<PointMass>& masses, const Located& at) {
  FeModel model;
  const auto place = [&](const char* key) { return Located{at.key_path + ".matrices." + key, at.mark}; };
  read_nodes(source.nodes, place("nodes"), model);
  const int n = static_cast<int>(model.nodes.size());
  double size = 0.0;
  for (const Vector3d& x : model.nodes) size = std::max(size, (x - model.nodes[0]).norm());
  model.element_size = kSamePlace * size;
  const int more = model.component_modes = source.component_modes;
  if (more < 0 || more > kMostComponentModes)
    refuse(at, "matrices.component_modes", Code::out_of_range, fmt::format("a number from 0 to {}", kMostComponentModes),
           fmt::format("{}", more));
  model.K = read_symmetric_matrix(source.stiffness, n, {6, 3}, more, place("stiffness"));
  model.per_node = (static_cast<int>(model.K.rows()) - more) / n;
  model.M = read_symmetric_matrix(source.mass, n, {model.per_node}, more, place("mass"));
  expect_free(model.K, model, "matrices.stiffness", "N or N m", at);
  expect_body(model, at);
  expect_semidefinite(model.M, "matrices.mass", "a mass matrix without negative eigenvalues",
                      "a node or a rotation with a mass of the wrong sign? Frequencies alone do not tell", at);
  if (!source.damping.empty()) {
    model.C = read_symmetric_matrix(source.damping, n, {model.per_node}, more, place("damping"));
    expect_free(model.C, model, "matrices.damping", "N s or N m s", at);
    expect_semidefinite(model.C, "matrices.damping", "a damping matrix without negative eigenvalues",
                        "negative damping would create energy", at);
  }
  model.exact_points = false;
  model.between = masses_between(model);
  add_masses(model, masses, at);
  if (source.root.nearest() && model.find_node(Vector3d::Zero()) < 0)
    refuse(at, "matrices.root", Code::missing_key, "the nodes that the body frame holds", "none, and no node at the origin",
           "root: [name, ...]");
  model.root_nodes = nodes_of(model, source.root, source.at, "matrices.root", at);
  if (model.nodes.size() <= kMostDrawnNodes) {
    std::map<std::pair<int, int>, bool> coupled;
    const int nodal = model.n_dofs() - more;
    for (int j = 0; j < nodal; ++j)
      for (SparseMatrix::InnerIterator it(model.K, j); it && it.row() < nodal; ++it)
        if (const int a = j / model.per_node, b = static_cast<int>(it.row()) / model.per_node; b > a && it.value() != 0.0)
          coupled[{a, b}] = true;
    if (coupled.size() <= kMostDrawnPairs)  // a condensed model couples all its nodes: they are no picture of it
      for (const auto& [pair, yes] : coupled) model.lines.push_back({pair.first, pair.second});
  }
  model.description = fmt::format("matrices {} and {}, {} nodes", std::filesystem::path(source.mass).filename().string(),
                                  std::filesystem::path(source.stiffness).filename().string(), model.nodes.size());
  return model;
}

}  // namespace cardan
