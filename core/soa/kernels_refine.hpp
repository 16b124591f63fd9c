#pragma once
// Masses that grow by large ratios per link. The rounding of P and z is that of the heavy bodies, and the hinges between take it to
// the light ones (mathematics: tree_algorithms.md, 10). So v' of the sweeps is taken as a first guess: the residual is formed about
// the accelerations found and the rest is solved for by the same P, D and G, where their errors act on a small number (iterative
// refinement; Wilkinson 1963). Rigid bodies and particles; the program has this op where compile() found it needed.
#include "core/soa/kernels_acceleration.hpp"
#include "core/soa/workspace.hpp"

namespace cardan::soa {

/// gamma and E become those of the accelerations found, z the residual there: formed about the mass centre c, so that every
/// rounding is an acceleration of the body itself and none a couple on a body that may have no rotary inertia,
///   f = m (gamma.v + E c) - loads,   n = c x f + axial part of E S_c - their couple.
template <class T>
static void rebase(const SweepModel& model, Workspace<T>& ws) {
  for (int k = 1; k < static_cast<int>(model.bodies.size()); ++k) {
    if (model.bodies[k].kind == BodyKernel::rotor) continue;
    const CentralInertia& M = model.graded.swept[k];
    const Force<T>& load = ws.loads[k];
    Core<T>& body = ws.core(k);
    Mat3<T>& E = body.E;
    const Vec3<T> w = body.delta.w;
    body.gamma += body.delta;
    E.xy = E.xy - w.z, E.xz = E.xz + w.y;
    E.yx = E.yx + w.z, E.yz = E.yz - w.x;
    E.zx = E.zx - w.y, E.zy = E.zy + w.x;
    const Vec3<T> c = cast<T>(M.c);
    const T xx(M.S.xx), yy(M.S.yy), zz(M.S.zz), xy(M.S.xy), xz(M.S.xz), yz(M.S.yz);
    const Vec3<T> couple{(E.zx * xy + E.zy * yy + E.zz * yz) - (E.yx * xz + E.yy * yz + E.yz * zz),
                         (E.xx * xz + E.xy * yz + E.xz * zz) - (E.zx * xx + E.zy * xy + E.zz * xz),
                         (E.yx * xx + E.yy * xy + E.yz * xz) - (E.xx * xy + E.xy * yy + E.xz * yz)};
    const Vec3<T> f = T(M.m) * (body.gamma.v + E * c) - load.f;
    ws.z(k) = {(couple - load.n) + cross(c, f), f};
  }
}

/// |x| and the larger of two, by lanes.
template <class T>
static T magnitude(const T& x) {
  return (T(2) * above(x, T(0)) - T(1)) * x;
}
template <class T>
static T larger(const T& a, const T& b) {
  return b + above(a, b) * (a - b);
}

static constexpr int kPasses = 5;          // at most: enough for ratios of 1e12 between neighbours on balls
static constexpr double kRefined = 1e-15;  // of v': what may be left
/// A pass leaves of the error at most this many times the relative error of the sweeps (measured: 1 to 20, most with balls and six
/// degrees of freedom).
static constexpr double kRate = 32.0;

}  // namespace cardan::soa
