#pragma once
// A run in (q, nu): the change of velocities between an integrator and a right-hand side x' = f(t, x), x = [q; v; z]
// (docs/mathematics/diagonalised.md, 4). Whoever is on either side of it sees v.
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/dynamics/diagonal_velocities.hpp"
#include "core/sim/dynamics.hpp"
#include "core/time/integrator.hpp"

namespace cardan {

class DiagonalisedForm {
 public:
  /// What a simulation does for it.
  struct Hooks {
    std::function<void(double t, double* q, double* v)> give;          ///< motions that are given as functions of time
    std::function<bool(const std::function<void()>&)> guard;           ///< does it; false where a function of a plugin throws
    std::function<void(const soa::Breakdown&, const double*)> broken;  ///< a direction without inertia at q
  };

  /// InputError C0401 at this place where the model or the method has what it does not take.
  static void expect_honoured(const Model& model, Dynamics dynamics, const IntegratorOptions& options, const Located& at);
  /// The same at "dynamics".
  DiagonalisedForm(std::shared_ptr<const Model> model, Dynamics dynamics, const IntegratorOptions& options, Hooks hooks);
  /// What of the model it does not take, "closed loops"; empty: it takes all.
  static std::string refusal(const Model& model);
  /// What of the method; empty: nothing.
  static std::string refusal(const IntegratorOptions& options);

  /// The same motion in [q; nu; z]. Refers to this.
  OdeProblem problem(OdeProblem of_v);
  /// In terms of [q; v; z] again. Refers to this.
  std::unique_ptr<Integrator> integrator(std::unique_ptr<Integrator> of_nu);

  /// x = [q; v; z] and y = [q; nu; z] of each other; false: a direction without inertia there, or a plugin that throws.
  bool enter(const double* x, double* y);
  bool leave(const double* y, double* x);

 private:
  template <class Work>
  bool attempt(const double* q, const Work& work);
  bool at(const double* q);
  bool look(double t, const double* y);
  bool rhs(double t, const double* y, double* ydot);

  std::shared_ptr<const Model> model_;
  Hooks hooks_;
  DiagonalVelocities velocities_;
  OdeProblem of_v_;
  std::vector<double> x_, vdot_;  // of the last state that was looked at
  std::vector<double> seen_;      // ... which was this one
  double t_seen_;
};

}  // namespace cardan
