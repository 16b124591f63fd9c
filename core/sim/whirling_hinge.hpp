#pragma once
// Near the lock of gimbals.
#include "core/dynamics/workspace.hpp"
#include "core/model/model.hpp"

namespace cardan {

/// A hinge whose rates cancel each other: its axes are nearly dependent, and it takes large ones to turn a little.
struct WhirlingHinge {
  int body = 0;        // of the sweeps; 0: none
  double times = 0.0;  // its rates beside what it turns with
};
/// The worst one of those above 1000 times, by the axes of the last evaluation. O(N), allocates nothing.
WhirlingHinge whirling_hinge(const Model& model, const Workspace& workspace, const double* v);

}  // namespace cardan
