// A body: sat:body "bus".
#include "scripts/bindings/handle.hpp"

namespace cardan {
namespace {

/// A body whose own frame hangs on the world frame by a quaternion hinge: attitude and rate are coordinates.
bool is_direct(const UserBody& u) {
  const auto is_identity = [](const Pose<double>& p) { return to_eigen(p.R) == Eigen::Matrix3d::Identity(); };
  return u.parent < 0 && u.has_attitude() && is_identity(u.onode) && is_identity(u.pnode);
}

NodeState state_of(lua_State* L, Scenario& s, const std::string& node, const char* what) {
  expect_state(L, s, what);
  return s.sim->observe().node(s.model->find_node(node));
}
NodeState body_state(lua_State* L, Handle& h, const char* what) { return state_of(L, *h.scenario, h.user().name, what); }

int body_attitude(lua_State* L) {
  Handle& h = self<Kind::body>(L);
  const UserBody& u = h.user();
  if (!is_direct(u)) return push_quaternion(L, body_state(L, h, "the attitude of a body").R_WN);
  for (int i = 0; i < 4; ++i) lua_pushnumber(L, h.scenario->q[u.q + i]);
  return 4;
}
int body_rate(lua_State* L) {
  Handle& h = self<Kind::body>(L);
  const UserBody& u = h.user();
  if (!is_direct(u)) return push3(L, body_state(L, h, "the rate of a body").velocity.head<3>());
  for (int i = 0; i < 3; ++i) lua_pushnumber(L, h.scenario->v[u.v + i]);
  return 3;
}
int body_position(lua_State* L) { return push3(L, body_state(L, self<Kind::body>(L), "the position of a body").position); }
int body_velocity(lua_State* L) {
  const NodeState n = body_state(L, self<Kind::body>(L), "the velocity of a body");
  return push3(L, n.R_WN * n.velocity.tail<3>());
}
int body_mass(lua_State* L) {
  lua_pushnumber(L, self<Kind::body>(L).user().mass);
  return 1;
}

}  // namespace

const std::vector<luaL_Reg>& body_methods() {
  static const std::vector<luaL_Reg> all = {{"attitude", method<body_attitude, 0>},
                                            {"rate", method<body_rate, 0>},
                                            {"position", method<body_position, 0>},
                                            {"velocity", method<body_velocity, 0>},
                                            {"mass", method<body_mass, 0>}};
  return all;
}

}  // namespace cardan
