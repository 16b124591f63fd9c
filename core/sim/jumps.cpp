// What follows where velocities jump, by whatever: states of devices that follow accelerations feel it, and what it has carried across zero
// happens. What makes them jump: impulses.cpp, given_motion.cpp, adopt.cpp.
#include <algorithm>
#include <utility>

#include "core/sim/simulation.hpp"

namespace cardan {
namespace {

/// What closing loops and rounding may move a node by [m], and that of its distance from the origin.
constexpr double kMoved = 1e-6, kMovedFar = 1e-12;

}  // namespace

/// Those at the present state go behind what `passing_` has.
void Simulation::roots_of_devices() {
  if (!on_trial_) return;
  const std::size_t from = passing_.size();
  observe();  // what inputs are given
  passing_.resize(from + static_cast<std::size_t>(n_roots()) - events_.size() - limits_.size());
  const double* x = packed();
  const bool known = unless_thrown([&] { device_roots(state_.t, x, passing_.data() + from); });
  passing_.resize(from + (known ? static_cast<std::size_t>(model_->devices.n_roots) : 0));
  if (!known) fail(explain({}));
}

void Simulation::motion_of_mounts(const Device& d, std::vector<cardan_mount_motion>& all) {
  all.assign(d.mounts.size(), {});
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (d.mounts[i].v >= 0) all[i].q = d.mounts[i].q >= 0 ? state_.q[d.mounts[i].q] : 0.0, all[i].v = state_.v[d.mounts[i].v];
    if (d.mounts[i].node < 0) continue;
    const NodeState n = observe().node(d.mounts[i].node);
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor>::Map(all[i].R_WN) = n.R_WN;
    Eigen::Vector3d::Map(all[i].position) = n.position;
    Eigen::Vector3d::Map(all[i].omega) = n.velocity.head<3>(), Eigen::Vector3d::Map(all[i].velocity) = n.velocity.tail<3>();
  }
}

/// States that follow from accelerations take what velocities have jumped by since the outermost Jump began, or since this was called last.
void Simulation::feel_jump() {
  for (const int i : devices_ ? devices_->following() : std::span<const int>{}) {
    const Device& d = model_->devices.all[static_cast<std::size_t>(i)];
    auto& [now, before, jumped, is_known] = felt_.devices[d.name];
    now.swap(before);
    motion_of_mounts(d, now);
    jumped = now;
    if (!std::exchange(is_known, true) || before.size() != now.size()) continue;  // it is new
    bool any = false;
    for (std::size_t k = 0; k < now.size(); ++k) {
      using Eigen::Vector3d;
      const auto place = Vector3d::Map(now[k].position);
      if ((place - Vector3d::Map(before[k].position)).norm() > kMoved + kMovedFar * place.norm())
        continue;  // a change of the vehicle put it elsewhere
      Vector3d::Map(jumped[k].alpha) = Vector3d::Map(now[k].omega) - Vector3d::Map(before[k].omega);
      Vector3d::Map(jumped[k].specific_force) = Vector3d::Map(now[k].velocity) - Vector3d::Map(before[k].velocity);
      jumped[k].vdot = now[k].v - before[k].v;
      any = any || jumped[k].vdot != 0.0 || !Vector3d::Map(jumped[k].alpha).isZero(0.0) ||
            !Vector3d::Map(jumped[k].specific_force).isZero(0.0);
    }
    if (!any) continue;
    bool good = false;
    if (!unless_thrown([&, &felt = jumped] { good = devices_->feel(i, felt, state_.z.data()); }) || !good) fail(explain({}));
    changed();
  }
}

Simulation::Jump::Jump(Simulation& sim) : sim_(sim), from_(std::ssize(sim.passing_)) {
  if (sim.felt_.depth == 0)
    for (auto& [name, device] : sim.felt_.devices) device.is_known = false;
  sim.feel_jump();
  sim.roots_of_devices();
  ++sim.felt_.depth;
}

Simulation::Jump::~Jump() {
  if (!felt_) --sim_.felt_.depth;
  sim_.passing_.resize(static_cast<std::size_t>(from_));
}

void Simulation::Jump::end() {
  sim_.feel_jump();
  felt_ = true, --sim_.felt_.depth;
  sim_.pass_roots(static_cast<std::size_t>(from_));
}

/// What lies on the other side of zero than it did happens; `before`: where that is in passing_.
void Simulation::pass_roots(std::size_t before) {
  if (!on_trial_) return;
  const std::size_t now = passing_.size();
  roots_of_devices();
  bool any = false;
  for (std::size_t i = 0; i < model_->devices.all.size(); ++i) {
    const Device& d = model_->devices.all[i];
    for (std::uint32_t root = 0; root < d.family->n_roots; ++root) {
      const std::size_t at = static_cast<std::size_t>(d.root) + root;
      const double was = passing_[before + at], is = passing_[now + at];
      if (!(was < 0.0 ? is > 0.0 : was > 0.0 && is < 0.0)) continue;
      observe();
      device_happens(static_cast<int>(i), root, is > 0.0 ? 1 : -1);
      any = true;
    }
  }
  passing_.resize(before);
  if (any) settle_holds();
}

}  // namespace cardan
