// The modes of a body: sat:modes "wing_left".
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "scripts/bindings/handle.hpp"

namespace cardan {
namespace {

int mode(lua_State* L, const UserBody& u) {
  int is_integer = 0;
  const lua_Integer i = lua_tointegerx(L, 2, &is_integer);
  if (!is_integer || i < 1 || i > u.n_modes)
    refuse(L, Code::unknown_name, "modes of " + u.name, fmt::format("a mode: 1 to {}", u.n_modes), describe_value(L, 2));
  return static_cast<int>(i) - 1;
}
int modes_eta(lua_State* L) {
  const Handle& h = self<Kind::modes>(L);
  lua_pushnumber(L, h.scenario->q[h.user().eta + mode(L, h.user())]);
  return 1;
}
int modes_etadot(lua_State* L) {
  const Handle& h = self<Kind::modes>(L);
  lua_pushnumber(L, h.scenario->v[h.user().etadot + mode(L, h.user())]);
  return 1;
}
int modes_count(lua_State* L) {
  lua_pushinteger(L, self<Kind::modes>(L).user().n_modes);
  return 1;
}
int modes_frequency(lua_State* L) {
  const Handle& h = self<Kind::modes>(L);
  const int j = mode(L, h.user());
  const SystemSpec& spec = *h.scenario->model->spec;
  const ModalData& d = *spec.bodies[static_cast<std::size_t>(h.index)].modal;
  lua_pushnumber(L, std::sqrt(d.K(j, j) / d.integrals.I6(j, j)) / (2.0 * std::numbers::pi));
  return 1;
}

}  // namespace

const std::vector<luaL_Reg>& modes_methods() {
  static const std::vector<luaL_Reg> all = {{"eta", method<modes_eta, 1>},
                                            {"etadot", method<modes_etadot, 1>},
                                            {"count", method<modes_count, 0>},
                                            {"frequency", method<modes_frequency, 1>}};
  return all;
}

}  // namespace cardan
