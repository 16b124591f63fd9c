#pragma once
// Hinges that ask for the square-root form (HingeFactor; mathematics: tree_algorithms.md, 11). With P = L L* and L* H* = Q T, by
// reflections,
//   D = T* T,   G = L Q T^-*,   P+ = L (1 - Q Q*) L*,   y = T^-* tau - Q* L^-1 z,   nu = T^-1 y,   v' = T^-1 (y - Q* L* delta+):
// D is not formed, so that the error of v' grows as the condition number of L* H* and not as its square. T* stands where the factor of D
// does, and nu, G are what they are elsewhere. The hinge alone; the modes of a flexible body are eliminated before, as ever.
#include "core/soa/kernels_acceleration.hpp"

namespace cardan::soa {

/// L Q of P, the factor T* of D, and the gain, of a hinge with nv columns H. `fixed`, `whole` (or null): as for factor_hinge. Returns false
/// at a direction without inertia.
template <class T>
CARDAN_APART bool factor_square_root(const ArticulatedInertia<T>& P, const ArticulatedInertia<T>* whole, const Motion<T>* H, int nv,
                                     const std::uint8_t* fixed, T* factor, Force<T>* G, SquareRoot<T>& root, Breakdown& bad) {
  T W[6][6];  // columns of L Q, rows of force first
  factor_root(P, W, root);
  const auto column = [&](int c) { return Force<T>{{W[c][3], W[c][4], W[c][5]}, {W[c][0], W[c][1], W[c][2]}}; };
  int out = 0;
  for (int j = 0; j < nv; ++j) {
    T* row = factor + j * (j + 1) / 2;
    if (fixed && fixed[j]) {
      root.along[j] = Force<T>();
      for (int i = 0; i < j; ++i) row[i] = T(0);
      row[j] = T(1);
      continue;
    }
    const auto is_inertia = [&](const T& D, const T& limit) {
      bad.component = j;
      bad.value = static_cast<double>(D), bad.limit = static_cast<double>(limit);
      return D > limit;
    };
    if (whole && !is_inertia(dot(H[j], P * H[j]), T(kRoundingOfModes * kPivotLimit) * inertia_scale(*whole, H[j]))) return false;
    const T length = reflect<false, true>(H[j], j, out, W, root);
    if (!is_inertia(length * length, T(kRootPivotLimit * kRootPivotLimit) * inertia_scale(P, H[j]))) return false;
    for (int i = 0; i < j; ++i) row[i] = dot(H[j], root.along[i]);
    row[j] = length;
    // The reflection sends H_j to minus its first entry; T has a positive diagonal, as the factor of D.
    root.along[j] = (T(1) - T(2) * above(root.v[6 * j + out], T(0))) * column(out);
    ++out;
  }
  for (int c = 0; c < 6; ++c) root.across[c] = c < out ? Force<T>() : column(c);
  gain(factor, root.along, nv, G);
  return true;
}

/// y and nu of such a hinge. What of z passes it: `past` and the rest of zeta, L^-1 z in the columns of L Q, with across zeta + past = z+.
template <class T>
CARDAN_APART Force<T> bias_in_square_root(const Force<T>& z, const T* tau, const Motion<T>* H, int nv, const std::uint8_t* fixed,
                                          const T* factor, T* nu, SquareRoot<T>& root, T (&zeta)[6]) {
  const Force<T> unreached = reach_root(z, root, zeta);  // by L: no force of these directions reaches a body without inertia in them
  T* y = root.y;
  for (int j = 0; j < nv; ++j) y[j] = fixed && fixed[j] ? T(0) : (tau ? tau[j] : T(0)) - dot(H[j], unreached);
  solve_factor(factor, nv, y);
  Force<T> past = unreached;
  for (int j = 0, out = 0; j < nv; ++j) {
    past += y[j] * root.along[j];
    if (fixed && fixed[j]) continue;
    reflect<true>(j, out, zeta, root);
    y[j] = y[j] - (T(1) - T(2) * above(root.v[6 * j + out], T(0))) * zeta[out];
    zeta[out++] = T(0);
  }
  for (int j = 0; j < nv; ++j) nu[j] = y[j];
  solve_factor_star(factor, nv, nu);
  return past;
}

/// P+ to an inboard body that is eliminated through its nodes.
template <class T>
CARDAN_APART void carry_across(const SquareRoot<T>& from, const Pose<T>& X, const ModalNode<T>& node, NodeRoot<T>& root) {
  T W[6][6];
  for (int c = 0; c < 6; ++c) store(Force<T>{from.across[c].f, from.across[c].n}, W[c]);
  carry_root<0>(W, X, node, root);
}

template <class T, int NV>
static bool inertia_through_square_root(const SweepModel& model, Workspace<T>& ws, int k) {
  const SweepBody& b = model.bodies[k];
  Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
  Modal<T>& modal = ws.template modal<NV>(k);
  SquareRoot<T>& root = ws.template square_root<NV>(k);
  Breakdown bad;
  bad.body = k;
  if (!factor_square_root(modal.P_r, b.n_modes > 0 ? &ws.core(k).P : nullptr, hinge.H, NV,
                          b.has_prescribed ? model.prescribed.data() + b.v : nullptr, hinge.L, hinge.G, root, bad)) {
    ws.breakdown = bad;
    return false;
  }
  if (modal.root) {
    carry_across(root, ws.X(k), *modal.node, *modal.root);
  } else if (b.parent > 0) {
    ArticulatedInertia<T> P{};
    for (const Force<T>& column : root.across) subtract_outer(P, T(-1) * column, column);
    add_to_inboard_apart(model, ws, k, modal, P);
  }
  return true;
}

template <class T, int NV>
static void bias_through_square_root(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, int k, const Force<T>& z_r) {
  const SweepBody& b = model.bodies[k];
  Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
  Modal<T>& modal = ws.template modal<NV>(k);
  SquareRoot<T>& root = ws.template square_root<NV>(k);
  T zeta[6];
  Force<T> z = bias_in_square_root(z_r, in.tau ? in.tau + b.v : nullptr, hinge.H, NV,
                                   b.has_prescribed ? model.prescribed.data() + b.v : nullptr, hinge.L, hinge.nu, root, zeta);
  if (modal.root) {
    for (int c = 0; c < 6; ++c) modal.root->zeta[c] = zeta[c];
    return pass_to_node(ws, b, modal, to_inboard(ws.X(k), z));
  }
  for (int c = 0; c < 6; ++c) z += zeta[c] * root.across[c];
  add_to_inboard_apart(model, ws, k, modal, z);
}

template <class T, int NV>
static void inward_square_root(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, InwardFor what, int begin, int end) {
  for (int k = end - 1; k >= begin; --k) {
    Modal<T>& modal = ws.template modal<NV>(k);
    if (what.inertia && (!inertia_without_modes(model, ws, k, modal) || !inertia_through_square_root<T, NV>(model, ws, k))) return;
    if (what.bias) bias_through_square_root<T, NV>(model, ws, in, k, bias_without_modes(model, ws, in, k, modal));
  }
}

template <class T, int NV>
static void acceleration_square_root(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, T* vdot, int begin, int end) {
  for (int k = begin; k < end; ++k) {
    const Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
    Modal<T>& modal = ws.template modal<NV>(k);
    const SquareRoot<T>& root = ws.template square_root<NV>(k);
    acceleration_through_hinge<T, NV>(model, ws, in, vdot, k, [&](const Motion<T>& delta, T* a) CARDAN_INLINE_BODY {
      for (int j = 0; j < NV; ++j) a[j] = root.y[j] - dot(delta, root.along[j]);
      solve_factor_star(hinge.L, NV, a);
    });
    acceleration_with_modes(model, ws, in, vdot, k, modal);
  }
}

}  // namespace cardan::soa
