#include "core/dynamics/loops.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/dynamics/node_motion.hpp"
#include "core/dynamics/part.hpp"
#include "core/model/loops.hpp"

namespace cardan {
namespace {

using soa::DeformedNode;
using Vector3 = Vec3<double>;

constexpr double kDependent =
    1e-10;  // a scaled pivot below is none: of redundant rows they are 1e-16, of others above 1e-3 but near singular postures
constexpr double kOpen =
    10.0;  // ... of more rows than at the start also below so much of the residual: what agrees on closed loops differs on open ones
constexpr double kMostOpen = 1e-4;       // ... but not more: rows of loops that are far open are still rows
constexpr double kContradiction = 1e-6;  // what may be missing in the acceleration of a redundant row, relative to those of the open tree
constexpr double kStart = 1e-6;          // residual of a start: typed numbers have a finite number of digits
constexpr double kClosed = 4e-15;        // residual that counts as none, relative to the size of a loop
constexpr int kTries = 20;               // of Newton's method

Vector3 rotation_vector(const Mat3<double>& R) {
  const Eigen::Quaterniond q(to_eigen(R));
  const double length = q.vec().norm();
  const double angle = 2.0 * std::atan2(length, q.w());
  const double turn = angle > M_PI ? angle - 2.0 * M_PI : angle;
  return from_eigen(length > 0.0 ? Eigen::Vector3d(turn / length * q.vec()) : Eigen::Vector3d(2.0 * q.vec()));
}
Eigen::Matrix<double, 6, 1> vector(const Vector3& a, const Vector3& b) {
  Eigen::Matrix<double, 6, 1> out;
  out << to_eigen(a), to_eigen(b);
  return out;
}
double product(const Force<double>& W, const Vector3& w, const Vector3& v) { return dot(W.n, w) + dot(W.f, v); }

using Columns = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, 6>;
using Few = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 6, 1>;
using FewSquare = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 6, 6>;

/// A x = b in the least squares of angles times `lever`.
Few least_squares(const Columns& A, const Eigen::Matrix<double, 6, 1>& b, double lever) {
  Eigen::Matrix<double, 6, 1> weight;
  weight << lever * lever, lever * lever, lever * lever, 1.0, 1.0, 1.0;
  const FewSquare N = A.transpose() * weight.asDiagonal() * A;
  const Few r = A.transpose() * weight.cwiseProduct(b);
  return N.ldlt().solve(r);
}

/// Orthonormal columns W with W* H = 0, each as near to a coordinate direction as there is one left.
void complement(const Columns& H, Force<double>* W) {
  const int n = static_cast<int>(H.cols());
  Eigen::Matrix<double, 6, 6> basis;
  int have = 0;
  const auto without = [&](Eigen::Matrix<double, 6, 1> x) {
    for (int twice = 0; twice < 2; ++twice)
      for (int i = 0; i < have; ++i) x -= basis.col(i).dot(x) * basis.col(i);
    return x;
  };
  for (int j = 0; j < n; ++j)
    if (const auto x = without(H.col(j)); x.norm() > 1e-9 * H.col(j).norm()) basis.col(have++) = x.normalized();
  for (int j = 0; j < 6 - n; ++j) {
    Eigen::Matrix<double, 6, 1> best = Eigen::Matrix<double, 6, 1>::Zero();
    double most = 0.0;
    for (int i = 0; i < 6; ++i)
      if (const auto x = without(Eigen::Matrix<double, 6, 1>::Unit(i)); x.norm() > most + 1e-6) best = x, most = x.norm();
    basis.col(have) = best.normalized();
    W[j] = force(basis.col(have++).data());
  }
}

}  // namespace

/// Scratch of the loops of one model, in a workspace; made in its first call.
struct LoopWork {
  /// One end of a loop.
  struct End {
    DeformedNode<double> at;  // in its body
    Mat3<double> R_HN;        // node axes to axes of home
    Vector3 x;                // [m] from home
    Vector3 w, v;             // relative to home, node axes
  };
  /// `to` seen from `from`, axes of the node `from`.
  struct Relative {
    Mat3<double> R;
    Vector3 d, w, u;  // [m], [rad/s], [m/s]: u = d'
  };
  explicit LoopWork(const Model& model);

  std::vector<End> from, to;  // per loop
  std::vector<Relative> relative;
  std::vector<std::vector<double>> q, v;  // of hinges that close, of each loop
  // Per row:
  std::vector<Force<double>> W;  // what a multiplier of 1 does to the end `to`, axes of the node `from`
  std::vector<double> c, rate, extra, open, acceleration, rhs, lambda, step, scale;
  // rows x nv, row by row: G, and M^-1 G* of the rows that count.
  std::vector<double> G, U;
  // Rank: rows x columns scaled, and how rows and columns were exchanged.
  std::vector<int> columns, row_at, column_at;
  std::vector<double> B, L, Lambda, N, NN, y;
  int rank = 0;
  double smallest = 0.0, largest = 0.0;
  // What acts on the bodies before the inward sweeps.
  std::vector<Motion<double>> gamma;
  std::vector<Force<double>> z;
  std::vector<double> z_modes, rotor_loads;
  std::vector<NodeWrench> wrenches, one;
  std::vector<double> tau, tau_of_row, response, zero;
  std::vector<Run> near;  // bodies that loops move and all inboard of them
  bool coupled = false;
};

namespace {

/// One evaluation of the loops.
class Pass {
 public:
  Pass(const Model& model, Workspace& ws, const Inputs& in)
      : m_(model), loops_(model.loops), ws_(ws), k_(*ws.loops), in_(in), S_(soa::sweeps<double>()) {}

  /// Poses and rates of the ends relative to each other, rows, c and G v. Needs outward.
  void place() {
    for (std::size_t l = 0; l < loops_.all.size(); ++l) {
      const Loop& loop = loops_.all[l];
      if (loop.closing == Closing::coupling) {
        couple(loop);
        continue;
      }
      LoopWork::End &a = k_.from[l], &b = k_.to[l];
      seen_from_home(loop.from, loop.from_path, a);
      seen_from_home(loop.to, loop.to_path, b);
      LoopWork::Relative& r = k_.relative[l];
      r.R = transpose(a.R_HN) * b.R_HN;
      r.d = transpose_times(a.R_HN, b.x - a.x);
      r.w = r.R * b.w - a.w;
      r.u = r.R * b.v - a.v - cross(a.w, r.d);
      close(loop, l);
      for (int i = loop.first; i < loop.first + loop.rows; ++i) k_.rate[at(i)] = product(k_.W[at(i)], r.w, r.u);
    }
  }

  /// c'' of all rows as the workspace and vdot have it, v' included.
  void accelerations(const double* vdot, double* out) const {
    each_loop(vdot, out, [&](const Loop& loop, std::size_t l) {
      const LoopWork::Relative& r = k_.relative[l];
      Vector3 w_a, w_b;
      const Motion<double> A = acceleration(loop.from, k_.from[l], vdot, w_a), B = acceleration(loop.to, k_.to[l], vdot, w_b);
      const Vector3 wdot = r.R * B.w - A.w - cross(w_a, r.w);
      const Vector3 udot = r.R * B.v - A.v - cross(A.w, r.d) - 2.0 * cross(w_a, r.u) - cross(w_a, cross(w_a, r.d));
      for (int i = loop.first; i < loop.first + loop.rows; ++i) out[i] = product(k_.W[at(i)], wdot, udot) + k_.extra[at(i)];
    });
  }

  /// G of the v' that the sweeps have just given to a system at rest.
  void responses(const double* vdot, double* out) const {
    each_loop(vdot, out, [&](const Loop& loop, std::size_t l) {
      const LoopWork::Relative& r = k_.relative[l];
      const Motion<double> A = response(loop.from, k_.from[l], vdot), B = response(loop.to, k_.to[l], vdot);
      const Vector3 wdot = r.R * B.w - A.w, udot = r.R * B.v - A.v - cross(A.w, r.d);
      for (int i = loop.first; i < loop.first + loop.rows; ++i) out[i] = product(k_.W[at(i)], wdot, udot);
    });
  }

  /// G, row by row: what a multiplier of 1 is as hinge forces.
  void matrix() {
    const Inputs still = at_rest();
    for (const Loop& loop : loops_.all)
      for (int i = loop.first; i < loop.first + loop.rows; ++i) {
        double* row = k_.G.data() + at(i) * at(m_.nv);
        std::fill_n(row, m_.nv, 0.0);
        if (loop.closing == Closing::coupling) {
          for (const CoupledRate& term : loop.terms) row[term.v] = term.coefficient;
          continue;
        }
        Inputs in = still;
        in.wrenches = wrenches_of(loop, k_.W[at(i)]);
        S_.ground(m_, ws_, in);
        S_.at_rest(m_, ws_);
        S_.node_wrenches(m_, ws_, in);
        for (auto run = k_.near.rbegin(); run != k_.near.rend(); ++run) S_.gather(m_, ws_, in, *run, k_.response.data());
        for (const int v : loop.rates) row[v] = -k_.response[at(v)];  // no other component moves the ends against each other
      }
  }

  /// Independent rows by complete pivoting on scaled G: rates in the root of their energy, rows in metres.
  void find_rank() {
    const int rows = loops_.rows, n = static_cast<int>(k_.columns.size());
    double open = 0.0;
    for (const Loop& loop : loops_.all) {
      for (int i = loop.first; i < loop.first + loop.rows; ++i) {
        k_.scale[at(i)] = in_metres(loop, i);
        if (loop.closing != Closing::coupling) open = std::max(open, std::abs(k_.c[at(i)]) * k_.scale[at(i)] / loop.lever);
        for (int j = 0; j < n; ++j) {
          const auto v = at(k_.columns[at(j)]);
          k_.B[at(i * n + j)] = k_.G[at(i) * at(m_.nv) + v] * k_.scale[at(i)] * loops_.column_scale[v] / loop.reference;
        }
        k_.row_at[at(i)] = i;
      }
    }
    for (int j = 0; j < n; ++j) k_.column_at[at(j)] = j;
    const double limit = std::max(kDependent, std::min(kOpen * open, kMostOpen));
    const auto B = [&](int i, int j) -> double& { return k_.B[at(k_.row_at[at(i)] * n + k_.column_at[at(j)])]; };
    k_.rank = 0, k_.smallest = 0.0, k_.largest = 0.0;
    for (int p = 0; p < std::min(rows, n); ++p) {
      int row = p, column = p;
      double most = -1.0;
      for (int i = p; i < rows; ++i)
        for (int j = p; j < n; ++j)
          if (const double x = std::abs(B(i, j)); x > most) most = x, row = i, column = j;
      if (!(most > (p < loops_.rank ? kDependent : limit))) {
        k_.largest = most;
        break;
      }
      std::swap(k_.row_at[at(p)], k_.row_at[at(row)]);
      std::swap(k_.column_at[at(p)], k_.column_at[at(column)]);
      for (int i = p + 1; i < rows; ++i) {
        const double factor = B(i, p) / B(p, p);
        B(i, p) = factor;  // L, beside what is left
        if (factor == 0.0) continue;
        for (int j = p + 1; j < n; ++j) B(i, j) -= factor * B(p, j);
      }
      k_.smallest = most;
      ++k_.rank;
    }
  }

  /// M^-1 G* and G M^-1 G* of the independent rows, factored. Needs P, D, G of the sweeps; `runs`: as far as U is wanted. false: a row
  /// without compliance.
  bool compliance(const std::vector<Run>& runs) {
    const int r = k_.rank;
    Inputs in = at_rest();
    for (int p = 0; p < r; ++p) {
      const int row = k_.row_at[at(p)];
      const Loop& loop = loop_of(row);
      const bool couples = loop.closing == Closing::coupling;
      in.wrenches = couples ? std::span<const NodeWrench>() : wrenches_of(loop, k_.W[at(row)]);
      in.tau = nullptr;
      if (couples) {
        for (const CoupledRate& term : loop.terms) k_.tau_of_row[at(term.v)] = term.coefficient;
        in.tau = k_.tau_of_row.data();
      }
      double* U = k_.U.data() + at(p) * at(m_.nv);
      S_.ground(m_, ws_, in);
      S_.at_rest(m_, ws_);
      S_.node_wrenches(m_, ws_, in);
      for (auto run = runs.rbegin(); run != runs.rend(); ++run) S_.inward(m_, ws_, in, *run, {.inertia = false});
      for (const Run& run : runs) S_.acceleration(m_, ws_, in, run, U);
      for (std::size_t v = 0; v < m_.prescribed.size(); ++v)
        if (m_.prescribed[v]) U[v] = 0.0;
      if (couples)
        for (const CoupledRate& term : loop.terms) k_.tau_of_row[at(term.v)] = 0.0;
      responses(U, k_.y.data());
      for (int q = 0; q < r; ++q) k_.Lambda[at(q * r + p)] = k_.y[at(k_.row_at[at(q)])];
    }
    return factor_compliance();
  }

  /// Multipliers of the independent rows for G v' = rhs (all rows), added to lambda.
  void solve(const double* rhs, double* lambda) {
    const int r = k_.rank;
    double* y = k_.y.data();
    for (int p = 0; p < r; ++p) {
      y[p] = rhs[k_.row_at[at(p)]] * unit(p);
      for (int q = 0; q < p; ++q) y[p] -= k_.Lambda[at(p * r + q)] * y[q];
      y[p] /= k_.Lambda[at(p * r + p)];
    }
    for (int p = r - 1; p >= 0; --p) {
      for (int q = p + 1; q < r; ++q) y[p] -= k_.Lambda[at(q * r + p)] * y[q];
      y[p] /= k_.Lambda[at(p * r + p)];
    }
    for (int p = 0; p < r; ++p) lambda[k_.row_at[at(p)]] += y[p] * unit(p);
  }

  /// Of all multipliers that push alike those of smallest norm: less what lies in the left null space of G.
  void share() {
    const int rows = loops_.rows, r = k_.rank, n = rows - r, columns = static_cast<int>(k_.columns.size());
    if (n == 0) return;
    const auto L = [&](int i, int j) { return k_.B[at(k_.row_at[at(i)] * columns + k_.column_at[at(j)])]; };
    // Per redundant row: 1 on itself, -K on the others, where row = K (independent rows).
    for (int i = 0; i < n; ++i) {
      double* N = k_.N.data() + at(i * rows);
      std::fill_n(N, rows, 0.0);
      const int row = k_.row_at[at(r + i)];
      N[row] = 1.0;
      for (int p = r - 1; p >= 0; --p) {  // K L_I = L_row
        double x = L(r + i, p);
        for (int q = p + 1; q < r; ++q) x += N[k_.row_at[at(q)]] * L(q, p);
        N[k_.row_at[at(p)]] = -x;
      }
      for (int p = 0; p < r; ++p) {  // rows as they are, not scaled
        const int other = k_.row_at[at(p)];
        N[other] *= weight(other) / weight(row);
      }
    }
    for (int i = 0; i < n; ++i)
      for (int j = 0; j <= i; ++j) {
        double sum = 0.0;
        for (int k = 0; k < rows; ++k) sum += k_.N[at(i * rows + k)] * k_.N[at(j * rows + k)];
        for (int k = 0; k < j; ++k) sum -= k_.NN[at(i * n + k)] * k_.NN[at(j * n + k)];
        k_.NN[at(i * n + j)] = i == j ? std::sqrt(sum) : sum / k_.NN[at(j * n + j)];
      }
    double* y = k_.y.data();
    for (int i = 0; i < n; ++i) {
      y[i] = 0.0;
      for (int k = 0; k < rows; ++k) y[i] += k_.N[at(i * rows + k)] * k_.lambda[at(k)];
      for (int j = 0; j < i; ++j) y[i] -= k_.NN[at(i * n + j)] * y[j];
      y[i] /= k_.NN[at(i * n + i)];
    }
    for (int i = n - 1; i >= 0; --i) {
      for (int j = i + 1; j < n; ++j) y[i] -= k_.NN[at(j * n + i)] * y[j];
      y[i] /= k_.NN[at(i * n + i)];
    }
    for (int i = 0; i < n; ++i)
      for (int k = 0; k < rows; ++k) k_.lambda[at(k)] -= k_.N[at(i * rows + k)] * y[i];
  }

  /// The multipliers as wrenches on nodes and as hinge forces of couplings, beside those of actuators.
  void push() {
    k_.wrenches.clear();
    if (k_.coupled)
      for (int v = 0; v < m_.nv; ++v) k_.tau[at(v)] = in_.tau ? in_.tau[v] : 0.0;
    for (const Loop& loop : loops_.all) {
      if (loop.closing == Closing::coupling) {
        for (const CoupledRate& term : loop.terms) k_.tau[at(term.v)] += term.coefficient * k_.lambda[at(loop.first)];
        continue;
      }
      Force<double> f{};
      for (int i = loop.first; i < loop.first + loop.rows; ++i) f += k_.lambda[at(i)] * k_.W[at(i)];
      for (const NodeWrench& w : wrenches_of(loop, f)) k_.wrenches.push_back(w);
    }
  }

  /// The inward and outward sweeps once more, from what was kept, with the loops pushing.
  void move(double* vdot) {
    S_.ground(m_, ws_, in_);
    restore();
    Inputs in = in_;
    if (k_.coupled) in.tau = k_.tau.data();
    in.wrenches = k_.wrenches;
    S_.node_wrenches(m_, ws_, in);
    for (auto run = m_.runs.rbegin(); run != m_.runs.rend(); ++run) S_.inward(m_, ws_, in, *run, {.inertia = false});
    for (const Run& run : m_.runs) S_.acceleration(m_, ws_, in, run, vdot);
  }

  double in_metres(const Loop& loop, int row) const {
    if (loop.closing == Closing::coupling) return 1.0;
    const Force<double>& W = k_.W[at(row)];
    return 1.0 / std::sqrt(dot(W.n, W.n) / (loop.lever * loop.lever) + dot(W.f, W.f));
  }
  const Loop& loop_of(int row) const {
    std::size_t l = 0;
    while (row >= loops_.all[l].first + loops_.all[l].rows) ++l;
    return loops_.all[l];
  }

 private:
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  static std::size_t at(std::size_t i) { return i; }

  Inputs at_rest() const { return {.q = in_.q, .v = k_.zero.data(), .vdot = k_.zero.data(), .gravity = false}; }

  /// Factor of a row of G in k_.B.
  double weight(int row) const { return k_.scale[at(row)] / loop_of(row).reference; }
  /// What makes the diagonal of G M^-1 G* one.
  double unit(int p) const { return k_.L[at(p)]; }

  bool factor_compliance() {
    const int r = k_.rank;
    for (int p = 0; p < r; ++p) {
      const double diagonal = k_.Lambda[at(p * r + p)];
      if (!(diagonal > 0.0)) return false;
      k_.L[at(p)] = 1.0 / std::sqrt(diagonal);
    }
    for (int p = 0; p < r; ++p)
      for (int q = 0; q <= p; ++q) {
        const double both = 0.5 * (k_.Lambda[at(p * r + q)] + k_.Lambda[at(q * r + p)]);  // symmetric by nature
        k_.Lambda[at(p * r + q)] = both * unit(p) * unit(q);
      }
    for (int p = 0; p < r; ++p)
      for (int q = 0; q <= p; ++q) {
        double x = k_.Lambda[at(p * r + q)];
        for (int k = 0; k < q; ++k) x -= k_.Lambda[at(p * r + k)] * k_.Lambda[at(q * r + k)];
        if (p == q && !(x > 0.0)) return false;
        k_.Lambda[at(p * r + q)] = p == q ? std::sqrt(x) : x / k_.Lambda[at(q * r + q)];
      }
    return true;
  }

  void seen_from_home(const LoopEnd& end, const std::vector<int>& path, LoopWork::End& out) const {
    if (end.node >= 0) {
      out.at = deformed(m_, m_.nodes[at(end.node)], in_);
    } else {
      out.at.R = end.pose.R, out.at.rho = end.pose.p;
      out.at.rate = out.at.bias = Motion<double>{};
    }
    Pose<double> X;
    Motion<double> V{};
    for (const int k : path) {
      const Pose<double> step = soa::pose_in_inboard(m_, ws_, k, in_.q);
      V = soa::velocity_of(m_, ws_, in_, k, step, V);
      X = X * step;
    }
    const Motion<double> here = velocity_at(V, out.at);
    out.R_HN = X.R * out.at.R;
    out.x = X.p + X.R * out.at.rho;
    out.w = transpose_times(out.at.R, here.w), out.v = transpose_times(out.at.R, here.v);
  }

  void couple(const Loop& loop) {
    double c = -loop.offset;
    for (const CoupledRate& term : loop.terms) c += term.coefficient * in_.q[term.q];
    k_.c[at(loop.first)] = c;
    k_.rate[at(loop.first)] = coupled(loop, in_.v);
    k_.extra[at(loop.first)] = 0.0;
  }
  /// G v' of couplings; `join(loop, l)` for what joins places.
  template <class Join>
  void each_loop(const double* vdot, double* out, const Join& join) const {
    for (std::size_t l = 0; l < loops_.all.size(); ++l)
      if (const Loop& loop = loops_.all[l]; loop.closing == Closing::coupling)
        out[loop.first] = coupled(loop, vdot);
      else
        join(loop, l);
  }
  static double coupled(const Loop& loop, const double* v) {
    double sum = 0.0;
    for (const CoupledRate& term : loop.terms) sum += term.coefficient * v[term.v];
    return sum;
  }

  void close(const Loop& loop, std::size_t l) {
    const LoopWork::Relative& r = k_.relative[l];
    const auto first = at(loop.first);
    double *c = k_.c.data() + first, *extra = k_.extra.data() + first;
    Force<double>* W = k_.W.data() + first;
    for (int i = 0; i < loop.rows; ++i) W[i] = {}, extra[i] = 0.0;
    const Vector3 units[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const auto hold = [&](int i, const Vector3& u) { W[i].f = u, c[i] = dot(u, r.d); };
    switch (loop.closing) {
      case Closing::weld: {
        const Vector3 turn = rotation_vector(r.R);
        for (int i = 0; i < 3; ++i) W[i].n = units[i], c[i] = dot(units[i], turn), hold(3 + i, units[i]);
        return;
      }
      case Closing::point:
        for (int i = 0; i < 3; ++i) hold(i, units[i]);
        return;
      case Closing::line:
        hold(0, units[0]), hold(1, units[1]);
        return;
      case Closing::plane:
        return hold(0, units[2]);
      case Closing::distance: {
        const double length = std::sqrt(dot(r.d, r.d));
        W[0].f = (1.0 / length) * r.d;
        c[0] = length - loop.length;
        const double along = dot(W[0].f, r.u);
        extra[0] = (dot(r.u, r.u) - along * along) / length;
        return;
      }
      default:
        return close_by_hinge(loop, l, W, c, extra);
    }
  }

  // q of the hinge whose pose is nearest; what is left of the pose, and of rates, in the directions in which the hinge does not move.
  void close_by_hinge(const Loop& loop, std::size_t l, Force<double>* W, double* c, double* extra) {
    const LoopWork::Relative& r = k_.relative[l];
    const cardan_hinge_family& f = *loop.hinge;
    std::vector<double>&q = k_.q[l], &v = k_.v[l];
    std::ranges::copy(loop.q0, q.begin());
    std::ranges::fill(v, 0.0);
    if (f.shape == CARDAN_SHAPE_SCREW) {  // turns beyond one are told by its way
      double u[3], pitch;
      f.axis(loop.packed.data(), u, &pitch);
      if (pitch != 0.0) q[0] = (u[0] * r.d.x + u[1] * r.d.y + u[2] * r.d.z) / pitch;
    }
    const int n = static_cast<int>(f.nv);
    cardan_hinge_out out{};
    Eigen::Matrix<double, 6, 1> e;
    Columns H(6, n);
    const auto look = [&] {
      const std::uint32_t zero = 0;
      f.kinematics(loop.packed.data(), 1, &zero, &zero, q.data(), v.data(), &out);
      const double* R = out.R_OP;
      const Mat3<double> R_OP{R[0], R[1], R[2], R[3], R[4], R[5], R[6], R[7], R[8]};
      e = vector(rotation_vector(transpose(R_OP) * r.R), transpose_times(R_OP, r.d - Vector3{out.p_OP[0], out.p_OP[1], out.p_OP[2]}));
      H = Eigen::Map<const Eigen::Matrix<double, 6, Eigen::Dynamic>>(out.Ht, 6, n);
    };
    look();
    for (int i = 0; n > 0 && i < kTries; ++i) {
      const Few step = least_squares(H, e, loop.lever);
      std::array<double, 7> next{};
      if (f.retract)
        f.retract(loop.packed.data(), q.data(), step.data(), next.data());
      else
        for (int j = 0; j < n; ++j) next[at(j)] = q[at(j)] + step[j];
      std::copy_n(next.begin(), f.nq, q.begin());
      look();
      if (step.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() < 1e-13) break;
    }
    const Eigen::Matrix3d R = to_eigen(r.R);
    Columns H_A(6, n);  // axes of `from`
    H_A.topRows<3>() = R * H.topRows<3>(), H_A.bottomRows<3>() = R * H.bottomRows<3>();
    if (n > 0) {
      const Few rates = least_squares(H_A, vector(r.w, r.u), loop.lever);
      std::copy_n(rates.data(), n, v.begin());
      look();
    }
    complement(H_A, W);
    const Vector3 turn = r.R * Vector3{e[0], e[1], e[2]}, shift = r.R * Vector3{e[3], e[4], e[5]};
    const Vector3 alpha = r.R * Vector3{out.Hdot_v[0], out.Hdot_v[1], out.Hdot_v[2]};
    const Vector3 a = cross(r.w, r.u) + r.R * Vector3{out.Hdot_v[3], out.Hdot_v[4], out.Hdot_v[5]};
    for (int i = 0; i < loop.rows; ++i) {
      c[i] = product(W[i], turn, shift);
      extra[i] = -product(W[i], alpha, a);
    }
  }

  const SweepBody& body_of(const LoopEnd& end) const { return m_.bodies[at(end.sweep)]; }
  const NodeShapes& shapes_of(const LoopEnd& end) const {
    static const NodeShapes rigid;
    return end.node >= 0 ? m_.nodes[at(end.node)].shapes : rigid;
  }

  /// Node axes; w: angular velocity of the node.
  Motion<double> acceleration(const LoopEnd& end, const LoopWork::End& e, const double* vdot, Vector3& w) const {
    const BodyMotion<double> body = motion_of_body(m_, ws_, in_, end.sweep, vdot, After::forward);
    const Motion<double> a = acceleration_at(body_of(end), shapes_of(end), e.at, body.w, body.gamma + body.delta, vdot);
    w = transpose_times(e.at.R, body.w + e.at.rate.w);
    return {transpose_times(e.at.R, a.w), transpose_times(e.at.R, a.v)};
  }
  Motion<double> response(const LoopEnd& end, const LoopWork::End& e, const double* vdot) const {
    const Motion<double> delta = motion_of_body(m_, ws_, in_, end.sweep, vdot, After::forward).delta;
    Motion<double> a{delta.w, delta.v + cross(delta.w, e.at.rho)};
    const SweepBody& b = body_of(end);
    if (const NodeShapes& shapes = shapes_of(end); shapes.deforms())
      for (int j = 0; j < b.n_modes; ++j) a += vdot[b.etadot + j] * soa::node_column(shapes, e.at, j);
    return {transpose_times(e.at.R, a.w), transpose_times(e.at.R, a.v)};
  }

  /// f on the end `to`, its opposite on the end `from`: wrenches on nodes, node axes.
  std::span<const NodeWrench> wrenches_of(const Loop& loop, const Force<double>& f) {
    const LoopWork::Relative& r = k_.relative[static_cast<std::size_t>(&loop - loops_.all.data())];
    k_.one.clear();
    if (loop.to.node >= 0) k_.one.push_back({loop.to.node, false, {transpose_times(r.R, f.n), transpose_times(r.R, f.f)}});
    if (loop.from.node >= 0) k_.one.push_back({loop.from.node, false, {-(f.n + cross(r.d, f.f)), -f.f}});
    return k_.one;
  }

  void restore() {
    std::size_t mode = 0;
    for (std::size_t k = 1; k < m_.bodies.size(); ++k) {
      ws_.core(static_cast<int>(k)).gamma = k_.gamma[k];
      ws_.core(static_cast<int>(k)).z = k_.z[k];
      if (soa::Modal<double>* modal = ws_.modal_of(static_cast<int>(k)))
        for (int j = 0; j < m_.bodies[k].n_modes; ++j) modal->z[j] = k_.z_modes[mode++];
    }
    for (std::size_t i = 0; i < m_.rotors.size(); ++i) ws_.axis(m_.rotors[i]).load = k_.rotor_loads[i];
  }

  const Model& m_;
  const Loops& loops_;
  Workspace& ws_;
  LoopWork& k_;
  const Inputs& in_;
  const soa::Sweeps<double>& S_;
};

void make_room(const Model& model, Workspace& ws) {
  if (ws.loops) return;
  ws.loops = {new LoopWork(model), [](LoopWork* work) { delete work; }};
}

bool stop(Workspace& ws, const Loop& loop, int row, double value, double limit) {
  const int outer = std::max(loop.from.sweep, loop.to.sweep);
  ws.breakdown = {.body = outer > 0 ? outer : 1, .component = -1, .value = value, .limit = limit, .row = row};
  return false;
}

}  // namespace

LoopWork::LoopWork(const Model& model) {
  const Loops& loops = model.loops;
  const std::size_t n = loops.all.size(), rows = static_cast<std::size_t>(loops.rows), nv = static_cast<std::size_t>(model.nv);
  from.resize(n), to.resize(n), relative.resize(n), q.resize(n), v.resize(n);
  std::vector<std::uint8_t> moves(nv), marked(model.bodies.size());
  const auto mark = [&](int k) {
    for (; k > 0; k = model.bodies[static_cast<std::size_t>(k)].parent) marked[static_cast<std::size_t>(k)] = 1;
  };
  for (std::size_t l = 0; l < n; ++l) {
    const Loop& loop = loops.all[l];
    if (loop.hinge) q[l].resize(loop.hinge->nq), v[l].resize(loop.hinge->nv);
    for (const int i : loop.rates)
      if (!model.has_prescribed() || !model.prescribed[static_cast<std::size_t>(i)]) moves[static_cast<std::size_t>(i)] = 1;
    mark(loop.from.sweep), mark(loop.to.sweep);
    for (const CoupledRate& term : loop.terms)
      for (std::size_t k = 1; k < model.bodies.size(); ++k)
        if (const SweepBody& b = model.bodies[k]; term.v >= b.v && term.v < b.v + b.nv) mark(static_cast<int>(k));
    coupled = coupled || loop.closing == Closing::coupling;
  }
  for (std::size_t k = 1; k < model.bodies.size(); ++k)  // what hangs on a flexible body may be eliminated with it
    if (const SweepBody& b = model.bodies[k]; b.onode >= 0 && marked[static_cast<std::size_t>(b.parent)]) marked[k] = 1;
  near = stretches(model.runs, marked);
  for (std::size_t i = 0; i < nv; ++i)
    if (moves[i]) columns.push_back(static_cast<int>(i));
  W.resize(rows), row_at.resize(rows), column_at.resize(columns.size());
  for (auto* x : {&c, &rate, &extra, &open, &acceleration, &rhs, &lambda, &step, &scale, &L, &y}) x->resize(rows);
  G.resize(rows * nv), U.resize(rows * nv), B.resize(rows * columns.size());
  for (auto* x : {&Lambda, &N, &NN}) x->resize(rows * rows);
  gamma.resize(model.bodies.size()), z.resize(model.bodies.size());
  z_modes.resize(static_cast<std::size_t>(model.n_modes)), rotor_loads.resize(model.rotors.size());
  wrenches.reserve(2 * n), one.reserve(2);
  tau.resize(coupled ? nv : 0), tau_of_row.resize(nv), response.resize(nv), zero.resize(nv);
}

void keep_loads(const Model& model, Workspace& ws) {
  make_room(model, ws);
  LoopWork& work = *ws.loops;
  std::size_t mode = 0;
  for (std::size_t k = 1; k < model.bodies.size(); ++k) {
    work.gamma[k] = ws.core(static_cast<int>(k)).gamma;
    work.z[k] = ws.core(static_cast<int>(k)).z;
    if (const soa::Modal<double>* modal = ws.modal_of(static_cast<int>(k)))
      for (int j = 0; j < model.bodies[k].n_modes; ++j) work.z_modes[mode++] = modal->z[j];
  }
  for (std::size_t i = 0; i < model.rotors.size(); ++i) work.rotor_loads[i] = ws.axis(model.rotors[i]).load;
}

bool close_loops(const Model& model, Workspace& ws, const Inputs& in, double* vdot) {
  LoopWork& work = *ws.loops;
  Pass pass(model, ws, in);
  pass.place();
  pass.accelerations(vdot, work.open.data());
  pass.matrix();
  pass.find_rank();
  if (!pass.compliance(model.runs)) return stop(ws, pass.loop_of(work.row_at[0]), work.row_at[0], 0.0, 0.0);
  double size = 0.0;
  for (std::size_t i = 0; i < work.open.size(); ++i) {
    work.rhs[i] = -work.open[i], work.lambda[i] = 0.0;
    size = std::max(size, work.scale[i] * std::abs(work.open[i]));
  }
  pass.solve(work.rhs.data(), work.lambda.data());
  for (int twice = 0; twice < 2; ++twice) {  // the second time with what rounding has left open
    pass.share();
    pass.push();
    pass.move(vdot);
    pass.accelerations(vdot, work.acceleration.data());
    for (std::size_t i = 0; i < work.rhs.size(); ++i) work.rhs[i] = -work.acceleration[i];
    if (twice == 0) pass.solve(work.rhs.data(), work.lambda.data());
  }
  // What is less than the rounding of the multipliers still counts where what they push is light (rotors behind gears).
  std::ranges::fill(work.step, 0.0);
  pass.solve(work.rhs.data(), work.step.data());
  for (int p = 0; p < work.rank; ++p) {
    const double mu = work.step[static_cast<std::size_t>(work.row_at[static_cast<std::size_t>(p)])];
    const double* U = work.U.data() + static_cast<std::ptrdiff_t>(p) * model.nv;
    for (int i = 0; i < model.nv; ++i) vdot[i] += mu * U[i];
  }
  double open = 0.0;
  for (const Loop& loop : model.loops.all)
    for (int i = loop.first; i < loop.first + loop.rows && loop.closing != Closing::coupling; ++i)
      open = std::max(open, work.scale[static_cast<std::size_t>(i)] * std::abs(work.c[static_cast<std::size_t>(i)]) / loop.lever);
  const double limit = (kContradiction + 1e3 * open) * size;
  for (std::size_t i = static_cast<std::size_t>(work.rank); i < work.row_at.size(); ++i) {
    const int row = work.row_at[i];
    const auto at = static_cast<std::size_t>(row);
    if (const double missing = work.scale[at] * std::abs(work.acceleration[at]); !(missing <= limit))
      return stop(ws, pass.loop_of(row), row, missing, limit);
  }
  return true;
}

LoopForces loop_forces(const Workspace& ws) {
  if (!ws.loops) return {};
  const LoopWork& work = *ws.loops;
  return {work.lambda, work.wrenches, work.c, work.rate, work.tau, work.W};
}

Force<double> loop_wrench(const Model& model, const Workspace& ws, int loop) {
  const Loop& l = model.loops.all[static_cast<std::size_t>(loop)];
  Force<double> f{};
  for (int i = l.first; i < l.first + l.rows; ++i)
    f += ws.loops->lambda[static_cast<std::size_t>(i)] * ws.loops->W[static_cast<std::size_t>(i)];
  return f;
}

namespace {

/// Where each component of v is an angular velocity.
std::vector<std::uint8_t> turning(const Model& model) {
  std::vector<std::uint8_t> out(static_cast<std::size_t>(model.nv));
  for (const UserBody& u : model.user)
    for (int i = 0; i < u.nv; ++i) out[static_cast<std::size_t>(u.v + i)] = u.v_units[static_cast<std::size_t>(i)] == "rad/s";
  return out;
}

/// Poses at q; P, D and G where `inertia`.
bool stand(const Model& model, Workspace& ws, const double* q, bool inertia) {
  make_room(model, ws);
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  const double* still = ws.loops->zero.data();
  const Inputs in{.q = q, .v = still, .vdot = still, .gravity = false};
  outward(model, S, ws, in, {.velocity = false});
  for (auto run = model.runs.rbegin(); inertia && run != model.runs.rend() && ws.breakdown.body == 0; ++run)
    S.inward(model, ws, in, *run, {.bias = false});
  return ws.breakdown.body == 0;
}

/// [m] largest distance of an end from a hinge on the way to it.
double lever_of(const Model& model, const Workspace& ws, const Loop& loop, std::size_t l, const double* q) {
  double longest = 0.0;
  for (const auto& [path, end] : {std::pair(&loop.from_path, &ws.loops->from[l]), std::pair(&loop.to_path, &ws.loops->to[l])}) {
    Pose<double> X;
    for (const int k : *path) {
      X = X * soa::pose_in_inboard(model, ws, k, q);
      const Vector3 arm = end->x - X.p;
      longest = std::max(longest, std::sqrt(dot(arm, arm)));
    }
  }
  return longest > 0.0 ? longest : 1.0;
}

std::string name_of_row(const Loop& loop, int row, const Force<double>& W) {
  if (loop.rows == 1) return loop.name;
  const bool turns = dot(W.n, W.n) > dot(W.f, W.f);
  const Vector3 u = turns ? W.n : W.f;
  const double x = std::abs(u.x), y = std::abs(u.y), z = std::abs(u.z);
  const char* axis = x >= y && x >= z ? "x" : y >= z ? "y" : "z";
  return fmt::format("{}: row {}, {} {}", loop.name, row - loop.first + 1, turns ? "rotation about" : "along", axis);
}

const char* unit_of_row(const Loop& loop, const Force<double>& W) {
  return loop.closing == Closing::coupling ? "" : dot(W.n, W.n) > dot(W.f, W.f) ? " rad" : " m";
}

/// What a loop of this size may be open by at the start, of a row.
void refuse_open_start(const Model& model, const LoopWork& work, const Eigen::VectorXd& v) {
  DiagnosticSink sink;
  for (const Loop& loop : model.loops.all) {
    std::string places, rates;
    double pace = 1.0;
    for (const int i : loop.rates) pace = std::max(pace, std::abs(v[i]));
    for (int i = loop.first; i < loop.first + loop.rows; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const Force<double>& W = work.W[at];
      double size = loop.closing == Closing::coupling || dot(W.n, W.n) > dot(W.f, W.f) ? 1.0 : loop.lever, speed = size;
      for (const CoupledRate& term : loop.terms) speed = std::max(speed, std::abs(term.coefficient));
      const std::string name = name_of_row(loop, i, W);
      const auto add = [&](std::string& text, double value, const char* per) {
        text += fmt::format("{}{} {:.3g}{}{}", text.empty() ? "" : "; ", name, value, unit_of_row(loop, W), per);
      };
      if (!(std::abs(work.c[at]) <= kStart * size)) add(places, work.c[at], "");
      if (!(std::abs(work.rate[at]) <= kStart * pace * speed)) add(rates, work.rate[at], loop.closing == Closing::coupling ? " 1/s" : "/s");
    }
    const auto report = [&](const char* expected, const std::string& got, const char* hint) {
      if (!got.empty()) sink.report(Code::open_start, model.spec->locate("loops." + loop.name), expected, got, hint);
    };
    report("initial coordinates that close it", places,
           "give `initial` of the hinges between its ends the values that bring them together");
    if (places.empty()) report("initial rates that keep it closed", rates, "give `initial` of the hinges rates that move both ends alike");
  }
  sink.throw_if_any();
}

}  // namespace

void prepare_loops(Model& model, const Eigen::VectorXd& inertia) {
  Loops& loops = model.loops;
  Workspace ws(model);
  const State start = model.initial_state();
  loops.column_scale.assign(inertia.data(), inertia.data() + model.nv);
  for (double& x : loops.column_scale) x = x > 0.0 ? 1.0 / std::sqrt(x) : 1.0;
  for (Loop& loop : loops.all) {
    if (!loop.hinge) continue;
    loop.q0.assign(loop.hinge->nq, 0.0);
    if (loop.hinge->zero) loop.hinge->zero(loop.packed.data(), loop.q0.data());
  }
  stand(model, ws, start.q.data(), false);
  const Inputs in{.q = start.q.data(), .v = start.v.data(), .gravity = false};
  Pass pass(model, ws, in);
  pass.place();
  const std::vector<std::uint8_t> turns = turning(model);
  for (std::size_t l = 0; l < loops.all.size(); ++l) {
    Loop& loop = loops.all[l];
    loop.reference = 0.0;
    const auto refer = [&](int v, double arm) {
      loop.reference = std::max(loop.reference, arm * loops.column_scale[static_cast<std::size_t>(v)]);
    };
    for (const CoupledRate& term : loop.terms) refer(term.v, std::abs(term.coefficient));
    if (loop.closing == Closing::coupling) continue;
    loop.lever = lever_of(model, ws, loop, l, start.q.data());
    for (const int v : loop.rates) refer(v, turns[static_cast<std::size_t>(v)] ? loop.lever : 1.0);
    if (loop.hinge) loop.q0 = ws.loops->q[l];
  }
  pass.place();  // with the levers
  refuse_open_start(model, *ws.loops, start.v);
  pass.matrix();
  pass.find_rank();
  loops.rank = ws.loops->rank;
}

LoopRank loop_rank(const Model& model, Workspace& ws, const double* q) {
  stand(model, ws, q, false);
  const Inputs in{.q = q, .v = ws.loops->zero.data(), .gravity = false};
  Pass pass(model, ws, in);
  pass.place();
  pass.matrix();
  pass.find_rank();
  const LoopWork& work = *ws.loops;
  return {model.loops.rows, work.rank, {work.row_at.begin() + work.rank, work.row_at.end()}, work.smallest, work.largest};
}

Eigen::MatrixXd loop_matrix(const Model& model, Workspace& ws, const double* q) {
  loop_rank(model, ws, q);
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(ws.loops->G.data(), model.loops.rows,
                                                                                                  model.nv);
}

std::string name_of_row(const Model& model, const Workspace& ws, int row) {
  for (const Loop& loop : model.loops.all)
    if (row < loop.first + loop.rows) return name_of_row(loop, row, ws.loops->W[static_cast<std::size_t>(row)]);
  return {};
}

LoopProjection::LoopProjection(const Model& model) : model_(model), ws_(model), step_(model.nv), next_(model.nq), mu_(model.loops.rows) {}
LoopProjection::~LoopProjection() = default;

soa::Breakdown LoopProjection::breakdown() const {
  if (ws_.breakdown.body != 0) return ws_.breakdown;
  return {.body = 1, .value = open_, .limit = kClosed, .row = worst_};
}

bool LoopProjection::close(double* q, double* v) {
  make_room(model_, ws_);
  LoopWork& work = *ws_.loops;
  const Inputs in{.q = q, .v = v, .gravity = false};
  Pass pass(model_, ws_, in);
  const auto largest = [&](const std::vector<double>& x) {
    double most = 0.0;
    worst_ = 0;
    for (const Loop& loop : model_.loops.all) {
      double size = loop.lever;
      for (const CoupledRate& term : loop.terms) size = std::max(size, std::abs(term.coefficient));
      for (int i = loop.first; i < loop.first + loop.rows; ++i) {
        const double one = std::abs(x[static_cast<std::size_t>(i)]) * pass.in_metres(loop, i) / size;
        if (!(one <= most)) most = one, worst_ = i;  // what is no number is the largest
      }
    }
    return most;
  };
  /// The least motion M^-1 G* mu that takes G of it from x.
  const auto take = [&](const std::vector<double>& x) {
    mu_.setZero();
    pass.solve(x.data(), mu_.data());
    step_.setZero();
    for (int p = 0; p < work.rank; ++p)
      step_ -= mu_[work.row_at[static_cast<std::size_t>(p)]] *
               Eigen::Map<const Eigen::VectorXd>(work.U.data() + static_cast<std::ptrdiff_t>(p) * model_.nv, model_.nv);
  };
  double before = std::numeric_limits<double>::infinity();
  for (int i = 0;; ++i) {
    if (!stand(model_, ws_, q, true)) return false;
    pass.place();
    const double now = largest(work.c);
    if (i == 0) distance_ = now;
    open_ = now;
    if (!std::isfinite(now)) return false;
    pass.matrix();
    pass.find_rank();
    if (!pass.compliance(model_.runs)) return false;
    if (now <= kClosed || (i > 0 && now > 0.5 * before && before < 1e-11)) break;
    if (i == kTries || (i > 2 && now > before)) return false;
    take(work.c);
    model_.retract(q, step_.data(), next_.data());
    std::copy_n(next_.data(), model_.nq, q);
    before = now;
  }
  const int in_place = worst_;
  rate_ = largest(work.rate);
  if (!(rate_ > distance_)) worst_ = in_place;
  take(work.rate);
  for (int i = 0; i < model_.nv; ++i) v[i] += step_[i];
  return true;
}

}  // namespace cardan
