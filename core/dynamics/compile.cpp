// compile(): assemble(), and where masses grow by large ratios per link a try at some states, after which v' is refined or not.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "core/dynamics/inverse.hpp"
#include "core/dynamics/loops.hpp"
#include "core/model/absolute.hpp"
#include "core/model/loops.hpp"
#include "core/model/rotary_terms.hpp"
#include "core/model/validate.hpp"
#include "core/soa/kernels.hpp"

namespace cardan {
namespace {

constexpr double kGrowth =
    100.0;  // of masses: below it no model was found to lose more than 1e-12 of v' (docs/mathematics/tree_algorithms.md, 10)
constexpr int kWindow = 6;       // hinge velocities between the two bodies, those of the outboard body counted
constexpr int kStates = 32;      // tried
constexpr double kLoss = 3e-14;  // of v' at any of them: refined from here on. At others it may be a few times as large
constexpr double kLong = 50.0;   // bodies: beyond, rounding that refinement is not for grows as the root of their number

struct Growth {
  double ratio = 0.0;
  int body = 0, ancestor = 0;
};

/// The largest ratio of the mass of a body to that of one at most kWindow hinge velocities inboard of it.
Growth growth(const Model& m) {
  Growth most;
  for (int k = 1; k < static_cast<int>(m.bodies.size()); ++k) {
    const SweepBody* b = &m.bodies[k];
    if (b->kind == BodyKernel::rotor) continue;
    const double mass = b->M_sweep.m;
    for (int velocities = b->nv; velocities <= kWindow && b->parent > 0; velocities += b->nv) {
      const int a = b->parent;
      b = &m.bodies[a];
      if (const double ratio = mass / b->M_sweep.m; ratio > most.ratio) most = {ratio, k, a};
    }
  }
  return most;
}

/// What the refinement finds wrong with v' of the sweeps, relative, the largest of kStates pseudo-random states: hinges turned by up
/// to pi and moved by up to 1 m, velocities up to 1 rad/s and 1 m/s.
double loss(const Model& m) {
  std::mt19937_64 random(1);
  const auto vector = [&](int n, double size) {
    Eigen::VectorXd x(n);
    for (double& one : x) one = size * (-1.0 + 2.0 * static_cast<double>(random() >> 11) * 0x1.0p-53);
    return x;
  };
  Workspace ws(m);
  const State initial = m.initial_state();
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(m.nv);
  double worst = 0.0;
  for (int i = 0; i < kStates; ++i) {
    Eigen::VectorXd q(m.nq), vdot(m.nv);
    const Eigen::VectorXd move = vector(m.nv, 3.0), v = vector(m.nv, 1.0);
    m.retract(initial.q.data(), move.data(), q.data());
    const Inputs in{.q = q.data(), .v = v.data(), .vdot = zero.data()};
    if (!forward_dynamics(m, ws, in, vdot.data())) continue;
    const Eigen::VectorXd first = vdot;
    soa::sweeps<double>().refine(m, ws, in, vdot.data());
    const double size = first.cwiseAbs().maxCoeff();
    if (size > 0.0) worst = std::max(worst, (vdot - first).cwiseAbs().maxCoeff() / size);
  }
  return worst;
}

/// `instead`: what takes no hinge in square-root form.
void refuse_square_root(const SystemSpec& spec, const std::string& instead, const std::string& hint) {
  const auto asks = [](const BodySpec& b) { return b.hinge.factor == HingeFactor::square_root && !b.hinge.locked; };
  const auto body = std::ranges::find_if(spec.bodies, asks);
  if (body == spec.bodies.end()) return;
  refuse(Code::unsupported, spec.locate(body_path(*body) + ".hinge.factor"), "cholesky " + instead,
         hinge_factors()[static_cast<std::size_t>(body->hinge.factor)], hint);
}

std::string name_of(const Model& m, int k) { return k > 0 ? m.user[m.owner[k]].name : "world"; }

}  // namespace

std::shared_ptr<const Model> compile(const SystemSpec& spec, const Registry& registry, const CompileOptions& options) {
  return compile(std::make_shared<const SystemSpec>(spec), registry, options);
}

std::shared_ptr<const Model> compile(std::shared_ptr<const SystemSpec> spec, const Registry& registry, const CompileOptions& options) {
  if (spec->loop_form == LoopForm::dae || (spec->loop_form == LoopForm::embedding && !spec->loops.empty()))  // with factors of their own
    refuse_square_root(*spec, "with loop_form: " + loop_forms()[static_cast<std::size_t>(spec->loop_form)],
                       "loop_form: multipliers takes it, and auto is that then");
  spec = with_kept_rotary_terms(std::move(spec));
  std::shared_ptr<Model> model = assemble(spec, registry, options, false);
  if (!model->loops.empty()) prepare_loops(*model);
  if (model->spec->loop_form == LoopForm::dae) {
    model->loops.absolute = in_absolute_coordinates(*model, registry, options);
    if (!model->loops.empty()) sweep_absolute(*model);
  }
  if (!model->loops.empty() || model->loops.absolute) return model;
  if (model->n_modes > 0 || !model->varies.empty()) return model;
  const Growth most = growth(*model);
  if (!(most.ratio > kGrowth)) return model;
  const std::shared_ptr<Model> graded = assemble(std::move(spec), registry, options, true);
  const double lost = loss(*graded);
  if (!(lost > kLoss * std::max(1.0, std::sqrt(static_cast<double>(model->bodies.size()) / kLong)))) return model;
  const std::string growing = fmt::format("the mass of {} is {:.3g} times that of {}, few hinges inboard of it",
                                          name_of(*graded, most.body), most.ratio, name_of(*graded, most.ancestor));
  // Reflections mix the tension of a heavy body into the moments of a light one, and no pass takes that out.
  refuse_square_root(*graded->spec, "where masses grow by large ratios per link and v' is refined", growing);
  graded->program.push_back({OpCode::refine});
  graded->refinement = fmt::format("{}: without, v' loses up to {:.1e} of itself", growing, lost);
  return graded;
}

}  // namespace cardan
