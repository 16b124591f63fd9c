// y = A x and y = A* x for each letter of the algebra, body by body: O(N), no matrix of the size of the tree.
#include <algorithm>
#include <iterator>

#include "core/operators/tree_operators.hpp"

namespace cardan::operators {
namespace {

using Eigen::Map, Eigen::MatrixXd;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// One product. The blocks of body i are those of the tree; parts of x and y by space: `body` 6 + m numbers, `rigid` the six of them
/// that the inboard body sees, `hinge` the velocities of its hinge and modes.
class TreeProduct {
 public:
  TreeProduct(const TreeOperators& tree, bool star, const double* x_in, double* y_out, double* work, std::size_t widest)
      : t(tree), n(static_cast<int>(tree.bodies().size())), adjoint(star), x(x_in), y(y_out), w0(work), w1(work + widest) {}

  template <auto Block>
  void hinge_map() {  // H f or H* v
    for (int i = 0; i < n; ++i)
      if (adjoint)
        body(y, i).noalias() = (t.*Block)(i)*hinge(x, i);
      else
        hinge(y, i).noalias() = (t.*Block)(i).transpose() * body(x, i);
  }
  template <auto Block>
  void shift() {  // one step towards the base, or away from it
    clear();
    for (int i = 0; i < n; ++i) {
      if (parent(i) < 0) continue;
      if (adjoint)
        rigid(y, i).noalias() = (t.*Block)(i)*body(x, parent(i));
      else
        body(y, parent(i)).noalias() += (t.*Block)(i).transpose() * rigid(x, i);
    }
  }
  template <auto Block>
  void diagonal() {  // body by body
    for (int i = 0; i < n; ++i) body(y, i).noalias() = (t.*Block)(i)*body(x, i);
  }
  void D() {
    for (int i = 0; i < n; ++i) hinge(y, i).noalias() = t.D(i) * hinge(x, i);
  }
  void G() {
    for (int i = 0; i < n; ++i)
      if (adjoint)
        hinge(y, i).noalias() = t.G(i).transpose() * body(x, i);
      else
        body(y, i).noalias() = t.G(i) * hinge(x, i);
  }
  void phi() {
    std::copy(x, x + t.size(Space::body), y);
    if (adjoint) {
      for (int i = 0; i < n; ++i)
        if (parent(i) >= 0) rigid(y, i).noalias() += t.A(i) * body(y, parent(i));
    } else {
      for (int i = n - 1; i >= 0; --i)
        if (parent(i) >= 0) body(y, parent(i)).noalias() += t.A(i).transpose() * rigid(y, i);
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
    for (int i = 0; i < n; ++i) {
      if (adjoint) {
        Map<Eigen::VectorXd> h(w0, hinge_size(i));
        h.noalias() = t.G(i).transpose() * body(x, i);
        body(y, i) = body(x, i);
        body(y, i).noalias() -= t.Ht(i) * h;
      } else {
        relaxed(i, body(x, i));
        body(y, i) = Map<const Eigen::VectorXd>(w1, body_size(i));
      }
    }
  }
  void K() {
    if (!adjoint) clear();
    for (int i = 0; i < n; ++i) {
      if (parent(i) < 0) {
        if (adjoint) hinge(y, i).setZero();
        continue;
      }
      Vector6 a;
      if (adjoint) {
        a.noalias() = t.A(i) * body(x, parent(i));
        hinge(y, i).noalias() = t.G(i).topRows<6>().transpose() * a;
      } else {
        a.noalias() = t.G(i).topRows<6>() * hinge(x, i);
        body(y, parent(i)).noalias() += t.A(i).transpose() * a;
      }
    }
  }
  void B() { t.apply_nodes(t.nodes(), adjoint, x, y); }

 private:
  int parent(int i) const { return t.bodies()[i].parent; }
  int body_size(int i) const { return 6 + t.bodies()[i].m; }
  int hinge_size(int i) const { return t.bodies()[i].nh + t.bodies()[i].m; }
  Map<const Eigen::VectorXd> body(const double* a, int i) const { return {a + t.bodies()[i].at, body_size(i)}; }
  Map<Eigen::VectorXd> body(double* a, int i) const { return {a + t.bodies()[i].at, body_size(i)}; }
  Map<const Vector6> rigid(const double* a, int i) const { return Map<const Vector6>(a + t.bodies()[i].at); }
  Map<Vector6> rigid(double* a, int i) const { return Map<Vector6>(a + t.bodies()[i].at); }
  Map<const Eigen::VectorXd> hinge(const double* a, int i) const { return {a + t.bodies()[i].v, hinge_size(i)}; }
  Map<Eigen::VectorXd> hinge(double* a, int i) const { return {a + t.bodies()[i].v, hinge_size(i)}; }
  void clear() { Map<Eigen::VectorXd>(y, t.size(Space::body)).setZero(); }

  /// tau_bar f = f - G (H f), all of it in w1: its first six numbers.
  template <class F>
  Map<const Vector6> relaxed(int i, const F& f) {
    Map<Eigen::VectorXd> h(w0, hinge_size(i)), out(w1, body_size(i));
    h.noalias() = t.Ht(i).transpose() * f;
    out = f;
    out.noalias() -= t.G(i) * h;
    return Map<const Vector6>(w1);
  }
  /// y += E_psi or E_psi* of `from`, in the order in which y may be `from`.
  void relax_and_shift(const double* from) {
    if (!adjoint) {
      for (int i = n - 1; i >= 0; --i)
        if (parent(i) >= 0) body(y, parent(i)).noalias() += t.A(i).transpose() * relaxed(i, body(from, i));
      return;
    }
    for (int i = 0; i < n; ++i) {  // tau_bar* [A V(p); 0]
      if (parent(i) < 0) continue;
      Vector6 V;
      V.noalias() = t.A(i) * body(from, parent(i));
      Map<Eigen::VectorXd> h(w0, hinge_size(i));
      h.noalias() = t.G(i).topRows<6>().transpose() * V;
      rigid(y, i) += V;
      body(y, i).noalias() -= t.Ht(i) * h;
    }
  }

  const TreeOperators& t;
  const int n;
  const bool adjoint;
  const double* const x;
  double *const y, *const w0, *const w1;
};

/// In the order of Kind.
constexpr void (TreeProduct::*kProducts[])() = {
    &TreeProduct::hinge_map<&TreeOperators::Ht>,  // H
    &TreeProduct::phi,
    &TreeProduct::shift<&TreeOperators::A>,  // E_phi
    &TreeProduct::diagonal<&TreeOperators::M>,
    &TreeProduct::B,
    &TreeProduct::diagonal<&TreeOperators::P>,
    &TreeProduct::diagonal<&TreeOperators::P_plus>,
    &TreeProduct::D,
    &TreeProduct::G,
    &TreeProduct::tau_bar,
    &TreeProduct::K,
    &TreeProduct::E_psi,
    &TreeProduct::psi,
    &TreeProduct::diagonal<&TreeOperators::Y>,
    &TreeProduct::diagonal<&TreeOperators::Y_plus>,
    &TreeProduct::hinge_map<&TreeOperators::dHt>,  // dH
    &TreeProduct::shift<&TreeOperators::dA>,       // dE_phi
    &TreeProduct::diagonal<&TreeOperators::dM>,
};
static_assert(std::size(kProducts) == std::size(kKinds));

}  // namespace

void TreeOperators::apply(Kind kind, bool star, const double* x, double* y) const {
  require(kind);
  TreeProduct product(*this, star, x, y, work_.data(), work_.size() / 3);
  (product.*kProducts[static_cast<std::size_t>(kind)])();
}

}  // namespace cardan::operators
