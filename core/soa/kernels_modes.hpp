#pragma once
// Modes of a flexible body in the sweeps: their elimination before the hinge (stage 1 of mathematics 4.10), their residual forces,
// their accelerations, and how what hangs on a deforming node joins them.
#include <type_traits>

#include "core/soa/columns.hpp"
#include "core/soa/kernels_by_nodes.hpp"
#include "core/soa/workspace.hpp"

namespace cardan::soa {

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
/// visit(S): the columns of a node that the modes of the inboard body move; constant ones, or those of a curved node.
template <class T, class Visit>
CARDAN_INLINE void with_columns(const NodeShapes& shapes, const ModalNode<T>& node, const Visit& visit) {
  if constexpr (std::is_same_v<T, double>)
    visit(shapes.is_curved() ? node.S() : shapes.columns.data());
  else if (shapes.is_curved())
    visit(node.S());
  else
    visit(shapes.columns.data());
}
/// out_j += [psi_j; phi_j] . y, y from on_node.
template <class E, class T>
static void add_to_modes(const E* S, const T* y, int m, T* out) {
  for (int j = 0; j < m; ++j) {
    T sum(0);
    for (int r = 0; r < 6; ++r) sum = sum + T(S[6 * j + r]) * y[r];
    out[j] = out[j] + sum;
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
  if (modal.C) {                    // P_re' and P_ee' of a body whose pnode deforms: P_ee - C* P_re - P_re'* C
    for (int j = 0; j < m; ++j) {
      const Force<T> old = force_column(modal.P_re, j);
      store(old, U + 6 * j);
      store(old - body.P * motion_column(modal.C, j), modal.P_re + 6 * j);
    }
    for (int j = 0; j < m; ++j)
      for (int i = j; i < m; ++i)
        L[m * j + i] =
            L[m * j + i] - dot(motion_column(modal.C, i), force_column(U, j)) - dot(motion_column(modal.C, j), force_column(modal.P_re, i));
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

/// eps_e = tau_e - z_e + C* z_r, into nu.
template <class T>
static void eps_of_modes(const SweepModel& model, const SweepBody& b, const Inputs<T>& in, const Force<T>& z_r, const Modal<T>& modal) {
  const int m = b.n_modes;
  const T *tau = in.tau ? in.tau + b.etadot : nullptr, *z = modal.z;
  T* __restrict eps = modal.nu;
  if (tau)
    for (int j = 0; j < m; ++j) eps[j] = tau[j] - z[j];
  else
    for (int j = 0; j < m; ++j) eps[j] = -z[j];
  if (modal.C)
    for (int j = 0; j < m; ++j) eps[j] = eps[j] + dot(motion_column(modal.C, j), z_r);
  if (!model.has_prescribed()) return;
  for (int j = 0; j < m; ++j)
    if (model.prescribed[b.etadot + j]) eps[j] = T(0);
}

/// nu from eps_e in it, and what the modes add to z_r.
template <class T>
static Force<T> bias_of_modes(const SweepModel& model, Workspace<T>& ws, const SweepBody& b, const Motion<T>& gamma,
                              const Modal<T>& modal) {
  const FlexibleBody& f = model.flexible[b.flexible];
  const int m = b.n_modes;
  T* x = modal.nu;
  if (!modal.P_ee) {
    const int own = f.M_re_constant ? 6 : 0, rows = own + (modal.by_nodes ? 6 * static_cast<int>(f.attached.size()) : 0);
    T of_body[6];
    T* sums = modal.by_nodes ? ws.sums.data() : of_body;  // U* eps_e, V* eps_e
    sum_columns(f.UV_columns.data(), rows, x, m, sums);
    Force<T> z{};
    if (f.M_re_constant) z = force_column(sums, 0) - cast<T>(f.gramian) * gamma;
    if (modal.by_nodes) z += bias_by_nodes(model, ws, b, gamma, modal, sums + own);
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
static void acceleration_of_modes(const SweepModel& model, Workspace<T>& ws, const SweepBody& b, const Core<T>& body, Modal<T>& modal,
                                  const Motion<T>& dl) {
  const FlexibleBody& f = model.flexible[b.flexible];
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
  for (std::size_t a = 0; f.curved && a < f.attached.size(); ++a) {
    ModalNode<T>& node = *ws.modal_of(f.attached[a])->node;
    sum_columns(node.S(), x, m, node.accel);
  }
  if (f.curved) return;
  const int own = f.constant ? 6 : 0, rows = own + 6 * static_cast<int>(f.attached.size());
  for (std::size_t a = 0; a < f.attached.size(); ++a)
    sum_columns_of<Six<T>>(f.shapes.data() + own + 6 * a, rows, x, m, ws.modal_of(f.attached[a])->node->accel);
}

/// A* P+ A, A = X (motion of the node) S: joins the blocks of the inboard modes.
template <class E, class T>
static void add_to_mode_blocks(const Pose<T>& X, const ModalNode<T>& node, const E* S, int m, const ArticulatedInertia<T>& P,
                               ArticulatedInertia<T>& P_rr, Modal<T>& inboard) {
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

}  // namespace cardan::soa
