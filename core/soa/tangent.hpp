#pragma once
// The sweeps on Tangent (core/spatial/tangent.hpp) are their own directional derivatives, O(N) each. A direction is a tangent vector u:
// q moves by N(q) u.
#include "core/soa/lanes.hpp"
#include "core/spatial/tangent.hpp"

namespace cardan {
struct FlexibleBody;  // core/model/sweep_model.hpp

/// To the families, which know doubles only, a Tangent is two lanes: the value and the derivative (tangent_leaves.hpp).
inline double lane(const Tangent& a, int i) { return i == 0 ? a.x : a.d; }
inline void set_lane(Tangent& a, int i, double value) { (i == 0 ? a.x : a.d) = value; }

}  // namespace cardan

namespace cardan::soa {

using cardan::Tangent;
template <>
inline constexpr int kWidth<Tangent> = 2;

/// Sum of c_i f(i h), i = -4 ... 4: the derivative at 0 of a smooth vector function of s, of eighth order in h; exact but for
/// round-off where f is a polynomial of degree 8 or less. f(s, out) writes n numbers; `work` holds n more.
template <class F>
void derivative(const F& f, double h, int n, double* out, double* work) {
  static constexpr double kWeight[] = {4.0 / 5, -1.0 / 5, 4.0 / 105, -1.0 / 280};
  for (int i = 0; i < n; ++i) out[i] = 0.0;
  for (int k = 4; k >= 1; --k)
    for (const double side : {1.0, -1.0}) {
      f(side * k * h, work);
      for (int i = 0; i < n; ++i) out[i] += side * kWeight[k - 1] / h * work[i];
    }
}

/// How a node of a flexible body with m modes has moved (cardan_body_family::node), x, S and a with their derivatives; a null where etadot
/// is.
void family_node(const FlexibleBody& f, int m, int node, const Tangent* eta, const Tangent* etadot, double* scratch, Tangent* x, Tangent* S,
                 Tangent* a);

}  // namespace cardan::soa
