#pragma once
// What is alike moves alike but for rounding and the error of the steps: which part comes first to a stop or to rest is not known.

#include <algorithm>
#include <cmath>

#include "core/time/integrator.hpp"

namespace cardan {

/// Relative, of rates with which alike parts come to a stop, and of what slows them down.
inline bool is_alike(double a, double b) { return std::abs(std::abs(a) - std::abs(b)) <= 1e-6 * std::abs(a); }

/// Of 1 (rad, m, and the largest rate): what the errors of many steps move alike parts apart by, at most.
inline double apart(const IntegratorOptions& o) { return 100.0 * o.relative_tolerance; }

}  // namespace cardan
