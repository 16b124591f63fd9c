#include "core/operators/log_det.hpp"

#include <algorithm>

#include "core/base/poll.hpp"

namespace cardan::operators {
namespace {

using Eigen::MatrixXd;

/// tr(A B) of square A.
double trace_of_product(const MatrixXd& A, const MatrixXd& B) { return A.cwiseProduct(B.transpose()).sum(); }

/// 2 tr(Y(p) dPhi P+ Phi*): body i is moved against its inboard body.
double shift_term(const TreeOperators& tree, int i, const PositionBlocks& d) {
  const OperatorBody& b = tree.bodies()[i];
  if (b.parent < 0) return 0.0;
  const Matrix6X felt = tree.P_plus(i).topLeftCorner<6, 6>() * tree.A(i);
  return 2.0 * trace_of_product(d.A[b.sweep].transpose() * felt, tree.Y(b.parent));
}

/// tr(Y dM) + 2 tr(G* dH*) - 2 tr(Y+ G dH P+): inertia and hinge map of body i.
double own_term(const TreeOperators& tree, int i, const PositionBlocks& d) {
  const auto k = (tree.bodies()[i].sweep);
  const MatrixXd &dHt = d.Ht[k], &G = tree.G(i);
  return trace_of_product(tree.Y(i), d.M[k]) + 2.0 * G.cwiseProduct(dHt).sum() -
         2.0 * trace_of_product(tree.Y_plus(i) * G, dHt.transpose() * tree.P_plus(i));
}

/// What is moved at once: component c of every hinge, or mode c of every body of one parity of depth.
struct Pass {
  int component;
  int parity;  // -1: hinges
};

std::vector<Pass> passes_of(const TreeOperators& tree, const std::vector<int>& depth) {
  int hinge = 0, modes[2] = {0, 0};
  for (std::size_t i = 0; i < depth.size(); ++i) {
    hinge = std::max(hinge, tree.bodies()[i].nh);
    int& most = modes[depth[i] % 2];
    most = std::max(most, tree.bodies()[i].m);
  }
  std::vector<Pass> out;
  for (int c = 0; c < hinge; ++c) out.push_back({c, -1});
  for (const int parity : {0, 1})
    for (int c = 0; c < modes[parity]; ++c) out.push_back({c, parity});
  return out;
}

std::vector<int> depths(const TreeOperators& tree) {
  std::vector<int> depth;
  for (const OperatorBody& b : tree.bodies()) depth.push_back(b.parent < 0 ? 0 : depth[b.parent] + 1);
  return depth;
}

}  // namespace

int log_det_passes(const TreeOperators& tree) { return static_cast<int>(passes_of(tree, depths(tree)).size()); }

Eigen::VectorXd log_det_gradient(const TreeOperators& tree) {
  tree.require(Kind::Y);
  const Model& model = tree.model();
  const std::vector<int> depth = depths(tree);
  const int n = static_cast<int>(depth.size());
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(tree.size(Space::hinge));
  std::vector<double> u(model.nv);
  PositionBlocks d;
  for (const Pass& pass : passes_of(tree, depth)) {
    Poll::now();
    const auto moved = [&](int i) {
      const OperatorBody& b = tree.bodies()[i];
      return pass.parity < 0 ? pass.component < b.nh : depth[i] % 2 == pass.parity && pass.component < b.m;
    };
    std::ranges::fill(u, 0.0);
    for (int i = 0; i < n; ++i) {
      const SweepBody& b = model.bodies[tree.bodies()[i].sweep];
      if (moved(i)) u[(pass.parity < 0 ? b.v : b.etadot) + pass.component] = 1.0;
    }
    tree.derivatives(u.data(), d);
    for (int i = 0; i < n; ++i) {
      const OperatorBody& b = tree.bodies()[i];
      if (moved(i)) {
        double& g = gradient[(pass.parity < 0 ? b.v : b.etadot) + pass.component];
        g += shift_term(tree, i, d) + own_term(tree, i, d);
      } else if (pass.parity >= 0 && b.parent >= 0 && moved(b.parent)) {
        gradient[tree.bodies()[b.parent].etadot + pass.component] += shift_term(tree, i, d);
      }
    }
  }
  return gradient;
}

}  // namespace cardan::operators
