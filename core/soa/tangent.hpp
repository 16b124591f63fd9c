#pragma once
// The sweeps on Tangent (core/spatial/tangent.hpp) are their own directional derivatives, O(N) each, those on Tangents along eight
// directions at once. A direction is a tangent vector u: q moves by N(q) u.
#include "core/soa/lanes.hpp"
#include "core/spatial/tangent.hpp"

namespace cardan {
struct FlexibleBody;  // core/model/sweep_model.hpp

/// To the families, which know doubles only, a Tangent is two lanes: the value and the derivative (tangent_leaves.hpp).
inline double lane(const Tangent& a, int i) { return i == 0 ? a.x : a.d; }
inline void set_lane(Tangent& a, int i, double value) { (i == 0 ? a.x : a.d) = value; }
/// And Tangents are nine.
[[gnu::always_inline]] inline double lane(const TangentOf<soa::Lanes<8>>& a, int i) { return i == 0 ? a.x : a.d.x[i - 1]; }
[[gnu::always_inline]] inline void set_lane(TangentOf<soa::Lanes<8>>& a, int i, double value) {
  if (i == 0)
    a.x = value;
  else
    a.d.x[i - 1] = value;
}

}  // namespace cardan

namespace cardan::soa {

using cardan::Tangent;
template <>
inline constexpr int kWidth<Tangent> = 2;

inline constexpr int kDirections = 8;
using Tangents = TangentOf<Lanes<kDirections>>;
template <>
inline constexpr int kWidth<Tangents> = 1 + kDirections;
template <>
inline constexpr bool kHasSlopes<Tangents> = true;
/// Along direction i.
inline Tangent along(const Tangents& a, int i) { return {a.x, a.d.x[i]}; }

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
void family_node(const FlexibleBody& f, int m, int node, const Tangents* eta, const Tangents* etadot, double* scratch, Tangents* x,
                 Tangents* S, Tangents* a);

}  // namespace cardan::soa
