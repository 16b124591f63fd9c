// parameters { ... }: numbers of a script that the command line may set.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/units.hpp"
#include "core/io/yaml_reader.hpp"
#include "scripts/bindings/bind.hpp"
#include "scripts/lua/table.hpp"

namespace cardan {
namespace {

/// "30 deg" -> 0.52 and an angle. Empty if the text does not begin like a number.
struct Quantity {
  double value;
  Dimension dimension;
};
std::optional<Quantity> read_quantity(const std::string& text, QuantityFault& fault) {
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

/// "6 N m/rad": a value in SI with its unit.
std::string with_unit(const std::string& value, const Dimension& dimension) {
  const std::string text = describe(dimension);
  const std::size_t open = text.find('[');
  return open == std::string::npos ? value : value + " " + text.substr(open + 1, text.size() - open - 2);
}

/// "+.5 m", not "../file".
bool begins_like_a_number(const std::string& text) {
  const std::size_t at = text.find_first_of("+-") == 0 ? 1 : 0, digit = text.substr(at, 1) == "." ? at + 1 : at;
  return digit < text.size() && text[digit] >= '0' && text[digit] <= '9';
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
    sink_.report(code, {"parameters." + name_, {fmt::format("--set {}={}", set.key, set.value), 0, 0}}, std::move(expected), std::move(got),
                 std::move(hint));
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

  void push_numbers(const Setting* set, int table) {
    const auto size = static_cast<int>(lua_rawlen(L_, table));
    std::vector<Quantity> all;
    for (int i = 1; i <= size; ++i) {
      lua_rawgeti(L_, table, i);
      all.push_back(quantity(-1, fmt::format("{}[{}]", name_, i)));
      lua_pop(L_, 1);
    }
    if (all.empty()) report(name_, Code::wrong_type, "an array of numbers", "a table without them");
    if (set) {
      const DocNode list = parse_yaml(set->value, fmt::format("--set {}={}", set->key, set->value));
      if (list.kind != DocNode::Kind::list || list.items.size() != all.size())
        report_setting(Code::wrong_type, fmt::format("a list of {} numbers: [1, 0, 0]", all.size()), in_quotes(set->value));
      else
        for (std::size_t i = 0; i < all.size(); ++i) all[i].value = replaced(list.items[i].text, all[i].dimension);
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
