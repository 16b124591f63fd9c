// Derivatives of the dynamics (mathematics/sensitivities.md) on random trees: against the dense twin in 113 bits, differenced, which
// knows nothing of tangents; against one another; and laws that need no reference.
#include "core/operators/sensitivity.hpp"

#include "core/operators/apply.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "core/reference/factor.hpp"
#include "core/reference/quad.hpp"
#include "tests/operators/compare.hpp"

namespace cardan::test {
namespace {

using reference::DenseModel;
using reference::DenseState;
using reference::DenseTwin;
using reference::Quad;
using VectorQ = Eigen::Matrix<Quad, Eigen::Dynamic, 1>;
using MatrixQ = Eigen::Matrix<Quad, Eigen::Dynamic, Eigen::Dynamic>;

constexpr double kDerivative = 1e-12;  // of the largest entry
constexpr int kTwins = 30;

std::vector<TreeOptions> kinds_with_springs() {
  TreeOptions rigid{.bodies = 7, .flexible = 0.0, .springs = true, .loads = true}, mixed{.bodies = 6, .flexible = 0.5, .springs = true},
      flexible{.bodies = 4, .flexible = 1.0}, central{.bodies = 5, .flexible = 0.4, .locked = 0.2, .gravity = GravitySpec::Kind::central};
  return {rigid, mixed, flexible, central};
}

/// Twins at 113 bits are slow: small trees. In a central field what sweeps and twin define alike: no merged bodies (a field is expanded
/// about the mass centre of what is merged), level 1 or 2.
std::vector<TreeOptions> kinds_of_small_trees() {
  std::vector<TreeOptions> out = kinds_with_springs();
  for (TreeOptions& o : out) o.bodies = 3;
  out[0].bodies = 4, out[0].locked = 0.3;
  TreeOptions& central = out[3];
  central.locked = 0.0, central.level = 1;
  std::erase(central.hinges, "locked");
  out.push_back(central);
  out[4].level = 2;
  return out;
}

/// A tree with loads at its state; v' that of the tree's random accelerations.
struct LoadedScene : Loaded {
  explicit LoadedScene(const RandomTree& tree) : Loaded(tree), sens(model) { vdot = in_user_order(*model, tree.vdot); }
  Inputs at_vdot() const {
    Inputs i = in();
    i.vdot = vdot.data();
    return i;
  }
  VectorXd direction(int which) const {
    VectorXd u(model->nv);
    for (Eigen::Index i = 0; i < u.size(); ++i) u[i] = std::sin(1.0 + which + 1.7 * static_cast<double>(i));
    return u;
  }
  operators::Sensitivities sens;
  VectorXd vdot;
};

/// tau of inverse dynamics by the twin, with q moved by the tangent vector u, springs included. Loads in world axes become node axes.
VectorQ twin_tau(const DenseTwin<Quad>& twin, const RandomTree& tree, const VectorQ& q, const VectorQ& v, const VectorQ& vdot) {
  const DenseState<Quad> s = twin.at(q, v);
  reference::NodeWrenches<Quad> loads;
  for (const Load& l : tree.loads) {
    VectorQ w = l.wrench.cast<Quad>();
    if (l.world_axes) {
      const auto R = s.node(l.body, l.node).R;
      w.head(3) = (R.transpose() * w.head(3)).eval();
      w.tail(3) = (R.transpose() * w.tail(3)).eval();
    }
    loads.push_back({l.body, l.node, w});
  }
  return s.inverse(vdot, loads);
}

/// Derivative at 0 of f by differences of sixth order, h small enough for 113 bits.
template <class F>
VectorXd slope(const F& f) {
  const Quad h(1e-5);
  const VectorQ d = (45 * (f(h) - f(Quad(-h))) - 9 * (f(Quad(2 * h)) - f(Quad(-2 * h))) + (f(Quad(3 * h)) - f(Quad(-3 * h)))) / (60 * h);
  return d.cast<double>();
}

TEST(Sensitivity, OfInverseDynamicsAgainstTheTwin) {
  for (const TreeOptions& options : kinds_of_small_trees())
    for_all_trees(
        options, kDerivative,
        [](const RandomTree& tree) {
          LoadedScene s(tree);
          if (s.model->nv == 0) return 0.0;
          const DenseTwin<Quad> twin(tree.spec);
          const VectorQ q = s.state.q.cast<Quad>(), v = s.state.v.cast<Quad>(), vdot = s.vdot.cast<Quad>();
          const VectorXd u = s.direction(1), w = s.direction(2), a = s.direction(3);
          // the twin divides by the norm of a quaternion, so q + s N u serves as the path
          const VectorQ rate = twin.at(q, u.cast<Quad>()).qdot;
          s.sens.at(s.at_vdot());
          VectorXd got(s.model->nv);
          s.sens.inverse({.q = u.data(), .v = w.data(), .vdot = a.data()}, got.data());
          const VectorXd want =
              slope([&](const Quad& h) { return twin_tau(twin, tree, q + h * rate, v + h * w.cast<Quad>(), vdot + h * a.cast<Quad>()); });
          return worse(differ(got, want), differ(s.sens.tau(), twin_tau(twin, tree, q, v, vdot).cast<double>()));
        },
        kTwins);
}

TEST(Sensitivity, OfForwardDynamicsAgainstTheTwin) {
  for (const TreeOptions& options : kinds_of_small_trees())
    for_all_trees(
        options, 1e-11,
        [](const RandomTree& tree) {
          LoadedScene s(tree);
          if (s.model->nv == 0) return 0.0;
          const DenseTwin<Quad> twin(tree.spec);
          const VectorQ q = s.state.q.cast<Quad>(), v = s.state.v.cast<Quad>(), tau = s.tau.cast<Quad>();
          const VectorXd u = s.direction(1), w = s.direction(2), f = s.direction(3);
          const VectorQ rate = twin.at(q, u.cast<Quad>()).qdot, none = VectorQ::Zero(q.size() > 0 ? s.model->nv : 0);
          s.sens.solve(s.in());
          VectorXd got(s.model->nv);
          s.sens.forward({.q = u.data(), .v = w.data(), .tau = f.data()}, got.data());
          const VectorXd want = slope([&](const Quad& h) {
            const VectorQ qh = q + h * rate, vh = v + h * w.cast<Quad>();
            const VectorQ missing = tau + h * f.cast<Quad>() - twin_tau(twin, tree, qh, vh, none);
            return reference::Factor<Quad>(twin.at(qh, vh).M).solve(missing);
          });
          return differ(got, want);
        },
        kTwins);
}

/// A path that knows nothing of the inverse: the articulated sweeps on tangents.
TEST(Sensitivity, OfForwardDynamicsAgainstTheArticulatedSweeps) {
  std::vector<TreeOptions> kinds = kinds_with_springs();
  TreeOptions hybrid{.bodies = 6, .flexible = 0.4, .prescribed = 0.3};
  kinds.push_back(hybrid);
  TreeOptions many_modes{.bodies = 5, .flexible = 0.6, .modes = 20, .plain_masses = true};  // eliminated through their nodes
  kinds.push_back(many_modes);
  for (TreeOptions& options : kinds) {
    options.springs = options.loads = false;
    for_all_trees(
        options, 1e-11,
        [](const RandomTree& tree) {
          LoadedScene s(tree);
          const Model& m = *s.model;
          if (m.nv == 0) return 0.0;
          const VectorXd u = s.direction(1), w = s.direction(2), f = s.direction(3), a = s.direction(4);
          s.sens.solve(s.in());
          VectorXd got(m.nv), rate(m.nq), direct(m.nv);
          s.sens.forward({.q = u.data(), .v = w.data(), .vdot = a.data(), .tau = f.data()}, got.data());
          using soa::Tangent;
          m.qdot(s.state.q.data(), u.data(), rate.data());
          std::vector<Tangent> q, v, tau, vdot, out(static_cast<std::size_t>(m.nv));
          for (int i = 0; i < m.nq; ++i) q.push_back({s.state.q[i], rate[i]});
          for (int i = 0; i < m.nv; ++i) {
            const bool given = m.has_prescribed() && m.prescribed[static_cast<std::size_t>(i)];
            v.push_back({s.state.v[i], w[i]}), tau.push_back({s.tau[i], f[i]}),
                vdot.push_back(given ? Tangent{s.vdot_given[i], a[i]} : Tangent(0.0));
          }
          std::vector<soa::NodeWrench<Tangent>> wrenches;
          for (const NodeWrench& x : s.wrenches) wrenches.push_back({x.node, x.world_axes, {cast<Tangent>(x.f.n), cast<Tangent>(x.f.f)}});
          soa::Workspace<Tangent> ws(m);
          ws.require_world();
          if (!forward_dynamics(m, ws, {.q = q.data(), .v = v.data(), .tau = tau.data(), .vdot = vdot.data(), .wrenches = wrenches},
                                out.data()))
            return HUGE_VAL;
          for (int i = 0; i < m.nv; ++i) direct[i] = out[static_cast<std::size_t>(i)].d;
          return differ(got, direct);
        },
        options.modes > 0 ? 30 : kTrees);
  }
}

TEST(Sensitivity, MatricesAreMadeOfDirections) {  // and d v' = - M^-1 d ID, M dv'/dtau = 1
  for (const TreeOptions& options : kinds_with_springs())
    for_all_trees(
        options, kDerivative,
        [](const RandomTree& tree) {
          LoadedScene s(tree);
          if (s.model->nv == 0) return 0.0;
          s.sens.solve(s.in());
          const operators::InverseDerivatives inverse = s.sens.inverse();
          const operators::ForwardDerivatives forward = s.sens.forward();
          const MatrixXd M = mass_matrix(*s.model, s.ws, s.state.q.data());
          const VectorXd u = s.direction(1), w = s.direction(2), f = s.direction(3);
          VectorXd tau(s.model->nv), vdot(s.model->nv);
          s.sens.inverse({.q = u.data(), .v = w.data()}, tau.data());
          s.sens.forward({.q = u.data(), .v = w.data(), .tau = f.data()}, vdot.data());
          const double size = largest(inverse.q) + largest(inverse.v);
          return worse({differ(inverse.q * u + inverse.v * w, tau, size),
                        differ(M * (forward.q * u + forward.v * w + forward.tau * f), f - tau, size),
                        differ(M * forward.q, -inverse.q, largest(M) * largest(forward.q)), differ(M * vdot, f - tau, size)});
        },
        kTrees);
}

TEST(Sensitivity, DirectionsSideBySideAreEachAsByThemselves) {
  for (const TreeOptions& options : kinds_with_springs())
    for_all_trees(
        options, kDerivative,
        [](const RandomTree& tree) {
          LoadedScene s(tree);
          if (s.model->nv == 0) return 0.0;
          s.sens.solve(s.in());
          constexpr unsigned kMany = 11;  // more than stand side by side
          std::vector<VectorXd> numbers;
          for (unsigned i = 0; i < 4 * kMany; ++i) numbers.push_back(s.direction(i + 1));
          std::vector<operators::Direction> along(kMany);
          for (unsigned d = 0; d < kMany; ++d) {  // some along one of them alone
            if (d % 4 != 1) along[d].q = numbers[4 * d].data();
            if (d % 4 != 2) along[d].v = numbers[4 * d + 1].data();
            if (d % 4 != 3) along[d].vdot = numbers[4 * d + 2].data();
            if (d % 2 == 0) along[d].tau = numbers[4 * d + 3].data();
          }
          MatrixXd tau(s.model->nv, kMany), vdot(s.model->nv, kMany), one_tau = tau, one_vdot = vdot;
          s.sens.inverse(along, tau.data());
          s.sens.forward(along, vdot.data());
          for (unsigned d = 0; d < kMany; ++d) {
            s.sens.inverse(along[d], one_tau.col(d).data());
            s.sens.forward(along[d], one_vdot.col(d).data());
          }
          const MatrixXd M = mass_matrix(*s.model, s.ws, s.state.q.data());
          return worse(differ(tau, one_tau), differ(M * vdot, M * one_vdot, largest(M) * largest(one_vdot)));
        },
        kTrees);
}

TEST(Sensitivity, MassMatrixByExpressionBySweepAndByTheTwin) {
  for (const TreeOptions& options : kinds_with_springs())
    for_all_trees(
        options, kDerivative,
        [](const RandomTree& tree) {
          LoadedScene s(tree);
          if (s.model->nv == 0) return 0.0;
          const VectorXd u = s.direction(1), w = s.direction(2);
          operators::TreeOperators ops(s.model);
          ops.at(s.state.q.data());
          ops.along(u.data());
          s.sens.at(s.in());
          VectorXd swept(s.model->nv);
          s.sens.mass(u.data(), w.data(), swept.data());
          return differ(operators::apply(operators::letters::mass_derivative, ops, w), swept,
                        largest(mass_matrix(*s.model, s.ws, s.state.q.data())));
        },
        kTrees);
  for (const TreeOptions& options : kinds_of_small_trees())
    for_all_trees(
        options, kDerivative,
        [](const RandomTree& tree) {
          LoadedScene s(tree);
          if (s.model->nv == 0) return 0.0;
          const VectorXd u = s.direction(1), w = s.direction(2);
          const DenseTwin<Quad> twin(tree.spec);
          const VectorQ q = s.state.q.cast<Quad>(), none = VectorQ::Zero(s.model->nv), rate = twin.at(q, u.cast<Quad>()).qdot;
          const VectorXd want = slope([&](const Quad& h) { return VectorQ(twin.at(q + h * rate, none).M * w.cast<Quad>()); });
          operators::TreeOperators ops(s.model);
          ops.at(s.state.q.data());
          ops.along(u.data());
          return differ(operators::apply(operators::letters::mass_derivative, ops, w), want,
                        largest(mass_matrix(*s.model, s.ws, s.state.q.data())));
        },
        kTwins);
}

// --- parameters -----------------------------------------------------------------------------------------------------------------

/// tau of inverse dynamics when the inertia (m, h, J about B) of one rigid body moves by h times a change: the mass point of the twin with
/// that mass, its centre and its central inertia.
TEST(Sensitivity, InTheInertiaOfABody) {
  for (const TreeOptions& options : kinds_of_small_trees())
    for_all_trees(
        options, kDerivative,
        [](const RandomTree& tree) {
          LoadedScene s(tree);
          if (s.model->nv == 0) return 0.0;
          s.sens.at(s.at_vdot());
          const VectorQ q = s.state.q.cast<Quad>(), v = s.state.v.cast<Quad>(), vdot = s.vdot.cast<Quad>();
          const DenseModel<Quad> base = reference::dense_model<Quad>(tree.spec);
          double worst = 0.0;
          for (std::size_t b = 0; b < base.bodies.size(); ++b) {
            if (base.bodies[b].n_modes > 0) continue;
            const MatrixXd got = s.sens.inverse_in_inertia(static_cast<int>(b));
            MatrixXd want(s.model->nv, 10);
            for (int p = 0; p < 10; ++p)
              want.col(p) = slope([&](const Quad& step) {
                DenseModel<Quad> moved = base;
                reference::MassPoint<Quad>& point = moved.bodies[b].masses.at(0);
                const reference::Vec3<Quad> c = point.point.position;
                const reference::Mat3<Quad> one = reference::Mat3<Quad>::Identity();
                Quad mass = point.mass;
                reference::Vec3<Quad> h = mass * c;
                const reference::Mat3<Quad> R = point.point.R;
                reference::Mat3<Quad> J = R * point.inertia * R.transpose() + mass * (c.squaredNorm() * one - c * c.transpose());
                static constexpr int row[] = {0, 1, 2, 0, 0, 1}, col[] = {0, 1, 2, 1, 2, 2};
                if (p == 0) mass += step;
                if (p >= 1 && p < 4) h[p - 1] += step;
                if (p >= 4) J(row[p - 4], col[p - 4]) += step;
                if (p >= 7) J(col[p - 4], row[p - 4]) += step;
                point.mass = mass;
                point.point.position = h / mass;
                point.inertia = R.transpose() * (J - h.dot(h) / mass * one + h * h.transpose() / mass) * R;
                return twin_tau(DenseTwin<Quad>(moved), tree, q, v, vdot);
              });
            worst = worse(worst, differ(got, want));
          }
          return worst;
        },
        12);
}

/// Of the ten numbers that an inertia may be [Traversaro et al., IROS 2016: masses make [tr(J) / 2 - J, h; h*, m] positive]: each may
/// change by as much and is an inertia still.
double smallest_pseudo_inertia(const RigidInertia<double>& I) {
  Eigen::Matrix4d S;
  S << 0.5 * (I.J.yy + I.J.zz - I.J.xx), -I.J.xy, -I.J.xz, I.h.x, -I.J.xy, 0.5 * (I.J.xx + I.J.zz - I.J.yy), -I.J.yz, I.h.y, -I.J.xz,
      -I.J.yz, 0.5 * (I.J.xx + I.J.yy - I.J.zz), I.h.z, I.h.x, I.h.y, I.h.z, I.m;
  return singular_values(MatrixXd(S))[3];  // positive, so these are its eigenvalues
}

/// The same by models with another inertia of the body, in every kind of tree: merged bodies in a central field, wheels that cease to be
/// wheels.
TEST(Sensitivity, InTheInertiaOfABodyAgainstOtherModels) {
  std::vector<TreeOptions> kinds = kinds_with_springs();
  kinds.push_back({.bodies = 5, .flexible = 0.0, .wheels = 0.5, .locked = 0.3, .gravity = GravitySpec::Kind::central});
  for (const TreeOptions& options : kinds)
    for_all_trees(
        options, 1e-11,
        [](const RandomTree& tree) {
          LoadedScene s(tree);
          const Model& m = *s.model;
          if (m.nv == 0) return 0.0;
          s.sens.solve(s.in());
          const VectorXd vdot = s.sens.vdot();
          const MatrixXd M = mass_matrix(m, s.ws, s.state.q.data());
          double worst = 0.0;
          for (std::size_t b = 0; b < m.user.size(); ++b) {
            if (m.user[b].n_modes > 0) continue;
            const MatrixXd got = s.sens.inverse_in_inertia(static_cast<int>(b)), forward = s.sens.forward_in_inertia(static_cast<int>(b));
            const RigidInertia<double>& I = m.user[b].M;
            MatrixXd want(m.nv, 10);
            VectorXd work(m.nv);
            const double step = std::min(1e-3 * std::min({I.J.xx, I.J.yy, I.J.zz, I.m}), smallest_pseudo_inertia(I) / 16.0);
            for (int p = 0; p < 10; ++p)
              soa::derivative(
                  [&](double more, double* out) {
                    double x[10] = {I.m, I.h.x, I.h.y, I.h.z, I.J.xx, I.J.yy, I.J.zz, I.J.xy, I.J.xz, I.J.yz};
                    x[p] += more;
                    RandomTree moved = tree;
                    BodySpec& body = moved.spec.bodies[b];
                    body.mass = x[0];
                    body.com = Vector3d(x[1], x[2], x[3]) / x[0];
                    const Vector3d& c = body.com;
                    Eigen::Matrix3d J;
                    J << x[4], x[7], x[8], x[7], x[5], x[9], x[8], x[9], x[6];
                    body.inertia_com = J - x[0] * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
                    Eigen::Map<VectorXd>(out, m.nv) = Loaded(moved).inverse(vdot);
                  },
                  step, m.nv, want.col(p).data(), work.data());
            // of a light body, differences of the forces of all others: round-off of tau over the step
            const double noise = 1e-2 * largest(s.sens.tau()) / step;
            worst = worse({worst, differ(got, want, noise), differ(M * forward, -got, largest(M) * largest(forward))});
          }
          return worst;
        },
        20);
}

/// tau is linear in all inertias together: uniform gravity, no elastic forces, no loads.
TEST(Sensitivity, InertiasTimesTheirDerivativesAreTheForces) {
  TreeOptions options{.bodies = 8, .flexible = 0.0, .wheels = 0.4, .locked = 0.2};
  for_all_trees(
      options, 1e-12,
      [](const RandomTree& tree) {
        RandomTree bare = tree;
        bare.loads.clear();
        LoadedScene s(bare);
        if (s.model->nv == 0) return 0.0;
        s.sens.at(s.at_vdot());
        VectorXd sum = VectorXd::Zero(s.model->nv);
        double size = 0.0;
        for (std::size_t b = 0; b < s.model->user.size(); ++b) {
          const RigidInertia<double>& M = s.model->user[b].M;
          VectorXd p(10);
          p << M.m, M.h.x, M.h.y, M.h.z, M.J.xx, M.J.yy, M.J.zz, M.J.xy, M.J.xz, M.J.yz;
          const MatrixXd d = s.sens.inverse_in_inertia(static_cast<int>(b));
          sum += d * p;
          size = worse(size, largest(d * p.asDiagonal()));
        }
        return differ(sum, s.sens.tau(), size);
      },
      kTrees);
}

TEST(Sensitivity, InModalStiffness) {
  TreeOptions options{.bodies = 4, .flexible = 0.7};
  for_all_trees(
      options, 1e-12,
      [](const RandomTree& tree) {
        LoadedScene s(tree);
        if (s.model->nv == 0) return 0.0;
        s.sens.solve(s.in());
        const MatrixXd M = mass_matrix(*s.model, s.ws, s.state.q.data());
        double worst = 0.0;
        for (std::size_t b = 0; b < tree.spec.bodies.size(); ++b) {
          if (!tree.spec.bodies[b].modal) continue;
          const int m = tree.spec.bodies[b].modal->n_modes, body = static_cast<int>(b);
          const MatrixXd full = s.sens.inverse_in_stiffness(body, operators::Sensitivities::Stiffness::full),
                         diagonal = s.sens.inverse_in_stiffness(body);
          for (int i = 0, column = 0; i < m; ++i)
            for (int j = 0; j <= i; ++j, ++column) {
              RandomTree stiffer = tree;  // tau is linear in K: one whole step is the derivative
              auto data = std::make_shared<ModalData>(*tree.spec.bodies[b].modal);
              data->K(i, j) += 1.0;
              if (i != j) data->K(j, i) += 1.0;
              stiffer.spec.bodies[b].modal = data;
              LoadedScene other(stiffer);
              const VectorXd change = other.inverse(s.sens.vdot()) - s.inverse(s.sens.vdot());
              worst = worse(worst, differ(full.col(column), change, largest(s.sens.tau()) + largest(s.vdot) * largest(M)));
              if (i == j) worst = worse(worst, differ(full.col(column), diagonal.col(i)));
            }
          const MatrixXd forward = s.sens.forward_in_stiffness(body, operators::Sensitivities::Stiffness::full);
          worst = worse(worst, differ(M * forward, -full, largest(M) * largest(forward)));
        }
        return worst;
      },
      60);
}

TEST(Sensitivity, InertiaOfAFlexibleBodyIsRefused) {
  TreeOptions options{.bodies = 2, .flexible = 1.0};
  LoadedScene s(random_tree(3, options));
  s.sens.at(s.in());
  EXPECT_THROW(s.sens.inverse_in_inertia(0), InputError);
  EXPECT_THROW(s.sens.inverse_in_inertia(7), InputError);
}

// --- laws -----------------------------------------------------------------------------------------------------------------------

/// A constant added to the velocity of a system on a `free` root, and a shift of its place in uniform gravity, change nothing: not even
/// derivatives. At the speed of an orbit.
TEST(Sensitivity, DerivativesAreGalileanInvariant) {
  TreeOptions options{.bodies = 6, .roots = 1, .flexible = 0.4, .floating = true};
  for_all_trees(
      options, 1e-12,
      [](const RandomTree& tree) {
        LoadedScene s(tree);
        const UserBody& root = s.model->user[0];
        if (root.hinge_type != "free") return 0.0;
        s.sens.at(s.at_vdot());
        const operators::InverseDerivatives slow = s.sens.inverse();
        s.state.v.segment<3>(root.v + 3) += Vector3d(7500.0, -300.0, 100.0);
        s.state.q.segment<3>(root.q + 4) += Vector3d(10.0, -20.0, 5.0);
        s.sens.at(s.at_vdot());
        const operators::InverseDerivatives fast = s.sens.inverse();
        // along place and velocity of the root no force changes, if no load is fixed to the world
        const double still = worse(largest(fast.v.middleCols(root.v + 3, 3)), largest(fast.q.middleCols(root.v + 3, 3)));
        return worse({differ(fast.q, slow.q), differ(fast.v, slow.v), still / largest(fast.q)});
      },
      60);
}

/// The inertia of one body moves the forces between it and the ground, and no others.
TEST(Sensitivity, ParametersReachToTheGroundOnly) {
  std::vector<BodySpec> bodies;
  for (int i = 0; i < 60; ++i)
    bodies.push_back(on(rigid("b" + std::to_string(i), 1.0, {0.1, 0.2, 0.3}, diagonal({1.0, 1.1, 1.2})),
                        i > 0 ? "b" + std::to_string(i - 1) : "", i % 3 ? "revolute" : "ball",
                        i % 3 ? std::vector<Vector3d>{Vector3d(0, i % 2, 1)} : std::vector<Vector3d>{}, {0.4, 0.0, 0.1}));
  const auto model = compiled(system(std::move(bodies), uniform_gravity({0, 0, -9.8})));
  operators::Sensitivities s(model);
  const State state = model->initial_state();
  s.at({.q = state.q.data(), .v = state.v.data()});
  VectorXd d(model->nv);
  s.inverse_in_inertia(29, RigidInertia<double>{1.0, {}, {}}, d.data());
  const UserBody& next = model->user[30];
  EXPECT_GT(largest(d.head(next.v)), 0.0);
  EXPECT_EQ(largest(d.tail(model->nv - next.v)), 0.0);
}

// --- kinematics -----------------------------------------------------------------------------------------------------------------

/// d/dt difference(q, retract(q, theta)) along one velocity, differenced: what C_kin is by definition.
TEST(Sensitivity, RatesOfTheKinematics) {
  TreeOptions options{.bodies = 6, .flexible = 0.2};
  for_all_trees(
      options, 1e-9,
      [](const RandomTree& tree) {
        LoadedScene s(tree);
        const Model& m = *s.model;
        if (m.nv == 0) return 0.0;
        const MatrixXd C = operators::kinematic_rates(m, s.state.q.data(), s.state.v.data());
        MatrixXd want(m.nv, m.nv);
        const double h = 1e-3;
        const auto theta_rate = [&](const VectorXd& theta) {  // at dv = 0
          VectorXd p(m.nq), q_rate(m.nq), p_rate(m.nq), out = VectorXd::Zero(m.nv), d(m.nv);
          m.retract(s.state.q.data(), theta.data(), p.data());
          m.qdot(s.state.q.data(), s.state.v.data(), q_rate.data());
          m.qdot(p.data(), s.state.v.data(), p_rate.data());
          for (const auto& [t, weight] : {std::pair{1.0, 8.0}, {-1.0, -8.0}, {2.0, -1.0}, {-2.0, 1.0}}) {
            VectorXd a = s.state.q + t * h * q_rate, b = p + t * h * p_rate;
            m.normalise(a.data()), m.normalise(b.data());
            m.difference(a.data(), b.data(), d.data());
            out += weight / (12.0 * h) * d;
          }
          return out;
        };
        for (int j = 0; j < m.nv; ++j) {
          VectorXd e = VectorXd::Zero(m.nv);
          e[j] = 2e-3;
          want.col(j) = (8.0 * (theta_rate(e) - theta_rate(-e)) - (theta_rate(2.0 * e) - theta_rate(-2.0 * e))) / (12.0 * e[j]);
        }
        return largest(C - want) / (1.0 + largest(want));  // two differences of fourth order
      },
      40);
}

/// A hinge of a plugin with coordinates of its own says nothing of its C_kin: the closed forms again, by differences.
TEST(Sensitivity, RatesOfTheKinematicsOfForeignHinges) {
  for (const char* type : {"ball", "free", "free_body"}) {
    TreeOptions options{.bodies = 1, .roots = 1, .flexible = 0.0, .hinges = {type}};
    const auto model = compiled(random_tree(4, options).spec);
    const State state = model->initial_state();
    Model foreign = *model;
    cardan_hinge_family family = *model->user[0].hinge;
    family.shape = CARDAN_SHAPE_DENSE;
    foreign.user[0].hinge = &family;
    const MatrixXd want = operators::kinematic_rates(*model, state.q.data(), state.v.data());
    EXPECT_GT(largest(want), 0.1);
    EXPECT_LT(differ(MatrixXd(operators::kinematic_rates(foreign, state.q.data(), state.v.data())), want), 1e-11) << type;
  }
}

}  // namespace
}  // namespace cardan::test
