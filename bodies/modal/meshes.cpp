// The meshes of modal_source.hpp: a beam, and a plate with or without a yoke.
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "bodies/modal/elements.hpp"
#include "bodies/modal/refuse.hpp"

namespace cardan {
namespace {

using Eigen::Vector3d;

constexpr int kYokeElements = 8;  // per arm
// Rounding of K grows with the fourth power of the number of elements of a beam; memory of a plate with its unknowns.
constexpr int kMostBeamElements = 4000;
constexpr double kMostUnknowns = 150'000, kBytesPerUnknown = 12e3;  // of a plate, factor and modes
constexpr double kThickPlate = 0.1, kDeepBeam = 0.1;  // thickness over the shorter side, depth over length: errors of some percent
constexpr double kSoftest = 1e5, kStiffest = 2e12,
                 kDensest = 22.6e3;   // [Pa], [Pa], [kg/m^3] foams, carbon, osmium: beyond lie typing errors
constexpr double kLeastShear = 0.02;  // shear area over area: below lie areas in m^2

std::string bytes_text(double bytes) {
  return bytes >= 1e12  ? fmt::format("{:.3g} TB", bytes / 1e12)
         : bytes >= 1e9 ? fmt::format("{:.3g} GB", bytes / 1e9)
                        : fmt::format("{:.3g} MB", bytes / 1e6);
}

/// Collects the same question for one model: is the value inside its range?
struct Checks {
  const Located& at;
  Warnings* warnings = nullptr;
  void doubt(Code code, const std::string& field, std::string about, std::string hint) const {
    if (warnings) warnings->add(code, {at.key_path + "." + field, at.mark}, std::move(about), std::move(hint));
  }
  void positive(const std::string& field, double value, const char* unit) const {
    if (!(value > 0.0) || !std::isfinite(value))
      refuse(at, field, Code::out_of_range, fmt::format("a number > 0 [{}]", unit), fmt::format("{}", value));
  }
  void at_least(const std::string& field, double value, double least) const {
    if (!(value >= least) || !std::isfinite(value))
      refuse(at, field, Code::out_of_range, fmt::format("at least {}", least), fmt::format("{}", value));
  }
  void material(const std::string& field, const Material& m) const {
    positive(field + ".E", m.E, "Pa");
    positive(field + ".rho", m.rho, "kg/m^3");
    if (!(m.nu > -1.0 && m.nu < 0.5)) refuse(at, field + ".nu", Code::out_of_range, "-1 < nu < 0.5", fmt::format("{}", m.nu));
    if (m.E < kSoftest || m.E > kStiffest)
      doubt(Code::unusual_value, field + ".E", fmt::format("E = {:g} Pa: solids have {:g} ... {:g} Pa", m.E, kSoftest, kStiffest),
            "a number without unit is in Pa: 70 GPa");
    if (m.rho > kDensest)
      doubt(Code::unusual_value, field + ".rho", fmt::format("rho = {:g} kg/m^3: nothing solid is denser than 22 600", m.rho),
            "a number without unit is in kg/m^3");
  }
  /// Without shear deformation a beam is too stiff by about (E / kappa G) (pi r / length)^2 of its first frequency squared.
  void slender(const std::string& field, const BeamSection& s, const Material& m, double length) const {
    const auto plane = [&](const char* name, double I, double shear) {
      const double r = std::sqrt(I / s.area), depth = std::sqrt(12.0) * r;
      if (shear > 0.0 || depth < kDeepBeam * length) return;
      const double part = 2.0 * (1.0 + m.nu) * 1.2 * std::pow(std::numbers::pi * r / (2.0 * length), 2);
      doubt(Code::outside_theory, field,
            fmt::format("bending in {}: the section is {:.3g} m deep (sqrt(12 I/A)) on a length of {:.3g} m, and shear is left out: the "
                        "first frequency "
                        "is too high by about {:.2g} %",
                        name, depth, length, 50.0 * part),
            "shear: true (a Timoshenko beam)");
    };
    plane("x-y", s.Iz, s.shear_y);
    plane("x-z", s.Iy, s.shear_z);
  }
  /// Thickness beside the sides of a plate: shear and rotations of the normal are left out.
  void thin(const std::string& field, double thickness, double length, double width) const {
    const double side = std::min(length, width);
    const std::string got = fmt::format("thickness {:.3g} m on sides of {:.3g} m and {:.3g} m", thickness, length, width);
    if (thickness >= side)
      refuse(at, field, Code::out_of_range, "a plate: thinner than its shorter side", got, "a block is a rigid body, or a beam");
    if (thickness > kThickPlate * side)
      doubt(Code::outside_theory, field,
            got + fmt::format(": the theory of thin plates leaves out shear, good to some percent up to {:g} of the shorter side",
                              kThickPlate),
            "results are too stiff");
  }
  void section(const std::string& field, const BeamSection& s) const {
    positive(field + ".area", s.area, "m^2");
    positive(field + ".Iy", s.Iy, "m^4");
    positive(field + ".Iz", s.Iz, "m^4");
    positive(field + ".J", s.J, "m^4");
    shear_factor(field + ".shear_y", s.shear_y);
    shear_factor(field + ".shear_z", s.shear_z);
  }
  void shear_factor(const std::string& field, double kappa) const {
    if (!(kappa >= 0.0 && kappa <= 1.0))
      refuse(at, field, Code::out_of_range, "shear area over area, 0 (without shear) to 1", fmt::format("{}", kappa),
             "a shear area in m^2 is to be divided by `area`");
    if (kappa > 0.0 && kappa < kLeastShear)
      doubt(Code::unusual_value, field,
            fmt::format("a shear factor of {:g}: solid sections have 0.83 to 0.93, thin tubes 0.5, thin webs 0.2 and more", kappa),
            "it is the shear area over `area`, not the shear area in m^2");
  }
};

/// Adds the lumped masses to the finished mesh (nodes and elements known, so the nearest node can be looked up).
FeModel with_masses(FeBuilder& builder, const std::vector<PointMass>& masses, std::vector<int> root, std::string description,
                    const Located& at) {
  for (std::size_t i = 0; i < masses.size(); ++i) {
    const std::string field = fmt::format("masses[{}]", i);
    const PointMass& m = masses[i];
    Checks{at}.positive(field + ".mass", m.mass, "kg");
    const int node = builder.mesh().find_node(m.position);
    if (node < 0)
      refuse(at, field + ".position", Code::fe_model, "a point within one element of the mesh",
             fmt::format("({}, {}, {}) m", m.position.x(), m.position.y(), m.position.z()));
    builder.add_mass(node, m.mass, m.inertia);
  }
  return builder.finish(std::move(root), std::move(description));
}

}  // namespace

std::vector<int> some_of(int n, int most) {
  std::vector<int> out;
  for (int i = 0, count = std::min(n, most); i <= count; ++i) out.push_back(static_cast<int>(std::int64_t{i} * n / count));
  return out;
}

void check_material(const Located& at, const std::string& field, const Material& material, Warnings* warnings) {
  Checks{at, warnings}.material(field, material);
}

FeModel beam_mesh(const BeamModel& beam, const std::vector<PointMass>& masses, const Located& at, Warnings* warnings) {
  const Checks check{at, warnings};
  check.positive("length", beam.length, "m");
  check.material("material", beam.material);
  check.section("section", beam.section);
  check.at_least("elements", beam.elements, 1);
  if (beam.elements > kMostBeamElements)
    refuse(at, "elements", Code::out_of_range, fmt::format("at most {}", kMostBeamElements), fmt::format("{}", beam.elements),
           "rounding errors of the stiffness grow with the fourth power of their number; 40 give the first ten modes to six digits");
  check.slender("section", beam.section, beam.material, beam.length);

  FeBuilder builder;
  for (int i = 0; i <= beam.elements; ++i) builder.add_node({beam.length * i / beam.elements, 0, 0});
  const auto inertia = beam.rotary_inertia ? SectionInertia::all : SectionInertia::torsional;
  for (int i = 0; i < beam.elements; ++i) add_beam(builder, i, i + 1, Vector3d::UnitY(), beam.material, beam.section, inertia);
  builder.add_line(some_of(beam.elements, 40));
  return with_masses(builder, masses, {0},
                     fmt::format("beam {} m, {} elements, {} dofs", beam.length, beam.elements, 6 * (beam.elements + 1)), at);
}

FeModel plate_mesh(const PlateModel& plate, const std::vector<PointMass>& masses, const Located& at, Warnings* warnings) {
  const Checks check{at, warnings};
  check.positive("length", plate.length, "m");
  check.positive("width", plate.width, "m");
  check.at_least("elements_x", plate.elements_x, 1);
  check.at_least("elements_y", plate.elements_y, 1);
  if (plate.elements_y % 2 != 0)
    refuse(at, "elements_y", Code::out_of_range, "an even number: the root is at mid-width", fmt::format("{}", plate.elements_y));
  if (const auto* solid = std::get_if<SolidPanel>(&plate.panel)) {
    check.material("panel.material", solid->material);
    check.positive("panel.thickness", solid->thickness, "m");
    check.thin("panel.thickness", solid->thickness, plate.length, plate.width);
  } else {
    const auto& sandwich = std::get<SandwichPanel>(plate.panel);
    check.material("panel.face", sandwich.face);
    check.positive("panel.face_thickness", sandwich.face_thickness, "m");
    check.at_least("panel.core_thickness", sandwich.core_thickness, 0.0);
    check.at_least("panel.core_density", sandwich.core_density, 0.0);
    check.at_least("panel.added_mass", sandwich.added_mass, 0.0);
    check.thin("panel.core_thickness", sandwich.core_thickness + 2 * sandwich.face_thickness, plate.length, plate.width);
  }
  const double unknowns = 6.0 * (plate.elements_x + 1.0) * (plate.elements_y + 1.0);
  if (unknowns > kMostUnknowns)
    refuse(at, plate.elements_x > plate.elements_y ? "elements_x" : "elements_y", Code::out_of_range,
           fmt::format("a mesh of at most {:g} unknowns (six at each node)", kMostUnknowns),
           fmt::format("{} x {} elements: {:.3g} unknowns, about {}", plate.elements_x, plate.elements_y, unknowns,
                       bytes_text(kBytesPerUnknown * unknowns)),
           "frequencies converge with the square of the element size");
  const Yoke& yoke = plate.yoke;
  check.at_least("yoke.length", yoke.length, 0.0);

  FeBuilder builder;
  const int root = yoke.length > 0 ? builder.add_node(Vector3d::Zero()) : plate.elements_y / 2;
  const PlateSection section = std::visit([&](const auto& panel) { return plate_section(panel, plate.rotary_inertia); }, plate.panel);
  const std::vector<int> edge = add_plate(builder, yoke.length, plate.length, plate.width, plate.elements_x, plate.elements_y, section);
  std::string description = fmt::format("plate {} x {} m, {} x {} elements", plate.length, plate.width, plate.elements_x, plate.elements_y);
  if (yoke.length > 0) {
    check.material("yoke.material", yoke.material);
    check.section("yoke.section", yoke.section);
    if (!(yoke.spread >= 0.0 && yoke.spread <= plate.width))
      refuse(at, "yoke.spread", Code::out_of_range, fmt::format("0 ... {} m, the width of the plate", plate.width),
             fmt::format("{} m", yoke.spread));
    const auto beam = [&](int from, int to) {
      const Vector3d y_axis = Vector3d::UnitZ().cross(builder.node(to) - builder.node(from));
      add_beam(builder, from, to, y_axis, yoke.material, yoke.section, plate.rotary_inertia ? SectionInertia::all : SectionInertia::none);
    };
    for (std::size_t i = 0; i + 1 < edge.size(); ++i) beam(edge[i], edge[i + 1]);
    const int half = plate.elements_y / 2;
    const int offset = static_cast<int>(std::lround(0.5 * yoke.spread / plate.width * plate.elements_y));
    if (offset == 0 && yoke.spread > 0.0)
      check.doubt(Code::unusual_value, "yoke.spread",
                  fmt::format("{:g} m is less than an element of the plate, {:g} m wide: both beams meet it at its middle, as one",
                              yoke.spread, plate.width / plate.elements_y),
                  "larger `elements_y`, or spread: 0");
    const auto arm = [&](int to) {
      std::vector<int> line{root};
      int from = root;
      for (int i = 1; i < kYokeElements; ++i) {
        const int next = builder.add_node(builder.node(to) * (static_cast<double>(i) / kYokeElements));
        beam(from, next);
        from = next;
        line.push_back(next);
      }
      beam(from, to);
      line.push_back(to);
      builder.add_line(std::move(line));
    };
    arm(edge[half - offset]);
    if (offset > 0) arm(edge[half + offset]);
    description += fmt::format(", yoke {} m", yoke.length);
  }
  description += fmt::format(", {} dofs", builder.mesh().n_dofs());
  return with_masses(builder, masses, yoke.length > 0 ? std::vector<int>{root} : edge, std::move(description), at);
}

}  // namespace cardan
