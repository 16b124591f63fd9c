// A device: sat:device "wheel_x".
#include <fmt/format.h>

#include <algorithm>

#include "core/abi/port_vectors.hpp"
#include "core/base/units.hpp"
#include "core/model/device_units.hpp"
#include "scripts/bindings/handle.hpp"
#include "scripts/lua/table.hpp"

namespace cardan {
namespace {

const Device& device_of(const Handle& h) {
  const Scenario& s = *h.scenario;
  return s.model->devices.all[static_cast<std::size_t>(s.sim->now().device[static_cast<std::size_t>(h.index)])];
}

/// Where what argument `arg` names stands: a number among inputs, outputs, states, marks, or a vector of ports; refused if there is none.
struct Place {
  enum class What { input, output, state, mark } what;
  int index;       // of the model
  int size = 0;    // of a vector; 0: it is a number
  int valid = -1;  // which output says whether it holds; -1: it always does
};
Place place(lua_State* L, const Handle& h, std::initializer_list<Place::What> of, int arg = 2) {
  const Device& d = device_of(h);
  const std::string wanted = lua_type(L, arg) == LUA_TSTRING ? lua_tostring(L, arg) : "";
  std::vector<std::string> names;
  for (const Place::What what : of) {
    if (what == Place::What::state || what == Place::What::mark) {
      const bool state = what == Place::What::state;
      for (std::uint32_t i = 0; i < (state ? d.family->n_states : d.family->n_marks); ++i) {
        names.emplace_back((state ? d.family->states : d.family->marks)[i].name);
        if (wanted == names.back()) return {what, (state ? d.z : d.mark) + static_cast<int>(i)};
      }
      continue;
    }
    const bool input = what == Place::What::input;
    const std::uint32_t kind = input ? CARDAN_PORT_IN : CARDAN_PORT_OUT;
    const auto found = [&](int place, int size) {
      const char* says = input ? nullptr : port_at(*d.family, kind, place).valid;
      return Place{what, (input ? d.in : d.out) + place, size, says ? d.out + place_of_port(*d.family, kind, says) : -1};
    };
    for (int i = 0; i < (input ? d.n_in : d.n_out); ++i) {
      names.emplace_back(port_at(*d.family, kind, i).name);
      if (wanted == names.back()) return found(i, 0);
    }
    for (const PortVector& v : port_vectors(*d.family, kind)) {
      names.push_back(v.name);
      if (wanted == v.name) return found(v.first, static_cast<int>(v.suffixes.size()));
    }
  }
  std::vector<std::string> once;  // a state has the name of the output that tells it
  for (const std::string& name : names)
    if (std::ranges::find(once, name) == once.end()) once.push_back(name);
  refuse(L, Code::unknown_name, "device " + d.name,
         names.empty() ? fmt::format("nothing: a {} has no such numbers", d.family->type) : fmt::format("one of: {}", listed(once)),
         lua_type(L, arg) == LUA_TSTRING ? in_quotes(wanted) : describe_value(L, arg), did_you_mean(wanted, names));
}

int device_set(lua_State* L) {
  const Handle& h = self<Kind::device>(L);
  Scenario& s = *h.scenario;
  const Device& d = device_of(h);
  expect_state(L, s, "a command");
  const Place to = place(L, h, {Place::What::input});
  for (int i = to.index; i < to.index + std::max(to.size, 1); ++i)
    if (!s.model->devices.is_commanded(i))
      refuse(L, Code::lua_argument, fmt::format("{} of device {}", lua_tostring(L, 2), d.name), "an input that is not connected",
             "one that another device gives", "devices." + d.name + ".inputs of the vehicle");
  if (to.size == 0) {
    s.sim->set_device_input(to.index, command(L, 3, s, lua_tostring(L, 2), "device " + d.name));
    return 0;
  }
  if (lua_type(L, 3) != LUA_TTABLE || lua_rawlen(L, 3) != static_cast<lua_Unsigned>(to.size) || count_keys(L, 3) != lua_rawlen(L, 3))
    refuse(L, Code::lua_argument, fmt::format("{} of device {}", lua_tostring(L, 2), d.name), fmt::format("a list of {} numbers", to.size),
           describe_value(L, 3));
  std::vector<double> all;  // all of them, or none
  for (int i = 0; i < to.size; ++i) {
    lua_rawgeti(L, 3, i + 1);
    all.push_back(command(L, lua_gettop(L), s, lua_tostring(L, 2), "device " + d.name));
    lua_pop(L, 1);
  }
  for (int i = 0; i < to.size; ++i) s.sim->set_device_input(to.index + i, all[static_cast<std::size_t>(i)]);
  return 0;
}

/// Inside of an event's `when` states alone are known: which of the model argument 2 names.
int state_at_trial(lua_State* L, const Device& d) {
  std::vector<std::string> states;
  for (std::uint32_t i = 0; i < d.family->n_states; ++i) {
    states.emplace_back(d.family->states[i].name);
    if (lua_type(L, 2) == LUA_TSTRING && lua_tostring(L, 2) == states.back()) return d.z + static_cast<int>(i);
  }
  const std::string wanted = lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : describe_value(L, 2);
  const std::string has = states.empty() ? fmt::format("a {} has none", d.family->type) : fmt::format("its states: {}", listed(states));
  refuse_at_trial(L, fmt::format("{} of device {}, which is no state of it ({})", wanted, d.name, has));
}

int device_get(lua_State* L) {
  const Handle& h = self<Kind::device>(L);
  Scenario& s = *h.scenario;
  s.expect_closed();
  if (s.in_event_function) {
    lua_pushnumber(L, s.z[state_at_trial(L, device_of(h))]);
    return 1;
  }
  using What = Place::What;
  const Place p = place(L, h, {What::output, What::input, What::state, What::mark});
  s.sim->observe();
  const auto number = [&](int i) {
    return p.what == What::output  ? s.sim->device_output(i)
           : p.what == What::input ? s.sim->device_input(i)
           : p.what == What::state ? s.sim->state().z[i]
                                   : s.sim->state().marks[i];
  };
  if (p.size == 0) {
    lua_pushnumber(L, number(p.index));
  } else {
    lua_createtable(L, p.size, 0);
    for (int i = 0; i < p.size; ++i) lua_pushnumber(L, number(p.index + i)), lua_rawseti(L, -2, i + 1);
  }
  return 1;
}

int device_valid(lua_State* L) {
  const Handle& h = self<Kind::device>(L);
  Scenario& s = *h.scenario;
  expect_state(L, s, "a number of a device");
  const Place p = place(L, h, {Place::What::output});
  s.sim->observe();
  lua_pushboolean(L, p.valid < 0 || s.sim->device_output(p.valid) != 0.0);
  return 1;
}

/// The faults of the ports that argument 2 tells of, without numbers.
std::vector<PortFault> faults_of(const Handle& h, const Place& p) {
  const Device& d = device_of(h);
  const bool input = p.what == Place::What::input;
  std::vector<PortFault> all;
  for (int i = 0; i < std::max(p.size, 1); ++i)
    all.push_back({.device = h.index, .input = input, .place = p.index - (input ? d.in : d.out) + i});
  return all;
}

/// Each of these numbers: one for all ports of a vector, or a list.
void read_each(lua_State* L, LuaTable& t, const char* key, const std::string& unit, std::vector<PortFault>& of, double PortFault::*number) {
  const bool list = lua_getfield(L, 2, key) == LUA_TTABLE;
  lua_pop(L, 1);
  if (!list) {
    const auto x = t.number(key, unit);
    for (PortFault& f : of) f.*number = x.value_or(f.*number);
  } else if (const auto all = t.numbers(key, of.size(), unit)) {
    for (std::size_t i = 0; i < of.size(); ++i) of[i].*number = (*all)[i];
  }
}

int device_fault(lua_State* L) {
  const Handle& h = self<Kind::device>(L);
  Scenario& s = *h.scenario;
  expect_state(L, s, "a fault");
  lua_settop(L, 2);
  DiagnosticSink sink;
  LuaTable t(L, 2, "fault of " + device_of(h).name, sink);
  sink.throw_if_any();
  t.require({"port"});
  sink.throw_if_any();
  t.has("port");
  lua_getfield(L, 2, "port");
  const Place p = place(L, h, {Place::What::output, Place::What::input}, lua_gettop(L));
  lua_pop(L, 1);
  std::vector<PortFault> faults = faults_of(h, p);
  const Device& d = device_of(h);
  const std::string unit =
      unit_where(turns(s.sim->model(), d), port_at(*d.family, faults[0].input ? CARDAN_PORT_IN : CARDAN_PORT_OUT, faults[0].place).unit);
  bool any = false;
  for (const char* key : {"scale", "bias", "drift", "stuck", "noise", "drop", "delay", "swap"}) any = t.has(key) || any;
  if (!any)
    t.reject("port", "beside it one of: scale, bias, drift, stuck, noise, drop, delay, swap", "what is wrong with it; `mend` ends a fault");
  read_each(L, t, "scale", "1", faults, &PortFault::scale);
  read_each(L, t, "bias", unit, faults, &PortFault::bias);
  read_each(L, t, "drift", unit == "1" ? "1/s" : unit + "/s", faults, &PortFault::drift);
  read_each(L, t, "noise", unit, faults, &PortFault::noise);
  read_each(L, t, "drop", "1", faults, &PortFault::drop);
  read_each(L, t, "delay", "s", faults, &PortFault::delay);
  if (t.has("swap")) {
    lua_getfield(L, 2, "swap");
    const Place other = place(L, h, {p.what}, lua_gettop(L));
    lua_pop(L, 1);
    if (other.size != p.size)
      t.reject("swap", p.size == 0 ? "a number, as the port is" : fmt::format("a vector of {}, as the port is", p.size));
    else
      for (std::size_t i = 0; i < faults.size(); ++i) faults[i].swap = other.index - (faults[0].input ? d.in : d.out) + static_cast<int>(i);
  }
  const int stuck = lua_getfield(L, 2, "stuck");
  lua_pop(L, 1);
  if (stuck == LUA_TBOOLEAN) {
    if (!t.flag("stuck").value_or(true)) t.reject("stuck", "true: at what it is then, or a number");
    for (PortFault& f : faults) f.stuck = true;
  } else if (stuck != LUA_TNIL) {
    std::vector<PortFault> at = faults;
    read_each(L, t, "stuck", unit, at, &PortFault::bias);
    for (std::size_t i = 0; i < faults.size(); ++i) faults[i].stuck = true, faults[i].value = at[i].bias;
  }
  const auto from = t.number("from", "s");
  const auto until = t.number("until_", "s");
  t.finish();
  sink.throw_if_any();
  for (PortFault& f : faults) f.from = from.value_or(f.from), f.until = until.value_or(f.until);
  for (const PortFault& f : faults) s.sim->fault(f, LuaHost::caller(L));
  return 0;
}

int device_mend(lua_State* L) {
  const Handle& h = self<Kind::device>(L);
  Scenario& s = *h.scenario;
  expect_state(L, s, "a fault");
  for (const PortFault& f : faults_of(h, place(L, h, {Place::What::output, Place::What::input}))) s.sim->mend(f.device, f.input, f.place);
  return 0;
}

}  // namespace

const std::vector<luaL_Reg>& device_methods() {
  static const std::vector<luaL_Reg> all = {{"set", method<device_set, 2>},
                                            {"get", method<device_get, 1>},
                                            {"valid", method<device_valid, 1>},
                                            {"fault", method<device_fault, 1>},
                                            {"mend", method<device_mend, 1>}};
  return all;
}

}  // namespace cardan
