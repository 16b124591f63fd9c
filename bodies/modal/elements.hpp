#pragma once
// Elements and the meshes made of them (docs/mathematics/modes.md, section 1).
#include <Eigen/Core>

#include "bodies/modal/fe_model.hpp"
#include "bodies/modal/modal_source.hpp"

namespace cardan {

/// Two-node beam between `from` and `to`; `y_axis` (not parallel to it) fixes the section axes: z along x cross y_axis.
enum class SectionInertia { none, torsional, all };  // about no axis, that of the beam, all
void add_beam(FeBuilder&, int from, int to, const Eigen::Vector3d& y_axis, const Material&, const BeamSection&, SectionInertia);

/// Stiffness and mass of a thin plate per unit area, symmetric about its mid-plane.
struct PlateSection {
  Eigen::Matrix3d membrane = Eigen::Matrix3d::Zero();  // [N/m]  N = A (u_x, v_y, u_y + v_x)
  Eigen::Matrix3d bending = Eigen::Matrix3d::Zero();   // [N m]  M = D (w_xx, w_yy, 2 w_xy)
  double mass = 0.0;                                   // [kg/m^2]
  double rotary = 0.0;                                 // [kg] integral of rho z^2 over the thickness
};
PlateSection plate_section(const SolidPanel&, bool rotary_inertia);
PlateSection plate_section(const SandwichPanel&, bool rotary_inertia);

/// For pictures: at most `most` + 1 of the numbers 0 ... n, evenly spread, with both ends.
std::vector<int> some_of(int n, int most);

/// Rectangle x0 <= x <= x0 + length, |y| <= width / 2, of nx by ny elements; returns the nodes of its edge x = x0, y
/// ascending.
std::vector<int> add_plate(FeBuilder&, double x0, double length, double width, int nx, int ny, const PlateSection&);

/// Refuses what is no material; doubts what is an unusual one.
void check_material(const Located& at, const std::string& field, const Material&, Warnings* warnings);

/// The models of modal_source.hpp, with lumped masses added. Throws InputError, whose key path is at.key_path and the
/// field. `warnings` may be null.
FeModel beam_mesh(const BeamModel&, const std::vector<PointMass>&, const Located& at, Warnings* warnings = nullptr);
FeModel plate_mesh(const PlateModel&, const std::vector<PointMass>&, const Located& at, Warnings* warnings = nullptr);

}  // namespace cardan
