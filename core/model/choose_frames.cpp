#include "core/model/choose_frames.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/spatial/rotation.hpp"

namespace cardan {
namespace {

// The inertia of body b seen from S (pose C in P), whose axis i is the hinge axis u, exactly: the inertia about a hinge may be
// ten orders below the others, and a rotation that is orthogonal to round-off only would lose it. Hence long double, u kept
// as it is, and the second moments S = (tr J/2) 1 - J in place of J: those of a slender body are small by themselves.
void turn_inertia(const Pose<double>& C, int i, SweepBody& b, AxisBody& a, Central* central) {
  const Mat3L R = to_eigen(C.R).cast<Long>();
  const int j = (i + 1) % 3, k = (i + 2) % 3;
  Mat3L Q;
  Q.col(i) = to_eigen(b.axis).cast<Long>().normalized();
  Q.col(j) = (R.col(j) - Q.col(i) * Q.col(i).dot(R.col(j))).normalized();
  Q.col(k) = Q.col(i).cross(Q.col(j));
  const RigidInertia<Long> M = cast<Long>(b.M);
  Mat3L S;
  S << 0.5L * ((M.J.yy - M.J.xx) + M.J.zz), -M.J.xy, -M.J.xz, -M.J.xy, 0.5L * ((M.J.xx - M.J.yy) + M.J.zz), -M.J.yz, -M.J.xz, -M.J.yz,
      0.5L * ((M.J.xx - M.J.zz) + M.J.yy);
  const Vec3L d = to_eigen(C.p).cast<Long>(), h = to_eigen(b.M.h).cast<Long>();
  S += M.m * d * d.transpose() - d * h.transpose() - h * d.transpose();
  S = (Q.transpose() * S * Q).eval();
  Vec3L h_S = Q.transpose() * (h - M.m * d);
  const auto without_noise = [](Mat3L& moments, Vec3L& first, Long size) {  // round-off of the rotation itself
    const Long noise = 1e-18L * moments.trace();
    for (int r = 0; r < 3; ++r) {
      if (std::abs(first[r]) < 1e-18L * size) first[r] = 0;
      for (int c = 0; c < 3; ++c)
        if (r != c && std::abs(moments(r, c)) < noise) moments(r, c) = 0;
    }
  };
  without_noise(S, h_S, h.norm() + M.m * d.norm());
  if (central) {
    const Long size = central->c.norm() + d.norm();
    central->c = (Q.transpose() * (central->c - d)).eval();
    central->S = (Q.transpose() * central->S * Q).eval();
    without_noise(central->S, central->c, size);
  }
  const auto down = [](Long x) { return static_cast<double>(x); };
  b.M.h = {down(h_S[0]), down(h_S[1]), down(h_S[2])};
  b.M.J = {down(S(1, 1) + S(2, 2)), down(S(0, 0) + S(2, 2)), down(S(0, 0) + S(1, 1)), down(-S(0, 1)), down(-S(0, 2)), down(-S(1, 2))};
  const Long second[6] = {S(0, 0), S(1, 1), S(2, 2), S(0, 1), S(0, 2), S(1, 2)};
  std::transform(second, second + 6, a.S, down);
}

// Angle about axis i of a body (frame R_PS) that serves its first outboard axis hinge best; 0 if some fits already.
template <class Served>
double best_turn(const Model& m, std::span<const int> outboard, int i, const Eigen::Matrix3d& R_PS, const Served& served) {
  double best = 0.0;
  bool found = false;
  for (const int child : outboard) {
    const SweepBody& c = m.bodies[child];
    if (!served(child)) continue;
    const Eigen::Vector3d a = R_PS.transpose() * (to_eigen(c.O.R) * to_eigen(c.axis));
    if (a.maxCoeff() > 1.0 - 1e-15) return 0.0;
    if (found) continue;
    found = true;
    const int j = (i + 1) % 3, h = (i + 2) % 3;
    if (std::hypot(a[j], a[h]) < 1e-12) continue;  // parallel or opposite: nothing to gain
    if (std::abs(a[i]) < 1e-15 || i != 1) {
      // rotate so that the component across the axis points along x (i = z), z (i = x), or any coordinate axis
      const double now = std::atan2(a[h], a[j]);                    // angle in the j, h plane
      const double wanted = i == 0 ? 0.5 * std::numbers::pi : 0.0;  // i = 0: j = y, h = z -> along z;  i = 2: j = x -> along x
      best = now - wanted;
    }
  }
  return best;
}

int axis_index(BodyKernel kind) { return kind == BodyKernel::axis_x ? 0 : kind == BodyKernel::axis_y ? 1 : 2; }

/// To round-off: mass centre on the hinge axis, which is a principal axis between two equal moments.
bool is_axisymmetric(const SweepBody& b) {
  const int i = axis_index(b.kind), j = (i + 1) % 3, k = (i + 2) % 3;
  const Eigen::Matrix3d J = to_eigen(b.M.J);
  const Eigen::Vector3d h = to_eigen(b.M.h);
  const double small = 4e-16 * J.trace(), small_h = 4e-16 * std::sqrt(b.M.m * J.trace());
  return J(i, i) > small && std::abs(J(j, j) - J(k, k)) <= small && std::abs(J(i, j)) <= small && std::abs(J(i, k)) <= small &&
         std::abs(J(j, k)) <= small && std::abs(h[j]) <= small_h && std::abs(h[k]) <= small_h;
}

}  // namespace

void choose_frames(Model& m, std::vector<Central>& central) {
  const int n = static_cast<int>(m.bodies.size());
  m.axis_bodies.resize(m.bodies.size());
  const Groups outboard(m.bodies, &SweepBody::parent, n), carried(m.user, &UserBody::sweep, n);  // by sweep body
  // The frame slides along the axis to where that passes the inboard origin. From ground that may be an orbit's radius: about such a place
  // the inertia of the body is round-off.
  const auto stays_near = [&](const SweepBody& b) {
    const double slide = to_eigen(b.O.R * b.axis).dot(to_eigen(b.O.p));
    return b.parent != 0 || b.M.m * slide * slide <= 1e8 * (b.M.J.xx + b.M.J.yy + b.M.J.zz);
  };
  const auto served = [&](int k) {
    const SweepBody& b = m.bodies[k];
    return b.shape == CARDAN_SHAPE_ROTATION && b.n_modes == 0 && b.onode < 0 && !b.has_prescribed && (m.varies.empty() || !m.varies[k]) &&
           stays_near(b);
  };
  const auto slides = [&](int k) {
    const SweepBody& b = m.bodies[k];
    return b.shape == CARDAN_SHAPE_SLIDE && b.n_modes == 0 && b.onode < 0 && !b.has_prescribed && (m.varies.empty() || !m.varies[k]) &&
           central.empty();
  };
  for (int k = 1; k < n; ++k) {
    if (slides(k)) {
      SweepBody& b = m.bodies[k];
      const Pose<double> turned{b.O.R, {}};
      b.M = to_inboard(turned, b.M), b.axis = b.O.R * b.axis, b.O.R = Mat3<double>::identity();
      for (const int u : carried[k]) m.user[u].pose = turned * m.user[u].pose;
      for (const int child : outboard[k]) m.bodies[child].O = turned * m.bodies[child].O;
      continue;
    }
    if (!served(k)) continue;
    SweepBody& b = m.bodies[k];
    AxisBody& a = m.axis_bodies[k];
    const Eigen::Matrix3d R_AO = to_eigen(b.O.R);
    const Eigen::Vector3d axis_A = R_AO * to_eigen(b.axis), p_A = to_eigen(b.O.p);
    const double slide = axis_A.dot(p_A);
    int i = -1;
    for (int c = 0; c < 3; ++c)
      if (std::abs(axis_A[c] - 1.0) < 1e-15 && axis_A.cwiseAbs().sum() - std::abs(axis_A[c]) < 4e-16) i = c;
    Eigen::Matrix3d R_AS;  // new frame S at q = 0 in A
    Eigen::Vector3d offset = p_A - slide * axis_A;
    if (i >= 0) {
      R_AS.setIdentity();
      offset[i] = 0.0;
      b.kind = static_cast<BodyKernel>(static_cast<int>(BodyKernel::axis_x) + i);
    } else {
      i = 2;
      const double beta = std::atan2(std::hypot(axis_A.x(), axis_A.y()), axis_A.z());
      const double alpha = std::abs(axis_A.y()) < 1e-15 * std::abs(axis_A.x()) && axis_A.x() > 0 ? 0.0 : std::atan2(axis_A.y(), axis_A.x());
      a.cos_alpha = std::cos(alpha), a.sin_alpha = std::sin(alpha), a.cos_beta = std::cos(beta), a.sin_beta = std::sin(beta);
      R_AS << a.cos_alpha * a.cos_beta, -a.sin_alpha, a.cos_alpha * a.sin_beta, a.sin_alpha * a.cos_beta, a.cos_alpha,
          a.sin_alpha * a.sin_beta, -a.sin_beta, 0.0, a.cos_beta;
      b.kind = alpha == 0.0 ? BodyKernel::tilt : BodyKernel::tilt2;
    }
    Eigen::Vector3d l = R_AS.transpose() * offset;
    l[i] = 0.0;
    Eigen::Matrix3d R_PS = R_AO.transpose() * R_AS;  // S in the old frame P, at q = 0
    // The frame may still be turned about its own axis: if that brings the axis of an outboard hinge onto a coordinate
    // axis, or at least into the x-z plane, so that the outboard body needs less.
    const double turn = best_turn(m, outboard[k], i, R_PS, served);
    if (turn != 0.0) {
      Eigen::Vector3d e = Eigen::Vector3d::Zero();
      e[i] = 1.0;
      R_PS = R_PS * to_eigen(rotation_about(from_eigen(e), std::sin(turn), std::cos(turn)));
      b.q0 = turn;
    }
    const Pose<double> C{from_eigen(R_PS), from_eigen(Eigen::Vector3d(-slide * to_eigen(b.axis)))};  // S in P
    const Pose<double> back = inverse(C);
    turn_inertia(C, i, b, a, central.empty() ? nullptr : &central[k]);
    for (const int u : carried[k]) m.user[u].pose = back * m.user[u].pose;
    for (const int child : outboard[k]) m.bodies[child].O = back * m.bodies[child].O;
    b.O = {from_eigen(R_AS), from_eigen(Eigen::Vector3d(R_AS * l))};
    b.axis = {i == 0 ? 1.0 : 0.0, i == 1 ? 1.0 : 0.0, i == 2 ? 1.0 : 0.0};
    a.parent = b.parent;
    a.q = b.q;
    a.v = b.v;
    a.q0 = b.q0;
    a.p[0] = b.O.p.x, a.p[1] = b.O.p.y, a.p[2] = b.O.p.z;
    a.l[0] = l[(i + 1) % 3], a.l[1] = l[(i + 2) % 3];
  }
}

void fold_rotors(Model& m) {
  const std::size_t n = m.bodies.size();
  std::vector<std::uint8_t> carries(n, 0);  // something hangs on it
  for (std::size_t k = 1; k < n; ++k) carries[m.bodies[k].parent] = 1;
  for (const Loop& loop : m.loops.all)
    if (loop.closing != Closing::coupling) carries[loop.from.sweep] = carries[loop.to.sweep] = 1;
  for (std::size_t k = 1; k < n; ++k) m.bodies[k].M_sweep = m.bodies[k].M, m.bodies[k].J_P = m.bodies[k].M.J;
  for (std::size_t k = 1; k < n; ++k) {
    SweepBody& b = m.bodies[k];
    SweepBody& carrier = m.bodies[b.parent];
    if (!is_axis(b.kind) || carries[k] || b.parent == 0 || carrier.n_modes > 0 || !is_axisymmetric(b)) continue;
    AxisBody& a = m.axis_bodies[k];
    const int i = axis_index(b.kind);
    const Eigen::Vector3d u = to_eigen(b.O.R).col(i);
    a.J_axial = to_eigen(b.M.J)(i, i);
    for (int c = 0; c < 3; ++c) a.u[c] = u[c];
    const RigidInertia<double> seen = to_inboard(b.O, b.M);
    b.M_sweep = seen;
    carrier.M_sweep = carrier.M_sweep + seen;
    carrier.J_P = carrier.J_P + seen.J + symmetric(-a.J_axial * u * u.transpose());
    if (is_axis(carrier.kind)) {
      const Eigen::Matrix3d J = to_eigen(seen.J), S = 0.5 * J.trace() * Eigen::Matrix3d::Identity() - J;
      double* to = m.axis_bodies[b.parent].S;
      for (const double x : {S(0, 0), S(1, 1), S(2, 2), S(0, 1), S(0, 2), S(1, 2)}) *to++ += x;
    }
    b.kind = BodyKernel::rotor;
    m.rotors.push_back(static_cast<int>(k));
  }
  std::vector<int> last(n, 0);  // child with the highest index that is no rotor: the first that comes from the tip
  for (std::size_t k = 1; k < n; ++k)
    if (m.bodies[k].kind != BodyKernel::rotor) last[m.bodies[k].parent] = static_cast<int>(k);
  for (std::size_t k = 1; k < n; ++k) {
    SweepBody& b = m.bodies[k];
    if (!is_axis(b.kind)) continue;
    AxisBody& a = m.axis_bodies[k];
    a.kind = b.kind;
    if (b.kind != BodyKernel::rotor) {
      a.angle = static_cast<int>(m.angles.size());
      m.angles.push_back({a.q, a.q0});
    }
    const int child = last[k];
    a.leaf = child == 0;
    if (child > 0 && is_axis(m.bodies[child].kind)) m.axis_bodies[child].first = a.written_by_child = true;
    const RigidInertia<double>& M = b.M_sweep;
    a.m = M.m;
    a.h[0] = M.h.x, a.h[1] = M.h.y, a.h[2] = M.h.z;
    a.P = articulated(M);
    a.P.J = b.J_P;
  }
}

}  // namespace cardan
