#include "core/reference/quad.hpp"

namespace cardan::reference {

Quad::Quad(double x) : x_(x) {}
Quad::Quad(const std::string& decimal) : x_(decimal) {}
Quad::operator double() const { return static_cast<double>(x_); }

Quad& Quad::operator+=(const Quad& b) {
  x_ += b.x_;
  return *this;
}
Quad& Quad::operator-=(const Quad& b) {
  x_ -= b.x_;
  return *this;
}
Quad& Quad::operator*=(const Quad& b) {
  x_ *= b.x_;
  return *this;
}
Quad& Quad::operator/=(const Quad& b) {
  x_ /= b.x_;
  return *this;
}
Quad Quad::operator-() const { return Quad(Number(-x_)); }
Quad operator+(const Quad& a, const Quad& b) { return Quad(Quad::Number(a.x_ + b.x_)); }
Quad operator-(const Quad& a, const Quad& b) { return Quad(Quad::Number(a.x_ - b.x_)); }
Quad operator*(const Quad& a, const Quad& b) { return Quad(Quad::Number(a.x_ * b.x_)); }
Quad operator/(const Quad& a, const Quad& b) { return Quad(Quad::Number(a.x_ / b.x_)); }

bool operator==(const Quad& a, const Quad& b) { return a.x_ == b.x_; }
bool operator<(const Quad& a, const Quad& b) { return a.x_ < b.x_; }
bool operator>(const Quad& a, const Quad& b) { return a.x_ > b.x_; }
bool operator<=(const Quad& a, const Quad& b) { return a.x_ <= b.x_; }
bool operator>=(const Quad& a, const Quad& b) { return a.x_ >= b.x_; }

Quad abs(const Quad& a) { return Quad(Quad::Number(abs(a.x_))); }
Quad sqrt(const Quad& a) { return Quad(Quad::Number(sqrt(a.x_))); }
Quad sin(const Quad& a) { return Quad(Quad::Number(sin(a.x_))); }
Quad cos(const Quad& a) { return Quad(Quad::Number(cos(a.x_))); }
Quad exp(const Quad& a) { return Quad(Quad::Number(exp(a.x_))); }
Quad tanh(const Quad& a) { return Quad(Quad::Number(tanh(a.x_))); }
Quad pow(const Quad& base, const Quad& exponent) { return Quad(Quad::Number(pow(base.x_, exponent.x_))); }
bool isfinite(const Quad& a) { return boost::multiprecision::isfinite(a.x_); }
bool isinf(const Quad& a) { return boost::multiprecision::isinf(a.x_); }
bool isnan(const Quad& a) { return boost::multiprecision::isnan(a.x_); }

}  // namespace cardan::reference
