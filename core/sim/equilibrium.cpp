#include "core/sim/equilibrium.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>

#include "core/base/diagnostic.hpp"
#include "core/base/poll.hpp"
#include "core/linalg/dense.hpp"
#include "core/model/components.hpp"
#include "core/model/loops.hpp"
#include "core/operators/linear_model.hpp"
#include "core/operators/sensitivity.hpp"
#include "core/sim/operating_state.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kTied = 1e-9;      // singular values of what loops tie to what stands, over the largest
constexpr double kNeutral = 1e-12;  // an eigenvalue, over the largest, that counts as zero
constexpr int kParts = 4;           // of a step of Newton, each half of the one before
constexpr int kDamped = 10;         // damped steps
constexpr double kDamping = 1e-4;   // of the first of them, over what is left of r
constexpr double kTurning = 1e-6;   // rates of loops that cannot be at rest, over the largest rate, or 1
constexpr double kStalled = 1e-8;   // where nothing comes nearer: what is left, as a displacement, that is rounding
constexpr double kBent = 0.5;       // of r: how far r may be from what its slope told, for a step of the descent
constexpr double kCaution = 0.9;    // of the span that would just reach that
constexpr double kSpans = 8.0;      // by which spans grow and shrink at most
constexpr int kShrunk = 24;         // times, at most, in one step

Eigen::Index rank(const RightSingular& parts) { return (parts.values.array() > kTied * parts.values[0]).count(); }
/// The rows that hold, without those of zeros.
MatrixXd rows(const MatrixXd& A, auto hold) {
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < A.rows(); ++i)
    if (hold(static_cast<int>(i)) && !A.row(i).isZero(0.0)) kept.push_back(i);
  return A(kept, Eigen::all);
}

double largest(const VectorXd& x) { return x.size() > 0 ? x.lpNorm<Eigen::Infinity>() : 0.0; }

/// Motions v = along y that are looked at, and how r = rates* v', which is to vanish, changes with them: dr = J dy.
struct Slope {
  MatrixXd along, rates;  // nv x k
  MatrixXd J;             // k x k
  MatrixXd M;             // k x k, masses of these motions
  VectorXd r(const VectorXd& vdot) const { return rates.transpose() * vdot; }
  VectorXd size;  // k: of each row of J the largest entry so far (as Moré 1978 does with columns); 1 where there was none
  void set_sizes(VectorXd& largest_yet) {
    const VectorXd now = J.rowwise().lpNorm<Eigen::Infinity>();
    largest_yet = largest_yet.size() == now.size() ? VectorXd(largest_yet.cwiseMax(now)) : now;
    size = largest_yet.unaryExpr([](double x) { return x > 0.0 ? x : 1.0; });
  }
  /// r in the unit of y.
  VectorXd scaled(const VectorXd& r) const { return r.cwiseQuotient(size); }
  /// The shortest dy that brings r nearest to zero, rows of J alike.
  VectorXd newton_step(const VectorXd& r) const { return -least_squares(size.cwiseInverse().asDiagonal() * J, scaled(r)); }
  /// The dy of least |r + J dy|^2 + damping |dy|^2, rows of J alike (Levenberg 1944, Marquardt 1963).
  VectorXd damped_step(const VectorXd& r, double damping) const {
    const MatrixXd A = size.cwiseInverse().asDiagonal() * J;
    MatrixXd normal = A.transpose() * A;
    normal.diagonal().array() += damping;
    return -symmetric_solve(normal, VectorXd(A.transpose() * scaled(r)));
  }
  /// The dy that y' = r takes in a span, by Euler's implicit step: (1 - span J) dy = span r.
  VectorXd descent(const VectorXd& r, double span) const { return lu_solve(MatrixXd::Identity(J.rows(), J.cols()) - span * J, span * r).x; }
  /// The forces M r that are left, as displacements: of each over the largest entry of its row of the stiffness M J. Stiff modes are in
  /// each row of J itself, and hide there what is soft.
  VectorXd unbalanced(const VectorXd& r) const {
    return (M * r).cwiseQuotient((M * J).rowwise().lpNorm<Eigen::Infinity>().unaryExpr([](double x) { return x > 0.0 ? x : 1.0; }));
  }
  /// Of y'' = J y: the eigenvalue that lets it grow most, zero if none does but by rounding; by motions of mass 1 each, in which J of a
  /// potential is symmetric and so rounding small.
  double growth() const {
    const MatrixXd Y = cholesky(M) ? orthonormalised(MatrixXd::Identity(M.rows(), M.cols()), M) : MatrixXd();
    const Eigen::ArrayXcd lambda = eigenvalues(Y.size() > 0 ? MatrixXd(Y.transpose() * M * J * Y) : J);
    const double most = lambda.real().maxCoeff();
    return most > kNeutral * lambda.abs().maxCoeff() ? most : 0.0;
  }
  /// What no dy takes away of r, in the unit of y: zero but for rounding where J has its rank.
  double out_of_reach(const VectorXd& r) const { return largest(scaled(r + J * newton_step(r))); }
};

class Search {
 public:
  Search(Simulation& sim, const EquilibriumOptions& options)
      : trial_(sim.shared_model(), SimulationOptions{}), m_(trial_.model()), moves_(static_cast<std::size_t>(m_.nv), 0), turns_(moves_) {
    const int own = m_.devices.n_loads;
    for (std::size_t i = static_cast<std::size_t>(own); i < sim.wrenches().size(); ++i)
      trial_.add_wrench(sim.wrenches()[i].node, sim.wrenches()[i].world_axes);
    trial_.take_over(sim);
    for (const int v : options.move) {
      if (v < 0 || v >= m_.nv)
        refuse(Code::out_of_range, {"equilibrium.move"}, fmt::format("velocity components 0 to {}", m_.nv - 1), fmt::format("{}", v));
      if (m_.has_given_motion(v))
        refuse(Code::unsupported, {"equilibrium.move"}, "components that are free",
               fmt::format("{}, whose motion is given", component_name(m_, v)));
      moves_[static_cast<std::size_t>(v)] = 1;
    }
    if (options.move.empty()) refuse(Code::missing_key, {"equilibrium.move"}, "the components that may move", "none");
    for (const UserBody& u : m_.user)
      for (int j = 0; j < u.nv; ++j) turns_[static_cast<std::size_t>(u.v + j)] = u.v_units[static_cast<std::size_t>(j)] == "rad/s";
    if (!m_.loops.empty()) loops_.emplace(m_);
  }

  Equilibrium run(const EquilibriumOptions& options) {
    begin_at_rest();
    const State start = trial_.state();
    Course course = by_newton(options);
    if (!course.reached()) {
      const State nearest = trial_.state();
      place(start);
      Course down = by_descent(options);
      down.iterations += course.iterations;
      if (down.reached())
        course = down;
      else
        place(nearest), course.iterations = down.iterations;
    }
    if (course.reached()) unwind(start);
    Equilibrium out;
    out.q = trial_.state().q, out.v = trial_.state().v;
    out.iterations = course.iterations, out.reached = course.reached();
    out.statically_stable = out.reached && slope_here().growth() == 0.0;
    tell(out, course.settled);
    return out;
  }

 private:
  Simulation trial_;
  const Model& m_;
  const std::shared_ptr<const Model> open_ = open_tree(trial_.own_model());
  std::vector<std::uint8_t> moves_, turns_;  // per velocity component
  std::optional<LoopProjection> loops_;

  /// How a search ended.
  struct Course {
    int iterations = 0;
    bool settled = false;       // no step goes on from there
    double out_of_reach = 0.0;  // what of r none takes away, as a displacement
    bool reached() const { return settled && out_of_reach <= kStalled; }
  };

  void begin_at_rest() {
    State at = trial_.state();
    for (int v = 0; v < m_.nv; ++v)
      if (moves_[static_cast<std::size_t>(v)]) at.v[v] = 0.0;
    if (!place(at)) trial_.set_state(at), trial_.vdot();  // throws what is wrong with the start
    if (const double turning = largest(trial_.state().v - at.v); turning > kTurning * std::max(1.0, largest(at.v)))
      refuse(Code::unsupported, {"equilibrium.move"}, "loops that let what may move be at rest while all others keep their rates",
             fmt::format("rates that loops change by {:.3g}", turning), "name more of those of the loops, or stop what turns them");
  }

  /// To the equilibrium nearby, whether or not it is stable.
  Course by_newton(const EquilibriumOptions& options) {
    Course out;
    VectorXd went = VectorXd::Zero(m_.nv), sizes;
    bool nearer = true;
    while (!out.settled && nearer && out.iterations < options.iterations) {
      const std::optional<Slope> here = next_slope(out, sizes);
      if (!here) break;
      const Slope& slope = *here;
      const VectorXd r = slope.r(trial_.vdot()), d = slope.along * slope.newton_step(r);
      if (!d.allFinite()) break;
      out.out_of_reach = slope.out_of_reach(r);
      const double far = std::max(1.0, largest(went));
      const bool undamped = approach_by_newton(slope, d, options.step, went);
      nearer = undamped || approach_with_damping(slope, r, options.step, went);
      out.settled = undamped ? largest(d) <= options.tolerance * far : !nearer && largest(slope.unbalanced(r)) <= kStalled * far;
    }
    return out;
  }

  /// Down to one that is stable: along y' = r, which under forces that have a potential never rises in it, as masses measure what is steep.
  /// The span of a step grows as r comes to be linear, until it is one of Newton's; not beyond where what drives itself on is led back.
  Course by_descent(const EquilibriumOptions& options) {
    Course out;
    VectorXd went = VectorXd::Zero(m_.nv), sizes;
    double span = 1.0;
    while (!out.settled && out.iterations < options.iterations) {
      const std::optional<Slope> here = next_slope(out, sizes);
      if (!here) break;
      const Slope& slope = *here;
      const VectorXd r = slope.r(trial_.vdot());
      out.out_of_reach = slope.out_of_reach(r);
      const double far = std::max(1.0, largest(went));
      if (const double growth = slope.growth(); growth > 0.0) span = std::min(span, 0.5 / growth);
      const bool went_on = approach_by_descent(slope, r, options.step, span, went);
      out.settled =
          largest(slope.along * slope.newton_step(r)) <= options.tolerance * far || (!went_on && largest(slope.unbalanced(r)) <= kStalled);
      if (!went_on) break;
    }
    return out;
  }

  /// Goes there, loops closed; false where there are no accelerations.
  bool place(State at) {
    if (loops_ && !loops_->close(at.q.data(), at.v.data(), trial_.drives().data())) return false;
    trial_.set_state(at);
    try {
      return trial_.vdot().allFinite();
    } catch (const NumericsError&) {
      return false;
    }
  }

  /// Of an iteration more, rows by the largest sizes yet. Nothing where a search has gone so far that derivatives drown in rounding; at
  /// its start that is thrown.
  std::optional<Slope> next_slope(Course& course, VectorXd& sizes) {
    Poll::now();
    ++course.iterations;
    try {
      Slope slope = slope_here();
      slope.set_sizes(sizes);
      return slope;
    } catch (const NumericsError&) {
      if (course.iterations == 1) throw;
      return std::nullopt;
    }
  }

  Slope slope_here() {
    const OperatingState at = operating_state(trial_);
    const double* q = trial_.state().q.data();
    Slope out = loops_ ? closed_slope(at.point(q)) : open_slope(at, q);
    Workspace ws(*open_);
    out.M = out.along.transpose() * mass_matrix(*open_, ws, q) * out.along;
    return out;
  }

  Slope open_slope(const OperatingState& at, const double* q) {
    std::vector<int> moved;
    for (int v = 0; v < m_.nv; ++v)
      if (moves_[static_cast<std::size_t>(v)]) moved.push_back(v);
    const auto k = static_cast<Eigen::Index>(moved.size());
    Slope out{MatrixXd::Zero(m_.nv, k), {}, {}, {}, {}};
    std::vector<operators::Direction> along(moved.size());
    for (Eigen::Index j = 0; j < k; ++j) {
      out.along(moved[static_cast<std::size_t>(j)], j) = 1.0;
      along[static_cast<std::size_t>(j)].q = out.along.col(j).data();
    }
    operators::Sensitivities about(trial_.own_model());
    about.solve(at.inputs(q), at.devices.get());
    MatrixXd slope(m_.nv, k);
    about.forward(along, slope.data());
    out.rates = out.along;
    out.J = out.rates.transpose() * slope;
    return out;
  }

  /// Of the independent components, those motions in which nothing moves that may not.
  Slope closed_slope(const operators::OperatingPoint& at) {
    const operators::ClosedDerivatives found = operators::closed_derivatives(m_, at);
    Workspace ws(m_);
    const MatrixXd X = loop_freedom(m_, ws, at.q, at.drives).X;
    /// The motions of independent components in which nothing that `stays` moves.
    const auto still = [&](auto stays) -> MatrixXd {
      const MatrixXd held = rows(X, stays);
      if (held.rows() == 0) return MatrixXd::Identity(X.cols(), X.cols());
      const RightSingular parts = right_singular(held);
      return parts.vectors.rightCols(X.cols() - rank(parts));
    };
    const auto named = [&](int v) { return moves_[static_cast<std::size_t>(v)] != 0; };
    const MatrixXd N = still(std::not_fn(named)), free = still([&](int v) { return !named(v) && m_.has_prescribed() && m_.prescribed[v]; });
    // Where more of what is named is independent than these motions, it accelerates with what may: it has no rest, and r of it would
    // hang on units.
    if (N.cols() == 0 || rank(right_singular(rows(X * free, named))) > N.cols())
      refuse(Code::unsupported, {"equilibrium.move"}, "components that closed loops let move while all others stand",
             "some that they tie to others", "name more of those of the loops");
    Slope out{X * N, MatrixXd::Zero(m_.nv, N.cols()), {}, {}, {}};
    for (Eigen::Index i = 0; i < N.rows(); ++i) out.rates.row(found.independent[static_cast<std::size_t>(i)]) = N.row(i);
    out.J = out.rates.transpose() * found.q * N;
    return out;
  }

  double largest_turn(const VectorXd& d) const {
    double most = 0.0;
    for (int v = 0; v < m_.nv; ++v)
      if (turns_[static_cast<std::size_t>(v)]) most = std::max(most, std::abs(d[v]));
    return most;
  }

  double within(double turn, const VectorXd& d) const { return std::min(1.0, turn / std::max(largest_turn(d), turn)); }
  State moved(const State& from, const VectorXd& d) const {
    State next = from;
    m_.retract(from.q.data(), d.data(), next.q.data());
    return next;
  }

  /// By d or a part of it, such that the next step would be smaller by the same slope (Deuflhard 2004, natural monotonicity); false: no
  /// part of it is, and it stays.
  bool approach_by_newton(const Slope& slope, const VectorXd& d, double turn, VectorXd& went) {
    const State from = trial_.state();
    double part = within(turn, d);
    for (int tried = 0; tried < kParts; ++tried, part *= 0.5) {
      if (!place(moved(from, part * d))) continue;
      const VectorXd left = slope.along * slope.newton_step(slope.r(trial_.vdot()));
      if (!(left.norm() <= (1.0 - 0.25 * part) * d.norm())) continue;
      went += part * d;
      return true;
    }
    place(from);
    return false;
  }
  /// By damped steps, ever shorter, such that r is smaller: where J has hardly its rank, as beside postures that are next to each other.
  bool approach_with_damping(const Slope& slope, const VectorXd& r, double turn, VectorXd& went) {
    const State from = trial_.state();
    const double now = slope.scaled(r).norm();
    double damping = kDamping * std::min(1.0, now);
    for (int tried = 0; tried < kDamped; ++tried, damping *= 8.0) {
      VectorXd d = slope.along * slope.damped_step(r, damping);
      d *= within(turn, d);
      if (!place(moved(from, d)) || !(slope.scaled(slope.r(trial_.vdot())).norm() <= (1.0 - 1e-3) * now)) continue;
      went += d;
      return true;
    }
    place(from);
    return false;
  }

  /// By the step of a span, or of one so much shorter that r is nearly what its slope tells; the next is as long as that lets expect.
  bool approach_by_descent(const Slope& slope, const VectorXd& r, double turn, double& span, VectorXd& went) {
    const State from = trial_.state();
    const double now = slope.scaled(r).norm();
    for (int tried = 0; tried < kShrunk; ++tried) {
      const VectorXd dy = slope.descent(r, span), d = slope.along * dy;
      if (!d.allFinite() || largest_turn(d) > turn || !place(moved(from, d))) {
        span /= kSpans;
        continue;
      }
      const double bent = slope.scaled(slope.r(trial_.vdot()) - r - slope.J * dy).norm();  // ~ span^2
      span *= std::clamp(kCaution * std::sqrt(kBent * now / bent), 1.0 / kSpans, kSpans);
      if (!(bent <= kBent * now)) continue;
      went += d;
      return true;
    }
    place(from);
    return false;
  }

  /// Takes back the whole turns that hinges of one angle have made, where nothing then pushes otherwise: without springs, stops or
  /// couplings of that angle it is the same posture, nearer to the start.
  void unwind(const State& start) {
    constexpr double turn = 2.0 * std::numbers::pi;
    for (const UserBody& u : m_.user) {
      if (u.nq != 1 || u.nv != 1 || !turns_[static_cast<std::size_t>(u.v)] || !moves_[static_cast<std::size_t>(u.v)]) continue;
      const State wound = trial_.state();
      const double turns = std::round((wound.q[u.q] - start.q[u.q]) / turn);
      if (turns == 0.0) continue;
      Slope slope = slope_here();
      VectorXd sizes;
      slope.set_sizes(sizes);
      const VectorXd r = slope.r(trial_.vdot());
      State back = wound;
      back.q[u.q] -= turns * turn;
      if (!place(back) || !(largest(slope.scaled(slope.r(trial_.vdot()) - r)) <= kStalled) ||
          !(largest(trial_.state().q - back.q) <= kStalled))
        place(wound);
    }
  }

  void tell(Equilibrium& out, bool settled) {
    int worst = -1;
    for (int v = 0; v < m_.nv; ++v)
      if (moves_[static_cast<std::size_t>(v)] && (worst < 0 || !(std::abs(trial_.vdot()[v]) <= out.residual)))
        worst = v, out.residual = std::abs(trial_.vdot()[v]);
    const std::string left = fmt::format("{} has an acceleration of {:.3g}", component_name(m_, worst), out.residual);
    const std::string after = fmt::format("after {} iteration{}", out.iterations, out.iterations == 1 ? "" : "s");
    if (out.reached)
      out.message = fmt::format("in equilibrium {}: {} at most{}", after, left,
                                out.statically_stable ? "" : "; a small move drives itself on there, unless what spins holds it");
    else if (settled)
      out.message = fmt::format("not in equilibrium: {} wherever it moves, nothing that it moves holds it", left);
    else
      out.message = fmt::format("not in equilibrium {}: {}; begin nearer to one, or name what may move with it", after, left);
  }
};

}  // namespace

Equilibrium find_equilibrium(Simulation& sim, const EquilibriumOptions& options) { return Search(sim, options).run(options); }

}  // namespace cardan
