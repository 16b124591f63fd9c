#pragma once
// Operator expressions at run time: what the types of operators.hpp are to C++, these values are to Lua. The same letters, the
// same rules for star() and inv(), O(N), matrix-free. An expression refers to the operators of one tree at one q.
#include <Eigen/Core>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/operators/spatial_operators.hpp"

namespace cardan::operators {

class Expression {
 public:
  using Tree = std::shared_ptr<const SpatialOperators>;

  // Leaves
  static Expression leaf(Tree tree, Kind kind);
  /// B of these nodes (indices into Model::nodes) instead of the tree's selection.
  static Expression nodes(Tree tree, std::vector<int> nodes);
  static Expression identity(Tree tree, Space space);
  /// 1 of whichever space it meets in a sum; as a factor it is left out.
  static Expression unit(Tree tree);
  /// The formulas of operators.hpp that have a name, in its words: "mass", "omega", "jacobian", "mass_derivative".
  struct Named {
    std::string_view name;
    Expression (*of)(Tree);
  };
  static std::span<const Named> named();

  /// The longest formula: more letters are refused (C0902). On paper some twenty are many; in a loop they double.
  static constexpr int kMaxLetters = 4096;

  // Algebra. Errors C0902 name both operands and their shapes; operands of different trees do not mix.
  Expression star() const;
  /// By rule (operators.hpp); C0903 where there is none.
  Expression inv() const;
  friend Expression operator*(const Expression& a, const Expression& b);
  friend Expression operator*(double s, const Expression& a);
  friend Expression operator+(const Expression& a, const Expression& b);
  friend Expression operator-(const Expression& a, const Expression& b);

  // What it does
  Eigen::VectorXd apply(const Eigen::VectorXd& x) const;
  Eigen::MatrixXd dense() const;
  /// 2-norm: the largest singular value, in the units of the entries as they stand.
  double norm() const;
  /// The k largest eigenvalues, descending, of a symmetric expression that is positive semidefinite (C0902 for another).
  Eigen::VectorXd eigenvalues(int k) const;

  // What it is
  int rows() const;
  int cols() const;
  Sort gives() const;  ///< motions or forces, where the formula says so
  Sort takes() const;
  /// At the level of accelerations: units rad/s^2, N m.
  SpaceLabels row_labels() const;
  SpaceLabels column_labels() const;
  int letters() const;        ///< of the formula, which is what apply() goes through
  std::string text() const;   ///< "H phi M phi* H*"
  std::string shape() const;  ///< "hinge x body (12 x 34)"
  const Tree& tree() const { return tree_; }

  struct Node;  // one node of the formula, immutable

 private:
  using Formula = std::shared_ptr<const Node>;
  Expression(Tree tree, Formula formula) : tree_(std::move(tree)), formula_(std::move(formula)) {}
  Tree tree_;
  Formula formula_;
};

}  // namespace cardan::operators
