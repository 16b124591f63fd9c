#pragma once
// Diagonalised velocities (Jain & Rodriguez 1995; mathematics/diagonalised.md): coordinates of velocity in which the mass matrix is the
// identity at every q. M = L L* with L = (1 + H phi K) S, D = S S* (lower Cholesky, hinge then modes of each body), and
//
//   nu = L* v,   eps = L^-1 tau,   nu' + C(q, nu) = eps,   T = 1/2 nu* nu,   nu* C = 0.
#include "core/dynamics/inverse.hpp"
#include "core/operators/tree_operators.hpp"

namespace cardan::operators {

/// Rates of P, P+, D, G, S of each body along a direction, from the derivatives of H, Phi, M along it (TreeOperators::derivatives): the
/// Riccati recursion differentiated, O(N). Index: TreeOperators::bodies().
struct RiccatiRates {
  std::vector<Eigen::MatrixXd> P, P_plus, D, G, S;
};
void riccati_rates(const TreeOperators& tree, const PositionBlocks& direction, RiccatiRates& rates);

/// Vectors are of the hinge space; entries of given (prescribed) components are zero in nu, eps, C. O(N) each. The tree, a whole one or a
/// subgraph, must outlive this; at() and articulate() of it move this along. T = 1/2 nu* nu and nu* C = 0 where no component is given a
/// velocity.
class Diagonalised {
 public:
  enum class Form : std::uint8_t {
    normalised,  ///< as above
    rates  ///< nu = (1 + H phi K)* v, no square roots, units of v: T = 1/2 nu* D nu, D nu' + C = eps = (1 - H psi K) tau, nu* C = 1/2 nu*
           ///< D' nu
  };
  explicit Diagonalised(const TreeOperators& tree, Form form = Form::normalised);

  Eigen::VectorXd from_velocity(const Eigen::VectorXd& v) const;
  /// v of nu; `v` holds the given components beforehand and all of them afterwards.
  void to_velocity(const Eigen::VectorXd& nu, Eigen::VectorXd& v) const;
  Eigen::VectorXd eps(const Eigen::VectorXd& tau) const;
  /// C at q of the tree: velocity terms alone; given components move uniformly.
  Eigen::VectorXd coriolis(const Eigen::VectorXd& v);
  /// nu' of the whole right-hand side: in.tau, gravity, elastic forces, wrenches, v' of given components in in.vdot; nv numbers of the
  /// model each, of which those of bodies that take part are read. q is that of the tree. Springs of hinges are part of in.tau, as in
  /// forward dynamics.
  Eigen::VectorXd rate(const Inputs& in);

 private:
  Eigen::VectorXd drift(const Eigen::VectorXd& v, const double* given_vdot);
  void clear_given(int i, Eigen::VectorXd& x) const;
  const TreeOperators& tree_;
  bool normalised_;
  Workspace ws_;
  PositionBlocks direction_;  // kept for their memory
  RiccatiRates rates_;
};

}  // namespace cardan::operators
