#pragma once
// The pull of a point attractor, or of a field of a family, on a rigid inertia.
#include <cmath>

#include "core/model/sweep_model.hpp"
#include "core/soa/field_pull.hpp"
#include "core/soa/kernels_kinematics.hpp"
#include "core/soa/record.hpp"
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
/// Moments of inertia about the mass centre c.
template <class T>
static Sym3<T> about_centre(const RigidInertia<T>& M, const Vec3<T>& c) {
  const T hc = dot(M.h, c);
  return {M.J.xx - hc + M.h.x * c.x, M.J.yy - hc + M.h.y * c.y, M.J.zz - hc + M.h.z * c.z,
          M.J.xy + M.h.x * c.y,      M.J.xz + M.h.x * c.z,      M.J.yz + M.h.y * c.z};
}
/// The pull of GravityField::source on a body.
template <class T>
static FieldPull<T> pull_of_source(const GravityField& g, const FieldMoment* at, const RigidInertia<T>& M, const Pose<T>& body_W) {
  const Vec3<T> c = (T(1) / M.m) * M.h;
  return field_pull(g, at, M.m, c, about_centre(M, c), body_W);
}

/// The same at the origin of the body, body axes. Gives back c, the mass centre, and r; r not of a source. `at`: Inputs::moment.
template <class T>
static Force<T> attraction(const GravityField& g, const RigidInertia<T>& M, const Pose<T>& body_W, Vec3<T>& c, Vec3<T>& r,
                           const FieldMoment* at) {
  c = (T(1) / M.m) * M.h;
  if (g.source) {
    const FieldPull<T> pull = pull_of_source(g, at, M, body_W);
    return {pull.torque + cross(c, pull.force), pull.force};
  }
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

/// What pulls on the modes of a body in a field: F / m - G c along I3_k, and on dJ/d eta_k (xx yy zz xy xz yz) what 1/2 G : dS_k has of
/// it, dS = 1/2 tr(dJ) 1 - dJ.
template <class T>
struct PullOnModes {
  Vec3<T> along;
  T on_inertia[6];
};
/// F / m [m/s^2], mass centre c and G in body axes.
template <class T>
static PullOnModes<T> pull_on_modes(const Vec3<T>& field, const Vec3<T>& c, const Mat3<T>& G) {
  return {field - transpose_times(G, c),
          {T(0.25) * (G.yy + G.zz - G.xx), T(0.25) * (G.xx + G.zz - G.yy), T(0.25) * (G.xx + G.yy - G.zz), T(-0.5) * (G.xy + G.yx),
           T(-0.5) * (G.xz + G.zx), T(-0.5) * (G.yz + G.zy)}};
}
/// 1/2 G : dS of dJ.
template <class T>
static T pull_on_inertia(const PullOnModes<T>& pull, const double* dJ) {
  T sum = T(dJ[0]) * pull.on_inertia[0];
  for (int i = 1; i < 6; ++i) sum = sum + T(dJ[i]) * pull.on_inertia[i];
  return sum;
}

/// Adds `scale` times the forces of a field on the m modes of a body to `out`. P_re of `modal` as the family gave it; its b and accel are
/// work, where the family tells how J changes.
template <class T>
static void add_pull_on_modes(const FlexibleBody& f, Modal<T>& modal, int m, const T* eta, const PullOnModes<T>& pull, const T& scale,
                              T* out) {
  for (int j = 0; j < m; ++j) {
    const double* constant = f.M_re.data() + 6 * j;
    const T* M_e = modal.P_re ? modal.P_re + 6 * j : nullptr;
    const Vec3<T> I3 = M_e ? Vec3<T>{M_e[3], M_e[4], M_e[5]} : Vec3<T>{T(constant[3]), T(constant[4]), T(constant[5])};
    T force = dot(I3, pull.along);
    if (!f.dJ.empty()) force = force + pull_on_inertia(pull, f.dJ.data() + 6 * j);
    for (int l = 0; l < m && !f.d2J.empty(); ++l) force = force + eta[l] * pull_on_inertia(pull, f.d2J.data() + 6 * (j * m + l));
    out[j] = out[j] + scale * force;
  }
  if (!f.J_by_family) return;
  // b_e(omega) = -1/2 omega* dJ_k omega of modes at rest, and dJ_k is known from six turns: x, y, z, x + y, x + z, y + z.
  for (int j = 0; j < m; ++j) modal.accel[j] = T(0);
  const T* on = pull.on_inertia;
  const T half(0.5), of[6] = {on[0] - half * (on[3] + on[4]),
                              on[1] - half * (on[3] + on[5]),
                              on[2] - half * (on[4] + on[5]),
                              half * on[3],
                              half * on[4],
                              half * on[5]};
  constexpr double turns[6][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}, {1, 0, 1}, {0, 1, 1}};
  for (int i = 0; i < 6; ++i) {
    family_inertia(f, m, eta, modal.accel, Vec3<T>{T(turns[i][0]), T(turns[i][1]), T(turns[i][2])}, modal, static_cast<T*>(nullptr));
    const T weight = T(-2) * scale * of[i];
    for (int j = 0; j < m; ++j) out[j] = out[j] + weight * modal.b[6 + j];
  }
}

/// Potential energy in the same field.
template <class T>
static T potential(const GravityField& g, const RigidInertia<T>& M, const Pose<T>& body_W, const FieldMoment* at) {
  using std::sqrt;
  if (g.source) return pull_of_source(g, at, M, body_W).potential;
  Vec3<T> c, r;
  attraction(g, M, body_W, c, r, at);
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
