// Bodies of solid elements: checks of a mesh, its matrices, what is held and what holds on to it.
#include "bodies/modal/solids.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numeric>

#include "bodies/modal/elements.hpp"
#include "bodies/modal/node_sets.hpp"
#include "bodies/modal/refuse.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using Triplets = std::vector<Eigen::Triplet<double>>;

constexpr std::size_t kMostSolidNodes = 50'000, kMostDrawnLines = 1000;
constexpr double kNearlyIncompressible = 0.49, kLightest = 1.0;  // [-], [kg/m^3]

Located in_file(const SolidMesh& mesh, int line, const Located& at) { return {at.key_path + ".solid.mesh", {mesh.file, line, 0}}; }

Matrix3Xd corners(const SolidMesh& mesh, const SolidMesh::Element& e) {
  Matrix3Xd x(3, static_cast<Eigen::Index>(e.nodes.size()));
  for (std::size_t i = 0; i < e.nodes.size(); ++i) x.col(static_cast<Eigen::Index>(i)) = mesh.nodes[static_cast<std::size_t>(e.nodes[i])];
  return x;
}

void expect_upright(const SolidMesh& mesh, const SolidMesh::Element& e, const Located& at) {
  const Matrix3Xd x = corners(mesh, e);
  const auto [least, most] = determinants(e.shape, x);
  if (least > 0.0) return;
  const char* expected = "an element whose mapping has a positive determinant everywhere";
  if (!(most > 0.0))
    refuse(Code::fe_model, in_file(mesh, e.line, at), expected,
           fmt::format("element {}, a {}, is turned inside out: {:.4g} to {:.4g} m^3", e.number, name_of(e.shape), least, most),
           "the corners stand in the order of a mirror image, or all in one plane");
  refuse(Code::fe_model, in_file(mesh, e.line, at), expected,
         fmt::format("element {}, a {}, is folded: {:.4g} to {:.4g} m^3", e.number, name_of(e.shape), least, most),
         corners_of(e.shape) < x.cols()
             ? "nodes in another order, or a node on an edge too far from its middle (a quarter of the edge at most)"
             : "nodes in another order, or a corner beyond the others");
}

/// No element twice, no node without one, and all in one piece.
void expect_one_body(const SolidMesh& mesh, const Located& at) {
  std::map<std::vector<int>, int> seen;
  std::vector<int> part(mesh.nodes.size());
  std::iota(part.begin(), part.end(), 0);
  const auto root = [&](int i) {
    while (part[static_cast<std::size_t>(i)] != i)
      i = part[static_cast<std::size_t>(i)] = part[static_cast<std::size_t>(part[static_cast<std::size_t>(i)])];
    return i;
  };
  std::vector<bool> used(mesh.nodes.size(), false);
  for (const SolidMesh::Element& e : mesh.elements) {
    std::vector<int> sorted = e.nodes;
    std::ranges::sort(sorted);
    if (std::ranges::adjacent_find(sorted) != sorted.end())
      refuse(Code::fe_model, in_file(mesh, e.line, at), "an element of different nodes",
             fmt::format("element {} with a node twice", e.number), "what is drawn together to a wedge is a CPENTA");
    if (const auto [other, is_new] = seen.emplace(std::move(sorted), e.number); !is_new)
      refuse(Code::fe_model, in_file(mesh, e.line, at), "each element once",
             fmt::format("element {} has the nodes of element {}", e.number, other->second), "its mass and stiffness would count twice");
    for (const int i : e.nodes) used[static_cast<std::size_t>(i)] = true, part[static_cast<std::size_t>(root(i))] = root(e.nodes[0]);
  }
  for (std::size_t i = 0; i < used.size(); ++i)
    if (!used[i])
      refuse(Code::fe_model, in_file(mesh, mesh.lines[i], at), "nodes of elements", fmt::format("node {} is of none", mesh.numbers[i]),
             "take it out; a lumped mass is one of `masses`, a point of reference one of `nodes`, with the nodes that carry it");
  for (const SolidMesh::Element& e : mesh.elements)
    if (root(e.nodes[0]) != root(mesh.elements[0].nodes[0]))
      refuse(Code::fe_model, in_file(mesh, e.line, at), "one body: elements that hang together by their nodes",
             fmt::format("no way from element {} to element {}", mesh.elements[0].number, e.number),
             "nodes at one place are to be merged; parts that are joined otherwise are bodies of their own");
}

/// Linear and quadratic elements side by side leave nodes on edges that hang on one of them alone.
void expect_one_order(const SolidMesh& mesh, const Located& at) {
  for (const SolidMesh::Element& e : mesh.elements)
    if ((e.shape == SolidShape::hexa8) != (mesh.elements[0].shape == SolidShape::hexa8))
      refuse(Code::fe_model, in_file(mesh, e.line, at), "elements of one order",
             fmt::format("element {}, a {}, beside a {}", e.number, name_of(e.shape), name_of(mesh.elements[0].shape)),
             "nodes on the edges of one would hang in the faces of the other");
}

/// The edges of the surface, the sharpest first: what a picture needs.
std::vector<std::vector<int>> outline(const SolidMesh& mesh) {
  std::map<std::vector<int>, std::pair<int, std::vector<int>>> faces;  // sorted corners -> how often, the corners in their order
  std::map<std::pair<int, int>, int> middle;
  for (const SolidMesh::Element& e : mesh.elements) {
    for (const std::vector<int>& face : faces_of(e.shape)) {
      std::vector<int> nodes;
      for (const int i : face) nodes.push_back(e.nodes[static_cast<std::size_t>(i)]);
      std::vector<int> key = nodes;
      std::ranges::sort(key);
      auto& [times, kept] = faces[key];
      ++times, kept = std::move(nodes);
    }
    const auto& edges = edges_of(e.shape);
    for (std::size_t k = 0; k < edges.size(); ++k) {
      const auto [a, b] =
          std::minmax(e.nodes[static_cast<std::size_t>(edges[k].first)], e.nodes[static_cast<std::size_t>(edges[k].second)]);
      middle[{a, b}] = e.nodes[static_cast<std::size_t>(corners_of(e.shape)) + k];
    }
  }
  std::map<std::pair<int, int>, std::vector<Vector3d>> edges;  // with the normals of its faces
  const auto node = [&](int i) -> const Vector3d& { return mesh.nodes[static_cast<std::size_t>(i)]; };
  for (const auto& [key, face] : faces) {
    const auto& [times, c] = face;
    if (times > 1) continue;
    const Vector3d normal = (node(c[1]) - node(c[0])).cross(node(c[2]) - node(c[0])).normalized();
    for (std::size_t i = 0; i < c.size(); ++i) edges[std::minmax(c[i], c[(i + 1) % c.size()])].push_back(normal);
  }
  std::vector<std::pair<double, std::vector<int>>> lines;
  for (const auto& [ends, normals] : edges) {
    const double flat = normals.size() == 2 ? normals[0].dot(normals[1]) : -1.0;
    const auto between = middle.find(ends);
    lines.push_back({flat, between == middle.end() ? std::vector<int>{ends.first, ends.second}
                                                   : std::vector<int>{ends.first, between->second, ends.second}});
  }
  std::ranges::stable_sort(lines, {}, [](const auto& line) { return line.first; });
  std::vector<std::vector<int>> out;
  for (std::size_t i = 0; i < std::min(lines.size(), kMostDrawnLines); ++i) out.push_back(std::move(lines[i].second));
  return out;
}

}  // namespace

FeModel solid_mesh(const SolidMesh& mesh, const std::vector<PointMass>& masses, const Located& at) {
  if (mesh.elements.empty()) refuse(Code::fe_model, in_file(mesh, 0, at), "solid elements", "none");
  if (mesh.nodes.size() > kMostSolidNodes)
    refuse(Code::out_of_range, in_file(mesh, 0, at), fmt::format("a mesh of at most {} nodes", kMostSolidNodes),
           fmt::format("{}", mesh.nodes.size()), "frequencies converge with the fourth power of the element size");
  expect_one_order(mesh, at);
  expect_one_body(mesh, at);
  FeModel model;
  model.per_node = 3;
  model.nodes = mesh.nodes;
  model.groups = mesh.groups;
  for (std::size_t i = 0; i < mesh.numbers.size(); ++i) model.numbers.emplace(mesh.numbers[i], static_cast<int>(i));
  const int n = static_cast<int>(mesh.nodes.size());

  Triplets K, M, between;
  for (const SolidMesh::Element& e : mesh.elements) {
    expect_upright(mesh, e, at);
    const SolidMatrices own = solid_matrices(e.shape, corners(mesh, e), mesh.materials[static_cast<std::size_t>(e.material)]);
    for (std::size_t j = 0; j < e.nodes.size(); ++j)
      for (std::size_t i = 0; i < e.nodes.size(); ++i) {
        const auto r = static_cast<Eigen::Index>(i), c = static_cast<Eigen::Index>(j);
        between.emplace_back(e.nodes[i], e.nodes[j], own.m(r, c));
        for (int b = 0; b < 3; ++b)
          for (int a = 0; a < 3; ++a) K.emplace_back(3 * e.nodes[i] + a, 3 * e.nodes[j] + b, own.K(3 * r + a, 3 * c + b));
        model.element_size =
            std::max(model.element_size,
                     (mesh.nodes[static_cast<std::size_t>(e.nodes[i])] - mesh.nodes[static_cast<std::size_t>(e.nodes[j])]).norm());
      }
  }
  const auto assemble = [](SparseMatrix& A, int rows, int cols, const Triplets& entries) {
    A.resize(rows, cols);
    A.setFromTriplets(entries.begin(), entries.end());
  };
  assemble(model.K, 3 * n, 3 * n, K);
  Triplets().swap(K);

  assemble(model.between, n, n, between);
  for (const auto& m : between)
    for (int a = 0; a < 3; ++a) M.emplace_back(3 * m.row() + a, 3 * m.col() + a, m.value());
  assemble(model.M, 3 * n, 3 * n, M);
  add_masses(model, masses, at);
  if (!(model.point_mass.sum() > 0.0))
    refuse(Code::fe_model, in_file(mesh, 0, at), "a body with mass: a material with a density, or `masses`", "neither");
  model.lines = outline(mesh);
  model.description =
      fmt::format("solids {}, {} nodes, {} elements", std::filesystem::path(mesh.file).filename().string(), n, mesh.elements.size());
  return model;
}

FeModel solid_model(const SolidModel& source, const std::vector<PointMass>& masses, const Located& at, Warnings* warnings) {
  const Located file{at.key_path + ".solid.mesh", at.mark};
  const bool gmsh = source.mesh.ends_with(".msh");
  SolidMesh mesh = gmsh ? read_gmsh(source.mesh, source.units, file) : read_bulk_data(source.mesh, source.units, file);
  if (gmsh && source.material.empty())
    refuse(at, "solid.material", Code::missing_key, "the material of the elements: a mesh of Gmsh has none", "none",
           "material: {E: 70 GPa, nu: 0.33, rho: 2700}");
  if (!gmsh && !source.material.empty())
    refuse(at, "solid.material", Code::wrong_type, "one of `material` and the materials of the file", "both", "leave `material` out");
  if (gmsh) mesh.materials = source.material;
  if (warnings && !mesh.weightless.empty())
    warnings->add(Code::unusual_value, file,
                  fmt::format("elements that weigh nothing, their material has no density: {}", fmt::join(mesh.weightless, ", ")),
                  "RHO, the fifth field of MAT1, unless their mass is among `masses`");
  std::vector<bool> used(mesh.materials.size(), false);
  for (const SolidMesh::Element& e : mesh.elements) used[static_cast<std::size_t>(e.material)] = true;
  for (std::size_t i = 0; i < mesh.materials.size(); ++i) {
    const Material& m = mesh.materials[i];
    if (!used[i] || (!gmsh && m.rho == 0.0)) continue;
    check_material(at, "solid.material", m, warnings);
    const auto doubt = [&](Code code, std::string about, std::string hint) {
      if (warnings) warnings->add(code, {at.key_path + ".solid.material", at.mark}, std::move(about), std::move(hint));
    };
    if (m.rho < kLightest)
      doubt(Code::unusual_value, fmt::format("rho = {:g} kg/m^3: lighter than air", m.rho), "a file in mm, t and MPa needs units: mm_t_s");
    if (m.nu > kNearlyIncompressible)
      doubt(Code::outside_theory, fmt::format("nu = {:g}: elements of displacements alone grow too stiff as nu nears 0.5", m.nu),
            "compare with a finer mesh");
  }
  if (warnings && !mesh.passed_over.empty()) {
    std::string list;
    for (const std::string& one : mesh.passed_over) list += (list.empty() ? "" : ", ") + one;
    warnings->add(Code::no_effect, file, fmt::format("not taken from {}: {}", std::filesystem::path(source.mesh).filename().string(), list),
                  "what is held, loads and damping are those of the vehicle file");
  }
  FeModel model = solid_mesh(mesh, masses, at);
  if (!source.root.nearest()) model.root_nodes = nodes_of(model, source.root, source.at, "solid.root", at);
  return model;
}

}  // namespace cardan
