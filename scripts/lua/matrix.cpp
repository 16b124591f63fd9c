#include "scripts/lua/matrix.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <memory>
#include <new>
#include <span>

#include "core/base/poll.hpp"
#include "core/base/units.hpp"
#include "core/base/utf8.hpp"
#include "core/io/hdf5_file.hpp"
#include "core/linalg/dense.hpp"
#include "scripts/lua/function.hpp"
#include "scripts/lua/inspect.hpp"

namespace cardan {
namespace {

using Index = Eigen::Index;
using SharedLabels = std::shared_ptr<const Labels>;  // null: none

constexpr char kVector[] = "cardan.vector", kMatrix[] = "cardan.matrix";
constexpr Index kShownRows = 40, kShownColumns = 12;
constexpr Index kColumnsAtOnce = 64;  // of a product, between two looks at the person's wish to interrupt
constexpr double kPerStep = 16.0;     // operations in the time of one step, 3e9 a second
constexpr double kLevelTwo = 4.0;     // slower where each number is used once, as in a tridiagonalisation

/// The userdata: this, then rows * cols numbers, column after column. A vector is one column.
struct Block {
  Index rows, cols;
  bool is_vector;
  bool is_row;  // read from a matrix: a copy, so that setting its entries would be lost
  SharedLabels row_labels, column_labels;

  Index size() const { return rows * cols; }
  double* data() { return reinterpret_cast<double*>(this + 1); }
  Eigen::Map<Eigen::MatrixXd> map() { return {data(), rows, cols}; }
  /// A copy where Eigen wants its numbers: what it computes from there does not depend on where Lua put ours.
  Eigen::MatrixXd copy() { return map(); }
};
static_assert(sizeof(Block) % alignof(double) == 0);

void charge_operations(lua_State* L, double operations) {
  LuaHost::charge(L, static_cast<std::int64_t>(std::min(operations / kPerStep, 1e18)));
}

[[noreturn]] void misfit(lua_State* L, std::string where, std::string expected, std::string got, std::string hint = {}) {
  refuse(L, Code::lua_argument, std::move(where), std::move(expected), std::move(got), std::move(hint));
}

Block* block_at(lua_State* L, int index) {
  void* block = luaL_testudata(L, index, kVector);
  return static_cast<Block*>(block ? block : luaL_testudata(L, index, kMatrix));
}

/// A name beside the numbers of a list, which nobody would read.
void expect_no_names(lua_State* L, int index, const std::string& what, const std::string& wanted) {
  if (count_keys(L, index) > lua_rawlen(L, index)) misfit(L, what, wanted, "a table with other keys than 1, 2, ...");
}

std::string shape(const Block& b) {
  return b.is_vector ? fmt::format("vector of {}", b.rows) : fmt::format("matrix {}x{}", b.rows, b.cols);
}
std::string shape_at(lua_State* L, int index) {
  const Block* b = block_at(L, index);
  return b ? shape(*b) : describe_value(L, index);
}

/// The object a method was called on.
Block& self(lua_State* L) {
  if (Block* b = block_at(L, 1)) return *b;
  misfit(L, "vector, matrix", "a vector or a matrix before a colon", describe_value(L, 1), "methods are called with a colon: A:t()");
}
Block& self_matrix(lua_State* L, const char* method) {
  Block& b = self(L);
  if (b.is_vector) misfit(L, method, "a matrix before the colon", "a " + shape(b));
  return b;
}

SharedLabels shared(Labels labels, Index n) {
  for (const auto* list : {&labels.names, &labels.units})
    if (!list->empty() && static_cast<Index>(list->size()) != n) throw std::invalid_argument("Labels: one per entry, or none");
  if (labels.names.empty() && labels.units.empty()) return nullptr;
  return std::make_shared<const Labels>(std::move(labels));
}

Block& push_block(lua_State* L, bool is_vector, Index rows, Index cols, SharedLabels row_labels, SharedLabels column_labels) {
  LuaHost::charge(L, rows * cols / 8);
  const std::size_t bytes = sizeof(Block) + static_cast<std::size_t>(rows * cols) * sizeof(double);
  auto* b = new (lua_newuserdatauv(L, bytes, 0)) Block{rows, cols, is_vector, false, std::move(row_labels), std::move(column_labels)};
  luaL_setmetatable(L, is_vector ? kVector : kMatrix);
  return *b;
}
Block& push_like(lua_State* L, const Block& b) { return push_block(L, b.is_vector, b.rows, b.cols, b.row_labels, b.column_labels); }

/// Of a sum: those of both where they agree, or of the one that has some.
SharedLabels merged(const SharedLabels& a, const SharedLabels& b) {
  if (!a || !b) return a ? a : b;
  return *a == *b ? a : nullptr;
}

// ---- arithmetic ----

template <class F>
int elementwise(lua_State* L, const char* word, F&& f) {
  Block *a = block_at(L, 1), *b = block_at(L, 2);
  if (!a || !b || a->is_vector != b->is_vector || a->rows != b->rows || a->cols != b->cols)
    misfit(L, fmt::format("{} {} {}", shape_at(L, 1), word, shape_at(L, 2)), "two of the same shape",
           fmt::format("{} and {}", shape_at(L, 1), shape_at(L, 2)));
  Block& out =
      push_block(L, a->is_vector, a->rows, a->cols, merged(a->row_labels, b->row_labels), merged(a->column_labels, b->column_labels));
  std::transform(a->data(), a->data() + a->size(), b->data(), out.data(), f);
  return 1;
}
int add(lua_State* L) {
  return elementwise(L, "plus", [](double x, double y) { return x + y; });
}
int subtract(lua_State* L) {
  return elementwise(L, "minus", [](double x, double y) { return x - y; });
}

template <class F>
int each(lua_State* L, Block& b, F&& f) {
  Block& out = push_like(L, b);
  std::transform(b.data(), b.data() + b.size(), out.data(), f);
  return 1;
}
int negate(lua_State* L) {
  return each(L, self(L), [](double x) { return -x; });
}

int multiply(lua_State* L) {
  Block *a = block_at(L, 1), *b = block_at(L, 2);
  if (a && !b && lua_type(L, 2) == LUA_TNUMBER) return each(L, *a, [k = lua_tonumber(L, 2)](double x) { return x * k; });
  if (!a && b && lua_type(L, 1) == LUA_TNUMBER) return each(L, *b, [k = lua_tonumber(L, 1)](double x) { return k * x; });
  if (!a || !b || a->is_vector || a->cols != b->rows) {
    const std::string left = shape_at(L, 1), right = shape_at(L, 2);
    const std::string expected = !a || a->is_vector
                                     ? "a number or a matrix on the left"
                                     : fmt::format("a number, a vector of {} or a matrix of {} rows on the right", a->cols, a->cols);
    misfit(L, fmt::format("{} times {}", left, right), expected, fmt::format("{} and {}", left, right),
           a && b && a->is_vector ? "x:dot(y), or x:t() * A"
           : !a || !b             ? "vector{1, 2} makes a vector of a table"
                                  : "");
  }
  charge_operations(L, 2.0 * static_cast<double>(a->size()) * static_cast<double>(b->cols));
  Block& out = push_block(L, b->is_vector, a->rows, b->cols, a->row_labels, b->is_vector ? nullptr : b->column_labels);
  const Eigen::MatrixXd left = a->copy(), right = b->copy();
  Eigen::MatrixXd product(left.rows(), right.cols());
  for (Index j = 0; j < right.cols(); j += kColumnsAtOnce) {
    Poll::now();
    const Index n = std::min(kColumnsAtOnce, right.cols() - j);
    product.middleCols(j, n).noalias() = left * right.middleCols(j, n);
  }
  out.map() = product;
  return 1;
}

int divide(lua_State* L) {
  Block* a = block_at(L, 1);
  if (!a || lua_type(L, 2) != LUA_TNUMBER)
    misfit(L, fmt::format("{} divided by {}", shape_at(L, 1), shape_at(L, 2)), "a number on the right", shape_at(L, 2),
           "A:solve(b) is A^-1 b");
  return each(L, *a, [k = lua_tonumber(L, 2)](double x) { return x / k; });
}

int is_equal(lua_State* L) {
  Block *a = block_at(L, 1), *b = block_at(L, 2);
  lua_pushboolean(L, a && b && a->is_vector == b->is_vector && a->rows == b->rows && a->cols == b->cols &&
                         std::equal(a->data(), a->data() + a->size(), b->data()));
  return 1;
}

int transpose(lua_State* L) {
  Block& b = self(L);
  push_block(L, false, b.cols, b.rows, b.column_labels, b.row_labels).map() = b.map().transpose();
  return 1;
}

int dot(lua_State* L) {
  Block &a = self(L), *b = block_at(L, 2);
  if (!a.is_vector || !b || !b->is_vector || a.rows != b->rows)
    misfit(L, fmt::format("{} dot {}", shape(a), shape_at(L, 2)), "two vectors of one length",
           fmt::format("{} and {}", shape(a), shape_at(L, 2)));
  LuaHost::charge(L, a.rows / 4);
  double sum = 0.0;
  for (Index i = 0; i < a.rows; ++i) sum += a.data()[i] * b->data()[i];
  lua_pushnumber(L, sum);
  return 1;
}

double largest(Block& b) {
  double m = 0.0;
  for (Index i = 0; i < b.size(); ++i) m = std::isnan(b.data()[i]) ? b.data()[i] : std::max(m, std::abs(b.data()[i]));
  return m;
}
int max_abs(lua_State* L) {
  lua_pushnumber(L, largest(self(L)));
  return 1;
}

/// The 2-norm: of a matrix its largest singular value, the root of the largest eigenvalue of A* A (or A A*).
int norm(lua_State* L) {
  Block& b = self(L);
  const double m = largest(b);
  if (!std::isfinite(m) || m == 0.0) {
    lua_pushnumber(L, m);
    return 1;
  }
  const int e = std::ilogb(m);  // by powers of two: without rounding, without overflow
  double squared = 0.0;
  if (b.is_vector) {
    for (Index i = 0; i < b.rows; ++i) squared += std::pow(std::scalbn(b.data()[i], -e), 2);
  } else {
    const Index n = std::min(b.rows, b.cols);
    charge_operations(L, static_cast<double>(n) * (2.0 * static_cast<double>(b.size()) + 4.0 * static_cast<double>(n * n)));
    Eigen::MatrixXd A = b.copy().unaryExpr([e](double x) { return std::scalbn(x, -e); });
    const Eigen::MatrixXd AA = b.rows < b.cols ? Eigen::MatrixXd(A * A.transpose()) : Eigen::MatrixXd(A.transpose() * A);
    squared = symmetric_eigenvalues(AA)[n - 1];
  }
  lua_pushnumber(L, std::scalbn(std::sqrt(squared), e));
  return 1;
}

/// x with A x = b, by LU with partial pivoting of the matrix whose rows and columns are scaled by powers of two: units that
/// differ do not make a matrix singular.
int solve(lua_State* L) {
  Block& A = self_matrix(L, "solve");
  if (A.rows != A.cols) misfit(L, "solve", "a square matrix", "a " + shape(A));
  Block* b = block_at(L, 2);
  if (b && b->rows != A.rows)
    misfit(L, fmt::format("{}:solve({})", shape(A), shape(*b)), fmt::format("a right-hand side of {} rows", A.rows), "a " + shape(*b));
  const Eigen::MatrixXd rhs = b ? b->copy() : Eigen::MatrixXd(to_vector(L, 2, A.rows, "the right-hand side of " + shape(A)));
  const Index n = A.rows;
  charge_operations(L, static_cast<double>(n * n) * (static_cast<double>(n) + 2.0 * static_cast<double>(rhs.cols())));
  Eigen::MatrixXd scaled = A.copy();
  // Exponents and not powers: 2^1074, which brings the smallest numbers to 1, is none itself.
  Eigen::VectorXi row = Eigen::VectorXi::Zero(n), column = row;
  const auto exponent = [](double m) { return m > 0.0 && std::isfinite(m) ? -std::ilogb(m) : 0; };
  const auto scale = [](auto&& part, int e) { part = part.unaryExpr([e](double x) { return std::scalbn(x, e); }).eval(); };
  for (Index i = 0; i < n; ++i) scale(scaled.row(i), row[i] = exponent(scaled.row(i).cwiseAbs().maxCoeff()));
  for (Index j = 0; j < n; ++j) scale(scaled.col(j), column[j] = exponent(scaled.col(j).cwiseAbs().maxCoeff()));
  Eigen::MatrixXd x(n, rhs.cols());
  if (n > 0) {
    // y = S_c^-1 x of S_r A S_c y = S_r b. Of each S_r b the exponent is taken out too: it may leave the range of numbers though x
    // does not.
    Eigen::MatrixXd b_scaled(n, rhs.cols());
    Eigen::VectorXi own(rhs.cols());
    for (Index k = 0; k < rhs.cols(); ++k) {
      int largest_exponent = std::numeric_limits<int>::min();
      for (Index i = 0; i < n; ++i)
        if (rhs(i, k) != 0.0 && std::isfinite(rhs(i, k))) largest_exponent = std::max(largest_exponent, std::ilogb(rhs(i, k)) + row[i]);
      own[k] = largest_exponent == std::numeric_limits<int>::min() ? 0 : -largest_exponent;
      for (Index i = 0; i < n; ++i) b_scaled(i, k) = std::scalbn(rhs(i, k), row[i] + own[k]);
    }
    const LuSolution y = lu_solve(scaled, b_scaled);
    if (!(y.rcond >= std::numeric_limits<double>::epsilon()))
      misfit(L, "solve", "a regular matrix", fmt::format("a {} that is singular: reciprocal condition number {:.2g}", shape(A), y.rcond));
    x = y.x;
    for (Index k = 0; k < rhs.cols(); ++k)
      for (Index i = 0; i < n; ++i) x(i, k) = std::scalbn(x(i, k), column[i] - own[k]);
    if (rhs.allFinite() && A.map().allFinite() && !x.allFinite())
      misfit(L, "solve", "a solution within the range of numbers", "one that overflows", "other units?");
  }
  const bool is_vector = !b || b->is_vector;
  push_block(L, is_vector, n, x.cols(), A.column_labels, is_vector ? nullptr : b->column_labels).map() = x;
  return 1;
}

/// Of a symmetric matrix, ascending.
int eigenvalues(lua_State* L) {
  Block& A = self_matrix(L, "eigenvalues");
  if (A.rows != A.cols) misfit(L, "eigenvalues", "a square matrix", "a " + shape(A));
  const Index n = A.rows;
  const double limit = 1e-12 * largest(A);  // rounding of products on either side of the diagonal
  const auto a = A.map();
  if (!a.allFinite()) misfit(L, "eigenvalues", "a matrix of finite numbers", "one that is not finite");
  for (Index j = 0; j < n; ++j)
    for (Index i = 0; i <= j; ++i)
      if (!(std::abs(a(i, j) - a(j, i)) <= limit))
        misfit(L, "eigenvalues", "a symmetric matrix",
               fmt::format("A({0}, {1}) = {2:.17g}, A({1}, {0}) = {3:.17g}", i + 1, j + 1, a(i, j), a(j, i)));
  charge_operations(L, 4.0 / 3.0 * std::pow(static_cast<double>(n), 3) * kLevelTwo);
  Eigen::VectorXd values(n);
  if (n > 0) values = symmetric_eigenvalues(A.copy());
  push_vector(L, values);
  return 1;
}

// ---- entries ----

/// Entry 1 ... n, or a name of the labels, as argument `arg`; -1 if there is none.
Index position(lua_State* L, int arg, Index n, const SharedLabels& labels) {
  if (lua_type(L, arg) == LUA_TNUMBER) {
    const lua_Integer i = lua_tointeger(L, arg);
    if (i >= 1 && i <= n && lua_compare(L, arg, arg, LUA_OPEQ) && static_cast<double>(i) == lua_tonumber(L, arg)) return i - 1;
  } else if (lua_type(L, arg) == LUA_TSTRING && labels) {
    const auto found = std::find(labels->names.begin(), labels->names.end(), lua_tostring(L, arg));
    if (found != labels->names.end()) return found - labels->names.begin();
  }
  return -1;
}
Index expect_position(lua_State* L, int arg, Index n, const SharedLabels& labels, const std::string& of) {
  const Index i = position(L, arg, n, labels);
  if (i >= 0) return i;
  const bool has_names = labels && !labels->names.empty();
  misfit(L, of, fmt::format("1 to {}{}", n, has_names ? ", or one of its names" : ""), describe_value(L, arg),
         has_names && lua_type(L, arg) == LUA_TSTRING ? did_you_mean(lua_tostring(L, arg), labels->names) : "");
}

std::vector<std::string> method_names(lua_State* L, int table) {
  std::vector<std::string> names;
  for (lua_pushnil(L); lua_next(L, table); lua_pop(L, 1)) names.emplace_back(lua_tostring(L, -2));
  std::sort(names.begin(), names.end());
  return names;
}

/// x[i], x["rod.angle"], A[i] (a copy of the row), or a method; upvalue 1 has the methods.
int index(lua_State* L) {
  Block& b = self(L);
  if (lua_type(L, 2) == LUA_TSTRING) {
    lua_pushvalue(L, 2);
    if (lua_rawget(L, lua_upvalueindex(1)) != LUA_TNIL) return 1;
    lua_pop(L, 1);
  }
  const Index i = position(L, 2, b.rows, b.row_labels);
  if (i < 0 && lua_type(L, 2) == LUA_TSTRING) {
    lua_pushvalue(L, lua_upvalueindex(1));
    std::vector<std::string> legal = method_names(L, lua_gettop(L));
    std::string entries = fmt::format("1 to {}", b.rows), methods = fmt::format("{}", fmt::join(legal, ", "));
    if (b.row_labels && !b.row_labels->names.empty()) {
      const std::vector<std::string>& names = b.row_labels->names;
      constexpr std::size_t most = 30;
      entries = fmt::format("one of its names: {}{}", fmt::join(std::span(names).first(std::min(most, names.size())), ", "),
                            names.size() > most ? ", ..." : "");
      legal.insert(legal.begin(), names.begin(), names.end());
    }
    misfit(L, shape(b), fmt::format("{}, or a method: {}", entries, methods), describe_value(L, 2),
           did_you_mean(lua_tostring(L, 2), legal));
  }
  if (i < 0) expect_position(L, 2, b.rows, b.row_labels, "index of " + shape(b));
  if (b.is_vector) {
    lua_pushnumber(L, b.data()[i]);
    return 1;
  }
  Block& row = push_block(L, true, b.cols, 1, b.column_labels, nullptr);
  row.is_row = true;
  row.map() = b.map().row(i).transpose();
  return 1;
}

double number(lua_State* L, int arg, const std::string& where) {
  if (lua_type(L, arg) != LUA_TNUMBER) misfit(L, where, "a number", describe_value(L, arg));
  return lua_tonumber(L, arg);
}

int set_index(lua_State* L) {
  Block& b = self(L);
  if (!b.is_vector || b.is_row)
    misfit(L, b.is_row ? "a row of a matrix" : shape(b), "A:set(i, j, x)", "an assignment to an index",
           b.is_row ? "A[i] is a copy of the row: the matrix would not change" : "");
  const Index i = expect_position(L, 2, b.rows, b.row_labels, "index of " + shape(b));
  b.data()[i] = number(L, 3, "entry of " + shape(b));
  return 0;
}

int call(lua_State* L) {
  Block& b = self_matrix(L, "A(i, j)");
  const Index i = expect_position(L, 2, b.rows, b.row_labels, "row of " + shape(b));
  lua_pushnumber(L, b.map()(i, expect_position(L, 3, b.cols, b.column_labels, "column of " + shape(b))));
  return 1;
}
int set(lua_State* L) {
  Block& b = self_matrix(L, "set");
  const Index i = expect_position(L, 2, b.rows, b.row_labels, "row of " + shape(b));
  b.map()(i, expect_position(L, 3, b.cols, b.column_labels, "column of " + shape(b))) = number(L, 4, "entry of " + shape(b));
  return 0;
}
int column(lua_State* L) {
  Block& b = self_matrix(L, "column");
  const Index j = expect_position(L, 2, b.cols, b.column_labels, "column of " + shape(b));
  push_block(L, true, b.rows, 1, b.row_labels, nullptr).map() = b.map().col(j);
  return 1;
}

int rows(lua_State* L) {
  lua_pushinteger(L, self(L).rows);
  return 1;
}
int cols(lua_State* L) {
  lua_pushinteger(L, self(L).cols);
  return 1;
}

int table(lua_State* L) {
  Block& b = self(L);
  const auto numbers = [&](Index n, Index first, Index stride) {
    LuaHost::charge(L, n);
    lua_createtable(L, static_cast<int>(n), 0);
    for (Index k = 0; k < n; ++k) {
      lua_pushnumber(L, b.data()[first + k * stride]);
      lua_rawseti(L, -2, k + 1);
    }
  };
  if (b.is_vector) {
    numbers(b.rows, 0, 1);
    return 1;
  }
  lua_createtable(L, static_cast<int>(b.rows), 0);
  for (Index i = 0; i < b.rows; ++i) {
    numbers(b.cols, i, b.rows);
    lua_rawseti(L, -2, i + 1);
  }
  return 1;
}

void push_labels(lua_State* L, const SharedLabels& labels) {
  const auto list = [L](const std::vector<std::string>& texts, const char* key) {
    if (texts.empty()) return;
    lua_createtable(L, static_cast<int>(texts.size()), 0);
    for (std::size_t i = 0; i < texts.size(); ++i) {
      lua_pushlstring(L, texts[i].data(), texts[i].size());
      lua_rawseti(L, -2, static_cast<lua_Integer>(i) + 1);
    }
    lua_setfield(L, -2, key);
  };
  lua_newtable(L);
  if (!labels) return;
  list(labels->names, "names");
  list(labels->units, "units");
}
/// {names = {...}, units = {...}} of a vector; of a matrix those of the rows, then those of the columns.
int labels(lua_State* L) {
  const Block& b = self(L);
  push_labels(L, b.row_labels);
  if (!b.is_vector) push_labels(L, b.column_labels);
  return b.is_vector ? 1 : 2;
}

// ---- construction ----

Labels labels_at(lua_State* L, int index, Index n, const std::string& what) {
  Labels out;
  if (lua_isnoneornil(L, index)) return out;
  const std::string expected = fmt::format("{{names = {{...}}, units = {{...}}}} with {} texts each", n);
  if (!lua_istable(L, index)) misfit(L, what, expected, describe_value(L, index));
  const auto list = [&](const char* key) {
    std::vector<std::string> texts;
    const int type = lua_getfield(L, index, key);
    if (type != LUA_TNIL && (type != LUA_TTABLE || static_cast<Index>(lua_rawlen(L, -1)) != n))
      misfit(L, what + "." + key, expected, type == LUA_TTABLE ? fmt::format("{} of them", lua_rawlen(L, -1)) : describe_value(L, -1));
    for (Index i = 1; type == LUA_TTABLE && i <= n; ++i) {
      if (lua_rawgeti(L, -1, i) != LUA_TSTRING) misfit(L, what + "." + key, expected, describe_value(L, -1));
      texts.emplace_back(lua_tostring(L, -1));
      lua_pop(L, 1);
    }
    lua_pop(L, 1);
    return texts;
  };
  out.names = list("names");
  out.units = list("units");
  if (count_keys(L, index) > (out.names.empty() ? 0u : 1u) + (out.units.empty() ? 0u : 1u) && n > 0)
    misfit(L, what, expected, "a table with other keys");
  return out;
}

/// vector({1, 2, 3} [, labels])
int make_vector(lua_State* L) {
  expect_at_most(L, 2, 0);
  const Eigen::VectorXd x = to_vector(L, 1, kAnySize, "vector");
  push_vector(L, x, labels_at(L, 2, x.size(), "labels of the vector"));
  return 1;
}
/// matrix({{1, 2}, {3, 4}} [, labels of the rows [, labels of the columns]])
int make_matrix(lua_State* L) {
  expect_at_most(L, 3, 0);
  const Eigen::MatrixXd A = to_matrix(L, 1, kAnySize, kAnySize, "matrix");
  push_matrix(L, A, labels_at(L, 2, A.rows(), "labels of the rows"), labels_at(L, 3, A.cols(), "labels of the columns"));
  return 1;
}

// ---- text ----

std::string label(const SharedLabels& labels, Index i) {
  const auto at = static_cast<std::size_t>(i);
  const bool has_name = labels && !labels->names.empty(), has_unit = labels && !labels->units.empty();
  std::string text = has_name ? labels->names[at] : std::to_string(i + 1);
  if (has_unit) text += " [" + labels->units[at] + "]";
  return printable(text);
}

/// Lines of cells: numbers to the right, words before them to the left. In a window that is too narrow the columns stand in
/// several blocks, the words before each.
std::string aligned(const std::vector<std::vector<std::string>>& lines, bool begins_with_words, std::size_t window) {
  std::vector<std::size_t> widths;
  for (const auto& line : lines)
    for (std::size_t j = 0; j < line.size(); ++j) {
      if (j == widths.size()) widths.push_back(0);
      widths[j] = std::max(widths[j], line[j].size());
    }
  const std::size_t first = begins_with_words ? 1 : 0, words = begins_with_words && !widths.empty() ? widths[0] + 2 : 0;
  std::string out;
  for (std::size_t from = first; from < widths.size() || from == first;) {
    std::size_t to = from, width = words;
    while (to < widths.size() && (window == 0 || to == from || 2 + width + widths[to] <= window)) width += widths[to++] + 2;
    if (to - from < widths.size() - first)
      out += from + 1 == to ? fmt::format("\n column {}", to - first) : fmt::format("\n columns {} to {}", from - first + 1, to - first);
    for (const auto& line : lines) {
      std::string text = "  ";
      if (begins_with_words && !line.empty()) text += fmt::format("{:<{}}", line[0], words);
      for (std::size_t j = from; j < std::min(to, line.size()); ++j)
        text += (j > from ? "  " : "") + fmt::format("{:>{}}", line[j], widths[j]);
      out += "\n" + text.substr(0, text.find_last_not_of(' ') + 1);
    }
    from = std::max(to, from + 1);
  }
  return out;
}

std::string text_of(Block& b, std::size_t window) {
  const Index shown_rows = std::min(b.rows, kShownRows), shown_columns = std::min(b.cols, kShownColumns);
  std::vector<std::vector<std::string>> lines;
  if (b.column_labels)
    for (const auto* list : {&b.column_labels->names, &b.column_labels->units}) {
      if (list->empty()) continue;
      const bool is_unit = list == &b.column_labels->units;
      lines.emplace_back(b.row_labels ? 1 : 0);
      for (Index j = 0; j < shown_columns; ++j) {
        const std::string& text = (*list)[static_cast<std::size_t>(j)];
        lines.back().push_back(printable(is_unit ? "[" + text + "]" : text));
      }
    }
  for (Index i = 0; i < shown_rows; ++i) {
    lines.emplace_back();
    if (b.row_labels) lines.back().push_back(label(b.row_labels, i));
    for (Index j = 0; j < shown_columns; ++j) lines.back().push_back(short_text(b.map()(i, j)));
  }
  std::string out = shape(b) + aligned(lines, b.row_labels != nullptr, window);
  const auto more = [&out](const char* what, Index shown, Index all) {
    if (shown < all) out += fmt::format("\n  ({} {} to {} are not shown; :csv(file) writes all)", what, shown + 1, all);
  };
  more(b.is_vector ? "entries" : "rows", shown_rows, b.rows);
  more("columns", shown_columns, b.cols);
  return out;
}

int to_text(lua_State* L) {
  const std::string text = text_of(self(L), LuaHost::of(L).options().width());
  lua_pushlstring(L, text.data(), text.size());
  return 1;
}

// ---- files ----

[[noreturn]] void cannot_write(lua_State* L, const std::string& path, const std::string& why) {
  refuse(L, Code::cannot_write, path, "a place that can be written to", why);
}

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

std::string text_argument(lua_State* L, int index, const char* where, const char* expected) {
  if (lua_type(L, index) != LUA_TSTRING) misfit(L, where, expected, describe_value(L, index));
  std::size_t n = 0;
  const char* const text = lua_tolstring(L, index, &n);
  return {text, n};
}

/// A line per row with all digits; names and units stand first where there are any.
int csv(lua_State* L) {
  Block& b = self(L);
  LuaHost::charge(L, 8 * b.size());
  const std::filesystem::path path = output_file(L, text_argument(L, 2, "csv", "the name of a file: A:csv(\"A.csv\")"));
  std::string text;
  if (b.column_labels) {
    for (Index j = 0; j < b.cols; ++j) text += (j > 0 || b.row_labels ? "," : "") + csv_field(label(b.column_labels, j));
    text += '\n';
  }
  for (Index i = 0; i < b.rows; ++i) {
    if (b.row_labels) text += csv_field(label(b.row_labels, i)) + ",";
    for (Index j = 0; j < b.cols; ++j) text += fmt::format("{}{}", j > 0 ? "," : "", b.map()(i, j));
    text += '\n';
  }
  std::ofstream out(path, std::ios::binary);
  out << text;
  out.close();
  if (!out) cannot_write(L, path.string(), "it cannot be written");
  return push_path(L, path);
}

/// A dataset in a file that may hold others: attributes row_names, row_units, column_names, column_units.
int hdf5(lua_State* L) {
  Block& b = self(L);
  LuaHost::charge(L, b.size());
  const std::filesystem::path path = output_file(L, text_argument(L, 2, "hdf5", "the name of a file: A:hdf5(\"A.h5\", \"A\")"));
  std::string name = text_argument(L, 3, "hdf5", "the name of a dataset: A:hdf5(\"A.h5\", \"A\")");
  if (name.empty() || name.front() != '/') name.insert(0, "/");
  const std::string expected = "the name of a dataset: mass_matrix, run1/mass_matrix";
  for (std::size_t from = 1; from <= name.size();) {  // no empty part, none that HDF5 reads as a way
    const std::size_t to = std::min(name.find('/', from), name.size());
    const std::string part = name.substr(from, to - from);
    if (part.empty() || part == "." || part == ".." || part.find('\0') != std::string::npos) misfit(L, "hdf5", expected, in_quotes(name));
    from = to + 1;
  }
  Hdf5File file = Hdf5File::update(path.string());
  for (std::size_t slash = name.find('/', 1); slash != std::string::npos; slash = name.find('/', slash + 1)) {
    const std::string folder = name.substr(0, slash);
    if (file.has(folder) && !file.is_group(folder))
      misfit(L, "hdf5", expected, fmt::format("{}: {} is a dataset", in_quotes(name), in_quotes(folder.substr(1))));
  }
  file.remove(name);  // with the names and units of what it was
  const Eigen::MatrixXd row_major = b.map().transpose();
  std::vector<std::size_t> dims{static_cast<std::size_t>(b.rows)};
  if (!b.is_vector) dims.push_back(static_cast<std::size_t>(b.cols));
  file.write(name, {row_major.data(), static_cast<std::size_t>(b.size())}, dims);
  const auto attributes = [&](const SharedLabels& all, const std::string& prefix) {
    if (all && !all->names.empty()) file.set_attribute(name, prefix + "names", all->names);
    if (all && !all->units.empty()) file.set_attribute(name, prefix + "units", all->units);
  };
  attributes(b.row_labels, b.is_vector ? "" : "row_");
  attributes(b.column_labels, "column_");
  file.close();
  return push_path(L, path);
}

// ---- the types ----

int collected(lua_State* L) {
  static_cast<Block*>(lua_touserdata(L, 1))->~Block();
  return 0;
}

constexpr luaL_Reg kBoth[] = {{"t", own_method<transpose, 0>},     {"norm", own_method<norm, 0>},
                              {"max_abs", own_method<max_abs, 0>}, {"rows", own_method<rows, 0>},
                              {"cols", own_method<cols, 0>},       {"table", own_method<table, 0>},
                              {"labels", own_method<labels, 0>},   {"csv", own_method<csv, 1>},
                              {"hdf5", own_method<hdf5, 2>},       {nullptr, nullptr}};
constexpr luaL_Reg kOfVectors[] = {{"dot", own_method<dot, 1>}, {nullptr, nullptr}};
constexpr luaL_Reg kOfMatrices[] = {{"set", own_method<set, 3>},
                                    {"column", own_method<column, 1>},
                                    {"solve", own_method<solve, 1>},
                                    {"eigenvalues", own_method<eigenvalues, 0>},
                                    {nullptr, nullptr}};
constexpr luaL_Reg kOperators[] = {{"__add", own_method<add>},
                                   {"__sub", own_method<subtract>},
                                   {"__mul", own_method<multiply>},
                                   {"__div", own_method<divide>},
                                   {"__unm", own_method<negate>},
                                   {"__eq", own_method<is_equal>},
                                   {"__len", own_method<rows>},
                                   {"__call", own_method<call, 2>},
                                   {"__newindex", own_method<set_index>},
                                   {"__tostring", own_method<to_text>},
                                   {"__gc", collected},
                                   {nullptr, nullptr}};

void make_type(lua_State* L, const char* name, const luaL_Reg* own) {
  luaL_newmetatable(L, name);
  luaL_setfuncs(L, kOperators, 0);
  lua_newtable(L);
  luaL_setfuncs(L, kBoth, 0);
  luaL_setfuncs(L, own, 0);
  lua_pushvalue(L, -1);
  lua_setfield(L, -3, "__members");
  lua_pushcclosure(L, own_method<index>, 1);
  lua_setfield(L, -2, "__index");
  lua_pushboolean(L, 0);
  lua_setfield(L, -2, "__metatable");
  lua_pop(L, 1);
}

}  // namespace

void open_matrices(LuaHost& host) {
  host.protect([](lua_State* L) {
    make_type(L, kVector, kOfVectors);
    make_type(L, kMatrix, kOfMatrices);
    lua_pushcfunction(L, own_method<make_vector>);
    lua_setglobal(L, "vector");
    lua_pushcfunction(L, own_method<make_matrix>);
    lua_setglobal(L, "matrix");
  });
}

void push_vector(lua_State* L, const Eigen::Ref<const Eigen::VectorXd>& x, Labels labels) {
  push_block(L, true, x.size(), 1, shared(std::move(labels), x.size()), nullptr).map() = x;
}

void push_matrix(lua_State* L, const Eigen::Ref<const Eigen::MatrixXd>& A, Labels rows, Labels columns) {
  push_block(L, false, A.rows(), A.cols(), shared(std::move(rows), A.rows()), shared(std::move(columns), A.cols())).map() = A;
}

Labels row_labels(lua_State* L, int index) {
  const Block* b = block_at(L, index);
  return b && b->row_labels ? *b->row_labels : Labels{};
}
Labels column_labels(lua_State* L, int index) {
  const Block* b = block_at(L, index);
  return b && b->column_labels ? *b->column_labels : Labels{};
}
std::span<double> numbers_of(lua_State* L, int index) {
  Block* b = block_at(L, index);
  return b ? std::span(b->data(), static_cast<std::size_t>(b->size())) : std::span<double>();
}
bool is_vector(lua_State* L, int index) { return luaL_testudata(L, index, kVector) != nullptr; }
bool is_matrix(lua_State* L, int index) { return luaL_testudata(L, index, kMatrix) != nullptr; }

Eigen::VectorXd to_vector(lua_State* L, int index, Eigen::Index size, const std::string& what) {
  const std::string wanted = size == kAnySize ? "a vector or a table of numbers" : fmt::format("a vector or a table of {} numbers", size);
  Block* b = static_cast<Block*>(luaL_testudata(L, index, kVector));
  if (!b && !lua_istable(L, index)) misfit(L, what, wanted, block_at(L, index) ? "a " + shape_at(L, index) : describe_value(L, index));
  index = lua_absindex(L, index);
  const Index n = b ? b->rows : static_cast<Index>(lua_rawlen(L, index));
  if (size != kAnySize && n != size) misfit(L, what, wanted, b ? "a " + shape(*b) : fmt::format("a table of {}", n));
  LuaHost::charge(L, n);
  if (b) return b->map().col(0);
  expect_no_names(L, index, what, wanted);
  Eigen::VectorXd x(n);
  for (Index i = 0; i < n; ++i) {
    if (lua_rawgeti(L, index, i + 1) != LUA_TNUMBER) misfit(L, fmt::format("{}[{}]", what, i + 1), "a number", describe_value(L, -1));
    x[i] = lua_tonumber(L, -1);
    lua_pop(L, 1);
  }
  return x;
}

Eigen::MatrixXd to_matrix(lua_State* L, int index, Eigen::Index rows, Eigen::Index cols, const std::string& what) {
  const auto count = [](Index n, const char* word) { return n == kAnySize ? std::string() : fmt::format(" of {} {}", n, word); };
  const std::string wanted = rows == kAnySize || cols == kAnySize
                                 ? fmt::format("a matrix or a table of rows{}{}", count(rows, "rows"), count(cols, "columns"))
                                 : fmt::format("a matrix {}x{} or a table of as many rows", rows, cols);
  Block* b = static_cast<Block*>(luaL_testudata(L, index, kMatrix));
  if (!b && !lua_istable(L, index)) misfit(L, what, wanted, block_at(L, index) ? "a " + shape_at(L, index) : describe_value(L, index));
  index = lua_absindex(L, index);
  Eigen::MatrixXd A;
  if (b) {
    LuaHost::charge(L, b->size());
    A = b->map();
  } else {
    expect_no_names(L, index, what, wanted);
    const auto n = static_cast<Index>(lua_rawlen(L, index));
    for (Index i = 0; i < n; ++i) {
      lua_rawgeti(L, index, i + 1);
      const Eigen::VectorXd row = to_vector(L, -1, i == 0 ? cols : A.cols(), fmt::format("{}[{}]", what, i + 1));
      if (i == 0) A.resize(n, row.size());
      A.row(i) = row.transpose();
      lua_pop(L, 1);
    }
  }
  if ((rows != kAnySize && A.rows() != rows) || (cols != kAnySize && A.cols() != cols))
    misfit(L, what, wanted, fmt::format("a matrix {}x{}", A.rows(), A.cols()));
  return A;
}

std::filesystem::path output_file(lua_State* L, const std::string& name) {
  namespace fs = std::filesystem;
  const fs::path& output = LuaHost::of(L).options().output;
  if (output.empty()) cannot_write(L, name, "a script that writes no files; `cardan workbench` lets it");
  std::error_code error;
  fs::path root = fs::weakly_canonical(fs::absolute(output), error);
  if (!root.has_filename()) root = root.parent_path();  // "out/"
  const fs::path file = fs::weakly_canonical(root / name, error);
  const bool is_inside = std::mismatch(root.begin(), root.end(), file.begin(), file.end()).first == root.end();
  if (name.empty() || !is_inside || file == root) cannot_write(L, name, fmt::format("a name that leads out of {}", output.string()));
  fs::create_directories(file.parent_path(), error);
  if (error) cannot_write(L, file.string(), error.message());
  if (fs::is_directory(file, error)) cannot_write(L, file.string(), "a folder");
  if (fs::is_symlink(fs::symlink_status(root / name, error)) && !fs::exists(root / name, error))
    cannot_write(L, name, "a symbolic link to a place where nothing is");  // which weakly_canonical does not follow
  if (fs::exists(file, error) && !fs::is_regular_file(file, error)) cannot_write(L, file.string(), "no regular file");
  return file;
}

int push_path(lua_State* L, const std::filesystem::path& path) {
  std::error_code ignored;
  const std::filesystem::path near = std::filesystem::proximate(path, ignored);
  lua_pushstring(L, (near.empty() ? path : near).c_str());
  return 1;
}

}  // namespace cardan
