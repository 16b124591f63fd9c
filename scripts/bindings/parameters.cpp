// parameters { ... }: numbers of a script that the command line may set, and that chance may set anew in every run.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/base/noise.hpp"
#include "core/base/units.hpp"
#include "core/io/yaml_reader.hpp"
#include "scripts/bindings/bind.hpp"
#include "scripts/lua/table.hpp"

namespace cardan {
namespace {

std::string without_spaces_before(const std::string& text) { return text.substr(std::min(text.find_first_not_of(' '), text.size())); }

/// "30 deg" -> 0.52 and an angle. Empty if the text does not begin like a number.
struct Quantity {
  double value;
  Dimension dimension;
};
std::optional<Quantity> read_quantity(const std::string& given, QuantityFault& fault) {
  const std::string text = without_spaces_before(given);
  for (std::size_t cut = text.size(); cut > 0; --cut) {
    const auto number = parse_number(std::string_view(text).substr(0, cut));
    if (!number) continue;
    const std::size_t unit_at = text.find_first_not_of(' ', cut);
    if (unit_at == std::string::npos) return Quantity{*number, {}};
    if (const auto unit = parse_unit(std::string_view(text).substr(unit_at))) return Quantity{*number * unit->factor, unit->dimension};
  }
  fault = std::get<QuantityFault>(parse_quantity(text, "1"));
  fault.expected = "a number with a unit, or a text that does not begin like a number";
  return {};
}

/// "N m/rad", in SI; "1": none.
std::string unit_of(const Dimension& dimension) {
  const std::string text = describe(dimension);
  const std::size_t open = text.find('[');
  return open == std::string::npos ? "1" : text.substr(open + 1, text.size() - open - 2);
}
std::string with_unit(const std::string& value, const Dimension& dimension) {
  const std::string unit = unit_of(dimension);
  return unit == "1" ? value : value + " " + unit;
}

/// "+.5 m", not "../file".
bool begins_like_a_number(const std::string& given) {
  const std::string text = without_spaces_before(given);
  const std::size_t at = text.find_first_of("+-") == 0 ? 1 : 0, digit = text.substr(at, 1) == "." ? at + 1 : at;
  return digit < text.size() && text[digit] >= '0' && text[digit] <= '9';
}

constexpr double kNarrowest = 0.1;  // standard deviations that `within` leaves at least

/// How far a number may be off the one that is given.
struct Spread {
  double normal = 0.0;                                      // standard deviation
  double within = std::numeric_limits<double>::infinity();  // which a normal one never exceeds
  double uniform = 0.0;                                     // half of the width
};

/// Drawn for number i of what has this name, in the run of a seed; seed 0 is the run of the numbers that are given.
double drawn(const Spread& s, std::uint64_t seed, const std::string& name, std::uint32_t i) {
  if (seed == 0) return 0.0;
  const auto key = noise_key(seed, name);
  if (s.uniform > 0.0) {
    const auto word = philox({i, 0, 0, 1}, key);
    return s.uniform * (2.0 * uniform_noise(word[0], word[1]) - 1.0);
  }
  double off = 0.0;
  for (std::uint64_t tried = 0; tried == 0 || std::abs(off) > s.within; ++tried) {
    normal_noise(key, tried << 32 | i, 1, &off);
    off *= s.normal;
  }
  return off;
}

std::string text_of(const Spread& s, const Dimension& dimension) {
  const auto size = [&](double x) { return with_unit(fmt::format("{:.6g}", x), dimension); };
  if (s.uniform > 0.0) return "uniform " + size(s.uniform);
  return "normal " + size(s.normal) + (std::isfinite(s.within) ? ", within " + size(s.within) : "");
}

/// One parameter: what the script gives, replaced by what the command line gives. Pushes its value.
class ParameterReader {
 public:
  ParameterReader(lua_State* L, Scenario& s, DiagnosticSink& sink) : L_(L), s_(s), sink_(sink) {}

  void read(const std::string& name, int value) {
    name_ = name;
    const Setting* set = setting();
    switch (lua_type(L_, value)) {
      case LUA_TBOOLEAN:
        push_flag(set, lua_toboolean(L_, value) != 0);
        break;
      case LUA_TTABLE:
        push_numbers(set, value);
        break;
      case LUA_TSTRING:
        if (!begins_like_a_number(lua_tostring(L_, value))) {
          const std::string text = set ? set->value : lua_tostring(L_, value);
          note(text);
          lua_pushlstring(L_, text.data(), text.size());
          break;
        }
        [[fallthrough]];
      case LUA_TNUMBER: {
        const Quantity given = quantity(value, name);
        const double x = set ? replaced(set->value, given.dimension) : given.value;
        note(with_unit(fmt::format("{}", x), given.dimension));
        lua_pushnumber(L_, x);
        break;
      }
      default:
        report(name, Code::wrong_type, "a number, a text, an array of numbers, true or false", describe_value(L_, value));
        lua_pushnil(L_);
    }
  }

 private:
  Setting* setting() {
    const auto found = std::find_if(s_.settings.rbegin(), s_.settings.rend(), [&](const Setting& x) { return x.key == name_; });
    if (found == s_.settings.rend()) return nullptr;
    for (Setting& x : s_.settings) x.used = x.used || x.key == name_;
    return &*found;
  }
  void note(std::string value) { s_.parameters.emplace_back("parameters." + name_, std::move(value)); }

  void report(const std::string& path, Code code, std::string expected, std::string got, std::string hint = {}) {
    sink_.report(code, {"parameters." + path, LuaHost::caller(L_)}, std::move(expected), std::move(got), std::move(hint));
  }
  void report_setting(Code code, std::string expected, std::string got, std::string hint = {}) {
    const Setting& set = *setting();
    sink_.report(code, {"parameters." + name_, setting_mark(set.key, set.value)}, std::move(expected), std::move(got), std::move(hint));
  }

  Quantity quantity(int index, const std::string& path) {
    QuantityFault fault;
    if (lua_type(L_, index) == LUA_TNUMBER && std::isfinite(lua_tonumber(L_, index))) return {lua_tonumber(L_, index), {}};
    if (lua_type(L_, index) != LUA_TSTRING) {
      report(path, Code::wrong_type, "a finite number, or a text with a unit", describe_value(L_, index));
    } else if (const auto x = read_quantity(lua_tostring(L_, index), fault)) {
      return *x;
    } else {
      report(path, fault.code, fault.expected, fault.got, fault.hint);
    }
    return {0.0, {}};
  }

  /// The command line's value: of the same dimension, or a bare number in SI.
  double replaced(const std::string& text, const Dimension& dimension) {
    QuantityFault fault;
    const auto x = read_quantity(text, fault);
    if (!x)
      report_setting(fault.code, describe(dimension), fault.got, fault.hint);
    else if (x->dimension != dimension && x->dimension != Dimension{})
      report_setting(Code::wrong_unit, describe(dimension), fmt::format("{}: {}", in_quotes(text), describe(x->dimension)));
    else
      return x->value;
    return 0.0;
  }

  void push_flag(const Setting* set, bool flag) {
    if (set && set->value != "true" && set->value != "false") report_setting(Code::wrong_type, "true or false", in_quotes(set->value));
    if (set) flag = set->value == "true";
    note(flag ? "true" : "false");
    lua_pushboolean(L_, flag);
  }

  /// Of each number; none where the table has numbers alone. A size is one quantity for all of them, or one each.
  std::vector<Spread> spreads_of(int table, const std::vector<Quantity>& about) {
    std::map<std::string, std::vector<double>> given;
    for (lua_pushnil(L_); lua_next(L_, table) != 0; lua_pop(L_, 1)) {
      if (lua_type(L_, -2) != LUA_TSTRING) continue;
      const std::string key = lua_tostring(L_, -2), path = name_ + "." + key;
      if (key != "normal" && key != "uniform" && key != "within")
        report(path, Code::unknown_key, "normal, uniform, within", in_quotes(key), did_you_mean(key, {"normal", "uniform", "within"}));
      else
        given[key] = sizes(lua_gettop(L_), path, about, key != "within");
    }
    if (given.contains("normal") == given.contains("uniform")) {
      if (!given.empty()) report(name_, Code::wrong_type, "one of `normal` and `uniform`", given.contains("normal") ? "both" : "none");
      return {};
    }
    std::vector<Spread> out(about.size());
    for (std::size_t i = 0; i < about.size(); ++i) {
      if (given.contains("normal")) out[i].normal = given["normal"][i];
      if (given.contains("uniform")) out[i].uniform = given["uniform"][i];
      if (!given.contains("within")) continue;
      out[i].within = given["within"][i];
      if (given.contains("uniform") || out[i].within < kNarrowest * out[i].normal) {
        report(name_ + ".within", Code::out_of_range, fmt::format("a bound of `normal`, at least {:g} of it", kNarrowest),
               fmt::format("{}", out[i].within), "`uniform` for what is that narrow");
        return {};
      }
    }
    return out;
  }

  std::vector<double> sizes(int value, const std::string& path, const std::vector<Quantity>& about, bool may_be_zero) {
    std::vector<double> out(about.size(), 0.0);
    const bool each = lua_type(L_, value) == LUA_TTABLE;
    if (each && lua_rawlen(L_, value) != about.size()) {
      report(path, Code::wrong_type, fmt::format("one quantity, or an array of {}", about.size()), describe_value(L_, value));
      return out;
    }
    for (std::size_t i = 0; i < (each ? about.size() : std::min<std::size_t>(about.size(), 1)); ++i) {
      if (each) lua_rawgeti(L_, value, static_cast<lua_Integer>(i) + 1);
      const Quantity x = quantity(each ? -1 : value, each ? fmt::format("{}[{}]", path, i + 1) : path);
      if (each) lua_pop(L_, 1);
      if (x.dimension != about[i].dimension)
        report(path, Code::wrong_unit, describe(about[i].dimension), describe(x.dimension));
      else if (!(x.value > 0.0 || (may_be_zero && x.value == 0.0)))
        report(path, Code::out_of_range, may_be_zero ? "a number >= 0" : "a number > 0", fmt::format("{}", x.value));
      out[i] = x.value;
    }
    if (!each && !about.empty()) {
      const bool alike = std::ranges::all_of(about, [&](const Quantity& q) { return q.dimension == about[0].dimension; });
      if (!alike) report(path, Code::wrong_unit, "one for each of numbers in different units", "one for all");
      std::ranges::fill(out, out[0]);
    }
    return out;
  }

  void push_numbers(const Setting* set, int table) {
    const auto size = static_cast<int>(lua_rawlen(L_, table));
    std::vector<Quantity> all;
    for (int i = 1; i <= size; ++i) {
      lua_rawgeti(L_, table, i);
      all.push_back(quantity(-1, fmt::format("{}[{}]", name_, i)));
      lua_pop(L_, 1);
    }
    if (all.empty()) report(name_, Code::wrong_type, "an array of numbers", "a table without them");
    const std::vector<Spread> spreads = spreads_of(table, all);
    const bool is_one = size == 1 && !spreads.empty();  // a number, by chance
    if (set && is_one) {
      all[0].value = replaced(set->value, all[0].dimension);
    } else if (set) {
      const DocNode list = parse_yaml(set->value, setting_mark(set->key, set->value).file);
      if (list.kind != DocNode::Kind::list || list.items.size() != all.size())
        report_setting(Code::wrong_type, fmt::format("a list of {} numbers: [1, 0, 0]", all.size()), in_quotes(set->value));
      else
        for (std::size_t i = 0; i < all.size(); ++i) all[i].value = replaced(list.items[i].text, all[i].dimension);
    }
    for (std::size_t i = 0; i < spreads.size(); ++i) {
      if (!set) all[i].value += drawn(spreads[i], s_.seed, "parameters." + name_, static_cast<std::uint32_t>(i));
      s_.drawn.push_back({is_one ? name_ : fmt::format("{}[{}]", name_, i + 1), all[i].value, unit_of(all[i].dimension)});
      s_.spreads.push_back(set ? "set" : text_of(spreads[i], all[i].dimension));
    }
    if (is_one) {
      note(with_unit(fmt::format("{}", all[0].value), all[0].dimension));
      lua_pushnumber(L_, all[0].value);
      return;
    }
    lua_createtable(L_, size, 0);
    std::string text;
    for (std::size_t i = 0; i < all.size(); ++i) {
      lua_pushnumber(L_, all[i].value);
      lua_rawseti(L_, -2, static_cast<lua_Integer>(i) + 1);
      text += fmt::format("{}{}", i > 0 ? ", " : "", all[i].value);
    }
    const bool alike = std::all_of(all.begin(), all.end(), [&](const Quantity& x) { return x.dimension == all[0].dimension; });
    note(alike && !all.empty() ? with_unit("[" + text + "]", all[0].dimension) : "[" + text + "]");
  }

  lua_State* L_;
  Scenario& s_;
  DiagnosticSink& sink_;
  std::string name_;
};

/// parameters { slew_angle = "30 deg", ... } -> table of numbers in SI that answers for unknown names.
int parameters(lua_State* L, Scenario& s) {
  expect_setup(L, s, "parameters", false);
  DiagnosticSink sink;
  LuaTable(L, 1, "parameters", sink);
  sink.throw_if_any();
  std::vector<std::string> names;
  for (lua_pushnil(L); lua_next(L, 1); lua_pop(L, 1)) {
    if (lua_type(L, -2) == LUA_TSTRING)
      names.emplace_back(lua_tostring(L, -2));
    else
      sink.report(Code::wrong_type, {"parameters", LuaHost::caller(L)}, "names and their values", "a value without a name");
  }
  std::sort(names.begin(), names.end());
  lua_newtable(L);
  const int out = lua_gettop(L);
  ParameterReader reader(L, s, sink);
  for (const std::string& name : names) {
    if (std::find(s.parameter_names.begin(), s.parameter_names.end(), name) != s.parameter_names.end())
      sink.report(Code::duplicate_name, {"parameters." + name, LuaHost::caller(L)}, "each parameter once", in_quotes(name));
    lua_getfield(L, 1, name.c_str());
    reader.read(name, lua_gettop(L));
    lua_setfield(L, out, name.c_str());
    lua_pop(L, 1);
    s.parameter_names.push_back(name);
  }
  sink.throw_if_any();
  lua_newtable(L);
  s.lua.push(L, [names](lua_State* state) -> int {
    const std::string name = luaL_tolstring(state, 2, nullptr);
    std::string known;
    for (const std::string& n : names) known += (known.empty() ? "" : ", ") + n;
    refuse(state, Code::unknown_name, "parameters." + name, "a parameter: " + known, in_quotes(name), did_you_mean(name, names));
  });
  lua_setfield(L, -2, "__index");
  lua_setmetatable(L, out);
  return 1;
}

}  // namespace

void bind_parameters(Scenario& s) {
  s.lua.bind("parameters", [&s](lua_State* L) { return parameters(L, s); });
}

}  // namespace cardan
