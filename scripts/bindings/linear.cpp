#include "scripts/bindings/linear.hpp"

#include "core/operators/linear_model.hpp"
#include "core/operators/system_modes.hpp"
#include "core/sim/linear_model_file.hpp"
#include "scripts/bindings/operator_methods.hpp"
#include "scripts/lua/table.hpp"
#include "scripts/mission/examine.hpp"

namespace cardan {
namespace {

void push_texts(lua_State* L, const std::vector<std::string>& texts) {
  lua_createtable(L, static_cast<int>(texts.size()), 0);
  for (std::size_t i = 0; i < texts.size(); ++i) {
    lua_pushstring(L, texts[i].c_str());
    lua_rawseti(L, -2, static_cast<lua_Integer>(i) + 1);
  }
}
/// The table of a model that `make` makes of the argument at index 2; nv: of what it is of.
template <class Make>
int push_linear(lua_State* L, const Model& m, int nv, const operators::OperatingPoint& at, const Make& make) {
  operators::LinearPorts ports;
  std::string file;
  if (!lua_isnoneornil(L, 2)) {
    DiagnosticSink sink;
    LuaTable table(L, 2, "linearize", sink);
    ports.inputs = table.texts("inputs").value_or(std::vector<std::string>());
    ports.outputs = table.texts("outputs").value_or(std::vector<std::string>());
    file = table.text("file").value_or("");
    table.finish();
    sink.throw_if_any();
  }
  LuaHost::charge(L, 100LL * static_cast<std::int64_t>(m.bodies.size() + static_cast<std::size_t>(nv)) * (2 * nv + 1));
  const operators::LinearModel linear = make(at, ports);
  lua_newtable(L);
  if (!file.empty()) {
    const std::filesystem::path path = output_file(L, file);
    write_linear_model(linear, path.string());
    push_path(L, path), set(L, "file");
  }
  const Labels x = to_labels(linear.states), u = to_labels(linear.inputs), y = to_labels(linear.outputs), rates{x.names, {}};
  push_matrix(L, linear.A, rates, x), set(L, "A");
  push_matrix(L, linear.B, rates, u), set(L, "B");
  push_matrix(L, linear.C, y, x), set(L, "C");
  push_matrix(L, linear.D, y, u), set(L, "D");
  push_vector(L, linear.drift, rates), set(L, "drift");
  push_vector(L, linear.u0, u), set(L, "u0");
  push_vector(L, linear.y0, y), set(L, "y0");
  push_texts(L, linear.states.names), set(L, "state_names");
  push_texts(L, linear.states.units), set(L, "state_units");
  push_texts(L, linear.inputs.names), set(L, "input_names");
  push_texts(L, linear.inputs.units), set(L, "input_units");
  push_texts(L, linear.outputs.names), set(L, "output_names");
  push_texts(L, linear.outputs.units), set(L, "output_units");
  push_poles(L, operators::poles(linear.A)), set(L, "poles");
  lua_pushnumber(L, linear.t), set(L, "t");
  return 1;
}

}  // namespace

void push_poles(lua_State* L, const std::vector<operators::Pole>& all) {
  lua_createtable(L, static_cast<int>(all.size()), 0);
  for (std::size_t i = 0; i < all.size(); ++i) {
    lua_createtable(L, 0, 4);
    for (const auto& [key, value] : {std::pair{"re", all[i].value.real()},
                                     {"im", all[i].value.imag()},
                                     {"frequency", all[i].frequency},
                                     {"damping", all[i].damping}}) {
      lua_pushnumber(L, value);
      lua_setfield(L, -2, key);
    }
    lua_rawseti(L, -2, static_cast<lua_Integer>(i) + 1);
  }
}

int linear_model(lua_State* L, const TreeOperators& tree, const OperatingState& at) {
  return push_linear(L, tree.model(), tree.size(Space::hinge), at.point(nullptr),
                     [&](const operators::OperatingPoint& point, const operators::LinearPorts& ports) {
                       return operators::linearize(tree, point, ports);
                     });
}

int push_linear_model(lua_State* L, Scenario& s) {
  if (s.q) expect_away_from_centre(s.model, s.q);
  if (s.model->loops.empty()) return study_of_now(L, s, "linearize", linear_model);
  require_a_state(L, s, "linearize");
  const auto model = s.sim ? s.sim->shared_model() : s.model;
  const OperatingState at = present_state(s);
  return push_linear(L, *model, model->nv, at.point(s.q), [&](const operators::OperatingPoint& point, const operators::LinearPorts& ports) {
    return operators::linearize(*model, point, ports);
  });
}

}  // namespace cardan
