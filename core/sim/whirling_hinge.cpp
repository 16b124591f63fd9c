#include "core/sim/whirling_hinge.hpp"

#include <cmath>

namespace cardan {

WhirlingHinge whirling_hinge(const Model& model, const Workspace& workspace, const double* v) {
  constexpr double kMany = 1e3;
  WhirlingHinge worst{.body = 0, .times = kMany};
  for (std::size_t k = 1; k < model.bodies.size(); ++k) {
    const SweepBody& b = model.bodies[k];
    if (b.nv < 3 || b.kind == BodyKernel::free) continue;  // two axes keep the angle between them
    Vec3<double> turn{0.0, 0.0, 0.0};
    double rates = 0.0;
    for (int j = 0; j < b.nv; ++j) {
      const Vec3<double> by = v[b.v + j] * workspace.H(static_cast<int>(k))[j].w;
      turn = turn + by, rates += std::sqrt(dot(by, by));
    }
    if (rates > worst.times * std::sqrt(dot(turn, turn))) worst = {static_cast<int>(k), rates / std::sqrt(dot(turn, turn))};
  }
  return worst;
}

}  // namespace cardan
