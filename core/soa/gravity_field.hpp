#pragma once
// The pull of a point attractor, or of a field of a family, on a rigid inertia.
#include <cmath>

#include "core/model/sweep_model.hpp"
#include "core/soa/field_pull.hpp"
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

/// The force of a source on mode j of a body of mass m and mass centre c: F . I3 / m - c . G I3 + 1/2 G : dS, dS = 1/2 tr(dJ) 1 - dJ.
template <class T>
static T pull_on_mode(const FlexibleBody& f, const Modal<T>& modal, int j, int n_modes, const T* eta, const T& m, const Vec3<T>& c,
                      const FieldPull<T>& pull) {
  const double* constant = f.M_re.data() + 6 * j;
  const T* M_e = modal.P_re ? modal.P_re + 6 * j : nullptr;
  const Vec3<T> I3 = M_e ? Vec3<T>{M_e[3], M_e[4], M_e[5]} : Vec3<T>{T(constant[3]), T(constant[4]), T(constant[5])};
  Sym3<T> dJ = inertia_derivative<T>(f.dJ.data() + 6 * j);
  for (int l = 0; l < n_modes && !f.d2J.empty(); ++l) dJ += scaled(eta[l], inertia_derivative<T>(f.d2J.data() + 6 * (j * n_modes + l)));
  const Mat3<T>& G = pull.gradient;
  const T along = G.xx * dJ.xx + G.yy * dJ.yy + G.zz * dJ.zz + (G.xy + G.yx) * dJ.xy + (G.xz + G.zx) * dJ.xz + (G.yz + G.zy) * dJ.yz;
  return dot(I3, pull.force) / m - dot(c, G * I3) + T(0.5) * (T(0.5) * (dJ.xx + dJ.yy + dJ.zz) * (G.xx + G.yy + G.zz) - along);
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
