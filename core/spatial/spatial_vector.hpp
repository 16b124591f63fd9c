#pragma once
// Spatial velocities and forces, angular part first. Motion and Force are distinct types: phi and phi* cannot be swapped.
#include "core/spatial/vec3.hpp"

namespace cardan {

/// [angular; linear]: spatial velocity [rad/s; m/s], acceleration, column of a hinge map.
template <class T>
struct Motion {
  Vec3<T> w{}, v{};
};
/// [moment; force]: [N m; N], momentum, column of P H*.
template <class T>
struct Force {
  Vec3<T> n{}, f{};
};

template <class T>
CARDAN_INLINE constexpr Motion<T> operator+(const Motion<T>& a, const Motion<T>& b) {
  return {a.w + b.w, a.v + b.v};
}
template <class T>
CARDAN_INLINE constexpr Motion<T> operator-(const Motion<T>& a, const Motion<T>& b) {
  return {a.w - b.w, a.v - b.v};
}
template <class T>
CARDAN_INLINE constexpr Motion<T>& operator+=(Motion<T>& a, const Motion<T>& b) {
  return a = a + b;
}
template <class T>
CARDAN_INLINE constexpr Motion<T>& operator-=(Motion<T>& a, const Motion<T>& b) {
  return a = a - b;
}
template <class T>
CARDAN_INLINE constexpr Motion<T> operator*(const T& s, const Motion<T>& a) {
  return {s * a.w, s * a.v};
}
template <class T>
CARDAN_INLINE constexpr Force<T> operator+(const Force<T>& a, const Force<T>& b) {
  return {a.n + b.n, a.f + b.f};
}
template <class T>
CARDAN_INLINE constexpr Force<T> operator-(const Force<T>& a, const Force<T>& b) {
  return {a.n - b.n, a.f - b.f};
}
template <class T>
CARDAN_INLINE constexpr Force<T>& operator+=(Force<T>& a, const Force<T>& b) {
  return a = a + b;
}
template <class T>
CARDAN_INLINE constexpr Force<T>& operator-=(Force<T>& a, const Force<T>& b) {
  return a = a - b;
}
template <class T>
CARDAN_INLINE constexpr Force<T> operator*(const T& s, const Force<T>& a) {
  return {s * a.n, s * a.f};
}

/// Power f* V [W].
template <class T>
CARDAN_INLINE constexpr T dot(const Motion<T>& V, const Force<T>& f) {
  return dot(V.w, f.n) + dot(V.v, f.f);
}

}  // namespace cardan
