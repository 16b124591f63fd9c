#pragma once
// Base to tip: v' = nu - G* delta+, delta = delta+ + H* v' (mathematics 4.6, 4.10); and the gather of inverse dynamics.
#include "core/soa/kernels_articulated.hpp"

namespace cardan::soa {

template <class T, int NV>
static void acceleration_rigid(const SweepModel& model, Workspace<T>& ws, const Inputs<T>&, T* vdot, int begin, int end) {
  for (int k = begin; k < end; ++k) {
    const SweepBody& b = model.bodies[k];
    Core<T>& body = ws.core(k);
    const Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
    const Motion<T> delta = to_outboard(ws.X(k), ws.core(b.parent).delta);
    body.delta = delta;
    for (int j = 0; j < NV; ++j) {
      const T a = hinge.nu[j] - dot(delta, hinge.G[j]);
      vdot[b.v + j] = a;
      body.delta += a * hinge.H[j];
    }
  }
}

/// v' of the hinge of a flexible body, one on a deforming node or one with given motions; delta as if its modes stood still.
/// solve(delta+, a): v' of its components, zero of a prescribed one, whose v' is inside gamma_b.
template <class T, int NV, class Solve>
CARDAN_INLINE void acceleration_through_hinge(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, T* vdot, int k,
                                              const Solve& solve) {
  const SweepBody& b = model.bodies[k];
  const Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
  const Modal<T>& modal = ws.template modal<NV>(k);
  Motion<T> at_inboard = ws.core(b.parent).delta;
  if (modal.node) at_inboard += motion_of_node(*modal.node, modal.node->accel);
  const Motion<T> delta = to_outboard(ws.X(k), at_inboard);
  Motion<T> after = delta;
  const bool given = model.has_prescribed();
  T a[NV > 0 ? NV : 1];
  solve(delta, a);
  for (int j = 0; j < NV; ++j) {
    after += a[j] * hinge.H[j];
    vdot[b.v + j] = given && model.prescribed[b.v + j] ? in.vdot[b.v + j] : a[j];
  }
  ws.core(k).delta = after;
}
template <class T, int NV>
static void acceleration_through_hinge(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, T* vdot, int k) {
  const Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
  acceleration_through_hinge<T, NV>(model, ws, in, vdot, k, [&](const Motion<T>& delta, T* a) CARDAN_INLINE_BODY {
    for (int j = 0; j < NV; ++j) a[j] = hinge.nu[j] - dot(delta, hinge.G[j]);
  });
}

/// v' of its modes, and delta with them.
template <class T>
static void acceleration_with_modes(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, T* vdot, int k, Modal<T>& modal) {
  const SweepBody& b = model.bodies[k];
  if (b.n_modes == 0) return;
  Core<T>& body = ws.core(k);
  const bool given = model.has_prescribed();
  const Motion<T> after = body.delta;
  acceleration_of_modes(model, ws, b, body, modal, after);
  for (int j = 0; j < b.n_modes; ++j) vdot[b.etadot + j] = modal.accel[j];
  for (int j = 0; given && j < b.n_modes; ++j)
    if (model.prescribed[b.etadot + j]) vdot[b.etadot + j] = in.vdot[b.etadot + j];
  if (modal.C) {
    T moved[6];
    sum_columns(modal.C, modal.accel, b.n_modes, moved);
    body.delta -= motion_column(moved, 0);
  }
}

template <class T, int NV>
static void acceleration_general(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, T* vdot, int begin, int end) {
  for (int k = begin; k < end; ++k) {
    acceleration_through_hinge<T, NV>(model, ws, in, vdot, k);
    acceleration_with_modes(model, ws, in, vdot, k, ws.template modal<NV>(k));
  }
}

/// tau = H phi f with f in z (inverse dynamics): tip to base.
template <class T, int NV>
static void gather_rigid(const SweepModel& model, Workspace<T>& ws, T* tau, int begin, int end) {
  for (int k = end - 1; k >= begin; --k) {
    const SweepBody& b = model.bodies[k];
    const Force<T>& z = ws.z(k);
    const Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
    for (int j = 0; j < NV; ++j) tau[b.v + j] = dot(hinge.H[j], z);
    ws.z(b.parent) += to_inboard(ws.X(k), z);
  }
}

/// The same of the modes of body k.
template <class T>
CARDAN_INLINE void gather_modes(const SweepModel& model, Workspace<T>& ws, T* tau, int k) {
  const SweepBody& b = model.bodies[k];
  const Force<T>& z = ws.z(k);
  const Modal<T>& modal = *ws.modal_of(k);
  if (!modal.P_re) {
    T gamma[6];
    store(ws.core(k).gamma, gamma);
    add_rows(model.flexible[b.flexible].M_re_rows.data(), gamma, b.n_modes, modal.z, modal.z);
  }
  for (int j = 0; j < b.n_modes; ++j) {
    T force = modal.z[j];
    if (modal.C) force = force - dot(motion_column(modal.C, j), z);
    tau[b.etadot + j] = force;
  }
}

template <class T>
CARDAN_APART void gather_modes_apart(const SweepModel& model, Workspace<T>& ws, T* tau, int k) {
  if (model.bodies[k].n_modes > 0) gather_modes(model, ws, tau, k);
  add_to_inboard(model, ws, k, *ws.modal_of(k), ws.z(k));
}

template <class T, int NV>
static void gather_general(const SweepModel& model, Workspace<T>& ws, T* tau, int begin, int end) {
  for (int k = end - 1; k >= begin; --k) {
    const SweepBody& b = model.bodies[k];
    const Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
    for (int j = 0; j < NV; ++j) tau[b.v + j] = dot(hinge.H[j], ws.z(k));
    if constexpr (kOften<NV>) {
      if (b.n_modes > 0) gather_modes(model, ws, tau, k);
      add_to_inboard(model, ws, k, ws.template modal<NV>(k), ws.z(k));
    } else {
      gather_modes_apart(model, ws, tau, k);
    }
  }
}

}  // namespace cardan::soa
