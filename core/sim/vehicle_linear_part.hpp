#pragma once
// What the methods `exponential` and `multirate` ask of a vehicle: its frozen linear part in coordinates about the start of each step, in
// which hinges turn by rotation vectors and a free body moves along axes that stand still (docs/mathematics/exponential.md, 2).
#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "core/dynamics/device_tangents.hpp"
#include "core/sim/frozen_vehicle.hpp"
#include "core/time/integrator.hpp"

namespace cardan {

/// x = [q; v; z] in the user's order. r: forces per velocity component; what q' is beyond a constant map of v, per velocity component of
/// hinges with a quaternion and per coordinate of others; z'.
class VehicleLinearPart final : public LinearPart {
 public:
  /// Of `exponential` what swings and is damped, of `multirate` gyroscopic moments of fast rotors too. InputError C0401, with the name of
  /// the method, where a hinge whose coordinates are no integrals of its velocities is given a motion, or the vehicle has closed loops.
  /// `devices`: at the state that centre() is told they have been evaluated; null: there are none.
  VehicleLinearPart(std::shared_ptr<const Model> model, const std::string& method, const DeviceForces* devices = nullptr);

  /// What of the model these methods do not take, "closed loops"; empty: it takes all.
  static std::string refusal(const Model& model);

  int size() const override { return 2 * nv_ + nq_ + nz_; }
  void centre(double t, const double* x, const double* xdot) override;
  void residual(const double* x, const double* xdot, double* r) const override;
  void divide(int pieces) override;
  void advance(double h, const std::array<const double*, 3>& r, double* x) override;
  void effect(double h, const std::array<const double*, 3>& r, double* e) override;
  bool last_terms(double* e, double* lost) override;
  void leave_out(double h, double* e) const override;
  void inside(double s, double* x) override;
  void sizes(const double* x, double* size) const override;
  double longest_step() const override;
  void remember(Archive& archive) override { frozen_.remember(archive); }

 private:
  struct Hinge {  // whose q' is not v
    int q, v, nq, nv, shape;
    const UserBody* user;
    Vec3<double> fall{};  // [m/s^2] of a root that nothing holds: as its frame did at the centre all that it carries falls, beside r
  };
  /// Rotation vector of the attitude at q seen from that of the centre.
  Vec3<double> turned(const Hinge& hinge, const double* q) const;
  bool moved(const double* q) const;
  /// Through a piece of the step: travel_ from its start, rate_.
  void go(int piece);
  void assemble(double h, double s, double* x) const;
  /// What travel_ and rate_, and the integrals of what is beyond forces, are in x where they are small.
  void spread(const auto& beyond, double* e);

  std::shared_ptr<const Model> model_;
  FrozenVehicle frozen_;
  std::unique_ptr<DeviceTangents> devices_;
  FrozenVehicle::AtHinges at_hinges_;  // of devices
  int nq_, nv_, nz_;
  std::vector<Hinge> curved_;
  std::vector<std::uint8_t> matters_;        // per velocity component: M changes with its coordinate; 2: with its length
  std::vector<double> x_;                    // the centre
  std::array<std::vector<double>, 3> past_;  // r of the last advance
  int pieces_ = 1, redone_ = -1;             // of it; the one that `frozen_` was taken through last
  // Of several: travel from the centre and rates at the start of each, the whole travel; where the next one starts; what acts on it.
  std::vector<double> starts_, whole_, y_, v_;
  std::array<std::vector<double>, 3> drive_;
  mutable std::vector<double> travel_, rate_, u_, du_, qdot_, difference_;
  double h_ = 0.0;
  int since_ = 0;  // steps since it was frozen
};

}  // namespace cardan
