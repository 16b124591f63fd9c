#pragma once
// Ops of the program that compile() wrote. `again`: q is that of the last evaluation, so P, D and G stay.
#include "core/model/model.hpp"
#include "core/soa/sweeps.hpp"

namespace cardan::soa {

template <class T>
void run_op(const Model& model, const Op& op, const Sweeps<T>& S, Workspace<T>& ws, const Inputs<T>& in, T* vdot, bool again = false) {
  const Run* run = op.run >= 0 ? &model.runs[op.run] : nullptr;
  switch (op.code) {
    case OpCode::hinge_records:
      if (!again || !model.batches.empty()) S.hinge_records(model, ws, in);
      return;
    case OpCode::outward:
      return S.outward(model, ws, in, *run, {.vdot = run->prescribed, .inertia = !again});
    case OpCode::elastic:
      return S.elastic(model, ws, in);
    case OpCode::world:
      return S.world(model, ws, in);
    case OpCode::central_gravity:
      return S.central_gravity(model, ws, in);
    case OpCode::devices:
    case OpCode::keep:
    case OpCode::loops:
    case OpCode::embedding:
    case OpCode::absolute:
      return;  // forward_dynamics
    case OpCode::node_wrenches:
      return S.node_wrenches(model, ws, in);
    case OpCode::inward:
      return S.inward(model, ws, in, *run, {.inertia = !again});
    case OpCode::acceleration:
      return S.acceleration(model, ws, in, *run, vdot);
    case OpCode::refine:
      return S.refine(model, ws, in, vdot);
  }
}

/// Of the program what devices read: poses and velocities.
template <class T>
void run_kinematics(const Model& model, const Sweeps<T>& S, Workspace<T>& ws, const Inputs<T>& in) {
  for (const Op& op : model.program) {
    if (op.code == OpCode::devices) return;
    if (op.code != OpCode::elastic && op.code != OpCode::central_gravity) run_op<T>(model, op, S, ws, in, nullptr);
  }
}

}  // namespace cardan::soa
