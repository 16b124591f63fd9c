#pragma once
// Inverse dynamics (Newton-Euler in operator form, mathematics 4.2) and what follows from it.
#include <Eigen/Core>

#include "core/dynamics/forward.hpp"
#include "core/dynamics/part.hpp"

namespace cardan {

/// What enters the forces of inverse dynamics.
struct InverseTerms {
  bool velocity = true;  // bias C(q, v)
  bool gravity = true;
  bool elastic = true;  // K eta + C eta' of the modes
};

/// tau = M v' + C - gravity - elastic - external, nv numbers, with v' = in.vdot (null = 0). Hinge springs are not part of it.
/// Of a part: tau of its bodies alone is written, in.v and in.vdot must be zero for the others. Afterwards the workspace holds
/// gamma with v' inside, and in z the forces that the hinges transmit (of rotors: in that of their carrier).
template <class T>
void inverse_dynamics(const Model& model, soa::Workspace<T>& workspace, const soa::Inputs<T>& in, T* tau, InverseTerms terms = {},
                      const Part* part = nullptr);
/// The same, also of a vehicle with closed loops: of its tree, where loops push with what is in in.wrenches and in the tau that comes out.
template <class T>
void inverse_dynamics_of_tree(const Model& model, soa::Workspace<T>& workspace, const soa::Inputs<T>& in, T* tau, InverseTerms terms = {},
                              const Part* part = nullptr);

/// Mass matrix M = H phi M phi* H*, nv x nv, by the composite body inertia (Lyapunov recursion, 4.3), O(N^2).
Eigen::MatrixXd mass_matrix(const Model& model, Workspace& workspace, const double* q);
/// The same into M (nv x nv, column-major); allocates nothing in trees of rigid bodies.
void mass_matrix(const Model& model, Workspace& workspace, const double* q, double* M);
/// P, D and G at q without velocities, loads and gravity, for solve_mass. False: a direction without inertia (Workspace::breakdown).
template <class T>
bool articulate_at_rest(const Model& model, soa::Workspace<T>& workspace, const T* q);
/// vdot = M^-1 f (nv each) at the q of articulate_at_rest, O(N). Components with a given motion get 0.
void solve_mass(const Model& model, Workspace& workspace, const double* q, const double* f, double* vdot);

/// M^-1 into `inverse` (nv x nv, column-major), O(N^2) from the articulated quantities; M is not formed. Rows and columns of
/// prescribed components are zero. False at a direction without inertia.
bool mass_matrix_inverse(const Model& model, Workspace& workspace, const double* q, double* inverse);

/// Of a tree of rigid bodies, what sweeps that form matrices need of it at q (Sweeps::mass_matrix and beside it), which takes these inputs:
/// at rest, without gravity.
Inputs stand_rigid(const Model& model, Workspace& workspace, const double* q);

/// Generalised gravity force (right-hand side), nv.
Eigen::VectorXd gravity_force(const Model& model, Workspace& workspace, const double* q);
/// Velocity terms C(q, v) (left-hand side), nv.
Eigen::VectorXd bias_force(const Model& model, Workspace& workspace, const double* q, const double* v);
/// -K eta - C eta' in the modal entries, nv.
Eigen::VectorXd elastic_force(const Model& model, const double* q, const double* v);
/// Generalised force of node wrenches (right-hand side), nv.
Eigen::VectorXd external_force(const Model& model, Workspace& workspace, const double* q, std::span<const NodeWrench> wrenches);

}  // namespace cardan
