#pragma once
// Three-vectors and 3 x 3 matrices on any scalar T (double, lanes, float128, a counting scalar). No Eigen: the sweeps are
// compiled once per instruction set and must not share inline library code. Conversions to Eigen: eigen_bridge.hpp.

// The sweeps are compiled once per instruction set and must share no function between the files (docs/adr/0013-instruction-sets.md):
// what they call is inlined, always, or static.
#ifndef CARDAN_INLINE
#define CARDAN_INLINE [[gnu::always_inline]] inline
#endif

namespace cardan {

template <class T>
struct Vec3 {
  T x{}, y{}, z{};
};

template <class T>
CARDAN_INLINE constexpr Vec3<T> operator+(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class T>
CARDAN_INLINE constexpr Vec3<T> operator-(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class T>
CARDAN_INLINE constexpr Vec3<T> operator-(const Vec3<T>& a) {
  return {-a.x, -a.y, -a.z};
}
template <class T>
CARDAN_INLINE constexpr Vec3<T> operator*(const T& s, const Vec3<T>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class T>
CARDAN_INLINE constexpr Vec3<T>& operator+=(Vec3<T>& a, const Vec3<T>& b) {
  return a = a + b;
}
template <class T>
CARDAN_INLINE constexpr Vec3<T>& operator-=(Vec3<T>& a, const Vec3<T>& b) {
  return a = a - b;
}
template <class T>
CARDAN_INLINE constexpr T dot(const Vec3<T>& a, const Vec3<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class T>
CARDAN_INLINE constexpr Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// Row-major 3 x 3 matrix: xy is row x, column y.
template <class T>
struct Mat3 {
  T xx{}, xy{}, xz{}, yx{}, yy{}, yz{}, zx{}, zy{}, zz{};

  CARDAN_INLINE static constexpr Mat3 identity() { return {T(1), T(0), T(0), T(0), T(1), T(0), T(0), T(0), T(1)}; }
};

template <class T>
CARDAN_INLINE constexpr Vec3<T> operator*(const Mat3<T>& m, const Vec3<T>& a) {
  return {m.xx * a.x + m.xy * a.y + m.xz * a.z, m.yx * a.x + m.yy * a.y + m.yz * a.z, m.zx * a.x + m.zy * a.y + m.zz * a.z};
}
/// m* a without forming the transpose.
template <class T>
CARDAN_INLINE constexpr Vec3<T> transpose_times(const Mat3<T>& m, const Vec3<T>& a) {
  return {m.xx * a.x + m.yx * a.y + m.zx * a.z, m.xy * a.x + m.yy * a.y + m.zy * a.z, m.xz * a.x + m.yz * a.y + m.zz * a.z};
}
template <class T>
static constexpr Mat3<T> operator*(const Mat3<T>& a, const Mat3<T>& b) {
  return {a.xx * b.xx + a.xy * b.yx + a.xz * b.zx, a.xx * b.xy + a.xy * b.yy + a.xz * b.zy, a.xx * b.xz + a.xy * b.yz + a.xz * b.zz,
          a.yx * b.xx + a.yy * b.yx + a.yz * b.zx, a.yx * b.xy + a.yy * b.yy + a.yz * b.zy, a.yx * b.xz + a.yy * b.yz + a.yz * b.zz,
          a.zx * b.xx + a.zy * b.yx + a.zz * b.zx, a.zx * b.xy + a.zy * b.yy + a.zz * b.zy, a.zx * b.xz + a.zy * b.yz + a.zz * b.zz};
}
template <class T>
CARDAN_INLINE constexpr Mat3<T> transpose(const Mat3<T>& a) {
  return {a.xx, a.yx, a.zx, a.xy, a.yy, a.zy, a.xz, a.yz, a.zz};
}
template <class T>
CARDAN_INLINE constexpr Mat3<T> operator+(const Mat3<T>& a, const Mat3<T>& b) {
  return {a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yx + b.yx, a.yy + b.yy, a.yz + b.yz, a.zx + b.zx, a.zy + b.zy, a.zz + b.zz};
}
/// a~ b = a x b.
template <class T>
CARDAN_INLINE constexpr Mat3<T> tilde(const Vec3<T>& a) {
  return {T(0), -a.z, a.y, a.z, T(0), -a.x, -a.y, a.x, T(0)};
}

/// Symmetric 3 x 3 matrix, 6 numbers: asymmetry cannot arise.
template <class T>
struct Sym3 {
  T xx{}, yy{}, zz{}, xy{}, xz{}, yz{};
};
template <class T>
CARDAN_INLINE constexpr Vec3<T> operator*(const Sym3<T>& m, const Vec3<T>& a) {
  return {m.xx * a.x + m.xy * a.y + m.xz * a.z, m.xy * a.x + m.yy * a.y + m.yz * a.z, m.xz * a.x + m.yz * a.y + m.zz * a.z};
}
template <class T>
CARDAN_INLINE constexpr Sym3<T> operator+(const Sym3<T>& a, const Sym3<T>& b) {
  return {a.xx + b.xx, a.yy + b.yy, a.zz + b.zz, a.xy + b.xy, a.xz + b.xz, a.yz + b.yz};
}
template <class T>
CARDAN_INLINE constexpr Sym3<T>& operator+=(Sym3<T>& a, const Sym3<T>& b) {
  return a = a + b;
}
/// R s R*.
template <class T>
static constexpr Sym3<T> rotate(const Mat3<T>& R, const Sym3<T>& s) {
  const Vec3<T> a = s * Vec3<T>{R.xx, R.xy, R.xz}, b = s * Vec3<T>{R.yx, R.yy, R.yz}, c = s * Vec3<T>{R.zx, R.zy, R.zz};
  const Vec3<T> rx{R.xx, R.xy, R.xz}, ry{R.yx, R.yy, R.yz}, rz{R.zx, R.zy, R.zz};
  return {dot(rx, a), dot(ry, b), dot(rz, c), dot(rx, b), dot(rx, c), dot(ry, c)};
}

/// Entries by compile-time index (0, 1, 2 = x, y, z): kernels written once for the three coordinate axes.
template <int I, class V>
CARDAN_INLINE constexpr auto& at(V& v) {
  if constexpr (I == 0)
    return v.x;
  else if constexpr (I == 1)
    return v.y;
  else
    return v.z;
}
template <int I, int J, class T>
CARDAN_INLINE constexpr T& entry(Sym3<T>& m) {
  if constexpr (I == J) {
    if constexpr (I == 0)
      return m.xx;
    else if constexpr (I == 1)
      return m.yy;
    else
      return m.zz;
  } else if constexpr (I + J == 1)
    return m.xy;
  else if constexpr (I + J == 2)
    return m.xz;
  else
    return m.yz;
}
template <int I, int J, class T>
CARDAN_INLINE constexpr T& entry(Mat3<T>& m) {
  if constexpr (I == 0) {
    if constexpr (J == 0)
      return m.xx;
    else if constexpr (J == 1)
      return m.xy;
    else
      return m.xz;
  } else if constexpr (I == 1) {
    if constexpr (J == 0)
      return m.yx;
    else if constexpr (J == 1)
      return m.yy;
    else
      return m.yz;
  } else {
    if constexpr (J == 0)
      return m.zx;
    else if constexpr (J == 1)
      return m.zy;
    else
      return m.zz;
  }
}

}  // namespace cardan
