#pragma once
// The pull of a point attractor on a rigid inertia.
#include <cmath>

#include "core/model/sweep_model.hpp"
#include "core/spatial/inertia.hpp"

namespace cardan::soa {

/// Six numbers xx yy zz xy xz yz as a symmetric matrix, and its multiple.
template <class T>
static Sym3<T> inertia_derivative(const double* d) {
  return {T(d[0]), T(d[1]), T(d[2]), T(d[3]), T(d[4]), T(d[5])};
}
template <class T>
static Sym3<T> scaled(const T& s, const Sym3<T>& m) {
  return {s * m.xx, s * m.yy, s * m.zz, s * m.xy, s * m.xz, s * m.yz};
}

/// Wrench on a body of mass m and moments J about its mass centre, there. The field is expanded about that: m g_c, and with the
/// gradient also -dU2/dr and the torque 3 mu/r^3 rhat x (J rhat), all from one potential U2 = 3 mu r*J r/(2 r^5) - mu tr J/(2 r^3)
/// (MacCullagh), so that energy and momentum balance. r: from the attractor to the mass centre.
template <class T>
static Force<T> attraction(const GravityField& g, const T& m, const Sym3<T>& J, const Vec3<T>& r) {
  using std::sqrt;
  const T r2 = dot(r, r), k3 = T(g.mu) / (r2 * sqrt(r2));
  Vec3<T> force = (-(m * k3)) * r, torque{T(0), T(0), T(0)};
  if (g.gradient) {
    const Vec3<T> Jr = J * r;
    const T k5 = T(3) * k3 / r2;
    torque = k5 * cross(r, Jr);
    force += (k5 * (T(2.5) * dot(r, Jr) / r2 - T(0.5) * (J.xx + J.yy + J.zz))) * r - k5 * Jr;
  }
  return {torque, force};
}
/// The same at the origin of the body, body axes. Gives back c, the mass centre, and r.
template <class T>
static Force<T> attraction(const GravityField& g, const RigidInertia<T>& M, const Pose<T>& body_W, Vec3<T>& c, Vec3<T>& r) {
  c = (T(1) / M.m) * M.h;
  r = transpose_times(body_W.R, body_W.p - cast<T>(g.centre)) + c;
  Sym3<T> J{};
  if (g.gradient) {
    const T hc = dot(M.h, c);
    J = {M.J.xx - hc + M.h.x * c.x, M.J.yy - hc + M.h.y * c.y, M.J.zz - hc + M.h.z * c.z,
         M.J.xy + M.h.x * c.y,      M.J.xz + M.h.x * c.z,      M.J.yz + M.h.y * c.z};
  }
  const Force<T> pull = attraction(g, M.m, J, r);
  return {pull.n + cross(c, pull.f), pull.f};
}

/// Inertia of a flexible body for its gravity, from M_rr of its level: the potential takes J to first order in
/// eta also where the kinetic energy (level 0) does not, so that the field pulls on the modes at every level.
template <class T>
static RigidInertia<T> gravity_inertia(const FlexibleBody& f, int n_modes, RigidInertia<T> M, const T* eta) {
  for (int k = 0; f.level == 0 && k < n_modes && !f.dJ.empty(); ++k) M.J += scaled(eta[k], inertia_derivative<T>(f.dJ.data() + 6 * k));
  return M;
}

/// Potential energy in the same field.
template <class T>
static T potential(const GravityField& g, const RigidInertia<T>& M, const Pose<T>& body_W) {
  using std::sqrt;
  Vec3<T> c, r;
  attraction(g, M, body_W, c, r);
  const T r2 = dot(r, r), r1 = sqrt(r2), mu(g.mu);
  T U = -mu * M.m / r1;
  if (g.gradient) {
    const T hc = dot(M.h, c);
    const Sym3<T> J{M.J.xx - hc + M.h.x * c.x, M.J.yy - hc + M.h.y * c.y, M.J.zz - hc + M.h.z * c.z,
                    M.J.xy + M.h.x * c.y,      M.J.xz + M.h.x * c.z,      M.J.yz + M.h.y * c.z};
    U = U + T(1.5) * mu * dot(r, J * r) / (r2 * r2 * r1) - T(0.5) * mu * (J.xx + J.yy + J.zz) / (r2 * r1);
  }
  return U;
}

}  // namespace cardan::soa
