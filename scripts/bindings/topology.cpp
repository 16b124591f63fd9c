// sat:attach, detach, lock, unlock, close, open: hinges and closures that become others at the end of an instant.
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>

#include "scripts/bindings/topology.hpp"

namespace cardan {
namespace {

using Wish = VehicleChanges::Wish;

Scenario& scenario_of(lua_State* L, const char* what) {
  Scenario& s = *self<Kind::vehicle>(L).scenario;
  expect_state(L, s, what);
  return s;
}

void want(lua_State* L, Scenario& s, std::string key, std::string value, std::string told) {
  s.changes.want(Wish{std::move(key), std::move(value), std::move(told), LuaHost::caller(L), LuaHost::traceback(L)});
}

const BodySpec& body_named(lua_State* L, const Scenario& s, const char* what) {
  std::vector<std::string> names;
  for (const BodySpec& b : s.model->spec->bodies) names.push_back(b.name);
  const std::string name = lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : "";
  const BodySpec* body = s.model->spec->find(name);
  if (!body)
    refuse(L, Code::unknown_body, what, "a body of the vehicle: " + listed(names), describe_value(L, 2), did_you_mean(name, names));
  return *body;
}

constexpr int kDeepest = 10;  // lists and maps in each other

/// The value at the top of the stack as the vehicle's text has it.
std::string yaml(lua_State* L, const char* what, int depth = 0) {
  luaL_checkstack(L, LUA_MINSTACK, nullptr);
  switch (lua_type(L, -1)) {
    case LUA_TBOOLEAN:
      return lua_toboolean(L, -1) != 0 ? "true" : "false";
    case LUA_TNUMBER:
      return fmt::format("{}", lua_tonumber(L, -1));
    case LUA_TSTRING: {
      std::string out = "\"";
      for (const char c : std::string_view(lua_tostring(L, -1))) out += c == '"' || c == '\\' ? std::string{'\\', c} : std::string(1, c);
      return out + "\"";
    }
    case LUA_TTABLE: {
      std::vector<std::string> items;
      const auto n = static_cast<lua_Integer>(lua_rawlen(L, -1));
      if (depth == kDeepest || (n > 0 && count_keys(L, -1) > static_cast<lua_Unsigned>(n)))
        refuse(L, Code::lua_argument, what, "lists and maps as in the vehicle's file",
               depth == kDeepest ? fmt::format("tables more than {} deep", kDeepest) : "a list with other keys than 1, 2, ...");
      for (lua_Integer i = 1; i <= n; ++i) {
        lua_rawgeti(L, -1, i);
        items.push_back(yaml(L, what, depth + 1));
        lua_pop(L, 1);
      }
      if (n > 0) return fmt::format("[{}]", fmt::join(items, ", "));
      for (lua_pushnil(L); lua_next(L, -2) != 0; lua_pop(L, 1)) {
        if (lua_type(L, -2) != LUA_TSTRING) refuse(L, Code::lua_argument, what, "keys as in the vehicle's file", describe_value(L, -2));
        items.push_back(fmt::format("{}: {}", lua_tostring(L, -2), yaml(L, what, depth + 1)));
      }
      std::ranges::sort(items);
      return fmt::format("{{{}}}", fmt::join(items, ", "));
    }
    default:
      refuse(L, Code::lua_argument, what, "texts, numbers, truths and tables of them", describe_value(L, -1));
  }
}

std::string point_text(const Eigen::Vector3d& p) { return fmt::format("[{}, {}, {}]", p.x(), p.y(), p.z()); }

/// `at` of a hinge as it is: "at: boss", or its place.
std::string at_text(const HingeSpec& h) {
  if (!h.body_node.empty()) return ", at: " + h.body_node;
  if (h.pnode_position.isZero(0.0) && h.pnode_R.isIdentity(0.0)) return "";
  const Eigen::Matrix3d& R = h.pnode_R;
  return fmt::format(", at: {{position: {}, orientation: {{matrix: [{}, {}, {}]}}}}", point_text(h.pnode_position), point_text(R.row(0)),
                     point_text(R.row(1)), point_text(R.row(2)));
}

/// A particle that nothing hangs on and no loop holds: its rotation has no equation.
bool spins_without_inertia(const SystemSpec& spec, const BodySpec& body) {
  return body.type == "particle" &&
         std::ranges::none_of(spec.bodies, [&](const BodySpec& b) { return b.hinge.inboard_body == body.name; }) &&
         std::ranges::none_of(spec.loops, [&](const LoopSpec& l) { return l.from.body == body.name || l.to.body == body.name; });
}

/// vehicle:detach "upper": the hinge between the body and the one inboard of it is gone; the body flies on with all that hangs on it.
int vehicle_detach(lua_State* L) {
  Scenario& s = scenario_of(L, "vehicle:detach");
  const BodySpec& body = body_named(L, s, "vehicle:detach");
  if (body.hinge.inboard_body.empty() && body.hinge.type == "free" && !body.hinge.locked)
    refuse(L, Code::other_vehicle, "vehicle:detach", "a body that hangs on another one, or on the world",
           body.name + ", which flies freely");
  if (spins_without_inertia(*s.model->spec, body))
    refuse(
        L, Code::other_vehicle, "vehicle:detach", "a body that has inertia, or carries one: what is let go turns by itself",
        body.name + ", a particle",
        fmt::format(
            "sat:attach(\"{}\", {{to = {{body = \"world\", orientation = {{quaternion_wxyz = {{sat:body(\"{}\"):attitude()}}}}}}, type = "
            "\"translational\"}})",
            body.name, body.name));
  want(L, s, "bodies." + body.name + ".hinge", "{type: free, to: world" + at_text(body.hinge) + "}", "detach " + body.name);
  return 0;
}

/// vehicle:attach("probe", {to = "station.port", at = "tip"}): its hinge is this one from now on. As in the vehicle's file, `locked` by
/// default; as_found = true: held as it is.
int vehicle_attach(lua_State* L) {
  constexpr const char* kWhat = "vehicle:attach";
  Scenario& s = scenario_of(L, kWhat);
  const BodySpec& body = body_named(L, s, kWhat);
  lua_settop(L, 3);
  if (lua_type(L, 3) != LUA_TTABLE)
    refuse(L, Code::lua_argument, kWhat, "a hinge as in the vehicle's file: {to = \"station.port\", at = \"tip\"}", describe_value(L, 3));
  std::vector<std::string> items;
  bool typed = false, as_found = false;
  for (lua_pushnil(L); lua_next(L, 3) != 0; lua_pop(L, 1)) {
    const std::string key = lua_type(L, -2) == LUA_TSTRING ? lua_tostring(L, -2) : "";
    if (key.empty()) refuse(L, Code::lua_argument, kWhat, "keys as in the vehicle's file", describe_value(L, -2));
    if (key == "initial" || key == "locked")
      refuse(L, Code::lua_argument, kWhat, "a hinge without `initial` and `locked`", key,
             "bodies stay where they are; as_found = true holds them as they are");
    if (key == "as_found") {
      as_found = lua_toboolean(L, -1) != 0;
      continue;
    }
    typed = typed || key == "type";
    items.push_back(fmt::format("{}: {}", key, yaml(L, kWhat)));
  }
  if (typed && as_found)
    refuse(L, Code::lua_argument, kWhat, "a type, or as_found = true", "both", "what is held as it is found has no type of hinge");
  if (!typed) items.emplace_back(as_found ? "type: free, locked: true" : "type: locked");
  std::ranges::sort(items);
  want(L, s, "bodies." + body.name + ".hinge", fmt::format("{{{}}}", fmt::join(items, ", ")), "attach " + body.name);
  return 0;
}

template <bool kLock>
int vehicle_lock(lua_State* L) {
  constexpr const char* kWhat = kLock ? "vehicle:lock" : "vehicle:unlock";
  Scenario& s = scenario_of(L, kWhat);
  const BodySpec& body = body_named(L, s, kWhat);
  const cardan_hinge_family* family = s.registry.hinge(body.hinge.type);
  if (body.hinge.locked == kLock || !family || family->nv == 0)
    refuse(L, Code::other_vehicle, kWhat, kLock ? "a hinge that moves" : "a hinge that is locked and has coordinates",
           fmt::format("that of {}, {}{}", body.name, body.hinge.type, body.hinge.locked ? ", locked" : ""));
  if (kLock && !body.hinge.prescribed.empty())
    refuse(L, Code::other_vehicle, kWhat, "a hinge whose motion is not given", fmt::format("that of {}, which is prescribed", body.name),
           "a profile that holds it: profile { hold = 0 }");
  want(L, s, "bodies." + body.name + ".hinge.locked", kLock ? "true" : "false", (kLock ? "lock " : "unlock ") + body.name);
  return 0;
}

template <bool kClose>
int vehicle_close(lua_State* L) {
  constexpr const char* kWhat = kClose ? "vehicle:close" : "vehicle:open";
  Scenario& s = scenario_of(L, kWhat);
  std::vector<std::string> names;
  for (const LoopSpec& l : s.model->spec->loops) names.push_back(l.name);
  const std::string name = lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : "";
  const auto loop = std::ranges::find(s.model->spec->loops, name, &LoopSpec::name);
  if (loop == s.model->spec->loops.end())
    refuse(L, Code::unknown_name, kWhat,
           names.empty() ? "a loop of the vehicle, which has none" : "a loop of the vehicle: " + listed(names), describe_value(L, 2),
           did_you_mean(name, names));
  if (loop->open != kClose)
    refuse(L, Code::other_vehicle, kWhat, kClose ? "a loop that is open" : "a loop that is closed", name + ", which is not");
  want(L, s, "loops." + name + ".open", kClose ? "false" : "true", (kClose ? "close " : "open ") + name);
  return 0;
}

}  // namespace

const std::vector<luaL_Reg>& topology_methods() {
  static const std::vector<luaL_Reg> all = {{"attach", method<vehicle_attach, 2>},     {"detach", method<vehicle_detach, 1>},
                                            {"lock", method<vehicle_lock<true>, 1>},   {"unlock", method<vehicle_lock<false>, 1>},
                                            {"close", method<vehicle_close<true>, 1>}, {"open", method<vehicle_close<false>, 1>}};
  return all;
}

}  // namespace cardan
