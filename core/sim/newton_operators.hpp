#pragma once
// What an implicit method asks of x' = f(t, x), x = [q; v; z], of a scenario between two ticks: J dx, J = df/dx, and an
// approximate inverse of 1 - gamma J; both O(N), no matrix formed (mathematics/integration.md, "Newton's equations").
#include <Eigen/LU>
#include <memory>
#include <span>
#include <vector>

#include "core/dynamics/device_tangents.hpp"
#include "core/dynamics/hinge_laws.hpp"
#include "core/operators/apply.hpp"
#include "core/operators/tree_operators.hpp"
#include "core/soa/tangent.hpp"

namespace cardan {

/// User's order of q and v throughout; dx, r, z: nq numbers, then nv, then those of device states.
class NewtonOperators {
 public:
  /// `devices`: null where there are none; has been evaluated where an operator is asked for. Outlives this.
  explicit NewtonOperators(std::shared_ptr<const Model> model, const DeviceForces* devices = nullptr);

  /// J dx by the sweeps on numbers with a derivative; any dx, also off the unit quaternions. in: q, v, tau of actuators
  /// and springs, prescribed v', wrenches at this state; of these only the springs change with it between ticks. Prescribed
  /// v, and the q that are their integrals, are functions of time: f does not depend on those of x. false: a direction without inertia.
  bool jacobian_times(const soa::Inputs<double>& in, const double* dx, double* J_dx);

  /// Articulated inertias with W = gamma C + gamma^2 K of the free components at x. moved: q counts anew; else those of the
  /// last call with another gamma. false: a direction without inertia.
  bool prepare(const double* x, double gamma, bool moved);
  /// z = (1 - gamma J)^-1 r but for velocity terms, what gravity, loads and M change with q, and what is off the
  /// diagonal of full modal K and C in W: exact at rest, relaxed, where these are diagonal.
  void precondition(const double* r, double* z);

 private:
  bool is_free(int v) const { return !model_->has_prescribed() || model_->prescribed[static_cast<std::size_t>(v)] == 0; }
  template <class Visit>
  void each_flexible(const Visit& visit) const;

  std::shared_ptr<const Model> model_;
  double gamma_ = 0.0;
  std::vector<int> given_q_;  // coordinates that are functions of time
  // J dx
  soa::Workspace<soa::Tangent> tangent_;
  std::vector<soa::Tangent> q_t_, v_t_, tau_t_, vdot_given_t_, vdot_t_;
  std::vector<soa::NodeWrench<soa::Tangent>> wrenches_t_;
  std::vector<double> scratch_;
  std::unique_ptr<DeviceTangents> devices_;
  std::vector<soa::Tangent> z_t_;
  // the approximate inverse
  operators::TreeOperators tree_;
  operators::Erased<std::remove_const_t<decltype(operators::letters::mass)>> mass_;
  operators::Erased<std::remove_const_t<decltype(operators::letters::mass_inverse)>> inverse_;  // of mass + W, once there is a W
  std::vector<double> q_;                                                                       // of the last prepare
  std::vector<double> W_;
  std::vector<Eigen::MatrixXd> states_;     // (1 - gamma dz'/dz)^-1, device by device; of those that have states
  std::vector<hinge_laws::Linear> linear_;  // of each hinge load
  std::vector<std::uint8_t> free_;          // empty: all
  Eigen::VectorXd at_, rhs_, dv_;
};

}  // namespace cardan
