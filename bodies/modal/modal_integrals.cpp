#include "bodies/modal/modal_integrals.hpp"

#include <cmath>
#include <limits>

#include "core/linalg/dense.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

/// Sums over the points with J0: I4, I6, I7 and the first-order terms of mathematics/modes.md, section 3.
void add_rotary(const MassField& f, ModalIntegrals& out) {
  const Eigen::Index n = f.mass.size(), m = f.Phi[0].cols();
  const auto count = static_cast<std::size_t>(m);
  MatrixXd share = MatrixXd::Zero(m, m);  // sum |J0| psi* psi
  double inertia = 0.0;
  for (Eigen::Index j = 0; j < n; ++j) {
    const Matrix3d& J = f.inertia[static_cast<std::size_t>(j)];
    if (J.isZero(0.0)) continue;
    MatrixXd psi(3, m);
    for (int a = 0; a < 3; ++a) psi.row(a) = f.Psi[a].row(j);
    const MatrixXd J_psi = J * psi;
    const double size = J.norm();
    inertia += size;
    share.noalias() += size * psi.transpose() * psi;
    out.I4 += J_psi;
    out.I6.noalias() += psi.transpose() * J_psi;
    out.I7 += J;
    if (psi.isZero(0.0)) continue;
    if (out.rotary_ww.empty()) {
      out.rotary_ww.assign(count, Matrix3d::Zero());
      out.rotary_we.assign(count, MatrixXd::Zero(3, m));
      out.rotary_ee.assign(count, MatrixXd::Zero(m, m));
      out.rotary_turn.setZero(m);
    }
    out.rotary_turn = out.rotary_turn.cwiseMax(psi.colwise().norm().transpose());
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
  if (out.rotary_ww.empty()) return;
  const Vector3d c = out.I2 / out.I1;
  const Matrix3d about_centre = out.I7 - out.I1 * (c.squaredNorm() * Matrix3d::Identity() - c * c.transpose());
  const std::optional<Eigen::VectorXd> of_modes = generalised_eigenvalues(share, out.I6);
  const double least = symmetric_eigenvalues(about_centre)[0], most = of_modes ? (*of_modes)[m - 1] : HUGE_VAL;
  out.rotary_share = least > 0.0 && std::isfinite(most) ? std::max(inertia / least, most) : std::numeric_limits<double>::max();
}

}  // namespace

ModalIntegrals modal_integrals(const MassField& f) {
  const Eigen::Index m = f.Phi[0].cols();
  const auto count = static_cast<std::size_t>(m);
  // first[a](b, k) = sum m r_a phi_k,b        second[a][b](l, k) = sum m phi_l,a phi_k,b
  MatrixXd first[3], second[3][3];
  const auto weighed = [&](const MatrixXd& x) -> MatrixXd {
    if (f.between.size() > 0) return f.between * x;
    return f.mass.asDiagonal() * x;
  };
  const MatrixXd places = weighed(f.position.transpose());
  for (int a = 0; a < 3; ++a) {
    first[a].resize(3, m);
    const MatrixXd shapes = weighed(f.Phi[a]);
    for (int b = 0; b < 3; ++b) {
      first[a].row(b) = places.col(a).transpose() * f.Phi[b];
      second[a][b] = shapes.transpose() * f.Phi[b];
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
  const Matrix3d moments = f.position * places;
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

void forget_changes(ModalIntegrals& out) {
  for (MatrixXd& x : out.I5) x.setZero();
  for (Matrix3d& x : out.I8) x.setZero();
  out.I9.clear(), out.rotary_ww.clear(), out.rotary_we.clear(), out.rotary_ee.clear();
  out.rotary_turn.resize(0), out.rotary_share = 0.0;
  out.of_change = false;
}

void forget_rounding(ModalIntegrals& I) {
  constexpr double kRounding = 1e-12;  // of what they could be at most: |I5_lk|, |I9_lk| <= (I6_ll I6_kk)^(1/2)
  const Eigen::Index m = I.I6.rows();
  for (Eigen::Index l = 0; l < m; ++l)
    for (Eigen::Index k = 0; k < m; ++k) {
      const auto s = static_cast<std::size_t>(l);
      const double rounding = kRounding * std::sqrt(I.I6(l, l) * I.I6(k, k));
      if (I.I5[s].col(k).norm() <= rounding) I.I5[s].col(k).setZero();
      if (I.I9.empty()) continue;  // forgotten itself
      for (double& x : I.I9[s * static_cast<std::size_t>(m) + static_cast<std::size_t>(k)].reshaped())
        if (std::abs(x) <= rounding) x = 0.0;
    }
}

}  // namespace cardan
