#pragma once
// Mass matrix M = H phi M phi* H* of trees of rigid bodies, O(N^2): composite inertia R (Lyapunov recursion), a rigid inertia of
// ten numbers, and each column R H* carried towards the base (mathematics 4.3).
#include "core/soa/kernels_axis.hpp"
#include "core/soa/kernels_free.hpp"

namespace cardan::soa {

/// phi R phi* of an axis body: turned by the angle, moved by l (no component along the axis), tilted.
template <class T, int I, Tilt TILT>
CARDAN_INLINE RigidInertia<T> inertia_to_inboard(const AxisBody& b, const T& c, const T& s, RigidInertia<T> R) {
  constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
  turn<I>(R.h, c, s);
  turn<I>(R.J, c, s);
  const T lj(b.l[0]), lk(b.l[1]), hi = at<I>(R.h), hj = at<J>(R.h), hk = at<K>(R.h);
  // J - h~ l~ - l~ h~ - m l~ l~, h + m l
  const T aj = lj * (R.m * lj + hj + hj), ak = lk * (R.m * lk + hk + hk);
  entry<I, I>(R.J) = entry<I, I>(R.J) + (aj + ak);
  entry<J, J>(R.J) = entry<J, J>(R.J) + ak;
  entry<K, K>(R.J) = entry<K, K>(R.J) + aj;
  entry<I, J>(R.J) = entry<I, J>(R.J) - lj * hi;
  entry<I, K>(R.J) = entry<I, K>(R.J) - lk * hi;
  entry<J, K>(R.J) = entry<J, K>(R.J) - (lj * hk + lk * (hj + R.m * lj));
  at<J>(R.h) = hj + R.m * lj;
  at<K>(R.h) = hk + R.m * lk;
  tilt<TILT, T>(b, R.h);
  tilt<TILT, T>(b, R.J);
  return R;
}

/// Column j of H* at B, of any body.
template <class T>
static Motion<T> hinge_column(const SweepModel& model, const Workspace<T>& ws, int k, int j) {
  const SweepBody& b = model.bodies[k];
  const Vec3<T> none{T(0), T(0), T(0)};
  if (is_axis(b.kind)) return {cast<T>(b.axis), none};
  if (b.kind != BodyKernel::free) return ws.H(k)[j];
  const Vec3<T> unit{T(j % 3 == 0), T(j % 3 == 1), T(j % 3 == 2)};
  if (j < 3) return {unit, none};
  return {none, b.shape == CARDAN_SHAPE_FREE ? transpose_times(ws.X(k).R, cast<T>(b.O.R) * unit) : unit};
}

/// M (nv x nv, column-major). Needs hinge_records, and outward of the bodies that are not on an axis kernel.
template <class T>
static void mass_matrix(const SweepModel& model, Workspace<T>& ws, const Inputs<T>&, T* M) {
  const int n = static_cast<int>(model.bodies.size()), nv = model.nv;
  RigidInertia<T>* R = ws.composite.data();
  const T *cosines = ws.cosines.data(), *sines = ws.sines.data();
  for (int k = 1; k < n; ++k) R[k] = cast<T>(model.bodies[k].M_sweep);
  for (int i = 0; i < nv * nv; ++i) M[i] = T(0);
  const auto put = [&](int row, int column, const T& value) { M[nv * column + row] = M[nv * row + column] = value; };
  // The wrench f at body p and all bodies inboard of it, projected on their hinges: column v of M.
  const auto project = [&](int p, Force<T> f, int v) {
    while (p > 0) {
      const SweepBody& b = model.bodies[p];
      if (is_axis(b.kind)) {
        const AxisBody& a = model.axis_bodies[p];
        for_axis(a.kind, [&]<int I, Tilt TILT>() {
          put(a.v, v, at<I>(f.n));
          if (a.parent > 0) f = force_to_inboard<T, I, TILT>(a, cosines[a.angle], sines[a.angle], f);
        });
      } else {
        for (int j = 0; j < b.nv; ++j) put(b.v + j, v, dot(hinge_column(model, ws, p, j), f));
        if (b.parent > 0) f = to_inboard(ws.X(p), f);
      }
      p = b.parent;
    }
  };
  for (int k = n - 1; k >= 1; --k) {
    const SweepBody& b = model.bodies[k];
    if (!is_axis(b.kind)) {
      if (b.parent > 0) R[b.parent] = R[b.parent] + to_inboard(ws.X(k), R[k]);
      for (int j = 0; j < b.nv; ++j) {
        const Force<T> f = R[k] * hinge_column(model, ws, k, j);
        for (int i = 0; i <= j; ++i) put(b.v + i, b.v + j, dot(hinge_column(model, ws, k, i), f));
        if (b.parent > 0) project(b.parent, to_inboard(ws.X(k), f), b.v + j);
      }
      continue;
    }
    const AxisBody& a = model.axis_bodies[k];
    if (a.kind == BodyKernel::rotor) {  // its inertia is part of the carrier's
      const T Ja(a.J_axial);
      put(a.v, a.v, Ja);
      project(a.parent, {Ja * rotor_axis<T>(a), {T(0), T(0), T(0)}}, a.v);
      continue;
    }
    for_axis(a.kind, [&]<int I, Tilt TILT>() {
      constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
      const T c = cosines[a.angle], s = sines[a.angle];
      Force<T> f;  // R e_i
      at<I>(f.n) = entry<I, I>(R[k].J), at<J>(f.n) = entry<I, J>(R[k].J), at<K>(f.n) = entry<I, K>(R[k].J);
      at<I>(f.f) = T(0), at<J>(f.f) = -at<K>(R[k].h), at<K>(f.f) = at<J>(R[k].h);
      put(a.v, a.v, at<I>(f.n));
      if (a.parent == 0) return;
      R[a.parent] = R[a.parent] + inertia_to_inboard<T, I, TILT>(a, c, s, R[k]);
      project(a.parent, force_to_inboard<T, I, TILT>(a, c, s, f), a.v);
    });
  }
}

}  // namespace cardan::soa
