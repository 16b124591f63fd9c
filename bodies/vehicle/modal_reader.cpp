#include "bodies/vehicle/modal_reader.hpp"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "core/model/validate.hpp"
#include "core/model/vehicle.hpp"

namespace cardan {
namespace {

using Kind = DocNode::Kind;

class ModalReader {
 public:
  explicit ModalReader(ReadContext& context) : context_(context) {}

  ModalSource read(const DocRef& modal) {
    ModalSource source;
    source.at = modal.at();
    MapReader map(modal, context_);
    const auto form = map.one({"beam", "plate", "lumped", "file", "matrices", "solid"});
    if (form) {
      const auto& [kind, value] = *form;
      if (kind == 0) source.model = read_beam(value);
      if (kind == 1) source.model = read_plate(value);
      if (kind == 2) source.model = read_lumped(value);
      if (kind == 3) source.model = read_file(value);
      if (kind == 4) source.model = read_matrices(value);
      if (kind == 5) source.model = read_solid(value);
      if (kind <= 1 || kind >= 4) read_solution(map, source);
      if (const auto* matrices = std::get_if<MatrixModel>(&source.model); matrices && !matrices->damping.empty() && map.is_map())
        if (const auto ratios = map.find("damping"))
          context_.sink.report(Code::wrong_type, ratios->at(), "one of damping and matrices.damping alone", "both");
    }
    if (form || !map.is_map()) map.finish();
    return source;
  }

 private:
  BeamModel read_beam(const DocRef& value) {
    BeamModel beam;
    MapReader map(value, context_);
    beam.length = map.number("length", "m");
    beam.material = read_material(map, "material");
    beam.section = read_section(map);
    beam.elements = map.integer("elements", 1, beam.elements);
    beam.rotary_inertia = map.flag("rotary_inertia", beam.rotary_inertia);
    map.finish();
    return beam;
  }

  PlateModel read_plate(const DocRef& value) {
    PlateModel plate;
    MapReader map(value, context_);
    plate.length = map.number("length", "m");
    plate.width = map.number("width", "m");
    if (const auto panel = map.one({"solid", "sandwich"})) {
      MapReader layers(panel->second, context_);
      if (panel->first == 0)
        plate.panel = SolidPanel{read_material(layers, "material"), layers.number("thickness", "m")};
      else
        plate.panel =
            SandwichPanel{read_material(layers, "face"), layers.number("face_thickness", "m"), layers.number("core_thickness", "m"),
                          layers.number("core_density", "kg/m^3"), layers.number("added_mass", "kg/m^2", 0.0)};
      layers.finish();
    }
    plate.elements_x = map.integer("elements_x", 1, plate.elements_x);
    plate.elements_y = map.integer("elements_y", 2, plate.elements_y);
    plate.rotary_inertia = map.flag("rotary_inertia", plate.rotary_inertia);
    if (const auto yoke = map.find("yoke")) {
      MapReader reader(*yoke, context_);
      plate.yoke.length = reader.number("length", "m");
      plate.yoke.spread = reader.number("spread", "m");
      plate.yoke.material = read_material(reader, "material");
      plate.yoke.section = read_section(reader);
      reader.finish();
    }
    map.finish();
    return plate;
  }

  Material read_material(MapReader& around, std::string_view key) {
    Material material;
    if (const auto value = around.require(key, "{E, nu, rho}")) {
      MapReader map(*value, context_);
      material.E = map.number("E", "Pa");
      material.nu = map.number("nu", "1", material.nu);
      material.rho = map.number("rho", "kg/m^3");
      map.finish();
    }
    return material;
  }

  BeamSection read_section(MapReader& around) {
    BeamSection section;
    const auto value = around.require("section", "{rectangle: ...}, {tube: ...} or {area, Iy, Iz, J}");
    if (!value) return section;
    MapReader map(*value, context_);
    const auto by_sizes = [&](const DocRef& form, const char* first, const char* second, auto make) {
      MapReader sizes(form, context_);
      const double a = sizes.number(first, "m"), b = sizes.number(second, "m");
      const bool shear = sizes.flag("shear", false);
      sizes.finish();
      if (std::isnan(a) || std::isnan(b)) return;  // told already
      try {
        section = make(a, b, shear);
      } catch (const InputError& e) {
        for (Diagnostic d : e.diagnostics()) {
          const std::string key = d.at.key_path.substr(d.at.key_path.rfind('.') + 1);
          d.at = {fmt::format("{}.{}", form.path, key), form.node->find(key) ? form.node->find(key)->mark : form.node->mark};
          context_.sink.report(std::move(d));
        }
      }
    };
    if (const auto rectangle = map.find("rectangle")) {
      by_sizes(*rectangle, "width", "height", rectangle_section);
    } else if (const auto tube = map.find("tube")) {
      by_sizes(*tube, "radius", "wall", tube_section);
    } else {
      section.area = map.number("area", "m^2");
      section.Iy = map.number("Iy", "m^4");
      section.Iz = map.number("Iz", "m^4");
      section.J = map.number("J", "m^4");
      section.shear_y = map.number("shear_y", "1", 0.0);
      section.shear_z = map.number("shear_z", "1", 0.0);
    }
    map.finish();
    return section;
  }

  FileModel read_file(const DocRef& value) { return {read_path(value, "the name of a modal file")}; }

  MatrixModel read_matrices(const DocRef& value) {
    MatrixModel matrices;
    MapReader map(value, context_);
    const auto path = [&](const char* key, const char* what, bool required) {
      const auto name = required ? map.require(key, what) : map.find(key);
      return name ? read_path(*name, what) : std::string();
    };
    matrices.nodes = path("nodes", "the name of a table of nodes: name, x, y, z", true);
    matrices.mass = path("mass", "the name of a matrix in the Matrix Market format", true);
    matrices.stiffness = path("stiffness", "the name of a matrix in the Matrix Market format", true);
    matrices.damping = path("damping", "the name of a matrix in the Matrix Market format", false);
    matrices.component_modes = map.integer("component_modes", 0, 0);
    if (const auto root = map.find("root")) {
      if (root->node->kind == Kind::map) {
        MapReader reader(*root, context_);
        matrices.root = read_nodes(reader, Nodes::of_table, matrices.at);
        reader.finish();
        if (matrices.root.nearest()) context_.sink.report(Code::missing_key, root->at(), kNodesOfTable, "none of them");
      } else {
        matrices.root.names = read_names(*root, "the nodes that the body frame holds: [name, ...]",
                                         "without the key it is the node at the origin; `boundary: free` holds none");
      }
    }
    map.finish();
    return matrices;
  }

  SolidModel read_solid(const DocRef& value) {
    SolidModel solid;
    MapReader map(value, context_);
    constexpr const char* kMesh = "the name of a mesh: bulk data of NASTRAN, or *.msh of Gmsh";
    if (const auto mesh = map.require("mesh", kMesh)) solid.mesh = read_path(*mesh, kMesh);
    static const std::vector<std::string> kUnits = {"SI", "mm_t_s"};
    if (const auto units = map.find("units")) {
      const int choice = read_choice(*units, kUnits, "units of the mesh", Code::wrong_type, context_);
      if (choice >= 0) solid.units = static_cast<SolidModel::Units>(choice);
    } else {
      map.note_default("units", kUnits[0]);
    }
    if (map.is_map() && map.find("material")) solid.material = {read_material(map, "material")};
    if (const auto root = map.find("root")) {
      MapReader reader(*root, context_);
      solid.root = read_nodes(reader, Nodes::of_mesh, solid.at);
      reader.finish();
      if (reader.is_map() && solid.root.nearest()) context_.sink.report(Code::missing_key, root->at(), kNodesOfMesh, "none of them");
    }
    map.finish();
    return solid;
  }

  static constexpr const char *kNodesOfMesh = "numbers, group, within (of position) or normal (of a plane through position)",
                              *kNodesOfTable = "names, within (of position) or normal (of a plane through position)";
  enum class Nodes { of_mesh, of_table };
  std::vector<std::string> read_names(const DocRef& value, const char* expected, const char* hint = "") {
    std::vector<std::string> names;
    for (const DocRef& name : items(value, "a list of nodes")) names.push_back(read_text(name, "the name of a node", context_));
    if (value.node->kind == Kind::list && value.node->items.empty())
      context_.sink.report(Code::wrong_type, value.at(), expected, "an empty list", hint);
    return names;
  }

  /// Which nodes of a mesh of solids or of a table, and their place.
  NodeSet read_nodes(MapReader& map, Nodes nodes, Eigen::Vector3d& position) {
    NodeSet set;
    const bool table = nodes == Nodes::of_table;
    const auto none = std::optional<DocRef>();
    const auto numbers = table ? none : map.find("numbers"), group = table ? none : map.find("group"),
               names = table ? map.find("names") : none, within = map.find("within"), normal = map.find("normal");
    if (bool(numbers) + bool(group) + bool(names) + bool(within) + bool(normal) > 1)
      context_.sink.report(Code::wrong_type, map.ref().at(), std::string("one of ") + (table ? kNodesOfTable : kNodesOfMesh), "several");
    if (names) set.names = read_names(*names, "names of nodes");
    if (numbers)
      for (const DocRef& number : items(*numbers, "a list of numbers of nodes")) set.numbers.push_back(read_integer(number, 1, context_));
    if (numbers && set.numbers.empty() && numbers->node->kind == Kind::list)
      context_.sink.report(Code::wrong_type, numbers->at(), "numbers of nodes", "an empty list");
    if (group) {
      set.group = read_text(*group, "the name of a group", context_);
      if (set.group.empty()) context_.sink.report(Code::wrong_type, group->at(), "the name of a group", "an empty text");
    }
    if (within) {
      set.within = read_number(*within, "m", context_);
      if (!(set.within > 0.0))
        context_.sink.report(Code::out_of_range, within->at(), "a number > 0 [m]", fmt::format("{:g} m", set.within));
    }
    if (normal) {
      const std::vector<double> n = read_numbers(*normal, "1", 3, context_);
      if (n.size() == 3) set.normal = {n[0], n[1], n[2]};
      if (n.size() == 3 && !(set.normal.norm() > 0.0)) context_.sink.report(Code::out_of_range, normal->at(), "a direction", "zero");
    }
    set.at_mean = (numbers || group || names) && !map.find("position");
    if (!set.at_mean) position = map.vector("position", "m");
    return set;
  }

  /// A file beside the one that names it.
  std::string read_path(const DocRef& value, std::string_view what) {
    const std::filesystem::path path = read_text(value, what, context_);
    return (std::filesystem::path(value.node->mark.file).parent_path() / path).string();
  }

  LumpedModel read_lumped(const DocRef& value) {
    LumpedModel lumped;
    MapReader map(value, context_);
    if (const auto masses = map.require("masses", "a list of {mass, position, inertia, Phi, Psi}"))
      for (const DocRef& item : items(*masses, "a list of {mass, position, inertia, Phi, Psi}")) {
        MassNode node;
        MapReader reader(item, context_);
        node.mass = reader.number("mass", "kg");
        node.position = reader.vector("position", "m");
        if (const auto inertia = reader.find("inertia")) node.inertia = read_point_inertia(*inertia, node.mass);
        read_shapes(reader, node.Phi, node.Psi);
        if (const auto Q = reader.find("Q"))
          for (const DocRef& matrix : items(*Q, "a list of 3 matrices")) node.Q.push_back(read_matrix(matrix));
        reader.finish();
        lumped.mass_nodes.push_back(std::move(node));
      }
    if (const auto K = map.require("K", "modal stiffness: a list of rows")) lumped.K = read_matrix(*K);
    if (const auto C = map.find("C"))
      lumped.C = read_matrix(*C);
    else
      lumped.C = Eigen::MatrixXd::Zero(lumped.K.rows(), lumped.K.cols());
    if (const auto nodes = map.find("nodes")) {
      MapReader names(*nodes, context_);
      for (std::size_t i = 0; i < nodes->node->keys.size(); ++i) {
        ModalNode node;
        node.name = nodes->node->keys[i].name;
        MapReader reader(nodes->item(i), context_);
        node.position = reader.vector("position", "m");
        if (const auto orientation = reader.find("orientation")) node.R_BN = read_orientation(*orientation, context_);
        read_shapes(reader, node.Phi, node.Psi);
        reader.finish();
        lumped.nodes.push_back(std::move(node));
      }
    }
    map.finish();
    return lumped;
  }

  /// About the point, where its mass centre is; zero: none.
  Eigen::Matrix3d read_point_inertia(const DocRef& value, double mass) {
    const Eigen::Matrix3d I = read_inertia(value, mass, Eigen::Vector3d::Zero(), context_);
    if (!I.allFinite()) return I;  // told already
    if (InertiaFault fault = inertia_fault(I, true); !fault.expected.empty())
      context_.sink.report(Code::unphysical_inertia, value.at(), std::move(fault.expected), std::move(fault.got), std::move(fault.hint));
    return I;
  }

  void read_shapes(MapReader& map, Eigen::MatrixXd& Phi, Eigen::MatrixXd& Psi) {
    if (const auto value = map.find("Phi")) Phi = read_matrix(*value);
    if (const auto value = map.find("Psi")) Psi = read_matrix(*value);
  }

  std::vector<DocRef> items(const DocRef& list, std::string_view expected) {
    std::vector<DocRef> out;
    if (list.node->kind == Kind::list)
      for (std::size_t i = 0; i < list.node->items.size(); ++i) out.push_back(list.item(i));
    else
      context_.sink.report(Code::wrong_type, list.at(), std::string(expected), describe(*list.node));
    return out;
  }

  /// A list of rows of equal length, SI.
  Eigen::MatrixXd read_matrix(const DocRef& value) {
    const std::vector<DocRef> rows = items(value, "a list of rows");
    Eigen::MatrixXd matrix;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const std::size_t columns = i == 0 ? 0 : static_cast<std::size_t>(matrix.cols());
      const std::vector<double> row = read_numbers(rows[i], "1", columns, context_);
      if (row.empty()) return {};
      if (i == 0) matrix.resize(static_cast<Eigen::Index>(rows.size()), static_cast<Eigen::Index>(row.size()));
      for (std::size_t j = 0; j < row.size(); ++j) matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = row[j];
    }
    return matrix;
  }

  void read_place(MapReader& map, const ModalSource& source, Eigen::Vector3d& position, NodeSet& nodes) {
    if (std::holds_alternative<SolidModel>(source.model))
      nodes = read_nodes(map, Nodes::of_mesh, position);
    else if (std::holds_alternative<MatrixModel>(source.model))
      nodes = read_nodes(map, Nodes::of_table, position);
    else
      position = map.vector("position", "m");
  }

  /// What beams and plates have in common: what is held, which modes are kept, their damping, points and masses.
  void read_solution(MapReader& map, ModalSource& source) {
    static const std::vector<std::string> kBoundaries = {"cantilever", "free", "craig_bampton"};
    if (const auto boundary = map.find("boundary")) {
      const int choice = read_choice(*boundary, kBoundaries, "what is held", Code::wrong_type, context_);
      if (choice >= 0) source.boundary = static_cast<Boundary>(choice);
    } else {
      map.note_default("boundary", kBoundaries[0]);
    }
    if (const auto modes = map.require("modes", "at least one of {count, max_frequency, effective_mass}")) {
      MapReader reader(*modes, context_);
      if (const auto count = reader.find("count")) source.modes.count = read_integer(*count, 0, context_);
      if (const auto limit = reader.find("max_frequency")) source.modes.max_frequency = read_number(*limit, "Hz", context_);
      if (const auto share = reader.find("effective_mass")) source.modes.effective_mass = read_number(*share, "1", context_);
      reader.finish();
    }
    if (const auto damping = map.find("damping"); damping && damping->node->kind == Kind::list)
      source.damping = read_numbers(*damping, "1", 0, context_);
    else
      source.damping = {map.number("damping", "1", source.damping[0])};
    if (const auto nodes = map.find("nodes")) {
      MapReader names(*nodes, context_);
      for (std::size_t i = 0; i < nodes->node->keys.size(); ++i) {
        const std::string& name = nodes->node->keys[i].name;
        MapReader reader(nodes->item(i), context_);
        source.points.push_back({.name = name});
        NamedPoint& point = source.points.back();
        read_place(reader, source, point.position, point.nodes);
        point.interface = reader.flag("interface", false);
        if (const auto orientation = reader.find("orientation")) source.points.back().R_BN = read_orientation(*orientation, context_);
        reader.finish();
      }
    }
    if (const auto masses = map.find("masses"))
      for (const DocRef& item : items(*masses, "a list of {mass, position, inertia}")) {
        MapReader reader(item, context_);
        PointMass point{.mass = reader.number("mass", "kg")};
        read_place(reader, source, point.position, point.nodes);
        if (const auto inertia = reader.find("inertia")) point.inertia = read_point_inertia(*inertia, point.mass);
        reader.finish();
        source.masses.push_back(std::move(point));
      }
  }

  ReadContext& context_;
};

}  // namespace

ModalSource read_modal_source(const DocRef& modal, ReadContext& context) { return ModalReader(context).read(modal); }

}  // namespace cardan
