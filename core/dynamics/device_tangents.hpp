#pragma once
// The derivative of what the devices of a model do, along a direction. docs/mathematics/devices.md.
#include "core/dynamics/devices.hpp"
#include "core/soa/tangent.hpp"

namespace cardan {

/// The derivative of DeviceForces along a direction: for Newton's equations and linear models. Values are those of `base`, which has been
/// evaluated at the same point.
class DeviceTangents : public StateLoads<soa::Tangent> {
 public:
  DeviceTangents(const Model& model, const DeviceForces& base);
  /// Rates of the inputs that are commanded.
  std::vector<double> commands;
  void set(const DeviceState<soa::Tangent>& state) { state_ = state; }
  bool act(soa::Workspace<soa::Tangent>& ws, const soa::Inputs<soa::Tangent>& in) override;
  bool follow(const soa::Workspace<soa::Tangent>& ws, const soa::Inputs<soa::Tangent>& in, const soa::Tangent* vdot) override {
    return follow(ws, in, vdot, After::forward);
  }
  bool follow(const soa::Workspace<soa::Tangent>& ws, const soa::Inputs<soa::Tangent>& in, const soa::Tangent* vdot, After after);
  /// As DeviceForces::complete().
  bool complete(soa::Workspace<soa::Tangent>& ws, const soa::Inputs<soa::Tangent>& in);
  const double* zdot() const { return zdot_.data(); }
  double output(int i) const { return out_[i]; }
  /// Derivative of what is pushed with at a mount.
  const cardan_mount_load& load(int mount) const { return loads_[mount]; }
  /// Of sweep body k, its frame, along the rates of z: of its inertia.
  RigidInertia<double> inertia_rate(int k) const;
  /// As DeviceForces::stored_momentum(), after act().
  Vec3<soa::Tangent> stored_momentum();
  /// As if this mount alone moved, of all devices; -1: all do.
  void move_only(int mount) { only_ = mount; }
  /// Something said false as a device has no derivative where it is: which.
  bool failed() const { return fault_of_ >= 0; }
  NumericsError fault() const;
  /// -d tau/dq and -d tau/dv of what devices push with at hinges [N m/rad, N m s/rad; N/m, N s/m], added per velocity component: by the
  /// motion of that component alone. Of devices that tell their tangent, as others would be asked some twenty times, and have no states:
  /// what these hold back is another force a moment later.
  void add_at_hinges(double* stiffness, double* damping);
  /// dz'/dz of one device with its mounts and inputs held, n x n, column-major.
  void state_matrix(int device, double* J);

 private:
  void take_inputs(const Device& d);
  void add_flows(const soa::Inputs<soa::Tangent>& in);
  bool differentiate(int device);
  bool follow_along(int device);
  template <class F>
  void differences(const Device& d, const cardan_device_args& at, const cardan_device_args& along, std::size_t n, double* out, const F& f);
  bool by_differences(const Device& d, const cardan_device_args& at, const cardan_device_args& along, cardan_device_out& out);

  int fault_of_ = -1;  // index into Devices::all
  int only_ = -1;      // of move_only()
  const Model& model_;
  const DeviceForces& base_;
  DeviceState<soa::Tangent> state_;
  FieldsOfDevices fields_;
  std::vector<cardan_mount_motion> motions_, followed_motions_;
  std::vector<cardan_mount_load> loads_;
  std::vector<double> in_, out_, zdot_, dz_, scratch_, rates_, unused_;
};

}  // namespace cardan
