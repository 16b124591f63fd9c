#pragma once
// A column of a linear model: the derivative of v' and of the outputs along one direction.
#include <optional>

#include "core/dynamics/device_tangents.hpp"
#include "core/operators/linear_ports.hpp"
#include "core/operators/operating_point.hpp"
#include "core/soa/tangent.hpp"

namespace cardan::operators::linear {

using soa::Tangent;

/// v' and outputs on Tangent numbers; the direction is set in q, v, u and z, then run() gives the column.
class Column {
 public:
  Column(const Scope& scope, const OperatingPoint& at, const PortList& inputs, const PortList& outputs);
  std::vector<Tangent> q, v, vdot, u, z;

  /// The v' of the point, and its derivative along the direction that is set, as they are known; null: run() finds both.
  void take(const Eigen::VectorXd* vdot0, const double* dvdot) { vdot0_ = vdot0, dvdot_ = dvdot; }
  /// v moves so that loops stay closed where q moves along its direction and the independent rates stand.
  void keep_loops_closed();
  /// vdot and y, values and derivatives. NumericsError at a direction without inertia, or where a device has no derivative.
  void run(Tangent* y);
  /// [dz'] of devices.
  const double* zdot() const { return devices_->zdot(); }

 private:
  soa::Workspace<Tangent>& ws();
  StateLoads<Tangent>* with_devices();
  void push(const soa::Inputs<Tangent>& in);
  void follow(soa::Inputs<Tangent>& in);
  void move(const soa::Inputs<Tangent>& in);
  void place_loops(const soa::Inputs<Tangent>& in);
  void close(soa::Inputs<Tangent>& in);
  void solve(soa::Inputs<Tangent>& in);
  void look(const soa::Inputs<Tangent>& in, Tangent* y);

  const Scope& scope_;
  const Model& m_;
  const OperatingPoint& at_;
  const PortList &inputs_, &outputs_;
  std::optional<soa::Workspace<Tangent>> sweeping_;
  std::vector<Tangent> tau_, given_, back_;
  Eigen::VectorXd residual_, solved_;
  std::vector<soa::NodeWrench<Tangent>> wrenches_;
  std::optional<DeviceTangents> devices_;
  std::optional<soa::Workspace<Tangent>> moving_;  // poses and inertias as they are before the inward sweep
  bool looks_ = false, solved_once_ = false;
  const Eigen::VectorXd* vdot0_ = nullptr;
  const double* dvdot_ = nullptr;
};

}  // namespace cardan::operators::linear
