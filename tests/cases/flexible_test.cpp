// Published cases of flexible bodies in a tree: the frequencies of the whole out of the modes of its parts.
#include <cmath>
#include <numbers>

#include "bodies/modal/lumped.hpp"
#include "bodies/modal/modal_source.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/dynamics/loops.hpp"
#include "core/linalg/dense.hpp"
#include "core/model/loops.hpp"
#include "core/operators/linear_model.hpp"
#include "core/operators/system_modes.hpp"
#include "tests/cases/published.hpp"

namespace cardan::test {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// rho A = EI = L = 1 for bending in the x-y plane, and everything else so stiff that the lowest 19 modes are of that
/// kind.
ModalSource plane_beam() {
  BeamModel beam;
  beam.length = 1.0;
  beam.material = {1e8, 0.25, 1.0};
  beam.section = {1.0, 1e-2, 1e-8, 1e-2, 0.0, 0.0};
  beam.elements = 200;
  beam.rotary_inertia = false;
  ModalSource source;
  source.model = beam;
  source.damping = {0.0};
  return source;
}

BodySpec flexible(const std::string& name, std::shared_ptr<const ModalData> modal) {
  BodySpec b;
  b.name = name;
  b.type = "modal_flexible";
  b.modal = std::move(modal);
  return b;
}

/// Small motion about q = 0: eigenvalues omega^2 ascending, eigenvectors of unit mass.
DensePairs small_motion(const SystemSpec& spec) {
  const auto model = compiled(spec);
  Workspace ws(*model);
  const VectorXd zero = model->initial_state().q, none = VectorXd::Zero(model->nv);
  MatrixXd K(model->nv, model->nv);
  for (int i = 0; i < model->nv; ++i) {
    VectorXd q = zero;
    q[i] = 1.0;
    K.col(i) = -elastic_force(*model, q.data(), none.data());
  }
  return generalised_pairs(K, mass_matrix(*model, ws, zero.data())).value();
}
VectorXd omega2(const SystemSpec& spec) { return small_motion(spec).values; }

/// Circular frequency [rad/s] out of the times at which v[index] crosses zero downwards while `periods` periods pass.
double frequency_in_time(Simulation& sim, int index, int periods, double expected) {
  const auto times = crossings(sim, -1, [index](const double*, const double* v) { return v[index]; });
  sim.run((periods + 1.25) * 2.0 * std::numbers::pi / expected);
  if (static_cast<int>(times->size()) <= periods) return std::nan("");
  return 2.0 * std::numbers::pi * periods / (times->at(static_cast<std::size_t>(periods)) - times->front());
}

/// A hub of inertia J about z with two equal beams on opposite sides, free to turn.
SystemSpec hub_with_two_beams(double J, const std::shared_ptr<const ModalData>& modal) {
  BodySpec right = on(flexible("right", modal), "hub", "locked"), left = on(flexible("left", modal), "hub", "locked");
  left.hinge.onode_R = Eigen::AngleAxisd(std::numbers::pi, Z).toRotationMatrix();
  return system({on(rigid("hub", 1.0, Vector3d::Zero(), diagonal({J, J, J})), "", "revolute", {Z}), right, left});
}
std::shared_ptr<const ModalData> beam_of_sixteen_modes() {
  ModalSource source = plane_beam();
  source.modes.count = 16;
  return std::make_shared<const ModalData>(make_modal_data(source));
}

// 16 modes per beam leave out compliance of the order beta^4 sum_{k > 16} 4 / beta_k^8 < 1e-8 of the hub's coupling;
// the mesh adds (k h)^4 / 720. One plane, equal and opposite beams: a clamped root lies below each root of the hub's
// motion.
TEST(HubWithTwoBeams, TurnsWithTheRootsOfRotationCoupledBending) {
  const Published ref("flex-hub-two-appendages");
  const auto modal = beam_of_sixteen_modes();
  const VectorXd clamped = ref.vector("limit j -> infinity");
  for (const int j10 : {1, 10, 100}) {
    const double j = 0.1 * j10, J = 2.0 * j;
    const VectorXd want = ref.vector(j10 == 1 ? "j=0.1" : j10 == 10 ? "j=1" : "j=10");
    const VectorXd beta = omega2(hub_with_two_beams(J, modal)).cwiseMax(0.0).array().pow(0.25);
    EXPECT_LE(beta[0], 1e-3);  // the hub turns freely; beta^4 = 1e-12 is rounding of K / M
    for (int k = 0; k < 4; ++k) {
      expect_relative(fmt::format("j = {}: clamped root {}", j, k + 1), beta[1 + 2 * k], clamped[k], ref.tolerance("rel"));
      expect_relative(fmt::format("j = {}: coupled root {}", j, k + 1), beta[2 + 2 * k], want[k], ref.tolerance("rel"));
    }
  }
}

// The same in time, as a satellite is simulated: let go at rest, bent as in one of the coupled modes, the hub must
// swing with that frequency alone. Tips move by 1e-5 of a length: what is of second order shifts the frequency by
// 1e-10.
TEST(HubWithTwoBeams, SwingsInTimeWithTheRootsOfRotationCoupledBending) {
  const Published ref("flex-hub-two-appendages");
  const SystemSpec spec = hub_with_two_beams(0.2, beam_of_sixteen_modes());
  const VectorXd want = ref.vector("j=0.1");
  const auto modes = small_motion(spec);
  for (int k = 0; k < 4; ++k) {
    SimulationOptions options;
    options.integrator = {.method = "dopri5", .relative_tolerance = 1e-11};
    options.absolute_tolerance = 1e-16;
    Simulation sim(compiled(spec), options);
    for (int i = 0; i < sim.model().nq; ++i) sim.q(i) = 5e-6 * modes.vectors(i, 2 + 2 * k);
    const double energy = sim.observe().energy().total();
    const double beta = std::sqrt(frequency_in_time(sim, 0, 3, want[k] * want[k]));
    expect_relative(fmt::format("root {}", k + 1), beta, want[k], ref.tolerance("rel"));
    expect_within(fmt::format("energy, root {}", k + 1), std::abs(sim.observe().energy().total() / energy - 1.0),
                  1e-8);  // 1e-11 per step, 1e3 steps
    const Momentum momentum = sim.observe().momentum();
    expect_within(fmt::format("angular momentum, root {}", k + 1), momentum.angular.norm() / momentum.angular_magnitude, 1e-8);
  }
}

// The tip is an interface: its constraint modes hold the exact static compliance there, so that the series converges
// like 1 / beta^8 instead of 1 / beta^4, and the tip body hangs on a deforming node.
TEST(CantileverWithTipMass, HasTheRootsOfItsPayload) {
  const Published ref("flex-cantilever-tip-mass");
  ModalSource source = plane_beam();
  source.boundary = Boundary::craig_bampton;
  source.modes.count = 12;
  source.points = {{"tip", X, true}};
  const auto modal = std::make_shared<const ModalData>(make_modal_data(source));
  for (const char* r : {"0.25", "1", "5"}) {
    const VectorXd want = ref.vector(std::string("r=") + r);
    BodySpec payload = on(particle("payload", std::stod(r), Vector3d::Zero()), "beam", "locked");
    payload.hinge.inboard_node = "tip";
    const VectorXd beta = omega2(system({flexible("beam", modal), payload})).array().pow(0.25);
    for (int k = 0; k < 3; ++k) expect_relative(fmt::format("r = {}: root {}", r, k + 1), beta[k], want[k], ref.tolerance("rel"));
  }
}

TEST(CantileverWithTipBody, HasTheRootsOfItsPayload) {
  const Published ref("flex-cantilever-tip-body");
  ModalSource source = plane_beam();
  source.boundary = Boundary::craig_bampton;
  source.modes.count = 16;
  source.points = {{"tip", X, true}};
  const double J = ref.model()["inertia"].as<double>();
  BodySpec payload =
      on(rigid("payload", ref.model()["mass"].as<double>(), ref.model()["offset"].as<double>() * X, diagonal({J, J, J})), "beam", "locked");
  payload.hinge.inboard_node = "tip";
  const VectorXd want = ref.vector("roots");
  const VectorXd x =
      omega2(system({flexible("beam", std::make_shared<const ModalData>(make_modal_data(source))), payload})).array().pow(0.25);
  for (int k = 0; k < 4; ++k) expect_relative(fmt::format("root {}", k + 1), x[k], want[k], ref.tolerance("rel"));
}

// Flap of a spinning blade: analytic clamped-free modes with the shortening u = -1/2 int w'^2 dx as second-order field
// Q. The blade's points are those of a Gauss rule, weighted by it: integrals of the products of shapes are exact to
// rounding.
class Blade {
 public:
  explicit Blade(int n_modes, int cells = 60) {
    std::vector<double> beta;
    for (int k = 0; k < n_modes; ++k) beta.push_back(root(k));
    const double gauss[] = {-std::sqrt(0.6), 0.0, std::sqrt(0.6)}, weight[] = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};
    std::vector<MassNode> nodes;
    MatrixXd shortening = MatrixXd::Zero(n_modes, n_modes);  // int_0^x w_k' w_l'
    double reached = 0.0;
    const auto slopes = [&](double x) {
      VectorXd s(n_modes);
      for (int k = 0; k < n_modes; ++k) s[k] = slope(beta[static_cast<std::size_t>(k)], x);
      return s;
    };
    for (int c = 0; c < cells; ++c)
      for (int g = 0; g < 3; ++g) {
        MassNode node;
        const double x = (c + 0.5 + 0.5 * gauss[g]) / cells, half = 0.5 * (x - reached), mid = 0.5 * (x + reached);
        for (int p = 0; p < 3; ++p) {
          const VectorXd s = slopes(mid + half * gauss[p]);
          shortening += 2.0 * half * weight[p] * s * s.transpose();
        }
        reached = x;
        node.mass = weight[g] / cells;
        node.position = x * X;
        node.Phi = MatrixXd::Zero(3, n_modes);
        for (int k = 0; k < n_modes; ++k) node.Phi(2, k) = shape(beta[static_cast<std::size_t>(k)], x);
        node.Q = {-shortening, MatrixXd::Zero(n_modes, n_modes), MatrixXd::Zero(n_modes, n_modes)};
        nodes.push_back(node);
      }
    VectorXd K(n_modes);
    for (int k = 0; k < n_modes; ++k) K[k] = std::pow(beta[static_cast<std::size_t>(k)], 4);
    modal_ = std::make_shared<const ModalData>(lumped_modal_data(std::move(nodes), K.asDiagonal(), {}, {}));
  }

  SystemSpec spinning(double spin, double root) const {
    BodySpec blade = on(flexible("blade", modal_), "", "revolute", {Z});
    blade.level = 2;
    blade.hinge.pnode_position = -root * X;
    blade.hinge.prescribed = {0};
    blade.hinge.v = {spin};
    return system({blade});
  }

  /// Clamped at its foot, its weight along it.
  SystemSpec standing(double gravity) const {
    BodySpec column = on(flexible("column", modal_), "", "locked");
    column.level = 2;
    return system({column}, uniform_gravity(-gravity * X));
  }

  /// Flap frequencies at this rate of spin, root at this distance from the axis: eta'' = -A eta by central differences;
  /// the error of the differences is 1e-9 (the motion is odd in eta, third order).
  VectorXd flap(double spin, double root) const {
    VectorXd squares = eigenvalues(tangent(spin, root)).real();
    std::sort(squares.begin(), squares.end());
    return squares.cwiseSqrt();
  }
  MatrixXd tangent(double spin, double root) const {
    const auto model = compiled(spinning(spin, root));
    Workspace ws(*model);
    const int m = modal_->n_modes;
    VectorXd v = VectorXd::Zero(1 + m);
    v[0] = spin;
    MatrixXd A(m, m);
    const double h = 1e-5;
    for (int k = 0; k < m; ++k) {
      const auto accelerations = [&](double step) {
        VectorXd q = VectorXd::Zero(1 + m), vdot = VectorXd::Zero(1 + m);
        q[1 + k] = step;
        Inputs in;
        in.q = q.data(), in.v = v.data(), in.vdot = vdot.data();
        VectorXd out(1 + m);
        EXPECT_TRUE(forward_dynamics(*model, ws, in, out.data()));
        return VectorXd(out.tail(m));
      };
      A.col(k) = -(accelerations(h) - accelerations(-h)) / (2.0 * h);
    }
    return A;
  }

  /// Roots of cos b cosh b = -1 by Newton on cos b + 1 / cosh b.
  static double root(int k) {
    double b = (k + 0.5) * std::numbers::pi;
    for (int i = 0; i < 20; ++i) b += (std::cos(b) + 1.0 / std::cosh(b)) / (std::sin(b) + std::tanh(b) / std::cosh(b));
    return b;
  }
  /// cosh bx - cos bx - r (sinh bx - sin bx), r = (cosh b + cos b) / (sinh b + sin b), without the difference of large
  /// numbers.
  static double rest(double b) { return (std::sin(b) - std::cos(b) - std::exp(-b)) / (std::sinh(b) + std::sin(b)); }  // 1 - r
  static double shape(double b, double x) {
    const double c = rest(b), r = 1.0 - c;
    return 0.5 * (c * std::exp(b * x) + (1.0 + r) * std::exp(-b * x)) - std::cos(b * x) + r * std::sin(b * x);
  }
  static double slope(double b, double x) {
    const double c = rest(b), r = 1.0 - c;
    return b * (0.5 * (c * std::exp(b * x) - (1.0 + r) * std::exp(-b * x)) + std::sin(b * x) + r * std::cos(b * x));
  }

 private:
  std::shared_ptr<const ModalData> modal_;
};

TEST(SpinningBlade, StiffensLikeWrightsBeam) {
  const Published ref("flex-rotating-beam-wright");
  const Blade blade(14);
  for (const int hub : {0, 1})
    for (const int eta : hub == 0 ? std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12} : std::vector<int>{1, 3, 6, 12}) {
      const VectorXd want = ref.vector(fmt::format("eta={}, hub {}", eta, hub)), got = blade.flap(eta, hub);
      for (int k = 0; k < 3; ++k)
        expect_relative(fmt::format("speed {}, hub radius {}: flap frequency {}", eta, hub, k + 1), got[k], want[k], ref.tolerance("rel"));
    }
}

// In time, spinning six times as fast as it bends at rest: bent as in one of its flap modes and let go.
TEST(SpinningBlade, FlapsInTimeWithTheFrequencyOfWrightsBeam) {
  const Published ref("flex-rotating-beam-wright");
  const double spin = 6.0;
  const Blade blade(8, 20);
  const VectorXd want = ref.vector("eta=6, hub 0");
  const ComplexPairs modes = eigenpairs(blade.tangent(spin, 0.0));
  for (int k = 0; k < 3; ++k) {
    Eigen::Index nearest = 0;
    (modes.values.real().array().sqrt() - want[k]).abs().minCoeff<Eigen::PropagateNaN>(&nearest);
    const VectorXd shape = modes.vectors.col(nearest).real();
    SimulationOptions options;
    options.integrator = {.method = "dopri5", .relative_tolerance = 1e-9};
    options.absolute_tolerance = 1e-13;
    Simulation sim(compiled(blade.spinning(spin, 0.0)), options);
    sim.prescribe(0, MotionProfile::hold(spin));
    for (Eigen::Index i = 0; i < shape.size(); ++i) sim.q(1 + static_cast<int>(i)) = 1e-5 * shape[i];
    Eigen::Index largest_mode = 0;
    shape.cwiseAbs().maxCoeff<Eigen::PropagateNaN>(&largest_mode);
    const double got = frequency_in_time(sim, 1 + static_cast<int>(largest_mode), 2, want[k]);
    expect_relative(fmt::format("flap frequency {}", k + 1), got, want[k], ref.tolerance("rel"));
  }
}

// The spin-up of Kane, Ryan and Banerjee (1987): analytic clamped-free modes of bending in the plane of rotation with
// the shortening as second-order field, and one of stretching: the shape that a load growing with x causes, which
// leaves out 6e-5 of the extension. Shear (3 EI / (GA L^2) = 4e-5) and the sections' rotary inertia are left out.
TEST(KaneSpinUp, LagsBehindAndEndsStraightAndStretched) {
  const Published ref("flex-kane-spinup");
  const auto given = [&](const char* name) { return ref.model()[name].as<double>(); };
  const double L = given("length_m"), EA = given("EA_N"), EI = given("EI_Nm2"), rhoA = given("rhoA_kgm");
  constexpr int n_bend = 4, n = n_bend + 1, cells = 15;
  const double gauss[] = {-std::sqrt(0.6), 0.0, std::sqrt(0.6)}, weight[] = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};
  std::vector<MassNode> nodes;
  MatrixXd shortening = MatrixXd::Zero(n, n);  // int_0^x w_k' w_l' dx
  double reached = 0.0;
  const auto shorten_to = [&](double s) {
    const double half = 0.5 * (s - reached), mid = 0.5 * (s + reached);
    for (int p = 0; p < 3; ++p) {
      VectorXd slopes = VectorXd::Zero(n);
      for (int k = 0; k < n_bend; ++k) slopes[k] = Blade::slope(Blade::root(k), mid + half * gauss[p]) / L;
      shortening += 2.0 * half * L * weight[p] * slopes * slopes.transpose();
    }
    reached = s;
  };
  const auto shapes_at = [&](double s) {
    MatrixXd Phi = MatrixXd::Zero(3, n);
    for (int k = 0; k < n_bend; ++k) Phi(1, k) = Blade::shape(Blade::root(k), s);
    Phi(0, n_bend) = 0.5 * s * (3.0 - s * s);
    return Phi;
  };
  for (int c = 0; c < cells; ++c)
    for (int g = 0; g < 3; ++g) {
      const double s = (c + 0.5 + 0.5 * gauss[g]) / cells;
      shorten_to(s);
      MassNode node;
      node.mass = weight[g] / cells * rhoA * L;
      node.position = s * L * X;
      node.Phi = shapes_at(s);
      node.Q = {-shortening, MatrixXd::Zero(n, n), MatrixXd::Zero(n, n)};
      nodes.push_back(node);
    }
  shorten_to(1.0);
  VectorXd K(n);
  for (int k = 0; k < n_bend; ++k) K[k] = EI / std::pow(L, 3) * std::pow(Blade::root(k), 4);
  K[n_bend] = 1.2 * EA / L;  // integral of (1.5 (1 - s^2))^2
  const auto modal = std::make_shared<const ModalData>(lumped_modal_data(std::move(nodes), K.asDiagonal(), {}, {}));

  // The rate 0.4 t - 6 / (2 pi) sin(2 pi t / 15) is that of two hinges on one axis, a ramp and a sine; after 15 s the
  // sine has rate 0 and stops.
  BodySpec ramp = on(rigid("ramp", 1.0, Vector3d::Zero(), diagonal({1, 1, 1})), "", "revolute", {Z});
  BodySpec sine = on(rigid("sine", 1.0, Vector3d::Zero(), diagonal({1, 1, 1})), "ramp", "revolute", {Z});
  ramp.hinge.prescribed = sine.hinge.prescribed = {0};
  BodySpec beam = on(flexible("beam", modal), "sine", "locked");
  beam.level = 2;
  const auto sim = run_of(system({ramp, sine, beam}), "dopri5", 1e-8);
  sim->prescribe(0, MotionProfile::rate_table({{0.0, 0.0}, {15.0, 6.0}}));
  sim->prescribe(1, MotionProfile::sine(6.0 * 15.0 / std::pow(2.0 * std::numbers::pi, 2), 1.0 / 15.0, 0.5 * std::numbers::pi));
  const MatrixXd tip_shapes = shapes_at(1.0);
  const auto tip = [&] {
    const VectorXd eta = sim->state().q.tail(n);
    Vector3d u = tip_shapes * eta;
    u.x() -= 0.5 * eta.dot(shortening * eta);
    return u;
  };
  double lag = 0.0, ahead = 0.0, turned = 0.0;
  for (int i = 1; i <= 1000; ++i) {
    sim->run(0.02 * i);
    if (i == 750) {
      turned = sim->state().q[0] + sim->state().q[1];
      sim->prescribe(1, MotionProfile::hold());
    }
    lag = worse(lag, -tip().y()), ahead = worse(ahead, tip().y());
  }
  expect_relative("rotation at 15 s", turned, ref.number("rotation at 15 s"), 1e-8);
  expect_relative("rotation at 20 s", (sim->state().q[0] + sim->state().q[1]), ref.number("rotation at 20 s"), 1e-8);
  expect_absolute("lag", lag, ref.number("largest transverse lag"), ref.tolerance("lag_m"));
  expect_absolute("largest lead", ahead, 0.0, ref.tolerance("lag_m"));
  expect_absolute("deflection at the end", tip().y(), ref.number("steady transverse"), ref.tolerance("lag_m"));
  expect_relative("extension", tip().x(), ref.number("steady axial tip extension"), ref.tolerance("extension_rel"));
}

// Momentum and mass centre of a free beam do not know how it bends. Its moment and force make it turn and bend by more
// than its modes can follow. Shapes: Legendre polynomials, which are orthogonal to rigid motion. The sections' published
// rotary inertia, which the shape alone would feel, is left out.
TEST(FreeFlyingBeam, KeepsMomentumAndMassCentreUnderLargeDeformation) {
  const Published ref("flex-free-beam-invariants");
  const auto given = [&](const char* name) { return ref.model()[name].as<double>(); };
  const double L = given("length_m"), EI = given("EI_Nm2"), rhoA = given("rhoA_kgm");
  constexpr int n = 5, cells = 10;
  const auto polynomial = [](int k, double x) { return std::legendre(static_cast<unsigned>(k), x); };
  // P_k' = k (k + 1) / 2 at x = 1 and, with the sign of (-1)^(k + 1), at -1; P_k'' by P_k' = (2 k - 1) P_(k-1) +
  // P_(k-2)'.
  const std::function<double(int, double)> slope = [&](int k, double x) {
    return k < 1 ? 0.0 : (2 * k - 1) * polynomial(k - 1, x) + slope(k - 2, x);
  };
  const std::function<double(int, double)> curvature = [&](int k, double x) {
    return k < 2 ? 0.0 : (2 * k - 1) * slope(k - 1, x) + curvature(k - 2, x);
  };
  const double gauss[] = {-std::sqrt(0.6), 0.0, std::sqrt(0.6)}, weight[] = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};
  std::vector<MassNode> nodes;
  MatrixXd K = MatrixXd::Zero(n, n);
  for (int c = 0; c < cells; ++c)
    for (int g = 0; g < 3; ++g) {
      const double s = (c + 0.5 + 0.5 * gauss[g]) / cells, x = 2.0 * s - 1.0;
      MassNode node;
      node.mass = weight[g] / cells * rhoA * L;
      node.position = s * L * X;
      node.Phi = MatrixXd::Zero(3, n);
      VectorXd bend(n);
      for (int k = 0; k < n; ++k) node.Phi(1, k) = polynomial(k + 2, x), bend[k] = curvature(k + 2, x) * 4.0 / (L * L);
      K += weight[g] / cells * L * EI * bend * bend.transpose();
      nodes.push_back(node);
    }
  ModalNode lower;
  lower.name = "lower";
  lower.Phi = lower.Psi = MatrixXd::Zero(3, n);
  for (int k = 0; k < n; ++k) lower.Phi(1, k) = polynomial(k + 2, -1.0), lower.Psi(2, k) = slope(k + 2, -1.0) * 2.0 / L;
  BodySpec body =
      on(flexible("beam", std::make_shared<const ModalData>(lumped_modal_data(std::move(nodes), K, {}, {lower}))), "", "planar", {X, Y});
  body.level = 2;
  body.hinge.q = {6.0, 0.0, std::atan2(8.0, -6.0)};  // from (6, 0) to (0, 8)
  SimulationOptions options;
  options.integrator = {.method = "dopri5", .relative_tolerance = 1e-12};
  Simulation sim(compiled(system({body}), {.world_wrenches = true}), options);
  const int load = sim.add_wrench(sim.model().find_node("beam.lower"), true);
  sim.set_wrench(load, {{0.0, 0.0, 80.0}, {8.0, 0.0, 0.0}});
  const auto com = [&] { return Eigen::Vector2d(sim.observe().momentum().com.head<2>()); };
  sim.run(2.5);
  expect_vector("mass centre at 2.5 s [m]", com(), ref.vector("centre of mass at 2.5 s"), ref.tolerance("com_m"));
  sim.set_wrench(load, {});
  const VectorXd want = ref.vector("linear momentum");
  const auto expect_momentum = [&](const std::string& at) {
    expect_vector("momentum at " + at, sim.observe().momentum().linear.head<2>(), want, ref.tolerance("momentum_rel"), want.norm());
  };
  expect_momentum("2.5 s");
  double bent = 0.0;
  for (int t = 3; t <= 10; ++t) {
    sim.run(t);
    expect_momentum(fmt::format("{} s", t));
    bent = worse(bent, largest(sim.state().q.tail(n)));
  }
  expect_vector("mass centre at 10 s [m]", com(), ref.vector("centre of mass at 10 s"), ref.tolerance("com_m"));
  EXPECT_GT(bent, 0.3) << "[m] else this is no large motion";
}

/// A beam along x with an interface at its tip, of `count` modes of the fixed interface.
std::shared_ptr<const ModalData> nafems_beam(BeamModel beam, int count) {
  ModalSource source;
  beam.elements = 40;
  source.points = {{"tip", beam.length * X, true}};
  source.model = std::move(beam);
  source.boundary = Boundary::craig_bampton;
  source.modes.count = count;
  source.damping = {0.0};
  return std::make_shared<const ModalData>(make_modal_data(source));
}

TEST(NafemsFv4, MassesBesideTheAxisOfACantilever) {
  const Published ref("modal-nafems-fv4");
  const auto of = [&](const char* name) { return ref.model()[name].as<double>(); };
  BeamModel beam;
  beam.length = of("length_m"), beam.material = {of("E_Pa"), of("nu"), of("rho_kgm3")};
  beam.section = tube_section(0.25, 0.25), beam.rotary_inertia = false;  // as in Bernoulli and Euler's theory
  std::vector<BodySpec> bodies = {flexible("beam", nafems_beam(beam, 30))};
  const VectorXd mass = Published::as_vector(ref.model()["masses_kg"]), off = Published::as_vector(ref.model()["off_the_axis_m"]);
  for (int i = 0; i < 2; ++i) {
    bodies.push_back(on(particle(fmt::format("mass_{}", i), mass[i], off[i] * Y), "beam", "locked"));
    bodies.back().hinge.inboard_node = "tip";
  }
  const VectorXd want = ref.vector("f [Hz]"), f = omega2(system(bodies)).head(6).cwiseSqrt() / (2.0 * std::numbers::pi);
  for (int i = 0; i < 6; ++i) expect_relative(fmt::format("f{} [Hz]", i + 1), f[i], want[i], ref.tolerance("rel"));
}

// The hinge at one end and a loop at the other are the supports.
TEST(NafemsFv5, ADeepBeamOnTwoSupports) {
  const Published ref("modal-nafems-fv5");
  const auto of = [&](const char* name) { return ref.model()[name].as<double>(); };
  const VectorXd side = Published::as_vector(ref.model()["section_m"]);
  const double I = side[0] * std::pow(side[1], 3) / 12.0, kappa = of("shear_factor");
  BeamModel beam;
  beam.length = of("length_m"), beam.material = {of("E_Pa"), of("nu"), of("rho_kgm3")};
  beam.section = {side[0] * side[1], I, I, 2.0 * I, kappa, kappa};
  SystemSpec spec = system({on(flexible("beam", nafems_beam(beam, 40)), "", "universal", {Y, Z})});
  LoopSpec support;
  support.name = "support", support.type = "line", support.to.body = "beam", support.to.node = "tip";
  support.from.R = Eigen::AngleAxisd(0.5 * std::numbers::pi, Y).toRotationMatrix();  // its z along the beam
  spec.loops = {support};
  const auto model = compiled(spec);
  const State s = model->initial_state();
  Workspace ws(*model);
  operators::TreeOperators tree(open_tree(model));
  tree.at(s.q.data());
  const auto modes = operators::closed_system_modes(tree, loop_freedom(*model, ws, s.q.data()).X, {.elastic = 9});
  const VectorXd want = ref.vector("f [Hz]");
  ASSERT_GE(modes.frequency.size(), 9);
  for (int i = 0; i < 9; ++i) expect_relative(fmt::format("f{} [Hz]", i + 1), modes.frequency[i], want[i], ref.tolerance("rel"));
}

// The shaft weighs 3e-7 kg beside 10: 1e-8 of the frequencies. 18 of its own modes, up to 1e7 rad/s, are in the linear model.
TEST(StodolaGreenRotor, WhirlsForwardAndBackward) {
  const Published ref("flex-stodola-green-rotor");
  BeamModel shaft;
  shaft.length = 1.0, shaft.material = {200e9, 0.3, 1e-3}, shaft.section = tube_section(0.01, 0.01), shaft.rotary_inertia = false;
  const double polar = ref.model()["polar_kgm2"].as<double>(), diametral = ref.model()["diametral_kgm2"].as<double>();
  BodySpec disc = on(rigid("disc", ref.model()["disc_kg"].as<double>(), Vector3d::Zero(), diagonal({polar, diametral, diametral})), "shaft",
                     "revolute", {X});
  disc.hinge.inboard_node = "tip";
  const auto model = compiled(system({flexible("shaft", nafems_beam(shaft, 12)), disc}));
  State s = model->initial_state();
  const auto whirl = [&](double spin) {
    s.v[model->nv - 1] = spin;
    std::vector<double> up;
    for (const operators::Pole& p : operators::poles(operators::linearize(*model, {.q = s.q.data(), .v = s.v.data()}).A))
      if (p.value.imag() > 1.0) up.push_back(p.value.imag());
    return up;
  };
  const VectorXd at_rest = ref.vector("at rest"), spinning = ref.vector("at 100 rad/s");
  const std::vector<double> rest = whirl(0.0), fast = whirl(100.0);
  ASSERT_GE(std::min(rest.size(), fast.size()), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    expect_relative(fmt::format("at rest, {}", i + 1), rest[i], at_rest[static_cast<Eigen::Index>(i / 2)], ref.tolerance("rel"));
    expect_relative(fmt::format("at 100 rad/s, {}", i + 1), fast[i], spinning[static_cast<Eigen::Index>(i)], ref.tolerance("rel"));
  }
}

// Upright a column is at rest under any weight; its lowest pole is real and positive where it falls over. Eight shapes.
TEST(Column, BucklesUnderItsOwnWeight) {
  const Published ref("flex-column-own-weight");
  const Blade blade(8);
  const auto falls = [&](double gravity) {
    const auto model = compiled(blade.standing(gravity));
    const State s = model->initial_state();
    for (const operators::Pole& p : operators::poles(operators::linearize(*model, {.q = s.q.data(), .v = s.v.data()}).A))
      if (p.value.real() > 1e-4) return true;
    return false;
  };
  double low = 7.0, high = 9.0;
  for (int i = 0; i < 30; ++i) (falls(0.5 * (low + high)) ? high : low) = 0.5 * (low + high);
  expect_relative("weight L^2 / EI", low, ref.number("weight L^2 / EI"), ref.tolerance("rel"));
}

}  // namespace
}  // namespace cardan::test
