#define CARDAN_QUAD_KERNELS_HERE
#include "core/reference/factor.hpp"

#include <Eigen/LU>

#include "core/linalg/eigen_products.hpp"
#include "core/reference/quad.hpp"

CARDAN_EIGEN_KERNELS(template struct, cardan::reference::Quad)

namespace cardan::reference {

template <class T>
Factor<T>::Factor(const MatX<T>& A) : factor_(A) {}
template <class T>
bool Factor<T>::is_positive() const {
  return factor_.info() == Eigen::Success;
}
template <class T>
double Factor<T>::rcond() const {
  return static_cast<double>(factor_.rcond());
}
template <class T>
VecX<T> Factor<T>::solve(const VecX<T>& b) const {
  return factor_.solve(b);
}
template <class T>
MatX<T> Factor<T>::solve(const MatX<T>& B) const {
  return factor_.solve(B);
}

template <class T>
VecX<T> general_solve(const MatX<T>& A, const VecX<T>& b) {
  return A.partialPivLu().solve(b);
}

template class Factor<double>;
template class Factor<Quad>;
template VecX<double> general_solve(const MatX<double>&, const VecX<double>&);
template VecX<Quad> general_solve(const MatX<Quad>&, const VecX<Quad>&);

}  // namespace cardan::reference
