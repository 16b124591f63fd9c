// A node, sat:node "bus.camera", and a load on it.
#include <algorithm>

#include "scripts/bindings/handle.hpp"
#include "scripts/lua/table.hpp"

namespace cardan {
namespace {

NodeState node_state(lua_State* L, const Handle& h, const char* what) {
  expect_state(L, *h.scenario, what);
  Simulation& sim = *h.scenario->sim;
  return sim.observe().node(sim.now().node[static_cast<std::size_t>(h.index)]);
}
int node_position(lua_State* L) { return push3(L, node_state(L, self<Kind::node>(L), "the position of a node").position); }
int node_attitude(lua_State* L) { return push_quaternion(L, node_state(L, self<Kind::node>(L), "the attitude of a node").R_WN); }
int node_rate(lua_State* L) { return push3(L, node_state(L, self<Kind::node>(L), "the rate of a node").velocity.head<3>()); }
int node_velocity(lua_State* L) {
  const NodeState n = node_state(L, self<Kind::node>(L), "the velocity of a node");
  return push3(L, n.R_WN * n.velocity.tail<3>());
}
int node_acceleration(lua_State* L) {
  const NodeState n = node_state(L, self<Kind::node>(L), "the acceleration of a node");
  return push3(L, n.R_WN * n.acceleration.tail<3>());
}

int node_specific_force(lua_State* L) {
  return push3(L, node_state(L, self<Kind::node>(L), "the specific force at a node").specific_force);
}
int node_angular_acceleration(lua_State* L) {
  return push3(L, node_state(L, self<Kind::node>(L), "the acceleration of a node").acceleration.head<3>());
}

int node_load(lua_State* L) {
  const Handle& h = self<Kind::node>(L);
  Scenario& s = *h.scenario;
  expect_setup(L, s, "load", true);
  lua_settop(L, 2);
  if (lua_isnil(L, 2)) {
    lua_newtable(L);
    lua_replace(L, 2);
  }
  DiagnosticSink sink;
  LuaTable t(L, 2, "load", sink);
  const bool world_axes = t.choice("axes", {"node", "world"}).value_or("node") == "world";
  t.finish();
  sink.throw_if_any();
  s.loads.push_back({h.index, world_axes});
  s.use_model(compile(s.described(), s.registry, s.compile_options()));  // its own words: which initial values it gives
  push_handle(L, Kind::load, static_cast<int>(s.loads.size()) - 1, s);
  return 1;
}

int load_set(lua_State* L) {
  const Handle& h = self<Kind::load>(L);
  Scenario& s = *h.scenario;
  expect_state(L, s, "a command");
  const int id = s.loads[static_cast<std::size_t>(h.index)].node;
  const std::string& node = s.model->nodes[static_cast<std::size_t>(s.sim->now().node[static_cast<std::size_t>(id)])].name;
  double x[6];
  for (int i = 0; i < 6; ++i) x[i] = command(L, i + 2, s, "load on node", node);
  s.sim->set_wrench(h.index, {{x[0], x[1], x[2]}, {x[3], x[4], x[5]}});
  return 0;
}

}  // namespace

const std::vector<luaL_Reg>& node_methods() {
  static const std::vector<luaL_Reg> all = {{"position", method<node_position, 0>},
                                            {"attitude", method<node_attitude, 0>},
                                            {"rate", method<node_rate, 0>},
                                            {"velocity", method<node_velocity, 0>},
                                            {"acceleration", method<node_acceleration, 0>},
                                            {"angular_acceleration", method<node_angular_acceleration, 0>},
                                            {"specific_force", method<node_specific_force, 0>},
                                            {"load", method<node_load, 1>}};
  return all;
}

const std::vector<luaL_Reg>& load_methods() {
  static const std::vector<luaL_Reg> all = {{"set", method<load_set, 6>}};
  return all;
}

}  // namespace cardan
