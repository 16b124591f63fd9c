// Spatial operators in scripts: sim:operators() gives the letters at the present state, and they compose as on paper:
//   local s = sim:operators()
//   local tau = s.H * s.phi * s.M * s.phi:star() * s.H:star() * vdot
// Expressions are matrix-free values (core/operators/expression.hpp); vectors and matrices are those of lua_matrix.hpp.
#include "scripts/bindings/bind.hpp"
#include "scripts/bindings/operators.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/units.hpp"
#include "core/operators/components.hpp"
#include "core/operators/expression.hpp"
#include "scripts/lua/table.hpp"

namespace cardan {
namespace {

using soa::Expression;
using soa::Kind;
using soa::Sort;
using soa::Space;
using soa::TreeOperators;

constexpr char kOperators[] = "cardan.operators", kOperator[] = "cardan.operator";

template <class T>
T* object(lua_State* L, int index, const char* type) { return static_cast<T*>(luaL_testudata(L, index, type)); }

Expression& expression(lua_State* L, int index = 1) {
  if (auto* e = object<Expression>(L, index, kOperator)) return *e;
  refuse(L, Code::lua_argument, "operator", "an operator before a colon", describe_value(L, index), "methods are called with a colon: s.phi:star()");
}

int push(lua_State* L, Expression e) {
  LuaHost::charge(L, 10 * e.letters());  // a product or a sum copies the letters of its operands
  push_object<Expression>(L, kOperator, std::move(e));
  return 1;
}
/// Without units where the formula does not say what it gives.
Labels labels(soa::SpaceLabels l, Sort sort) {
  if (sort == Sort::unknown) l.units.clear();
  return to_labels(std::move(l));
}

/// The work of applying an expression once, as steps of the script's budget.
void charge(lua_State* L, const Expression& e, double times = 1.0) {
  const double numbers = 4.0 * e.letters() * (e.tree()->size(Space::body) + e.tree()->size(Space::hinge) + 10);
  LuaHost::charge(L, static_cast<std::int64_t>(std::min(1e15, times * numbers)));
}

int sweep_body(lua_State* L, int arg, const Model& m, const char* what) {
  std::vector<std::string> names;
  for (const UserBody& u : m.user) names.push_back(u.name);
  const std::string name = lua_type(L, arg) == LUA_TSTRING ? lua_tostring(L, arg) : "";
  const int body = m.find_body(name);
  if (name.empty() || body < 0)
    refuse(L, Code::unknown_body, what, fmt::format("a body of the vehicle: {}", fmt::join(names, ", ")), describe_value(L, arg), did_you_mean(name, names));
  const int k = m.user[static_cast<std::size_t>(body)].sweep;
  if (k == 0) refuse(L, Code::unknown_body, what, "a body that can move", in_quotes(name) + ", fixed to the world");
  return k;
}

// ---- operators(): letters and methods ------------------------------------------------------------------------------------------

/// Letters and methods, sorted.
std::vector<std::string> known_names(lua_State* L, int methods) {
  std::vector<std::string> known = {"I", "mass", "omega", "jacobian", "mass_derivative"};
  for (const soa::KindFacts& f : soa::kKinds) known.emplace_back(f.name);
  for (lua_pushnil(L); lua_next(L, methods); lua_pop(L, 1)) known.emplace_back(lua_tostring(L, -2));
  std::sort(known.begin(), known.end());
  return known;
}

int operators_index(lua_State* L) {
  LuaOperators& o = to_operators(L);
  if (lua_type(L, 2) == LUA_TSTRING) {
    const std::string_view name = lua_tostring(L, 2);
    for (std::size_t k = 0; k < std::size(soa::kKinds); ++k)
      if (soa::kKinds[k].name == name) return push(L, Expression::leaf(o.tree, static_cast<Kind>(k)));
    if (name == "I") return push(L, Expression::unit(o.tree));
    if (name == "mass") return push(L, Expression::mass(o.tree));
    const auto leaf = [&](Kind k) { return Expression::leaf(o.tree, k); };
    if (name == "omega")
      return push(L, leaf(Kind::psi).star() * leaf(Kind::H).star() * leaf(Kind::D).inv() * leaf(Kind::H) * leaf(Kind::psi));
    if (name == "jacobian") return push(L, leaf(Kind::B).star() * leaf(Kind::phi).star() * leaf(Kind::H).star());
    if (name == "mass_derivative") {
      const Expression H = leaf(Kind::H), phi = leaf(Kind::phi), M = leaf(Kind::M), dE = leaf(Kind::dE_phi), dH = leaf(Kind::dH), dM = leaf(Kind::dM);
      return push(L, H * phi * (dE * phi * M + dM + M * phi.star() * dE.star()) * phi.star() * H.star() + dH * phi * M * phi.star() * H.star() +
                         H * phi * M * phi.star() * dH.star());
    }
    lua_pushvalue(L, 2);
    if (lua_rawget(L, lua_upvalueindex(1)) != LUA_TNIL) return 1;
    lua_pop(L, 1);
  }
  const std::vector<std::string> known = known_names(L, lua_upvalueindex(1));
  refuse(L, Code::unknown_name, "operators", fmt::format("one of {}", fmt::join(known, ", ")), describe_value(L, 2),
         lua_type(L, 2) == LUA_TSTRING ? did_you_mean(lua_tostring(L, 2), known) : "");
}

int operators_text(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  lua_pushstring(L, fmt::format("operators of {}: {} bodies, hinge space {}, body space {}, {} nodes", o.of, o.tree->bodies().size(),
                                o.tree->size(Space::hinge), o.tree->size(Space::body), o.tree->nodes().size())
                        .c_str());
  return 1;
}

int push_part(lua_State* L, const LuaOperators& o, const std::vector<int>& bodies, std::string of) {
  auto part = std::make_shared<TreeOperators>(o.tree->subgraph(bodies));
  part->articulate();
  push_object<LuaOperators>(L, kOperators, std::move(part), std::move(of), o.at);
  return 1;
}
int subtree(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  const std::vector<int> bodies = o.tree->subtree(sweep_body(L, 2, o.tree->model(), "subtree"));
  return push_part(L, o, bodies, fmt::format("the subtree of {}", lua_tostring(L, 2)));
}
int path(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  const Model& m = o.tree->model();
  const std::vector<int> bodies = o.tree->path(sweep_body(L, 2, m, "path"), sweep_body(L, 3, m, "path"));
  return push_part(L, o, bodies, fmt::format("the path from {} to {}", lua_tostring(L, 2), lua_tostring(L, 3)));
}
int subgraph(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  const std::vector<std::string> names = names_at(L, 2, "subgraph");
  std::vector<int> bodies;
  for (const std::string& name : names) {
    lua_pushstring(L, name.c_str());
    bodies.push_back(sweep_body(L, lua_gettop(L), o.tree->model(), "subgraph"));
    lua_pop(L, 1);
  }
  if (bodies.empty()) refuse(L, Code::lua_argument, "subgraph", "the names of bodies", "none");
  return push_part(L, o, bodies, fmt::format("{}", fmt::join(names, ", ")));
}

/// s:nodes("bus.tip", ...) -> B of these nodes
int nodes(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  return push(L, Expression::nodes(o.tree, nodes_at(L, 2, o.tree->model())));
}

/// s:articulate{free = {"arm.angle", ...}, W = vector}: P, D, G anew.
int articulate(lua_State* L) {
  LuaOperators& o = to_operators(L);
  const int n = o.tree->size(Space::hinge);
  Eigen::VectorXd W;
  std::vector<std::uint8_t> free;
  if (!lua_isnoneornil(L, 2)) {
    if (lua_type(L, 2) != LUA_TTABLE) refuse(L, Code::lua_argument, "articulate", "a table {free = ..., W = ...}", describe_value(L, 2));
    for_each_key(L, 2, [&](int key_at, int value) {
      const std::string key = lua_type(L, key_at) == LUA_TSTRING ? lua_tostring(L, key_at) : "";
      if (key == "W")
        W = finite_vector(L, value, n, "W of articulate");
      else if (key == "free")
        free = component_mask(L, *o.tree, names_at(L, value, "free of articulate"), "free of articulate");
      else
        refuse(L, Code::lua_argument, "articulate", "free, W", describe_value(L, key_at));
    });
  }
  o.tree->articulate({.W = W.size() > 0 ? W.data() : nullptr, .free = free});
  return 0;
}
int operational_space(lua_State* L) {
  to_operators(L).tree->operational_space();
  return 0;
}
/// s:along(u): dH, dE_phi, dM where q moves by N(q) u; u: a vector over v, or the name of a component (of several: their sum).
int along(lua_State* L) {
  LuaOperators& o = to_operators(L);
  Eigen::VectorXd u = Eigen::VectorXd::Zero(o.tree->model().nv);
  if (lua_type(L, 2) == LUA_TSTRING) {
    const std::vector<std::uint8_t> one = component_mask(L, *o.tree, {lua_tostring(L, 2)}, "along");
    for (int v = 0; v < o.tree->model().nv; ++v)
      if (const int place = o.tree->place_of_velocity(v); place >= 0 && one[static_cast<std::size_t>(place)]) u[v] = 1.0;
  } else
    u = finite_vector(L, 2, u.size(), "the direction of along");
  o.tree->along(u.data());
  return 0;
}
int log_det(lua_State* L) {
  lua_pushnumber(L, to_operators(L).tree->log_det());
  return 1;
}
int size(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  const std::string name = lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : "";
  if (name != "hinge" && name != "body" && name != "node") refuse(L, Code::lua_argument, "size", "\"hinge\", \"body\" or \"node\"", describe_value(L, 2));
  lua_pushinteger(L, o.tree->size(name == "hinge" ? Space::hinge : name == "body" ? Space::body : Space::node));
  return 1;
}
/// Names of the numbers of a space, in order.
int names(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  const std::string name = lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : "hinge";
  if (name != "hinge" && name != "body" && name != "node") refuse(L, Code::lua_argument, "names", "\"hinge\", \"body\" or \"node\"", describe_value(L, 2));
  const soa::SpaceLabels l = o.tree->labels(name == "hinge" ? Space::hinge : name == "body" ? Space::body : Space::node, Sort::motion);
  lua_createtable(L, static_cast<int>(l.names.size()), 0);
  for (std::size_t i = 0; i < l.names.size(); ++i) {
    lua_pushstring(L, l.names[i].c_str());
    lua_rawseti(L, -2, static_cast<lua_Integer>(i) + 1);
  }
  return 1;
}

// ---- one operator ------------------------------------------------------------------------------------------------------------------

/// Units of the result of a product with a vector whose own units are known: velocities in place of accelerations give momenta in
/// place of forces.
Labels result_labels(const Expression& e, const Labels& of_vector) {
  Labels out = labels(e.row_labels(), e.gives());
  if (out.units.empty() || of_vector.units.empty() || e.takes() == Sort::unknown) return out;
  const soa::SpaceLabels expected = e.column_labels();
  const auto all = [&](const std::string& more) {
    for (std::size_t i = 0; i < expected.units.size(); ++i)
      if (of_vector.units[i] + more != expected.units[i]) return false;
    return true;
  };
  if (all("")) return out;
  // a factor of s lower: "rad/s" is written for "rad/s^2" times s, "N m s" for "N m" times s
  const bool of_motion = e.takes() == Sort::motion;
  bool lower = true;
  for (std::size_t i = 0; i < expected.units.size(); ++i) lower = lower && (of_motion ? of_vector.units[i] + "^2" == expected.units[i] : of_vector.units[i] == expected.units[i] + " s");
  if (!lower) {
    out.units.clear();
    return out;
  }
  for (std::string& unit : out.units) {
    if (unit.ends_with("/s^2"))
      unit.resize(unit.size() - 2);
    else
      unit += " s";
  }
  return out;
}

int multiply(lua_State* L) {
  auto *a = object<Expression>(L, 1, kOperator), *b = object<Expression>(L, 2, kOperator);
  if (a && b) return push(L, *a * *b);
  if (b && lua_type(L, 1) == LUA_TNUMBER) return push(L, lua_tonumber(L, 1) * *b);
  if (a && lua_type(L, 2) == LUA_TNUMBER) return push(L, lua_tonumber(L, 2) * *a);
  if (a && (is_vector(L, 2) || lua_type(L, 2) == LUA_TTABLE)) {
    charge(L, *a);
    const Eigen::VectorXd x = finite_vector(L, 2, kAnySize, "the vector");
    const Eigen::VectorXd y = a->apply(x);
    push_vector(L, y, result_labels(*a, row_labels(L, 2)));
    return 1;
  }
  if (a && is_matrix(L, 2)) {
    const Eigen::MatrixXd X = to_matrix(L, 2, kAnySize, kAnySize, "the matrix");
    if (!X.allFinite()) refuse(L, Code::not_finite, "the matrix", "finite numbers", "some that are not");
    charge(L, *a, static_cast<double>(X.cols()));
    Eigen::MatrixXd Y(a->rows(), X.cols());
    for (Eigen::Index j = 0; j < X.cols(); ++j) Y.col(j) = a->apply(X.col(j));
    push_matrix(L, Y, labels(a->row_labels(), a->gives()));
    return 1;
  }
  refuse(L, Code::operator_shape, a ? a->text() + " * ..." : "... * " + b->text(), "an operator, a number, a vector or a matrix",
         describe_value(L, a ? 2 : 1));
}
/// Both operands of a sum.
std::pair<Expression&, Expression&> both(lua_State* L, const char* sign) {
  auto *a = object<Expression>(L, 1, kOperator), *b = object<Expression>(L, 2, kOperator);
  if (!a || !b)
    refuse(L, Code::operator_shape, fmt::format("{} {} {}", a ? a->text() : describe_value(L, 1), sign, b ? b->text() : describe_value(L, 2)),
           "two operators", describe_value(L, a ? 2 : 1), "s.I is the identity");
  return {*a, *b};
}
int add(lua_State* L) {
  const auto [a, b] = both(L, "+");
  return push(L, a + b);
}
int subtract(lua_State* L) {
  const auto [a, b] = both(L, "-");
  return push(L, a - b);
}
int negate(lua_State* L) { return push(L, -1.0 * expression(L)); }
int star(lua_State* L) { return push(L, expression(L).star()); }
int inv(lua_State* L) { return push(L, expression(L).inv()); }

int dense(lua_State* L) {
  const Expression& e = expression(L);
  charge(L, e, e.cols());
  push_matrix(L, e.dense(), labels(e.row_labels(), e.gives()), labels(e.column_labels(), e.takes()));
  return 1;
}
int norm(lua_State* L) {
  const Expression& e = expression(L);
  charge(L, e, std::min(2.0 * e.cols(), 200.0));
  lua_pushnumber(L, e.norm());
  return 1;
}
int eig(lua_State* L) {
  const Expression& e = expression(L);
  int is_integer = 0;
  const lua_Integer k = lua_isnoneornil(L, 2) ? e.rows() : lua_tointegerx(L, 2, &is_integer);
  if (!lua_isnoneornil(L, 2) && !is_integer) refuse(L, Code::lua_argument, "eig", "how many eigenvalues", describe_value(L, 2));
  charge(L, e, std::min(2.0 * e.cols(), 20.0 * static_cast<double>(k) + 200.0));
  push_vector(L, e.eigenvalues(static_cast<int>(std::clamp<lua_Integer>(k, 0, 1 << 30))));
  return 1;
}
int rows(lua_State* L) {
  lua_pushinteger(L, expression(L).rows());
  return 1;
}
int cols(lua_State* L) {
  lua_pushinteger(L, expression(L).cols());
  return 1;
}
int formula(lua_State* L) {
  lua_pushstring(L, expression(L).text().c_str());
  return 1;
}
int operator_text(lua_State* L) {
  const Expression& e = expression(L);
  lua_pushstring(L, fmt::format("{}: {}", e.text(), e.shape()).c_str());
  return 1;
}

template <lua_CFunction kFunction>
constexpr lua_CFunction method = operator_method<kFunction>;

const std::vector<luaL_Reg> kOperatorsMethods = {{"subtree", method<subtree>},       {"path", method<path>},   {"subgraph", method<subgraph>},
                                                 {"nodes", method<nodes>},           {"along", method<along>}, {"articulate", method<articulate>},
                                                 {"operational_space", method<operational_space>},
                                                 {"log_det", method<log_det>},       {"size", method<size>},   {"names", method<names>}};
const std::vector<luaL_Reg> kOperatorMethods = {{"star", method<star>}, {"inv", method<inv>},   {"dense", method<dense>}, {"norm", method<norm>},
                                                {"eig", method<eig>},   {"rows", method<rows>}, {"cols", method<cols>},   {"text", method<formula>}};

}  // namespace

LuaOperators& to_operators(lua_State* L) {
  if (auto* o = object<LuaOperators>(L, 1, kOperators)) return *o;
  refuse(L, Code::lua_argument, "operators", "the result of operators() before a colon", describe_value(L, 1), "s = sim:operators(); s:subtree(\"boom\")");
}

Eigen::VectorXd finite_vector(lua_State* L, int index, Eigen::Index size, const char* what) {
  Eigen::VectorXd x = to_vector(L, index, size, what);
  if (!x.allFinite()) refuse(L, Code::not_finite, what, "finite numbers", "some that are not");
  return x;
}

Labels to_labels(soa::SpaceLabels l) { return {std::move(l.names), std::move(l.units)}; }

/// Strings of a table, or the arguments from `first` on.
std::vector<std::string> names_at(lua_State* L, int first, const char* what) {
  std::vector<std::string> names;
  const bool in_table = lua_type(L, first) == LUA_TTABLE;
  const int n = in_table ? static_cast<int>(lua_rawlen(L, first)) : lua_gettop(L) - first + 1;
  for (int i = 0; i < n; ++i) {
    if (in_table)
      lua_rawgeti(L, first, i + 1);
    else
      lua_pushvalue(L, first + i);
    if (lua_type(L, -1) != LUA_TSTRING) refuse(L, Code::lua_argument, what, "names", describe_value(L, -1));
    names.emplace_back(lua_tostring(L, -1));
    lua_pop(L, 1);
  }
  return names;
}

std::vector<int> node_indices(lua_State* L, const std::vector<std::string>& names, const Model& m) {
  std::vector<std::string> known;
  for (const UserNode& n : m.nodes) known.push_back(n.name);
  std::vector<int> out;
  for (const std::string& name : names) {
    const int j = m.find_node(name);
    if (j < 0) refuse(L, Code::unknown_node, "nodes", fmt::format("nodes of the vehicle: {}", fmt::join(known, ", ")), in_quotes(name), did_you_mean(name, known));
    out.push_back(j);
  }
  return out;
}

std::vector<int> components_at(lua_State* L, const Model& m, const std::string& name, const char* what) {
  std::vector<int> found = soa::components_of(m, name);
  if (found.empty())
    refuse(L, Code::unknown_name, what, fmt::format("a component, or a body for all of its hinge: {}", fmt::join(soa::component_names(m), ", ")),
           in_quotes(name), did_you_mean(name, soa::component_names(m)));
  return found;
}

std::vector<std::uint8_t> component_mask(lua_State* L, const TreeOperators& tree, const std::vector<std::string>& names, const char* what) {
  std::vector<std::uint8_t> mask(static_cast<std::size_t>(tree.size(Space::hinge)), 0);
  for (const std::string& name : names) {
    bool takes_part = false;
    for (const int v : components_at(L, tree.model(), name, what))
      if (const int place = tree.place_of_velocity(v); place >= 0) mask[static_cast<std::size_t>(place)] = 1, takes_part = true;
    if (!takes_part)
      refuse(L, Code::unknown_name, what,
             fmt::format("a component of the bodies that take part: {}", fmt::join(tree.labels(Space::hinge, Sort::motion).names, ", ")), in_quotes(name));
  }
  return mask;
}

int at_script_line(lua_State* L, const std::function<int(lua_State*)>& function) {
  try {
    return function(L);
  } catch (const InputError& e) {
    std::vector<Diagnostic> all = e.diagnostics();
    for (Diagnostic& d : all) {
      if (!d.at.mark.file.empty()) continue;
      d.at.mark = LuaHost::caller(L);
      d.stack = LuaHost::traceback(L);
    }
    throw InputError(all);
  }
}

OperatingState present_state(const Scenario& s) {
  const int nv = s.model->nv;
  OperatingState out{.t = s.sim->time(), .v = Eigen::Map<const Eigen::VectorXd>(s.v, nv), .tau = Eigen::VectorXd(nv), .vdot = Eigen::VectorXd::Zero(nv),
                     .wrenches = {s.sim->wrenches().begin(), s.sim->wrenches().end()}, .seed = s.seed};
  for (int i = 0; i < nv; ++i) out.tau[i] = s.sim->force(i);
  if (s.model->has_prescribed()) out.vdot = s.sim->vdot();
  return out;
}

/// The whole tree where the scene is now.
static std::shared_ptr<TreeOperators> tree_of_now(lua_State* L, Scenario& s, const char* what) {
  if (s.in_event_function) refuse(L, Code::lua_argument, what, "coordinates, inside of an event's `when`", what);
  auto tree = std::make_shared<TreeOperators>(s.model);
  tree->at(s.q);
  return tree;
}

int study_of_now(lua_State* L, Scenario& s, const char* what, Study study) {
  const auto tree = tree_of_now(L, s, what);
  return study(L, *tree, present_state(s));
}

int push_operators(lua_State* L, Scenario& s) {
  auto tree = tree_of_now(L, s, "operators");
  const std::string stage = lua_isnoneornil(L, 2) ? "inertia" : lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : "";
  if (stage != "position" && stage != "inertia")
    refuse(L, Code::lua_argument, "operators", "no argument, or the last stage to compute: \"position\", \"inertia\"", describe_value(L, 2));
  if (stage == "inertia") tree->articulate();
  LuaHost::charge(L, 200 * (tree->size(Space::body) + 1));
  push_object<LuaOperators>(L, kOperators, std::move(tree), "the whole tree", std::make_shared<const OperatingState>(present_state(s)));
  return 1;
}

void bind_operators(Scenario& s) {
  s.lua.protect([](lua_State* L) {
    make_handle_type(L, kOperator, kOperatorMethods, method<operator_text>);
    luaL_getmetatable(L, kOperator);
    for (const luaL_Reg& m : std::initializer_list<luaL_Reg>{{"__mul", method<multiply>}, {"__add", method<add>}, {"__sub", method<subtract>},
                                                             {"__unm", method<negate>}, {"__gc", collect<Expression>}}) {
      lua_pushcfunction(L, m.func);
      lua_setfield(L, -2, m.name);
    }
    make_analysis_types(L);
    std::vector<luaL_Reg> methods = kOperatorsMethods;
    methods.insert(methods.end(), analysis_methods().begin(), analysis_methods().end());
    make_handle_type(L, kOperators, methods, method<operators_text>);
    luaL_getmetatable(L, kOperators);
    lua_getfield(L, -1, "__index");  // the table of methods: letters come first
    lua_pushvalue(L, -1);
    lua_pushcclosure(L, method<operators_index>, 1);
    lua_setfield(L, -3, "__index");
    lua_newtable(L);  // what completion offers: methods, and letters
    for (const std::string& name : known_names(L, lua_absindex(L, -2))) {
      lua_pushstring(L, name.c_str());
      lua_pushvalue(L, -1);
      if (lua_rawget(L, -4) == LUA_TNIL) {
        lua_pop(L, 1);
        lua_pushboolean(L, 1);
      }
      lua_rawset(L, -3);
    }
    lua_setfield(L, -3, "__members");
    lua_pop(L, 1);
    lua_pushcfunction(L, collect<LuaOperators>);
    lua_setfield(L, -2, "__gc");
  });
}

}  // namespace cardan
