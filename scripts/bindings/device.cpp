// A device: sat:device "wheel_x".
#include <fmt/format.h>

#include <algorithm>

#include "core/abi/port_vectors.hpp"
#include "core/base/units.hpp"
#include "scripts/bindings/handle.hpp"

namespace cardan {
namespace {

const Device& device_of(const Handle& h) {
  const Scenario& s = *h.scenario;
  return s.model->devices.all[static_cast<std::size_t>(s.sim->now().device[static_cast<std::size_t>(h.index)])];
}

/// Where what argument 2 names stands: a number among inputs, outputs, states, marks, or a vector of ports; refused if there is none.
struct Place {
  enum class What { input, output, state, mark } what;
  int index;       // of the model
  int size = 0;    // of a vector; 0: it is a number
  int valid = -1;  // which output says whether it holds; -1: it always does
};
Place place(lua_State* L, const Handle& h, std::initializer_list<Place::What> of) {
  const Device& d = device_of(h);
  const std::string wanted = lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : "";
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
  refuse(L, Code::unknown_name, "device " + d.name,
         names.empty() ? fmt::format("nothing: a {} has no such numbers", d.family->type) : fmt::format("one of: {}", listed(names)),
         lua_type(L, 2) == LUA_TSTRING ? in_quotes(wanted) : describe_value(L, 2), did_you_mean(wanted, names));
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
    s.sim->set_device_input(to.index, command(L, 3, s, "an input of device", d.name));
    return 0;
  }
  if (lua_type(L, 3) != LUA_TTABLE || lua_rawlen(L, 3) != static_cast<lua_Unsigned>(to.size))
    refuse(L, Code::lua_argument, fmt::format("{} of device {}", lua_tostring(L, 2), d.name), fmt::format("a list of {} numbers", to.size),
           describe_value(L, 3));
  std::vector<double> all;  // all of them, or none
  for (int i = 0; i < to.size; ++i) {
    lua_rawgeti(L, 3, i + 1);
    all.push_back(command(L, lua_gettop(L), s, "an input of device", d.name));
  }
  for (int i = 0; i < to.size; ++i) s.sim->set_device_input(to.index + i, all[static_cast<std::size_t>(i)]);
  return 0;
}

int device_get(lua_State* L) {
  const Handle& h = self<Kind::device>(L);
  Scenario& s = *h.scenario;
  expect_state(L, s, "a number of a device");
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

}  // namespace

const std::vector<luaL_Reg>& device_methods() {
  static const std::vector<luaL_Reg> all = {{"set", method<device_set>}, {"get", method<device_get>}, {"valid", method<device_valid>}};
  return all;
}

}  // namespace cardan
