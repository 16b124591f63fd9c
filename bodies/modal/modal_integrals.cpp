#include "bodies/modal/modal_integrals.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <utility>

#include "bodies/modal/modal_check.hpp"
#include "bodies/modal/refuse.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

/// Sums over the points with J0: I4, I6, I7 and the first-order terms of mathematics/modes.md, section 3.
void add_rotary(const MassField& f, ModalIntegrals& out) {
  const Eigen::Index n = f.mass.size(), m = f.Phi[0].cols();
  const auto count = static_cast<std::size_t>(m);
  for (Eigen::Index j = 0; j < n; ++j) {
    const Matrix3d& J = f.inertia[static_cast<std::size_t>(j)];
    if (J.isZero(0.0)) continue;
    MatrixXd psi(3, m);
    for (int a = 0; a < 3; ++a) psi.row(a) = f.Psi[a].row(j);
    const MatrixXd J_psi = J * psi;
    out.I4 += J_psi;
    out.I6.noalias() += psi.transpose() * J_psi;
    out.I7 += J;
    if (psi.isZero(0.0)) continue;
    if (out.rotary_ww.empty()) {
      out.rotary_ww.assign(count, Matrix3d::Zero());
      out.rotary_we.assign(count, MatrixXd::Zero(3, m));
      out.rotary_ee.assign(count, MatrixXd::Zero(m, m));
    }
    for (Eigen::Index i = 0; i < m; ++i) {
      const Vector3d p = psi.col(i);
      Matrix3d tilde;
      tilde << 0, -p.z(), p.y(), p.z(), 0, -p.x(), -p.y(), p.x(), 0;
      const Matrix3d commutator = tilde * J - J * tilde;
      const auto s = static_cast<std::size_t>(i);
      out.rotary_ww[s] += commutator;
      out.rotary_we[s].noalias() += tilde * J_psi - 0.5 * J * (tilde * psi);
      out.rotary_ee[s].noalias() += 0.5 * psi.transpose() * (commutator * psi);
    }
  }
}

const Located kWhere = {"modal", {}};

/// No shape is a shape of zeros.
void fill(MatrixXd& shape, Eigen::Index m) {
  if (shape.size() == 0) shape = MatrixXd::Zero(3, m);
}

}  // namespace

ModalIntegrals modal_integrals(const MassField& f) {
  const Eigen::Index m = f.Phi[0].cols();
  const auto count = static_cast<std::size_t>(m);
  // first[a](b, k) = sum m r_a phi_k,b        second[a][b](l, k) = sum m phi_l,a phi_k,b
  MatrixXd first[3], second[3][3];
  for (int a = 0; a < 3; ++a) {
    first[a].resize(3, m);
    for (int b = 0; b < 3; ++b) {
      first[a].row(b) = (f.mass.array() * f.position.row(a).transpose().array()).matrix().transpose() * f.Phi[b];
      second[a][b] = f.Phi[a].transpose() * f.mass.asDiagonal() * f.Phi[b];
    }
  }
  const auto next = [](int a) { return (a + 1) % 3; };

  ModalIntegrals out;
  out.I1 = f.mass.sum();
  out.I2 = f.position * f.mass;
  out.I3.resize(3, m);
  out.I4.resize(3, m);
  for (int a = 0; a < 3; ++a) {
    const int b = next(a), c = next(b);
    out.I3.row(a) = f.mass.transpose() * f.Phi[a];
    out.I4.row(a) = first[b].row(c) - first[c].row(b);
  }
  out.I6 = second[0][0] + second[1][1] + second[2][2];
  const Matrix3d moments = f.position * f.mass.asDiagonal() * f.position.transpose();
  out.I7 = moments.trace() * Matrix3d::Identity() - moments;
  out.I5.assign(count, MatrixXd(3, m));
  out.I8.resize(count);
  out.I9.resize(count * count);
  for (Eigen::Index l = 0; l < m; ++l) {
    const auto s = static_cast<std::size_t>(l);
    for (int a = 0; a < 3; ++a) {
      const int b = next(a), c = next(b);
      out.I5[s].row(a) = second[b][c].row(l) - second[c][b].row(l);
    }
    Matrix3d H;  // a~* b~ = (a.b) 1 - b a*
    for (int a = 0; a < 3; ++a) H.row(a) = first[a].col(l).transpose();
    out.I8[s] = H.trace() * Matrix3d::Identity() - H.transpose();
    for (Eigen::Index k = 0; k < m; ++k) {
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) H(a, b) = second[a][b](l, k);
      out.I9[s * count + static_cast<std::size_t>(k)] = H.trace() * Matrix3d::Identity() - H.transpose();
    }
  }
  if (!f.inertia.empty()) add_rotary(f, out);
  return out;
}

ModalData lumped_modal_data(std::vector<MassNode> mass_nodes, MatrixXd K, MatrixXd C, std::vector<ModalNode> nodes) {
  const Eigen::Index m = K.rows();
  if (C.size() == 0) C = MatrixXd::Zero(m, m);
  check_stiffness(K, C, kWhere);
  if (mass_nodes.empty()) refuse(kWhere, {}, Code::bad_modal_data, "at least one mass node", "none");
  const auto n = static_cast<Eigen::Index>(mass_nodes.size());
  MassField field;
  field.mass.resize(n);
  field.position.resize(3, n);
  for (int a = 0; a < 3; ++a) field.Phi[a] = field.Psi[a] = MatrixXd::Zero(n, m);
  bool rotary = false;
  for (Eigen::Index j = 0; j < n; ++j) {
    MassNode& node = mass_nodes[static_cast<std::size_t>(j)];
    check_mass_node(node, m, static_cast<std::size_t>(j), kWhere);
    fill(node.Phi, m);
    fill(node.Psi, m);
    field.mass(j) = node.mass;
    field.position.col(j) = node.position;
    field.inertia.push_back(node.inertia);
    rotary = rotary || !node.inertia.isZero(0.0);
    for (int a = 0; a < 3; ++a) {
      field.Phi[a].row(j) = node.Phi.row(a);
      field.Psi[a].row(j) = node.Psi.row(a);
    }
  }
  if (!rotary) field.inertia.clear();
  check_nodes(nodes, m, kWhere);
  for (ModalNode& node : nodes) {
    fill(node.Phi, m);
    fill(node.Psi, m);
  }

  ModalData data;
  data.n_modes = static_cast<int>(m);
  data.integrals = modal_integrals(field);
  data.K = std::move(K);
  data.C = std::move(C);
  data.nodes = std::move(nodes);
  data.mass_nodes = std::move(mass_nodes);
  data.source = fmt::format("lumped: {} mass nodes, {} modes", n, m);
  return data;
}

}  // namespace cardan
