// The way back to closed loops after a step (docs/mathematics/loops.md, 3).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/dynamics/loop_pass.hpp"

namespace cardan {
namespace {

constexpr double kClosed = 4e-15;                        // residual that counts as none, relative to the size of a loop
constexpr double kRounded = 4.5e-16;                     // the same, relative to how far from home it is: places are rounded there
constexpr double kStalled = 1e-11, kStalledFar = 1e-14;  // what does not become less below these is rounding; relative to the same two
constexpr double kSeen = 1e-3;                           // of what is left open most, so much of another row is no rounding
constexpr int kTries = 20;                               // of Newton's method

}  // namespace

LoopProjection::LoopProjection(const Model& model)
    : model_(model),
      ws_(model),
      step_(model.nv),
      next_(model.nq),
      mu_(model.loops.rows),
      given_(static_cast<std::size_t>(model.loops.rows)),
      agreed_(given_) {}
LoopProjection::~LoopProjection() = default;

soa::Breakdown LoopProjection::breakdown() const {
  if (ws_.breakdown.body != 0) return ws_.breakdown;
  return {.body = 1, .value = open_, .limit = kClosed, .row = worst_};
}

bool LoopProjection::close(double* q, double* v, const LoopDrive* drives) {
  make_room_for_loops(model_, ws_);
  LoopWork& work = *ws_.loops;
  const Inputs in{.q = q, .v = v, .gravity = false, .drives = drives};
  LoopPass pass(model_, ws_, in);
  bool of_places = true, implied = false;  // rows by others
  bool embedded = model_.loops.embedding != nullptr;
  const auto largest = [&](const std::vector<double>& x) {
    double most = 0.0;
    worst_ = 0;
    for (const Loop& loop : model_.loops.all) {
      const double size = pass.size_of(loop);
      for (int i = loop.first; i < loop.first + loop.rows; ++i) {
        const double metres = std::abs(x[static_cast<std::size_t>(i)]) * pass.in_metres(loop, i);
        if (of_places && metres <= kRounded * pass.reach_of(loop)) continue;
        const double one = metres / size;
        if (!(one <= most)) most = one, worst_ = i;  // what is no number is the largest
      }
    }
    return most;
  };
  const auto drift = [&] {
    double most = 0.0;
    for (const Loop& loop : model_.loops.all)
      for (int i = loop.first; i < loop.first + loop.rows; ++i)
        most = std::max(most, std::abs(given_[static_cast<std::size_t>(i)]) * pass.in_metres(loop, i) /
                                  std::max(pass.size_of(loop), pass.reach_of(loop)));
    return most;
  };
  const auto stalled = [&] {
    double most = kStalled;
    for (const Loop& loop : model_.loops.all) most = std::max(most, kStalledFar * pass.reach_of(loop) / pass.size_of(loop));
    return most;
  };
  /// Rows of wheels that turn with hinges are in no elimination of the sweeps: the largest slope of each, scaled as a pivot is.
  const auto look_at_wheels = [&] {
    for (const Transmission& t : model_.loops.embedding->transmissions)
      for (const Transmission::Row& row : t.rows) {
        if (t.constant) continue;
        const Loop& loop = model_.loops.all[static_cast<std::size_t>(row.loop)];
        double most = 0.0;
        for (std::size_t i = 0; i < loop.coupling.terms.size(); ++i) {
          const auto rate = static_cast<std::size_t>(loop.coupling.terms[i].v);
          most = std::max(
              most, std::abs(work.gradient[static_cast<std::size_t>(row.loop)][i]) * model_.loops.column_scale[rate] / loop.reference);
        }
        if (most < pivot_) pivot_ = most, weakest_ = row.row;
      }
  };
  /// The least motion M^-1 G* mu that takes G of it from x. False: a row without compliance.
  const auto take = [&](const std::vector<double>& x) {
    if (embedded && embedded_response(model_, ws_, q, drives, x, step_.data())) {
      pivot_ = work.embedding->smallest, weakest_ = work.embedding->weakest;
      look_at_wheels();
      return true;
    }
    if (model_.loops.embedding && !stand(model_, ws_, q, true)) return false;
    pass.matrix();
    pass.find_rank();
    pivot_ = work.rank > 0 ? work.smallest : 1.0;
    weakest_ = work.rank > 0 ? work.row_at[static_cast<std::size_t>(work.rank) - 1] : 0;
    implied = work.rank >= model_.loops.rank && work.rank < model_.loops.rows;  // what counts no longer at a singular posture is not
    if (!pass.compliance(model_.runs)) return false;
    agreed_ = x;
    if (implied) pass.reconcile(agreed_.data());
    mu_.setZero();
    pass.solve(agreed_.data(), mu_.data());
    step_.setZero();
    for (int p = 0; p < work.rank; ++p)
      step_ -= mu_[work.row_at[static_cast<std::size_t>(p)]] *
               Eigen::Map<const Eigen::VectorXd>(work.U.data() + static_cast<std::ptrdiff_t>(p) * model_.nv, model_.nv);
    return true;
  };
  double before = std::numeric_limits<double>::infinity(), agreed_before = before;
  int in_place = 0;  // the row that was open most
  left_open_ = 0.0;
  for (int i = 0;; ++i) {
    if (!stand(model_, ws_, q, !model_.loops.embedding)) return false;
    pass.place();
    const double now = largest(work.c);
    if (i == 0) given_ = work.c, distance_ = now, drift_ = drift(), in_place = worst_;
    open_ = now;
    if (!std::isfinite(now)) return false;
    const auto closed = [&](double open, double was) { return open <= kClosed || (i > 0 && open > 0.5 * was && was < stalled()); };
    if (closed(now, before)) break;
    if (embedded && i > 0 && now > 0.5 * before) embedded = false, before = std::numeric_limits<double>::infinity();
    if (implied && now > stalled() && now <= kTyped) {  // is it open by that alone which nothing can close?
      const int row = worst_;
      agreed_ = work.c;
      pass.reconcile(agreed_.data());
      const double agreed = largest(agreed_);
      if (closed(agreed, agreed_before)) {
        pass.reconcile(given_.data());
        left_open_ = now, distance_ = largest(given_), drift_ = drift(), in_place = worst_;
        break;
      }
      agreed_before = agreed, worst_ = row;
    }
    if (i == kTries || (i > 2 && now > before)) return false;
    if (!take(work.c)) return false;
    model_.retract(q, step_.data(), next_.data());
    std::copy_n(next_.data(), model_.nq, q);
    before = now;
  }
  of_places = false;
  if (left_open_ > 0.0) pass.reconcile(work.rate.data());
  rate_ = largest(work.rate);
  if (!(rate_ > distance_)) worst_ = in_place;
  if (!take(work.rate)) return false;
  for (int i = 0; i < model_.nv; ++i) v[i] += step_[i];
  return true;
}

std::vector<RowLeftOpen> rows_left_open(const Model& model, const Eigen::VectorXd& q, const Eigen::VectorXd& v, const LoopDrive* drives) {
  std::vector<RowLeftOpen> out;
  if (model.loops.empty()) return out;
  LoopProjection projection(model);
  Eigen::VectorXd closed = q, rates = v;
  if (!projection.close(closed.data(), rates.data(), drives) || (projection.left_open() == 0.0 && !model.loops.left_open)) return out;
  Workspace ws(model);
  if (projection.left_open() == 0.0) {
    const LoopRank rank = loop_rank(model, ws, closed.data(), drives);
    if (rank.redundant.empty()) return out;
    const LoopWork& work = *ws.loops;
    int row = rank.redundant.front();
    double most = 0.0;
    for (const int i : rank.redundant)
      for (std::size_t j = static_cast<std::size_t>(rank.rank); j < work.columns.size(); ++j)
        if (const double x =
                std::abs(work.B[static_cast<std::size_t>(i) * work.columns.size() + static_cast<std::size_t>(work.column_at[j])]);
            x > most)
          most = x, row = i;
    const Inputs none{};
    const Loop& loop = LoopPass(model, ws, none).loop_of(row);
    out.push_back({static_cast<int>(&loop - model.loops.all.data()),
                   fmt::format("{} holds by a scaled pivot of {:.2g} beside the other rows, which should imply it: it is left open",
                               name_of_row(model, ws, row), rank.largest)});
    return out;
  }
  const Eigen::VectorXd c = loop_rows(model, ws, closed.data(), drives).c;
  for (std::size_t l = 0; l < model.loops.all.size(); ++l) {
    const Loop& loop = model.loops.all[l];
    int most = loop.first;
    for (int i = most + 1; i < loop.first + loop.rows; ++i)
      if (std::abs(c[i]) > std::abs(c[most])) most = i;
    if (!(std::abs(c[most]) > kStalled + kSeen * projection.left_open())) continue;
    const auto at = static_cast<std::size_t>(most);
    const Force<double>& W = ws.loops->W[at];
    out.push_back({static_cast<int>(l), fmt::format("{} is open by {:.3g}{} and nothing can close it: other rows imply it",
                                                    name_of_row(loop, most, W), std::abs(ws.loops->c[at]), unit_of_row(loop, W))});
  }
  return out;
}

}  // namespace cardan
