#pragma once
// What velocities of dependent components must add to v where q moves along closed loops and independent ones stand: of
// v = X v_I, X' v_I = -G_D^-1 G' v (docs/mathematics/linear.md, 2).
#include <span>
#include <vector>

#include "core/dynamics/loop_tangent.hpp"

namespace cardan::operators {

class FollowingRates {
 public:
  /// v in the order of the model; it keeps the loops closed, with lengths that stand. `open`: the vehicle without its loops.
  FollowingRates(const Model& closed, const Model& open, const double* q, const Eigen::VectorXd& v, std::span<const LoopDrive> drives);
  /// X' v_I where q moves by N(q) u; nv, independent components zero.
  Eigen::VectorXd along(const Eigen::VectorXd& u);
  /// G' v, per row: for dependent components of one's own.
  Eigen::VectorXd rows_along(const Eigen::VectorXd& u);

 private:
  void move(const Eigen::VectorXd& u);
  LoopTangents at(const Model& closed, const Eigen::VectorXd& v);

  const Model& open_;
  soa::Workspace<soa::Tangent> ws_;
  std::vector<double> q_;
  std::vector<LoopDrive> held_;
  LoopTangents loops_;
  std::vector<soa::Tangent> qt_, vt_;
  std::vector<double> rate_;
};

}  // namespace cardan::operators
