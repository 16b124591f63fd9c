#include "core/operators/expression.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/base/diagnostic.hpp"
#include "core/base/poll.hpp"
#include "core/linalg/dense.hpp"
#include "core/linalg/eigenpairs.hpp"
#include "core/operators/operators.hpp"

namespace cardan::operators {

/// A space, with the nodes where it is that of nodes.
struct Stack {
  Space space = Space::hinge;
  std::vector<int> nodes{};
  bool operator==(const Stack&) const = default;
};
namespace {
constexpr int kFormed = 300;  // up to this size a matrix is formed for norms and eigenvalues
}  // namespace

struct Expression::Node {
  enum class Form { leaf, block_inverse, identity, unit, product, sum };
  Form form = Form::leaf;
  Kind kind = Kind::H;
  bool starred = false;
  Stack rows{}, cols{};
  Sort gives = Sort::unknown, takes = Sort::unknown;
  std::vector<double> scales{};                      // of the terms of a sum
  std::vector<std::shared_ptr<const Node>> parts{};  // factors, or terms
  int letters = 1;
};

namespace {

using Node = Expression::Node;
using Formula = std::shared_ptr<const Node>;
using Form = Node::Form;

bool same(const Formula& a, const Formula& b) {
  if (a == b) return true;
  if (a->form != b->form || a->kind != b->kind || a->starred != b->starred || a->rows != b->rows || a->cols != b->cols ||
      a->scales != b->scales || a->parts.size() != b->parts.size())
    return false;
  for (std::size_t i = 0; i < a->parts.size(); ++i)
    if (!same(a->parts[i], b->parts[i])) return false;
  return true;
}

Formula make(Node n) {
  if (!n.parts.empty()) n.letters = 0;
  for (const Formula& part : n.parts) n.letters += part->letters;
  return std::make_shared<const Node>(std::move(n));
}
Formula leaf_of(Kind kind, bool starred = false, const std::vector<int>& nodes = {}) {
  const KindFacts& f = facts(kind);
  Node n{.form = Form::leaf,
         .kind = kind,
         .starred = starred && !f.symmetric,
         .rows = {f.rows, {}},
         .cols = {f.columns, {}},
         .gives = f.gives,
         .takes = f.takes};
  if (f.columns == Space::node) n.cols.nodes = nodes;
  if (n.starred) {
    std::swap(n.rows, n.cols);
    n.gives = dual(f.takes), n.takes = dual(f.gives);
  }
  return make(std::move(n));
}
Formula block_inverse(Kind kind) {
  return make({.form = Form::block_inverse,
               .kind = kind,
               .rows = {facts(kind).rows, {}},
               .cols = {facts(kind).columns, {}},
               .gives = facts(kind).takes,
               .takes = facts(kind).gives});
}
Formula identity_of(const Stack& s) { return make({.form = Form::identity, .rows = s, .cols = s}); }

/// A product without brackets, without identities, of one factor or more.
Formula product_of(const std::vector<Formula>& factors) {
  Node n{.form = Form::product, .rows = factors.front()->rows, .cols = factors.back()->cols};
  double scale = 1.0;
  const auto add = [&](const auto& self, const Formula& f) -> void {
    if (f->form == Form::product)
      for (const Formula& g : f->parts) self(self, g);
    else if (f->form == Form::sum && f->parts.size() == 1) {
      scale *= f->scales[0];
      self(self, f->parts[0]);
    } else if (f->form != Form::identity)
      n.parts.push_back(f);
  };
  for (const Formula& f : factors) add(add, f);
  if (!n.parts.empty()) {
    n.gives = n.parts.front()->gives, n.takes = n.parts.back()->takes;
    for (std::size_t i = 0; i + 1 < n.parts.size(); ++i)
      if (n.parts[i]->takes != n.parts[i + 1]->gives) n.gives = Sort::unknown;  // as in J J*
  }
  const Formula bare = n.parts.empty() ? identity_of(n.rows) : n.parts.size() == 1 ? n.parts[0] : make(n);
  if (scale == 1.0) return bare;
  return make({.form = Form::sum,
               .rows = bare->rows,
               .cols = bare->cols,
               .gives = bare->gives,
               .takes = bare->takes,
               .scales = {scale},
               .parts = {bare}});
}
Formula sum_of(const std::vector<std::pair<double, Formula>>& terms) {
  Node n{.form = Form::sum, .rows = terms[0].second->rows, .cols = terms[0].second->cols};
  for (const auto& [s, f] : terms) {
    if (f->form == Form::sum) {
      for (std::size_t i = 0; i < f->parts.size(); ++i) n.parts.push_back(f->parts[i]), n.scales.push_back(s * f->scales[i]);
    } else {
      n.parts.push_back(f), n.scales.push_back(s);
    }
  }
  if (n.parts.size() == 1 && n.scales[0] == 1.0) return n.parts[0];
  const Node* first = nullptr;  // that is not an identity, which takes and gives anything
  bool one_sort = true;
  for (const Formula& f : n.parts) {
    if (f->form == Form::identity) continue;
    if (first) one_sort = one_sort && f->gives == first->gives && f->takes == first->takes;
    first = f.get();
  }
  if (first && one_sort) n.gives = first->gives, n.takes = first->takes;
  return make(std::move(n));
}

Formula star_of(const Formula& f) {
  switch (f->form) {
    case Form::leaf:
      return leaf_of(f->kind, !f->starred, f->kind == Kind::B ? (f->starred ? f->rows.nodes : f->cols.nodes) : std::vector<int>{});
    case Form::block_inverse:
    case Form::identity:
    case Form::unit:
      return f;
    case Form::product: {
      std::vector<Formula> turned;
      for (auto p = f->parts.rbegin(); p != f->parts.rend(); ++p) turned.push_back(star_of(*p));
      return product_of(turned);
    }
    case Form::sum:
      break;
  }
  std::vector<std::pair<double, Formula>> terms;
  for (std::size_t i = 0; i < f->parts.size(); ++i) terms.emplace_back(f->scales[i], star_of(f->parts[i]));
  return sum_of(terms);
}

/// The same formula as its type says (operators.hpp); `nodes`: those of B.
struct Written {
  std::vector<int> nodes{};
  template <Kind Of, bool Star>
  Formula operator()(Leaf<Of, Star>) const {
    return leaf_of(Of, Star, nodes);
  }
  template <Kind Of>
  Formula operator()(BlockInverse<Of>) const {
    return block_inverse(Of);
  }
  template <Space S>
  Formula operator()(Identity<S>) const {
    return identity_of({S, {}});
  }
  template <class A>
  Formula operator()(Minus<A>) const {
    return sum_of({{-1.0, (*this)(A{})}});
  }
  template <class A, class B>
  Formula operator()(Sum<A, B>) const {
    return sum_of({{1.0, (*this)(A{})}, {1.0, (*this)(B{})}});
  }
  template <class... F>
  Formula operator()(Product<F...>) const {
    return product_of({(*this)(F{})...});
  }
};
const Formula& mass_of() {
  static const Formula written = Written{}(letters::mass);
  return written;
}

/// Pairs of an operator and its inverse, by the rules of operators.hpp.
const std::vector<std::pair<Formula, Formula>>& rules() {
  static const std::vector<std::pair<Formula, Formula>> all = [] {
    std::vector<std::pair<Formula, Formula>> out;
    using namespace letters;
    const auto both_ways = [&](auto... e) { (out.emplace_back(Written{}(e), Written{}(inv(e))), ...); };
    both_ways(phi, psi, I + H * phi * K, D, M, inv(phi), inv(psi), inv(I + H * phi * K), inv(D), inv(M), mass);
    return out;
  }();
  return all;
}

std::optional<Formula> inverse_of(const Formula& f) {
  if (f->form == Form::identity || f->form == Form::unit) return f;
  for (const auto& [from, to] : rules())
    if (same(f, from)) return to;
  const Formula turned = star_of(f);
  for (const auto& [from, to] : rules())
    if (same(turned, from)) return star_of(to);
  if (f->form == Form::sum && f->parts.size() == 1) {
    const auto inner = inverse_of(f->parts[0]);
    if (!inner || !std::isnormal(f->scales[0])) return std::nullopt;
    return sum_of({{1.0 / f->scales[0], *inner}});
  }
  if (f->form == Form::sum) {  // s (I + H phi K), its terms in any order
    Node bare = *f;
    const auto one = std::find_if(bare.parts.begin(), bare.parts.end(), [](const Formula& p) { return p->form == Form::identity; });
    if (one == bare.parts.end()) return std::nullopt;
    const double s = bare.scales[one - bare.parts.begin()];
    if (!std::isnormal(s) || (s == 1.0 && one == bare.parts.begin())) return std::nullopt;
    std::rotate(bare.scales.begin(), bare.scales.begin() + (one - bare.parts.begin()), bare.scales.end());
    std::rotate(bare.parts.begin(), one, bare.parts.end());
    for (double& scale : bare.scales) scale /= s;
    const auto inner = inverse_of(make(std::move(bare)));
    return inner ? std::optional(sum_of({{1.0 / s, *inner}})) : std::nullopt;
  }
  if (f->form != Form::product) return std::nullopt;
  std::vector<Formula> factors;
  for (auto p = f->parts.rbegin(); p != f->parts.rend(); ++p) {
    const auto inner = inverse_of(*p);
    if (!inner) return std::nullopt;
    factors.push_back(*inner);
  }
  return product_of(factors);
}

std::string text_of(const Formula& f) {
  switch (f->form) {
    case Form::leaf:
      return std::string(facts(f->kind).name) + (f->starred ? "*" : "");
    case Form::block_inverse:
      return std::string(facts(f->kind).name) + "^-1";
    case Form::identity:
    case Form::unit:
      return "I";
    case Form::product: {
      std::string out;
      for (const Formula& p : f->parts) out += (out.empty() ? "" : " ") + (p->form == Form::sum ? "(" + text_of(p) + ")" : text_of(p));
      return out;
    }
    case Form::sum:
      break;
  }
  std::string out;
  for (std::size_t i = 0; i < f->parts.size(); ++i) {
    const double s = f->scales[i];
    if (i > 0 || s < 0.0) out += i == 0 ? "-" : s < 0.0 ? " - " : " + ";
    if (std::abs(s) != 1.0) out += fmt::format("{:g} ", std::abs(s));
    out += text_of(f->parts[i]);
  }
  return out;
}

int size_of(const SpatialOperators& tree, const Stack& s) {
  return s.space == Space::node ? 6 * static_cast<int>(s.nodes.size()) : tree.size(s.space);
}

std::string_view name_of(Space s) {
  constexpr std::string_view names[] = {"hinge", "body", "node", "rate"};
  return names[static_cast<std::size_t>(s)];
}
std::string shape_of(const SpatialOperators& tree, const Formula& f) {
  if (f->form == Form::unit) return "I";
  return fmt::format("{} x {} ({} x {})", name_of(f->rows.space), name_of(f->cols.space), size_of(tree, f->rows), size_of(tree, f->cols));
}

[[noreturn]] void fail(Code code, const std::string& where, std::string expected, std::string got, std::string hint = {}) {
  refuse(code, {where}, std::move(expected), std::move(got), std::move(hint));
}

Eigen::VectorXd run(const SpatialOperators& tree, const Formula& f, const Eigen::VectorXd& x) {
  Eigen::VectorXd y(size_of(tree, f->rows));
  switch (f->form) {
    case Form::leaf:
      if (f->kind == Kind::B)
        tree.apply_nodes(f->starred ? f->rows.nodes : f->cols.nodes, f->starred, x.data(), y.data());
      else
        tree.apply(f->kind, f->starred, x.data(), y.data());
      return y;
    case Form::block_inverse:
      tree.apply_inverse(f->kind, x.data(), y.data());
      return y;
    case Form::identity:
    case Form::unit:
      return x;
    case Form::product: {
      Poll::now();
      static const Formula inverse = Written{}(letters::mass_inverse);
      const auto fused = same(f, mass_of()) ? SpatialOperators::Fused::mass
                         : same(f, inverse) ? SpatialOperators::Fused::mass_inverse
                                            : SpatialOperators::Fused::none;
      if (fused != SpatialOperators::Fused::none && tree.fused(fused, x.data(), y.data())) return y;
      y = x;
      for (auto p = f->parts.rbegin(); p != f->parts.rend(); ++p) y = run(tree, *p, y);
      return y;
    }
    case Form::sum:
      break;
  }
  y.setZero();
  for (std::size_t i = 0; i < f->parts.size(); ++i) y += f->scales[i] * run(tree, f->parts[i], x);
  return y;
}

void require_stages(const SpatialOperators& tree, const Formula& f) {
  if (f->form == Form::leaf || f->form == Form::block_inverse) tree.require(f->kind);
  for (const Formula& p : f->parts) require_stages(tree, p);
}

SpaceLabels labels_of(const SpatialOperators& tree, const Stack& s, Sort sort) {
  return s.space == Space::node ? tree.node_labels(s.nodes, sort) : tree.labels(s.space, sort);
}

}  // namespace

Expression Expression::leaf(Tree tree, Kind kind) {
  Formula f = leaf_of(kind, false, kind == Kind::B ? tree->nodes() : std::vector<int>{});
  return {std::move(tree), std::move(f)};
}
Expression Expression::nodes(Tree tree, std::vector<int> nodes) {
  tree->require_nodes(nodes);
  return {std::move(tree), leaf_of(Kind::B, false, nodes)};
}
Expression Expression::identity(Tree tree, Space space) {
  Formula f = identity_of({space, space == Space::node ? tree->nodes() : std::vector<int>{}});
  return {std::move(tree), std::move(f)};
}
Expression Expression::unit(Tree tree) { return {std::move(tree), make({.form = Form::unit})}; }
std::span<const Expression::Named> Expression::named() {
  static constexpr auto of = []<auto E>(Tree tree)->Expression { return {tree, Written{tree->nodes()}(E)}; };
  static const Named all[] = {{"mass", [](Tree t) { return of.operator()<letters::mass>(std::move(t)); }},
                              {"omega", [](Tree t) { return of.operator()<letters::omega>(std::move(t)); }},
                              {"jacobian", [](Tree t) { return of.operator()<letters::jacobian>(std::move(t)); }},
                              {"mass_derivative", [](Tree t) { return of.operator()<letters::mass_derivative>(std::move(t)); }}};
  return all;
}

Expression Expression::star() const { return {tree_, star_of(formula_)}; }

Expression Expression::inv() const {
  if (formula_->rows != formula_->cols)
    fail(Code::no_inverse, "inverse of " + text(), "a square operator", shape(),
         "only products of square operators and the mass matrix have an inverse");
  const bool scaled = formula_->form == Form::sum && formula_->parts.size() == 1;  // which has an inverse by the same rule
  if (tree_->is_weighted() && same(scaled ? formula_->parts[0] : formula_, mass_of()))
    fail(Code::no_inverse, "inverse of " + text(), "articulate() without W", "D = H P H* + W",
         "with it, ((I + H phi K) D (I + H phi K)*):inv() is the inverse of mass + W");
  if (const auto f = inverse_of(formula_)) return {tree_, *f};
  fail(Code::no_inverse, "inverse of " + text(),
       "an operator whose inverse a rule gives: phi, psi, D, M, mass, I + H phi K, products of these", "no rule for it",
       "(...):dense() gives a matrix, and solve() its inverse");
}

namespace {
void same_tree(const Expression& a, const Expression& b, const char* sign) {
  if (a.tree() != b.tree())
    fail(Code::operator_shape, a.text() + sign + b.text(), "two operators of one tree at one q",
         a.tree()->model_pointer() == b.tree()->model_pointer() ? "operators taken at different times, or of different subgraphs"
                                                                : "operators of two models",
         "take both from the same operators()");
}
void expect_room(const Formula& a, const Formula& b) {
  if (const int n = a->letters + b->letters; n > Expression::kMaxLetters)
    fail(Code::operator_shape, "a formula", fmt::format("at most {} letters", Expression::kMaxLetters), fmt::format("{}", n),
         "(...):dense() makes a matrix of a part");
}
}  // namespace

Expression operator*(const Expression& a, const Expression& b) {
  same_tree(a, b, " * ");
  if (a.formula_->form == Form::unit) return b;
  if (b.formula_->form == Form::unit) return a;
  if (a.formula_->cols != b.formula_->rows)
    fail(Code::operator_shape, a.text() + " * " + b.text(), "columns of the left operator = rows of the right one",
         fmt::format("{} times {}", a.shape(), b.shape()), "a star() may be missing");
  expect_room(a.formula_, b.formula_);
  return {a.tree_, product_of({a.formula_, b.formula_})};
}
Expression operator*(double s, const Expression& a) {
  if (a.formula_->form == Form::unit)
    fail(Code::operator_shape, fmt::format("{:g} * I", s), "I in a sum or product with an operator", "I alone");
  return {a.tree_, sum_of({{s, a.formula_}})};
}
namespace {
Formula add(const SpatialOperators& tree, const Expression& ea, const Formula& a, const Formula& b, const Expression& eb, double sign) {
  Formula x = a, y = b;
  if (x->form == Form::unit && y->form == Form::unit) fail(Code::operator_shape, "I + I", "an operator beside I", "I");
  const Formula& other = x->form == Form::unit ? y : x;
  if ((x->form == Form::unit || y->form == Form::unit) && other->rows != other->cols)
    fail(Code::operator_shape, ea.text() + " + " + eb.text(), "a square operator beside I", shape_of(tree, other));
  if (x->form == Form::unit) x = identity_of(y->rows);
  if (y->form == Form::unit) y = identity_of(x->rows);
  if (x->rows != y->rows || x->cols != y->cols)
    fail(Code::operator_shape, ea.text() + (sign < 0 ? " - " : " + ") + eb.text(), "two operators of one shape",
         fmt::format("{} and {}", shape_of(tree, x), shape_of(tree, y)));
  expect_room(x, y);
  return sum_of({{1.0, x}, {sign, y}});
}
}  // namespace
Expression operator+(const Expression& a, const Expression& b) {
  same_tree(a, b, " + ");
  return {a.tree_, add(*a.tree_, a, a.formula_, b.formula_, b, 1.0)};
}
Expression operator-(const Expression& a, const Expression& b) {
  same_tree(a, b, " - ");
  return {a.tree_, add(*a.tree_, a, a.formula_, b.formula_, b, -1.0)};
}

Eigen::VectorXd Expression::apply(const Eigen::VectorXd& x) const {
  require_stages(*tree_, formula_);
  if (formula_->form != Form::unit && x.size() != cols())
    fail(Code::operator_shape, text(), fmt::format("a vector of {} ({} space)", cols(), name_of(formula_->cols.space)),
         fmt::format("one of {}", x.size()));
  return run(*tree_, formula_, x);
}

Eigen::MatrixXd Expression::dense() const {
  require_stages(*tree_, formula_);
  Eigen::MatrixXd out(rows(), cols());
  Eigen::VectorXd unit = Eigen::VectorXd::Zero(cols());
  for (Eigen::Index j = 0; j < out.cols(); ++j) {
    unit[j] = 1.0;
    Poll::now();
    out.col(j) = run(*tree_, formula_, unit);
    unit[j] = 0.0;
  }
  return out;
}

namespace {
/// The k largest eigenvalues of a symmetric positive semidefinite operator of size n, descending.
template <class Multiply>
Eigen::VectorXd largest_eigenvalues(const Multiply& multiply, int n, int k) {
  const auto same_vector = [](const Eigen::VectorXd& x, Eigen::VectorXd& y) { y = x; };
  const MultiplyRef inverse(multiply), mass(same_vector);
  const Eigenpairs pairs = lowest_eigenpairs({n, n, inverse, inverse}, {n, n, mass, mass}, k, 0.0);
  return pairs.values.cwiseInverse();
}
}  // namespace

double Expression::norm() const {
  if (std::min(rows(), cols()) == 0) return 0.0;
  if (std::max(rows(), cols()) <= kFormed) return singular_values(dense())[0];
  const auto any = Eigen::VectorXd::NullaryExpr(cols(), [](Eigen::Index i) { return std::sin(1.0 + static_cast<double>(i)); });
  if (apply(any).isZero(0.0)) return 0.0;  // Lanczos' method would find no vectors
  const Expression turned = star();
  return std::sqrt(largest_eigenvalues([&](const Eigen::VectorXd& x, Eigen::VectorXd& y) { y = turned.apply(apply(x)); }, cols(), 1)[0]);
}

Eigen::VectorXd Expression::eigenvalues(int k) const {
  if (rows() != cols()) fail(Code::operator_shape, "eigenvalues of " + text(), "a square operator", shape());
  const int n = rows();
  if (k < 1 || k > n) fail(Code::out_of_range, "eigenvalues of " + text(), fmt::format("1 ... {} of them", n), fmt::format("{}", k));
  Eigen::VectorXd a(n), b(n);
  for (int i = 0; i < n; ++i) a[i] = std::sin(1.0 + i), b[i] = std::cos(2.0 + 3.0 * i);
  const double left = a.dot(apply(b)), right = b.dot(apply(a));
  if (std::abs(left - right) > 1e-9 * (std::abs(left) + std::abs(right)))
    fail(Code::operator_shape, "eigenvalues of " + text(), "a symmetric operator",
         fmt::format("x* A y = {:.6g}, y* A x = {:.6g}", left, right), "(A:star() * A):eig(k) gives the squares of the singular values");
  if (n <= kFormed || 2 * k + 8 >= n) {  // for so many Lanczos' method forms it too, as one that is definite
    const Eigen::MatrixXd A = dense();
    return symmetric_eigenvalues(0.5 * (A + A.transpose())).reverse().head(k);
  }
  return largest_eigenvalues([&](const Eigen::VectorXd& x, Eigen::VectorXd& y) { y = apply(x); }, n, k);
}

int Expression::rows() const {
  if (formula_->form == Form::unit) fail(Code::operator_shape, "I", "I in a sum or product with an operator", "I alone");
  return size_of(*tree_, formula_->rows);
}
int Expression::cols() const {
  if (formula_->form == Form::unit) fail(Code::operator_shape, "I", "I in a sum or product with an operator", "I alone");
  return size_of(*tree_, formula_->cols);
}
SpaceLabels Expression::row_labels() const { return labels_of(*tree_, formula_->rows, formula_->gives); }
SpaceLabels Expression::column_labels() const { return labels_of(*tree_, formula_->cols, formula_->takes); }
Sort Expression::gives() const { return formula_->gives; }
Sort Expression::takes() const { return formula_->takes; }
int Expression::letters() const { return formula_->letters; }
std::string Expression::text() const { return text_of(formula_); }
std::string Expression::shape() const { return shape_of(*tree_, formula_); }

}  // namespace cardan::operators
