#pragma once
// 6 x m arrays, one column of six numbers per mode: shapes of a node [psi; phi], M_re, U. Only vectors see m.
#include <type_traits>

#include "core/soa/lanes.hpp"
#include "core/spatial/spatial_vector.hpp"

/// Of a lambda; where sweeps are not timed, inlining would only take minutes (CMakeLists.txt).
#ifndef CARDAN_NOT_TIMED
#define CARDAN_INLINE_BODY __attribute__((always_inline))
#else
#define CARDAN_INLINE_BODY
#endif
/// Before a loop whose iterations do not depend on each other, whatever its pointers say; clang finds out by itself.
#ifdef __clang__
#define CARDAN_INDEPENDENT
#else
#define CARDAN_INDEPENDENT _Pragma("GCC ivdep")
#endif

namespace cardan::soa {

/// Column j of a 6 x m array as a force, and as a motion.
template <class T>
static Force<T> force_column(const T* a, int j) {
  return {{a[6 * j], a[6 * j + 1], a[6 * j + 2]}, {a[6 * j + 3], a[6 * j + 4], a[6 * j + 5]}};
}
template <class T>
static Motion<T> motion_column(const T* a, int j) {
  return {{a[6 * j], a[6 * j + 1], a[6 * j + 2]}, {a[6 * j + 3], a[6 * j + 4], a[6 * j + 5]}};
}

/// And back.
template <class T>
static void store(const Force<T>& f, T* out) {
  out[0] = f.n.x, out[1] = f.n.y, out[2] = f.n.z, out[3] = f.f.x, out[4] = f.f.y, out[5] = f.f.z;
}
template <class T>
static void store(const Motion<T>& f, T* out) {
  out[0] = f.w.x, out[1] = f.w.y, out[2] = f.w.z, out[3] = f.v.x, out[4] = f.v.y, out[5] = f.v.z;
}

/// f(From), ..., f(N - 1), the index a constant: loops over small matrices that are to stay in registers. gcc leaves loops in
/// triangles rolled, and each is a branch mispredicted. Their bodies are CARDAN_INLINE_BODY, else they become functions.
template <int N, int From = 0, class F>
CARDAN_INLINE void unrolled(const F& f) {
  if constexpr (From < N) {
    f(std::integral_constant<int, From>{});
    unrolled<N, From + 1>(f);
  }
}

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

/// Twelve numbers that are worked on together: what a body and one node on it do with a mode.
template <class T>
struct Twelve {
  Six<T> a, b;
  CARDAN_INLINE Twelve() {}
  template <class E>
  CARDAN_INLINE explicit Twelve(const E* x) : a(x), b(x + 6) {}
  CARDAN_INLINE void to(T* out) const { a.to(out), b.to(out + 6); }
  CARDAN_INLINE void add(const T& f, const Twelve& x) { a.add(f, x.a), b.add(f, x.b); }
  CARDAN_INLINE void operator+=(const Twelve& x) { a += x.a, b += x.b; }
};
#ifdef __AVX2__
template <>
struct Twelve<double> {
  using Four = Six<double>::Four;
  Four a, b, c;
  CARDAN_INLINE Twelve() : a{}, b{}, c{} {}
  CARDAN_INLINE explicit Twelve(const double* x) {
    __builtin_memcpy(&a, x, sizeof a);
    __builtin_memcpy(&b, x + 4, sizeof b);
    __builtin_memcpy(&c, x + 8, sizeof c);
  }
  CARDAN_INLINE void to(double* out) const {
    __builtin_memcpy(out, &a, sizeof a);
    __builtin_memcpy(out + 4, &b, sizeof b);
    __builtin_memcpy(out + 8, &c, sizeof c);
  }
  CARDAN_INLINE void add(const double& f, const Twelve& x) {
    a += f * x.a;
    b += f * x.b;
    c += f * x.c;
  }
  CARDAN_INLINE void operator+=(const Twelve& x) {
    a += x.a;
    b += x.b;
    c += x.c;
  }
  /// In registers: gcc would read the twelve from memory again for each of two sums.
  CARDAN_INLINE void keep() { asm("" : "+x"(a), "+x"(b), "+x"(c)); }
};
#endif

/// out = sum_j x_j [column j], columns `stride` apart. With many modes four sums are under way, so that none waits for its last term.
template <class C, class T, class E, class X>
static void sum_columns_of(const E* a, int stride, const X* x, int m, T* out) {
  C s;
  int j = 0;
  if (m >= 8) {
    C t, u, v;
    for (; j + 4 <= m; j += 4, a += 4 * stride) {
      s.add(T(x[j]), C(a));
      t.add(T(x[j + 1]), C(a + stride));
      u.add(T(x[j + 2]), C(a + 2 * stride));
      v.add(T(x[j + 3]), C(a + 3 * stride));
    }
    s += t, u += v, s += u;
  }
  for (; j < m; ++j, a += stride) s.add(T(x[j]), C(a));
  s.to(out);
}
/// The same for two vectors at once.
template <class C, class T, class E>
static void sum_columns_of(const E* a, int stride, const T* x, const T* y, int m, T* out_x, T* out_y) {
  C s, t;
  int j = 0;
  if constexpr (kWidth<T> == 1) {  // lanes have as many sums under way as there are registers
    C u, v;
    for (; j + 2 <= m; j += 2, a += 2 * stride) {
      C even(a), odd(a + stride);
      if constexpr (requires { even.keep(); }) even.keep(), odd.keep();
      s.add(x[j], even), t.add(y[j], even);
      u.add(x[j + 1], odd), v.add(y[j + 1], odd);
    }
    s += u, t += v;
  }
  for (; j < m; ++j, a += stride) {
    const C column(a);
    s.add(x[j], column), t.add(y[j], column);
  }
  s.to(out_x), t.to(out_y);
}
/// out = sum_j x_j [column j] of a 6 x m array.
template <class E, class X, class T>
static void sum_columns(const E* a, const X* x, int m, T* out) {
  sum_columns_of<Six<T>>(a, 6, x, m, out);
}
/// The same of a `rows` x m array of constants, rows a multiple of six.
template <class T>
static void sum_columns(const double* a, int rows, const T* x, int m, T* out) {
  if constexpr (kWidth<T> == 1)  // of lanes the registers hold no more than six
    if (rows == 12) return sum_columns_of<Twelve<T>>(a, rows, x, m, out);
  for (int d = 0; d < rows; d += 6) sum_columns_of<Six<T>>(a + d, rows, x, m, out + d);
}
/// out_j = x_j + w . [column j]; `rows`: a 6 x m array stored row by row. out may be x.
template <class T>
static void add_rows(const double* rows, const T* w, int m, const T* x, T* out) {
  const T w0 = w[0], w1 = w[1], w2 = w[2], w3 = w[3], w4 = w[4], w5 = w[5];
  CARDAN_INDEPENDENT
  for (int j = 0; j < m; ++j)
    out[j] = x[j] + (w0 * T(rows[j]) + w1 * T(rows[m + j]) + w2 * T(rows[2 * m + j])) +
             (w3 * T(rows[3 * m + j]) + w4 * T(rows[4 * m + j]) + w5 * T(rows[5 * m + j]));
}
/// The same of twelve rows.
template <class T>
static void add_twelve_rows(const double* rows, const T* w, int m, const T* x, T* out) {
  const T w0 = w[0], w1 = w[1], w2 = w[2], w3 = w[3], w4 = w[4], w5 = w[5], w6 = w[6], w7 = w[7], w8 = w[8], w9 = w[9], w10 = w[10],
          w11 = w[11];
  CARDAN_INDEPENDENT
  for (int j = 0; j < m; ++j)
    out[j] = (x[j] + (w0 * T(rows[j]) + w1 * T(rows[m + j]) + w2 * T(rows[2 * m + j])) +
              (w3 * T(rows[3 * m + j]) + w4 * T(rows[4 * m + j]) + w5 * T(rows[5 * m + j]))) +
             ((w6 * T(rows[6 * m + j]) + w7 * T(rows[7 * m + j]) + w8 * T(rows[8 * m + j])) +
              (w9 * T(rows[9 * m + j]) + w10 * T(rows[10 * m + j]) + w11 * T(rows[11 * m + j])));
}
/// The same of n rows, a multiple of six.
template <class T>
static void add_rows(const double* rows, const T* w, int n, int m, const T* x, T* out) {
  int r = 0;
  for (; r + 12 <= n; r += 12, x = out) add_twelve_rows(rows + m * r, w + r, m, x, out);
  if (r < n) add_rows(rows + m * r, w + r, m, x, out);
}
/// Scalar product of six numbers.
template <class X, class Y>
CARDAN_INLINE auto dot_six(const X* x, const Y* y) {
  return (x[0] * y[0] + x[1] * y[1] + x[2] * y[2]) + (x[3] * y[3] + x[4] * y[4] + x[5] * y[5]);
}
/// x_j += w . [column j] of an array stored column by column.
template <class T>
static void add_columns(const T* a, const T* w, int m, T* x) {
  for (int j = 0; j < m; ++j) {
    const T* c = a + 6 * j;
    x[j] = x[j] + (w[0] * c[0] + w[1] * c[1] + w[2] * c[2]) + (w[3] * c[3] + w[4] * c[4] + w[5] * c[5]);
  }
}

}  // namespace cardan::soa
