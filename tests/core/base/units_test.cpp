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

TEST(Units, HavePowersThatCanBeCounted) {
  EXPECT_TRUE(parse_unit("(m^9)^9"));
  for (const char* text : {"((m^9)^9)^9", "(((((((((m^9)^9)^9)^9)^9)^9)^9)^9)^9)^9", "(m^9)^9 (m^9)^9"})
    EXPECT_FALSE(parse_unit(text)) << text;
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
  EXPECT_EQ(value("2 ohm", "V/A"), 2.0);
  EXPECT_EQ(value("5 mH", "V s/A"), 5e-3);
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

TEST(Units, AreReadAsTheyArePrinted) {
  EXPECT_EQ(value("5 N·m", "N m"), 5.0);
  EXPECT_EQ(value("5 N⋅m/rad", "N m/rad"), 5.0);
  EXPECT_EQ(value("5 N.m.s/rad", "N m s/rad"), 5.0);
  EXPECT_DOUBLE_EQ(value("90°", "rad"), kPi / 2);
  EXPECT_DOUBLE_EQ(value("90 °/s", "rad/s"), kPi / 2);
  EXPECT_EQ(value("3 kg·m²", "kg m^2"), 3.0);
  EXPECT_EQ(value("3 m·s⁻²", "m/s^2"), 3.0);
  EXPECT_EQ(value("7 µm", "m"), value("7 um", "m"));
  EXPECT_EQ(value("3 kΩ", "V/A"), 3000.0);
  EXPECT_EQ(value("7 μm", "m"), value("7 um", "m")) << "the Greek letter as well";
  EXPECT_EQ(value("12\u00A0kg", "kg"), 12.0) << "a space that does not break";
  EXPECT_EQ(value("\u221212 kg", "kg"), -12.0) << "the minus sign of print";
}

TEST(Units, ThatAreMistypedAreAnsweredByWhatIsMeant) {
  const auto hint = [](const char* text, const char* unit) { return fault(text, unit).hint; };
  EXPECT_EQ(hint("5 Nm", "N m"), "did you mean \"N m\"?");
  EXPECT_EQ(hint("5Nm", "N m"), "did you mean \"N m\"?") << "without a space";
  EXPECT_EQ(hint("5000 Nm/rad", "N m/rad"), "did you mean \"N m/rad\"?") << "not about parentheses";
  EXPECT_EQ(hint("75 Nms/rad", "N m s/rad"), "did you mean \"N m s/rad\"?") << "by the dimension that is wanted, not newton milliseconds";
  EXPECT_EQ(hint("75 Nms", "N s"), "did you mean \"N ms\"?") << "and the other way round";
  EXPECT_EQ(hint("30 degrees", "rad"), "did you mean \"deg\"?");
  EXPECT_EQ(hint("30 degs/sec", "rad/s"), "did you mean \"deg/s\"?");
  EXPECT_EQ(hint("12 Kg", "kg"), "did you mean \"kg\"?");
  EXPECT_EQ(hint("12 mdeg", "rad"), "1 mdeg is 0.001 deg") << "not metre degrees";
  EXPECT_EQ(hint("12 hPa", "Pa"), "1 hPa is 100 Pa");
  EXPECT_EQ(hint("12 KM", "m"), "did you mean \"km\"?");
  EXPECT_EQ(hint("12 RPM", "rad/s"), "did you mean \"rpm\"?");
  EXPECT_EQ(hint("8 d", "s"), "did you mean \"day\"?");
  EXPECT_EQ(hint("12 kgm2", "kg m^2"), "did you mean \"kg m^2\"?");
  EXPECT_EQ(hint("9.81 m/s2", "m/s^2"), "did you mean \"m/s^2\"?");
  EXPECT_EQ(hint("9.81 m s-2", "m/s^2"), "did you mean \"m s^-2\"?");
  EXPECT_EQ(hint("9.81 m/s**2", "m/s^2"), "did you mean \"m/s^2\"?");
  EXPECT_EQ(hint("3 metres per second", "m/s"), "did you mean \"m/s\"?");
  EXPECT_EQ(hint("3 N m/rad s", "N m s/rad"), "after a `/` a product needs parentheses: N m/(rad s)");
  EXPECT_EQ(hint("12 lb", "kg"), "1 lb is 0.45359237 kg");
  EXPECT_EQ(hint("12lbs", "kg"), "1 lbs is 0.45359237 kg");
  EXPECT_EQ(hint("12 lbf ft", "N m"), "1 lbf is 4.4482216152605 N, 1 ft is 0.3048 m");
  EXPECT_EQ(hint("12 quatloos", "kg"), "");
  EXPECT_EQ(fault("5000 Nm/rad", "N m/rad").code, Code::wrong_unit);
  EXPECT_EQ(fault("5Nm", "N m").code, Code::wrong_unit);
  EXPECT_EQ(fault("1,5 m", "m").code, Code::bad_number) << "a number gone wrong, not a unit";
  std::string endless = "1 ";
  for (int i = 0; i < 100'000; ++i) endless += "Nm ";
  EXPECT_EQ(fault(endless, "N m").hint, "");
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
  for (const char* text : {"1 kilo", "1 kkg", "1 mdeg", "1 m^", "1 m^x", "1 m^99", "1 (m", "1 m)", "1 m//s", "1 /s", "1 N m/rad s", "1 m *",
                           "1 m -", "1 ^2", "1 m^-2147483648", "1 ((((((((((m))))))))))"})
    EXPECT_EQ(fault(text, "m").code, Code::wrong_unit) << text;
}

TEST(Numbers, AreDecimalFiniteAndWhole) {
  EXPECT_EQ(parse_number("0"), 0.0);
  EXPECT_EQ(parse_number("-0.5"), -0.5);
  EXPECT_EQ(parse_number("1e3"), 1000.0);
  EXPECT_EQ(parse_number("5."), 5.0);
  for (const char* text :
       {"",     " ",    "-",        "+",   "+-1",   "010", "-010",  "0x10",   "0b1",   "0o7", "1_000", "nan", "inf",  "-inf",
        ".nan", ".inf", "infinity", "1,5", "1.2.3", "1e",  "1e999", "-1e999", "12 kg", "1d3", "one",   "~",   "true", "1 2"}) {
    EXPECT_FALSE(parse_number(text)) << text;
  }
  for (const char* text : {"", "010", "00", "0x10", "1_000", "nan", "inf", ".inf", "1,5", "1.2.3", "1e999", "010 deg", "true"})
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
