#pragma once
// Six degrees of freedom between O and P (hinges `free` and `free_body`). H is invertible, so D = H P H* is inverted through P
// itself and nothing of the inertia passes inboard: P+ = 0, z+ = tau (the hinge forces as a wrench at P),
// delta = P^-1 (tau - z), v' = H^-* (delta - delta+).
#include "core/soa/workspace.hpp"
#include "core/spatial/rotation.hpp"

namespace cardan::soa {

/// R_OP of the quaternion.
template <class T>
static Mat3<T> free_rotation(const SweepBody& b, const T* q) {
  return rotation_of_quaternion(q[b.q], q[b.q + 1], q[b.q + 2], q[b.q + 3]);
}

/// Relative twist H* v at P, P axes: `free` gives its linear velocity in O axes, `free_body` in P axes.
template <class T>
static Motion<T> free_twist(const SweepBody& b, const Mat3<T>& R_OP, const T* v) {
  const Vec3<T> w{v[0], v[1], v[2]}, linear{v[3], v[4], v[5]};
  return {w, b.shape == CARDAN_SHAPE_FREE ? transpose_times(R_OP, linear) : linear};
}

template <class T, OutwardFor For>
static void outward_free(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, int begin, int end) {
  for (int k = begin; k < end; ++k) {
    const SweepBody& b = model.bodies[k];
    FreeRecord<T>& body = ws.free(k);
    Core<T>& core = ws.core(k);
    const Core<T>& inboard = ws.core(b.parent);
    const Mat3<T> R_OP = free_rotation(b, in.q), R_O = cast<T>(b.O.R);
    const T* l = in.q + b.q + 4;
    body.X = {R_O * R_OP, cast<T>(b.O.p) + R_O * Vec3<T>{l[0], l[1], l[2]}};
    const Vec3<T>& p = body.X.p;
    Motion<T>& gamma = core.gamma;
    Vec3<T> a = inboard.gamma.v + cross(inboard.gamma.w, p);
    gamma.w = transpose_times(body.X.R, inboard.gamma.w);
    core.w = {T(0), T(0), T(0)};
    if constexpr (For.velocity) {
      a += cross(inboard.w, cross(inboard.w, p));
      const Motion<T> rate = free_twist(b, R_OP, in.v + b.v);
      const Vec3<T> w1 = transpose_times(body.X.R, inboard.w);
      core.w = w1 + rate.w;
      gamma.w += cross(w1, rate.w);
      gamma.v = transpose_times(body.X.R, a) + T(2) * cross(w1, rate.v);
      if (b.shape == CARDAN_SHAPE_FREE_BODY) gamma.v += cross(rate.w, rate.v);
    } else {
      gamma.v = transpose_times(body.X.R, a);
    }
    if constexpr (For.vdot) gamma += free_twist(b, R_OP, in.vdot + b.v);
    const RigidInertia<T> M = cast<T>(b.M_sweep);
    body.z = M * gamma;
    if constexpr (For.velocity) body.z += gyroscopic(M, core.w);
    if constexpr (For.inertia) {
      core.P = articulated(M);
      core.P.J = cast<T>(b.J_P);
    }
    set_acceleration_field(core.E, core.w, gamma.w);
  }
}

/// P = L d L*; false at a direction without inertia.
template <class T>
static bool factor_free(const ArticulatedInertia<T>& P, T* L, Breakdown& breakdown) {
  const T rows[21] = {P.J.xx, P.J.xy, P.J.yy, P.J.xz, P.J.yz, P.J.zz, P.B.xx, P.B.yx, P.B.zx, P.M.xx, P.B.xy,
                      P.B.yy, P.B.zy, P.M.xy, P.M.yy, P.B.xz, P.B.yz, P.B.zz, P.M.xz, P.M.yz, P.M.zz};
  const T angular = P.J.xx + P.J.yy + P.J.zz, linear = P.M.xx + P.M.yy + P.M.zz;
  for (int i = 0; i < 6; ++i) {
    T* Li = L + i * (i + 1) / 2;
    T scaled[6], pivot = rows[i * (i + 1) / 2 + i];
    for (int j = 0; j < i; ++j) {
      T sum = rows[i * (i + 1) / 2 + j];
      const T* Lj = L + j * (j + 1) / 2;
      for (int l = 0; l < j; ++l) sum = sum - scaled[l] * Lj[l];
      scaled[j] = sum;
      Li[j] = sum * Lj[j];
      pivot = pivot - Li[j] * sum;
    }
    if (!(pivot > T(kSmallPivot) * (i < 3 ? angular : linear))) {
      const T scale[6] = {angular, angular, angular, linear, linear, linear};
      const T limit = rounding_of_pivot([&](int l, int m) { return l == m ? T(1) : L[l * (l + 1) / 2 + m]; }, scale, i);
      if (!(pivot > limit)) {
        breakdown.component = i;
        breakdown.value = static_cast<double>(pivot);
        breakdown.limit = static_cast<double>(limit);
        return false;
      }
    }
    Li[i] = T(1) / pivot;
  }
  return true;
}

template <class T, InwardFor For>
static void inward_free(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, int begin, int end) {
  for (int k = end - 1; k >= begin; --k) {
    const SweepBody& b = model.bodies[k];
    FreeRecord<T>& body = ws.free(k);
    if constexpr (For.inertia) {
      Breakdown bad;
      bad.body = k;
      if (!factor_free(ws.core(k).P, body.L, bad)) {
        ws.breakdown = bad;
        return;
      }
    }
    if constexpr (For.bias) {
      const T* tau = in.tau ? in.tau + b.v : nullptr;
      for (int i = 0; i < 6; ++i) body.tau[i] = tau ? tau[i] : T(0);
      if (tau && b.shape == CARDAN_SHAPE_FREE) {
        const Vec3<T> f = transpose_times(free_rotation(b, in.q), Vec3<T>{tau[3], tau[4], tau[5]});
        body.tau[3] = f.x, body.tau[4] = f.y, body.tau[5] = f.z;
      }
      const Force<T> wrench{{body.tau[0], body.tau[1], body.tau[2]}, {body.tau[3], body.tau[4], body.tau[5]}};
      ws.z(b.parent) += to_inboard(body.X, wrench);
    }
  }
}

template <class T>
static void acceleration_free(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, T* vdot, int begin, int end) {
  for (int k = begin; k < end; ++k) {
    const SweepBody& b = model.bodies[k];
    FreeRecord<T>& body = ws.free(k);
    const Force<T>& z = body.z;
    const T* L = body.L;
    T x[6] = {body.tau[0] - z.n.x, body.tau[1] - z.n.y, body.tau[2] - z.n.z, body.tau[3] - z.f.x, body.tau[4] - z.f.y, body.tau[5] - z.f.z};
    for (int i = 1; i < 6; ++i)
      for (int j = 0; j < i; ++j) x[i] = x[i] - L[i * (i + 1) / 2 + j] * x[j];
    for (int i = 0; i < 6; ++i) x[i] = x[i] * L[i * (i + 1) / 2 + i];
    for (int i = 4; i >= 0; --i)
      for (int j = i + 1; j < 6; ++j) x[i] = x[i] - L[j * (j + 1) / 2 + i] * x[j];
    Motion<T> relative{{x[0], x[1], x[2]}, {x[3], x[4], x[5]}};
    ws.core(k).delta = relative;
    if (b.parent > 0) relative -= to_outboard(body.X, ws.core(b.parent).delta);
    const Vec3<T> linear = b.shape == CARDAN_SHAPE_FREE ? free_rotation(b, in.q) * relative.v : relative.v;
    T* out = vdot + b.v;
    out[0] = relative.w.x, out[1] = relative.w.y, out[2] = relative.w.z;
    out[3] = linear.x, out[4] = linear.y, out[5] = linear.z;
  }
}

template <class T>
static void gather_free(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, T* tau, int begin, int end) {
  for (int k = end - 1; k >= begin; --k) {
    const SweepBody& b = model.bodies[k];
    FreeRecord<T>& body = ws.free(k);
    const Force<T>& z = body.z;
    const Vec3<T> linear = b.shape == CARDAN_SHAPE_FREE ? free_rotation(b, in.q) * z.f : z.f;
    T* out = tau + b.v;
    out[0] = z.n.x, out[1] = z.n.y, out[2] = z.n.z;
    out[3] = linear.x, out[4] = linear.y, out[5] = linear.z;
    ws.z(b.parent) += to_inboard(body.X, z);
  }
}

}  // namespace cardan::soa
