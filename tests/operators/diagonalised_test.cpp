// Diagonalised velocities (mathematics/diagonalised.md) on random trees: maps, energy, power of C, equations of motion, both forms.
#include "core/operators/diagonalised.hpp"

#include "core/operators/apply.hpp"
#include "core/soa/tangent.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {
namespace {

using operators::dense;
using soa::TreeOperators;
using Form = Diagonalised::Form;

constexpr double kExact = 1e-12;
constexpr int kTrees = 200;

std::vector<TreeOptions> kinds_of_trees() {
  TreeOptions rigid{.bodies = 7, .flexible = 0.0}, mixed{.bodies = 6, .flexible = 0.5}, flexible{.bodies = 4, .flexible = 1.0},
      central{.bodies = 5, .flexible = 0.4, .gravity = GravitySpec::Kind::central};
  return {rigid, mixed, flexible, central};
}
TreeOptions hybrid_trees() { return {.bodies = 6, .flexible = 0.4, .prescribed = 0.3}; }

double largest(const MatrixXd& a) { return a.size() == 0 ? 0.0 : a.cwiseAbs().maxCoeff(); }

struct Scene : Loaded {
  explicit Scene(const RandomTree& tree) : Loaded(tree), ops(model) { move(state.q); }
  void move(const VectorXd& q) {
    ops.at(q.data());
    std::vector<std::uint8_t> free(model->prescribed.size());
    for (std::size_t i = 0; i < free.size(); ++i) free[i] = model->prescribed[i] ? 0 : 1;
    ops.articulate({.free = free});
  }
  TreeOperators ops;
};

TEST(Diagonalised, MapsEnergyAndPower) {
  for (const TreeOptions& options : kinds_of_trees())
    for_all_trees(
        options, kExact,
        [](const RandomTree& tree) {
          Scene s(tree);
          if (s.model->nv == 0) return 0.0;
          const VectorXd& v = s.state.v;
          const MatrixXd M = mass_matrix(*s.model, s.ws, s.state.q.data());
          const double twice_energy = v.dot(M * v);
          Diagonalised form(s.ops);
          const VectorXd nu = form.from_velocity(v), C = form.coriolis(v), eps = form.eps(s.tau);
          VectorXd back = VectorXd::Zero(v.size());
          form.to_velocity(nu, back);
          // operator forms: nu = S* (1 + H phi K)* v, L eps = tau
          const MatrixXd one_plus = dense(operators::I + operators::H * operators::phi * operators::K, s.ops);
          MatrixXd S = MatrixXd::Zero(v.size(), v.size());
          for (std::size_t i = 0; i < s.ops.bodies().size(); ++i) {
            const auto& b = s.ops.bodies()[i];
            S.block(b.v, b.v, b.nh + b.m, b.nh + b.m) = s.ops.S(static_cast<int>(i));
          }
          const MatrixXd L = one_plus * S;
          const double power = std::abs(nu.dot(C)) / std::max(1e-300, nu.cwiseAbs().dot(C.cwiseAbs()) + largest(nu) * largest(C));
          return std::max({std::abs(nu.squaredNorm() - twice_energy) / twice_energy, apart(L.transpose() * v, nu), apart(L * L.transpose(), M),
                           largest(L * eps - s.tau) / std::max(largest(s.tau), largest(L) * largest(eps)), 1e-1 * power,
                           largest(L.transpose() * (back - v)) / largest(nu)});
        },
        kTrees);
}

/// D of the form without square roots: nu* C = 1/2 nu* D' nu, with D' along v.
TEST(Diagonalised, FormWithoutSquareRoots) {
  for (const TreeOptions& options : kinds_of_trees())
    for_all_trees(
        options, kExact,
        [](const RandomTree& tree) {
          Scene s(tree);
          if (s.model->nv == 0) return 0.0;
          const VectorXd& v = s.state.v;
          Diagonalised form(s.ops, Form::rates);
          const VectorXd nu = form.from_velocity(v), C = form.coriolis(v), Dnu = operators::apply(operators::D, s.ops, nu);
          const RiccatiRates rates = riccati_rates(s.ops, s.ops.derivatives(v.data()));
          double work = 0.0, size = nu.cwiseAbs().dot(C.cwiseAbs());
          for (std::size_t i = 0; i < s.ops.bodies().size(); ++i) {
            const auto& b = s.ops.bodies()[i];
            const VectorXd part = nu.segment(b.v, b.nh + b.m);
            work += 0.5 * part.dot(rates.D[i] * part);
            size += 0.5 * part.cwiseAbs().dot(rates.D[i].cwiseAbs() * part.cwiseAbs());
          }
          VectorXd back = VectorXd::Zero(v.size());
          form.to_velocity(nu, back);
          const double twice_energy = v.dot(mass_matrix(*s.model, s.ws, s.state.q.data()) * v);
          return std::max({std::abs(nu.dot(C) - work) / std::max(1e-300, size), std::abs(nu.dot(Dnu) - twice_energy) / twice_energy, 1e-3 * apart(back, v)});
        },
        kTrees);
}

/// nu' is the rate of nu along a motion that forward dynamics makes: differences of eighth order of nu(q, v) along it. Gravity, loads,
/// elastic forces, and given motions of some components.
TEST(Diagonalised, RateAlongTheMotion) {
  std::vector<TreeOptions> kinds = kinds_of_trees();
  kinds.push_back(hybrid_trees());
  for (const Form form_of : {Form::normalised, Form::rates})
    for (const TreeOptions& options : kinds)
      for_all_trees(
          options, 1e-11,
          [&](const RandomTree& tree) {
            Scene s(tree);
            const Model& m = *s.model;
            if (m.nv == 0) return 0.0;
            const VectorXd vdot = s.forward();
            Diagonalised form(s.ops, form_of);
            const VectorXd got = form.rate(s.in());
            VectorXd qdot(m.nq), want(m.nv), work(m.nv);
            m.qdot(s.state.q.data(), s.state.v.data(), qdot.data());
            const auto nu = [&](double t, double* out) {
              VectorXd q = s.state.q + t * qdot;
              m.normalise(q.data());
              s.move(q);
              Eigen::Map<VectorXd>(out, m.nv) = form.from_velocity(s.state.v + t * vdot);
            };
            soa::derivative(nu, 5e-3, m.nv, want.data(), work.data());
            return apart(got, want, 1.0);
          },
          40);
}

TEST(Diagonalised, GivenComponents) {  // no nu of their own; the rest comes back
  for_all_trees(
      hybrid_trees(), kExact,
      [](const RandomTree& tree) {
        Scene s(tree);
        const Model& m = *s.model;
        if (m.nv == 0) return 0.0;
        Diagonalised form(s.ops);
        const VectorXd nu = form.from_velocity(s.state.v), C = form.coriolis(s.state.v), eps = form.eps(s.tau);
        VectorXd back = s.state.v;
        for (int i = 0; i < m.nv; ++i) {
          const bool given = m.has_prescribed() && m.prescribed[static_cast<std::size_t>(i)];
          if (!given) back[i] = 77.0;
          if (given && (nu[i] != 0.0 || C[i] != 0.0 || eps[i] != 0.0)) return HUGE_VAL;
        }
        form.to_velocity(nu, back);
        return 1e-2 * apart(back, s.state.v);
      },
      kTrees);
}

TEST(Diagonalised, NeedsTheWholeTree) {
  Scene s(random_tree(5, {.bodies = 4, .flexible = 0.0}));
  TreeOperators sub = s.ops.subgraph(s.ops.subtree(1));
  EXPECT_THROW(Diagonalised{sub}, InputError);
}

}  // namespace
}  // namespace cardan::test
