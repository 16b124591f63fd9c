#pragma once
// Derivatives of what hinge and body families give, along the direction of a Tangent state (mathematics 8.1). Families know
// doubles only and give values. Of hinges: kernels_tangents.hpp; everything else by a difference of eighth order (tangent.hpp), which is
// exact to round-off for modal inertias (polynomials).
#include <algorithm>
#include <cstring>

#include "core/abi/registry.hpp"
#include "core/soa/kernels_kinematics.hpp"
#include "core/soa/kernels_tangents.hpp"

namespace cardan::soa {

/// Adds the slope of the record of a hinge that is no quaternion. x, w: the values of q and v, which move and come back.
static inline void add_record_slope(const cardan_hinge_family& f, HingeSlopes known, const void* packed, const Tangent* q, const Tangent* v,
                                    double* x, double* w, double* slope) {
  cardan_hinge_out in_q[kMostCoordinates];
  double in_v[36];
  const Moves moves = what_moves(f, q, v);
  record_slopes(f, known, packed, moves, x, w, in_q, in_v);
  for (std::uint32_t c = 0; c < f.nq; ++c)
    for (int k = 0; moves.q >> c & 1 && k < kRecordNumbers; ++k) slope[k] += q[c].d * reinterpret_cast<const double*>(in_q + c)[k];
  for (std::uint32_t c = 0; c < f.nv; ++c)
    for (std::uint32_t k = 0; moves.v >> c & 1 && k < 6; ++k) slope[48 + k] += v[c].d * in_v[6 * c + k];
}

static inline void family_records(const SweepModel& model, Workspace<Tangent>& ws, const Inputs<Tangent>& in, const DenseBatch& batch) {
  value_records(model, ws, in, batch);
  double *q = ws.family.data(), *v = q + model.nq;
  for (std::size_t j = 0; j < batch.iq.size(); ++j) {
    const std::uint32_t iq = batch.iq[j], iv = batch.iv[j];
    double* slope = reinterpret_cast<double*>(ws.hinge_records(1) + batch.first + static_cast<int>(j));
    std::fill_n(slope, kRecordNumbers, 0.0);
    if (has_quaternion(*batch.family))
      quaternion_record(batch.family->shape, in.q + iq, [&](int k, const Tangent& number) { slope[k] = number.d; });
    else
      add_record_slope(*batch.family, batch.slopes, packed_of(batch, j), in.q + iq, in.v + iv, q + iq, v + iv, slope);
  }
}

/// A step along d eta that moves no part of the body by more than a hundredth of its size; 0: nothing moves.
static inline double step_of_modes(const FlexibleBody& f, int m, const Tangent* eta) {
  double moved = 0.0;  // [sqrt(kg) m] of a unit step, by the modal mass
  for (int i = 0; i < m; ++i) moved += std::abs(eta[i].d) * std::sqrt(f.M_ee[m * i + i]);
  if (!(moved > 0.0)) return 0.0;
  const double size = std::sqrt(0.5 * (f.M_rr.J.xx + f.M_rr.J.yy + f.M_rr.J.zz));
  return 0.01 * (size > 0.0 ? size : 1.0) / moved;
}

/// Numbers that the functions below work with: eta, eta', and each number of a family three times.
constexpr std::size_t family_numbers(std::size_t m) { return 2 * m + 3 * (10 + 6 * m + m * m + 6 + m); }

/// M_fl(eta) and b, value and derivative. M_rr null: only b.
static inline void family_inertia(const FlexibleBody& f, int m, const Tangent* eta, const Tangent* etadot, const Vec3<Tangent>& w,
                                  Modal<Tangent>& modal, Tangent* M_rr) {
  const bool re = M_rr && !f.M_re_constant, ee = M_rr && modal.P_ee && !f.M_ee_constant;
  const int rr = M_rr ? 10 : 0, n = rr + (re ? 6 * m : 0) + (ee ? m * m : 0), nb = etadot ? 6 + m : 0;
  double *e = modal.family, *ed = e + m, *value = ed + m, *slope = value + n + nb, *work = slope + n + nb;
  double omega[3] = {w.x.x, w.y.x, w.z.x};
  const auto all = [&](double s, double* out) {
    for (int i = 0; i < m; ++i) e[i] = eta[i].x + s * eta[i].d;
    if (M_rr) f.family->mass(f.packed.data(), e, out, re ? out + 10 : nullptr, ee ? out + n - m * m : nullptr);
    if (!etadot) return;
    for (int i = 0; i < m; ++i) ed[i] = etadot[i].x;
    f.family->bias(f.packed.data(), e, ed, omega, out + n);
  };
  all(0.0, value);
  for (int i = 0; i < n + nb; ++i) slope[i] = 0.0;
  if (const double step = step_of_modes(f, m, eta); step > 0.0) derivative(all, step, n + nb, slope, work);
  if (etadot) {  // b is a quadratic form in (omega, eta')
    const double turn[3] = {w.x.d, w.y.d, w.z.d};
    double size = 0.0, change = 0.0;
    for (int i = 0; i < 3; ++i) size = std::max(size, std::abs(omega[i])), change = std::max(change, std::abs(turn[i]));
    for (int i = 0; i < m; ++i) size = std::max(size, std::abs(etadot[i].x)), change = std::max(change, std::abs(etadot[i].d));
    if (size > 0.0 && change > 0.0) {
      const double h = size / change;
      for (int i = 0; i < m; ++i) e[i] = eta[i].x;
      for (const double side : {1.0, -1.0}) {
        const double at[3] = {omega[0] + side * h * turn[0], omega[1] + side * h * turn[1], omega[2] + side * h * turn[2]};
        for (int i = 0; i < m; ++i) ed[i] = etadot[i].x + side * h * etadot[i].d;
        f.family->bias(f.packed.data(), e, ed, at, work);
        for (int i = 0; i < nb; ++i) slope[n + i] += side * work[i] / (2.0 * h);
      }
    }
  }
  for (int i = 0; i < rr; ++i) M_rr[i] = {value[i], slope[i]};
  for (int i = 0; re && i < 6 * m; ++i) modal.P_re[i] = {value[10 + i], slope[10 + i]};
  for (int i = 0; ee && i < m * m; ++i) modal.P_ee[i] = {value[n - m * m + i], slope[n - m * m + i]};
  for (int i = 0; i < nb; ++i) modal.b[i] = {value[n + i], slope[n + i]};
}

}  // namespace cardan::soa
