#include "core/sim/fastest_motion.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <vector>

#include "core/base/diagnostic.hpp"
#include "core/dynamics/hinge_laws.hpp"
#include "core/model/loops.hpp"
#include "core/operators/apply.hpp"
#include "core/operators/closed_system.hpp"
#include "core/operators/tree_operators.hpp"

namespace cardan {
namespace {

/// y = K x (damping: C x) over the velocity components.
void forces(const Model& m, const double* q, bool damping, const Eigen::VectorXd& x, Eigen::VectorXd& y) {
  y.setZero(m.nv);
  for (const HingeLoad& load : m.loads) {
    const hinge_laws::Linear at = hinge_laws::linear(load, q[load.q], 0.0);
    y[load.v] += std::max(0.0, damping ? at.damping : at.stiffness) * x[load.v];
  }
  for (const SweepBody& b : m.bodies) {
    if (b.n_modes == 0) continue;
    const FlexibleBody& f = m.flexible[b.flexible];
    const auto& K = damping ? f.C : f.K;
    for (int i = 0; i < b.n_modes; ++i)
      for (int j = 0; j < b.n_modes; ++j)
        if (!f.K_diagonal || i == j) y[b.etadot + i] += K[f.K_diagonal ? i : j * b.n_modes + i] * x[b.etadot + j];
  }
}

std::string owner(const Model& m, int v, bool damping) {
  for (const UserBody& u : m.user) {
    const int n = static_cast<int>(u.v_names.size());
    if (v >= u.v && v < u.v + n) return fmt::format("the {} of {}.{}", damping ? "damper" : "spring", u.name, u.v_names[v - u.v]);
    if (v >= u.etadot && v < u.etadot + u.n_modes)
      return fmt::format("{}mode {} of {}", damping ? "the damping of " : "", v - u.etadot + 1, u.name);
  }
  return "velocity " + std::to_string(v);
}

}  // namespace

FastestMotions fastest_motions(std::shared_ptr<const Model> model, const double* q) {
  const Model& m = *model;
  FastestMotions fastest;
  bool any = !m.loads.empty();
  for (const SweepBody& b : m.bodies) any = any || b.n_modes > 0;
  if (!any) return fastest;
  std::vector<std::uint8_t> free;
  for (int i = 0; m.has_prescribed() && i < m.nv; ++i) free.push_back(!m.prescribed[i]);
  const bool closed = !m.loops.empty();
  std::optional<operators::TreeOperators> tree;
  std::optional<operators::Erased<std::remove_const_t<decltype(operators::letters::mass_inverse)>>> of_tree;
  const LinearOperator* inverse = nullptr;
  std::optional<operators::ClosedSystem> system;
  try {
    if (closed) {
      system.emplace(model, q);
    } else {
      tree.emplace(model);
      tree->at(q);
      tree->articulate({.free = free});
      inverse = &static_cast<const LinearOperator&>(of_tree.emplace(*tree));
    }
  } catch (const NumericsError&) {
    return fastest;  // a direction without inertia: the run says so
  }
  for (const bool damping : {false, true}) {
    Eigen::VectorXd x(m.nv), y(m.nv), f(m.nv);
    for (int i = 0; i < m.nv; ++i) x[i] = free.empty() || free[i] ? 1.0 + 0.1 * std::sin(3.7 * i) : 0.0;
    if (closed) x = system->respond(x);  // a motion that loops allow
    double value = 0.0;
    for (int k = 0; k < 20; ++k) {  // power iteration, in the norm of K where M^-1 K is symmetric
      forces(m, q, damping, x, f);
      const double before = x.dot(f);
      if (!(before > 0.0)) break;
      if (closed)
        y = system->respond(f);
      else
        inverse->mult(f, y);
      for (int i = 0; i < m.nv; ++i)
        if (!free.empty() && !free[i]) y[i] = 0.0;
      value = f.dot(y) / before;
      if (!(y.norm() > 0.0) || !std::isfinite(y.norm())) break;
      x = y / y.norm();
    }
    const double rate = damping ? value : std::sqrt(value);
    if (!(rate > 0.0)) continue;
    forces(m, q, damping, x, f);
    Eigen::Index largest = 0;
    x.cwiseProduct(f).maxCoeff(&largest);
    FastestMotion& found = damping ? fastest.decays : fastest.swings;
    found = {rate, damping, owner(m, static_cast<int>(largest), damping)};
  }
  return fastest;
}

}  // namespace cardan
