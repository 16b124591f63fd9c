#include "core/base/units.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace cardan {
namespace {

constexpr double kPi = std::numbers::pi;

double value(std::string_view text, std::string_view unit) {
  const auto result = parse_quantity(text, unit);
  const double* number = std::get_if<double>(&result);
  return number ? *number : std::nan("");
}
QuantityFault fault(std::string_view text, std::string_view unit) {
  const auto result = parse_quantity(text, unit);
  const auto* f = std::get_if<QuantityFault>(&result);
  return f ? *f : QuantityFault{Code::yaml_syntax, "no fault", "", ""};
}

TEST(Units, ConvertToSi) {
  EXPECT_EQ(value("12 kg", "kg"), 12.0);
  EXPECT_EQ(value("12 g", "kg"), 0.012);
  EXPECT_EQ(value("1.6 t", "kg"), 1600.0);
  EXPECT_EQ(value("12 m", "m"), 12.0);
  EXPECT_EQ(value("-3 mm", "m"), -0.003);
  EXPECT_EQ(value("2 km", "m"), 2000.0);
  EXPECT_DOUBLE_EQ(value("30 deg", "rad"), kPi / 6);
  EXPECT_DOUBLE_EQ(value("180 arcmin", "rad"), kPi / 60);
  EXPECT_DOUBLE_EQ(value("3600 arcsec", "rad"), kPi / 180);
  EXPECT_DOUBLE_EQ(value("0.5 rev", "rad"), kPi);
  EXPECT_DOUBLE_EQ(value("1500 rpm", "rad/s"), 50 * kPi);
  EXPECT_DOUBLE_EQ(value("0.5 deg/s", "rad/s"), kPi / 360);
  EXPECT_DOUBLE_EQ(value("2 mm/rev", "m/rad"), 1e-3 / kPi);
  EXPECT_EQ(value("120 kg m^2", "kg m^2"), 120.0);
  EXPECT_EQ(value("5000 N m/rad", "N m/rad"), 5000.0);
  EXPECT_EQ(value("75 N m s/rad", "N m s/rad"), 75.0);
  EXPECT_DOUBLE_EQ(value("1 N m/deg", "N m/rad"), 180 / kPi);
  EXPECT_EQ(value("70 GPa", "Pa"), 70e9);
  EXPECT_EQ(value("398600 km^3/s^2", "m^3/s^2"), 398600e9);
  EXPECT_EQ(value("0.5 %", "1"), 0.005);
  EXPECT_EQ(value("2 h", "s"), 7200.0);
  EXPECT_EQ(value("10 Hz", "1/s"), 10.0);
}

TEST(Units, AreProductsQuotientsAndPowers) {
  EXPECT_EQ(value("3 kg*m^2", "kg m^2"), 3.0);
  EXPECT_EQ(value("3 m kg m", "kg m^2"), 3.0);
  EXPECT_EQ(value("3 J", "N m"), 3.0);
  EXPECT_EQ(value("3 m s^-2", "m/s^2"), 3.0);
  EXPECT_EQ(value("3 m/s/s", "m/s^2"), 3.0);
  EXPECT_EQ(value("3 N m/(rad/s)", "N m s/rad"), 3.0);
  EXPECT_EQ(value("3 (N m s)/rad", "N m s/rad"), 3.0);
  EXPECT_EQ(value("4 cm^2", "m^2"), 4 * 1e-2 * 1e-2);
  EXPECT_EQ(value("3m", "m"), 3.0);
}

TEST(Units, OfABareNumberAreSi) {
  EXPECT_EQ(value("12", "kg"), 12.0);
  EXPECT_EQ(value("  -1.5e-3  ", "m"), -1.5e-3);
  EXPECT_EQ(value("+.5", "rad"), 0.5);
}

TEST(Units, ThatDoNotFitAreRefusedWithBothDimensions) {
  const QuantityFault f = fault("12 kg", "m");
  EXPECT_EQ(f.code, Code::wrong_unit);
  EXPECT_EQ(f.expected, "length [m]");
  EXPECT_EQ(f.got, "\"12 kg\": mass [kg]");
}

TEST(Units, KeepTheAngle) {
  EXPECT_EQ(fault("2 Hz", "rad/s").code, Code::wrong_unit);
  EXPECT_EQ(fault("2 N m", "N m/rad").code, Code::wrong_unit);
  EXPECT_EQ(fault("2 m", "m/rad").code, Code::wrong_unit);
}

TEST(Units, WithoutMeaningAreRefused) {
  for (const char* text : {"1 kilo", "1 kkg", "1 mdeg", "1 m^", "1 m^x", "1 m^99", "1 (m", "1 m)", "1 m//s", "1 /s",
                           "1 N m/rad s", "1 m *", "1 m -", "1 ^2", "1 m^-2147483648", "1 ((((((((((m))))))))))"})
    EXPECT_EQ(fault(text, "m").code, Code::wrong_unit) << text;
}

TEST(Numbers, AreDecimalFiniteAndWhole) {
  EXPECT_EQ(parse_number("0"), 0.0);
  EXPECT_EQ(parse_number("-0.5"), -0.5);
  EXPECT_EQ(parse_number("1e3"), 1000.0);
  EXPECT_EQ(parse_number("5."), 5.0);
  for (const char* text : {"",      " ",      "-",     "+",    "+-1",  "010",  "-010",     "0x10", "0b1",   "0o7",
                           "1_000", "nan",    "inf",   "-inf", ".nan", ".inf", "infinity", "1,5",  "1.2.3", "1e",
                           "1e999", "-1e999", "12 kg", "1d3",  "one",  "~",    "true",     "1 2"}) {
    EXPECT_FALSE(parse_number(text)) << text;
  }
  for (const char* text :
       {"", "010", "00", "0x10", "1_000", "nan", "inf", ".inf", "1,5", "1.2.3", "1e999", "010 deg", "true"})
    EXPECT_EQ(fault(text, "rad").code, Code::bad_number) << text;
}

TEST(Numbers, ThatOverflowInTheirUnitAreRefused) { EXPECT_EQ(fault("1e308 GPa", "Pa").code, Code::bad_number); }

TEST(InQuotes, IsOneLineOfText) {
  EXPECT_EQ(in_quotes("a\nb\x01"), "\"a?b?\"");
  EXPECT_EQ(in_quotes("\xff"), "\"?\"");
  EXPECT_EQ(in_quotes("Raumflügel"), "\"Raumflügel\"");
  EXPECT_EQ(in_quotes(std::string(59, 'x') + "ü" + "yyy"), "\"" + std::string(59, 'x') + "...\"");
}

}  // namespace
}  // namespace cardan
