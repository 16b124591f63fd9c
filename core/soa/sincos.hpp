#pragma once
// Sine and cosine of many angles at once: a loop without branches that the compiler vectorises, the same bits at every
// vector width. Reduction by three parts of pi/2 (Cody & Waite 1980), polynomials of the C library fdlibm (Sun, 1993) on
// [-pi/4, pi/4]: error below 1 ulp for |x| < 1e5; larger angles go to the C library.
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/soa/lanes.hpp"
#include "core/spatial/tangent.hpp"

namespace cardan::soa {

/// s[i], c[i] = sin, cos of x[i].
static inline void sine_cosine(const double* x, double* s, double* c, std::size_t n) {
  constexpr double kTwoOverPi = 6.36619772367581382433e-01, kRound = 6755399441055744.0, kLargest = 1e5;  // kRound = 1.5 * 2^52
  constexpr double kPart1 = 1.57079632673412561417e+00, kPart2 = 6.07710050630396597660e-11, kPart3 = 2.02226624879595063154e-21;
  constexpr auto kLargestBits = __builtin_bit_cast(std::uint64_t, kLargest);
  std::uint64_t outside = 0;  // its sign bit is set by an angle of kLargest or more
  for (std::size_t i = 0; i < n; ++i) {
    const double shifted = x[i] * kTwoOverPi + kRound, quadrant = shifted - kRound;
    const double a = x[i] - quadrant * kPart1, w = quadrant * kPart2, r = a - w;
    const double tail = (a - r) - w - quadrant * kPart3;  // x = r + tail
    const double z = r * r;
    const double ps = 8.33333333332248946124e-03 +
                      z * (-1.98412698298579493134e-04 +
                           z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)));
    const double sine = r + (z * r * (-1.66666666666666324348e-01 + z * ps) + tail * (1.0 - 0.5 * z));
    const double pc =
        z * (4.16666666666666019037e-02 +
             z * (-1.38888888888741095749e-03 +
                  z * (2.48015872894767294178e-05 +
                       z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
    const double half = 0.5 * z, head = 1.0 - half;
    const double cosine = head + (((1.0 - head) - half) + (z * pc - r * tail));
    // The two low bits of the rounded quadrant stand in the low bits of `shifted`: bit 0 exchanges sine and cosine, the
    // others turn signs. Written on the bit patterns, without a branch.
    const auto bits = __builtin_bit_cast(std::uint64_t, shifted);
    const auto p = __builtin_bit_cast(std::uint64_t, sine), q = __builtin_bit_cast(std::uint64_t, cosine);
    const std::uint64_t exchange = (p ^ q) & (0 - (bits & 1));
    s[i] = __builtin_bit_cast(double, p ^ exchange ^ ((bits & 2) << 62));
    c[i] = __builtin_bit_cast(double, q ^ exchange ^ (((bits + 1) & 2) << 62));
    outside |= kLargestBits - 1 - (__builtin_bit_cast(std::uint64_t, x[i]) & ~(std::uint64_t{1} << 63));
  }
  if (!(outside >> 63)) return;
  for (std::size_t i = 0; i < n; ++i)
    if (!(x[i] < kLargest && x[i] > -kLargest)) {
      s[i] = std::sin(x[i]);
      c[i] = std::cos(x[i]);
    }
}

template <int W>
static void sine_cosine(const Lanes<W>* x, Lanes<W>* s, Lanes<W>* c, std::size_t n) {
  sine_cosine(reinterpret_cast<const double*>(x), reinterpret_cast<double*>(s), reinterpret_cast<double*>(c), n * W);
}

/// Of derivatives the values first.
template <class D>
static void sine_cosine(const TangentOf<D>* x, TangentOf<D>* s, TangentOf<D>* c, std::size_t n) {
  constexpr std::size_t kBlock = 8;
  for (std::size_t first = 0; first < n; first += kBlock) {
    const std::size_t count = n - first < kBlock ? n - first : kBlock;
    double angle[kBlock] = {}, sine[kBlock], cosine[kBlock];
    for (std::size_t i = 0; i < count; ++i) angle[i] = x[first + i].x;
    sine_cosine(angle, sine, cosine, kBlock);
    for (std::size_t i = 0; i < count; ++i) {
      const D turn = x[first + i].d;
      s[first + i] = {sine[i], cosine[i] * turn};
      c[first + i] = {cosine[i], -sine[i] * turn};
    }
  }
}

/// Any other scalar: one by one.
template <class T>
static void sine_cosine(const T* x, T* s, T* c, std::size_t n) {
  using std::cos, std::sin;
  for (std::size_t i = 0; i < n; ++i) {
    s[i] = sin(x[i]);
    c[i] = cos(x[i]);
  }
}

}  // namespace cardan::soa
