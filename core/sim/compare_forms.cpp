#include "core/sim/compare_forms.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/dynamics/observe.hpp"
#include "core/model/loops.hpp"
#include "core/sim/reference_check.hpp"

namespace cardan {
namespace {

constexpr double kCancelled = 1e3 * std::numeric_limits<double>::epsilon();  // [1/m] over a size of 1 m

/// What a form says of a state. `push`, `turn` [N, N m]: what the accelerations of the bodies take; multipliers and reactions may be zero
/// but for rounding of these.
struct Said {
  Eigen::VectorXd vdot, multipliers, moments, forces;
  double push = 0.0, turn = 0.0;
  double rounding = 0.0;  // [N, N m] of products of velocities that cancel where nothing turns
};

Said said_by(Simulation& sim) {
  Said out;
  const Observer& seen = sim.observe();
  const Model& m = sim.model();
  const auto bodies = static_cast<Eigen::Index>(m.user.size());
  out.vdot = sim.vdot();
  out.moments.resize(3 * bodies), out.forces.resize(3 * bodies);
  double size = 0.0;  // of the vehicle and its loops
  for (const Loop& loop : m.loops.all) size = std::max(size, loop.lever);
  const Eigen::Vector3d first = bodies > 0 ? to_eigen(seen.body_pose(0).p) : Eigen::Vector3d::Zero();
  for (Eigen::Index i = 0; i < bodies; ++i) {
    const UserBody& body = m.user[static_cast<std::size_t>(i)];
    const Force<double> f = seen.hinge_wrench(static_cast<int>(i));
    out.moments.segment<3>(3 * i) << f.n.x, f.n.y, f.n.z;
    out.forces.segment<3>(3 * i) << f.f.x, f.f.y, f.f.z;
    const NodeState node = seen.node(m.find_node(body.name));
    out.push += body.mass * node.acceleration.tail<3>().norm();
    out.rounding += kCancelled * body.mass * node.velocity.tail<3>().squaredNorm();
    size = std::max(size, (node.position - first).norm());
  }
  out.turn = out.push * size;
  const std::span<const double> lambda = sim.loop_forces().multipliers;
  out.multipliers = Eigen::VectorXd::Map(lambda.data(), static_cast<Eigen::Index>(lambda.size()));
  return out;
}

/// `least`: what they are compared with where all are smaller; `nothing`: rounding, where all of it is less.
double apart(const Eigen::VectorXd& a, const Eigen::VectorXd& b, double least = 0.0, double nothing = 0.0) {
  if (a.size() == 0) return 0.0;
  const double most = std::max(least, b.cwiseAbs().maxCoeff<Eigen::PropagateNaN>());
  const double difference = (a - b).cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
  return difference == 0.0 || (most <= nothing && difference <= nothing) ? 0.0 : difference / most;
}

std::string told(const InputError& e) {
  const Diagnostic& first = e.diagnostics().front();
  return fmt::format("it takes {}, not {}", first.expected, first.got);
}

}  // namespace

std::optional<ComparedForms> compare_forms(Simulation& sim, const Registry& registry, const CompileOptions& options) {
  if (sim.model().loops.empty()) return {};
  ComparedForms out;
  std::optional<Said> first;
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers, LoopForm::dae}) {
    ComparedForm& of = out.forms.emplace_back();
    of.form = form;
    auto spec = std::make_shared<SystemSpec>(*sim.model().spec);
    spec->loop_form = form;
    try {
      Simulation other(compile(std::shared_ptr<const SystemSpec>(spec), registry, options), sim.options());
      other.take_over(sim);
      const Said said = said_by(other);
      if (!first) first = said;
      of.vdot = apart(said.vdot, first->vdot);
      of.multipliers = apart(said.multipliers, first->multipliers, std::max(first->push, first->turn), first->rounding);
      of.reactions = std::max(apart(said.moments, first->moments, first->turn, first->rounding),
                              apart(said.forces, first->forces, first->push, first->rounding));
      if (!out.no_twin.empty()) continue;
      try {
        of.vdot = difference_from_twin(other);
      } catch (const InputError& e) {
        out.no_twin = told(e);
      }
    } catch (const InputError& e) {
      of.refused = told(e);
    } catch (const NumericsError& e) {
      of.refused = e.failure().what;
    }
  }
  return out;
}

}  // namespace cardan
