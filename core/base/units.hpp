#pragma once
// Numbers with units, as users write them: "12 kg", "30 deg", "5000 N m/rad". Everything inside Cardan is SI; this is
// the door. The radian counts as a dimension of its own here, so that 1/s is not an angular rate and N m/rad is not N
// m.
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "core/base/diagnostic.hpp"

namespace cardan {

/// Exponents of m, kg, s, A, K, rad.
struct Dimension {
  std::array<int, 6> exponents{};
  bool operator==(const Dimension&) const = default;
};

/// value [SI] = factor * value [this unit]
struct Unit {
  double factor = 1.0;
  Dimension dimension;
};

/// Products by a space, `*`, `.` or a raised dot, quotients by `/`, powers by `^` or raised digits, groups by parentheses, "1"
/// for no unit: "N m/rad", "kg m^2", "N m/(rad/s)". After a `/` a further product needs parentheses. Empty if not a unit.
std::optional<Unit> parse_unit(std::string_view text);

/// What may be meant by a text that is no unit: `did you mean "N m"?` for Nm, `1 lb is 0.45359237 kg`; empty if unknown. Where
/// several units may be meant, one of the dimension `wanted`.
std::string unit_hint(std::string_view text, const Dimension* wanted = nullptr);

/// "length [m]", "moment of inertia [kg m^2]"; only the bracket where the dimension has no name.
std::string describe(const Dimension&);

/// A finite decimal number and nothing else: no `010`, `0x10`, `1_000`, `nan`, `inf`.
std::optional<double> parse_number(std::string_view text);
/// A whole number from 0 to 2^64 - 1 in decimal digits, and nothing else.
std::optional<std::uint64_t> parse_seed(std::string_view text);

/// What is wrong with a quantity, in the words of a Diagnostic (codes C0107 and C0108).
struct QuantityFault {
  Code code;
  std::string expected, got, hint;
};
/// "12 kg" -> 12; a bare number is taken as SI. `unit` is the SI unit that is expected, in the notation of parse_unit.
std::variant<double, QuantityFault> parse_quantity(std::string_view text, std::string_view unit);

/// Unit of the force that is dual to a velocity in `rate`, such that their product is in W: "rad/s" gives "N m".
std::string force_unit(std::string_view rate);

/// The text between quotation marks, cut at 60 characters, control characters as '?': for `got`.
std::string in_quotes(std::string_view text);

}  // namespace cardan
