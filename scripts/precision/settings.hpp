#pragma once
// Which settings of the integrator are tried: methods of the registry, each with a ladder of tolerances or of steps.
#include <string>
#include <utility>
#include <vector>

#include "core/time/integrator.hpp"

namespace cardan {

/// Values as `--set` takes them.
using Sets = std::vector<std::pair<std::string, std::string>>;

/// A form of the equations of motion: `mission.dynamics`, or how loops are closed.
struct Formulation {
  std::string name = kStandard;
  Sets sets;  // that make it of the scenario; none: it is the scenario's own
  static constexpr const char* kStandard = "standard";
  bool operator==(const Formulation&) const = default;
};

/// One setting of `mission.integrator`, and what is integrated.
struct PrecisionSetting {
  std::string method, linear_solver;  // the latter empty: the method's own, or none
  bool adaptive = true;
  double relative = 0.0, absolute = 0.0;                     // of an adaptive method; absolute 0: that of `relative`
  double step = 0.0;                                         // [s] of a method of equal steps
  std::vector<std::pair<std::string, double>> by_kind = {};  // `tolerances` of an adaptive method: "angle" [rad]
  Formulation formulation = {};
  Sets model = {};             // simplifications of the vehicle
  std::string solver() const;  // "cvode_bdf/krylov"
  std::string name() const;    // of its curve: "cvode_bdf/krylov", "dopri5+dense"
  std::string rung() const;    // "1e-08", "0.05 s"
  /// As `--set` takes them, over what a scenario says itself (`own`), whose max_step and initial_step adaptive methods keep.
  Sets sets(const PrecisionSetting& own) const;
  bool operator==(const PrecisionSetting&) const = default;
};

/// What a scenario says itself, as a setting. by_kind: as PrecisionSetting has it.
PrecisionSetting own_setting(const IntegratorOptions& own, double absolute, std::vector<std::pair<std::string, double>> by_kind = {});

/// Methods by their names on the command line ("dopri5", "cvode_bdf/krylov"), all that compute in double where none is named: a curve for
/// each, those of several linear solvers once with each. Throws InputError C0801 for a name that there is not, and one that is given twice.
std::vector<PrecisionSetting> precision_methods(const std::vector<std::string>& names);

/// "1e-4:1e-12": both ends and the whole decades between; "1e-4:1e-9:11": so many, evenly in the logarithm; "1e-4,3e-7": these. From the
/// loosest to the tightest. Throws InputError C0801: not this form, not from 1e-14 to below 1, more than 100.
std::vector<double> tolerance_ladder(const std::string& text);
/// The same of steps, "0.1:0.001" [s], both ends and halves between.
std::vector<double> step_ladder(const std::string& text);
/// Steps for a scene whose fastest motion is `rate` [rad/s] (0: it has none that is elastic or damped), recorded each `period` [s]: from
/// the period or 2/rate, where Runge-Kutta methods are still stable, five times halved; none that needs more than 5 million steps to
/// `duration` [s], unless all do.
std::vector<double> usual_steps(double rate, double period, double duration);

/// Those of `there` that are named, each once; `all` is all of them. Throws InputError C0801.
std::vector<Formulation> formulations_named(const std::vector<std::string>& names, const std::vector<Formulation>& there);

/// Each method with each rung of its ladder. `own`: what the scenario says: absolute tolerances, of kinds too, keep their ratio to the
/// relative one.
std::vector<PrecisionSetting> precision_grid(const std::vector<PrecisionSetting>& methods, const std::vector<double>& tolerances,
                                             const std::vector<double>& steps, const PrecisionSetting& own);
/// With another tolerance, and the absolute ones along.
PrecisionSetting with_tolerance(PrecisionSetting setting, double relative, const PrecisionSetting& own);

}  // namespace cardan
