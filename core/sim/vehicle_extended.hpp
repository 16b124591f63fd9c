#pragma once
// What the method `extended` steps: the vehicle by the dense twin in 113 bits, its steps extrapolated. docs/mathematics/extended.md.
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/reference/quad.hpp"
#include "core/sim/motion_profile.hpp"
#include "core/sim/twin_dynamics.hpp"
#include "core/time/integrator.hpp"

namespace cardan {

/// Rates in double of n integrals beside the state, at (t, x); false: they cannot be evaluated there.
struct ExtendedIntegrands {
  int n = 0;
  std::function<bool(double t, const double* x, double* ydot)> rates = {};
};

/// What acts from one restart to the next: commands, which are constant, and motions that are functions of time.
struct ExtendedLoads {
  struct Motion {
    int v, q;  // components of velocity and, where q' is v, of coordinates; else -1
    const MotionProfile* profile;
  };
  struct Length {
    double more;  // of a prescribed loop, at the restart, in the order of Loop::drive
    const MotionProfile* profile;
  };
  std::vector<double> tau;  // of actuators [N m, N], nv numbers
  std::vector<NodeWrench> wrenches = {};
  std::vector<Motion> motions = {};
  std::vector<Length> lengths = {};
};

/// x = [q; v] in the user's order.
class VehicleExtended final : public ExtendedMotion {
 public:
  /// absolute: allowed of each state; relative: of its magnitude. `loads`: what acts from now on. InputError C0401 where something of the
  /// model has no more digits than a double.
  VehicleExtended(std::shared_ptr<const Model> model, std::vector<double> absolute, double relative, std::function<ExtendedLoads()> loads,
                  ExtendedIntegrands integrands = {});

  /// What of the model is known in double alone, "device wheel"; empty: nothing.
  static std::string refusal(const Model& model);

  void enter(double t, const double* x) override;
  Trial step(double t0, double t1) override;
  void found(double* x) const override;
  void integral_errors(double* error) const override;
  void take() override { now_ = next_, more_ = next_more_; }
  void remember(Archive& archive) override;

 private:
  using Quad = reference::Quad;
  using VecX = reference::VecX<Quad>;
  void give(const Quad& t, VecX& x) const;
  TwinLoads<Quad> loads_at(const Quad& t);
  VecX lengths_at(const Quad& t) const;
  bool rates(const Quad& t, VecX& x, VecX& xdot);
  void close(const Quad& t, VecX& x);
  double error(const VecX& a, const VecX& b, int& state) const;

  std::shared_ptr<const Model> model_;
  std::vector<double> absolute_;
  double relative_;
  std::function<ExtendedLoads()> loads_;
  ExtendedLoads acting_;
  TwinDynamics<Quad> twin_;
  std::vector<int> quaternions_;  // where they begin in q
  ExtendedIntegrands integrands_;
  std::vector<double> x_, ydot_;     // scratch
  VecX now_, next_;                  // the state and the integrals; next_: as found() tells them
  Eigen::VectorXd integral_errors_;  // of the last step: what its last column changed, and rounding
  VecX more_, next_more_;            // lengths and offsets of prescribed loops, there
  VecX vdot_given_;                  // scratch
  std::vector<int> free_;            // components of v that are not given
  std::vector<bool> given_;          // states that are functions of time
  double since_ = 0.0;               // [s] where the state now_ is, and a step begins
};

}  // namespace cardan
