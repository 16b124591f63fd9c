// log det M and diagonalised velocities, as methods of s = sim:operators().
#include <fmt/format.h>

#include "core/operators/diagonalised.hpp"
#include "core/operators/log_det.hpp"
#include "scripts/bindings/operator_methods.hpp"

namespace cardan {
namespace {

using Eigen::VectorXd;

constexpr char kDiagonalised[] = "cardan.diagonalised";

int log_det_gradient(lua_State* L) {
  const TreeOperators& tree = tree_with_Y(L);
  LuaHost::charge(L, 100LL * operators::log_det_passes(tree) * tree.size(Space::body));
  push_vector(L, operators::log_det_gradient(tree), names_alone(tree));
  return 1;
}

struct LuaDiagonalised {
  std::shared_ptr<TreeOperators> tree;
  std::unique_ptr<operators::Diagonalised> system;
};
LuaDiagonalised& to_diagonalised(lua_State* L) {
  if (auto* d = static_cast<LuaDiagonalised*>(luaL_testudata(L, 1, kDiagonalised))) return *d;
  refuse(L, Code::lua_argument, "diagonalised", "the result of s:diagonalised() before a colon", describe_value(L, 1));
}
/// s:diagonalised("normalised" or "rates")
int diagonalised(lua_State* L) {
  const std::shared_ptr<TreeOperators>& tree = shared_tree_of(L);
  const std::string form = lua_isnoneornil(L, 2) ? "normalised" : lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : "";
  if (form != "normalised" && form != "rates")
    refuse(L, Code::lua_argument, "diagonalised", "\"normalised\" (default) or \"rates\"", describe_value(L, 2));
  tree->require(operators::Kind::D);
  push_object<LuaDiagonalised>(
      L, kDiagonalised, tree,
      std::make_unique<operators::Diagonalised>(
          *tree, form == "rates" ? operators::Diagonalised::Form::rates : operators::Diagonalised::Form::normalised));
  return 1;
}
int nu_of(lua_State* L) {
  const LuaDiagonalised& d = to_diagonalised(L);
  push_vector(L, d.system->from_velocity(hinge_vector(L, 2, *d.tree, "the velocities")), names_alone(*d.tree));
  return 1;
}
int velocity_of(lua_State* L) {
  const LuaDiagonalised& d = to_diagonalised(L);
  VectorXd v = VectorXd::Zero(d.tree->size(Space::hinge));
  d.system->to_velocity(hinge_vector(L, 2, *d.tree, "nu"), v);
  push_vector(L, v, velocity_labels_of(*d.tree));
  return 1;
}
int eps_of(lua_State* L) {
  const LuaDiagonalised& d = to_diagonalised(L);
  push_vector(L, d.system->eps(hinge_vector(L, 2, *d.tree, "the forces")), names_alone(*d.tree));
  return 1;
}
int coriolis_of(lua_State* L) {
  const LuaDiagonalised& d = to_diagonalised(L);
  push_vector(L, d.system->coriolis(hinge_vector(L, 2, *d.tree, "the velocities")), names_alone(*d.tree));
  return 1;
}
int diagonalised_text(lua_State* L) {
  lua_pushstring(L, fmt::format("diagonalised velocities of {} components", to_diagonalised(L).tree->size(Space::hinge)).c_str());
  return 1;
}

const std::vector<luaL_Reg> kDiagonalisedMethods = {
    {"nu", placed<nu_of, 1>}, {"velocity", placed<velocity_of, 1>}, {"eps", placed<eps_of, 1>}, {"coriolis", placed<coriolis_of, 1>}};

}  // namespace

const std::vector<luaL_Reg>& diagonalised_methods() {
  static const std::vector<luaL_Reg> all = {{"log_det_gradient", placed<log_det_gradient, 0>}, {"diagonalised", placed<diagonalised, 1>}};
  return all;
}

void make_diagonalised_type(lua_State* L) { make_type<LuaDiagonalised>(L, kDiagonalised, kDiagonalisedMethods, placed<diagonalised_text>); }

}  // namespace cardan
