#pragma once
// The twin's own pose formulas: built-in hinges by type name, deformed nodes, rotations. Everything is the motion of
// one frame relative to another as plain 3-vectors in the axes of the first; nothing is shared with hinges/ or the
// sweeps.
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "core/reference/plain_matrices.hpp"

namespace cardan::reference {

template <class T>
using Vec3 = Eigen::Matrix<T, 3, 1>;
template <class T>
using Mat3 = Eigen::Matrix<T, 3, 3>;
template <class T>
using Mat3X = Eigen::Matrix<T, 3, Eigen::Dynamic>;
template <class T>
using VecX = Eigen::Matrix<T, Eigen::Dynamic, 1>;
template <class T>
using MatX = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>;

template <class T>
Mat3<T> tilde(const Vec3<T>& a) {
  Mat3<T> out;
  out << T(0), -a.z(), a.y(), a.z(), T(0), -a.x(), -a.y(), a.x(), T(0);
  return out;
}

/// Rotation about the unit vector u.
template <class T>
Mat3<T> rotation(const Vec3<T>& u, const T& angle) {
  using std::cos, std::sin;
  return Mat3<T>::Identity() + sin(angle) * tilde(u) + (1 - cos(angle)) * tilde(u) * tilde(u);
}

/// Rotation matrix of the quaternion (w, x, y, z) / its norm.
template <class T>
Mat3<T> rotation_of_quaternion(const VecX<T>& q) {
  const Vec3<T> r(q[1], q[2], q[3]);
  return Mat3<T>::Identity() + (2 / q.template head<4>().squaredNorm()) * (q[0] * tilde(r) + tilde(r) * tilde(r));
}

/// Stumpff function c_n(x) = sum_k (-x)^k / (2k + n)! (Stumpff 1959): c_1 = sin t / t, c_2 = (1 - cos t) / t^2, ... at
/// x = t^2, with dc_n/dx = (n c_{n+2} - c_{n+1}) / 2. The series serves the small rotations of modal nodes at any
/// precision.
template <class T>
T stumpff(int n, const T& x) {
  using std::abs;
  T term(1);
  for (int i = 2; i <= n; ++i) term /= i;
  T sum = term;
  for (int i = n + 2; abs(term) > std::numeric_limits<T>::epsilon() * abs(sum) / 16; i += 2) sum += term *= -x / (i * (i - 1));
  return sum;
}

/// Motion of a frame 2 relative to a frame 1, in the axes of frame 1.
template <class T>
struct RelativeMotion {
  Mat3<T> R = Mat3<T>::Identity();      // axes of 2 to axes of 1
  Vec3<T> p = Vec3<T>::Zero();          // [m] origin of 2 seen from 1
  Mat3X<T> turn, shift;                 // 3 x n: angular velocity and dp/dt per unit rate
  Vec3<T> turn_bias = Vec3<T>::Zero();  // derivatives of angular velocity and of dp/dt when the rates are constant
  Vec3<T> shift_bias = Vec3<T>::Zero();

  explicit RelativeMotion(int n = 0) : turn(Mat3X<T>::Zero(3, n)), shift(Mat3X<T>::Zero(3, n)) {}
};

/// Motion of frame 1 relative to frame 2, in the axes of frame 2: twice the time derivative of -R* p.
template <class T>
RelativeMotion<T> inverse(const RelativeMotion<T>& m, const VecX<T>& rates) {
  const Vec3<T> w = m.turn * rates, pdot = m.shift * rates;
  const Mat3<T> Rt = m.R.transpose();
  RelativeMotion<T> out(static_cast<int>(rates.size()));
  out.R = Rt;
  out.p = -Rt * m.p;
  out.turn = -Rt * m.turn;
  out.shift = -Rt * (m.shift + tilde(m.p) * m.turn);
  out.turn_bias = -Rt * m.turn_bias;
  out.shift_bias = -Rt * (m.shift_bias - 2 * w.cross(pdot) - m.turn_bias.cross(m.p) + w.cross(w.cross(m.p)));
  return out;
}

/// What fixes the shape of a built-in hinge: unit axes as columns, pitch of helical [m/rad].
template <class T>
struct HingeShape {
  std::string type;
  Mat3X<T> axes;
  T pitch{0};
};

struct HingeSize {
  int nq, nv;
};

/// Numbers of coordinates and velocities of a built-in type; {-1, -1} for any other.
inline HingeSize hinge_size(const std::string& type) {
  if (type == "locked") return {0, 0};
  if (type == "revolute" || type == "prismatic" || type == "helical") return {1, 1};
  if (type == "cylindrical" || type == "universal" || type == "constant_velocity") return {2, 2};
  if (type == "gimbal" || type == "planar" || type == "translational") return {3, 3};
  if (type == "ball") return {4, 3};
  if (type == "free" || type == "free_body") return {7, 6};
  return {-1, -1};
}

/// R = exp(theta~) with theta = along x: turn = Jl(theta) along with the left Jacobian Jl = 1 + c_2 theta~ + c_3 theta~^2 of the rotation
/// vector; `rate` is theta'.
template <class T>
void turn_by_vector(const Mat3X<T>& along, const Vec3<T>& theta, const Vec3<T>& rate, RelativeMotion<T>& m) {
  const Mat3<T> t = tilde(theta), d = tilde(rate);
  const T x = theta.squaredNorm();
  const T c2 = stumpff(2, x), c3 = stumpff(3, x), c4 = stumpff(4, x), c5 = stumpff(5, x);
  m.R = Mat3<T>::Identity() + stumpff(1, x) * t + c2 * t * t;
  m.turn = (Mat3<T>::Identity() + c2 * t + c3 * t * t) * along;
  m.turn_bias = (c2 * d + c3 * (d * t + t * d) + theta.dot(rate) * ((2 * c4 - c3) * t + (3 * c5 - c4) * t * t)) * rate;
}

/// Motion of P relative to O, in O axes (conventions: table of hinges in docs/mathematics).
template <class T>
RelativeMotion<T> hinge_motion(const HingeShape<T>& h, const VecX<T>& q, const VecX<T>& v) {
  RelativeMotion<T> m(static_cast<int>(v.size()));
  const auto u = [&](int i) -> Vec3<T> { return h.axes.col(i); };
  if (h.type == "revolute" || h.type == "helical") {
    m.R = rotation(u(0), q[0]);
    m.turn = u(0);
    m.shift = h.pitch * u(0);
    m.p = h.pitch * q[0] * u(0);
  } else if (h.type == "prismatic") {
    m.p = q[0] * u(0);
    m.shift = u(0);
  } else if (h.type == "cylindrical") {
    m.R = rotation(u(0), q[0]);
    m.p = q[1] * u(0);
    m.turn.col(0) = m.shift.col(1) = u(0);
  } else if (h.type == "universal" || h.type == "gimbal") {
    Vec3<T> w = Vec3<T>::Zero();  // angular velocity of the axes turned so far
    for (int i = 0; i < static_cast<int>(v.size()); ++i) {
      m.turn.col(i) = m.R * u(i);
      m.turn_bias += w.cross(m.turn.col(i) * v[i]);
      w += m.turn.col(i) * v[i];
      m.R *= rotation(u(i), q[i]);
    }
  } else if (h.type == "constant_velocity") {
    const Mat3X<T> across = h.axes.leftCols(2);
    turn_by_vector<T>(across, across * q, across * v, m);
  } else if (h.type == "planar") {
    const Vec3<T> normal = u(0).cross(u(1));
    m.R = rotation(normal, q[2]);
    m.p = q[0] * u(0) + q[1] * u(1);
    m.shift.col(0) = u(0);
    m.shift.col(1) = u(1);
    m.turn.col(2) = normal;
  } else if (h.type == "translational") {
    m.p = q;
    m.shift.setIdentity();
  } else if (h.type == "ball" || h.type == "free" || h.type == "free_body") {
    m.R = rotation_of_quaternion(q);
    m.turn.leftCols(3) = m.R;  // v = angular velocity in P axes
    if (h.type != "ball") m.p = q.tail(3);
    if (h.type == "free") m.shift.rightCols(3).setIdentity();
    if (h.type == "free_body") {
      m.shift.rightCols(3) = m.R;
      m.shift_bias = m.R * Vec3<T>(v.head(3)).cross(Vec3<T>(v.tail(3)));
    }
  }
  return m;
}

/// Time derivative of the coordinates of a built-in hinge.
template <class T>
VecX<T> hinge_qdot(const HingeShape<T>& h, const VecX<T>& q, const VecX<T>& v) {
  if (hinge_size(h.type).nq == hinge_size(h.type).nv) return v;
  VecX<T> out(q.size());
  const Vec3<T> r(q[1], q[2], q[3]), w(v[0], v[1], v[2]);
  out[0] = -r.dot(w) / 2;
  out.segment(1, 3) = (q[0] * w + r.cross(w)) / 2;
  if (h.type == "free") out.tail(3) = v.tail(3);
  if (h.type == "free_body") out.tail(3) = rotation_of_quaternion(q) * v.tail(3);
  return out;
}

/// A node that moves with the modes: position + Phi eta + 1/2 eta* Q eta, orientation exp((Psi eta)~) R.
template <class T>
struct ModalPoint {
  std::string name;
  Vec3<T> position = Vec3<T>::Zero();  // [m] undeformed
  Mat3<T> R = Mat3<T>::Identity();     // node axes to body axes, undeformed
  Mat3X<T> Phi, Psi;                   // 3 x modes
  std::vector<MatX<T>> Q;              // empty, or 3 matrices modes x modes
};

/// Motion of a node relative to its body's frame B, in B axes.
template <class T>
RelativeMotion<T> node_motion(const ModalPoint<T>& node, const VecX<T>& eta, const VecX<T>& etadot) {
  RelativeMotion<T> m(static_cast<int>(eta.size()));
  if (eta.size() == 0) {
    m.R = node.R, m.p = node.position;
    return m;
  }
  turn_by_vector<T>(node.Psi, node.Psi * eta, node.Psi * etadot, m);
  m.R *= node.R;
  m.p = node.position + node.Phi * eta;
  m.shift = node.Phi;
  for (std::size_t i = 0; i < node.Q.size(); ++i) {
    m.p[i] += eta.dot(node.Q[i] * eta) / 2;
    m.shift.row(i) += (node.Q[i] * eta).transpose();  // Q symmetric
    m.shift_bias[i] = etadot.dot(node.Q[i] * etadot);
  }
  return m;
}

}  // namespace cardan::reference
