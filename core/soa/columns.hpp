#pragma once
// 6 x m arrays, one column of six numbers per mode: shapes of a node [psi; phi], M_re, U. Only vectors see m.
#include "core/soa/lanes.hpp"
#include "core/spatial/spatial_vector.hpp"

namespace cardan::soa {

/// Column j of a 6 x m array as a force, and as a motion.
template <class T>
static Force<T> force_column(const T* a, int j) { return {{a[6 * j], a[6 * j + 1], a[6 * j + 2]}, {a[6 * j + 3], a[6 * j + 4], a[6 * j + 5]}}; }
template <class T>
static Motion<T> motion_column(const T* a, int j) { return {{a[6 * j], a[6 * j + 1], a[6 * j + 2]}, {a[6 * j + 3], a[6 * j + 4], a[6 * j + 5]}}; }

/// And back.
template <class T>
static void store(const Force<T>& f, T* out) { out[0] = f.n.x, out[1] = f.n.y, out[2] = f.n.z, out[3] = f.f.x, out[4] = f.f.y, out[5] = f.f.z; }
template <class T>
static void store(const Motion<T>& f, T* out) { out[0] = f.w.x, out[1] = f.w.y, out[2] = f.w.z, out[3] = f.v.x, out[4] = f.v.y, out[5] = f.v.z; }

/// Six numbers that are worked on together: a column of a 6 x m array.
template <class T>
struct Six {
  T a[6];
  CARDAN_INLINE Six() : a{T(0), T(0), T(0), T(0), T(0), T(0)} {}
  template <class E>
  CARDAN_INLINE explicit Six(const E* x) : a{T(x[0]), T(x[1]), T(x[2]), T(x[3]), T(x[4]), T(x[5])} {}
  CARDAN_INLINE void to(T* out) const {
    for (int r = 0; r < 6; ++r) out[r] = a[r];
  }
  /// this += f x
  CARDAN_INLINE void add(const T& f, const Six& x) {
    for (int r = 0; r < 6; ++r) a[r] = a[r] + f * x.a[r];
  }
  CARDAN_INLINE void operator+=(const Six& x) {
    for (int r = 0; r < 6; ++r) a[r] = a[r] + x.a[r];
  }
};
#ifdef __AVX2__
/// In registers of four and two. All of it is inlined: files for other instruction sets have the one above.
template <>
struct Six<double> {
  using Four [[gnu::vector_size(32)]] = double;
  using Two [[gnu::vector_size(16)]] = double;
  Four a;
  Two b;
  CARDAN_INLINE Six() : a{}, b{} {}
  CARDAN_INLINE explicit Six(const double* x) {
    __builtin_memcpy(&a, x, sizeof a);
    __builtin_memcpy(&b, x + 4, sizeof b);
  }
  CARDAN_INLINE void to(double* out) const {
    __builtin_memcpy(out, &a, sizeof a);
    __builtin_memcpy(out + 4, &b, sizeof b);
  }
  CARDAN_INLINE void add(const double& f, const Six& x) {
    a += f * x.a;
    b += f * x.b;
  }
  CARDAN_INLINE void operator+=(const Six& x) {
    a += x.a;
    b += x.b;
  }
};
#endif

/// out = sum_j x_j [column j] of a 6 x m array: shapes of a node, or M_re. Even and odd columns apart, two sums under way.
template <class E, class X, class T>
static void sum_columns(const E* a, const X* x, int m, T* out) {
  Six<T> s, t;
  int j = 0;
  for (; j + 2 <= m; j += 2, a += 12) {
    s.add(T(x[j]), Six<T>(a));
    t.add(T(x[j + 1]), Six<T>(a + 6));
  }
  if (j < m) s.add(T(x[j]), Six<T>(a));
  s += t;
  s.to(out);
}
/// The same for two vectors at once.
template <class E, class T>
static void sum_columns(const E* a, const T* x, const T* y, int m, T* out_x, T* out_y) {
  Six<T> s, t;
  int j = 0;
  if constexpr (kWidth<T> == 1) {  // lanes have as many sums under way as there are registers
    Six<T> u, v;
    for (; j + 2 <= m; j += 2, a += 12) {
      const Six<T> even(a), odd(a + 6);
      s.add(x[j], even), t.add(y[j], even);
      u.add(x[j + 1], odd), v.add(y[j + 1], odd);
    }
    s += u, t += v;
  }
  for (; j < m; ++j, a += 6) {
    const Six<T> column(a);
    s.add(x[j], column), t.add(y[j], column);
  }
  s.to(out_x), t.to(out_y);
}
/// x_j += w . [column j]; `rows`: the 6 x m array stored row by row.
template <class T>
static void add_rows(const double* rows, const T* w, int m, T* __restrict x) {
  for (int j = 0; j < m; ++j)
    x[j] = x[j] + (w[0] * T(rows[j]) + w[1] * T(rows[m + j]) + w[2] * T(rows[2 * m + j])) +
           (w[3] * T(rows[3 * m + j]) + w[4] * T(rows[4 * m + j]) + w[5] * T(rows[5 * m + j]));
}
/// The same with the array stored column by column.
template <class T>
static void add_columns(const T* a, const T* w, int m, T* x) {
  for (int j = 0; j < m; ++j) {
    const T* c = a + 6 * j;
    x[j] = x[j] + (w[0] * c[0] + w[1] * c[1] + w[2] * c[2]) + (w[3] * c[3] + w[4] * c[4] + w[5] * c[5]);
  }
}

}  // namespace cardan::soa
