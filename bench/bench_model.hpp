#pragma once
// Models in the schema cardan-bench/1 (tests/reference/bench/README.md) as SystemSpec, and their ring of states.
#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "core/abi/registry.hpp"
#include "core/model/spec.hpp"

namespace cardan::bench {

struct BenchState {
  Eigen::VectorXd q, v, tau, vdot;  // user's order of a Model made from `spec`
};

struct BenchModel {
  std::string name;
  SystemSpec spec;
  std::vector<BenchState> states;
};

BenchModel read_model(const std::filesystem::path& file);
/// All .json files of a folder by name; or the one file.
std::vector<std::filesystem::path> models_in(const std::filesystem::path& folder);

/// A chain of `bodies` revolute flexible bodies with `modes` modes each (level 0, mass-normalised modes, each hung on the
/// deforming tip of the one before), with 16 random states of a fixed seed.
BenchModel flexible_chain(int bodies, int modes);

/// A free-flying rigid hub with `appendages` flexible bodies of `modes` mass-normalised modes on it, cantilevered at their
/// roots; every other one turns on a revolute hinge. "hub_2x5", with "_level_1" where the level is not 0.
BenchModel hub_appendages(int appendages, int modes, int level);

/// The same hub with two wings of plates and beams, from finite elements. "wings_2x5".
BenchModel hub_wings(int modes, int level);

/// A vehicle in YAML with 16 random states about its initial one, its modes at rest or nearly so.
BenchModel vehicle_model(const std::string& name, const std::filesystem::path& vehicle, const Registry& registry);

}  // namespace cardan::bench
