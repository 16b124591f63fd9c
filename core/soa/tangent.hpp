#pragma once
// A number and its derivative along one direction: the sweeps on Tangent are their own directional derivatives, O(N) each
// (forward differentiation; Griewank & Walther 2008). A direction is a tangent vector u: q moves by N(q) u.
#include <cmath>

#include "core/soa/lanes.hpp"

namespace cardan::soa {

/// x + d e, e^2 = 0.
struct Tangent {
  double x, d;

  Tangent() = default;
  constexpr Tangent(double value) : x(value), d(0.0) {}                  // NOLINT: a constant
  constexpr Tangent(int value) : Tangent(static_cast<double>(value)) {}  // NOLINT
  constexpr Tangent(double value, double derivative) : x(value), d(derivative) {}
  explicit operator double() const { return x; }
  friend Tangent operator-(const Tangent& a) { return {-a.x, -a.d}; }
  friend Tangent operator+(const Tangent& a, const Tangent& b) { return {a.x + b.x, a.d + b.d}; }
  friend Tangent operator-(const Tangent& a, const Tangent& b) { return {a.x - b.x, a.d - b.d}; }
  friend Tangent operator*(const Tangent& a, const Tangent& b) { return {a.x * b.x, a.d * b.x + a.x * b.d}; }
  friend Tangent operator/(const Tangent& a, const Tangent& b) {
    const double r = a.x / b.x;
    return {r, (a.d - r * b.d) / b.x};
  }
  friend bool operator<(const Tangent& a, const Tangent& b) { return a.x < b.x; }
  friend bool operator>(const Tangent& a, const Tangent& b) { return a.x > b.x; }
};
inline Tangent sin(const Tangent& a) { return {std::sin(a.x), std::cos(a.x) * a.d}; }
inline Tangent cos(const Tangent& a) { return {std::cos(a.x), -std::sin(a.x) * a.d}; }
/// The root of 0 has the derivative 0: what has no inertia in one state has none beside it.
inline Tangent sqrt(const Tangent& a) {
  const double r = std::sqrt(a.x);
  return {r, r > 0.0 ? 0.5 * a.d / r : 0.0};
}

/// To the families, which know doubles only, a Tangent is two lanes: the value and the derivative (tangent_leaves.hpp).
template <>
inline constexpr int kWidth<Tangent> = 2;
inline double lane(const Tangent& a, int i) { return i == 0 ? a.x : a.d; }
inline void set_lane(Tangent& a, int i, double value) { (i == 0 ? a.x : a.d) = value; }

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

}  // namespace cardan::soa
