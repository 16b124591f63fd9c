#define CARDAN_EIGEN_KERNELS_HERE
#include "core/linalg/eigen_products.hpp"

CARDAN_EIGEN_KERNELS(template struct, double)
