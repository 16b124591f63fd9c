#include "core/operators/letter_products.hpp"
#include "core/operators/tree_operators.hpp"

namespace cardan::operators {

void TreeOperators::apply(Kind kind, bool star, const double* x, double* y) const {
  require(kind);
  LetterProduct<TreeOperators>(*this, star, x, y, work_.data(), work_.size() / 3).of(kind);
}

}  // namespace cardan::operators
