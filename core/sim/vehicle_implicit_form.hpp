#pragma once
// A vehicle with closed loops as a differential-algebraic system in absolute coordinates, stabilised (Gear, Gupta &
// Leimkuhler 1985; docs/mathematics/loops.md, 5).
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/dynamics/absolute.hpp"
#include "core/time/integrator.hpp"

namespace cardan {

/// y = [Q; U; lambda; mu; nu]: coordinates and velocities of the bodies, and since the last start the integrals of the multipliers of all
/// rows at velocities and at places, and of the norms of the quaternions: the multipliers are their rates (Gear 1988).
class VehicleImplicitForm final : public ImplicitForm {
 public:
  /// What acts at (t, q, v) of the vehicle: hinge forces tau and wrenches; null: it cannot be evaluated.
  using Loads = std::function<const Inputs*(double t, const double* q, const double* v)>;
  /// Of loops that are given as functions of time; into q and v what is given of hinges.
  using Drives = std::function<const LoopDrive*(double t, double* q, double* v)>;
  /// Does it; false where a function of a plugin throws.
  using Guard = std::function<bool(const std::function<void()>&)>;

  /// `tolerances`: absolute ones of [Q; U]. InputError C0401 where the model has what the method does not take.
  VehicleImplicitForm(std::shared_ptr<const Model> model, std::vector<double> tolerances, Loads loads, Drives drives, Guard guard);

  /// What of the model the method does not take, "devices with states"; empty: it takes all.
  static std::string refusal(const Model& model);
  /// The hint beside it.
  static const char* way_out(const Model& model);

  int size() const override { return static_cast<int>(absolute_.size()); }
  void tolerances(double relative, const double* y, double* out) const override;
  const std::vector<std::vector<int>>& pattern() const override { return pattern_; }
  bool enter(double t, const double* x, double* y, double* ydot) override;
  bool leave(double t, const double* y, double* x, bool end) override;
  bool residual(double t, const double* y, const double* ydot, double* F) override;
  int state_of(int unknown) const override;

 private:
  void find_pattern();
  void place(double t, const double* Q, const double* U);
  void measure(const double* y);
  /// Of its body: 0 to 2 it turns, 3 to 5 it shifts, then its modes.
  int axis_of(int velocity) const {
    return velocity - bodies_.bodies[static_cast<std::size_t>(body_of_[static_cast<std::size_t>(velocity)])].v;
  }
  bool evaluate(double t, const double* y, const double* ydot, double* F);

  std::shared_ptr<const Model> model_;
  Loads loads_;
  Drives drives_;
  Guard guard_;
  AbsoluteSystem system_;
  const Model& bodies_;
  Workspace tree_;
  int nq_, nv_, rows_;              // of the bodies
  std::vector<int> quaternions_;    // where they are in Q
  std::vector<std::uint8_t> kept_;  // rows that count: those of the last start
  std::vector<int> body_of_;        // of each velocity of the bodies
  std::vector<int> eta_of_;         // of each velocity of the bodies, where the coordinate of its mode is in Q; -1: it is no mode's
  std::vector<double> mobility_;    // of each velocity: 1 / the mean inertia of turns, of shifts, or of its mode, at the last start
  std::vector<double> asked_, absolute_, q_, v_, moved_, given_q_, given_v_;
  std::vector<std::vector<int>> pattern_;
};

}  // namespace cardan
