// One spatial operator in a script: a matrix-free formula of letters (core/operators/expression.hpp) that composes by + - * and applies to
// vectors and matrices.
#include <fmt/format.h>

#include <algorithm>

#include "core/base/units.hpp"
#include "scripts/bindings/operator_methods.hpp"

namespace cardan {
namespace {

using operators::Expression;

constexpr char kOperator[] = "cardan.operator";

/// Null: something else.
Expression* operator_at(lua_State* L, int index) { return static_cast<Expression*>(luaL_testudata(L, index, kOperator)); }

Expression& expression(lua_State* L, int index = 1) {
  if (auto* e = operator_at(L, index)) return *e;
  refuse(L, Code::lua_argument, "operator", "an operator before a colon", describe_value(L, index),
         "methods are called with a colon: s.phi:star()");
}

/// Without units where the formula does not say what it gives.
Labels labels(operators::SpaceLabels l, Sort sort) {
  if (sort == Sort::unknown) l.units.clear();
  return to_labels(std::move(l));
}

/// The work of applying an expression once, as steps of the script's budget.
void charge(lua_State* L, const Expression& e, double times = 1.0) {
  const double numbers = 4.0 * e.letters() * (e.tree()->size(Space::body) + e.tree()->size(Space::hinge) + 10);
  LuaHost::charge(L, static_cast<std::int64_t>(std::min(1e15, times * numbers)));
}

/// Units of the result of a product with a vector whose own units are known: velocities in place of accelerations give momenta in
/// place of forces.
Labels result_labels(const Expression& e, const Labels& of_vector) {
  Labels out = labels(e.row_labels(), e.gives());
  if (out.units.empty() || of_vector.units.empty() || e.takes() == Sort::unknown) return out;
  const operators::SpaceLabels expected = e.column_labels();
  const auto all = [&](const std::string& more) {
    for (std::size_t i = 0; i < expected.units.size(); ++i)
      if (of_vector.units[i] + more != expected.units[i]) return false;
    return true;
  };
  if (all("")) return out;
  // a factor of s lower: "rad/s" is written for "rad/s^2" times s, "N m s" for "N m" times s
  const bool of_motion = e.takes() == Sort::motion;
  bool lower = true;
  for (std::size_t i = 0; i < expected.units.size(); ++i)
    lower = lower && (of_motion ? of_vector.units[i] + "^2" == expected.units[i] : of_vector.units[i] == expected.units[i] + " s");
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
  auto *a = operator_at(L, 1), *b = operator_at(L, 2);
  if (a && b) return push_operator(L, *a * *b);
  if (b && lua_type(L, 1) == LUA_TNUMBER) return push_operator(L, lua_tonumber(L, 1) * *b);
  if (a && lua_type(L, 2) == LUA_TNUMBER) return push_operator(L, lua_tonumber(L, 2) * *a);
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
  auto *a = operator_at(L, 1), *b = operator_at(L, 2);
  if (!a || !b)
    refuse(L, Code::operator_shape,
           fmt::format("{} {} {}", a ? a->text() : describe_value(L, 1), sign, b ? b->text() : describe_value(L, 2)), "two operators",
           describe_value(L, a ? 2 : 1), "s.I is the identity");
  return {*a, *b};
}
int add(lua_State* L) {
  const auto [a, b] = both(L, "+");
  return push_operator(L, a + b);
}
int subtract(lua_State* L) {
  const auto [a, b] = both(L, "-");
  return push_operator(L, a - b);
}
int negate(lua_State* L) { return push_operator(L, -1.0 * expression(L)); }
int star(lua_State* L) { return push_operator(L, expression(L).star()); }
int inv(lua_State* L) { return push_operator(L, expression(L).inv()); }

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
  const int wanted = static_cast<int>(std::clamp<lua_Integer>(k, -1 << 30, 1 << 30));
  charge(L, e, std::min(2.0 * e.cols(), 20.0 * std::max(wanted, 0) + 200.0));
  push_vector(L, e.eigenvalues(wanted));
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

const std::vector<luaL_Reg> kOperatorMethods = {{"star", placed<star, 0>}, {"inv", placed<inv, 0>},     {"dense", placed<dense, 0>},
                                                {"norm", placed<norm, 0>}, {"eig", placed<eig, 1>},     {"rows", placed<rows, 0>},
                                                {"cols", placed<cols, 0>}, {"text", placed<formula, 0>}};

}  // namespace

int push_operator(lua_State* L, Expression e) {
  LuaHost::charge(L, 10 * e.letters());  // a product or a sum copies the letters of its operands
  push_object<Expression>(L, kOperator, std::move(e));
  return 1;
}

void make_operator_type(lua_State* L) {
  make_type<Expression>(L, kOperator, kOperatorMethods, placed<operator_text>);
  luaL_getmetatable(L, kOperator);
  for (const luaL_Reg& m : std::initializer_list<luaL_Reg>{
           {"__mul", placed<multiply>}, {"__add", placed<add>}, {"__sub", placed<subtract>}, {"__unm", placed<negate>}}) {
    lua_pushcfunction(L, m.func);
    lua_setfield(L, -2, m.name);
  }
  lua_pop(L, 1);
}

}  // namespace cardan
