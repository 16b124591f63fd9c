#include "core/sim/vehicle_momentum_form.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/base/diagnostic.hpp"
#include "core/base/finite.hpp"
#include "core/spatial/rotation.hpp"

namespace cardan {
namespace {

using Vec = Vec3<double>;
constexpr int kMost = 60;  // iterations
constexpr double kEps = std::numeric_limits<double>::epsilon();
constexpr double kRounding = 32.0 * kEps;  // of the largest terms of a residual
constexpr double kFloor = 1e-13;           // of an error, where it need not go on falling

Mat3<double> attitude(const double* q) { return rotation_of_quaternion(q[0], q[1], q[2], q[3]); }
Vec vec_at(const double* a) { return {a[0], a[1], a[2]}; }
void put_at(const Vec& a, double* out) { out[0] = a.x, out[1] = a.y, out[2] = a.z; }

bool has_a_quaternion(const UserBody& u) {
  const auto shape = u.hinge->shape;
  return shape == CARDAN_SHAPE_BALL || shape == CARDAN_SHAPE_FREE || shape == CARDAN_SHAPE_FREE_BODY;
}

/// What a half of a step turns by, x = h omega / 2, and maps that stand between momenta at its ends and in its middle.
struct HalfTurn {
  Vec x;
  Mat3<double> R;           // exp(x~)
  double s, parallel, tan;  // sin|x| / |x|; (1 - s) / |x|^2; tan(|x| / 2) / |x|
  explicit HalfTurn(const Vec& by) : x(by) {
    const RotationCoefficients<double> c = rotation_coefficients(dot(x, x));
    R = rotation_of_vector(c, x);
    s = c.s, parallel = c.b;
    tan = c.a / c.s;
  }
  /// The symmetric part of the derivative of exp.
  Vec S(const Vec& a) const { return s * a + (parallel * dot(x, a)) * x; }
};

std::shared_ptr<const Model> honoured_tree(std::shared_ptr<const Model> model) {
  if (const std::string not_taken = VehicleMomentumForm::refusal(*model); !not_taken.empty())
    refuse(Code::unsupported, {"integrator.method"}, "a method that takes " + not_taken, "variational, which does not",
           "dopri5, dop853; auto finds one");
  return model;
}

}  // namespace

std::string VehicleMomentumForm::refusal(const Model& model) {
  if (!model.loops.empty()) return "closed loops";
  for (int i = 0; i < model.nv; ++i)
    if (model.has_given_motion(i)) return "given motions";
  if (const UserBody* u = model.find_curved_nodes()) return fmt::format("bodies whose type tells how their nodes move, as {}", u->name);
  for (const Device& d : model.devices.all)
    if (d.acts) return fmt::format("devices that act, as {}", d.name);
  if (model.changes()) return "masses that change";
  if (model.devices.n_z > 0) return "devices with states";
  for (const int i : model.curved) {
    const UserBody& u = model.user[static_cast<std::size_t>(i)];
    if (!has_a_quaternion(u)) return fmt::format("the hinge of {}, {}, whose rates are no rates of its coordinates", u.name, u.hinge_type);
  }
  return {};
}

VehicleMomentumForm::VehicleMomentumForm(std::shared_ptr<const Model> model, Loads loads, Guard guard)
    : model_(honoured_tree(std::move(model))),
      loads_(std::move(loads)),
      guard_(std::move(guard)),
      nq_(model_->nq),
      nv_(model_->nv),
      tree_of_(model_->bodies.size(), -1),
      momenta_(*model_),
      ws_(*model_),
      inertia_(*model_),
      moments_(model_->bodies.size()) {
  const Model& m = *model_;
  for (const int i : m.curved) {
    const UserBody& u = m.user[static_cast<std::size_t>(i)];
    const bool floats = u.parent < 0 && u.hinge->shape != CARDAN_SHAPE_BALL;
    hinges_.push_back({u.q, u.v, static_cast<int>(u.hinge->shape), &u, floats ? static_cast<int>(floating_.size()) : -1});
    if (!floats) continue;
    tree_of_[static_cast<std::size_t>(u.sweep)] = static_cast<int>(floating_.size());
    floating_.push_back({u.sweep, u.q + 4, u.v + 3, u.hinge->shape == CARDAN_SHAPE_FREE_BODY, 0.0, {}});
    for (const HingeLoad& load : m.loads) placed_ = placed_ || (load.v >= u.v && load.v < u.v + 6);
  }
  placed_ = placed_ || m.field.pulls() || m.gravity.kind != GravitySpec::Kind::none;
  for (std::size_t k = 1; k < m.bodies.size(); ++k) {
    const SweepBody& b = m.bodies[k];
    if (tree_of_[k] < 0) tree_of_[k] = tree_of_[static_cast<std::size_t>(b.parent)];
    if (tree_of_[k] < 0 || b.kind == BodyKernel::rotor) continue;
    floating_[static_cast<std::size_t>(tree_of_[k])].mass +=
        b.n_modes > 0 ? m.flexible[static_cast<std::size_t>(b.flexible)].M_rr.m : b.M_sweep.m;
  }
  q_.resize(static_cast<std::size_t>(nq_));
  articulated_.assign(static_cast<std::size_t>(nq_), std::numeric_limits<double>::quiet_NaN());
  for (std::vector<double>* x : {&v_, &mu_, &rate_, &load_, &size_, &r_, &dv_}) x->assign(static_cast<std::size_t>(nv_), 0.0);
  inertia_.rest.assign(static_cast<std::size_t>(nv_), 0.0);
}

/// P, D and G at q, unless they are there.
bool VehicleMomentumForm::articulate(const double* q) {
  const std::size_t bytes = sizeof(double) * static_cast<std::size_t>(nq_);
  if (nq_ > 0 && std::memcmp(q, articulated_.data(), bytes) == 0) return true;
  articulated_.assign(static_cast<std::size_t>(nq_), std::numeric_limits<double>::quiet_NaN());
  if (!articulate_at_rest(*model_, inertia_, q)) return false;
  std::copy_n(q, nq_, articulated_.begin());
  return true;
}

/// From O to the mass centre of the tree, axes of O: the poses are those of `ws`, which is at q, with its root at the origin.
Vec VehicleMomentumForm::to_mass_centre(const Workspace& ws, const Floating& tree, const double* q) {
  const Model& m = *model_;
  const int which = static_cast<int>(&tree - floating_.data());
  for (std::size_t k = 1; k < m.bodies.size(); ++k) {
    const SweepBody& b = m.bodies[k];
    if (tree_of_[k] != which) continue;
    const soa::Modal<double>* modal = ws.modal_of(static_cast<int>(k));
    moments_[k] = b.n_modes > 0 ? modal->M_rr : b.M_sweep;
    if (b.kind == BodyKernel::rotor) moments_[k] = {};
  }
  for (std::size_t k = m.bodies.size(); --k > static_cast<std::size_t>(tree.root);) {
    if (tree_of_[k] != which || m.bodies[k].kind == BodyKernel::rotor) continue;
    const Pose<double> X = soa::pose_in_inboard(m, ws, static_cast<int>(k), q);
    RigidInertia<double>& inboard = moments_[static_cast<std::size_t>(m.bodies[k].parent)];
    inboard.m += moments_[k].m;
    inboard.h += X.R * moments_[k].h + moments_[k].m * X.p;
  }
  const RigidInertia<double>& all = moments_[static_cast<std::size_t>(tree.root)];
  const SweepBody& root = m.bodies[static_cast<std::size_t>(tree.root)];
  const Pose<double> X = ws.X(tree.root);  // B in the world; P of O is at the coordinates
  const Vec in_world = X.p + X.R * ((1.0 / all.m) * all.h) - root.O.p;
  return transpose_times(root.O.R, in_world);
}

bool VehicleMomentumForm::enter(const double* x, double* z) {
  bool good = false;
  const auto work = [&] {
    std::copy_n(x, nq_, z);
    double *p = z + nq_, *more = p + nv_;
    std::copy_n(x + nq_, nv_, v_.begin());
    for (const Floating& f : floating_) std::fill_n(z + f.q, 3, 0.0);  // else differences to the mass centre lose digits
    if (!articulate(z)) return;
    const auto product = [&] {
      inverse_dynamics(*model_, ws_, Inputs{.q = z, .v = v_.data(), .vdot = v_.data(), .gravity = false}, p,
                       {.velocity = false, .gravity = false, .elastic = false});
    };
    for (const Floating& f : floating_) std::fill_n(v_.begin() + f.v, 3, 0.0);
    if (!floating_.empty()) product();
    for (std::size_t i = 0; i < floating_.size(); ++i) {  // velocities as seen from the mass centre
      Floating& f = floating_[i];
      const Mat3<double> R = attitude(z + f.q - 4);
      const Vec relative = (-1.0 / f.mass) * vec_at(p + f.v), given = vec_at(x + nq_ + f.v);
      put_at(relative, v_.data() + f.v);
      put_at(vec_at(x + f.q) + to_mass_centre(inertia_, f, z), more + 6 * i);
      put_at((f.body_axes ? R * given : given) - (f.body_axes ? R * relative : relative), more + 6 * i + 3);
      f.a = {};
    }
    product();
    for (const Floating& f : floating_) std::fill_n(p + f.v, 3, 0.0);
    for (const Hinge& hinge : hinges_) {
      if (hinge.shape != CARDAN_SHAPE_FREE_BODY || hinge.floats >= 0) continue;
      put_at(attitude(z + hinge.q) * vec_at(p + hinge.v + 3), p + hinge.v + 3);
    }
    contraction_ = 1.0;
    good = all_finite(z, size());
  };
  return guard_(std::ref(work)) && good;
}

bool VehicleMomentumForm::velocity(const double* z, double* v) {
  bool good = false;
  const auto work = [&] {
    if (!articulate(z)) return;
    std::copy_n(z + nq_, nv_, r_.begin());
    for (const Hinge& hinge : hinges_) {
      if (hinge.shape != CARDAN_SHAPE_FREE_BODY || hinge.floats >= 0) continue;
      put_at(transpose_times(attitude(z + hinge.q), vec_at(r_.data() + hinge.v + 3)), r_.data() + hinge.v + 3);
    }
    solve_mass(*model_, inertia_, articulated_.data(), r_.data(), v);
    good = all_finite(v, nv_);
  };
  return guard_(std::ref(work)) && good;
}

bool VehicleMomentumForm::leave(const double* z, double* x) {
  std::copy_n(z, nq_, x);
  if (!velocity(z, x + nq_)) return false;
  const double* more = z + nq_ + nv_;
  for (std::size_t i = 0; i < floating_.size(); ++i) {
    const Floating& f = floating_[i];
    const Vec u = vec_at(more + 6 * i + 3);
    put_at(vec_at(more + 6 * i) - to_mass_centre(inertia_, f, z), x + f.q);
    put_at(vec_at(x + nq_ + f.v) + (f.body_axes ? transpose_times(attitude(z + f.q - 4), u) : u), x + nq_ + f.v);
  }
  return true;
}

/// `to` = `from` moved by `by` [s] times v, quaternions by exp; linear velocities along axes of the body are so in the middle, which is one
/// of the two. Trees that float stay at the origin.
void VehicleMomentumForm::move(double by, const double* from, const double* v, double* to, const double* middle) const {
  for (const PlainRates& r : model_->plain_rates)
    for (int i = 0; i < r.n; ++i) to[r.q + i] = from[r.q + i] + by * v[r.v + i];
  for (const Hinge& hinge : hinges_) {
    const double turn[6] = {by * v[hinge.v], by * v[hinge.v + 1], by * v[hinge.v + 2], 0.0, 0.0, 0.0};
    hinge.user->hinge->retract(hinge.user->hinge_packed.data(), from + hinge.q, turn, to + hinge.q);
    if (hinge.floats >= 0 || hinge.shape == CARDAN_SHAPE_BALL) continue;
    Vec u = vec_at(v + hinge.v + 3);
    if (hinge.shape == CARDAN_SHAPE_FREE_BODY) u = attitude(middle + hinge.q) * u;
    put_at(vec_at(from + hinge.q + 4) + by * u, to + hinge.q + 4);
  }
  for (const Floating& f : floating_) std::fill_n(to + f.q, 3, 0.0);
}

/// mu_ = M v and rate_ = what p' is in the middle, with all that acts; size_: the largest terms of both.
void VehicleMomentumForm::evaluate(double t, const double* z0, double h, const double* v) {
  const Model& m = *model_;
  const double* more = z0 + nq_ + nv_;
  momenta_.at(ws_, q_.data(), v, mu_.data(), rate_.data());
  std::copy_n(v, nv_, v_.begin());
  for (std::size_t i = 0; i < floating_.size(); ++i) {
    const Floating& f = floating_[i];
    const Vec u = vec_at(more + 6 * i + 3) + (0.5 * h) * f.a, r = vec_at(more + 6 * i) + (0.5 * h) * u;
    if (placed_) put_at(r - to_mass_centre(ws_, f, q_.data()), q_.data() + f.q);
    put_at(vec_at(v + f.v) + (f.body_axes ? transpose_times(attitude(q_.data() + f.q - 4), u) : u), v_.data() + f.v);
  }
  const Inputs in = loads_(t + 0.5 * h, q_.data(), v_.data());
  const bool wrenches = std::ranges::any_of(in.wrenches, [](const NodeWrench& w) {
    return w.f.n.x != 0.0 || w.f.n.y != 0.0 || w.f.n.z != 0.0 || w.f.f.x != 0.0 || w.f.f.y != 0.0 || w.f.f.z != 0.0;
  });
  const bool acted_on = wrenches || m.gravity.kind != GravitySpec::Kind::none;
  for (int i = 0; i < nv_; ++i) {
    const auto k = static_cast<std::size_t>(i);
    load_[k] = in.tau ? in.tau[i] : 0.0;
    size_[k] = std::abs(mu_[k]) + std::abs(h * rate_[k]) + std::abs(h * load_[k]);
  }
  if (acted_on || !m.flexible.empty()) {
    Inputs at = in;
    at.vdot = nullptr, at.gravity = acted_on;
    inverse_dynamics(m, ws_, at, dv_.data(), {.velocity = false, .gravity = true, .elastic = true});
    for (std::size_t i = 0; i < dv_.size(); ++i) load_[i] -= dv_[i], size_[i] += std::abs(h * dv_[i]);
  }
  // The mass centre of a tree that floats goes with what acts from outside; the rest is counted in axes that go with it.
  bool pulled = false;
  std::fill(r_.begin(), r_.end(), 0.0);
  for (Floating& f : floating_) {
    const Vec force = vec_at(load_.data() + f.v);
    pulled = pulled || force.x != 0.0 || force.y != 0.0 || force.z != 0.0;
    put_at((1.0 / f.mass) * force, r_.data() + f.v);
    f.a = (1.0 / f.mass) * (f.body_axes ? attitude(q_.data() + f.q - 4) * force : force);
  }
  if (pulled) {
    inverse_dynamics(m, ws_, Inputs{.q = q_.data(), .v = r_.data(), .vdot = r_.data(), .gravity = false}, dv_.data(),
                     {.velocity = false, .gravity = false, .elastic = false});
    for (std::size_t i = 0; i < dv_.size(); ++i) load_[i] -= dv_[i];
  }
  for (std::size_t i = 0; i < rate_.size(); ++i) rate_[i] += load_[i];
}

/// dL along turns of the middle. The kinetic energy of a tree that floats knows nothing of them: momentum is kept to round-off of R.
Vec VehicleMomentumForm::turning_force(const Hinge& hinge, const Vec& omega) const {
  if (hinge.floats >= 0) return vec_at(load_.data() + hinge.v);
  return vec_at(rate_.data() + hinge.v) + cross(omega, vec_at(mu_.data() + hinge.v));
}

/// r_ = what is missing of the discrete equations at the start of the step. Returns the largest of it over rounding.
double VehicleMomentumForm::residual(double h, const double* p0, const double* v) {
  const double half = 0.5 * h;
  for (int i = 0; i < nv_; ++i) {
    const auto k = static_cast<std::size_t>(i);
    r_[k] = p0[i] + half * rate_[k] - mu_[k];
    size_[k] += std::abs(p0[i]);
  }
  for (const Hinge& hinge : hinges_) {
    double *r = r_.data() + hinge.v, *size = size_.data() + hinge.v;
    const double *mu = mu_.data() + hinge.v, *rate = rate_.data() + hinge.v;
    const Vec omega = vec_at(v + hinge.v);
    const HalfTurn turn(half * omega);
    const Vec f = turning_force(hinge, omega);
    put_at(turn.S(transpose_times(turn.R, vec_at(p0 + hinge.v)) + half * (f - turn.tan * cross(turn.x, f))) - vec_at(mu), r);
    std::fill_n(size, 3, *std::max_element(size, size + 3));
    if (hinge.shape == CARDAN_SHAPE_BALL) continue;
    if (hinge.floats >= 0) {
      put_at(-vec_at(mu + 3), r + 3);
    } else if (hinge.shape == CARDAN_SHAPE_FREE_BODY) {
      const Vec there = transpose_times(attitude(q_.data() + hinge.q), vec_at(p0 + hinge.v + 3));
      put_at(there + half * (vec_at(rate + 3) + cross(omega, vec_at(mu + 3))) - vec_at(mu + 3), r + 3);
    }
    const double lever = std::max({size[3], size[4], size[5]});
    std::fill_n(size + 3, 3, lever);
  }
  for (const Floating& f : floating_)
    std::fill_n(size_.begin() + f.v, 3, std::numeric_limits<double>::infinity());  // of a sum that is zero
  double worst = 0.0;
  for (std::size_t i = 0; i < r_.size(); ++i)
    if (r_[i] != 0.0) worst = std::max(worst, std::abs(r_[i]) / size_[i]);
  return worst;
}

int VehicleMomentumForm::step(double t, double h, const double* z0, double* v, double* z1) {
  int calls = 0;
  const auto work = [&] { calls = solve(t, h, z0, v, z1); };
  return guard_(std::ref(work)) ? calls : 0;
}

/// Newton's method with M at the start of the step in place of the derivative. Errors are measured by their kinetic energy.
int VehicleMomentumForm::solve(double t, double h, const double* z0, double* v, double* z1) {
  if (!articulate(z0)) return 0;
  const double *p0 = z0 + nq_, *more0 = p0 + nv_;
  double before = std::numeric_limits<double>::infinity();
  int calls = 0;
  for (bool solved = false; !solved;) {
    if (++calls > kMost) return 0;
    move(0.5 * h, z0, v, q_.data(), q_.data());
    evaluate(t, z0, h, v);
    const double worst = residual(h, p0, v);
    solve_mass(*model_, inertia_, articulated_.data(), r_.data(), dv_.data());
    double error = 0.0, energy = 0.0;
    for (int i = 0; i < nv_; ++i) {
      const auto k = static_cast<std::size_t>(i);
      error += dv_[k] * r_[k], energy += v[i] * mu_[k];
      v[i] += dv_[k];
    }
    error = std::sqrt(std::max(error, 0.0)), energy = std::sqrt(std::max(energy, 0.0));
    if (!std::isfinite(error) || !std::isfinite(energy)) return 0;
    const bool rounding = error <= kFloor * energy;
    if (calls > 1 && !rounding) contraction_ = std::clamp(error / before, 1e-3, 1.0);
    solved = contraction_ * error <= kEps * energy || (rounding && (error > 0.9 * before || calls > kMost / 2)) || worst <= kRounding;
    before = error;
  }
  // The other end, with what acts in the middle.
  const double half = 0.5 * h;
  move(half, z0, v, q_.data(), q_.data());
  double *p1 = z1 + nq_, *more1 = p1 + nv_;
  for (std::size_t i = 0; i < floating_.size(); ++i) {
    const Floating& f = floating_[i];
    const Vec u0 = vec_at(more0 + 6 * i + 3);
    put_at(vec_at(more0 + 6 * i) + h * (u0 + half * f.a), more1 + 6 * i);
    put_at(u0 + h * f.a, more1 + 6 * i + 3);
  }
  for (int i = 0; i < nv_; ++i) r_[static_cast<std::size_t>(i)] = p0[i] + h * rate_[static_cast<std::size_t>(i)];
  for (const Hinge& hinge : hinges_) {
    const double *mu = mu_.data() + hinge.v, *rate = rate_.data() + hinge.v, *p = p0 + hinge.v;
    const Vec omega = vec_at(v + hinge.v);
    const HalfTurn turn(half * omega);
    const Vec f = turning_force(hinge, omega);
    put_at(transpose_times(turn.R, transpose_times(turn.R, vec_at(p)) + h * f), r_.data() + hinge.v);
    if (hinge.floats >= 0) std::fill_n(r_.data() + hinge.v + 3, 3, 0.0);
    if (hinge.floats >= 0 || hinge.shape != CARDAN_SHAPE_FREE_BODY) continue;
    const Vec push = attitude(q_.data() + hinge.q) * (vec_at(rate + 3) + cross(omega, vec_at(mu + 3)));
    put_at(vec_at(p + 3) + h * push, r_.data() + hinge.v + 3);
  }
  std::copy(r_.begin(), r_.end(), p1);
  move(half, q_.data(), v, z1, q_.data());
  return calls;
}

}  // namespace cardan
