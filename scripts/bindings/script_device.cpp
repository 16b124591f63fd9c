// device{...}: a type of devices whose functions the script gives, before the vehicle that mounts it.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <set>
#include <tuple>

#include "core/base/units.hpp"
#include "core/model/schema.hpp"
#include "scripts/bindings/bind.hpp"
#include "scripts/lua/table.hpp"
#include "scripts/mission/script_device.hpp"

namespace cardan {
namespace {

using Item = ScriptDevice::Item;

/// What the vehicle file and the tables of functions have by these names already.
constexpr std::array kReserved{"t", "type", "inputs", "initial", "rate", "period", "offset"};
std::string own_name() { return fmt::format("a name of its own, none of {}", fmt::join(kReserved, ", ")); }

/// {rate = "rad/s", torque = {0.1, "N m"}, gain = 2}: names with units, values, or both; by name, so that no order of tables enters.
std::vector<Item> items(lua_State* L, LuaTable& t, const char* key, std::set<std::string>& taken) {
  std::vector<Item> all;
  if (!t.has(key)) return all;
  auto table = t.table(key);  // marks the key as read, reports what is no table
  if (!table) return all;
  lua_getfield(L, 1, key);
  for (lua_pushnil(L); lua_next(L, -2); lua_pop(L, 1)) {
    Item item;
    if (lua_type(L, -2) == LUA_TSTRING) item.name = lua_tostring(L, -2);
    const auto read = [&] {
      if (lua_type(L, -1) == LUA_TNUMBER)
        item.value = lua_tonumber(L, -1), item.given = true;
      else if (lua_type(L, -1) == LUA_TSTRING)
        item.unit = lua_tostring(L, -1);
      else
        table->reject(item.name, "a unit, a number, or {number, unit}");
    };
    if (lua_istable(L, -1)) {
      for (int i = 1; i <= 2; ++i) {
        lua_rawgeti(L, -1, i);
        read();
        lua_pop(L, 1);
      }
    } else {
      read();
    }
    if (item.name.empty() || !taken.insert(item.name).second) table->reject(item.name, own_name());
    const auto unit = parse_unit(item.unit);
    if (!unit)
      table->reject(item.name, "a unit: rad/s, N m, 1", unit_hint(item.unit));
    else if (unit->factor != 1.0)
      table->reject(item.name, "a unit of SI, in which functions get all numbers: " + describe(unit->dimension),
                    "in the vehicle file any unit of that dimension will do");
    all.push_back(std::move(item));
  }
  lua_pop(L, 1);
  std::ranges::sort(all, {}, [](const Item& item) {  // u_2 before u_10: numbers at the end count, as those of a vector do
    return std::tuple(item.name.substr(0, item.name.find_last_not_of("0123456789") + 1), item.name.size(), item.name);
  });
  return all;
}

/// A mount as it is declared: "node", "hinge", "density", {reads = "hinge"}, or {field = "density", at = "cp", optional = true}.
struct DeclaredMount {
  ScriptDevice::Mount mount;
  std::string at;  // of a field: the mount of its node; empty: not told
};

DeclaredMount declared(LuaTable& table, const std::string& name, bool in_full) {
  std::vector<std::string> quantities;
  for (const ScriptDevice::Quantity& q : ScriptDevice::kQuantities) quantities.emplace_back(q.name);
  DeclaredMount m;
  m.mount.name = name;
  std::string word;
  if (in_full) {
    LuaTable told = *table.table(name);
    m.mount.reads = told.has("reads");
    if (m.mount.reads) {
      word = told.choice("reads", {"node", "hinge"}).value_or("");
    } else {
      told.require({"field"});
      word = told.choice("field", quantities).value_or("");
      m.at = told.text("at").value_or("");
      m.mount.optional = told.flag("optional").value_or(false);
    }
    told.finish();
  } else {
    std::vector<std::string> words{"node", "hinge"};
    words.insert(words.end(), quantities.begin(), quantities.end());
    word = table.choice(name, words).value_or("");
  }
  m.mount.hinge = word == "hinge";
  if (const auto q = std::ranges::find(quantities, word); q != quantities.end())
    m.mount.quantity = static_cast<int>(q - quantities.begin());
  return m;
}

/// {at = "node", joint = "hinge", air = "density"}: by name, fields behind the node where they are read.
std::vector<ScriptDevice::Mount> mounts(lua_State* L, LuaTable& t, std::set<std::string>& taken) {
  std::vector<ScriptDevice::Mount> all;
  if (!t.has("mounts")) return all;
  auto table = t.table("mounts");
  if (!table) return all;
  std::map<std::string, bool> names;  // whether they are told in full
  lua_getfield(L, 1, "mounts");
  for (lua_pushnil(L); lua_next(L, -2); lua_pop(L, 1))
    names[lua_type(L, -2) == LUA_TSTRING ? lua_tostring(L, -2) : ""] = lua_istable(L, -1);
  lua_pop(L, 1);
  std::vector<DeclaredMount> fields;
  for (const auto& [name, in_full] : names) {
    if (name.empty() || !taken.insert(name).second) table->reject(name, own_name());
    DeclaredMount m = declared(*table, name, in_full);
    if (m.mount.quantity < 0)
      all.push_back(std::move(m.mount));
    else
      fields.push_back(std::move(m));
  }
  std::vector<std::string> nodes;
  for (const ScriptDevice::Mount& m : all)
    if (!m.hinge) nodes.push_back(m.name);
  for (DeclaredMount& field : fields) {
    const bool of_time = ScriptDevice::kQuantities[field.mount.quantity].of_time;
    const std::string at = field.at.empty() && nodes.size() == 1 ? nodes.front() : field.at;
    const auto node = std::ranges::find_if(all, [&](const ScriptDevice::Mount& m) { return m.name == at && !m.hinge && m.quantity < 0; });
    if (node == all.end() && !(of_time && at.empty()))
      table->reject(field.mount.name, nodes.empty() ? "a field beside a mount that is a node, where it is read"
                                                    : "{field = ..., at = the node where it is read}: " + one_of(nodes));
    all.insert(node == all.end() ? node : node + 1, std::move(field.mount));
  }
  return all;
}

int device(lua_State* L, Scenario& s) {
  expect_setup(L, s, "device", false);
  if (s.model) refuse(L, Code::lua_argument, "device", "types of devices before the vehicle", "one after it");
  DiagnosticSink sink;
  LuaTable t(L, 1, "device", sink);
  sink.throw_if_any();
  ScriptDevice::Description d;
  d.type = t.text("type").value_or("");
  if (d.type.empty()) t.reject("type", "a name for the type: lua/detumble");
  if (s.registry.device(d.type)) t.reject("type", "a type that is not taken yet", "lua/...");
  d.summary = t.text("summary").value_or("a device of the script");
  d.in_step = t.flag("in_step").value_or(false);
  if (auto f = t.function("evaluate")) d.evaluate = std::move(*f);
  if (auto f = t.function("tick")) d.tick = std::move(*f);
  std::set<std::string> taken(kReserved.begin(), kReserved.end());
  d.params = items(L, t, "params", taken), d.inputs = items(L, t, "inputs", taken), d.outputs = items(L, t, "outputs", taken);
  d.states = items(L, t, "states", taken), d.memory = items(L, t, "memory", taken);
  d.mounts = mounts(L, t, taken);
  if (d.in_step != static_cast<bool>(d.evaluate))
    t.reject(d.in_step ? "evaluate" : "in_step", "`evaluate` and `in_step = true` together",
             "`evaluate` runs inside of the right-hand side, some times in a step; `tick` at its rate");
  if (!d.evaluate && !d.tick) t.reject("tick", "a function tick(a, dt), or evaluate(a) with in_step = true");
  if (!d.states.empty() && !d.in_step) t.reject("states", "`memory` in a device that is sampled");
  if (!d.memory.empty() && !d.tick) t.reject("memory", "a function tick, which sets it");
  t.finish();
  sink.throw_if_any();
  auto made = std::make_unique<ScriptDevice>(s.lua, s.in_device, std::move(d), Located{"device", LuaHost::caller(L)});
  made->expect_pure();
  s.registry.devices.add(made->family(), "the script");
  s.script_devices.push_back(std::move(made));
  return 0;
}

}  // namespace

void bind_script_device(Scenario& s) {
  s.lua.bind("device", [&s](lua_State* L) { return device(L, s); });
}

}  // namespace cardan
