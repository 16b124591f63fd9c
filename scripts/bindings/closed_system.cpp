// Vehicles with closed loops as one system, in scripts: sim:closed_system(). Formulas: docs/mathematics/linear.md.
#include "core/operators/closed_system.hpp"

#include <fmt/format.h>

#include "scripts/bindings/operator_methods.hpp"
#include "scripts/bindings/studies.hpp"

namespace cardan {
namespace {

using Eigen::VectorXd;

constexpr char kClosed[] = "cardan.closed_system";

struct LuaClosed {
  std::shared_ptr<const Model> model;
  std::shared_ptr<const operators::ClosedSystem> system;
  std::shared_ptr<const OperatingState> at;
  std::vector<double> q;
};
LuaClosed& to_closed(lua_State* L) {
  if (auto* c = static_cast<LuaClosed*>(luaL_testudata(L, 1, kClosed))) return *c;
  refuse(L, Code::lua_argument, "closed_system", "the result of closed_system() before a colon", describe_value(L, 1));
}

int closed_mobility(lua_State* L) {
  lua_pushinteger(L, to_closed(L).system->mobility());
  return 1;
}
int closed_independent(lua_State* L) {
  const operators::ClosedSystem& system = *to_closed(L).system;
  const std::vector<std::string> names = system.tree().labels(Space::hinge, Sort::motion).names;
  lua_newtable(L);
  lua_Integer i = 0;
  for (const int v : system.freedom().independent) {
    lua_pushstring(L, names[static_cast<std::size_t>(system.tree().place_of_velocity(v))].c_str());
    lua_rawseti(L, -2, ++i);
  }
  return 1;
}
int closed_motions(lua_State* L) {
  const operators::ClosedSystem& system = *to_closed(L).system;
  push_matrix(L, system.motions(), names_alone(system.tree()), {});
  return 1;
}
int closed_respond(lua_State* L) {
  const operators::ClosedSystem& system = *to_closed(L).system;
  push_vector(L, system.respond(hinge_vector(L, 2, system.tree(), "the forces")), hinge_labels(system.tree(), Sort::motion));
  return 1;
}
int closed_task(lua_State* L) {
  const auto& system = to_closed(L).system;
  return push_task(L, {system, &system->tree()}, system);
}
/// closed:inverse_dynamics(vdot, {components}): beside the forces of now.
int closed_inverse_dynamics(lua_State* L) {
  const LuaClosed& c = to_closed(L);
  const TreeOperators& tree = c.system->tree();
  const VectorXd vdot = tree.to_model(hinge_vector(L, 2, tree, "the accelerations"));
  const std::vector<std::uint8_t> marks = component_mask(L, tree, names_at(L, 3, "actuated"), "actuated");
  std::vector<std::uint8_t> actuated(static_cast<std::size_t>(c.model->nv));
  for (int v = 0; v < c.model->nv; ++v) actuated[static_cast<std::size_t>(v)] = marks[static_cast<std::size_t>(tree.place_of_velocity(v))];
  LuaHost::charge(L, 2000LL * static_cast<std::int64_t>(c.model->bodies.size()) * (c.system->mobility() + 1));
  const operators::ClosedForces found = operators::closed_inverse_dynamics(c.model, c.at->inputs(c.q.data()), vdot, actuated);
  const Labels forces = hinge_labels(tree, Sort::force);
  lua_newtable(L);
  push_vector(L, tree.from_model(found.tau), forces), set(L, "tau");
  push_vector(L, tree.from_model(found.missing), forces), set(L, "missing");
  return 1;
}
int closed_log_det(lua_State* L) {
  lua_pushnumber(L, to_closed(L).system->log_det());
  return 1;
}
/// Of the independent components that are free, in their order.
int closed_log_det_gradient(lua_State* L) {
  const operators::ClosedSystem& system = *to_closed(L).system;
  const std::int64_t m = system.mobility();
  LuaHost::charge(L, 200LL * static_cast<std::int64_t>(system.tree().model().bodies.size()) * m * (m + 1));
  push_vector(L, system.log_det_gradient());
  return 1;
}
int closed_nu(lua_State* L) {
  const operators::ClosedSystem& system = *to_closed(L).system;
  push_vector(L, system.nu(hinge_vector(L, 2, system.tree(), "v")));
  return 1;
}
int closed_velocity(lua_State* L) {
  const operators::ClosedSystem& system = *to_closed(L).system;
  push_vector(L, system.velocity(finite_vector(L, 2, system.mobility(), "nu")), velocity_labels_of(system.tree()));
  return 1;
}
int closed_eps(lua_State* L) {
  const operators::ClosedSystem& system = *to_closed(L).system;
  push_vector(L, system.eps(hinge_vector(L, 2, system.tree(), "the forces")));
  return 1;
}
int closed_coriolis(lua_State* L) {
  const operators::ClosedSystem& system = *to_closed(L).system;
  const std::int64_t m = system.mobility();
  LuaHost::charge(L, 2000LL * static_cast<std::int64_t>(system.tree().model().bodies.size()) * (m + 2));
  push_vector(L, system.coriolis(finite_vector(L, 2, m, "nu")));
  return 1;
}
/// The operators of the tree without its loops.
int closed_open_tree(lua_State* L) {
  const LuaClosed& c = to_closed(L);
  auto tree = std::make_shared<TreeOperators>(c.system->tree().model_pointer());
  tree->at(c.q.data());
  push_tree(L, std::move(tree), "the open tree", c.at);
  return 1;
}
int closed_text(lua_State* L) {
  const operators::ClosedSystem& system = *to_closed(L).system;
  lua_pushstring(L, fmt::format("closed system: {} ways to move of {}", system.mobility(), system.tree().size(Space::hinge)).c_str());
  return 1;
}

const std::vector<luaL_Reg> kClosedMethods = {{"mobility", placed<closed_mobility, 0>},
                                              {"independent", placed<closed_independent, 0>},
                                              {"motions", placed<closed_motions, 0>},
                                              {"respond", placed<closed_respond, 1>},
                                              {"task", placed<closed_task, 1>},
                                              {"inverse_dynamics", placed<closed_inverse_dynamics, 2>},
                                              {"log_det", placed<closed_log_det, 0>},
                                              {"log_det_gradient", placed<closed_log_det_gradient, 0>},
                                              {"nu", placed<closed_nu, 1>},
                                              {"velocity", placed<closed_velocity, 1>},
                                              {"eps", placed<closed_eps, 1>},
                                              {"coriolis", placed<closed_coriolis, 1>},
                                              {"open_tree", placed<closed_open_tree, 0>}};

}  // namespace

int push_closed_system(lua_State* L, Scenario& s) {
  require_a_state(L, s, "closed_system");
  const std::shared_ptr<const Model> model = s.sim ? s.sim->shared_model() : s.model;
  LuaHost::charge(L, 100LL * static_cast<std::int64_t>(model->bodies.size()) * (model->nv + 1));
  push_object<LuaClosed>(L, kClosed, model,
                         std::make_shared<const operators::ClosedSystem>(model, s.q, s.sim ? s.sim->drives().data() : nullptr),
                         std::make_shared<const OperatingState>(present_state(s)), std::vector<double>(s.q, s.q + model->nq));
  return 1;
}

void make_closed_system_type(lua_State* L) { make_type<LuaClosed>(L, kClosed, kClosedMethods, placed<closed_text>); }

}  // namespace cardan
