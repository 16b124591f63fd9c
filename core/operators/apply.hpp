#pragma once
// y = E x for an operator expression: one short rule per kind of node, and the sweeps of a step where they give the same (picked
// by type). Intermediate vectors come from the scratch of the tree: nothing is allocated once it is large enough.
#include <fmt/format.h>

#include "core/base/diagnostic.hpp"
#include "core/linalg/linear_operator.hpp"
#include "core/operators/operators.hpp"

namespace cardan::operators {

/// Which sweeps give E.
template <class E>
inline constexpr SpatialOperators::Fused kFused = SpatialOperators::Fused::none;
template <>
inline constexpr SpatialOperators::Fused kFused<std::remove_const_t<decltype(letters::mass)>> = SpatialOperators::Fused::mass;
template <>
inline constexpr SpatialOperators::Fused kFused<std::remove_const_t<decltype(letters::mass_inverse)>> =
    SpatialOperators::Fused::mass_inverse;

namespace detail {

/// Intermediate vectors that E needs at once.
template <class E>
struct Room {
  static constexpr int count = 0;
};
template <class... F>
struct Room<Product<F...>> {
  static constexpr int count = [] {
    int most = 0;
    ((most = Room<F>::count > most ? Room<F>::count : most), ...);
    return most + 2;
  }();
};
template <class A, class B>
struct Room<Sum<A, B>> {
  static constexpr int count = 1 + (Room<A>::count > Room<B>::count ? Room<A>::count : Room<B>::count);
};
template <class A>
struct Room<Minus<A>> : Room<A> {};

/// The rules. `room`: Room<E>::count vectors of `stride` numbers.
template <bool Fuse>
struct Rules {
  const SpatialOperators& tree;
  std::ptrdiff_t stride;

  template <Kind K, bool Star>
  void operator()(Leaf<K, Star>, const double* x, double* y, double*) const {
    tree.apply(K, Star, x, y);
  }
  template <Kind K>
  void operator()(BlockInverse<K>, const double* x, double* y, double*) const {
    tree.apply_inverse(K, x, y);
  }
  template <Space S>
  void operator()(Identity<S>, const double* x, double* y, double*) const {
    std::copy(x, x + tree.size(S), y);
  }
  template <class A>
  void operator()(Minus<A>, const double* x, double* y, double* room) const {
    (*this)(A{}, x, y, room);
    for (int i = 0; i < tree.size(Shape<A>::rows); ++i) y[i] = -y[i];
  }
  template <class A, class B>
  void operator()(Sum<A, B>, const double* x, double* y, double* room) const {
    (*this)(A{}, x, y, room + stride);
    (*this)(B{}, x, room, room + stride);
    for (int i = 0; i < tree.size(Shape<A>::rows); ++i) y[i] += room[i];
  }
  template <class... F>
  void operator()(Product<F...> e, const double* x, double* y, double* room) const {
    if constexpr (Fuse && kFused<Product<F...>> != SpatialOperators::Fused::none)
      if (tree.fused(kFused<Product<F...>>, x, y)) return;
    factors(e, x, y, room, room + stride, room + 2 * stride);
  }

 private:
  template <class A>
  void factors(Product<A>, const double* x, double* y, double*, double*, double* room) const {
    (*this)(A{}, x, y, room);
  }
  /// Right to left, between two vectors.
  template <class A, class B, class... Rest>
  void factors(Product<A, B, Rest...>, const double* x, double* y, double* mine, double* other, double* room) const {
    factors(Product<B, Rest...>{}, x, mine, other, mine, room);
    (*this)(A{}, mine, y, room);
  }
};

template <class E>
void require_stages(E, const SpatialOperators&) {}
template <Kind K, bool Star>
void require_stages(Leaf<K, Star>, const SpatialOperators& tree) {
  tree.require(K);
}
template <Kind K>
void require_stages(BlockInverse<K>, const SpatialOperators& tree) {
  tree.require(K);
}
template <class... F>
void require_stages(Product<F...>, const SpatialOperators& tree);
template <class A, class B>
void require_stages(Sum<A, B>, const SpatialOperators& tree) {
  require_stages(A{}, tree), require_stages(B{}, tree);
}
template <class A>
void require_stages(Minus<A>, const SpatialOperators& tree) {
  require_stages(A{}, tree);
}
template <class... F>
void require_stages(Product<F...>, const SpatialOperators& tree) {
  (require_stages(F{}, tree), ...);
}

}  // namespace detail

/// y = E x, O(N). x, y: tree.size() numbers of the columns' and of the rows' space; they must not overlap. Error C0901 where a
/// stage of the tree is missing. Fuse = false: by the rules alone (for tests).
template <bool Fuse = true, Symbolic E>
void apply(E e, const SpatialOperators& tree, const double* x, double* y) {
  detail::require_stages(e, tree);
  const auto stride =
      static_cast<std::size_t>(std::max({tree.size(Space::hinge), tree.size(Space::body), tree.size(Space::node), tree.size(Space::rate)}));
  detail::Rules<Fuse>{tree, static_cast<std::ptrdiff_t>(stride)}(e, x, y, tree.scratch(stride * detail::Room<E>::count));
}

/// E x. Error C0902 for a vector of another size.
template <bool Fuse = true, Symbolic E>
Eigen::VectorXd apply(E e, const SpatialOperators& tree, const Eigen::VectorXd& x) {
  if (x.size() != tree.size(Shape<E>::cols))
    refuse(Code::operator_shape, {"operator expression"}, fmt::format("a vector of {}", tree.size(Shape<E>::cols)),
           fmt::format("one of {}", x.size()));
  Eigen::VectorXd y(tree.size(Shape<E>::rows));
  apply<Fuse>(e, tree, x.data(), y.data());
  return y;
}

/// The matrix of E, column by column: for tests and small analyses.
template <bool Fuse = true, Symbolic E>
Eigen::MatrixXd dense(E e, const SpatialOperators& tree) {
  Eigen::MatrixXd A(tree.size(Shape<E>::rows), tree.size(Shape<E>::cols));
  Eigen::VectorXd unit = Eigen::VectorXd::Zero(A.cols());
  for (Eigen::Index j = 0; j < A.cols(); ++j) {
    unit[j] = 1.0;
    apply<Fuse>(e, tree, unit.data(), A.col(j).data());
    unit[j] = 0.0;
  }
  return A;
}

/// An expression over a tree as the one run-time view that Krylov methods, ARPACK and J v of CVODE take. The view refers to this
/// and to the tree, which must outlive it.
template <Symbolic E>
class Erased {
 public:
  explicit Erased(const SpatialOperators& tree)
      : mult_{&tree}, mult_transpose_{&tree}, view_{tree.size(Shape<E>::rows), tree.size(Shape<E>::cols), mult_, mult_transpose_} {}
  Erased(const Erased&) = delete;
  operator const LinearOperator&() const { return view_; }  // NOLINT: it is the view

 private:
  template <class Expr>
  struct Call {
    const SpatialOperators* tree;
    void operator()(const Eigen::VectorXd& x, Eigen::VectorXd& y) const { apply(Expr{}, *tree, x.data(), y.data()); }
  };
  Call<E> mult_;
  Call<decltype(star(E{}))> mult_transpose_;
  LinearOperator view_;
};
template <Symbolic E>
Erased<E> erase(E, const SpatialOperators& tree) {
  return Erased<E>(tree);
}

}  // namespace cardan::operators
