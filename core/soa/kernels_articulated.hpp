#pragma once
// Tip to base: the articulated body inertia P (Riccati), D = H P H*, the gain G = P H* D^-1, and in the same pass the
// residual z, eps = tau - H z and nu = D^-1 eps (mathematics 4.4, 4.6). Flexible bodies in two stages, modes (kernels_modes.hpp),
// then hinge (4.10). P is symmetric by type; P+ = P - G D G* is formed from the Cholesky factor of D.
#include <cmath>

#include "core/soa/kernels_modes.hpp"
#include "core/soa/workspace.hpp"

namespace cardan::soa {

/// G = half L^-1 with the packed factor D = L L*, half = P H* L^-*.
template <class T>
CARDAN_INLINE void gain(const T* L, const Force<T>* half, int nv, Force<T>* G) {
  for (int j = nv - 1; j >= 0; --j) {
    Force<T> g = half[j];
    for (int l = j + 1; l < nv; ++l) g -= L[l * (l + 1) / 2 + j] * G[l];
    G[j] = (T(1) / L[j * (j + 1) / 2 + j]) * g;
  }
}

/// x <- L^-1 x with that factor, and x <- L^-* x.
template <class T>
CARDAN_INLINE void solve_factor(const T* L, int nv, T* x) {
  for (int j = 0; j < nv; ++j) {
    const T* Lj = L + j * (j + 1) / 2;
    for (int l = 0; l < j; ++l) x[j] = x[j] - Lj[l] * x[l];
    x[j] = x[j] / Lj[j];
  }
}
template <class T>
CARDAN_INLINE void solve_factor_star(const T* L, int nv, T* x) {
  for (int j = nv - 1; j >= 0; --j) {
    for (int l = j + 1; l < nv; ++l) x[j] = x[j] - L[l * (l + 1) / 2 + j] * x[l];
    x[j] = x[j] / L[j * (j + 1) / 2 + j];
  }
}

/// Inertia that a component of a hinge moves, its other components and cancellations left out: what round-off of D is measured by.
template <class T>
CARDAN_INLINE T inertia_scale(const ArticulatedInertia<T>& P, const Motion<T>& H) {
  return (P.J.xx + P.J.yy + P.J.zz) * dot(H.w, H.w) + (P.M.xx + P.M.yy + P.M.zz) * dot(H.v, H.v);
}

/// Cholesky factor of D = H P H* and the gain, for NV columns. `fixed[j]`: component j follows a prescribed motion and takes
/// no part. `whole`: where modes were eliminated, the inertia before. Returns false at a direction without inertia.
template <class T, int NV>
static bool factor_hinge(const ArticulatedInertia<T>& P, Hinge<T, NV>& hinge, const std::uint8_t* fixed, Force<T>* half, Breakdown& bad,
                         const ArticulatedInertia<T>* whole = nullptr) {
  using std::sqrt;
  Force<T> PH[NV];
  T D[NV * (NV + 1) / 2];
  T scale[NV];
  for (int j = 0; j < NV; ++j) {
    PH[j] = P * hinge.H[j];
    scale[j] = inertia_scale(whole ? *whole : P, hinge.H[j]);
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
    if (!is_fixed && !(pivot > T(kSmallPivot) * scale[j])) {
      const T limit =
          T(whole ? kRoundingOfModes : 1.0) * rounding_of_pivot([&](int l, int i) { return hinge.L[l * (l + 1) / 2 + i]; }, scale, j);
      if (!(pivot > limit)) {
        bad.component = j;
        bad.value = static_cast<double>(pivot);
        bad.limit = static_cast<double>(limit);
        return false;
      }
    }
    Lj[j] = sqrt(pivot);
    Force<T> c = PH[j];
    for (int l = 0; l < j; ++l) c -= Lj[l] * half[l];
    half[j] = (T(1) / Lj[j]) * c;
  }
  gain(hinge.L, half, NV, hinge.G);
  return true;
}

/// nu = D^-1 eps with the factor of factor_hinge.
template <class T, int NV>
static void solve_hinge(const Hinge<T, NV>& hinge, T* x) {
  solve_factor(hinge.L, NV, x);
  solve_factor_star(hinge.L, NV, x);
}

template <class T, int NV, InwardFor For>
static void inward_rigid(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, int begin, int end) {
  for (int k = end - 1; k >= begin; --k) {
    const SweepBody& b = model.bodies[k];
    Core<T>& body = ws.core(k);
    Core<T>& inboard = ws.core(b.parent);
    Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
    if constexpr (For.inertia) {
      ArticulatedInertia<T> P = body.P;
      if constexpr (NV == 1) {  // one column: D is a number, the innermost case
        const Force<T> PH = body.P * hinge.H[0];
        const T D = dot(hinge.H[0], PH);
        const T scale = inertia_scale(P, hinge.H[0]);
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
      Force<T> z = ws.z(k);
      if constexpr (NV > 0) {
        T eps[NV];
        for (int j = 0; j < NV; ++j) {
          eps[j] = (in.tau ? in.tau[b.v + j] : T(0)) - dot(hinge.H[j], ws.z(k));
          z += eps[j] * hinge.G[j];
          hinge.nu[j] = eps[j];
        }
        if constexpr (NV == 1)
          hinge.nu[0] = eps[0] / hinge.L[0];
        else
          solve_hinge<T, NV>(hinge, hinge.nu);
      }
      ws.z(b.parent) += to_inboard(ws.X(k), z);
    }
  }
}

/// P_r of a flexible body, one on a deforming node or one with given motions: its modes are eliminated. False: one without inertia.
template <class T>
static bool inertia_without_modes(const SweepModel& model, Workspace<T>& ws, int k, Modal<T>& modal) {
  const SweepBody& b = model.bodies[k];
  Core<T>& body = ws.core(k);
  const int m = b.n_modes;
  Breakdown bad;
  bad.body = k;
  if (m == 0)
    modal.P_r = body.P;
  else if (!modal.P_ee) {
    free_modes(model.flexible[b.flexible], m, body, modal);
    if (modal.by_nodes) eliminate_by_nodes(model, ws, b, modal);
  } else if (!eliminate_modes(model, b, body, modal, bad)) {
    ws.breakdown = bad;
    return false;
  }
  return true;
}

/// P+, what of P passes the hinge, on to the inboard body: where that deforms, to its modes too.
template <class T>
CARDAN_INLINE void add_to_inboard(const SweepModel& model, Workspace<T>& ws, int k, const Modal<T>& modal, const ArticulatedInertia<T>& P) {
  const SweepBody& b = model.bodies[k];
  Core<T>& inboard = ws.core(b.parent);
  if (modal.node)
    with_columns(model.shapes[b.onode], *modal.node, [&](const auto* S) {
      add_to_mode_blocks(ws.X(k), *modal.node, S, b.n_parent_modes, P, inboard.P, *ws.modal_of(b.parent));
    });
  else
    inboard.P += to_inboard(ws.X(k), P);
}

/// z+, what of z passes the hinge, likewise.
template <class T>
CARDAN_INLINE void add_to_inboard(const SweepModel& model, Workspace<T>& ws, int k, const Modal<T>& modal, const Force<T>& z) {
  const SweepBody& b = model.bodies[k];
  const Force<T> at_inboard = to_inboard(ws.X(k), z);
  ws.z(b.parent) += at_inboard;
  if (!modal.node) return;
  T y[6];
  on_node(*modal.node, at_inboard, y);
  with_columns(model.shapes[b.onode], *modal.node, [&](const auto* S) { add_to_modes(S, y, b.n_parent_modes, ws.modal_of(b.parent)->z); });
}

template <class T, class Passed>
CARDAN_APART void add_to_inboard_apart(const SweepModel& model, Workspace<T>& ws, int k, const Modal<T>& modal, const Passed& passed) {
  add_to_inboard(model, ws, k, modal, passed);
}

/// D, G of such a body, and what passes its hinge. False: a direction without inertia.
template <class T, int NV>
static bool inertia_through_hinge(const SweepModel& model, Workspace<T>& ws, int k) {
  const SweepBody& b = model.bodies[k];
  Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
  Modal<T>& modal = ws.template modal<NV>(k);
  const std::uint8_t* fixed = b.has_prescribed ? model.prescribed.data() + b.v : nullptr;
  Breakdown bad;
  bad.body = k;
  Force<T> half[NV > 0 ? NV : 1];
  if constexpr (NV > 0)
    if (!factor_hinge<T, NV>(modal.P_r, hinge, fixed, half, bad, b.n_modes > 0 ? &ws.core(k).P : nullptr)) {
      ws.breakdown = bad;
      return false;
    }
  if (modal.root) {
    if (fixed || !kOften<NV>)
      take_root(modal.P_r, hinge.H, NV, fixed, ws.X(k), *modal.node, *modal.root);
    else if constexpr (kOften<NV>)
      take_root(modal.P_r, hinge, ws.X(k), *modal.node, *modal.root);
  } else if (b.parent > 0) {
    ArticulatedInertia<T> P = modal.P_r;
    for (int j = 0; j < NV; ++j) subtract_outer(P, half[j], half[j]);
    if constexpr (kOften<NV>)
      add_to_inboard(model, ws, k, modal, P);
    else
      add_to_inboard_apart(model, ws, k, modal, P);
  }
  return true;
}

/// z_r of the same: its modes are eliminated.
template <class T>
static Force<T> bias_without_modes(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, int k, Modal<T>& modal) {
  const SweepBody& b = model.bodies[k];
  Force<T> z = ws.z(k);
  if (b.n_modes > 0) {
    eps_of_modes(model, b, in, z, modal);
    z += bias_of_modes(model, ws, b, ws.core(k).gamma, modal);
  }
  return z;
}

/// Of z+ = C zeta + e at the inboard body, which is eliminated through its nodes, e.
template <class T>
CARDAN_INLINE void pass_to_node(Workspace<T>& ws, const SweepBody& b, const Modal<T>& modal, const Force<T>& e) {
  ws.z(b.parent) += e;
  store(e, modal.root->e);
  on_node(*modal.node, e, modal.root->e_N);
}

/// eps, nu of the same, and the force that passes its hinge.
template <class T, int NV>
static void bias_through_hinge(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, int k, const Force<T>& z_r) {
  const SweepBody& b = model.bodies[k];
  Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
  Modal<T>& modal = ws.template modal<NV>(k);
  const std::uint8_t* fixed = b.has_prescribed ? model.prescribed.data() + b.v : nullptr;
  Force<T> z = z_r;
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
    Force<T> e;
    if (fixed || !kOften<NV>)
      e = take_root_of_force(z_r, tau, hinge.H, hinge.G, NV, fixed, ws.X(k), *modal.root);
    else if constexpr (kOften<NV>)
      e = take_root_of_force(z_r, tau, hinge, ws.X(k), *modal.root);
    pass_to_node(ws, b, modal, e);
    return;
  }
  if constexpr (kOften<NV>)
    add_to_inboard(model, ws, k, modal, z);
  else
    add_to_inboard_apart(model, ws, k, modal, z);
}

template <class T, int NV>
static void inward_general(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, InwardFor what, int begin, int end) {
  for (int k = end - 1; k >= begin; --k) {
    Modal<T>& modal = ws.template modal<NV>(k);
    if (what.inertia && (!inertia_without_modes(model, ws, k, modal) || !inertia_through_hinge<T, NV>(model, ws, k))) return;
    if (what.bias) bias_through_hinge<T, NV>(model, ws, in, k, bias_without_modes(model, ws, in, k, modal));
  }
}

}  // namespace cardan::soa
