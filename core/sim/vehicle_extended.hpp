#pragma once
// What the method `extended` steps: the vehicle by the dense twin in 113 bits, its steps extrapolated. docs/mathematics/extended.md.
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/reference/quad.hpp"
#include "core/sim/twin_dynamics.hpp"
#include "core/time/integrator.hpp"

namespace cardan {

/// Rates in double of n integrals beside the state, at x; false: they cannot be evaluated there.
struct ExtendedIntegrands {
  int n = 0;
  std::function<bool(const double* x, double* ydot)> rates = {};
};

/// x = [q; v] in the user's order. Between two restarts what acts is constant in time: commands.
class VehicleExtended final : public ExtendedMotion {
 public:
  /// absolute: allowed of each state; relative: of its magnitude. `loads`: what acts now. InputError C0401 where something of the model has
  /// no more digits than a double.
  VehicleExtended(std::shared_ptr<const Model> model, std::vector<double> absolute, double relative, std::function<TwinLoads()> loads,
                  ExtendedIntegrands integrands = {});

  /// What of the model is known in double alone, "device wheel"; empty: nothing.
  static std::string refusal(const Model& model);

  void enter(const double* x) override;
  Trial step(double t0, double t1) override;
  void found(double* x) const override;
  void take() override { now_ = next_; }
  void remember(Archive& archive) override;

 private:
  using Quad = reference::Quad;
  using VecX = reference::VecX<Quad>;
  bool rates(const VecX& x, VecX& xdot);
  void close(VecX& x);
  double error(const VecX& a, const VecX& b, int& state) const;

  std::shared_ptr<const Model> model_;
  std::vector<double> absolute_;
  double relative_;
  std::function<TwinLoads()> loads_;
  TwinDynamics<Quad> twin_;
  std::vector<int> quaternions_;  // where they begin in q
  ExtendedIntegrands integrands_;
  std::vector<double> x_, ydot_;  // scratch
  VecX now_, next_;               // the state and the integrals; next_: as found() tells them
};

}  // namespace cardan
