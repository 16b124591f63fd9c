// Published cases of flexible bodies in a tree: the frequencies of the whole out of the modes of its parts.
#include <cmath>
#include <numbers>

#include "bodies/modal/modal_integrals.hpp"
#include "bodies/modal/modal_source.hpp"
#include "core/dynamics/inverse.hpp"
#include "tests/cases/published.hpp"

namespace cardan::test {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
const Vector3d X = Vector3d::UnitX(), Z = Vector3d::UnitZ();

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

/// omega^2 of small motion about q = 0.
VectorXd omega2(const SystemSpec& spec) {
  const auto model = compiled(spec);
  Workspace ws(*model);
  const VectorXd zero = model->initial_state().q, none = VectorXd::Zero(model->nv);
  MatrixXd K(model->nv, model->nv);
  for (int i = 0; i < model->nv; ++i) {
    VectorXd q = zero;
    q[i] = 1.0;
    K.col(i) = -elastic_force(*model, q.data(), none.data());
  }
  return Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd>(K, mass_matrix(*model, ws, zero.data()),
                                                            Eigen::EigenvaluesOnly)
      .eigenvalues();
}

// 16 modes per beam leave out compliance of the order beta^4 sum_{k > 16} 4 / beta_k^8 < 1e-8 of the hub's coupling;
// the mesh adds (k h)^4 / 720. One plane, equal and opposite beams: a clamped root lies below each root of the hub's
// motion.
TEST(HubWithTwoBeams, TurnsWithTheRootsOfRotationCoupledBending) {
  const Published ref("flex-hub-two-appendages");
  ModalSource source = plane_beam();
  source.modes.count = 16;
  const auto modal = std::make_shared<const ModalData>(make_modal_data(source));
  const VectorXd clamped = ref.vector("limit j -> infinity");
  for (const int j10 : {1, 10, 100}) {
    const double j = 0.1 * j10, J = 2.0 * j;
    const VectorXd want = ref.vector(j10 == 1 ? "j=0.1" : j10 == 10 ? "j=1" : "j=10");
    BodySpec right = on(flexible("right", modal), "hub", "locked"), left = on(flexible("left", modal), "hub", "locked");
    left.hinge.onode_R = Eigen::AngleAxisd(std::numbers::pi, Z).toRotationMatrix();
    const SystemSpec spec =
        system({on(rigid("hub", 1.0, Vector3d::Zero(), diagonal({J, J, J})), "", "revolute", {Z}), right, left});
    const VectorXd beta = omega2(spec).cwiseMax(0.0).array().pow(0.25);
    double coupled = 0.0, held = 0.0;
    for (int k = 0; k < 4; ++k) {
      held = worse(held, std::abs(beta[1 + 2 * k] / clamped[k] - 1.0));
      coupled = worse(coupled, std::abs(beta[2 + 2 * k] / want[k] - 1.0));
    }
    EXPECT_LE(beta[0], 1e-3);  // the hub turns freely; beta^4 = 1e-12 is rounding of K / M
    expect_within(fmt::format("j = {}: clamped roots", j).c_str(), held, ref.tolerance("rel"));
    expect_within(fmt::format("j = {}: coupled roots", j).c_str(), coupled, ref.tolerance("rel"));
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
    expect_within(fmt::format("r = {}", r).c_str(), largest(beta.head<3>().cwiseQuotient(want).array() - 1.0),
                  ref.tolerance("rel"));
  }
}

// Flap of a spinning blade: analytic clamped-free modes with the shortening u = -1/2 int w'^2 dx as second-order field
// Q. The blade's points are those of a Gauss rule, weighted by it: integrals of the products of shapes are exact to
// rounding.
class Blade {
 public:
  explicit Blade(int n_modes) {
    std::vector<double> beta;
    for (int k = 0; k < n_modes; ++k) beta.push_back(root(k));
    constexpr int cells = 60;
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

  /// Flap frequencies at this rate of spin, root at this distance from the axis: eta'' = -A eta by central differences;
  /// the error of the differences is 1e-9 (the motion is odd in eta, third order).
  VectorXd flap(double spin, double root) const {
    BodySpec blade = on(flexible("blade", modal_), "", "revolute", {Z});
    blade.level = 2;
    blade.hinge.pnode_position = -root * X;
    blade.hinge.prescribed = {0};
    const auto model = compiled(system({blade}));
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
    VectorXd squares = A.eigenvalues().real();
    std::sort(squares.begin(), squares.end());
    return squares.cwiseSqrt();
  }

 private:
  /// Roots of cos b cosh b = -1 by Newton on cos b + 1 / cosh b.
  static double root(int k) {
    double b = (k + 0.5) * std::numbers::pi;
    for (int i = 0; i < 20; ++i) b += (std::cos(b) + 1.0 / std::cosh(b)) / (std::sin(b) + std::tanh(b) / std::cosh(b));
    return b;
  }
  /// cosh bx - cos bx - r (sinh bx - sin bx), r = (cosh b + cos b) / (sinh b + sin b), without the difference of large
  /// numbers.
  static double rest(double b) {
    return (std::sin(b) - std::cos(b) - std::exp(-b)) / (std::sinh(b) + std::sin(b));
  }  // 1 - r
  static double shape(double b, double x) {
    const double c = rest(b), r = 1.0 - c;
    return 0.5 * (c * std::exp(b * x) + (1.0 + r) * std::exp(-b * x)) - std::cos(b * x) + r * std::sin(b * x);
  }
  static double slope(double b, double x) {
    const double c = rest(b), r = 1.0 - c;
    return b * (0.5 * (c * std::exp(b * x) - (1.0 + r) * std::exp(-b * x)) + std::sin(b * x) + r * std::cos(b * x));
  }
  std::shared_ptr<const ModalData> modal_;
};

TEST(SpinningBlade, StiffensLikeWrightsBeam) {
  const Published ref("flex-rotating-beam-wright");
  const Blade blade(14);
  double worst = 0.0;
  for (const int hub : {0, 1})
    for (const int eta :
         hub == 0 ? std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12} : std::vector<int>{1, 3, 6, 12}) {
      const VectorXd want = ref.vector(fmt::format("eta={}, hub {}", eta, hub)), got = blade.flap(eta, hub);
      for (int k = 0; k < 3; ++k) {
        const double error = std::abs(got[k] / want[k] - 1.0);
        EXPECT_LE(error, ref.tolerance("rel")) << "eta " << eta << ", hub " << hub << ", mode " << k + 1;
        worst = worse(worst, error);
      }
    }
  expect_within("flap frequencies", worst, ref.tolerance("rel"));
}

}  // namespace
}  // namespace cardan::test
