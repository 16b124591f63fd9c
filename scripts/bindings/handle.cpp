#include "scripts/bindings/handle.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace cardan {
namespace {

constexpr const char* kTypes[] = {"cardan.vehicle", "cardan.body",   "cardan.hinge", "cardan.modes",   "cardan.node",
                                  "cardan.load",    "cardan.device", "cardan.loop",  "cardan.sequence"};
constexpr const char* kWords[] = {"vehicle", "body", "hinge", "modes", "node", "load", "device", "loop", "sequence"};

/// hinge "rod": angle
int handle_text(lua_State* L) {
  const auto& h = *static_cast<Handle*>(lua_touserdata(L, 1));
  const Model& m = *h.scenario->model;
  const char* word = kWords[static_cast<int>(h.kind)];
  const auto named = [&](const std::string& name, const std::string& rest = {}) { return fmt::format("{} \"{}\"{}", word, name, rest); };
  const ModelMap& now = h.scenario->sim->now();
  const auto node = [&](int id) { return m.nodes[static_cast<std::size_t>(now.node[static_cast<std::size_t>(id)])].name; };
  std::string text;
  switch (h.kind) {
    case Kind::vehicle: {
      std::vector<std::string> names;
      for (const UserBody& u : m.user) names.push_back(u.name);
      text = fmt::format("vehicle: {}", listed(names));
      break;
    }
    case Kind::hinge:
      text = named(h.user().name, ": " + (h.user().nq > 0 ? listed(h.user().q_names) : "locked"));
      break;
    case Kind::modes:
      text = named(h.user().name, fmt::format(": {}", h.user().n_modes));
      break;
    case Kind::node:
      text = named(node(h.index));
      break;
    case Kind::load:
      text = named(node(h.scenario->loads[static_cast<std::size_t>(h.index)].node));
      break;
    case Kind::device: {
      const Device& d = m.devices.all[static_cast<std::size_t>(now.device[static_cast<std::size_t>(h.index)])];
      text = named(d.name, fmt::format(": {}", d.family->type));
      break;
    }
    case Kind::loop: {
      const LoopSpec& loop = m.spec->loops[static_cast<std::size_t>(h.index)];
      text = named(loop.name, fmt::format(": {}", loop.type));
      break;
    }
    case Kind::sequence:
      text = named(h.sequence().name, fmt::format(": {}", Sequences::name_of(h.sequence().state)));
      break;
    default:
      text = named(h.user().name);
  }
  lua_pushlstring(L, text.data(), text.size());
  return 1;
}

}  // namespace

Handle& handle_of(lua_State* L, Kind kind) {
  auto* h = static_cast<Handle*>(lua_touserdata(L, 1));
  const char* word = kWords[static_cast<int>(kind)];
  if (!h || lua_rawlen(L, 1) != sizeof(Handle) || h->kind != kind)
    refuse(L, Code::lua_argument, word, fmt::format("a {} before a colon", word), describe_value(L, 1),
           "methods are called with a colon: wheel:rate()");
  if (h->scenario->in_device)
    refuse(L, Code::lua_argument, word, "what it is handed, inside of a function of device{...}", fmt::format("a {} of the vehicle", word),
           "mounts, inputs and memory are its arguments: a function of them alone");
  return *h;
}

void push_handle(lua_State* L, Kind kind, int index, Scenario& s) {
  auto* h = static_cast<Handle*>(lua_newuserdatauv(L, sizeof(Handle), 0));
  *h = {kind, index, &s};
  luaL_setmetatable(L, kTypes[static_cast<int>(kind)]);
}

bool is_handle(lua_State* L, int index) {
  if (lua_type(L, index) != LUA_TUSERDATA || luaL_getmetafield(L, index, "__name") != LUA_TSTRING) return false;
  const bool is = std::ranges::find(kTypes, std::string_view(lua_tostring(L, -1))) != std::end(kTypes);
  lua_pop(L, 1);
  return is;
}

void refuse_at_trial(lua_State* L, const std::string& what) {
  refuse(L, Code::lua_argument, what, "coordinates and rates of hinges and modes, states of devices, and t, inside of an event's `when`",
         what,
         "an event is located by its function at trial states, where nothing else is known; what else there is a controller may read, or "
         "wait_until(f, { rate = \"10 Hz\" }), at ticks");
}

void expect_state(lua_State* L, const Scenario& s, const char* what) {
  s.expect_closed();
  if (s.in_event_function) refuse_at_trial(L, what);
}

double command(lua_State* L, int arg, Scenario& s, const char* what, const std::string& name) {
  if (lua_type(L, arg) != LUA_TNUMBER)
    refuse(L, Code::lua_argument, fmt::format("{} of {}", what, name), "a number", describe_value(L, arg));
  const double x = lua_tonumber(L, arg);
  if (std::isfinite(x)) return x;
  const std::string got = fmt::format("{} of {} = {}", what, name, std::isnan(x) ? "nan" : x > 0 ? "inf" : "-inf");
  if (s.stage == Scenario::Stage::setup) refuse(L, Code::lua_argument, fmt::format("{} of {}", what, name), "a finite number", got);
  s.fault = RunFailure{Code::controller_nan,
                       s.sim->time(),
                       "",
                       "",
                       fmt::format("{}: {}{}", s.actor, got, place_of_failure(LuaHost::caller(L))),
                       "a division by zero, or the root of a negative number?",
                       ""};
  refuse(L, Code::lua_argument, fmt::format("{} of {}", what, name), "a finite number", got);
}

int push3(lua_State* L, const Eigen::Vector3d& x) {
  for (int i = 0; i < 3; ++i) lua_pushnumber(L, x[i]);
  return 3;
}
int push_quaternion(lua_State* L, const Eigen::Matrix3d& R) {
  Eigen::Quaterniond q(R);
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  for (double x : {q.w(), q.x(), q.y(), q.z()}) lua_pushnumber(L, x);
  return 4;
}

void bind_handles(Scenario& s) {
  s.lua.protect([](lua_State* L) {
    int kind = 0;
    for (const auto& methods : {vehicle_methods(), body_methods(), hinge_methods(), modes_methods(), node_methods(), load_methods(),
                                device_methods(), loop_methods(), sequence_methods()})
      make_handle_type(L, kTypes[kind++], methods, method<handle_text>);
  });
}

void push_vehicle(lua_State* L, Scenario& s) { push_handle(L, Kind::vehicle, 0, s); }

}  // namespace cardan
