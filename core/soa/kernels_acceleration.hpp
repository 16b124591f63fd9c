#pragma once
// Base to tip: v' = nu - G* delta+, delta = delta+ + H* v' (mathematics 4.6, 4.10); and the gather of inverse dynamics.
#include "core/soa/kernels_articulated.hpp"

namespace cardan::soa {

template <class T, int NV>
static void acceleration_rigid(const SweepModel& model, Workspace<T>& ws, const Inputs<T>&, T* vdot, int begin, int end) {
  for (int k = begin; k < end; ++k) {
    const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
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

template <class T, int NV>
static void acceleration_general(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, T* vdot, int begin, int end) {
  for (int k = begin; k < end; ++k) {
    const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
    Core<T>& body = ws.core(k);
    const Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
    Modal<T>& modal = ws.template modal<NV>(k);
    Motion<T> delta = to_outboard(ws.X(k), ws.core(b.parent).delta);
    if (modal.Y) {
      T s[6];
      shapes_times(model.shapes[static_cast<std::size_t>(b.onode)].columns.data(), ws.modal_of(b.parent)->accel, b.n_parent_modes, s);
      delta += times(modal.Y, s);
    }
    Motion<T> after = delta;
    const bool given = model.has_prescribed();
    for (int j = 0; j < NV; ++j) {
      const T a = hinge.nu[j] - dot(delta, hinge.G[j]);  // zero for a prescribed component: its v' is inside gamma_b
      after += a * hinge.H[j];
      vdot[b.v + j] = given && model.prescribed[static_cast<std::size_t>(b.v + j)] ? in.vdot[b.v + j] : a;
    }
    body.delta = after;
    if (modal.compliant) acceleration_by_nodes(model, ws, b, modal, after);
    for (int j = 0; j < b.n_modes; ++j) {
      const T a = modal.compliant ? modal.accel[j] : modal.nu[j] - dot(after, force_column(modal.U, j));
      modal.accel[j] = a;
      if (modal.C) body.delta -= a * motion_column(modal.C, j);
      const auto at = static_cast<std::size_t>(b.etadot + j);
      vdot[at] = given && model.prescribed[at] ? in.vdot[at] : a;
    }
  }
}

/// tau = H phi f with f in z (inverse dynamics): tip to base.
template <class T, int NV>
static void gather_rigid(const SweepModel& model, Workspace<T>& ws, T* tau, int begin, int end) {
  for (int k = end - 1; k >= begin; --k) {
    const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
    const Core<T>& body = ws.core(k);
    const Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
    for (int j = 0; j < NV; ++j) tau[b.v + j] = dot(hinge.H[j], body.z);
    ws.core(b.parent).z += to_inboard(ws.X(k), body.z);
  }
}

template <class T, int NV>
static void gather_general(const SweepModel& model, Workspace<T>& ws, T* tau, int begin, int end) {
  for (int k = end - 1; k >= begin; --k) {
    const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
    const Core<T>& body = ws.core(k);
    const Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
    const Modal<T>& modal = ws.template modal<NV>(k);
    for (int j = 0; j < NV; ++j) tau[b.v + j] = dot(hinge.H[j], body.z);
    for (int j = 0; j < b.n_modes; ++j) {
      T force = modal.z[j];
      if (modal.C) force = force - dot(motion_column(modal.C, j), body.z);
      tau[b.etadot + j] = force;
    }
    ws.core(b.parent).z += to_inboard(ws.X(k), body.z);
    if (modal.Y)
      add_to_modes(modal.Y, model.shapes[static_cast<std::size_t>(b.onode)].columns.data(), body.z, b.n_parent_modes, ws.modal_of(b.parent)->z);
  }
}

}  // namespace cardan::soa
