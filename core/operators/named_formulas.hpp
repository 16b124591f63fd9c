#pragma once
// Formulas of the letters that have a name of their own. The same by type: operators.hpp.
#include <memory>
#include <string_view>

#include "core/operators/expression.hpp"

namespace cardan::soa {

Expression omega_formula(std::shared_ptr<const TreeOperators> tree);            ///< psi* H* D^-1 H psi
Expression jacobian_formula(std::shared_ptr<const TreeOperators> tree);         ///< B* phi* H*
Expression mass_derivative_formula(std::shared_ptr<const TreeOperators> tree);  ///< of H phi M phi* H*, along the direction of along()

struct NamedFormula {
  std::string_view name;
  Expression (*make)(std::shared_ptr<const TreeOperators>);
};
inline constexpr NamedFormula kNamedFormulas[] = {
    {"omega", omega_formula}, {"jacobian", jacobian_formula}, {"mass_derivative", mass_derivative_formula}};

}  // namespace cardan::soa
