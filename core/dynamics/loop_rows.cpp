// Rows of closed loops: the two ends of each seen from each other, the wrenches between them, c'' of any v' (docs/mathematics/loops.md, 1).
#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/dynamics/hinge_fit.hpp"
#include "core/dynamics/loop_pass.hpp"

namespace cardan {
namespace {

Eigen::Matrix<double, 6, 1> vector(const Vec3<double>& a, const Vec3<double>& b) {
  Eigen::Matrix<double, 6, 1> out;
  out << to_eigen(a), to_eigen(b);
  return out;
}
double product(const Force<double>& W, const Vec3<double>& w, const Vec3<double>& v) { return dot(W.n, w) + dot(W.f, v); }

/// Orthonormal columns W with W* H = 0, each as near to a coordinate direction as there is one left, or to the column of `near` in its
/// place. Where a rate turns and shifts at once the lever is the unit of length. N: the projector on what is left.
void complement(HingeColumns H, double lever, const Force<double>* near, Force<double>* W) {
  const int n = static_cast<int>(H.cols());
  using Column = Eigen::Matrix<double, 6, 1>;
  double unit = 1.0;
  for (int j = 0; j < n; ++j)
    if (!H.col(j).head<3>().isZero(0.0) && !H.col(j).tail<3>().isZero(0.0)) unit = lever;
  H.topRows<3>() *= unit;
  Eigen::Matrix<double, 6, 6> N = Eigen::Matrix<double, 6, 6>::Identity();
  const auto take = [&](const Column& left) {
    const Column x = (N * left).normalized();
    N.noalias() -= x * x.transpose();
    return x;
  };
  for (int j = 0; j < n; ++j)
    if (const Column left = N * H.col(j); left.squaredNorm() > 1e-18 * H.col(j).squaredNorm()) take(left);
  for (int j = 0; j < 6 - n; ++j) {
    int best = 0;
    double most = 0.0;
    for (int i = 0; i < 6 && !near; ++i)
      if (N(i, i) > most + 1e-6) best = i, most = N(i, i);
    W[j] = force(take(near ? vector((1.0 / unit) * near[j].n, near[j].f) : Column(N.col(best))).data());
    W[j].n = unit * W[j].n;
  }
}

}  // namespace

void LoopPass::place() {
  for (std::size_t l = 0; l < loops_.all.size(); ++l) {
    const Loop& loop = loops_.all[l];
    if (loop.closing == Closing::coupling) {
      couple(loop, l);
      drive(loop);
      continue;
    }
    k_.from[l] = seen_from_home(m_, ws_, in_, loop.from, loop.from_path);
    k_.to[l] = seen_from_home(m_, ws_, in_, loop.to, loop.to_path);
    const LoopPlace<double> seen = seen_from(k_.from[l], k_.to[l]);
    LoopWork::Relative& r = k_.relative[l];
    r = {seen.R, seen.d, seen.w, seen.u};
    close(loop, l);
    for (int i = loop.first; i < loop.first + loop.rows; ++i) k_.rate[at(i)] = product(k_.W[at(i)], r.w, r.u);
    drive(loop);
  }
}

/// What is given as a function of time is no residual.
void LoopPass::drive(const Loop& loop) {
  if (loop.drive < 0 || !in_.drives) return;
  const LoopDrive& given = in_.drives[loop.drive];
  k_.c[at(loop.first)] -= given.more, k_.rate[at(loop.first)] -= given.rate, k_.extra[at(loop.first)] -= given.acceleration;
}

void LoopPass::accelerations(const double* vdot, double* out) const {
  each_loop(vdot, out, [&](const Loop& loop, std::size_t l) {
    if (loop.closing == Closing::coupling) {
      out[loop.first] += k_.extra[at(loop.first)];
      return;
    }
    const LoopWork::Relative& r = k_.relative[l];
    const auto [wdot, udot] = relative_acceleration(m_, ws_, in_, loop, k_.from[l], k_.to[l], LoopPlace<double>{r.R, r.d, r.w, r.u}, vdot);
    for (int i = loop.first; i < loop.first + loop.rows; ++i) out[i] = product(k_.W[at(i)], wdot, udot) + k_.extra[at(i)];
  });
}

void LoopPass::responses(const double* vdot, double* out) const {
  each_loop(vdot, out, [&](const Loop& loop, std::size_t l) {
    if (loop.closing == Closing::coupling) return;
    const LoopWork::Relative& r = k_.relative[l];
    const Motion<double> A = response(loop.from, k_.from[l], vdot), B = response(loop.to, k_.to[l], vdot);
    const Vec3<double> wdot = r.R * B.w - A.w, udot = r.R * B.v - A.v - cross(A.w, r.d);
    for (int i = loop.first; i < loop.first + loop.rows; ++i) out[i] = product(k_.W[at(i)], wdot, udot);
  });
}

void LoopPass::couple(const Loop& loop, std::size_t l) {
  const Coupling& coupling = loop.coupling;
  double c = -coupling.offset, extra = 0.0;
  if (coupling.is_linear())
    for (const CoupledRate& term : coupling.terms) c += term.coefficient * in_.q[term.q];
  else
    coupling.at(in_.q, in_.v, k_.gradient[l].data(), c, extra);
  k_.c[at(loop.first)] = c;
  k_.rate[at(loop.first)] = coupled(loop, l, in_.v);
  k_.extra[at(loop.first)] = extra;
}
double LoopPass::coupled(const Loop& loop, std::size_t l, const double* v) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < k_.gradient[l].size(); ++i) sum += k_.gradient[l][i] * v[loop.coupling.terms[i].v];
  return sum;
}

void LoopPass::add_gradient(const Loop& loop, double multiplier, double* tau) const {
  const std::vector<double>& gradient = k_.gradient[at(&loop - loops_.all.data())];
  for (std::size_t i = 0; i < gradient.size(); ++i) tau[loop.coupling.terms[i].v] += gradient[i] * multiplier;
}

void LoopPass::close(const Loop& loop, std::size_t l) {
  const LoopWork::Relative& r = k_.relative[l];
  const auto first = at(loop.first);
  double *c = k_.c.data() + first, *extra = k_.extra.data() + first;
  Force<double>* W = k_.W.data() + first;
  for (int i = 0; i < loop.rows; ++i) W[i] = {}, extra[i] = 0.0;
  const Vec3<double> units[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const auto hold = [&](int i, const Vec3<double>& u) { W[i].f = u, c[i] = dot(u, r.d); };
  switch (loop.closing) {
    case Closing::weld: {
      const Vec3<double> turn = rotation_vector(r.R);
      for (int i = 0; i < 3; ++i) W[i].n = units[i], c[i] = dot(units[i], turn), hold(3 + i, units[i]);
      return;
    }
    case Closing::point:
      for (int i = 0; i < 3; ++i) hold(i, units[i]);
      return;
    case Closing::line:
      hold(0, units[0]), hold(1, units[1]);
      return;
    case Closing::plane:
      return hold(0, units[2]);
    case Closing::distance: {
      const double length = std::sqrt(dot(r.d, r.d));
      W[0].f = (1.0 / length) * r.d;
      c[0] = length - loop.length;
      const double along = dot(W[0].f, r.u);
      extra[0] = (dot(r.u, r.u) - along * along) / length;
      return;
    }
    default:
      return close_by_hinge(loop, l, W, c, extra);
  }
}

// q of the hinge whose pose is nearest; what is left of the pose, and of rates, in the directions in which the hinge does not move.
void LoopPass::close_by_hinge(int loop, const soa::RelativePlace& place, Force<double>* W, double* c, double* extra) {
  k_.relative[at(loop)] = place;
  close_by_hinge(loops_.all[at(loop)], at(loop), W, c, extra);
}

void LoopPass::close_by_hinge(const Loop& loop, std::size_t l, Force<double>* W, double* c, double* extra) {
  const LoopWork::Relative& r = k_.relative[l];
  const cardan_hinge_family& f = *loop.hinge;
  std::vector<double>&q = k_.q[l], &v = k_.v[l];
  std::copy_n(k_.near_q[l] ? k_.near_q[l] : loop.q0.data(), q.size(), q.begin());
  std::ranges::fill(v, 0.0);
  const int n = static_cast<int>(f.nv);
  const HingeFit fit = fit_hinge(f, loop.packed, {r.R, r.d}, loop.lever, q);
  const HingeColumns H = Eigen::Map<const Eigen::Matrix<double, 6, Eigen::Dynamic>>(fit.out.Ht, 6, n);
  cardan_hinge_out out = fit.out;
  const Eigen::Matrix3d R = to_eigen(r.R);
  HingeColumns H_A(6, n);  // axes of `from`
  H_A.topRows<3>() = R * H.topRows<3>(), H_A.bottomRows<3>() = R * H.bottomRows<3>();
  if (n > 0) {
    const HingeRates rates = least_squares(H_A, vector(r.w, r.u), loop.lever);
    std::copy_n(rates.data(), n, v.begin());
    const std::uint32_t zero = 0;
    f.kinematics(loop.packed.data(), 1, &zero, &zero, q.data(), v.data(), &out);
  }
  if (!k_.near_W.empty()) {
    complement(H_A, loop.lever, &k_.near_W[at(loop.first)], W);
  } else if (f.shape == CARDAN_SHAPE_ROTATION || f.shape == CARDAN_SHAPE_SCREW) {
    const Vec3<double> axis = from_eigen(Eigen::Vector3d(H_A.col(0).head<3>()));
    soa::rows_across(axis, W);
    if (f.shape == CARDAN_SHAPE_SCREW) {  // along its axis it moves by its pitch
      const double pitch = dot(axis, from_eigen(Eigen::Vector3d(H_A.col(0).tail<3>())));
      W[2].f = W[0].n, W[3].f = W[1].n, W[4] = {-pitch * axis, axis};
    }
  } else {
    complement(H_A, loop.lever, nullptr, W);
  }
  const Eigen::Matrix<double, 6, 1>& e = fit.e;
  const Vec3<double> turn = r.R * Vec3<double>{e[0], e[1], e[2]}, shift = r.R * Vec3<double>{e[3], e[4], e[5]};
  const Vec3<double> alpha = r.R * Vec3<double>{out.Hdot_v[0], out.Hdot_v[1], out.Hdot_v[2]};
  const Vec3<double> a = cross(r.w, r.u) + r.R * Vec3<double>{out.Hdot_v[3], out.Hdot_v[4], out.Hdot_v[5]};
  for (int i = 0; i < loop.rows; ++i) {
    c[i] = product(W[i], turn, shift);
    extra[i] = -product(W[i], alpha, a);
  }
}

Motion<double> LoopPass::response(const LoopEnd& end, const LoopWork::End& e, const double* vdot) const {
  const Motion<double> delta = motion_of_body(m_, ws_, in_, end.sweep, vdot, After::forward).delta;
  Motion<double> a{delta.w, delta.v + cross(delta.w, e.at.rho)};
  const SweepBody& b = m_.bodies[at(end.sweep)];
  if (const NodeShapes& shapes = shapes_of(m_, end); shapes.deforms())
    for (int j = 0; j < b.n_modes; ++j) a += vdot[b.etadot + j] * soa::node_column(shapes, e.at, j);
  return {transpose_times(e.at.R, a.w), transpose_times(e.at.R, a.v)};
}

}  // namespace cardan
