#include "core/sim/frozen_vehicle.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "core/dynamics/hinge_laws.hpp"
#include "core/linalg/dense.hpp"

namespace cardan {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
constexpr std::size_t kSteps = 8;      // lengths of steps that are kept
constexpr double kNutation = 0.05;     // [rad/s] momentum of a rotor over the moment of inertia of its carrier, from which on it is fast
constexpr double kOtherSpeed = 0.05;   // of its speed, after which a fast one is frozen anew
constexpr double kOtherTangent = 0.1;  // of the stiffness or damping of what acts at a hinge, likewise

MatrixXd full(const Stream& of, int m, bool diagonal) {
  if (diagonal) return VectorXd::Map(of.data(), m).asDiagonal();
  return MatrixXd::Map(of.data(), m, m);
}

/// Legendre coefficients of r[0] + r[1] s + r[2] s^2.
std::array<double, 3> series(double r0, double r1, double r2) { return {r0 + r1 / 2 + r2 / 3, (r1 + r2) / 2, r2 / 6}; }

}  // namespace

FrozenVehicle::FrozenVehicle(std::shared_ptr<const Model> model, bool gyroscopic) : model_(std::move(model)), tree_(model_) {
  const Model& m = *model_;
  std::vector<bool> moves_others(m.bodies.size(), false);  // its modes do, or its pnode
  for (const SweepBody& b : m.bodies) {
    if (b.onode >= 0) moves_others[static_cast<std::size_t>(b.parent)] = true;
    if (b.pnode >= 0) moves_others[static_cast<std::size_t>(&b - m.bodies.data())] = true;
  }
  std::size_t largest = 0;
  for (const operators::OperatorBody& o : tree_.bodies()) {
    const SweepBody& s = m.bodies[static_cast<std::size_t>(o.sweep)];
    Body b;
    b.parent = o.parent, b.m = o.m, b.eta = s.eta, b.etadot = s.etadot, b.first_mode = n_modes_;
    if (gyroscopic && s.kind == BodyKernel::rotor) b.rotor = s.v;
    const bool given = m.has_prescribed() && std::any_of(m.prescribed.begin() + s.etadot, m.prescribed.begin() + s.etadot + o.m,
                                                         [](std::uint8_t fixed) { return fixed != 0; });
    if (o.m > 0 && !given && !moves_others[static_cast<std::size_t>(o.sweep)])
      make_modes(b, m.flexible[static_cast<std::size_t>(s.flexible)]);
    if (b.in_closed_form) {
      n_modes_ += b.m;
      for (const Oscillator& mode : b.modes) fastest_ = std::max(fastest_, mode.frequency);
    } else {
      b.size = 6 + b.m;
    }
    largest = std::max(largest, static_cast<std::size_t>(b.m));
    bodies_.push_back(std::move(b));
  }
  steps_.reserve(kSteps);
  P_.resize(bodies_.size()), Z_.resize(bodies_.size()), delta_.resize(bodies_.size()), Gamma_.resize(bodies_.size()),
      eps_.resize(bodies_.size());
  a_.resize(bodies_.size()), f_.resize(bodies_.size()), V_.resize(bodies_.size());
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const int size = bodies_[i].size;
    Z_[i].setZero(size, kDegrees), delta_[i].setZero(size, kDegrees), a_[i].setZero(size), f_[i].setZero(size), V_[i].setZero(size);
  }
  for (VectorXd* x : {&xi_, &xi_rate_, &xi_acceleration_}) x->setZero(static_cast<Eigen::Index>(largest));
  u_.resize(static_cast<std::size_t>(m.nv));
  causes_.setZero(OscillatorTable::kCauses, n_modes_);
}

/// Modes of the body by itself, its frame held: those that are given where M_ee = 1 and K, C are diagonal.
void FrozenVehicle::make_modes(Body& b, const FlexibleBody& f) const {
  const MatrixXd K = full(f.K, b.m, f.K_diagonal), C = full(f.C, b.m, f.K_diagonal);
  VectorXd squares = K.diagonal(), rates = C.diagonal();
  if (!f.K_diagonal || !f.M_ee_identity) {
    const MatrixXd M_ee = MatrixXd::Map(f.M_ee.data(), b.m, b.m);
    const auto pairs = modal_pairs(K, M_ee);
    if (!pairs) return;
    squares = pairs->values;
    b.shape = pairs->vectors;
    b.to_xi = b.shape.transpose() * M_ee;
    rates = (b.shape.transpose() * C * b.shape).diagonal();
  }
  for (int k = 0; k < b.m; ++k) {
    const double omega = squares[k] > 0.0 ? std::sqrt(squares[k]) : 0.0, zeta = omega > 0.0 ? 0.5 * rates[k] / omega : 1.0;
    if (!(zeta >= 0.0 && zeta < 0.999)) return;  // coordinates like those of hinges, then
    b.modes.push_back({omega, zeta});
  }
  b.in_closed_form = true;
}

bool FrozenVehicle::holds_others() const { return held_ != model_->prescribed; }

void FrozenVehicle::freeze(const double* at_q, const double* at_v, const AtHinges* devices) {
  held_ = model_->prescribed;
  look_at_hinges(at_q, at_v, devices);
  std::swap(beside_, now_);
  freeze_held(at_q, at_v);
}

/// What drives away is left out: the vehicle that is frozen gains no energy.
void FrozenVehicle::look_at_hinges(const double* q, const double* v, const AtHinges* devices) {
  const auto none = [&](std::vector<double>& x) { x.assign(static_cast<std::size_t>(model_->nv), 0.0); };
  none(now_.stiffness), none(now_.damping);
  if (devices) now_ = *devices;
  for (const HingeLoad& load : model_->loads) {
    if (load.law == HingeLaw::spring) continue;
    const hinge_laws::Linear linear = hinge_laws::linear(load, q[load.q], v[load.v]);
    now_.stiffness[static_cast<std::size_t>(load.v)] += linear.stiffness, now_.damping[static_cast<std::size_t>(load.v)] += linear.damping;
  }
  for (std::vector<double>* all : {&now_.stiffness, &now_.damping})
    for (double& x : *all) x = x > 0.0 && std::isfinite(x) ? x : 0.0;
}

bool FrozenVehicle::stiffened(const double* q, const double* v, const AtHinges* devices) {
  look_at_hinges(q, v, devices);
  const auto other = [](double now, double then) { return std::abs(now - then) > kOtherTangent * std::max(now, then); };
  return !std::ranges::equal(now_.stiffness, beside_.stiffness, std::not_fn(other)) ||
         !std::ranges::equal(now_.damping, beside_.damping, std::not_fn(other));
}

void FrozenVehicle::freeze_held(const double* at_q, const double* at_v) {
  const Model& m = *model_;
  tree_.at(at_q);
  ++frozen_;
  at_.assign(at_q, at_q + m.nq), at_.insert(at_.end(), at_v, at_v + m.nv);
  std::vector<int> coordinate(static_cast<std::size_t>(m.nv), -1);
  for (const PlainRates& r : m.plain_rates)
    for (int i = 0; i < r.n; ++i) coordinate[static_cast<std::size_t>(r.v + i)] = r.q + i;
  for (Body& b : bodies_) b.wide_inside = b.in_closed_form;
  spinning_ = false;
  for (std::size_t i = bodies_.size(); i-- > 0;) {
    Body& b = bodies_[i];
    const operators::OperatorBody& o = tree_.bodies()[i];
    const int block = static_cast<int>(i);
    b.v.clear(), b.y.clear(), b.column.clear();
    const auto take = [&](int v, int column) {
      if (!held_.empty() && held_[static_cast<std::size_t>(v)]) return;
      b.v.push_back(v), b.y.push_back(coordinate[static_cast<std::size_t>(v)]), b.column.push_back(column);
    };
    for (int c = 0; c < o.nh; ++c) take(o.v + c, c);
    for (int k = 0; !b.in_closed_form && k < b.m; ++k) take(b.etadot + k, o.nh + k);
    const MatrixXd& Ht = tree_.Ht_all(block);
    const auto n = static_cast<Eigen::Index>(b.v.size());
    b.Ht.resize(b.size, n);
    for (Eigen::Index c = 0; c < n; ++c) b.Ht.col(c) = Ht.col(b.column[static_cast<std::size_t>(c)]).head(b.size);
    b.A = tree_.A(block).leftCols(b.parent < 0 ? 6 : bodies_[static_cast<std::size_t>(b.parent)].size);
    const MatrixXd& M = tree_.M(block);
    b.M = M.topLeftCorner(b.size, b.size);
    if (b.in_closed_form) {
      b.Mre = M.topRightCorner(6, b.m);
      if (b.shape.size() > 0) b.Mre = b.Mre * b.shape;
    }
    b.K.setZero(n, n), b.C.setZero(n, n);
    for (const HingeLoad& load : m.loads) {
      const auto found = std::ranges::find(b.v, load.v);
      if (load.law != HingeLaw::spring || found == b.v.end()) continue;
      const hinge_laws::Linear linear = hinge_laws::linear(load, at_q[load.q], at_v[load.v]);
      const auto c = found - b.v.begin();
      b.K(c, c) += linear.stiffness, b.C(c, c) += linear.damping;
    }
    if (!b.in_closed_form && b.m > 0) {
      const FlexibleBody& f = m.flexible[static_cast<std::size_t>(m.bodies[static_cast<std::size_t>(o.sweep)].flexible)];
      const MatrixXd K = full(f.K, b.m, f.K_diagonal), C = full(f.C, b.m, f.K_diagonal);
      for (Eigen::Index r = 0; r < n; ++r)
        for (Eigen::Index c = 0; c < n; ++c) {
          const int j = b.column[static_cast<std::size_t>(r)] - o.nh, k = b.column[static_cast<std::size_t>(c)] - o.nh;
          if (j >= 0 && k >= 0) b.K(r, c) += K(j, k), b.C(r, c) += C(j, k);
        }
    }
    for (Eigen::Index c = 0; c < n; ++c) {
      const auto v = static_cast<std::size_t>(b.v[static_cast<std::size_t>(c)]);
      if (b.y[static_cast<std::size_t>(c)] >= 0) b.K(c, c) += beside_.stiffness[v];
      b.C(c, c) += beside_.damping[v];
    }
    if (b.rotor >= 0) spin(b, block, at_v[b.rotor]);
    b.wide = b.wide_inside || !b.K.isZero(0.0) || !b.C.isZero(0.0);
    if (b.wide && b.parent >= 0) bodies_[static_cast<std::size_t>(b.parent)].wide_inside = true;
    Gamma_[i].setZero(n, kDegrees);
  }
}

/// Its carrier turns it against omega x h, h its momentum about its axis. A slow one has no part in C.
void FrozenVehicle::spin(Body& b, int block, double speed) {
  const Eigen::Vector3d h = tree_.M(block).topLeftCorner<3, 3>() * tree_.Ht_all(block).col(0).head<3>();
  b.per_speed = 3.0 * h.norm() / tree_.M(b.parent).topLeftCorner<3, 3>().trace();
  b.fast = std::abs(b.per_speed * speed) > kNutation;
  if (!b.fast) return;
  b.gyroscopic << 0.0, h[2], -h[1], -h[2], 0.0, h[0], h[1], -h[0], 0.0;
  b.gyroscopic *= speed;
  b.wide_inside = spinning_ = true;
}

bool FrozenVehicle::spun(const double* v) const {
  return std::ranges::any_of(bodies_, [&](const Body& b) {
    if (b.rotor < 0) return false;
    const double then = at_[static_cast<std::size_t>(model_->nq + b.rotor)],
                 allowed = std::max(kNutation, kOtherSpeed * b.per_speed * std::abs(then));
    return b.per_speed * std::abs(v[b.rotor] - then) > allowed;
  });
}

bool FrozenVehicle::floats(int v) const {
  for (const Body& b : bodies_)
    if (const auto first = std::ranges::find(b.v, v); first != b.v.end()) {
      const auto at = first - b.v.begin();
      return b.v.end() - first >= 3 && first[2] == v + 2 && b.K.middleRows(at, 3).isZero(0.0) && b.C.middleRows(at, 3).isZero(0.0);
    }
  return false;
}

void FrozenVehicle::move(const double* u) const {
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const Body& b = bodies_[i];
    V_[i].setZero();
    if (b.parent >= 0) V_[i].head<6>().noalias() = b.A * V_[static_cast<std::size_t>(b.parent)];
    for (std::size_t c = 0; c < b.v.size(); ++c) V_[i] += u[b.v[c]] * b.Ht.col(static_cast<Eigen::Index>(c));
  }
}

void FrozenVehicle::to_modes(const Body& b, const double* eta, VectorXd& xi) const {
  const auto given = VectorXd::Map(eta, b.m);
  if (b.to_xi.size() > 0)
    xi.head(b.m).noalias() = b.to_xi * given;
  else
    xi.head(b.m) = given;
}

void FrozenVehicle::from_modes(const Body& b, VectorXd& xi, double* eta) const {
  auto out = VectorXd::Map(eta, b.m);
  if (b.shape.size() > 0)
    out.noalias() = b.shape * xi.head(b.m);
  else
    out = xi.head(b.m);
}

// r of modes in closed form is that of xi.
void FrozenVehicle::force(const double* y, const double* u, const double* du, double* r) const {
  std::fill_n(r, model_->nv, 0.0);
  if (spinning_) move(u);
  const auto N = bodies_.size();
  for (std::size_t i = 0; i < N; ++i) {
    const Body& b = bodies_[i];
    VectorXd& a = a_[i];
    a.setZero();
    if (b.parent >= 0) a.head<6>().noalias() = b.A * a_[static_cast<std::size_t>(b.parent)];
    for (std::size_t c = 0; c < b.v.size(); ++c) a += du[b.v[c]] * b.Ht.col(static_cast<Eigen::Index>(c));
    f_[i].noalias() = b.M * a;
    if (b.fast) f_[i].head<3>().noalias() += b.gyroscopic * V_[i].head<3>();
    if (!b.in_closed_form) continue;
    to_modes(b, y + b.eta, xi_), to_modes(b, u + b.etadot, xi_rate_), to_modes(b, du + b.etadot, xi_acceleration_);
    f_[i].noalias() += b.Mre * xi_acceleration_.head(b.m);
    for (int k = 0; k < b.m; ++k) {
      const Oscillator& o = b.modes[static_cast<std::size_t>(k)];
      r[b.etadot + k] = b.Mre.col(k).dot(a) + xi_acceleration_[k] + o.frequency * (o.frequency * xi_[k] + 2.0 * o.damping * xi_rate_[k]);
    }
  }
  for (std::size_t i = N; i-- > 0;) {
    const Body& b = bodies_[i];
    for (std::size_t c = 0; c < b.v.size(); ++c) {
      const auto row = static_cast<Eigen::Index>(c);
      double sum = b.Ht.col(row).dot(f_[i]);
      if (b.wide)
        for (std::size_t d = 0; d < b.v.size(); ++d) {
          const auto column = static_cast<Eigen::Index>(d);
          sum += b.C(row, column) * u[b.v[d]] + (b.y[d] >= 0 ? b.K(row, column) * y[b.y[d]] : 0.0);
        }
      r[b.v[c]] = sum;
    }
    if (b.parent >= 0) f_[static_cast<std::size_t>(b.parent)].noalias() += b.A.transpose() * f_[i].head<6>();
  }
}

/// The one that is kept for this length but for rounding, or the one that was used longest ago.
FrozenVehicle::Step& FrozenVehicle::step_of(double h) {
  const auto known =
      std::ranges::find_if(steps_, [&](const Step& s) { return std::abs(s.h - h) <= std::max(1e-13 * h, std::min(rounding_, 1e-6 * h)); });
  if (known != steps_.end()) {
    known->used = ++used_;
    if (known->frozen != frozen_) factor(*known);
    return *known;
  }
  if (steps_.size() < kSteps) steps_.emplace_back();
  Step& step = steps_.back().h == 0.0 ? steps_.back() : *std::ranges::min_element(steps_, {}, &Step::used);
  fill(step, h);
  step.used = ++used_;
  factor(step);
  return step;
}

void FrozenVehicle::fill(Step& step, double h) const {
  step.h = h, step.frozen = -1;
  step.tables.clear();
  for (const Body& b : bodies_)
    if (b.in_closed_form)
      for (const Oscillator& mode : b.modes) step.tables.emplace_back(mode, h);
}

void FrozenVehicle::remember(Archive& archive) {
  std::vector<double> at = at_, h;
  std::vector<long> used;
  for (const Step& s : steps_) h.push_back(s.h), used.push_back(s.used);
  std::vector<std::uint8_t> held = held_;
  AtHinges beside = beside_;
  archive(at, held, beside.stiffness, beside.damping, h, used, used_);
  if (!archive.reading()) return;
  const auto all = static_cast<std::size_t>(model_->nq + model_->nv), rates = static_cast<std::size_t>(model_->nv);
  if ((!at.empty() && at.size() != all) || (!held.empty() && held.size() != rates) ||
      (!at.empty() && (beside.stiffness.size() != rates || beside.damping.size() != rates)) || h.size() > kSteps || used.size() != h.size())
    archive.wrong("it is of another model");
  beside_ = std::move(beside);
  held_ = held;  // what is held at this instant may be other components: then it is frozen anew
  if (!at.empty()) freeze_held(at.data(), at.data() + model_->nq);
  steps_.clear();
  for (std::size_t i = 0; i < h.size(); ++i) {
    if (!(h[i] > 0.0 && h[i] * fastest_ < 1e6)) archive.wrong("a length of a step is none");
    steps_.emplace_back();
    fill(steps_.back(), h[i]);
    steps_.back().used = used[i];
  }
}

void FrozenVehicle::factor(Step& step) {
  const double h = step.h;
  step.frozen = frozen_;
  step.factors.resize(bodies_.size());
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const Body& b = bodies_[i];
    const int degrees = b.wide ? kDegrees : 1, size = b.size;
    MatrixXd& P = P_[i];
    P.setZero(size * degrees, size * degrees);
    MatrixXd own = b.M;
    if (b.in_closed_form) own.noalias() -= b.Mre * b.Mre.transpose();
    for (int d = 0; d < degrees; ++d) P.block(size * d, size * d, size, size) = own;
    for (int k = 0; b.in_closed_form && k < b.m; ++k) {
      const OscillatorTable& table = step.tables[static_cast<std::size_t>(b.first_mode + k)];
      const Matrix6 outer = b.Mre.col(k) * b.Mre.col(k).transpose();
      for (int r = 0; r < kDegrees; ++r)
        for (int c = 0; c < kDegrees; ++c) P.block<6, 6>(6 * r, 6 * c) += table.force_of_carrier(r, c) * outer;
    }
    if (!b.fast) continue;
    for (int r = 0; r < kDegrees; ++r)
      for (int c = 0; c < kDegrees; ++c) P.block<3, 3>(6 * r, 6 * c) += h * integral_of_legendre(r, c) * b.gyroscopic;
  }
  for (std::size_t i = bodies_.size(); i-- > 0;) {
    const Body& b = bodies_[i];
    Factor& factor = step.factors[i];
    const int degrees = b.wide ? kDegrees : 1, size = b.size, n = static_cast<int>(b.v.size());
    const MatrixXd& P = P_[i];
    MatrixXd plus(6 * degrees, 6 * degrees);
    for (int r = 0; r < degrees; ++r)
      for (int c = 0; c < degrees; ++c) plus.block<6, 6>(6 * r, 6 * c) = P.block<6, 6>(size * r, size * c);
    if (n > 0) {
      MatrixXd D(n * degrees, n * degrees), back(n * degrees, 6 * degrees);
      factor.gain.resize(6 * degrees, n * degrees);
      MatrixXd PH(size, n), HP(n, size);
      for (int r = 0; r < degrees; ++r)
        for (int c = 0; c < degrees; ++c) {
          PH.noalias() = P.block(size * r, size * c, size, size) * b.Ht;
          HP.noalias() = b.Ht.transpose() * P.block(size * r, size * c, size, size);
          D.block(n * r, n * c, n, n).noalias() = b.Ht.transpose() * PH;
          factor.gain.block(6 * r, n * c, 6, n) = PH.topRows(6);
          back.block(n * r, 6 * c, n, 6) = HP.leftCols(6);
          if (!b.wide) continue;
          double twice = 0.0;  // of the integral of the integral
          for (int k = 0; k < kDegrees; ++k) twice += integral_of_legendre(r, k) * integral_of_legendre(k, c);
          D.block(n * r, n * c, n, n) += h * integral_of_legendre(r, c) * b.C + h * h * twice * b.K;
        }
      factor.D_inverse = inverse(D);
      if (b.parent >= 0) {
        factor.back.noalias() = factor.D_inverse * back;
        plus.noalias() -= factor.gain * factor.back;
      }
    }
    if (b.parent < 0) continue;
    const Body& inboard = bodies_[static_cast<std::size_t>(b.parent)];
    MatrixXd& P_in = P_[static_cast<std::size_t>(b.parent)];
    const int s = inboard.size, in_degrees = inboard.wide ? kDegrees : 1;
    if (b.wide) {
      for (int r = 0; r < kDegrees; ++r)
        for (int c = 0; c < kDegrees; ++c)
          P_in.block(s * r, s * c, s, s).noalias() += b.A.transpose() * plus.block<6, 6>(6 * r, 6 * c) * b.A;
    } else {
      const MatrixXd at_inboard = b.A.transpose() * plus * b.A;
      for (int d = 0; d < in_degrees; ++d) P_in.block(s * d, s * d, s, s) += at_inboard;
    }
  }
}

void FrozenVehicle::advance(double h, const double* y, const double* u, const Drive& r, double* travel, double* rate) {
  const Step& step = step_of(h);
  step_ = &step;
  const auto N = bodies_.size();
  std::fill_n(travel, model_->nv, 0.0), std::fill_n(rate, model_->nv, 0.0);
  if (u)
    std::copy_n(u, u_.size(), u_.begin());
  else
    std::ranges::fill(u_, 0.0);
  const auto drive = [&](int i) { return series(r[0][i], r[1][i], r[2][i]); };
  if (spinning_) move(u_.data());
  for (std::size_t i = 0; i < N; ++i) {
    const Body& b = bodies_[i];
    Z_[i].setZero();
    if (b.fast) Z_[i].col(0).head<3>().noalias() += b.gyroscopic * V_[i].head<3>();
    if (!b.in_closed_form) continue;
    if (u)
      to_modes(b, y + b.eta, xi_), to_modes(b, u + b.etadot, xi_rate_);
    else
      xi_.setZero(), xi_rate_.setZero();
    for (int k = 0; k < b.m; ++k) {
      const OscillatorTable& table = step.tables[static_cast<std::size_t>(b.first_mode + k)];
      const auto F = drive(b.etadot + k);
      auto cause = causes_.col(b.first_mode + k);
      cause.head<5>() << xi_[k], xi_rate_[k], F[0], F[1], F[2];
      const Eigen::Matrix<double, kDegrees, 1> force = table.force * cause.head<5>();
      Z_[i].topRows<6>().noalias() -= b.Mre.col(k).head<6>() * force.transpose();
    }
  }
  for (std::size_t i = N; i-- > 0;) {
    const Body& b = bodies_[i];
    const Factor& factor = step.factors[i];
    const auto n = static_cast<Eigen::Index>(b.v.size());
    Series& Gamma = Gamma_[i];
    Eigen::Matrix<double, 6, kDegrees> Z = Z_[i].topRows<6>();
    if (n > 0) {
      if (b.size == 6)
        for (Eigen::Index c = 0; c < n; ++c) Gamma.row(c).noalias() = -(b.Ht.col(c).head<6>().transpose() * Z_[i].topRows<6>());
      else
        Gamma = -b.Ht.transpose().lazyProduct(Z_[i]);
      for (Eigen::Index c = 0; c < n; ++c) {
        const auto F = drive(b.v[static_cast<std::size_t>(c)]);
        for (int d = 0; d < 3; ++d) Gamma(c, d) += F[static_cast<std::size_t>(d)];
        if (!b.wide || !u) continue;
        for (Eigen::Index e = 0; e < n; ++e) {
          const int y_e = b.y[static_cast<std::size_t>(e)];
          const double u_e = u[b.v[static_cast<std::size_t>(e)]];
          Gamma(c, 0) -= b.C(c, e) * u_e;
          if (y_e < 0) continue;  // of a quaternion: it is damped, and has no coordinate that a spring could hold
          Gamma(c, 0) -= b.K(c, e) * (y[y_e] + 0.5 * h * u_e);
          Gamma(c, 1) -= b.K(c, e) * 0.5 * h * u_e;
        }
      }
      Series& eps = eps_[i];
      eps = Gamma;
      if (b.wide) {
        VectorXd::Map(Gamma.data(), n * kDegrees).noalias() = factor.D_inverse * VectorXd::Map(eps.data(), n * kDegrees);
        if (b.parent >= 0) VectorXd::Map(Z.data(), 6 * kDegrees).noalias() += factor.gain * VectorXd::Map(Gamma.data(), n * kDegrees);
      } else {
        if (n == 1)
          Gamma *= factor.D_inverse(0, 0);
        else
          Gamma = factor.D_inverse.lazyProduct(eps);
        if (b.parent >= 0)
          for (Eigen::Index c = 0; c < n; ++c) Z.noalias() += factor.gain.col(c).head<6>() * Gamma.row(c);
      }
    }
    if (b.parent >= 0) {
      Series& inboard = Z_[static_cast<std::size_t>(b.parent)];
      if (b.A.cols() == 6)
        inboard.topRows<6>().noalias() += b.A.leftCols<6>().transpose() * Z;
      else
        inboard += b.A.transpose().lazyProduct(Z);
    }
  }
  for (std::size_t i = 0; i < N; ++i) {
    const Body& b = bodies_[i];
    const Factor& factor = step.factors[i];
    const auto n = static_cast<Eigen::Index>(b.v.size());
    Series& Gamma = Gamma_[i];
    delta_[i].setZero();
    if (b.parent >= 0) {
      const Series& inboard = delta_[static_cast<std::size_t>(b.parent)];
      Eigen::Matrix<double, 6, kDegrees> d;
      if (b.A.cols() == 6)
        d.noalias() = b.A.leftCols<6>() * inboard.topRows<6>();
      else
        d = b.A.lazyProduct(inboard);
      if (n > 0) {
        if (b.wide)
          VectorXd::Map(Gamma.data(), n * kDegrees).noalias() -= factor.back * VectorXd::Map(d.data(), 6 * kDegrees);
        else
          for (Eigen::Index c = 0; c < n; ++c) Gamma.row(c).noalias() -= factor.back.row(c).head<6>() * d;
      }
      delta_[i].topRows<6>() = d;
    }
    for (Eigen::Index c = 0; c < n; ++c)
      if (b.size == 6)
        delta_[i].topRows<6>().noalias() += b.Ht.col(c).head<6>() * Gamma.row(c);
      else
        delta_[i].noalias() += b.Ht.col(c) * Gamma.row(c);
    for (Eigen::Index c = 0; c < n; ++c) {
      const int v = b.v[static_cast<std::size_t>(c)];
      travel[v] = h * (u_[static_cast<std::size_t>(v)] + h * (Gamma(c, 0) / 2 - Gamma(c, 1) / 6));
      rate[v] = u_[static_cast<std::size_t>(v)] + h * Gamma(c, 0);
    }
    if (!b.in_closed_form) continue;
    for (int k = 0; k < b.m; ++k) {
      const OscillatorTable& table = step.tables[static_cast<std::size_t>(b.first_mode + k)];
      auto cause = causes_.col(b.first_mode + k);
      cause.tail<kDegrees>().noalias() = -(delta_[i].topRows<6>().transpose() * b.Mre.col(k).head<6>());
      const Eigen::Vector2d end = table.end * cause;
      xi_[k] = end[0] - cause[0], xi_rate_[k] = end[1];
    }
    from_modes(b, xi_, travel + b.etadot), from_modes(b, xi_rate_, rate + b.etadot);
  }
}

bool FrozenVehicle::last_terms(double* travel, double* rate, bool lost) const {
  // A swing that a step goes through many times has accelerations whose terms are 143/154 of those two degrees before, h times them 143/14
  // times four as large as its rate (exponential.md, 3.4).
  constexpr double kFalling = 0.5, kOfRate = 41.0;
  if (std::ranges::none_of(bodies_, &Body::wide)) return false;
  std::fill_n(travel, model_->nv, 0.0), std::fill_n(rate, model_->nv, 0.0);
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const Body& b = bodies_[i];
    for (std::size_t c = 0; c < b.v.size(); ++c) {
      const auto at = static_cast<Eigen::Index>(c);
      const auto v = static_cast<std::size_t>(b.v[c]);
      const double fifth = std::abs(Gamma_[i](at, kDegrees - 1)), third = std::abs(Gamma_[i](at, kDegrees - 3));
      double term = fifth + std::abs(Gamma_[i](at, kDegrees - 2));
      if (lost) {
        const bool held = !b.K.row(at).isZero(0.0) || !b.C.row(at).isZero(0.0);
        term = held && fifth > kFalling * third ? fifth / kOfRate : 0.0;
      }
      travel[v] = step_->h * step_->h * term, rate[v] = step_->h * term;
    }
  }
  return true;
}

void FrozenVehicle::inside(double s, double* travel, double* rate) const {
  const double h = step_->h;
  const Legendre P = legendre(s);
  std::array<double, kDegrees> once, twice{};  // integrals of P_j from the start of the step, over h and h^2
  std::array<double, kDegrees + 1> of{};       // the same once, up to degree kDegrees
  for (int j = 0; j <= kDegrees; ++j) {
    double sum = 0.0;
    for (int i = std::max(0, j - 1); i <= std::min(j + 1, kDegrees); ++i)
      sum += integral_of_legendre(i, j) * P[static_cast<std::size_t>(i)];
    of[static_cast<std::size_t>(j)] = sum;
  }
  {  // that of degree kDegrees needs the next polynomial
    const double x = 2.0 * s - 1.0, next = ((2 * kDegrees + 1) * x * P[kDegrees] - kDegrees * P[kDegrees - 1]) / (kDegrees + 1);
    of[kDegrees] = (next - P[kDegrees - 1]) / (2.0 * (2 * kDegrees + 1));
  }
  for (int j = 0; j < kDegrees; ++j) {
    once[static_cast<std::size_t>(j)] = of[static_cast<std::size_t>(j)];
    for (int i = std::max(0, j - 1); i <= j + 1; ++i)
      twice[static_cast<std::size_t>(j)] += integral_of_legendre(i, j) * of[static_cast<std::size_t>(i)];
  }
  std::fill_n(travel, model_->nv, 0.0), std::fill_n(rate, model_->nv, 0.0);
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const Body& b = bodies_[i];
    for (std::size_t c = 0; c < b.v.size(); ++c) {
      const auto v = static_cast<std::size_t>(b.v[c]);
      double turned = s * u_[v] * h, speed = u_[v];
      for (int j = 0; j < kDegrees; ++j) {
        const double gamma = Gamma_[i](static_cast<Eigen::Index>(c), j);
        turned += h * h * gamma * twice[static_cast<std::size_t>(j)], speed += h * gamma * once[static_cast<std::size_t>(j)];
      }
      travel[v] = turned, rate[v] = speed;
    }
    if (!b.in_closed_form) continue;
    for (int k = 0; k < b.m; ++k) {
      const OscillatorTable::Causes causes = causes_.col(b.first_mode + k);
      const auto [eta, eta_rate] = step_->tables[static_cast<std::size_t>(b.first_mode + k)].inside(s, causes);
      xi_[k] = eta - causes[0], xi_rate_[k] = eta_rate;
    }
    from_modes(b, xi_, travel + b.etadot), from_modes(b, xi_rate_, rate + b.etadot);
  }
}

}  // namespace cardan
