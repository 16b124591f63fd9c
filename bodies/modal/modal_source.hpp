#pragma once
// The one door to the modes of a flexible body: a plain description in SI, and the modal data made from it. It runs
// before compile, never in a step. Axes and origin are those of the body frame B; see docs/mathematics/modes.md.
#include <Eigen/Core>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/base/diagnostic.hpp"
#include "core/base/warnings.hpp"
#include "core/spatial/modal_data.hpp"

namespace cardan {

inline constexpr int kMostModesOfBody = 1000;  // kept, those of interfaces too; what is of pairs of them with each one takes gigabytes

struct Material {
  double E = 0.0;    // [Pa] Young's modulus, > 0
  double nu = 0.3;   // [-] Poisson's ratio, -1 < nu < 0.5; the shear modulus is E / (2 (1 + nu))
  double rho = 0.0;  // [kg/m^3] density, >= 0
};

/// A beam's cross-section; y and z are its principal axes through the centroid.
struct BeamSection {
  double area = 0.0;     // [m^2]
  double Iy = 0.0;       // [m^4] second moment for bending in the x-z plane: integral of z^2
  double Iz = 0.0;       // [m^4] second moment for bending in the x-y plane: integral of y^2
  double J = 0.0;        // [m^4] torsion constant
  double shear_y = 0.0;  // [-] shear area over area for shear along y; 0: no shear deformation (Euler-Bernoulli)
  double shear_z = 0.0;  // [-] the same along z
};
// Sizes in m. Throw InputError C0301 with the key path rectangle.width, rectangle.height, tube.radius or tube.wall.
BeamSection rectangle_section(double width_y, double height_z, bool shear = false);  // full sides; shear factor 5/6
BeamSection tube_section(double outer_radius, double wall, bool shear = false);      // round; Cowper (1966), nu = 0.3

/// Some nodes of a mesh of solids or of a table, by one of what stands here; by nothing: the node nearest to a place. Where nodes have no
/// rotations one stands for those that share an element with it.
struct NodeSet {
  std::vector<int> numbers;                          // as the file of the mesh numbers them
  std::string group;                                 // the name of a physical group of Gmsh
  double within = 0.0;                               // [m] of the place
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // of a plane through the place
  bool at_mean = false;                              // the place is the mean of the nodes'
  std::vector<std::string> names = {};               // as a table of nodes has them
  bool nearest() const { return numbers.empty() && names.empty() && group.empty() && within == 0.0 && normal.isZero(0.0); }
};

/// A mass rigidly fixed to the nearest node of the mesh, which has to lie within one element of `position`.
struct PointMass {
  double mass = 0.0;                                   // [kg]
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // [m]
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();   // [kg m^2] about the node, body axes
  NodeSet nodes = {};                                  // of nodes without rotations: what carries it
};

/// Straight beam from the origin along +x; section axes y, z are those of B.
struct BeamModel {
  double length = 0.0;  // [m]
  Material material;
  BeamSection section;
  int elements = 40;
  bool rotary_inertia = true;  // of the sections about y and z; that about x is always there
};

/// Solid plate of one isotropic material.
struct SolidPanel {
  Material material;
  double thickness = 0.0;  // [m]
};

/// Two equal face sheets on a core that carries shear only (rigidly) and adds mass.
struct SandwichPanel {
  Material face;
  double face_thickness = 0.0;  // [m] of one sheet
  double core_thickness = 0.0;  // [m] between the sheets
  double core_density = 0.0;    // [kg/m^3]
  double added_mass = 0.0;      // [kg/m^2] cells, wiring, glue, on the mid-plane
};

/// Two beams from the origin to the inner edge of a plate (at y = -spread/2 and +spread/2, x = length), and one along
/// it.
struct Yoke {
  double length = 0.0;  // [m] along x, from the origin to the plate; 0: no yoke
  double spread = 0.0;  // [m] distance of the two fixing points on the plate, at most its width
  Material material;
  BeamSection section;  // z along the plate's normal
};

/// Flat rectangular plate in the x-y plane, normal z, symmetric about the x axis: yoke.length <= x <= yoke.length +
/// length, |y| <= width / 2. Without a yoke the whole edge x = 0 is the root.
struct PlateModel {
  double length = 0.0, width = 0.0;  // [m] along x, along y
  std::variant<SolidPanel, SandwichPanel> panel;
  int elements_x = 40, elements_y = 8;
  bool rotary_inertia = true;  // of the plate and the sections of the yoke, about all axes
  Yoke yoke;
};

/// Matrices of another finite-element program, in the axes of B: docs/modal_files.md. Each node has six degrees of freedom, in the order of
/// the nodes ux, uy, uz, rx, ry, rz [m, rad], or the first three: the size of the matrices tells. Nothing is held in them.
struct MatrixModel {
  std::string nodes;                             // a table: name, x, y, z [m] of each
  std::string mass, stiffness;                   // Matrix Market: M [kg, kg m, kg m^2], K [N/m, N, N m]
  std::string damping;                           // C [N s/m, N s, N m s]; empty: damping ratios
  NodeSet root;                                  // the nodes that the body frame holds; of none given the one at the origin
  Eigen::Vector3d at = Eigen::Vector3d::Zero();  // [m] the place of `root`
  int component_modes = 0;  // rows behind those of the nodes: coordinates of modes with the nodes at rest, as of Craig and Bampton
};

/// A mesh of solid elements, of a file: docs/mathematics/modes.md, section 1. Its axes and origin are those of B.
struct SolidModel {
  enum class Units { si, mm_t_s };  // of the file: m, kg, Pa, or mm, t, MPa
  std::string mesh;                 // bulk data of NASTRAN, or *.msh of Gmsh
  Units units = Units::si;
  std::vector<Material> material;                // of all elements; empty: the file has it
  NodeSet root;                                  // what the body frame holds
  Eigen::Vector3d at = Eigen::Vector3d::Zero();  // [m] the place of `root`
};

/// Ready-made modes on lumped masses: nothing is solved and nothing chosen.
struct LumpedModel {
  std::vector<MassNode> mass_nodes;
  Eigen::MatrixXd K, C;  // m x m
  std::vector<ModalNode> nodes;
};

/// A modal file: docs/modal_files.md.
struct FileModel {
  std::string path;
};

/// A node of the result, at the mesh node nearest to `position` (within one element). "root", at the origin, is always
/// there.
struct NamedPoint {
  std::string name;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // [m]
  bool interface = false;                              // Boundary::craig_bampton: an outboard hinge attaches here
  Eigen::Matrix3d R_BN = Eigen::Matrix3d::Identity();  // node axes to body axes, undeformed
  NodeSet nodes = {};                                  // of nodes without rotations: those that move it
};

enum class Boundary {
  cantilever,     // the root is held: Phi = Psi = 0 there, so B = P
  free,           // nothing is held; the six rigid-body modes are removed (mean axes: I3 = 0, I4 = 0)
  craig_bampton,  // the root and the interface points are held, and each interface dof adds a constraint mode
};

/// Which modes are kept. All limits given apply together; at least one must be given. Constraint modes are always kept.
struct ModeChoice {
  std::optional<int> count;     // at most this many normal modes, the lowest; 0 (craig_bampton only): constraint modes alone
  double max_frequency = 0.0;   // [Hz] none above; 0: no limit
  double effective_mass = 0.0;  // of those left, in each of the six directions the largest until they reach this share
                                // (0 ... 1) of the effective mass of all computed modes (60 if no other limit is
                                // given); cantilever only; 0: all are kept
};

struct ModalSource {
  std::variant<BeamModel, PlateModel, LumpedModel, FileModel, MatrixModel, SolidModel> model;
  Boundary boundary = Boundary::cantilever;  // this and what follows: not of lumped masses and files
  ModeChoice modes;
  std::vector<double> damping = {0.005};  // [-] modal damping ratio: one for all, or one for each kept mode
  std::vector<NamedPoint> points;
  std::vector<PointMass> masses;
  Located at;  // where errors point to; field names are appended to its key path
};

/// Assembles, solves, chooses, integrates. Throws InputError: C0321 bad_modal_data, C0322 rigid_body_mode, C0323
/// fe_model; C0301 also for a mesh that is too fine. The result is a function of `source` alone, bit for bit. What is legal but doubtful
/// goes to `warnings`: W0302 (materials, damping), W0304 (plates as thick as wide, short beams), W0305 (modes left out).
ModalData make_modal_data(const ModalSource& source, Warnings* warnings = nullptr);

}  // namespace cardan
