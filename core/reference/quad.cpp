#include "core/reference/quad.hpp"

#include <bit>
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <cstdint>
#include <new>
#include <type_traits>

namespace cardan::reference {

using Number = boost::multiprecision::cpp_bin_float_quad;
using Backend = Number::backend_type;
static_assert(sizeof(Number) <= sizeof(Quad) && alignof(Number) <= alignof(Quad) && std::is_trivially_destructible_v<Number>);

struct QuadNumber {
  static const Number& of(const Quad& a) { return *std::launder(reinterpret_cast<const Number*>(a.bytes_)); }
  static Number& of(Quad& a) { return *std::launder(reinterpret_cast<Number*>(a.bytes_)); }
  /// In place of what the bytes hold, if anything.
  static void begin(Quad& a, const Number& x) { new (a.bytes_) Number(x); }
};

namespace {

const Number& of(const Quad& a) { return QuadNumber::of(a); }

Quad quad(const Number& x) {
  Quad a;
  QuadNumber::of(a) = x;
  return a;
}

// Sums and products of plain numbers, which are all of the twin's time: to the bits of Boost's, with what 113 bits are in a processor
// of 64. A plain number is (-1)^sign m 2^(exponent - 112), 2^112 <= m < 2^113.

__extension__ using Wide = unsigned __int128;
static_assert(std::is_same_v<std::remove_cvref_t<decltype(*std::declval<Backend>().bits().limbs())>, Wide>);
constexpr int kDigits = 113;
constexpr int kPlain = 16000;  // exponents beyond are left to Boost, as are infinity and what is no number

const Wide& mantissa(const Number& x) { return *x.backend().bits().limbs(); }
bool is_plain(const Number& x) {
  const int e = x.backend().exponent();
  return e < kPlain && e > -kPlain;
}
bool is_zero(const Number& x) { return x.backend().exponent() == Backend::exponent_zero; }
Wide below(int bit) { return (Wide(1) << bit) - 1; }
int length(Wide x) {
  const auto high = static_cast<std::uint64_t>(x >> 64);
  return high != 0 ? 128 - std::countl_zero(high) : 64 - std::countl_zero(static_cast<std::uint64_t>(x));
}

void set(Number& out, bool negative, Wide m, int exponent) {
  *out.backend().bits().limbs() = m;
  out.backend().exponent() = static_cast<Backend::exponent_type>(exponent);
  out.backend().sign() = negative;
}
/// m of 113 bits and what was cut off below it, half of its last bit being `half`: to the nearest, to the even of two.
void set_rounded(Number& out, bool negative, Wide m, Wide rest, Wide half, int exponent) {
  if (rest > half || (rest == half && (m & 1) != 0)) ++m;
  if (m >> kDigits != 0) m >>= 1, ++exponent;
  set(out, negative, m, exponent);
}

void multiply(Number& out, const Number& a, const Number& b) {
  const auto low = [](Wide x) { return static_cast<std::uint64_t>(x); };
  const auto high = [](Wide x) { return static_cast<std::uint64_t>(x >> 64); };
  const Wide x = mantissa(a), y = mantissa(b), first = Wide(low(x)) * low(y);
  const Wide middle = Wide(low(x)) * high(y) + Wide(high(x)) * low(y) + high(first);
  const Wide top = Wide(high(x)) * high(y) + high(middle), bottom = middle << 64 | low(first);  // 226 bits
  const int cut = (top >> 97) != 0 ? kDigits : kDigits - 1;
  set_rounded(out, a.backend().sign() != b.backend().sign(), top << (128 - cut) | bottom >> cut, bottom & below(cut), Wide(1) << (cut - 1),
              a.backend().exponent() + b.backend().exponent() + cut - (kDigits - 1));
}

/// `turned`: a - b.
void add(Number& out, const Number& a, const Number& b, bool turned) {
  constexpr int kGuard = 14, kTop = kDigits + kGuard;
  const bool swapped = a.backend().exponent() < b.backend().exponent();
  const Number &large = swapped ? b : a, &small = swapped ? a : b;
  const bool b_negative = b.backend().sign() != turned;
  const bool minus = swapped ? b_negative : a.backend().sign();
  const int apart = large.backend().exponent() - small.backend().exponent(), exponent = large.backend().exponent();
  if (apart > kDigits + 2) return set(out, minus, mantissa(large), exponent);
  const Wide x = mantissa(large) << kGuard, whole = mantissa(small) << kGuard;
  const Wide y = whole >> apart | Wide((whole & below(apart)) != 0);  // the last bit stands for all that are lost
  bool negative = minus;
  Wide sum = x + y;
  if (a.backend().sign() != b_negative) {
    if (x == y) return void(out = Number());
    if (y > x) negative = !negative;
    sum = x > y ? x - y : y - x;
  }
  const int bits = length(sum), cut = bits - kDigits;
  if (cut <= 0) return set(out, negative, sum << -cut, exponent + bits - kTop);
  set_rounded(out, negative, sum >> cut, sum & below(cut), Wide(1) << (cut - 1), exponent + bits - kTop);
}

}  // namespace

Quad::Quad() { QuadNumber::begin(*this, Number()); }
Quad::Quad(double x) {
  const bool plain = x != 0.0 && std::isfinite(x);
  QuadNumber::begin(*this, plain || x == 0.0 ? Number() : Number(x));
  if (!plain) return;
  int exponent = 0;
  const double m = std::frexp(std::abs(x), &exponent);
  set(QuadNumber::of(*this), x < 0.0, Wide(static_cast<std::uint64_t>(std::ldexp(m, 53))) << (kDigits - 53), exponent - 1);
}
Quad::Quad(const std::string& decimal) { QuadNumber::begin(*this, Number(decimal)); }
Quad::operator double() const { return static_cast<double>(of(*this)); }

Quad& Quad::operator+=(const Quad& b) {
  Number& x = QuadNumber::of(*this);
  const Number& y = of(b);
  if (is_zero(y)) return *this;
  if (is_plain(x) && is_plain(y))
    add(x, x, y, false);
  else if (is_zero(x))
    x = y;
  else
    x += y;
  return *this;
}
Quad& Quad::operator-=(const Quad& b) {
  Number& x = QuadNumber::of(*this);
  const Number& y = of(b);
  if (is_zero(y)) return *this;
  if (is_plain(x) && is_plain(y))
    add(x, x, y, true);
  else
    x -= y;
  return *this;
}
Quad& Quad::operator*=(const Quad& b) {
  Number& x = QuadNumber::of(*this);
  const Number& y = of(b);
  if (is_zero(x) && (is_plain(y) || is_zero(y))) return *this;
  if (is_plain(x) && is_plain(y) && std::abs(x.backend().exponent() + y.backend().exponent()) < kPlain)
    multiply(x, x, y);
  else if (is_plain(x) && is_zero(y))
    x = y;
  else
    x *= y;
  return *this;
}
Quad& Quad::operator/=(const Quad& b) {
  QuadNumber::of(*this) /= of(b);
  return *this;
}
Quad Quad::operator-() const {
  Quad out(*this);
  QuadNumber::of(out).backend().negate();
  return out;
}
Quad operator+(const Quad& a, const Quad& b) { return Quad(a) += b; }
Quad operator-(const Quad& a, const Quad& b) { return Quad(a) -= b; }
Quad operator*(const Quad& a, const Quad& b) { return Quad(a) *= b; }
Quad operator/(const Quad& a, const Quad& b) { return Quad(a) /= b; }

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
