#pragma once
// Flexible bodies eliminated through the nodes that their outboard hinges sit on (mathematics/flexible.md, 7): tip to base what an
// outboard body hands over through its hinge, and the body's own elimination; base to tip what the nodes and their hinges do.
// No matrix of the size of the modes is factored.
#include <cmath>
#include <type_traits>

#include "core/soa/columns.hpp"
#include "core/soa/workspace.hpp"

namespace cardan::soa {

/// As kPivotLimit, where a vanishing pivot is allowed: what is left of a 6 x 6 diagonal entry after the rounding of its elimination.
static constexpr double kRootLimit = 2e-15;

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

/// Takes what H_j sees of the columns W out of them: all of it is reflected into column `out`, which becomes zero, or stays with `Keep`.
/// `Lower`: W is lower triangular still, as for the first component. Gives the length that H_j sees.
template <bool Lower, bool Keep = false, class T, class Out>
CARDAN_INLINE T reflect(const Motion<T>& H, const int j, const Out out, T (&W)[6][6], HingeRoot<T>& root) {
  using std::sqrt;
  const T h[6] = {H.v.x, H.v.y, H.v.z, H.w.x, H.w.y, H.w.z};
  T v[6], w[6] = {T(0), T(0), T(0), T(0), T(0), T(0)}, square(0);
  unrolled<6>([&](const auto c) CARDAN_INLINE_BODY {
    if (c < out) return;
    v[c] = T(0);
    unrolled<6, Lower ? c : 0>([&](const auto r) CARDAN_INLINE_BODY { v[c] = v[c] + h[r] * W[c][r]; });
    square = square + v[c] * v[c];
  });
  const T length = (T(2) * above(v[out], T(0)) - T(1)) * sqrt(square);
  v[out] = v[out] + length;
  const T scale = T(1) / (length * v[out]);
  unrolled<6>([&](const auto c) CARDAN_INLINE_BODY {
    if (c >= out) unrolled<6, Lower ? c : 0>([&](const auto r) CARDAN_INLINE_BODY { w[r] = w[r] + v[c] * W[c][r]; });
  });
  unrolled<6>([&](const auto c) CARDAN_INLINE_BODY {
    if (c < out) return;
    root.v[6 * j + c] = v[c];
    if (!Keep && c == out) return;
    const T factor = scale * v[c];
    unrolled<6>([&](const auto r) CARDAN_INLINE_BODY { W[c][r] = W[c][r] - factor * w[r]; });
  });
  if constexpr (!Keep) unrolled<6>([&](const auto r) CARDAN_INLINE_BODY { W[out][r] = T(0); });
  root.scale[j] = scale;
  return (T(2) * above(length, T(0)) - T(1)) * length;
}

/// P_r = L L*, force rows first (the mass, then the moments about the mass centre), directions without inertia left out. W = L.
template <class T>
CARDAN_INLINE void factor_root(const ArticulatedInertia<T>& P, T (&W)[6][6], HingeRoot<T>& root) {
  using std::sqrt;
  T A[6][6];  // upper triangle, rows [force; moment]
  A[0][0] = P.M.xx, A[0][1] = P.M.xy, A[0][2] = P.M.xz, A[0][3] = P.B.xx, A[0][4] = P.B.yx, A[0][5] = P.B.zx;
  A[1][1] = P.M.yy, A[1][2] = P.M.yz, A[1][3] = P.B.xy, A[1][4] = P.B.yy, A[1][5] = P.B.zy;
  A[2][2] = P.M.zz, A[2][3] = P.B.xz, A[2][4] = P.B.yz, A[2][5] = P.B.zz;
  A[3][3] = P.J.xx, A[3][4] = P.J.xy, A[3][5] = P.J.xz, A[4][4] = P.J.yy, A[4][5] = P.J.yz, A[5][5] = P.J.zz;
  const T original[6] = {P.M.xx, P.M.yy, P.M.zz, P.J.xx, P.J.yy, P.J.zz};
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
}

/// The columns W from `First` on, C with P+ = C C*, carried to the node and to the frame of the inboard body.
template <int First, class T>
CARDAN_INLINE void carry_root(const T (&W)[6][6], const Pose<T>& X, const ModalNode<T>& node, NodeRoot<T>& root) {
  const Vec3<T> lever = X.p - node.rho;
  unrolled<6>([&](const auto c) CARDAN_INLINE_BODY {
    const T* a = W[c];
    if (c < First) return;  // taken out: zero from the start
    Force<T> f{X.R * Vec3<T>{a[3], a[4], a[5]}, X.R * Vec3<T>{a[0], a[1], a[2]}};
    f.n += cross(lever, f.f);
    const Vec3<T> n = transpose_times(node.Jl, f.n);
    root.N[c] = n.x, root.N[6 + c] = n.y, root.N[12 + c] = n.z;
    root.N[18 + c] = f.f.x, root.N[24 + c] = f.f.y, root.N[30 + c] = f.f.z;
    f.n += cross(node.rho, f.f);
    store(f, root.C + 6 * c);
  });
}

/// What passes the hinge to the node: the factor of P_r with the hinge reflected out of it. The columns left out are the first NV.
template <class T, int NV>
static void take_root(const ArticulatedInertia<T>& P, const Hinge<T, NV>& hinge, const Pose<T>& X, const ModalNode<T>& node,
                      NodeRoot<T>& root) {
  T W[6][6];
  factor_root(P, W, root);
  unrolled<NV>([&](const auto j) CARDAN_INLINE_BODY { reflect<j == 0>(hinge.H[j], j, j, W, root); });
  carry_root<NV>(W, X, node, root);
}
/// The same for any nv; of its components those that are `fixed`, if any, stay in.
template <class T>
static void take_root(const ArticulatedInertia<T>& P, const Motion<T>* H, int nv, const std::uint8_t* fixed, const Pose<T>& X,
                      const ModalNode<T>& node, NodeRoot<T>& root) {
  T W[6][6];
  factor_root(P, W, root);
  for (int j = 0, out = 0; j < nv; ++j)
    if (!fixed || !fixed[j]) reflect<false>(H[j], j, out++, W, root);
  carry_root<0>(W, X, node, root);
}

/// zeta: what L reaches of a force, hinge included. Gives what it does not reach.
template <class T>
CARDAN_INLINE Force<T> reach_root(const Force<T>& z, const HingeRoot<T>& root, T (&zeta)[6]) {
  T left[6] = {z.f.x, z.f.y, z.f.z, z.n.x, z.n.y, z.n.z};
  unrolled<6>([&](const auto j) CARDAN_INLINE_BODY {
    zeta[j] = left[j] * root.inverse[j];
    unrolled<6, j + 1>([&](const auto i) CARDAN_INLINE_BODY { left[i] = left[i] - root.L[6 * j + i] * zeta[j]; });
    left[j] = left[j] * (T(1) - above(root.inverse[j], T(0)));
  });
  return {{left[3], left[4], left[5]}, {left[0], left[1], left[2]}};
}
/// Reflection j on zeta.
template <bool Keep = false, class T, class Out>
CARDAN_INLINE void reflect(const int j, const Out out, T (&zeta)[6], const HingeRoot<T>& root) {
  const T* v = root.v + 6 * j;
  T sum(0);
  unrolled<6>([&](const auto c) CARDAN_INLINE_BODY {
    if (c >= out) sum = sum + v[c] * zeta[c];
  });
  sum = root.scale[j] * sum;
  unrolled<6>([&](const auto c) CARDAN_INLINE_BODY {
    if (c >= out) zeta[c] = zeta[c] - sum * v[c];
  });
  if constexpr (!Keep) zeta[out] = T(0);
}

/// zeta and e of z+ = C zeta + e, `tau` on the hinge: what L reaches, and the rest with the share of tau. Gives e at the inboard body.
template <class T, int NV>
static Force<T> take_root_of_force(const Force<T>& z, const T* tau, const Hinge<T, NV>& hinge, const Pose<T>& X, NodeRoot<T>& root) {
  T zeta[6];
  const Force<T> unreached = reach_root(z, root, zeta);
  Force<T> e = unreached;
  unrolled<NV>([&](const auto j) CARDAN_INLINE_BODY {
    reflect(j, j, zeta, root);
    e += ((tau ? tau[j] : T(0)) - dot(hinge.H[j], unreached)) * hinge.G[j];
  });
  unrolled<6>([&](const auto j) CARDAN_INLINE_BODY { root.zeta[j] = zeta[j]; });
  return to_inboard(X, e);
}
/// The same for any nv, some of them `fixed`.
template <class T>
static Force<T> take_root_of_force(const Force<T>& z, const T* tau, const Motion<T>* H, const Force<T>* G, int nv,
                                   const std::uint8_t* fixed, const Pose<T>& X, NodeRoot<T>& root) {
  T zeta[6];
  const Force<T> unreached = reach_root(z, root, zeta);
  Force<T> e = unreached;
  for (int j = 0, out = 0; j < nv; ++j) {
    if (fixed && fixed[j]) continue;
    reflect(j, out++, zeta, root);
    e += ((tau ? tau[j] : T(0)) - dot(H[j], unreached)) * G[j];
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
  const SweepBody& outboard = model.bodies[f.attached[0]];
  if (f.attached.size() > 1)
    visit(6 * static_cast<int>(f.attached.size()), std::integral_constant<int, 0>{});
  else if (outboard.nv == 1 && !outboard.has_prescribed)
    visit(six, std::integral_constant<int, 1>{});
  else
    visit(six, std::integral_constant<int, 0>{});
}

/// P_r of a body through its outboard nodes, from that of the body by itself (free_modes). V: the combinations of modes that move the
/// nodes, V* M_ee V = 1, by Q. With C of the outboard bodies side by side, N the same on the shapes of the nodes, B = Q* N, X~* C = C -
/// M_re V B:
///   A = 1 + B* B,   P_r = M_rr - M_re M_ee^-1 M_re* + (X~* C) A^-1 (X~* C)*.
/// A >= 1 whatever the outboard bodies weigh: its factor L D L* needs no pivots, and nothing is subtracted.
template <class T>
static void eliminate_by_nodes(const SweepModel& model, Workspace<T>& ws, const SweepBody& b, Modal<T>& modal) {
  const FlexibleBody& f = model.flexible[b.flexible];
  with_node_count(model, f, [&](const auto N, const auto first) {
    const ByNodes<T> w(modal.by_nodes, N);
    if (!f.M_re_constant)
      for (int r = 0; r < N; ++r) sum_columns(modal.P_re, f.UV.data() + b.n_modes * r, b.n_modes, w.MV + 6 * r);
    for (int a = 0; a < N; a += 6) {
      const NodeRoot<T>& root = *ws.modal_of(f.attached[a / 6])->root;
      for (int d = 0; d <= a; d += 6)  // Q is lower triangular
        unrolled<6>([&](const auto r) CARDAN_INLINE_BODY {
          Six<T> row;
          unrolled<6>([&](const auto i) CARDAN_INLINE_BODY {
            if (d < a || i >= r) row.add(T(f.Q[N * (a + i) + d + r]), Six<T>(root.N + 6 * i));
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
      const T* C = ws.modal_of(f.attached[a / 6])->root->C;
      Six<T> x[6];
      unrolled<6, first>([&](const auto i) CARDAN_INLINE_BODY { x[i] = Six<T>(C + 6 * i); });
      for (int e = 0; e <= a; e += 6)
        unrolled<6>([&](const auto l) CARDAN_INLINE_BODY {
          const Six<T> column(w.MV + 6 * (e + l));
          unrolled<6, first>([&](const auto i) CARDAN_INLINE_BODY { x[i].add(-w.B[N * (e + l) + a + i], column); });
        });
      unrolled<6, first>([&](const auto i) CARDAN_INLINE_BODY { x[i].to(w.XC + 6 * (a + i)); });
    }
    ArticulatedInertia<T> P = modal.P_r;
    for (int a = 0; a < N; a += 6) {  // A = L D L*; in the same steps columns of X~* C L^-*
      T A[6][6];
      Six<T> XC[6];
      unrolled<6, first>([&](const auto j) CARDAN_INLINE_BODY {
        XC[j] = Six<T>(w.XC + 6 * (a + j));
        unrolled<6, j>([&](const auto i) CARDAN_INLINE_BODY { A[j][i] = w.A[N * (a + j) + a + i]; });
      });
      unrolled<6, first>([&](const auto j) CARDAN_INLINE_BODY {
        const T inverse = T(1) / (T(1) + A[j][j]);
        unrolled<6, j + 1>([&](const auto i) CARDAN_INLINE_BODY {
          const T factor = A[j][i] * inverse;
          unrolled<6, i>([&](const auto l) CARDAN_INLINE_BODY { A[i][l] = A[i][l] - factor * A[j][l]; });
          XC[i].add(-factor, XC[j]);
          w.A[N * (a + j) + a + i] = factor;
        });
        w.inverse[a + j] = inverse;
        XC[j].to(w.XC + 6 * (a + j));
        const Force<T> column = force_column(w.XC, a + j);
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
          add_multiple(w.XC + 6 * i, -factor, Six<T>(w.XC + 6 * j));
        }
      for (int j = a; j < a + 6; ++j)
        for (int i = a + 6; i < N; ++i) w.A[N * j + i] = w.A[N * j + i] * w.inverse[j];
    }
    modal.P_r = P;
  });
}

/// t <- V* eps_e - Q* e and u <- L^-1 (zeta + B* t), given `seen` = V* eps_e, from which M_re* gamma is taken here where it is
/// constant. The result joins z_r: (X~* C L^-*) D^-1 u - M_re V Q* e.
template <class T>
static Force<T> bias_by_nodes(const SweepModel& model, const Workspace<T>& ws, const SweepBody& b, const Motion<T>& gamma_b,
                              const Modal<T>& modal, const T* seen) {
  const FlexibleBody& f = model.flexible[b.flexible];
  T gamma[6];
  store(gamma_b, gamma);
  Six<T> out;
  with_node_count(model, f, [&](const auto N, const auto first) {
    const ByNodes<T> w(modal.by_nodes, N);
    for (int d = 0; d < N; d += 6) {
      Six<T> t;  // -Q* e
      for (int a = d; a < N; a += 6) {
        const T* e = ws.modal_of(f.attached[a / 6])->root->e_N;
        unrolled<6>([&](const auto i) CARDAN_INLINE_BODY { t.add(-e[i], Six<T>(f.Q.data() + N * (a + i) + d)); });
      }
      T e[6];
      t.to(e);
      t.to(w.e + d);
      unrolled<6>([&](const auto r) CARDAN_INLINE_BODY {
        const T* c = w.MV + 6 * (d + r);
        out.add(e[r], Six<T>(c));
        T v = seen[d + r];
        if (!modal.P_re) v = v - dot_six(c, gamma);
        w.t[d + r] = e[r] + v;
      });
    }
    for (int d = 0; d < N; d += 6) {
      Six<T> u(ws.modal_of(f.attached[d / 6])->root->zeta);
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
        out.add(w.inverse[d + j] * u[j], Six<T>(w.XC + 6 * (d + j)));
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
static void acceleration_by_nodes(const SweepModel& model, const Workspace<T>& ws, const SweepBody& b, Modal<T>& modal, const T* dl,
                                  T* force) {
  const FlexibleBody& f = model.flexible[b.flexible];
  with_node_count(model, f, [&](const auto N, const auto first) {
    const ByNodes<T> w(modal.by_nodes, N);
    for (int d = N - 6; d >= 0; d -= 6) {
      T u[6];
      unrolled<first>([&](const auto j) CARDAN_INLINE_BODY { u[j] = T(0); });
      unrolled<6, first>([&](const auto j) CARDAN_INLINE_BODY {
        const T* x = w.XC + 6 * (d + j);
        const T seen = dot_six(x, dl);
        u[j] = (w.u[d + j] + seen) * w.inverse[d + j];
        for (int i = d + 6; i < N; ++i) u[j] = u[j] - w.A[N * (d + j) + i] * w.u[i];
      });
      unrolled<6 - first>([&](const auto back) CARDAN_INLINE_BODY {
        constexpr int i = 5 - back;
        unrolled<i, first>([&](const auto j) CARDAN_INLINE_BODY { u[j] = u[j] - w.A[N * (d + j) + d + i] * u[i]; });
      });
      T* phi = ws.modal_of(f.attached[d / 6])->root->phi;
      unrolled<6>([&](const auto j) CARDAN_INLINE_BODY { phi[j] = w.u[d + j] = u[j]; });
    }
    for (int d = 0; d < N; d += 6)
      unrolled<6>([&](const auto r) CARDAN_INLINE_BODY {
        const T *x = w.MV + 6 * (d + r), *B = w.B + N * (d + r);
        T by_phi(0);
        for (int a = d; a < N; a += 6) by_phi = by_phi + dot_six(B + a, w.u + a);
        force[d + r] = w.e[d + r] - by_phi;
        w.t[d + r] = (w.t[d + r] - dot_six(x, dl)) - by_phi;
      });
    for (int a = 0; a < N; a += 6) {
      T* accel = ws.modal_of(f.attached[a / 6])->node->accel;
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

}  // namespace cardan::soa
