#pragma once
// Mass matrix of one flexible body as a truncated function of its modal coordinates, and its Boltzmann-Hamel bias in
// the textbook form (Shabana 2013, chapter 5). Order of rows and columns: [angular 3; linear 3; modes], B axes.
#include "core/reference/dense_model.hpp"

namespace cardan::reference {

template <class T>
class ModalInertia {
 public:
  /// Levels 0 and 1: first order in eta of the sum over the points (second-order displacements Q play no part).
  explicit ModalInertia(const std::vector<MassPoint<T>>& points);
  /// Levels 0, 1 and 2; level 2 needs I9 and takes rotary inertia to first order.
  explicit ModalInertia(const ModalIntegrals& integrals);

  /// M_fl(eta) at this level, and its derivatives along each mode.
  ///   level 0: M_fl(0) with the moving mass centre in the block M_wv; 1: first order; 2: with the square terms of M_ww
  MatX<T> mass(const VecX<T>& eta, int level) const;
  std::vector<MatX<T>> mass_derivatives(const VecX<T>& eta, int level) const;

  /// b in M_fl [dV/dt; eta''] + b = force, V = [omega; v] of B in B axes, dV/dt the rate of its components; of mass() and
  /// mass_derivatives() at some eta and level.
  VecX<T> bias(const MatX<T>& mass, const std::vector<MatX<T>>& derivatives, const VecX<T>& etadot, const VecX<T>& V) const;

 private:
  int n_modes_;
  MatX<T> mass_;                 // M_fl(0)
  std::vector<MatX<T>> slope_;   // dM_fl/d eta_k at 0
  std::vector<Mat3<T>> square_;  // [l * m + k]: I9_lk; empty when unknown
};

}  // namespace cardan::reference
