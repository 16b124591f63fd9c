#pragma once
// Which plugin gave no number: asked when v' is none.
#include <string>

#include "core/model/model.hpp"

namespace cardan {

/// Asks the functions of the types that come from plugins once more at q and v (user order). The first that gives a number that is not
/// finite: `kinematics of hinge "acme/arc" (acme.so)`; empty if none does, or where q or v are not finite themselves. Of bodies with
/// modes at rest of their frame: their angular velocity is not known here.
std::string plugin_without_numbers(const Model& model, const double* q, const double* v);

}  // namespace cardan
