#pragma once
// Tip to base: the articulated body inertia P (Riccati), D = H P H*, the gain G = P H* D^-1, and in the same pass the
// residual z, eps = tau - H z and nu = D^-1 eps (mathematics 4.4, 4.6). Flexible bodies in two stages, modes then hinge
// (4.10). P is symmetric by type; P+ = P - G D G* is formed from the Cholesky factor of D.
#include <cmath>
#include <utility>

#include "core/soa/workspace.hpp"

namespace cardan::soa {

/// Cholesky factor of D = H P H* and the gain, for NV columns. `fixed[j]`: component j follows a prescribed motion and takes
/// no part. Returns false at a direction without inertia.
template <class T, int NV>
static bool factor_hinge(const ArticulatedInertia<T>& P, Hinge<T, NV>& hinge, const std::uint8_t* fixed, Force<T>* half, Breakdown& bad) {
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
static void solve_hinge(const Hinge<T, NV>& hinge, T* x) {
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

/// Column j of a 6 x m array as a force, and as a motion.
template <class T>
static Force<T> force_column(const T* a, int j) { return {{a[6 * j], a[6 * j + 1], a[6 * j + 2]}, {a[6 * j + 3], a[6 * j + 4], a[6 * j + 5]}}; }
template <class T>
static Motion<T> motion_column(const T* a, int j) { return {{a[6 * j], a[6 * j + 1], a[6 * j + 2]}, {a[6 * j + 3], a[6 * j + 4], a[6 * j + 5]}}; }

/// Modal columns of Phi*: Y s for s = S eta-like sums; and its transpose.
template <class T>
static Motion<T> times(const T* Y, const T* s) {
  Motion<T> out = s[0] * motion_column(Y, 0);
  for (int i = 1; i < 6; ++i) out += s[i] * motion_column(Y, i);
  return out;
}
template <class T>
static void transposed_times(const T* Y, const Force<T>& f, T* out) {
  for (int i = 0; i < 6; ++i) out[i] = dot(motion_column(Y, i), f);
}
/// S x = sum_j x_j [psi_j; phi_j], 6 numbers.
template <class T>
static void shapes_times(const double* S, const T* x, int m, T* out) {
  for (int r = 0; r < 6; ++r) out[r] = T(0);
  for (int j = 0; j < m; ++j)
    for (int r = 0; r < 6; ++r) out[r] = out[r] + x[j] * T(S[6 * j + r]);
}
/// out += S* Y* f: a wrench at B on the modes of the inboard body.
template <class T>
static void add_to_modes(const T* Y, const double* S, const Force<T>& f, int m, T* out) {
  T y[6];
  transposed_times(Y, f, y);
  for (int j = 0; j < m; ++j) {
    T sum(0);
    for (int r = 0; r < 6; ++r) sum = sum + T(S[6 * j + r]) * y[r];
    out[j] = out[j] + sum;
  }
}
/// 6 numbers as a force or motion, and back.
template <class T>
static void store(const Force<T>& f, T* out) { out[0] = f.n.x, out[1] = f.n.y, out[2] = f.n.z, out[3] = f.f.x, out[4] = f.f.y, out[5] = f.f.z; }
template <class T>
static void store(const Motion<T>& f, T* out) { out[0] = f.w.x, out[1] = f.w.y, out[2] = f.w.z, out[3] = f.v.x, out[4] = f.v.y, out[5] = f.v.z; }

/// Scratch of a body with n outboard hinges on deforming nodes (N = 6 n): P~ (N x N), X~ (N x 6), G_rs* (N x 6),
/// LU (N x N), s, g (N each).
static inline std::size_t compliant_size(int n) { return static_cast<std::size_t>(2 * 36 * n * n + 2 * 36 * n + 2 * 6 * n); }
template <class T>
struct Compliant {
  int N;
  T *P, *X, *G, *LU, *s, *g;
  Compliant(T* at, int n) : N(6 * n), P(at), X(P + N * N), G(X + 6 * N), LU(G + 6 * N), s(LU + N * N), g(s + N) {}
};

template <class T, int NV, InwardFor For>
static void inward_rigid(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, int begin, int end) {
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

/// Stage 1 of 4.10: P_ee' = L L*, U = P_ee'^-1 P_re'*, P_r = P_rr - P_re' U. Where M_ee is constant and nothing else deforms
/// with the modes, its factor was formed once by compile() and the cost is O(m).
template <class T>
static bool eliminate_modes(const SweepModel& model, const SweepBody& b, Core<T>& body, Modal<T>& modal, Breakdown& bad) {
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

/// Stage 1 through the outboard nodes. The modes act as a compliance Sigma_B = Y Sigma Y* between the body and what hangs on
/// its nodes:  P~ = (1 + P+ Sigma_B)^-1 P+,  X~ = X - Y G_rs*,  P_r = M_rr - M_re M_ee^-1 M_re* + X~* P~ X~.
/// Nothing cancels, however heavy the outboard bodies; P+ may be singular. U holds M_ee^-1 M_re* afterwards.
template <class T>
static void eliminate_by_nodes(const SweepModel& model, Workspace<T>& ws, const SweepBody& b, Core<T>& body, Modal<T>& modal) {
  const FlexibleBody& f = model.flexible[static_cast<std::size_t>(b.flexible)];
  const int m = b.n_modes, n = static_cast<int>(f.attached.size());
  const Compliant<T> c(modal.compliant, n);
  const int N = c.N;
  Breakdown none;
  eliminate_modes(model, b, body, modal, none);  // U and P_r of the body alone
  for (int a = 0; a < n; ++a) {
    const int k = f.attached[static_cast<std::size_t>(a)];
    const SweepBody& child = model.bodies[static_cast<std::size_t>(k)];
    const Modal<T>& outboard = *ws.modal_of(k);
    const double* S = model.shapes[static_cast<std::size_t>(child.onode)].columns.data();
    T G[36] = {};  // 6 x 6: S F1*, row r = sum_j S_rj U_j
    for (int j = 0; j < m; ++j)
      for (int col = 0; col < 6; ++col)
        for (int r = 0; r < 6; ++r) G[6 * col + r] = G[6 * col + r] + T(S[6 * j + r]) * modal.U[6 * j + col];
    for (int col = 0; col < 6; ++col) {
      T unit[6] = {T(0), T(0), T(0), T(0), T(0), T(0)};
      unit[col] = T(1);
      const Motion<T> e{{unit[0], unit[1], unit[2]}, {unit[3], unit[4], unit[5]}};
      store(to_outboard(ws.X(k), e) - times(outboard.Y, G + 6 * col), c.X + N * col + 6 * a);
    }
  }
  // LU <- 1 + P+ Sigma_B, P <- P+ (block diagonal)
  for (int a = 0; a < n; ++a) {
    const Modal<T>& row = *ws.modal_of(f.attached[static_cast<std::size_t>(a)]);
    for (int d = 0; d < n; ++d) {
      const Modal<T>& column = *ws.modal_of(f.attached[static_cast<std::size_t>(d)]);
      for (int col = 0; col < 6; ++col) {
        T w[6], v[6];  // w = Sigma_ad Y_d* e_col
        for (int i = 0; i < 6; ++i) v[i] = column.Y[6 * i + col];
        for (int i = 0; i < 6; ++i) {
          w[i] = T(0);
          for (int l = 0; l < 6; ++l) w[i] = w[i] + T(f.Sigma[static_cast<std::size_t>(N * (6 * d + l) + 6 * a + i)]) * v[l];
        }
        T out[6];
        store(row.P_plus * times(row.Y, w), out);
        for (int i = 0; i < 6; ++i) c.LU[N * (6 * d + col) + 6 * a + i] = out[i] + T(a == d && i == col ? 1 : 0);
        T unit[6] = {T(0), T(0), T(0), T(0), T(0), T(0)};
        unit[col] = T(a == d ? 1 : 0);
        store(row.P_plus * Motion<T>{{unit[0], unit[1], unit[2]}, {unit[3], unit[4], unit[5]}}, c.P + N * (6 * d + col) + 6 * a);
      }
    }
  }
  for (int j = 0; j < N; ++j) {  // Gauss with row exchanges
    int pivot = j;
    for (int i = j + 1; i < N; ++i)
      if (c.LU[N * j + i] * c.LU[N * j + i] > c.LU[N * j + pivot] * c.LU[N * j + pivot]) pivot = i;
    if (pivot != j)
      for (int l = 0; l < N; ++l) {
        std::swap(c.LU[N * l + j], c.LU[N * l + pivot]);
        std::swap(c.P[N * l + j], c.P[N * l + pivot]);
      }
    const T inverse = T(1) / c.LU[N * j + j];
    for (int i = j + 1; i < N; ++i) {
      const T factor = c.LU[N * j + i] * inverse;
      for (int l = j + 1; l < N; ++l) c.LU[N * l + i] = c.LU[N * l + i] - factor * c.LU[N * l + j];
      for (int l = 0; l < N; ++l) c.P[N * l + i] = c.P[N * l + i] - factor * c.P[N * l + j];
    }
  }
  for (int l = 0; l < N; ++l)
    for (int j = N - 1; j >= 0; --j) {
      for (int i = j + 1; i < N; ++i) c.P[N * l + j] = c.P[N * l + j] - c.LU[N * i + j] * c.P[N * l + i];
      c.P[N * l + j] = c.P[N * l + j] / c.LU[N * j + j];
    }
  for (int j = 0; j < N; ++j)  // symmetric by nature, kept so
    for (int i = 0; i < j; ++i) c.P[N * j + i] = c.P[N * i + j] = T(0.5) * (c.P[N * j + i] + c.P[N * i + j]);
  T H[36];  // X~* P~ X~, upper triangle
  for (int col = 0; col < 6; ++col) {
    for (int i = 0; i < N; ++i) {
      c.g[i] = T(0);
      for (int l = 0; l < N; ++l) c.g[i] = c.g[i] + c.P[N * l + i] * c.X[N * col + l];
    }
    for (int r = 0; r <= col; ++r) {
      T sum(0);
      for (int i = 0; i < N; ++i) sum = sum + c.X[N * r + i] * c.g[i];
      H[6 * col + r] = sum;
    }
  }
  const auto h = [&](int r, int col) { return H[6 * col + r]; };
  modal.P_r += ArticulatedInertia<T>{{h(0, 0), h(1, 1), h(2, 2), h(0, 1), h(0, 2), h(1, 2)},
                                     {h(0, 3), h(0, 4), h(0, 5), h(1, 3), h(1, 4), h(1, 5), h(2, 3), h(2, 4), h(2, 5)},
                                     {h(3, 3), h(4, 4), h(5, 5), h(3, 4), h(3, 5), h(4, 5)}};
}

/// nu <- y = M_ee^-1 eps_e; s <- Y S y; gives X~* P~ s, which joins z_r' = z_r + M_re y + X~* P~ s.
template <class T>
static Force<T> bias_by_nodes(const SweepModel& model, const Workspace<T>& ws, const SweepBody& b, const Modal<T>& modal) {
  const FlexibleBody& f = model.flexible[static_cast<std::size_t>(b.flexible)];
  const int n = static_cast<int>(f.attached.size());
  const Compliant<T> c(modal.compliant, n);
  const int N = c.N;
  for (int a = 0; a < n; ++a) {
    const int k = f.attached[static_cast<std::size_t>(a)];
    T s[6];
    shapes_times(model.shapes[static_cast<std::size_t>(model.bodies[static_cast<std::size_t>(k)].onode)].columns.data(), modal.nu, b.n_modes, s);
    store(times(ws.modal_of(k)->Y, s), c.s + 6 * a);
  }
  for (int i = 0; i < N; ++i) {
    c.g[i] = T(0);
    for (int l = 0; l < N; ++l) c.g[i] = c.g[i] + c.P[N * l + i] * c.s[l];
  }
  T out[6];
  for (int col = 0; col < 6; ++col) {
    out[col] = T(0);
    for (int i = 0; i < N; ++i) out[col] = out[col] + c.X[N * col + i] * c.g[i];
  }
  return {{out[0], out[1], out[2]}, {out[3], out[4], out[5]}};
}

/// eta'' = y - U dl - F Y* P~ (s + X~ dl), dl = delta of the body.
template <class T>
static void acceleration_by_nodes(const SweepModel& model, const Workspace<T>& ws, const SweepBody& b, Modal<T>& modal, const Motion<T>& dl) {
  const FlexibleBody& f = model.flexible[static_cast<std::size_t>(b.flexible)];
  const int n = static_cast<int>(f.attached.size());
  const Compliant<T> c(modal.compliant, n);
  const int N = c.N;
  T d[6];
  store(dl, d);
  for (int i = 0; i < N; ++i) {
    c.g[i] = c.s[i];
    for (int col = 0; col < 6; ++col) c.g[i] = c.g[i] + c.X[N * col + i] * d[col];
  }
  for (int j = 0; j < b.n_modes; ++j) modal.accel[j] = modal.nu[j] - dot(dl, force_column(modal.U, j));
  for (int a = 0; a < n; ++a) {
    Force<T> force{};  // P~ (s + X~ dl), rows of this node
    T h[6];
    for (int i = 0; i < 6; ++i) {
      h[i] = T(0);
      for (int l = 0; l < N; ++l) h[i] = h[i] + c.P[N * l + 6 * a + i] * c.g[l];
    }
    force = {{h[0], h[1], h[2]}, {h[3], h[4], h[5]}};
    T y[6];
    transposed_times(ws.modal_of(f.attached[static_cast<std::size_t>(a)])->Y, force, y);
    const double* F = f.F[static_cast<std::size_t>(a)].data();
    for (int j = 0; j < b.n_modes; ++j)
      for (int r = 0; r < 6; ++r) modal.accel[j] = modal.accel[j] - T(F[6 * j + r]) * y[r];
  }
}

/// x <- P_ee'^-1 x.
template <class T>
static void solve_modes(const FlexibleBody& f, const Modal<T>& modal, int m, T* x) {
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
static void inward_general(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, int begin, int end) {
  for (int k = end - 1; k >= begin; --k) {
    const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
    Core<T>& body = ws.core(k);
    Core<T>& inboard = ws.core(b.parent);
    Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
    Modal<T>& modal = ws.template modal<NV>(k);
    Modal<T>* modal_inboard = modal.Y ? ws.modal_of(b.parent) : nullptr;
    const double* S = modal.Y ? model.shapes[static_cast<std::size_t>(b.onode)].columns.data() : nullptr;
    const int m = b.n_modes;
    const std::uint8_t* fixed = b.has_prescribed ? model.prescribed.data() + b.v : nullptr;
    const std::uint8_t* fixed_mode = m > 0 && model.has_prescribed() ? model.prescribed.data() + b.etadot : nullptr;
    Breakdown bad;
    bad.body = k;
    if constexpr (For.inertia) {
      if (m == 0)
        modal.P_r = body.P;
      else if (modal.compliant)
        eliminate_by_nodes(model, ws, b, body, modal);
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
      if (modal_inboard) modal.P_plus = P;
      if (!modal_inboard || !modal_inboard->compliant) inboard.P += to_inboard(ws.X(k), P);
      if (modal_inboard && !modal_inboard->compliant) {  // rows and columns of the inboard modes: A* P+ A with A = Y S
        const int mp = b.n_parent_modes;
        T Q[36], W[36];  // Y* P+ Y and X* P+ Y
        for (int i = 0; i < 6; ++i) {
          const Force<T> PY = P * motion_column(modal.Y, i);
          transposed_times(modal.Y, PY, Q + 6 * i);
          store(to_inboard(ws.X(k), PY), W + 6 * i);
        }
        for (int j = 0; j < mp; ++j) {
          T q[6] = {T(0), T(0), T(0), T(0), T(0), T(0)};
          for (int i = 0; i < 6; ++i)
            for (int r = 0; r < 6; ++r) {
              modal_inboard->P_re[6 * j + r] = modal_inboard->P_re[6 * j + r] + W[6 * i + r] * T(S[6 * j + i]);
              q[r] = q[r] + Q[6 * i + r] * T(S[6 * j + i]);
            }
          for (int i = j; i < mp; ++i)
            for (int r = 0; r < 6; ++r) modal_inboard->P_ee[mp * j + i] = modal_inboard->P_ee[mp * j + i] + T(S[6 * i + r]) * q[r];
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
        if (modal.compliant) z += bias_by_nodes(model, ws, b, modal);
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
      if (modal_inboard) add_to_modes(modal.Y, S, z, b.n_parent_modes, modal_inboard->z);
    }
  }
}

}  // namespace cardan::soa
