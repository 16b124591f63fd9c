#pragma once
// Reads a published case (tests/reference/cases/*.yaml) and runs a system on it.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <Eigen/Eigenvalues>
#include <numbers>
#include <stdexcept>

#include "core/sim/simulation.hpp"
#include "tests/support/accuracy.hpp"
#include "tests/support/builders.hpp"

namespace cardan::test {

inline const Eigen::Vector3d X = Eigen::Vector3d::UnitX(), Y = Eigen::Vector3d::UnitY(), Z = Eigen::Vector3d::UnitZ();
inline constexpr double kDegree = std::numbers::pi / 180.0;

class Published {
 public:
  explicit Published(const std::string& id) : file_(YAML::LoadFile(CARDAN_SOURCE_DIR "/tests/reference/cases/" + id + ".yaml")) {
    case_at_hand() = id;
  }

  /// The value of this quantity, or of the first one that begins with this text.
  YAML::Node at(const std::string& quantity) const {
    for (const auto& entry : file_["reference"]["values"])
      if (entry["quantity"].as<std::string>() == quantity) return entry["value"];
    for (const auto& entry : file_["reference"]["values"])
      if (entry["quantity"].as<std::string>().rfind(quantity, 0) == 0) return entry["value"];
    throw std::runtime_error("no quantity " + quantity);
  }
  double number(const std::string& quantity) const { return at(quantity).as<double>(); }
  Eigen::VectorXd vector(const std::string& quantity) const { return as_vector(at(quantity)); }
  double tolerance(const std::string& name) const { return file_["tolerance_recommended"][name].as<double>(); }
  YAML::Node model() const { return file_["model"]; }
  YAML::Node initial() const { return file_["initial_state"]; }

  static Eigen::VectorXd as_vector(const YAML::Node& node) {
    const auto list = node.as<std::vector<double>>();
    return Eigen::Map<const Eigen::VectorXd>(list.data(), static_cast<Eigen::Index>(list.size()));
  }

 private:
  YAML::Node file_;
};

/// What a case reaches, kept in the test report.
inline void expect_within(const std::string& what, double error, double tolerance) {
  keep_accuracy(what, "", "", error, tolerance);
  EXPECT_LE(error, tolerance) << what;
}

/// Tight tolerances by default: the cases ask for 1e-7 ... 1e-12.
inline std::unique_ptr<Simulation> run_of(const SystemSpec& spec, const std::string& method = "dopri5", double relative = 1e-13,
                                          double fixed_step = 0.0) {
  SimulationOptions options;
  options.integrator.method = method;
  options.integrator.relative_tolerance = relative;
  options.integrator.fixed_step = fixed_step;
  return std::make_unique<Simulation>(compiled(spec), options);
}

/// Times at which a function of the state crosses zero in this direction.
inline std::shared_ptr<std::vector<double>> crossings(Simulation& sim, int direction,
                                                      std::function<double(const double* q, const double* v)> function,
                                                      std::function<void()> action = {}) {
  auto times = std::make_shared<std::vector<double>>();
  Event event;
  event.name = "crossing";
  event.direction = direction;
  event.function = [f = std::move(function)](double, const double* q, const double* v) { return f(q, v); };
  event.action = [times, &sim, a = std::move(action)] {
    times->push_back(sim.time());
    if (a) a();
  };
  sim.add_event(std::move(event));
  return times;
}

}  // namespace cardan::test
