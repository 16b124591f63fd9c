#pragma once
// Geodetic latitude and height above an ellipsoid.
#include <cmath>

namespace cardan {

template <class T>
struct Geodetic {
  T sine, cosine, height;  // of the latitude; along the normal [m]

  /// Of a place `out` from the axis and `z` along it, by Bowring (1976), three times: to round-off from far below to far above.
  static Geodetic of(const T& out, const T& z, double radius, double flattening) noexcept {
    using std::sqrt;
    const double polar = radius * (1.0 - flattening), e2 = flattening * (2.0 - flattening), e2_polar = e2 / (1.0 - e2);
    const T r = sqrt(out * out + z * z);
    if (!(r > T(0.0))) return {T(0.0), T(1.0), T(-radius)};
    // Of the reduced latitude u, on the ellipsoid; the normal there is along (c, s).
    T u_cosine = T(radius) * out, u_sine = T(polar) * z * (T(1.0) + T(e2_polar * polar) / r), c(1.0), s(0.0);
    const auto to_unit = [](T& x, T& y) {
      const T size = T(1.0) / sqrt(x * x + y * y);
      x = size * x, y = size * y;
    };
    for (int i = 0; i < 3; ++i) {
      to_unit(u_cosine, u_sine);
      c = out - T(e2 * radius) * u_cosine * u_cosine * u_cosine, s = z + T(e2_polar * polar) * u_sine * u_sine * u_sine;
      to_unit(c, s);
      u_cosine = c, u_sine = T(1.0 - flattening) * s;
    }
    to_unit(u_cosine, u_sine);
    return {s, c, (out - T(radius) * u_cosine) * c + (z - T(polar) * u_sine) * s};
  }
};

}  // namespace cardan
