// A hinge: sat:hinge "wing_left".
#include <fmt/format.h>

#include <cmath>

#include "core/base/units.hpp"
#include "scripts/bindings/handle.hpp"
#include "scripts/bindings/profile.hpp"

namespace cardan {
namespace {

/// Index of the component of a coordinate or velocity (`names` are its own) that argument `arg` names: 1, 2, ... or a name; the
/// first one if absent. Where each coordinate has its rate, both names will do; the name of the body may stand before it.
int component(lua_State* L, int arg, const std::vector<std::string>& names, const UserBody& u) {
  const std::string& body = u.name;
  const cardan_hinge_family& hinge = *u.hinge;  // of a locked hinge the model has no names
  const int type = lua_type(L, arg);
  const auto n = static_cast<lua_Integer>(names.size());
  if (type == LUA_TNUMBER || type == LUA_TNONE || type == LUA_TNIL) {
    const lua_Integer i = type == LUA_TNUMBER ? lua_tointeger(L, arg) : 1;
    if (i >= 1 && i <= n) return static_cast<int>(i) - 1;
  } else if (type == LUA_TSTRING) {
    std::string_view name = lua_tostring(L, arg);
    if (name.starts_with(body) && name.substr(body.size()).starts_with('.')) name.remove_prefix(body.size() + 1);
    for (std::size_t i = 0; i < names.size(); ++i)
      if (names[i] == name || (hinge.nq == hinge.nv && (name == hinge.q_names[i] || name == hinge.v_names[i]))) return static_cast<int>(i);
  }
  const std::string word = type == LUA_TSTRING ? lua_tostring(L, arg) : "";
  refuse(L, n == 0 ? Code::lua_argument : Code::unknown_name, "hinge of " + body,
         n == 0 ? "a hinge that moves" : fmt::format("1 to {}, or a name: {}", n, listed(names)),
         n == 0              ? body + ", which does not"
         : type == LUA_TNONE ? "the first component"
                             : describe_value(L, arg),
         did_you_mean(word, names));
}

/// A hinge that is held has its coordinates, and rates of zero.
const HingeSpec* held(const Handle& h) {
  const HingeSpec& spec = h.scenario->model->spec->bodies[static_cast<std::size_t>(h.index)].hinge;
  return spec.locked ? &spec : nullptr;
}
std::vector<std::string> names_of(const char* const* names, std::uint32_t n) { return {names, names + n}; }

int hinge_q(lua_State* L) {
  const Handle& h = self<Kind::hinge>(L);
  const UserBody& u = h.user();
  if (const HingeSpec* spec = held(h)) {
    const int i = component(L, 2, names_of(u.hinge->q_names, u.hinge->nq), u);
    lua_pushnumber(L, spec->q.empty() ? 0.0 : spec->q[static_cast<std::size_t>(i)]);
    return 1;
  }
  lua_pushnumber(L, h.scenario->q[u.q + component(L, 2, u.q_names, u)]);
  return 1;
}
int hinge_v(lua_State* L) {
  const Handle& h = self<Kind::hinge>(L);
  const UserBody& u = h.user();
  if (held(h)) {
    component(L, 2, names_of(u.hinge->v_names, u.hinge->nv), u);
    lua_pushnumber(L, 0.0);
    return 1;
  }
  lua_pushnumber(L, h.scenario->v[u.v + component(L, 2, u.v_names, u)]);
  return 1;
}

int hinge_force(lua_State* L) {
  const Handle& h = self<Kind::hinge>(L);
  Scenario& s = *h.scenario;
  const UserBody& u = h.user();
  expect_state(L, s, "a command");
  const double x = command(L, 2, s, "force on hinge", u.name);
  if (held(h)) {  // a controller goes on while the mission has its hinge locked
    component(L, 3, names_of(u.hinge->v_names, u.hinge->nv), u);
    if (x != 0.0)
      s.sim->warn(Code::no_effect, {"hinge of " + u.name, LuaHost::caller(L)}, "it is locked: a force on it has no effect",
                  "commands begin anew when it is let go");
    return 0;
  }
  const int v = u.v + component(L, 3, u.v_names, u);
  if (s.sim->model().has_given_motion(v))
    refuse(L, Code::lua_argument, "hinge of " + u.name, "a component that is free to move", "a prescribed one",
           "its motion is given by :profile{...}; :applied() tells the force it needs");
  s.sim->set_force(v, x);
  return 0;
}
int hinge_applied(lua_State* L) {
  const Handle& h = self<Kind::hinge>(L);
  Scenario& s = *h.scenario;
  expect_state(L, s, "the force on a hinge");
  if (held(h)) {
    component(L, 2, names_of(h.user().hinge->v_names, h.user().hinge->nv), h.user());
    lua_pushnumber(L, 0.0);
    return 1;
  }
  const int v = h.user().v + component(L, 2, h.user().v_names, h.user());
  if (!s.sim->model().has_given_motion(v)) {
    lua_pushnumber(L, s.sim->force(v));
    return 1;
  }
  std::vector<double> all(static_cast<std::size_t>(s.sim->model().nv));  // of the vehicle as it is now
  s.sim->drive_forces(all.data());
  lua_pushnumber(L, all[static_cast<std::size_t>(v)]);
  return 1;
}
int hinge_reaction(lua_State* L) {
  const Handle& h = self<Kind::hinge>(L);
  expect_state(L, *h.scenario, "the reaction of a hinge");
  const Force<double> f = h.scenario->sim->observe().hinge_wrench(h.index);
  for (double x : {f.n.x, f.n.y, f.n.z, f.f.x, f.f.y, f.f.z}) lua_pushnumber(L, x);
  return 6;
}

int hinge_profile(lua_State* L) {
  const Handle& h = self<Kind::hinge>(L);
  Scenario& s = *h.scenario;
  const UserBody& u = h.user();
  expect_state(L, s, "a profile");
  lua_settop(L, 2);
  DiagnosticSink sink;
  LuaTable t(L, 2, "profile of " + u.name, sink);
  sink.throw_if_any();
  t.has("component");
  lua_getfield(L, 2, "component");
  const int c = component(L, lua_gettop(L), u.v_names, u), v = u.v + c;
  lua_pop(L, 1);
  if (!s.sim->model().has_given_motion(v))
    refuse(L, Code::lua_argument, "profile of " + u.name, "a component that is prescribed", "one that is free to move",
           fmt::format("say so in the vehicle: bodies.{}.hinge.prescribed: [{}]", u.name, u.v_names[static_cast<std::size_t>(c)]));
  MotionProfile profile = read_profile(L, t, u.v_units[static_cast<std::size_t>(c)]);
  t.finish();
  sink.throw_if_any();
  s.sim->prescribe(v, std::move(profile));
  return 0;
}

}  // namespace

const std::vector<luaL_Reg>& hinge_methods() {
  static const std::vector<luaL_Reg> all = {{"angle", method<hinge_q, 1>},         {"q", method<hinge_q, 1>},
                                            {"rate", method<hinge_v, 1>},          {"v", method<hinge_v, 1>},
                                            {"torque", method<hinge_force, 2>},    {"force", method<hinge_force, 2>},
                                            {"applied", method<hinge_applied, 1>}, {"reaction", method<hinge_reaction, 0>},
                                            {"profile", method<hinge_profile, 1>}};
  return all;
}

}  // namespace cardan
