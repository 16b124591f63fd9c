#include "core/abi/modal_view.hpp"

namespace cardan {
namespace {

std::vector<double> flat(const auto& list) {
  std::vector<double> out;
  for (const auto& a : list) out.insert(out.end(), a.data(), a.data() + a.size());
  return out;
}

void append(std::vector<double>& to, const Eigen::MatrixXd& a, Eigen::Index rows, Eigen::Index cols) {
  const Eigen::MatrixXd full = a.size() > 0 ? a : Eigen::MatrixXd::Zero(rows, cols);
  to.insert(to.end(), full.data(), full.data() + full.size());
}

const double* or_null(const std::vector<double>& a) { return a.empty() ? nullptr : a.data(); }

}  // namespace

ModalView::ModalView(const ModalData& data, int level)
    : I5_(flat(data.integrals.I5)),
      I8_(flat(data.integrals.I8)),
      I9_(flat(data.integrals.I9)),
      ww_(flat(data.integrals.rotary_ww)),
      we_(flat(data.integrals.rotary_we)),
      ee_(flat(data.integrals.rotary_ee)) {
  const ModalIntegrals& I = data.integrals;
  const Eigen::Index m = data.n_modes;
  bool any_inertia = false, any_Psi = false, any_Q = false;
  const std::vector<MassNode> none;
  const std::vector<MassNode>& mass_nodes = data.whole ? none : data.mass_nodes;
  for (const MassNode& n : mass_nodes) {
    any_inertia = any_inertia || !n.inertia.isZero(0.0);
    any_Psi = any_Psi || (n.Psi.size() > 0 && !n.inertia.isZero(0.0));
    any_Q = any_Q || !n.Q.empty();
  }
  for (const MassNode& n : mass_nodes) {
    mass_.push_back(n.mass);
    append(position_, n.position, 3, 1);
    append(inertia_, n.inertia, 3, 3);
    append(Phi_, n.Phi, 3, m);
    append(Psi_, n.Psi, 3, m);
    for (std::size_t i = 0; i < 3 && any_Q; ++i) append(Q_, n.Q.empty() ? Eigen::MatrixXd() : n.Q[i], m, m);
  }
  const auto columns = static_cast<std::size_t>(6 * m);
  shapes_.resize(columns * data.nodes.size());
  for (std::size_t i = 0; i < data.nodes.size(); ++i) {
    const ModalNode& n = data.nodes[i];
    Eigen::Map<Eigen::MatrixXd> S(shapes_.data() + columns * i, 6, m);
    if (n.Psi.size() > 0) S.topRows<3>() = n.Psi;
    if (n.Phi.size() > 0) S.bottomRows<3>() = n.Phi;
    cardan_modal_node& out = nodes_.emplace_back(cardan_modal_node{n.name.c_str(), {}, {}, S.data()});
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out.R_BN) = n.R_BN;
    Eigen::Map<Eigen::Vector3d>(out.position) = n.position;
  }
  view_.struct_size = sizeof view_;
  view_.n_modes = static_cast<std::uint32_t>(m);
  view_.level = static_cast<std::uint32_t>(level);
  view_.I1 = I.I1;
  view_.I2 = I.I2.data();
  view_.I3 = I.I3.data();
  view_.I4 = I.I4.data();
  view_.I5 = I5_.data();
  view_.I6 = I.I6.data();
  view_.I7 = I.I7.data();
  view_.I8 = I8_.data();
  view_.I9 = or_null(I9_);
  view_.rotary_ww = or_null(ww_);
  view_.rotary_we = or_null(we_);
  view_.rotary_ee = or_null(ee_);
  view_.n_mass_nodes = static_cast<std::uint32_t>(mass_nodes.size());
  view_.node_mass = mass_.data();
  view_.node_position = position_.data();
  view_.node_inertia = any_inertia ? inertia_.data() : nullptr;
  view_.node_Phi = Phi_.data();
  view_.node_Psi = any_Psi ? Psi_.data() : nullptr;
  view_.node_Q = any_Q ? Q_.data() : nullptr;
  view_.n_nodes = static_cast<std::uint32_t>(nodes_.size());
  view_.node_size = sizeof nodes_[0];
  view_.nodes = nodes_.data();
}

}  // namespace cardan
