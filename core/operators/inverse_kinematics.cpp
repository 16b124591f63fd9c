#include "core/operators/inverse_kinematics.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "core/base/diagnostic.hpp"
#include "core/base/poll.hpp"
#include "core/dynamics/loops.hpp"
#include "core/dynamics/node_motion.hpp"
#include "core/linalg/dense.hpp"
#include "core/model/loops.hpp"
#include "core/operators/apply.hpp"
#include "core/soa/kernels.hpp"

namespace cardan::operators {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Vector6 = Eigen::Matrix<double, 6, 1>;

constexpr double kStationary = 1e-9;     // |J* e| over |J| |e|
constexpr double kNullSpaceStep = 1e-7;  // the distance to the preferred posture is flat to round-off below
constexpr int kSecondaryIterations = 100;
constexpr double kClosed = 4e-15;  // rows of loops that count as closed, over the size of the loop
constexpr int kClosing = 20;       // iterations of Newton's method
constexpr int kMoves = 16;         // in which a random start is gone to

[[noreturn]] void refuse_task(Code code, std::string what, std::string expected, std::string got) {
  cardan::refuse(code, {"inverse kinematics: " + std::move(what)}, std::move(expected), std::move(got));
}

/// log of a rotation, also near a half turn.
Vector3d rotation_vector(const Eigen::Matrix3d& R) {
  const Vector3d s{0.5 * (R(2, 1) - R(1, 2)), 0.5 * (R(0, 2) - R(2, 0)), 0.5 * (R(1, 0) - R(0, 1))};
  const double sine = s.norm(), cosine = 0.5 * (R.trace() - 1.0), angle = std::atan2(sine, cosine);
  if (sine > 1e-3) return angle / sine * s;
  if (cosine > 0.0) return (1.0 + sine * sine / 6.0 + 3.0 / 40.0 * std::pow(sine, 4)) * s;
  Eigen::Index j = 0;  // near pi: R + R* = 2 cos + 2 (1 - cos) u u*
  const Eigen::Matrix3d uu = (0.5 * (R + R.transpose()) - cosine * Eigen::Matrix3d::Identity()) / (1.0 - cosine);
  uu.diagonal().maxCoeff(&j);
  Vector3d u = uu.col(j).normalized();
  if (u.dot(s) < 0.0) u = -u;
  return angle * u;
}
Eigen::Matrix3d tilde(const Vector3d& a) { return (Eigen::Matrix3d() << 0, -a[2], a[1], a[2], 0, -a[0], -a[1], a[0], 0).finished(); }
/// Inverse of the left Jacobian: log(exp(-d) exp(e)) = e - Jl^-1(e) d + ...
Eigen::Matrix3d left_jacobian_inverse(const Vector3d& e) {
  const double t = e.norm(), half = 0.5 * t;
  const double c = t < 1e-2 ? 1.0 / 12.0 + t * t / 720.0 : (1.0 - half / std::tan(half)) / (t * t);
  return Eigen::Matrix3d::Identity() - 0.5 * tilde(e) + c * tilde(e) * tilde(e);
}

/// splitmix64 (Steele, Lea, Flood 2014), uniform in [-1, 1).
struct Random {
  std::uint64_t state;
  double operator()() {
    std::uint64_t z = (state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-52 - 1.0;
  }
};

class Solver {
 public:
  /// part: null, all may move.
  Solver(const std::shared_ptr<const Model>& model, const TreeOperators* part, std::span<const IkTarget> targets, const IkOptions& options)
      : closed_(model),
        open_(open_tree(model)),
        m_(*open_),
        targets_(targets),
        options_(options),
        tree_(open_),
        ws_(m_),
        zeros_(m_.nv, 0.0),
        coordinate_(m_.nv, -1),
        movable_(m_.nv, 0),
        turns_(m_.nv, 0) {
    ws_.require_world();
    if (!closed_->loops.empty()) loops_.emplace(*closed_);
    for (const PlainRates& r : m_.plain_rates)
      for (int i = 0; i < r.n; ++i) coordinate_[r.v + i] = r.q + i;
    for (const UserBody& u : m_.user)
      for (int j = 0; j < u.nv; ++j) {
        movable_[u.v + j] = options.free.empty() && may_move(part, u.v + j);
        turns_[u.v + j] = u.v_units[j] == "rad/s";
      }
    for (const int v : options.free) {
      if (v < 0 || v >= m_.nv) refuse_task(Code::out_of_range, "free", fmt::format("components 0 to {}", m_.nv - 1), fmt::format("{}", v));
      if (!may_move(part, v)) refuse_task(Code::unsupported, "free", "components of bodies that take part, free in the tree", name_of(v));
      movable_[v] = 1;
    }
    std::vector<int> nodes;
    for (const IkTarget& t : targets) nodes.push_back(t.node);
    (part ? *part : tree_).require_nodes(nodes);
    if (part && !part->whole()) {
      bodies_ = part->sweep_bodies();
      place_bodies(part->q());
      for (int k = 0; k < static_cast<int>(m_.bodies.size()); ++k)
        held_.push_back(part->index_of(k) < 0 ? std::optional(ws_.pose_W(k)) : std::nullopt);
    }
    for (const IkTarget& t : targets) {
      for (int i = 0; i < 6; ++i)
        if (t.rows[i]) ++rows_;
      const std::string on = "target on " + m_.nodes[t.node].name;
      if (!t.position.allFinite()) refuse_task(Code::out_of_range, on, "a position of finite numbers", "one that is not");
      for (const double weight : {t.rotation_weight, t.position_weight})
        if (!(weight >= 0.0 && std::isfinite(weight)))
          refuse_task(Code::out_of_range, on, "finite weights >= 0", fmt::format("{:g}", weight));
      scale_ = std::max(scale_, t.position_weight * t.position.norm());
      const bool rotation = (t.R_WN.transpose() * t.R_WN - Eigen::Matrix3d::Identity()).norm() < 1e-6 && t.R_WN.determinant() > 0.0;
      if (!rotation) refuse_task(Code::not_a_rotation, on, "a rotation matrix", "another matrix");
    }
    lower_.setConstant(m_.nv, -std::numeric_limits<double>::infinity());
    upper_ = -lower_;
    for (const IkLimit& l : options.limits) {
      if (l.v < 0 || l.v >= m_.nv || coordinate_[l.v] < 0)
        refuse_task(Code::unsupported, "limits", "a component with a coordinate of its own", fmt::format("velocity component {}", l.v));
      if (!may_move(part, l.v))
        refuse_task(Code::unsupported, "limits", "components of bodies that take part, free in the tree", name_of(l.v));
      if (!(l.lower <= l.upper))
        refuse_task(Code::out_of_range, "limits", "lower <= upper", fmt::format("{:g} ... {:g}", l.lower, l.upper));
      lower_[l.v] = std::max(lower_[l.v], l.lower), upper_[l.v] = std::min(upper_[l.v], l.upper);
      if (!(lower_[l.v] <= upper_[l.v]))
        refuse_task(Code::out_of_range, "limits", "limits that leave room", fmt::format("{:g} ... {:g}", lower_[l.v], upper_[l.v]));
    }
    const auto expect_size = [](const char* what, const VectorXd& x, int n) {
      if (x.size() != 0 && x.size() != n)
        refuse_task(Code::operator_shape, what, fmt::format("{} numbers", n), fmt::format("{}", x.size()));
    };
    expect_size("weight", options.weight, m_.nv);
    expect_size("prefer", options.prefer, m_.nq);
    if (!options.prefer.allFinite()) refuse_task(Code::out_of_range, "prefer", "finite numbers", "a value that is not finite");
    inverse_weight_ = VectorXd::Ones(m_.nv);
    if (options.weight.size() > 0) {
      if (!options.weight.allFinite() || !(options.weight.minCoeff() > 0.0))
        refuse_task(Code::out_of_range, "weight", "positive numbers", fmt::format("{:g}", options.weight.minCoeff()));
      inverse_weight_ = options.weight.cwiseInverse();
    }
  }

  IkResult run(const double* start) {
    const Eigen::Map<const VectorXd> given(start, m_.nq);
    if (!given.allFinite()) refuse_task(Code::out_of_range, "the start", "finite numbers", "a value that is not finite");
    VectorXd first = clamped(given);
    if (!close(first))
      refuse_task(Code::open_start, "the start", "a posture near one that closes the loops by what may move, within the limits",
                  fmt::format("loops that stay open by {:.3g} of their size", open_by_));
    IkResult best;
    best.seed = options_.seed;
    best.residual = std::numeric_limits<double>::infinity();
    Random random{options_.seed};
    double room = 1.0;  // [m] how far a sliding start may be
    const MatrixXd there = errors(first);
    room = std::max(room, there.bottomRows(3).size() > 0 ? there.bottomRows(3).colwise().norm().maxCoeff() : 0.0);
    int spent = 0, starts = 0;
    for (; starts < std::max(1, options_.starts) && !best.reached; ++starts) {
      VectorXd q = first;
      if (starts > 0) {
        VectorXd d = VectorXd::Zero(m_.nv);
        for (int v = 0; v < m_.nv; ++v) {
          if (!movable_[v]) continue;
          const double r = random();
          const bool within = std::isfinite(lower_[v]) && std::isfinite(upper_[v]);
          d[v] = within ? 0.5 * (lower_[v] + upper_[v] + r * (upper_[v] - lower_[v])) - first[coordinate_[v]]
                        : r * (turns_[v] ? std::numbers::pi : room);
        }
        q = loops_ ? moved_along_loops(first, d) : clamped(moved(first, d));
      }
      IkResult found = descend(std::move(q), options_.iterations);
      spent += found.iterations;
      if (starts == 0 || found.residual < best.residual) best = std::move(found);  // the first also where its residual overflows
    }
    if (best.reached && options_.prefer.size() > 0) spent += approach_preferred(best);
    best.iterations = spent, best.starts = starts, best.seed = options_.seed;
    report(best);
    return best;
  }

 private:
  std::shared_ptr<const Model> closed_, open_;  // the same where there are no loops
  const Model& m_;
  std::span<const IkTarget> targets_;
  const IkOptions& options_;
  TreeOperators tree_;
  std::vector<int> bodies_;                        // that take part; empty: all
  std::optional<TreeOperators> part_;              // theirs, at the q of the last jacobian_star()
  std::vector<std::optional<Pose<double>>> held_;  // by sweep index: where those stand that take no part; empty: none
  Workspace ws_;
  std::optional<Workspace> loops_;
  double open_by_ = 0.0;  // of the last close()
  std::vector<double> zeros_;
  std::vector<int> coordinate_;  // per velocity component: the coordinate with q' = v, or -1
  std::vector<std::uint8_t> movable_, turns_;
  VectorXd lower_, upper_, inverse_weight_;
  int rows_ = 0;
  double scale_ = 1.0;
  std::vector<NodeMotion<double>> nodes_;  // of the last errors()

  static bool may_move(const TreeOperators* part, int v) {
    if (!part) return true;
    const int place = part->place_of_velocity(v);
    return place >= 0 && part->is_free(place);
  }
  std::string name_of(int v) const { return tree_.labels(Space::hinge, Sort::motion).names[tree_.place_of_velocity(v)]; }
  VectorXd moved(const VectorXd& q, const VectorXd& d) const {
    VectorXd out(m_.nq);
    m_.retract(q.data(), d.data(), out.data());
    return out;
  }
  VectorXd clamped(VectorXd q) const {
    m_.normalise(q.data());
    for (const IkLimit& l : options_.limits) {
      double& x = q[coordinate_[l.v]];
      x = std::clamp(x, lower_[l.v], upper_[l.v]);
    }
    return q;
  }

  /// Poses in the world.
  void place_bodies(std::span<const double> q) {
    const soa::Sweeps<double>& S = soa::sweeps<double>();
    const Inputs in{.q = q.data(), .v = zeros_.data(), .gravity = false};
    outward(m_, S, ws_, in, {.velocity = false});
    S.world(m_, ws_, in);
    for (int k = 0; k < static_cast<int>(held_.size()); ++k)
      ws_.pose_W(k) = held_[k] ? *held_[k] : ws_.pose_W(m_.bodies[k].parent) * pose_in_inboard(m_, ws_, k, in.q);
  }

  /// 6 x targets, [rotation; position] in target axes.
  MatrixXd errors(const VectorXd& q) {
    place_bodies(std::span(q.data(), m_.nq));
    const Inputs in{.q = q.data(), .v = zeros_.data(), .gravity = false};
    MatrixXd out(6, targets_.size());
    nodes_.clear();
    for (std::size_t i = 0; i < targets_.size(); ++i) {
      const IkTarget& t = targets_[i];
      nodes_.push_back(node_motion<double>(m_, ws_, in, t.node, nullptr));
      const Eigen::Matrix3d R = to_eigen(nodes_.back().R_WN);
      out.col(static_cast<Eigen::Index>(i)) << rotation_vector(R.transpose() * t.R_WN),
          t.R_WN.transpose() * (t.position - to_eigen(nodes_.back().position));
    }
    return out;
  }
  /// The rows that count, weighted.
  VectorXd counted(const MatrixXd& errors) const {
    VectorXd out(rows_);
    int r = 0;
    for (std::size_t i = 0; i < targets_.size(); ++i)
      for (int k = 0; k < 6; ++k)
        if (targets_[i].rows[k])
          out[r++] = (k < 3 ? targets_[i].rotation_weight : targets_[i].position_weight) * errors(k, static_cast<Eigen::Index>(i));
    return out;
  }
  bool is_reached(double residual) const { return std::isfinite(residual) && residual <= options_.tolerance * scale_; }

  /// A*: nv x rows, e(q + d) = e - A d; by H phi B, O(N) per row. At the q of the last errors().
  MatrixXd jacobian_star(const VectorXd& q, const MatrixXd& errors) {
    part_.reset();
    tree_.at(q.data());
    if (!bodies_.empty()) part_.emplace(tree_.subgraph(bodies_));
    const TreeOperators& by = part_ ? *part_ : tree_;
    MatrixXd out(m_.nv, rows_);
    VectorXd f(by.size(Space::body)), gathered(f.size()), tau(by.size(Space::hinge));
    int r = 0;
    for (std::size_t i = 0; i < targets_.size(); ++i) {
      const IkTarget& t = targets_[i];
      const Eigen::Matrix3d turn = left_jacobian_inverse(errors.col(static_cast<Eigen::Index>(i)).head<3>()),
                            shift = t.R_WN.transpose() * to_eigen(nodes_[i].R_WN);
      for (int k = 0; k < 6; ++k) {
        if (!t.rows[k]) continue;
        Vector6 wrench = Vector6::Zero();
        if (k < 3)
          wrench.head<3>() = t.rotation_weight * turn.row(k).transpose();
        else
          wrench.tail<3>() = t.position_weight * shift.row(k - 3).transpose();
        const int node = t.node;
        by.apply_nodes({&node, 1}, false, wrench.data(), f.data());
        by.apply(Kind::phi, false, f.data(), gathered.data());
        by.apply(Kind::H, false, gathered.data(), tau.data());
        for (int v = 0; v < m_.nv; ++v) out(v, r) = movable_[v] ? tau[by.place_of_velocity(v)] : 0.0;
        ++r;
      }
    }
    return out;
  }

  LoopRows rows_of_loops(const VectorXd& q) { return loop_rows(*closed_, *loops_, q.data(), options_.drives); }

  /// Components that move by step(free), which says how if these do, and is asked last for those: without such at a limit that cross it.
  template <class Step>
  std::vector<std::uint8_t> free_to_follow(const VectorXd& q, const Step& step) const {
    std::vector<std::uint8_t> out = movable_;
    for (bool more = true; more;) {
      more = false;
      const VectorXd wish = step(out);
      for (const IkLimit& l : options_.limits) {
        const double x = q[coordinate_[l.v]];
        if (!out[l.v] || !((x <= lower_[l.v] && wish[l.v] < 0.0) || (x >= upper_[l.v] && wish[l.v] > 0.0))) continue;
        out[l.v] = 0, more = true;  // on closed loops others follow it
      }
    }
    return out;
  }
  static MatrixXd masked(MatrixXd x, const std::vector<std::uint8_t>& free) {
    for (Eigen::Index v = 0; v < x.rows(); ++v)
      if (!free[static_cast<std::size_t>(v)]) x.row(v).setZero();
    return x;
  }
  /// Orthonormal columns: what loops keep of these components, nv x rank.
  MatrixXd held_by_loops(const MatrixXd& G, const std::vector<std::uint8_t>& free) const {
    if (!loops_) return MatrixXd(m_.nv, 0);
    const RightSingular s = right_singular(masked(G.transpose(), free).transpose());
    return s.vectors.leftCols((s.values.array() > closed_->loops.dependent).count());
  }
  /// W^-1 A* with the rows of held components zero (H empty there).
  MatrixXd weighted(const MatrixXd& A_star, const std::vector<std::uint8_t>& free, bool dynamic) {
    MatrixXd out = masked(A_star, free);
    if (!dynamic) return inverse_weight_.asDiagonal() * out;
    TreeOperators& by = part_ ? *part_ : tree_;
    const int n = by.size(Space::hinge);
    std::vector<std::uint8_t> mask(n);
    VectorXd solved(n);
    for (int v = 0; v < m_.nv; ++v)
      if (const int place = by.place_of_velocity(v); place >= 0) mask[place] = free[v];
    by.articulate({.W = nullptr, .free = mask});
    for (Eigen::Index r = 0; r < out.cols(); ++r) {
      apply(letters::mass_inverse, by, by.from_model(out.col(r)).data(), solved.data());  // 0 where not free
      out.col(r) = by.to_model(solved);
    }
    return out;
  }
  /// The same without what loops hold, N of held_by_loops(): (W^-1 - W^-1 N (N* W^-1 N)^-1 N* W^-1) A*.
  MatrixXd weighted_along_loops(const MatrixXd& A_star, const MatrixXd& N, const std::vector<std::uint8_t>& free, bool dynamic) {
    MatrixXd out = weighted(A_star, free, dynamic);
    if (N.cols() == 0) return out;
    const MatrixXd of_loops = weighted(N, free, dynamic);
    return out - of_loops * symmetric_solve(MatrixXd(N.transpose() * of_loops), MatrixXd(N.transpose() * out));
  }
  MatrixXd along_loops(const MatrixXd& x, const MatrixXd& N, const std::vector<std::uint8_t>& free) {
    return weighted_along_loops(inverse_weight_.cwiseInverse().asDiagonal() * x, N, free, false);
  }

  /// Newton's method on the loops, by the least motion of what may move: the branch it is on, if q is near it. False: they stay open.
  bool close(VectorXd& q) {
    if (!loops_) return true;
    double before = std::numeric_limits<double>::infinity();
    for (int i = 0;; ++i) {
      const LoopRows rows = rows_of_loops(q);
      open_by_ = rows.c.cwiseAbs().maxCoeff();
      if (!std::isfinite(open_by_)) return false;
      VectorXd step;
      const auto find_step = [&] {
        free_to_follow(q, [&](const std::vector<std::uint8_t>& free) {
          const MatrixXd Z = weighted(held_by_loops(rows.G, free), free, false);
          return step = Z.cols() > 0 ? VectorXd(-Z * least_squares(rows.G * Z, rows.c)) : VectorXd(VectorXd::Zero(m_.nv));
        });
      };
      double open = open_by_;
      if (closed_->loops.left_open && open_by_ <= kTyped) find_step(), open = (rows.G * step).cwiseAbs().maxCoeff();  // can be closed
      if (open <= kClosed || (open > 0.5 * before && before < 1e-11)) return true;
      if (i == kClosing || (i > 2 && open > before)) return false;
      if (step.size() == 0) find_step();
      q = clamped(moved(q, step));
      before = open;
    }
  }
  /// q moved by d and onto the loops again; false where that is farther away than d, another branch perhaps.
  bool moved_to(const VectorXd& q, const VectorXd& d, VectorXd& out) {
    const VectorXd there = out = clamped(moved(q, d));
    if (!loops_) return true;
    if (!close(out)) return false;
    VectorXd back(m_.nv);
    m_.difference(there.data(), out.data(), back.data());
    return back.norm() <= 0.5 * d.norm();
  }
  VectorXd moved_along_loops(VectorXd q, const VectorXd& d) {
    for (int i = 0; i < kMoves; ++i) {
      const MatrixXd G = rows_of_loops(q).G;
      const VectorXd share = d / kMoves;
      VectorXd step, next;
      free_to_follow(q, [&](const auto& free) { return step = along_loops(share, held_by_loops(G, free), free); });
      if (!moved_to(q, step, next)) break;
      q = next;
    }
    return q;
  }

  /// Levenberg and Marquardt from q, lambda ~ |e|^2, on the components that limits leave free.
  IkResult descend(VectorXd q, int iterations) {
    IkResult out;
    if (!close(q)) {
      out.residual = std::numeric_limits<double>::infinity();
      return out;
    }
    MatrixXd error = errors(q);
    VectorXd e = counted(error);
    double mu = 1e-2;
    int idle = 0;
    for (out.iterations = 0; out.iterations < iterations && !is_reached(e.norm()); ++out.iterations) {
      Poll::now();
      const MatrixXd A_star = jacobian_star(q, error);
      const VectorXd gradient = A_star * e;
      const MatrixXd G = loops_ ? rows_of_loops(q).G : MatrixXd();
      MatrixXd N;
      VectorXd wish;
      const std::vector<std::uint8_t> free = free_to_follow(q, [&](const auto& may) {
        N = held_by_loops(G, may);
        return wish = masked(gradient, may) - N * (N.transpose() * gradient);
      });
      const MatrixXd Z = weighted_along_loops(A_star, N, free, options_.dynamic);
      const double pull = wish.squaredNorm(), size = masked(A_star, free).squaredNorm();
      if (!(std::sqrt(pull) > kStationary * std::sqrt(size) * e.norm())) {
        out.stationary = true;
        break;
      }
      const MatrixXd kernel = A_star.transpose() * Z;
      const double scale = kernel.trace() / rows_, cost = e.squaredNorm();
      bool accepted = false;
      while (!accepted && mu < 1e12) {
        MatrixXd damped = kernel;
        damped.diagonal().array() += scale * std::max(mu * cost / (1.0 + cost), 1e-15);
        VectorXd d = Z * symmetric_solve(damped, e);
        double turn = 0.0;
        for (int v = 0; v < m_.nv; ++v)
          if (turns_[v]) turn = std::max(turn, std::abs(d[v]));
        if (turn > options_.step) d *= options_.step / turn;
        VectorXd trial;
        if (!moved_to(q, d, trial)) {
          mu *= 8.0;
          continue;
        }
        const MatrixXd error_there = errors(trial);
        const VectorXd there = counted(error_there);
        accepted = there.squaredNorm() < cost;
        if (!accepted) {
          mu *= 8.0;
          continue;
        }
        idle = cost - there.squaredNorm() < 1e-13 * cost ? idle + 1 : 0;
        q = trial, error = error_there, e = there;
        mu = std::max(0.25 * mu, 1e-8);
      }
      if (!accepted || idle > 5) {  // nothing but round-off is left
        error = errors(q);
        out.stationary = true;
        ++out.iterations;
        break;
      }
    }
    out.residual = e.norm();
    out.reached = is_reached(out.residual);
    if (out.reached) out.stationary = false;
    out.error = error;
    for (std::size_t i = 0; i < targets_.size(); ++i)
      for (int k = 0; k < 6; ++k)
        if (!targets_[i].rows[k]) out.error(k, static_cast<Eigen::Index>(i)) = 0.0;
    out.q = std::move(q);
    return out;
  }

  /// Moves within the solutions towards the preferred posture: d - J^+ J d with d the way there, back onto the targets after each
  /// step; halved where that does not come nearer. Returns the iterations spent.
  int approach_preferred(IkResult& best) {
    int spent = 0;
    const auto way = [&](const VectorXd& q) {
      VectorXd d(m_.nv);
      m_.difference(q.data(), options_.prefer.data(), d.data());
      for (int v = 0; v < m_.nv; ++v)
        if (!movable_[v]) d[v] = 0.0;
      return d;
    };
    const auto length = [&](const VectorXd& d) { return std::sqrt(d.cwiseAbs2().cwiseQuotient(inverse_weight_).sum()); };
    double share = 1.0;
    for (int i = 0; i < kSecondaryIterations; ++i) {
      Poll::now();
      const VectorXd d = way(best.q);
      const MatrixXd A_star = jacobian_star(best.q, errors(best.q));
      const MatrixXd G = loops_ ? rows_of_loops(best.q).G : MatrixXd();
      MatrixXd N;
      VectorXd wish;
      const std::vector<std::uint8_t> free = free_to_follow(best.q, [&](const auto& may) {
        N = held_by_loops(G, may);
        return wish = along_loops(d, N, may);
      });
      const MatrixXd Z = weighted_along_loops(A_star, N, free, false);
      const MatrixXd kernel = A_star.transpose() * Z;
      const VectorXd step = wish - Z * least_squares(kernel, A_star.transpose() * wish);
      best.null_space_step = length(step);
      if (best.null_space_step < kNullSpaceStep) break;
      bool nearer = false;
      for (; share > 1e-4 && !nearer; share *= 0.5) {
        double turn = 0.0;
        for (int v = 0; v < m_.nv; ++v)
          if (turns_[v]) turn = std::max(turn, std::abs(step[v]));
        IkResult next = descend(clamped(moved(best.q, std::min(share, options_.step / std::max(turn, 1e-300)) * step)), 20);
        spent += next.iterations + 1;
        nearer = next.reached && length(way(next.q)) < length(d);
        if (!nearer) continue;
        next.null_space_step = best.null_space_step;
        best = std::move(next);
        break;
      }
      if (!nearer) break;
      share = std::min(1.0, 2.0 * share);
    }
    return spent;
  }

  void report(IkResult& r) const {
    std::string limits;
    for (const IkLimit& l : options_.limits) {
      const double x = r.q[coordinate_[l.v]];
      if ((x > lower_[l.v] && x < upper_[l.v]) || std::find(r.at_limit.begin(), r.at_limit.end(), l.v) != r.at_limit.end()) continue;
      r.at_limit.push_back(l.v);
      for (const UserBody& u : m_.user)
        if (l.v >= u.v && l.v < u.v + u.nv)
          limits += fmt::format("{}{}.{} = {:.6g}", limits.empty() ? "; at limits: " : ", ", u.name, u.v_names[l.v - u.v], x);
    }
    if (r.reached) {
      r.message = fmt::format("reached in {} iterations, {} start{}: residual {:.2g}{}", r.iterations, r.starts, r.starts == 1 ? "" : "s",
                              r.residual, limits);
      return;
    }
    std::string nearest;
    for (std::size_t i = 0; i < targets_.size(); ++i) {
      const Vector6 e = r.error.col(static_cast<Eigen::Index>(i));
      nearest += fmt::format("{}{} off by {:.3g} rad, {:.3g} m", i == 0 ? "" : "; ", m_.nodes[targets_[i].node].name, e.head<3>().norm(),
                             e.tail<3>().norm());
    }
    r.message = fmt::format("{} from {} start{} (seed {}, {} iterations): residual {:.3g}, nearest: {}{}",
                            r.stationary ? "cannot be reached" : "not reached, iterations used up,", r.starts, r.starts == 1 ? "" : "s",
                            r.seed, r.iterations, r.residual, nearest, limits);
  }
};

}  // namespace

IkTarget IkTarget::at_position(int node, const Vector3d& x) {
  IkTarget t;
  t.node = node, t.position = x, t.rows = {false, false, false, true, true, true};
  return t;
}
IkTarget IkTarget::at_attitude(int node, const Eigen::Matrix3d& R_WN) {
  IkTarget t;
  t.node = node, t.R_WN = R_WN, t.rows = {true, true, true, false, false, false};
  return t;
}
IkTarget IkTarget::at_pose(int node, const Vector3d& x, const Eigen::Matrix3d& R_WN) {
  IkTarget t;
  t.node = node, t.position = x, t.R_WN = R_WN;
  return t;
}

IkResult inverse_kinematics(const std::shared_ptr<const Model>& model, const double* q, std::span<const IkTarget> targets,
                            const IkOptions& options) {
  return Solver(model, nullptr, targets, options).run(q);
}
IkResult inverse_kinematics(const TreeOperators& tree, std::span<const IkTarget> targets, const IkOptions& options) {
  tree.require(Kind::H);
  return Solver(tree.model_pointer(), &tree, targets, options).run(tree.q().data());
}

}  // namespace cardan::operators
