#pragma once
// Models in the schema cardan-bench-loops/1 (tests/reference/bench_loops/README.md) as SystemSpec, with their states.
#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "core/model/spec.hpp"

namespace cardan::bench_loops {

struct State {
  Eigen::VectorXd q, v, tau, vdot, lambda, force;  // force = G* lambda
  double floor = 0.0;                              // relative change of v' when q, v, tau are rounded to double
  double log_det = 0.0;                            // of X* M X, X by the model's independent rates
};
struct Spring {
  PlaceSpec from, to;
};
/// `spec` has the first state as its start. Its q is ours: [quaternion; position] of a free hinge.
struct Model {
  std::string name;
  SystemSpec spec;
  std::vector<State> states;
  int rank = 0, mobility = 0;  // of the rows of the loops
  std::vector<int> independent;
  std::vector<Spring> springs;  // not in `spec`: its tau has their forces
};

Model read(const std::filesystem::path& file);

/// Those of tests/reference/bench_loops, by name.
std::vector<std::filesystem::path> files();

}  // namespace cardan::bench_loops
