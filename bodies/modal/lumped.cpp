#include "bodies/modal/lumped.hpp"

#include <fmt/format.h>

#include <utility>

#include "bodies/modal/modal_check.hpp"
#include "bodies/modal/modal_integrals.hpp"
#include "bodies/modal/refuse.hpp"

namespace cardan {
namespace {

using Eigen::MatrixXd;

const Located kWhere = {"modal", {}};

/// No shape is a shape of zeros.
void fill(MatrixXd& shape, Eigen::Index m) {
  if (shape.size() == 0) shape = MatrixXd::Zero(3, m);
}

}  // namespace

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
