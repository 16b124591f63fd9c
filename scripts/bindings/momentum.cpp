// Mass properties and momentum, as methods of s = sim:operators().
#include "core/operators/system_properties.hpp"
#include "scripts/bindings/operator_methods.hpp"

namespace cardan {
namespace {

using Eigen::VectorXd;

const Labels kMomentum{{"hx", "hy", "hz", "px", "py", "pz"}, {"N m s", "N m s", "N m s", "N s", "N s", "N s"}};

Labels body_labels(const TreeOperators& tree) {
  Labels out;
  for (const operators::OperatorBody& b : tree.bodies()) out.names.push_back(tree.model().user[static_cast<std::size_t>(b.user)].name);
  return out;
}

int mass_properties(lua_State* L) {
  const operators::MassProperties p = operators::mass_properties(tree_of(L));
  lua_newtable(L);
  set_number(L, "mass", p.mass);
  push_vector(L, p.com, {{"x", "y", "z"}, {"m", "m", "m"}}), set(L, "com");
  push_matrix(L, p.inertia, {{"x", "y", "z"}, {"kg m^2", "kg m^2", "kg m^2"}}), set(L, "inertia");
  return 1;
}
operators::About about_at(lua_State* L, int arg) {
  const std::string word = lua_isnoneornil(L, arg) ? "world" : lua_type(L, arg) == LUA_TSTRING ? lua_tostring(L, arg) : "";
  if (word != "world" && word != "com")
    refuse(L, Code::lua_argument, "momentum", "about \"world\" (default) or \"com\"", describe_value(L, arg));
  return word == "com" ? operators::About::mass_centre : operators::About::world_origin;
}
int momentum(lua_State* L) {
  const TreeOperators& tree = tree_of(L);
  push_vector(L, operators::momentum(tree, about_at(L, 3), hinge_vector(L, 2, tree, "the velocities")), kMomentum);
  return 1;
}
int momentum_matrix(lua_State* L) {
  const TreeOperators& tree = tree_of(L);
  push_matrix(L, operators::momentum_matrix(tree, about_at(L, 2)), kMomentum, velocity_labels_of(tree));
  return 1;
}
int momentum_sharing(lua_State* L) {
  const TreeOperators& tree = tree_of(L);
  const operators::MomentumSharing m = operators::momentum_sharing(tree, hinge_vector(L, 2, tree, "the velocities"));
  lua_newtable(L);
  push_matrix(L, m.bodies, kMomentum, body_labels(tree)), set(L, "bodies");
  push_vector(L, m.total, kMomentum), set(L, "total");
  if (m.angular.size() > 0) push_vector(L, m.angular, body_labels(tree)), set(L, "angular");
  if (m.linear.size() > 0) push_vector(L, m.linear, body_labels(tree)), set(L, "linear");
  return 1;
}
int reflected_inertia(lua_State* L) {
  const TreeOperators& tree = tree_with_Y(L);
  const operators::ReflectedInertia r = operators::reflected_inertia(tree);
  const Labels names = names_alone(tree);
  lua_newtable(L);
  push_vector(L, r.others_locked, names), set(L, "others_locked");
  push_vector(L, r.outboard_free, names), set(L, "outboard_free");
  push_vector(L, r.others_free, names), set(L, "others_free");
  return 1;
}

}  // namespace

const std::vector<luaL_Reg>& momentum_methods() {
  static const std::vector<luaL_Reg> all = {{"mass_properties", placed<mass_properties, 0>},
                                            {"momentum", placed<momentum, 2>},
                                            {"momentum_matrix", placed<momentum_matrix, 1>},
                                            {"momentum_sharing", placed<momentum_sharing, 1>},
                                            {"reflected_inertia", placed<reflected_inertia, 0>}};
  return all;
}

}  // namespace cardan
