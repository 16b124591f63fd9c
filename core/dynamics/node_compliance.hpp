#pragma once
// What wrenches on nodes do to the motion of nodes of a tree of rigid bodies, by the sweeps of a step: the operational space of
// core/operators/operational_space.hpp without blocks of operators, of whole trees in which every component is free.
#include <Eigen/Core>
#include <memory>
#include <span>

#include "core/dynamics/workspace.hpp"

namespace cardan {

/// Scratch of one thread.
class NodeCompliance {
 public:
  /// An open tree of rigid bodies without given motions, in which v' needs no refinement.
  static bool takes(const Model& model);
  /// InputError C0401: it does not take the model.
  explicit NodeCompliance(std::shared_ptr<const Model> model);
  ~NodeCompliance();
  NodeCompliance(NodeCompliance&&) noexcept;

  /// Lambda^-1 = J M^-1 J* of s nodes (indices into Model::nodes, any, repeated ones too) at q, 6s x 6s, symmetric: [rad/s^2; m/s^2] per
  /// [N m; N], node axes. O(n + s d + s^2), d bodies between a node and the base. NumericsError at a direction without inertia.
  /// Both allocate nothing from the second call with as many nodes on.
  void compliance(const double* q, std::span<const int> nodes, Eigen::MatrixXd& C);
  /// Lambda. NumericsError N0401 where the nodes cannot move in all 6s ways: use OperationalSpace, which says in how many.
  void inertia(const double* q, std::span<const int> nodes, Eigen::MatrixXd& Lambda);

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

}  // namespace cardan
