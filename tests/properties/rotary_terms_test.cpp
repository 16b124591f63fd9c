// Which terms of nodal rotary inertia a body keeps: what is left out is as small as is said, and what is kept is one mass matrix for all.
#include <gtest/gtest.h>

#include <random>

#include "bodies/modal/modal_source.hpp"
#include "core/model/rotary_terms.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "core/reference/factor.hpp"
#include "core/reference/quad.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/trees.hpp"
#include "tests/support/builders.hpp"

namespace cardan::test {
namespace {

/// A beam of 0.1 m x 0.01 m: torsion, whose rotary inertia is all of its mass, and bending in two planes.
std::shared_ptr<const ModalData> strip(int modes) {
  ModalSource source;
  BeamModel beam;
  beam.length = 10.0, beam.material = {70e9, 0.3, 2700.0}, beam.section = rectangle_section(0.1, 0.01), beam.elements = 60;
  source.model = beam, source.modes.count = modes;
  return std::make_shared<const ModalData>(make_modal_data(source));
}

std::shared_ptr<const ModalData> panel(int modes, bool rotary_inertia = true) {
  ModalSource source;
  PlateModel wing;
  wing.length = 10.0, wing.width = 2.4, wing.elements_x = 20, wing.elements_y = 6, wing.rotary_inertia = rotary_inertia;
  wing.panel = SandwichPanel{{110e9, 0.3, 1600.0}, 2e-4, 0.02, 32.0, 1.2};
  wing.yoke = {2.0, 1.8, {110e9, 0.3, 1600.0}, tube_section(0.03, 0.0015)};
  source.model = wing, source.modes.count = modes;
  return std::make_shared<const ModalData>(make_modal_data(source));
}

SystemSpec with(const std::shared_ptr<const ModalData>& modal, int level, double tolerance) {
  SystemSpec spec;
  spec.name = "hub and wing";
  BodySpec hub;
  hub.name = "hub", hub.mass = 50.0, hub.com = {0.1, 0.0, 0.2}, hub.inertia_com = Eigen::Vector3d(20.0, 30.0, 25.0).asDiagonal();
  hub.hinge.type = "free";
  BodySpec wing;
  wing.name = "wing", wing.type = "modal_flexible", wing.modal = modal, wing.level = level, wing.rotary_tolerance = tolerance;
  wing.hinge.type = "revolute", wing.hinge.inboard_body = "hub", wing.hinge.onode_position = {1.0, 0.2, -0.1};
  wing.hinge.params["axis"] = {std::vector<double>{1.0, 0.0, 0.0}, {}};
  spec.bodies = {hub, wing};
  return spec;
}

/// Coordinates whose modes turn by 0.1 rad in all.
Eigen::VectorXd turned(const ModalIntegrals& I, std::mt19937_64& rng) {
  std::normal_distribution<double> any;
  Eigen::VectorXd eta = Eigen::VectorXd::NullaryExpr(I.rotary_turn.size(), [&] { return any(rng); });
  for (Eigen::Index i = 0; i < eta.size(); ++i) eta[i] = I.rotary_turn[i] > 0.0 ? eta[i] / I.rotary_turn[i] : 0.0;
  return eta * (0.1 / eta.cwiseAbs().dot(I.rotary_turn));
}

/// What the bound is of: the change of the kinetic energy of the body beside those of its rotation about its mass centre and of its modes.
double changed(const ModalIntegrals& exact, const ModalIntegrals& kept, const Eigen::VectorXd& eta, std::mt19937_64& rng) {
  const reference::ModalInertia<double> all(exact), some(kept);
  const Eigen::MatrixXd dM = some.mass(eta, 1) - all.mass(eta, 1);
  const Eigen::Index m = eta.size();
  const Eigen::Vector3d c = exact.I2 / exact.I1;
  Eigen::MatrixXd T = Eigen::MatrixXd::Identity(3 + m, 3 + m);
  T.topLeftCorner<3, 3>() = exact.I7 - exact.I1 * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
  EXPECT_EQ(dM.middleRows(3, 3).cwiseAbs().sum(), 0.0) << "momentum";
  Eigen::MatrixXd of_both(3 + m, 3 + m);
  of_both << dM.topLeftCorner(3, 3), dM.topRightCorner(3, m), dM.bottomLeftCorner(m, 3), dM.bottomRightCorner(m, m);
  std::normal_distribution<double> any;
  double worst = 0.0;
  for (int k = 0; k < 20; ++k) {
    const Eigen::VectorXd x = Eigen::VectorXd::NullaryExpr(3 + m, [&] { return any(rng); });
    const double change = std::abs(x.dot(of_both * x)) / x.dot(T * x);
    worst = change > worst || std::isnan(change) ? change : worst;
  }
  return worst;
}

TEST(RotaryTerms, ThatAreLeftOutAreAsSmallAsIsSaid) {
  struct Case {
    std::shared_ptr<const ModalData> modal;
    double tolerance;
    bool nothing_is_left;  // of dM_ee
  };
  for (const Case& c :
       {Case{panel(10), 1e-4, true}, {panel(20), 1e-4, true}, {panel(20), 1e-6, false}, {strip(20), 1e-4, false}, {strip(20), 0.1, true}}) {
    SCOPED_TRACE(c.modal->source + ", " + std::to_string(c.tolerance));
    const auto model = compile(with(c.modal, 1, c.tolerance), registry());
    const ModalData& kept = *model->spec->bodies[1].modal;
    EXPECT_EQ(kept.whole, c.modal);
    EXPECT_GT(kept.left_out, 0.0);
    EXPECT_LE(kept.left_out, c.tolerance);
    EXPECT_EQ(kept.integrals.rotary_ee.empty(), c.nothing_is_left);
    EXPECT_EQ(model->flexible[0].M_ee_constant, c.nothing_is_left);
    EXPECT_EQ(kept.content_hash, c.modal->content_hash) << "the source is the same";
    std::mt19937_64 rng(11);
    for (int k = 0; k < 20; ++k) {
      const double change = changed(c.modal->integrals, kept.integrals, turned(c.modal->integrals, rng), rng);
      EXPECT_LE(change, 2.0 * kept.left_out);  // of modes, and twice of the coupling
      EXPECT_GT(change, 0.0);
    }
  }
}

TEST(RotaryTerms, AreKeptWhereTheyAreAskedFor) {
  const auto modal = strip(12);
  const auto exact = compile(with(modal, 1, 0.0), registry());
  EXPECT_EQ(exact->spec->bodies[1].modal, modal);
  EXPECT_EQ(compile(with(modal, 0, 1e-4), registry())->spec->bodies[1].modal, modal) << "level 0 has none";
  ModalData unknown = *modal;
  unknown.integrals.rotary_turn.resize(0);
  const auto told = std::make_shared<const ModalData>(unknown);
  EXPECT_EQ(compile(with(told, 1, 1e-4), registry())->spec->bodies[1].modal, told) << "how far modes turn is not known";
}

/// Relative errors of the sweeps against the dense twin of what is kept, in 113 bits: of v', and of the forces of a motion without it.
struct OffTwin {
  double vdot, forces;
};
OffTwin off_twin(const SystemSpec& spec, std::uint64_t seed, double bent = 0.01) {
  using T = reference::Quad;
  const auto model = compile(spec, registry());
  const reference::DenseTwin<T> twin(reference::dense_model<T>(*model->spec));
  std::mt19937_64 rng(seed);
  std::normal_distribution<double> any;
  State at = model->initial_state();
  Eigen::VectorXd tau(model->nv), vdot(model->nv);
  const UserBody& wing = model->user[1];
  for (int i = 0; i < model->nv; ++i) at.v[i] = (i >= wing.etadot ? 0.1 : 0.3) * any(rng), tau[i] = any(rng);
  for (int i = 0; i < wing.n_modes; ++i) at.q[wing.eta + i] = bent * any(rng);
  Workspace ws(*model);
  Inputs in;
  in.q = at.q.data(), in.v = at.v.data(), in.tau = tau.data();
  EXPECT_TRUE(forward_dynamics(*model, ws, in, vdot.data()));
  const auto truth = twin.at(at.q.cast<T>(), at.v.cast<T>());
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(model->nv), exact = truth.forward(tau.cast<T>()).cast<double>(),
                        forces = truth.inverse(none.cast<T>()).cast<double>();
  in.vdot = none.data();
  inverse_dynamics(*model, ws, in, tau.data());
  return {(vdot - exact).norm() / exact.norm(), (tau - forces).norm() / forces.norm()};
}

// A cantilever of many modes leaves little that its root still feels of it as a rigid body: digits go with it (1e-13 at 20 modes).
TEST(RotaryTerms, OfAllRanksAreThoseOfTheTwin) {
  for (const int level : {0, 1, 2})
    for (const double tolerance : {0.0, 1e-6, 1e-4, 0.05})
      for (const auto& modal : {strip(12), panel(12)}) {
        if (level == 2 && tolerance < 1e-4) continue;  // refused
        if (level == 2 && tolerance < 0.05 && modal->source.starts_with("beam")) continue;
        EXPECT_LE(off_twin(with(modal, level, tolerance), 3).vdot, 1e-12) << modal->source << ", level " << level << ", " << tolerance;
      }
}

// What a wing leaves of itself to a hinge about its length once many modes have taken their share is a small difference of entries of M:
// v' errs by what the last bit of M is worth, and no formula with M in double can do better.
TEST(RotaryTerms, LeaveVdotTheLastBitOfTheMassMatrix) {
  using T = reference::Quad;
  for (const int level : {1, 2}) {
    const SystemSpec spec = with(panel(20), level, 1e-4);
    const auto model = compile(spec, registry());
    const reference::DenseTwin<T> twin(reference::dense_model<T>(*model->spec));
    std::mt19937_64 rng(5);
    std::uniform_real_distribution<double> any(-1.0, 1.0);
    State at = model->initial_state();
    Eigen::VectorXd tau(model->nv), vdot(model->nv);
    const UserBody& wing = model->user[1];
    for (int i = 0; i < model->nv; ++i) at.v[i] = 0.2 * any(rng), tau[i] = any(rng);
    for (int i = 0; i < wing.n_modes; ++i) at.q[wing.eta + i] = 0.01 * any(rng);
    const auto s = twin.at(at.q.cast<T>(), at.v.cast<T>());
    const reference::VecX<T> force = s.M * s.forward(tau.cast<T>());
    const auto solved = [&](const reference::MatX<T>& M) {
      return Eigen::VectorXd(reference::Factor<T>(M).solve(force).template cast<double>());
    };
    const Eigen::VectorXd exact = solved(s.M);
    double bit = 0.0;
    for (int k = 0; k < 20; ++k) {
      reference::MatX<T> M = s.M;
      for (Eigen::Index i = 0; i < M.rows(); ++i)
        for (Eigen::Index j = 0; j <= i; ++j) M(j, i) = M(i, j) = M(i, j) * (T(1) + T(0x1p-53 * any(rng)));
      bit = std::max(bit, (solved(M) - exact).norm() / exact.norm());
    }
    Workspace ws(*model);
    ASSERT_TRUE(forward_dynamics(*model, ws, Inputs{.q = at.q.data(), .v = at.v.data(), .tau = tau.data()}, vdot.data()));
    const double error = (vdot - exact).norm() / exact.norm();
    EXPECT_GT(bit, 5e-14) << "of level " << level << " more could be asked";
    EXPECT_LE(error, bit) << level;
    RecordProperty(fmt::format("error_at_level_{}", level), fmt::format("{:.1e}, of half a last bit {:.1e}", error, bit));
  }
}

// As many as are not formed at once. The forces are sums of up to m^3 terms.
TEST(RotaryTerms, OfManyModesAreThoseOfTheTwin) { EXPECT_LE(off_twin(with(strip(40), 1, 0.0), 3, 1e-4).forces, 1e-13); }

TEST(RotaryTerms, ThatAreKeptConserve) {
  for (const double tolerance : {0.0, 1e-4, 0.05})
    for (const int level : {1, 2}) {
      if (level == 2 && tolerance < 0.05) continue;
      SystemSpec spec = with(strip(12), level, tolerance);
      spec.bodies[0].hinge.v = {0.03, -0.02, 0.04, 0.0, 0.0, 0.0};
      spec.bodies[1].etadot.assign(12, 0.005);
      SimulationOptions options;
      options.integrator.method = "dop853";
      options.integrator.relative_tolerance = 1e-12;
      Simulation sim(compile(spec, registry()), options);
      sim.run(0.5);
      const LedgerState l = sim.ledger();
      // The modes are damped: what they lose is in the ledger.
      for (const double error : {l.linear_relative, l.angular_relative, l.energy_relative})
        EXPECT_LE(error, 1e-10) << tolerance << " " << level;
    }
}

TEST(RotaryTerms, OfTheSecondOrderAreRefusedWhereTheyMatter) {
  EXPECT_NO_THROW(compile(with(panel(10), 2, 1e-4), registry()));
  EXPECT_NO_THROW(compile(with(panel(10, false), 2, 0.0), registry())) << "neither the plate nor its yoke has any";
  EXPECT_TRUE(panel(10, false)->integrals.rotary_ww.empty());
  try {
    compile(with(strip(10), 2, 1e-4), registry());
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics().front().code, Code::bad_modal_data);
    EXPECT_NE(std::string(e.what()).find("rotary_inertia: 0.03"), std::string::npos) << e.what();
  }
}

}  // namespace
}  // namespace cardan::test
