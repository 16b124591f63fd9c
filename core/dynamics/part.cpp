#include "core/dynamics/part.hpp"

namespace cardan {

std::vector<Run> stretches(const std::vector<Run>& runs, const std::vector<std::uint8_t>& marked) {
  std::vector<Run> out;
  for (const Run& run : runs)
    for (int k = run.begin; k < run.end; ++k) {
      if (!marked[k]) continue;
      if (k > run.begin && marked[k - 1])
        ++out.back().end;
      else
        out.push_back({k, k + 1, run.kind, run.prescribed, run.square_root});
    }
  return out;
}

Part part_of(const SweepModel& model, std::span<const int> sweep_bodies) {
  Part out;
  out.takes_part.assign(model.bodies.size(), 0);
  for (const int k : sweep_bodies) out.takes_part[k] = 1;
  std::vector<std::uint8_t> still(model.bodies.size(), 0);
  for (const int k : sweep_bodies)
    if (const int inboard = model.bodies[k].parent; !out.takes_part[inboard])
      for (int p = inboard; p > 0 && !still[p]; p = model.bodies[p].parent) still[p] = 1;
  out.runs = stretches(model.runs, out.takes_part);
  out.still = stretches(model.runs, still);
  for (const int k : model.rotors)
    if (!out.takes_part[k] && out.takes_part[model.bodies[k].parent]) out.rotors_left_out.push_back(k);
  return out;
}

}  // namespace cardan
