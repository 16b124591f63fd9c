// Diagonalised velocities by the sweeps of a step (mathematics/diagonalised.md, 4): energy, the way back, their rate along a motion; and
// against those of the operators, which are written from other formulas.
#include "core/dynamics/diagonal_velocities.hpp"

#include <algorithm>

#include "core/operators/diagonalised.hpp"
#include "tests/operators/compare.hpp"
#include "tests/plugins/told_modal.hpp"

namespace cardan::test {
namespace {

using operators::TreeOperators;

constexpr double kToRounding = 1e-12;

/// Every hinge, at every level, also bodies that a step eliminates through their nodes (more than six modes for each), wheels.
std::vector<TreeOptions> diagonal_kinds() {
  std::vector<TreeOptions> out = kinds_of_trees();
  out.push_back({.bodies = 5, .flexible = 0.6, .modes = 8});
  out.push_back({.bodies = 5, .flexible = 0.4, .gravity = GravitySpec::Kind::central});
  return out;
}
std::vector<TreeOptions> with_given_motions() {
  return {{.bodies = 6, .flexible = 0.4, .prescribed = 0.3}, {.bodies = 6, .flexible = 0.0, .prescribed = 0.3}};
}

bool has_given(const Model& m, int i) { return m.has_prescribed() && m.prescribed[idx(i)] != 0; }

struct Diagonal : Loaded {
  Diagonal(const RandomTree& tree, bool normalised) : Loaded(tree), form(model, normalised) { move(state.q); }
  void move(const VectorXd& q) {
    if (!form.at(q.data())) throw NumericsError(describe_breakdown(*model, form.breakdown(), 0.0));
  }
  VectorXd nu(const VectorXd& v) {
    VectorXd out(v.size());
    form.from_velocity(v.data(), out.data());
    return out;
  }
  VectorXd v(const VectorXd& nu) {
    VectorXd out(nu.size());
    form.to_velocity(nu.data(), out.data());
    return out;
  }
  VectorXd rate(const VectorXd& vdot) {
    VectorXd qdot(model->nq), out(model->nv);
    model->qdot(state.q.data(), state.v.data(), qdot.data());
    if (!form.rate(state.q.data(), qdot.data(), state.v.data(), vdot.data(), out.data())) throw std::logic_error("rate");
    return out;
  }
  DiagonalVelocities form;
};

/// T = 1/2 nu* nu, of any two velocities: L* is a root of M; and v comes back.
double energy_and_back(const std::shared_ptr<const Model>& model) {
  const Model& m = *model;
  if (m.nv == 0) return 0.0;
  const State s = m.initial_state();
  DiagonalVelocities form(model, true);
  if (!form.at(s.q.data())) return HUGE_VAL;
  Workspace ws(m);
  const MatrixXd M = mass_matrix(m, ws, s.q.data());
  const VectorXd &v = s.v, other = VectorXd::LinSpaced(m.nv, 1.0, -1.5).cwiseProduct(VectorXd::Ones(m.nv) + v);
  VectorXd nu(m.nv), of_other(m.nv), back(m.nv);
  form.from_velocity(v.data(), nu.data()), form.from_velocity(other.data(), of_other.data());
  form.to_velocity(nu.data(), back.data());
  const double size = std::sqrt(other.dot(M * other) * v.dot(M * v));
  return worse({std::abs(nu.squaredNorm() - v.dot(M * v)) / v.dot(M * v), std::abs(of_other.dot(nu) - other.dot(M * v)) / size,
                std::sqrt((back - v).dot(M * (back - v)) / v.dot(M * v))});
}

TEST(DiagonalVelocities, AreARootOfTheMassMatrix) {
  for (const TreeOptions& options : diagonal_kinds())
    for_all_trees(
        options, kToRounding, [](const RandomTree& tree) { return energy_and_back(compiled(tree.spec)); }, kTrees);
}

TEST(DiagonalVelocities, OfBodiesWhoseFamilyMovesTheirNodes) {
  Registry all = registry();
  all.bodies.add(told_modal(), "test");
  for (unsigned seed = first_seed(); seed < first_seed() + 30; ++seed) {
    SystemSpec spec = random_tree(seed, {.bodies = 6, .flexible = 0.7}).spec;
    for (BodySpec& b : spec.bodies)
      if (b.modal) b.type = told_modal().type;
    EXPECT_LT(energy_and_back(compile(spec, all)), kToRounding) << seed;
  }
}

/// Without roots: of one body's nu alone T knows nothing of another's, and a rate of a body on inboard bodies at rest is its own nu.
TEST(DiagonalVelocities, WithoutRootsAreRatesThatTheMassMatrixKeepsApart) {
  for (const TreeOptions& options : diagonal_kinds())
    for_all_trees(
        options, kToRounding,
        [](const RandomTree& tree) {
          Diagonal s(tree, false);
          const Model& m = *s.model;
          if (m.nv == 0) return 0.0;
          const MatrixXd M = mass_matrix(m, s.ws, s.state.q.data());
          std::vector<VectorXd> alone;  // v of the nu of one hinge, of one body's modes
          double worst = 0.0;
          for (std::size_t k = 1; k < m.bodies.size(); ++k) {
            const SweepBody& b = m.bodies[k];
            for (const auto& [first, n] : {std::pair(b.v, static_cast<int>(b.nv)), std::pair(b.etadot, b.n_modes)}) {
              if (n == 0) continue;
              VectorXd nu = VectorXd::Zero(m.nv);
              nu.segment(first, n).setLinSpaced(0.7, 1.3);
              alone.push_back(s.v(nu));
              const bool of_O = b.kind == BodyKernel::free && b.shape == CARDAN_SHAPE_FREE;  // whose nu is in the axes of P
              if (!of_O) worst = worse(worst, 0.1 * distance(alone.back().segment(first, n), nu.segment(first, n)));
            }
          }
          for (std::size_t i = 0; i < alone.size(); ++i)
            for (std::size_t j = 0; j < i; ++j) {
              const double size = std::sqrt(alone[i].dot(M * alone[i]) * alone[j].dot(M * alone[j]));
              worst = worse(worst, std::abs(alone[i].dot(M * alone[j])) / size);
            }
          return worst;
        },
        kTrees);
}

/// nu' is the rate of nu along a motion that forward dynamics makes: differences of eighth order along it. Gravity, loads, given motions.
TEST(DiagonalVelocities, RateAlongTheMotion) {
  std::vector<TreeOptions> kinds = diagonal_kinds();
  for (const TreeOptions& more : with_given_motions()) kinds.push_back(more);
  for (const bool normalised : {true, false})
    for (const TreeOptions& options : kinds)
      for_all_trees(
          options, 1e-11,
          [&](const RandomTree& tree) {
            Diagonal s(tree, normalised);
            const Model& m = *s.model;
            if (m.nv == 0) return 0.0;
            const VectorXd vdot = s.forward(), got = s.rate(vdot);
            VectorXd qdot(m.nq), want(m.nv), work(m.nv);
            m.qdot(s.state.q.data(), s.state.v.data(), qdot.data());
            const auto nu = [&](double t, double* out) {
              VectorXd q = s.state.q + t * qdot;
              m.normalise(q.data());
              s.move(q);
              Eigen::Map<VectorXd>(out, m.nv) = s.nu(s.state.v + t * vdot);
            };
            soa::derivative(nu, 5e-3, m.nv, want.data(), work.data());
            return apart(got, want, 1.0);
          },
          40);
}

/// nu* nu' = v* tau where all that acts is tau: C does no work.
TEST(DiagonalVelocities, CoriolisTermsDoNoWork) {
  for (TreeOptions options : diagonal_kinds()) {
    options.gravity = GravitySpec::Kind::none;
    for_all_trees(
        options, kToRounding,
        [](const RandomTree& tree) {
          Diagonal s(tree, true);
          const Model& m = *s.model;
          if (m.nv == 0) return 0.0;
          s.wrenches.clear();
          const VectorXd &v = s.state.v, vdot = s.forward(), nu = s.nu(v), rate = s.rate(vdot);
          const VectorXd force = s.tau + elastic_force(m, s.state.q.data(), v.data());
          return 0.1 * std::abs(nu.dot(rate) - v.dot(force)) / worse(1e-300, nu.norm() * rate.norm() + v.cwiseAbs().dot(force.cwiseAbs()));
        },
        kTrees);
  }
}

/// nu and nu' of rigid trees are those of Diagonalised, which forms P, D, G and their rates by other formulas. With modes the order of
/// elimination is another, and of six degrees of freedom by `free` the axes.
TEST(DiagonalVelocities, AreThoseOfTheOperatorsInRigidTrees) {
  for (const double prescribed : {0.0, 0.3})
    for (const bool normalised : {true, false})
      for_all_trees(
          {.bodies = 7, .flexible = 0.0, .prescribed = prescribed}, 1e-11,
          [&](const RandomTree& tree) {
            Diagonal s(tree, normalised);
            const Model& m = *s.model;
            if (m.nv == 0) return 0.0;
            TreeOperators ops(s.model);
            ops.at(s.state.q.data());
            std::vector<std::uint8_t> free(idx(m.nv), 1);
            for (int i = 0; i < m.nv; ++i) free[idx(i)] = !has_given(m, i);
            ops.articulate({.free = free});
            operators::Diagonalised form(ops,
                                         normalised ? operators::Diagonalised::Form::normalised : operators::Diagonalised::Form::rates);
            VectorXd nu = s.nu(s.state.v), rate = s.rate(s.forward());
            VectorXd want = form.from_velocity(s.state.v), want_rate = ops.to_model(form.rate(s.in()));
            for (int i = 0; i < m.nv; ++i)
              if (has_given(m, i)) {
                if (nu[i] != s.state.v[i] || rate[i] != s.vdot_given[i]) return HUGE_VAL;
                nu[i] = rate[i] = 0.0;
              }
            for (const SweepBody& b : m.bodies)
              if (b.kind == BodyKernel::free && b.shape == CARDAN_SHAPE_FREE)
                for (VectorXd* x : {&nu, &rate, &want, &want_rate}) x->segment(b.v, 6).setZero();
            return worse(apart(nu, want), apart(rate, want_rate, 1.0));
          },
          kTrees);
}

TEST(DiagonalVelocities, OfGivenMotionsComeBack) {
  for (const TreeOptions& options : with_given_motions())
    for_all_trees(
        options, kToRounding,
        [](const RandomTree& tree) {
          Diagonal s(tree, true);
          return s.model->nv == 0 ? 0.0 : 1e-2 * apart(s.v(s.nu(s.state.v)), s.state.v);
        },
        kTrees);
}

/// What devices hold comes and goes in a run.
TEST(DiagonalVelocities, LookAtWhatIsGivenNow) {
  SystemSpec spec = system(base_with_sprung_arm());
  DeviceSpec brake;
  brake.name = "brake", brake.type = "dry_friction";
  brake.params["coulomb"].value = 1.0;
  brake.mounts["at"].target = "arm";
  spec.devices = {brake};
  const auto model = std::make_shared<Model>(*compiled(spec));
  DiagonalVelocities form(model, true);
  const int arm = model->user[1].v;
  ASSERT_TRUE(model->has_prescribed());
  State s = model->initial_state();
  s.v[arm] = 0.7;
  for (const bool held : {false, true, false}) {
    model->prescribed[idx(arm)] = held;
    form.look_at_given();
    ASSERT_TRUE(form.at(s.q.data()));
    VectorXd nu(model->nv), back(model->nv);
    form.from_velocity(s.v.data(), nu.data()), form.to_velocity(nu.data(), back.data());
    EXPECT_EQ(nu[arm] == 0.7, held);
    EXPECT_LT(apart(back, s.v), kToRounding);
  }
}

/// The root of the sum of squares of what each of the rates makes of nu.
TEST(DiagonalVelocities, SizesAreRootsOfSumsOfSquares) {
  for_all_trees(
      {.bodies = 5, .roots = 1, .flexible = 0.4}, kToRounding,
      [](const RandomTree& tree) {
        Diagonal s(tree, true);
        const Model& m = *s.model;
        if (m.nv == 0) return 0.0;
        VectorXd v = VectorXd::LinSpaced(m.nv, 0.5, 2.0), got(m.nv), want = VectorXd::Zero(m.nv);
        s.form.size(v.data(), got.data());
        for (const SweepBody& b : m.bodies)
          for (int j = 0; j < m.nv; ++j) {
            VectorXd one = VectorXd::Zero(m.nv);
            one[j] = v[j];
            const VectorXd nu = s.nu(one);
            const auto add = [&](int first, int n) {
              if (j >= first && j < first + n) want.segment(first, n) += nu.segment(first, n).cwiseAbs2();
            };
            if (&b == m.bodies.data()) continue;
            if (b.kind == BodyKernel::free && b.shape == CARDAN_SHAPE_FREE) {  // in the axes of P
              if (j >= b.v && j < b.v + 6) got.segment(b.v, 6).setZero();
              continue;
            }
            add(b.v, b.nv), add(b.etadot, b.n_modes);
          }
        return apart(got, want.cwiseSqrt());
      },
      kTrees);
}

}  // namespace
}  // namespace cardan::test
