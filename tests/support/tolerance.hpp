#pragma once
// How far a result is from a reference vector: the scales of tests/reference/oracle/README.md, section Tolerances.
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/support/oracle_reader.hpp"

namespace cardan::oracle {

/// Largest entry in absolute value of a number, a list or a list of lists.
inline double largest(const nlohmann::json& j) {
  if (!j.is_array()) return std::abs(number<double>(j));
  double out = 0.0;
  for (const auto& e : j) out = std::max(out, largest(e));
  return out;
}

/// Compares results with the field `expected` of one file. Fields are named by their path in it: "M",
/// "nodes/0/velocity", "hybrid/tau_prescribed", "level1/bias". All errors are relative to the scale of their field.
class Comparator {
 public:
  explicit Comparator(const nlohmann::json& file) : file_(file), expected_(file.at("expected")) {}

  bool has(const std::string& field) const { return expected_.contains(pointer(field)); }
  const nlohmann::json& at(const std::string& field) const { return expected_.at(pointer(field)); }

  /// Error of a scalar, a vector (given as a column) or a matrix.
  template <class Derived>
  double error(const std::string& field, const Eigen::MatrixBase<Derived>& got) const {
    using T = typename Derived::Scalar;
    const nlohmann::json& j = at(field);
    Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic> want;
    if (!j.is_array())
      want.setConstant(1, 1, number<T>(j));
    else if (!j.empty() && j[0].is_array())
      want = matrix<T>(j);
    else
      want = vector<T>(j);
    if (want.rows() != got.rows() || want.cols() != got.cols()) return HUGE_VAL;
    if (want.size() == 0) return 0.0;
    double out = 0.0;
    for (Eigen::Index i = 0; i < want.rows(); ++i)
      for (Eigen::Index k = 0; k < want.cols(); ++k) out = larger(out, T(got(i, k) - want(i, k)));
    return out / scale(field);
  }
  template <class T>
  double scalar_error(const std::string& field, const T& got) const {
    return error(field, Eigen::Matrix<T, 1, 1>(got));
  }

  /// Error of v' as the residual of M v' = input.tau + all known forces - bias with the file's arrays; for files where
  /// M is nearly singular (37). `free`: the components to look at (hybrid); all when empty.
  template <class Derived>
  double residual(const Eigen::MatrixBase<Derived>& vdot, const std::vector<bool>& free = {}) const {
    using T = typename Derived::Scalar;
    const auto M = matrix<T>(at("M"));
    Eigen::Matrix<T, Eigen::Dynamic, 1> r = M * vdot - vector<T>(file_["input"]["tau"]) + vector<T>(at("bias"));
    double size = std::max(largest(file_["input"]["tau"]), largest(at("bias")));
    for (const char* force : {"gravity_force", "elastic_force", "external_force"}) {
      r -= vector<T>(at(force));
      size = std::max(size, largest(at(force)));
    }
    double out = 0.0;
    for (Eigen::Index i = 0; i < r.size(); ++i) {
      size = larger(size, T(M(i, i) * vdot[i]));
      if (free.empty() || free[i]) out = larger(out, r[i]);
    }
    return std::isinf(out) ? out : out / size;
  }

  double scale(const std::string& field) const {
    const std::string name = last(field);
    if (name == "log_det_M") return std::max(1.0, own(field));
    if (name == "grad_log_det_M" || name == "dtau_dtheta" || name == "dtau_dv") return std::max(1.0, own(field));
    if (field.rfind("dM_dtheta/", 0) == 0) return own("M");
    if (field.rfind("hinge_wrench_on_body_at_pnode/", 0) == 0) return own("hinge_wrench_on_body_at_pnode");
    if (name == "linear_momentum" || name == "angular_momentum_about_ground_origin")
      return std::max({own("linear_momentum"), own("angular_momentum_about_ground_origin"),
                       1e-3 * std::sqrt(2.0 * own("kinetic_energy") * own("total_mass"))});
    if (name == "power_nuC") return own("diagonalised/nu") * scale("diagonalised/C") * static_cast<double>(at("diagonalised/nu").size());
    if (!at(field).is_array()) return std::max(own(field), 1e-6 * largest_energy());
    if (own(field) > 1e-30) return own(field);
    const double group = largest_of_unit(field);
    return group > 1e-30 ? group : 1.0;  // the whole group is zero: absolute
  }

 private:
  static nlohmann::json::json_pointer pointer(const std::string& field) { return nlohmann::json::json_pointer("/" + field); }
  static std::string last(const std::string& field) { return field.substr(field.rfind('/') + 1); }
  /// max(a, |b|); infinite when b is not a number.
  template <class T>
  static double larger(double a, const T& b) {
    const double size = std::abs(static_cast<double>(b));
    return std::isnan(size) ? HUGE_VAL : std::max(a, size);
  }
  double own(const std::string& field) const { return largest(at(field)); }
  double own_or_zero(const std::string& field) const { return has(field) ? own(field) : 0.0; }

  double largest_energy() const {
    double out = 0.0;
    for (const char* e : {"kinetic_energy", "gravity_potential", "elastic_energy"})
      for (const char* at : {"", "level0/", "level1/", "level2/"}) out = std::max(out, own_or_zero(std::string(at) + e));
    return out;
  }

  /// Largest array of the same unit in the file.
  double largest_of_unit(const std::string& field) const {
    const std::string name = last(field), prefix = field.substr(0, field.size() - name.size());
    const auto among = [&](const std::vector<std::string>& names) {
      double out = 0.0;
      for (const std::string& n : names) out = std::max(out, own_or_zero(n));
      return out;
    };
    const auto of_nodes = [&](const char* key) {
      double out = 0.0;
      if (has("nodes"))
        for (const auto& node : at("nodes")) out = std::max(out, largest(node.at(key)));
      return out;
    };
    const auto is = [&](std::initializer_list<const char*> names) { return std::find(names.begin(), names.end(), name) != names.end(); };
    if (is({"bias", "gravity_force", "elastic_force", "external_force", "inverse_dynamics_tau", "tau_prescribed"})) {
      const double input = file_.contains("input") ? largest(file_["input"]["tau"]) : 0.0;
      const std::string level = prefix.rfind("level", 0) == 0 ? prefix : "";
      return std::max(input, among({level + "bias", level + "gravity_force", level + "elastic_force", "external_force",
                                    "inverse_dynamics_tau", "hybrid/tau_prescribed"}));
    }
    if (name == "velocity") return std::max(largest(file_["state"]["v"]), of_nodes("velocity"));
    if (name == "vdot" || name == "classical_acceleration") return std::max(among({"vdot"}), of_nodes("classical_acceleration"));
    if (prefix == "diagonalised/") return among({"diagonalised/C", "diagonalised/epsilon_for_tau"});
    return 0.0;
  }

  const nlohmann::json& file_;
  const nlohmann::json& expected_;
};

/// What double precision can reach in `field` of the file `name`: 1e-12 but for the exceptions of the README.
inline double reachable(const std::string& name, const std::string& field) {
  const auto starts = [&](const char* text) { return field.rfind(text, 0) == 0; };
  // 37: 1e-6 rad from gimbal lock, condition of order 1e12: what contains M^-1 keeps 3 digits (v' is judged by
  // residual).
  if (name == "37_gimbal_near_lock" &&
      (starts("hinge_wrench") || starts("osi_nodes") || starts("log_det_M") || starts("grad_log_det_M") || starts("diagonalised") ||
       starts("hybrid/tau") || starts("hybrid_by_operators/tau") || field.find("acceleration") != std::string::npos))
    return 1e-2;
  // 36: wrenches of size 3 remain from body forces of size 3e8, so 1e-16 of those is 1e-7 of the scale.
  if (name == "36_mass_ratio_flex" && starts("hinge_wrench")) return 1e-5;
  // 40: 1e-10 kg m^2 remain of 1 about the hinge in the user's frame, in which the operators are; the sweeps choose a better one.
  if (name == "40_tiny_inertia_about_hinge" && starts("hybrid_by_operators/tau")) return 1e-6;
  return 1e-12;
}

}  // namespace cardan::oracle
