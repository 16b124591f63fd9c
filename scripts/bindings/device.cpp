// A device: sat:device "wheel_x".
#include <fmt/format.h>

#include "core/base/units.hpp"
#include "scripts/bindings/handle.hpp"

namespace cardan {
namespace {

const Device& device_of(const Handle& h) {
  const Scenario& s = *h.scenario;
  return s.model->devices.all[static_cast<std::size_t>(s.sim->now().device[static_cast<std::size_t>(h.index)])];
}

/// Where the number that argument 2 names stands: among inputs, outputs, states, marks, which begin at `first`; refused if there is none.
struct Place {
  enum class What { input, output, state, mark } what;
  int index;  // of the model
};
Place place(lua_State* L, const Handle& h, std::initializer_list<Place::What> of) {
  const Device& d = device_of(h);
  const std::string wanted = lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : "";
  std::vector<std::string> names;
  int in = d.in, out = d.out;
  for (const Place::What what : of) {
    const bool states = what == Place::What::state || what == Place::What::mark;
    const cardan_state_desc* all = what == Place::What::state ? d.family->states : d.family->marks;
    const std::uint32_t n = !states ? d.family->n_ports : what == Place::What::state ? d.family->n_states : d.family->n_marks;
    for (std::uint32_t i = 0; i < n; ++i) {
      if (states) {
        if (wanted == all[i].name) return {what, (what == Place::What::state ? d.z : d.mark) + static_cast<int>(i)};
        names.emplace_back(all[i].name);
        continue;
      }
      const cardan_port_desc& port = d.family->ports[i];
      if ((port.kind == CARDAN_PORT_IN) != (what == Place::What::input)) continue;
      int& index = what == Place::What::input ? in : out;
      if (wanted == port.name) return {what, index};
      names.emplace_back(port.name);
      ++index;
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
  const int i = place(L, h, {Place::What::input}).index;
  if (!s.model->devices.is_commanded(i))
    refuse(L, Code::lua_argument, fmt::format("{} of device {}", lua_tostring(L, 2), d.name), "an input that is not connected",
           "one that another device gives", "devices." + d.name + ".inputs of the vehicle");
  s.sim->set_device_input(i, command(L, 3, s, "an input of device", d.name));
  return 0;
}

int device_get(lua_State* L) {
  const Handle& h = self<Kind::device>(L);
  Scenario& s = *h.scenario;
  expect_state(L, s, "a number of a device");
  using What = Place::What;
  const Place p = place(L, h, {What::output, What::input, What::state, What::mark});
  s.sim->observe();
  lua_pushnumber(L, p.what == What::output  ? s.sim->device_output(p.index)
                    : p.what == What::input ? s.sim->device_input(p.index)
                    : p.what == What::state ? s.sim->state().z[p.index]
                                            : s.sim->state().marks[p.index]);
  return 1;
}

}  // namespace

const std::vector<luaL_Reg>& device_methods() {
  static const std::vector<luaL_Reg> all = {{"set", method<device_set>}, {"get", method<device_get>}};
  return all;
}

}  // namespace cardan
