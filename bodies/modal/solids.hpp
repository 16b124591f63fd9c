#pragma once
// Solid elements and bodies made of them (docs/mathematics/modes.md, section 1).
#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "bodies/modal/fe_model.hpp"
#include "bodies/modal/modal_source.hpp"

namespace cardan {

/// Corners first, then the nodes on the edges, in the order of NASTRAN: CTETRA of 10 nodes, CHEXA of 20 and 8, CPENTA of 15.
enum class SolidShape { tetra10, hexa20, penta15, hexa8 };
/// Where each node lies in the element's own coordinates: 3 x k.
const Eigen::Matrix3Xd& places_of(SolidShape);
/// The corners at the ends of the edge of each node beyond the corners.
const std::vector<std::pair<int, int>>& edges_of(SolidShape);
int corners_of(SolidShape);
/// The faces, by their corners, counted against the clock as seen from outside.
const std::vector<std::vector<int>>& faces_of(SolidShape);
const char* name_of(SolidShape);  ///< "tetrahedron of 10 nodes"

/// Values (k) and derivatives (k x 3) of the shape functions.
struct SolidShapes {
  Eigen::VectorXd N;
  Eigen::MatrixX3d dN;
};
SolidShapes shapes_at(SolidShape, const Eigen::Vector3d& place);

/// Of nodes at x (3 x k): stiffness [N/m], dofs 3 node + 0..2, and masses m_ij [kg] between the nodes, alike in all directions.
struct SolidMatrices {
  Eigen::MatrixXd K, m;
};
/// The least of determinants() has to be above 0.
SolidMatrices solid_matrices(SolidShape, const Eigen::Matrix3Xd& x, const Material&);
/// The least and the largest determinant of the mapping [m^3], at the nodes and the points of integration.
std::pair<double, double> determinants(SolidShape, const Eigen::Matrix3Xd& x);

/// What a file of a mesh holds, in SI.
struct SolidMesh {
  struct Element {
    SolidShape shape;
    int number = 0, line = 0;  // of the file
    std::vector<int> nodes;    // indices into `nodes`
    int material = 0;
  };
  std::string file;
  std::vector<Eigen::Vector3d> nodes;
  std::vector<int> numbers, lines;  // of the nodes, in the file
  std::vector<Element> elements;
  std::vector<Material> materials;
  std::map<std::string, std::vector<int>> groups;  // nodes by the name of their group
  std::vector<std::string> passed_over;            // what the file has and a body does not take: "SPC1 (12)"
  std::vector<std::string> weightless;             // materials without density that elements have, and how many: "MAT1 8 (12)"
};
/// Of bulk data of NASTRAN, and of *.msh of Gmsh. Throw InputError: C0102, C0321, C0323 and, of what would change the body
/// and is not taken, C0401, with the line of the file.
SolidMesh read_bulk_data(const std::string& path, SolidModel::Units, const Located& at);
SolidMesh read_gmsh(const std::string& path, SolidModel::Units, const Located& at);

/// Matrices of a mesh, with lumped masses. Refused (C0323, with the line of the file): elements that are turned inside out or folded, that
/// are there twice, parts that do not hang together, nodes of no element.
FeModel solid_mesh(const SolidMesh&, const std::vector<PointMass>&, const Located& at);
/// Reads the file and holds the root.
FeModel solid_model(const SolidModel&, const std::vector<PointMass>&, const Located& at, Warnings* warnings = nullptr);

}  // namespace cardan
