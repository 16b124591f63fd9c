#include "core/sim/plugin_faults.hpp"

#include <fmt/format.h>

#include <vector>

#include "core/base/finite.hpp"

namespace cardan {
namespace {

std::string function_of_hinge(const UserBody& u, const double* q, const double* v) {
  const std::uint32_t zero = 0;
  const int nv = static_cast<int>(u.hinge->nv);
  cardan_hinge_out out{};
  u.hinge->kinematics(u.hinge_packed.data(), 1, &zero, &zero, q, v, &out);
  if (!all_finite(out.R_OP, 9) || !all_finite(out.p_OP, 3) || !all_finite(out.Ht, 6 * nv) || !all_finite(out.Hdot_v, 6))
    return "kinematics";
  std::vector<double> qdot(u.hinge->nq, 0.0);
  u.hinge->qdot(u.hinge_packed.data(), q, v, qdot.data());
  return all_finite(qdot.data(), static_cast<int>(qdot.size())) ? "" : "qdot";
}

std::string function_of_body(const FlexibleBody& f, int m, const double* eta, const double* etadot) {
  const double omega[3] = {};
  const auto n = static_cast<std::size_t>(m);
  std::vector<double> M(10 + 6 * n + n * n), b(6 + n);
  f.family->mass(f.packed.data(), eta, M.data(), M.data() + 10, M.data() + 10 + 6 * n);
  if (!all_finite(M.data(), static_cast<int>(M.size()))) return "mass";
  f.family->bias(f.packed.data(), eta, etadot, omega, b.data());
  return all_finite(b.data(), static_cast<int>(b.size())) ? "" : "bias";
}

}  // namespace

std::string plugin_without_numbers(const Model& model, const double* q, const double* v) {
  if (!all_finite(q, model.nq) || !all_finite(v, model.nv)) return {};
  constexpr const char* kOurs = "built-in";
  const auto told = [](const std::string& function, const char* word, const std::string& type, const std::string& origin) {
    return fmt::format("{} of {} \"{}\" ({}) gives a value that is not finite", function, word, type, origin);
  };
  for (const UserBody& u : model.user) {
    if (u.nv > 0 && u.hinge_origin != kOurs)
      if (const std::string f = function_of_hinge(u, q + u.q, v + u.v); !f.empty()) return told(f, "hinge", u.hinge_type, u.hinge_origin);
    if (u.n_modes > 0 && u.family_origin != kOurs) {
      const FlexibleBody& flexible = model.flexible[static_cast<std::size_t>(model.bodies[static_cast<std::size_t>(u.sweep)].flexible)];
      if (const std::string f = function_of_body(flexible, u.n_modes, q + u.eta, v + u.etadot); !f.empty())
        return told(f, "body", u.type, u.family_origin);
    }
  }
  return {};
}

}  // namespace cardan
