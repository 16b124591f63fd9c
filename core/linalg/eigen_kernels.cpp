#define CARDAN_EIGEN_KERNELS_HERE
#include "core/linalg/eigen_kernels.hpp"

CARDAN_EIGEN_KERNELS(template struct, double)
