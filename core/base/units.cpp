#include "core/base/units.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <vector>

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
    {"yr", 365.25 * 86400.0, {0, 0, 1}, false},
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
    {"ohm", 1.0, {2, 1, -3, -2}, true},
    {"H", 1.0, {2, 1, -2, -2}, true},
    {"T", 1.0, {0, 1, -2, -1}, true},
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
    {"current", "A", {0, 0, 0, 1}},
    {"voltage", "V", {2, 1, -3, -1}},
    {"resistance", "ohm", {2, 1, -3, -2}},
    {"inductance", "H", {2, 1, -2, -2}},
    {"magnetic field", "T", {0, 1, -2, -1}},
    {"magnetic moment", "A m^2", {2, 0, 0, 1}},
    {"strength of a dipole", "T m^3", {3, 1, -2, -1}},
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

/// Empty: a power beyond all use.
std::optional<Unit> multiply(const Unit& a, const Unit& b, int power) {
  constexpr int kMost = 99;
  Unit c{a.factor * std::pow(b.factor, power), a.dimension};
  for (std::size_t i = 0; i < 6; ++i)
    if (std::abs(c.dimension.exponents[i] += power * b.dimension.exponents[i]) > kMost) return {};
  return c;
}

// Signs of print in the notation of the grammar below.
struct Sign {
  std::string_view printed, ascii;
};
constexpr Sign kSigns[] = {{"\u00B7", "*"},         {"\u22C5", "*"},  {"\u2219", "*"},         {"\u00D7", "*"},
                           {"\u00A0", " "},         {"\u202F", " "},  {"\u00B0", "deg"},       {"\u2032", "arcmin"},
                           {"\u2033", "arcsec"},    {"\u00B5", "u"},  {"\u03A9", "ohm"},       {"\u2126", "ohm"},
                           {"\u03BC", "u"},         {"\u2212", "-"},  {"\u207B\u00B9", "^-1"}, {"\u207B\u00B2", "^-2"},
                           {"\u207B\u00B3", "^-3"}, {"\u00B2", "^2"}, {"\u00B3", "^3"},        {"\u2074", "^4"}};

std::string ascii_notation(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const auto sign = std::ranges::find_if(kSigns, [&](const Sign& s) { return text.starts_with(s.printed); });
    out += sign == std::end(kSigns) ? text.substr(0, 1) : sign->ascii;
    text.remove_prefix(sign == std::end(kSigns) ? 1 : sign->printed.size());
  }
  return out;
}

constexpr std::string_view kPunctuation = " */^().";

// unit = factor { [ "*" | "." | " " ] factor } { "/" factor };  factor = ( name | "(" unit ")" ) [ "^" integer ]
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
        if (!take('*')) take('.');
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
      const std::size_t end = std::min(rest_.find_first_of(kPunctuation), rest_.size());
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

// Words that are no symbols here: what they mean, or, with `value`, how much one of them is.
struct Word {
  std::string_view name, unit, value;
};
constexpr Word kWords[] = {{"metre", "m", ""},
                           {"meter", "m", ""},
                           {"gram", "g", ""},
                           {"kilogram", "kg", ""},
                           {"kilo", "kg", ""},
                           {"tonne", "t", ""},
                           {"second", "s", ""},
                           {"sec", "s", ""},
                           {"minute", "min", ""},
                           {"hour", "h", ""},
                           {"hr", "h", ""},
                           {"d", "day", ""},
                           {"ampere", "A", ""},
                           {"amp", "A", ""},
                           {"kelvin", "K", ""},
                           {"radian", "rad", ""},
                           {"degree", "deg", ""},
                           {"arcminute", "arcmin", ""},
                           {"arcsecond", "arcsec", ""},
                           {"revolution", "rev", ""},
                           {"turn", "rev", ""},
                           {"hertz", "Hz", ""},
                           {"newton", "N", ""},
                           {"joule", "J", ""},
                           {"watt", "W", ""},
                           {"pascal", "Pa", ""},
                           {"volt", "V", ""},
                           {"henry", "H", ""},
                           {"percent", "%", ""},
                           {"kph", "km/h", ""},
                           {"kmh", "km/h", ""},
                           {"lb", "kg", "0.45359237"},
                           {"lbm", "kg", "0.45359237"},
                           {"pound", "kg", "0.45359237"},
                           {"oz", "kg", "0.028349523125"},
                           {"slug", "kg", "14.593903"},
                           {"ft", "m", "0.3048"},
                           {"foot", "m", "0.3048"},
                           {"feet", "m", "0.3048"},
                           {"in", "m", "0.0254"},
                           {"inch", "m", "0.0254"},
                           {"inches", "m", "0.0254"},
                           {"yd", "m", "0.9144"},
                           {"mile", "m", "1609.344"},
                           {"nmi", "m", "1852"},
                           {"au", "m", "149597870700"},
                           {"lbf", "N", "4.4482216152605"},
                           {"kgf", "N", "9.80665"},
                           {"psi", "Pa", "6894.757293168"},
                           {"bar", "Pa", "1e5"},
                           {"atm", "Pa", "101325"},
                           {"week", "s", "604800"},
                           {"year", "s", "31557600"},
                           {"gon", "deg", "0.9"},
                           {"mas", "arcsec", "0.001"}};

std::string lower(std::string_view text) {
  std::string out(text);
  for (char& c : out)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return out;
}

const Word* word(std::string_view name) {
  const std::string small = lower(name);
  for (const Word& w : kWords)
    if (w.name == small || (small.size() == w.name.size() + 1 && small.back() == 's' && small.starts_with(w.name))) return &w;
  return nullptr;
}

/// The name as a product of known symbols: "Nms" is "N m s" and "N ms".
void split_products(std::string_view name, const std::string& begun, int left, std::vector<std::string>& out) {
  if (name.empty()) out.push_back(begun);
  if (name.empty() || left == 0) return;
  for (std::size_t n = 1; n <= name.size(); ++n)
    if (symbol(name.substr(0, n)))
      split_products(name.substr(n), begun + (begun.empty() ? "" : " ") + std::string(name.substr(0, n)), left - 1, out);
}

/// What may be meant by a name that is no unit, likeliest first.
std::vector<std::string> meanings(std::string_view name) {
  std::vector<std::string> out;
  const std::size_t end = name.find_last_not_of("-0123456789") + 1;  // m2, s-1
  const std::string power = end > 0 && end < name.size() ? "^" + std::string(name.substr(end)) : "";
  if (!power.empty()) name = name.substr(0, end);
  if (!power.empty() && symbol(name)) out.push_back(std::string(name));
  if (const Word* w = word(name); w && w->value.empty()) out.emplace_back(w->unit);
  if (name == "per") out.emplace_back("/");
  split_products(name, "", 4, out);
  if (name.size() > 1 && name.back() == 's' && symbol(name.substr(0, name.size() - 1))) out.emplace_back(name.substr(0, name.size() - 1));
  const std::string small = lower(name);
  const auto same = [&](const std::string& legal) {
    if (lower(legal) == small) out.push_back(legal);
  };
  for (const Symbol& s : kSymbols) same(std::string(s.name));
  for (const Prefix& p : kPrefixes)
    for (const Symbol& s : kSymbols)
      if (s.takes_prefix) same(p.name + std::string(s.name));
  for (std::string& meaning : out) meaning += power;
  return out;
}

constexpr std::size_t kMostReadings = 200, kLongestUnit = 60;

/// Every way to read `text` with its unknown names replaced by what they may mean; empty where one means nothing.
std::vector<std::string> readings(std::string_view text) {
  std::vector<std::string> all{""};
  while (!text.empty() && !all.empty()) {
    const std::size_t length = std::min(text.find_first_of(kPunctuation), text.size());
    if (length == 0) {
      for (std::string& r : all) r += text[0];
      text.remove_prefix(1);
      continue;
    }
    const std::string_view name = text.substr(0, length);
    const bool known = symbol(name) || (!all.front().empty() && all.front().back() == '^');
    const std::vector<std::string> choices = known ? std::vector<std::string>{std::string(name)} : meanings(name);
    std::vector<std::string> longer;
    for (const std::string& r : all)
      for (const std::string& c : choices)
        if (longer.size() < kMostReadings) longer.push_back(r + c);
    all = std::move(longer);
    text.remove_prefix(length);
  }
  return all;
}

struct Repair {
  std::string unit;  // empty: none found
  bool fits = false;
};

/// A unit that may be meant by a text that is none, preferably one of the wanted dimension.
Repair repaired(std::string_view text, const Dimension* wanted) {
  if (text.size() > kLongestUnit) return {};
  std::string plain(text);
  for (std::size_t at; (at = plain.find("**")) != std::string::npos;) plain.replace(at, 2, "^");
  Repair best;
  for (std::string r : readings(plain)) {
    for (const std::string_view around : {" / ", "/ ", " /"})
      for (std::size_t at; (at = r.find(around)) != std::string::npos;) r.replace(at, around.size(), "/");
    auto unit = parse_unit(r);
    if (const std::size_t slash = r.find('/'); !unit && slash != std::string::npos) {
      r = r.substr(0, slash + 1) + "(" + r.substr(slash + 1) + ")";
      unit = parse_unit(r);
    }
    if (!unit) continue;
    const bool fits = wanted && unit->dimension == *wanted;
    if (best.unit.empty() || (fits && !best.fits)) best = {r, fits};
  }
  return best;
}

/// "1 lb is 0.45359237 kg" for each name of the text that is a unit elsewhere.
std::string conversions(std::string_view text) {
  if (text.size() > kLongestUnit) return {};
  std::string out;
  while (!text.empty()) {
    const std::size_t length = std::min(text.find_first_of(kPunctuation), text.size());
    const Word* w = length > 0 && !symbol(text.substr(0, length)) ? word(text.substr(0, length)) : nullptr;
    if (w && !w->value.empty()) out += fmt::format("{}1 {} is {} {}", out.empty() ? "" : ", ", text.substr(0, length), w->value, w->unit);
    text.remove_prefix(std::max<std::size_t>(length, 1));
  }
  return out;
}

/// "1 mdeg is 0.001 deg" of a prefix that is none here, or stands at a unit that takes none; empty: the text is nothing of that kind.
std::string without_prefix(std::string_view text) {
  for (const Symbol& s : kSymbols) {
    if (text.size() != s.name.size() + 1 || text.substr(1) != s.name) continue;
    const auto p = std::ranges::find(kPrefixes, text[0], &Prefix::name);
    if (text[0] == 'h' || p != std::end(kPrefixes)) return fmt::format("1 {} is {:g} {}", text, text[0] == 'h' ? 100.0 : p->factor, s.name);
  }
  return {};
}

std::string number_hint(std::string_view text) {
  const std::string_view digits = text.substr(!text.empty() && (text[0] == '-' || text[0] == '+') ? 1 : 0);
  if (digits.size() > 1 && digits[0] == '0' && is_digit(digits[1]))
    return "a leading zero means octal to some readers; write the number without it";
  if (digits.size() > 1 && digits[0] == '0' && (digits[1] == 'x' || digits[1] == 'X' || digits[1] == 'o' || digits[1] == 'b'))
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

std::optional<Unit> parse_unit(std::string_view text) { return UnitParser(ascii_notation(text)).whole(); }

std::string unit_hint(std::string_view text, const Dimension* wanted) {
  const std::string plain = ascii_notation(text);
  if (std::string known = conversions(plain); !known.empty()) return known;
  if (std::string plainly = without_prefix(plain); !plainly.empty()) return plainly;
  if (const Repair repair = repaired(plain, wanted); !repair.unit.empty())
    return plain.find('/') != std::string::npos && repair.unit.find('(') != std::string::npos && plain.find('(') == std::string::npos
               ? fmt::format("after a `/` a product needs parentheses: {}", repair.unit)
               : fmt::format("did you mean \"{}\"?", repair.unit);
  return {};
}

std::string describe(const Dimension& dimension) {
  for (const NamedDimension& n : kNamed)
    if (n.exponents == dimension.exponents) return n.unit.empty() ? std::string(n.name) : fmt::format("{} [{}]", n.name, n.unit);
  std::string unit;
  for (std::size_t i = 0; i < 6; ++i) {
    const int e = dimension.exponents[i];
    if (e != 0) unit += fmt::format("{}{}{}", unit.empty() ? "" : " ", kBase[i], e == 1 ? "" : fmt::format("^{}", e));
  }
  return fmt::format("[{}]", unit);
}

std::optional<std::uint64_t> parse_seed(std::string_view text) {
  std::uint64_t seed = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seed);
  return error == std::errc() && end == text.data() + text.size() ? std::optional(seed) : std::nullopt;
}

std::optional<double> parse_number(std::string_view text) {
  const auto number = leading_number(text);
  return number && number->rest.empty() ? std::optional(number->value) : std::nullopt;
}

std::variant<double, QuantityFault> parse_quantity(std::string_view original, std::string_view unit) {
  const Unit wanted = parse_unit(unit).value_or(Unit{});
  const std::string expected = describe(wanted.dimension);
  const std::string plain = ascii_notation(trimmed(original));
  const std::string_view text = trimmed(plain);
  const auto number = leading_number(text);
  if (!number) return QuantityFault{Code::bad_number, expected, in_quotes(trimmed(original)), number_hint(text)};
  if (number->rest.empty()) return number->value;

  const std::string_view unit_text = trimmed(number->rest);
  const auto got = parse_unit(unit_text);
  if (!got) {
    const bool glued = number->rest[0] != ' ';  // 1,5 and 1_000 are numbers gone wrong, 5Nm is a unit
    if (glued && conversions(unit_text).empty() && !repaired(unit_text, &wanted.dimension).fits)
      return QuantityFault{Code::bad_number, expected, in_quotes(trimmed(original)), number_hint(text)};
    const std::size_t at = original.find(unit_text);  // as it was written, but for the signs of print
    return QuantityFault{Code::wrong_unit, expected,
                         fmt::format("{} (no such unit: {})", in_quotes(trimmed(original)),
                                     in_quotes(at == std::string_view::npos ? unit_text : original.substr(at, unit_text.size()))),
                         unit_hint(unit_text, &wanted.dimension)};
  }
  if (got->dimension != wanted.dimension) {
    std::string hint;
    Dimension without_angle = got->dimension;
    without_angle.exponents[5] = wanted.dimension.exponents[5];
    if (without_angle == wanted.dimension && wanted.dimension != Dimension{}) hint = "an angle counts as a unit here: rad, deg or rev";
    return QuantityFault{Code::wrong_unit, expected, fmt::format("{}: {}", in_quotes(trimmed(original)), describe(got->dimension)), hint};
  }
  const double value = number->value * got->factor;
  if (!std::isfinite(value)) return QuantityFault{Code::bad_number, expected, in_quotes(trimmed(original)), "too large"};
  return value;
}

std::string force_unit(std::string_view rate) {
  return rate == "rad/s" ? "N m" : rate == "m/s" ? "N" : rate == "1/s" ? "J" : fmt::format("W/({})", rate);
}

std::string in_quotes(std::string_view text) {
  constexpr std::size_t kLongest = 60;
  std::size_t shown = std::min(text.size(), kLongest);
  while (shown < text.size() && (static_cast<unsigned char>(text[shown]) & 0xC0) == 0x80) --shown;  // whole UTF-8 characters
  return fmt::format("\"{}{}\"", printable(text.substr(0, shown)), shown < text.size() ? "..." : "");
}

}  // namespace cardan
