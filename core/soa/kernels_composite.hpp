#pragma once
// Composite inertia R of trees of rigid bodies (Lyapunov recursion, mathematics 4.3), a rigid inertia of ten numbers.
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

}  // namespace cardan::soa
