#pragma once
// Matrices of trees of rigid bodies, all columns side by side: M = H phi M phi* H* from composite inertias (mathematics 4.3), and M^-1 =
// (I - H psi K)* D^-1 (I - H psi K) from articulated ones (4.6). In depth-first order (ColumnOrder) the columns that pass through a body
// are a range, its own and those outboard of it: what a body does with a column is a loop over numbers that stand side by side.
#include "core/soa/columns.hpp"
#include "core/soa/kernels_acceleration.hpp"
#include "core/soa/kernels_composite.hpp"

namespace cardan::soa {

/// A spatial force or motion of each column, number by number: six rows.
template <class T>
struct ColumnRows {
  T* x[6];
  CARDAN_INLINE ColumnRows(T* at, int stride) : x{at, at + stride, at + 2 * stride, at + 3 * stride, at + 4 * stride, at + 5 * stride} {}
  CARDAN_INLINE Force<T> force(int c) const { return {{x[0][c], x[1][c], x[2][c]}, {x[3][c], x[4][c], x[5][c]}}; }
  CARDAN_INLINE Motion<T> motion(int c) const { return {{x[0][c], x[1][c], x[2][c]}, {x[3][c], x[4][c], x[5][c]}}; }
  CARDAN_INLINE void set(int c, const Vec3<T>& a, const Vec3<T>& b) const {
    x[0][c] = a.x, x[1][c] = a.y, x[2][c] = a.z, x[3][c] = b.x, x[4][c] = b.y, x[5][c] = b.z;
  }
  CARDAN_INLINE void set(int c, const Force<T>& f) const { set(c, f.n, f.f); }
  CARDAN_INLINE void set(int c, const Motion<T>& a) const { set(c, a.w, a.v); }
};

/// f(c), the columns one after the other: they do not depend on each other.
template <class F>
CARDAN_INLINE void for_columns(int begin, int end, const F& f) {
  if (end == begin + 1) return f(begin);  // of a leaf
  CARDAN_INDEPENDENT
  for (int c = begin; c < end; ++c) f(c);
}

#ifdef __AVX2__
/// Four columns of four numbers from four rows, nv numbers from row to row.
CARDAN_INLINE void turn_four(const double* rows, double* columns, std::ptrdiff_t nv) {
  using Four [[gnu::vector_size(32)]] = double;
  Four a, b, c, d;
  __builtin_memcpy(&a, rows, sizeof a);
  __builtin_memcpy(&b, rows + nv, sizeof b);
  __builtin_memcpy(&c, rows + 2 * nv, sizeof c);
  __builtin_memcpy(&d, rows + 3 * nv, sizeof d);
  const Four ab0 = __builtin_shufflevector(a, b, 0, 4, 2, 6), ab1 = __builtin_shufflevector(a, b, 1, 5, 3, 7);
  const Four cd0 = __builtin_shufflevector(c, d, 0, 4, 2, 6), cd1 = __builtin_shufflevector(c, d, 1, 5, 3, 7);
  a = __builtin_shufflevector(ab0, cd0, 0, 1, 4, 5), b = __builtin_shufflevector(ab1, cd1, 0, 1, 4, 5);
  c = __builtin_shufflevector(ab0, cd0, 2, 3, 6, 7), d = __builtin_shufflevector(ab1, cd1, 2, 3, 6, 7);
  __builtin_memcpy(columns, &a, sizeof a);
  __builtin_memcpy(columns + nv, &b, sizeof b);
  __builtin_memcpy(columns + 2 * nv, &c, sizeof c);
  __builtin_memcpy(columns + 3 * nv, &d, sizeof d);
}
#endif
template <class T>
CARDAN_INLINE void turn_four(const T* rows, T* columns, std::ptrdiff_t nv) {
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i) columns[nv * j + i] = rows[nv * i + j];
}

/// Below the diagonal what stands above it: row i from its diagonal to ends[i], the rest of it is zero; without ends, to the last column.
template <class T>
static void mirror(T* matrix, std::ptrdiff_t nv, const int* ends) {
  std::ptrdiff_t i = 0;
  for (; i + 4 <= nv; i += 4) {
    const std::ptrdiff_t end = ends ? std::max(std::max(ends[i], ends[i + 1]), std::max(ends[i + 2], ends[i + 3])) : nv;
    for (int k = 0; k < 3; ++k)
      for (int j = k + 1; j < 4; ++j) matrix[nv * (i + j) + i + k] = matrix[nv * (i + k) + i + j];
    std::ptrdiff_t j = i + 4;
    for (; j < end && j + 4 <= nv; j += 4) turn_four(matrix + nv * i + j, matrix + nv * j + i, nv);
    for (; j < end; ++j)
      for (int k = 0; k < 4; ++k) matrix[nv * j + i + k] = matrix[nv * (i + k) + j];
  }
  for (; i < nv; ++i)
    for (std::ptrdiff_t j = i + 1; j < nv; ++j) matrix[nv * j + i] = matrix[nv * i + j];
}

/// The matrix in the order of the user. `rows`: depth-first, row i from its diagonal on; `coupled`: to the last column outboard of its body
/// alone, the rest is zero.
template <class T>
static void symmetric_from(const SweepModel& model, bool coupled, const T* rows, T* matrix) {
  const ColumnOrder& order = model.columns;
  const std::ptrdiff_t nv = model.nv;
  if (order.as_given) return mirror(matrix, nv, coupled && !order.one_chain ? order.ends.data() : nullptr);
  const int* v = order.v.data();
  if (coupled && !order.one_chain)
    for (std::ptrdiff_t i = 0; i < nv * nv; ++i) matrix[i] = T(0);
  for (const int k : order.bodies) {
    const int begin = order.of[k].begin, end = coupled ? order.of[k].end : model.nv;
    for (int i = begin; i < begin + model.bodies[k].nv; ++i) {
      T *column = matrix + nv * v[i], *row = matrix + v[i];
      for (int j = i; j < end; ++j) column[v[j]] = row[nv * v[j]] = rows[nv * i + j];
    }
  }
}

/// Memory of both matrices in Workspace::columns: six rows of forces, six of motions for each slot, and the matrix itself where its order
/// is not that of the user.
static inline std::size_t columns_size(const SweepModel& model) {
  const auto n = static_cast<std::size_t>(model.nv);
  return 6 * n * static_cast<std::size_t>(1 + model.columns.slots) + (model.columns.as_given ? 0 : n * n);
}
template <class T>
struct ColumnWork {
  ColumnRows<T> force;
  T *motion, *rows;
  CARDAN_INLINE ColumnWork(const SweepModel& model, Workspace<T>& ws, T* matrix)
      : force(ws.columns.data(), model.nv), motion(ws.columns.data() + 6 * model.nv), rows(matrix) {
    if (!model.columns.as_given) rows = motion + 6 * static_cast<std::ptrdiff_t>(model.nv) * model.columns.slots;
  }
};

/// M (nv x nv, column-major). Needs hinge_records, outward of the bodies that are not on an axis kernel, and the memory.
template <class T>
static void mass_matrix(const SweepModel& model, Workspace<T>& ws, const Inputs<T>&, T* M) {
  const int nv = model.nv;
  const ColumnOrder& order = model.columns;
  const ColumnWork<T> work(model, ws, M);
  const ColumnRows<T> F = work.force;
  if (order.as_given && !order.one_chain)
    for (std::ptrdiff_t i = 0; i < static_cast<std::ptrdiff_t>(nv) * nv; ++i) M[i] = T(0);
  RigidInertia<T>* R = ws.composite.data();
  for (auto next = order.bodies.rbegin(); next != order.bodies.rend(); ++next) {
    const int k = *next, begin = order.of[k].begin, end = order.of[k].end;
    const SweepBody& b = model.bodies[k];
    if (order.of[k].leaf) R[k] = cast<T>(b.M_sweep);
    // Of siblings the last is met first.
    const RigidInertia<T> inboard = order.of[k].last ? cast<T>(model.bodies[b.parent].M_sweep) : R[b.parent];
    T* row = work.rows + static_cast<std::ptrdiff_t>(nv) * begin;
    if (!is_axis(b.kind)) {
      const Pose<T> X = ws.X(k);
      if (b.parent > 0) R[b.parent] = inboard + to_inboard(X, R[k]);
      for (int j = 0; j < b.nv; ++j) F.set(begin + j, R[k] * hinge_column(model, ws, k, j));
      for (int j = 0; j < b.nv; ++j, row += nv) {
        const Motion<T> H = hinge_column(model, ws, k, j);
        for_columns(begin + j, end, [&](int c) CARDAN_INLINE_BODY { row[c] = dot(H, F.force(c)); });
      }
      if (b.parent > 0) for_columns(begin, end, [&](int c) CARDAN_INLINE_BODY { F.set(c, to_inboard(X, F.force(c))); });
      continue;
    }
    const AxisBody& a = model.axis_bodies[k];
    if (a.kind == BodyKernel::rotor) {  // its inertia is part of the carrier's
      const T Ja(a.J_axial);
      if (order.of[k].last) R[a.parent] = inboard;
      row[begin] = Ja;
      F.set(begin, Ja * rotor_axis<T>(a), {T(0), T(0), T(0)});
      continue;
    }
    const T c = ws.cosines[a.angle], s = ws.sines[a.angle];
    for_axis(
        a.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
          constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
          Force<T> own;  // R e_i
          at<I>(own.n) = entry<I, I>(R[k].J), at<J>(own.n) = entry<I, J>(R[k].J), at<K>(own.n) = entry<I, K>(R[k].J);
          at<I>(own.f) = T(0), at<J>(own.f) = -at<K>(R[k].h), at<K>(own.f) = at<J>(R[k].h);
          F.set(begin, own);
          if (a.parent == 0) return for_columns(begin, end, [&](int i) CARDAN_INLINE_BODY { row[i] = F.x[I][i]; });
          R[a.parent] = inboard + inertia_to_inboard<T, I, TILT>(a, c, s, R[k]);
          for_columns(begin, end, [&](int i) CARDAN_INLINE_BODY {
            const Force<T> f = F.force(i);
            row[i] = at<I>(f.n);
            F.set(i, force_to_inboard<T, I, TILT>(a, c, s, f));
          });
        });
  }
  symmetric_from(model, true, work.rows, M);
}

// M^-1, tip to base: z of each column, and in its row nu = D^-1 eps, of a body with six free components tau - z. No z but its own goes
// inboard through such a body.

template <class T, int I, Tilt TILT>
CARDAN_INLINE void inward_columns(const AxisBody& a, const AxisRecord<T>& body, const T& c, const T& s, const ColumnRows<T>& z, int begin,
                                  int end, T* row) {
  constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
  const Force<T> G = body.G;
  const T inverse = body.inverse_D;
  z.set(begin, Vec3<T>{T(0), T(0), T(0)}, Vec3<T>{T(0), T(0), T(0)});
  z.x[I][begin] = T(-1);  // its own column: eps = tau - z_i, then z_i = tau
  for_columns(begin, end, [&](int i) CARDAN_INLINE_BODY {
    Force<T> f = z.force(i);
    const T eps = -at<I>(f.n);
    row[i] = eps * inverse;
    at<I>(f.n) = T(0);
    at<J>(f.n) = at<J>(f.n) + eps * at<J>(G.n);
    at<K>(f.n) = at<K>(f.n) + eps * at<K>(G.n);
    f.f += eps * G.f;
    z.set(i, force_to_inboard<T, I, TILT>(a, c, s, f));
  });
  Vec3<T> tau{T(0), T(0), T(0)};
  at<I>(tau) = T(1);
  tilt<TILT, T>(a, tau);
  z.x[0][begin] = z.x[0][begin] + tau.x, z.x[1][begin] = z.x[1][begin] + tau.y, z.x[2][begin] = z.x[2][begin] + tau.z;
}

template <class T, int NV>
static void inward_columns(Workspace<T>& ws, int k, const ColumnRows<T>& z, int begin, int end, T* rows, int nv) {
  const Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
  const Pose<T> X = ws.X(k);
  for (int j = 0; j < NV; ++j) z.set(begin + j, Force<T>());
  for (int i = begin; i < end; ++i) {
    Force<T> f = z.force(i);
    T nu[NV > 0 ? NV : 1];
    for (int j = 0; j < NV; ++j) nu[j] = T(i == begin + j ? 1 : 0) - dot(hinge.H[j], f);
    for (int j = 0; j < NV; ++j) f += nu[j] * hinge.G[j];
    if constexpr (NV == 1)
      nu[0] = nu[0] / hinge.L[0];
    else if constexpr (NV > 1)
      solve_hinge<T, NV>(hinge, nu);
    for (int j = 0; j < NV; ++j) rows[nv * j + i] = nu[j];
    z.set(i, to_inboard(X, f));
  }
}

/// Of six free components: the wrench at P of a unit force on each, P axes.
template <class T>
static Force<T> unit_wrench(const SweepModel& model, const Workspace<T>& ws, int k, int j) {
  const Motion<T> column = hinge_column(model, ws, k, j);  // H^-1 = H*: a rotation
  return {column.w, column.v};
}

template <class T>
static void inward_columns_free(const SweepModel& model, Workspace<T>& ws, int k, const ColumnRows<T>& z, int begin, int end, T* rows) {
  const int nv = model.nv;
  for (int r = 0; r < 6; ++r)
    for (int i = begin + 6; i < end; ++i) {
      rows[nv * r + i] = -z.x[r][i];
      z.x[r][i] = T(0);
    }
  for (int j = 0; j < 6; ++j) {
    const Force<T> f = unit_wrench(model, ws, k, j);
    rows[begin + j] = f.n.x, rows[nv + begin + j] = f.n.y, rows[2 * nv + begin + j] = f.n.z;
    rows[3 * nv + begin + j] = f.f.x, rows[4 * nv + begin + j] = f.f.y, rows[5 * nv + begin + j] = f.f.z;
    z.set(begin + j, to_inboard(ws.X(k), f));
  }
}

// Base to tip: v' = nu - G* delta+, delta = delta+ + H* v', in the columns from the first of the body on: the rest follows by symmetry.

template <class T, int I, Tilt TILT>
CARDAN_INLINE void outward_columns(const AxisBody& a, const AxisRecord<T>& body, const T& c, const T& s, const ColumnRows<T>& from,
                                   const ColumnRows<T>& to, int begin, int end, T* row) {
  constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
  const Force<T> G = body.G;
  for_columns(begin, end, [&](int i) CARDAN_INLINE_BODY {
    Motion<T> d = motion_to_outboard<T, I, TILT>(a, c, s, from.motion(i));
    const T nudot = ((row[i] - at<I>(d.w)) - at<J>(d.w) * at<J>(G.n) - at<K>(d.w) * at<K>(G.n)) - dot(d.v, G.f);
    row[i] = nudot;
    at<I>(d.w) = at<I>(d.w) + nudot;
    to.set(i, d);
  });
}

template <class T, int NV>
static void outward_columns(Workspace<T>& ws, int k, const ColumnRows<T>& from, const ColumnRows<T>& to, int begin, int end, T* rows,
                            int nv) {
  const Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
  const Pose<T> X = ws.X(k);
  for_columns(begin, end, [&](int i) CARDAN_INLINE_BODY {
    const Motion<T> delta = to_outboard(X, from.motion(i));
    Motion<T> after = delta;
    for (int j = 0; j < NV; ++j) {
      const T a = rows[nv * j + i] - dot(delta, hinge.G[j]);
      rows[nv * j + i] = a;
      after += a * hinge.H[j];
    }
    to.set(i, after);
  });
}

template <class T>
static void outward_columns_free(const SweepModel& model, Workspace<T>& ws, int k, const ColumnRows<T>& from, const ColumnRows<T>& to,
                                 int begin, int end, T* rows) {
  const int nv = model.nv;
  const T* L = ws.free(k).L;
  const Pose<T> X = ws.X(k);
  Motion<T> H[6];
  for (int j = 0; j < 6; ++j) H[j] = hinge_column(model, ws, k, j);
  for_columns(begin, end, [&](int c) CARDAN_INLINE_BODY {
    T x[6];
    for (int i = 0; i < 6; ++i) x[i] = rows[nv * i + c];
    unrolled<6, 1>([&](auto i) CARDAN_INLINE_BODY {
      unrolled<decltype(i)::value>([&](auto j) CARDAN_INLINE_BODY { x[i] = x[i] - L[i * (i + 1) / 2 + j] * x[j]; });
    });
    for (int i = 0; i < 6; ++i) x[i] = x[i] * L[i * (i + 1) / 2 + i];
    unrolled<5>([&](auto up) CARDAN_INLINE_BODY {
      constexpr int i = 4 - decltype(up)::value;
      unrolled<6, i + 1>([&](auto j) CARDAN_INLINE_BODY { x[i] = x[i] - L[j * (j + 1) / 2 + i] * x[j]; });
    });
    const Motion<T> delta{{x[0], x[1], x[2]}, {x[3], x[4], x[5]}};
    const Motion<T> relative = delta - to_outboard(X, from.motion(c));
    for (int j = 0; j < 6; ++j) rows[nv * j + c] = dot(relative.w, H[j].w) + dot(relative.v, H[j].v);
    to.set(c, delta);
  });
}

/// M^-1, nv x nv, column-major: column j is the acceleration that a unit force on hinge velocity j gives to a system at rest. Needs P, D,
/// G of all bodies, and the memory.
template <class T>
static void inverse_by_columns(const SweepModel& model, Workspace<T>& ws, T* inverse) {
  const int nv = model.nv;
  const ColumnOrder& order = model.columns;
  const ColumnWork<T> work(model, ws, inverse);
  const T *cosines = ws.cosines.data(), *sines = ws.sines.data();
  for (std::ptrdiff_t i = 0; i < static_cast<std::ptrdiff_t>(nv) * nv; ++i) work.rows[i] = T(0);
  for (int i = 0; i < 6 * nv; ++i) work.motion[i] = T(0);  // of the ground
  for (auto next = order.bodies.rbegin(); next != order.bodies.rend(); ++next) {
    const int k = *next, begin = order.of[k].begin, end = order.of[k].end;
    const SweepBody& b = model.bodies[k];
    T* rows = work.rows + static_cast<std::ptrdiff_t>(nv) * begin;
    if (b.kind == BodyKernel::rotor) {
      rows[begin] = T(1) / T(model.axis_bodies[k].J_axial);
      work.force.set(begin, rotor_axis<T>(model.axis_bodies[k]), {T(0), T(0), T(0)});
    } else if (is_axis(b.kind)) {
      const AxisBody& a = model.axis_bodies[k];
      for_axis(
          a.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
            inward_columns<T, I, TILT>(a, ws.axis(k), cosines[a.angle], sines[a.angle], work.force, begin, end, rows);
          });
    } else if (b.kind == BodyKernel::free) {
      inward_columns_free(model, ws, k, work.force, begin, end, rows);
    } else {
      with_hinge_size<T>(b.nv, [&]<int NV>() { inward_columns<T, NV>(ws, k, work.force, begin, end, rows, nv); });
    }
  }
  for (const int k : order.bodies) {
    const SweepBody& b = model.bodies[k];
    const ColumnOrder::Of &own = order.of[k], &inboard = order.of[b.parent];
    const int begin = own.begin, end = own.limit;
    const ColumnRows<T> from(work.motion + 6 * nv * inboard.slot, nv), to(work.motion + 6 * nv * own.slot, nv);
    T* rows = work.rows + static_cast<std::ptrdiff_t>(nv) * begin;
    if (b.kind == BodyKernel::rotor) {
      const Vec3<T> u = rotor_axis<T>(model.axis_bodies[k]);
      for_columns(begin, end, [&](int i) CARDAN_INLINE_BODY { rows[i] = rows[i] - dot(u, from.motion(i).w); });
    } else if (is_axis(b.kind)) {
      const AxisBody& a = model.axis_bodies[k];
      for_axis(
          a.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
            outward_columns<T, I, TILT>(a, ws.axis(k), cosines[a.angle], sines[a.angle], from, to, begin, end, rows);
          });
    } else if (b.kind == BodyKernel::free) {
      outward_columns_free(model, ws, k, from, to, begin, end, rows);
    } else {
      with_hinge_size<T>(b.nv, [&]<int NV>() { outward_columns<T, NV>(ws, k, from, to, begin, end, rows, nv); });
    }
  }
  symmetric_from(model, false, work.rows, inverse);
}

}  // namespace cardan::soa
