#include "core/reference/quad.hpp"

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <new>
#include <type_traits>

namespace cardan::reference {

using Number = boost::multiprecision::cpp_bin_float_quad;
static_assert(sizeof(Number) <= sizeof(Quad) && alignof(Number) <= alignof(Quad) && std::is_trivially_destructible_v<Number>);

struct QuadNumber {
  static const Number& of(const Quad& a) { return *std::launder(reinterpret_cast<const Number*>(a.bytes_)); }
  static Number& of(Quad& a) { return *std::launder(reinterpret_cast<Number*>(a.bytes_)); }
  /// In place of what the bytes hold, if anything.
  static void begin(Quad& a, const Number& x) { new (a.bytes_) Number(x); }
  static Quad quad(const Number& x) {
    Quad a;
    of(a) = x;
    return a;
  }
};

namespace {
const Number& of(const Quad& a) { return QuadNumber::of(a); }
Quad quad(const Number& x) { return QuadNumber::quad(x); }
}  // namespace

Quad::Quad(double x) { QuadNumber::begin(*this, Number(x)); }
Quad::Quad(const std::string& decimal) { QuadNumber::begin(*this, Number(decimal)); }
Quad::operator double() const { return static_cast<double>(of(*this)); }

Quad& Quad::operator+=(const Quad& b) {
  QuadNumber::of(*this) += of(b);
  return *this;
}
Quad& Quad::operator-=(const Quad& b) {
  QuadNumber::of(*this) -= of(b);
  return *this;
}
Quad& Quad::operator*=(const Quad& b) {
  QuadNumber::of(*this) *= of(b);
  return *this;
}
Quad& Quad::operator/=(const Quad& b) {
  QuadNumber::of(*this) /= of(b);
  return *this;
}
Quad Quad::operator-() const { return quad(-of(*this)); }
Quad operator+(const Quad& a, const Quad& b) { return quad(of(a) + of(b)); }
Quad operator-(const Quad& a, const Quad& b) { return quad(of(a) - of(b)); }
Quad operator*(const Quad& a, const Quad& b) { return quad(of(a) * of(b)); }
Quad operator/(const Quad& a, const Quad& b) { return quad(of(a) / of(b)); }

bool operator==(const Quad& a, const Quad& b) { return of(a) == of(b); }
bool operator<(const Quad& a, const Quad& b) { return of(a) < of(b); }
bool operator>(const Quad& a, const Quad& b) { return of(a) > of(b); }
bool operator<=(const Quad& a, const Quad& b) { return of(a) <= of(b); }
bool operator>=(const Quad& a, const Quad& b) { return of(a) >= of(b); }

Quad abs(const Quad& a) { return quad(abs(of(a))); }
Quad sqrt(const Quad& a) { return quad(sqrt(of(a))); }
Quad sin(const Quad& a) { return quad(sin(of(a))); }
Quad cos(const Quad& a) { return quad(cos(of(a))); }
Quad exp(const Quad& a) { return quad(exp(of(a))); }
Quad tanh(const Quad& a) { return quad(tanh(of(a))); }
Quad pow(const Quad& base, const Quad& exponent) { return quad(pow(of(base), of(exponent))); }
bool isfinite(const Quad& a) { return boost::multiprecision::isfinite(of(a)); }
bool isinf(const Quad& a) { return boost::multiprecision::isinf(of(a)); }
bool isnan(const Quad& a) { return boost::multiprecision::isnan(of(a)); }

}  // namespace cardan::reference

using Limits = std::numeric_limits<cardan::reference::Quad>;
using Numbers = std::numeric_limits<cardan::reference::Number>;
static_assert(Limits::digits == Numbers::digits && Limits::digits10 == Numbers::digits10 && Limits::max_digits10 == Numbers::max_digits10);
Limits::Quad Limits::min() { return cardan::reference::quad((Numbers::min)()); }
Limits::Quad Limits::max() { return cardan::reference::quad((Numbers::max)()); }
Limits::Quad Limits::lowest() { return cardan::reference::quad(Numbers::lowest()); }
Limits::Quad Limits::epsilon() { return cardan::reference::quad(Numbers::epsilon()); }
Limits::Quad Limits::infinity() { return cardan::reference::quad(Numbers::infinity()); }
Limits::Quad Limits::quiet_NaN() { return cardan::reference::quad(Numbers::quiet_NaN()); }
