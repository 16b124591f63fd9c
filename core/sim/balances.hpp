#pragma once
// The ledger of a run: momentum and energy, beside what came in from outside.
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <string>
#include <utility>
#include <vector>

#include "core/dynamics/observe.hpp"
#include "core/time/integrator.hpp"

namespace cardan {

/// Residuals of the balances so far: quantity now - at the start - what came from outside. Each over the largest sum of
/// magnitudes over bodies so far.
struct LedgerState {
  Eigen::Vector3d linear = Eigen::Vector3d::Zero(), angular = Eigen::Vector3d::Zero();  // [N s], [N m s] residual
  double energy = 0.0;                                                                  // [J] residual
  double linear_relative = 0.0, angular_relative = 0.0, energy_relative = 0.0;          // [-]
  /// [-] What the errors of the steps so far explain of each, over the same sums of magnitudes.
  double linear_limit = 0.0, angular_limit = 0.0, energy_limit = 0.0;
  bool pass = true;  // none is above its limit, all are numbers; balances that no limit judges left out

  /// Balances whose limit is so large a part of the sum itself that it judges nothing: "linear momentum".
  std::vector<std::string> undecided() const;

  void remember(Archive&);
};

/// Of a balance the exact motion keeps whatever the steps did to it before: its residual is the sum of what each step and the
/// round-off of each put in. docs/mathematics/integration.md, "What a ledger may show".
class Balances {
 public:
  static constexpr int kIntegrals = 7;  // of the force [N s] and of its moment about the world's origin [N m s], work [J]
  using Integrals = Eigen::Matrix<double, kIntegrals, 1>;

  /// Linear and angular momentum and energy at a rate of the absolute tolerances: what counts as no motion at all. Of several vehicles, one
  /// after the other, the largest counts.
  void allow_least(double linear, double angular, double energy) {
    least_ = {std::max(least_[0], linear), std::max(least_[1], angular), std::max(least_[2], energy)};
  }
  void begin(const Momentum&, const Energy&);
  /// Momentum and energy have jumped to these, all of it brought in from outside, and the integrals begin anew: residuals stay, and what
  /// the integrals up to here may be off by.
  void go_on(const Momentum&, const Energy&);
  /// They have jumped by this, brought in from outside: an impulse, its moment about the world's origin, its work. `off`: what these may
  /// be off by.
  void jump(const Integrals& by, const Integrals& off = Integrals::Zero()) { start_ += by, off_ += off; }
  /// What has become of them after so many steps with such errors, at this relative tolerance. `off`: what the integrals may be off by.
  /// inside: of a step, where a state is off by more than steps are: it is told and not judged.
  const LedgerState& look(const Momentum&, const Energy&, const Integrals&, const Integrals& off, const IntegratorStatistics&,
                          double relative, bool inside = false);
  const LedgerState& worst() const { return worst_; }
  /// One sentence for each that was beyond its limit at the last look: its name and the sentence.
  std::vector<std::pair<std::string, std::string>> beyond(const std::string& method) const;
  void remember(Archive&);

 private:
  Integrals start_ = Integrals::Zero();      // momenta and energy
  Integrals off_ = Integrals::Zero();        // what jumps of these may be off by
  Integrals last_off_ = Integrals::Zero();   // what the integrals of the last look may be off by
  std::array<double, 3> scale_{}, least_{};  // linear, angular, energy
  LedgerState now_, worst_;
  long steps_ = 0;  // at the last look
};

}  // namespace cardan
