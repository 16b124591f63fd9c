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
#include "core/operators/closed_system.hpp"
#include "core/operators/following_rates.hpp"

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
  std::vector<std::uint8_t> moves(n);
  for (int i = 0; i < n; ++i) moves[i] = tree.is_free(i);
  for (int v = 0; v < model.nv; ++v)
    if (const int i = tree.place_of_velocity(v); i >= 0 && model.has_prescribed() && model.prescribed[v] != 0) moves[i] = 0;
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

/// Products by the mass matrix.
struct Mass {
  explicit Mass(const TreeOperators& of) : tree(of), whole(same(of)), fused(of.model().rigid && of.has_fused(TreeOperators::Fused::mass)) {}
  const TreeOperators& tree;
  TreeOperators whole;  // its stages are its own
  bool fused;           // else M_fl(eta) would be formed at each product
  void operator()(const VectorXd& x, VectorXd& Mx) const {
    if (fused)
      tree.fused(TreeOperators::Fused::mass, x.data(), Mx.data());
    else
      apply(letters::mass, whole, x.data(), Mx.data());
  }
};

/// Shapes in the hinge space, X* M X = 1, lambda and residuals of the elastic ones.
struct Vibrations {
  int n_rigid = 0;
  MatrixXd rigid, elastic;  // as many of the rigid ones as are asked for
  VectorXd lambda, residual;
  bool complete = false;
};

/// Of each component by itself.
VectorXd inertias(int n, const Mass& mass) {
  VectorXd unit = VectorXd::Zero(n), column(n), out(n);
  for (int i = 0; i < n; ++i) {
    unit[i] = 1.0;
    mass(unit, column);
    out[i] = column[i];
    unit[i] = 0.0;
  }
  return out;
}

/// The rows B of a device that resists what it is strained by, B* B = K, in components of the inertia 1 / scale^2; nothing where it drives
/// something on.
std::optional<MatrixXd> root_of(const DeviceStiffness& d, const VectorXd& scale) {
  const auto scaled = [&](const MatrixXd& A) { return MatrixXd(scale.asDiagonal() * A * scale.asDiagonal()); };
  const DensePairs pairs = symmetric_pairs(scaled(d.K));
  const double least = DeviceStiffness::kNothing * scaled(d.size).maxCoeff<Eigen::PropagateNaN>();
  if (!(pairs.values[0] >= -least)) return {};
  const Eigen::Index rank = (pairs.values.array() > least).count();
  return MatrixXd(pairs.values.tail(rank).cwiseSqrt().asDiagonal() * pairs.vectors.rightCols(rank).transpose() *
                  scale.cwiseInverse().asDiagonal());
}

/// root* root = Y* K Y, so that low frequencies keep their digits beside high ones; nothing where a device drives something on.
std::optional<MatrixXd> root_along(const MatrixXd& Y, const TreeOperators& tree, const Joint& J,
                                   const std::vector<DeviceStiffness>& devices, bool stiff, const Mass& mass) {
  MatrixXd root = J.K.cwiseSqrt().asDiagonal() * Y;
  for (std::size_t i = 0; i < J.K_modes.size(); ++i)
    if (const OperatorBody& b = tree.bodies()[i]; J.K_modes[i].size() > 0)
      root.middleRows(b.etadot, b.m) = cholesky(J.K_modes[i])->transpose() * Y.middleRows(b.etadot, b.m);
  if (!stiff) return root;
  const VectorXd scale = inertias(tree.size(Space::hinge), mass).cwiseSqrt().cwiseInverse();
  for (const DeviceStiffness& d : devices) {
    const std::optional<MatrixXd> own = root_of(d, scale);
    if (!own) return {};
    root.conservativeResize(root.rows() + own->rows(), Eigen::NoChange);
    root.bottomRows(own->rows()) = *own * Y;
  }
  return root;
}

[[noreturn]] void refuse_unstable() {
  cardan::refuse(Code::unsupported, {"modes of the system"}, "a positive stiffness with what devices push",
                 "an equilibrium that is not stable, or none", "linearize() has its poles");
}

/// With the stiffness of devices. In coordinates of unit mass, of stiff components s and of the others u, which K touches by the
/// eigenvectors of devices: u = Q_1 y + Q_2 r with r strained by nothing. What preloads of several devices leave of each other by no more
/// than rounding, as where a tensegrity turns as a whole, belongs to r too. Then r is eliminated as momentum-free.
Vibrations densely(const TreeOperators& tree, const Joint& J, const std::vector<DeviceStiffness>& devices, const Mass& mass,
                   const SystemModesOptions& options) {
  constexpr double kNothing = DeviceStiffness::kNothing;  // of an eigenvalue, beside what it is the sum of; of a direction, beside 1
  const int n = tree.size(Space::hinge), n_stiff = static_cast<int>(J.stiff.size()), n_slack = static_cast<int>(J.slack.size()),
            n_free = n_stiff + n_slack;
  if (n_free > kDense)
    cardan::refuse(Code::unsupported, {"modes of the system"}, fmt::format("at most {} components where devices have stiffness", kDense),
                   fmt::format("{}", n_free));
  Vibrations out;
  out.complete = true, out.rigid.resize(n, 0), out.elastic.resize(n, 0);
  if (n_free == 0) return out;
  std::vector<std::uint8_t> free(n, 0);
  for (const int i : J.free) free[i] = 1;
  same(tree).articulate({.free = free});  // every direction has inertia
  std::vector<int> order = J.stiff;
  order.insert(order.end(), J.slack.begin(), J.slack.end());
  MatrixXd M(n_free, n_free), K(n_free, n_free);
  VectorXd unit = VectorXd::Zero(n), column(n);
  for (int j = 0; j < n_free; ++j) {
    unit[order[j]] = 1.0;
    mass(unit, column);
    M.col(j) = column(order);
    K.col(j) = J.times(tree, J.K, J.K_modes, unit)(order);
    unit[order[j]] = 0.0;
  }
  const VectorXd scale = M.diagonal().cwiseSqrt().cwiseInverse();
  const auto scaled = [&](const MatrixXd& A) { return MatrixXd(scale.asDiagonal() * A * scale.asDiagonal()); };
  M = scaled(M), K = scaled(K);
  MatrixXd strained(n_free, 0), magnitude = K;  // what devices resist, and the sum of how much
  // A mount where nothing moves has motions of rounding, and their squares: 1e-12 of the highest frequency, or 1e-12 rad/s, is no
  // vibration.
  double least_of_all = std::max(K.diagonal().maxCoeff<Eigen::PropagateNaN>(), 1.0);
  for (const DeviceStiffness& d : devices)
    least_of_all = std::max(least_of_all, scaled(d.size(order, order)).maxCoeff<Eigen::PropagateNaN>());
  least_of_all *= 1e-24;
  for (const DeviceStiffness& d : devices) {
    const MatrixXd own = scaled(d.K(order, order));
    K += own;
    const DensePairs pairs = symmetric_pairs(own);
    const double least = std::max(kNothing * scaled(d.size(order, order)).maxCoeff<Eigen::PropagateNaN>(), least_of_all);
    for (int j = 0; j < n_free; ++j) {
      if (!(std::abs(pairs.values[j]) > least)) continue;
      strained.conservativeResize(n_free, strained.cols() + 1);
      strained.rightCols(1) = pairs.vectors.col(j);
      magnitude += std::abs(pairs.values[j]) * pairs.vectors.col(j) * pairs.vectors.col(j).transpose();
    }
  }
  MatrixXd T = MatrixXd::Identity(n_free, n_stiff), R(n_free, 0);  // what is strained, and rigid-body motions
  if (n_slack > 0) {
    RightSingular directions{VectorXd(), MatrixXd::Identity(n_slack, n_slack)};
    if (strained.cols() > 0) directions = right_singular(strained.bottomRows(n_slack).transpose());
    const int rank = static_cast<int>((directions.values.array() > kNothing).count());
    T = MatrixXd::Zero(n_free, n_stiff + rank), R = MatrixXd::Zero(n_free, n_slack - rank);
    T.topLeftCorner(n_stiff, n_stiff).setIdentity();
    T.bottomRightCorner(n_slack, rank) = directions.vectors.leftCols(rank);
    R.bottomRows(n_slack) = directions.vectors.rightCols(n_slack - rank);
  }
  if (T.cols() > 0)
    if (const auto shares = generalised_pairs(T.transpose() * K * T, T.transpose() * magnitude * T)) {
      std::vector<Eigen::Index> none, some;
      for (Eigen::Index j = 0; j < T.cols(); ++j) (std::abs(shares->values[j]) > kNothing ? some : none).push_back(j);
      if (!none.empty()) {
        R.conservativeResize(n_free, R.cols() + static_cast<Eigen::Index>(none.size()));
        R.rightCols(static_cast<Eigen::Index>(none.size())) = T * shares->vectors(Eigen::all, none);
        T = (T * shares->vectors(Eigen::all, some)).eval();
      }
    }
  out.n_rigid = static_cast<int>(R.cols());
  if (R.cols() > 0) {
    R = orthonormalised(R, R.transpose() * M * R);
    T -= (R * (R.transpose() * M * T)).eval();
  }
  const auto spread = [&](const MatrixXd& x) {
    MatrixXd all = MatrixXd::Zero(n, x.cols());
    all(order, Eigen::all) = scale.asDiagonal() * x;
    return all;
  };
  out.rigid = spread(R.leftCols(std::min<Eigen::Index>(std::max(options.rigid, 0), R.cols())));
  const Eigen::Index wanted = std::min<Eigen::Index>(std::max(options.elastic, 0), T.cols());
  const MatrixXd KT = T.transpose() * K * T, MT = T.transpose() * M * T;
  const std::optional<DensePairs> found = T.cols() > 0 ? generalised_pairs(MT, KT) : DensePairs{};  // the lowest are the largest here
  const std::optional<MatrixXd> K_inverse = T.cols() > 0 ? positive_inverse(KT) : MatrixXd();
  if (!found || !K_inverse) refuse_unstable();
  MatrixXd X(T.cols(), wanted);
  out.lambda.resize(wanted), out.residual.resize(wanted);
  for (Eigen::Index j = 0; j < wanted; ++j) {
    const Eigen::Index from = T.cols() - 1 - j;
    const double reciprocal = found->values[from];
    out.lambda[j] = 1.0 / reciprocal;
    X.col(j) = found->vectors.col(from) / std::sqrt(reciprocal);
    const VectorXd r = KT * X.col(j) - out.lambda[j] * (MT * X.col(j));
    out.residual[j] = std::sqrt(std::max(r.dot(*K_inverse * r), 0.0) / out.lambda[j]);
  }
  out.elastic = spread(T * X);
  if (wanted == 0 || out.residual.maxCoeff() <= kResidualLimit) return out;
  // Frequencies very far apart: by singular values, which take longer.
  const MatrixXd Y = spread(orthonormalised(T, MT));
  if (const auto root = root_along(Y, tree, J, devices, true, mass)) {
    const RightSingular all = right_singular(*root);
    const MatrixXd lowest = all.vectors.rightCols(wanted).rowwise().reverse();
    out.lambda = all.values.tail(wanted).reverse().cwiseAbs2();
    out.elastic = Y * lowest;
    for (Eigen::Index j = 0; j < wanted; ++j)
      out.residual[j] =
          (root->transpose() * (*root * lowest.col(j)) - out.lambda[j] * lowest.col(j)).norm() / (std::sqrt(out.lambda[j]) * all.values[0]);
  }
  return out;
}

/// Of springs and modes alone, matrix-free.
Vibrations by_products(const TreeOperators& tree, const Joint& J, const Mass& mass, const SystemModesOptions& options) {
  const int n = tree.size(Space::hinge), n_stiff = static_cast<int>(J.stiff.size()), n_slack = static_cast<int>(J.slack.size());
  Vibrations out;
  out.n_rigid = n_slack;
  const int wanted = std::min(std::max(options.elastic, 0), n_stiff);
  TreeOperators slack = same(tree);
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
      const int there = operators::count_below(tree, 0.5 * (found.values[below - 1] + found.values[below]));
      if (there == n_slack + below) {
        out.complete = true;
        break;
      }
      if (extra > 4)
        throw LinalgError(fmt::format("{} eigenvalues found below {:.6g}, but there are {}", n_slack + below, found.values[below], there));
    }
  }

  out.rigid.resize(n, std::min(std::max(options.rigid, 0), n_slack));
  for (int j = 0; j < out.rigid.cols(); ++j) out.rigid.col(j) = X.cols() == n_slack ? VectorXd(X.col(j)) : rigid_mode(j);
  out.lambda = found.values.head(taken), out.residual.resize(taken), out.elastic.resize(n, taken);
  for (int j = 0; j < taken; ++j) {
    spread(found.vectors.col(j));
    follow(whole_x);
    out.elastic.col(j) = whole_x;
    const double lambda = out.lambda[j];
    const VectorXd Kx = J.times(tree, J.K, J.K_modes, whole_x);
    mass(VectorXd(whole_x), y);
    VectorXd r(n_stiff), Kr(n_stiff);
    for (int i = 0; i < n_stiff; ++i) r[i] = Kx[J.stiff[i]] - lambda * y[J.stiff[i]];
    compliance(r, Kr);
    out.residual[j] = std::sqrt(std::max(r.dot(Kr), 0.0) / lambda);  // in this order NaN stays
  }
  return out;
}

}  // namespace

int count_below(const TreeOperators& given, double lambda) {
  given.require(Kind::H);
  const TreeOperators tree = same(given);  // all components take part
  const Joint J = joint_of(given);
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

namespace {

/// What `find` finds, with damping, strain and shares of energy.
template <class Find>
SystemModes modes_of(const TreeOperators& tree, const SystemModesOptions& options, const Find& find) {
  tree.require(Kind::H);
  const int n = tree.size(Space::hinge);
  const Joint J = joint_of(tree);
  const Mass mass(tree);
  const std::vector<DeviceStiffness> devices =
      options.devices ? stiffness_of_devices(tree, *options.devices) : std::vector<DeviceStiffness>();
  const bool stiff = std::ranges::any_of(devices, &DeviceStiffness::is_stiff);
  const Vibrations found = find(J, mass, devices, stiff);
  SystemModes out;
  out.n_rigid = found.n_rigid, out.complete = found.complete;
  out.first_elastic = static_cast<int>(found.rigid.cols());
  const int taken = static_cast<int>(found.elastic.cols()), k = out.first_elastic + taken;
  out.frequency.setZero(k), out.damping.setZero(k), out.residual.setZero(k);
  out.shapes.resize(n, k), out.kinetic.setZero(static_cast<Eigen::Index>(tree.bodies().size()), k), out.strain.setZero(n, k);
  out.shapes << found.rigid, found.elastic;
  out.labels = tree.labels(Space::hinge, Sort::unknown);
  for (const OperatorBody& b : tree.bodies()) out.bodies.push_back(tree.model().user[b.user].name);
  for (int j = 0; j < taken; ++j) {
    const int c = out.first_elastic + j;
    const VectorXd x = out.shapes.col(c);
    const double lambda = found.lambda[j], omega = std::sqrt(lambda);
    VectorXd Kx = J.times(tree, J.K, J.K_modes, x), Cx = J.times(tree, J.C, J.C_modes, x);
    for (const DeviceStiffness& d : devices) Kx += d.K * x, Cx += d.C * x;
    out.frequency[c] = omega / (2.0 * std::numbers::pi);
    out.damping[c] = x.dot(Cx) / (2.0 * omega);
    out.strain.col(c) = x.cwiseProduct(Kx) / lambda;
    out.residual[c] = found.residual[j];
    if (!(out.residual[c] <= kResidualLimit)) throw LinalgError(fmt::format("mode {} has a residual of {:.2g}", j + 1, out.residual[c]));
  }
  VectorXd V(tree.size(Space::body)), p(tree.size(Space::body));
  for (int c = 0; c < k; ++c) {
    apply(star(letters::phi) * star(letters::H), mass.whole, out.shapes.col(c).data(), V.data());
    mass.whole.apply(Kind::M, false, V.data(), p.data());
    for (std::size_t i = 0; i < tree.bodies().size(); ++i) {
      const OperatorBody& b = tree.bodies()[i];
      out.kinetic(static_cast<Eigen::Index>(i), c) = V.segment(b.at, 6 + b.m).dot(p.segment(b.at, 6 + b.m));
    }
  }
  return out;
}

/// [1/s^2] The largest stiffness of a component over its own inertia: beside it, what loops leave of it is rounding.
double stiffest(const TreeOperators& tree, const Joint& J, const Mass& mass) {
  const int n = tree.size(Space::hinge);
  const VectorXd inertia = inertias(n, mass);
  VectorXd unit = VectorXd::Zero(n);
  double largest = 0.0;
  for (const int i : J.stiff) {
    unit[i] = 1.0;
    largest = std::max(largest, J.times(tree, J.K, J.K_modes, unit)[i] / inertia[i]);
    unit[i] = 0.0;
  }
  return largest;
}

/// What loops take from Y* K Y as they turn the motions Y under the preload f of devices: f* Y' along each of them, of X' v_I.
MatrixXd turned_aside(const MatrixXd& Y, const TreeOperators& tree, const std::vector<DeviceStiffness>& devices,
                      const SystemModesOptions& options) {
  MatrixXd out = MatrixXd::Zero(Y.cols(), Y.cols());
  VectorXd f = VectorXd::Zero(Y.rows());
  for (const DeviceStiffness& d : devices) f += d.push;
  if (f.isZero(0.0)) return out;
  f = tree.to_model(f);
  std::vector<VectorXd> ways;
  VectorXd some = VectorXd::Zero(f.size());  // of all at once
  for (Eigen::Index j = 0; j < Y.cols(); ++j) {
    ways.push_back(tree.to_model(VectorXd(Y.col(j))));
    some += std::cos(1.0 + static_cast<double>(j)) * ways.back();
  }
  for (Eigen::Index k = 0; k < Y.cols(); ++k) {
    FollowingRates rates(*options.closed, tree.model(), tree.q().data(), ways[static_cast<std::size_t>(k)], options.drives);
    if (f.cwiseProduct(rates.along(some)).isZero(0.0)) continue;  // no part in loops that carry the preload
    for (Eigen::Index j = 0; j < Y.cols(); ++j) out(j, k) = f.dot(rates.along(ways[static_cast<std::size_t>(j)]));
  }
  return out;
}

/// Along the motions that closed loops leave free.
Vibrations along(const MatrixXd& X, const TreeOperators& tree, const Joint& J, const std::vector<DeviceStiffness>& devices, bool stiff,
                 const Mass& mass, const SystemModesOptions& options) {
  const int n = tree.size(Space::hinge);
  const MatrixXd Y = free_motions(mass.whole, X);
  const Eigen::Index free = Y.cols();
  if (free == 0) {  // loops, and what is held, leave nothing
    Vibrations none;
    none.complete = true, none.rigid.resize(n, 0), none.elastic.resize(n, 0);
    return none;
  }
  MatrixXd KY(n, free);
  for (Eigen::Index j = 0; j < free; ++j) KY.col(j) = J.times(tree, J.K, J.K_modes, Y.col(j));
  for (const DeviceStiffness& d : devices) KY += d.K * Y;
  MatrixXd K = Y.transpose() * KY;
  const MatrixXd aside = stiff && options.closed ? turned_aside(Y, tree, devices, options) : MatrixXd::Zero(free, free);
  K = (0.5 * (K + K.transpose() - aside - aside.transpose())).eval();

  const std::optional<MatrixXd> root = aside.isZero(0.0) ? root_along(Y, tree, J, devices, stiff, mass) : std::nullopt;

  Vibrations out;
  out.complete = true;
  VectorXd lambda;  // ascending
  MatrixXd vectors;
  double nothing = 0.0;
  if (!root) {
    const DensePairs pairs = symmetric_pairs(K);
    lambda = pairs.values, vectors = pairs.vectors;
    nothing = kRigid * lambda.cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
    if (!(lambda[0] >= -nothing)) refuse_unstable();
  } else {
    const RightSingular found = right_singular(*root);  // descending, and no more than there are rows
    lambda.setZero(free), vectors = found.vectors.rowwise().reverse();
    lambda.tail(found.values.size()) = found.values.cwiseAbs2().reverse();
    nothing = kRigid * kRigid * std::max(lambda[free - 1], stiffest(tree, J, mass));
  }
  for (Eigen::Index j = 0; j < free && lambda[j] <= nothing; ++j) ++out.n_rigid;
  const Eigen::Index taken = std::min<Eigen::Index>(std::max(options.elastic, 0), free - out.n_rigid);
  out.rigid = Y * vectors.leftCols(std::min(std::max(options.rigid, 0), out.n_rigid));
  out.lambda = lambda.segment(out.n_rigid, taken);
  out.elastic = Y * vectors.middleCols(out.n_rigid, taken);
  out.residual.resize(taken);
  for (Eigen::Index j = 0; j < taken; ++j) {
    const VectorXd of = vectors.col(out.n_rigid + j);
    out.residual[j] = (K * of - out.lambda[j] * of).norm() / std::sqrt(out.lambda[j] * lambda[free - 1]);
  }
  return out;
}

}  // namespace

SystemModes system_modes(const TreeOperators& tree, const SystemModesOptions& options) {
  return modes_of(tree, options, [&](const Joint& J, const Mass& mass, const std::vector<DeviceStiffness>& devices, bool stiff) {
    return stiff ? densely(tree, J, devices, mass, options) : by_products(tree, J, mass, options);
  });
}

SystemModes closed_system_modes(const TreeOperators& tree, const MatrixXd& X, const SystemModesOptions& options) {
  return modes_of(tree, options, [&](const Joint& J, const Mass& mass, const std::vector<DeviceStiffness>& devices, bool stiff) {
    return along(X, tree, J, devices, stiff, mass, options);
  });
}

/// By rising frequency; `rounding`: what is below it [rad/s] is zero.
static std::vector<Pole> in_order(const Eigen::VectorXcd& values, double rounding) {
  std::vector<Pole> out;
  for (const std::complex<double>& s : values) {
    const double size = std::abs(s);
    out.push_back({s, size / (2.0 * std::numbers::pi), size > rounding ? -s.real() / size : 0.0});
  }
  std::stable_sort(out.begin(), out.end(), [](const Pole& a, const Pole& b) {
    return a.frequency != b.frequency ? a.frequency < b.frequency : a.value.imag() > b.value.imag();
  });
  return out;
}

// A rigid-body mode is a double zero, which rounding of A takes apart into poles of sqrt(eps |A|) anywhere about the origin.
std::vector<Pole> poles(const Eigen::MatrixXd& A) {
  return in_order(eigenvalues(A), 4.0 * std::sqrt(std::numeric_limits<double>::epsilon() * A.norm()));
}

std::vector<Pole> poles(const Eigen::MatrixXd& A, double dt) {
  Eigen::VectorXcd values = eigenvalues(A);
  for (std::complex<double>& z : values) z = std::log(z) / dt;
  return in_order(values, 4.0 * std::sqrt(std::numeric_limits<double>::epsilon() * A.norm()) / dt);
}

}  // namespace cardan::operators
