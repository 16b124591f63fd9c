#pragma once
// A number and its derivative along one direction, or along several at once (forward differentiation; Griewank & Walther 2008).
#include <cmath>

namespace cardan {

/// x + d e, e^2 = 0. D: double, or numbers side by side, one for each direction. The sweeps on it share no function between instruction
/// sets (vec3.hpp), so all of it is inlined.
template <class D>
struct TangentOf {
  double x;
  D d;

  TangentOf() = default;
  [[gnu::always_inline]] constexpr TangentOf(double value) : x(value), d(0.0) {}                    // NOLINT: a constant
  [[gnu::always_inline]] constexpr TangentOf(int value) : TangentOf(static_cast<double>(value)) {}  // NOLINT
  [[gnu::always_inline]] constexpr TangentOf(double value, const D& derivative) : x(value), d(derivative) {}
  [[gnu::always_inline]] explicit operator double() const { return x; }
  [[gnu::always_inline]] friend TangentOf operator-(const TangentOf& a) { return {-a.x, -a.d}; }
  [[gnu::always_inline]] friend TangentOf operator+(const TangentOf& a, const TangentOf& b) { return {a.x + b.x, a.d + b.d}; }
  [[gnu::always_inline]] friend TangentOf operator-(const TangentOf& a, const TangentOf& b) { return {a.x - b.x, a.d - b.d}; }
  [[gnu::always_inline]] friend TangentOf operator*(const TangentOf& a, const TangentOf& b) { return {a.x * b.x, a.d * b.x + a.x * b.d}; }
  [[gnu::always_inline]] friend TangentOf operator/(const TangentOf& a, const TangentOf& b) {
    const double r = a.x / b.x;
    return {r, (a.d - r * b.d) / b.x};
  }
  [[gnu::always_inline]] friend bool operator<(const TangentOf& a, const TangentOf& b) { return a.x < b.x; }
  [[gnu::always_inline]] friend bool operator>(const TangentOf& a, const TangentOf& b) { return a.x > b.x; }
};
using Tangent = TangentOf<double>;

template <class D>
[[gnu::always_inline]] inline TangentOf<D> sin(const TangentOf<D>& a) {
  return {std::sin(a.x), std::cos(a.x) * a.d};
}
template <class D>
[[gnu::always_inline]] inline TangentOf<D> cos(const TangentOf<D>& a) {
  return {std::cos(a.x), -std::sin(a.x) * a.d};
}
/// The root of 0 has the derivative 0: what has no inertia in one state has none beside it.
template <class D>
[[gnu::always_inline]] inline TangentOf<D> sqrt(const TangentOf<D>& a) {
  const double r = std::sqrt(a.x);
  return {r, r > 0.0 ? D(0.5 * a.d / r) : D(0.0)};
}
inline Tangent exp(const Tangent& a) { return {std::exp(a.x), std::exp(a.x) * a.d}; }
inline Tangent tanh(const Tangent& a) {
  const double y = std::tanh(a.x);
  return {y, (1.0 - y * y) * a.d};
}
inline Tangent pow(const Tangent& a, double n) { return {std::pow(a.x, n), n * std::pow(a.x, n - 1.0) * a.d}; }
inline Tangent abs(const Tangent& a) { return a.x < 0.0 ? -a : a; }

}  // namespace cardan
