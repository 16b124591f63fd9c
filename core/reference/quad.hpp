#pragma once
// The 113-bit scalar of the twin: the format of float128 (34 digits) without a compiler's own type or library. A class of its own, and
// its operations in quad.cpp: to compile Boost's into every expression of the twin would take half a minute more for each of its files.
#include <Eigen/Core>
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <concepts>
#include <limits>
#include <string>

namespace cardan::reference {

class Quad {
 public:
  using Number = boost::multiprecision::cpp_bin_float_quad;

  Quad() = default;                                             // zero
  Quad(std::integral auto i) : Quad(static_cast<double>(i)) {}  // NOLINT: numbers convert; |i| < 2^53
  Quad(double);                                                 // NOLINT
  explicit Quad(const Number& x) : x_(x) {}
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
  Number x_;
};

}  // namespace cardan::reference

template <>
struct std::numeric_limits<cardan::reference::Quad> : std::numeric_limits<cardan::reference::Quad::Number> {
  using Number = std::numeric_limits<cardan::reference::Quad::Number>;
  using Quad = cardan::reference::Quad;
  static Quad min() { return Quad((Number::min)()); }
  static Quad max() { return Quad((Number::max)()); }
  static Quad lowest() { return Quad(Number::lowest()); }
  static Quad epsilon() { return Quad(Number::epsilon()); }
  static Quad infinity() { return Quad(Number::infinity()); }
  static Quad quiet_NaN() { return Quad(Number::quiet_NaN()); }
};

template <>
struct Eigen::NumTraits<cardan::reference::Quad> : Eigen::GenericNumTraits<cardan::reference::Quad> {
  enum { RequireInitialization = 1, AddCost = 4, MulCost = 8 };
};
