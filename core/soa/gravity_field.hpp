#pragma once
// The pull of a point attractor on a rigid inertia.
#include <cmath>

#include "core/model/model.hpp"
#include "core/spatial/inertia.hpp"

namespace cardan::soa {

/// dJ/d eta_k at eta = 0 (symmetric).
inline Eigen::Matrix3d first_order_inertia(const ModalIntegrals& I, int k) {
  const auto at = static_cast<std::size_t>(k);
  Eigen::Matrix3d d = I.I8[at] + I.I8[at].transpose();
  if (!I.rotary_ww.empty()) d += I.rotary_ww[at];
  return d;
}

/// Wrench on the body at its origin, body axes. The field is expanded about the mass centre: m g_c, and with the gradient
/// also -dU2/dr and the torque 3 mu/r^3 rhat x (J_c rhat), all from one potential U2 = 3 mu r*J_c r/(2 r^5) - mu tr J_c/(2 r^3)
/// (MacCullagh), so that energy and momentum balance. Gives back c, the mass centre, and r from the attractor to it, body axes.
template <class T>
Force<T> attraction(const GravitySpec& g, const RigidInertia<T>& M, const Pose<T>& body_W, Vec3<T>& c, Vec3<T>& r) {
  using std::sqrt;
  const Vec3<T> centre{T(g.centre.x()), T(g.centre.y()), T(g.centre.z())};
  c = (T(1) / M.m) * M.h;
  r = transpose_times(body_W.R, body_W.p - centre) + c;
  const T r2 = dot(r, r), k3 = T(g.mu) / (r2 * sqrt(r2));
  Vec3<T> force = (-(M.m * k3)) * r, torque{T(0), T(0), T(0)};
  if (g.gradient) {
    const T hc = dot(M.h, c);
    const Sym3<T> J{M.J.xx - hc + M.h.x * c.x, M.J.yy - hc + M.h.y * c.y, M.J.zz - hc + M.h.z * c.z,
                    M.J.xy + M.h.x * c.y,      M.J.xz + M.h.x * c.z,      M.J.yz + M.h.y * c.z};
    const Vec3<T> Jr = J * r;
    const T k5 = T(3) * k3 / r2;
    torque = k5 * cross(r, Jr);
    force += (k5 * (T(2.5) * dot(r, Jr) / r2 - T(0.5) * (J.xx + J.yy + J.zz))) * r - k5 * Jr;
  }
  return {torque + cross(c, force), force};
}

/// Inertia of a flexible body for its gravity, from M_rr of its level: the potential takes J to first order in
/// eta also where the kinetic energy (level 0) does not, so that the field pulls on the modes at every level.
template <class T>
RigidInertia<T> gravity_inertia(const FlexibleBody& f, int n_modes, RigidInertia<T> M, const T* eta) {
  for (int k = 0; f.level == 0 && k < n_modes; ++k) {
    const Eigen::Matrix3d d = first_order_inertia(f.data->integrals, k);
    M.J += Sym3<T>{eta[k] * T(d(0, 0)), eta[k] * T(d(1, 1)), eta[k] * T(d(2, 2)), eta[k] * T(d(0, 1)), eta[k] * T(d(0, 2)), eta[k] * T(d(1, 2))};
  }
  return M;
}

/// Potential energy in the same field.
template <class T>
T potential(const GravitySpec& g, const RigidInertia<T>& M, const Pose<T>& body_W) {
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
