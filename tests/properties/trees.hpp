#pragma once
// A property over many random trees: the error it gives for each must stay below the tolerance. What fails is cut down
// to the smallest tree that still fails, and printed with its seed.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "core/dynamics/inverse.hpp"
#include "core/dynamics/observe.hpp"
#include "tests/support/builders.hpp"
#include "tests/support/random_tree.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

inline std::size_t idx(int i) { return static_cast<std::size_t>(i); }

inline const TreeOptions kAny;
using Property = std::function<double(const RandomTree&)>;

/// The error, infinite where the property throws or is no number.
inline double error_of(const Property& property, const RandomTree& tree, std::string* what = nullptr) {
  try {
    const double e = property(tree);
    return std::isnan(e) ? HUGE_VAL : e;
  } catch (const std::exception& e) {
    if (what) *what = e.what();
    return HUGE_VAL;
  }
}

inline void for_all_trees(const TreeOptions& options, double tolerance, const Property& property, int count = 60) {
  double worst = 0.0;
  for (unsigned seed = first_seed(); seed < first_seed() + static_cast<unsigned>(count); ++seed) {
    RandomTree tree = random_tree(seed, options);
    const double error = error_of(property, tree);
    if (error <= tolerance) {
      worst = worse(worst, error);
      continue;
    }
    for (bool smaller = true; smaller;) {
      smaller = false;
      for (const BodySpec& b : tree.spec.bodies) {
        const RandomTree cut = without(tree, b.name);
        if (cut.spec.bodies.empty() || error_of(property, cut) <= tolerance) continue;
        tree = cut;
        smaller = true;
        break;
      }
    }
    std::string what;
    const double left = error_of(property, tree, &what);
    ADD_FAILURE() << fmt::format("error {:.2e} (limit {:.0e}); cut down to {:.2e} {}:\n{}", error, tolerance, left, what, describe(tree));
    return;
  }
  ::testing::Test::RecordProperty("worst", fmt::format("{:.1e} of {:.0e}", worst, tolerance));
}

/// [hinge; modes] by body, in the order of the model's v.
inline VectorXd in_user_order(const Model& model, const ByBody& by_body) {
  VectorXd out(model.nv);
  for (const UserBody& u : model.user) out.segment(u.v, u.nv + u.n_modes) = by_body.at(u.name);
  return out;
}
inline ByBody by_body(const Model& model, const VectorXd& v) {
  ByBody out;
  for (const UserBody& u : model.user) out[u.name] = v.segment(u.v, u.nv + u.n_modes);
  return out;
}

/// Largest difference over the largest value, of all bodies together.
inline double apart(const ByBody& a, const ByBody& b) {
  double difference = a.size() == b.size() ? 0.0 : HUGE_VAL, size = 0.0;
  for (const auto& [name, x] : a) {
    difference = worse(difference, distance(x, b.at(name)));
    size = worse(size, largest(x));
  }
  return relative(difference, size == 0.0 ? 1.0 : size);
}
template <class A, class B>
double apart(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b, double at_least = 0.0) {
  const double size = worse(at_least, largest(b));
  return relative(distance(a, b), size == 0.0 ? 1.0 : size);
}

/// A compiled tree at its state under its loads.
class Loaded {
 public:
  explicit Loaded(const RandomTree& tree, CompileOptions options = {})
      : model((options.world_wrenches = true, compiled(tree.spec, options))), ws(*model), state(model->initial_state()) {
    tau = in_user_order(*model, tree.tau);
    vdot_given = in_user_order(*model, tree.vdot);
    for (std::size_t i = 0; i < model->prescribed.size(); ++i)
      if (!model->prescribed[i]) vdot_given[static_cast<Eigen::Index>(i)] = 0.0;
    for (const Load& l : tree.loads) {
      NodeWrench w;
      w.node = model->find_node(l.body + "." + l.node);
      w.world_axes = l.world_axes;
      w.f = force(l.wrench.data());
      wrenches.push_back(w);
    }
  }
  Inputs in() const {
    Inputs i;
    i.q = state.q.data(), i.v = state.v.data(), i.tau = tau.data(), i.vdot = vdot_given.data(), i.wrenches = wrenches;
    return i;
  }
  VectorXd forward() {
    VectorXd out(model->nv);
    if (!forward_dynamics(*model, ws, in(), out.data())) throw NumericsError(describe_breakdown(*model, ws.breakdown, 0.0));
    return out;
  }
  VectorXd inverse(const VectorXd& vdot) {
    VectorXd out(model->nv);
    Inputs i = in();
    i.vdot = vdot.data();
    inverse_dynamics(*model, ws, i, out.data());
    return out;
  }
  /// Accelerations of all nodes after forward(): [angular; linear], node axes, one column each, in order of the names.
  std::map<std::string, Vector6d> node_accelerations(const VectorXd& vdot) {
    Observer observer(*model, ws);
    observer.update(in(), vdot.data());
    std::map<std::string, Vector6d> out;
    for (std::size_t i = 0; i < model->nodes.size(); ++i) out[model->nodes[i].name] = observer.node(static_cast<int>(i)).acceleration;
    return out;
  }

  std::shared_ptr<const Model> model;
  Workspace ws;
  State state;
  VectorXd tau, vdot_given;
  std::vector<NodeWrench> wrenches;
};

inline double apart(const std::map<std::string, Vector6d>& a, const std::map<std::string, Vector6d>& b) {
  double difference = a.size() == b.size() ? 0.0 : HUGE_VAL, size = 0.0;
  for (const auto& [name, x] : a) {
    difference = worse(difference, distance(x, b.at(name)));
    size = worse(size, largest(x));
  }
  return relative(difference, size);
}

/// How far something is from differences with a step of h: with h or a quarter of it, whichever is nearer. What is wrong is wrong by both;
/// next to where a posture is singular the truncation of the longer one shows, elsewhere the rounding of the shorter.
template <class F>
double by_differences(double h, const F& error_with_step) {
  const double longer = error_with_step(h), shorter = error_with_step(h / 4.0);
  return std::isfinite(longer) && std::isfinite(shorter) ? std::min(longer, shorter) : HUGE_VAL;
}

}  // namespace cardan::test
