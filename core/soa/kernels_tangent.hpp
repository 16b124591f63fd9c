#pragma once
// The sweeps on numbers that carry their derivative (tangent.hpp): one set, for the baseline instruction set.
#include "core/soa/kernels.hpp"
#include "core/soa/tangent.hpp"

namespace cardan::soa {

template <>
const Sweeps<Tangent>& sweeps<Tangent>();

}  // namespace cardan::soa
