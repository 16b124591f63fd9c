#pragma once
// The 113-bit scalar of the twin: the format of float128 (34 digits) without a compiler's own type or library. A class of its own around
// Boost's, which quad.cpp alone sees: to compile it into every expression of the twin would take half a minute more for each of its files.
#include <concepts>
#include <cstddef>
#include <limits>
#include <string>

#include "core/linalg/eigen_kernels.hpp"

namespace cardan::reference {

class Quad {
 public:
  Quad();
  Quad(std::integral auto i) : Quad(static_cast<double>(i)) {}  // NOLINT: numbers convert; |i| < 2^53
  Quad(double);                                                 // NOLINT
  explicit Quad(const std::string& decimal);
  explicit operator double() const;

  Quad& operator+=(const Quad&);
  Quad& operator-=(const Quad&);
  Quad& operator*=(const Quad&);
  Quad& operator/=(const Quad&);
  Quad operator-() const;
  friend Quad operator+(const Quad&, const Quad&);
  friend Quad operator-(const Quad&, const Quad&);
  friend Quad operator*(const Quad&, const Quad&);
  friend Quad operator/(const Quad&, const Quad&);
  friend bool operator==(const Quad&, const Quad&);
  friend bool operator<(const Quad&, const Quad&);
  friend bool operator>(const Quad&, const Quad&);
  friend bool operator<=(const Quad&, const Quad&);
  friend bool operator>=(const Quad&, const Quad&);
  friend Quad abs(const Quad&);
  friend Quad sqrt(const Quad&);
  friend Quad sin(const Quad&);
  friend Quad cos(const Quad&);
  friend Quad exp(const Quad&);
  friend Quad tanh(const Quad&);
  friend Quad pow(const Quad& base, const Quad& exponent);
  friend bool isfinite(const Quad&);
  friend bool isinf(const Quad&);
  friend bool isnan(const Quad&);

 private:
  friend struct QuadNumber;          // sees Boost's number in the bytes
  alignas(16) std::byte bytes_[32];  // no pointer is in it: to copy them is to copy the number
};

}  // namespace cardan::reference

/// The range is that of long double within a bit, the precision is not.
template <>
struct std::numeric_limits<cardan::reference::Quad> : std::numeric_limits<long double> {
  using Quad = cardan::reference::Quad;
  static constexpr int digits = 113, digits10 = 33, max_digits10 = 37;
  static Quad min();
  static Quad max();
  static Quad lowest();
  static Quad epsilon();
  static Quad infinity();
  static Quad quiet_NaN();
};

template <>
struct Eigen::NumTraits<cardan::reference::Quad> : Eigen::GenericNumTraits<cardan::reference::Quad> {
  enum { RequireInitialization = 1, AddCost = 4, MulCost = 8 };
};

#ifndef CARDAN_QUAD_KERNELS_HERE
CARDAN_EIGEN_KERNELS_ELSEWHERE(cardan::reference::Quad)
#endif
