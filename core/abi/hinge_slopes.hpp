#pragma once
#include "core/abi/cardan_abi.h"

namespace cardan {

/// How the record of a hinge changes, at (q, v) of that hinge: in_q has nq records, its slopes in each coordinate, in_v those of Hdot_v in
/// each rate (6 x nv, column-major). What the contract does not ask for, built-in hinges tell their registry beside their table.
using HingeSlopes = void (*)(const void* packed, const double* q, const double* v, cardan_hinge_out* in_q, double* in_v);

}  // namespace cardan
