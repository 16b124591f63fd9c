// The assembler: a start whose loops are open becomes the nearest one that closes them (docs/mathematics/loops.md, 3).
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "core/dynamics/loop_pass.hpp"
#include "core/linalg/dense.hpp"
#include "core/model/components.hpp"

namespace cardan {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kSteps = 400;
constexpr double kReach = 0.1;      // [rad], of slides in levers: the longest step
constexpr double kStraight = 1e-9;  // a step that changes gradients by less may be followed by one twice as long
constexpr double kSingular = 0.2;   // a step that leaves less of the determinant of the pivots is too long
constexpr double kShortest = 1e-7;  // a step of such a part of what it should be leads nowhere
constexpr double kPart = 0.1;       // of what the gradients promise of a step, at least
constexpr double kMet = 1e-13;      // residual, relative to the size of a loop, at which Newton's method ends
constexpr double kAlmost = 1e-8;    // ... that it may leave where rows imply each other on closed loops alone: it then halves what is left
constexpr double kNoPivot = 1e-10;  // a scaled pivot below is none
constexpr double kDoubt = 1e-10;    // relative to |A|: what rounding in A may amount to
constexpr double kWeak = 0.03;      // pivots below may be of rows that imply each other on closed loops, and are so where they end below
constexpr double kVanished = 1e-6;  // (kTyped, where digits of what was typed may be behind it)
constexpr double kNearest = 1e-7;   // part of the way back, or of the residual, that may be left to go

/// The description's word for a velocity component, and for its coordinate.
struct ComponentName {
  std::string rate, coordinate, rate_unit, coordinate_unit;
};
ComponentName name_of_component(const Model& model, int v) {
  for (const UserBody& u : model.user) {
    if (v < u.v || v >= u.v + u.nv) continue;
    const int j = v - u.v;
    const std::string unit = u.v_units[static_cast<std::size_t>(j)];
    return {u.name + "." + u.v_names[static_cast<std::size_t>(j)], u.name + "." + deviation_name(u, j), unit,
            unit.ends_with("/s") ? unit.substr(0, unit.size() - 2) : unit};
  }
  return {};
}

/// The y of least |A y - b|^2 + (damping |A|)^2 |y|^2, |A| its largest entry.
VectorXd damped(const MatrixXd& A, const VectorXd& b, double damping) {
  if (A.size() == 0) return VectorXd::Zero(A.cols());
  MatrixXd both(A.rows() + A.cols(), A.cols());
  both << A, damping * A.cwiseAbs().maxCoeff() * MatrixXd::Identity(A.cols(), A.cols());
  VectorXd right = VectorXd::Zero(both.rows());
  right.head(b.size()) = b;
  return least_squares(both, right);
}

/// Where a closed form of the loops is looked for, at one q.
struct Here {
  VectorXd r;  // residuals, each relative to the size of its loop
  MatrixXd A;  // their gradients along the components that move, in the roots of their (weighted) inertia: rows x free
  double open() const { return r.size() == 0 ? 0.0 : r.cwiseAbs().maxCoeff<Eigen::PropagateNaN>(); }
  /// Rows that imply each other on closed loops alone differ here by about as much as these are open, and no more is to be made of it:
  /// where there may be such, damped by the residual, Newton's method converges as fast as where all rows count (Yamashita and Fukushima
  /// 2001; Fan and Yuan 2005).
  double doubt() const { return std::clamp(open(), kDoubt, most_doubt); }
  VectorXd solve(const VectorXd& b) const {
    if (!typed) return damped(A, b, doubt());
    VectorXd y = VectorXd::Zero(A.cols());
    if (A.size() == 0) return y;
    const RightSingular s = right_singular(A);
    const VectorXd along = s.vectors.transpose() * (A.transpose() * b);
    const double d = doubt() * s.values[0];
    for (Eigen::Index i = 0; i < s.values.size() && s.values[i] > kTyped * full; ++i)
      y += along[i] / (s.values[i] * s.values[i] + d * d) * s.vectors.col(i);
    return y;
  }
  double most_doubt = kDoubt;
  bool typed = false;  // what is weaker than digits of what was typed holds nothing
  double full = 0.0;   // what a row may be, where it is no such
};

std::vector<std::uint8_t> held_components(const Model& m, bool rates, bool all) {
  std::vector<std::uint8_t> held(static_cast<std::size_t>(m.nv), 1);  // modes stay
  for (std::size_t i = 0; i < m.user.size(); ++i) {
    const UserBody& u = m.user[i];
    const HingeSpec& hinge = m.spec->bodies[i].hinge;
    const bool given = !all && !m.spec->assembly.hold && !(rates ? hinge.v : hinge.q).empty();
    for (int v = u.v; v < u.v + u.nv; ++v)
      held[static_cast<std::size_t>(v)] = given || (m.has_prescribed() && m.prescribed[static_cast<std::size_t>(v)] != 0);
  }
  if (m.spec->assembly.hold)
    for (const std::string& name : *m.spec->assembly.hold)
      for (const int v : components_of(m, name)) held[static_cast<std::size_t>(v)] = 1;
  return held;
}

/// Loops in sets that have no component in common that may move: each closes by itself, or not.
std::vector<std::vector<std::size_t>> sets_of_loops(const Model& model, bool all) {
  const std::vector<std::uint8_t> held = held_components(model, false, all);
  std::vector<std::size_t> set(model.loops.all.size());
  std::vector<int> first(static_cast<std::size_t>(model.nv), -1);  // loop that has the component
  for (std::size_t l = 0; l < set.size(); ++l) {
    set[l] = l;
    for (const int v : model.loops.all[l].rates) {
      if (held[static_cast<std::size_t>(v)] != 0) continue;
      int& other = first[static_cast<std::size_t>(v)];
      if (other < 0) {
        other = static_cast<int>(l);
        continue;
      }
      const auto [to, from] = std::minmax(set[l], set[static_cast<std::size_t>(other)]);
      std::ranges::replace(set, std::size_t{from}, std::size_t{to});
    }
  }
  std::vector<std::vector<std::size_t>> out;
  for (std::size_t s = 0; s < set.size(); ++s) {
    std::vector<std::size_t> loops;
    for (std::size_t l = 0; l < set.size(); ++l)
      if (set[l] == s) loops.push_back(l);
    if (!loops.empty()) out.push_back(std::move(loops));
  }
  return out;
}

class Assembler {
 public:
  /// Of some of the loops; the others stay as they are.
  Assembler(Model& model, Workspace& ws, VectorXd q, const MatrixXd& M, std::vector<std::size_t> loops, bool given_moves)
      : m_(model), ws_(ws), q0_(std::move(q)), loops_(std::move(loops)) {
    const std::vector<std::uint8_t> held = held_components(model, false, given_moves);
    std::vector<std::uint8_t> on_the_way(static_cast<std::size_t>(m_.nv), 0);
    for (const std::size_t l : loops_) {
      const Loop& loop = m_.loops.all[l];
      for (const int v : loop.rates) on_the_way[static_cast<std::size_t>(v)] = 1;
      for (int i = loop.first; i < loop.first + loop.rows; ++i) rows_.push_back(i);
    }
    for (int v = 0; v < m_.nv; ++v)
      if (on_the_way[static_cast<std::size_t>(v)] != 0 && held[static_cast<std::size_t>(v)] == 0) free_.push_back(v);
    root_ = root_of(free_, M);
    for (const std::size_t l : loops_) {
      const Loop& loop = m_.loops.all[l];
      reach_ = std::max(reach_, kReach * loop.lever), full_ = std::max(full_, loop.reference / loop.lever);
    }
    turns_ = turning(m_);
  }

  const std::vector<int>& free() const { return free_; }

  /// Newton's method in steps so short that the way there is that of the differential equation q' = -G^+ c, which cannot pass a singular
  /// posture. False: it ends before; q is as near as it got.
  bool newton(VectorXd& q) {
    ws_.loops->near_W.clear();
    Here here = look(q);
    settle();
    stretch_ = 1.0;
    for (int i = 0; i < kSteps && here.open() > kMet; ++i) {
      const VectorXd y = here.solve(-here.r), change = here.A * y;
      if (!(change.norm() > kNearest * here.r.norm())) break;  // as near as rows that contradict each other let it
      const double open = here.r.norm();
      const auto better = [&](const Here& there, double s) {
        return there.r.norm() <= open + kPart * ((here.r + s * change).norm() - open);
      };
      const MatrixXd before = here.A;
      if (!step_along(q, here, in_velocities(y), better)) break;
      stretch_ = (here.A - before).cwiseAbs().maxCoeff() <= kStraight * before.cwiseAbs().maxCoeff() ? 2.0 * stretch_ : 1.0;
    }
    stretch_ = 1.0;
    return here.open() <= (typed_ ? kTyped : kAlmost);
  }

  /// newton(); where it ends before, once more with rows in doubt that are weak: whether they imply each other is seen where it ends. There
  /// each of them must have vanished, else it is a row as the others, and a singular posture may have been passed. Where rows are left that
  /// are as weak as digits of what was typed, or neither way leads to an end, once more without these; the others must imply them.
  bool close(VectorXd& q) {
    const VectorXd from = q;
    const std::vector<std::vector<double>> given = coordinates();
    const auto again = [&](bool typed, const auto& counts) {
      VectorXd x = from;
      const auto before = std::tuple(coordinates(), in_doubt_, typed_);
      take_coordinates(given);
      in_doubt_ = true, typed_ = typed;
      if (newton(x) && !has_weak_rows(look(x).A, typed ? kTyped : kVanished, kWeak) && counts(x)) {
        q = x;
        return true;
      }
      take_coordinates(std::get<0>(before));
      std::tie(std::ignore, in_doubt_, typed_) = before;
      return false;
    };
    const auto always = [](const VectorXd&) { return true; };
    const auto implied = [&](const VectorXd& x) { return loops_.size() < m_.loops.all.size() || implied_by_others(m_, x); };
    if (typed_) return again(true, always);
    const bool closed = (!in_doubt_ && newton(q)) || again(false, always);
    if (closed && !has_weak_rows(look(q).A, kDoubt, kTyped)) return true;
    return again(true, implied) || closed;
  }

  /// Along the closed loops to where what is left of the way back to the start is across them.
  void approach(VectorXd& q) {
    for (int i = 0; i < kSteps; ++i) {
      const Here here = look(q);
      const VectorXd back = way_back(q), along = back - here.solve(here.A * back);
      if (!(along.norm() > kNearest * back.norm())) return;
      const VectorXd step = in_velocities(along);
      VectorXd best;
      for (double s = std::min(1.0, longest(step)); s > 1e-3; s *= 0.5) {
        VectorXd next = moved(q, s * step);
        if (!same_branch(here, look(next)) || !close(next)) continue;
        if (way_back(next).norm() < (1.0 - 1e-9) * back.norm()) {
          best = next;
          break;
        }
      }
      if (best.size() == 0) return;
      q = best;
    }
  }

  /// Rates nearest to v that keep the loops closed at q.
  void move_along(const VectorXd& q, const MatrixXd& M, VectorXd& v) {
    const std::vector<std::uint8_t> held = held_components(m_, true, false);
    std::vector<int> free;
    for (const Loop& loop : m_.loops.all)
      for (const int i : loop.rates)
        if (held[static_cast<std::size_t>(i)] == 0 && std::ranges::find(free, i) == free.end()) free.push_back(i);
    if (free.empty()) return;
    std::ranges::sort(free);
    const MatrixXd root = root_of(free, M);
    Here here = look(q);
    const auto scale = rows();
    MatrixXd G = scale * Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(ws_.loops->G.data(),
                                                                                                                  m_.loops.rows, m_.nv);
    VectorXd open = G * v;
    for (const Loop& loop : m_.loops.all) {
      if (loop.drive < 0) continue;
      if (const auto& rate = m_.spec->loops[static_cast<std::size_t>(loop.spec)].rate)
        open[loop.first] -= scale.diagonal()[loop.first] * *rate;
      else
        open[loop.first] = 0.0, G.row(loop.first).setZero();
    }
    here.A = root.triangularView<Eigen::Lower>().solve(G(Eigen::all, free).transpose()).transpose();
    here.most_doubt = kDoubt;
    here.typed = typed_ || (has_weak_rows(here.A, kDoubt, kTyped) && implied_by_others(m_, q));
    const VectorXd d = root.transpose().triangularView<Eigen::Upper>().solve(here.solve(-open));
    for (std::size_t i = 0; i < free.size(); ++i) v[free[i]] += d[static_cast<Eigen::Index>(i)];
  }

 private:
  /// L of the weighted mass matrix of these components.
  MatrixXd root_of(const std::vector<int>& free, const MatrixXd& M) const {
    VectorXd weight = VectorXd::Ones(m_.nv);
    for (const auto& [name, w] : m_.spec->assembly.weights)
      for (const int v : components_of(m_, name)) weight[v] = std::sqrt(w);
    const MatrixXd W = (weight.asDiagonal() * M * weight.asDiagonal())(free, free);
    const std::optional<MatrixXd> L = cholesky(W);
    return L ? *L : MatrixXd(W.diagonal().cwiseMax(1e-300).cwiseSqrt().asDiagonal());
  }

  VectorXd moved(const VectorXd& q, const VectorXd& step) const {
    VectorXd d = VectorXd::Zero(m_.nv), out(m_.nq);
    for (std::size_t i = 0; i < free_.size(); ++i) d[free_[i]] = step[static_cast<Eigen::Index>(i)];
    m_.retract(q.data(), d.data(), out.data());
    return out;
  }
  VectorXd in_velocities(const VectorXd& y) const { return root_.transpose().triangularView<Eigen::Upper>().solve(y); }
  /// From q to the start, in the roots of inertia.
  VectorXd way_back(const VectorXd& q) const {
    VectorXd d(m_.nv);
    m_.difference(q.data(), q0_.data(), d.data());
    return root_.transpose() * d(free_);
  }

  Eigen::DiagonalMatrix<double, Eigen::Dynamic> rows() const {
    VectorXd scale(m_.loops.rows);
    const Inputs none{};
    const LoopPass pass(m_, ws_, none);
    for (const Loop& loop : m_.loops.all) {
      const double size = pass.size_of(loop);
      for (int i = loop.first; i < loop.first + loop.rows; ++i) scale[i] = pass.in_metres(loop, i) / size;
    }
    return scale.asDiagonal();
  }

  Here look(const VectorXd& q) {
    stand(m_, ws_, q.data(), false);
    const Inputs in{.q = q.data(), .v = ws_.loops->zero.data(), .gravity = false};
    LoopPass pass(m_, ws_, in);
    pass.place();
    pass.matrix();
    const auto scale = rows();
    const auto G =
        Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(ws_.loops->G.data(), m_.loops.rows, m_.nv);
    const VectorXd c = scale * Eigen::Map<const VectorXd>(ws_.loops->c.data(), m_.loops.rows);
    return {c(rows_), root_.triangularView<Eigen::Lower>().solve((scale * G)(rows_, free_).transpose()).transpose(),
            in_doubt_ ? kWeak : kDoubt, typed_, full_};
  }

  /// Rows of which pivots are between these.
  bool has_weak_rows(const MatrixXd& A, double least, double most) const {
    if (A.size() == 0) return false;
    const double largest = typed_ || most <= kTyped ? full_ : A.cwiseAbs().maxCoeff();
    return complete_pivots(A, most * largest).rows.size() != complete_pivots(A, least * largest).rows.size();
  }
  /// Of hinges that close.
  std::vector<std::vector<double>> coordinates() const {
    std::vector<std::vector<double>> out;
    for (const Loop& loop : m_.loops.all) out.push_back(loop.q0);
    return out;
  }
  void take_coordinates(const std::vector<std::vector<double>>& q0) {
    for (std::size_t l = 0; l < q0.size(); ++l) m_.loops.all[l].q0 = q0[l];
  }

  /// Hinges that close loops go on from where they are, and so do the rows of each.
  void settle() {
    ws_.loops->near_W = ws_.loops->W;
    for (const std::size_t l : loops_)
      if (m_.loops.all[l].hinge) m_.loops.all[l].q0 = ws_.loops->q[l];
  }

  /// The part of a step that is not too long.
  double longest(const VectorXd& step) const {
    double most = 1.0;
    for (std::size_t i = 0; i < free_.size(); ++i) {
      const double reach = stretch_ * (turns_[static_cast<std::size_t>(free_[i])] != 0 ? kReach : reach_);
      most = std::max(most, std::abs(step[static_cast<Eigen::Index>(i)]) / reach);
    }
    return 1.0 / most;
  }

  bool same_branch(const Here& here, const Here& there) const {
    if (!there.A.allFinite()) return false;
    if (here.A.size() == 0) return true;
    const Pivots p = complete_pivots(here.A, (in_doubt_ ? kWeak : kNoPivot) * here.A.cwiseAbs().maxCoeff());
    if (p.rows.empty()) return true;
    return determinant(there.A(p.rows, p.columns)) / determinant(here.A(p.rows, p.columns)) > kSingular;
  }

  template <class Better>
  bool step_along(VectorXd& q, Here& here, const VectorXd& step, const Better& better) {
    const double first = longest(step);
    for (double s = first; s > kShortest * first; s *= 0.5) {
      const VectorXd next = moved(q, s * step);
      Here there = look(next);
      if (!better(there, s) || !same_branch(here, there)) continue;
      q = next, here = std::move(there);
      settle();
      return true;
    }
    return false;
  }

  Model& m_;
  Workspace& ws_;
  VectorXd q0_;
  std::vector<std::size_t> loops_;
  std::vector<int> free_, rows_;
  MatrixXd root_;
  std::vector<std::uint8_t> turns_;
  double reach_ = 0.0, full_ = 0.0;
  double stretch_ = 1.0;   // of steps: longer ones where gradients stay what they are, as of gears and of bodies that only shift
  bool in_doubt_ = false;  // weak rows: whether they count is told where it ends
  bool typed_ = false;     // rows as weak as digits of what was typed: others imply them
};

}  // namespace

bool assemble_start(Model& model, Workspace& ws, const std::function<MatrixXd(const VectorXd&)>& inertia, bool places, bool given_moves,
                    State& start, std::vector<std::vector<std::string>>& may_move) {
  const State given = start;
  const MatrixXd M = inertia(start.q);
  const std::vector<std::vector<std::size_t>> sets = sets_of_loops(model, given_moves);
  std::vector<std::size_t> all(model.loops.all.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  Assembler assembler(model, ws, start.q, M, all, given_moves);
  may_move.assign(all.size(), {});
  for (const auto& set : sets) {
    const Assembler part(model, ws, start.q, M, set, given_moves);
    for (const int v : part.free())
      for (const std::size_t l : set) may_move[l].push_back(name_of_component(model, v).coordinate);
  }
  bool closed = !places;
  if (places && !assembler.free().empty()) {
    closed = assembler.close(start.q);
    if (!closed && sets.size() > 1) {  // what closes by itself is not at fault
      closed = true;
      start.q = given.q;
      for (const auto& set : sets) {
        Assembler part(model, ws, start.q, M, set, given_moves);
        if (!part.close(start.q)) closed = false;
      }
      if (!closed) assembler.move_along(start.q, inertia(start.q), start.v);
    }
    if (closed) assembler.approach(start.q);
  }
  if (closed) assembler.move_along(start.q, inertia(start.q), start.v);
  ws.loops->near_W.clear();
  return closed;
}

std::vector<MovedAtStart> moved_at_start(const Model& model, const State& given, const State& start, bool given_moves) {
  std::vector<MovedAtStart> moved;
  VectorXd way(model.nv);
  model.difference(given.q.data(), start.q.data(), way.data());
  for (const UserBody& u : model.user)
    for (int j = 0; j < u.nv; ++j) {
      const int v = u.v + j;
      const ComponentName name = name_of_component(model, v);
      const double from = u.nq == u.nv ? given.q[u.q + j] : 0.0;
      const HingeSpec& hinge = model.spec->bodies[static_cast<std::size_t>(&u - model.user.data())].hinge;
      if (way[v] != 0.0) moved.push_back({name.coordinate, name.coordinate_unit, from, from + way[v], given_moves && !hinge.q.empty()});
      if (start.v[v] != given.v[v]) moved.push_back({name.rate, name.rate_unit, given.v[v], start.v[v]});
    }
  return moved;
}

}  // namespace cardan
