#include "core/reference/modal_inertia.hpp"

#include "core/reference/quad.hpp"

namespace cardan::reference {

template <class T>
ModalInertia<T>::ModalInertia(const std::vector<MassPoint<T>>& points)
    : n_modes_(static_cast<int>(points.front().point.Phi.cols())),
      mass_(MatX<T>::Zero(6 + n_modes_, 6 + n_modes_)),
      slope_(n_modes_, mass_) {
  for (const MassPoint<T>& p : points) {
    MatX<T> J(3, 6 + n_modes_), A(3, 6 + n_modes_), dJ = MatX<T>::Zero(3, 6 + n_modes_), dA = dJ;
    J << -tilde(p.point.position), Mat3<T>::Identity(), p.point.Phi;
    A << Mat3<T>::Identity(), Mat3<T>::Zero(), p.point.Psi;
    mass_ += p.mass * J.transpose() * J + A.transpose() * p.inertia * A;
    for (int k = 0; k < n_modes_; ++k) {
      const Mat3<T> turn = tilde(Vec3<T>(p.point.Psi.col(k)));
      dJ.leftCols(3) = -tilde(Vec3<T>(p.point.Phi.col(k)));
      dA.rightCols(n_modes_) = turn * p.point.Psi / 2;  // Jl = 1 + theta~ / 2 + ...
      const MatX<T> half = p.mass * dJ.transpose() * J + dA.transpose() * p.inertia * A;
      slope_[k] += half + half.transpose() + A.transpose() * (turn * p.inertia - p.inertia * turn) * A;
    }
  }
}

template <class T>
ModalInertia<T>::ModalInertia(const ModalIntegrals& I)
    : n_modes_(static_cast<int>(I.I3.cols())), mass_(MatX<T>::Zero(6 + n_modes_, 6 + n_modes_)), slope_(n_modes_, mass_) {
  const int m = n_modes_;
  const auto fill = [&](MatX<T>& M, const Mat3<T>& ww, const Vec3<T>& first_moment, const MatX<T>& we, const MatX<T>& ee) {
    M.topLeftCorner(3, 3) = ww;
    M.block(0, 3, 3, 3) = tilde(first_moment);
    M.block(0, 6, 3, m) = we;
    M.bottomRightCorner(m, m) = ee;
  };
  fill(mass_, I.I7.cast<T>(), I.I2.cast<T>(), I.I4.cast<T>(), I.I6.cast<T>());
  mass_.block(3, 3, 3, 3).diagonal().setConstant(T(I.I1));
  mass_.block(3, 6, 3, m) = I.I3.cast<T>();
  for (int k = 0; k < m; ++k) {
    MatX<T> we = I.I5[k].template cast<T>(), ee = MatX<T>::Zero(m, m);
    Mat3<T> ww = (I.I8[k] + I.I8[k].transpose()).template cast<T>();
    if (!I.rotary_ww.empty()) ww += I.rotary_ww[k].template cast<T>();
    if (!I.rotary_we.empty()) we += I.rotary_we[k].template cast<T>();
    if (!I.rotary_ee.empty()) ee += I.rotary_ee[k].template cast<T>();
    fill(slope_[k], ww, I.I3.col(k).template cast<T>(), we, ee);
  }
  for (const Eigen::Matrix3d& s : I.I9) square_.push_back(s.cast<T>());
  const auto mirror = [](MatX<T>& M) { M.template triangularView<Eigen::StrictlyLower>() = M.transpose(); };
  mirror(mass_);
  for (MatX<T>& M : slope_) mirror(M);
}

template <class T>
std::vector<MatX<T>> ModalInertia<T>::mass_derivatives(const VecX<T>& eta, int level) const {
  std::vector<MatX<T>> out = slope_;
  for (int k = 0; k < n_modes_; ++k) {
    if (level == 0) {
      out[k].setZero();
      out[k].block(0, 3, 3, 3) = slope_[k].block(0, 3, 3, 3);
      out[k].block(3, 0, 3, 3) = slope_[k].block(3, 0, 3, 3);
    }
    if (level == 2)
      for (int l = 0; l < n_modes_; ++l) out[k].topLeftCorner(3, 3) += eta[l] * (square_[l * n_modes_ + k] + square_[k * n_modes_ + l]);
  }
  return out;
}

template <class T>
MatX<T> ModalInertia<T>::mass(const VecX<T>& eta, int level) const {
  MatX<T> out = mass_;
  const auto add = [&](const std::vector<MatX<T>>& slope) {
    for (int k = 0; k < n_modes_; ++k) out += eta[k] * slope[k];
  };
  if (level == 1)
    add(slope_);
  else
    add(mass_derivatives(eta / 2, level));  // exact for a polynomial of degree 2
  return out;
}

template <class T>
VecX<T> ModalInertia<T>::bias(const MatX<T>& mass, const std::vector<MatX<T>>& derivatives, const VecX<T>& etadot, const VecX<T>& V) const {
  VecX<T> Vfl(6 + n_modes_);
  Vfl << V, etadot;
  const VecX<T> p = mass * Vfl;
  const Vec3<T> w = V.head(3), v = V.tail(3), pw = p.head(3), pv = p.segment(3, 3);
  VecX<T> b = VecX<T>::Zero(6 + n_modes_);
  b.head(3) = w.cross(pw) + v.cross(pv);
  b.segment(3, 3) = w.cross(pv);
  for (int k = 0; k < n_modes_; ++k) {
    const VecX<T> dp = derivatives[k] * Vfl;
    b += etadot[k] * dp;
    b[6 + k] -= Vfl.dot(dp) / 2;
  }
  return b;
}

template class ModalInertia<double>;
template class ModalInertia<Quad>;

}  // namespace cardan::reference
