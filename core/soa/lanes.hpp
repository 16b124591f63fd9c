#pragma once
// W samples side by side in one number: the sweeps on Lanes<W> do W states at once, one state per lane. Every operation works
// on each lane by itself, so a sample has the same bits whatever stands in the other lanes.
#include <cmath>
#include <cstddef>
#include <type_traits>

#include "core/spatial/rotation.hpp"

namespace cardan::soa {

template <int W>
struct PackOf;
template <>
struct PackOf<2> {
  using type [[gnu::vector_size(16)]] = double;
};
template <>
struct PackOf<4> {
  using type [[gnu::vector_size(32)]] = double;
};
#if defined(__AVX512F__)
template <>
struct PackOf<8> {
  using type [[gnu::vector_size(64)]] = double;
};
#else
/// Twice four where no register holds eight: a vector of eight goes through memory there, at twice the code and, with AVX2, five to six
/// times the time (docs/benchmarks.md, analyses).
struct TwiceFour {
  using Four = PackOf<4>::type;
  Four a, b;
  [[gnu::always_inline]] const double& operator[](std::size_t i) const { return reinterpret_cast<const double*>(this)[i]; }
  [[gnu::always_inline]] double& operator[](std::size_t i) { return reinterpret_cast<double*>(this)[i]; }
  [[gnu::always_inline]] TwiceFour operator-() const { return {-a, -b}; }
  [[gnu::always_inline]] friend TwiceFour operator+(const TwiceFour& x, const TwiceFour& y) { return {x.a + y.a, x.b + y.b}; }
  [[gnu::always_inline]] friend TwiceFour operator-(const TwiceFour& x, const TwiceFour& y) { return {x.a - y.a, x.b - y.b}; }
  [[gnu::always_inline]] friend TwiceFour operator*(const TwiceFour& x, const TwiceFour& y) { return {x.a * y.a, x.b * y.b}; }
  [[gnu::always_inline]] friend TwiceFour operator/(const TwiceFour& x, const TwiceFour& y) { return {x.a / y.a, x.b / y.b}; }
};
template <>
struct PackOf<8> {
  using type = TwiceFour;
};
#endif

template <int W>
struct alignas(8 * W) Lanes {
  using Pack = typename PackOf<W>::type;
  Pack x;

  Lanes() = default;
  [[gnu::always_inline]] Lanes(double a) {  // NOLINT: a number is the same number in every lane; loaded as it stands, nothing added
    if constexpr (W == 2)
      x = Pack{a, a};
    else if constexpr (W == 4)
      x = Pack{a, a, a, a};
    else if constexpr (std::is_class_v<Pack>)
      x.a = x.b = typename PackOf<4>::type{a, a, a, a};
    else
      x = Pack{a, a, a, a, a, a, a, a};
  }
  [[gnu::always_inline]] Lanes(int a) : Lanes(static_cast<double>(a)) {}  // NOLINT
  [[gnu::always_inline]] explicit Lanes(const Pack& a) : x(a) {}
  /// Of the first lane: for messages only.
  [[gnu::always_inline]] explicit operator double() const { return x[0]; }
  [[gnu::always_inline]] Lanes operator-() const { return Lanes(-x); }
  [[gnu::always_inline]] friend Lanes operator+(const Lanes& a, const Lanes& b) { return Lanes(a.x + b.x); }
  [[gnu::always_inline]] friend Lanes operator-(const Lanes& a, const Lanes& b) { return Lanes(a.x - b.x); }
  [[gnu::always_inline]] friend Lanes operator*(const Lanes& a, const Lanes& b) { return Lanes(a.x * b.x); }
  [[gnu::always_inline]] friend Lanes operator/(const Lanes& a, const Lanes& b) { return Lanes(a.x / b.x); }
  /// True where it holds in every lane: a check that fails in one lane fails.
  [[gnu::always_inline]] friend bool operator>(const Lanes& a, const Lanes& b) {
#if defined(__AVX512F__)
    if constexpr (W == 8) return __builtin_ia32_cmppd512_mask(a.x, b.x, 0x1e, 0xff, 4) == 0xff;  // greater, quiet; rounding as set
#elif defined(__AVX__)
    if constexpr (W == 4) return __builtin_ia32_movmskpd256(reinterpret_cast<Pack>(a.x > b.x)) == 0xf;
#endif
#if defined(__SSE2__)
    if constexpr (W == 2) return __builtin_ia32_movmskpd(reinterpret_cast<Pack>(a.x > b.x)) == 0x3;
#endif
    const auto mask = a.x > b.x;
    long long all = -1;
    for (int i = 0; i < W; ++i) all &= mask[i];
    return all != 0;
  }
};

template <class T>
inline constexpr int kWidth = 1;
template <int W>
inline constexpr int kWidth<Lanes<W>> = W;
/// A value with derivatives side by side behind it: TangentOf<Lanes>.
template <class T>
inline constexpr bool kHasSlopes = false;
/// States side by side, of which nobody looks at more than the result.
template <class T>
inline constexpr bool kStates = false;
template <int W>
inline constexpr bool kStates<Lanes<W>> = true;

/// 1 where x > limit, else 0: kernels choose by arithmetic, so that lanes need no branch.
template <class T>
static T above(const T& x, const T& limit) {
  return x > limit ? T(1) : T(0);
}
template <int W>
[[gnu::always_inline]] inline Lanes<W> above(const Lanes<W>& x, const Lanes<W>& limit) {
  return Lanes<W>(x.x > limit.x ? Lanes<W>(1.0).x : Lanes<W>(0.0).x);
}

/// Lane i of a number.
[[gnu::always_inline]] inline double lane(const double& a, int) { return a; }
template <int W>
[[gnu::always_inline]] inline double lane(const Lanes<W>& a, int i) {
  return a.x[i];
}
template <class T>
[[gnu::always_inline]] inline double lane(const T& a, int) {
  return static_cast<double>(a);
}
[[gnu::always_inline]] inline void set_lane(double& a, int, double value) { a = value; }
template <int W>
[[gnu::always_inline]] inline void set_lane(Lanes<W>& a, int i, double value) {
  a.x[i] = value;
}
template <class T>
[[gnu::always_inline]] inline void set_lane(T& a, int, double value) {
  a = T(value);
}

/// By lanes: functions that branch on their argument.
template <int W>
[[gnu::always_inline]] inline Lanes<W> sqrt(const Lanes<W>& a) {
  Lanes<W> r;
  for (int i = 0; i < W; ++i) r.x[i] = std::sqrt(a.x[i]);
  return r;
}
template <int W>
static Lanes<W> sin(const Lanes<W>& a) {
  Lanes<W> r;
  for (int i = 0; i < W; ++i) r.x[i] = std::sin(a.x[i]);
  return r;
}
template <int W>
static Lanes<W> cos(const Lanes<W>& a) {
  Lanes<W> r;
  for (int i = 0; i < W; ++i) r.x[i] = std::cos(a.x[i]);
  return r;
}

using cardan::rotation_coefficients;
template <int W>
static RotationCoefficients<Lanes<W>> rotation_coefficients(const Lanes<W>& t2) {
  RotationCoefficients<Lanes<W>> r;
  for (int i = 0; i < W; ++i) {
    const RotationCoefficients<double> one = cardan::rotation_coefficients<double>(t2.x[i]);
    r.s.x[i] = one.s, r.a.x[i] = one.a, r.b.x[i] = one.b, r.a1.x[i] = one.a1, r.b1.x[i] = one.b1;
  }
  return r;
}

}  // namespace cardan::soa
