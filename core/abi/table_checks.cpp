#include "core/abi/table_checks.hpp"

#include <cmath>
#include <cstring>
#include <set>

#include "core/base/units.hpp"
#include "core/base/utf8.hpp"

namespace cardan {

void TableChecks::text(const std::string& member, const char* value, bool name) {
  if (!value) return expect(false, member, "null");
  constexpr std::size_t kLongest = 1000;
  const std::string_view shown(value, strnlen(value, kLongest));
  expect(shown.size() < kLongest && printable(shown) == shown, member, "no text of one line: " + in_quotes(shown));
  expect(!name || (!shown.empty() && shown.find_first_of(" \t\"'{}[],:#&*!|>%@`") == std::string_view::npos), member,
         "a name without spaces, quotes and brackets is needed: " + in_quotes(shown));
}

void TableChecks::unit(const std::string& member, const char* value) {
  if (!value) return expect(false, member, "null; \"1\" where there is none");
  const std::string_view shown(value, strnlen(value, 100));
  // "N m|N": where a component of a hinge turns, where it slides.
  const auto bar = shown.find('|');
  const bool good = parse_unit(shown.substr(0, bar)) && (bar == std::string_view::npos || parse_unit(shown.substr(bar + 1)));
  expect(good, member, "no unit: " + in_quotes(shown));
}

void TableChecks::names(const std::string& names_member, const std::string& units_member, const char* const* list, const char* const* units,
                        std::uint32_t n) {
  if (n == 0) return;
  expect(list, names_member, "null");
  expect(units, units_member, "null");
  for (std::uint32_t i = 0; i < n; ++i) {
    if (list) text(fmt::format("{}[{}]", names_member, i), list[i], true);
    if (units) unit(fmt::format("{}[{}]", units_member, i), units[i]);
  }
}

void TableChecks::parameters(const cardan_param_desc* params, std::uint32_t n) {
  expect(n <= kMostParameters, "n_params", fmt::format("{}, expected at most {}", n, kMostParameters));
  expect(n == 0 || params, "params", "null");
  if (n > kMostParameters || !params) return;
  std::set<std::string_view> names;
  for (std::uint32_t i = 0; i < n; ++i) {
    parameter(fmt::format("params[{}].", i), params[i]);
    if (good()) expect(names.insert(params[i].name).second, fmt::format("params[{}].name", i), fmt::format("\"{}\" twice", params[i].name));
  }
}

void TableChecks::parameter(const std::string& member, const cardan_param_desc& p) {
  text(member + "name", p.name, true);
  text(member + "meaning", p.meaning, false);
  expect(p.kind <= CARDAN_TABLE, member + "kind", fmt::format("{}, expected one of cardan_param_kind", p.kind));
  expect(p.flags <= (CARDAN_REQUIRED | CARDAN_ABOVE | CARDAN_BELOW | CARDAN_EACH), member + "flags",
         fmt::format("{}, expected those of cardan_param_flag", p.flags));
  expect((p.flags & CARDAN_EACH) == 0 || p.kind == CARDAN_VECTOR, member + "flags", "CARDAN_EACH, which is of a vector alone");
  expect(p.count <= kMostVectors, member + "count", fmt::format("{}, expected at most {}", p.count, kMostVectors));
  const bool columns = p.kind == CARDAN_TABLE, choice = p.kind == CARDAN_CHOICE;
  if (!(columns && p.units) && p.kind != CARDAN_TEXT && p.kind != CARDAN_TRUTH && !choice && p.kind != CARDAN_FILE)
    unit(member + "unit", p.unit);
  if ((columns || choice) && p.count <= kMostVectors) {
    expect(p.count > 0, member + "count", "0, and a choice needs its texts, a table its columns");
    expect(p.names, member + "names", "null");
    for (std::uint32_t i = 0; p.names && i < p.count; ++i) text(fmt::format("{}names[{}]", member, i), p.names[i], true);
    for (std::uint32_t i = 0; columns && p.units && i < p.count; ++i) unit(fmt::format("{}units[{}]", member, i), p.units[i]);
  }
  expect(p.lower <= p.upper, member + "lower, upper", fmt::format("{:g}, {:g}, expected lower <= upper", p.lower, p.upper));
}

}  // namespace cardan
