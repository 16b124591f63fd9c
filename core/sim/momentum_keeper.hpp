#pragma once
// The momentum of a free vehicle on which nothing acts from outside, put right after each step: what the error of a step made of it turns
// and moves the vehicle as one body (docs/mathematics/exponential.md, 1.1).
#include <vector>

#include "core/dynamics/observe.hpp"

namespace cardan {

class MomentumKeeper {
 public:
  /// A tree whose one root floats freely: nothing of its hinge has a given motion.
  static bool honours(const Model& model);
  explicit MomentumKeeper(const Model& model);

  /// The momentum of (q, v) is to be kept from now on; of a state that keep() gave, that which it kept.
  void aim(const double* q, const double* v);
  /// Changes the velocity of the root, and the rates of wheels so that they turn as before in inertial space. inside: of a step, from which
  /// no other goes on.
  void keep(const double* q, double* v, bool inside = false);

 private:
  void look(const double* q, const double* v);

  const Model& model_;
  const UserBody& root_;
  Workspace workspace_;
  Observer observer_;
  Eigen::Vector3d linear_, angular_;  // wanted; about the world's origin
  std::vector<double> kept_;          // q and v that keep() gave
};

}  // namespace cardan
