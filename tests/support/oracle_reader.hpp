#pragma once
// Reads the reference vectors of tests/reference/oracle (README.md there: schema, numbers, conventions).
#include <Eigen/Core>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>
#include <vector>

#include "core/model/spec.hpp"

namespace cardan::oracle {

/// A number of the file (decimal text, or a JSON integer) in the scalar T, with all the digits T can hold.
template <class T>
T number(const nlohmann::json& j) {
  if (j.is_number()) return T(j.get<int>());
  if constexpr (std::is_same_v<T, double>)
    return std::stod(j.get_ref<const std::string&>());
  else
    return T(j.get_ref<const std::string&>());
}

template <class T>
Eigen::Vector<T, Eigen::Dynamic> vector(const nlohmann::json& j) {
  Eigen::Vector<T, Eigen::Dynamic> out(j.size());
  for (std::size_t i = 0; i < j.size(); ++i) out[i] = number<T>(j[i]);
  return out;
}

/// A list of rows.
template <class T>
Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic> matrix(const nlohmann::json& j) {
  Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic> out(j.size(), j.empty() ? 0 : j[0].size());
  for (std::size_t i = 0; i < j.size(); ++i) out.row(i) = vector<T>(j[i]).transpose();
  return out;
}

/// A point of interest of the file: node `node` of body `body`, with the wrench [moment; force] in node axes on it.
struct Point {
  std::string body, node;
  Eigen::Matrix<double, 6, 1> wrench = Eigen::Matrix<double, 6, 1>::Zero();
};

/// One file. Names: bodies as in the file; the inboard hinge node of a body is "pnode", the outboard node for the child
/// c is "o_c" (on the world it is given in place), point of interest i is "n_i".
/// A file of the schema cardan-oracle-body/1 becomes one body "b1" with B = P on a `free_body` hinge at the world's
/// origin, so that M and bias of the system are M_fl and its Boltzmann-Hamel bias.
/// Flexible bodies stand at level 2 (`at_level` makes others).
struct Case {
  std::string name, schema;
  nlohmann::json json;   // the file as it is: every number as text
  SystemSpec spec;       // with the state of the file as initial state
  Eigen::VectorXd q, v;  // q body by body [hinge q; eta], v [hinge v; eta']
  Eigen::VectorXd tau;   // input.tau; zeros when absent
  std::vector<Point> points;
  bool has_loops() const { return json.contains("constraints"); }
};

Case read(const std::filesystem::path&);

/// The system of a file with its constraints as loops "loop_0", "loop_1", ..., between nodes "loop_0_A" and "loop_0_B".
SystemSpec with_loops(const Case&);

/// The same system with every flexible body at this fidelity level.
SystemSpec at_level(SystemSpec, int level);

/// The .json files of tests/reference/oracle and of the folder in the environment variable CARDAN_ORACLE_DIR, by name.
std::vector<std::filesystem::path> files();

}  // namespace cardan::oracle
