#include "core/reference/loops.hpp"

#include <algorithm>
#include <limits>

#include "core/reference/factor.hpp"
#include "core/reference/quad.hpp"

namespace cardan::reference {
namespace {

// Roundings: of a mass matrix whose reciprocal condition is below, of a row beside the longest, of an entry beside what it is made of.
constexpr double kSingular = 1e3;

/// Rows of one loop, condition by condition.
template <class T>
class Conditions {
 public:
  Conditions(const Frame<T>& A, const Frame<T>& B, int nv)
      : A_(A), B_(B), nv_(nv), d_(B.x - A.x), ddot_(B.xdot - A.xdot), dddot_(B.xddot - A.xddot) {}

  /// Two directions, p fixed in A and n fixed in B, keep their angle: p . n = cosine.
  void angle(const Vec3<T>& p_A, const Vec3<T>& n_B, const T& cosine) {
    const Vec3<T> p = A_.R * p_A, n = B_.R * n_B, pdot = A_.w.cross(p), ndot = B_.w.cross(n);
    const Vec3<T> pddot = A_.wdot.cross(p) + A_.w.cross(pdot), nddot = B_.wdot.cross(n) + B_.w.cross(ndot);
    add(p.dot(n) - cosine, n.cross(p), Vec3<T>::Zero(), -(pddot.dot(n) + 2 * pdot.dot(ndot) + p.dot(nddot)));
  }
  /// No turn about the line between two shafts: p_1 of A to n_2 of B as p_2 of A to n_1 of B, e_1 and e_2 across the shafts.
  void no_torsion(const Vec3<T>& e_1, const Vec3<T>& e_2) {
    angle(e_1, e_2, T(0)), angle(e_2, e_1, T(0));
    const Row second = all_.back();
    all_.pop_back();
    Row& row = all_.back();
    row.c -= second.c, row.gamma -= second.gamma, row.moment -= second.moment, row.G -= second.G;
  }
  /// No way along p, fixed in A.
  void way(const Vec3<T>& p_A) {
    const Vec3<T> p = A_.R * p_A, pdot = A_.w.cross(p), pddot = A_.wdot.cross(p) + A_.w.cross(pdot);
    add(p.dot(d_), Vec3<T>::Zero(), p, -(pddot.dot(d_) + 2 * pdot.dot(ddot_) + p.dot(dddot_)));
  }
  /// The way along u, fixed in both, is pitch times the turn about it.
  void screw(const Vec3<T>& u_A, const Vec3<T>& across_A, const T& pitch) {
    const Vec3<T> u = A_.R * u_A, udot = A_.w.cross(u), uddot = A_.wdot.cross(u) + A_.w.cross(udot);
    const Vec3<T> a = A_.R * across_A, b = B_.R * across_A;
    const double turned = std::atan2(static_cast<double>(u.dot(a.cross(b))), static_cast<double>(a.dot(b)));  // up to whole turns
    const T turning = udot.dot(B_.w - A_.w) + u.dot(B_.wdot - A_.wdot);
    add(u.dot(d_) - pitch * T(turned), -pitch * u, u, -(uddot.dot(d_) + 2 * udot.dot(ddot_) + u.dot(dddot_)) + pitch * turning);
  }
  void point() {
    for (int i = 0; i < 3; ++i) add(d_[i], Vec3<T>::Zero(), Vec3<T>::Unit(i), -dddot_[i], false);
  }
  void distance(const T& length, const T& rate, const T& acceleration) {  // d.d = l^2, differentiated twice, over l
    add((d_.squaredNorm() - length * length) / (2 * length), Vec3<T>::Zero(), d_ / length,
        (rate * rate - ddot_.squaredNorm() - d_.dot(dddot_)) / length + acceleration, false);
  }
  /// Axes of A and B are parallel.
  void parallel() {
    for (int i = 0; i < 3; ++i) angle(Vec3<T>::Unit(i), Vec3<T>::Unit((i + 1) % 3), T(0));
  }

  LoopRows<T> rows() const {
    const auto n = static_cast<Eigen::Index>(all_.size());
    LoopRows<T> out{VecX<T>(n), VecX<T>(n), MatX<T>(n, nv_), MatX<T>(6, n)};
    for (Eigen::Index i = 0; i < n; ++i) {
      const Row& row = all_[static_cast<std::size_t>(i)];
      out.c[i] = row.c, out.gamma[i] = row.gamma;
      out.G.row(i) = row.G.transpose();
      out.wrench.col(i) << row.moment, row.force;
    }
    return out;
  }

 private:
  struct Row {
    T c, gamma;
    Vec3<T> moment, force;
    VecX<T> G;
  };
  /// moment and force: on B. `turns`: A pulls about its own origin with the arm d, as where a direction fixed in A is in the condition.
  void add(const T& c, const Vec3<T>& moment, const Vec3<T>& force, const T& gamma, bool turns = true) {
    using std::abs;
    const Vec3<T> arm = turns ? Vec3<T>(d_.cross(force)) : Vec3<T>(Vec3<T>::Zero());
    VecX<T> G = (B_.Jw - A_.Jw).transpose() * moment + (B_.Jx - A_.Jx).transpose() * force - A_.Jw.transpose() * arm;
    // What is a rounding of what it is made of is nothing: a strut to a pin turns about it freely, and would be held by a row of roundings.
    const T rounding = T(kSingular) * std::numeric_limits<T>::epsilon();
    for (int j = 0; j < nv_; ++j) {
      const T made_of = (A_.Jw.col(j).norm() + B_.Jw.col(j).norm()) * (moment.norm() + arm.norm()) +
                        (A_.Jx.col(j).norm() + B_.Jx.col(j).norm()) * force.norm();
      if (abs(G[j]) <= rounding * made_of) G[j] = T(0);
    }
    all_.push_back({c, gamma, moment, force, G});
  }
  const Frame<T>&A_, &B_;
  int nv_;
  Vec3<T> d_, ddot_, dddot_;
  std::vector<Row> all_;
};

/// F, F', F'' of one number.
template <class T>
Vec3<T> evaluated(const typename DenseLoop<T>::Function& f, T x) {
  using std::cos, std::sin;
  if (f.kind == "sine") return f.numbers[0] * Vec3<T>(sin(x), cos(x), -sin(x));
  if (f.kind == "cosine") return f.numbers[0] * Vec3<T>(cos(x), -sin(x), -cos(x));
  Vec3<T> out = Vec3<T>::Zero();
  const auto n = f.numbers.size();
  if (f.kind == "polynomial") {  // power by power
    T power(1), before(0), twice_before(0);
    for (Eigen::Index i = 0; i < n; ++i) {
      out += f.numbers[i] * Vec3<T>(power, T(static_cast<double>(i)) * before, T(static_cast<double>(i * (i - 1))) * twice_before);
      twice_before = before, before = power, power *= x;
    }
    return out;
  }
  if (const T period = f.numbers[n - 1] - f.numbers[0]; f.periodic)
    x -= period * T(std::floor(static_cast<double>((x - f.numbers[0]) / period)));
  if (x < f.numbers[0]) return {f.values[0] + f.slopes[0] * (x - f.numbers[0]), f.slopes[0], T(0)};
  if (x > f.numbers[n - 1]) return {f.values[n - 1] + f.slopes[n - 1] * (x - f.numbers[n - 1]), f.slopes[n - 1], T(0)};
  Eigen::Index i = 0;
  while (i + 2 < n && !(x < f.numbers[i + 1])) ++i;
  const T h = f.numbers[i + 1] - f.numbers[i], s = (x - f.numbers[i]) / h, rise = (f.values[i + 1] - f.values[i]) / h;
  const T m0 = f.slopes[i], m1 = f.slopes[i + 1];  // Hermite's cubic: powers of s
  const T second = 3 * rise - 2 * m0 - m1, third = m0 + m1 - 2 * rise;
  return {f.values[i] + h * s * (m0 + s * (second + s * third)), m0 + s * (2 * second + 3 * s * third), (2 * second + 6 * s * third) / h};
}

template <class T>
Vec3<T> across(const Vec3<T>& u) {
  using std::abs;
  int least = 0;
  for (int i = 1; i < 3; ++i)
    if (abs(u[i]) < abs(u[least])) least = i;
  return u.cross(Vec3<T>(Vec3<T>::Unit(least))).normalized();
}

}  // namespace

bool knows_loop(std::string_view type) {
  constexpr std::string_view kKnown[] = {"weld",      "locked",   "point",         "ball",      "gimbal",           "line",
                                         "plane",     "distance", "revolute",      "prismatic", "helical",          "cylindrical",
                                         "universal", "planar",   "translational", "coupling",  "constant_velocity"};
  return std::ranges::find(kKnown, type) != std::end(kKnown);
}

template <class T>
VecX<T> slopes_of_table(const VecX<T>& x, const VecX<T>& values, bool periodic) {
  const Eigen::Index n = x.size();
  MatX<T> A = MatX<T>::Zero(n, n);
  VecX<T> b = VecX<T>::Zero(n);
  const auto curvature = [&](Eigen::Index row, Eigen::Index i, bool end, const T& sign) {  // of stretch i at its beginning or end
    const T h = x[i + 1] - x[i], rise = (values[i + 1] - values[i]) / h;
    A(row, i) += sign * (end ? T(2) : T(-4)) / h, A(row, i + 1) += sign * (end ? T(4) : T(-2)) / h;
    b[row] += sign * (end ? T(6) : T(-6)) * rise / h;
  };
  for (Eigen::Index i = 1; i + 1 < n; ++i) curvature(i, i - 1, true, T(1)), curvature(i, i, false, T(-1));
  curvature(0, 0, false, T(1));
  if (periodic) {
    curvature(0, n - 2, true, T(-1));
    A(n - 1, 0) = T(1), A(n - 1, n - 1) = T(-1);
  } else {
    curvature(n - 1, n - 2, true, T(1));
  }
  return general_solve(A, b);
}

template <class T>
LoopRows<T> rows_of(const DenseLoop<T>& loop, const Frame<T>& A, const Frame<T>& B, const VecX<T>& q, const VecX<T>& v,
                    const Vec3<T>& drive) {
  const auto nv = static_cast<int>(v.size());
  const std::string& type = loop.shape.type;
  if (type == "coupling") {
    LoopRows<T> out{VecX<T>::Constant(1, -loop.offset), VecX<T>::Zero(1), MatX<T>::Zero(1, nv), MatX<T>::Zero(6, 1)};
    for (const auto& term : loop.terms) {
      out.c[0] += term.coefficient * q[term.q];
      out.G(0, term.v) += term.coefficient;
    }
    for (const auto& function : loop.functions) {
      T x = function.phase, rate(0);
      for (const auto& term : function.of) x += term.coefficient * q[term.q], rate += term.coefficient * v[term.v];
      const Vec3<T> F = evaluated<T>(function, x);
      out.c[0] += F[0], out.gamma[0] -= F[2] * rate * rate;
      for (const auto& term : function.of) out.G(0, term.v) += F[1] * term.coefficient;
    }
    out.c[0] -= drive[0], out.gamma[0] += drive[2];
    return out;
  }
  Conditions<T> on(A, B, nv);
  const auto axis = [&](int i) -> Vec3<T> { return loop.shape.axes.col(i); };
  const auto unit = [](int i) -> Vec3<T> { return Vec3<T>::Unit(i); };
  if (type == "revolute" || type == "cylindrical" || type == "helical" || type == "prismatic") {
    const Vec3<T> u = axis(0), a = across<T>(u), b = u.cross(a);
    if (type == "prismatic")
      on.parallel();
    else
      on.angle(a, u, T(0)), on.angle(b, u, T(0));
    if (type == "revolute")
      on.point();
    else
      on.way(a), on.way(b);
    if (type == "helical") on.screw(u, a, loop.shape.pitch);
  } else if (type == "universal") {
    on.angle(axis(0), axis(1), axis(0).dot(axis(1)));
    on.point();
  } else if (type == "constant_velocity") {
    on.no_torsion(axis(0), axis(1));
    on.point();
  } else if (type == "planar") {
    const Vec3<T> n = axis(0).cross(axis(1));
    on.angle(axis(0), n, T(0)), on.angle(axis(1), n, T(0)), on.way(n);
  } else if (type == "translational") {
    on.parallel();
  } else if (type == "weld" || type == "locked") {
    on.parallel(), on.point();
  } else if (type == "point" || type == "ball" || type == "gimbal") {
    on.point();
  } else if (type == "line") {
    on.way(unit(0)), on.way(unit(1));
  } else if (type == "plane") {
    on.way(unit(2));
  } else {
    on.distance(loop.length + drive[0], drive[1], drive[2]);
  }
  return on.rows();
}

template <class T>
ClosedMotion<T> closed_motion(const MatX<T>& M, const VecX<T>& force, const MatX<T>& G, const VecX<T>& gamma, double tolerance) {
  using std::sqrt;
  ClosedMotion<T> out{{}, VecX<T>::Zero(G.rows()), 0};
  // Rows as unit vectors in the metric of diag M; the longest remainder is taken in turn (Gram-Schmidt, twice). What is a rounding long
  // says nothing: of a planar loop on a body that stands askew, rows out of its plane.
  const VecX<T> weight = M.diagonal().unaryExpr([](const T& m) { return m > T(0) ? T(1) / sqrt(m) : T(1); });
  MatX<T> left = G * weight.asDiagonal();
  const VecX<T> lengths = left.rowwise().norm();
  const T none = T(kSingular) * std::numeric_limits<T>::epsilon() * (lengths.size() > 0 ? lengths.maxCoeff() : T(0));
  for (Eigen::Index i = 0; i < left.rows(); ++i)
    if (lengths[i] > none)
      left.row(i) /= lengths[i];
    else
      left.row(i).setZero();
  std::vector<Eigen::Index> taken;
  for (Eigen::Index turn = 0; turn < std::min(left.rows(), left.cols()); ++turn) {
    Eigen::Index best = 0;
    for (Eigen::Index i = 1; i < left.rows(); ++i)
      if (left.row(i).squaredNorm() > left.row(best).squaredNorm()) best = i;
    const T length = left.row(best).norm();
    if (!(length > T(tolerance))) break;
    taken.push_back(best);
    const VecX<T> e = left.row(best).transpose() / length;
    for (int twice = 0; twice < 2; ++twice) left -= (left * e).eval() * e.transpose();
    left.row(best).setZero();
  }
  out.rank = static_cast<int>(taken.size());
  Factor<T> factor(M);
  VecX<T> pushed = force;
  if (!factor.is_positive() || factor.rcond() < kSingular * static_cast<double>(std::numeric_limits<T>::epsilon())) {
    // M + G* G, force + G* gamma: the same v' and lambda, since G v' = gamma; regular where the rows move what M does not.
    MatX<T> regular = M;
    for (const Eigen::Index i : taken) {
      const VecX<T> g = G.row(i).transpose() / lengths[i];
      regular += g * g.transpose();
      pushed += g * (gamma[i] / lengths[i]);
    }
    factor = Factor<T>(regular);
  }
  out.vdot = factor.solve(pushed);
  if (taken.empty()) return out;
  const MatX<T> G_I = G(taken, Eigen::all), S = G_I * factor.solve(MatX<T>(G_I.transpose()));
  const VecX<T> lambda_I = Factor<T>(S).solve(VecX<T>(gamma(taken) - G_I * out.vdot));
  out.vdot += factor.solve(VecX<T>(G_I.transpose() * lambda_I));
  // G = K G_I; of all lambda with K* lambda = lambda_I the smallest.
  const MatX<T> K = Factor<T>(G_I * G_I.transpose()).solve(MatX<T>(G_I * G.transpose())).transpose();
  out.lambda = K * Factor<T>(K.transpose() * K).solve(lambda_I);
  return out;
}

template LoopRows<double> rows_of(const DenseLoop<double>&, const Frame<double>&, const Frame<double>&, const VecX<double>&,
                                  const VecX<double>&, const Vec3<double>&);
template LoopRows<Quad> rows_of(const DenseLoop<Quad>&, const Frame<Quad>&, const Frame<Quad>&, const VecX<Quad>&, const VecX<Quad>&,
                                const Vec3<Quad>&);
template VecX<double> slopes_of_table(const VecX<double>&, const VecX<double>&, bool);
template VecX<Quad> slopes_of_table(const VecX<Quad>&, const VecX<Quad>&, bool);
template ClosedMotion<double> closed_motion(const MatX<double>&, const VecX<double>&, const MatX<double>&, const VecX<double>&, double);
template ClosedMotion<Quad> closed_motion(const MatX<Quad>&, const VecX<Quad>&, const MatX<Quad>&, const VecX<Quad>&, double);

}  // namespace cardan::reference
