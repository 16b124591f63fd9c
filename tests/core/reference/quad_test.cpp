// Sums and products of 113 bits against numbers of so many that nothing is rounded but at the end.
#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <limits>
#include <random>

#include "core/reference/quad.hpp"

namespace cardan::test {
namespace {

using reference::Quad;
using Rounded = boost::multiprecision::cpp_bin_float_quad;
using Wide = boost::multiprecision::number<boost::multiprecision::cpp_bin_float<1000, boost::multiprecision::digit_base_2>>;

/// All 113 bits, as three doubles; magnitudes are those of a double.
Wide exact(Quad x) {
  Wide sum = 0;
  for (int i = 0; i < 3; ++i) {
    const auto part = static_cast<double>(x);
    sum += part, x -= Quad(part);
  }
  return sum;
}

// Magnitudes apart by up to 240 bits, bits in all places or few, operands that nearly cancel, halves of the last bit, zeros.
TEST(Quad, SumsAndProductsAreRoundedToTheNearest) {
  std::mt19937_64 random(7);
  const auto below = [&](unsigned n) { return static_cast<int>(random() % n); };
  const auto some = [&](int exponent) { return std::ldexp(std::uniform_real_distribution<double>(-1, 1)(random), exponent); };
  const auto number = [&] {
    const int e = below(240) - 120;
    switch (below(5)) {
      case 0:
        return Quad(0);
      case 1:
        return Quad(some(e));
      case 2:  // a power of two, and its last bit
        return Quad(std::ldexp(1.0, e)) + Quad(std::ldexp(below(2) == 0 ? 1.0 : -1.0, e - 112));
      default:
        return Quad(some(e)) + Quad(some(e - 53)) + Quad(some(e - 106));
    }
  };
  for (int i = 0; i < 100'000; ++i) {
    const Quad a = number(), b = below(3) == 0 ? Quad(-a) * (Quad(1) + Quad(some(-below(130)))) : number();
    const Wide x = exact(a), y = exact(b);
    ASSERT_EQ(exact(a + b), Wide(Rounded(Wide(x + y)))) << x << " + " << y;
    ASSERT_EQ(exact(a - b), Wide(Rounded(Wide(x - y)))) << x << " - " << y;
    ASSERT_EQ(exact(a * b), Wide(Rounded(Wide(x * y)))) << x << " * " << y;
  }
}

TEST(Quad, NumbersThatAreNoneStayNone) {
  const double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(isinf(Quad(inf) + Quad(1)) && isinf(Quad(0) + Quad(inf)) && isinf(Quad(-2) * Quad(inf)));
  EXPECT_TRUE(isnan(Quad(inf) - Quad(inf)) && isnan(Quad(inf) * Quad(0)) && isnan(Quad(0) * Quad(nan)) && isnan(Quad(nan) + Quad(0)));
  EXPECT_TRUE(isinf(std::numeric_limits<Quad>::max() * Quad(2)) &&
              isinf(std::numeric_limits<Quad>::max() + std::numeric_limits<Quad>::max()));
  EXPECT_TRUE(Quad(1) - Quad(1) == Quad(0) && Quad(0) * Quad(-3) == Quad() && Quad(5e-324) + Quad(5e-324) == Quad(1e-323));
  EXPECT_EQ(static_cast<double>(Quad(-0.1)), -0.1);
  EXPECT_EQ(static_cast<double>(Quad(5e-324) * Quad(2)), 1e-323);
}

}  // namespace
}  // namespace cardan::test
