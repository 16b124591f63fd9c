// A body given by M and K in place of its mesh: on a bus, on a moving carrier, on a flexible tip.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>

#include "bodies/modal/elements.hpp"
#include "bodies/register.hpp"
#include "bodies/vehicle/load_vehicle.hpp"
#include "core/model/model.hpp"
#include "core/sim/simulation.hpp"
#include "hinges/register.hpp"
#include "plugins/devices/register.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

void write_file(const std::string& path, const std::string& text) { std::ofstream(path) << text; }

void write_matrices(const TemporaryFolder& dir, const FeModel& mesh) {
  const auto text = [](const SparseMatrix& A) {
    std::string out = fmt::format("%%MatrixMarket matrix coordinate real general\n{0} {0} {1}\n", A.rows(), A.nonZeros());
    for (int j = 0; j < A.outerSize(); ++j)
      for (SparseMatrix::InnerIterator it(A, j); it; ++it) out += fmt::format("{} {} {:.17g}\n", it.row() + 1, j + 1, it.value());
    return out;
  };
  write_file(dir / "M.mtx", text(mesh.M));
  write_file(dir / "K.mtx", text(mesh.K));
  std::string nodes;
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i) nodes += fmt::format("{}, {:.17g}, 0, 0\n", i, mesh.nodes[i].x());
  write_file(dir / "nodes.csv", nodes);
}

const char* kBeam =
    "beam: {length: 4, material: {E: 70 GPa, nu: 0.3, rho: 2700}, section: {area: 4e-4, Iy: 2e-8, Iz: 5e-8, J: 3e-8}, elements: 30, "
    "rotary_inertia: false}";
const char* kMatrices = "matrices: {nodes: nodes.csv, mass: M.mtx, stiffness: K.mtx}";

/// The boom, by a source, on `carrier`: where the bus is after 2 s, and the momenta.
Eigen::VectorXd end_of(const TemporaryFolder& dir, const std::string& source, const std::string& carrier, int level) {
  write_file(dir / "vehicle.yaml", fmt::format(R"(cardan: 1
bodies:
  bus: {{mass: 60, inertia: [9, 12, 15], nodes: {{side: {{position: [0.5, 0.1, 0]}}}},
        hinge: {{type: free, to: world, initial: {{velocity: [0.1, 0.2, -0.3], rate: [0.2, -0.3, 0.4]}}}}}}
  carrier: {{mass: 5, inertia: [0.3, 0.4, 0.5], hinge: {{type: revolute, axis: [0, 1, 1], to: bus.side, initial: {{rate: 0.7}}}}}}
  arm:
    type: modal_flexible
    level: {0}
    modal: {{{1}, modes: {{count: 4}}, nodes: {{tip: {{position: [4, 0, 0]}}}}}}
    hinge: {{type: locked, to: bus.side}}
  boom:
    type: modal_flexible
    level: {0}
    initial: {{eta: [0.05, 0.03, 0, 0]}}
    modal: {{{2}, modes: {{count: 4}}, nodes: {{tip: {{position: [4, 0, 0]}}}}}}
    hinge: {{type: revolute, axis: [0, 0, 1], to: {3}, initial: {{rate: -0.2}}}}
)",
                                               level, kBeam, source, carrier));
  Registry registry;
  register_hinges(registry);
  register_bodies(registry);
  register_devices(registry);
  SimulationOptions options;
  options.integrator = {.method = "dop853", .relative_tolerance = 1e-11};
  options.absolute_tolerance = 1e-12;
  Simulation sim(compile(*load_vehicle(dir / "vehicle.yaml", registry), registry), options);
  sim.run(2.0);
  return sim.state().q.head(7);  // quaternion and position of the bus
}

TEST(MatricesInAVehicle, MoveItAsTheirMeshDoes) {
  const TemporaryFolder dir;
  BeamModel beam;
  beam.length = 4.0;
  beam.material = {70e9, 0.3, 2700.0};
  beam.section = {4e-4, 2e-8, 5e-8, 3e-8, 0.0, 0.0};
  beam.elements = 30;
  beam.rotary_inertia = false;
  write_matrices(dir, beam_mesh(beam, {}, {}));
  for (const std::string carrier : {"bus.side", "carrier", "arm.tip"}) {
    const Eigen::VectorXd still = end_of(dir, kBeam, carrier, 0);
    const Eigen::VectorXd zeroth = end_of(dir, kMatrices, carrier, 0);
    EXPECT_LE((zeroth - still).norm(), 1e-7) << carrier << ": at level 0 both know the same";
    const Eigen::VectorXd beam_first = end_of(dir, kBeam, carrier, 1), first = end_of(dir, kMatrices, carrier, 1);
    const double effect = (beam_first - still).norm();
    EXPECT_GE(effect, 1e-4) << carrier << ": what level 1 changes";
    EXPECT_LE((first - beam_first).norm(), 2e-2 * effect) << carrier << ": most of it is the same";
  }
}

}  // namespace
}  // namespace cardan
