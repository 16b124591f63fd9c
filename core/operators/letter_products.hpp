#pragma once
// y = A x and y = A* x for each letter of the algebra, body by body: O(N), no matrix of the size of the whole. Of a tree of bodies, and of
// one of compound bodies: there several bodies (`members`) have the velocities of one hinge, and hang on one body (`home`) that is none of
// theirs. By members: H* of the compound, and Phi* from home to each of them.
#include <algorithm>
#include <iterator>

#include "core/operators/spatial_operators.hpp"

namespace cardan::operators {

/// One product. Parts of x and y by space: `body` 6 + m numbers, `rigid` the six of them that the inboard body sees, `hinge` the
/// velocities of a compound. `work`: three times `widest` numbers.
template <class Tree>
class LetterProduct {
 public:
  LetterProduct(const Tree& tree, bool star, const double* x_in, double* y_out, double* work, std::size_t widest)
      : t(tree), n(tree.count()), adjoint(star), x(x_in), y(y_out), w0(work), w1(work + widest), w2(work + 2 * widest) {}

  void of(Kind kind) {
    static_assert(std::size(kProducts) == std::size(kKinds));
    (this->*kProducts[static_cast<std::size_t>(kind)])();
  }

 private:
  using ConstVector = Eigen::Map<const Eigen::VectorXd>;
  using Vector = Eigen::Map<Eigen::VectorXd>;
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  template <auto Block>
  void hinge_map() {  // H f or H* v
    for (int c = 0; c < n; ++c)
      if (adjoint)
        for (const int i : t.members(c)) body(y, i).noalias() = (t.*Block)(i)*hinge(x, c);
      else
        gather<Block>(c, x, hinge(y, c));
  }
  template <auto Block>
  void shift() {  // one step towards the base, or away from it
    clear();
    for (int c = 0; c < n; ++c) {
      const int home = t.home(c);
      if (home < 0) continue;
      for (const int i : t.members(c))
        if (adjoint)
          rigid(y, i).noalias() = (t.*Block)(i)*body(x, home);
        else
          body(y, home).noalias() += (t.*Block)(i).transpose() * rigid(x, i);
    }
  }
  template <auto Block>
  void diagonal() {  // body by body
    for (int c = 0; c < n; ++c)
      for (const int i : t.members(c)) body(y, i).noalias() = (t.*Block)(i)*body(x, i);
  }
  void D() {
    for (int c = 0; c < n; ++c) hinge(y, c).noalias() = t.D(c) * hinge(x, c);
  }
  void G() {
    for (int c = 0; c < n; ++c)
      if (adjoint)
        gather<&Tree::G>(c, x, hinge(y, c));
      else
        for (const int i : t.members(c)) body(y, i).noalias() = t.G(i) * hinge(x, c);
  }
  void phi() {
    std::copy(x, x + t.size(Space::body), y);
    if (adjoint) {
      for (int c = 0; c < n; ++c)
        for (const int i : t.members(c))
          if (t.home(c) >= 0) rigid(y, i).noalias() += t.A(i) * body(y, t.home(c));
    } else {
      for (int c = n - 1; c >= 0; --c)
        for (const int i : t.members(c))
          if (t.home(c) >= 0) body(y, t.home(c)).noalias() += t.A(i).transpose() * rigid(y, i);
    }
  }
  void psi() {
    std::copy(x, x + t.size(Space::body), y);
    relax_and_shift(y);
  }
  void E_psi() {
    clear();
    relax_and_shift(x);
  }
  void tau_bar() {
    for (int c = 0; c < n; ++c) relax(c, x, y);
  }
  void K() {
    if (!adjoint) clear();
    for (int c = 0; c < n; ++c) {
      if (t.home(c) < 0) {
        if (adjoint) hinge(y, c).setZero();
        continue;
      }
      if (adjoint) {
        felt(c, body(x, t.home(c)), hinge(y, c), [](int, const Vector6&) {});
        continue;
      }
      Vector6 a;
      for (const int i : t.members(c)) {
        a.noalias() = t.G(i).template topRows<6>() * hinge(x, c);
        body(y, t.home(c)).noalias() += t.A(i).transpose() * a;
      }
    }
  }
  void B() { t.apply_nodes(t.nodes(), adjoint, x, y); }
  void X() { t.follow(adjoint, x, y); }
  void dX() { t.follow_change(adjoint, x, y); }
  /// What the blocks of single bodies do not give of a compound.
  void P_plus() {
    if constexpr (Tree::kCompounds) {  // P - G D G*
      diagonal<&Tree::P>();
      for (int c = 0; c < n; ++c) {
        Vector h(w0, t.hinge_size(c)), f(w1, t.hinge_size(c));
        gather<&Tree::G>(c, x, h);
        f.noalias() = t.D(c) * h;
        for (const int i : t.members(c)) body(y, i).noalias() -= t.G(i) * f;
      }
    } else {
      diagonal<&Tree::P_plus>();
    }
  }
  void Y_plus() {
    if constexpr (Tree::kCompounds)
      for (int c = 0; c < n; ++c) from_home(c, x, y);
    else
      diagonal<&Tree::Y_plus>();
  }
  void Y() {
    if constexpr (Tree::kCompounds) {  // H* D^-1 H + tau_bar* Y+ tau_bar
      adjoint = false;
      tau_bar();
      adjoint = true;
      for (int c = 0; c < n; ++c) {
        from_home(c, y, y);
        relax(c, y, y);
      }
      for (int c = 0; c < n; ++c) {
        Vector h(w0, t.hinge_size(c));
        gather<&Tree::Ht>(c, x, h);
        t.solve(c, h.data());
        for (const int i : t.members(c)) body(y, i).noalias() += t.Ht(i) * h;
      }
    } else {
      diagonal<&Tree::Y>();
    }
  }

  int body_size(int i) const { return 6 + t.bodies()[static_cast<std::size_t>(i)].m; }
  int at(int i) const { return t.bodies()[static_cast<std::size_t>(i)].at; }
  ConstVector body(const double* a, int i) const { return {a + at(i), body_size(i)}; }
  Vector body(double* a, int i) const { return {a + at(i), body_size(i)}; }
  Eigen::Map<const Vector6> rigid(const double* a, int i) const { return Eigen::Map<const Vector6>(a + at(i)); }
  Eigen::Map<Vector6> rigid(double* a, int i) const { return Eigen::Map<Vector6>(a + at(i)); }
  ConstVector hinge(const double* a, int c) const { return {a + t.hinge_at(c), t.hinge_size(c)}; }
  Vector hinge(double* a, int c) const { return {a + t.hinge_at(c), t.hinge_size(c)}; }
  void clear() { Vector(y, t.size(Space::body)).setZero(); }

  /// h = sum of Block* f over the members.
  template <auto Block>
  void gather(int c, const double* f, Vector h) const {
    bool first = true;
    for (const int i : t.members(c)) {
      if (first)
        h.noalias() = (t.*Block)(i).transpose() * body(f, i);
      else
        h.noalias() += (t.*Block)(i).transpose() * body(f, i);
      first = false;
    }
  }
  /// h = K* of what home does; visit(i, V): what of it member i sees.
  template <class OfHome, class Visit>
  void felt(int c, const OfHome& of_home, Vector h, const Visit& visit) const {
    bool first = true;
    for (const int i : t.members(c)) {
      Vector6 V;
      V.noalias() = t.A(i) * of_home;
      visit(i, V);
      if (first)
        h.noalias() = t.G(i).template topRows<6>().transpose() * V;
      else
        h.noalias() += t.G(i).template topRows<6>().transpose() * V;
      first = false;
    }
  }
  /// tau_bar f = f - G (H f), or tau_bar* V = V - H* (G* V). `to` may be `from`.
  void relax(int c, const double* from, double* to) {
    Vector h(w0, t.hinge_size(c));
    if (adjoint)
      gather<&Tree::G>(c, from, h);
    else
      gather<&Tree::Ht>(c, from, h);
    for (const int i : t.members(c)) {
      if (to != from) body(to, i) = body(from, i);
      if (adjoint)
        body(to, i).noalias() -= t.Ht(i) * h;
      else
        body(to, i).noalias() -= t.G(i) * h;
    }
  }
  /// Y+ = E_phi* Y E_phi. `to` may be `from`.
  void from_home(int c, const double* from, double* to) {
    const int home = t.home(c);
    if (home < 0) {
      for (const int i : t.members(c)) body(to, i).setZero();
      return;
    }
    Vector f(w1, body_size(home)), V(w2, body_size(home));
    f.setZero();
    for (const int i : t.members(c)) f.noalias() += t.A(i).transpose() * rigid(from, i);
    V.noalias() = t.Y(home) * f;
    for (const int i : t.members(c)) {
      body(to, i).setZero();
      rigid(to, i).noalias() = t.A(i) * V;
    }
  }
  /// y += E_psi or E_psi* of `from`, in the order in which y may be `from`.
  void relax_and_shift(const double* from) {
    if (!adjoint) {
      for (int c = n - 1; c >= 0; --c) {
        const int home = t.home(c);
        if (home < 0) continue;
        Vector h(w0, t.hinge_size(c));
        gather<&Tree::Ht>(c, from, h);
        for (const int i : t.members(c)) {
          Vector6 f = rigid(from, i);
          f.noalias() -= t.G(i).template topRows<6>() * h;
          body(y, home).noalias() += t.A(i).transpose() * f;
        }
      }
      return;
    }
    for (int c = 0; c < n; ++c) {  // tau_bar* [A V(p); 0]
      const int home = t.home(c);
      if (home < 0) continue;
      Vector h(w0, t.hinge_size(c));
      felt(c, body(from, home), h, [&](int i, const Vector6& V) { rigid(y, i) += V; });
      for (const int i : t.members(c)) body(y, i).noalias() -= t.Ht(i) * h;
    }
  }

  /// In the order of Kind.
  static constexpr void (LetterProduct::*kProducts[])() = {
      &LetterProduct::hinge_map<&Tree::Ht>,  // H
      &LetterProduct::phi,
      &LetterProduct::shift<&Tree::A>,  // E_phi
      &LetterProduct::diagonal<&Tree::M>,
      &LetterProduct::B,
      &LetterProduct::diagonal<&Tree::P>,
      &LetterProduct::P_plus,
      &LetterProduct::D,
      &LetterProduct::G,
      &LetterProduct::tau_bar,
      &LetterProduct::K,
      &LetterProduct::E_psi,
      &LetterProduct::psi,
      &LetterProduct::Y,
      &LetterProduct::Y_plus,
      &LetterProduct::hinge_map<&Tree::dHt>,  // dH
      &LetterProduct::shift<&Tree::dA>,       // dE_phi
      &LetterProduct::diagonal<&Tree::dM>,
      &LetterProduct::X,
      &LetterProduct::dX,
  };

  const Tree& t;
  const int n;
  bool adjoint;
  const double* const x;
  double *const y, *const w0, *const w1, *const w2;
};

}  // namespace cardan::operators
