#include "core/dynamics/node_compliance.hpp"

#include <fmt/format.h>

#include <cmath>

#include "core/base/diagnostic.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/soa/kernels_compliance.hpp"

namespace cardan {

struct NodeCompliance::Work {
  explicit Work(std::shared_ptr<const Model> m) : model(std::move(m)), workspace(*model) {}
  std::shared_ptr<const Model> model;
  Workspace workspace;
  std::vector<soa::NodeColumns::Node> nodes;
  std::vector<int> first, last;
  std::vector<soa::NodeColumns::Block> blocks;
  Eigen::VectorXd scale;

  soa::NodeColumns of(std::span<const int> list) {
    nodes.resize(list.size()), blocks.resize(list.size() * (list.size() + 1) / 2);
    for (std::size_t a = 0; a < list.size(); ++a) nodes[a].node = list[a], nodes[a].next = -1;
    for (std::vector<int>* x : {&first, &last}) x->assign(model->bodies.size(), -1);
    return {static_cast<int>(list.size()), nodes.data(), first.data(), last.data(), blocks.data()};
  }
};

bool NodeCompliance::takes(const Model& model) {
  return model.rigid && model.loops.empty() && !model.has(OpCode::refine) && !model.has_prescribed();
}

NodeCompliance::NodeCompliance(std::shared_ptr<const Model> model) {
  if (!takes(*model))
    refuse(Code::unsupported, {"compliance of nodes by sweeps"}, "an open tree of rigid bodies whose motions are free", "another",
           "compliance() of the operators of its tree");
  work_ = std::make_unique<Work>(std::move(model));
}
NodeCompliance::~NodeCompliance() = default;
NodeCompliance::NodeCompliance(NodeCompliance&&) noexcept = default;

void NodeCompliance::compliance(const double* q, std::span<const int> nodes, Eigen::MatrixXd& C) {
  const Model& model = *work_->model;
  Workspace& ws = work_->workspace;
  soa::NodeColumns columns = work_->of(nodes);
  soa::sweeps<double>().node_compliance(model, ws, stand_rigid(model, ws, q), columns);
  if (ws.breakdown.body != 0) throw NumericsError(describe_breakdown(model, ws.breakdown, 0.0));
  const auto n = static_cast<int>(nodes.size());
  C.resize(6 * n, 6 * n);
  for (int b = 0, block = 0; b < n; ++b)
    for (int a = 0; a <= b; ++a, ++block)
      for (int r = 0; r < 6; ++r)
        for (int c = a == b ? r : 0; c < 6; ++c) C(6 * a + r, 6 * b + c) = C(6 * b + c, 6 * a + r) = columns.blocks[block].row[r].x[c];
}

// By Cholesky with a unit diagonal, in place: L, then L^-1, then L^-* L^-1.
void NodeCompliance::inertia(const double* q, std::span<const int> nodes, Eigen::MatrixXd& Lambda) {
  compliance(q, nodes, Lambda);
  constexpr double kNone = 1e-14;  // a pivot that is round-off
  Eigen::MatrixXd& L = Lambda;
  const Eigen::Index n = L.rows();
  Eigen::VectorXd& scale = work_->scale;
  scale.resize(n);
  for (Eigen::Index j = 0; j < n; ++j) scale[j] = L(j, j) > 0.0 ? 1.0 / std::sqrt(L(j, j)) : 0.0;
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = j; i < n; ++i) {
      double sum = L(j, i) * scale[i] * scale[j];  // of the upper triangle, which stays
      for (Eigen::Index k = 0; k < j; ++k) sum -= L(i, k) * L(j, k);
      L(i, j) = sum;
    }
    const double pivot = L(j, j);
    if (!(pivot > kNone))
      throw NumericsError({.code = Code::singular_task,
                           .body = work_->model->nodes[static_cast<std::size_t>(nodes[static_cast<std::size_t>(j / 6)])].name,
                           .what = fmt::format("component {} of 6 of its motion has a pivot of {:.1e}", j % 6 + 1, pivot),
                           .hint = "fewer nodes, or OperationalSpace, which takes the rows that can move"});
    for (Eigen::Index i = j; i < n; ++i) L(i, j) /= std::sqrt(pivot);
  }
  for (Eigen::Index j = 0; j < n; ++j) {
    L(j, j) = 1.0 / L(j, j);
    for (Eigen::Index i = j + 1; i < n; ++i) {
      double sum = 0.0;
      for (Eigen::Index k = j; k < i; ++k) sum -= L(i, k) * L(k, j);
      L(i, j) = sum / L(i, i);
    }
  }
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = 0; i <= j; ++i) {
      double sum = 0.0;
      for (Eigen::Index k = j; k < n; ++k) sum += L(k, i) * L(k, j);
      L(i, j) = sum * scale[i] * scale[j];
    }
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = 0; i < j; ++i) L(j, i) = L(i, j);
}

}  // namespace cardan
