#include "core/operators/named_formulas.hpp"

namespace cardan::soa {

Expression omega_formula(std::shared_ptr<const TreeOperators> tree) {
  const auto leaf = [&](Kind k) { return Expression::leaf(tree, k); };
  return leaf(Kind::psi).star() * leaf(Kind::H).star() * leaf(Kind::D).inv() * leaf(Kind::H) * leaf(Kind::psi);
}

Expression jacobian_formula(std::shared_ptr<const TreeOperators> tree) {
  const auto leaf = [&](Kind k) { return Expression::leaf(tree, k); };
  return leaf(Kind::B).star() * leaf(Kind::phi).star() * leaf(Kind::H).star();
}

Expression mass_derivative_formula(std::shared_ptr<const TreeOperators> tree) {
  const auto leaf = [&](Kind k) { return Expression::leaf(tree, k); };
  const Expression H = leaf(Kind::H), phi = leaf(Kind::phi), M = leaf(Kind::M), dE = leaf(Kind::dE_phi), dH = leaf(Kind::dH),
                   dM = leaf(Kind::dM);
  return H * phi * (dE * phi * M + dM + M * phi.star() * dE.star()) * phi.star() * H.star() + dH * phi * M * phi.star() * H.star() +
         H * phi * M * phi.star() * dH.star();
}

}  // namespace cardan::soa
