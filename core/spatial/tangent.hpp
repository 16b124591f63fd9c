#pragma once
// A number and its derivative along one direction (forward differentiation; Griewank & Walther 2008).
#include <cmath>

namespace cardan {

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
inline Tangent exp(const Tangent& a) { return {std::exp(a.x), std::exp(a.x) * a.d}; }
inline Tangent tanh(const Tangent& a) {
  const double y = std::tanh(a.x);
  return {y, (1.0 - y * y) * a.d};
}
inline Tangent pow(const Tangent& a, double n) { return {std::pow(a.x, n), n * std::pow(a.x, n - 1.0) * a.d}; }
inline Tangent abs(const Tangent& a) { return a.x < 0.0 ? -a : a; }

}  // namespace cardan
