#pragma once
// 6 x m arrays, one column of six numbers per mode: shapes of a node [psi; phi], M_re, U. Only vectors see m.
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

/// out = sum_j x_j [column j] of a 6 x m array: shapes of a node, or M_re. Even and odd columns apart, two sums under way.
template <class E, class X, class T>
static void sum_columns(const E* a, const X* x, int m, T* out) {
  T s[6] = {T(0), T(0), T(0), T(0), T(0), T(0)}, t[6] = {T(0), T(0), T(0), T(0), T(0), T(0)};
  int j = 0;
  for (; j + 2 <= m; j += 2, a += 12) {
    for (int r = 0; r < 6; ++r) s[r] = s[r] + T(x[j]) * T(a[r]);
    for (int r = 0; r < 6; ++r) t[r] = t[r] + T(x[j + 1]) * T(a[6 + r]);
  }
  if (j < m)
    for (int r = 0; r < 6; ++r) s[r] = s[r] + T(x[j]) * T(a[r]);
  for (int r = 0; r < 6; ++r) out[r] = s[r] + t[r];
}
/// The same for two vectors at once.
template <class E, class T>
static void sum_columns(const E* a, const T* x, const T* y, int m, T* out_x, T* out_y) {
  T s[6] = {T(0), T(0), T(0), T(0), T(0), T(0)}, t[6] = {T(0), T(0), T(0), T(0), T(0), T(0)};
  for (int j = 0; j < m; ++j)
    for (int r = 0; r < 6; ++r) {
      s[r] = s[r] + x[j] * T(a[6 * j + r]);
      t[r] = t[r] + y[j] * T(a[6 * j + r]);
    }
  for (int r = 0; r < 6; ++r) out_x[r] = s[r], out_y[r] = t[r];
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
