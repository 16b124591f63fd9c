#pragma once
// A random tree at its state, the dense twin beside it, and the subgraphs of it of which the twin knows the mass matrix.
#include "core/operators/apply.hpp"
#include "core/operators/tree_operators.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "tests/operators/compare.hpp"

namespace cardan::test {

using operators::TreeOperators;

constexpr double kIdentity = 1e-12;

/// Floating, so that much is free to move.
inline std::vector<TreeOptions> floating_trees() {
  std::vector<TreeOptions> out = kinds_of_trees();
  for (TreeOptions& o : out) o.floating = true;
  return out;
}

/// Operators with their dense counterpart.
struct View {
  const char* name;
  TreeOperators ops;
  MatrixXd M;                      // of the twin
  std::vector<int> components;     // of the model's v
  std::vector<int> nodes;          // the tips that take part
  std::function<MatrixXd(int)> J;  // of a node, 6 x components, of the twin
  MatrixXd jacobian(const std::vector<int>& of) const {
    MatrixXd out(6 * static_cast<Eigen::Index>(of.size()), M.cols());
    for (std::size_t i = 0; i < of.size(); ++i) out.middleRows<6>(6 * static_cast<Eigen::Index>(i)) = J(of[i]);
    return out;
  }
  double condition() const { return scaled_condition(M); }
};

class Scene {
 public:
  explicit Scene(const RandomTree& from)
      : tree(from),
        model(compiled(tree.spec, {.world_wrenches = true})),
        state(model->initial_state()),
        ops(model),
        twin(reference::DenseTwin<double>(tree.spec).at(state.q, state.v)) {
    ops.at(state.q.data());
  }
  /// The tree; a subtree; the path to the deepest body (the bodies on it alone).
  std::vector<View> views() {
    std::vector<View> out;
    TreeOperators whole(model);
    whole.at(state.q.data());
    out.push_back(view("tree", std::move(whole)));
    const int n = static_cast<int>(model->bodies.size());
    if (n > 2) {
      int root = 1 + static_cast<int>(tree.seed % static_cast<unsigned>(n - 1));
      out.push_back(view("subtree", ops.subgraph(ops.subtree(root))));
      out.push_back(path_view(ops.path(n - 1, 0)));
    }
    return out;
  }
  std::vector<reference::NodeWrench<double>> twin_wrenches() const {  // those in node axes
    std::vector<reference::NodeWrench<double>> out;
    for (const Load& l : tree.loads) out.push_back({l.body, l.node, l.wrench});
    return out;
  }
  std::vector<NodeWrench> wrenches() const {
    std::vector<NodeWrench> out;
    for (const Load& l : tree.loads) {
      NodeWrench w;
      w.node = model->find_node(l.body + "." + l.node);
      w.f = force(l.wrench.data());
      out.push_back(w);
    }
    return out;
  }
  /// The description of these bodies alone; whoever they hang on is among them.
  SystemSpec only(const TreeOperators& sub) const {
    SystemSpec spec = tree.spec;
    std::erase_if(spec.bodies, [&](const BodySpec& b) {
      return sub.index_of(model->user[static_cast<std::size_t>(model->find_body(b.name))].sweep) < 0;
    });
    return spec;
  }
  reference::DenseState<double> twin_of(const TreeOperators& sub) const {
    const SystemSpec spec = only(sub);
    const State s = compiled(spec)->initial_state();
    return reference::DenseTwin<double>(spec).at(s.q, s.v);
  }

  RandomTree tree;
  std::shared_ptr<const Model> model;
  State state;
  TreeOperators ops;
  reference::DenseState<double> twin;

 private:
  std::vector<int> tips(const TreeOperators& sub) const {
    std::vector<int> out;
    for (const BodySpec& b : tree.spec.bodies) {
      const int node = model->find_node(b.name + ".tip");
      if (sub.index_of(model->nodes[static_cast<std::size_t>(node)].sweep) >= 0) out.push_back(node);
    }
    return out;
  }
  MatrixXd jacobian_of(const reference::DenseState<double>& dense, int node) const {
    const std::string& body = model->user[static_cast<std::size_t>(model->nodes[static_cast<std::size_t>(node)].body)].name;
    return dense.node(body, "tip").J;
  }
  /// A subgraph with all that hangs on it: its rows and columns of what the twin has.
  View view(const char* name, TreeOperators sub) const {
    View out{name, std::move(sub), {}, {}, {}, {}};
    out.components.resize(static_cast<std::size_t>(out.ops.size(operators::Space::hinge)));
    for (int j = 0; j < model->nv; ++j)
      if (const int place = out.ops.place_of_velocity(j); place >= 0) out.components[static_cast<std::size_t>(place)] = j;
    out.M = twin.M(out.components, out.components);
    out.nodes = tips(out.ops);
    out.J = [this, components = out.components](int node) -> MatrixXd { return jacobian_of(twin, node)(Eigen::all, components); };
    return out;
  }
  View path_view(std::vector<int> bodies) const {
    View out = view("path", ops.subgraph(std::move(bodies)));
    const auto dense = std::make_shared<const reference::DenseState<double>>(twin_of(out.ops));
    out.M = dense->M;
    out.J = [this, dense](int node) -> MatrixXd { return jacobian_of(*dense, node); };
    return out;
  }
};

/// The worst error over the views of each tree.
inline void for_all_views(const std::vector<TreeOptions>& kinds, double tolerance, const std::function<double(View&, Scene&)>& property,
                          int count = kTrees) {
  for (const TreeOptions& options : kinds)
    for_all_trees(
        options, tolerance,
        [&](const RandomTree& tree) {
          Scene s(tree);
          double worst = 0.0;
          if (s.model->nv == 0) return worst;
          for (View& v : s.views()) {
            if (v.M.size() == 0) continue;
            const double error = property(v, s);
            if (!(error <= worst)) worst = error;
            if (std::isnan(error)) return HUGE_VAL;
          }
          return worst;
        },
        count);
}

inline void prepare(TreeOperators& ops, std::span<const std::uint8_t> free = {}) {
  ops.articulate({.free = free});
  ops.operational_space();
}

/// The same sequence for a seed on every machine.
inline VectorXd some_vector(unsigned seed, Eigen::Index size) {
  VectorXd out(size);
  std::uint64_t x = 88172645463325252ull + seed;
  for (Eigen::Index i = 0; i < size; ++i) {
    for (int r = 0; r < 3; ++r) x ^= x << 13, x ^= x >> 7, x ^= x << 17;
    out[i] = static_cast<double>(x >> 11) / 4503599627370496.0 - 1.0;
  }
  return out;
}
/// Some components free, some not.
inline std::vector<std::uint8_t> some_mask(unsigned seed, Eigen::Index size, double above = -0.2) {
  const VectorXd x = some_vector(seed + 1000, size);
  std::vector<std::uint8_t> out(static_cast<std::size_t>(size));
  for (Eigen::Index i = 0; i < size; ++i) out[static_cast<std::size_t>(i)] = x[i] > above;
  return out;
}
inline std::vector<int> where(std::span<const std::uint8_t> mask, int value) {
  std::vector<int> out;
  for (std::size_t i = 0; i < mask.size(); ++i)
    if (mask[i] == value) out.push_back(static_cast<int>(i));
  return out;
}
/// The columns (and rows) of a linear map.
inline MatrixXd matrix_of(Eigen::Index cols, const std::function<VectorXd(const VectorXd&)>& map) {
  MatrixXd out;
  for (Eigen::Index j = 0; j < cols; ++j) {
    const VectorXd y = map(VectorXd::Unit(cols, j));
    if (j == 0) out.resize(y.size(), cols);
    out.col(j) = y;
  }
  return out;
}

}  // namespace cardan::test
