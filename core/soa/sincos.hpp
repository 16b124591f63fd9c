#pragma once
// Sine and cosine of many angles at once: a loop without branches that the compiler vectorises, the same bits at every
// vector width. Reduction by three parts of pi/2 (Cody & Waite 1980), polynomials of the C library fdlibm (Sun, 1993) on
// [-pi/4, pi/4]: error below 1 ulp for |x| < 1e5; larger angles go to the C library.
#include <cmath>
#include <cstddef>

namespace cardan::soa {

/// s[i], c[i] = sin, cos of x[i].
inline void sine_cosine(const double* x, double* s, double* c, std::size_t n) {
  constexpr double kTwoOverPi = 6.36619772367581382433e-01, kRound = 6755399441055744.0;  // 1.5 * 2^52
  constexpr double kPart1 = 1.57079632673412561417e+00, kPart2 = 6.07710050630396597660e-11,
                   kPart3 = 2.02226624879595063154e-21;
  bool large = false;
  for (std::size_t i = 0; i < n; ++i) {
    const double shifted = x[i] * kTwoOverPi + kRound, quadrant = shifted - kRound;
    const double a = x[i] - quadrant * kPart1, w = quadrant * kPart2, r = a - w;
    const double tail = (a - r) - w - quadrant * kPart3;  // x = r + tail
    const double z = r * r;
    const double ps = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 +
                      z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)));
    const double sine = r + (z * r * (-1.66666666666666324348e-01 + z * ps) + tail * (1.0 - 0.5 * z));
    const double pc = z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 +
                      z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
    const double half = 0.5 * z, head = 1.0 - half;
    const double cosine = head + (((1.0 - head) - half) + (z * pc - r * tail));
    // The two low bits of the rounded quadrant stand in the low bits of `shifted`.
    long long bits;
    __builtin_memcpy(&bits, &shifted, sizeof bits);
    const bool swap = bits & 1, minus_s = bits & 2, minus_c = (bits + 1) & 2;
    const double u = swap ? cosine : sine, v = swap ? sine : cosine;
    s[i] = minus_s ? -u : u;
    c[i] = minus_c ? -v : v;
    large = large || !(x[i] < 1e5 && x[i] > -1e5);
  }
  if (!large) return;
  for (std::size_t i = 0; i < n; ++i)
    if (!(x[i] < 1e5 && x[i] > -1e5)) {
      s[i] = std::sin(x[i]);
      c[i] = std::cos(x[i]);
    }
}

/// Any other scalar: one by one.
template <class T>
void sine_cosine(const T* x, T* s, T* c, std::size_t n) {
  using std::cos, std::sin;
  for (std::size_t i = 0; i < n; ++i) {
    s[i] = sin(x[i]);
    c[i] = cos(x[i]);
  }
}

}  // namespace cardan::soa
