#pragma once
// Forward dynamics of a tree, O(N): v' from (q, v, tau). Articulated bodies in gamma form (Jain & Rodriguez 1992; Jain 2011;
// docs/one_step.md).
#include "core/soa/sweeps.hpp"

namespace cardan {

using Workspace = soa::Workspace<double>;
using Inputs = soa::Inputs<double>;
using NodeWrench = soa::NodeWrench<double>;

/// vdot (nv numbers, user order) from in.q, in.v, in.tau, gravity, wrenches and the prescribed components of in.vdot.
/// Afterwards the workspace holds P, G, nu, gamma_b, delta of this evaluation. Returns false and leaves
/// workspace.breakdown set where a free direction has no inertia. Allocates nothing.
bool forward_dynamics(const Model& model, Workspace& workspace, const Inputs& in, double* vdot);

/// The breakdown in words: body, hinge component, value and limit.
RunFailure describe_breakdown(const Model& model, const soa::Breakdown& breakdown, double t);

}  // namespace cardan
