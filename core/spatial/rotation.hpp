#pragma once
// Rotations: axis and angle, quaternion (w, x, y, z), rotation vector, and the derivative maps of the rotation vector.
#include <cmath>

#include "core/spatial/vec3.hpp"

namespace cardan {

/// exp(u~ q) from the sine and cosine of q, u of unit length (Rodrigues).
template <class T>
static constexpr Mat3<T> rotation_about(const Vec3<T>& u, const T& s, const T& c) {
  const T k = T(1) - c;
  return {c + k * u.x * u.x,       k * u.x * u.y - s * u.z, k * u.x * u.z + s * u.y, k * u.x * u.y + s * u.z, c + k * u.y * u.y,
          k * u.y * u.z - s * u.x, k * u.x * u.z - s * u.y, k * u.y * u.z + s * u.x, c + k * u.z * u.z};
}

/// R(q / |q|), q = (w, x, y, z): a proper rotation for any q but zero, as integrator stages need it.
template <class T>
static constexpr Mat3<T> rotation_of_quaternion(const T& w, const T& x, const T& y, const T& z) {
  const T s = T(2) / (w * w + x * x + y * y + z * z), one(1);
  return {one - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y), s * (x * y + w * z),      one - s * (x * x + z * z),
          s * (y * z - w * x),       s * (x * z - w * y), s * (y * z + w * x), one - s * (x * x + y * y)};
}

/// Coefficients of R, Jl and dJl at a rotation vector of square length t2 (mathematics 3.1), by power series below
/// |t| = 1 where the closed forms cancel.
template <class T>
struct RotationCoefficients {
  T s, a, b, a1, b1;  // R = I + s t~ + a t~^2;  Jl = I + a t~ + b t~^2;  derivatives of a, b: a1 (t . d), b1 (t . d)
};
/// The coefficients by their power series in t2 (10 terms: 1e-20 at |t| = 1), Horner's rule.
template <class T>
static RotationCoefficients<T> small_rotation_coefficients(const T& t2) {
  constexpr double kInverseFactorial[] = {1.0,
                                          1.0,
                                          1.0 / 2,
                                          1.0 / 6,
                                          1.0 / 24,
                                          1.0 / 120,
                                          1.0 / 720,
                                          1.0 / 5040,
                                          1.0 / 40320,
                                          1.0 / 362880,
                                          1.0 / 3628800,
                                          1.0 / 39916800,
                                          1.0 / 479001600.0,
                                          1.0 / 6227020800.0,
                                          1.0 / 87178291200.0,
                                          1.0 / 1307674368000.0,
                                          1.0 / 20922789888000.0,
                                          1.0 / 355687428096000.0,
                                          1.0 / 6402373705728000.0,
                                          1.0 / 121645100408832000.0,
                                          1.0 / 2432902008176640000.0,
                                          1.0 / 51090942171709440000.0,
                                          1.0 / 1124000727777607680000.0,
                                          1.0 / 25852016738884976640000.0};
  T s(0), a(0), b(0), a1(0), b1(0);
  for (int k = 9; k >= 0; --k) {  // s = sum (-t2)^k / (2k+1)!, a: (2k+2)!, b: (2k+3)!; a1 = 2 da/d(t2), b1 = 2 db/d(t2)
    s = T(kInverseFactorial[2 * k + 1]) - t2 * s;
    a = T(kInverseFactorial[2 * k + 2]) - t2 * a;
    b = T(kInverseFactorial[2 * k + 3]) - t2 * b;
    a1 = T(-2.0 * (k + 1) * kInverseFactorial[2 * k + 4]) - t2 * a1;
    b1 = T(-2.0 * (k + 1) * kInverseFactorial[2 * k + 5]) - t2 * b1;
  }
  return {s, a, b, a1, b1};
}

template <class T>
static RotationCoefficients<T> rotation_coefficients(const T& t2) {
  using std::cos, std::sin, std::sqrt;
  if (t2 < T(1)) return small_rotation_coefficients(t2);
  const T t = sqrt(t2), sn = sin(t), cs = cos(t), one(1), two(2), three(3);
  const T t4 = t2 * t2;
  return {sn / t, (one - cs) / t2, (t - sn) / (t2 * t), (t * sn - two * (one - cs)) / t4, (three * sn - t * (two + cs)) / (t4 * t)};
}

/// exp(t~).
template <class T>
static constexpr Mat3<T> rotation_of_vector(const RotationCoefficients<T>& c, const Vec3<T>& t) {
  const Vec3<T> st = c.s * t, at = c.a * t;
  const T tt = dot(t, t), one(1);
  return {one + at.x * t.x - c.a * tt, at.x * t.y - st.z, at.x * t.z + st.y, at.x * t.y + st.z,          one + at.y * t.y - c.a * tt,
          at.y * t.z - st.x,           at.x * t.z - st.y, at.y * t.z + st.x, one + at.z * t.z - c.a * tt};
}
/// Jl(t) d: the angular velocity, in base axes, of exp(t~) when t' = d.
template <class T>
static constexpr Vec3<T> left_jacobian(const RotationCoefficients<T>& c, const Vec3<T>& t, const Vec3<T>& d) {
  const Vec3<T> td = cross(t, d);
  return d + c.a * td + c.b * cross(t, td);
}
/// (d/de Jl(t + e d)) g.
template <class T>
static constexpr Vec3<T> left_jacobian_dot(const RotationCoefficients<T>& c, const Vec3<T>& t, const Vec3<T>& d, const Vec3<T>& g) {
  const Vec3<T> tg = cross(t, g), dg = cross(d, g);
  const T td = dot(t, d);
  return c.a * dg + c.b * (cross(d, tg) + cross(t, dg)) + (c.a1 * td) * tg + (c.b1 * td) * cross(t, tg);
}

}  // namespace cardan
