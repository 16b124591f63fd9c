#pragma once
// Closed loops along a direction (docs/mathematics/linear.md, 2): the derivatives of their rows, of the wrenches of their multipliers and
// of c'', on Tangent numbers over the open tree, and the multipliers that the direction brings.
#include "core/dynamics/loop_pass.hpp"
#include "core/soa/tangent.hpp"

namespace cardan {

class LoopTangents {
 public:
  /// At a point: the closed system moves with v' of these inputs; `in.tau` has the forces of hinge loads too. NumericsError where it
  /// cannot.
  LoopTangents(const Model& closed, const Inputs& in, double t);

  const LoopFreedom& freedom() const { return freedom_; }

  /// Poses and rates of the ends, with their derivatives. Needs outward of `ws`, a workspace of the open tree.
  void place(const soa::Workspace<soa::Tangent>& ws, const soa::Inputs<soa::Tangent>& in);
  /// The rates of dependent components that keep c' = 0 where q moves along the direction of place() and v stands; nv, others zero.
  Eigen::VectorXd rates() const;
  /// G' v there, per row.
  Eigen::VectorXd row_rates() const;
  /// The multipliers at the point, with derivatives as they are known: wrenches on nodes, appended, and forces of couplings, added to tau.
  void push(std::vector<soa::NodeWrench<soa::Tangent>>& wrenches, soa::Tangent* tau) const;
  /// Sets the derivatives of the multipliers to nothing.
  void forget() { dlambda_.setZero(); }
  /// Sets them to what takes the derivative of c'' away that v' has without. Needs forward dynamics of `ws` with push() after forget().
  void solve(const soa::Workspace<soa::Tangent>& ws, const soa::Inputs<soa::Tangent>& in, const soa::Tangent* vdot);

 private:
  /// What a hinge that closes does at the point, and along the direction of place(): per loop, empty without one.
  struct HingeTangent {
    Eigen::Matrix<double, 6, Eigen::Dynamic> H, dH;  // axes of `from`
    Eigen::VectorXd v, vdot;                         // at the point
    Eigen::Matrix<double, 6, 1> bias, dbias;         // Hdot* v with w x u
  };
  void move_hinge(std::size_t loop);

  const Model& m_;
  Workspace ws_;
  Eigen::VectorXd q_, v_, vdot_, lambda_, dlambda_;
  LoopFreedom freedom_;
  /// Of a coupling: its slopes along the direction of place(), which of c'' at fixed v' changes with them. Per loop, per term.
  struct CouplingTangent {
    std::vector<double> dq, dv, slope;
    double extra = 0.0;
  };
  void move_coupling(std::size_t loop, const soa::Inputs<soa::Tangent>& in);
  double slope_of(std::size_t loop, std::size_t term) const { return couplings_[loop].slope.empty() ? 0.0 : couplings_[loop].slope[term]; }

  std::vector<LoopEndMotion<soa::Tangent>> from_, to_;
  std::vector<LoopPlace<soa::Tangent>> place_;
  std::vector<HingeTangent> hinges_;
  std::vector<CouplingTangent> couplings_;
};

}  // namespace cardan
