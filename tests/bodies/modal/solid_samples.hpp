#pragma once
// Meshes of blocks for tests: on a lattice of half steps, which every shape of element finds its nodes on.
#include <Eigen/Core>
#include <array>
#include <functional>
#include <map>
#include <vector>

#include "bodies/modal/solids.hpp"

namespace cardan::test {

using Map = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;
inline const SolidShape kSolidShapes[] = {SolidShape::tetra10, SolidShape::hexa20, SolidShape::penta15, SolidShape::hexa8};

/// The block 0 <= x, y, z <= 1 (before `map`) of n[0] x n[1] x n[2] cells: a brick, two wedges or six tetrahedra each. `straight`: corners
/// are mapped, the nodes on edges lie half-way; else all nodes are.
inline SolidMesh block(SolidShape shape, const std::array<int, 3>& n, const Map& map, const Material& material, bool straight = false) {
  SolidMesh mesh;
  mesh.materials = {material};
  std::map<std::array<int, 3>, int> index;
  const auto corner = [&](const std::array<int, 3>& at) { return map({0.5 * at[0] / n[0], 0.5 * at[1] / n[1], 0.5 * at[2] / n[2]}); };
  const auto node = [&](const std::array<int, 3>& at, const Eigen::Vector3d& x) {
    const auto [found, is_new] = index.emplace(at, static_cast<int>(mesh.nodes.size()));
    if (is_new) {
      mesh.nodes.push_back(x);
      mesh.numbers.push_back(static_cast<int>(mesh.nodes.size()));
      mesh.lines.push_back(static_cast<int>(mesh.nodes.size()));
    }
    return found->second;
  };
  std::vector<std::vector<int>> cells;  // corners of a cell, of those of the cube in the order of CHEXA
  if (shape == SolidShape::tetra10)
    cells = {{0, 1, 2, 6}, {0, 2, 3, 6}, {0, 3, 7, 6}, {0, 7, 4, 6}, {0, 4, 5, 6}, {0, 5, 1, 6}};
  else if (shape == SolidShape::penta15)
    cells = {{0, 1, 2, 4, 5, 6}, {0, 2, 3, 4, 6, 7}};
  else
    cells = {{0, 1, 2, 3, 4, 5, 6, 7}};
  constexpr std::array<std::array<int, 3>, 8> cube = {
      {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}};
  for (int i = 0; i < n[0]; ++i)
    for (int j = 0; j < n[1]; ++j)
      for (int k = 0; k < n[2]; ++k)
        for (const std::vector<int>& cell : cells) {
          SolidMesh::Element e{shape, static_cast<int>(mesh.elements.size()) + 1, static_cast<int>(mesh.elements.size()) + 1, {}, 0};
          std::vector<std::array<int, 3>> at;
          for (const int c : cell) {
            const auto& d = cube[static_cast<std::size_t>(c)];
            at.push_back({2 * (i + d[0]), 2 * (j + d[1]), 2 * (k + d[2])});
            e.nodes.push_back(node(at.back(), corner(at.back())));
          }
          for (const auto& [a, b] : edges_of(shape)) {
            const auto &p = at[static_cast<std::size_t>(a)], &q = at[static_cast<std::size_t>(b)];
            const std::array<int, 3> middle = {(p[0] + q[0]) / 2, (p[1] + q[1]) / 2, (p[2] + q[2]) / 2};
            e.nodes.push_back(node(middle, straight ? Eigen::Vector3d(0.5 * (corner(p) + corner(q))) : corner(middle)));
          }
          mesh.elements.push_back(std::move(e));
        }
  return mesh;
}

}  // namespace cardan::test
