#include "core/sim/vehicle_extended.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/reference/quad.hpp"

namespace cardan {
namespace {

using reference::Quad;

constexpr int kColumns = 16;     // of an extrapolation: order 32 at most
constexpr double kSame = 4e-16;  // relative: a state that is nearer was not changed
constexpr int kClosings = 5;     // Newton steps from what is closed in double: each doubles the digits

std::shared_ptr<const Model> of_113_bits(std::shared_ptr<const Model> model) {
  if (const std::string not_taken = VehicleExtended::refusal(*model); !not_taken.empty())
    refuse(Code::unsupported, {"integrator.method"}, "a method that takes " + not_taken, "extended, which computes in 113 bits throughout",
           "dop853 with a relative of 1e-13");
  return model;
}

}  // namespace

std::string VehicleExtended::refusal(const Model& model) {
  for (const Device& d : model.devices.all)
    if (d.acts || d.family->n_states > 0) return fmt::format("device {} ({}), which computes in double", d.name, d.family->type);
  if (model.field.source) return "gravity of a field, which is computed in double";
  for (int i = 0; i < model.nv; ++i)
    if (model.has_given_motion(i)) return "motions that are given as functions of time";
  for (const Loop& loop : model.loops.all)
    if (loop.drive >= 0) return fmt::format("loop {}, which is driven as a function of time", loop.name);
  if (model.changes()) return "masses that change";
  for (const UserBody& u : model.user) {
    if (u.family_origin != "built-in") return fmt::format("body {} ({}) of a plugin", u.name, u.type);
    if (reference::hinge_size(u.hinge_type).nq < 0) return fmt::format("the hinge of {} ({}) of a plugin", u.name, u.hinge_type);
  }
  return {};
}

VehicleExtended::VehicleExtended(std::shared_ptr<const Model> model, std::vector<double> absolute, double relative,
                                 std::function<TwinLoads()> loads, ExtendedIntegrands integrands)
    : model_(of_113_bits(std::move(model))),
      absolute_(std::move(absolute)),
      relative_(relative),
      loads_(std::move(loads)),
      twin_(*model_),
      integrands_(std::move(integrands)),
      x_(static_cast<std::size_t>(model_->nq + model_->nv)),
      ydot_(static_cast<std::size_t>(integrands_.n)),
      now_(VecX::Zero(model_->nq + model_->nv + integrands_.n)),
      next_(now_) {
  now_.head(static_cast<Eigen::Index>(x_.size())).setConstant(std::numeric_limits<Quad>::quiet_NaN());  // nowhere yet
  for (const UserBody& u : model_->user)
    if (u.nq > 0 && u.hinge->normalise) quaternions_.push_back(u.q);
}

bool VehicleExtended::rates(const VecX& x, VecX& xdot) {
  const TwinLoads loads = loads_();
  try {
    const auto state = twin_.at(x.head(model_->nq), x.segment(model_->nq, model_->nv), loads);
    xdot.head(model_->nq) = state.qdot;
    xdot.segment(model_->nq, model_->nv) = twin_.vdot(state, loads);
  } catch (const NumericsError&) {
    return false;
  }
  if (integrands_.n > 0) {
    const auto n = static_cast<Eigen::Index>(x_.size());
    Eigen::VectorXd::Map(x_.data(), n) = x.head(n).cast<double>();
    if (!integrands_.rates(x_.data(), ydot_.data())) return false;
    xdot.tail(integrands_.n) = Eigen::VectorXd::Map(ydot_.data(), integrands_.n).cast<Quad>();
  }
  return std::ranges::all_of(xdot, [](const Quad& r) { return isfinite(r); });
}

/// Quaternions of length 1; loops and their rates, by steps that are smallest in the metric of M.
void VehicleExtended::close(VecX& x) {
  const auto normalise = [&] {
    for (const int q : quaternions_) x.segment(q, 4) /= sqrt(x.segment(q, 4).squaredNorm());
  };
  normalise();
  if (model_->loops.empty()) return;
  const TwinLoads loads = loads_();
  const auto rows = [&](const reference::DenseState<Quad>& state, bool rates) {
    const auto loops = state.loops();
    Eigen::Index n = 0;
    for (const auto& l : loops) n += l.c.size();
    reference::MatX<Quad> G(n, model_->nv);
    VecX c(n);
    n = 0;
    for (const auto& l : loops) {
      G.middleRows(n, l.c.size()) = l.G;
      c.segment(n, l.c.size()) = rates ? VecX(l.G * x.segment(model_->nq, model_->nv)) : l.c;
      n += l.c.size();
    }
    return reference::closed_motion<Quad>(state.M, VecX::Zero(model_->nv), G, -c).vdot;
  };
  for (int i = 0; i < kClosings; ++i) {
    const VecX by = rows(twin_.at(x.head(model_->nq), x.segment(model_->nq, model_->nv), loads), false);
    x.head(model_->nq) += twin_.at(x.head(model_->nq), by, loads).qdot;
    normalise();
  }
  x.segment(model_->nq, model_->nv) += rows(twin_.at(x.head(model_->nq), x.segment(model_->nq, model_->nv), loads), true);
}

void VehicleExtended::enter(const double* x) {
  const auto n = static_cast<Eigen::Index>(x_.size());
  bool same = true;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double before = static_cast<double>(now_[i]);
    same = same && std::abs(x[i] - before) <= kSame * std::max(1.0, std::abs(before));
  }
  if (!same) {
    now_.head(n) = Eigen::VectorXd::Map(x, n).cast<Quad>();
    close(now_);
  }
  next_ = now_;
}

double VehicleExtended::error(const VecX& a, const VecX& b, int& state) const {
  double worst = 0.0;
  for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(x_.size()); ++i) {
    const double size = std::max(std::abs(static_cast<double>(a[i])), std::abs(static_cast<double>(now_[i])));
    const double e = std::abs(static_cast<double>(a[i] - b[i])) / (absolute_[static_cast<std::size_t>(i)] + relative_ * size);
    if (!(e <= worst)) worst = e, state = static_cast<int>(i);
  }
  return worst;
}

// The modified midpoint rule with 2, 4, ... parts, extrapolated to none of them (Gragg 1965; Hairer, Norsett and Wanner, Solving Ordinary
// Differential Equations I, II.9); as many columns as it takes.
ExtendedMotion::Trial VehicleExtended::step(double t0, double t1) {
  Trial trial;
  const Quad whole = Quad(t1) - Quad(t0);
  VecX first(now_.size()), slope(now_.size());
  ++trial.calls;
  if (!rates(now_, first)) return trial;
  std::vector<VecX> row;
  for (int k = 1; k <= kColumns; ++k) {
    const Quad h = whole / Quad(2 * k);
    VecX before = now_, at = now_ + h * first;
    for (int i = 1; i < 2 * k; ++i) {
      ++trial.calls;
      if (!rates(at, slope)) return trial;
      VecX after = before + Quad(2) * h * slope;
      before = std::move(at), at = std::move(after);
    }
    std::vector<VecX> next{std::move(at)};
    for (int j = 1; j < k; ++j) {
      const Quad ratio = Quad(k) / Quad(k - j);
      next.push_back(next.back() + (next.back() - row[static_cast<std::size_t>(j - 1)]) / (ratio * ratio - Quad(1)));
    }
    const double off = k < 3 ? HUGE_VAL : error(next.back(), next[next.size() - 2], trial.worst);
    row = std::move(next);
    if (!(off <= 1.0)) continue;
    next_ = row.back();
    trial.order = 2 * k;
    break;
  }
  return trial;
}

void VehicleExtended::found(double* x) const { Eigen::VectorXd::Map(x, next_.size()) = next_.cast<double>(); }

void VehicleExtended::remember(Archive& archive) {
  for (Eigen::Index i = 0; i < now_.size(); ++i) {
    double part[3];  // 53 bits each
    Quad rest = now_[i];
    for (double& p : part) p = static_cast<double>(rest), rest -= Quad(p);
    archive(part[0], part[1], part[2]);
    if (archive.reading()) now_[i] = Quad(part[0]) + Quad(part[1]) + Quad(part[2]);
  }
  if (archive.reading()) next_ = now_;
}

}  // namespace cardan
