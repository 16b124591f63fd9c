#pragma once
// Velocities nu in which the mass matrix is the identity (Jain & Rodriguez 1995), from v and back, and their rate: what a run in (q, nu)
// asks of a vehicle. docs/mathematics/diagonalised.md, 4.
#include <memory>
#include <vector>

#include "core/dynamics/forward.hpp"
#include "core/soa/tangent.hpp"

namespace cardan {

/// The roots of the articulated sweeps, as they eliminate: the modes of a body, then its hinge. nv numbers throughout, user's order of v.
/// Components with a given motion have no nu: their place holds v. Open trees; allocates nothing once it is made.
class DiagonalVelocities {
 public:
  /// normalised: T = 1/2 nu* nu, nu in the root of J; else nu has the units of v and T = 1/2 nu* D nu, no root is taken.
  DiagonalVelocities(std::shared_ptr<const Model> model, bool normalised);

  /// P, D and G at q, unless they are those of the call before. False: a direction without inertia, breakdown() tells.
  bool at(const double* q);
  /// At the q of at().
  void from_velocity(const double* v, double* nu);
  /// Of nu; components with a given motion as they stand in nu.
  void to_velocity(const double* nu, double* v);
  /// The root of the sum of squares of what the numbers of a body in v make of each nu, the inboard body at rest: of a hinge, of modes.
  void size(const double* v, double* nu);
  /// nu' where q' = qdot and v' = vdot. The derivative of the map along the motion by the sweeps on numbers with a derivative, O(N). False:
  /// as of at().
  bool rate(const double* q, const double* qdot, const double* v, const double* vdot, double* nudot);
  /// The components that have a given motion are those of the model now.
  void look_at_given();

  const soa::Breakdown& breakdown() const { return breakdown_; }
  bool is_given(int v) const { return model_.has_prescribed() && model_.prescribed[static_cast<std::size_t>(v)] != 0; }

 private:
  std::shared_ptr<const Model> original_;
  Model
      model_;  // its modes are eliminated by a factor of P_ee, also those of bodies that the sweeps of a step eliminate through their nodes
  bool normalised_;
  Workspace workspace_;
  soa::Workspace<soa::Tangent> along_;
  std::vector<double> q_, v_;  // of at(), NaN: none; scratch
  std::vector<Motion<double>> V_;
  std::vector<soa::Tangent> q_t_, v_t_, nu_t_;
  std::vector<Motion<soa::Tangent>> V_t_;
  soa::Breakdown breakdown_;
};

}  // namespace cardan
