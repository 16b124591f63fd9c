#pragma once
// What linear modes cannot tell: how fast a flexible body turns beside its first frequency (terms of second order in the deformation,
// centrifugal stiffening and softening, are of the order of (Omega / omega_1)^2 of its stiffness), what it carries along itself beside what
// it would buckle under, and how far it bends beside its size.
#include <algorithm>
#include <limits>
#include <memory>
#include <vector>

#include "core/base/warnings.hpp"
#include "core/model/spec.hpp"

namespace cardan {

class Simulation;

/// First frequency of K x = omega^2 M x of the modes [rad/s]; infinity without modes.
double first_frequency(const ModalData& modal);
/// True if stiffening by rotation is in the model: level 2 with second-order shapes Q on the mass nodes.
bool has_stiffening(const BodySpec& body);
/// Radius of gyration about the body's origin times sqrt(3) [m]: the length of a uniform rod from there.
double size_of(const ModalData& modal);

/// Follows the flexible bodies of a run. see() reads what observers have computed anyway; it is called at outputs, never in a step.
class FlexibleLimits {
 public:
  explicit FlexibleLimits(const Simulation& sim);
  /// False: no body has such limits, see() does nothing.
  bool needed() const { return !bodies_.empty(); }

  /// Before the run: the rate of each body at the initial state and what its profiles add to it. Empty where that state is singular.
  Warnings expected(Simulation& sim, double t_end);
  void see(Simulation& sim);
  void remember(Archive& archive) {
    for (Body& b : bodies_) {
      archive.finite(b.rate, b.t_rate, b.carries, b.t_carries, b.carried, b.t_carried, b.deflection, b.t_deflection, b.point);
      const bool there = std::find(b.points.begin(), b.points.end(), b.point) != b.points.end();
      if (!there && (b.point != -1 || b.deflection != 0.0)) archive.wrong("a node that the body does not have");
    }
  }
  /// After the run: what was seen beyond what expected() has told.
  Warnings seen() const;

 private:
  struct Body {
    int user = 0, node = 0;                       // node at the origin of its frame
    double omega = 0.0, size = 0.0;               // [rad/s] first frequency, [m]
    std::vector<int> points;                      // its nodes that deform: index into the modal data
    double expected = 0.0;                        // [rad/s]
    double rate = 0.0, t_rate = 0.0;              // [rad/s] largest seen, and when [s]
    double carries = 0.0, t_carries = -1.0;       // [N] tension along it > 0, mean over a period; when it was looked at [s], -1: not yet
    double carried = 0.0, t_carried = 0.0;        // [N] the largest of these, likewise
    double deflection = 0.0, t_deflection = 0.0;  // [m] likewise, |Phi eta|
    int point = -1;                               // of that deflection
  };
  Diagnostic rate_warning(const Body& body, double rate, bool before) const;
  double carried_by(const Body& body, Simulation& sim) const;
  double share_of_stiffness(const Body& body) const;
  std::shared_ptr<const SystemSpec> spec_;  // of the run's first model, whatever it adopts
  std::vector<Body> bodies_;
};

}  // namespace cardan
