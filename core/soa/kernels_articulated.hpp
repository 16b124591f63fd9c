#pragma once
// Tip to base: the articulated body inertia P (Riccati), D = H P H*, the gain G = P H* D^-1, and in the same pass the
// residual z, eps = tau - H z and nu = D^-1 eps (mathematics 4.4, 4.6). Flexible bodies in two stages, modes then hinge
// (4.10). P is symmetric by type; P+ = P - G D G* is formed from the Cholesky factor of D.
#include <algorithm>
#include <cmath>
#include <type_traits>

#include "core/soa/columns.hpp"
#include "core/soa/workspace.hpp"

namespace cardan::soa {

/// As kPivotLimit, where a vanishing pivot is allowed: what is left of a 6 x 6 diagonal entry after the rounding of its elimination.
static constexpr double kRootLimit = 2e-15;

/// 1 where x > limit, else 0: kernels choose by arithmetic, so that lanes need no branch.
template <class T>
static T above(const T& x, const T& limit) { return x > limit ? T(1) : T(0); }
/// 1/x where x > limit, else 0.
template <class T>
CARDAN_INLINE T inverse_above(const T& x, const T& limit) {
  if constexpr (kWidth<T> == 1) {
    return x > limit ? T(1) / x : T(0);
  } else {
    const T keep = above(x, limit);
    return keep / (keep * x + (T(1) - keep));
  }
}

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

/// What s = sum_j x_j [psi_j; phi_j] moves at O, as a motion of the inboard body's frame; and the transpose, a force there on
/// the node's shapes. Modal columns of Phi* are X S-like sums of the first, S the shapes.
template <class T>
static Motion<T> motion_of_node(const ModalNode<T>& node, const T* s) {
  const Vec3<T> w = node.Jl * Vec3<T>{s[0], s[1], s[2]};
  return {w, Vec3<T>{s[3], s[4], s[5]} - cross(w, node.rho)};
}
template <class T>
static void on_node(const ModalNode<T>& node, const Force<T>& f, T* out) {
  const Vec3<T> n = transpose_times(node.Jl, f.n - cross(node.rho, f.f));
  out[0] = n.x, out[1] = n.y, out[2] = n.z, out[3] = f.f.x, out[4] = f.f.y, out[5] = f.f.z;
}
/// out_j += [psi_j; phi_j] . y, y from on_node.
template <class T>
static void add_to_modes(const double* S, const T* y, int m, T* out) {
  for (int j = 0; j < m; ++j) {
    T sum(0);
    for (int r = 0; r < 6; ++r) sum = sum + T(S[6 * j + r]) * y[r];
    out[j] = out[j] + sum;
  }
}

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

/// y_i -= f x_i for i in [begin, end).
template <class T>
static void subtract_multiple(T* __restrict y, const T* __restrict x, const T& f, int begin, int end) {
  for (int i = begin; i < end; ++i) y[i] = y[i] - f * x[i];
}

/// M_ee^-1 x with the factor of compile().
template <class T>
static void solve_constant(const FlexibleBody& f, int m, T* x) {
  if (f.M_ee_identity) return;
  const double* L = f.L_ee.data();
  for (int j = 0; j < m; ++j) {
    x[j] = x[j] / T(L[m * j + j]);
    for (int i = j + 1; i < m; ++i) x[i] = x[i] - T(L[m * j + i]) * x[j];
  }
  for (int j = m - 1; j >= 0; --j) {
    for (int i = j + 1; i < m; ++i) x[j] = x[j] - T(L[m * j + i]) * x[i];
    x[j] = x[j] / T(L[m * j + j]);
  }
}

/// U = M_ee^-1 M_re* and M_rr - M_re U of a body by itself, M_ee constant. Where M_re is constant too, both were formed by
/// compile() and no mode is touched; where M_ee = 1, U is M_re*.
template <class T>
static void free_modes(const FlexibleBody& f, int m, const Core<T>& body, Modal<T>& modal) {
  modal.P_r = body.P;
  if (f.M_re_constant) {
    modal.P_r -= cast<T>(f.gramian);
    return;
  }
  if (!f.M_ee_identity) {
    const double* L = f.L_ee.data();
    T* U = modal.U;
    for (int i = 0; i < 6 * m; ++i) U[i] = modal.P_re[i];
    for (int j = 0; j < m; ++j) {  // six right-hand sides at once: row j of U holds 6 numbers
      const T inverse = T(1) / T(L[m * j + j]);
      for (int r = 0; r < 6; ++r) U[6 * j + r] = U[6 * j + r] * inverse;
      for (int i = j + 1; i < m; ++i) subtract_multiple(U + 6 * i, U + 6 * j, T(L[m * j + i]), 0, 6);
    }
    for (int j = m - 1; j >= 0; --j) {
      const T inverse = T(1) / T(L[m * j + j]);
      for (int i = j + 1; i < m; ++i) subtract_multiple(U + 6 * j, U + 6 * i, T(L[m * j + i]), 0, 6);
      for (int r = 0; r < 6; ++r) U[6 * j + r] = U[6 * j + r] * inverse;
    }
  }
  for (int j = 0; j < m; ++j) subtract_outer(modal.P_r, force_column(modal.P_re, j), force_column(modal.U, j));
}

/// Stage 1 of 4.10 with P_ee' = L D L* factored in place (below the diagonal L, on it D^-1): U = L^-1 P_re'*,
/// P_r = P_rr - U* D^-1 U.
template <class T>
static bool eliminate_modes(const SweepModel& model, const SweepBody& b, Core<T>& body, Modal<T>& modal, Breakdown& bad) {
  const int m = b.n_modes;
  T *L = modal.P_ee, *U = modal.U;  // lower triangle, column-major
  if (modal.C) {  // P_re' and P_ee' of a body whose pnode deforms: P_ee - C* P_re - P_re'* C
    for (int j = 0; j < m; ++j) {
      const Force<T> old = force_column(modal.P_re, j);
      store(old, U + 6 * j);
      store(old - body.P * motion_column(modal.C, j), modal.P_re + 6 * j);
    }
    for (int j = 0; j < m; ++j)
      for (int i = j; i < m; ++i)
        L[m * j + i] = L[m * j + i] - dot(motion_column(modal.C, i), force_column(U, j)) - dot(motion_column(modal.C, j), force_column(modal.P_re, i));
  }
  const std::uint8_t* fixed = model.has_prescribed() ? model.prescribed.data() + b.etadot : nullptr;
  for (int j = 0; fixed && j < m; ++j) {
    if (!fixed[j]) continue;
    for (int i = j; i < m; ++i) L[m * j + i] = T(i == j ? 1 : 0);
    for (int i = 0; i < j; ++i) L[m * i + j] = T(0);
    for (int r = 0; r < 6; ++r) modal.P_re[6 * j + r] = T(0);
  }
  for (int j = 0; j < m; ++j) modal.accel[j] = L[m * j + j];  // before elimination, to judge the pivots
  for (int i = 0; i < 6 * m; ++i) U[i] = modal.P_re[i];
  modal.P_r = body.P;
  for (int j = 0; j < m; ++j) {
    const T pivot = L[m * j + j];
    if (!(pivot > T(kPivotLimit) * modal.accel[j])) {
      bad.component = -1;
      bad.value = static_cast<double>(pivot);
      bad.limit = kPivotLimit * static_cast<double>(modal.accel[j]);
      return false;
    }
    const T inverse = T(1) / pivot;
    const Force<T> y = force_column(U, j);
    subtract_outer(modal.P_r, inverse * y, y);
    L[m * j + j] = inverse;
    for (int i = j + 1; i < m; ++i) {
      const T factor = L[m * j + i] * inverse;
      subtract_multiple(L + m * i, L + m * j, factor, i, m);
      subtract_multiple(U + 6 * i, U + 6 * j, factor, 0, 6);
    }
    for (int i = j + 1; i < m; ++i) L[m * j + i] = L[m * j + i] * inverse;
  }
  return true;
}

/// P_r = L L*, force rows first (the mass, then the moments about the mass centre), directions without inertia left out; the
/// hinge reflected out of L; and what is left, C with P+ = C C*, carried to the node and to the frame of the inboard body. `Given`:
/// some component of the hinge is `fixed`; else the columns that are left out are the first NV.
template <class T, int NV, bool Given>
static void take_root(const ArticulatedInertia<T>& P, const Hinge<T, NV>& hinge, const std::uint8_t* fixed, const Pose<T>& X,
               const ModalNode<T>& node, NodeRoot<T>& root) {
  using std::sqrt;
  T A[6][6];  // upper triangle, rows [force; moment]
  A[0][0] = P.M.xx, A[0][1] = P.M.xy, A[0][2] = P.M.xz, A[0][3] = P.B.xx, A[0][4] = P.B.yx, A[0][5] = P.B.zx;
  A[1][1] = P.M.yy, A[1][2] = P.M.yz, A[1][3] = P.B.xy, A[1][4] = P.B.yy, A[1][5] = P.B.zy;
  A[2][2] = P.M.zz, A[2][3] = P.B.xz, A[2][4] = P.B.yz, A[2][5] = P.B.zz;
  A[3][3] = P.J.xx, A[3][4] = P.J.xy, A[3][5] = P.J.xz, A[4][4] = P.J.yy, A[4][5] = P.J.yz, A[5][5] = P.J.zz;
  const T original[6] = {P.M.xx, P.M.yy, P.M.zz, P.J.xx, P.J.yy, P.J.zz};
  T W[6][6];  // columns of L, then of C
  unrolled<6>([&](const auto j) CARDAN_INLINE_BODY {
    const T inverse = inverse_above(A[j][j], T(kRootLimit) * original[j]);
    unrolled<6, j + 1>([&](const auto i) CARDAN_INLINE_BODY {
      const T factor = A[j][i] * inverse;
      unrolled<6, i>([&](const auto l) CARDAN_INLINE_BODY { A[i][l] = A[i][l] - factor * A[j][l]; });
    });
    root.inverse[j] = sqrt(inverse);
    unrolled<j>([&](const auto i) CARDAN_INLINE_BODY { W[j][i] = T(0); });
    unrolled<6, j>([&](const auto i) CARDAN_INLINE_BODY { W[j][i] = root.L[6 * j + i] = A[j][i] * root.inverse[j]; });
  });
  // what H* sees of the columns is reflected into one of them, and that is taken out
  const auto reflect = [&](const auto j, const auto out) CARDAN_INLINE_BODY {
    const T H[6] = {hinge.H[j].v.x, hinge.H[j].v.y, hinge.H[j].v.z, hinge.H[j].w.x, hinge.H[j].w.y, hinge.H[j].w.z};
    T v[6], w[6] = {T(0), T(0), T(0), T(0), T(0), T(0)}, square(0);
    unrolled<6>([&](const auto c) CARDAN_INLINE_BODY {
      if (c < out) return;
      v[c] = T(0);
      unrolled<6, j == 0 ? c : 0>([&](const auto r) CARDAN_INLINE_BODY { v[c] = v[c] + H[r] * W[c][r]; });
      square = square + v[c] * v[c];
    });
    const T length = (T(2) * above(v[out], T(0)) - T(1)) * sqrt(square);
    v[out] = v[out] + length;
    const T scale = T(1) / (length * v[out]);
    unrolled<6>([&](const auto c) CARDAN_INLINE_BODY {
      if (c >= out) unrolled<6, j == 0 ? c : 0>([&](const auto r) CARDAN_INLINE_BODY { w[r] = w[r] + v[c] * W[c][r]; });
    });
    unrolled<6>([&](const auto c) CARDAN_INLINE_BODY {
      if (c < out) return;
      root.v[6 * j + c] = v[c];
      if (c == out) return;
      const T factor = scale * v[c];
      unrolled<6>([&](const auto r) CARDAN_INLINE_BODY { W[c][r] = W[c][r] - factor * w[r]; });
    });
    unrolled<6>([&](const auto r) CARDAN_INLINE_BODY { W[out][r] = T(0); });
    root.scale[j] = scale;
  };
  if constexpr (Given) {
    int out = 0;
    unrolled<NV>([&](const auto j) CARDAN_INLINE_BODY {
      if (!fixed[j]) reflect(j, out++);
    });
  } else {
    unrolled<NV>([&](const auto j) CARDAN_INLINE_BODY { reflect(j, j); });
  }
  const Vec3<T> lever = X.p - node.rho;
  unrolled<6>([&](const auto c) CARDAN_INLINE_BODY {
    const T* a = W[c];
    if (!Given && c < NV) return;  // taken out: zero from the start
    Force<T> f{X.R * Vec3<T>{a[3], a[4], a[5]}, X.R * Vec3<T>{a[0], a[1], a[2]}};
    f.n += cross(lever, f.f);
    const Vec3<T> n = transpose_times(node.Jl, f.n);
    root.N[c] = n.x, root.N[6 + c] = n.y, root.N[12 + c] = n.z;
    root.N[18 + c] = f.f.x, root.N[24 + c] = f.f.y, root.N[30 + c] = f.f.z;
    f.n += cross(node.rho, f.f);
    store(f, root.C + 6 * c);
  });
}

/// zeta and e of z+ = C zeta + e, `tau` on the hinge: what L reaches, and the rest with the share of tau. Gives e at the inboard body.
template <class T, int NV, bool Given>
static Force<T> take_root_of_force(const Force<T>& z, const T* tau, const Hinge<T, NV>& hinge, const std::uint8_t* fixed, const Pose<T>& X,
                            NodeRoot<T>& root) {
  T left[6] = {z.f.x, z.f.y, z.f.z, z.n.x, z.n.y, z.n.z};  // in the end: what L does not reach
  T zeta[6];
  unrolled<6>([&](const auto j) CARDAN_INLINE_BODY {
    zeta[j] = left[j] * root.inverse[j];
    unrolled<6, j + 1>([&](const auto i) CARDAN_INLINE_BODY { left[i] = left[i] - root.L[6 * j + i] * zeta[j]; });
    left[j] = left[j] * (T(1) - above(root.inverse[j], T(0)));
  });
  const Force<T> unreached{{left[3], left[4], left[5]}, {left[0], left[1], left[2]}};
  Force<T> e = unreached;
  const auto reflect = [&](const auto j, const auto out) CARDAN_INLINE_BODY {
    const T* v = root.v + 6 * j;
    T sum(0);
    unrolled<6>([&](const auto c) CARDAN_INLINE_BODY {
      if (c >= out) sum = sum + v[c] * zeta[c];
    });
    sum = root.scale[j] * sum;
    unrolled<6>([&](const auto c) CARDAN_INLINE_BODY {
      if (c >= out) zeta[c] = zeta[c] - sum * v[c];
    });
    zeta[out] = T(0);
    e += ((tau ? tau[j] : T(0)) - dot(hinge.H[j], unreached)) * hinge.G[j];
  };
  if constexpr (Given) {
    int out = 0;
    unrolled<NV>([&](const auto j) CARDAN_INLINE_BODY {
      if (!fixed[j]) reflect(j, out++);
    });
  } else {
    unrolled<NV>([&](const auto j) CARDAN_INLINE_BODY { reflect(j, j); });
  }
  unrolled<6>([&](const auto j) CARDAN_INLINE_BODY { root.zeta[j] = zeta[j]; });
  return to_inboard(X, e);
}

/// y += f x, six numbers.
template <class T>
CARDAN_INLINE void add_multiple(T* y, const T& f, const Six<T>& x) {
  Six<T> s(y);
  s.add(f, x);
  s.to(y);
}

/// Calls visit(N, first), N = 6 n, as constants where there is one node. `first`: that of the columns of C that are not zero; 1 behind a
/// hinge of one velocity (take_root), where one pivot and a sixth of the rest are saved.
template <class Visit>
static void with_node_count(const SweepModel& model, const FlexibleBody& f, const Visit& visit) {
  constexpr std::integral_constant<int, 6> six;
  const SweepBody& outboard = model.bodies[static_cast<std::size_t>(f.attached[0])];
  if (f.attached.size() > 1)
    visit(6 * static_cast<int>(f.attached.size()), std::integral_constant<int, 0>{});
  else if (outboard.nv == 1 && !outboard.has_prescribed)
    visit(six, std::integral_constant<int, 1>{});
  else
    visit(six, std::integral_constant<int, 0>{});
}

/// Stage 1 through the outboard nodes (flexible.md, 7). V: the combinations of modes that move the nodes, V* M_ee V = 1, by Q.
/// With C of the outboard bodies side by side, N the same on the shapes of the nodes, B = Q* N, X~* C = C - M_re V B:
///   A = 1 + B* B,   P_r = M_rr - M_re M_ee^-1 M_re* + (X~* C) A^-1 (X~* C)*.
/// A >= 1 whatever the outboard bodies weigh: its factor L D L* needs no pivots, and nothing is subtracted.
template <class T>
static void eliminate_by_nodes(const SweepModel& model, Workspace<T>& ws, const SweepBody& b, const Core<T>& body, Modal<T>& modal) {
  const FlexibleBody& f = model.flexible[static_cast<std::size_t>(b.flexible)];
  const int m = b.n_modes;
  free_modes(f, m, body, modal);
  with_node_count(model, f, [&](const auto N, const auto first) {
    const ByNodes<T> w(modal.by_nodes, N);
    if (!f.M_re_constant)
      for (int r = 0; r < N; ++r) sum_columns(modal.P_re, f.UV.data() + m * r, m, w.MV + 6 * r);
    for (int a = 0; a < N; a += 6) {
      const NodeRoot<T>& root = *ws.modal_of(f.attached[static_cast<std::size_t>(a / 6)])->root;
      for (int d = 0; d <= a; d += 6)  // Q is lower triangular
        unrolled<6>([&](const auto r) CARDAN_INLINE_BODY {
          Six<T> row;
          unrolled<6>([&](const auto i) CARDAN_INLINE_BODY {
            if (d < a || i >= r) row.add(T(f.Q[static_cast<std::size_t>(N * (a + i) + d + r)]), Six<T>(root.N + 6 * i));
          });
          row.to(w.B + N * (d + r) + a);
        });
    }
    for (int a = 0; a < N; a += 6)  // rows of A, upper triangle in blocks of six columns
      for (int d = a; d < N; d += 6) {
        Six<T> rows[6];
        for (int e = 0; e <= a; e += 6)
          unrolled<6>([&](const auto r) CARDAN_INLINE_BODY {
            const T* B = w.B + N * (e + r);
            const Six<T> row(B + d);
            unrolled<6, first>([&](const auto i) CARDAN_INLINE_BODY { rows[i].add(B[a + i], row); });
          });
        unrolled<6, first>([&](const auto i) CARDAN_INLINE_BODY { rows[i].to(w.A + N * (a + i) + d); });
      }
    for (int a = 0; a < N; a += 6) {  // columns of X~* C
      const T* C = ws.modal_of(f.attached[static_cast<std::size_t>(a / 6)])->root->C;
      Six<T> x[6];
      unrolled<6, first>([&](const auto i) CARDAN_INLINE_BODY { x[i] = Six<T>(C + 6 * i); });
      for (int e = 0; e <= a; e += 6)
        unrolled<6>([&](const auto l) CARDAN_INLINE_BODY {
          const Six<T> column(w.MV + 6 * (e + l));
          unrolled<6, first>([&](const auto i) CARDAN_INLINE_BODY { x[i].add(-w.B[N * (e + l) + a + i], column); });
        });
      unrolled<6, first>([&](const auto i) CARDAN_INLINE_BODY { x[i].to(w.X + 6 * (a + i)); });
    }
    ArticulatedInertia<T> P = modal.P_r;
    for (int a = 0; a < N; a += 6) {  // A = L D L*; in the same steps columns of X~* C L^-*
      T A[6][6];
      Six<T> X[6];
      unrolled<6, first>([&](const auto j) CARDAN_INLINE_BODY {
        X[j] = Six<T>(w.X + 6 * (a + j));
        unrolled<6, j>([&](const auto i) CARDAN_INLINE_BODY { A[j][i] = w.A[N * (a + j) + a + i]; });
      });
      unrolled<6, first>([&](const auto j) CARDAN_INLINE_BODY {
        const T inverse = T(1) / (T(1) + A[j][j]);
        unrolled<6, j + 1>([&](const auto i) CARDAN_INLINE_BODY {
          const T factor = A[j][i] * inverse;
          unrolled<6, i>([&](const auto l) CARDAN_INLINE_BODY { A[i][l] = A[i][l] - factor * A[j][l]; });
          X[i].add(-factor, X[j]);
          w.A[N * (a + j) + a + i] = factor;
        });
        w.inverse[a + j] = inverse;
        X[j].to(w.X + 6 * (a + j));
        const Force<T> column = force_column(w.X, a + j);
        subtract_outer(P, (-inverse) * column, column);
      });
      for (int d = a + 6; d < N; d += 6)  // the rows below, and their columns of X~* C
        for (int j = a; j < a + 6; ++j) {
          for (int i = j + 1; i < a + 6; ++i) add_multiple(w.A + N * i + d, -w.A[N * j + i], Six<T>(w.A + N * j + d));
        }
      for (int j = a; j < a + 6; ++j)
        for (int i = a + 6; i < N; ++i) {
          const T factor = w.A[N * j + i] * w.inverse[j];
          for (int d = 6 * (i / 6); d < N; d += 6) add_multiple(w.A + N * i + d, -factor, Six<T>(w.A + N * j + d));
          add_multiple(w.X + 6 * i, -factor, Six<T>(w.X + 6 * j));
        }
      for (int j = a; j < a + 6; ++j)
        for (int i = a + 6; i < N; ++i) w.A[N * j + i] = w.A[N * j + i] * w.inverse[j];
    }
    modal.P_r = P;
  });
}

/// seen: V* eps_e. t <- V* eps_e - Q* e (eps_e less M_re* gamma where that is constant), u <- L^-1 (zeta + B* t); gives what joins z_r: -M_re V Q* e + (X~* C L^-*) D^-1 u.
template <class T>
static Force<T> bias_by_nodes(const SweepModel& model, const Workspace<T>& ws, const SweepBody& b, const Core<T>& body, const Modal<T>& modal, const T* seen) {
  const FlexibleBody& f = model.flexible[static_cast<std::size_t>(b.flexible)];
  T gamma[6];
  store(body.gamma, gamma);
  Six<T> out;
  with_node_count(model, f, [&](const auto N, const auto first) {
    const ByNodes<T> w(modal.by_nodes, N);
    for (int d = 0; d < N; d += 6) {
      Six<T> t;  // -Q* e
      for (int a = d; a < N; a += 6) {
        const T* e = ws.modal_of(f.attached[static_cast<std::size_t>(a / 6)])->root->e_N;
        unrolled<6>([&](const auto i) CARDAN_INLINE_BODY { t.add(-e[i], Six<T>(f.Q.data() + N * (a + i) + d)); });
      }
      T e[6];
      t.to(e);
      t.to(w.e + d);
      unrolled<6>([&](const auto r) CARDAN_INLINE_BODY {
        const T* c = w.MV + 6 * (d + r);
        out.add(e[r], Six<T>(c));
        T v = seen[d + r];
        if (!modal.P_re) v = v - ((c[0] * gamma[0] + c[1] * gamma[1] + c[2] * gamma[2]) + (c[3] * gamma[3] + c[4] * gamma[4] + c[5] * gamma[5]));
        w.t[d + r] = e[r] + v;
      });
    }
    for (int d = 0; d < N; d += 6) {
      Six<T> u(ws.modal_of(f.attached[static_cast<std::size_t>(d / 6)])->root->zeta);
      for (int a = 0; a <= d; a += 6)
        unrolled<6>([&](const auto r) CARDAN_INLINE_BODY { u.add(w.t[a + r], Six<T>(w.B + N * (a + r) + d)); });
      u.to(w.u + d);
    }
    for (int d = 0; d < N; d += 6) {
      T u[6];
      Six<T>(w.u + d).to(u);
      unrolled<6, first>([&](const auto j) CARDAN_INLINE_BODY {
        unrolled<6, j + 1>([&](const auto i) CARDAN_INLINE_BODY { u[i] = u[i] - w.A[N * (d + j) + d + i] * u[j]; });
      });
      for (int later = d + 6; later < N; later += 6)
        for (int j = 0; j < 6; ++j) add_multiple(w.u + later, -u[j], Six<T>(w.A + N * (d + j) + later));
      unrolled<6, first>([&](const auto j) CARDAN_INLINE_BODY {
        out.add(w.inverse[d + j] * u[j], Six<T>(w.X + 6 * (d + j)));
        w.u[d + j] = u[j];
      });
    }
  });
  T sum[6];
  out.to(sum);
  return force_column(sum, 0);
}

/// phi = A^-1 (zeta + B* t + (X~* C)* dl), dl = delta of the body; force = -(B phi + Q* e), eta'' = y - U dl + V force. In these
/// combinations of the modes the acceleration is t - (M_re V)* dl - B phi; Q takes it to the nodes, and no mode is touched.
template <class T>
static void acceleration_by_nodes(const SweepModel& model, const Workspace<T>& ws, const SweepBody& b, Modal<T>& modal, const T* dl, T* force) {
  const FlexibleBody& f = model.flexible[static_cast<std::size_t>(b.flexible)];
  with_node_count(model, f, [&](const auto N, const auto first) {
    const ByNodes<T> w(modal.by_nodes, N);
    for (int d = N - 6; d >= 0; d -= 6) {
      T u[6];
      unrolled<first>([&](const auto j) CARDAN_INLINE_BODY { u[j] = T(0); });
      unrolled<6, first>([&](const auto j) CARDAN_INLINE_BODY {
        const T* x = w.X + 6 * (d + j);
        const T seen = (x[0] * dl[0] + x[1] * dl[1] + x[2] * dl[2]) + (x[3] * dl[3] + x[4] * dl[4] + x[5] * dl[5]);
        u[j] = (w.u[d + j] + seen) * w.inverse[d + j];
        for (int i = d + 6; i < N; ++i) u[j] = u[j] - w.A[N * (d + j) + i] * w.u[i];
      });
      unrolled<6 - first>([&](const auto back) CARDAN_INLINE_BODY {
        constexpr int i = 5 - back;
        unrolled<i, first>([&](const auto j) CARDAN_INLINE_BODY { u[j] = u[j] - w.A[N * (d + j) + d + i] * u[i]; });
      });
      T* phi = ws.modal_of(f.attached[static_cast<std::size_t>(d / 6)])->root->phi;
      unrolled<6>([&](const auto j) CARDAN_INLINE_BODY { phi[j] = w.u[d + j] = u[j]; });
    }
    for (int d = 0; d < N; d += 6)
      unrolled<6>([&](const auto r) CARDAN_INLINE_BODY {
        const T *x = w.MV + 6 * (d + r), *B = w.B + N * (d + r);
        T by_phi(0);
        for (int a = d; a < N; a += 6)
          by_phi = by_phi + ((B[a] * w.u[a] + B[a + 1] * w.u[a + 1] + B[a + 2] * w.u[a + 2]) + (B[a + 3] * w.u[a + 3] + B[a + 4] * w.u[a + 4] + B[a + 5] * w.u[a + 5]));
        force[d + r] = w.e[d + r] - by_phi;
        w.t[d + r] = (w.t[d + r] - ((x[0] * dl[0] + x[1] * dl[1] + x[2] * dl[2]) + (x[3] * dl[3] + x[4] * dl[4] + x[5] * dl[5]))) - by_phi;
      });
    for (int a = 0; a < N; a += 6) {
      T* accel = ws.modal_of(f.attached[static_cast<std::size_t>(a / 6)])->node->accel;
      unrolled<6>([&](const auto i) CARDAN_INLINE_BODY {
        const double* Q = f.Q.data() + N * (a + i);
        T sum(0);
        for (int r = 0; r < a; ++r) sum = sum + T(Q[r]) * w.t[r];
        unrolled<i + 1>([&](const auto r) CARDAN_INLINE_BODY { sum = sum + T(Q[a + r]) * w.t[a + r]; });
        accel[i] = sum;
      });
    }
  });
}

/// eps_e = tau_e - z_e + C* z_r, into nu.
template <class T>
static void eps_of_modes(const SweepModel& model, const SweepBody& b, const Inputs<T>& in, const Core<T>& body, const Modal<T>& modal) {
  const int m = b.n_modes;
  const T *tau = in.tau ? in.tau + b.etadot : nullptr, *z = modal.z;
  T* __restrict eps = modal.nu;
  if (tau)
    for (int j = 0; j < m; ++j) eps[j] = tau[j] - z[j];
  else
    for (int j = 0; j < m; ++j) eps[j] = -z[j];
  if (modal.C)
    for (int j = 0; j < m; ++j) eps[j] = eps[j] + dot(motion_column(modal.C, j), body.z);
  if (!model.has_prescribed()) return;
  for (int j = 0; j < m; ++j)
    if (model.prescribed[static_cast<std::size_t>(b.etadot + j)]) eps[j] = T(0);
}

/// nu from eps_e in it, and what the modes add to z_r.
template <class T>
static Force<T> bias_of_modes(const SweepModel& model, Workspace<T>& ws, const SweepBody& b, const Core<T>& body, const Modal<T>& modal) {
  const FlexibleBody& f = model.flexible[static_cast<std::size_t>(b.flexible)];
  const int m = b.n_modes;
  T* x = modal.nu;
  if (!modal.P_ee) {
    const int own = f.M_re_constant ? 6 : 0, rows = own + (modal.by_nodes ? 6 * static_cast<int>(f.attached.size()) : 0);
    T of_body[6];
    T* sums = modal.by_nodes ? ws.sums.data() : of_body;  // U* eps_e, V* eps_e
    sum_columns(f.UV_columns.data(), rows, x, m, sums);
    Force<T> z{};
    if (f.M_re_constant) z = force_column(sums, 0) - cast<T>(f.gramian) * body.gamma;
    if (modal.by_nodes) z += bias_by_nodes(model, ws, b, body, modal, sums + own);
    solve_constant(f, m, x);
    if (f.M_re_constant) return z;
    sum_columns(modal.P_re, x, m, sums);
    return z + force_column(sums, 0);
  }
  Force<T> out{};
  for (int j = 0; j < m; ++j) {
    subtract_multiple(x, modal.P_ee + m * j, x[j], j + 1, m);
    out += (modal.P_ee[m * j + j] * x[j]) * force_column(modal.U, j);
  }
  return out;
}

/// eta'' = nu_e - U dl, dl = delta of the body (and gamma_b, where that is not in nu_e).
template <class T>
static void acceleration_of_modes(const SweepModel& model, Workspace<T>& ws, const SweepBody& b, const Core<T>& body, Modal<T>& modal, const Motion<T>& dl) {
  const FlexibleBody& f = model.flexible[static_cast<std::size_t>(b.flexible)];
  const int m = b.n_modes;
  T* x = modal.accel;
  T of_body[6];
  T *weights = modal.by_nodes ? ws.sums.data() : of_body, *force = weights;  // of the rows of UV
  if (modal.P_re) {
    T minus[6];
    store(Motion<T>{} - dl, minus);
    for (int j = 0; j < m; ++j) x[j] = modal.nu[j];
    add_columns(modal.U, minus, m, x);
  } else {
    store(Motion<T>{} - (dl + body.gamma), weights);
    force += 6;
  }
  if (modal.by_nodes) {
    T d[6];
    store(dl, d);
    acceleration_by_nodes(model, ws, b, modal, d, force);
    force += 6 * f.attached.size();
  }
  if (force > weights) add_rows(f.UV.data(), weights, static_cast<int>(force - weights), m, modal.P_re ? x : modal.nu, x);
  if (modal.P_ee)
    for (int j = m - 1; j >= 0; --j) {
      T sum = x[j] * modal.P_ee[m * j + j];
      for (int i = j + 1; i < m; ++i) sum = sum - modal.P_ee[m * j + i] * x[i];
      x[j] = sum;
    }
  if (modal.by_nodes) return;
  const int own = f.constant ? 6 : 0, rows = own + 6 * static_cast<int>(f.attached.size());
  for (std::size_t a = 0; a < f.attached.size(); ++a)
    sum_columns_of<Six<T>>(f.shapes.data() + own + 6 * a, rows, x, m, ws.modal_of(f.attached[a])->node->accel);
}

/// A* P+ A, A = X (motion of the node) S: joins the blocks of the inboard modes.
template <class T>
static void add_to_mode_blocks(const Pose<T>& X, const ModalNode<T>& node, const double* S, int m, const ArticulatedInertia<T>& P, ArticulatedInertia<T>& P_rr,
                        Modal<T>& inboard) {
  const ArticulatedInertia<T> P_O = to_inboard({X.R, X.p - node.rho}, P);
  P_rr += shift(node.rho, P_O);
  T Q[36], W[36];  // P+ between shapes of the node; between them and the frame of the inboard body
  for (int i = 0; i < 6; ++i) {
    const T one(1), zero(0);
    const Vec3<T> unit{i % 3 == 0 ? one : zero, i % 3 == 1 ? one : zero, i % 3 == 2 ? one : zero}, none{zero, zero, zero};
    Force<T> f = i < 3 ? P_O * Motion<T>{node.Jl * unit, none} : P_O * Motion<T>{none, unit};
    const Vec3<T> n = transpose_times(node.Jl, f.n);
    store(Force<T>{n, f.f}, Q + 6 * i);
    f.n += cross(node.rho, f.f);
    store(f, W + 6 * i);
  }
  for (int j = 0; j < m; ++j) {
    T q[6] = {T(0), T(0), T(0), T(0), T(0), T(0)}, w[6] = {T(0), T(0), T(0), T(0), T(0), T(0)};
    for (int i = 0; i < 6; ++i)
      for (int r = 0; r < 6; ++r) {
        w[r] = w[r] + W[6 * i + r] * T(S[6 * j + i]);
        q[r] = q[r] + Q[6 * i + r] * T(S[6 * j + i]);
      }
    for (int r = 0; r < 6; ++r) inboard.P_re[6 * j + r] = inboard.P_re[6 * j + r] + w[r];
    for (int i = j; i < m; ++i) {
      T sum = inboard.P_ee[m * j + i];
      for (int r = 0; r < 6; ++r) sum = sum + T(S[6 * i + r]) * q[r];
      inboard.P_ee[m * j + i] = sum;
    }
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
    const double* S = modal.node ? model.shapes[static_cast<std::size_t>(b.onode)].columns.data() : nullptr;
    const int m = b.n_modes;
    const std::uint8_t* fixed = b.has_prescribed ? model.prescribed.data() + b.v : nullptr;
    if constexpr (For.inertia) {
      Breakdown bad;
      bad.body = k;
      if (m == 0)
        modal.P_r = body.P;
      else if (modal.by_nodes)
        eliminate_by_nodes(model, ws, b, body, modal);
      else if (!modal.P_ee)
        free_modes(model.flexible[static_cast<std::size_t>(b.flexible)], m, body, modal);
      else if (!eliminate_modes(model, b, body, modal, bad)) {
        ws.breakdown = bad;
        return;
      }
      Force<T> half[NV > 0 ? NV : 1];
      if constexpr (NV > 0)
        if (!factor_hinge<T, NV>(modal.P_r, hinge, fixed, half, bad)) {
          ws.breakdown = bad;
          return;
        }
      if (modal.root) {
        if (fixed)
          take_root<T, NV, true>(modal.P_r, hinge, fixed, ws.X(k), *modal.node, *modal.root);
        else
          take_root<T, NV, false>(modal.P_r, hinge, fixed, ws.X(k), *modal.node, *modal.root);
      } else if (b.parent > 0) {
        ArticulatedInertia<T> P = modal.P_r;
        for (int j = 0; j < NV; ++j) subtract_outer(P, half[j], half[j]);
        if (modal.node)
          add_to_mode_blocks(ws.X(k), *modal.node, S, b.n_parent_modes, P, inboard.P, *ws.modal_of(b.parent));
        else
          inboard.P += to_inboard(ws.X(k), P);
      }
    }
    if constexpr (For.bias) {
      Force<T> z = body.z;
      if (m > 0) {
        eps_of_modes(model, b, in, body, modal);
        z += bias_of_modes(model, ws, b, body, modal);
      }
      const Force<T> z_r = z;
      if constexpr (NV > 0) {
        T eps[NV];
        for (int j = 0; j < NV; ++j) eps[j] = fixed && fixed[j] ? T(0) : (in.tau ? in.tau[b.v + j] : T(0)) - dot(hinge.H[j], z_r);
        for (int j = 0; j < NV; ++j) {
          z += eps[j] * hinge.G[j];
          hinge.nu[j] = eps[j];
        }
        solve_hinge<T, NV>(hinge, hinge.nu);
      }
      if (modal.root) {
        const T* tau = in.tau ? in.tau + b.v : nullptr;
        const Force<T> e = fixed ? take_root_of_force<T, NV, true>(z_r, tau, hinge, fixed, ws.X(k), *modal.root)
                                 : take_root_of_force<T, NV, false>(z_r, tau, hinge, fixed, ws.X(k), *modal.root);
        inboard.z += e;
        store(e, modal.root->e);
        on_node(*modal.node, e, modal.root->e_N);
        continue;
      }
      const Force<T> at_inboard = to_inboard(ws.X(k), z);
      inboard.z += at_inboard;
      if (modal.node) {
        T y[6];
        on_node(*modal.node, at_inboard, y);
        add_to_modes(S, y, b.n_parent_modes, ws.modal_of(b.parent)->z);
      }
    }
  }
}

}  // namespace cardan::soa
