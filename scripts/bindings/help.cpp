// `help` at the prompt: what annotated Lua (scripts/prelude/cardan) says about objects, functions and names.
#include "scripts/bindings/help.hpp"
#include "scripts/bindings/bind.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>

#include "core/base/units.hpp"
#include "core/model/components.hpp"
#include "scripts/lua/function.hpp"
#include "scripts/prelude/prelude.hpp"

namespace cardan {
namespace {

constexpr std::array<std::string_view, 6> kLibraries = {"string", "table", "math", "utf8", "coroutine", "_G"};

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

/// Pushes the table of a class's functions as scripts find it: of a type of userdata, or a module; false if there is none.
bool push_functions(lua_State* L, const ApiClass& c) {
  const int top = lua_gettop(L);
  if (luaL_getmetatable(L, ("cardan." + lower(c.name)).c_str()) == LUA_TTABLE) {
    lua_getfield(L, -1, "__index");
    if (lua_isfunction(L, -1)) lua_getupvalue(L, -1, 1);
  } else {
    lua_getglobal(L, lower(c.name).c_str());
  }
  const bool found = lua_istable(L, -1);
  if (found) lua_replace(L, top + 1);
  lua_settop(L, found ? top + 1 : top);
  return found;
}

/// Of the function at `index`, by identity.
std::string text_of_function(lua_State* L, int index) {
  const ApiReference& api = api_reference();
  for (const ApiFunction& f : api.functions()) {
    lua_getglobal(L, f.name.c_str());
    const bool found = lua_rawequal(L, -1, index) != 0;
    lua_pop(L, 1);
    if (found) return api.text_of(f);
  }
  for (const auto& [name, c] : api.classes()) {
    if (!push_functions(L, c)) continue;
    const int table = lua_gettop(L);
    for (const ApiFunction* f : api.functions_of(c)) {
      lua_pushstring(L, f->name.c_str());
      lua_rawget(L, table);
      const bool found = lua_rawequal(L, -1, index) != 0;
      lua_settop(L, table);
      if (!found) continue;
      ApiFunction own = *f;
      own.owner = c.name;
      return api.text_of(own);
    }
    lua_settop(L, table - 1);
  }
  return "a function of the script, or of Lua's own library";
}

std::string text_of_object(lua_State* L, int index) {
  const ApiReference& api = api_reference();
  if (luaL_getmetafield(L, index, "__name") == LUA_TSTRING) {
    const std::string_view type = lua_tostring(L, -1);
    if (type.starts_with("cardan."))
      if (const ApiClass* c = api.find_class(type.substr(7))) return api.text_of(*c);
  }
  for (const auto& [name, c] : api.classes()) {
    lua_getglobal(L, lower(name).c_str());
    const bool found = lua_istable(L, index) && lua_rawequal(L, -1, index);
    lua_pop(L, 1);
    if (found) return api.text_of(c);
  }
  return fmt::format("a {} of the script", luaL_typename(L, index));
}

std::string text_of_name(lua_State* L, const std::string& name) {
  const ApiReference& api = api_reference();
  std::string out;
  const auto add = [&](const std::string& text) { out += (out.empty() ? "" : "\n\n") + text; };
  for (const ApiFunction* f : api.find(name)) {
    const std::string text = api.text_of(*f);
    if (out.find(text) == std::string::npos) add(text);
  }
  if (const ApiClass* c = api.find_class(name); c && (out.empty() || !c->functions.empty())) add(api.text_of(*c));
  if (out.empty() && std::find(kLibraries.begin(), kLibraries.end(), name) != kLibraries.end()) {
    std::vector<std::string> names;
    lua_getglobal(L, name.c_str());
    for (lua_pushnil(L); lua_next(L, -2); lua_pop(L, 1))
      if (lua_type(L, -2) == LUA_TSTRING) names.emplace_back(lua_tostring(L, -2));
    std::sort(names.begin(), names.end());
    out = fmt::format("{}: of Lua 5.4: {}", name, fmt::join(names, ", "));
  }
  if (out.empty())
    refuse(L, Code::unknown_name, "help", "an object, a function, or a name; `help` alone lists them", in_quotes(name),
           did_you_mean(name, api.topics()));
  return out;
}

/// help(), help(x), help "name" -> text
int help(lua_State* L) {
  lua_remove(L, 1);  // the table `help`, which is called
  std::string text;
  switch (lua_type(L, 1)) {
    case LUA_TNONE:
    case LUA_TNIL:
      text = api_reference().overview();
      break;
    case LUA_TSTRING:
      text = text_of_name(L, lua_tostring(L, 1));
      break;
    case LUA_TFUNCTION:
      text = text_of_function(L, 1);
      break;
    case LUA_TUSERDATA:
    case LUA_TTABLE:
      text = text_of_object(L, 1);
      break;
    default:
      text = describe_value(L, 1);
  }
  lua_pushlstring(L, text.data(), text.size());
  return 1;
}

}  // namespace

const ApiReference& api_reference() {
  static const ApiReference api(reference_files());
  return api;
}

void bind_help(Scenario& s) {
  s.lua.protect([&s](lua_State* L) {
    lua_newtable(L);
    lua_newtable(L);
    s.lua.push(L, help);
    lua_setfield(L, -2, "__call");
    s.lua.push(L, [](lua_State* l) {
      const std::string text = api_reference().overview();
      lua_pushlstring(l, text.data(), text.size());
      return 1;
    });
    lua_setfield(L, -2, "__tostring");
    lua_pushboolean(L, 0);
    lua_setfield(L, -2, "__metatable");
    lua_setmetatable(L, -2);
    lua_setglobal(L, "help");
  });
}

std::vector<std::string> names_for(const Scenario& s, std::string_view word) {
  constexpr std::array<std::string_view, 8> kBodies = {"hinge", "body", "modes", "subtree", "path", "subgraph", "derivatives", "reactions"};
  constexpr std::array<std::string_view, 7> kNodes = {"node",          "nodes", "compliance", "manipulability", "effective_inertia",
                                                      "participation", "load"};
  const auto is_one_of = [&](const auto& words) { return std::find(words.begin(), words.end(), word) != words.end(); };
  if (word == "help") return api_reference().topics();
  std::vector<std::string> out;
  if (!s.model) return out;
  if (!is_one_of(kNodes))
    for (const UserBody& u : s.model->user)
      if (word != "modes" || u.n_modes > 0) out.push_back(u.name);
  if (is_one_of(kBodies)) return out;
  for (const UserNode& n : s.model->nodes) out.push_back(n.name);
  if (is_one_of(kNodes)) return out;
  for (const std::string& name : component_names(*s.model)) out.push_back(name);
  return out;
}

}  // namespace cardan
