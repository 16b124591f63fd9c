#include "core/operators/mass_matrix.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/diagnostic.hpp"
#include "core/operators/apply.hpp"

namespace cardan::operators {

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

int hinge_size(const OperatorBody& b) { return b.nh + b.m; }

/// Every pair of bodies was written once, on one side of the diagonal: the other side, tile by tile (a long row is far apart in memory).
void mirror(MatrixXd& a) {
  constexpr Eigen::Index kTile = 32;
  for (Eigen::Index c = 0; c < a.cols(); c += kTile)
    for (Eigen::Index r = 0; r <= c; r += kTile)
      for (Eigen::Index j = c; j < std::min(c + kTile, a.cols()); ++j)
        for (Eigen::Index i = r; i < std::min(r + kTile, j); ++i) a(i, j) = a(j, i) = a(i, j) != 0.0 ? a(i, j) : a(j, i);
}

}  // namespace

void require_size(const TreeOperators& tree, const char* what, Space space, Eigen::Index size) {
  if (size == tree.size(space)) return;
  constexpr const char* names[] = {"hinge", "body", "node"};
  refuse(Code::operator_shape, {what}, fmt::format("{} numbers ({} space)", tree.size(space), names[static_cast<int>(space)]),
         fmt::format("{}", size));
}

VectorXd body_velocities(const TreeOperators& tree, const VectorXd& v) {
  tree.require(Kind::H);
  require_size(tree, "velocities", Space::hinge, v.size());
  VectorXd V(tree.size(Space::body));
  for (int i = 0; i < static_cast<int>(tree.bodies().size()); ++i) {
    const OperatorBody& b = tree.bodies()[i];
    V.segment(b.at, 6 + b.m).noalias() = tree.Ht_all(i) * v.segment(b.v, hinge_size(b));
    if (b.parent < 0) continue;
    const OperatorBody& p = tree.bodies()[b.parent];
    V.segment<6>(b.at).noalias() += tree.A(i) * V.segment(p.at, 6 + p.m);
  }
  return V;
}

VectorXd hinge_forces(const TreeOperators& tree, VectorXd f) {
  tree.require(Kind::H);
  require_size(tree, "forces on bodies", Space::body, f.size());
  VectorXd tau(tree.size(Space::hinge));
  for (int i = static_cast<int>(tree.bodies().size()) - 1; i >= 0; --i) {
    const OperatorBody& b = tree.bodies()[i];
    tau.segment(b.v, hinge_size(b)).noalias() = tree.Ht_all(i).transpose() * f.segment(b.at, 6 + b.m);
    if (b.parent < 0) continue;
    const OperatorBody& p = tree.bodies()[b.parent];
    f.segment(p.at, 6 + p.m).noalias() += tree.A(i).transpose() * f.segment<6>(b.at);
  }
  return tau;
}

VectorXd mass_times(const TreeOperators& tree, const VectorXd& v) {
  const VectorXd V = body_velocities(tree, v);
  VectorXd f(V.size());
  tree.apply(Kind::M, false, V.data(), f.data());
  return hinge_forces(tree, std::move(f));
}

VectorXd inverse_mass_times(const TreeOperators& tree, const VectorXd& tau) { return apply(letters::mass_inverse, tree, tau); }

std::vector<MatrixXd> composite_inertias(const TreeOperators& tree) {
  tree.require(Kind::M);
  const int n = static_cast<int>(tree.bodies().size());
  std::vector<MatrixXd> R(n);
  for (int i = 0; i < n; ++i) R[i] = tree.M(i);
  for (int i = n - 1; i >= 0; --i) {
    const int p = tree.bodies()[i].parent;
    if (p < 0) continue;
    const MatrixXd shifted = R[i].topLeftCorner<6, 6>() * tree.A(i);
    R[p].noalias() += tree.A(i).transpose() * shifted;
    R[p].triangularView<Eigen::StrictlyUpper>() = R[p].transpose().eval();
  }
  return R;
}

MatrixXd mass_matrix(const TreeOperators& tree) {
  const std::vector<MatrixXd> R = composite_inertias(tree);
  MatrixXd mass = MatrixXd::Zero(tree.size(Space::hinge), tree.size(Space::hinge));
  for (int k = static_cast<int>(tree.bodies().size()) - 1; k >= 0; --k) {
    const OperatorBody& b = tree.bodies()[k];
    const int nk = hinge_size(b);
    MatrixXd X = R[k] * tree.Ht_all(k);
    mass.block(b.v, b.v, nk, nk).noalias() = tree.Ht_all(k).transpose() * X;
    for (int j = k; tree.bodies()[j].parent >= 0;) {
      X = (tree.A(j).transpose() * X.topRows<6>()).eval();
      j = tree.bodies()[j].parent;
      const OperatorBody& a = tree.bodies()[j];
      mass.block(a.v, b.v, hinge_size(a), nk).noalias() = tree.Ht_all(j).transpose() * X;
    }
  }
  mirror(mass);
  return mass;
}

// Every body j carries W_j = psi(c, par j) K_j inboard. Where it passes body c its block with c is due, and at the nearest common
// ancestor of i and j theirs.
MatrixXd mass_matrix_inverse(const TreeOperators& tree) {
  tree.require(Kind::Y);
  const int n = static_cast<int>(tree.bodies().size());
  MatrixXd inverse = MatrixXd::Zero(tree.size(Space::hinge), tree.size(Space::hinge));
  const auto place = [&](int i, int j, const MatrixXd& block) {
    const int vi = tree.bodies()[i].v, vj = tree.bodies()[j].v;
    inverse.block(vi, vj, block.rows(), block.cols()) = block;
  };
  std::vector<MatrixXd> W(n);                // of body j, at the body that it has reached
  std::vector<std::vector<int>> arrived(n);  // the bodies whose W stands at c, by child of c
  for (int c = n - 1; c >= 0; --c) {
    const OperatorBody& b = tree.bodies()[c];
    const int size = hinge_size(b);
    MatrixXd D_inverse = MatrixXd::Zero(size, size);
    for (int j = 0; j < size; ++j) D_inverse(j, j) = tree.is_free(b.v + j) ? 1.0 : 0.0;
    tree.S(c).triangularView<Eigen::Lower>().solveInPlace(D_inverse);
    D_inverse = (D_inverse.transpose() * D_inverse).eval();
    const MatrixXd& G = tree.G(c);
    const MatrixXd GY = G.transpose() * tree.Y_plus(c);
    place(c, c, D_inverse + GY * G);
    const MatrixXd row = D_inverse * tree.Ht(c).transpose() - GY + GY * G * tree.Ht(c).transpose();  // D^-1 H - G* Y+ tau_bar
    for (const int j : arrived[c]) {
      place(c, j, -row * W[j]);
      W[j] -= (G * (tree.Ht(c).transpose() * W[j])).eval();  // tau_bar(c)
    }
    if (b.parent < 0) continue;
    W[c] = G;
    std::vector<int>& here = arrived[c];
    here.push_back(c);
    for (const int j : here) W[j] = (tree.A(c).transpose() * W[j].topRows<6>()).eval();
    std::vector<int>& there = arrived[b.parent];
    if (!there.empty())
      for (const int j : here) {
        const MatrixXd YW = tree.Y(b.parent) * W[j];
        for (const int i : there) place(i, j, W[i].transpose() * YW);
      }
    there.insert(there.end(), here.begin(), here.end());
    here.clear(), here.shrink_to_fit();
  }
  mirror(inverse);
  return inverse;
}

}  // namespace cardan::operators
