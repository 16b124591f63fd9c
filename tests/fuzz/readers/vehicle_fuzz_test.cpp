// Vehicles in YAML, with --set, as far as a model of them; matrices of flexible bodies, as far as their modes.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "bodies/modal/elements.hpp"
#include "bodies/register.hpp"
#include "bodies/vehicle/load_vehicle.hpp"
#include "bodies/vehicle/modal_reader.hpp"
#include "core/io/yaml_reader.hpp"
#include "core/model/model.hpp"
#include "hinges/register.hpp"
#include "plugins/devices/register.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

using fuzz::Keep;
using fuzz::Random;

const std::vector<std::string> kWords = {"cardan",
                                         "name",
                                         "gravity",
                                         "uniform",
                                         "central",
                                         "mu",
                                         "centre",
                                         "gradient",
                                         "none",
                                         "loop_form",
                                         "embedding",
                                         "multipliers",
                                         "bodies",
                                         "type",
                                         "rigid",
                                         "particle",
                                         "modal_flexible",
                                         "mass",
                                         "com",
                                         "inertia",
                                         "about",
                                         "origin",
                                         "nodes",
                                         "position",
                                         "orientation",
                                         "axis",
                                         "angle",
                                         "rotvec",
                                         "quaternion_wxyz",
                                         "euler",
                                         "sequence",
                                         "zyx",
                                         "angles",
                                         "matrix",
                                         "hinge",
                                         "to",
                                         "at",
                                         "root",
                                         "world",
                                         "free",
                                         "ball",
                                         "revolute",
                                         "prismatic",
                                         "universal",
                                         "gimbal",
                                         "planar",
                                         "cylindrical",
                                         "helical",
                                         "translational",
                                         "locked",
                                         "free_body",
                                         "axes",
                                         "pitch",
                                         "initial",
                                         "rate",
                                         "velocity",
                                         "prescribed",
                                         "true",
                                         "false",
                                         "spring",
                                         "springs",
                                         "component",
                                         "stiffness",
                                         "damping",
                                         "rest",
                                         "level",
                                         "rotary_inertia",
                                         "modal",
                                         "beam",
                                         "plate",
                                         "lumped",
                                         "matrices",
                                         "solid",
                                         "mesh",
                                         "normal",
                                         "within",
                                         "file",
                                         "length",
                                         "width",
                                         "material",
                                         "E",
                                         "nu",
                                         "rho",
                                         "section",
                                         "tube",
                                         "rectangle",
                                         "radius",
                                         "wall",
                                         "elements",
                                         "boundary",
                                         "cantilever",
                                         "craig_bampton",
                                         "interface",
                                         "modes",
                                         "count",
                                         "max_frequency",
                                         "effective_mass",
                                         "masses",
                                         "Phi",
                                         "Psi",
                                         "Q",
                                         "K",
                                         "C",
                                         "kg",
                                         "m",
                                         "deg",
                                         "rad/s",
                                         "N m/rad",
                                         "GPa",
                                         "%",
                                         "km^3/s^2",
                                         "rpm",
                                         "null",
                                         "~",
                                         "*a",
                                         "&a",
                                         "<<",
                                         "!!int",
                                         "---",
                                         "devices",
                                         "momentum_wheel",
                                         "spring_damper",
                                         "lugre_friction",
                                         "thruster",
                                         "magnetorquer",
                                         "dc_motor",
                                         "tape_spring",
                                         "latch",
                                         "imu",
                                         "integrating_imu",
                                         "bushing",
                                         "cable",
                                         "stepper",
                                         "rotor_disturbance",
                                         "wheel_disturbance",
                                         "vibration",
                                         "recorded_load",
                                         "horizon_sensor",
                                         "gnss",
                                         "repeat",
                                         "iau2006",
                                         "moon_principal",
                                         "epoch",
                                         "bulletin",
                                         "inputs",
                                         "from",
                                         "period",
                                         "torque",
                                         "motor.torque",
                                         "stay.tension",
                                         "boom.rate",
                                         "bus.hook",
                                         "coulomb",
                                         "max_torque"};

/// Small enough that thousands of inputs take seconds: finite elements are the business of other tests.
bool is_small(const ModalSource& source) {
  if (const auto* beam = std::get_if<BeamModel>(&source.model)) return beam->elements <= 12 && source.modes.count <= 6;
  if (const auto* plate = std::get_if<PlateModel>(&source.model))
    return plate->elements_x <= 4 && plate->elements_y <= 4 && source.modes.count <= 6;
  return true;
}

void read(const std::string& text, const Overrides& overrides, const Registry& registry) {
  SystemSpec spec = vehicle_from_text(text, "fuzz.yaml", registry, overrides);
  DiagnosticSink sink;
  ReadContext context{sink, spec.defaults_used};
  bool small = true;
  for (const BodySpec& body : spec.bodies)
    if (body.modal_source) small = is_small(read_modal_source({body.modal_source.get(), "modal"}, context)) && small;
  sink.throw_if_any();
  if (!small) return;
  make_modes(spec);
  compile(spec, registry);
}

TEST(Fuzz, Vehicle) {
  const std::vector<std::string> seeds =
      fuzz::sources({"tests/errors", "tests/scripts", "tests/fuzz", "docs/operators", "scenarios"}, ".yaml");
  Registry registry;
  register_hinges(registry);
  register_bodies(registry);
  register_devices(registry);
  std::vector<std::string> good;
  for (const std::string& seed : seeds) {
    try {
      read(seed, {}, registry);
      good.push_back(seed);
    } catch (const InputError&) {  // what tests/errors has
    }
  }
  ASSERT_GT(seeds.size(), 50u);
  ASSERT_GT(good.size(), 8u);
  fuzz::run("vehicle", [&](Random& random, const Keep& keep) {
    const std::string text = fuzz::mutated(random.of(random.one_in(4) ? seeds : good), seeds, kWords, random);
    Overrides overrides;
    if (random.one_in(6)) {
      const std::string key = random.of(
          std::vector<std::string>{"bodies.bus.mass", "bodies.bus.inertia[1]", "bodies.b.hinge.initial", "gravity.uniform", "name"});
      overrides.emplace_back(fuzz::mutated(key, seeds, kWords, random),
                             fuzz::mutated("[1, 2, 3]", {"12 kg", ",", "{a: 1}"}, kWords, random));
    }
    keep(text + (overrides.empty() ? "" : "\n# --set " + overrides[0].first + "=" + overrides[0].second));
    read(text, overrides, registry);
  });
}

/// Tables and matrices of a small beam: from their text to its modes.
TEST(Fuzz, Matrices) {
  const FeModel mesh = beam_mesh({4.0, {70e9, 0.3, 2700.0}, tube_section(0.05, 0.002), 4}, {}, {});
  const auto text_of = [](const SparseMatrix& A) {
    std::string text = fmt::format("%%MatrixMarket matrix coordinate real general\n% of a beam\n{0} {0} {1}\n", A.rows(), A.nonZeros());
    for (int j = 0; j < A.outerSize(); ++j)
      for (SparseMatrix::InnerIterator it(A, j); it; ++it) text += fmt::format("{} {} {}\n", it.row() + 1, j + 1, it.value());
    return text;
  };
  std::string nodes = "name, x, y, z\n";
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i) nodes += fmt::format("n{}, {}, 0, 0\n", i, mesh.nodes[i].x());
  const std::vector<std::string> good = {nodes, text_of(mesh.M), text_of(mesh.K)};
  const std::vector<std::string> words = {"symmetric", "general", "integer", "%%MatrixMarket", "nan", "inf", "1e308", "-1", "31", "0"};
  const TemporaryFolder dir;
  ModalSource source;
  source.model = MatrixModel{dir / "nodes.csv", dir / "M.mtx", dir / "K.mtx", "", {}, Eigen::Vector3d::Zero(), 0};
  source.modes.count = 2;
  const std::vector<std::string> files = {dir / "nodes.csv", dir / "M.mtx", dir / "K.mtx"};
  for (std::size_t i = 0; i < 3; ++i) fuzz::write(files[i], good[i]);
  EXPECT_EQ(make_modal_data(source).n_modes, 2);
  fuzz::run("matrices", [&](Random& random, const Keep& keep) {
    const std::size_t changed = random.below(3);
    const std::string text = fuzz::mutated(good[changed], good, words, random);
    keep(files[changed] + "\n" + text);
    for (std::size_t i = 0; i < 3; ++i) fuzz::write(files[i], i == changed ? text : good[i]);
    make_modal_data(source);
  });
}

/// Meshes of solids: from their text to modes.
TEST(Fuzz, SolidMeshes) {
  const std::vector<std::string> good = {
      "PSOLID,1,1\nMAT1,1,7.+10,,.3,2700.\nGRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,1.,1.,0.\nGRID,4,,0.,1.,0.\nGRID,5,,0.,0.,1.\n"
      "GRID,6,,1.,0.,1.\nGRID,7,,1.,1.,1.\nGRID           8              0.      1.      "
      "1.\nCHEXA,1,1,1,2,3,4,5,6\n,7,8\nSPC1,1,123,1\nENDDATA\n",
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n0 7 \"base\"\n$EndPhysicalNames\n$Nodes\n8\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 "
      "1 0\n"
      "5 0 0 1\n6 1 0 1\n7 1 1 1\n8 0 1 1\n$EndNodes\n$Elements\n2\n9 15 2 7 1 1\n1 5 2 0 1 1 2 3 4 5 6 7 8\n$EndElements\n",
      "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 7 \"base\"\n$EndPhysicalNames\n$Entities\n0 0 0 1\n1 0 0 0 1 1 1 1 7 "
      "0\n$EndEntities\n"
      "$Nodes\n1 8 1 8\n3 1 0 8\n1\n2\n3\n4\n5\n6\n7\n8\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n$EndNodes\n"
      "$Elements\n1 1 1 1\n3 1 5 1\n1 1 2 3 4 5 6 7 8\n$EndElements\n"};
  const std::vector<std::string> words = {"GRID", "GRID*", "CHEXA",  "CTETRA", "+",          "*",    "$",
                                          ",",    "nan",   "1.-400", "-1",     "2147483648", "$End", "1e308"};
  const TemporaryFolder dir;
  ModalSource source;
  source.modes.count = 2;
  const auto model = [&](std::size_t i) {
    SolidModel solid{dir / (i == 0 ? "mesh.bdf" : "mesh.msh"), SolidModel::Units::si, {}, {}, Eigen::Vector3d::Zero()};
    if (i > 0) solid.material = {{70e9, 0.3, 2700.0}};
    solid.root.normal = Eigen::Vector3d::UnitX();
    return solid;
  };
  for (std::size_t i = 0; i < good.size(); ++i) {
    source.model = model(i);
    fuzz::write(model(i).mesh, good[i]);
    EXPECT_EQ(make_modal_data(source).n_modes, 2) << i;
  }
  fuzz::run("solids", [&](Random& random, const Keep& keep) {
    const std::size_t changed = random.below(good.size());
    const std::string text = fuzz::mutated(good[changed], good, words, random);
    source.model = model(changed);
    keep(model(changed).mesh + "\n" + text);
    fuzz::write(model(changed).mesh, text);
    make_modal_data(source);
  });
}

}  // namespace
}  // namespace cardan
