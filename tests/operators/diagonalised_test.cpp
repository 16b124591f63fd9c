// Diagonalised velocities (mathematics/diagonalised.md) on random trees: maps, energy, power of C, equations of motion, both forms.
#include "core/operators/diagonalised.hpp"

#include <algorithm>

#include "core/operators/apply.hpp"
#include "core/soa/tangent.hpp"
#include "tests/operators/compare.hpp"

namespace cardan::test {
namespace {

using operators::dense;
using operators::TreeOperators;
using Form = operators::Diagonalised::Form;

constexpr double kExact = 1e-12;

std::vector<TreeOptions> kinds_with_gravity() {
  std::vector<TreeOptions> out = kinds_of_trees();
  out.push_back({.bodies = 5, .flexible = 0.4, .gravity = GravitySpec::Kind::central});
  return out;
}
TreeOptions hybrid_trees() { return {.bodies = 6, .flexible = 0.4, .prescribed = 0.3}; }

struct DiagonalisedScene : Loaded {
  explicit DiagonalisedScene(const RandomTree& tree) : Loaded(tree), ops(model) { move(state.q); }
  void move(const VectorXd& q) {
    ops.at(q.data());
    std::vector<std::uint8_t> free(model->prescribed.size());
    for (std::size_t i = 0; i < free.size(); ++i) free[i] = model->prescribed[i] ? 0 : 1;
    ops.articulate({.free = free});
  }
  TreeOperators ops;
};

/// The size of nu* C, at least that of what cancels where C is nothing but rounding, as of a single hinge: energy times rates.
double of_coriolis(double size, const VectorXd& nu, const VectorXd& v) { return worse({1e-300, size, nu.squaredNorm() * largest(v)}); }

TEST(Diagonalised, MapsEnergyAndPower) {
  for (const TreeOptions& options : kinds_with_gravity())
    for_all_trees(
        options, kExact,
        [](const RandomTree& tree) {
          DiagonalisedScene s(tree);
          if (s.model->nv == 0) return 0.0;
          const VectorXd& v = s.state.v;
          const MatrixXd M = mass_matrix(*s.model, s.ws, s.state.q.data());
          const double twice_energy = v.dot(M * v);
          operators::Diagonalised form(s.ops);
          const VectorXd nu = form.from_velocity(v), C = form.coriolis(v), eps = form.eps(s.tau);
          VectorXd back = VectorXd::Zero(v.size());
          form.to_velocity(nu, back);
          // operator forms: nu = S* (1 + H phi K)* v, L eps = tau
          const MatrixXd one_plus =
              dense(operators::letters::I + operators::letters::H * operators::letters::phi * operators::letters::K, s.ops);
          MatrixXd S = MatrixXd::Zero(v.size(), v.size());
          for (std::size_t i = 0; i < s.ops.bodies().size(); ++i) {
            const auto& b = s.ops.bodies()[i];
            S.block(b.v, b.v, b.nh + b.m, b.nh + b.m) = s.ops.S(static_cast<int>(i));
          }
          const MatrixXd L = one_plus * S;
          const double size = nu.cwiseAbs().dot(C.cwiseAbs()) + largest(nu) * largest(C),
                       power = std::abs(nu.dot(C)) / of_coriolis(size, nu, v);
          return worse({std::abs(nu.squaredNorm() - twice_energy) / twice_energy, apart(L.transpose() * v, nu), apart(L * L.transpose(), M),
                        largest(L * eps - s.tau) / worse(largest(s.tau), largest(L) * largest(eps)), 1e-1 * power,
                        largest(L.transpose() * (back - v)) / largest(nu)});
        },
        kTrees);
}

/// D of the form without square roots: nu* C = 1/2 nu* D' nu, with D' along v.
TEST(Diagonalised, FormWithoutSquareRoots) {
  for (const TreeOptions& options : kinds_with_gravity())
    for_all_trees(
        options, kExact,
        [](const RandomTree& tree) {
          DiagonalisedScene s(tree);
          if (s.model->nv == 0) return 0.0;
          const VectorXd& v = s.state.v;
          operators::Diagonalised form(s.ops, Form::rates);
          const VectorXd nu = form.from_velocity(v), C = form.coriolis(v), Dnu = operators::apply(operators::letters::D, s.ops, nu);
          operators::RiccatiRates rates;
          operators::riccati_rates(s.ops, s.ops.derivatives(v.data()), rates);
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
          return worse({std::abs(nu.dot(C) - work) / of_coriolis(size, nu, v), std::abs(nu.dot(Dnu) - twice_energy) / twice_energy,
                        1e-3 * apart(back, v)});
        },
        kTrees);
}

/// nu' is the rate of nu along a motion that forward dynamics makes: differences of eighth order of nu(q, v) along it. Gravity, loads,
/// elastic forces, and given motions of some components.
TEST(Diagonalised, RateAlongTheMotion) {
  std::vector<TreeOptions> kinds = kinds_with_gravity();
  kinds.push_back(hybrid_trees());
  for (const Form form_of : {Form::normalised, Form::rates})
    for (const TreeOptions& options : kinds)
      for_all_trees(
          options, 1e-11,
          [&](const RandomTree& tree) {
            DiagonalisedScene s(tree);
            const Model& m = *s.model;
            if (m.nv == 0) return 0.0;
            const VectorXd vdot = s.forward();
            operators::Diagonalised form(s.ops, form_of);
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
        DiagonalisedScene s(tree);
        const Model& m = *s.model;
        if (m.nv == 0) return 0.0;
        operators::Diagonalised form(s.ops);
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

/// The bodies at and outboard of `root`, hung on the world where root hung on its inboard body: at rest, the same system.
SystemSpec on_its_own(const SystemSpec& whole, const std::string& root) {
  SystemSpec out = whole;
  std::vector<std::string> kept{root};
  for (bool more = true; more;) {
    more = false;
    for (const BodySpec& b : whole.bodies)
      if (std::ranges::count(kept, b.hinge.inboard_body) && !std::ranges::count(kept, b.name)) kept.push_back(b.name), more = true;
  }
  std::erase_if(out.bodies, [&](const BodySpec& b) { return !std::ranges::count(kept, b.name); });
  for (BodySpec& b : out.bodies)
    if (b.name == root) b.hinge.inboard_body = b.hinge.inboard_node = "";
  return out;
}

TEST(Diagonalised, Subtrees) {  // nu, its inverse and C of a subtree are those of the subtree hung on the world
  for (const double flexible : {0.0, 0.5})
    for_all_trees(
        {.bodies = 6, .roots = 1, .flexible = flexible}, kExact,
        [](const RandomTree& tree) {
          DiagonalisedScene s(tree);
          double worst = 0.0;
          for (const auto& root : s.ops.bodies()) {
            TreeOperators part = s.ops.subgraph(s.ops.subtree(root.sweep));
            part.articulate();
            const int n = part.size(operators::Space::hinge);
            if (n == 0) continue;
            VectorXd v(n);
            for (int i = 0; i < s.model->nv; ++i)
              if (part.place_of_velocity(i) >= 0) v[part.place_of_velocity(i)] = s.state.v[i];
            operators::Diagonalised form(part);
            const VectorXd nu = form.from_velocity(v), C = form.coriolis(v);
            VectorXd back = VectorXd::Zero(n);
            form.to_velocity(nu, back);
            const double energy = v.dot(operators::apply(operators::letters::mass, part, v));
            const double power = std::abs(nu.dot(C)) / (largest(nu) * (largest(C) + largest(nu)));  // rates of 1/s: C is of the size of nu
            worst = worse({worst, apart(back, v) / 1e2, std::abs(nu.squaredNorm() - energy) / energy, 1e-1 * power});
            const UserBody& body = s.model->user[static_cast<std::size_t>(root.user)];
            const bool rigid = std::ranges::all_of(part.bodies(), [](const auto& b) { return b.m == 0; });
            if (!rigid || body.parent < 0) continue;
            const auto alone = compiled(on_its_own(tree.spec, body.name));
            if (alone->nv != n) continue;  // something is merged with the inboard body
            TreeOperators other(alone);
            other.at(alone->initial_state().q.data());
            other.articulate();
            operators::Diagonalised same(other);
            const VectorXd w = alone->initial_state().v;
            worst = worse({worst, apart(same.from_velocity(w), nu), apart(same.coriolis(w), C, nu.norm()) / 10});
          }
          return worst;
        },
        60);
}

}  // namespace
}  // namespace cardan::test
