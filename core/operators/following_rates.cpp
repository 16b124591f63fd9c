#include "core/operators/following_rates.hpp"

#include "core/dynamics/forward.hpp"
#include "core/soa/kernels_tangent.hpp"

namespace cardan::operators {

using Eigen::VectorXd;

FollowingRates::FollowingRates(const Model& closed, const Model& open, const double* q, const VectorXd& v,
                               std::span<const LoopDrive> drives)
    : open_(open),
      ws_(open),
      q_(q, q + open.nq),
      held_(drives.begin(), drives.end()),
      loops_(at(closed, v)),
      qt_(q_.size()),
      rate_(q_.size()) {
  for (const double x : v) vt_.emplace_back(x);
}

VectorXd FollowingRates::along(const VectorXd& u) {
  move(u);
  return loops_.rates();
}
VectorXd FollowingRates::rows_along(const VectorXd& u) {
  move(u);
  return loops_.row_rates();
}

void FollowingRates::move(const VectorXd& u) {
  open_.qdot(q_.data(), u.data(), rate_.data());
  for (std::size_t i = 0; i < q_.size(); ++i) qt_[i] = {q_[i], rate_[i]};
  const soa::Inputs<soa::Tangent> in{.q = qt_.data(), .v = vt_.data()};
  outward(open_, soa::sweeps<soa::Tangent>(), ws_, in, {});
  loops_.place(ws_, in);
}

LoopTangents FollowingRates::at(const Model& closed, const VectorXd& v) {
  for (LoopDrive& d : held_) d.rate = d.acceleration = 0.0;
  const VectorXd still = VectorXd::Zero(open_.nv);
  return {closed,
          {.q = q_.data(),
           .v = v.data(),
           .tau = still.data(),
           .vdot = still.data(),
           .gravity = false,
           .drives = held_.empty() ? nullptr : held_.data()},
          0.0};
}

}  // namespace cardan::operators
