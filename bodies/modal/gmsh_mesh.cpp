// Solid elements in a mesh of Gmsh: *.msh of version 2.2 and 4.1, as text.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "bodies/modal/solids.hpp"
#include "bodies/modal/text_lines.hpp"

namespace cardan {
namespace {

struct Type {
  int number, dimension, nodes;
  const char* name;
};
constexpr std::array kTypes = {
    Type{15, 0, 1, "point"},      Type{1, 1, 2, "line"},          Type{8, 1, 3, "line"},        Type{2, 2, 3, "triangle"},
    Type{9, 2, 6, "triangle"},    Type{3, 2, 4, "quadrangle"},    Type{10, 2, 9, "quadrangle"}, Type{16, 2, 8, "quadrangle"},
    Type{4, 3, 4, "tetrahedron"}, Type{11, 3, 10, "tetrahedron"}, Type{5, 3, 8, "brick"},       Type{17, 3, 20, "brick"},
    Type{12, 3, 27, "brick"},     Type{6, 3, 6, "wedge"},         Type{18, 3, 15, "wedge"},     Type{13, 3, 18, "wedge"},
    Type{7, 3, 5, "pyramid"},     Type{14, 3, 14, "pyramid"},     Type{19, 3, 13, "pyramid"}};

using Edges = std::vector<std::pair<int, int>>;
// The edges on which Gmsh's nodes beyond the corners lie, in its order.
const Edges kTetra = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {2, 3}, {1, 3}};
const Edges kHexa = {{0, 1}, {0, 3}, {0, 4}, {1, 2}, {1, 5}, {2, 3}, {2, 6}, {3, 7}, {4, 5}, {4, 7}, {5, 6}, {6, 7}};
const Edges kPenta = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 4}, {2, 5}, {3, 4}, {3, 5}, {4, 5}};

class Mesh {
 public:
  Mesh(const std::string& path, SolidModel::Units units, const Located& at)
      : path_(path), at_(at), scale_(units == SolidModel::Units::si ? 1.0 : 1e-3), lines_(path, at, "a mesh of Gmsh, *.msh") {}

  SolidMesh read() {
    mesh_.file = path_;
    next("$MeshFormat");
    if (lines_.line() != "$MeshFormat") refuse("$MeshFormat", lines_.line());
    std::vector<double> format = numbers(3);
    if (format[1] != 0.0) refuse("a mesh as text", "a binary one", "Mesh.Binary = 0");
    if (format[0] != 2.2 && format[0] != 4.1)
      refuse("version 2.2 or 4.1", fmt::format("{:g}", format[0]), "Mesh.MshFileVersion = 4.1", Code::unsupported);
    new_ = format[0] == 4.1;
    end("MeshFormat");
    bool nodes = false;
    while (lines_.next()) {
      const std::string section = lines_.line();
      if (section.empty()) continue;
      if (section[0] != '$') refuse("a section: $...", section);
      const std::string name = section.substr(1);
      if (name == "PhysicalNames")
        names();
      else if (name == "Entities" && new_)
        entities();
      else if (name == "Nodes")
        new_ ? new_nodes() : old_nodes(), nodes = true;
      else if (name == "Elements") {
        if (!nodes) refuse("$Nodes before $Elements", section);
        new_ ? new_elements() : old_elements();
      } else if (name == "Periodic" || name == "PartitionedEntities") {
        refuse("a mesh without periodic sides and parts", section, {}, Code::unsupported);
      } else {  // results, remarks
        mesh_.passed_over.push_back(section);
        do next("$End" + name);
        while (lines_.line() != "$End" + name);
        continue;
      }
      end(name);
    }
    for (auto& [name, members] : groups_) mesh_.groups[name].assign(members.begin(), members.end());
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void refuse(std::string expected, std::string got, std::string hint = {}, Code code = Code::bad_modal_data) const {
    cardan::refuse(code, lines_.here(), std::move(expected), std::move(got), std::move(hint));
  }
  void next(const std::string& expected) {
    if (!lines_.next()) refuse(expected, "the end of the file");
  }
  void end(const std::string& name) {
    next("$End" + name);
    if (lines_.line() != "$End" + name) refuse("$End" + name, lines_.line());
  }
  /// The numbers of the next line, at least `least`.
  std::vector<double> numbers(std::size_t least) {
    next(fmt::format("{} numbers", least));
    std::vector<double> out;
    const std::string& line = lines_.line();
    const char *at = line.data(), *stop = line.data() + line.size();
    for (;;) {
      while (at != stop && (*at == ' ' || *at == '\t')) ++at;
      if (at == stop) break;
      double x = 0.0;
      const auto [end, error] = std::from_chars(at + (*at == '+'), stop, x);
      if (error != std::errc() || !std::isfinite(x) || (end != stop && *end != ' ' && *end != '\t')) refuse("numbers", line);
      out.push_back(x);
      at = end;
    }
    if (out.size() < least) refuse(fmt::format("{} numbers", least), line);
    return out;
  }
  int whole(double x, double least = 0.0) const {
    if (!(x >= least && x <= 2e9 && x == std::floor(x))) refuse(fmt::format("a whole number from {}", least), fmt::format("{:g}", x));
    return static_cast<int>(x);
  }

  void names() {
    const int count = whole(numbers(1)[0]);
    for (int i = 0; i < count; ++i) {
      next("a physical group: dimension, number, \"name\"");
      const std::string& line = lines_.line();
      const auto first = line.find('"'), last = line.rfind('"');
      int dimension = 0, number = 0;
      const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), dimension);
      if (error != std::errc() || first == std::string::npos || last <= first)
        refuse("a physical group: dimension, number, \"name\"", line);
      const auto from = line.find_first_not_of(' ', static_cast<std::size_t>(end - line.data()));
      if (from == std::string::npos || std::from_chars(line.data() + from, line.data() + first, number).ec != std::errc())
        refuse("a physical group: dimension, number, \"name\"", line);
      names_[{dimension, number}] = line.substr(first + 1, last - first - 1);
    }
  }
  /// The groups of each entity.
  void entities() {
    const std::vector<double> counts = numbers(4);
    for (int dimension = 0; dimension < 4; ++dimension)
      for (int i = whole(counts[static_cast<std::size_t>(dimension)]); i > 0; --i) {
        const std::size_t box = dimension == 0 ? 3 : 6;
        const std::vector<double> entity = numbers(2 + box);
        const int groups = whole(entity[1 + box]);
        if (entity.size() < 2 + box + static_cast<std::size_t>(groups)) refuse("the groups of an entity", lines_.line());
        for (int k = 0; k < groups; ++k)
          groups_of_[{dimension, static_cast<int>(entity[0])}].push_back(static_cast<int>(entity[2 + box + static_cast<std::size_t>(k)]));
      }
  }

  void add_node(int number, double x, double y, double z, int line) {
    if (!index_.emplace(number, static_cast<int>(mesh_.nodes.size())).second)
      refuse("a node with a number of its own", fmt::format("node {} twice", number));
    mesh_.nodes.emplace_back(scale_ * x, scale_ * y, scale_ * z);
    mesh_.numbers.push_back(number);
    mesh_.lines.push_back(line);
  }
  void old_nodes() {
    for (int i = whole(numbers(1)[0]); i > 0; --i) {
      const std::vector<double> node = numbers(4);
      add_node(whole(node[0], 1.0), node[1], node[2], node[3], lines_.here().mark.line);
    }
  }
  void new_nodes() {
    for (int block = whole(numbers(4)[0]); block > 0; --block) {
      const std::vector<double> head = numbers(4);
      std::vector<int> tags;
      for (int i = whole(head[3]); i > 0; --i) tags.push_back(whole(numbers(1)[0], 1.0));
      for (const int tag : tags) {
        const std::vector<double> x = numbers(3);
        add_node(tag, x[0], x[1], x[2], lines_.here().mark.line);
      }
    }
  }
  void old_elements() {
    for (int i = whole(numbers(1)[0]); i > 0; --i) {
      const std::vector<double> e = numbers(3);
      const int tags = whole(e[2]);
      const auto first = 3 + static_cast<std::size_t>(tags);
      if (e.size() < first) refuse("the tags of an element", lines_.line());
      const Type type = type_of(whole(e[1]));
      std::vector<int> groups;
      if (tags > 0 && e[3] != 0.0) groups.push_back(static_cast<int>(e[3]));
      add_element(type, whole(e[0], 1.0), groups, {e.begin() + static_cast<std::ptrdiff_t>(first), e.end()});
    }
  }
  void new_elements() {
    for (int block = whole(numbers(4)[0]); block > 0; --block) {
      const std::vector<double> head = numbers(4);
      const Type type = type_of(whole(head[2]));
      const std::vector<int>& groups = groups_of_[{static_cast<int>(head[0]), static_cast<int>(head[1])}];
      for (int i = whole(head[3]); i > 0; --i) {
        const std::vector<double> e = numbers(1);
        add_element(type, whole(e[0], 1.0), groups, {e.begin() + 1, e.end()});
      }
    }
  }
  Type type_of(int number) const {
    const auto type = std::ranges::find(kTypes, number, &Type::number);
    if (type == kTypes.end())
      refuse("elements of first or second order", fmt::format("type {}", number), "Mesh.ElementOrder = 2", Code::unsupported);
    return *type;
  }

  void add_element(const Type& type, int number, const std::vector<int>& groups, const std::vector<double>& tags) {
    if (static_cast<int>(tags.size()) != type.nodes)
      refuse(fmt::format("{} nodes of a {}", type.nodes, type.name), fmt::format("{} of element {}", tags.size(), number));
    std::vector<int> nodes;
    for (const double tag : tags) {
      const auto node = index_.find(whole(tag, 1.0));
      if (node == index_.end()) refuse("numbers of nodes of the file", fmt::format("node {:g} of element {}", tag, number));
      nodes.push_back(node->second);
    }
    for (const int group : groups) {
      const auto name = names_.find({type.dimension, std::abs(group)});
      auto& members = groups_[name == names_.end() ? fmt::format("{}", std::abs(group)) : name->second];
      members.insert(nodes.begin(), nodes.end());
    }
    if (type.dimension < 3) return;
    SolidMesh::Element e{SolidShape::tetra10, number, lines_.here().mark.line, nodes, 0};
    const Edges* edges = nullptr;
    if (type.number == 11) edges = &kTetra;
    if (type.number == 17) e.shape = SolidShape::hexa20, edges = &kHexa;
    if (type.number == 18) e.shape = SolidShape::penta15, edges = &kPenta;
    if (type.number == 5) e.shape = SolidShape::hexa8;
    if (!edges && type.number != 5)
      refuse("tetrahedra of 10, bricks of 20 or 8, wedges of 15 nodes",
             fmt::format("element {}, a {} of {} nodes", number, type.name, type.nodes),
             "Mesh.ElementOrder = 2, Mesh.SecondOrderIncomplete = 1", Code::unsupported);
    if (edges) {
      const auto corners = static_cast<std::size_t>(corners_of(e.shape));
      for (std::size_t k = 0; k < edges->size(); ++k) {
        const auto same = [&](const std::pair<int, int>& edge) {
          return std::minmax(edge.first, edge.second) == std::minmax((*edges)[k].first, (*edges)[k].second);
        };
        const auto& ours = edges_of(e.shape);
        e.nodes[corners + static_cast<std::size_t>(std::ranges::find_if(ours, same) - ours.begin())] = nodes[corners + k];
      }
    }
    mesh_.elements.push_back(std::move(e));
  }

  std::string path_;
  Located at_;
  double scale_;
  TextLines lines_;
  bool new_ = true;
  SolidMesh mesh_;
  std::map<int, int> index_;
  std::map<std::pair<int, int>, std::string> names_;           // dimension, number
  std::map<std::pair<int, int>, std::vector<int>> groups_of_;  // dimension, entity
  std::map<std::string, std::set<int>> groups_;
};

}  // namespace

SolidMesh read_gmsh(const std::string& path, SolidModel::Units units, const Located& at) { return Mesh(path, units, at).read(); }

}  // namespace cardan
