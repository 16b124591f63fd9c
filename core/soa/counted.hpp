#pragma once
// A scalar that counts what is done with it: the flops of a sweep are measured on the kernels themselves.
#include <cmath>

namespace cardan::soa {

/// double with a count of additions, multiplications, divisions and roots (one each; sine and cosine apart).
struct Counted {
  double x = 0.0;
  static inline thread_local long flops = 0, functions = 0;

  Counted() = default;
  Counted(double value) : x(value) {}  // NOLINT: a number is a number
  Counted(int value) : x(value) {}     // NOLINT
  explicit operator double() const { return x; }
  Counted operator-() const { return {-x}; }  // a sign is free
};
inline Counted counted(double x) {
  ++Counted::flops;
  return {x};
}
inline Counted operator+(Counted a, Counted b) { return counted(a.x + b.x); }
inline Counted operator-(Counted a, Counted b) { return counted(a.x - b.x); }
inline Counted operator*(Counted a, Counted b) { return counted(a.x * b.x); }
inline Counted operator/(Counted a, Counted b) { return counted(a.x / b.x); }
inline bool operator<(Counted a, Counted b) { return a.x < b.x; }
inline bool operator>(Counted a, Counted b) { return a.x > b.x; }
inline Counted sqrt(Counted a) { return counted(std::sqrt(a.x)); }
inline Counted sin(Counted a) {
  ++Counted::functions;
  return {std::sin(a.x)};
}
inline Counted cos(Counted a) {
  ++Counted::functions;
  return {std::cos(a.x)};
}

}  // namespace cardan::soa
