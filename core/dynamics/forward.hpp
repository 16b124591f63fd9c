#pragma once
// Forward dynamics of a tree, O(N): v' from (q, v, tau). Articulated bodies in gamma form (Jain & Rodriguez 1992; Jain 2011;
// docs/one_step.md).
#include "core/dynamics/workspace.hpp"

namespace cardan {

/// What acts on a system as its motion has it. Called by the op `devices`, once poses and velocities of bodies are there: it writes the
/// wrenches and forces that the inputs show. false: it cannot be evaluated here.
template <class T>
struct StateLoads {
  virtual ~StateLoads() = default;
  virtual bool act(soa::Workspace<T>& workspace, const soa::Inputs<T>& in) = 0;
  /// Once v' is known: what hangs on it and changes it in nothing.
  virtual bool follow(const soa::Workspace<T>& workspace, const soa::Inputs<T>& in, const T* vdot) = 0;
};

/// vdot (nv numbers, user order) from in.q, in.v, in.tau, gravity, wrenches and the prescribed components of in.vdot.
/// Afterwards the workspace holds P, G, nu, gamma_b, delta of this evaluation. Returns false and leaves
/// workspace.breakdown set where a free direction has no inertia. Allocates nothing.
/// In trees of rigid bodies P, D and G are reused, to the same bits, when q is that of the call before.
/// `loads`: the devices of the model; null: without them.
/// T: double, or Lanes<2>, Lanes<4>, Lanes<8> for as many states at once (batch.hpp).
template <class T>
bool forward_dynamics(const Model& model, soa::Workspace<T>& workspace, const soa::Inputs<T>& in, T* vdot, StateLoads<T>* loads = nullptr);

/// The breakdown in words: body, hinge component, value and limit.
RunFailure describe_breakdown(const Model& model, const soa::Breakdown& breakdown, double t);

}  // namespace cardan
