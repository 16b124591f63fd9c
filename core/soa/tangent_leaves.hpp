#pragma once
// Derivatives of what hinge and body families give, along the direction of a Tangent state (mathematics 8.1). Families know
// doubles only and give values; quaternion hinges are differentiated here in closed form, everything else by a difference of
// eighth order (tangent.hpp), which is exact to round-off for modal inertias (polynomials) and to 1e-14 for smooth hinge maps.
#include <algorithm>
#include <cstring>

#include "core/abi/registry.hpp"
#include "core/soa/kernels_kinematics.hpp"
#include "core/soa/tangent.hpp"
#include "core/spatial/rotation.hpp"

namespace cardan::soa {

/// Step of the differences in a hinge coordinate [rad, m]: h^8 / 630 and eps / h are both below 1e-14.
inline constexpr double kHingeStep = 0.03;

namespace detail {

inline constexpr int kRecord = sizeof(cardan_hinge_out) / sizeof(double);

/// ball, free, free_body: R of the quaternion, the position, and R* in the map of `free`. Their rates of the map are not read.
inline void quaternion_record(std::uint32_t shape, const Tangent* q, double* out) {
  const Mat3<Tangent> R = rotation_of_quaternion(q[0], q[1], q[2], q[3]);
  const Tangent r[9] = {R.xx, R.xy, R.xz, R.yx, R.yy, R.yz, R.zx, R.zy, R.zz};
  for (int i = 0; i < 9; ++i) out[i] = r[i].d;
  if (shape == CARDAN_SHAPE_BALL) return;
  for (int i = 0; i < 3; ++i) out[9 + i] = q[4 + i].d;
  if (shape == CARDAN_SHAPE_FREE)
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i) out[12 + 6 * (3 + j) + 3 + i] = r[3 * j + i].d;
}

/// Any other: by components of q; the rate Hdot* v is a quadratic form in v. x, w: the values of q and v, which move and come back.
inline void dense_record(const cardan_hinge_family& f, const void* packed, const Tangent* q, const Tangent* v, double* x, double* w,
                         double* out) {
  const std::uint32_t zero = 0;
  const auto nq = static_cast<int>(f.nq), nv = static_cast<int>(f.nv);
  double sum[kRecord], work[kRecord];
  const auto record = [&](double* to) {
    cardan_hinge_out one{};
    f.kinematics(packed, 1, &zero, &zero, x, w, &one);
    std::memcpy(to, &one, sizeof one);
  };
  for (int i = 0; i < nq; ++i) {
    if (q[i].d == 0.0) continue;
    derivative([&](double s, double* to) { x[i] = q[i].x + s, record(to); }, kHingeStep, kRecord, sum, work);
    x[i] = q[i].x;
    for (int k = 0; k < kRecord; ++k) out[k] += q[i].d * sum[k];
  }
  double size = 0.0, change = 0.0;
  for (int i = 0; i < nv; ++i) size = std::max(size, std::abs(v[i].x)), change = std::max(change, std::abs(v[i].d));
  if (size == 0.0 || change == 0.0) return;
  const double h = size / change;
  for (const double side : {1.0, -1.0}) {
    for (int i = 0; i < nv; ++i) w[i] = v[i].x + side * h * v[i].d;
    record(work);
    for (int k = 48; k < kRecord; ++k) out[k] += side * work[k] / (2.0 * h);
  }
  for (int i = 0; i < nv; ++i) w[i] = v[i].x;
}

}  // namespace detail

/// The records of a family by value; q and v by value stay in Workspace::family.
template <class T>
static void value_records(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, const DenseBatch& batch) {
  double *q = ws.family.data(), *v = q + model.nq;
  for (int i = 0; i < model.nq; ++i) q[i] = in.q[i].x;
  for (int i = 0; i < model.nv; ++i) v[i] = in.v[i].x;
  batch.family->kinematics(batch.packed.data(), static_cast<std::uint32_t>(batch.iq.size()), batch.iq.data(), batch.iv.data(), q, v,
                           ws.hinge_records(0) + batch.first);
}
static inline void family_records(const SweepModel& model, Workspace<Tangent>& ws, const Inputs<Tangent>& in, const DenseBatch& batch) {
  value_records(model, ws, in, batch);
  const auto n = static_cast<std::uint32_t>(batch.iq.size());
  double *q = ws.family.data(), *v = q + model.nq;
  const auto* packed = reinterpret_cast<const std::byte*>(batch.packed.data());
  for (std::uint32_t j = 0; j < n; ++j) {
    cardan_hinge_out& record = ws.hinge_records(1)[batch.first + static_cast<int>(j)];
    record = {};
    if (has_quaternion(*batch.family))
      detail::quaternion_record(batch.family->shape, in.q + batch.iq[j], record.R_OP);
    else
      detail::dense_record(*batch.family, packed + j * batch.family->params_size, in.q + batch.iq[j], in.v + batch.iv[j], q + batch.iq[j],
                           v + batch.iv[j], record.R_OP);
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

/// M_fl(eta) and b, value and derivative.
static inline void family_inertia(const FlexibleBody& f, int m, const Tangent* eta, const Tangent* etadot, const Vec3<Tangent>& w,
                                  Modal<Tangent>& modal, Tangent* M_rr) {
  const bool re = !f.M_re_constant, ee = modal.P_ee && !f.M_ee_constant;
  const int n = 10 + (re ? 6 * m : 0) + (ee ? m * m : 0), nb = etadot ? 6 + m : 0;
  double *e = modal.family, *ed = e + m, *value = ed + m, *slope = value + n + nb, *work = slope + n + nb;
  double omega[3] = {w.x.x, w.y.x, w.z.x};
  const auto all = [&](double s, double* out) {
    for (int i = 0; i < m; ++i) e[i] = eta[i].x + s * eta[i].d;
    f.family->mass(f.packed.data(), e, out, re ? out + 10 : nullptr, ee ? out + n - m * m : nullptr);
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
  for (int i = 0; i < 10; ++i) M_rr[i] = {value[i], slope[i]};
  for (int i = 0; re && i < 6 * m; ++i) modal.P_re[i] = {value[10 + i], slope[10 + i]};
  for (int i = 0; ee && i < m * m; ++i) modal.P_ee[i] = {value[n - m * m + i], slope[n - m * m + i]};
  for (int i = 0; i < nb; ++i) modal.b[i] = {value[n + i], slope[n + i]};
}

}  // namespace cardan::soa
