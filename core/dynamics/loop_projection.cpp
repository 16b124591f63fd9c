// The way back to closed loops after a step (docs/mathematics/loops.md, 3).
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/dynamics/loop_pass.hpp"

namespace cardan {
namespace {

constexpr double kClosed = 4e-15;                        // residual that counts as none, relative to the size of a loop
constexpr double kRounded = 4.5e-16;                     // the same, relative to how far from home it is: places are rounded there
constexpr double kStalled = 1e-11, kStalledFar = 1e-14;  // what does not become less below these is rounding; relative to the same two
constexpr int kTries = 20;                               // of Newton's method

}  // namespace

LoopProjection::LoopProjection(const Model& model) : model_(model), ws_(model), step_(model.nv), next_(model.nq), mu_(model.loops.rows) {}
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
  const auto largest = [&](const std::vector<double>& x) {
    double most = 0.0;
    worst_ = 0;
    for (const Loop& loop : model_.loops.all) {
      const double size = pass.size_of(loop);
      for (int i = loop.first; i < loop.first + loop.rows; ++i) {
        const double metres = std::abs(x[static_cast<std::size_t>(i)]) * pass.in_metres(loop, i);
        if (&x == &work.c && metres <= kRounded * pass.reach_of(loop)) continue;
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
        most = std::max(most, std::abs(work.c[static_cast<std::size_t>(i)]) * pass.in_metres(loop, i) /
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
    if (model_.loops.embedding && embedded_response(model_, ws_, q, drives, x, step_.data())) {
      pivot_ = work.embedding->smallest, weakest_ = work.embedding->weakest;
      look_at_wheels();
      return true;
    }
    if (model_.loops.embedding && !stand(model_, ws_, q, true)) return false;
    pass.matrix();
    pass.find_rank();
    pivot_ = work.rank > 0 ? work.smallest : 1.0;
    weakest_ = work.rank > 0 ? work.row_at[static_cast<std::size_t>(work.rank) - 1] : 0;
    if (!pass.compliance(model_.runs)) return false;
    mu_.setZero();
    pass.solve(x.data(), mu_.data());
    step_.setZero();
    for (int p = 0; p < work.rank; ++p)
      step_ -= mu_[work.row_at[static_cast<std::size_t>(p)]] *
               Eigen::Map<const Eigen::VectorXd>(work.U.data() + static_cast<std::ptrdiff_t>(p) * model_.nv, model_.nv);
    return true;
  };
  double before = std::numeric_limits<double>::infinity();
  int in_place = 0;  // the row that was open most
  for (int i = 0;; ++i) {
    if (!stand(model_, ws_, q, !model_.loops.embedding)) return false;
    pass.place();
    const double now = largest(work.c);
    if (i == 0) distance_ = now, drift_ = drift(), in_place = worst_;
    open_ = now;
    if (!std::isfinite(now)) return false;
    if (now <= kClosed || (i > 0 && now > 0.5 * before && before < stalled())) break;
    if (i == kTries || (i > 2 && now > before)) return false;
    if (!take(work.c)) return false;
    model_.retract(q, step_.data(), next_.data());
    std::copy_n(next_.data(), model_.nq, q);
    before = now;
  }
  rate_ = largest(work.rate);
  if (!(rate_ > distance_)) worst_ = in_place;
  if (!take(work.rate)) return false;
  for (int i = 0; i < model_.nv; ++i) v[i] += step_[i];
  return true;
}

}  // namespace cardan
