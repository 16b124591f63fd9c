#include "core/operators/system_modes.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/base/diagnostic.hpp"
#include "core/dynamics/hinge_laws.hpp"
#include "core/linalg/dense.hpp"
#include "core/linalg/eigenpairs.hpp"
#include "core/operators/apply.hpp"

namespace cardan::operators {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kResidualLimit = 1e-8;
constexpr int kFew = 32;
constexpr int kDense = 1000;
constexpr double kGap = 1e-4;     // of neighbouring eigenvalues, for the count
constexpr double kRigid = 1e-12;  // of the highest frequency: a lower one is of a motion without stiffness

/// K and C of the hinge space: per body [springs, diagonal; modes, diagonal or full].
struct Joint {
  VectorXd K, C;                                            // diagonals, n
  std::vector<MatrixXd> K_modes, C_modes, K_modes_inverse;  // per body, m x m; empty where diagonal
  std::vector<int> free, stiff, slack;                      // components that move; those with and without stiffness

  VectorXd times(const TreeOperators& tree, const VectorXd& diagonal, const std::vector<MatrixXd>& blocks, const VectorXd& x) const {
    VectorXd y = diagonal.cwiseProduct(x);
    for (std::size_t i = 0; i < blocks.size(); ++i)
      if (const OperatorBody& b = tree.bodies()[i]; blocks[i].size() > 0)
        y.segment(b.etadot, b.m).noalias() = blocks[i] * x.segment(b.etadot, b.m);
    return y;
  }
};

Joint joint_of(const TreeOperators& tree) {
  const Model& model = tree.model();
  const int n = tree.size(Space::hinge);
  Joint J;
  J.K.setZero(n), J.C.setZero(n);
  J.K_modes.resize(tree.bodies().size()), J.C_modes = J.K_modes, J.K_modes_inverse = J.K_modes;
  std::vector<std::uint8_t> moves(n, 1);
  for (int v = 0; v < model.nv; ++v)
    if (const int i = tree.place_of_velocity(v); i >= 0 && model.has_prescribed()) moves[i] = model.prescribed[v] == 0;
  for (const HingeLoad& load : model.loads)
    if (const int i = tree.place_of_velocity(load.v); i >= 0) {
      const hinge_laws::Linear at_rest = hinge_laws::linear(load, tree.q()[load.q], 0.0);
      J.K[i] += at_rest.stiffness, J.C[i] += at_rest.damping;
    }
  const auto refuse = [](const std::string& what, const std::string& got) {
    cardan::refuse(Code::unsupported, {"modes of " + what}, "a stiffness >= 0", got);
  };
  for (std::size_t i = 0; i < tree.bodies().size(); ++i) {
    const OperatorBody& b = tree.bodies()[i];
    if (b.m == 0) continue;
    const FlexibleBody& f = model.flexible[model.bodies[b.sweep].flexible];
    if (f.K_diagonal) {
      J.K.segment(b.etadot, b.m) = Eigen::Map<const VectorXd>(f.K.data(), b.m);
      J.C.segment(b.etadot, b.m) = Eigen::Map<const VectorXd>(f.C.data(), b.m);
      continue;
    }
    MatrixXd K = Eigen::Map<const MatrixXd>(f.K.data(), b.m, b.m), C = Eigen::Map<const MatrixXd>(f.C.data(), b.m, b.m);
    for (int j = 0; j < b.m; ++j)
      if (!moves[b.etadot + j]) {  // held: its own row is left as a one that nobody reads
        K.row(j).setZero(), K.col(j).setZero(), C.row(j).setZero(), C.col(j).setZero();
        K(j, j) = 1.0;
      }
    std::optional<MatrixXd> K_inverse = positive_inverse(K);
    if (!K_inverse) refuse(model.user[b.user].name, "a modal stiffness matrix that is not positive definite");
    J.K.segment(b.etadot, b.m) = K.diagonal(), J.C.segment(b.etadot, b.m) = C.diagonal();
    J.K_modes[i] = std::move(K), J.C_modes[i] = std::move(C);
    J.K_modes_inverse[i] = std::move(*K_inverse);
  }
  for (int i = 0; i < n; ++i) {
    if (!moves[i]) {
      J.K[i] = J.C[i] = 0.0;
      continue;
    }
    if (!(J.K[i] >= 0.0)) refuse(tree.labels(Space::hinge, Sort::unknown).names[i], fmt::format("{:g}", J.K[i]));
    J.free.push_back(i);
    (J.K[i] > 0.0 ? J.stiff : J.slack).push_back(i);
  }
  return J;
}

/// The tree at the same q, for another stage.
TreeOperators same(const TreeOperators& tree) {
  std::vector<int> all;
  for (const OperatorBody& b : tree.bodies()) all.push_back(b.sweep);
  return tree.subgraph(all);
}

void make_room(const TreeOperators& tree, int k, SystemModes& out) {
  const int n = tree.size(Space::hinge);
  out.frequency.setZero(k), out.damping.setZero(k), out.residual.setZero(k);
  out.shapes.setZero(n, k), out.kinetic.setZero(static_cast<Eigen::Index>(tree.bodies().size()), k), out.strain.setZero(n, k);
  out.labels = tree.labels(Space::hinge, Sort::unknown);
  for (const OperatorBody& b : tree.bodies()) out.bodies.push_back(tree.model().user[b.user].name);
}

/// Column c: shape, frequency, damping, strain. K x.
VectorXd take_mode(const TreeOperators& tree, const Joint& J, const VectorXd& x, double lambda, int c, SystemModes& out) {
  const double omega = std::sqrt(lambda);
  out.shapes.col(c) = x;
  out.frequency[c] = omega / (2.0 * std::numbers::pi);
  out.damping[c] = x.dot(J.times(tree, J.C, J.C_modes, x)) / (2.0 * omega);
  VectorXd Kx = J.times(tree, J.K, J.K_modes, x);
  out.strain.col(c) = x.cwiseProduct(Kx) / lambda;
  return Kx;
}

void share_kinetic_energy(const TreeOperators& whole, SystemModes& out) {
  VectorXd V(whole.size(Space::body)), p(whole.size(Space::body));
  for (int c = 0; c < out.shapes.cols(); ++c) {
    apply(star(letters::phi) * star(letters::H), whole, out.shapes.col(c).data(), V.data());
    whole.apply(Kind::M, false, V.data(), p.data());
    for (std::size_t i = 0; i < whole.bodies().size(); ++i) {
      const OperatorBody& b = whole.bodies()[i];
      out.kinetic(static_cast<Eigen::Index>(i), c) = V.segment(b.at, 6 + b.m).dot(p.segment(b.at, 6 + b.m));
    }
  }
}

}  // namespace

int count_below(const TreeOperators& given, double lambda) {
  given.require(Kind::H);
  const TreeOperators tree = same(given);  // all components take part
  const Joint J = joint_of(tree);
  std::vector<std::uint8_t> free((tree.size(Space::hinge)), 0);
  for (const int i : J.free) free[i] = 1;
  std::vector<MatrixXd> P;
  for (int i = 0; i < static_cast<int>(tree.bodies().size()); ++i) P.push_back(tree.M(i));
  int count = 0;
  for (int i = static_cast<int>(P.size()) - 1; i >= 0; --i) {
    const OperatorBody& b = tree.bodies()[i];
    std::vector<int> columns;
    for (int j = 0; j < b.nh + b.m; ++j)
      if (free[b.v + j]) columns.push_back(j);
    MatrixXd& at = P[i];
    if (!columns.empty()) {
      const MatrixXd Ht = tree.Ht(i)(Eigen::all, columns), PH = at * Ht;
      MatrixXd K = MatrixXd::Zero(b.nh + b.m, b.nh + b.m);
      K.diagonal() = J.K.segment(b.v, b.nh + b.m);
      if (J.K_modes[i].size() > 0) K.bottomRightCorner(b.m, b.m) = J.K_modes[i];
      MatrixXd D = Ht.transpose() * PH - K(columns, columns) / lambda;
      const VectorXd scale = D.cwiseAbs().rowwise().maxCoeff().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();  // a congruence: pivots compare
      const MatrixXd PHs = PH * scale.asDiagonal();
      const DensePairs pivots = symmetric_pairs(scale.asDiagonal() * D * scale.asDiagonal());
      count += static_cast<int>((pivots.values.array() > 0.0).count());
      const MatrixXd U = PHs * pivots.vectors;
      at.noalias() -= U * pivots.values.cwiseInverse().asDiagonal() * U.transpose();
    }
    if (b.parent >= 0) P[b.parent].noalias() += tree.A(i).transpose() * at.topLeftCorner<6, 6>() * tree.A(i);
  }
  return count;
}

SystemModes system_modes(const TreeOperators& tree, const SystemModesOptions& options) {
  tree.require(Kind::H);
  const int n = tree.size(Space::hinge);
  const Joint J = joint_of(tree);
  const int n_stiff = static_cast<int>(J.stiff.size()), n_slack = static_cast<int>(J.slack.size());
  SystemModes out;
  out.n_rigid = n_slack;
  out.first_elastic = std::min(std::max(options.rigid, 0), n_slack);
  const int wanted = std::min(std::max(options.elastic, 0), n_stiff);

  TreeOperators whole = same(tree), slack = same(tree);                                 // their stages are their own
  const bool fused = tree.model().rigid && tree.has_fused(TreeOperators::Fused::mass);  // else M_fl(eta) would be formed at each product
  const auto mass = [&](const VectorXd& x, VectorXd& Mx) {
    if (fused)
      tree.apply_fused(TreeOperators::Fused::mass, x.data(), Mx.data());
    else
      apply(letters::mass, whole, x.data(), Mx.data());
  };
  if (n_slack > 0) {
    std::vector<std::uint8_t> only(n, 0);
    for (const int i : J.slack) only[i] = 1;
    slack.articulate({.W = nullptr, .free = only});
  }
  VectorXd y(n), z(n), u(n);
  /// Rigid-body mode of slack component j: (1 - H psi K)* S^-* of a unit vector, X* M X = 1 by the innovations factors of M_uu.
  const auto rigid_mode = [&](int j) {
    const int at = J.slack[j];
    VectorXd unit = VectorXd::Zero(n), x(n);
    unit[at] = 1.0;
    for (int i = 0; i < static_cast<int>(tree.bodies().size()); ++i) {
      const OperatorBody& b = slack.bodies()[i];
      if (at < b.v || at >= b.v + b.nh + b.m) continue;
      auto part = unit.segment(b.v, b.nh + b.m);
      slack.S(i).triangularView<Eigen::Lower>().transpose().solveInPlace(part);
    }
    apply(star(letters::I - letters::H * letters::psi * letters::K), slack, unit.data(), x.data());
    return x;
  };
  // M_uu^-1 = X X*: where the rigid-body modes are few, by them; else by the innovations factors at each product.
  MatrixXd X(n, n_slack <= kFew ? n_slack : 0), MX(n, X.cols());
  for (int j = 0; j < X.cols(); ++j) {
    X.col(j) = rigid_mode(j);
    mass(X.col(j), y);
    MX.col(j) = y;
  }
  /// x with its slack components such that these carry no momentum.
  const auto follow = [&](VectorXd& x) {
    if (X.cols() == n_slack) {
      const VectorXd momentum = MX.transpose() * x;
      x.noalias() -= X * momentum;
      return;
    }
    mass(x, y);
    z.setZero();
    for (const int i : J.slack) z[i] = y[i];
    apply(letters::mass_inverse, slack, z.data(), u.data());
    for (const int i : J.slack) x[i] -= u[i];
  };
  VectorXd whole_x(n);
  const auto spread = [&](const VectorXd& x_s) {
    whole_x.setZero();
    for (int i = 0; i < n_stiff; ++i) whole_x[J.stiff[i]] = x_s[i];
  };
  const auto reduced_mass = [&](const VectorXd& x_s, VectorXd& y_s) {
    spread(x_s);
    follow(whole_x);
    mass(whole_x, y);
    for (int i = 0; i < n_stiff; ++i) y_s[i] = y[J.stiff[i]];
  };
  const auto compliance = [&](const VectorXd& f_s, VectorXd& x_s) {
    spread(f_s);
    for (std::size_t i = 0; i < J.K_modes_inverse.size(); ++i)
      if (const MatrixXd& block = J.K_modes_inverse[i]; block.size() > 0) {
        const OperatorBody& b = tree.bodies()[i];
        whole_x.segment(b.etadot, b.m) = (block * whole_x.segment(b.etadot, b.m)).eval();
      } else if (const OperatorBody& b = tree.bodies()[i]; b.m > 0) {
        for (int j = b.etadot; j < b.etadot + b.m; ++j)
          if (J.K[j] > 0.0) whole_x[j] /= J.K[j];
      }
    for (const OperatorBody& b : tree.bodies())
      for (int j = b.v; j < b.v + b.nh; ++j)
        if (J.K[j] > 0.0) whole_x[j] /= J.K[j];
    for (int i = 0; i < n_stiff; ++i) x_s[i] = whole_x[J.stiff[i]];
  };

  Eigenpairs found;
  int taken = 0;
  if (wanted > 0) {
    const LinearOperator K_inverse{n_stiff, n_stiff, compliance, compliance}, M_reduced{n_stiff, n_stiff, reduced_mass, reduced_mass};
    for (int extra = 4;; extra = 2 * extra + wanted) {  // some more than wanted, to find a gap to count in
      const int asked = std::min(n_stiff, wanted + extra);
      try {
        found = lowest_eigenpairs(K_inverse, M_reduced, asked, 0.0);
      } catch (const LinalgError&) {  // most often: so many equal eigenvalues that there is nothing to iterate on
        if (n_stiff > kDense) throw;
        found = lowest_eigenpairs(K_inverse, M_reduced, std::max(wanted, (n_stiff - 7) / 2), 0.0);  // so many that it is solved densely
        taken = wanted;
        out.complete = true;
        break;
      }
      taken = std::min(wanted, static_cast<int>(found.values.size()));
      const int last = static_cast<int>(found.values.size());
      if (last == n_stiff) {
        out.complete = true;
        break;
      }
      const auto gap = [&](int j) { return (found.values[j] - found.values[j - 1]) / found.values[j]; };
      int below = taken;
      while (below < last && gap(below) < kGap) ++below;
      if (below == last)
        for (below = std::min(taken, last - 1); below > 0 && gap(below) < kGap;) --below;
      if (below == 0) break;
      const int there = count_below(tree, 0.5 * (found.values[below - 1] + found.values[below]));
      if (there == n_slack + below) {
        out.complete = true;
        break;
      }
      if (extra > 4)
        throw LinalgError(fmt::format("{} eigenvalues found below {:.6g}, but there are {}", n_slack + below, found.values[below], there));
    }
  }

  const int k = out.first_elastic + taken;
  make_room(tree, k, out);

  for (int j = 0; j < out.first_elastic; ++j) out.shapes.col(j) = X.cols() == n_slack ? VectorXd(X.col(j)) : rigid_mode(j);
  for (int j = 0; j < taken; ++j) {
    spread(found.vectors.col(j));
    follow(whole_x);
    const VectorXd x = whole_x;
    const double lambda = found.values[j], omega = std::sqrt(lambda);
    const int c = out.first_elastic + j;
    const VectorXd Kx = take_mode(tree, J, x, lambda, c, out);
    mass(x, y);
    VectorXd r(n_stiff), Kr(n_stiff);
    for (int i = 0; i < n_stiff; ++i) r[i] = Kx[J.stiff[i]] - lambda * y[J.stiff[i]];
    compliance(r, Kr);
    out.residual[c] = std::sqrt(std::max(r.dot(Kr), 0.0)) / omega;  // in this order NaN stays
    if (!(out.residual[c] <= kResidualLimit)) throw LinalgError(fmt::format("mode {} has a residual of {:.2g}", j + 1, out.residual[c]));
  }
  share_kinetic_energy(whole, out);
  return out;
}

SystemModes closed_system_modes(const TreeOperators& tree, const MatrixXd& X_given, const SystemModesOptions& options) {
  tree.require(Kind::H);
  const Joint J = joint_of(tree);
  TreeOperators whole = same(tree);
  const int n = tree.size(Space::hinge);
  const Model& m = tree.model();
  MatrixXd X(n, X_given.cols());  // in the order of the hinge space, without given motions
  Eigen::Index free = 0;
  for (Eigen::Index j = 0; j < X_given.cols(); ++j) {
    bool given = false;
    for (int v = 0; v < m.nv; ++v) {
      given = given || (m.has_prescribed() && m.prescribed[v] != 0 && X_given(v, j) != 0.0);
      if (const int i = tree.place_of_velocity(v); i >= 0) X(i, free) = X_given(v, j);
    }
    if (!given) ++free;
  }
  X.conservativeResize(n, free);
  MatrixXd MX(n, X.cols());
  for (int j = 0; j < X.cols(); ++j) {
    VectorXd y(n);
    apply(letters::mass, whole, X.col(j).data(), y.data());
    MX.col(j) = y;
  }
  const MatrixXd Y = orthonormalised(X, X.transpose() * MX);  // Y* M Y = 1
  MatrixXd root = J.K.cwiseSqrt().asDiagonal() * Y;           // root* root = Y* K Y
  for (std::size_t i = 0; i < J.K_modes.size(); ++i)
    if (const OperatorBody& b = tree.bodies()[i]; J.K_modes[i].size() > 0)
      root.middleRows(b.etadot, b.m) = cholesky(J.K_modes[i])->transpose() * Y.middleRows(b.etadot, b.m);
  const RightSingular found = right_singular(root);  // descending
  const int mobility = static_cast<int>(Y.cols());
  const auto omega = [&](int j) { return j < found.values.size() ? found.values[j] : 0.0; };
  SystemModes out;
  for (int j = 0; j < mobility; ++j) out.n_rigid += omega(j) <= kRigid * omega(0) ? 1 : 0;
  out.first_elastic = std::min(std::max(options.rigid, 0), out.n_rigid);
  out.complete = true;
  const int taken = std::min(std::max(options.elastic, 0), mobility - out.n_rigid);
  make_room(tree, out.first_elastic + taken, out);
  for (int j = 0; j < out.first_elastic; ++j) out.shapes.col(j) = Y * found.vectors.col(mobility - 1 - j);
  for (int j = 0; j < taken; ++j) {
    const int at = mobility - out.n_rigid - 1 - j, c = out.first_elastic + j;
    const double lambda = omega(at) * omega(at);
    const VectorXd x = Y * found.vectors.col(at), Kx = take_mode(tree, J, x, lambda, c, out);
    VectorXd Mx(n);
    apply(letters::mass, whole, x.data(), Mx.data());
    out.residual[c] = (Y.transpose() * (Kx - lambda * Mx)).norm() / (omega(at) * omega(0));
  }
  share_kinetic_energy(whole, out);
  return out;
}

std::vector<Pole> poles(const Eigen::MatrixXd& A) {
  std::vector<Pole> out;
  if (A.size() == 0) return out;
  const Eigen::VectorXcd values = eigenvalues(A);
  // A rigid-body mode is a double zero, which rounding of A takes apart into poles of sqrt(eps |A|) anywhere about the origin.
  const double rounding = 4.0 * std::sqrt(std::numeric_limits<double>::epsilon() * A.norm());
  for (const std::complex<double>& s : values) {
    const double size = std::abs(s);
    out.push_back({s, size / (2.0 * std::numbers::pi), size > rounding ? -s.real() / size : 0.0});
  }
  std::stable_sort(out.begin(), out.end(), [](const Pole& a, const Pole& b) {
    return a.frequency != b.frequency ? a.frequency < b.frequency : a.value.imag() > b.value.imag();
  });
  return out;
}

}  // namespace cardan::operators
