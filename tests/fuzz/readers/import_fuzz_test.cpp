// Robots of others, URDF and MJCF, as far as a model of their vehicles.
#include <gtest/gtest.h>

#include "bodies/register.hpp"
#include "core/io/yaml_reader.hpp"
#include "core/model/model.hpp"
#include "hinges/register.hpp"
#include "scripts/import/import.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace cardan {
namespace {

using fuzz::Keep;
using fuzz::Random;

const std::vector<std::string> kRobotWords = {"robot",
                                              "mujoco",
                                              "link",
                                              "joint",
                                              "name",
                                              "type",
                                              "parent",
                                              "child",
                                              "origin",
                                              "xyz",
                                              "rpy",
                                              "axis",
                                              "limit",
                                              "lower",
                                              "upper",
                                              "mimic",
                                              "multiplier",
                                              "offset",
                                              "inertial",
                                              "mass",
                                              "inertia",
                                              "ixx",
                                              "value",
                                              "fixed",
                                              "revolute",
                                              "continuous",
                                              "prismatic",
                                              "floating",
                                              "planar",
                                              "spherical",
                                              "loop",
                                              "coupling",
                                              "constraint",
                                              "joint_constraint",
                                              "loop_constraint",
                                              "loop_joint",
                                              "predecessor",
                                              "successor",
                                              "ratio",
                                              "gear_ratio",
                                              "position",
                                              "rolling",
                                              "body",
                                              "world",
                                              "worldbody",
                                              "default",
                                              "class",
                                              "childclass",
                                              "compiler",
                                              "angle",
                                              "radian",
                                              "degree",
                                              "eulerseq",
                                              "XYZ",
                                              "inertiafromgeom",
                                              "true",
                                              "false",
                                              "auto",
                                              "freejoint",
                                              "free",
                                              "ball",
                                              "hinge",
                                              "slide",
                                              "pos",
                                              "quat",
                                              "euler",
                                              "axisangle",
                                              "xyaxes",
                                              "zaxis",
                                              "fromto",
                                              "size",
                                              "geom",
                                              "sphere",
                                              "capsule",
                                              "box",
                                              "cylinder",
                                              "ellipsoid",
                                              "mesh",
                                              "density",
                                              "site",
                                              "equality",
                                              "connect",
                                              "weld",
                                              "joint1",
                                              "joint2",
                                              "body1",
                                              "body2",
                                              "site1",
                                              "anchor",
                                              "relpose",
                                              "polycoef",
                                              "armature",
                                              "stiffness",
                                              "springref",
                                              "ref",
                                              "damping",
                                              "frictionloss",
                                              "range",
                                              "limited",
                                              "option",
                                              "gravity",
                                              "flag",
                                              "<!--",
                                              "-->",
                                              "<![CDATA[",
                                              "]]>",
                                              "<?",
                                              "?>",
                                              "<!DOCTYPE",
                                              "&#10;",
                                              "&lt;",
                                              "&quot;",
                                              "&#0;",
                                              "/>",
                                              "</",
                                              "<a/>",
                                              "=\"\"",
                                              "nan",
                                              "inf",
                                              "1e308",
                                              "-1e308",
                                              "1e-320",
                                              "-1",
                                              "0",
                                              "0 0 0",
                                              "1 0 0",
                                              "0 0 1"};

void read_robot(const std::string& text, const ImportOptions& options, const Registry& registry) {
  const Imported imported = import_robot(text, "fuzz.xml", options);
  try {
    compile(vehicle_from_text(imported.yaml, "fuzz.yaml", registry), registry);
  } catch (const InputError& e) {
    for (const Diagnostic& d : e.diagnostics()) {
      if (d.code == Code::yaml_syntax || d.code == Code::unknown_key || d.code == Code::missing_key || d.code == Code::duplicate_key ||
          d.code == Code::bad_name || d.code == Code::unknown_body || d.code == Code::unknown_node || d.code == Code::unknown_hinge_type)
        throw std::logic_error(std::string("the vehicle is none, whatever the robot: ") + e.what() + imported.yaml);
      imported.at_its_source(d);
    }
    throw;
  }
}

TEST(Fuzz, Import) {
  std::vector<std::string> good = fuzz::sources({"tests/import/robots"}, ".urdf"), seeds = fuzz::sources({"tests/import"}, ".urdf");
  for (const std::string& more : fuzz::sources({"tests/import/robots"}, ".xml")) good.push_back(more);
  for (const std::string& more : fuzz::sources({"tests/import"}, ".xml")) seeds.push_back(more);
  Registry registry;
  register_hinges(registry);
  register_bodies(registry);
  for (const std::string& seed : good) read_robot(seed, {}, registry);
  ASSERT_GE(good.size(), 5u);
  ASSERT_GT(seeds.size(), 30u);
  fuzz::run("import", [&](Random& random, const Keep& keep) {
    const std::string text = fuzz::mutated(random.of(random.one_in(4) ? seeds : good), seeds, kRobotWords, random);
    ImportOptions options;
    if (random.one_in(4)) options.base = random.one_in(2) ? ImportOptions::Base::free : ImportOptions::Base::fixed;
    if (random.one_in(8)) options.stop_stiffness = 100.0, options.friction_width = 0.01;
    if (random.one_in(8)) options.initial = {{"q1", "0.1"}};
    if (random.one_in(8)) options.leave_out = {random.of(kRobotWords)};
    keep(text);
    read_robot(text, options, registry);
  });
}

}  // namespace
}  // namespace cardan
