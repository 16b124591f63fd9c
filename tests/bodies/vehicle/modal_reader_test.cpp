#include "bodies/vehicle/modal_reader.hpp"
#include "bodies/vehicle/load_vehicle.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "core/io/yaml_reader.hpp"

namespace cardan {
namespace {

ModalSource read(const std::string& text) {
  const DocNode root = parse_yaml(text, "folder/test.yaml");
  DiagnosticSink sink;
  std::vector<std::pair<std::string, std::string>> defaults;
  ReadContext context{sink, defaults};
  ModalSource source = read_modal_source({&root, "modal"}, context);
  sink.throw_if_any();
  return source;
}

TEST(ModalSource, OfABeam) {
  const ModalSource source = read(
      "beam: {length: 12 m, material: {E: 70 GPa, rho: 2.7 g/cm^3}, section: {rectangle: {width: 4 cm, height: 2 cm}}, "
      "elements: 30, rotary_inertia: false}\n"
      "boundary: craig_bampton\nmodes: {count: 6, max_frequency: 20 Hz, effective_mass: 95 %}\ndamping: [0.5 %, 1 %]\n"
      "nodes: {mid: {position: [6, 0, 0]}, tip: {position: [12, 0, 0], interface: true}}\n"
      "masses:\n  - {mass: 3 kg, position: [12, 0, 0], inertia: [1, 2, 2]}\n");
  const auto& beam = std::get<BeamModel>(source.model);
  EXPECT_EQ(beam.length, 12.0);
  EXPECT_EQ(beam.material.E, 70e9);
  EXPECT_EQ(beam.material.nu, 0.3);
  EXPECT_DOUBLE_EQ(beam.material.rho, 2700.0);
  EXPECT_DOUBLE_EQ(beam.section.area, 8e-4);
  EXPECT_DOUBLE_EQ(beam.section.Iy, 0.04 * 0.02 * 0.02 * 0.02 / 12) << "width is along y, height along z";
  EXPECT_EQ(beam.elements, 30);
  EXPECT_FALSE(beam.rotary_inertia);
  EXPECT_EQ(source.boundary, Boundary::craig_bampton);
  EXPECT_EQ(source.modes.count, 6);
  EXPECT_EQ(source.modes.max_frequency, 20.0) << "Hz, not rad/s";
  EXPECT_DOUBLE_EQ(source.modes.effective_mass, 0.95);
  EXPECT_EQ(source.damping, (std::vector<double>{0.005, 0.01}));
  ASSERT_EQ(source.points.size(), 2u);
  EXPECT_FALSE(source.points[0].interface);
  EXPECT_TRUE(source.points[1].interface);
  ASSERT_EQ(source.masses.size(), 1u);
  EXPECT_EQ(source.masses[0].inertia(2, 2), 2.0);
  EXPECT_EQ(source.at.key_path, "modal");
}

TEST(ModalSource, OfABeamWithASectionByNumbers) {
  const ModalSource source = read(
      "beam: {length: 1, material: {E: 70 GPa, rho: 2700},\n  section: {area: 6 cm^2, Iy: 2e-8, Iz: 3e-8, J: 4e-8, shear_y: 0.7, "
      "shear_z: 0.4}}\nmodes: {count: 1}\n");
  const BeamSection& section = std::get<BeamModel>(source.model).section;
  EXPECT_DOUBLE_EQ(section.area, 6e-4);
  EXPECT_EQ(section.Iy, 2e-8);
  EXPECT_EQ(section.Iz, 3e-8);
  EXPECT_EQ(section.J, 4e-8);
  EXPECT_EQ(section.shear_y, 0.7);
  EXPECT_EQ(section.shear_z, 0.4);
}

TEST(ModalSource, AnEmptyRootIsRefused) {
  const auto with = [](const std::string& root) {
    return read("matrices: {nodes: n.csv, mass: m.mtx, stiffness: k.mtx, root: " + root + "}\nmodes: {count: 2}\n");
  };
  EXPECT_EQ(std::get<MatrixModel>(with("[a, b]").model).root.names, (std::vector<std::string>{"a", "b"}));
  EXPECT_THROW(with("[]"), InputError) << "it would hold the node at the origin, as no key does";
  const MatrixModel by_plane = std::get<MatrixModel>(with("{position: [1 cm, 0, 0], normal: [0, 1, 0]}").model);
  EXPECT_EQ(by_plane.root.normal, Eigen::Vector3d::UnitY());
  EXPECT_EQ(by_plane.at, Eigen::Vector3d(0.01, 0, 0));
  EXPECT_EQ(std::get<MatrixModel>(with("{names: [a, 12]}").model).root.names, (std::vector<std::string>{"a", "12"}));
  EXPECT_THROW(with("{position: [0, 0, 0]}"), InputError) << "a place alone is no set";
  EXPECT_THROW(with("{numbers: [1, 2, 3]}"), InputError) << "tables have names";
  EXPECT_THROW(with("{names: [a], position: [0, 0, 0], within: 1}"), InputError) << "one of them";
}

TEST(ModalSource, OfASandwichPlateOnAYoke) {
  const ModalSource source = read(R"(
plate:
  length: 10
  width: 2.4 m
  sandwich: {face: {E: 70 GPa, rho: 2700}, face_thickness: 0.3 mm, core_thickness: 20 mm, core_density: 32 kg/m^3, added_mass: 1.5 kg/m^2}
  elements_x: 20
  elements_y: 6
  yoke: {length: 2, spread: 2, material: {E: 70 GPa, rho: 2700}, section: {tube: {radius: 2 cm, wall: 1 mm}}}
modes: {count: 8}
)");
  const auto& plate = std::get<PlateModel>(source.model);
  EXPECT_EQ(plate.width, 2.4);
  EXPECT_EQ(plate.elements_x, 20);
  EXPECT_EQ(plate.elements_y, 6);
  EXPECT_EQ(plate.yoke.spread, 2.0);
  const auto& panel = std::get<SandwichPanel>(plate.panel);
  EXPECT_DOUBLE_EQ(panel.face_thickness, 0.3e-3);
  EXPECT_EQ(panel.core_density, 32.0);
  EXPECT_EQ(panel.added_mass, 1.5);
  EXPECT_EQ(source.damping, std::vector<double>{0.005}) << "the default";
}

TEST(ModalSource, OfLumpedMasses) {
  const ModalSource source = read(R"(
lumped:
  masses:
    - {mass: 2, position: [1, 0, 0], Phi: [[0, 1], [2, 3], [4, 5]], Psi: [[0, 0], [0, 0], [1, 0]]}
  K: [[100, 0], [0, 200]]
  nodes: {tip: {position: [1, 0, 0], Phi: [[0, 1], [2, 3], [4, 5]]}}
)");
  const auto& lumped = std::get<LumpedModel>(source.model);
  ASSERT_EQ(lumped.mass_nodes.size(), 1u);
  EXPECT_EQ(lumped.mass_nodes[0].Phi(1, 0), 2.0) << "rows are x, y, z";
  EXPECT_EQ(lumped.mass_nodes[0].Psi(2, 0), 1.0);
  EXPECT_EQ(lumped.K(1, 1), 200.0);
  EXPECT_EQ(lumped.C, Eigen::MatrixXd::Zero(2, 2));
  EXPECT_EQ(lumped.nodes.at(0).Phi(2, 1), 5.0);
}

TEST(ModalSource, OfAFileIsRelativeToTheVehicle) {
  EXPECT_EQ(std::get<FileModel>(read("file: modes/wing.h5").model).path, "folder/modes/wing.h5");
}

TEST(ModalSource, OfMatricesIsRelativeToTheVehicle) {
  const ModalSource source = read(
      "matrices: {nodes: fe/nodes.csv, mass: fe/M.mtx, stiffness: fe/K.mtx, damping: C.mtx, root: [a, 12], component_modes: 7}\n"
      "boundary: free\nmodes: {count: 6}\nnodes: {tip: {position: [1, 0, 0]}}\nmasses: [{mass: 1, position: [1, 0, 0]}]\n");
  const auto& matrices = std::get<MatrixModel>(source.model);
  EXPECT_EQ(matrices.nodes, "folder/fe/nodes.csv");
  EXPECT_EQ(matrices.mass, "folder/fe/M.mtx");
  EXPECT_EQ(matrices.stiffness, "folder/fe/K.mtx");
  EXPECT_EQ(matrices.damping, "folder/C.mtx");
  EXPECT_EQ(matrices.root.names, (std::vector<std::string>{"a", "12"}));
  EXPECT_EQ(matrices.component_modes, 7);
  EXPECT_EQ(source.boundary, Boundary::free);
  EXPECT_EQ(source.points.at(0).name, "tip");
  EXPECT_EQ(source.masses.size(), 1u);
}

TEST(ModalSource, OfMatricesHasOneKindOfDamping) {
  try {
    read("matrices: {nodes: n.csv, mass: M.mtx, stiffness: K.mtx, damping: C.mtx}\nmodes: {count: 6}\ndamping: 1 %\n");
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("  at: modal.damping\n"), std::string::npos) << e.what();
    EXPECT_NE(std::string(e.what()).find("  expected: one of damping and matrices.damping alone\n  got:      both\n"), std::string::npos)
        << e.what();
  }
}

TEST(MakeModes, SolvesEqualSourcesOnce) {
  const std::string wing =
      "{type: modal_flexible, modal: {beam: {length: 10, material: {E: 70 GPa, rho: 2700}, section: {tube: {radius: 5 "
      "cm, wall: 1 mm}}, elements: 10}, "
      "modes: {count: 2}}, hinge: {type: locked, to: world}}\n";
  SystemSpec spec;
  const DocNode root = parse_yaml("a: " + wing + "b: " + wing, "test.yaml");
  for (std::size_t i = 0; i < 2; ++i) {
    BodySpec body;
    body.name = root.keys[i].name;
    body.type = "modal_flexible";
    body.modal_source = std::make_shared<const DocNode>(*root.items[i].find("modal"));
    spec.bodies.push_back(std::move(body));
  }
  make_modes(spec);
  ASSERT_TRUE(spec.bodies[0].modal);
  EXPECT_EQ(spec.bodies[0].modal, spec.bodies[1].modal);
  EXPECT_EQ(spec.bodies[0].modal->n_modes, 2);
  EXPECT_FALSE(spec.defaults_used.empty());
}

}  // namespace
}  // namespace cardan
