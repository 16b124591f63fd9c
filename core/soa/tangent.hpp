#pragma once
// The sweeps on Tangent (core/spatial/tangent.hpp) are their own directional derivatives, O(N) each, those on Tangents along eight
// directions at once. A direction is a tangent vector u: q moves by N(q) u.
#include "core/soa/lanes.hpp"
#include "core/spatial/tangent.hpp"

namespace cardan::soa {

#if defined(__AVX512F__)
using Eight = PackOf<8>::type;
#else
/// Twice four where no register holds eight: the compiler takes a vector of eight through memory there, at three times the code and four
/// times the time of these sweeps.
struct Eight {
  using Four = PackOf<4>::type;
  Four a, b;
  [[gnu::always_inline]] const double& operator[](int i) const { return reinterpret_cast<const double*>(this)[i]; }
  [[gnu::always_inline]] double& operator[](int i) { return reinterpret_cast<double*>(this)[i]; }
  [[gnu::always_inline]] Eight operator-() const { return {-a, -b}; }
  [[gnu::always_inline]] friend Eight operator+(const Eight& x, const Eight& y) { return {x.a + y.a, x.b + y.b}; }
  [[gnu::always_inline]] friend Eight operator-(const Eight& x, const Eight& y) { return {x.a - y.a, x.b - y.b}; }
  [[gnu::always_inline]] friend Eight operator*(const Eight& x, const Eight& y) { return {x.a * y.a, x.b * y.b}; }
  [[gnu::always_inline]] friend Eight operator/(const Eight& x, const Eight& y) { return {x.a / y.a, x.b / y.b}; }
};
#endif

inline constexpr int kDirections = 8;
/// Derivatives of a number along eight directions.
struct alignas(8 * kDirections) Slopes {
  Eight x;

  Slopes() = default;
  [[gnu::always_inline]] Slopes(double a) {  // NOLINT: the same along all
#if defined(__AVX512F__)
    x = Eight{a, a, a, a, a, a, a, a};
#else
    x.a = x.b = Eight::Four{a, a, a, a};
#endif
  }
  [[gnu::always_inline]] Slopes(int a) : Slopes(static_cast<double>(a)) {}  // NOLINT
  [[gnu::always_inline]] explicit Slopes(const Eight& a) : x(a) {}
  [[gnu::always_inline]] Slopes operator-() const { return Slopes(-x); }
  [[gnu::always_inline]] friend Slopes operator+(const Slopes& a, const Slopes& b) { return Slopes(a.x + b.x); }
  [[gnu::always_inline]] friend Slopes operator-(const Slopes& a, const Slopes& b) { return Slopes(a.x - b.x); }
  [[gnu::always_inline]] friend Slopes operator*(const Slopes& a, const Slopes& b) { return Slopes(a.x * b.x); }
  [[gnu::always_inline]] friend Slopes operator/(const Slopes& a, const Slopes& b) { return Slopes(a.x / b.x); }
};

}  // namespace cardan::soa

namespace cardan {
struct FlexibleBody;  // core/model/sweep_model.hpp

/// To the families, which know doubles only, a Tangent is two lanes: the value and the derivative (tangent_leaves.hpp).
inline double lane(const Tangent& a, int i) { return i == 0 ? a.x : a.d; }
inline void set_lane(Tangent& a, int i, double value) { (i == 0 ? a.x : a.d) = value; }
/// And Tangents are nine.
[[gnu::always_inline]] inline double lane(const TangentOf<soa::Slopes>& a, int i) { return i == 0 ? a.x : a.d.x[i - 1]; }
[[gnu::always_inline]] inline void set_lane(TangentOf<soa::Slopes>& a, int i, double value) {
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

using Tangents = TangentOf<Slopes>;
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
