#pragma once
// Spatial inertias: rigid (10 numbers) and articulated (21 numbers, symmetric by type: rounding cannot make them
// asymmetric, which is what keeps all digits when masses grow towards the tip; docs/benchmarks.md).
#include "core/spatial/pose.hpp"

namespace cardan {

/// M of a rigid body about its frame origin: m [kg], h = m p_Bcm [kg m], J about the origin [kg m^2].
template <class T>
struct RigidInertia {
  T m{};
  Vec3<T> h{};
  Sym3<T> J{};
};

/// M V = [J w + h x v; m v - h x w].
template <class T>
CARDAN_INLINE constexpr Force<T> operator*(const RigidInertia<T>& M, const Motion<T>& V) {
  return {M.J * V.w + cross(M.h, V.v), M.m * V.v - cross(M.h, V.w)};
}
template <class T>
CARDAN_INLINE constexpr RigidInertia<T> operator+(const RigidInertia<T>& a, const RigidInertia<T>& b) {
  return {a.m + b.m, a.h + b.h, a.J + b.J};
}
/// Inertia about the origin from that about the mass centre p: J = J_c - m p~ p~ (parallel axis theorem).
template <class T>
static constexpr RigidInertia<T> about_origin(const T& m, const Vec3<T>& p, const Sym3<T>& J_c) {
  return {m,
          m * p,
          {J_c.xx + m * (p.y * p.y + p.z * p.z), J_c.yy + m * (p.x * p.x + p.z * p.z), J_c.zz + m * (p.x * p.x + p.y * p.y),
           J_c.xy - m * p.x * p.y, J_c.xz - m * p.x * p.z, J_c.yz - m * p.y * p.z}};
}
/// The same body seen from frame A, where B stands at the pose AB: phi M phi*.
template <class T>
static constexpr RigidInertia<T> to_inboard(const Pose<T>& AB, const RigidInertia<T>& M) {
  const Vec3<T> h = AB.R * M.h;
  const Vec3<T>& p = AB.p;
  Sym3<T> J = rotate(AB.R, M.J);
  const T ph = dot(p, h), pp = dot(p, p), two = T(2);
  J.xx = J.xx + M.m * (pp - p.x * p.x) + two * (ph - p.x * h.x);
  J.yy = J.yy + M.m * (pp - p.y * p.y) + two * (ph - p.y * h.y);
  J.zz = J.zz + M.m * (pp - p.z * p.z) + two * (ph - p.z * h.z);
  J.xy = J.xy - M.m * p.x * p.y - p.x * h.y - p.y * h.x;
  J.xz = J.xz - M.m * p.x * p.z - p.x * h.z - p.z * h.x;
  J.yz = J.yz - M.m * p.y * p.z - p.y * h.z - p.z * h.y;
  return {M.m, h + M.m * p, J};
}
/// Gyroscopic force b of the gamma form: [w x J w; w x (w x h)] (no linear velocity occurs; mathematics 0.6, 1).
template <class T>
CARDAN_INLINE constexpr Force<T> gyroscopic(const RigidInertia<T>& M, const Vec3<T>& w) {
  return {cross(w, M.J * w), cross(w, cross(w, M.h))};
}

template <class T, class S>
CARDAN_INLINE constexpr Sym3<T> cast(const Sym3<S>& m) {
  return {T(m.xx), T(m.yy), T(m.zz), T(m.xy), T(m.xz), T(m.yz)};
}
template <class T, class S>
static constexpr RigidInertia<T> cast(const RigidInertia<S>& M) {
  return {T(M.m), cast<T>(M.h), {T(M.J.xx), T(M.J.yy), T(M.J.zz), T(M.J.xy), T(M.J.xz), T(M.J.yz)}};
}

/// P = [J B; B* M]: moment from angular acceleration J, moment from linear acceleration B, force from linear M.
template <class T>
struct ArticulatedInertia {
  Sym3<T> J{};
  Mat3<T> B{};
  Sym3<T> M{};
};

template <class T, class S>
CARDAN_INLINE constexpr ArticulatedInertia<T> cast(const ArticulatedInertia<S>& P) {
  return {cast<T>(P.J), cast<T>(P.B), cast<T>(P.M)};
}
template <class T>
CARDAN_INLINE constexpr Force<T> operator*(const ArticulatedInertia<T>& P, const Motion<T>& V) {
  return {P.J * V.w + P.B * V.v, transpose_times(P.B, V.w) + P.M * V.v};
}
template <class T>
CARDAN_INLINE constexpr ArticulatedInertia<T> operator+(const ArticulatedInertia<T>& a, const ArticulatedInertia<T>& b) {
  return {a.J + b.J, a.B + b.B, a.M + b.M};
}
template <class T>
CARDAN_INLINE constexpr ArticulatedInertia<T>& operator+=(ArticulatedInertia<T>& a, const ArticulatedInertia<T>& b) {
  a.J += b.J;
  a.B = a.B + b.B;
  a.M += b.M;
  return a;
}
template <class T>
CARDAN_INLINE constexpr ArticulatedInertia<T>& operator-=(ArticulatedInertia<T>& a, const ArticulatedInertia<T>& b) {
  a.J = {a.J.xx - b.J.xx, a.J.yy - b.J.yy, a.J.zz - b.J.zz, a.J.xy - b.J.xy, a.J.xz - b.J.xz, a.J.yz - b.J.yz};
  a.B = {a.B.xx - b.B.xx, a.B.xy - b.B.xy, a.B.xz - b.B.xz, a.B.yx - b.B.yx, a.B.yy - b.B.yy,
         a.B.yz - b.B.yz, a.B.zx - b.B.zx, a.B.zy - b.B.zy, a.B.zz - b.B.zz};
  a.M = {a.M.xx - b.M.xx, a.M.yy - b.M.yy, a.M.zz - b.M.zz, a.M.xy - b.M.xy, a.M.xz - b.M.xz, a.M.yz - b.M.yz};
  return a;
}
template <class T>
CARDAN_INLINE constexpr ArticulatedInertia<T> articulated(const RigidInertia<T>& M) {
  const T o(0);
  return {M.J, tilde(M.h), {M.m, M.m, M.m, o, o, o}};
}
/// P - a b* with a b* symmetric (sum of such terms): one column of P+ = P - G D G*.
template <class T>
static constexpr void subtract_outer(ArticulatedInertia<T>& P, const Force<T>& a, const Force<T>& b) {
  P.J = {P.J.xx - a.n.x * b.n.x, P.J.yy - a.n.y * b.n.y, P.J.zz - a.n.z * b.n.z,
         P.J.xy - a.n.x * b.n.y, P.J.xz - a.n.x * b.n.z, P.J.yz - a.n.y * b.n.z};
  P.B = {P.B.xx - a.n.x * b.f.x, P.B.xy - a.n.x * b.f.y, P.B.xz - a.n.x * b.f.z, P.B.yx - a.n.y * b.f.x, P.B.yy - a.n.y * b.f.y,
         P.B.yz - a.n.y * b.f.z, P.B.zx - a.n.z * b.f.x, P.B.zy - a.n.z * b.f.y, P.B.zz - a.n.z * b.f.z};
  P.M = {P.M.xx - a.f.x * b.f.x, P.M.yy - a.f.y * b.f.y, P.M.zz - a.f.z * b.f.z,
         P.M.xy - a.f.x * b.f.y, P.M.xz - a.f.x * b.f.z, P.M.yz - a.f.y * b.f.z};
}
/// The same inertia about another point, l = p_AB, axes kept: J <- J - B l~ + l~ B* - l~ M l~,  B <- B + l~ M.
template <class T>
static constexpr ArticulatedInertia<T> shift(const Vec3<T>& l, const ArticulatedInertia<T>& P) {
  const Sym3<T>& M = P.M;
  const Mat3<T>& B = P.B;
  Sym3<T> J = P.J;
  // E = l~ M
  const Mat3<T> E{l.y * M.xz - l.z * M.xy, l.y * M.yz - l.z * M.yy, l.y * M.zz - l.z * M.yz,
                  l.z * M.xx - l.x * M.xz, l.z * M.xy - l.x * M.yz, l.z * M.xz - l.x * M.zz,
                  l.x * M.xy - l.y * M.xx, l.x * M.yy - l.y * M.xy, l.x * M.yz - l.y * M.xz};
  // S = B l~ (rows of B crossed with l), F = E l~
  const Vec3<T> b1{B.xx, B.xy, B.xz}, b2{B.yx, B.yy, B.yz}, b3{B.zx, B.zy, B.zz};
  const Vec3<T> e1{E.xx, E.xy, E.xz}, e2{E.yx, E.yy, E.yz}, e3{E.zx, E.zy, E.zz};
  const Vec3<T> s1 = cross(b1, l), s2 = cross(b2, l), s3 = cross(b3, l);  // row i of B l~ is b_i x l
  const Vec3<T> f1 = cross(e1, l), f2 = cross(e2, l), f3 = cross(e3, l);
  const T two(2);
  J.xx = J.xx - two * s1.x - f1.x;
  J.yy = J.yy - two * s2.y - f2.y;
  J.zz = J.zz - two * s3.z - f3.z;
  J.xy = J.xy - s1.y - s2.x - f1.y;
  J.xz = J.xz - s1.z - s3.x - f1.z;
  J.yz = J.yz - s2.z - s3.y - f2.z;
  return {J, B + E, M};
}
/// Phi P Phi*: an articulated inertia at B referred to A.
template <class T>
static constexpr ArticulatedInertia<T> to_inboard(const Pose<T>& AB, const ArticulatedInertia<T>& P) {
  const Mat3<T>& R = AB.R;
  return shift(AB.p, ArticulatedInertia<T>{rotate(R, P.J), R * P.B * transpose(R), rotate(R, P.M)});
}

}  // namespace cardan
