#include "core/base/units.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <numbers>

#include "core/base/utf8.hpp"

namespace cardan {
namespace {

constexpr double kPi = std::numbers::pi;

struct Symbol {
  std::string_view name;
  double factor;
  std::array<int, 6> exponents;  // m kg s A K rad
  bool takes_prefix;
};
constexpr Symbol kSymbols[] = {
    {"m", 1.0, {1}, true},
    {"g", 1e-3, {0, 1}, true},
    {"t", 1e3, {0, 1}, false},
    {"s", 1.0, {0, 0, 1}, true},
    {"min", 60.0, {0, 0, 1}, false},
    {"h", 3600.0, {0, 0, 1}, false},
    {"day", 86400.0, {0, 0, 1}, false},
    {"A", 1.0, {0, 0, 0, 1}, true},
    {"K", 1.0, {0, 0, 0, 0, 1}, true},
    {"rad", 1.0, {0, 0, 0, 0, 0, 1}, true},
    {"deg", kPi / 180.0, {0, 0, 0, 0, 0, 1}, false},
    {"arcmin", kPi / 10800.0, {0, 0, 0, 0, 0, 1}, false},
    {"arcsec", kPi / 648000.0, {0, 0, 0, 0, 0, 1}, false},
    {"rev", 2.0 * kPi, {0, 0, 0, 0, 0, 1}, false},
    {"rpm", 2.0 * kPi / 60.0, {0, 0, -1, 0, 0, 1}, false},
    {"Hz", 1.0, {0, 0, -1}, true},
    {"N", 1.0, {1, 1, -2}, true},
    {"J", 1.0, {2, 1, -2}, true},
    {"W", 1.0, {2, 1, -3}, true},
    {"Pa", 1.0, {-1, 1, -2}, true},
    {"V", 1.0, {2, 1, -3, -1}, true},
    {"%", 1e-2, {}, false},
    {"1", 1.0, {}, false},
};

struct Prefix {
  char name;
  double factor;
};
constexpr Prefix kPrefixes[] = {{'n', 1e-9}, {'u', 1e-6}, {'m', 1e-3}, {'c', 1e-2}, {'k', 1e3}, {'M', 1e6}, {'G', 1e9}};

struct NamedDimension {
  std::string_view name, unit;
  std::array<int, 6> exponents;
};
constexpr NamedDimension kNamed[] = {
    {"number without unit", "", {}},
    {"length", "m", {1}},
    {"area", "m^2", {2}},
    {"mass", "kg", {0, 1}},
    {"time", "s", {0, 0, 1}},
    {"temperature", "K", {0, 0, 0, 0, 1}},
    {"angle", "rad", {0, 0, 0, 0, 0, 1}},
    {"frequency", "Hz", {0, 0, -1}},
    {"angular velocity", "rad/s", {0, 0, -1, 0, 0, 1}},
    {"angular acceleration", "rad/s^2", {0, 0, -2, 0, 0, 1}},
    {"velocity", "m/s", {1, 0, -1}},
    {"acceleration", "m/s^2", {1, 0, -2}},
    {"screw pitch", "m/rad", {1, 0, 0, 0, 0, -1}},
    {"moment of inertia", "kg m^2", {2, 1}},
    {"first moment of mass", "kg m", {1, 1}},
    {"force", "N", {1, 1, -2}},
    {"torque or energy", "N m", {2, 1, -2}},
    {"power", "W", {2, 1, -3}},
    {"stiffness", "N/m", {0, 1, -2}},
    {"rotational stiffness", "N m/rad", {2, 1, -2, 0, 0, -1}},
    {"damping", "N s/m", {0, 1, -1}},
    {"rotational damping", "N m s/rad", {2, 1, -1, 0, 0, -1}},
    {"angular momentum", "N m s", {2, 1, -1}},
    {"momentum", "N s", {1, 1, -1}},
    {"pressure or elastic modulus", "Pa", {-1, 1, -2}},
    {"density", "kg/m^3", {-3, 1}},
    {"mass per length", "kg/m", {-1, 1}},
    {"mass per area", "kg/m^2", {-2, 1}},
    {"fourth moment of area", "m^4", {4}},
    {"bending stiffness", "N m^2", {3, 1, -2}},
    {"gravitational parameter", "m^3/s^2", {3, 0, -2}},
};
constexpr std::string_view kBase[] = {"m", "kg", "s", "A", "K", "rad"};

std::optional<Unit> symbol(std::string_view name) {
  for (const Symbol& s : kSymbols)
    if (s.name == name) return Unit{s.factor, {s.exponents}};
  for (const Prefix& p : kPrefixes)
    for (const Symbol& s : kSymbols)
      if (s.takes_prefix && name.size() == s.name.size() + 1 && name[0] == p.name && name.substr(1) == s.name)
        return Unit{s.name == "g" && p.name == 'k' ? 1.0 : p.factor * s.factor, {s.exponents}};
  return {};
}

Unit multiply(const Unit& a, const Unit& b, int power) {
  Unit c{a.factor * std::pow(b.factor, power), a.dimension};
  for (std::size_t i = 0; i < 6; ++i) c.dimension.exponents[i] += power * b.dimension.exponents[i];
  return c;
}

// unit = factor { [ "*" | " " ] factor } { "/" factor };  factor = ( name | "(" unit ")" ) [ "^" integer ]
class UnitParser {
 public:
  explicit UnitParser(std::string_view text) : rest_(text) {}
  std::optional<Unit> whole() {
    auto unit = product(0);
    skip_spaces();
    return rest_.empty() ? unit : std::nullopt;
  }

 private:
  std::optional<Unit> product(int depth) {
    auto unit = factor(depth);
    bool divided = false;
    while (unit) {
      skip_spaces();
      if (rest_.empty() || rest_[0] == ')') return unit;
      const bool slash = take('/');
      if (!slash) {
        if (divided) return {};
        take('*');
      }
      divided = divided || slash;
      const auto next = factor(depth);
      if (!next) return {};
      unit = multiply(*unit, *next, slash ? -1 : 1);
    }
    return unit;
  }
  std::optional<Unit> factor(int depth) {
    skip_spaces();
    std::optional<Unit> unit;
    if (take('(')) {
      if (depth > 8) return {};
      unit = product(depth + 1);
      if (!unit || !take(')')) return {};
    } else {
      const std::size_t end = std::min(rest_.find_first_of(" */^()"), rest_.size());
      unit = symbol(rest_.substr(0, end));
      rest_.remove_prefix(end);
    }
    if (unit && take('^')) {
      int power = 0;
      const auto [stop, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), power);
      if (error != std::errc() || power < -9 || power > 9) return {};
      rest_.remove_prefix(static_cast<std::size_t>(stop - rest_.data()));
      unit = multiply(Unit{}, *unit, power);
    }
    return unit;
  }
  void skip_spaces() {
    while (take(' ')) {
    }
  }
  bool take(char c) {
    if (rest_.empty() || rest_[0] != c) return false;
    rest_.remove_prefix(1);
    return true;
  }
  std::string_view rest_;
};

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }

// The number at the start of the text, and what follows it.
struct Leading {
  double value;
  std::string_view rest;
};
std::optional<Leading> leading_number(std::string_view text) {
  if (!text.empty() && text[0] == '+') {
    text.remove_prefix(1);
    if (!text.empty() && text[0] == '-') return {};
  }
  std::string_view digits = text;
  if (!digits.empty() && digits[0] == '-') digits.remove_prefix(1);
  if (digits.empty() || !(is_digit(digits[0]) || digits[0] == '.')) return {};  // nan, inf
  if (digits.size() > 1 && digits[0] == '0' && is_digit(digits[1])) return {};  // 010
  double value = 0.0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc()) return {};
  return Leading{value, text.substr(static_cast<std::size_t>(stop - text.data()))};
}

std::string number_hint(std::string_view text) {
  const std::string_view digits = text.substr(!text.empty() && (text[0] == '-' || text[0] == '+') ? 1 : 0);
  if (digits.size() > 1 && digits[0] == '0' && is_digit(digits[1]))
    return "a leading zero means octal to some readers; write the number without it";
  if (digits.size() > 1 && digits[0] == '0' &&
      (digits[1] == 'x' || digits[1] == 'X' || digits[1] == 'o' || digits[1] == 'b'))
    return "only decimal numbers are read";
  if (digits.empty() || !is_digit(digits[0])) return {};
  if (text.find('_') != std::string_view::npos) return "write the digits without `_`";
  if (text.find(',') != std::string_view::npos) return "the decimal sign is a point, and digits are not grouped";
  double value = 0.0;
  if (std::from_chars(text.data(), text.data() + text.size(), value).ec == std::errc::result_out_of_range)
    return "magnitudes from 1e-307 to 1e308 can be represented";
  return {};
}

}  // namespace

std::optional<Unit> parse_unit(std::string_view text) { return UnitParser(text).whole(); }

std::string describe(const Dimension& dimension) {
  for (const NamedDimension& n : kNamed)
    if (n.exponents == dimension.exponents)
      return n.unit.empty() ? std::string(n.name) : fmt::format("{} [{}]", n.name, n.unit);
  std::string unit;
  for (std::size_t i = 0; i < 6; ++i) {
    const int e = dimension.exponents[i];
    if (e != 0) unit += fmt::format("{}{}{}", unit.empty() ? "" : " ", kBase[i], e == 1 ? "" : fmt::format("^{}", e));
  }
  return fmt::format("[{}]", unit);
}

std::optional<double> parse_number(std::string_view text) {
  const auto number = leading_number(text);
  return number && number->rest.empty() ? std::optional(number->value) : std::nullopt;
}

std::variant<double, QuantityFault> parse_quantity(std::string_view text, std::string_view unit) {
  const Unit wanted = parse_unit(unit).value_or(Unit{});
  const std::string expected = describe(wanted.dimension);
  text = trimmed(text);
  const auto number = leading_number(text);
  if (!number) return QuantityFault{Code::bad_number, expected, in_quotes(text), number_hint(text)};
  if (number->rest.empty()) return number->value;

  const std::string_view unit_text = trimmed(number->rest);
  const auto got = parse_unit(unit_text);
  if (!got && number->rest[0] != ' ')
    return QuantityFault{Code::bad_number, expected, in_quotes(text), number_hint(text)};
  if (!got) {
    const bool slash = unit_text.find('/') != std::string_view::npos;
    return QuantityFault{Code::wrong_unit, expected,
                         fmt::format("{} (no such unit: {})", in_quotes(text), in_quotes(unit_text)),
                         slash ? "after a `/` a product needs parentheses: N m/(rad/s)" : ""};
  }
  if (got->dimension != wanted.dimension) {
    std::string hint;
    Dimension without_angle = got->dimension;
    without_angle.exponents[5] = wanted.dimension.exponents[5];
    if (without_angle == wanted.dimension) hint = "an angle counts as a unit here: rad, deg or rev";
    return QuantityFault{Code::wrong_unit, expected, fmt::format("{}: {}", in_quotes(text), describe(got->dimension)),
                         hint};
  }
  const double value = number->value * got->factor;
  if (!std::isfinite(value)) return QuantityFault{Code::bad_number, expected, in_quotes(text), "too large"};
  return value;
}

std::string in_quotes(std::string_view text) {
  constexpr std::size_t kLongest = 60;
  std::size_t shown = std::min(text.size(), kLongest);
  while (shown < text.size() && (static_cast<unsigned char>(text[shown]) & 0xC0) == 0x80)
    --shown;  // whole UTF-8 characters
  return fmt::format("\"{}{}\"", printable(text.substr(0, shown)), shown < text.size() ? "..." : "");
}

}  // namespace cardan
