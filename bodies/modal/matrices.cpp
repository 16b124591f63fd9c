#include "bodies/modal/matrices.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>

#include "bodies/modal/matrix_market.hpp"
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

constexpr std::size_t kMostNodes = 50'000, kMostDrawnNodes = 300;
constexpr double kRigid = 1e-6;         // relative: what matrices printed with seven digits are right to
constexpr double kSemidefinite = 1e-5;  // of a matrix with a unit diagonal: what rows of matrices printed with seven digits sum up to
constexpr double kSamePlace = 1e-6;     // of the size of the body
constexpr const char* kRigidMotions[] = {"rotation about x",    "rotation about y",    "rotation about z",
                                         "translation along x", "translation along y", "translation along z"};
constexpr const char* kUnits =
    "six degrees of freedom for each node, in the order of the table: ux, uy, uz, rx, ry, rz; SI; the same axes and origin";

/// Names of the nodes, in their order; their positions go to the model.
std::map<std::string, int> read_nodes(const std::string& path, const Located& at, FeModel& model) {
  TextLines lines(path, at, "a table of nodes: name, x, y, z");
  std::map<std::string, int> names;
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
    if (!numbers && names.empty() && fields[1] == "x") continue;  // what stands above the columns
    if (!numbers) bad("name, x, y, z [m]");
    if (!names.emplace(fields[0], static_cast<int>(names.size())).second) bad("a node with a name of its own");
    if (names.size() > kMostNodes) bad("at most 50000 nodes");
    model.nodes.push_back(position);
  }
  if (names.empty()) refuse(Code::bad_modal_data, {at.key_path, {path}}, "a table of nodes: name, x, y, z", "no node");
  return names;
}

/// M is a quadratic form in the velocities of the nodes. Where it weighs their three directions alike, m_ij x_i' x_j', it is that of masses
/// between the nodes: 2 x_i x_j = 4 ((x_i + x_j) / 2)^2 - x_i^2 - x_j^2. What differs between the directions, and rotations, the points do
/// not know.
void add_points(FeModel& model) {
  const int n = static_cast<int>(model.nodes.size());
  Eigen::VectorXd at_node = Eigen::VectorXd::Zero(n);
  std::map<std::pair<int, int>, double> between;
  for (int j = 0; j < model.M.outerSize(); ++j)
    for (SparseMatrix::InnerIterator it(model.M, j); it; ++it) {
      const int row = static_cast<int>(it.row()), a = row / 6, b = j / 6;
      if (row % 6 != j % 6 || row % 6 >= 3 || a < b) continue;
      (a == b ? at_node[a] : between[{b, a}]) += it.value() / 3.0;
    }
  std::vector<double> mass;
  std::vector<Vector3d> position;
  std::vector<Eigen::Triplet<double>> N[3];
  const auto add = [&](double m, std::initializer_list<int> of) {
    Vector3d x = Vector3d::Zero();
    const double weight = 1.0 / static_cast<double>(of.size());
    for (int i : of) {
      x += weight * model.nodes[static_cast<std::size_t>(i)];
      for (int a = 0; a < 3; ++a) N[a].emplace_back(static_cast<int>(mass.size()), 6 * i + a, weight);
    }
    mass.push_back(m), position.push_back(x);
  };
  for (const auto& [pair, m] : between) {
    if (m == 0.0) continue;
    add(4.0 * m, {pair.first, pair.second});
    at_node[pair.first] -= m, at_node[pair.second] -= m;
  }
  for (int i = 0; i < n; ++i) add(at_node[i], {i});
  const auto points = static_cast<Eigen::Index>(mass.size());
  model.point_mass = Eigen::Map<const Eigen::VectorXd>(mass.data(), points);
  model.point_position.resize(3, points);
  for (Eigen::Index p = 0; p < points; ++p) model.point_position.col(p) = position[static_cast<std::size_t>(p)];
  for (int a = 0; a < 3; ++a) {
    model.N[a].resize(points, model.n_dofs());
    model.N[a].setFromTriplets(N[a].begin(), N[a].end());
    model.Q[a].resize(points, model.n_dofs());
  }
  model.exact_points = false;
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
  const std::map<std::string, int> names = read_nodes(source.nodes, place("nodes"), model);
  double size = 0.0;
  for (const Vector3d& x : model.nodes) size = std::max(size, (x - model.nodes[0]).norm());
  model.element_size = kSamePlace * size;
  model.K = read_symmetric_matrix(source.stiffness, model.n_dofs(), place("stiffness"));
  model.M = read_symmetric_matrix(source.mass, model.n_dofs(), place("mass"));
  expect_free(model.K, model, "matrices.stiffness", "N or N m", at);
  expect_body(model, at);
  expect_semidefinite(model.M, "matrices.mass", "a mass matrix without negative eigenvalues",
                      "a node or a rotation with a mass of the wrong sign? Frequencies alone do not tell", at);
  if (!source.damping.empty()) {
    model.C = read_symmetric_matrix(source.damping, model.n_dofs(), place("damping"));
    expect_free(model.C, model, "matrices.damping", "N s or N m s", at);
    expect_semidefinite(model.C, "matrices.damping", "a damping matrix without negative eigenvalues",
                        "negative damping would create energy", at);
  }
  std::vector<Eigen::Triplet<double>> added;
  for (std::size_t i = 0; i < masses.size(); ++i) {
    if (!(masses[i].mass > 0.0))
      refuse(at, fmt::format("masses[{}].mass", i), Code::out_of_range, "a number > 0 [kg]", fmt::format("{}", masses[i].mass));
    const int node = model.find_node(masses[i].position);
    if (node < 0)
      refuse(at, fmt::format("masses[{}].position", i), Code::fe_model, "the position of a node",
             fmt::format("({}, {}, {}) m", masses[i].position.x(), masses[i].position.y(), masses[i].position.z()));
    for (int a = 0; a < 3; ++a) {
      added.emplace_back(6 * node + a, 6 * node + a, masses[i].mass);
      for (int b = 0; b < 3; ++b) added.emplace_back(6 * node + 3 + a, 6 * node + 3 + b, masses[i].inertia(a, b));
    }
  }
  SparseMatrix lumped(model.n_dofs(), model.n_dofs());
  lumped.setFromTriplets(added.begin(), added.end());
  model.M += lumped;
  add_points(model);
  for (const std::string& name : source.root) {
    const auto node = names.find(name);
    if (node == names.end()) refuse(at, "matrices.root", Code::fe_model, "names of nodes in " + source.nodes, in_quotes(name));
    model.root_nodes.push_back(node->second);
  }
  if (model.root_nodes.empty()) {
    const int node = model.find_node(Vector3d::Zero());
    if (node < 0)
      refuse(at, "matrices.root", Code::missing_key, "the nodes that the body frame holds", "none, and no node at the origin",
             "root: [name, ...]");
    model.root_nodes = {node};
  }
  if (model.nodes.size() <= kMostDrawnNodes) {
    std::map<std::pair<int, int>, bool> coupled;
    for (int j = 0; j < model.K.outerSize(); ++j)
      for (SparseMatrix::InnerIterator it(model.K, j); it; ++it)
        if (it.row() / 6 > j / 6 && it.value() != 0.0) coupled[{j / 6, static_cast<int>(it.row()) / 6}] = true;
    for (const auto& [pair, yes] : coupled) model.lines.push_back({pair.first, pair.second});
  }
  model.description = fmt::format("matrices {} and {}, {} nodes", std::filesystem::path(source.mass).filename().string(),
                                  std::filesystem::path(source.stiffness).filename().string(), model.nodes.size());
  return model;
}

}  // namespace cardan
