#pragma once
// Spatial operators as values (Rodriguez, Jain & Kreutz-Delgado 1991; Jain 2011): H, phi, M, psi, K, D, ... compose by +, -, *,
// star() and inv() into empty types. The formula is the type: nothing is stored, nothing is formed, copying is free; apply.hpp
// reads the type. What each leaf is, its frames, shapes and units: spatial_operators.hpp, docs/operators.md.
//
//   using namespace letters;
//   constexpr auto mass = H * phi * M * star(phi) * star(H);
//   constexpr auto mass_inverse = inv(mass);          // (1 - H psi K)* D^-1 (1 - H psi K), by rule
//
// Sums and products of operators whose spaces do not fit do not compile.
#include <type_traits>

#include "core/operators/spatial_operators.hpp"

namespace cardan::operators {

template <Kind K, bool Star = false>
struct Leaf {};
/// Inverse of the block-diagonal D and M.
template <Kind K>
struct BlockInverse {};
template <Space S>
struct Identity {};
/// Identity of whichever space it meets.
struct Unit {};
template <class... Factors>
struct Product {};
template <class A, class B>
struct Sum {};
template <class A>
struct Minus {};

// --- spaces -------------------------------------------------------------------------------------------------------------------
template <class E>
struct Shape;
template <Kind K, bool Star>
struct Shape<Leaf<K, Star>> {
  static constexpr Space rows = Star ? facts(K).columns : facts(K).rows;
  static constexpr Space cols = Star ? facts(K).rows : facts(K).columns;
};
template <Kind K>
struct Shape<BlockInverse<K>> : Shape<Leaf<K>> {};
template <Space S>
struct Shape<Identity<S>> {
  static constexpr Space rows = S, cols = S;
};
template <class A>
struct Shape<Product<A>> : Shape<A> {};
template <class A, class B, class... Rest>
struct Shape<Product<A, B, Rest...>> {
  static constexpr Space rows = Shape<A>::rows, cols = Shape<Product<B, Rest...>>::cols;
};
template <class A, class B>
struct Shape<Sum<A, B>> : Shape<A> {};
template <class A>
struct Shape<Minus<A>> : Shape<A> {};

template <class E>
concept Symbolic = requires {
  Shape<E>::rows;
};
template <class E>
concept Operand = Symbolic<E> || std::is_same_v<E, Unit>;
template <class A, class B>
inline constexpr bool kSameShape = Shape<A>::rows == Shape<B>::rows&& Shape<A>::cols == Shape<B>::cols;

// --- the letters ----------------------------------------------------------------------------------------------------------------
namespace letters {
inline constexpr Leaf<Kind::H> H;
inline constexpr Leaf<Kind::phi> phi;
inline constexpr Leaf<Kind::E_phi> E_phi;
inline constexpr Leaf<Kind::M> M;
inline constexpr Leaf<Kind::B> B;
inline constexpr Leaf<Kind::P> P;
inline constexpr Leaf<Kind::P_plus> P_plus;
inline constexpr Leaf<Kind::D> D;
inline constexpr Leaf<Kind::G> G;
inline constexpr Leaf<Kind::tau_bar> tau_bar;
inline constexpr Leaf<Kind::K> K;
inline constexpr Leaf<Kind::E_psi> E_psi;
inline constexpr Leaf<Kind::psi> psi;
inline constexpr Leaf<Kind::Y> Y;
inline constexpr Leaf<Kind::Y_plus> Y_plus;
inline constexpr Leaf<Kind::dH> dH;
inline constexpr Leaf<Kind::dE_phi> dE_phi;
inline constexpr Leaf<Kind::dM> dM;
inline constexpr Leaf<Kind::X> X;
inline constexpr Leaf<Kind::dX> dX;
inline constexpr Unit I;
}  // namespace letters

// --- products and sums ----------------------------------------------------------------------------------------------------------
namespace detail {
template <class A>
struct Factors {
  using type = Product<A>;
};
template <class... F>
struct Factors<Product<F...>> {
  using type = Product<F...>;
};
template <class A, class B>
struct Join;
template <class... A, class... B>
struct Join<Product<A...>, Product<B...>> {
  using type = Product<A..., B...>;
};
template <class E>
struct Simplify {
  using type = E;
};
template <class A>
struct Simplify<Product<A>> {
  using type = A;
};
}  // namespace detail

/// A B: products are flat, however they were bracketed.
template <Symbolic A, Symbolic B>
constexpr auto operator*(A, B) {
  static_assert(Shape<A>::cols == Shape<B>::rows, "the columns of the left operator and the rows of the right one are different spaces");
  return typename detail::Join<typename detail::Factors<A>::type, typename detail::Factors<B>::type>::type{};
}
template <Symbolic A>
constexpr A operator*(A, Unit) {
  return {};
}
template <Symbolic B>
constexpr B operator*(Unit, B) {
  return {};
}
template <Symbolic A, Symbolic B>
constexpr Sum<A, B> operator+(A, B) {
  static_assert(kSameShape<A, B>, "operators of different shapes cannot be added");
  return {};
}
template <Symbolic A>
constexpr auto operator+(A a, Unit) {
  return a + Identity<Shape<A>::rows>{};
}
template <Symbolic B>
constexpr auto operator+(Unit, B b) {
  return Identity<Shape<B>::rows>{} + b;
}
template <Symbolic A>
constexpr Minus<A> operator-(A) {
  return {};
}
template <Symbolic A>
constexpr A operator-(Minus<A>) {
  return {};
}
template <Operand A, Symbolic B>
constexpr auto operator-(A a, B b) {
  return a + (-b);
}
template <Symbolic A>
constexpr auto operator-(A a, Unit) {
  return a + Minus<Identity<Shape<A>::rows>>{};
}

// --- star: pushed to the leaves -------------------------------------------------------------------------------------------------
template <Kind K, bool Star>
constexpr auto star(Leaf<K, Star>) {
  if constexpr (facts(K).symmetric)
    return Leaf<K>{};
  else
    return Leaf<K, !Star>{};
}
template <Kind K>
constexpr BlockInverse<K> star(BlockInverse<K>) {
  return {};
}
template <Space S>
constexpr Identity<S> star(Identity<S>) {
  return {};
}
constexpr Unit star(Unit) { return {}; }
template <class A, class B>
constexpr auto star(Sum<A, B>);
template <class A>
constexpr auto star(Minus<A>);
template <class A>
constexpr auto star(Product<A>) {
  return star(A{});
}
template <class A, class B, class... Rest>
constexpr auto star(Product<A, B, Rest...>) {
  return star(typename detail::Simplify<Product<B, Rest...>>::type{}) * star(A{});
}
template <class A, class B>
constexpr auto star(Sum<A, B>) {
  return star(A{}) + star(B{});
}
template <class A>
constexpr auto star(Minus<A>) {
  return -star(A{});
}

// --- inverses by rule -------------------------------------------------------------------------------------------------------------
namespace detail {
using namespace letters;
using MassType = Product<Leaf<Kind::H>, Leaf<Kind::phi>, Leaf<Kind::M>, Leaf<Kind::phi, true>, Leaf<Kind::H, true>>;
using HphiK = Product<Leaf<Kind::H>, Leaf<Kind::phi>, Leaf<Kind::K>>;
using HpsiK = Product<Leaf<Kind::H>, Leaf<Kind::psi>, Leaf<Kind::K>>;
using One = Identity<Space::hinge>;

struct NoRule {};
/// The inverse of E where a rule of its own gives it.
template <class E>
constexpr NoRule rule(E) {
  return {};
}
template <Space S>
constexpr Identity<S> rule(Identity<S> e) {
  return e;
}
constexpr auto rule(Leaf<Kind::phi>) { return I - E_phi; }
constexpr auto rule(Leaf<Kind::psi>) { return I - E_psi; }
constexpr auto rule(decltype(I - E_phi)) { return phi; }
constexpr auto rule(decltype(I - E_psi)) { return psi; }
constexpr auto rule(Leaf<Kind::D>) { return BlockInverse<Kind::D>{}; }
constexpr auto rule(Leaf<Kind::M>) { return BlockInverse<Kind::M>{}; }
template <Kind K>
constexpr Leaf<K> rule(BlockInverse<K>) {
  return {};
}
constexpr auto rule(decltype(I + H * phi * K)) { return I - H * psi * K; }
constexpr auto rule(decltype(I - H * psi * K)) { return I + H * phi * K; }
constexpr auto rule(MassType) { return star(I - H * psi * K) * BlockInverse<Kind::D>{} * (I - H * psi * K); }
template <class E>
inline constexpr bool kHasRule = !std::is_same_v<decltype(rule(E{})), NoRule>;
}  // namespace detail

/// The inverse, by rule and never by a factorisation of the whole: of phi, psi, 1 - E_phi, 1 - E_psi; of D and M (block by
/// block); 1 + H phi K <-> 1 - H psi K; of the mass matrix H phi M phi* H* by its innovations factorisation; of products of
/// square operators; of the adjoint of each. Anything else does not compile.
template <Symbolic E>
constexpr auto inv(E e);
namespace detail {
template <class A>
constexpr auto inv_product(Product<A>) {
  return inv(A{});
}
template <class A, class B, class... Rest>
constexpr auto inv_product(Product<A, B, Rest...>) {
  return inv(typename Simplify<Product<B, Rest...>>::type{}) * inv(A{});
}
template <class E>
struct IsProduct : std::false_type {};
template <class... F>
struct IsProduct<Product<F...>> : std::true_type {};
template <class E>
struct Negated : std::false_type {};
template <class A>
struct Negated<Minus<A>> : std::true_type {
  using type = A;
};
}  // namespace detail
template <Symbolic E>
constexpr auto inv(E e) {
  static_assert(Shape<E>::rows == Shape<E>::cols, "only square operators have an inverse");
  if constexpr (detail::kHasRule<E>)
    return detail::rule(e);
  else if constexpr (detail::kHasRule<decltype(star(e))>)
    return star(detail::rule(star(e)));
  else if constexpr (detail::Negated<E>::value)
    return -inv(typename detail::Negated<E>::type{});
  else {
    static_assert(detail::IsProduct<E>::value, "no rule gives the inverse of this operator");
    return detail::inv_product(e);
  }
}

// --- what is written often --------------------------------------------------------------------------------------------------------
namespace letters {
/// Mass matrix, Newton-Euler factorisation, hinge x hinge (mathematics 4.1).
inline constexpr auto mass = H * phi * M * star(phi) * star(H);
/// The same by its innovations factorisation, square factors (4.5).
inline constexpr auto mass_innovations = (I + H * phi * K) * D * star(I + H * phi * K);
inline constexpr auto mass_inverse = inv(mass);
/// Derivative of the mass matrix along the direction of SpatialOperators::along (8.2).
inline constexpr auto mass_derivative = H * phi * (dE_phi * phi * M + dM + M * star(phi) * star(dE_phi)) * star(phi) * star(H) +
                                        dH * phi * M * star(phi) * star(H) + H * phi * M * star(phi) * star(dH);
/// Operational space compliance kernel Omega = psi* H* D^-1 H psi (6).
inline constexpr auto omega = star(psi) * star(H) * inv(D) * H * psi;
/// Jacobian of the selected nodes, node x hinge.
inline constexpr auto jacobian = star(B) * star(phi) * star(H);
}  // namespace letters

}  // namespace cardan::operators
