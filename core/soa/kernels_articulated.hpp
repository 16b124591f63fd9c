#pragma once
// Tip to base: the articulated body inertia P (Riccati), D = H P H*, the gain G = P H* D^-1, and in the same pass the
// residual z, eps = tau - H z and nu = D^-1 eps (mathematics 4.4, 4.6). Flexible bodies in two stages, modes then hinge
// (4.10). P is symmetric by type; P+ = P - G D G* is formed from the Cholesky factor of D.
#include <cmath>

#include "core/soa/workspace.hpp"

namespace cardan::soa {

struct InwardFor {
  bool inertia = true;  // P, D, G: functions of q only
  bool bias = true;     // z, eps, nu: need P, D, G at the same q
};

/// A pivot of D below this fraction of the inertia it is made of is round-off, not inertia.
inline constexpr double kPivotLimit = 4e-16;

/// Cholesky factor of D = H P H* and the gain, for NV columns. `fixed[j]`: component j follows a prescribed motion and takes
/// no part. Returns false at a direction without inertia.
template <class T, int NV>
bool factor_hinge(const ArticulatedInertia<T>& P, Hinge<T, NV>& hinge, const std::uint8_t* fixed, Force<T>* half, Breakdown& bad) {
  using std::sqrt;
  Force<T> PH[NV];
  T D[NV * (NV + 1) / 2];
  T scale[NV];
  for (int j = 0; j < NV; ++j) {
    PH[j] = P * hinge.H[j];
    scale[j] = (P.J.xx + P.J.yy + P.J.zz) * dot(hinge.H[j].w, hinge.H[j].w) + (P.M.xx + P.M.yy + P.M.zz) * dot(hinge.H[j].v, hinge.H[j].v);
    if (fixed && fixed[j]) PH[j] = {};
    for (int i = 0; i <= j; ++i) D[j * (j + 1) / 2 + i] = fixed && fixed[i] ? T(0) : dot(hinge.H[i], PH[j]);
    if (fixed && fixed[j]) D[j * (j + 1) / 2 + j] = T(1);
  }
  // D = L L*; half = P H* L^-* (columns), so that P+ = P - half half*
  for (int j = 0; j < NV; ++j) {
    T* Lj = hinge.L + j * (j + 1) / 2;
    for (int i = 0; i < j; ++i) {
      const T* Li = hinge.L + i * (i + 1) / 2;
      T sum = D[j * (j + 1) / 2 + i];
      for (int l = 0; l < i; ++l) sum = sum - Lj[l] * Li[l];
      Lj[i] = sum / Li[i];
    }
    T pivot = D[j * (j + 1) / 2 + j];
    for (int l = 0; l < j; ++l) pivot = pivot - Lj[l] * Lj[l];
    const bool is_fixed = fixed && fixed[j];
    if (!is_fixed && !(pivot > T(kPivotLimit) * scale[j])) {
      bad.component = j;
      bad.value = static_cast<double>(pivot);
      bad.limit = kPivotLimit * static_cast<double>(scale[j]);
      return false;
    }
    Lj[j] = sqrt(pivot);
    Force<T> c = PH[j];
    for (int l = 0; l < j; ++l) c -= Lj[l] * half[l];
    half[j] = (T(1) / Lj[j]) * c;
  }
  // G = half L^-1
  for (int j = NV - 1; j >= 0; --j) {
    Force<T> g = half[j];
    for (int l = j + 1; l < NV; ++l) g -= hinge.L[l * (l + 1) / 2 + j] * hinge.G[l];
    hinge.G[j] = (T(1) / hinge.L[j * (j + 1) / 2 + j]) * g;
  }
  return true;
}

/// nu = D^-1 eps with the factor of factor_hinge.
template <class T, int NV>
void solve_hinge(const Hinge<T, NV>& hinge, T* x) {
  for (int j = 0; j < NV; ++j) {
    const T* Lj = hinge.L + j * (j + 1) / 2;
    for (int l = 0; l < j; ++l) x[j] = x[j] - Lj[l] * x[l];
    x[j] = x[j] / Lj[j];
  }
  for (int j = NV - 1; j >= 0; --j) {
    for (int l = j + 1; l < NV; ++l) x[j] = x[j] - hinge.L[l * (l + 1) / 2 + j] * x[l];
    x[j] = x[j] / hinge.L[j * (j + 1) / 2 + j];
  }
}

template <class T, int NV, InwardFor For>
void inward_rigid(const Model& model, Workspace<T>& ws, const Inputs<T>& in, int begin, int end) {
  for (int k = end - 1; k >= begin; --k) {
    const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
    Core<T>& body = ws.core(k);
    Core<T>& inboard = ws.core(b.parent);
    Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
    if constexpr (For.inertia) {
      ArticulatedInertia<T> P = body.P;
      if constexpr (NV == 1) {  // one column: D is a number, the innermost case
        const Force<T> PH = body.P * hinge.H[0];
        const T D = dot(hinge.H[0], PH);
        const T scale = (P.J.xx + P.J.yy + P.J.zz) * dot(hinge.H[0].w, hinge.H[0].w) + (P.M.xx + P.M.yy + P.M.zz) * dot(hinge.H[0].v, hinge.H[0].v);
        if (!(D > T(kPivotLimit) * scale)) {
          ws.breakdown = {k, 0, static_cast<double>(D), kPivotLimit * static_cast<double>(scale)};
          return;
        }
        hinge.L[0] = D;
        hinge.G[0] = (T(1) / D) * PH;
        subtract_outer(P, hinge.G[0], PH);
      } else if constexpr (NV > 1) {
        Force<T> half[NV];
        Breakdown bad;
        if (!factor_hinge<T, NV>(body.P, hinge, nullptr, half, bad)) {
          bad.body = k;
          ws.breakdown = bad;
          return;
        }
        for (int j = 0; j < NV; ++j) subtract_outer(P, half[j], half[j]);
      }
      inboard.P += to_inboard(ws.X(k), P);
    }
    if constexpr (For.bias) {
      Force<T> z = body.z;
      if constexpr (NV > 0) {
        T eps[NV];
        for (int j = 0; j < NV; ++j) {
          eps[j] = (in.tau ? in.tau[b.v + j] : T(0)) - dot(hinge.H[j], body.z);
          z += eps[j] * hinge.G[j];
          hinge.nu[j] = eps[j];
        }
        if constexpr (NV == 1)
          hinge.nu[0] = eps[0] / hinge.L[0];
        else
          solve_hinge<T, NV>(hinge, hinge.nu);
      }
      inboard.z += to_inboard(ws.X(k), z);
    }
  }
}

/// Column j of a 6 x m array as a force, and as a motion.
template <class T>
Force<T> force_column(const T* a, int j) { return {{a[6 * j], a[6 * j + 1], a[6 * j + 2]}, {a[6 * j + 3], a[6 * j + 4], a[6 * j + 5]}}; }
template <class T>
Motion<T> motion_column(const T* a, int j) { return {{a[6 * j], a[6 * j + 1], a[6 * j + 2]}, {a[6 * j + 3], a[6 * j + 4], a[6 * j + 5]}}; }

/// Stage 1 of 4.10: P_ee' = L L*, U = P_ee'^-1 P_re'*, P_r = P_rr - P_re' U. Where M_ee is constant and nothing else deforms
/// with the modes, its factor was formed once by compile() and the cost is O(m).
template <class T>
bool eliminate_modes(const Model& model, const SweepBody& b, Core<T>& body, Modal<T>& modal, Breakdown& bad) {
  using std::sqrt;
  const FlexibleBody& f = model.flexible[static_cast<std::size_t>(b.flexible)];
  const int m = b.n_modes;
  modal.P_r = body.P;
  if (!modal.P_ee) {
    if (f.M_re_constant) {
      for (int i = 0; i < 6 * m; ++i) modal.U[i] = T(f.U[static_cast<std::size_t>(i)]);
    } else {
      for (int i = 0; i < 6 * m; ++i) modal.U[i] = modal.P_re[i];
      if (!f.M_ee_identity) {
        const double* L = f.L_ee.data();
        for (int j = 0; j < m; ++j)  // six right-hand sides at once: row j of U holds 6 numbers
          for (int r = 0; r < 6; ++r) {
            T sum = modal.U[6 * j + r];
            for (int l = 0; l < j; ++l) sum = sum - T(L[m * l + j]) * modal.U[6 * l + r];
            modal.U[6 * j + r] = sum / T(L[m * j + j]);
          }
        for (int j = m - 1; j >= 0; --j)
          for (int r = 0; r < 6; ++r) {
            T sum = modal.U[6 * j + r];
            for (int l = j + 1; l < m; ++l) sum = sum - T(L[m * j + l]) * modal.U[6 * l + r];
            modal.U[6 * j + r] = sum / T(L[m * j + j]);
          }
      }
    }
    for (int j = 0; j < m; ++j) subtract_outer(modal.P_r, force_column(modal.P_re, j), force_column(modal.U, j));
    return true;
  }
  // P_re' and P_ee' of a body whose pnode deforms
  if (modal.C) {
    for (int j = 0; j < m; ++j) {
      const Force<T> old = force_column(modal.P_re, j), now = old - body.P * motion_column(modal.C, j);
      T* c = modal.P_re + 6 * j;
      modal.U[6 * j] = old.n.x, modal.U[6 * j + 1] = old.n.y, modal.U[6 * j + 2] = old.n.z;
      modal.U[6 * j + 3] = old.f.x, modal.U[6 * j + 4] = old.f.y, modal.U[6 * j + 5] = old.f.z;
      c[0] = now.n.x, c[1] = now.n.y, c[2] = now.n.z, c[3] = now.f.x, c[4] = now.f.y, c[5] = now.f.z;
    }
    for (int j = 0; j < m; ++j)  // lower triangle: P_ee - C* P_re - P_re'* C
      for (int i = j; i < m; ++i)
        modal.P_ee[m * j + i] = modal.P_ee[m * j + i] - dot(motion_column(modal.C, i), force_column(modal.U, j)) -
                                dot(motion_column(modal.C, j), force_column(modal.P_re, i));
  }
  const std::uint8_t* fixed = model.has_prescribed() ? model.prescribed.data() + b.etadot : nullptr;
  for (int j = 0; fixed && j < m; ++j) {
    if (!fixed[j]) continue;
    for (int i = j; i < m; ++i) modal.P_ee[m * j + i] = T(i == j ? 1 : 0);
    for (int i = 0; i < j; ++i) modal.P_ee[m * i + j] = T(0);
    for (int r = 0; r < 6; ++r) modal.P_re[6 * j + r] = T(0);
  }
  T* L = modal.P_ee;  // lower triangle, column-major, in place
  for (int j = 0; j < m; ++j) {
    const T original = L[m * j + j];
    for (int l = 0; l < j; ++l) {
      const T factor = L[m * l + j];
      for (int i = j; i < m; ++i) L[m * j + i] = L[m * j + i] - factor * L[m * l + i];
    }
    const T pivot = L[m * j + j];
    if (!(pivot > T(kPivotLimit) * original)) {
      bad.component = -1;
      bad.value = static_cast<double>(pivot);
      bad.limit = kPivotLimit * static_cast<double>(original);
      return false;
    }
    const T root = sqrt(pivot);
    L[m * j + j] = root;
    for (int i = j + 1; i < m; ++i) L[m * j + i] = L[m * j + i] / root;
  }
  for (int j = 0; j < m; ++j) {  // Y = L^-1 P_re'*, kept in U; P_r = P_rr - Y* Y
    for (int r = 0; r < 6; ++r) {
      T sum = modal.P_re[6 * j + r];
      for (int l = 0; l < j; ++l) sum = sum - L[m * l + j] * modal.U[6 * l + r];
      modal.U[6 * j + r] = sum / L[m * j + j];
    }
    const Force<T> y = force_column(modal.U, j);
    subtract_outer(modal.P_r, y, y);
  }
  for (int j = m - 1; j >= 0; --j)
    for (int r = 0; r < 6; ++r) {
      T sum = modal.U[6 * j + r];
      for (int l = j + 1; l < m; ++l) sum = sum - L[m * j + l] * modal.U[6 * l + r];
      modal.U[6 * j + r] = sum / L[m * j + j];
    }
  return true;
}

/// x <- P_ee'^-1 x.
template <class T>
void solve_modes(const FlexibleBody& f, const Modal<T>& modal, int m, T* x) {
  if (!modal.P_ee && f.M_ee_identity) return;
  const auto L = [&](int i, int j) { return modal.P_ee ? modal.P_ee[m * j + i] : T(f.L_ee[static_cast<std::size_t>(m * j + i)]); };
  for (int j = 0; j < m; ++j) {
    for (int l = 0; l < j; ++l) x[j] = x[j] - L(j, l) * x[l];
    x[j] = x[j] / L(j, j);
  }
  for (int j = m - 1; j >= 0; --j) {
    for (int l = j + 1; l < m; ++l) x[j] = x[j] - L(l, j) * x[l];
    x[j] = x[j] / L(j, j);
  }
}

template <class T, int NV, InwardFor For>
void inward_general(const Model& model, Workspace<T>& ws, const Inputs<T>& in, int begin, int end) {
  for (int k = end - 1; k >= begin; --k) {
    const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
    Core<T>& body = ws.core(k);
    Core<T>& inboard = ws.core(b.parent);
    Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
    Modal<T>& modal = ws.template modal<NV>(k);
    Modal<T>* modal_inboard = modal.A ? ws.modal_of(b.parent) : nullptr;
    const int m = b.n_modes;
    const std::uint8_t* fixed = b.has_prescribed ? model.prescribed.data() + b.v : nullptr;
    const std::uint8_t* fixed_mode = m > 0 && model.has_prescribed() ? model.prescribed.data() + b.etadot : nullptr;
    Breakdown bad;
    bad.body = k;
    if constexpr (For.inertia) {
      if (m == 0)
        modal.P_r = body.P;
      else if (!eliminate_modes(model, b, body, modal, bad)) {
        ws.breakdown = bad;
        return;
      }
      ArticulatedInertia<T> P = modal.P_r;
      if constexpr (NV > 0) {
        Force<T> half[NV];
        if (!factor_hinge<T, NV>(modal.P_r, hinge, fixed, half, bad)) {
          ws.breakdown = bad;
          return;
        }
        for (int j = 0; j < NV; ++j) subtract_outer(P, half[j], half[j]);
      }
      inboard.P += to_inboard(ws.X(k), P);
      if (modal_inboard) {  // rows and columns of the inboard modes: A* P+ A
        const int mp = b.n_parent_modes;
        for (int j = 0; j < mp; ++j) {
          const Force<T> PA = P * motion_column(modal.A, j), at_A = to_inboard(ws.X(k), PA);
          T* c = modal_inboard->P_re + 6 * j;
          c[0] = c[0] + at_A.n.x, c[1] = c[1] + at_A.n.y, c[2] = c[2] + at_A.n.z;
          c[3] = c[3] + at_A.f.x, c[4] = c[4] + at_A.f.y, c[5] = c[5] + at_A.f.z;
          for (int i = j; i < mp; ++i) modal_inboard->P_ee[mp * j + i] = modal_inboard->P_ee[mp * j + i] + dot(motion_column(modal.A, i), PA);
        }
      }
    }
    if constexpr (For.bias) {
      Force<T> z = body.z;
      if (m > 0) {
        const FlexibleBody& f = model.flexible[static_cast<std::size_t>(b.flexible)];
        for (int j = 0; j < m; ++j) {
          T eps = (in.tau ? in.tau[b.etadot + j] : T(0)) - modal.z[j];
          if (modal.C) eps = eps + dot(motion_column(modal.C, j), body.z);
          modal.nu[j] = fixed_mode && fixed_mode[j] ? T(0) : eps;
        }
        solve_modes(f, modal, m, modal.nu);
        for (int j = 0; j < m; ++j) z += modal.nu[j] * force_column(modal.P_re, j);
      }
      if constexpr (NV > 0) {
        T eps[NV];
        for (int j = 0; j < NV; ++j) eps[j] = fixed && fixed[j] ? T(0) : (in.tau ? in.tau[b.v + j] : T(0)) - dot(hinge.H[j], z);
        for (int j = 0; j < NV; ++j) {
          z += eps[j] * hinge.G[j];
          hinge.nu[j] = eps[j];
        }
        solve_hinge<T, NV>(hinge, hinge.nu);
      }
      inboard.z += to_inboard(ws.X(k), z);
      if (modal_inboard)
        for (int j = 0; j < b.n_parent_modes; ++j) modal_inboard->z[j] = modal_inboard->z[j] + dot(motion_column(modal.A, j), z);
    }
  }
}

}  // namespace cardan::soa
