#include "core/sim/vehicle_linear_part.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/base/diagnostic.hpp"
#include "core/spatial/rotation.hpp"

namespace cardan {
namespace {

// M is taken anew where a hinge has moved by so much since: errors of the method grow threefold at 3 degrees (exponential.md, 5).
constexpr double kTurn = std::numbers::pi / 180.0;  // [rad]
constexpr double kWay = 0.01;                       // [m]
constexpr int kVarying = 20;                        // steps, where masses change with time
constexpr double kSwings = 2e4;                     // |mu| h of the longest step: tables of oscillators have 0.6 of that rows
constexpr double kResolved = std::numbers::pi;      // omega h above which a mode is not seen by three evaluations

Vec3<double> vec(const double* a) { return {a[0], a[1], a[2]}; }
void store(const Vec3<double>& a, double* out) { out[0] = a.x, out[1] = a.y, out[2] = a.z; }

Mat3<double> exponential(const Vec3<double>& theta) { return rotation_of_vector(rotation_coefficients(dot(theta, theta)), theta); }

/// theta' where R = exp(theta~) and omega = 2 (R* R')^v is in the turned axes: the inverse of the right Jacobian.
Vec3<double> rate_of_rotation(const Vec3<double>& theta, const Vec3<double>& omega) {
  const double t2 = dot(theta, theta), t = std::sqrt(t2);
  const double k = t > 1e-2 ? (1.0 - 0.5 * t * std::sin(t) / (1.0 - std::cos(t))) / t2 : 1.0 / 12.0 + t2 / 720.0 + t2 * t2 / 30240.0;
  const Vec3<double> to = cross(theta, omega);
  return omega + 0.5 * to + k * cross(theta, to);
}

bool has_quaternion_shape(int shape) { return shape == CARDAN_SHAPE_BALL || shape == CARDAN_SHAPE_FREE || shape == CARDAN_SHAPE_FREE_BODY; }

std::shared_ptr<const Model> honoured(std::shared_ptr<const Model> model, const std::string& method) {
  if (const std::string not_taken = VehicleLinearPart::refusal(*model); !not_taken.empty())
    refuse(Code::unsupported, {"integrator.method"}, "a method that takes " + not_taken, method + ", which does not",
           "dopri5, dop853; auto finds one");
  return model;
}

}  // namespace

std::string VehicleLinearPart::refusal(const Model& model) {
  if (!model.loops.empty()) return "closed loops";
  if (const UserBody* u = model.find_curved_nodes()) return fmt::format("bodies whose type tells how their nodes move, as {}", u->name);
  for (const int i : model.curved) {
    const UserBody& u = model.user[static_cast<std::size_t>(i)];
    for (int j = u.v; j < u.v + u.nv; ++j)
      if (model.has_given_motion(j)) return fmt::format("the given motion of {}, a {} hinge", u.name, u.hinge_type);
  }
  return {};
}

VehicleLinearPart::VehicleLinearPart(std::shared_ptr<const Model> model, const std::string& method, const DeviceForces* devices)
    : model_(honoured(std::move(model), method)),
      frozen_(model_, method == "multirate"),
      nq_(model_->nq),
      nv_(model_->nv),
      nz_(model_->devices.n_z) {
  const Model& m = *model_;
  const auto pushes_at_hinge = [](const Device& d) {
    return d.family->tangent && d.family->n_states == 0 && std::ranges::any_of(d.mounts, [](const DeviceMount& at) { return at.v >= 0; });
  };
  if (devices && std::ranges::any_of(m.devices.all, pushes_at_hinge)) devices_ = std::make_unique<DeviceTangents>(m, *devices);
  matters_.assign(static_cast<std::size_t>(nv_), 0);
  for (const UserBody& u : m.user) {
    if (u.nv == 0 || m.bodies[static_cast<std::size_t>(u.sweep)].kind == BodyKernel::rotor) continue;
    const int shape = u.hinge->shape;
    if (u.parent < 0 && shape == CARDAN_SHAPE_FREE_BODY) continue;  // M is in its axes
    for (int j = 0; j < u.nv; ++j) matters_[static_cast<std::size_t>(u.v + j)] = u.v_units[static_cast<std::size_t>(j)] == "m/s" ? 2 : 1;
    if (u.parent < 0 && shape == CARDAN_SHAPE_FREE) std::fill_n(matters_.begin() + u.v + 3, 3, std::uint8_t{0});
  }
  for (const int i : m.curved) {
    const UserBody& u = m.user[static_cast<std::size_t>(i)];
    curved_.push_back({u.q, u.v, u.nq, u.nv, static_cast<int>(u.hinge->shape), &u});
  }
  x_.resize(static_cast<std::size_t>(nq_ + nv_ + nz_));
  for (auto* x : {&travel_, &rate_, &u_, &du_, &difference_, &whole_, &v_}) x->resize(static_cast<std::size_t>(nv_));
  qdot_.resize(static_cast<std::size_t>(nq_)), y_.resize(static_cast<std::size_t>(nq_));
  for (auto& r : past_) r.resize(static_cast<std::size_t>(size()));
  for (auto& r : drive_) r.resize(static_cast<std::size_t>(nv_));
}

Vec3<double> VehicleLinearPart::turned(const Hinge& hinge, const double* q) const {
  std::array<double, 6> d{};
  hinge.user->hinge->difference(hinge.user->hinge_packed.data(), x_.data() + hinge.q, q + hinge.q, d.data());
  return vec(d.data());
}

bool VehicleLinearPart::moved(const double* q) const {
  model_->difference(frozen_.where(), q, difference_.data());
  for (std::size_t i = 0; i < matters_.size(); ++i)
    if (matters_[i] != 0 && !(std::abs(difference_[i]) < (matters_[i] == 2 ? kWay : kTurn))) return true;
  return false;
}

void VehicleLinearPart::centre(double t, const double* x, const double* xdot) {
  std::copy_n(x, x_.size(), x_.begin());
  frozen_.set_rounding(8.0 * std::numeric_limits<double>::epsilon() * std::abs(t));
  ++since_;
  const double *q = x, *v = x + nq_;
  if (devices_) {
    for (std::vector<double>* all : {&at_hinges_.stiffness, &at_hinges_.damping}) all->assign(static_cast<std::size_t>(nv_), 0.0);
    devices_->add_at_hinges(at_hinges_.stiffness.data(), at_hinges_.damping.data());
  }
  const FrozenVehicle::AtHinges* at_hinges = devices_ ? &at_hinges_ : nullptr;
  if (!frozen_.where() || frozen_.holds_others() || (!model_->varies.empty() && since_ > kVarying) || moved(q) || frozen_.spun(v) ||
      frozen_.stiffened(q, v, at_hinges))
    frozen_.freeze(q, v, at_hinges), since_ = 0;
  // r without it is of what moves in the vehicle; with it, of its weight, whose rounding is above what modes are asked for.
  for (Hinge& h : curved_) {
    h.fall = {};
    if (h.user->parent >= 0 || (h.shape != CARDAN_SHAPE_FREE && h.shape != CARDAN_SHAPE_FREE_BODY) || !frozen_.floats(h.v + 3)) continue;
    h.fall = vec(xdot + nq_ + h.v + 3);
    if (h.shape == CARDAN_SHAPE_FREE_BODY) h.fall += cross(vec(v + h.v), vec(v + h.v + 3));
  }
}

void VehicleLinearPart::residual(const double* x, const double* xdot, double* r) const {
  const double *q = x, *v = q + nq_, *qdot = xdot, *vdot = qdot + nq_;
  std::copy_n(v, nv_, u_.begin()), std::copy_n(vdot, nv_, du_.begin());
  double* beyond = r + nv_;
  std::fill_n(beyond, nv_ + nq_, 0.0);
  for (const Hinge& h : curved_) {
    if (!has_quaternion_shape(h.shape)) {  // q' - N v, N at the centre
      h.user->hinge->qdot(h.user->hinge_packed.data(), x_.data() + h.q, v + h.v, qdot_.data());
      for (int i = 0; i < h.nq; ++i) beyond[nv_ + h.q + i] = qdot[h.q + i] - qdot_[static_cast<std::size_t>(i)];
      continue;
    }
    const Vec3<double> theta = turned(h, q), omega = vec(v + h.v);
    store(rate_of_rotation(theta, omega) - omega, beyond + h.v);
    if (h.shape == CARDAN_SHAPE_BALL) continue;
    if (h.shape == CARDAN_SHAPE_FREE_BODY) {
      const Mat3<double> R = exponential(theta);  // its velocity along the axes of the centre
      const Vec3<double> along = vec(v + h.v + 3);
      store(R * along, u_.data() + h.v + 3);
      store(R * (vec(vdot + h.v + 3) + cross(omega, along)), du_.data() + h.v + 3);
    }
    store(vec(du_.data() + h.v + 3) - h.fall, du_.data() + h.v + 3);
  }
  frozen_.force(q, u_.data(), du_.data(), r);
  std::copy_n(vdot + nv_, nz_, beyond + nv_ + nq_);
}

void VehicleLinearPart::divide(int pieces) {
  pieces_ = pieces;
  starts_.resize(std::max(starts_.size(), static_cast<std::size_t>(2 * nv_ * pieces)));
}

void VehicleLinearPart::advance(double h, const std::array<const double*, 3>& r, double* x) {
  h_ = h;
  for (std::size_t i = 0; i < 3; ++i) std::copy_n(r[i], past_[i].size(), past_[i].begin());
  go(0);
  if (pieces_ > 1) std::copy_n(travel_.begin(), nv_, whole_.begin());
  for (int k = 1; k < pieces_; ++k) {
    double* start = starts_.data() + 2 * nv_ * k;
    std::copy_n(whole_.begin(), nv_, start), std::copy_n(rate_.begin(), nv_, start + nv_);
    go(k);
    for (std::size_t i = 0; i < whole_.size(); ++i) whole_[i] += travel_[i];
  }
  if (pieces_ > 1) travel_ = whole_;
  assemble(h, 1.0, x);
}

void VehicleLinearPart::go(int piece) {
  redone_ = piece;
  const double *y = x_.data(), *u = x_.data() + nq_;
  if (pieces_ == 1) return frozen_.advance(h_, y, u, {past_[0].data(), past_[1].data(), past_[2].data()}, travel_.data(), rate_.data());
  const double share = 1.0 / pieces_, s = piece * share;
  for (std::size_t i = 0; i < v_.size(); ++i) {
    drive_[0][i] = past_[0][i] + s * (past_[1][i] + s * past_[2][i]);
    drive_[1][i] = share * (past_[1][i] + 2.0 * s * past_[2][i]);
    drive_[2][i] = share * share * past_[2][i];
  }
  if (piece > 0) {
    const double* start = starts_.data() + 2 * nv_ * piece;
    std::copy_n(y, nq_, y_.begin()), std::copy_n(start + nv_, nv_, v_.begin());
    for (const PlainRates& p : model_->plain_rates)
      for (int i = 0; i < p.n; ++i) y_[static_cast<std::size_t>(p.q + i)] += start[p.v + i];
    y = y_.data(), u = v_.data();
  }
  frozen_.advance(share * h_, y, u, {drive_[0].data(), drive_[1].data(), drive_[2].data()}, travel_.data(), rate_.data());
}

void VehicleLinearPart::inside(double s, double* x) {
  const int piece = std::min(static_cast<int>(s * pieces_), pieces_ - 1);
  const double within = s * pieces_ - piece, *start = starts_.data() + 2 * nv_ * piece;
  if (piece > 0 && within == 0.0) {
    std::copy_n(start, nv_, travel_.begin()), std::copy_n(start + nv_, nv_, rate_.begin());
  } else {
    if (piece != redone_) go(piece);
    frozen_.inside(within, travel_.data(), rate_.data());
    for (std::size_t i = 0; piece > 0 && i < travel_.size(); ++i) travel_[i] += start[i];
  }
  assemble(h_, s, x);
}

/// x from travel_, rate_ and the integrals of what is beyond forces.
void VehicleLinearPart::assemble(double h, double s, double* x) const {
  const auto beyond = [&](int i) {
    const auto k = static_cast<std::size_t>(nv_ + i);
    return h * s * (past_[0][k] + s * (past_[1][k] / 2 + s * past_[2][k] / 3));
  };
  std::copy_n(x_.data(), nq_, x);
  double* v = x + nq_;
  std::copy_n(x_.data() + nq_, nv_, v);
  for (const PlainRates& p : model_->plain_rates)
    for (int i = 0; i < p.n; ++i) x[p.q + i] += travel_[static_cast<std::size_t>(p.v + i)];
  for (int i = 0; i < nv_; ++i)
    if (!model_->has_prescribed() || model_->prescribed[static_cast<std::size_t>(i)] == 0) v[i] = rate_[static_cast<std::size_t>(i)];
  for (const Hinge& hinge : curved_) {
    double* q = x + hinge.q;
    const double *travel = travel_.data() + hinge.v, *rate = rate_.data() + hinge.v;
    if (!has_quaternion_shape(hinge.shape)) {
      hinge.user->hinge->qdot(hinge.user->hinge_packed.data(), x_.data() + hinge.q, travel, qdot_.data());
      for (int i = 0; i < hinge.nq; ++i) q[i] += qdot_[static_cast<std::size_t>(i)] + beyond(nv_ + hinge.q + i);
      continue;
    }
    std::array<double, 6> way{};
    std::copy_n(travel, hinge.nv, way.begin());
    for (int i = 0; i < 3; ++i) way[static_cast<std::size_t>(i)] += beyond(hinge.v + i);
    const Vec3<double> faster = h * s * hinge.fall;
    store(vec(way.data() + 3) + 0.5 * h * s * faster, way.data() + 3);
    hinge.user->hinge->retract(hinge.user->hinge_packed.data(), x_.data() + hinge.q, way.data(), q);
    if (hinge.shape == CARDAN_SHAPE_BALL) continue;
    const Vec3<double> along = vec(rate + 3) + faster;
    store(hinge.shape == CARDAN_SHAPE_FREE_BODY ? transpose_times(exponential(vec(way.data())), along) : along, v + hinge.v + 3);
  }
  for (int i = 0; i < nz_; ++i) v[nv_ + i] = x_[static_cast<std::size_t>(nq_ + nv_ + i)] + beyond(nv_ + nq_ + i);
}

void VehicleLinearPart::spread(const auto& beyond, double* e) {
  std::fill_n(e, x_.size(), 0.0);
  for (const PlainRates& p : model_->plain_rates) std::copy_n(travel_.data() + p.v, p.n, e + p.q);
  std::copy_n(rate_.data(), nv_, e + nq_);
  for (const Hinge& hinge : curved_) {
    const double* travel = travel_.data() + hinge.v;
    if (!has_quaternion_shape(hinge.shape)) {
      hinge.user->hinge->qdot(hinge.user->hinge_packed.data(), x_.data() + hinge.q, travel, e + hinge.q);
      for (int i = 0; i < hinge.nq; ++i) e[hinge.q + i] += beyond(nv_ + hinge.q + i);
      continue;
    }
    for (int i = 0; i < 3; ++i) e[hinge.q + 1 + i] = 0.5 * (travel[i] + beyond(hinge.v + i));
    if (hinge.shape != CARDAN_SHAPE_BALL) std::copy_n(travel + 3, 3, e + hinge.q + 4);
  }
  for (int i = 0; i < nz_; ++i) e[nq_ + nv_ + i] = beyond(nv_ + nq_ + i);
}

void VehicleLinearPart::effect(double h, const std::array<const double*, 3>& r, double* e) {
  redone_ = -1;
  frozen_.advance(h, nullptr, nullptr, r, travel_.data(), rate_.data());
  spread([&](int i) { return h * (r[0][nv_ + i] + r[1][nv_ + i] / 2 + r[2][nv_ + i] / 3); }, e);
}

bool VehicleLinearPart::last_terms(double* e, double* lost) {
  const auto none = [](int) { return 0.0; };
  if (!frozen_.last_terms(travel_.data(), rate_.data(), false)) return false;
  spread(none, e);
  frozen_.last_terms(travel_.data(), rate_.data(), true);
  spread(none, lost);
  return true;
}

void VehicleLinearPart::leave_out(double h, double* e) const {
  frozen_.each_flexible([&](int eta, int etadot, std::span<const Oscillator> modes) {
    for (std::size_t k = 0; k < modes.size(); ++k)
      if (modes[k].frequency * h > kResolved) e[eta + static_cast<int>(k)] = e[nq_ + etadot + static_cast<int>(k)] = 0.0;
  });
}

void VehicleLinearPart::sizes(const double* x, double* size) const {
  for (std::size_t i = 0; i < x_.size(); ++i) size[i] = std::abs(x[i]);
  frozen_.each_flexible([&](int eta, int etadot, std::span<const Oscillator> modes) {  // of all its modes together
    double sum = 0.0;
    int k = 0;
    for (const Oscillator& mode : modes) sum += std::pow(mode.frequency * x[eta + k], 2) + std::pow(x[nq_ + etadot + k], 2), ++k;
    const double amplitude = std::sqrt(sum);
    k = 0;
    for (const Oscillator& mode : modes) size[eta + k] = amplitude / mode.frequency, size[nq_ + etadot + k] = amplitude, ++k;
  });
}

double VehicleLinearPart::longest_step() const {
  return frozen_.fastest() > 0.0 ? kSwings / frozen_.fastest() : std::numeric_limits<double>::infinity();
}

}  // namespace cardan
