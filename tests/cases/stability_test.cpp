// Cases of poles: columns and rotors that lose their stability, booms with wheels, blades that spin. Numbers by closed forms, in the
// files of tests/reference/cases.
#include <cmath>
#include <complex>

#include "bodies/modal/modal_source.hpp"
#include "core/sim/simulation.hpp"
#include "tests/cases/poles.hpp"
#include "tests/cases/published.hpp"

namespace cardan::test {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

TEST(BecksColumn, OfTwentyRodsFlutters) {
  const Published ref("rigid-beck-chain");
  const int n = ref.model()["rods"].as<int>();
  const double l = 1.0 / n;
  std::vector<BodySpec> rods;
  for (int i = 0; i < n; ++i) {
    const std::string inboard = i == 0 ? "" : rods.back().name;
    rods.push_back(on(rigid(fmt::format("rod_{}", i), l, 0.5 * l * X, l * l * l / 12.0 * diagonal({1e-3, 1, 1})), inboard, "revolute", {Z},
                      i == 0 ? Vector3d(Vector3d::Zero()) : Vector3d(l * X)));
    rods.back().hinge.springs = {{0, (i == 0 ? 2.0 : 1.0) / l, 0.0, 0.0, {}}};
    rods.back().nodes = {{"end", l * X, Eigen::Matrix3d::Identity(), {}}};
  }
  const auto model = compiled(system(rods));
  const auto grows = [&](double load) {
    const NodeWrench push{model->find_node(rods.back().name + ".end"), false, {{0, 0, 0}, {-load, 0, 0}}};
    double most = -HUGE_VAL;
    for (const operators::Pole& p : operators::poles(linear_at_start(*model, {&push, 1}).A)) most = std::max(most, p.value.real());
    return most > 1e-4;  // at the double root poles of 9 rad/s part as the root of what is beyond: 1e-10 of the load
  };
  double low = 10.0, high = 30.0;
  for (int i = 0; i < 36; ++i) (grows(0.5 * (low + high)) ? high : low) = 0.5 * (low + high);
  expect_relative("flutter load of twenty rods", low, ref.number("flutter load of twenty rods"), ref.tolerance("chain_rel"));
  expect_relative("flutter load of the column", low, ref.number("flutter load of the column"), ref.tolerance("column_rel"));
}

// The shaft turns as it is told and carries springs and dampers in its axes; the bearing damps from the world.
TEST(InternalDamping, MakesARotorWhirlFromTheThresholdOn) {
  const Published ref("rigid-rotor-internal-damping");
  const double m = 2.0, k = 8000.0, inside = 6.0, outside = 4.0;
  for (const double share : {0.99, 1.01}) {
    const double spin = share * ref.number("threshold");
    BodySpec shaft = on(rigid("shaft", 1.0, Vector3d::Zero(), diagonal({1, 1, 1})), "", "revolute", {Z});
    shaft.hinge.prescribed = {0};
    shaft.hinge.v = {spin};
    BodySpec disc = on(particle("disc", m, Vector3d::Zero()), "shaft", "translational");
    disc.hinge.springs = {{0, k, 0.0, inside, {}}, {1, k, 0.0, inside, {}}, {2, k, 0.0, 0.0, {}}};
    SystemSpec spec = system({shaft, disc});
    DeviceSpec bearing;
    bearing.name = "bearing", bearing.type = "bushing";
    bearing.mounts["from"] = {"world", {}}, bearing.mounts["to"] = {"disc", {}};
    for (const char* none : {"stiffness", "turn_stiffness"}) bearing.params[none].value = std::vector<double>{0, 0, 0};
    bearing.params["damping"].value = std::vector<double>{outside, outside, 0};
    spec.devices = {bearing};
    const auto poles = operators::poles(linear_at_start(*run_of(spec)).A);
    const std::complex<double> i(0, 1), root = std::sqrt((inside + outside) * (inside + outside) - 4.0 * m * (k - i * spin * inside));
    for (const double sign : {-1.0, 1.0}) {
      const std::complex<double> want = (-(inside + outside) + sign * root) / (2.0 * m) - i * spin;
      expect_within(fmt::format("pole at {} of the threshold", share), distance_of(poles, want) / std::abs(want),
                    ref.tolerance("poles_rel"));
      if (sign > 0.0) {
        EXPECT_EQ(want.real() > 0.0, share > 1.0);
      }
    }
  }
}

ModalSource boom_on_interfaces(double length, double E, double rho, const BeamSection& section, int modes) {
  BeamModel beam;
  beam.length = length;
  beam.material = {E, 0.3, rho};
  beam.section = section;
  beam.rotary_inertia = false;
  ModalSource source;
  source.model = beam;
  source.boundary = Boundary::craig_bampton;
  source.modes.count = modes;
  source.damping = {0.0};
  source.points = {{"tip", length * X, true}};
  return source;
}
BodySpec modal_body(const std::string& name, std::shared_ptr<const ModalData> modal) {
  BodySpec b;
  b.name = name, b.type = "modal_flexible", b.modal = std::move(modal);
  return b;
}

TEST(GyroelasticBoom, WhirlsBothWays) {
  const Published ref("flex-gyroelastic-boom");
  const auto of = [&](const char* name) { return ref.model()[name].as<double>(); };
  const double I = of("I_m4");
  const ModalSource source = boom_on_interfaces(of("length_m"), of("E_Pa"), of("rho_kgm3"), {of("area_m2"), I, I, 2.0 * I, 0.0, 0.0}, 24);
  BodySpec head = on(rigid("head", of("head_mass_kg"), Vector3d::Zero(), diagonal(Published::as_vector(ref.model()["head_inertia_kgm2"]))),
                     "boom", "locked");
  head.hinge.inboard_node = "tip";
  SystemSpec spec = system({modal_body("boom", std::make_shared<const ModalData>(make_modal_data(source))), head});
  DeviceSpec wheel;
  wheel.name = "wheel", wheel.type = "momentum_wheel", wheel.mounts["at"] = {"head", {}};
  wheel.params = along({X});
  wheel.params["inertia"].value = 0.01;
  wheel.initial["momentum"].value = of("wheel_momentum_Nms");
  spec.devices = {wheel};
  const auto poles = operators::poles(linear_at_start(*run_of(spec)).A);
  for (const double w : ref.vector("whirl"))
    expect_within(fmt::format("whirl of {:.1f} rad/s", w), distance_of(poles, {0.0, w}) / w, ref.tolerance("rel"));
}

/// Frequencies, ascending, in sqrt(EI / m L^4), of a blade of length 10 in so many pieces, about the state in which its tension holds it.
VectorXd frequencies_of_pieces(int n, double spin) {
  const double length = 10.0 / n;
  const auto modal =
      std::make_shared<const ModalData>(make_modal_data(boom_on_interfaces(length, 1e6, 1.0, {1.0, 1e-6, 1e-6, 1e-3, 0, 0}, 4)));
  BodySpec hub = on(rigid("hub", 1.0, Vector3d::Zero(), diagonal({1, 1, 1})), "", "revolute", {Z});
  hub.hinge.prescribed = {0};
  hub.hinge.v = {spin / 100.0};
  std::vector<BodySpec> bodies = {hub};
  for (int i = 0; i < n; ++i) {
    bodies.push_back(on(modal_body(fmt::format("piece_{}", i), modal), bodies.back().name, "locked"));
    if (i > 0) bodies.back().hinge.inboard_node = "tip";
  }
  const auto model = compiled(system(bodies));
  State s = model->initial_state();
  const int modes = model->nv - 1;  // behind the hub's angle
  operators::LinearModel linear;
  for (int i = 0; i < 2; ++i) {  // Newton: the stretch is linear in the tension but for 1e-4
    linear = operators::linearize(*model, {.q = s.q.data(), .v = s.v.data()});
    if (i == 0)
      s.q.tail(modes) -=
          MatrixXd(linear.A.block(linear.A.rows() - modes, 1, modes, modes)).partialPivLu().solve(VectorXd(linear.drift.tail(modes)));
  }
  std::vector<double> w;
  for (const operators::Pole& p : operators::poles(linear.A))
    if (p.value.imag() > 1e-6) w.push_back(100.0 * p.value.imag());
  std::sort(w.begin(), w.end());
  return Eigen::Map<const VectorXd>(w.data(), 6);
}

TEST(BladeOfPieces, StiffensAsItsTensionDoes) {
  const Published ref("flex-southwell-pieces");
  const VectorXd four = frequencies_of_pieces(4, 6.0), eight = frequencies_of_pieces(8, 6.0), tend = eight + (eight - four) / 3.0;
  for (const bool flap : {true, false}) {
    const std::string which = flap ? "flap" : "lag";
    const VectorXd want = ref.vector(which);
    for (int k = 0; k < 3; ++k) {
      const int at = 2 * k + (flap ? 1 : 0);
      expect_relative(fmt::format("{} {}, eight pieces", which, k + 1), eight[at], want[k], ref.tolerance("eight_rel"));
      expect_relative(fmt::format("{} {}, from four and eight", which, k + 1), tend[at], want[k], ref.tolerance("rel"));
    }
  }
}

}  // namespace
}  // namespace cardan::test
