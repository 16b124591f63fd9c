#pragma once
// The forms that close loops, beside each other and beside the dense twin.
#include "core/dynamics/loops.hpp"
#include "core/dynamics/observe.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "core/reference/quad.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {

/// Relative to the largest of `want`.
inline double error_of(const VectorXd& got, const VectorXd& want) { return relative(distance(got, want), largest(want)); }

/// Of all rows, after forward dynamics at `in`.
inline VectorXd multipliers(const Model& model, Workspace& ws, const Inputs& in) {
  settle_loops(model, ws, in);
  return Eigen::Map<const VectorXd>(loop_forces(ws).multipliers.data(), model.loops.rows);
}

/// v', multipliers, accelerations of nodes of all forms, and v' of the twin.
inline double forms_apart(SystemSpec spec, const VectorXd& vdot_given = {},
                          const std::vector<LoopForm>& forms = {LoopForm::embedding, LoopForm::multipliers, LoopForm::dae}) {
  using reference::Quad;
  std::vector<VectorXd> vdot, lambda, nodes;
  for (const LoopForm form : forms) {
    spec.loop_form = form;
    const auto model = compiled(spec);
    EXPECT_EQ(model->loops.embedding != nullptr, form == LoopForm::embedding);
    Workspace ws(*model);
    const State at = model->initial_state();
    VectorXd out(model->nv), tau = VectorXd::LinSpaced(model->nv, -0.5, 1.5);
    const Inputs in{.q = at.q.data(), .v = at.v.data(), .tau = tau.data(), .vdot = vdot_given.size() > 0 ? vdot_given.data() : nullptr};
    EXPECT_TRUE(forward_dynamics(*model, ws, in, out.data()));
    vdot.push_back(out);
    lambda.push_back(multipliers(*model, ws, in));
    Observer seen(*model, ws);
    seen.update(in, out.data());
    VectorXd a(3 * static_cast<Eigen::Index>(model->nodes.size()));
    for (std::size_t i = 0; i < model->nodes.size(); ++i)
      a.segment<3>(3 * static_cast<Eigen::Index>(i)) = seen.node(static_cast<int>(i)).acceleration.tail<3>();
    nodes.push_back(a);
    if (vdot_given.size() > 0) continue;
    const reference::DenseTwin<Quad> twin(spec);
    const auto exact = twin.at(at.q.cast<Quad>(), at.v.cast<Quad>()).closed(tau.cast<Quad>()).vdot;
    VectorXd want(model->nv);
    for (Eigen::Index i = 0; i < model->nv; ++i) want[i] = static_cast<double>(exact[i]);
    vdot.push_back(want);
  }
  double worst = 0.0;
  for (const VectorXd& x : lambda) worst = worse(worst, error_of(x, lambda.front()));
  for (const VectorXd& x : vdot) worst = worse(worst, error_of(x, vdot.back()));
  // Accelerations of nodes are sums of v' by arms of a metre, in which most of it cancels where many links follow one another.
  const double summed = worse(largest(nodes.front()), largest(vdot.back()));
  for (const VectorXd& x : nodes) worst = worse(worst, relative(distance(x, nodes.front()), summed));
  return worst;
}

}  // namespace cardan::test
