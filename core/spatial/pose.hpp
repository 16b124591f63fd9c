#pragma once
// The rigid transformation X_BA of mathematics 0.1, stored as (R, p) and applied with two rotations and one cross
// product, never as a 6 x 6 product.
#include "core/spatial/spatial_vector.hpp"

namespace cardan {

/// Frame B in frame A: R = R_AB (B axes to A axes), p = p_AB [m], origin of B in A, A axes.
template <class T>
struct Pose {
  Mat3<T> R = Mat3<T>::identity();
  Vec3<T> p{};
};

/// X_AB X_BC: frame C in A.
template <class T>
static constexpr Pose<T> operator*(const Pose<T>& AB, const Pose<T>& BC) {
  return {AB.R * BC.R, AB.p + AB.R * BC.p};
}
template <class T>
static constexpr Pose<T> inverse(const Pose<T>& AB) {
  return {transpose(AB.R), -transpose_times(AB.R, AB.p)};
}

/// phi* with a change of axes: V_B = X_BA V_A, from A to the frame B fixed to the same body.
template <class T>
CARDAN_INLINE constexpr Motion<T> to_outboard(const Pose<T>& AB, const Motion<T>& V) {
  return {transpose_times(AB.R, V.w), transpose_times(AB.R, V.v + cross(V.w, AB.p))};
}
/// The inverse: V_A = X_AB V_B.
template <class T>
CARDAN_INLINE constexpr Motion<T> to_inboard(const Pose<T>& AB, const Motion<T>& V) {
  const Vec3<T> w = AB.R * V.w;
  return {w, AB.R * V.v + cross(AB.p, w)};
}
/// phi with a change of axes: f_A = X_BA* f_B, a wrench at B referred to A.
template <class T>
CARDAN_INLINE constexpr Force<T> to_inboard(const Pose<T>& AB, const Force<T>& f) {
  const Vec3<T> force = AB.R * f.f;
  return {AB.R * f.n + cross(AB.p, force), force};
}
/// The inverse: f_B = X_AB* f_A.
template <class T>
CARDAN_INLINE constexpr Force<T> to_outboard(const Pose<T>& AB, const Force<T>& f) {
  return {transpose_times(AB.R, f.n - cross(AB.p, f.f)), transpose_times(AB.R, f.f)};
}

template <class T, class S>
CARDAN_INLINE constexpr Vec3<T> cast(const Vec3<S>& a) {
  return {T(a.x), T(a.y), T(a.z)};
}
template <class T, class S>
static constexpr Mat3<T> cast(const Mat3<S>& a) {
  return {T(a.xx), T(a.xy), T(a.xz), T(a.yx), T(a.yy), T(a.yz), T(a.zx), T(a.zy), T(a.zz)};
}
template <class T, class S>
static constexpr Pose<T> cast(const Pose<S>& a) {
  return {cast<T>(a.R), cast<T>(a.p)};
}
template <class T, class S>
CARDAN_INLINE constexpr Motion<T> cast(const Motion<S>& a) {
  return {cast<T>(a.w), cast<T>(a.v)};
}
template <class T, class S>
CARDAN_INLINE constexpr Force<T> cast(const Force<S>& a) {
  return {cast<T>(a.n), cast<T>(a.f)};
}

}  // namespace cardan
