#include "core/model/flexible_constants.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/abi/modal_view.hpp"
#include "core/linalg/dense.hpp"
#include "core/model/rotary_terms.hpp"
#include "core/model/validate.hpp"

namespace cardan {
namespace {

std::vector<double> columns_of(const Eigen::MatrixXd& Phi, const Eigen::MatrixXd& Psi, int m) {
  const auto zero = [](const Eigen::MatrixXd& a) { return a.size() == 0 || a.isZero(0.0); };
  if (m == 0 || (zero(Phi) && zero(Psi))) return {};
  std::vector<double> c(static_cast<std::size_t>(6 * m), 0.0);
  Eigen::Map<Eigen::MatrixXd> out(c.data(), 6, m);
  if (Psi.size() > 0) out.topRows<3>() = Psi;
  if (Phi.size() > 0) out.bottomRows<3>() = Phi;
  return c;
}

}  // namespace

NodeShapes shapes_of(const ModalData& modal, std::size_t i, const cardan_body_family& family) {
  const ModalNode& n = modal.nodes[i];
  NodeShapes s{{from_eigen(n.R_BN), from_eigen(n.position)}, 0, {}};
  if (family.node)
    s.curved = static_cast<int>(i);
  else
    s.columns = columns_of(n.Phi, n.Psi, modal.n_modes);
  if (s.is_curved() || !s.columns.empty()) s.n_modes = modal.n_modes;
  return s;
}

NodeShapes node_of(const BodySpec& body, const std::string& node, const cardan_body_family* family) {
  if (node.empty()) return {};
  if (body.modal)
    for (std::size_t i = 0; i < body.modal->nodes.size(); ++i)
      if (body.modal->nodes[i].name == node) return shapes_of(*body.modal, i, *family);
  for (const auto& n : body.nodes)
    if (n.name == node) return {{from_eigen(n.R_BN), from_eigen(n.position)}, 0, {}};
  return {};
}

FlexibleBody flexible_of(const SystemSpec& spec, const BodySpec& body, const cardan_body_family& family, DiagnosticSink& sink) {
  const ModalData& d = *body.modal;
  const auto m = static_cast<std::uint32_t>(d.n_modes);
  const ModalView view(d, body.level);
  FlexibleBody f;
  f.family = &family;
  f.level = body.level;
  f.curved = family.node;
  f.data = body.modal;
  std::optional<ParamTable> values = body_params(spec, body, family, sink);
  if (!values) return f;
  const cardan_param_values given = values->view();
  f.packed.resize((family.packed_size(&given, view.get()) + 7) / 8);
  if (family.pack(&given, view.get(), f.packed.data()) != 0) {
    report_refused(spec, body, family, *values, Code::bad_modal_data, sink);
    return f;
  }
  expect_rotary_terms(body, sink);
  cardan_body_facts facts{};
  facts.struct_size = sizeof facts;
  if (family.facts) family.facts(f.packed.data(), &facts);
  f.M_ee_constant = facts.m_ee_constant;
  f.M_re_constant = facts.m_re_constant;
  f.states = facts.states && family.states;
  f.constant = facts.m_ee_constant && facts.m_re_constant && facts.j_constant;
  f.M_re.resize(6 * m);
  f.M_ee.resize(m * m);
  double M_rr[10];
  const std::vector<double> eta(m, 0.0);
  family.mass(f.packed.data(), eta.data(), M_rr, f.M_re.data(), f.M_ee.data());
  f.M_rr = {M_rr[0], {M_rr[1], M_rr[2], M_rr[3]}, {M_rr[4], M_rr[5], M_rr[6], M_rr[7], M_rr[8], M_rr[9]}};
  const Eigen::Map<const Eigen::MatrixXd> M_ee(f.M_ee.data(), m, m), M_re(f.M_re.data(), 6, m);
  f.M_ee_identity = (M_ee - Eigen::MatrixXd::Identity(m, m)).cwiseAbs().maxCoeff() == 0.0;
  const std::optional<Eigen::MatrixXd> factor = cholesky(M_ee);
  if (!factor) {
    sink.report({Code::bad_modal_data, body.at, "a positive definite modal mass matrix", "one that is not",
                 "does one mode move no mass, or are two equal?", "", "", 0});
    return f;
  }
  const Eigen::MatrixXd &L = *factor, U = cholesky_solve(L, M_re.transpose());
  f.L_ee.assign(L.data(), L.data() + L.size());
  const Eigen::MatrixXd M_re_rows = M_re.transpose();
  f.M_re_rows.assign(M_re_rows.data(), M_re_rows.data() + M_re_rows.size());
  f.U.assign(U.data(), U.data() + U.size());
  const Eigen::Matrix<double, 6, 6> gram = M_re * U;
  f.gramian = {symmetric(gram.topLeftCorner<3, 3>()), from_eigen(Eigen::Matrix3d(gram.topRightCorner<3, 3>())),
               symmetric(gram.bottomRightCorner<3, 3>())};
  const auto diagonal = [](const Eigen::MatrixXd& a) {
    return a.size() == 0 || Eigen::MatrixXd(a - Eigen::MatrixXd(a.diagonal().asDiagonal())).isZero(0.0);
  };
  f.K_diagonal = diagonal(d.K) && diagonal(d.C);
  const auto store = [&](Stream& to, const Eigen::MatrixXd& a) {
    const Eigen::MatrixXd full = a.size() > 0 ? a : Eigen::MatrixXd::Zero(m, m);
    for (std::uint32_t j = 0; j < m; ++j)
      for (std::uint32_t i = 0; i < m; ++i)
        if (!f.K_diagonal || i == j) to.push_back(full(i, j));
  };
  store(f.K, d.K);
  store(f.C, d.C);
  return f;
}

namespace {

/// Whether dJ and d2J are those of the kinetic energy that the velocity terms of the family come from, bent by a tenth of the body's size.
bool J_is_polynomial(const FlexibleBody& f) {
  const auto m = static_cast<int>(f.dJ.size() / 6);
  const Eigen::Map<const Eigen::Matrix<double, 6, Eigen::Dynamic>> dJ(f.dJ.data(), 6, m);
  const double size = std::sqrt(0.5 * (f.M_rr.J.xx + f.M_rr.J.yy + f.M_rr.J.zz));  // [sqrt(kg) m], as a deflection by the modal mass
  Eigen::VectorXd eta(m), b(6 + m);
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(m);
  for (int k = 0; k < m; ++k) eta[k] = (k % 2 == 0 ? 0.1 : -0.07) * size / std::sqrt(m * f.M_ee[static_cast<std::size_t>(m * k + k)]);
  const double omega[3] = {0.8, -0.6, 1.1};
  const double xx = omega[0] * omega[0], yy = omega[1] * omega[1], zz = omega[2] * omega[2];
  const Eigen::Vector<double, 6> of{xx, yy, zz, 2 * omega[0] * omega[1], 2 * omega[0] * omega[2], 2 * omega[1] * omega[2]};
  f.family->bias(f.packed.data(), eta.data(), rest.data(), omega, b.data());
  double off = 0.0, all = 0.0;
  for (int k = 0; k < m; ++k) {
    Eigen::Vector<double, 6> slope = dJ.col(k);
    for (int l = 0; l < m && !f.d2J.empty(); ++l)
      slope += eta[l] * Eigen::Map<const Eigen::Vector<double, 6>>(f.d2J.data() + 6 * (k * m + l));
    const double unit = std::sqrt(f.M_ee[static_cast<std::size_t>(m * k + k)]);
    off = std::max(off, std::abs(of.dot(slope) + 2.0 * b[6 + k]) / unit);
    all = std::max(all, slope.norm() / unit);
  }
  return off <= 1e-12 * (all + size);
}

}  // namespace

void add_inertia_derivatives(FlexibleBody& f) {
  const ModalIntegrals& I = f.data->integrals;
  const auto append = [](std::vector<double>& to, const Eigen::Matrix3d& d) {
    for (const double x : {d(0, 0), d(1, 1), d(2, 2), d(0, 1), d(0, 2), d(1, 2)}) to.push_back(x);
  };
  for (std::size_t k = 0; k < I.I8.size(); ++k) {
    Eigen::Matrix3d d = I.I8[k] + I.I8[k].transpose();
    if (!I.rotary_ww.empty()) d += I.rotary_ww[k];
    append(f.dJ, d);
  }
  if (f.level == 2)
    for (const Eigen::Matrix3d& a : I.I9) append(f.d2J, a + a.transpose());
  f.J_by_family = f.level > 0 && !J_is_polynomial(f);
  if (f.J_by_family) f.dJ.clear(), f.d2J.clear();
}

void prepare_nodes(Model& m) {
  for (std::size_t k = 1; k < m.bodies.size(); ++k)
    if (m.bodies[k].onode >= 0) m.flexible[m.bodies[m.bodies[k].parent].flexible].attached.push_back(static_cast<int>(k));
  for (const SweepBody& b : m.bodies) {
    if (b.n_modes == 0) continue;
    FlexibleBody& f = m.flexible[b.flexible];
    if (f.U.empty()) continue;  // refused
    bool masked = false;
    for (int j = b.etadot; m.has_prescribed() && j < b.etadot + b.n_modes; ++j) masked = masked || m.prescribed[j];
    const bool moves_at_P = b.pnode >= 0 && m.shapes[b.pnode].deforms();
    // With more than six modes per node the factor of P_ee takes more operations (and more time from six on); 6 n <= m must hold.
    const std::size_t nodes = f.curved ? 0 : f.attached.size();  // whose shapes are constant
    f.by_nodes = f.M_ee_constant && !moves_at_P && !masked && nodes > 0 && b.n_modes > 6 * static_cast<int>(nodes);
    const Eigen::Index n = static_cast<Eigen::Index>(6 * nodes), modes = b.n_modes;
    const Eigen::Map<const Eigen::MatrixXd> M_re(f.M_re.data(), 6, modes), U(f.U.data(), modes, 6);
    Eigen::MatrixXd S(n, modes);
    for (std::size_t c = 0; c < nodes; ++c) {
      const SweepBody& child = m.bodies[f.attached[c]];
      S.middleRows<6>(static_cast<Eigen::Index>(6 * c)) =
          Eigen::Map<const Eigen::Matrix<double, 6, Eigen::Dynamic>>(m.shapes[child.onode].columns.data(), 6, modes);
    }
    const auto append = [](const Eigen::MatrixXd& a, auto& to) { to.insert(to.end(), a.data(), a.data() + a.size()); };
    const auto below = [](const Eigen::MatrixXd& top, const Eigen::MatrixXd& bottom) {
      Eigen::MatrixXd both(top.rows() + bottom.rows(), bottom.cols());
      both << top, bottom;
      return both;
    };
    append(f.constant ? below(M_re, S) : S, f.shapes);
    Eigen::MatrixXd V(modes, 0);
    if (f.by_nodes) {
      const Eigen::Map<const Eigen::MatrixXd> L(f.L_ee.data(), modes, modes);
      // L^-1 S* = Z R by reflections (nothing is squared): V = L^-* Z, Q = R*
      const auto& [Z, R] = thin_qr(L.triangularView<Eigen::Lower>().solve(S.transpose()));
      V = L.transpose().triangularView<Eigen::Upper>().solve(Z);
      append(M_re * V, f.MV);
      append(R, f.Q);
    }
    if (!f.M_re_constant && !f.by_nodes) continue;
    const Eigen::MatrixXd columns = f.M_re_constant ? below(U.transpose(), V.transpose()) : V.transpose();
    append(columns, f.UV_columns);
    append(columns.transpose(), f.UV);
  }
}

}  // namespace cardan
