// Bodies of solid elements in a vehicle: their keys, their files, and that they move as the theory says.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>
#include <numbers>

#include "bodies/register.hpp"
#include "bodies/vehicle/load_vehicle.hpp"
#include "core/model/model.hpp"
#include "core/sim/reference_check.hpp"
#include "core/sim/simulation.hpp"
#include "hinges/register.hpp"
#include "plugins/devices/register.hpp"
#include "tests/bodies/modal/solid_samples.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

using Eigen::Vector3d;

void write_text(const std::string& path, const std::string& text) { std::ofstream(path) << text; }

/// Bulk data in free fields.
std::string bulk_text(const SolidMesh& mesh) {
  std::string out = "$ of a test\nSOL 103\nCEND\nBEGIN BULK\nPSOLID,1,1\nMAT1,1,7.+10,,.3,2700.\nSPC1,1,123456,1\n";
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
    out += fmt::format("GRID,{},,{:.15e},{:.15e},{:.15e}\n", i + 1, mesh.nodes[i].x(), mesh.nodes[i].y(), mesh.nodes[i].z());
  for (const SolidMesh::Element& e : mesh.elements) {
    out += fmt::format("{},{},1", e.shape == SolidShape::tetra10 ? "CTETRA" : "CHEXA", e.number);
    for (std::size_t k = 0; k < e.nodes.size(); ++k)
      out += (k == 6 || (k > 6 && (k - 6) % 8 == 0) ? ",+\n+," : ",") + fmt::format("{}", e.nodes[k] + 1);
    out += '\n';
  }
  return out + "ENDDATA\n";
}

/// An arm of 0.8 m with a square section that grows thinner.
Vector3d tapered(const Vector3d& s) {
  const double width = 0.08 - 0.04 * s.x();
  return {0.8 * s.x(), width * (s.y() - 0.5), width * (s.z() - 0.5)};
}

struct Bracket {
  TemporaryFolder dir;
  Registry registry;
  Bracket() {
    const SolidMesh mesh = test::block(SolidShape::hexa20, {4, 1, 1}, tapered, {});
    write_text(dir / "arm.bdf", bulk_text(mesh));
    register_hinges(registry), register_bodies(registry), register_devices(registry);
  }
  std::string vehicle(const std::string& modal, const std::string& eta) {
    write_text(dir / "vehicle.yaml", fmt::format(R"(cardan: 1
bodies:
  bus: {{mass: 20, inertia: [2, 3, 4], nodes: {{side: {{position: [0.3, 0.1, 0]}}}},
        hinge: {{type: free, to: world, initial: {{velocity: [0.1, 0.2, -0.3], rate: [0.2, -0.3, 0.4]}}}}}}
  bracket:
    type: modal_flexible
    level: 1
    initial: {{eta: {}}}
    modal: {{{}}}
    hinge: {{type: locked, to: bus.side}}
  wing:
    type: modal_flexible
    level: 1
    modal: {{plate: {{length: 2, width: 0.5, solid: {{material: {{E: 70 GPa, rho: 2700}}, thickness: 3 mm}}, elements_x: 8, elements_y: 2}},
            modes: {{count: 3}}, damping: 0, nodes: {{tip: {{position: [2, 0, 0]}}}}}}
    hinge: {{type: revolute, axis: [0, 1, 0], to: bracket.tip, initial: {{rate: -0.2}}}}
)",
                                                 eta, modal));
    return dir / "vehicle.yaml";
  }
};

const char* kArm =
    "solid: {mesh: arm.bdf, root: {position: [0, 0, 0], normal: [1, 0, 0]}}, modes: {count: 4}, damping: 0, "
    "nodes: {tip: {position: [0.8, 0, 0], normal: [1, 0, 0]}}";
const char* kReducedArm =
    "solid: {mesh: arm.bdf, root: {position: [0, 0, 0], within: 60 mm}}, boundary: craig_bampton, modes: {count: 2}, damping: 0, "
    "nodes: {tip: {position: [0.8, 0, 0], within: 3 cm, interface: true}}, masses: [{mass: 0.5, position: [0.4, 0, 0], within: 5 cm, "
    "inertia: [1e-3, 2e-3, 2e-3]}]";

TEST(SolidsInAVehicle, KeepMomentumAndEnergyAndMoveAsTheTwinDoes) {
  Bracket bracket;
  for (const auto& [modal, eta] : {std::pair(kArm, "[3e-3, -2e-3, 0, 0]"), {kReducedArm, "[3e-3, -2e-3, 0, 0, 0, 0, 0, 0]"}}) {
    SimulationOptions options;
    options.integrator = {.method = "dop853", .relative_tolerance = 1e-10};
    options.absolute_tolerance = 1e-12;
    Simulation sim(compile(*load_vehicle(bracket.vehicle(modal, eta), bracket.registry), bracket.registry), options);
    EXPECT_LE(difference_from_twin(sim), 1e-9);
    const Momentum before = sim.momentum();
    const double energy = sim.energy().total();
    sim.run(0.5);
    const Momentum after = sim.momentum();
    EXPECT_LE((after.linear - before.linear).norm(), 1e-9 * before.linear.norm());
    EXPECT_LE((after.angular - before.angular).norm(), 1e-9 * before.angular.norm());
    EXPECT_NEAR(sim.energy().total(), energy, 1e-8 * std::abs(energy));
    EXPECT_LE(difference_from_twin(sim), 1e-9);
  }
}

/// A stiff arm carries the wing as a rigid body of its mass, centre and inertia does.
TEST(SolidsInAVehicle, AreRigidBodiesWhereTheyAreStiff) {
  Bracket bracket;
  const auto spec = load_vehicle(bracket.vehicle(kArm, "[3e-3, -2e-3, 0, 0]"), bracket.registry);
  const auto& modal = *spec->bodies[1].modal;
  // width w(x) = 0.08 - 0.05 x: volume = integral w^2.
  const auto w2 = [](double x) { return std::pow(0.08 - 0.05 * x, 2); };
  double volume = 0, first = 0, Ixx = 0, Iyy = 0;  // Simpson's rule is exact for the volume, 2000 intervals for the rest
  const int n = 2000;
  for (int i = 0; i <= n; ++i) {
    const double x = 0.8 * i / n, c = (i == 0 || i == n ? 1 : i % 2 ? 4 : 2) * 0.8 / n / 3;
    volume += c * w2(x), first += c * w2(x) * x, Ixx += c * w2(x) * w2(x) / 6, Iyy += c * (w2(x) * w2(x) / 12 + w2(x) * x * x);
  }
  EXPECT_NEAR(modal.integrals.I1, 2700 * volume, 1e-10);
  EXPECT_NEAR(modal.integrals.I2.x(), 2700 * first, 1e-10);
  EXPECT_NEAR(modal.integrals.I7(0, 0), 2700 * Ixx, 1e-12);
  EXPECT_NEAR(modal.integrals.I7(1, 1), 2700 * Iyy, 1e-10);
  EXPECT_EQ(modal.nodes[0].name, "root");
  EXPECT_TRUE(modal.nodes[0].Phi.isZero(0.0));
  EXPECT_EQ(modal.nodes[1].position, Vector3d(0.8, 0, 0));
  EXPECT_GT(modal.nodes[1].Psi.norm(), 0.0) << "the end turns as it bends";
}

TEST(SolidsInAVehicle, TellWhatTheyDidNotTake) {
  Bracket bracket;
  const auto spec = load_vehicle(bracket.vehicle(kArm, "[3e-3, -2e-3, 0, 0]"), bracket.registry);
  bool told = false;
  for (const Warning& w : spec->warnings.all())
    told = told || (w.what.code == Code::no_effect && w.what.about.find("SPC1") != std::string::npos);
  EXPECT_TRUE(told);
}

TEST(SolidsInAVehicle, AreRefusedWithTheKey) {
  Bracket bracket;
  const auto refused = [&](const std::string& modal) -> Diagnostic {
    try {
      load_vehicle(bracket.vehicle(modal, "[0, 0]"), bracket.registry);
    } catch (const InputError& e) {
      return e.diagnostics().front();
    }
    return {};
  };
  const auto expect = [&](const std::string& modal, const std::string& code, const std::string& key) {
    const Diagnostic d = refused(modal);
    EXPECT_EQ(number_of(d.code), code) << modal << render(d);
    EXPECT_EQ(d.at.key_path, "bodies.bracket.modal" + key) << modal << render(d);
    EXPECT_GT(d.at.mark.line, 0) << modal;
  };
  const std::string root = "root: {position: [0, 0, 0], normal: [1, 0, 0]}",
                    tip = ", modes: {count: 2}, nodes: {tip: {position: [0.8, 0, 0]}}";
  EXPECT_EQ(refused("solid: {mesh: arm.bdf, " + root + "}" + tip).got, "");
  expect("solid: {mesh: arm.bdf}" + tip, "C0105", "");
  expect("solid: {mesh: none.bdf, " + root + "}" + tip, "C0102", ".solid.mesh");
  expect("solid: {mesh: arm.bdf, root: {numbers: [99999]}}" + tip, "C0208", ".solid.root.numbers");
  expect("solid: {mesh: arm.bdf, root: {group: base}}" + tip, "C0208", ".solid.root.group");
  expect("solid: {mesh: arm.bdf, root: {position: [0, 0, 0]}}" + tip, "C0105", ".solid.root");
  expect("solid: {mesh: arm.bdf, root: {position: [-3, 0, 0], normal: [1, 0, 0]}}" + tip, "C0323", ".solid.root.normal");
  expect("solid: {mesh: arm.bdf, root: {position: [-3, 0, 0], within: 1 mm}}" + tip, "C0323", ".solid.root.within");
  expect("solid: {mesh: arm.bdf, root: {numbers: [1]}}" + tip, "C0322", "");
  expect("solid: {mesh: arm.bdf, " + root + ", material: {E: 70 GPa, rho: 2700}}" + tip, "C0106", ".solid.material");
  expect("solid: {mesh: arm.bdf, " + root + ", units: inch}" + tip, "C0106", ".solid.units");
  expect("solid: {mesh: arm.bdf, " + root + "}, modes: {count: 2}, nodes: {tip: {position: [3, 0, 0]}}", "C0323", ".nodes.tip.position");
  expect("solid: {mesh: arm.bdf, " + root + "}, modes: {count: 2}, nodes: {tip: {position: [0.8, 0, 0], within: 3 mm}}", "C0323",
         ".nodes.tip.within");
  expect("solid: {mesh: arm.bdf, " + root + "}, modes: {count: 2}, nodes: {tip: {numbers: [1, 2]}}", "C0323", ".nodes.tip");
  expect("solid: {mesh: arm.bdf, " + root + "}, modes: {count: 2}, nodes: {tip: {position: [0.8, 0, 0], within: -1}}", "C0301",
         ".nodes.tip.within");
}

}  // namespace
}  // namespace cardan
