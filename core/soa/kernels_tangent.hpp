#pragma once
#include "core/soa/kernels.hpp"
#include "core/soa/tangent.hpp"

namespace cardan::soa {

template <>
const Sweeps<Tangent>& sweeps<Tangent>();

}  // namespace cardan::soa
