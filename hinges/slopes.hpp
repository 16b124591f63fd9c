#pragma once
// From the slopes of a C++ hinge (a static function of its struct) to the function that its registry keeps.
#include "core/abi/family.hpp"
#include "core/abi/hinge_slopes.hpp"

namespace cardan {

/// Slopes of what HingeOut has, in each coordinate, and of Hdot_v in each rate; zero at first.
template <int NQ, int NV>
struct SlopesOut {
  HingeOut<NV> in_q[NQ];
  Eigen::Matrix<double, 6, NV> in_v = Eigen::Matrix<double, 6, NV>::Zero();
  SlopesOut() {
    for (HingeOut<NV>& slope : in_q) slope.R_OP.setZero();
  }
};

/// a~.
inline Eigen::Matrix3d tilde(const Eigen::Vector3d& a) {
  return (Eigen::Matrix3d() << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0).finished();
}

template <class F>
HingeSlopes slopes_of() {
  return [](const void* packed, const double* q, const double* v, cardan_hinge_out* in_q, double* in_v) {
    SlopesOut<F::nq, F::nv> slopes;
    F::slopes(*static_cast<const typename F::Packed*>(packed), q, v, slopes);
    for (int i = 0; i < F::nq; ++i) detail::store(slopes.in_q[i], in_q[i]);
    std::copy_n(slopes.in_v.data(), 6 * F::nv, in_v);
  };
}

}  // namespace cardan
