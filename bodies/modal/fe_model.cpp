#include "bodies/modal/fe_model.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <map>
#include <utility>

#include "core/linalg/dense.hpp"

namespace cardan {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

namespace {

constexpr double kOneLine = 1e-9;  // of second moments, relative: nodes on one line

Matrix3d skew(const Vector3d& a) {
  Matrix3d A;
  A << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return A;
}

}  // namespace

Vector3d first_moment(const Eigen::Matrix<double, 6, 6>& rigid) {
  const Matrix3d S = rigid.topRightCorner<3, 3>();  // S(a, b) = e_b . (e_a x I2)
  return 0.5 * Vector3d(S(2, 1) - S(1, 2), S(0, 2) - S(2, 0), S(1, 0) - S(0, 1));
}

int FeModel::find_node(const Vector3d& position) const {
  int nearest = -1;
  double distance = element_size;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const double d = (nodes[i] - position).norm();
    if (d < distance || (nearest < 0 && d <= distance)) {
      nearest = static_cast<int>(i);
      distance = d;
    }
  }
  return nearest;
}

RigidShapes FeModel::rigid_shapes() const {
  RigidShapes R = RigidShapes::Zero(n_dofs(), 6);
  for (std::size_t i = 0; i < nodes.size(); ++i)
    for (int a = 0; a < 3; ++a) {
      const Vector3d axis = Vector3d::Unit(a);
      const auto row = per_node * static_cast<Eigen::Index>(i);
      R.block<3, 1>(row, a) = axis.cross(nodes[i]);
      if (per_node == 6) R.block<3, 1>(row + 3, a) = axis;
      R.block<3, 1>(row, 3 + a) = axis;
    }
  return R;
}

MatrixXd FeModel::Grip::of(const MatrixXd& shapes, int dofs) const {
  MatrixXd rows(B.cols(), shapes.cols());
  for (std::size_t i = 0; i < nodes.size(); ++i)
    rows.middleRows(dofs * static_cast<Eigen::Index>(i), dofs) = shapes.middleRows(dofs * nodes[i], dofs);
  return B * rows;
}

std::optional<FeModel::Grip> FeModel::grip(const Vector3d& position, const std::vector<int>& of) const {
  Grip out{position, of, MatrixXd::Identity(6, 6)};
  if (per_node == 6) {
    out.B.topRightCorner<3, 3>() = skew(nodes[static_cast<std::size_t>(of.front())] - position);
    return out;
  }
  const auto k = static_cast<Eigen::Index>(of.size());
  Vector3d centre = Vector3d::Zero();
  for (const int i : of) centre += nodes[static_cast<std::size_t>(i)] / static_cast<double>(k);
  // x_i = u + theta x (r_i - p): sum d_i x x_i = S theta with d_i = r_i - centre, and the mean of x_i gives u.
  Matrix3d S = Matrix3d::Zero();
  for (const int i : of) {
    const Vector3d d = nodes[static_cast<std::size_t>(i)] - centre;
    S += d.squaredNorm() * Matrix3d::Identity() - d * d.transpose();
  }
  const Eigen::VectorXd moments = symmetric_eigenvalues(S);
  if (!(moments[0] > kOneLine * moments[2])) return std::nullopt;
  const Matrix3d S_inverse = inverse(S);
  out.B.resize(6, 3 * k);
  for (Eigen::Index i = 0; i < k; ++i)
    out.B.block<3, 3>(3, 3 * i) = S_inverse * skew(nodes[static_cast<std::size_t>(of[static_cast<std::size_t>(i)])] - centre);
  out.B.topRows(3) = skew(centre - position) * out.B.bottomRows(3);
  for (Eigen::Index i = 0; i < k; ++i) out.B.block<3, 3>(0, 3 * i).diagonal().array() += 1.0 / static_cast<double>(k);
  return out;
}

std::vector<int> FeModel::around(int node) const {
  std::vector<int> out;
  for (SparseMatrix::InnerIterator it(K, per_node * node); it; ++it)
    if (it.row() < n_dofs() - component_modes && (out.empty() || out.back() != it.row() / per_node))
      out.push_back(static_cast<int>(it.row()) / per_node);
  return out;
}

MatrixXd FeModel::rigid_motion(const Grip& grip) const {
  MatrixXd out = MatrixXd::Zero(n_dofs(), 6);
  for (const int i : grip.nodes) {
    out.block<3, 3>(per_node * i, 0).setIdentity();
    out.block<3, 3>(per_node * i, 3) = -skew(nodes[static_cast<std::size_t>(i)] - grip.position);
    if (per_node == 6) out.block<3, 3>(per_node * i + 3, 3).setIdentity();
  }
  return out;
}

MassField FeModel::mass_field(const MatrixXd& shapes) const {
  MassField field{point_mass, point_position, point_inertia, {}, {}, between};
  for (int a = 0; a < 3; ++a) {
    field.Phi[a] = N[a] * shapes;
    field.Psi[a] = Q[a] * shapes;
  }
  return field;
}

ModalDrawing FeModel::drawing(const MatrixXd& shapes) const {
  std::map<int, int> points;  // node -> point
  std::vector<std::pair<int, int>> pieces;
  for (const std::vector<int>& line : lines)
    for (std::size_t i = 0; i < line.size(); ++i) {
      points.emplace(line[i], 0);
      if (i > 0) pieces.emplace_back(line[i - 1], line[i]);
    }
  ModalDrawing out;
  out.points.resize(static_cast<Eigen::Index>(points.size()), 3);
  out.lines.resize(static_cast<Eigen::Index>(pieces.size()), 2);
  out.shapes.assign(static_cast<std::size_t>(std::min(shapes.cols(), kMostPictured)), out.points);
  int row = 0;
  for (auto& [node, point] : points) {
    point = row++;
    out.points.row(point) = nodes[static_cast<std::size_t>(node)].transpose();
    for (std::size_t j = 0; j < out.shapes.size(); ++j)
      out.shapes[j].row(point) = shapes.block<3, 1>(per_node * node, static_cast<Eigen::Index>(j)).transpose();
  }
  for (std::size_t i = 0; i < pieces.size(); ++i)
    out.lines.row(static_cast<Eigen::Index>(i)) << points[pieces[i].first], points[pieces[i].second];
  return out;
}

int FeBuilder::add_node(const Vector3d& position) {
  model_.nodes.push_back(position);
  return static_cast<int>(model_.nodes.size()) - 1;
}

void FeBuilder::add_element(const std::vector<int>& nodes, const MatrixXd& K, const std::vector<Point>& points) {
  const int n = 6 * static_cast<int>(nodes.size());
  const auto dof = [&](int i) { return 6 * nodes[i / 6] + i % 6; };
  MatrixXd M = MatrixXd::Zero(n, n);
  for (const Point& p : points) {
    M.noalias() += p.mass * p.N.transpose() * p.N + p.Q.transpose() * p.inertia * p.Q;
    const int row = static_cast<int>(masses_.size());
    masses_.push_back(p.mass);
    positions_.push_back(p.position);
    model_.point_inertia.push_back(p.inertia);
    for (int a = 0; a < 3; ++a)
      for (int i = 0; i < n; ++i) {
        if (p.N(a, i) != 0.0) N_[a].emplace_back(row, dof(i), p.N(a, i));
        if (p.Q(a, i) != 0.0) Q_[a].emplace_back(row, dof(i), p.Q(a, i));
      }
  }
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      // Symmetric to the last bit, and one pattern for both matrices.
      K_.emplace_back(dof(i), dof(j), 0.5 * (K(i, j) + K(j, i)));
      M_.emplace_back(dof(i), dof(j), 0.5 * (M(i, j) + M(j, i)));
    }
  for (int a : nodes)
    for (int b : nodes) model_.element_size = std::max(model_.element_size, (node(a) - node(b)).norm());
}

void FeBuilder::add_mass(int node_index, double mass, const Matrix3d& inertia) {
  Point p{mass, node(node_index), inertia, MatrixXd::Zero(3, 6), MatrixXd::Zero(3, 6)};
  p.N.leftCols(3).setIdentity();
  p.Q.rightCols(3).setIdentity();
  add_element({node_index}, MatrixXd::Zero(6, 6), {p});
}

FeModel FeBuilder::finish(std::vector<int> root_nodes, std::string description) {
  const int n = model_.n_dofs(), n_points = static_cast<int>(masses_.size());
  const auto assemble = [](SparseMatrix& A, int rows, int cols, const Triplets& entries) {
    A.resize(rows, cols);
    A.setFromTriplets(entries.begin(), entries.end());
  };
  assemble(model_.K, n, n, K_);
  assemble(model_.M, n, n, M_);
  model_.point_mass = Eigen::Map<const Eigen::VectorXd>(masses_.data(), n_points);
  model_.point_position.resize(3, n_points);
  for (int p = 0; p < n_points; ++p) model_.point_position.col(p) = positions_[p];
  for (int a = 0; a < 3; ++a) {
    assemble(model_.N[a], n_points, n, N_[a]);
    assemble(model_.Q[a], n_points, n, Q_[a]);
  }
  model_.root_nodes = std::move(root_nodes);
  model_.description = std::move(description);
  return std::move(model_);
}

}  // namespace cardan
