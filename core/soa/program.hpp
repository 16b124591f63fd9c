#pragma once
// One op of the program that compile() wrote. `again`: q is that of the last evaluation, so P, D and G stay.
#include "core/model/model.hpp"
#include "core/soa/sweeps.hpp"

namespace cardan::soa {

template <class T>
void run_op(const Model& model, const Op& op, const Sweeps<T>& S, Workspace<T>& ws, const Inputs<T>& in, T* vdot, bool again = false) {
  const Run* run = op.run >= 0 ? &model.runs[static_cast<std::size_t>(op.run)] : nullptr;
  switch (op.kernel) {
    case Kernel::hinge_records:
      if (!again || !model.batches.empty()) S.hinge_records(model, ws, in);
      return;
    case Kernel::outward: return S.outward(model, ws, in, *run, {.vdot = run->prescribed, .inertia = !again});
    case Kernel::elastic: return S.elastic(model, ws, in);
    case Kernel::world: return S.world(model, ws, in);
    case Kernel::central_gravity: return S.central_gravity(model, ws, in);
    case Kernel::node_wrenches: return S.node_wrenches(model, ws, in);
    case Kernel::inward: return S.inward(model, ws, in, *run, {.inertia = !again});
    case Kernel::acceleration: return S.acceleration(model, ws, in, *run, vdot);
    case Kernel::refine: return S.refine(model, ws, in, vdot);
  }
}

}  // namespace cardan::soa
