#pragma once
// Formulas of the letters that have a name of their own, as values (Jain 2011: operational space, Jacobian, sensitivities). The same by
// type, with the spaces of each: operators.hpp. The tree must have reached the stage of its letters (C0901).
#include <memory>
#include <string_view>

#include "core/operators/expression.hpp"

namespace cardan::soa {

Expression omega_formula(std::shared_ptr<const TreeOperators> tree);     ///< psi* H* D^-1 H psi: body forces to body accelerations
Expression jacobian_formula(std::shared_ptr<const TreeOperators> tree);  ///< B* phi* H*: hinge rates to those of the nodes, node axes
Expression mass_derivative_formula(std::shared_ptr<const TreeOperators> tree);  ///< of H phi M phi* H*, along the direction of along()

struct NamedFormula {
  std::string_view name;
  Expression (*make)(std::shared_ptr<const TreeOperators>);
};
inline constexpr NamedFormula kNamedFormulas[] = {
    {"omega", omega_formula}, {"jacobian", jacobian_formula}, {"mass_derivative", mass_derivative_formula}};

}  // namespace cardan::soa
