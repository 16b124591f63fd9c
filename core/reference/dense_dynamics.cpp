#include "core/reference/dense_dynamics.hpp"

#include <algorithm>

#include "core/reference/factor.hpp"
#include "core/reference/quad.hpp"

namespace cardan::reference {
namespace {

/// Frame 2 in world axes out of frame 1 and the motion of 2 relative to 1; the rates are v[column ... column + n - 1].
template <class T>
Frame<T> compose(const Frame<T>& f, const RelativeMotion<T>& m, const VecX<T>& rates, int column) {
  const Vec3<T> r = f.R * m.p, w_rel = f.R * (m.turn * rates), u = f.R * (m.shift * rates);
  Frame<T> out;
  out.R = f.R * m.R;
  out.x = f.x + r;
  out.w = f.w + w_rel;
  out.xdot = f.xdot + f.w.cross(r) + u;
  out.Jw = f.Jw;
  out.Jx = f.Jx - tilde(r) * f.Jw;
  out.Jw.middleCols(column, rates.size()) += f.R * m.turn;
  out.Jx.middleCols(column, rates.size()) += f.R * m.shift;
  out.wdot = f.wdot + f.w.cross(w_rel) + f.R * m.turn_bias;
  out.xddot = f.xddot + f.wdot.cross(r) + f.w.cross(f.w.cross(r)) + 2 * f.w.cross(u) + f.R * m.shift_bias;
  return out;
}

template <class T>
RelativeMotion<T> foreign_motion(const ForeignMotion& m, const VecX<T>& v) {
  RelativeMotion<T> out;
  out.R = m.R.cast<T>();
  out.p = m.p.cast<T>();
  const MatX<T> Ht = m.Ht.cast<T>();
  const VecX<T> h = Ht * v, Hdot_v = m.Hdot_v.cast<T>();
  const Vec3<T> hw = h.head(3), hv = h.tail(3);
  out.turn = out.R * Ht.topRows(3);
  out.shift = out.R * Ht.bottomRows(3);
  out.turn_bias = out.R * Hdot_v.head(3);
  out.shift_bias = out.R * (hw.cross(hv) + Hdot_v.tail(3));
  return out;
}

template <class T>
VecX<T> hinge_q(const DenseBody<T>& b, const VecX<T>& q) {
  return b.hinge.locked ? b.held : VecX<T>(q.segment(b.iq, b.size.nq));
}
template <class T>
VecX<T> hinge_v(const DenseBody<T>& b, const VecX<T>& v) {
  return b.hinge.locked ? VecX<T>::Zero(b.size.nv) : VecX<T>(v.segment(b.iv, b.size.nv));
}
template <class T>
VecX<T> modes(const DenseBody<T>& b, const VecX<T>& q) {
  return q.segment(b.iq + b.free_nq(), b.n_modes);
}
template <class T>
int mode_column(const DenseBody<T>& b) {
  return b.iv + b.free_nv();
}
template <class T>
VecX<T> mode_rates(const DenseBody<T>& b, const VecX<T>& v) {
  return v.segment(mode_column(b), b.n_modes);
}

/// Moves the frame of a body to one of its deforming points.
template <class T>
Frame<T> to_point(const Frame<T>& B, const DenseBody<T>& b, const ModalPoint<T>& p, const VecX<T>& q, const VecX<T>& v) {
  const VecX<T> rates = mode_rates(b, v);
  return compose(B, node_motion(p, modes(b, q), rates), rates, mode_column(b));
}

/// Gravity on a body, expanded about its mass centre x and all from one potential (MacCullagh's formula), world axes:
/// U = m potential - 1/2 gradient : S, with S the sum of m rho rho* of the body about x.
template <class T>
struct Field {
  Vec3<T> g = Vec3<T>::Zero();
  Mat3<T> gradient = Mat3<T>::Zero();
  T potential{0};                                                         // [J/kg]
  Vec3<T> n = Vec3<T>::Zero();                                            // from the attractor to x, unit length
  T k{0};                                                                 // 3 mu / (2 r^4)
  Mat3<T> bend[3] = {Mat3<T>::Zero(), Mat3<T>::Zero(), Mat3<T>::Zero()};  // d gradient / dx_j, of a field

  T energy(const T& mass, const Mat3<T>& S) const { return mass * potential - (gradient * S).trace() / 2; }
  Vec3<T> force(const T& mass, const Mat3<T>& S) const {
    Vec3<T> out = mass * g + k * (2 * S * n + (S.trace() - 5 * n.dot(S * n)) * n);
    for (int j = 0; j < 3; ++j) out += bend[j] * S.col(j) / 2;
    return out;
  }
  /// Sum of m rho x (gradient rho).
  Vec3<T> torque(const Mat3<T>& S) const {
    const Mat3<T> A = S * gradient;
    return {A(1, 2) - A(2, 1), A(2, 0) - A(0, 2), A(0, 1) - A(1, 0)};
  }
};

template <class T>
Field<T> gravity_field(const DenseGravity<T>& spec, const Vec3<T>& x) {
  Field<T> out;
  if (spec.kind == GravitySpec::Kind::uniform) {
    out.g = spec.g;
    out.potential = -out.g.dot(x);
  } else if (spec.kind == GravitySpec::Kind::central) {
    const Vec3<T> d = x - spec.centre;
    const T r = d.norm(), r3 = r * r * r;
    out.g = -spec.mu / r3 * d;
    out.potential = -spec.mu / r;
    if (!spec.gradient) return out;
    out.n = d / r;
    out.gradient = spec.mu / r3 * (3 * out.n * out.n.transpose() - Mat3<T>::Identity());
    out.k = 3 * spec.mu / (2 * r3 * r);
  } else if (spec.kind == GravitySpec::Kind::field) {
    const auto at = [&](const Vec3<T>& p) {
      return spec.sample({static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])});
    };
    const auto gradient_of = [](const std::array<double, 13>& all) {
      return Mat3<T>(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(all.data() + 3).template cast<T>());
    };
    const std::array<double, 13> here = at(x);
    out.g = Eigen::Map<const Eigen::Vector3d>(here.data()).template cast<T>();
    out.potential = T(here[12]);
    if (!spec.gradient) return out;
    out.gradient = gradient_of(here);
    const double size = Eigen::Map<const Eigen::Matrix3d>(here.data() + 3).norm();
    if (size == 0.0) return out;
    const double length = Eigen::Map<const Eigen::Vector3d>(here.data()).norm() / size;  // over which it varies
    const auto across = [&](int j, double h) {
      const Vec3<T> step = T(h) * Vec3<T>::Unit(j);
      return Mat3<T>(gradient_of(at(x + step)) - gradient_of(at(x - step)));
    };
    // By differences of fourth order; where what the field knows ends within them, as at a surface, by narrow ones; at its very end by
    // none.
    const double h = 1e-3 * length, narrow = 1e-5 * length;
    const auto known = [&] { return std::ranges::all_of(out.bend, [](const Mat3<T>& B) { return (B - B).cwiseEqual(T(0)).all(); }); };
    for (int j = 0; j < 3; ++j) out.bend[j] = (8 * across(j, h) - across(j, 2 * h)) / T(12 * h);
    for (int j = 0; j < 3 && !known(); ++j) out.bend[j] = across(j, narrow) / T(2 * narrow);
    if (!known()) std::ranges::fill(out.bend, Mat3<T>::Zero());
  }
  return out;
}

/// Sum of m rho rho* of a body out of its inertia tensor, both about the same point.
template <class T>
Mat3<T> second_moment(const Mat3<T>& inertia) {
  return inertia.trace() / 2 * Mat3<T>::Identity() - inertia;
}

template <class T>
VecX<T> wrench(const Vec3<T>& moment, const Vec3<T>& force) {
  VecX<T> out(6);
  out << moment, force;
  return out;
}
/// [moment; force] about a point that lies at `arm` from the new one.
template <class T>
VecX<T> shifted(const VecX<T>& f, const Vec3<T>& arm) {
  const Vec3<T> force = f.tail(3);
  return wrench<T>(f.head(3) + arm.cross(force), force);
}
template <class T>
VecX<T> turned(const Mat3<T>& R, const VecX<T>& f) {
  return wrench<T>(R * f.head(3), R * f.tail(3));
}

/// Columns `in` of a matrix with n, zero elsewhere.
template <class T>
MatX<T> widened(const MatX<T>& some, const std::vector<int>& in, Eigen::Index n) {
  MatX<T> out = MatX<T>::Zero(some.rows(), n);
  out(Eigen::all, in) = some;
  return out;
}

template <class T>
VecX<T> solve(const MatX<T>& M, const VecX<T>& rhs) {
  const Factor<T> factor(M);
  if (!factor.is_positive()) {
    RunFailure failure{};
    failure.code = Code::singular_mass;
    failure.what = "dense mass matrix of the reference";
    throw NumericsError(failure);
  }
  return factor.solve(rhs);
}

}  // namespace

template <class T>
DenseTwin<T>::DenseTwin(DenseModel<T> model) : model_(std::make_shared<const DenseModel<T>>(std::move(model))) {
  if (model_->gravity.kind == GravitySpec::Kind::field && !model_->gravity.sample)
    cardan::refuse(Code::unsupported, {"gravity.field"}, "DenseGravity::sample, which tells what the field is", "none");
  for (const DenseBody<T>& b : model_->bodies) {
    const auto refuse = [&](const char* expected, const char* got) { cardan::refuse(Code::unsupported, b.hinge.at, expected, got); };
    for (const SpringDamper& s : b.hinge.springs)
      if (s.stiffness != 0.0 && b.size.nq != b.size.nv) refuse("a hinge whose velocities are the rates of its coordinates", "a spring");
    inertia_.emplace_back();
    if (b.n_modes == 0 || (b.level == 2 && !b.masses.empty())) continue;
    if (b.level == 2 && b.modal->integrals.I9.empty()) refuse("mass nodes or the integral I9 for level 2", "neither");
    if (b.masses.empty())
      inertia_.back().emplace(b.modal->integrals);
    else
      inertia_.back().emplace(b.masses);
  }
}

template <class T>
DenseState<T> DenseTwin<T>::at(const VecX<T>& q, const VecX<T>& v, const Mat3X<T>& drives) const {
  DenseState<T> s(model_);
  const int nv = model_->nv;
  s.q_ = q;
  s.v_ = v;
  s.drives_ = drives;
  s.M = MatX<T>::Zero(nv, nv);
  s.bias = s.gravity_force = s.elastic_force = s.hinge_force = VecX<T>::Zero(nv);
  s.com = s.linear_momentum = s.angular_momentum = Vec3<T>::Zero();
  s.resultants_.resize(model_->bodies.size());
  set_kinematics(s);
  for (int k = 0; k < static_cast<int>(model_->bodies.size()); ++k) {
    inertia_[k] ? add_modal_body(s, k) : add_nodal_body(s, k);
    add_hinge_and_modal_forces(s, k);
    const VecX<T> momentum = shifted<T>(s.resultants_[k].W * v, s.bodies[k].x);
    s.angular_momentum += momentum.head(3);
    s.linear_momentum += momentum.tail(3);
  }
  s.com /= s.total_mass;
  s.kinetic_energy = v.dot(s.M * v) / 2;
  return s;
}

template <class T>
void DenseTwin<T>::set_kinematics(DenseState<T>& s) const {
  Frame<T> world;
  world.Jw = world.Jx = Mat3X<T>::Zero(3, model_->nv);
  const DenseBody<T> nothing;
  s.bodies.resize(model_->bodies.size());
  s.pnodes_.resize(model_->bodies.size());
  s.qdot = VecX<T>::Zero(model_->nq);
  for (const int k : model_->outward) {
    const DenseBody<T>& b = model_->bodies[k];
    const bool on_world = b.parent < 0;
    const Frame<T> O = to_point(on_world ? world : s.bodies[b.parent], on_world ? nothing : model_->bodies[b.parent], b.onode, s.q_, s.v_);
    const VecX<T> hq = hinge_q(b, s.q_), hv = hinge_v(b, s.v_), rates = mode_rates(b, s.v_);
    RelativeMotion<T> hinge;
    VecX<T> qdot;
    if (b.foreign) {
      const ForeignMotion m = b.foreign->motion(b.hinge, hq.template cast<double>(), hv.template cast<double>());
      hinge = foreign_motion<T>(m, hv);
      qdot = m.qdot.cast<T>();
    } else {
      hinge = hinge_motion(b.shape, hq, hv);
      qdot = hinge_qdot(b.shape, hq, hv);
    }
    if (b.hinge.locked)
      hinge.turn = hinge.shift = Mat3X<T>(3, 0);
    else
      s.qdot.segment(b.iq, b.size.nq) = qdot;
    s.qdot.segment(b.iq + b.free_nq(), b.n_modes) = rates;
    s.pnodes_[k] = compose<T>(O, hinge, s.v_.segment(b.iv, b.free_nv()), b.iv);
    const RelativeMotion<T> pnode = node_motion(b.pnode, modes(b, s.q_), rates);
    s.bodies[k] = compose(s.pnodes_[k], inverse(pnode, rates), rates, mode_column(b));
  }
}

template <class T>
Vec3<T> DenseTwin<T>::common_centre(const DenseState<T>& s, const std::vector<int>& bodies) const {
  T mass(0);
  Vec3<T> sum = Vec3<T>::Zero();
  for (const int k : bodies)
    for (const MassPoint<T>& p : model_->bodies[k].masses)
      mass += p.mass, sum += p.mass * to_point(s.bodies[k], model_->bodies[k], p.point, s.q_, s.v_).x;
  return sum / mass;
}

template <class T>
void DenseTwin<T>::add_nodal_body(DenseState<T>& s, int k) const {
  const DenseBody<T>& b = model_->bodies[k];
  const Frame<T>& B = s.bodies[k];
  std::vector<Frame<T>> frames;
  std::vector<Mat3<T>> inertias;  // world axes
  T mass(0);
  Vec3<T> centre = Vec3<T>::Zero();  // mass centre from B
  for (const MassPoint<T>& p : b.masses) {
    const Frame<T> f = to_point(B, b, p.point, s.q_, s.v_);
    frames.push_back(f);
    inertias.push_back(f.R * p.inertia * f.R.transpose());
    mass += p.mass;
    centre += p.mass * (f.x - B.x);
  }
  centre /= mass;
  Mat3<T> S = Mat3<T>::Zero();  // second moment about the mass centre
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Vec3<T> r = frames[i].x - B.x - centre;
    S += b.masses[i].mass * r * r.transpose() + second_moment(inertias[i]);
  }
  const bool as_one = !model_->gravity.gradient && !b.as_one.empty();  // and pulled at the mass centre of all
  const Field<T> field = gravity_field<T>(model_->gravity, as_one ? common_centre(s, b.as_one) : Vec3<T>(B.x + centre));
  const Vec3<T> mean_pull = field.force(mass, S) / mass;
  const auto n = static_cast<Eigen::Index>(b.moving.size());
  MatX<T> M = MatX<T>::Zero(n, n), W = MatX<T>::Zero(6, n);  // of the entries of v that move it
  VecX<T> bias = VecX<T>::Zero(6), gravity = bias, bias_v = VecX<T>::Zero(n), gravity_v = bias_v;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Frame<T>& f = frames[i];
    const T m = b.masses[i].mass;
    const Mat3<T>& I = inertias[i];
    const Mat3<T> arm = tilde<T>(f.x - B.x);
    const Vec3<T> force = m * f.xddot, moment = I * f.wdot + f.w.cross(I * f.w);
    const Vec3<T> pull = m * (mean_pull + field.gradient * (f.x - B.x - centre));
    const Vec3<T> torque = field.torque(second_moment(I));
    const Mat3X<T> Jx = f.Jx(Eigen::all, b.moving), Jw = f.Jw(Eigen::all, b.moving), P = m * Jx, L = I * Jw;
    M += Jx.transpose() * P + Jw.transpose() * L;
    bias_v += Jx.transpose() * force + Jw.transpose() * moment;
    gravity_v += Jx.transpose() * pull + Jw.transpose() * torque;
    W.topRows(3) += arm * P + L;
    W.bottomRows(3) += P;
    bias += wrench<T>(arm * force + moment, force);
    gravity += wrench<T>(arm * pull + torque, pull);
  }
  s.total_mass += mass;
  s.pull_squared += gravity.tail(3).squaredNorm() / mass;
  s.com += mass * (B.x + centre);
  s.gravity_energy += field.energy(mass, S);
  s.add(b.moving, M, bias_v, gravity_v);
  s.resultants_[k] = {widened<T>(W, b.moving, model_->nv), bias, gravity};
}

template <class T>
void DenseTwin<T>::add_modal_body(DenseState<T>& s, int k) const {
  const DenseBody<T>& b = model_->bodies[k];
  const Frame<T>& B = s.bodies[k];
  const int m = b.n_modes;
  const VecX<T> eta = modes(b, s.q_);
  const Mat3<T> Rt = B.R.transpose();
  const Vec3<T> w = Rt * B.w, v = Rt * B.xdot;
  // [omega; v; eta'] = J v, B axes, of the entries of v that move it: rows of the modes are the unit matrix in its last columns.
  const auto n = static_cast<Eigen::Index>(b.moving.size());
  MatX<T> J(6, n);
  J << Rt * B.Jw(Eigen::all, b.moving), Rt * B.Jx(Eigen::all, b.moving);
  VecX<T> Jdot_v = VecX<T>::Zero(6 + m);
  Jdot_v.head(3) = Rt * B.wdot;
  Jdot_v.segment(3, 3) = Rt * B.xddot - w.cross(v);

  const std::vector<MatX<T>> of_level = inertia_[k]->mass_derivatives(eta, b.level);
  const MatX<T> M = inertia_[k]->mass(eta, b.level);
  const VecX<T> bias = M * Jdot_v + inertia_[k]->bias(M, of_level, mode_rates(b, s.v_), wrench<T>(w, v));

  // Gravity: the mass centre is exact at every level; the second moment S is that of the level, at least of level 1, so
  // that modes and torque come from one potential. On mode k: force . d centre + 1/2 gradient : dS.
  const T mass = M(3, 3);
  const Vec3<T> centre(M(2, 4) / mass, M(0, 5) / mass, M(1, 3) / mass);  // out of M_wv = (mass centre)~
  const bool lifted = b.level < 1;
  const Mat3<T> about_B = (lifted ? inertia_[k]->mass(eta, 1) : M).topLeftCorner(3, 3);
  const Mat3<T> S = B.R * (second_moment(about_B) - mass * centre * centre.transpose()) * Rt;
  const Field<T> field = gravity_field<T>(model_->gravity, B.x + B.R * centre);
  const Vec3<T> pull = Rt * field.force(mass, S), torque = Rt * field.torque(S);
  const Mat3<T> gradient = Rt * field.gradient * B.R;
  const MatX<T> I3 = M.block(3, 6, 3, m);
  VecX<T> gravity(6 + m);
  gravity << centre.cross(pull) + torque, pull, I3.transpose() * (pull / mass - gradient * centre);
  const std::vector<MatX<T>> slope = lifted ? inertia_[k]->mass_derivatives(eta, 1) : of_level;
  for (int i = 0; i < m; ++i) gravity[6 + i] += (gradient * second_moment<T>(slope[i].topLeftCorner(3, 3))).trace() / 2;

  MatX<T> MJ = M.leftCols(6) * J;
  MJ.rightCols(m) += M.rightCols(m);
  const auto projected = [&](const auto& x) {  // J* x, with the rows of the modes
    MatX<T> out = J.transpose() * x.topRows(6);
    out.bottomRows(m) += x.bottomRows(m);
    return out;
  };
  s.add(b.moving, projected(MJ), projected(bias), projected(gravity));
  s.total_mass += mass;
  s.pull_squared += pull.squaredNorm() / mass;
  s.com += mass * (B.x + B.R * centre);
  s.gravity_energy += field.energy(mass, S);
  MatX<T> W(6, n);
  W << B.R * MJ.topRows(3), B.R * MJ.middleRows(3, 3);
  s.resultants_[k] = {widened<T>(W, b.moving, model_->nv), turned<T>(B.R, bias.head(6)), turned<T>(B.R, gravity.head(6))};
}

template <class T>
void DenseTwin<T>::add_hinge_and_modal_forces(DenseState<T>& s, int k) const {
  const DenseBody<T>& b = model_->bodies[k];
  const VecX<T> eta = modes(b, s.q_);
  s.elastic_force.segment(mode_column(b), b.n_modes) = -(b.K * eta + b.C * mode_rates(b, s.v_));
  s.elastic_energy += eta.dot(b.K * eta) / 2;
  if (b.hinge.locked) return;
  for (const SpringDamper& spring : b.hinge.springs) {
    T& force = s.hinge_force[b.iv + spring.component];
    force -= T(spring.damping) * s.v_[b.iv + spring.component];
    if (spring.stiffness == 0.0) continue;
    const T stretch = s.q_[b.iq + spring.component] - T(spring.rest);
    force -= T(spring.stiffness) * stretch;
    s.elastic_energy += T(spring.stiffness) * stretch * stretch / 2;
  }
  for (const HingeLoadSpec& load : b.hinge.loads) {
    using std::exp, std::pow, std::tanh;
    const HingeLoad::Parameters& p = load.parameters;
    const T rate = s.v_[b.iv + load.component];
    T& force = s.hinge_force[b.iv + load.component];
    if (load.law == HingeLaw::friction) {
      const T slow = rate / T(p[2]), level = T(p[0]) + T(p[1] - p[0]) * exp(T(-(slow * slow)));
      force -= level * tanh(T(rate / T(p[4]))) + T(p[3]) * rate;
      continue;
    }
    const T q = s.q_[b.iq + load.component];
    const int side = q > T(p[1]) ? 1 : q < T(p[0]) ? -1 : 0;  // beyond the upper or the lower limit
    if (side == 0) continue;
    const T depth = side > 0 ? T(q - T(p[1])) : T(T(p[0]) - q), pushed = T(p[2]) * pow(depth, T(p[3]));
    const T push = pushed * (T(1) + T(p[4]) * T(side) * rate);
    if (push > T(0)) force -= T(side) * push;
    s.elastic_energy += pushed * depth / (T(p[3]) + 1);
  }
}

/// What one body adds to the equations of the entries `in` of v.
template <class T>
void DenseState<T>::add(const std::vector<int>& in, const MatX<T>& mass, const VecX<T>& bias_of_body, const VecX<T>& gravity_of_body) {
  M(in, in) += mass;
  bias(in) += bias_of_body;
  gravity_force(in) += gravity_of_body;
}

template <class T>
int DenseState<T>::index(std::string_view body) const {
  for (std::size_t k = 0; k < model_->bodies.size(); ++k)
    if (model_->bodies[k].name == body) return static_cast<int>(k);
  refuse(Code::unknown_body, {}, "the name of a body", std::string(body));
}

template <class T>
Frame<T> DenseState<T>::node_frame(int body, std::string_view node) const {
  if (node.empty()) return bodies[body];
  return to_point(bodies[body], model_->bodies[body], model_->bodies[body].node(node), q_, v_);
}

template <class T>
NodeMotion<T> DenseState<T>::node(std::string_view body, std::string_view node) const {
  const Frame<T> f = node_frame(index(body), node);
  const Mat3<T> Rt = f.R.transpose();
  NodeMotion<T> out{f.x, f.R, turned<T>(Rt, wrench<T>(f.w, f.xdot)), turned<T>(Rt, wrench<T>(f.wdot, f.xddot)), {}};
  out.J.resize(6, v_.size());
  out.J << Rt * f.Jw, Rt * f.Jx;
  return out;
}

template <class T>
VecX<T> DenseState<T>::external_force(const NodeWrenches<T>& wrenches) const {
  VecX<T> out = VecX<T>::Zero(v_.size());
  for (const NodeWrench<T>& w : wrenches) out += node(w.body, w.node).J.transpose() * w.wrench;
  return out;
}

template <class T>
VecX<T> DenseState<T>::applied(const NodeWrenches<T>& wrenches) const {
  return gravity_force + elastic_force + hinge_force + external_force(wrenches) - bias;
}

template <class T>
Frame<T> DenseState<T>::end_frame(int body, const ModalPoint<T>& at) const {
  if (body >= 0) return to_point(bodies[static_cast<std::size_t>(body)], model_->bodies[static_cast<std::size_t>(body)], at, q_, v_);
  Frame<T> world;
  world.R = at.R, world.x = at.position;
  world.Jw = world.Jx = Mat3X<T>::Zero(3, v_.size());
  return world;
}

template <class T>
std::vector<LoopRows<T>> DenseState<T>::loops() const {
  std::vector<LoopRows<T>> all;
  Eigen::Index drive = 0;
  for (const DenseLoop<T>& loop : model_->loops) {
    const bool given = loop.prescribed && drives_.cols() > 0;
    const Vec3<T> at = given ? Vec3<T>(drives_.col(drive++)) : Vec3<T>(Vec3<T>::Zero());
    all.push_back(rows_of<T>(loop, end_frame(loop.from, loop.A), end_frame(loop.to, loop.B), q_, v_, at));
  }
  return all;
}

template <class T>
std::pair<MatX<T>, VecX<T>> DenseState<T>::constraints() const {
  const std::vector<LoopRows<T>> all = loops();
  Eigen::Index n = 0;
  for (const LoopRows<T>& rows : all) n += rows.c.size();
  std::pair<MatX<T>, VecX<T>> out{MatX<T>(n, v_.size()), VecX<T>(n)};
  n = 0;
  for (const LoopRows<T>& rows : all) {
    out.first.middleRows(n, rows.c.size()) = rows.G;
    out.second.segment(n, rows.c.size()) = rows.gamma;
    n += rows.c.size();
  }
  return out;
}

template <class T>
ClosedMotion<T> DenseState<T>::closed(const VecX<T>& tau, const NodeWrenches<T>& wrenches) const {
  const auto [G, gamma] = constraints();
  return closed_motion<T>(M, tau + applied(wrenches), G, gamma);
}

template <class T>
VecX<T> DenseState<T>::forward(const VecX<T>& tau, const NodeWrenches<T>& wrenches) const {
  if (!model_->loops.empty()) return closed(tau, wrenches).vdot;
  return solve<T>(M, tau + applied(wrenches));
}

template <class T>
VecX<T> DenseState<T>::inverse(const VecX<T>& vdot, const NodeWrenches<T>& wrenches) const {
  return M * vdot - applied(wrenches);
}

template <class T>
HybridResult<T> DenseState<T>::hybrid(const VecX<T>& tau, const std::vector<bool>& prescribed, const VecX<T>& vdot_prescribed,
                                      const NodeWrenches<T>& wrenches) const {
  std::vector<int> free;
  HybridResult<T> out{VecX<T>::Zero(tau.size()), tau};
  for (int i = 0; i < static_cast<int>(tau.size()); ++i) {
    if (prescribed[i])
      out.vdot[i] = vdot_prescribed[i];
    else
      free.push_back(i);
  }
  const VecX<T> missing = tau - inverse(out.vdot, wrenches);  // what the free components still have to take up
  VecX<T> vdot_free, from_loops = VecX<T>::Zero(tau.size());
  if (model_->loops.empty()) {
    vdot_free = solve<T>(M(free, free), missing(free));
  } else {
    const auto [G, gamma] = constraints();
    const ClosedMotion<T> closed = closed_motion<T>(M(free, free), missing(free), G(Eigen::all, free), gamma - G * out.vdot);
    vdot_free = closed.vdot;
    from_loops = G.transpose() * closed.lambda;
  }
  for (std::size_t i = 0; i < free.size(); ++i) out.vdot[free[i]] = vdot_free[i];
  const VecX<T> needed = inverse(out.vdot, wrenches) - from_loops;
  for (int i = 0; i < static_cast<int>(tau.size()); ++i)
    if (prescribed[i]) out.tau[i] = needed[i];
  return out;
}

template <class T>
std::vector<VecX<T>> DenseState<T>::hinge_wrenches(const VecX<T>& vdot, const NodeWrenches<T>& wrenches, const VecX<T>& lambda) const {
  std::vector<VecX<T>> total;  // what the subtree of each body needs, about the body's origin
  for (const Resultants& r : resultants_) total.push_back(r.W * vdot + r.bias - r.gravity);
  for (const NodeWrench<T>& w : wrenches) {
    const int k = index(w.body);
    const Frame<T> f = node_frame(k, w.node);
    total[k] -= shifted<T>(turned<T>(f.R, w.wrench), f.x - bodies[k].x);
  }
  const std::vector<LoopRows<T>> rows = lambda.size() > 0 ? loops() : std::vector<LoopRows<T>>();
  Eigen::Index at = 0;
  for (std::size_t l = 0; l < rows.size(); ++l) {
    const DenseLoop<T>& loop = model_->loops[l];
    const VecX<T> f = rows[l].wrench * lambda.segment(at, rows[l].c.size());
    at += rows[l].c.size();
    if (loop.shape.type == "coupling") continue;     // it pushes on hinges, and their wrenches have it in them
    const Vec3<T> x = end_frame(loop.to, loop.B).x;  // both ends feel it there
    if (loop.to >= 0) total[static_cast<std::size_t>(loop.to)] -= shifted<T>(f, x - bodies[static_cast<std::size_t>(loop.to)].x);
    if (loop.from >= 0) total[static_cast<std::size_t>(loop.from)] += shifted<T>(f, x - bodies[static_cast<std::size_t>(loop.from)].x);
  }
  std::vector<VecX<T>> out(total.size());
  for (auto it = model_->outward.rbegin(); it != model_->outward.rend(); ++it) {
    const int k = *it, parent = model_->bodies[k].parent;
    if (parent >= 0) total[parent] += shifted<T>(total[k], bodies[k].x - bodies[parent].x);
    out[k] = turned<T>(pnodes_[k].R.transpose(), shifted<T>(total[k], bodies[k].x - pnodes_[k].x));
  }
  return out;
}

template class DenseState<double>;
template class DenseState<Quad>;
template class DenseTwin<double>;
template class DenseTwin<Quad>;

}  // namespace cardan::reference
