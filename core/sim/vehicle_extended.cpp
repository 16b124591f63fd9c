#include "core/sim/vehicle_extended.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/reference/quad.hpp"

namespace cardan {
namespace {

using reference::Quad;

constexpr int kColumns = 16;  // of an extrapolation: order 32 at most
// Relative: a state that is nearer was not changed, but rounded; brought back on closed loops in double; a function of time, which rounding
// of its argument moves by as much after many turns.
constexpr double kSame = 4e-16, kSameClosed = 1e-13, kSameGiven = 1e-9;
constexpr int kClosings = 5;  // Newton steps from what is closed in double: each doubles the digits

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
  if (model.changes()) return "masses that change";
  for (const UserBody& u : model.user) {
    if (u.family_origin != "built-in") return fmt::format("body {} ({}) of a plugin", u.name, u.type);
    if (reference::hinge_size(u.hinge_type).nq < 0) return fmt::format("the hinge of {} ({}) of a plugin", u.name, u.hinge_type);
  }
  return {};
}

VehicleExtended::VehicleExtended(std::shared_ptr<const Model> model, std::vector<double> absolute, double relative,
                                 std::function<ExtendedLoads()> loads, ExtendedIntegrands integrands)
    : model_(of_113_bits(std::move(model))),
      absolute_(std::move(absolute)),
      relative_(relative),
      loads_(std::move(loads)),
      twin_(*model_),
      integrands_(std::move(integrands)),
      x_(static_cast<std::size_t>(model_->nq + model_->nv)),
      ydot_(static_cast<std::size_t>(integrands_.n)),
      now_(VecX::Zero(model_->nq + model_->nv + integrands_.n)),
      next_(now_),
      vdot_given_(VecX::Zero(model_->nv)) {
  now_.head(static_cast<Eigen::Index>(x_.size())).setConstant(std::numeric_limits<Quad>::quiet_NaN());  // nowhere yet
  for (const UserBody& u : model_->user)
    if (u.nq > 0 && u.hinge->normalise) quaternions_.push_back(u.q);
  for (int i = 0; i < model_->nv; ++i)
    if (!twin_.prescribed()[static_cast<std::size_t>(i)]) free_.push_back(i);
}

/// Given motions at a time between since_ and the next corner of their profiles.
void VehicleExtended::give(const Quad& t, VecX& x) const {
  for (const ExtendedLoads::Motion& m : acting_.motions) {
    x[model_->nq + m.v] = m.profile->rate(t);
    if (m.q >= 0) x[m.q] = now_[m.q] + m.profile->travel(Quad(since_), t);
  }
}

VehicleExtended::VecX VehicleExtended::lengths_at(const Quad& t) const {
  VecX out = more_;
  for (Eigen::Index i = 0; i < out.size(); ++i) out[i] += acting_.lengths[static_cast<std::size_t>(i)].profile->travel(Quad(since_), t);
  return out;
}

TwinLoads<Quad> VehicleExtended::loads_at(const Quad& t) {
  for (const ExtendedLoads::Motion& m : acting_.motions) vdot_given_[m.v] = m.profile->acceleration(t, since_);
  TwinLoads<Quad> out;
  out.tau = acting_.tau.data(), out.wrenches = acting_.wrenches, out.vdot = vdot_given_.data();
  out.drives.resize(3, more_.size());
  out.drives.row(0) = lengths_at(t).transpose();
  for (Eigen::Index i = 0; i < out.drives.cols(); ++i) {
    const MotionProfile& profile = *acting_.lengths[static_cast<std::size_t>(i)].profile;
    out.drives(1, i) = profile.rate(t), out.drives(2, i) = profile.acceleration(t, since_);
  }
  return out;
}

/// At x with its given motions put in.
bool VehicleExtended::rates(const Quad& t, VecX& x, VecX& xdot) {
  give(t, x);
  const TwinLoads<Quad> loads = loads_at(t);
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
    if (!integrands_.rates(static_cast<double>(t), x_.data(), ydot_.data())) return false;
    xdot.tail(integrands_.n) = Eigen::VectorXd::Map(ydot_.data(), integrands_.n).cast<Quad>();
  }
  return std::ranges::all_of(xdot, [](const Quad& r) { return isfinite(r); });
}

/// Quaternions of length 1; loops and their rates, by steps of the components that are not given, the smallest in the metric of M.
void VehicleExtended::close(const Quad& t, VecX& x) {
  const auto normalise = [&] {
    for (const int q : quaternions_) x.segment(q, 4) /= sqrt(x.segment(q, 4).squaredNorm());
  };
  normalise();
  if (model_->loops.empty() || free_.empty()) return;
  const TwinLoads<Quad> loads = loads_at(t);
  const auto closing = [&](bool rates) {
    const VecX v = x.segment(model_->nq, model_->nv);
    const auto state = twin_.at(x.head(model_->nq), v, loads);
    const auto loops = state.loops();
    Eigen::Index n = 0, drive = 0;
    for (const auto& l : loops) n += l.c.size();
    reference::MatX<Quad> G(n, model_->nv);
    VecX c(n);
    n = 0;
    for (std::size_t i = 0; i < loops.size(); ++i) {
      const auto& l = loops[i];
      G.middleRows(n, l.c.size()) = l.G;
      c.segment(n, l.c.size()) = rates ? VecX(l.G * v) : l.c;
      if (model_->loops.all[i].drive >= 0 && rates) c[n] -= loads.drives(1, drive++);
      n += l.c.size();
    }
    VecX by = VecX::Zero(model_->nv);
    by(free_) =
        reference::closed_motion<Quad>(state.M(free_, free_), VecX::Zero(static_cast<Eigen::Index>(free_.size())), G(Eigen::all, free_), -c)
            .vdot;
    return by;
  };
  for (int i = 0; i < kClosings; ++i) {
    const VecX by = closing(false);
    x.head(model_->nq) += twin_.at(x.head(model_->nq), by, loads).qdot;
    normalise();
  }
  x.segment(model_->nq, model_->nv) += closing(true);
}

void VehicleExtended::enter(double t, const double* x) {
  const auto n = static_cast<Eigen::Index>(x_.size());
  since_ = t;
  acting_ = loads_();
  given_.assign(x_.size(), false);
  for (const ExtendedLoads::Motion& m : acting_.motions) {
    given_[static_cast<std::size_t>(model_->nq + m.v)] = true;
    if (m.q >= 0) given_[static_cast<std::size_t>(m.q)] = true;
  }
  const double same_within = model_->loops.empty() ? kSame : kSameClosed;
  bool same = true;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double before = static_cast<double>(now_[i]), within = given_[static_cast<std::size_t>(i)] ? kSameGiven : same_within;
    if (std::abs(x[i] - before) <= within * std::max(1.0, std::abs(before))) continue;
    now_[i] = Quad(x[i]), same = false;
  }
  if (more_.size() != std::ssize(acting_.lengths)) {
    more_.resize(std::ssize(acting_.lengths));
    for (Eigen::Index i = 0; i < more_.size(); ++i) more_[i] = Quad(acting_.lengths[static_cast<std::size_t>(i)].more);
  }
  give(Quad(t), now_);
  if (!same) close(Quad(t), now_);
  next_ = now_, next_more_ = more_;
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
  since_ = t0;
  const Quad start(t0), whole = Quad(t1) - start;
  VecX first(now_.size()), slope(now_.size());
  ++trial.calls;
  if (!rates(start, now_, first)) return trial;
  std::vector<VecX> row;
  std::vector<double> magnified;  // of each of the row, the rounding of rates
  for (int k = 1; k <= kColumns; ++k) {
    const Quad h = whole / Quad(2 * k);
    VecX before = now_, at = now_ + h * first;
    for (int i = 1; i < 2 * k; ++i) {
      ++trial.calls;
      if (!rates(start + Quad(i) * h, at, slope)) return trial;
      VecX after = before + Quad(2) * h * slope;
      before = std::move(at), at = std::move(after);
    }
    give(Quad(t1), at);
    std::vector<VecX> next{std::move(at)};
    std::vector<double> next_magnified{1.0};
    for (int j = 1; j < k; ++j) {
      const Quad ratio = Quad(k) / Quad(k - j);
      const double by = static_cast<double>(k * k) / ((k - j) * (k - j)) - 1.0;
      next_magnified.push_back(next_magnified.back() + (next_magnified.back() + magnified[static_cast<std::size_t>(j - 1)]) / by);
      next.push_back(next.back() + (next.back() - row[static_cast<std::size_t>(j - 1)]) / (ratio * ratio - Quad(1)));
    }
    const double off = k < 3 ? HUGE_VAL : error(next.back(), next[next.size() - 2], trial.worst);
    row = std::move(next), magnified = std::move(next_magnified);
    if (!(off <= 1.0)) continue;
    next_ = row.back(), next_more_ = lengths_at(Quad(t1));
    const auto integrals = [this](const VecX& x) { return Eigen::VectorXd(x.tail(integrands_.n).cast<double>().cwiseAbs()); };
    integral_errors_ = integrals(row.back() - row[row.size() - 2]) +
                       std::numeric_limits<double>::epsilon() * (t1 - t0) * magnified.back() * integrals(first).cwiseMax(integrals(slope));
    trial.order = 2 * k;
    break;
  }
  return trial;
}

void VehicleExtended::integral_errors(double* error) const { Eigen::VectorXd::Map(error, integral_errors_.size()) = integral_errors_; }

void VehicleExtended::found(double* x) const { Eigen::VectorXd::Map(x, next_.size()) = next_.cast<double>(); }

void VehicleExtended::remember(Archive& archive) {
  for (VecX* all : {&now_, &more_})
    for (Quad& x : *all) {
      double part[3];  // 53 bits each
      Quad rest = x;
      for (double& p : part) p = static_cast<double>(rest), rest -= Quad(p);
      archive(part[0], part[1], part[2]);
      if (archive.reading()) x = Quad(part[0]) + Quad(part[1]) + Quad(part[2]);
    }
  if (archive.reading()) next_ = now_, next_more_ = more_, integral_errors_.setZero();
}

}  // namespace cardan
