// Vehicles in YAML, with --set, as far as a model of them.
#include <gtest/gtest.h>

#include "bodies/register.hpp"
#include "bodies/vehicle/load_vehicle.hpp"
#include "bodies/vehicle/modal_reader.hpp"
#include "core/io/yaml_reader.hpp"
#include "core/model/model.hpp"
#include "hinges/register.hpp"
#include "plugins/devices/register.hpp"
#include "tests/fuzz/fuzz.hpp"

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

}  // namespace
}  // namespace cardan
