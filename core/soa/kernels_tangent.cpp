// The sweeps on numbers that carry their derivative (tangent.hpp).
#include "core/soa/kernels_tangent.hpp"

#include "core/soa/tangent_leaves.hpp"
// what families give must be known before the sweeps that ask for it
#include "core/soa/sweeps_impl.hpp"
#include "core/soa/workspace_layout.hpp"

namespace cardan::soa {

template class Workspace<Tangent>;

// dx = S d eta; S and a along eta by differences, as the inertia; a is a quadratic form in eta'.
void family_node(const FlexibleBody& f, int m, int node, const Tangent* eta, const Tangent* etadot, double*, Tangent* x, Tangent* S,
                 Tangent* a) {
  const int n = 6 * m + (etadot ? 6 : 0);
  std::vector<double> scratch(static_cast<std::size_t>(2 * m + 6 + 3 * n));
  double *e = scratch.data(), *ed = e + m, *moved = ed + m, *value = moved + 6, *slope = value + n, *work = slope + n;
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

template <>
const Sweeps<Tangent>& sweeps<Tangent>() {
  static constexpr Sweeps<Tangent> set = make_sweeps<Tangent>();
  return set;
}

}  // namespace cardan::soa
