#pragma once
// The variational midpoint rule of a vehicle (docs/mathematics/variational.md): its discrete equations of motion, and how they are solved
// by sweeps.
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/dynamics/momenta.hpp"
#include "core/time/integrator.hpp"

namespace cardan {

/// z = [q; p; centre and velocity of the mass centre of each tree that floats]: p of quaternion hinges in axes of P, of linear velocities
/// in those of O, where a tree floats as seen from its mass centre.
class VehicleMomentumForm final : public MomentumForm {
 public:
  /// Forces and fields that act at (t, q, v): what inverse dynamics is given, beside the hinge forces tau.
  using Loads = std::function<Inputs(double t, const double* q, const double* v)>;
  /// Does it; false where a function of a plugin throws.
  using Guard = std::function<bool(const std::function<void()>&)>;

  /// InputError C0401 where the model has what the method does not take.
  VehicleMomentumForm(std::shared_ptr<const Model> model, Loads loads, Guard guard);

  /// What of the model the method does not take, "closed loops"; empty: it takes all.
  static std::string refusal(const Model& model);

  int size() const override { return nq_ + nv_ + 6 * static_cast<int>(floating_.size()); }
  int velocities() const override { return nv_; }
  bool enter(const double* x, double* z) override;
  bool leave(const double* z, double* x) override;
  bool velocity(const double* z, double* v) override;
  int step(double t, double h, const double* z0, double* v, double* z1) override;

 private:
  struct Hinge {  // with a quaternion
    int q, v, shape;
    const UserBody* user;
    int floats;  // index into floating_, -1: it is no root
  };
  struct Floating {
    int root;  // sweep index
    int q, v;
    bool body_axes;  // of its linear velocity
    double mass;     // [kg] of the tree
    Vec3<double> a;  // [m/s^2] of its mass centre at the last evaluation, axes of O
  };
  bool articulate(const double* q);
  int solve(double t, double h, const double* z0, double* v, double* z1);
  void move(double by, const double* from, const double* v, double* to, const double* middle) const;
  void evaluate(double t, const double* z0, double h, const double* v);
  double residual(double h, const double* p0, const double* v);
  Vec3<double> turning_force(const Hinge& hinge, const Vec3<double>& omega) const;
  Vec3<double> to_mass_centre(const Workspace& workspace, const Floating& tree, const double* q);

  std::shared_ptr<const Model> model_;
  Loads loads_;
  Guard guard_;
  int nq_, nv_;
  std::vector<Hinge> hinges_;
  std::vector<Floating> floating_;
  std::vector<int> tree_of_;  // per sweep body: index into floating_, -1
  bool placed_ = false;       // what acts depends on where a floating tree is
  Momenta momenta_;
  Workspace ws_, inertia_;  // of the middle of a step; P, D and G at articulated_
  std::vector<double> articulated_;
  std::vector<double> q_, v_, mu_, rate_, load_, size_, r_, dv_;
  std::vector<RigidInertia<double>> moments_;  // per sweep body
  double contraction_ = 1.0;                   // of the last iteration
};

}  // namespace cardan
