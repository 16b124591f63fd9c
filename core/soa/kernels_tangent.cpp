// The sweeps on numbers that carry their derivative (tangent.hpp), and what families give along eight directions.
#include "core/soa/kernels_tangent.hpp"

#include <cstring>

#include "core/soa/kernels_tangents.hpp"
#include "core/soa/tangent_leaves.hpp"
// what families give must be known before the sweeps that ask for it
#include "core/soa/sweeps_impl.hpp"
#include "core/soa/workspace_layout.hpp"

namespace cardan::soa {

template <>
constexpr std::size_t family_scratch<Tangent>(std::size_t m) {
  return m == 0 ? 0 : family_numbers(m);
}
template <>
constexpr std::size_t family_scratch<Tangents>(std::size_t m) {
  return m == 0 ? 0 : family_numbers(m);
}
template class Workspace<Tangent>;
template class Workspace<Tangents>;

// dx = S d eta; S and a along eta by differences, as the inertia; a is a quadratic form in eta'.
void family_node(const FlexibleBody& f, int m, int node, const Tangent* eta, const Tangent* etadot, double* scratch, Tangent* x, Tangent* S,
                 Tangent* a) {
  const int n = 6 * m + (etadot ? 6 : 0);
  double *e = scratch, *ed = e + m, *moved = ed + m, *value = moved + 6, *slope = value + n, *work = slope + n;
  const auto ask = [&](double along_eta, double along_etadot, double* columns, double* bent) {
    for (int i = 0; i < m; ++i) e[i] = eta[i].x + along_eta * eta[i].d;
    for (int i = 0; etadot && i < m; ++i) ed[i] = etadot[i].x + along_etadot * etadot[i].d;
    f.family->node(f.packed.data(), static_cast<std::uint32_t>(node), e, etadot ? ed : nullptr, moved, columns, bent);
  };
  const auto all = [&](double s, double* out) { ask(s, 0.0, out, etadot ? out + 6 * m : nullptr); };
  std::fill_n(slope, n, 0.0);
  if (const double step = step_of_modes(f, m, eta); step > 0.0) derivative(all, step, n, slope, work);
  all(0.0, value);
  for (int i = 0; i < 6; ++i) {
    x[i] = {moved[i], 0.0};
    for (int j = 0; j < m; ++j) x[i].d += value[6 * j + i] * eta[j].d;
  }
  double size = 0.0, change = 0.0;
  for (int i = 0; etadot && i < m; ++i) size = std::max(size, std::abs(etadot[i].x)), change = std::max(change, std::abs(etadot[i].d));
  if (size > 0.0 && change > 0.0)
    for (const double side : {1.0, -1.0}) {
      ask(0.0, side * size / change, nullptr, work);
      for (int i = 0; i < 6; ++i) slope[6 * m + i] += side * work[i] * change / (2.0 * size);
    }
  for (int i = 0; i < 6 * m; ++i) S[i] = {value[i], slope[i]};
  for (int i = 0; etadot && i < 6; ++i) a[i] = {value[6 * m + i], slope[6 * m + i]};
}

namespace {

/// n numbers along one direction.
std::vector<Tangent> along_one(const Tangents* all, std::size_t n, int direction) {
  std::vector<Tangent> one(n);
  for (std::size_t i = 0; i < n; ++i) one[i] = along(all[i], direction);
  return one;
}
void set_along(Tangents* all, const Tangent* one, std::size_t n, int direction) {
  for (std::size_t i = 0; i < n; ++i) {
    all[i].x = one[i].x;
    all[i].d.x[direction] = one[i].d;
  }
}

}  // namespace

void family_node(const FlexibleBody& f, int m, int node, const Tangents* eta, const Tangents* etadot, double* scratch, Tangents* x,
                 Tangents* S, Tangents* a) {
  const auto n = static_cast<std::size_t>(m);
  std::vector<Tangent> S_one(6 * n), rates;
  Tangent x_one[6], a_one[6];
  for (int d = 0; d < kDirections; ++d) {
    const std::vector<Tangent> at = along_one(eta, n, d);
    if (etadot) rates = along_one(etadot, n, d);
    family_node(f, m, node, at.data(), etadot ? rates.data() : nullptr, scratch, x_one, S_one.data(), a ? a_one : nullptr);
    set_along(x, x_one, 6, d), set_along(S, S_one.data(), 6 * n, d);
    if (a) set_along(a, a_one, 6, d);
  }
}

namespace {

/// Step of the differences in a hinge coordinate [rad, m]: h^8 / 630 and eps / h are both below 1e-14.
constexpr double kHingeStep = 0.03;

}  // namespace

void record_slopes(const cardan_hinge_family& f, HingeSlopes known, const void* packed, Moves moves, double* x, double* w,
                   cardan_hinge_out* in_q, double* in_v) {
  if (known) return known(packed, x, w, in_q, in_v);
  const std::uint32_t zero = 0;
  double work[kRecordNumbers];
  const auto record = [&](double* to) {
    cardan_hinge_out one{};
    f.kinematics(packed, 1, &zero, &zero, x, w, &one);
    std::memcpy(to, &one, sizeof one);
  };
  for (std::uint32_t i = 0; i < f.nq; ++i) {
    if (!(moves.q >> i & 1)) continue;
    const double q = x[i];
    derivative([&](double s, double* to) { x[i] = q + s, record(to); }, kHingeStep, kRecordNumbers, reinterpret_cast<double*>(in_q + i),
               work);
    x[i] = q;
  }
  double size = 0.0;
  for (std::uint32_t i = 0; i < f.nv; ++i) size = std::max(size, std::abs(w[i]));
  std::fill_n(in_v, 6 * f.nv, 0.0);
  for (std::uint32_t i = 0; i < f.nv && size > 0.0; ++i) {  // Hdot* v is a quadratic form in v
    if (!(moves.v >> i & 1)) continue;
    const double v = w[i];
    for (const double side : {1.0, -1.0}) {
      w[i] = v + side * size, record(work);
      for (int k = 0; k < 6; ++k) in_v[6 * i + static_cast<std::uint32_t>(k)] += side * work[48 + k] / (2.0 * size);
    }
    w[i] = v;
  }
}

void family_inertia(const FlexibleBody& f, int m, const Tangents* eta, const Tangents* etadot, const Vec3<Tangents>& w,
                    Modal<Tangents>& modal, Tangents* M_rr) {
  const auto n = static_cast<std::size_t>(m), n_re = f.M_re_constant || !M_rr ? 0 : 6 * n,
             n_ee = M_rr && modal.P_ee && !f.M_ee_constant ? n * n : 0;
  std::vector<Tangent> numbers(n_re + n_ee + 6 + n), rates;
  Modal<Tangent> one{};
  one.family = modal.family;
  one.P_re = numbers.data(), one.P_ee = n_ee > 0 ? numbers.data() + n_re : nullptr, one.b = numbers.data() + n_re + n_ee;
  Tangent rr[10];
  for (int d = 0; d < kDirections; ++d) {
    const std::vector<Tangent> at = along_one(eta, n, d);
    if (etadot) rates = along_one(etadot, n, d);
    family_inertia(f, m, at.data(), etadot ? rates.data() : nullptr, Vec3<Tangent>{along(w.x, d), along(w.y, d), along(w.z, d)}, one,
                   M_rr ? rr : nullptr);
    if (M_rr) set_along(M_rr, rr, 10, d);
    if (n_re > 0) set_along(modal.P_re, one.P_re, n_re, d);
    if (n_ee > 0) set_along(modal.P_ee, one.P_ee, n_ee, d);
    if (etadot) set_along(modal.b, one.b, 6 + n, d);
  }
}

#ifdef CARDAN_TANGENTS_V2  // where the program has the sweeps of v2 (core/CMakeLists.txt)
const Sweeps<Tangents>& tangents_v2() {
  static constexpr Sweeps<Tangents> set = make_inverse_sweeps<Tangents>();
  return set;
}
#endif

template <>
const Sweeps<Tangent>& sweeps<Tangent>() {
  static constexpr Sweeps<Tangent> set = make_sweeps<Tangent>();
  return set;
}

}  // namespace cardan::soa
