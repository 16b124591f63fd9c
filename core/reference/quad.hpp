#pragma once
// The 113-bit scalar of the twin: the format of float128 (34 digits) without a compiler's own type or library.
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <boost/multiprecision/eigen.hpp>

namespace cardan::reference {
using Quad = boost::multiprecision::cpp_bin_float_quad;
}
